# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Choice of what is read from a file: topics, frame and units of the readings."""

from collections.abc import Mapping
from dataclasses import dataclass
from math import pi
from typing import Final

from imu_sim_ros.conventions import STANDARD_GRAVITY

GYRO_UNITS: Final[Mapping[str, float]] = {"rad/s": 1.0, "deg/s": pi / 180.0}
"""Value of each unit of the gyroscope [rad/s]."""
ACCEL_UNITS: Final[Mapping[str, float]] = {
    "m/s^2": 1.0,
    "g": STANDARD_GRAVITY,
    "mg": STANDARD_GRAVITY * 1e-3,
}
"""Value of each unit of the accelerometer [m/s^2]."""


@dataclass(frozen=True)
class Choice:
    """Topics, frame and units of the readings of a file."""

    topic: str | None = None
    """Topic of both triads; None: the only one."""
    gyro_topic: str | None = None
    """Topic of the gyroscope, if the accelerometer has another one."""
    accel_topic: str | None = None
    """Topic of the accelerometer, if the gyroscope has another one."""
    frame: str | None = None
    """Frame of the messages to read; None: the only one."""
    gyro_unit: str | None = None
    """Unit of the gyroscope, one of :data:`GYRO_UNITS`; None: that of the format."""
    accel_unit: str | None = None
    """Unit of the accelerometer, one of :data:`ACCEL_UNITS`; None: that of the format."""
