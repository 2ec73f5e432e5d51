# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""A record at rest: its stamps, its readings and its motion, before anything is computed from it.

Missing samples are found by the stamps, readings that are no noise by their values, and motion by
the means of each second: slow motion is reported, single disturbances are cut out.
"""

from collections.abc import Callable, Iterable, Iterator
from typing import Final, NamedTuple

import numpy as np

from imu_sim_ros.core import conventions
from imu_sim_ros.core.conventions import TRIADS
from imu_sim_ros.core.records import Readings
from imu_sim_ros.core.types import Array, Mask
from imu_sim_ros.recordings.stream import ClockStream, Stretch

AXES: Final = tuple(f"{triad} {axis}" for triad in TRIADS for axis in conventions.AXES)
_NO_READINGS: Final = (np.empty(0, dtype=np.int64), np.empty((0, 6)))
_LOOKED_AT: Final = 4096
"""Number of readings of a block in which digital steps are looked for."""
_MAX_CODES: Final = 256
"""Number of different readings from which on no digital step is looked for."""
_SATURATED: Final = 1e-4
"""Share of samples at the very same extreme value."""
_PILED_UP: Final = 4
"""Ratio of the hits of an extreme value to those of the next value that no tail of noise
reaches."""
_ROUNDING: Final = 16.0 * float(np.finfo(np.float64).eps)
"""Relative change of a reading that is rounding of float64."""


class Timing(NamedTuple):
    """Rate, jitter and losses, from the stamps of a record."""

    rate: float
    """Number of samples over their time, without gaps [Hz]."""
    jitter: float
    """Standard deviation of a stamp from equal intervals, if each is late independently [s]."""
    lost: int
    """Number of samples missing between others, outside of gaps."""
    gaps: int
    """Number of pauses that ended a piece."""
    longest_gap: float
    """Length of the longest gap [s]."""
    duplicates: int
    """Number of messages that came twice; the second was dropped."""
    remarks: tuple[str, ...]
    """Lines on other properties of the stamps."""


class Record:
    """Messages of one or more bags of one sensor; passes on the readings at rest."""

    rate: float
    """Sample rate [Hz], available from the first block on."""
    rest: "RestCheck"
    """Motion in the record, available from the first block on."""

    def __init__(self) -> None:
        self.samples = 0
        self.lowest = _Extreme(np.minimum)
        self.highest = _Extreme(np.maximum)
        self.steps = StepFinder(6)
        self._sum = np.zeros(6)
        self._square = np.zeros(6)
        self._clock = ClockStream()

    def at_rest(
        self,
        bags: Iterable[Iterable[Readings]],
        advance: Callable[[int], None] = lambda count: None,
    ) -> Iterator[Array | None]:
        """Yield readings (n, 6) at rest, with rows of NaN for lost ones, and None if a piece ends.

        :param bags: messages of each bag, in blocks.
        :param advance: called with the number of messages read.
        :raises InputError: for stamps without a rate, and stamps in another unit.
        """
        for bag in bags:
            for block in bag:
                if len(block.t_ns):
                    readings = np.concatenate(block.triads(), axis=1)
                    yield from self._process_stretches(self._clock.add(block.t_ns, readings))
                advance(len(block.t_ns))
            yield from self._process_stretches(self._clock.add(*_NO_READINGS, at_end=True))
            if self.samples:
                yield from self.rest.add(None)

    def _process_stretches(self, stretches: Iterable[Stretch]) -> Iterator[Array | None]:
        """Yield the readings at rest of stretches; None between pieces."""
        for stretch in stretches:
            for piece in self._pieces(stretch):
                yield from self.rest.add(piece)

    def _pieces(self, stretch: Stretch) -> Iterator[Array | None]:
        """Note properties of the readings; yield them with rows of NaN for lost ones."""
        y, missing = stretch.values, stretch.missing
        if not self.samples:
            assert self._clock.pattern is not None
            self.rate = 1e9 / self._clock.pattern.interval_ns
            self.rest = RestCheck(self.rate, self.steps)
        elif stretch.begins:
            yield None
        self.samples += len(y)
        columns = np.ascontiguousarray(y.T)
        self._sum += columns.sum(axis=1)
        self._square += np.einsum("an,an->a", columns, columns)
        self.lowest.add(columns)
        self.highest.add(columns)
        self.steps.add(columns)
        if not missing.any():
            yield y
            return
        places = np.cumsum(missing + 1) - 1
        piece = np.full((int(places[-1]) + 1, y.shape[1]), np.nan)
        piece[places] = y
        yield piece

    def timing(self) -> Timing:
        """Return rate, jitter and losses."""
        clock = self._clock
        return Timing(
            rate=1e9 / clock.interval_ns,
            jitter=clock.jitter_ns * 1e-9,
            lost=clock.lost,
            gaps=clock.pauses,
            longest_gap=clock.longest_pause_ns * 1e-9,
            duplicates=clock.duplicates,
            remarks=tuple(clock.remarks()),
        )

    @property
    def mean(self) -> Array:
        """(6,) mean of the readings."""
        return self._sum / max(self.samples, 1)

    def constant_axes(self) -> list[int]:
        """Return the axes whose readings never change by more than float64's rounding."""
        size = np.maximum(np.abs(self.lowest.value), np.abs(self.highest.value))
        is_constant = self.highest.value - self.lowest.value <= _ROUNDING * size
        return [int(k) for k in np.flatnonzero(is_constant)]

    def saturated_axes(self) -> list[tuple[int, float, float]]:
        """Return axis, value and share of samples where readings pile up at one end.

        Noise has fewer readings at the extreme value than at the value next to it; at the end of a
        range all readings beyond are added to the extreme value.
        """
        saturated = []
        spread = np.sqrt(np.maximum(self._square / self.samples - self.mean**2, 0.0))
        for end in (self.lowest, self.highest):
            is_distant = np.abs(end.value - self.mean) > 2.0 * spread
            is_frequent = end.hits > np.maximum(10, _SATURATED * self.samples)
            is_pile = end.hits > _PILED_UP * end.next_hits
            for k in np.flatnonzero(is_distant & is_frequent & is_pile):
                share = float(end.hits[k] / self.samples)
                saturated.append((int(k), float(end.value[k]), share))
        return saturated


class _Extreme:
    """The smallest or largest value of each axis and the value next to it, with their hits."""

    def __init__(self, find: np.ufunc) -> None:
        """Initialise without readings.

        :param find: ``np.minimum`` for the smallest value, ``np.maximum`` for the largest.
        """
        self._find = find
        self._none = np.inf if find is np.minimum else -np.inf
        self.value = np.full(6, self._none)
        """(6,) extreme values so far [rad/s, m/s^2]; infinite without readings."""
        self.hits = np.zeros(6, dtype=np.int64)
        """(6,) number of readings that are the extreme value."""
        self.next_value = np.full(6, self._none)
        """(6,) values next to the extreme ones."""
        self.next_hits = np.zeros(6, dtype=np.int64)
        """(6,) number of readings that are the next value."""

    def add(self, columns: Array) -> None:
        """Add the next readings (6, n)."""
        extreme = self._find.reduce(columns, axis=1)
        # The axes whose readings reach the value next to the extreme one.
        for k in np.flatnonzero(self._find(extreme, self.next_value) == extreme):
            column, extreme_value = columns[k], extreme[k]
            is_extreme = column == extreme_value
            without_extreme = np.where(is_extreme, self._none, column)
            next_value = self._find.reduce(without_extreme)
            next_count = np.count_nonzero(without_extreme == next_value)
            values = np.array([self.value[k], self.next_value[k], extreme_value, next_value])
            counts = [self.hits[k], self.next_hits[k], np.count_nonzero(is_extreme), next_count]
            hits = np.array(counts)
            self.value[k] = self._find.reduce(values)
            equal = values == self.value[k]
            self.hits[k] = hits[equal].sum()
            further = np.where(equal, self._none, values)
            self.next_value[k] = self._find.reduce(further)
            equal = further == self.next_value[k]
            self.next_hits[k] = hits[equal].sum()


class StepFinder:
    """Finds the step of each axis from the few distinct values of its readings."""

    def __init__(self, axes: int) -> None:
        self.step = np.zeros(axes)
        """(axes,) the step; 0 if the readings are not in steps, or only one code was seen."""
        self._open = np.ones(axes, dtype=bool)
        self._codes: list[Array] = [np.empty(0)] * axes

    def add(self, columns: Array) -> None:
        """Add the next readings (axes, n)."""
        for k in np.flatnonzero(self._open):
            codes = np.union1d(self._codes[k], columns[k, :_LOOKED_AT])
            if len(codes) > _MAX_CODES:
                self.step[k], self._open[k] = 0.0, False
                continue
            self._codes[k] = codes
            if len(codes) > 1:
                self.step[k] = float(np.min(np.diff(codes)))
                self._open[k] = len(codes) < 8  # a neighbouring pair has been observed by then


_WINDOWS: Final = 256
"""Number of windows of about a second that are judged together."""
_NOISIER: Final = 6.0
"""Ratio of a window's variance to the median one that no stationary noise reaches."""
_JUMP: Final = 12.0
"""Jump between neighbouring window means, in robust standard deviations."""
_SLOW: Final = 25.0
"""Variance of the window means over that of white noise of the same samples."""
_SMALLEST_MOTION: Final = np.array([2e-3] * 3 + [2e-2] * 3)
"""Wander of the means of a second that may be a sensor's random walk [rad/s, m/s^2]."""
_SUDDEN: Final = 50.0
"""Variance of the means in one stretch over the median one that no random walk reaches.

The variance of a detrended walk in a stretch is nearly chi-square distributed with one degree of
freedom, which exceeds 23 times its mean, 50 times its median, once in 10^6.
"""
_MIN_WINDOWS: Final = 4
"""Smallest number of stretches among which one can stand out."""


class Movement(NamedTuple):
    """Time in which an axis was not at rest."""

    axis: int
    begin: float
    """Start after the first sample [s]."""
    end: float
    """End after the first sample [s]."""
    size: float
    """Standard deviation of the means over a second, or the largest jump [rad/s, m/s^2]."""


class RestCheck:
    """Filter of pieces of readings that passes on those at rest.

    It stays apart from the findings, which judge readings that are in memory: a record at rest may
    be of any length, and single disturbances are cut out of it. Its movements become the finding
    ``motion_at_rest``.
    """

    def __init__(self, rate: float, steps: StepFinder) -> None:
        """Initialise without readings.

        :param rate: samples per second [Hz].
        :param steps: digital steps of the readings, as far as they have been determined.
        """
        self._window = max(round(rate), 4)
        self._rate, self._steps = rate, steps
        self._buffer: list[Array] = []
        self._buffered = 0
        self._previous_mean: Array | None = None
        self.moving: list[Movement] = []
        """Stretches of continued motion, or of a walk of such size; their readings are passed
        on."""
        self.spreads: list[Array] = []
        """(6,) standard deviations of the detrended means over a second, of each stretch."""
        self._variance = np.zeros(6)
        self._window_count = 0
        self.disturbed: list[Movement] = []
        """Single disturbances, whose readings are removed."""
        self.seconds = 0.0

    def add(self, y: Array | None) -> Iterator[Array | None]:
        """Add readings (n, 6), or None at the end of a piece; yield the readings at rest."""
        if y is None:
            yield from self._judge()
            self._previous_mean = None
            yield None
            return
        size = _WINDOWS * self._window
        while len(y):
            part, y = y[: size - self._buffered], y[size - self._buffered :]
            self._buffer.append(part)
            self._buffered += len(part)
            if self._buffered == size:
                yield from self._judge()

    def _judge(self) -> Iterator[Array | None]:
        """Yield the buffered readings without their disturbed windows."""
        if self._buffered == 0:
            return
        y = np.concatenate(self._buffer)
        self._buffer, self._buffered = [], 0
        begin = self.seconds
        self.seconds += len(y) / self._rate
        count = len(y) // self._window
        if count < 8:
            yield y
            return
        whole = y[: count * self._window]
        lossy = np.isnan(whole[:, 0]).any()
        mean, variance = (self._with_losses if lossy else self._without_losses)(whole, count)
        typical = np.median(variance, axis=0)
        self._note_motion(mean, typical, begin)
        bad = self._disturbances(mean, variance, typical, begin)
        self._variance += variance[~bad].sum(axis=0)
        self._window_count += int(np.count_nonzero(~bad))
        if not bad.any():
            yield y
            return
        samples = np.zeros(len(y), dtype=bool)
        samples[: len(bad) * self._window] = np.repeat(bad, self._window)
        edges = np.flatnonzero(np.diff(samples.astype(int), prepend=1, append=1))
        for start, stop in zip(edges[::2], edges[1::2], strict=True):
            if start > 0:
                yield None
            yield y[start:stop]
        if samples[-1]:
            yield None

    def _without_losses(self, y: Array, count: int) -> tuple[Array, Array]:
        """Return means and variances (windows, 6) of windows with lost readings.

        Samples first: NumPy adds long rows, not six numbers at a time.
        """
        windows = y.reshape(count, self._window, 6).transpose(1, 0, 2)
        rows = np.ascontiguousarray(windows).reshape(self._window, -1)
        mean = np.add.reduce(rows, axis=0) / self._window
        rows -= mean
        rows *= rows
        variance = np.add.reduce(rows, axis=0) / self._window
        return mean.reshape(count, 6), variance.reshape(count, 6)

    def _with_losses(self, y: Array, count: int) -> tuple[Array, Array]:
        """Return means and variances (windows, 6) of the readings that are there.

        A window with fewer than half of its readings has the mean of the window before and the
        typical variance.
        """
        windows = y.reshape(count, self._window, 6)
        counts = np.count_nonzero(~np.isnan(windows[:, :, 0]), axis=1)
        centre = np.nanmean(y, axis=0)
        deviations = np.where(np.isnan(windows), 0.0, windows - centre)
        number = np.maximum(counts, 1)[:, None]
        mean = deviations.sum(axis=1) / number
        variance = np.maximum((deviations**2).sum(axis=1) / number - mean**2, 0.0)
        complete = counts >= 0.5 * self._window
        source = np.maximum.accumulate(np.where(complete, np.arange(count), 0))
        variance[~complete] = np.median(variance[complete], axis=0) if complete.any() else 0.0
        return centre + mean[source], variance

    def _note_motion(self, mean: Array, typical: Array, begin: float) -> None:
        """Note the axes whose means move more than those of a stretch at rest.

        :param mean: (m, 6) means of the windows.
        :param typical: (6,) typical variance in a window.
        :param begin: begin of the stretch [s].
        """
        # A single shock or shift of level is a disturbance; without it the stretch must be at rest.
        steps = np.diff(mean, axis=0)
        steps[np.abs(steps) > self._jump_limit(np.abs(steps), typical)] = 0.0
        level = np.concatenate([np.zeros((1, 6)), np.cumsum(steps, axis=0)])
        t = np.linspace(-1.0, 1.0, len(level))[:, None]
        drift = (t * (level - level.mean(axis=0))).sum(axis=0) / (t**2).sum()
        spread = np.std(level - t * drift, axis=0)
        white = np.sqrt(typical / self._window)
        end = begin + len(mean) * self._window / self._rate
        moving = (spread > _SMALLEST_MOTION) & (spread**2 > _SLOW * white**2)
        self.spreads.append(spread)
        for axis in np.flatnonzero(moving):
            self.moving.append(Movement(int(axis), begin, end, float(spread[axis])))

    def noise(self) -> Array:
        """Return (6,) the standard deviation of the readings within a second."""
        return np.sqrt(self._variance / max(self._window_count, 1))

    def is_sudden(self, motion: Movement) -> bool:
        """Return whether a motion is far larger than the axis' motion in the other stretches."""
        if len(self.spreads) < _MIN_WINDOWS:
            return False
        typical = float(np.median([spread[motion.axis] for spread in self.spreads]))
        return motion.size**2 > _SUDDEN * typical**2

    def sways(self, axis: int, amplitude: float, samples: float) -> bool:
        """Return whether a sinusoid is motion: too fast and too large for a sensor's own drift.

        :param amplitude: amplitude of the sinusoid [rad/s, m/s^2].
        :param samples: period of the sinusoid [samples].
        """
        fast = samples < _WINDOWS * self._window
        return bool(fast and amplitude > np.sqrt(2.0) * _SMALLEST_MOTION[axis])

    def _jump_limit(self, jump: Array, typical: Array) -> Array:
        """Return (6,) the largest difference between neighbouring means of noise."""
        robust = 1.4826 * np.median(jump, axis=0)
        limit: Array = _JUMP * np.maximum(robust, np.sqrt(2.0 * typical / self._window))
        return limit + self._steps.step

    def _disturbances(self, mean: Array, variance: Array, typical: Array, begin: float) -> Mask:
        """Return a mask (windows,) of disturbances, with one window of margin on both sides.

        :param mean: (windows, 6) means of the readings in consecutive windows.
        :param variance: (windows, 6) variances in the windows.
        :param typical: (6,) variance in a window at rest.
        :param begin: start of the first window after the first sample [s].
        """
        previous = mean[:1] if self._previous_mean is None else self._previous_mean
        jump = np.abs(np.diff(mean, axis=0, prepend=previous))
        self._previous_mean = mean[-1:]
        limit = self._jump_limit(jump, typical)
        # An axis that hardly changes its last digit has a typical variance of zero; an axis that
        # alternates between two codes deviates by half a step.
        noisy = _NOISIER * (typical + 0.25 * self._steps.step**2)
        noisy_axes = (variance > noisy) & (typical > 0.0)
        bad_axis = noisy_axes | ((jump > limit) & (limit > 0.0))
        bad: Mask = np.logical_or.reduce(bad_axis, axis=1)
        for k in np.flatnonzero(np.diff(bad.astype(int), prepend=0) == 1):
            axis = int(np.argmax(bad_axis[k]))
            end = int(k + np.argmin(np.append(bad[k:], False)))
            size = max(float(jump[k:end, axis].max()), float(np.sqrt(variance[k:end, axis].max())))
            seconds = self._window / self._rate
            self.disturbed.append(Movement(axis, begin + k * seconds, begin + end * seconds, size))
        return np.convolve(bad, np.ones(3), mode="same") > 0.5
