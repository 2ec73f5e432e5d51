# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""What a simulated board reads beside its IMU, as arrays."""

from __future__ import annotations

from collections.abc import Collection, Sequence
from dataclasses import dataclass, fields
from typing import Any, TypeVar

import numpy as np
from numpy.typing import NDArray

from imu_sim_ros.api.readings import span
from imu_sim_ros.arguments import words
from imu_sim_ros.conventions import BESIDE
from imu_sim_ros.errors import ConfigurationError
from imu_sim_ros.names import suggestion
from imu_sim_ros.sensor import ImuBlock

Array = NDArray[np.float64]
Times = NDArray[np.int64]
_Any = TypeVar("_Any", "MagneticReadings", "PressureReadings", "Orientations")


class _Readings:
    """n readings with stamps."""

    t_ns: Times

    def __len__(self) -> int:
        return len(self.t_ns)

    def __repr__(self) -> str:
        return f"<{type(self).__name__}: {span(self.t_ns)}>"


@dataclass(frozen=True, repr=False)
class MagneticReadings(_Readings):
    """The n readings of a magnetometer that are delivered, and the truth of each."""

    t_ns: Times
    """(n,) stamps [ns], with the errors of the board's clock."""
    field: Array
    """(n, 3) as read [T]."""
    true_t_ns: Times
    """(n,) when the sample was taken [ns]."""
    ideal_field: Array
    """(n, 3) the field at the IMU in its own frame, without any error [T]."""
    bias: Array
    """(n, 3) what is added to the field times the sensor's response [T]."""


@dataclass(frozen=True, repr=False)
class PressureReadings(_Readings):
    """The n readings of a barometer that are delivered, and the truth of each."""

    t_ns: Times
    """(n,) stamps [ns], with the errors of the board's clock."""
    pressure: Array
    """(n,) as read [Pa]."""
    true_t_ns: Times
    """(n,) when the sample was taken [ns]."""
    ideal_pressure: Array
    """(n,) of the still air at the IMU's height [Pa]."""
    bias: Array
    """(n,) what is added to it, without white noise and rounding [Pa]."""


@dataclass(frozen=True, repr=False)
class Orientations(_Readings):
    """The n orientations that a board states and delivers, and the truth of each."""

    t_ns: Times
    """(n,) stamps [ns]."""
    q_wi: Array
    """(n, 4) of the IMU in the world, as stated: unit quaternions (w, x, y, z)."""
    variance: Array
    """(n, 3) stated, of the error about the world's axes [rad^2]; 0: unknown."""
    true_t_ns: Times
    """(n,) when the sample was taken [ns]."""
    ideal_q_wi: Array
    """(n, 4) the true ones."""


def checked_sensors(names: Collection[str]) -> frozenset[str]:
    """Return the names of sensors beside the IMU.

    :raises ConfigurationError: with a line for each that does not exist.
    """
    given = words("sensors", names)
    unknown = [
        f"sensors: {name!r}: {suggestion(name, BESIDE)}" for name in given if name not in BESIDE
    ]
    if unknown:
        raise ConfigurationError(unknown)
    return frozenset(given)


def joined(blocks: Sequence[ImuBlock], sensor: str, readings: type[_Any]) -> _Any:
    """Return what a sensor beside the IMU delivered in all blocks.

    :raises ConfigurationError: where it was not simulated.
    """
    parts: list[Any] = [getattr(block, sensor) for block in blocks]
    if any(part is None for part in parts):
        raise ConfigurationError(
            f"{sensor}: was not simulated; simulate(..., sensors=[{sensor!r}]) does"
        )
    return readings(
        **{
            field.name: np.concatenate([getattr(p, field.name)[p.delivered] for p in parts])
            for field in fields(readings)
        }
    )
