# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""The sensors on a body: one folder for each, and what all of them share.

They are listed here, each with the declaration in its folder, which says whether each IMU has it.
Engine, node, ``generate``, datasets, reports and Python go through the list and name none of them;
other packages add theirs (:mod:`imu_sim_ros.sensors.registry`).
"""

from functools import cache
from importlib import import_module
from typing import TYPE_CHECKING, Final

if TYPE_CHECKING:
    from imu_sim_ros.inputs.tables import Table
    from imu_sim_ros.sensors.declaration import Sensor, Switch

SENSORS: Final = (
    "magnetometer",
    "orientation",
    "barometer",
    "gnss",
    "wheels",
    "lidar",
)
"""The folder of each. A sensor that another one needs comes before it."""
CAMERAS: Final = (
    "names of the cameras on the body, each the namespace of its topics and the prefix of its "
    "own parameters (cam0.camera.rate, ...); none: no camera"
)
"""What the parameter ``cameras`` is."""


@cache
def declared() -> "dict[str, Sensor]":
    """Return the declarations of all sensors in the list, by name, imported when first used."""
    return {name: import_module(f"{__name__}.{name}.declaration").SENSOR for name in SENSORS}


@cache
def sensors_of_imus() -> "tuple[Sensor, ...]":
    """Return the sensors that each IMU has with it."""
    return tuple(one for one in declared().values() if one.with_imu)


@cache
def named_sensors() -> "dict[str, Sensor]":
    """Return the sensors that the parameter ``sensors`` switches on, by name."""
    return {name: one for name, one in declared().items() if not one.with_imu}


def switches() -> "dict[str, Switch]":
    """Return the options of ``generate`` that ask for files of these sensors, by sensor."""
    asked = ((name, one.companions) for name, one in named_sensors().items())
    return {name: files.switch for name, files in asked if files and files.switch}


def known_tables() -> "dict[str, Table]":
    """Return the tables of readings other than an IMU's, by name.

    They are those of all sensors of this package and of those that were registered.
    """
    from imu_sim_ros.sensors.registry import registered

    tables = (one.table for one in (*declared().values(), *registered()))
    return {table.name: table for table in tables if table is not None}
