# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Parameters of scene and motion that suit each other and the sensors that see."""

from collections.abc import Callable, Mapping

import numpy as np

from imu_sim_ros.core.errors import ConfigurationError
from imu_sim_ros.parameters import files
from imu_sim_ros.places.catalogue import KINDS, usual
from imu_sim_ros.sensors.camera.rig_parameters import (
    DEFAULT_SCENE,
    axes,
    load_rig,
    select_rig_parameters,
)
from imu_sim_ros.sensors.camera.target import HORIZON, TURNS, fit_board_and_motion
from imu_sim_ros.sensors.camera.view import View
from imu_sim_ros.trajectory.parameters import TourParameters, TrajectoryParameters


def fit_scene(
    parameters: Mapping[str, object],
    trajectory_of: Callable[[Mapping[str, object]], TrajectoryParameters],
) -> dict[str, object]:
    """Return parameters by dotted name with a board and a motion that suit the cameras.

    The trajectory ``target`` before the scene ``aprilgrid`` gets a board in the middle of the
    images, with the smallest tags that have enough pixels per bit everywhere, fewer of them for
    wide lenses, and turns as far as the corners need to cover the images; rigs that look in other
    directions than x are not changed. The trajectory ``tour`` in a place goes through that place,
    of its usual size unless it is stated; without a stated scene, sensors see the tour's own place.
    Stated parameters are not changed.

    :param parameters: as for :func:`imu_sim_ros.camera.build_rig`, of a body with sensors that
        see a scene; not checked here.
    :param trajectory_of: returns the trajectory that parameters by dotted name describe.
    """
    parameters = _add_tour(parameters)
    if parameters.get("scene.type") != "aprilgrid" or "cameras" not in parameters:
        return parameters
    try:
        turns = _free_turns(parameters)
        if turns is None:
            return parameters
        rig = load_rig({**select_rig_parameters(parameters), **axes(parameters, recorded=False)})
        motion = trajectory_of({k: v for k, v in parameters.items() if k.startswith("trajectory.")})
    except ConfigurationError:
        return parameters  # loading them reports it
    views = [View(name, camera, 0, 0, HORIZON) for name, camera in rig.camera_parameters().items()]
    scene_names = [key.removeprefix("scene.") for key in parameters if key.startswith("scene.")]
    return {**parameters, **fit_board_and_motion(views, motion, rig.scene, scene_names, turns)}


def _add_tour(parameters: Mapping[str, object]) -> dict[str, object]:
    """Return parameters with a tour through the place that the sensors see."""
    kind = parameters.get("scene.type", DEFAULT_SCENE)
    if kind == DEFAULT_SCENE:
        kind = parameters.get("trajectory.place", TourParameters.place)
    if parameters.get("trajectory.type") != "tour" or kind not in KINDS:
        return dict(parameters)
    tour = {
        f"trajectory.{to}": parameters[f"scene.{name}"]
        for name, to in (("seed", "place_seed"), ("size", "place_size"))
        if f"scene.{name}" in parameters
    }
    values = {"trajectory.place": kind, **tour, **parameters}
    size = values.get("trajectory.place_size", (0.0, 0.0, 0.0))
    if values["trajectory.place"] != kind or not isinstance(size, list | tuple) or len(size) != 3:
        return dict(parameters)
    try:
        low, high = usual(str(kind), [float(length) for length in size])
    except (TypeError, ValueError):
        return dict(parameters)  # loading them reports it
    scene = {
        "scene.size": (high - low).tolist(),
        "scene.center": (0.5 * (low + high)).tolist(),
        "scene.seed": values.get("trajectory.place_seed", 0),
    }
    return {**scene, **values, "scene.type": kind}


def _free_turns(parameters: Mapping[str, object]) -> list[str] | None:
    """Return the angles of ``target`` whose amplitudes are not stated; None: another motion."""
    base = files.load(files.find("trajectories", "target"))
    if parameters.get("trajectory.type") != "target":
        path_names = [k for k in base if k == "trajectory.type" or k.endswith(".angular_frequency")]
        if any(_as_list(parameters.get(k)) != base[k] for k in path_names):
            return None
    names = {angle: f"trajectory.{angle}.amplitude" for angle in TURNS}
    return [
        a for a, name in names.items() if _as_list(parameters.get(name, base[name])) == base[name]
    ]


def _as_list(value: object) -> object:
    """Return a value with a list in place of a tuple or array."""
    return list(value) if isinstance(value, tuple | np.ndarray) else value
