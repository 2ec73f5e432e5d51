# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Limits of measured values: readings, poses and their stamps, from any source.

Files, live messages and arrays pass the same limits. The limits are far beyond what sensors read
and bodies do, and far within what the arithmetic behind them can handle: a refused value is never a
bold measurement, but a broken one.
"""

from collections.abc import Sequence
from pathlib import Path
from typing import Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from imu_sim_ros.core.bad_rows import STAMPS, VALUES, BadRows
from imu_sim_ros.core.errors import InputError
from imu_sim_ros.core.types import Array, Integers, Mask, Times

Scalars = tuple[float, ...]

_SECOND: Final = 1_000_000_000
"""Nanoseconds in a second."""
FIRST_STAMP: Final = -(2**31) * 1_000_000_000
"""Earliest stamp that a ROS message can hold [ns]."""
LAST_STAMP: Final = 2**31 * 1_000_000_000 - 1
"""Range of stamps that a ROS 2 message can hold, whose seconds are an int32 [ns]."""
UNIT_TOLERANCE: Final = 0.05
"""Largest deviation of a quaternion's length from 1 by rounding; a larger one is a mix-up."""

_ROUNDING: Final = 1e-12
"""Deviation of a quaternion's length from 1 that needs no normalisation."""


class Quantity(NamedTuple):
    """Physical quantity of a column of numbers, with the largest possible value on each axis."""

    name: str
    largest: float
    unit: str
    may_lack: bool = False
    """True if NaN stands for a row without the quantity."""


RATE: Final = Quantity("angular velocity", 1e5, "rad/s")
FORCE: Final = Quantity("linear acceleration", 1e7, "m/s^2")
POSITION: Final = Quantity("position", 1e10, "m")
VELOCITY: Final = Quantity("velocity", 1e8, "m/s")
ORIENTATION: Final = Quantity("orientation", 1.0 + UNIT_TOLERANCE, "")
FIELD: Final = Quantity("magnetic field", 1e3, "T")
PRESSURE: Final = Quantity("pressure", 1e10, "Pa")
TEMPERATURE: Final = Quantity("temperature", 1e5, "degC")
SENSOR_TEMPERATURE: Final = Quantity("temperature", 1e7, "degC", may_lack=True)
"""Temperature beside the readings of a sensor, perhaps at a lower rate, perhaps in another unit."""
OTHER: Final = Quantity("value", 1e100, "")
"""A number without a certain meaning; its square is still finite."""


class Verdict:
    """Result of the check of n rows."""

    def __init__(
        self,
        t_ns: Times | None,
        columns: Sequence[tuple[Quantity, Array]],
        nanosecond: Integers | None = None,
    ) -> None:
        """Check rows.

        :param t_ns: (n,) stamps [ns]; None: the rows have none.
        :param columns: quantity and values, (n,) or (n, m), of each column; quaternions
            (n, 4) of any order are ``ORIENTATION``.
        :param nanosecond: (n,) nanoseconds of the stamps as in messages; None: not from messages.
        """
        self._nanosecond = nanosecond
        self._stamped, self._columns = t_ns is not None, columns
        self._t_ns = np.zeros(len(columns[0][1]), dtype=np.int64) if t_ns is None else t_ns
        self.good: Mask = (self._t_ns >= FIRST_STAMP) & (self._t_ns <= LAST_STAMP)
        """(n,) whether a row may pass."""
        if nanosecond is not None:
            self.good &= nanosecond < _SECOND
        for quantity, values in columns:
            good = _good(quantity, values)
            if good is not None:
                self.good &= good

    @property
    def bad(self) -> NDArray[np.intp]:
        """(m,) rows outside the limits."""
        return np.flatnonzero(~self.good)

    def why(self, row: int) -> str:
        """Return the problem of a row outside the limits: name, value and limit."""
        if not FIRST_STAMP <= self._t_ns[row] <= LAST_STAMP:
            return f"the stamp {self._t_ns[row]} ns is outside the years 1901 to 2038"
        if self._overflows(row):
            assert self._nanosecond is not None
            return overflow_problem(int(self._nanosecond[row]))
        for quantity, values in self._columns:
            value = values[row]
            if quantity.may_lack and np.isnan(value).all():
                continue
            if not np.isfinite(value).all():
                return f"a value that is not finite: {quantity.name} {_value_text(value)}"
            if quantity is ORIENTATION and _good(quantity, value[None]) is not None:
                length = np.linalg.norm(value.astype(np.longdouble))
                return f"a quaternion of length {length:.3g} instead of 1"
            if np.abs(value).max() > quantity.largest:
                limit = f"{quantity.largest:g} {quantity.unit}".strip()
                return f"{quantity.name} {_value_text(value)}: at most {limit} is possible"
        raise ValueError(f"row {row} may pass")

    def _overflows(self, row: int) -> bool:
        """Return whether the nanoseconds of a stamp are a second or more."""
        nanosecond = self._nanosecond
        return nanosecond is not None and bool(nanosecond[row] >= _SECOND)

    def note(self, bad: BadRows, numbers: Times | None = None, stamps: bool = False) -> None:
        """Note every row outside the limits.

        :param numbers: (n,) numbers of the rows in messages; None: 0 to n - 1.
        :param stamps: include the stamps in the text; a line of text has its own.
        """
        for row in self.bad:
            number = int(row if numbers is None else numbers[row])
            t_ns = int(self._t_ns[row])
            possible = FIRST_STAMP <= t_ns <= LAST_STAMP and not self._overflows(int(row))
            kind = VALUES if possible else STAMPS
            bad.note(kind, number, f"{stamp_text(t_ns)}: " * stamps + self.why(int(row)))
        bad.rows += len(self.bad)

    def problems(self, name: str | Path) -> list[str]:
        """Return the problems of the first rows outside the limits, and the number of others.

        :param name: name of the arrays or of their source.
        """
        bad = BadRows(name, "number")
        self.note(bad, stamps=self._stamped)
        return bad.problems

    def complain(self, name: str) -> None:
        """Raise if a row is outside the limits.

        :raises InputError: with the problems.
        """
        if not self.good.all():
            raise InputError(self.problems(name))


def readings(t_ns: Times, gyro: Array, accel: Array) -> Verdict:
    """Return the check of readings of an IMU.

    :param t_ns: (n,) stamps [ns].
    :param gyro: (n, 3) angular rates [rad/s].
    :param accel: (n, 3) specific forces [m/s^2].
    """
    return Verdict(t_ns, [(RATE, gyro), (FORCE, accel)])


def poses(t_ns: Times, position: Array, q_wb: Array, velocity: Array | None = None) -> Verdict:
    """Return the check of poses.

    :param t_ns: (n,) stamps [ns].
    :param position: (n, 3) positions [m].
    :param q_wb: (n, 4) unit quaternions, within ``UNIT_TOLERANCE``.
    :param velocity: (n, 3) velocities [m/s].
    """
    columns = [(POSITION, position), (ORIENTATION, q_wb)]
    return Verdict(t_ns, columns if velocity is None else [*columns, (VELOCITY, velocity)])


def normalise_quaternions(q: Array) -> Array:
    """Return quaternions that have passed at exactly unit length.

    :param q: (n, 4) quaternions; returned unchanged if all differ from unit length by rounding in
            double precision alone, so that exact attitudes keep their bits.
    """
    length = np.sqrt(np.einsum("ni,ni->n", q, q))
    if np.abs(length - 1.0).max(initial=0.0) <= _ROUNDING:
        return q
    return np.asarray(q / length[:, None])


def disorder(name: str | Path, t_ns: Times) -> list[str]:
    """Return a line if stamps do not increase strictly, none if they do.

    :param name: name of the source of the stamps.
    :param t_ns: (n,) stamps [ns].
    """
    bad = t_ns[1:] <= t_ns[:-1]
    if not bad.any():
        return []
    first_row = int(np.argmax(bad)) + 1
    return [
        f"{name}: {np.count_nonzero(bad)} stamps do not increase, the first is number {first_row} "
        f"({t_ns[first_row]} ns)"
    ]


def is_reading(t_ns: int, gyro: Scalars, accel: Scalars) -> bool:
    """Return whether one reading is within the limits, in plain floats (:func:`readings`)."""
    x, y, z = gyro
    u, v, w = accel
    rate, force = RATE.largest, FORCE.largest
    return (
        FIRST_STAMP <= t_ns <= LAST_STAMP
        and -rate <= x <= rate
        and -rate <= y <= rate
        and -rate <= z <= rate
        and -force <= u <= force
        and -force <= v <= force
        and -force <= w <= force
    )


def is_pose(t_ns: int, position: Scalars, q_wb: Scalars) -> bool:
    """Return whether one pose is within the limits, in plain floats (:func:`poses`)."""
    if not (FIRST_STAMP <= t_ns <= LAST_STAMP and is_within(position, POSITION)):
        return False
    w, x, y, z = q_wb
    smallest, largest = (1.0 - UNIT_TOLERANCE) ** 2, (1.0 + UNIT_TOLERANCE) ** 2
    return smallest <= w * w + x * x + y * y + z * z <= largest


def is_within(values: Scalars, quantity: Quantity) -> bool:
    """Return whether a vector is within its limit, in plain floats; NaN never is."""
    x, y, z = values
    limit = quantity.largest
    return -limit <= x <= limit and -limit <= y <= limit and -limit <= z <= limit


def stamp_ns(second: int, nanosecond: int) -> int:
    """Return the stamp of a message [ns].

    :raises InputError: for nanoseconds of a second and more, which no message of ROS has.
    """
    if nanosecond >= _SECOND:
        raise InputError(overflow_problem(nanosecond))
    return second * _SECOND + nanosecond


def overflow_problem(nanosecond: int) -> str:
    """Return a line about the nanoseconds of a stamp that are a second or more."""
    return f"nanosec = {nanosecond} in the stamp: must be less than {_SECOND}"


def stamp_text(t_ns: int) -> str:
    """Return a stamp as text for messages: ``stamp 12.005000000 s``."""
    whole, part = divmod(abs(t_ns), 1_000_000_000)
    return f"stamp {'-' * (t_ns < 0)}{whole}.{part:09d} s"


def _good(quantity: Quantity, values: Array) -> Mask | None:
    """Return a mask of the rows in range; None: all of them."""
    if not values.size:
        return None
    if quantity.may_lack:
        values = np.where(np.isnan(values), 0.0, values)
    # Extremes are NaN if a value is, and need no memory; nearly always they are enough.
    with np.errstate(invalid="ignore"):
        all_in_range = values.min() >= -quantity.largest and values.max() <= quantity.largest
    good: Mask = np.ones(len(values), dtype=bool)
    if not all_in_range:
        with np.errstate(invalid="ignore"):
            is_in_limits = np.abs(values) <= quantity.largest
        good = np.asarray(is_in_limits.reshape(len(values), -1).all(axis=1))
    if quantity is ORIENTATION:
        with np.errstate(over="ignore", invalid="ignore"):
            length = np.sqrt(np.einsum("ni,ni->n", values, values))
            good &= np.abs(length - 1.0) <= UNIT_TOLERANCE
    return None if good.all() else good


def _value_text(value: Array) -> str:
    """Return a number or a vector as text."""
    text = ", ".join(f"{number:.6g}" for number in np.atleast_1d(value).tolist())
    return f"[{text}]" if np.ndim(value) else text
