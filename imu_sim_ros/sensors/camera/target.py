# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""AprilGrids: how cameras see their tags, and the board and motion that suit a lens."""

import dataclasses
from collections.abc import Collection, Iterable, Iterator, Sequence
from typing import Final, NamedTuple

import numpy as np

from imu_sim_ros.core import rotation
from imu_sim_ros.core.types import Array, Keywords, field_values
from imu_sim_ros.sensors.camera.build import aprilgrid_corners
from imu_sim_ros.sensors.camera.scene_parameters import AprilgridParameters, SceneParameters
from imu_sim_ros.sensors.camera.view import View
from imu_sim_ros.trajectory.build import build_trajectory
from imu_sim_ros.trajectory.motion import Trajectory
from imu_sim_ros.trajectory.parameters import SeriesParameters, TrajectoryParameters

COVERAGE: Final = 0.8
"""Share of an image's width and height that the tags' corners should cover over a flight."""
BITS: Final = 4.0
"""Pixels that a bit of a tag in view should have."""
_TAG: Final = 10
"""Bits along the edge of a tag: six of data, two of border on either side."""
_MARGIN: Final = 1.03
"""Factor by which a fitted board and motion exceed these limits."""
HORIZON: Final = 60.0
"""Length of a motion that is evaluated [s]."""
_LOOKS: Final = 300
"""Moments of it that are looked at."""
_BODY: Final = (0.0, 0.0, 1.0)
"""Mean position of the body of config/trajectories/target.yaml [m]."""
_DISTANCE: Final = 1.35
"""Distance from the body to the board along x [m]; the tags' size follows from the lens only."""
_ALONG: Final = 0.9
"""Least cosine of the angle between a view and the body's x axis for which a board is fitted."""
TURNS: Final = {"yaw": 0, "pitch": 1}
"""Angles whose amplitudes follow from the lens, and whether they cover its width or height."""
_TURN: Final = 1.15
"""Step of their amplitudes, and how often it is taken at most."""
_TURN_STEPS: Final = 10
_TAGS: Final = (6, 5, 4, 3)
"""Tags along a side, kalibr's 6 first; it takes no fewer than 3."""
_TINY: Final = 0.01
"""Size of a tag that is in view as a whole wherever its middle is [m]."""
_BOARD: Final = ("columns", "rows", "tag_size", "tag_spacing", "position", "orientation")
_GROWTH: Final = tuple(1.08**k for k in range(8))
"""Sizes of tags that are tried: at the ends of a large board they are seen aslant, and a fisheye
bends their edges, which detectors take for straight."""


class Sight(NamedTuple):
    """Size, number and coverage of the tags in a camera's view over a flight."""

    coverage: tuple[float, float]
    """Shares of the image's width and height between the outermost corners in view."""
    bits: float
    """Pixels of a bit at the shortest edge of any tag in view."""
    tags: int
    """Fewest tags in view at a time."""


def sight(view: View, trajectory: Trajectory, corners: Array) -> Sight:
    """Return how a camera sees tags.

    :param corners: (4 n, 3) of all tags, in order around each [m].
    """
    t = np.linspace(0.0, min(trajectory.duration, HORIZON), _LOOKS)
    poses = view.poses(trajectory, t)
    local = rotation.rotate_inverse(poses.q_wc[:, None], corners - poses.position[:, None])
    uv, visible = view.model.project(local.reshape(-1, 3))
    visible &= view.model.inside(uv)
    tags = visible.reshape(_LOOKS, -1, 4).all(axis=2)
    if not tags.any():
        return Sight((0.0, 0.0), 0.0, 0)
    width, height = np.ptp(uv[visible], axis=0) / (view.model.width, view.model.height)
    tag_corners = uv.reshape(*tags.shape, 4, 2)[tags]
    edges = np.linalg.norm(np.roll(tag_corners, -1, axis=1) - tag_corners, axis=2)
    return Sight((float(width), float(height)), float(edges.min()) / _TAG, int(tags.sum(1).min()))


def target_warning(parameters: SceneParameters, view: View, trajectory: Trajectory) -> list[str]:
    """Return a line if a camera sees too little of an AprilGrid, or too small tags."""
    if not isinstance(parameters, AprilgridParameters):
        return []
    (width, height), bits, _ = sight(view, trajectory, aprilgrid_corners(parameters))
    if bits == 0.0:
        return [
            "no tag of the AprilGrid comes into view as a whole; camera.body_axes = "
            f"{view.parameters.body_axes}, scene.position and scene.orientation say where it is"
        ]
    if bits >= BITS and min(width, height) >= COVERAGE:
        return []
    return [
        f"a bit of the AprilGrid's tags has {bits:.1f} px at the least ({BITS:g} are wanted), "
        f"their corners cover {width:.0%} of the image's width and {height:.0%} of its height "
        f"({COVERAGE:.0%} are wanted)"
    ]


def fit_board_and_motion(
    views: Sequence[View],
    motion: TrajectoryParameters,
    scene: SceneParameters,
    fixed: Collection[str],
    turns: Collection[str],
) -> dict[str, object]:
    """Return the parameters of the board and the motion that suit lenses, by dotted name.

    Nothing for views in other directions than the body's x axis.

    :param motion: motion of config/trajectories/target.yaml, with explicit parameters applied.
    :param fixed: names of the board's parameters that stay as they are in the scene.
    :param turns: the angles of the motion that may grow.
    """
    scene_values = field_values(scene)
    board_settings = {name: scene_values[name] for name in _BOARD if name in fixed}
    best, values = -1.0, dict[str, object]()
    for board in _boards(views, motion, board_settings):
        turned, score = _fewest_turns(board, views, motion, turns)
        if score > best:
            best, values = score, _values(board, turned, turns)
        if score >= _MARGIN:
            break
    return values


def _boards(
    views: Sequence[View], motion: TrajectoryParameters, settings: Keywords
) -> Iterator[AprilgridParameters]:
    """Yield boards upright and square to the body's x axis, most and smallest tags first.

    None if the views look in other directions than x, or in opposite ones.

    :param settings: parameters of the board that stay as they are.
    """
    board_pose = _board_pose(views)
    if board_pose is None:
        return
    sizes = _GROWTH  # not used if the tags' size is one of the settings
    if "tag_size" not in settings:
        # Bits of a tiny tag in the middle tell the size of those with enough pixels per bit.
        trajectory = build_trajectory(motion)
        corners = aprilgrid_corners(_board(*board_pose, 1, _TINY, settings))
        bits = min(sight(view, trajectory, corners).bits for view in views)
        if bits == 0.0:
            return
        sizes = tuple(round(_TINY * BITS * _MARGIN / bits * growth, 3) for growth in _GROWTH)
    boards = (_board(*board_pose, tags, size, settings) for tags in _TAGS for size in sizes)
    yield from dict.fromkeys(boards)  # without repetitions


def _board_pose(views: Sequence[View]) -> tuple[Array, Array] | None:
    """Return the center (3,) of a board in the world [m] and its rotation R_wt (3, 3).

    It is on the mean of the views' axes and faces the body. None if a view looks in another
    direction than the others, or than the body's x axis, forwards or backwards.
    """
    centers = []
    for view in views:
        middle = 0.5 * np.array([[view.model.width - 1.0, view.model.height - 1.0]])
        ray = rotation.rotate(view.q_bc, view.model.unproject(middle).direction[0])
        centers.append(view.p_bc + ray / max(abs(ray[0]), 1e-9) * _DISTANCE)
        if abs(ray[0]) < _ALONG or np.sign(ray[0]) != np.sign(centers[0][0]):
            return None
    side = float(np.sign(centers[0][0]))
    r_wt = np.array([[0.0, 0.0, -side], [-side, 0.0, 0.0], [0.0, 1.0, 0.0]])
    return np.asarray(np.mean(centers, axis=0) + _BODY), r_wt


def _board(
    center: Array, r_wt: Array, tags: int, size: float, settings: Keywords
) -> AprilgridParameters:
    """Return a board around a center [m].

    :param tags: tags along a side; ``size`` of a tag [m]; ``settings`` count before both.
    """
    values = {"columns": tags, "rows": tags, "tag_size": size, **settings}
    board = AprilgridParameters(**values)
    pitch = board.tag_size * (1.0 + board.tag_spacing)
    # Between the outer edges: there is no gap behind the last tag.
    extent = np.array([board.columns, board.rows]) * pitch - board.tag_size * board.tag_spacing
    corner = np.round(center - 0.5 * r_wt[:, :2] @ extent, 4)
    pose = {"position": tuple(corner.tolist()), "orientation": tuple(r_wt.ravel().tolist())}
    return AprilgridParameters(**{**pose, **values})


def _fewest_turns(
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
        bits = min(sighting.bits for sighting in sights) / BITS
        cover = np.min([sighting.coverage for sighting in sights], axis=0) / COVERAGE
        score = min(bits, float(cover.min()))
        short = [angle for angle in turns if cover[TURNS[angle]] < _MARGIN]
        if not short or bits < _MARGIN:
            break
        series = field_values(motion)
        changes: Keywords = {angle: _larger(series[angle]) for angle in short}
        motion = dataclasses.replace(motion, **changes)
    return motion, score


def _larger(series: SeriesParameters) -> SeriesParameters:
    """Return a series with larger amplitudes."""
    larger = tuple(round(_TURN * amplitude, 4) for amplitude in series.amplitude)
    return dataclasses.replace(series, amplitude=larger)


def _values(
    board: AprilgridParameters, motion: TrajectoryParameters, turns: Iterable[str]
) -> dict[str, object]:
    """Return the parameters of a motion in front of a board."""
    board_values, series = field_values(board), field_values(motion)
    values = {f"scene.{name}": board_values[name] for name in _BOARD}
    for angle in turns:
        values[f"trajectory.{angle}.amplitude"] = series[angle].amplitude
    return {k: list(v) if isinstance(v, tuple) else v for k, v in values.items()}
