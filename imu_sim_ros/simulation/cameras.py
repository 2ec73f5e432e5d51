# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""The cameras that parameters describe, on their trajectory: build, fit and load them."""

import dataclasses
from collections.abc import Iterable, Iterator, Mapping, Sequence
from typing import Any, Protocol

import numpy as np

from imu_sim_ros import rotation
from imu_sim_ros.errors import ConfigurationError
from imu_sim_ros.parameters import files
from imu_sim_ros.places.catalogue import KINDS, usual
from imu_sim_ros.sensors.camera.build import (
    aprilgrid_corners,
    build_scene,
    check_path,
    scene_span,
)
from imu_sim_ros.sensors.camera.rig import Rig
from imu_sim_ros.sensors.camera.rig_parameters import (
    DEFAULT_SCENE,
    axes,
    load_rig,
    of_rig,
    rig_problems,
)
from imu_sim_ros.sensors.camera.scene import Scene
from imu_sim_ros.sensors.camera.scene_parameters import AprilgridParameters, SceneParameters
from imu_sim_ros.sensors.camera.target import (
    _ALONG,
    _BOARD,
    _BODY,
    _DISTANCE,
    _GROWTH,
    _HORIZON,
    _MARGIN,
    _TAGS,
    _TINY,
    _TURN,
    _TURN_STEPS,
    _TURNS,
    BITS,
    COVERAGE,
    sight,
)
from imu_sim_ros.sensors.camera.view import View
from imu_sim_ros.sensors.world import World
from imu_sim_ros.simulation.engine import Body
from imu_sim_ros.simulation.parameters import (
    SimulationParameters,
    has_scene,
    load_simulation,
)
from imu_sim_ros.simulation.sensors import arms_of_seeing, mounted
from imu_sim_ros.trajectory.build import build_trajectory
from imu_sim_ros.trajectory.motion import Trajectory
from imu_sim_ros.trajectory.parameters import (
    PosesParameters,
    SeriesParameters,
    TourParameters,
    TrajectoryParameters,
)


def build_rig(parameters: Mapping[str, object]) -> Rig:
    """Return the cameras that parameters by dotted name describe, on their trajectory.

    The frames are those of ``generate`` with the same parameters.

    :param parameters: for instance ``{"cameras": ["cam0"], "camera.preset": "euroc_cam0",
        "trajectory.type": "figure_eight", "duration": 10.0, "seed": 1}``.
    :raises ConfigurationError: with a line for each problem.
    :raises InputError: for a file that cannot be used.
    """
    body = Body(load_simulation(fitted(parameters)))
    return rig_of(body.parameters, body.trajectory, body.t0_ns)


class Simulated(Protocol):
    """What the cameras need from the simulation of their body."""

    @property
    def parameters(self) -> SimulationParameters:
        """All parameters."""

    @property
    def trajectory(self) -> Trajectory:
        """The body's motion."""

    @property
    def t0_ns(self) -> int:
        """True time of sample 0 [ns]."""


def on_simulation(given: Mapping[str, object], simulation: Simulated) -> Rig:
    """Return the cameras that parameters by dotted name describe, on a simulation's body.

    :raises ConfigurationError: with a line for each problem.
    :raises InputError: for a file that cannot be used.
    """
    recorded = isinstance(simulation.parameters.trajectory, PosesParameters)
    rig = load_rig({**given, **axes(given, recorded)})
    problems = list(rig_problems(rig, simulation.parameters))
    if problems:
        raise ConfigurationError(problems)
    seen = dataclasses.replace(simulation.parameters, cameras=rig.cameras, rig=rig)
    return rig_of(seen, simulation.trajectory, simulation.t0_ns)


def rig_of(parameters: SimulationParameters, trajectory: Trajectory, t0_ns: int) -> Rig:
    """Return the cameras of a simulation, with their scene.

    :raises ConfigurationError: for a scene that does not fit the path.
    :raises InputError: for a file that cannot be used.
    """
    world = World(
        trajectory, parameters, t0_ns, lambda: scene_around(parameters, trajectory, t0_ns)
    )
    return Rig(mounted(parameters), world)


def scene_around(parameters: SimulationParameters, trajectory: Trajectory, t0_ns: int) -> Scene:
    """Return the scene of a body's sensors that see.

    :raises ConfigurationError: for a scene that does not fit the path.
    :raises InputError: for a file that cannot be used.
    """
    described: SceneParameters = parameters.rig.scene
    # A scene belongs to the trajectory, however much of it is flown.
    arms, span = arms_of_seeing(mounted(parameters)), scene_span(described, trajectory.duration)
    views = [
        View(name, one, parameters.seed, t0_ns, span) for name, one in parameters.rig.each().items()
    ]
    scene = build_scene(described, arms, views, trajectory, span)
    longest = min(parameters.duration or trajectory.duration, trajectory.duration)
    check_path(described, arms, trajectory, longest, scene)
    return scene


def fitted(given: Mapping[str, object]) -> dict[str, object]:
    """Return parameters by dotted name with the board and the motion that suit what sees.

    The trajectory ``target`` before the scene ``aprilgrid`` gets a board before the middle of the
    images, the smallest tags that have enough pixels a bit in every place, fewer of them for wide
    lenses, and turns as far as the corners need to cover the images; rigs that look in other
    directions than x stay as they are. The trajectory ``tour`` in a place goes through that place,
    which has its usual size unless told; if no scene is told, sensors see the tour's own place.
    What is given stays as it is.

    :param given: as for :func:`imu_sim_ros.simulation.cameras.build_rig`; not checked here.
    """
    given = _toured(given)
    if given.get("scene.type") != "aprilgrid" or "cameras" not in given:
        return given
    try:
        turns = _free_turns(given)
        if turns is None:
            return given
        rig = load_rig({**of_rig(given), **axes(given, recorded=False)})
        moves = load_simulation({k: v for k, v in given.items() if k.startswith("trajectory.")})
    except ConfigurationError:
        return given  # whoever loads them says what is wrong
    own = {k: getattr(rig.scene, k) for k in _BOARD if f"scene.{k}" in given}
    views = [View(name, one, 0, 0, _HORIZON) for name, one in rig.each().items()]
    best, values = -1.0, {}
    for board in _boards(views, moves.trajectory, own):
        motion, score = _turned(board, views, moves.trajectory, turns)
        if score > best:
            best, values = score, _values(board, motion, turns)
        if score >= _MARGIN:
            break
    return {**given, **values}


def _toured(given: Mapping[str, object]) -> dict[str, object]:
    """Return parameters with a tour through the place that sensors see, and that place for it."""
    kind = given.get("scene.type", DEFAULT_SCENE)
    if kind == DEFAULT_SCENE:
        kind = given.get("trajectory.place", TourParameters.place)
    if given.get("trajectory.type") != "tour" or kind not in KINDS or not has_scene(given):
        return dict(given)
    own = {
        f"trajectory.{to}": given[f"scene.{name}"]
        for name, to in (("seed", "place_seed"), ("size", "place_size"))
        if f"scene.{name}" in given
    }
    values = {"trajectory.place": kind, **own, **given}
    size = values.get("trajectory.place_size", (0.0, 0.0, 0.0))
    if values["trajectory.place"] != kind or not isinstance(size, list | tuple) or len(size) != 3:
        return dict(given)
    try:
        low, high = usual(str(kind), [float(length) for length in size])
    except (TypeError, ValueError):
        return dict(given)  # whoever loads them says what is wrong
    there = {
        "scene.size": (high - low).tolist(),
        "scene.center": (0.5 * (low + high)).tolist(),
        "scene.seed": values.get("trajectory.place_seed", 0),
    }
    return {**there, **values, "scene.type": kind}


def _free_turns(given: Mapping[str, object]) -> list[str] | None:
    """Return which angles of ``target`` have amplitudes that nobody gave; None: another motion."""
    base = files.load(files.find("trajectories", "target"))
    if given.get("trajectory.type") != "target":
        same = [k for k in base if k == "trajectory.type" or k.endswith(".angular_frequency")]
        if any(_plain(given.get(k)) != base[k] for k in same):
            return None
    names = {angle: f"trajectory.{angle}.amplitude" for angle in _TURNS}
    return [a for a, name in names.items() if _plain(given.get(name, base[name])) == base[name]]


def _plain(value: object) -> object:
    return list(value) if isinstance(value, tuple | np.ndarray) else value


def _boards(
    views: Sequence[View], motion: TrajectoryParameters, own: Mapping[str, Any]
) -> Iterator[AprilgridParameters]:
    """Yield boards upright and square to the body's x axis, most and smallest tags first.

    :param own: their parameters that are given.
    """
    centers = []
    for view in views:
        middle = 0.5 * np.array([[view.model.width - 1.0, view.model.height - 1.0]])
        ray = rotation.rotate(view.q_bc, view.model.unproject(middle).direction[0])
        centers.append(view.p_bc + ray / max(abs(ray[0]), 1e-9) * _DISTANCE)
        if abs(ray[0]) < _ALONG or np.sign(ray[0]) != np.sign(centers[0][0]):
            return
    center, side = np.mean(centers, axis=0) + _BODY, float(np.sign(centers[0][0]))
    r_wt = np.array([[0.0, 0.0, -side], [-side, 0.0, 0.0], [0.0, 1.0, 0.0]])

    def board(tags: int, size: float) -> AprilgridParameters:
        values = {"columns": tags, "rows": tags, "tag_size": size, **own}
        there = AprilgridParameters(**values)
        pitch = there.tag_size * (1.0 + there.tag_spacing)
        extent = np.array([there.columns, there.rows]) * pitch - there.tag_size * there.tag_spacing
        corner = np.round(center - 0.5 * r_wt[:, :2] @ extent, 4)
        placed = {"position": tuple(corner.tolist()), "orientation": tuple(r_wt.ravel().tolist())}
        return AprilgridParameters(**{**placed, **values})

    sizes = _GROWTH
    if "tag_size" not in own:
        trajectory = build_trajectory(motion)
        bits = min(sight(v, trajectory, aprilgrid_corners(board(1, _TINY)))[1] for v in views)
        if bits == 0.0:
            return
        sizes = tuple(round(_TINY * BITS * _MARGIN / bits * growth, 3) for growth in _GROWTH)
    yield from dict.fromkeys(board(tags, size) for tags in _TAGS for size in sizes)


def _turned(
    board: AprilgridParameters,
    views: Sequence[View],
    motion: TrajectoryParameters,
    turns: Iterable[str],
) -> tuple[TrajectoryParameters, float]:
    """Return the motion with the least turns that cover the images, and how good it is.

    1 is as good as the limits.

    :param turns: the angles that may grow.
    """
    corners = aprilgrid_corners(board)
    for _ in range(_TURN_STEPS):
        trajectory = build_trajectory(motion)
        sights = [sight(view, trajectory, corners) for view in views]
        bits = min(one.bits for one in sights) / BITS
        cover = np.min([one.coverage for one in sights], axis=0) / COVERAGE
        score = min(bits, float(cover.min()))
        short = [angle for angle in turns if cover[_TURNS[angle]] < _MARGIN]
        if not short or bits < _MARGIN:
            break
        more: dict[str, Any] = {angle: _more(getattr(motion, angle)) for angle in short}
        motion = dataclasses.replace(motion, **more)
    return motion, score


def _more(series: SeriesParameters) -> SeriesParameters:
    larger = tuple(round(_TURN * amplitude, 4) for amplitude in series.amplitude)
    return dataclasses.replace(series, amplitude=larger)


def _values(board: AprilgridParameters, motion: Any, turns: Iterable[str]) -> dict[str, object]:
    values = {f"scene.{name}": getattr(board, name) for name in _BOARD}
    for angle in turns:
        values[f"trajectory.{angle}.amplitude"] = getattr(motion, angle).amplitude
    return {k: list(v) if isinstance(v, tuple) else v for k, v in values.items()}
