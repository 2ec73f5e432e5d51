# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Choice of what is read from a file: topics, frame and units of the readings."""

from dataclasses import dataclass
from typing import Final

from imu_sim_ros.core.conventions import ACCEL_UNITS, GYRO_UNITS, TRIADS


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

    @property
    def is_plain(self) -> bool:
        """True if all readings of the topic are taken in the units of the format."""
        return self == Choice(self.topic)

    @property
    def merges(self) -> bool:
        """True if the triads have topics of their own."""
        return self.gyro_topic is not None or self.accel_topic is not None

    @property
    def factors(self) -> tuple[float, float]:
        """SI values of the units of the gyroscope and of the accelerometer."""
        gyro = 1.0 if self.gyro_unit is None else GYRO_UNITS[self.gyro_unit]
        return gyro, 1.0 if self.accel_unit is None else ACCEL_UNITS[self.accel_unit]

    def notes(self) -> tuple[str, ...]:
        """Return a line for the frame, the topics of the triads and each converted unit."""
        lines = [] if self.frame is None else [f"readings of the frame {self.frame} only"]
        if self.merges:
            lines.append(
                f"gyroscope of {self.gyro_topic}, accelerometer of {self.accel_topic}, at the "
                "times of the gyroscope"
            )
        units = (self.gyro_unit, self.accel_unit)
        for triad, unit, factor in zip(TRIADS, units, self.factors, strict=True):
            if factor != 1.0:
                lines.append(f"the {triad} is read in {unit} and converted to SI units")
        return tuple(lines)


AS_RECORDED: Final = Choice()
"""The only topic and frame of a file, in the units of its format."""
