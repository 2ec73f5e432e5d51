# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""The sensors of a body by name, from the parameters that users give.

The one place that knows what stands where: ``imu`` and ``imus`` with the sensors of each,
the true pose, the sensors that ``sensors`` names, and ``cameras`` with what they see.
"""

from collections import Counter
from collections.abc import Collection, Mapping
from typing import NamedTuple

from imu_sim_ros.errors import ConfigurationError
from imu_sim_ros.inputs.tables import Table
from imu_sim_ros.sensors import find_sensor, sensors_of_imus
from imu_sim_ros.sensors.declaration import Model, Mounted
from imu_sim_ros.sensors.imu import declaration as imu
from imu_sim_ros.sensors.pose import declaration as pose
from imu_sim_ros.sensors.world import World
from imu_sim_ros.simulation.parameters import SampledParameters, SimulationParameters, imus
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
            of_imu = Mounted(sensor.name, sensor, one.imu, one, one.imu_frame, space)
            found[space + sensor.quantity] = of_imu
    frame = parameters.body_frame
    found[pose.NAME] = Mounted(pose.NAME, pose.SENSOR, parameters, parameters, frame)
    named, seen = dict[str, Mounted](), dict[str, Mounted]()
    for name, own in getattr(parameters, "each_sensor", {}).items():
        sensor = find_sensor(own.type or name)
        space = f"{name}/" if own.type else ""
        named[name] = Mounted(name, sensor, own, parameters, own.own_frame(name, frame), space)
    if isinstance(parameters, SimulationParameters) and parameters.cameras:
        from imu_sim_ros.sensors.camera.declaration import seeing  # most runs have none

        seen = seeing(parameters.rig, parameters)
    for listed, group in (("sensors", named), ("cameras", seen)):
        known = {part for one in found.values() for part in (one.name, *one.sensor.parts)}
        taken = [
            f"{listed}: {name!r}: is another sensor, or what one measures"
            for name in group
            if name in known or name in found
        ]
        if taken:
            raise ConfigurationError(taken)
        found |= group
    return found


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


def sensor_warnings(mounted: Mounted, world: World, duration: float) -> list[str]:
    """Return a line for each way in which a world or a motion is not for a sensor.

    :param duration: length of the motion [s]; may be infinite.
    :raises ConfigurationError: if the sensor cannot read there at all.
    """
    lines = mounted.sensor.warnings(mounted, world, duration)
    if mounted.sensor.sees:
        from imu_sim_ros.sensors.camera.surroundings import scene_warnings  # most runs have none

        lines += scene_warnings(mounted, world, duration)
    return lines


def mounts(sensors: Mapping[str, Mounted]) -> dict[str, Array]:
    """Return the poses T_bf (4, 4) of frames on the body; one maps coordinates in f to the body.

    What coincides with the body's own frame needs none.
    """
    found: dict[str, Array] = {}
    for one in sensors.values():
        found.setdefault(one.frame, one.sensor.mount(one.own))
    found.pop(sensors[pose.NAME].frame)
    return found


class InTable(NamedTuple):
    """The rows of a sensor in a dataset."""

    table: Table
    number: int
    """Of its IMU among the IMUs, or among the sensors of its kind."""
    name: str
    mounted: Mounted


def all_tables(sensors: Mapping[str, Mounted]) -> list[InTable]:
    """Return the tables of the sensors that have one of their own in a dataset."""
    numbers: Counter[str] = Counter()
    found = []
    for name, one in sensors.items():
        table = one.sensor.table
        if table is not None:
            found.append(InTable(table, numbers[table.name], name, one))
            numbers[table.name] += 1
    return found
