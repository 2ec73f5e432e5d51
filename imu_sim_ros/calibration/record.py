# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""A record at rest: its stamps, its readings and its motion, before anything is computed from it.

Missing samples are found by the stamps, readings that are no noise by their values, and motion by
the means of each second: slow motion is reported, single disturbances are cut out.
"""

from collections.abc import Callable, Iterable, Iterator
from itertools import pairwise
from typing import Final, NamedTuple, Protocol

import numpy as np

from imu_sim_ros import conventions
from imu_sim_ros.conventions import TRIADS
from imu_sim_ros.errors import InputError
from imu_sim_ros.types import Array, Integers, Mask, Times

AXES: Final = tuple(f"{triad} {axis}" for triad in TRIADS for axis in conventions.AXES)
_LOOKED_AT: Final = 4096
_MAX_CODES: Final = 256
_SATURATED: Final = 1e-4
"""Share of samples at the very same extreme value."""
_PILED_UP: Final = 4
"""Hits of an extreme value over those of the value next to it that no tail of noise reaches."""
_ROUNDING: Final = 16.0 * float(np.finfo(np.float64).eps)
"""Relative change of a reading that is not the sensor's: float64 has no more digits."""


class ReadingsBlock(Protocol):
    """A block of messages."""

    @property
    def t_ns(self) -> Integers:
        """(n,) stamps."""

    @property
    def gyro(self) -> Array:
        """(n, 3) [rad/s]."""

    @property
    def accel(self) -> Array:
        """(n, 3) [m/s^2]."""


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


class Record:
    """Takes the messages of one or more bags of one sensor, passes on what is at rest."""

    rate: float
    """Samples per second [Hz], known from the first block on."""
    rest: "RestCheck"
    """What was found of motion, from the first block on."""
    _interval: float
    """Nominal [ns]."""

    def __init__(self) -> None:
        self.samples = 0
        self.lowest = _Extreme(np.minimum)
        self.highest = _Extreme(np.maximum)
        self.steps = StepFinder(6)
        self._sum = np.zeros(6)
        self._square = np.zeros(6)
        self._clock: SampleClock | None = None
        """Of the bag that is read, from its first message on."""
        self._lost = self._filled = self._gaps = self._duplicates = 0
        self._longest_gap = 0
        self._intervals = np.zeros(3)  # count, sum and sum of squares, relative to the nominal
        self._span = np.zeros(2)  # time and count of intervals, gaps apart

    def at_rest(
        self,
        bags: Iterable[Iterable[ReadingsBlock]],
        advance: Callable[[int], None] = lambda count: None,
    ) -> Iterator[Array | None]:
        """Yield readings (n, 6) at rest, with rows of NaN for lost ones, and None if a piece ends.

        :param bags: for each bag its messages, in blocks.
        :param advance: called with the number of messages read.
        :raises InputError: for stamps that run backwards.
        """
        for bag in bags:
            for block in bag:
                if len(block.t_ns):
                    readings = np.concatenate([block.gyro, block.accel], axis=1)
                    for piece in self._pieces(block.t_ns, readings):
                        yield from self.rest.add(piece)
                advance(len(block.t_ns))
            self._clock = None
            if self.samples:
                yield from self.rest.add(None)

    def _pieces(self, t_ns: Times, y: Array) -> Iterator[Array | None]:
        """Take messages, note what they are like, and yield them cut where there are gaps."""
        if not self.samples:
            self._interval = sampling_interval(t_ns)
            self.rate = 1e9 / self._interval
            self.rest = RestCheck(self.rate, self.steps)
        is_first = self._clock is None
        clock = self._clock = self._clock or SampleClock(self._interval)
        before = t_ns[0] - 1 if clock.last_ns is None else clock.last_ns
        steps = np.diff(t_ns, prepend=before)
        if np.any(steps < 0):
            k = int(np.argmax(steps < 0))
            raise InputError(
                f"stamps run backwards by {-steps[k] * 1e-9:.6f} s at sample {self.samples + k}: "
                "sort the bag by stamp first"
            )
        new = steps > 0
        if not new.all():
            self._duplicates += int(np.count_nonzero(~new))
            t_ns, y, steps = t_ns[new], y[new], steps[new]
            if not len(y):  # nothing but repetitions of the message before
                return
        self.samples += len(y)
        columns = np.ascontiguousarray(y.T)
        self._sum += columns.sum(axis=1)
        self._square += np.einsum("an,an->a", columns, columns)
        self.lowest.take(columns)
        self.highest.take(columns)
        self.steps.look(columns)
        missing = clock.missing(t_ns)
        lost = int(missing.sum())
        near = missing <= clock.longest
        connected = near.copy()
        connected[0] &= not is_first
        self._span += steps[connected].sum(), (1 + missing[connected]).sum()
        regular = steps[connected & (missing == 0)] / self._interval - 1.0
        self._intervals += [len(regular), regular.sum(), (regular**2).sum()]
        if not lost:
            yield y
            return
        self._lost += lost
        self._filled += int(missing[near].sum())
        starts = np.concatenate([[0], np.flatnonzero(~near), [len(y)]])
        for start, stop in pairwise(starts):
            if start < len(y) and not near[start]:
                self._gaps += 1
                self._longest_gap = max(self._longest_gap, int(missing[start]) + 1)
                missing[start] = 0
                yield None
            if stop > start:
                there = np.cumsum(missing[start:stop] + 1) - 1
                piece = np.full((int(there[-1]) + 1, y.shape[1]), np.nan)
                piece[there] = y[start:stop]
                yield piece

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
        size = np.maximum(np.abs(self.lowest.value), np.abs(self.highest.value))
        same = self.highest.value - self.lowest.value <= _ROUNDING * size
        return [int(k) for k in np.flatnonzero(same)]

    def saturated_axes(self) -> list[tuple[int, float, float]]:
        """Return axis, value and share of samples where readings pile up at one end.

        Noise has fewer readings at the end than at the value next to it; at the end of a sensor's
        range all that lies beyond comes on top of it.
        """
        result = []
        spread = np.sqrt(np.maximum(self._square / self.samples - self.mean**2, 0.0))
        for end in (self.lowest, self.highest):
            far = np.abs(end.value - self.mean) > 2.0 * spread
            often = end.hits > np.maximum(10, _SATURATED * self.samples)
            piled_up = end.hits > _PILED_UP * end.next_hits
            for k in np.flatnonzero(far & often & piled_up):
                share = float(end.hits[k] / self.samples)
                result.append((int(k), float(end.value[k]), share))
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
        extreme = self._find.reduce(columns, axis=1)
        # The axes whose readings reach the value next to the extreme one.
        for k in np.flatnonzero(self._find(extreme, self.next_value) == extreme):
            column, first = columns[k], extreme[k]
            at_first = column == first
            rest = np.where(at_first, self._none, column)
            second = self._find.reduce(rest)
            at_second = np.count_nonzero(rest == second)
            values = np.array([self.value[k], self.next_value[k], first, second])
            counts = [self.hits[k], self.next_hits[k], np.count_nonzero(at_first), at_second]
            hits = np.array(counts)
            self.value[k] = self._find.reduce(values)
            self.hits[k] = np.sum(hits[values == self.value[k]])
            beyond = np.where(values == self.value[k], self._none, values)
            self.next_value[k] = self._find.reduce(beyond)
            self.next_hits[k] = np.sum(hits[beyond == self.next_value[k]])


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


_CLEAR: Final = 0.25
"""Intervals: steps that are as close to whole numbers of them are counted one by one."""
_NUMBERED: Final = 0.25
"""Intervals of jitter up to which single losses can be seen."""
_CHUNK: Final = 512
"""Samples after which the phase of the sensor's clock is followed."""
_NEIGHBOURS: Final = 4
"""Samples on each side whose median tells a loss from a late stamp."""


def sampling_interval(t_ns: Times) -> float:
    """Return the interval [ns] at which a sensor takes its samples: the time over their count.

    Missing samples are counted. The count of intervals between two stamps follows from an estimate
    of the interval that the stamps before them give, ever further apart, so that jitter does not
    add up.

    :raises InputError: for fewer than two different stamps.
    """
    t = t_ns[np.append(True, np.diff(t_ns) > 0)]
    if len(t) < 2:
        raise InputError("fewer than two different stamps: no rate")
    steps = np.diff(t).astype(np.float64)
    interval, mean = float(np.median(steps)), float(np.mean(steps))
    if mean > 1.5 * interval:
        # Drivers that deliver in bursts have a median far below the mean, which alone is right.
        return mean
    for apart in (4, 16, 64, 256):
        spans = (t[apart:] - t[:-apart]).astype(np.float64)
        spans = spans[spans < 2.0 * apart * interval]  # no gap among them
        if len(spans):
            interval = float(np.sum(spans) / np.sum(np.rint(spans / interval)))
    clock = SampleClock(interval)
    missing = clock.missing(t)[1:]
    regular = missing <= clock.longest
    return float(np.sum(steps[regular]) / np.sum(1.0 + missing[regular]))


class SampleClock:
    """Counts the samples of one bag that are missing before each stamp, block by block."""

    def __init__(self, interval: float) -> None:
        """Set up.

        :param interval: nominal sampling interval [ns].
        """
        self.interval = interval
        self.longest = max(10.0, 1e9 / interval)
        """So many missing samples in a row are a loss; more are a gap."""
        self.last_ns: int | None = None
        """The latest stamp."""
        self._late = np.nan

    def missing(self, t_ns: Times) -> Integers:
        """Return (n,) how many samples are missing before each of n rising stamps."""
        first = t_ns[:1] if self.last_ns is None else np.array([self.last_ns])
        steps = np.diff(t_ns, prepend=first) / self.interval
        if self.last_ns is None:
            steps[0] = 1.0
        self.last_ns = int(t_ns[-1])
        whole = np.rint(steps)
        if np.all(np.abs(steps - whole) < _CLEAR) and np.all(whole >= 1.0):
            self._late = 0.0
            return (whole - 1.0).astype(np.int64)
        return self._among_jitter(steps)

    def _among_jitter(self, steps: Array) -> Integers:
        """Return the missing samples if stamps jitter: lasting shifts against the count."""
        spread = 1.4826 * float(np.median(np.abs(steps - 1.0))) / np.sqrt(2.0)
        if spread > _NUMBERED:
            late = steps > 1.5 + 8.0 * np.sqrt(2.0) * spread
            self._late = 0.0
            return np.where(late, np.rint(steps) - 1.0, 0.0).astype(np.int64)
        missing = np.where(steps > self.longest + 1.5, np.rint(steps) - 1.0, 0.0)
        starts = np.concatenate([[0], np.flatnonzero(missing), [len(steps)]])
        for start, stop in pairwise(starts):
            run = steps[start:stop] - 1.0
            if missing[start]:  # a gap: the phase of the clock after it is not known
                run[0], self._late = 0.0, np.nan
            for first in range(0, len(run), _CHUNK):
                part = slice(first, first + _CHUNK)
                missing[start:stop][part] += self._shifts(run[part])
        return missing.astype(np.int64)

    def _shifts(self, steps: Array) -> Array:
        """Return how many intervals each stamp is later than its neighbours explain.

        :param steps: less one, in intervals.
        """
        if not len(steps):
            return steps
        if np.isnan(self._late):
            angle = 2j * np.pi * np.cumsum(steps)
            self._late = -float(np.angle(np.mean(np.exp(angle)))) / (2.0 * np.pi)
        late = self._late + np.cumsum(steps)
        padded = np.pad(late, min(_NEIGHBOURS, len(late) - 1), mode="symmetric")
        width = len(padded) - len(late) + 1
        typical = np.median(np.lib.stride_tricks.sliding_window_view(padded, width), axis=1)
        shift = np.maximum.accumulate(np.maximum(np.rint(typical), 0.0))
        phase = float(np.median(late - shift))
        trust = len(late) / (len(late) + 0.1 * _CHUNK)
        self._late = float(late[-1] - shift[-1]) - trust * phase
        return np.diff(shift, prepend=0.0)


_WINDOWS: Final = 256
"""Windows of about a second that are judged together."""
_NOISIER: Final = 6.0
"""Ratio of a window's variance to the median one that no stationary noise reaches."""
_JUMP: Final = 12.0
"""Jump between neighbouring window means, in robust standard deviations."""
_SLOW: Final = 25.0
"""Variance of the window means over that of white noise of the same samples."""
_SMALLEST_MOTION: Final = np.array([2e-3] * 3 + [2e-2] * 3)
"""Below this the means of a second may wander [rad/s, m/s^2]: that is a sensor's random walk."""
_SUDDEN: Final = 50.0
"""Variance of the means in one stretch over the median one that no random walk reaches.

Without its line, a walk's variance in a stretch is nearly chi-square's of one degree of freedom,
which is 23 times its mean, 50 times its median, once in 10^6.
"""
_MIN_WINDOWS: Final = 4
"""Number of stretches below which none of them can stand out."""


class Movement(NamedTuple):
    """Seconds in which an axis was not at rest."""

    axis: int
    begin: float
    """[s] after the first sample"""
    end: float
    size: float
    """Standard deviation of the means over a second, or the largest jump [rad/s, m/s^2]."""


class RestCheck:
    """Takes pieces of readings, passes on those at rest."""

    def __init__(self, rate: float, steps: StepFinder) -> None:
        """Set up.

        :param rate: samples per second [Hz].
        :param steps: knows the digital steps of the readings, as far as they have been seen.
        """
        self._window = max(round(rate), 4)
        self._rate, self._steps = rate, steps
        self._buffer: list[Array] = []
        self._buffered = 0
        self._before: Array | None = None
        self.moving: list[Movement] = []
        """Stretches of continued motion, or of a walk of such size; they are handed on."""
        self.spreads: list[Array] = []
        """(6,) for each stretch: standard deviation of the means of a second, without a line."""
        self._variance = np.zeros(6)
        self._windows_seen = 0
        self.disturbed: list[Movement] = []
        """Single disturbances; they are cut out."""
        self.seconds = 0.0

    def add(self, y: Array | None) -> Iterator[Array | None]:
        """Take readings (n, 6), or None at the end of a piece; yield them, judged."""
        if y is None:
            yield from self._judge()
            self._before = None
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
        """Yield what has been waiting without its disturbed windows."""
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
        self._windows_seen += int(np.count_nonzero(~bad))
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
        """Return means and variances (windows, 6) of so many windows of readings.

        With the samples first NumPy adds long rows, four times as fast as six numbers at a time.
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

        A window without half of its readings has the mean of the last one before it and the
        typical variance: nothing is known of it.
        """
        windows = y.reshape(count, self._window, 6)
        known = np.count_nonzero(~np.isnan(windows[:, :, 0]), axis=1)
        centre = np.nanmean(y, axis=0)
        there = np.where(np.isnan(windows), 0.0, windows - centre)
        number = np.maximum(known, 1)[:, None]
        mean = there.sum(axis=1) / number
        variance = np.maximum((there**2).sum(axis=1) / number - mean**2, 0.0)
        half = known >= 0.5 * self._window
        last = np.maximum.accumulate(np.where(half, np.arange(count), 0))
        variance[~half] = np.median(variance[half], axis=0) if half.any() else 0.0
        return centre + mean[last], variance

    def _note_motion(self, mean: Array, typical: Array, begin: float) -> None:
        # A single shock or shift of level is a disturbance; without it the rest must be at rest.
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
        return np.sqrt(self._variance / max(self._windows_seen, 1))

    def sudden(self, motion: Movement) -> bool:
        """Return whether a motion is far larger than the axis' motion in the other stretches."""
        if len(self.spreads) < _MIN_WINDOWS:
            return False
        typical = float(np.median([spread[motion.axis] for spread in self.spreads]))
        return motion.size**2 > _SUDDEN * typical**2

    def sways(self, axis: int, amplitude: float, samples: float) -> bool:
        """Return whether a sinusoid is motion: too fast and too large for a sensor's own drift.

        :param amplitude: of the sinusoid [rad/s, m/s^2].
        :param samples: its period.
        """
        fast = samples < _WINDOWS * self._window
        return bool(fast and amplitude > np.sqrt(2.0) * _SMALLEST_MOTION[axis])

    def _jump_limit(self, jump: Array, typical: Array) -> Array:
        """Return (6,) the difference between neighbouring means that no noise makes."""
        robust = 1.4826 * np.median(jump, axis=0)
        result: Array = _JUMP * np.maximum(robust, np.sqrt(2.0 * typical / self._window))
        return result + self._steps.step

    def _disturbances(self, mean: Array, variance: Array, typical: Array, begin: float) -> Mask:
        """Return (windows,) which were disturbed, with one window of margin on both sides."""
        before = mean[:1] if self._before is None else self._before
        jump = np.abs(np.diff(mean, axis=0, prepend=before))
        self._before = mean[-1:]
        limit = self._jump_limit(jump, typical)
        # An axis that hardly changes its last digit has a typical variance of zero.
        # One that goes to and fro between two codes has half a step as its deviation.
        noisy = _NOISIER * (typical + 0.25 * self._steps.step**2)
        shaken = (variance > noisy) & (typical > 0.0)
        bad_axis = shaken | ((jump > limit) & (limit > 0.0))
        bad: Mask = np.logical_or.reduce(bad_axis, axis=1)
        for k in np.flatnonzero(np.diff(bad.astype(int), prepend=0) == 1):
            axis = int(np.argmax(bad_axis[k]))
            end = int(k + np.argmin(np.append(bad[k:], False)))
            size = max(float(jump[k:end, axis].max()), float(np.sqrt(variance[k:end, axis].max())))
            seconds = self._window / self._rate
            self.disturbed.append(Movement(axis, begin + k * seconds, begin + end * seconds, size))
        return np.convolve(bad, np.ones(3), mode="same") > 0.5
