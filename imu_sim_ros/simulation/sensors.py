# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""The sensors of a body by name, from the parameters of a simulation.

The only module that knows the names: ``imu`` and ``imus`` with the sensors of each,
the true pose, the sensors that ``sensors`` names, and ``cameras`` with what they see.
"""

from collections import Counter
from collections.abc import Collection, Mapping
from typing import NamedTuple

from imu_sim_ros.core.errors import ConfigurationError
from imu_sim_ros.core.types import Array
from imu_sim_ros.inputs.tables import Table
from imu_sim_ros.sensors import find_sensor, sensors_of_imus
from imu_sim_ros.sensors.declaration import Model, Mounted
from imu_sim_ros.sensors.imu import declaration as imu
from imu_sim_ros.sensors.parameters import MountedParameters
from imu_sim_ros.sensors.pose import declaration as pose
from imu_sim_ros.sensors.world import World
from imu_sim_ros.simulation.parameters import (
    SampledParameters,
    SimulationParameters,
    imus,
    segments,
)


def mount_sensors(parameters: SampledParameters) -> dict[str, Mounted[MountedParameters]]:
    """Return all sensors of a body by name; a sensor that another one needs comes before it.

    The name of a sensor is the quantity that it measures, after the name of its IMU if there are
    several: ``imu``, ``magnetic_field``, ``pose``, ``gnss``, ``left/imu``, ``left/pressure``. An
    IMU on a segment has the pose of the segment with it: ``left/pose``.
    """
    sensors: dict[str, Mounted[MountedParameters]] = {}
    on_segments = segments(parameters)
    for name, imu_parameters in imus(parameters).items():
        space = f"{name}/" if name else ""
        for sensor in (imu.SENSOR, *sensors_of_imus()):
            of_imu = Mounted(
                sensor.name,
                sensor,
                imu_parameters.imu,
                imu_parameters,
                imu_parameters.imu_frame,
                space,
            )
            sensors[space + sensor.quantity] = of_imu
        if name in on_segments:
            sensors[space + pose.NAME] = Mounted(
                pose.NAME, pose.SENSOR, imu_parameters, imu_parameters, on_segments[name], space
            )
    frame = parameters.body_frame
    sensors[pose.NAME] = Mounted(pose.NAME, pose.SENSOR, parameters, parameters, frame)
    extra_sensors: dict[str, Mounted[MountedParameters]] = {}
    cameras: dict[str, Mounted[MountedParameters]] = {}
    sections = parameters.each_sensor if isinstance(parameters, SimulationParameters) else {}
    for name, section in sections.items():
        sensor = find_sensor(section.type or name)
        space = f"{name}/" if section.type else ""
        extra_sensors[name] = Mounted(
            name, sensor, section, parameters, section.own_frame(name, frame), space
        )
    if isinstance(parameters, SimulationParameters) and parameters.cameras:
        from imu_sim_ros.sensors.camera.declaration import mount_cameras  # most runs have none

        assert parameters.rig is not None
        cameras = mount_cameras(parameters.rig, parameters)
    for listed, group in (("sensors", extra_sensors), ("cameras", cameras)):
        reserved = {
            part
            for mounted_sensor in sensors.values()
            for part in (mounted_sensor.name, *mounted_sensor.faulty)
        }
        problems = [
            f"{listed}: {name!r}: is another sensor, or what one measures"
            for name in group
            if name in reserved or name in sensors
        ]
        if problems:
            raise ConfigurationError(problems)
        sensors |= group
    return sensors


def imus_in(sensors: Mapping[str, Mounted[MountedParameters]]) -> list[str]:
    """Return the names of the IMUs among the sensors."""
    return [name for name, sensor in sensors.items() if sensor.sensor is imu.SENSOR]


def models(
    sensors: Mapping[str, Mounted[MountedParameters]], names: Collection[str], t0_ns: int
) -> dict[str, Model]:
    """Return the models of the IMUs, of the named sensors and of those that these need, by name.

    :param names: names of sensors that are read in addition to the IMUs.
    :param t0_ns: time of the first sample [ns].
    """
    needed = {*imus_in(sensors), *names}
    for name in names:
        mounted_sensor = sensors[name]
        needed |= {
            mounted_sensor.space + quantity
            for quantity in mounted_sensor.sensor.needs(mounted_sensor.parameters)
        }
    models: dict[str, Model] = {}
    for name, mounted_sensor in sensors.items():
        if name in needed:
            sensors_of_namespace = {
                n.removeprefix(mounted_sensor.space): m
                for n, m in models.items()
                if n.startswith(mounted_sensor.space)
            }
            models[name] = mounted_sensor.sensor.model(mounted_sensor, t0_ns, sensors_of_namespace)
    return models


def sensor_warnings(
    mounted: Mounted[MountedParameters], world: World, duration: float
) -> list[str]:
    """Return a line for each way in which a world or a motion is not for a sensor.

    :param duration: length of the motion [s]; may be infinite.
    :raises ConfigurationError: if the sensor cannot read there at all.
    """
    lines = mounted.sensor.warnings(mounted, world, duration)
    if mounted.sensor.sees:
        from imu_sim_ros.sensors.camera.surroundings import scene_warnings  # most runs have none

        lines += scene_warnings(mounted, world, duration)
    return lines


def mounts(sensors: Mapping[str, Mounted[MountedParameters]]) -> dict[tuple[str, str], Array]:
    """Return the poses T_bf (4, 4) of frames f on bodies b; they map coordinates in f to b.

    A sensor in the body's own frame has none.

    :returns: poses by the names of body and frame.
    """
    poses: dict[tuple[str, str], Array] = {}
    for mounted_sensor in sensors.values():
        body_frame, frame = mounted_sensor.environment.body_frame, mounted_sensor.frame
        if frame != body_frame:
            poses.setdefault((body_frame, frame), mounted_sensor.parameters.mount())
    return poses


class InTable(NamedTuple):
    """A sensor with its table in a dataset."""

    table: Table
    number: int
    """Index of its IMU among the IMUs, or of the sensor among those of its kind."""
    name: str
    """Name of the sensor among those of the body."""
    mounted: Mounted[MountedParameters]


def all_tables(sensors: Mapping[str, Mounted[MountedParameters]]) -> list[InTable]:
    """Return the tables of the sensors that have one of their own in a dataset."""
    numbers: Counter[str] = Counter()
    tables = []
    for name, mounted_sensor in sensors.items():
        table = mounted_sensor.sensor.table
        if table is not None:
            tables.append(InTable(table, numbers[table.name], name, mounted_sensor))
            numbers[table.name] += 1
    return tables
