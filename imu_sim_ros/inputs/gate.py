# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""The gate of what is measured: a reading, a pose and their stamps, wherever they come from.

Files, live messages and arrays pass by the same limits. They are far outside of what sensors read
and bodies do, and far inside of what the arithmetic behind the gate can carry: what is refused is
never a bold measurement, but a broken one.
"""

from collections.abc import Sequence
from pathlib import Path
from typing import Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from imu_sim_ros.errors import InputError
from imu_sim_ros.inputs.rows import STAMPS, VALUES, BadRows
from imu_sim_ros.types import Array, Integers, Mask, Times

Scalars = tuple[float, ...]

_SECOND: Final = 1_000_000_000
"""[ns]"""
FIRST_STAMP: Final = -(2**31) * 1_000_000_000
LAST_STAMP: Final = 2**31 * 1_000_000_000 - 1
"""[ns] The stamps that a ROS 2 message can hold: its seconds are an int32."""
UNIT_TOLERANCE: Final = 0.05
"""A written quaternion is rounded; one whose length differs from 1 by more is a mix-up."""

_ROUNDING: Final = 1e-12


class Quantity(NamedTuple):
    """What a column of numbers measures, and its largest possible size on each axis."""

    name: str
    largest: float
    unit: str


RATE: Final = Quantity("angular velocity", 1e5, "rad/s")
FORCE: Final = Quantity("linear acceleration", 1e7, "m/s^2")
POSITION: Final = Quantity("position", 1e10, "m")
VELOCITY: Final = Quantity("velocity", 1e8, "m/s")
ORIENTATION: Final = Quantity("orientation", 1.0 + UNIT_TOLERANCE, "")
FIELD: Final = Quantity("magnetic field", 1e3, "T")
PRESSURE: Final = Quantity("pressure", 1e10, "Pa")
TEMPERATURE: Final = Quantity("temperature", 1e5, "degC")
OTHER: Final = Quantity("value", 1e100, "")
"""A number of no certain meaning; its square is still one."""


class Verdict:
    """What the gate says of n rows."""

    def __init__(
        self,
        t_ns: Times | None,
        columns: Sequence[tuple[Quantity, Array]],
        nanosecond: Integers | None = None,
    ) -> None:
        """Look at rows.

        :param t_ns: (n,) stamps [ns]; None: the rows have none.
        :param columns: what each column measures, and its values, (n,) or (n, m); quaternions
            (n, 4) of any order are ``ORIENTATION``.
        :param nanosecond: (n,) nanoseconds of the stamps as messages have them; None: of others.
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
        """(m,) the rows that may not pass."""
        return np.flatnonzero(~self.good)

    def why(self, row: int) -> str:
        """Return what is wrong with a row that may not pass: name, value, what is allowed."""
        if not FIRST_STAMP <= self._t_ns[row] <= LAST_STAMP:
            return f"the stamp {self._t_ns[row]} ns is outside the years 1901 to 2038"
        if self._overflows(row):
            assert self._nanosecond is not None
            return overflow_problem(int(self._nanosecond[row]))
        for quantity, values in self._columns:
            value = values[row]
            if not np.isfinite(value).all():
                return f"a value that is not finite: {quantity.name} {_shown(value)}"
            if quantity is ORIENTATION and _good(quantity, value[None]) is not None:
                length = np.linalg.norm(value.astype(np.longdouble))
                return f"a quaternion of length {length:.3g} instead of 1"
            if np.abs(value).max() > quantity.largest:
                limit = f"{quantity.largest:g} {quantity.unit}".strip()
                return f"{quantity.name} {_shown(value)}: at most {limit} is possible"
        raise ValueError(f"row {row} may pass")

    def _overflows(self, row: int) -> bool:
        """Return whether the nanoseconds of a stamp are a second or more."""
        nanosecond = self._nanosecond
        return nanosecond is not None and bool(nanosecond[row] >= _SECOND)

    def note(self, bad: BadRows, numbers: Times | None = None, stamps: bool = False) -> None:
        """Note every row that may not pass.

        :param numbers: (n,) under which the rows are known; None: 0 to n - 1.
        :param stamps: say the stamps, too; a line of text shows its own.
        """
        for row in self.bad:
            number = int(row if numbers is None else numbers[row])
            t_ns = int(self._t_ns[row])
            possible = FIRST_STAMP <= t_ns <= LAST_STAMP and not self._overflows(int(row))
            kind = VALUES if possible else STAMPS
            bad.note(kind, number, f"{stamp_words(t_ns)}: " * stamps + self.why(int(row)))
        bad.rows += len(self.bad)

    def problems(self, name: str | Path) -> list[str]:
        """Return what is wrong with the first rows that may not pass, and the count of the others.

        :param name: name of the arrays, or of where they come from.
        """
        bad = BadRows(name, "number")
        self.note(bad, stamps=self._stamped)
        return bad.problems

    def complain(self, name: str) -> None:
        """Raise if a row may not pass.

        :raises InputError: with the problems.
        """
        if not self.good.all():
            raise InputError(self.problems(name))


def readings(t_ns: Times, gyro: Array, accel: Array) -> Verdict:
    """Return what the gate says of readings of an IMU.

    :param t_ns: (n,) stamps [ns].
    :param gyro: (n, 3) angular rates [rad/s].
    :param accel: (n, 3) specific forces [m/s^2].
    """
    return Verdict(t_ns, [(RATE, gyro), (FORCE, accel)])


def poses(t_ns: Times, position: Array, q_wb: Array) -> Verdict:
    """Return what the gate says of poses.

    :param t_ns: (n,) stamps [ns].
    :param position: (n, 3) [m].
    :param q_wb: (n, 4) unit quaternions, within ``UNIT_TOLERANCE``.
    """
    return Verdict(t_ns, [(POSITION, position), (ORIENTATION, q_wb)])


def at_unit_length(q: Array) -> Array:
    """Return quaternions that have passed at exactly unit length.

    :param q: (n, 4); returned as they are if none differs from it by more than rounding in double
        precision, so that exact attitudes keep their bits.
    """
    length = np.sqrt(np.einsum("ni,ni->n", q, q))
    if np.abs(length - 1.0).max(initial=0.0) <= _ROUNDING:
        return q
    return np.asarray(q / length[:, None])


def disorder(name: str | Path, t_ns: Times) -> list[str]:
    """Return a line if stamps do not increase strictly, none if they do.

    :param name: name of what has the stamps.
    :param t_ns: (n,) [ns].
    """
    bad = t_ns[1:] <= t_ns[:-1]
    if not bad.any():
        return []
    first = int(np.argmax(bad)) + 1
    return [
        f"{name}: {np.count_nonzero(bad)} stamps do not increase, the first is number {first} "
        f"({t_ns[first]} ns)"
    ]


def is_reading(t_ns: int, gyro: Scalars, accel: Scalars) -> bool:
    """Return whether one reading may pass, in plain floats; arguments as for :func:`readings`."""
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
    """Return whether one pose may pass, in plain floats; arguments as for :func:`poses`."""
    if not (FIRST_STAMP <= t_ns <= LAST_STAMP and within(position, POSITION)):
        return False
    w, x, y, z = q_wb
    least, most = (1.0 - UNIT_TOLERANCE) ** 2, (1.0 + UNIT_TOLERANCE) ** 2
    return least <= w * w + x * x + y * y + z * z <= most


def within(values: Scalars, quantity: Quantity) -> bool:
    """Return whether a vector is of possible size, in plain floats; NaN never is."""
    x, y, z = values
    most = quantity.largest
    return -most <= x <= most and -most <= y <= most and -most <= z <= most


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


def stamp_words(t_ns: int) -> str:
    """Return a stamp as messages say it: ``stamp 12.005000000 s``."""
    whole, part = divmod(abs(t_ns), 1_000_000_000)
    return f"stamp {'-' * (t_ns < 0)}{whole}.{part:09d} s"


def _good(quantity: Quantity, values: Array) -> Mask | None:
    """Return which rows are in range; None: all of them."""
    if not values.size:
        return None
    # Extremes are NaN if a value is, and need no memory; nearly always they are enough.
    with np.errstate(invalid="ignore"):
        in_range = values.min() >= -quantity.largest and values.max() <= quantity.largest
    good: Mask = np.ones(len(values), dtype=bool)
    if not in_range:
        with np.errstate(invalid="ignore"):
            each = np.abs(values) <= quantity.largest
        good = np.asarray(each.reshape(len(values), -1).all(axis=1))
    if quantity is ORIENTATION:
        with np.errstate(over="ignore", invalid="ignore"):
            length = np.sqrt(np.einsum("ni,ni->n", values, values))
            good &= np.abs(length - 1.0) <= UNIT_TOLERANCE
    return None if good.all() else good


def _shown(value: Array) -> str:
    words = ", ".join(f"{number:.6g}" for number in np.atleast_1d(value).tolist())
    return f"[{words}]" if np.ndim(value) else words
