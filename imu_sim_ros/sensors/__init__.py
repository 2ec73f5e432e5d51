# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""What the body carries: one folder a sensor, and what all of them share.

The sensors are listed here, each with the declaration in its folder. Engine, node, ``generate``,
datasets, reports and Python go through these lists and name none of them; other packages add theirs
(:mod:`imu_sim_ros.sensors.registry`).
"""

from functools import cache
from importlib import import_module
from typing import TYPE_CHECKING, Final

if TYPE_CHECKING:
    from imu_sim_ros.inputs.tables import Table
    from imu_sim_ros.sensors.declaration import Sensor

AUXILIARY: Final = ("magnetometer", "orientation", "barometer")
"""On the board of each IMU. A sensor that another one needs comes before it."""
CARRIED: Final[tuple[str, ...]] = ("gnss", "wheels")
"""Sensors of the body, which the parameter ``sensors`` switches on."""


@cache
def auxiliary_sensors() -> "tuple[Sensor, ...]":
    """Return the declarations of all auxiliary sensors; they are imported when first used."""
    return tuple(
        import_module(f"imu_sim_ros.sensors.{name}.declaration").SENSOR for name in AUXILIARY
    )


@cache
def auxiliary_sections() -> dict[str, type]:
    """Return the parameters of all auxiliary sensors by name."""
    return {
        name: import_module(f"imu_sim_ros.sensors.{name}.parameters").SECTION for name in AUXILIARY
    }


def with_faults() -> dict[str, str]:
    """Return the names of the sensors that have faults, each with what it measures.

    Those of the body are among them once they are in use.
    """
    from imu_sim_ros.sensors.registry import in_use

    known = (*auxiliary_sensors(), *in_use())
    return {sensor.name: sensor.quantity for sensor in known if sensor.faults}


def known_tables() -> "dict[str, Table]":
    """Return the tables of readings other than an IMU's, by name.

    They are those of all sensors of this package and of those that were registered.
    """
    from imu_sim_ros.sensors.registry import in_use

    carried = [import_module(f"imu_sim_ros.sensors.{name}.declaration").SENSOR for name in CARRIED]
    tables = (one.table for one in (*auxiliary_sensors(), *carried, *in_use()))
    return {table.name: table for table in tables if table is not None}
