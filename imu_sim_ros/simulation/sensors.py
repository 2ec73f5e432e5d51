# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""The sensors of a body by name, from the parameters that users give.

The one place that knows what stands where: ``imu`` and ``imus`` with the sensors of each,
the true pose, and the sensors that ``sensors`` names.
"""

from collections.abc import Collection, Mapping

import numpy as np

from imu_sim_ros.sensors import sensors_of_imus
from imu_sim_ros.sensors.declaration import Model, Mounted
from imu_sim_ros.sensors.imu import declaration as imu
from imu_sim_ros.sensors.pose import declaration as pose
from imu_sim_ros.sensors.registry import find_sensor
from imu_sim_ros.simulation.parameters import SampledParameters, imus
from imu_sim_ros.types import Array


def mounted(parameters: SampledParameters) -> dict[str, Mounted]:
    """Return all sensors of a body by name; a sensor that another one needs comes before it.

    What they measure is their name, behind that of the IMU if there are several: ``imu``,
    ``magnetic_field``, ``pose``, ``gnss``, ``left/imu``, ``left/pressure``.
    """
    found: dict[str, Mounted] = {}
    for name, one in imus(parameters).items():
        space = f"{name}/" if name else ""
        for sensor in (imu.SENSOR, *sensors_of_imus()):
            of_imu = Mounted(sensor.name, sensor, one.imu, one, one, one.imu_frame, space)
            found[space + sensor.quantity] = of_imu
    frame = parameters.body_frame
    found[pose.NAME] = Mounted(pose.NAME, pose.SENSOR, parameters, parameters, parameters, frame)
    for name, own in getattr(parameters, "each_sensor", {}).items():
        sensor = find_sensor(own.type or name)
        space = f"{name}/" if own.type else ""
        found[name] = Mounted(name, sensor, own, parameters, own, own.own_frame(name, frame), space)
    return found


def arms_of_seeing(sensors: Mapping[str, Mounted]) -> Array:
    """Return the positions (k, 3) in the body of all sensors that see or range [m]."""
    arms = [one.own.lever_arm for one in sensors.values() if one.sensor.sees]
    return np.reshape(arms, (-1, 3))


def imus_in(sensors: Mapping[str, Mounted]) -> list[str]:
    """Return the names of the IMUs among the sensors."""
    return [name for name, one in sensors.items() if one.sensor is imu.SENSOR]


def models(sensors: Mapping[str, Mounted], wanted: Collection[str], t0_ns: int) -> dict[str, Model]:
    """Return the IMUs, the wanted sensors and those that these need, at their start.

    :param t0_ns: time of the start [ns].
    """
    needed = {*imus_in(sensors), *wanted}
    for name in wanted:
        one = sensors[name]
        needed |= {one.space + quantity for quantity in one.sensor.needs(one.own)}
    made: dict[str, Model] = {}
    for name, one in sensors.items():
        if name in needed:
            before = {
                n.removeprefix(one.space): m for n, m in made.items() if n.startswith(one.space)
            }
            made[name] = one.sensor.model(one, t0_ns, before)
    return made


def mount(one: Mounted) -> Array:
    """Return the pose T_bs (4, 4) of a sensor, which maps its coordinates to the body."""
    pose_bs = np.eye(4)
    pose_bs[:3, :3] = np.reshape(getattr(one.own, "mounting", np.eye(3)), (3, 3))
    pose_bs[:3, 3] = getattr(one.own, "lever_arm", 0.0)
    return pose_bs


def mounts(sensors: Mapping[str, Mounted]) -> dict[str, Array]:
    """Return the poses T_bf (4, 4) of frames on the body; one maps coordinates in f to the body.

    What coincides with the body's own frame needs none.
    """
    placed: dict[str, Array] = {}
    for one in sensors.values():
        placed.setdefault(one.frame, mount(one))
    placed.pop(sensors[pose.NAME].frame)
    return placed
