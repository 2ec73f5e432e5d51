# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Form of the readings of a sensor in folders of text, and in bags.

Sensors declare their tables; readers and writers receive them and know none by name.
"""

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import TypeAlias

from imu_sim_ros.core.gate import Quantity
from imu_sim_ros.core.types import Array, Bytes, Times

Encode: TypeAlias = Callable[[Times, Array], Bytes]
"""Encoder of stamps (n,) and values (n, m) into messages (n, size)."""


@dataclass(frozen=True)
class Table:
    """Table of the readings of one kind of sensor: a time and some numbers in each row."""

    name: str
    """Name of its files, before the number of the IMU: ``mag`` of mag0.csv."""
    title: str
    """Description of the sensor, for the head of EuRoC's sensor.yaml."""
    quantity: Quantity
    """Quantity of the numbers, with its limit."""
    headers: Mapping[str, str]
    """The first line, by form, ``euroc`` and ``csv``: a column for the time, one a number."""
    type: str
    """Type of its messages, in the form of ROS 2."""
    topic: str
    """Topic of its messages, without the namespace of one IMU among several."""
    fields: tuple[str, ...] = ()
    """The field of the message that holds the numbers and, if there is one, their covariance."""
    encoder: Callable[[str, str], Encode] | None = None
    """Makes what writes messages of a table, for a frame and an encoding."""
    of_readings: bool = False
    """True if the messages repeat the readings of the IMU, of equal stamps, with the numbers as
    their orientation."""
    truths: tuple[str, str] | None = None
    """Topics of the ideal readings, in messages of the same type, and of the true biases."""
    bias_type: str = ""
    """Type of the bias messages: that of the readings, or Vector3Stamped."""

    @property
    def columns(self) -> int:
        """Numbers in a row."""
        return self.headers["csv"].count(",")

    @property
    def is_converted(self) -> bool:
        """True if bags are converted to such tables, and back; others are only written."""
        return self.of_readings or self.encoder is not None


Tables: TypeAlias = Mapping[str, Table]
"""All tables that are known, by their names."""
