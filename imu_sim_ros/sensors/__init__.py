# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""What the body carries: one folder a sensor, and what all of them share.

The auxiliary sensors of a board are listed here, each with the declaration in its folder. Engine,
node, ``generate``, datasets and Python go through this list and name none of them.
"""

from functools import cache
from importlib import import_module
from typing import TYPE_CHECKING, Final

if TYPE_CHECKING:
    from imu_sim_ros.sensors.declaration import Sensor

AUXILIARY: Final = ("magnetometer", "orientation", "barometer")
"""A sensor that another one needs comes before it."""


@cache
def auxiliary_sensors() -> "tuple[Sensor, ...]":
    """Return the declarations of all auxiliary sensors; they are imported when first used."""
    return tuple(
        import_module(f"imu_sim_ros.sensors.{name}.declaration").SENSOR for name in AUXILIARY
    )


def with_faults() -> dict[str, str]:
    """Return the names of the auxiliary sensors that have faults, each with what it measures."""
    return {sensor.name: sensor.quantity for sensor in auxiliary_sensors() if sensor.faults}
