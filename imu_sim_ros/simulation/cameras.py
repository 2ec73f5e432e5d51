# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""The scene around the sensors that see."""

import numpy as np

from imu_sim_ros.sensors.camera.build import build_scene, check_path, scene_span
from imu_sim_ros.sensors.camera.declaration import cameras_in
from imu_sim_ros.sensors.camera.rig_parameters import rig_parameters_of
from imu_sim_ros.sensors.camera.scene import Scene
from imu_sim_ros.sensors.camera.view import view_of
from imu_sim_ros.sensors.world import World
from imu_sim_ros.simulation.parameters import SampledParameters
from imu_sim_ros.simulation.sensors import mount_sensors


def scene_around(world: World) -> Scene:
    """Return the scene of a body's sensors that see.

    :param world: world of the body, with the parameters of the simulation.
    :raises ConfigurationError: for a scene that does not fit the path.
    :raises InputError: for a file that cannot be used.
    """
    parameters = world.environment
    assert isinstance(parameters, SampledParameters)
    described = rig_parameters_of(parameters).scene
    sensors, trajectory = mount_sensors(parameters), world.trajectory
    # A scene belongs to the trajectory, however much of it is flown.
    span = scene_span(described, trajectory.duration)
    seeing = [sensor for sensor in sensors.values() if sensor.sensor.sees]
    arms = np.reshape([sensor.parameters.mount()[:3, 3] for sensor in seeing], (-1, 3))
    views = [view_of(sensor, world, span) for sensor in cameras_in(sensors).values()]
    scene = build_scene(described, arms, views, trajectory, span)
    longest = min(parameters.duration or trajectory.duration, trajectory.duration)
    check_path(described, arms, trajectory, longest, scene)
    return scene
