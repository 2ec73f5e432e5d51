# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""The sensors on a body: one folder for each, and what all of them share.

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

OF_IMUS: Final = ("magnetometer", "orientation", "barometer")
"""Each IMU has them with it: ``imu.NAME_...``. A sensor that another one needs comes before it."""
NAMED: Final[tuple[str, ...]] = ("gnss", "wheels", "lidar")
"""The parameter ``sensors`` switches them on: ``NAME.*``."""
CAMERAS: Final = (
    "names of the cameras on the body, each the namespace of its topics and the prefix of its "
    "own parameters (cam0.camera.rate, ...); none: no camera"
)
"""What the parameter ``cameras`` is."""


@cache
def sensors_of_imus() -> "tuple[Sensor, ...]":
    """Return the declarations of all sensors of IMUs; they are imported when first used."""
    return tuple(
        import_module(f"imu_sim_ros.sensors.{name}.declaration").SENSOR for name in OF_IMUS
    )


@cache
def sections_of_imus() -> dict[str, type]:
    """Return the parameters of all sensors of IMUs by name."""
    return {
        name: import_module(f"imu_sim_ros.sensors.{name}.parameters").SECTION for name in OF_IMUS
    }


def known_tables() -> "dict[str, Table]":
    """Return the tables of readings other than an IMU's, by name.

    They are those of all sensors of this package and of those that were registered.
    """
    from imu_sim_ros.sensors.registry import registered

    named = [import_module(f"imu_sim_ros.sensors.{name}.declaration").SENSOR for name in NAMED]
    tables = (one.table for one in (*sensors_of_imus(), *named, *registered()))
    return {table.name: table for table in tables if table is not None}
