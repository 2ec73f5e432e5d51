# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Checks of a record at rest before anything is computed from it."""

from collections.abc import Iterator
from itertools import pairwise
from typing import Final, NamedTuple

import numpy as np

from imu_sim_ros import conventions
from imu_sim_ros.calibration.rest import RestCheck
from imu_sim_ros.calibration.stamps import SampleClock, sampling_interval
from imu_sim_ros.conventions import TRIADS
from imu_sim_ros.errors import InputError
from imu_sim_ros.inputs import gate
from imu_sim_ros.inputs.rows import BadRows
from imu_sim_ros.types import Array, Integers, Times

COARSE: Final = 0.55
"""Deviation of the readings, in steps, below which the noise is not their own. At 0.55 the noise is
between 0.45 and 0.48 steps, wherever the mean lies."""
HIDDEN: Final = 0.58
"""Deviation, in steps, that noise with its rounding may have if the readings are coarse."""
_LOOKED_AT: Final = 4096
_MAX_CODES: Final = 256


class StepFinder:
    """Finds the step of each axis from the few distinct values that its readings take."""

    def __init__(self, axes: int) -> None:
        self.step = np.zeros(axes)
        """(axes,) the step; 0 if the readings are not in steps, or only one code was seen."""
        self._open = np.ones(axes, dtype=bool)
        self._codes: list[Array] = [np.empty(0)] * axes

    def look(self, columns: Array) -> None:
        """Take the next readings (axes, n)."""
        for k in np.flatnonzero(self._open):
            codes = np.union1d(self._codes[k], columns[k, :_LOOKED_AT])
            if len(codes) > _MAX_CODES:
                self.step[k], self._open[k] = 0.0, False
                continue
            self._codes[k] = codes
            if len(codes) > 1:
                self.step[k] = float(np.min(np.diff(codes)))
                self._open[k] = len(codes) < 8  # then a neighbouring pair has been seen


def doubt(deviation: float, step: float) -> float:
    """Return the relative uncertainty of the readings' variance that rounding leaves.

    :param deviation: of the readings, rounding included.
    :param step: 0: no rounding.
    """
    if step == 0.0:
        return 0.0
    x = max((deviation / step) ** 2 - 1.0 / 12.0, 0.0)
    share = (1.0 / np.pi**2 + 4.0 * x) * np.exp(-2.0 * np.pi**2 * x)
    return float(share / max(x + 1.0 / 12.0, 1e-12))


AXES: Final = tuple(f"{triad} {axis}" for triad in TRIADS for axis in conventions.AXES)
_SATURATED: Final = 1e-4
"""Share of samples at the very same extreme value."""
_PILED_UP: Final = 4
"""Hits of an extreme value over those of the value next to it that no tail of noise reaches."""


class Timing(NamedTuple):
    """Rate, jitter and losses, from the stamps of a record."""

    rate: float
    """Samples over the time that they take, gaps apart [Hz]."""
    jitter: float
    """Standard deviation of a stamp against equal intervals, if each is late on its own [s]."""
    lost: int
    """Samples missing between others."""
    filled: int
    """Missing samples in losses short enough to be filled."""
    gaps: int
    """Losses that ended a piece."""
    longest_gap: float
    """[s]"""
    duplicates: int
    """Messages with the stamp of the one before; the second was dropped."""


_ROUNDING: Final = 16.0 * float(np.finfo(np.float64).eps)
"""Relative change of a reading that is not the sensor's: float64 has no more digits."""


class Record:
    """Takes the messages of one or more bags of one sensor, passes on pieces of readings."""

    def __init__(self) -> None:
        self.samples = 0
        self.start_ns = 0
        self.bad = BadRows("readings", "number")
        self._lowest = _Extreme(np.minimum)
        self._highest = _Extreme(np.maximum)
        self._steps = StepFinder(6)
        self._sum = np.zeros(6)
        self._square = np.zeros(6)
        self.rest: RestCheck | None = None
        self._clock: SampleClock | None = None
        self._last_ns: int | None = None
        self._lost = self._filled = self._gaps = self._duplicates = 0
        self._longest_gap = 0
        self._intervals = np.zeros(3)  # count, sum and sum of squares, relative to the nominal
        self._span = np.zeros(2)  # time and count of intervals, gaps apart

    @property
    def rate(self) -> float:
        """Samples per second [Hz], known from the first block on."""
        return 1e9 / self._interval

    @property
    def _interval(self) -> float:
        """Nominal sampling interval [ns]."""
        return self._clock.interval if self._clock else np.inf

    def add(self, t_ns: Times, gyro: Array, accel: Array) -> Iterator[Array | None]:
        """Take a block of messages; yield readings (n, 6), and None if a piece ends.

        :raises InputError: for stamps that run backwards.
        """
        y = np.concatenate([gyro, accel], axis=1)
        if len(y) == 0:
            return
        if self._clock is None:
            self._clock = SampleClock(sampling_interval(t_ns))
            self.start_ns = int(t_ns[0])
            self.rest = RestCheck(self.rate)
        t_ns, y = self._in_order(t_ns, y)
        if not len(y):  # nothing but repetitions of the message before
            return
        yield from self._pieces(self._clock, t_ns, self._looked_at(t_ns, y))
        self._last_ns = int(t_ns[-1])

    def at_rest(self, y: Array | None) -> Iterator[Array | None]:
        """Yield the parts of a piece that are at rest; None marks the end of a piece."""
        if self.rest is not None:
            yield from self.rest.add(y)

    def end_bag(self) -> None:
        """Announce that the next block is from another bag."""
        self._last_ns = None
        if self._clock is not None:
            self._clock.restart()

    def _in_order(self, t_ns: Times, y: Array) -> tuple[Times, Array]:
        before = t_ns[0] - 1 if self._last_ns is None else self._last_ns
        steps = np.diff(t_ns, prepend=before)
        if np.any(steps < 0):
            k = int(np.argmax(steps < 0))
            raise InputError(
                f"stamps run backwards by {-steps[k] * 1e-9:.6f} s at sample {self.samples + k}: "
                "sort the bag by stamp first"
            )
        new = steps > 0
        repeated = int(np.count_nonzero(~new))
        self._duplicates += repeated
        return (t_ns[new], y[new]) if repeated else (t_ns, y)

    def _looked_at(self, t_ns: Times, y: Array) -> Array:
        """Return readings with zeros for those that the gate refuses."""
        verdict = gate.readings(t_ns, y[:, :3], y[:, 3:])
        if not verdict.good.all():
            numbers = np.arange(self.samples, self.samples + len(y))
            verdict.note(self.bad, numbers, stamps=True)
            y = np.where(verdict.good[:, None], y, 0.0)
        self.samples += len(y)
        columns = np.ascontiguousarray(y.T)
        self._sum += columns.sum(axis=1)
        self._square += np.einsum("an,an->a", columns, columns)
        self._lowest.take(columns)
        self._highest.take(columns)
        self._steps.look(columns)
        if self.rest is not None:
            self.rest.step = self._steps.step
        return y

    @property
    def minimum(self) -> Array:
        """(6,) smallest readings."""
        return self._lowest.value

    @property
    def maximum(self) -> Array:
        """(6,) largest readings."""
        return self._highest.value

    @property
    def step(self) -> Array:
        """(6,) digital steps of the readings; 0 if there are none."""
        return self._steps.step

    def _pieces(self, clock: SampleClock, t_ns: Times, y: Array) -> Iterator[Array | None]:
        missing = clock.missing(t_ns)
        steps = np.diff(t_ns, prepend=t_ns[0] if self._last_ns is None else self._last_ns)
        lost = int(missing.sum())
        near = missing <= clock.longest
        connected = near & (steps > 0)
        self._span += steps[connected].sum(), (1 + missing[connected]).sum()
        regular = steps[connected & (missing == 0)] / clock.interval - 1.0
        self._intervals += [len(regular), regular.sum(), (regular**2).sum()]
        self._lost += lost
        if not lost:
            yield y
            return
        self._filled += int(missing[near].sum())
        starts = np.concatenate([[0], np.flatnonzero(~near), [len(y)]])
        for start, stop in pairwise(starts):
            if start < len(y) and not near[start]:
                self._gaps += 1
                self._longest_gap = max(self._longest_gap, int(missing[start]) + 1)
                missing[start] = 0
                yield None
            if stop > start:
                yield _with_gaps(y[start:stop], missing[start:stop])

    def timing(self) -> Timing:
        """Return rate, jitter and losses."""
        count, total, squares = self._intervals
        mean = total / max(count, 1.0)
        # An interval between neighbours has the jitter of two stamps: twice the variance of one.
        variance = 0.5 * max(squares / max(count, 1.0) - mean**2, 0.0)
        jitter = np.sqrt(variance) * self._interval * 1e-9
        span, steps = self._span
        return Timing(
            float(1e9 * steps / span) if steps else self.rate,
            float(jitter),
            self._lost,
            self._filled,
            self._gaps,
            self._longest_gap * self._interval * 1e-9,
            self._duplicates,
        )

    @property
    def mean(self) -> Array:
        """(6,) mean of the readings."""
        return self._sum / max(self.samples, 1)

    def constant_axes(self) -> list[int]:
        """Return the axes whose readings never change by more than float64's rounding."""
        size = np.maximum(np.abs(self.minimum), np.abs(self.maximum))
        same = self.maximum - self.minimum <= _ROUNDING * size
        return [int(k) for k in np.flatnonzero(same)]

    def saturated_axes(self) -> list[tuple[int, float, float]]:
        """Return axis, value and share of samples where readings pile up at one end.

        Noise has fewer readings at the end than at the value next to it; at the end of a sensor's
        range all that lies beyond comes on top of it.
        """
        result = []
        spread = np.sqrt(np.maximum(self._square / self.samples - self.mean**2, 0.0))
        for end in (self._lowest, self._highest):
            far = np.abs(end.value - self.mean) > 2.0 * spread
            often = end.hits > np.maximum(10, _SATURATED * self.samples)
            piled_up = end.hits > _PILED_UP * end.next_hits
            for k in np.flatnonzero(far & often & piled_up):
                share = float(end.hits[k] / self.samples)
                result.append((int(k), float(end.value[k]), share))
        return result


def _with_gaps(y: Array, missing: Integers) -> Array:
    """Return readings with rows of NaN for those missing before each."""
    if not missing.any():
        return y
    there = np.cumsum(missing + 1) - 1
    result = np.full((int(there[-1]) + 1, y.shape[1]), np.nan)
    result[there] = y
    return result


class _Extreme:
    """The smallest or largest value of each axis and the value next to it, with their hits."""

    def __init__(self, find: np.ufunc) -> None:
        self._find = find
        self._none = np.inf if find is np.minimum else -np.inf
        self.value = np.full(6, self._none)
        self.hits = np.zeros(6, dtype=np.int64)
        self.next_value = np.full(6, self._none)
        self.next_hits = np.zeros(6, dtype=np.int64)

    def take(self, columns: Array) -> None:
        """Take the next readings (6, n)."""
        if columns.shape[1] == 0:
            return
        first = self._find.reduce(columns, axis=1)
        for k in np.flatnonzero(self._find(first, self.next_value) == first):
            self._take_axis(int(k), columns[k], first[k])

    def _take_axis(self, k: int, column: Array, first: float) -> None:
        """Take the next readings (n,) of an axis which reach the value next to the extreme one."""
        at_first = column == first
        rest = np.where(at_first, self._none, column)
        second = self._find.reduce(rest)
        at_second = np.count_nonzero(rest == second)
        values = np.array([self.value[k], self.next_value[k], first, second])
        hits = np.array([self.hits[k], self.next_hits[k], np.count_nonzero(at_first), at_second])
        self.value[k] = self._find.reduce(values)
        self.hits[k] = np.sum(hits[values == self.value[k]])
        beyond = np.where(values == self.value[k], self._none, values)
        self.next_value[k] = self._find.reduce(beyond)
        self.next_hits[k] = np.sum(hits[beyond == self.next_value[k]])
