# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""The clock behind the stamps of a recording: rate, rounding, batches, losses, pieces.

Sample k of a sensor is taken at ``a + b k``; a driver or a host stamps it. A stamp differs from
the time of its sample by rounding (to a unit, or to the time at which a batch was delivered) or by
jitter. A loss is a lasting shift of stamps against their count by whole intervals b, which neither
rounding nor jitter makes.
"""

import dataclasses
import math
from dataclasses import dataclass
from itertools import pairwise
from typing import Final, NamedTuple

import numpy as np

from imu_sim_ros.core.errors import InputError
from imu_sim_ros.core.types import Array, Integers, Mask, Times
from imu_sim_ros.recordings.order import (
    CLOCK_CHANGE_NS,
    RESET_READINGS,
    StampOrder,
    longest_loss,
    order_stamps,
)

CLEAR: Final = 0.25
"""Intervals: steps that are as close to whole numbers of them are counted one by one."""
_NUMBERED: Final = 0.25
"""Intervals of jitter up to which single losses can be told from late stamps."""
_CHUNK: Final = 512
"""Samples after which the phase of the sensor's clock is followed."""
_NEIGHBOURS: Final = 4
"""Samples on each side whose median tells a loss from a late stamp."""
_STRIP: Final = 1024
"""Batches that are compared with the range of rounding at once."""
_SLACK: Final = 0.05
"""Intervals by which errors may exceed the range of rounding."""
_DRIFT: Final = 2e-4
"""Intervals that the phase of a clock may drift at each sample."""
_COARSE: Final = 2.0
"""Intervals in units below which a step does not tell by itself how many samples it has.

A step of m intervals is rounded by less than a unit; nearest whole numbers of intervals are right
as long as that is less than half an interval.
"""
_COARSEST_NS: Final = 1_001_000.0
"""Largest unit of a clock whose stamps alone do not tell rounding from losses [ns]: a millisecond,
with the skew of another clock."""
_STRETCHES: Final = (8192, 2048)
"""Numbers of stamps on one line."""
_SIMPLER: Final = 0.75
"""Share of losses that a rounded clock must save against one that is not rounded."""
_FINE: Final = 0.02
"""Share of an interval below which a unit does not matter."""
_TOLERANCE: Final = 0.25
"""Share by which errors may exceed the range of rounding; a loss exceeds it by 0.75 at least."""
_FEWEST_WRAPS: Final = 4
"""Longer steps, at equal distances, from which on they come from rounding rather than losses."""
_SAMPLE: Final = 65536
"""Stamps of which the pattern is found."""
_SEARCHED: Final = 2048
"""Batches of the search for an interval among coarse rounding and losses."""
_MOST_INTERVALS: Final = 8192
"""Intervals that the search tries."""
_CONTRADICTION: Final = 3.0
"""Losses that one stamp too early for an interval outweighs."""
_MARGIN: Final = 0.02
"""Share by which the search goes beyond the mean interval, and a strip beyond the rounding."""
_MOST_LOST: Final = 0.4
"""Largest share of lost samples that the search allows for."""
SHORT: Final = 0.25
"""Steps within a bunch are shorter than this share of the mean step."""
_BUNCHED: Final = 0.45
"""Share of short steps from which on readings come in bunches: half of them in pairs."""
_REGULAR: Final = 0.25
"""Relative deviation up to which bunches come at regular times."""
_FASTEST_NS: Final = 20_000.0
"""Interval below which stamps are not in nanoseconds: no IMU is sampled at more than 50 kHz."""
_SMOOTHED: Final = 1025
"""Stamps over which the line through rounded ones is averaged."""
_EVEN: Final = 0.5
"""Relative deviation of the distances of repeated stamps below which they are no coincidence."""
_FEW_SHARED: Final = 0.02
"""Share of readings without a stamp of their own up to which they are no batches."""
_JITTER_OF_UNIT: Final = 0.6
"""Units: rounding makes 0.29 of them, twice as much is jitter that was rounded as well."""
_EXACT_NS: Final = 2.0
"""Largest jitter of exact stamps [ns]."""
_EXACT: Final = 1e-4
"""Deviation from equal intervals, in intervals, up to which a clock is exact."""
_UNITS: Final = ((1e3, "us"), (1e6, "ms"), (1e9, "s"))


class StampPattern(NamedTuple):
    """The way in which stamps follow each other."""

    interval_ns: float
    """Time between two samples of the sensor [ns]."""
    unit_ns: float
    """Unit to which stamps are rounded [ns]; 0: none that matters."""
    bunch_ns: float
    """Steps up to this are within a batch [ns]; -1: each reading has a stamp of its own."""
    coarse: bool
    """True if rounding leaves it to several stamps to tell a loss."""
    rounded: bool
    """True if the errors of stamps stay within the range of rounding."""

    def heads(self, t_ns: Times) -> Integers:
        """Return the rows (m,) that begin a batch, of n stamps in order."""
        if self.bunch_ns < 0.0:
            return np.arange(len(t_ns))
        return np.flatnonzero(
            np.diff(t_ns, prepend=t_ns[:1] - 2 - int(self.bunch_ns)) > self.bunch_ns
        )

    @property
    def error(self) -> float:
        """Range of the errors of the first stamps of batches by rounding, in intervals."""
        if self.bunch_ns >= 0.0:
            return min(1.0, self.unit_ns / self.interval_ns) if self.unit_ns else 1.0
        return min(1.0, self.unit_ns / self.interval_ns)


def _refine_interval(
    pattern: StampPattern, t_ns: Times, rows: Integers
) -> tuple[StampPattern, Integers]:
    """Return a pattern of coarse stamps with the interval by the losses, and the losses.

    Losses and interval depend on each other; they settle in two or three rounds.

    :param rows: (k,) rows of the first stamps of batches.
    :returns: the pattern, and the readings (k - 1,) missing between these stamps.
    """
    heads = t_ns[rows]
    counts, steps = np.diff(rows), np.diff(heads)
    missing = np.zeros(len(counts), np.int64)
    for _ in range(3):
        missing = Losses(pattern).count(t_ns)[rows[1:]]
        if not missing.any():
            break
        interval = _interval_by_count(steps, counts + missing, pattern.interval_ns)
        if missing.max() <= longest_loss(interval):
            numbers = np.append(0, np.cumsum(counts + missing))
            interval = _line(numbers, heads)[0]
        pattern = pattern._replace(interval_ns=interval)
    return pattern, missing


def find_pattern(t_ns: Times) -> StampPattern:
    """Return the pattern of stamps of one stretch of time, of which the first 65,536 are used.

    Stamps may be shared by the readings of a batch, jitter, or be rounded to a unit as coarse as
    the interval; readings may be missing. All that follows is about the first stamps of batches.

    :param t_ns: (n,) stamps in order [ns].
    :raises InputError: for fewer than two different stamps.
    """
    t_ns = t_ns[:_SAMPLE]
    if len(t_ns) < 2 or t_ns[0] == t_ns[-1]:
        raise InputError("fewer than two different stamps: no rate")
    bunch_ns = bunch_limit(t_ns)
    pattern = StampPattern(1.0, 0.0, bunch_ns, False, False)
    rows = pattern.heads(t_ns)
    heads = t_ns[rows]
    if len(heads) < 2:
        pattern = pattern._replace(bunch_ns=-1.0)
        rows = np.flatnonzero(np.diff(t_ns, prepend=t_ns[0] - 1) > 0)
        heads = t_ns[rows]
    if bunch_ns >= 0.0 and len(rows) > 2:
        rows, heads = rows[1:], heads[1:]  # the first batch may have begun before the recording
    counts, steps = np.diff(rows), np.diff(heads)
    unit_ns = _unit(steps)
    mean = float(steps.sum() / counts.sum())
    has_own_stamps = len(rows) >= (1.0 - _FEW_SHARED) * (rows[-1] - rows[0] + 1)
    typical = _typical_interval(rows, heads)
    # Missing readings if every step is a whole number of intervals; else None.
    losses = _clear(steps / typical - counts)
    interval = _interval_by_long_spans(rows, heads, typical)
    # Rounding as coarse as the interval makes steps look like losses.
    coarse = not has_own_stamps or 0.0 < interval < _COARSE * unit_ns
    if coarse and has_own_stamps and unit_ns > _COARSEST_NS:
        coarse = False
    if losses is not None:
        events = int(np.count_nonzero(losses))
        if not coarse or events < _FEWEST_WRAPS:
            interval = _interval_by_count(steps, counts + losses, typical)
            return StampPattern(interval, unit_ns, bunch_ns, False, True)
    if coarse:
        coarse_interval = _interval_by_lines(rows, heads, unit_ns, losses)
        if coarse_interval is None and unit_ns:
            coarse_interval = _interval_of_fewest_losses(rows, heads, unit_ns, mean)
        if coarse_interval is not None:
            pattern = StampPattern(coarse_interval, unit_ns, bunch_ns, True, True)
            pattern, missing = _refine_interval(pattern, t_ns, rows)
            # Nearly as many losses on a grid without rounding are more likely.
            if losses is None or missing.sum() < _SIMPLER * losses.sum():
                return pattern
        if losses is not None:
            interval = _interval_by_count(steps, counts + losses, typical)
            return StampPattern(interval, unit_ns, bunch_ns, False, True)
    # Stamps that jitter, or are rounded to less than an interval.
    pattern = StampPattern(interval, unit_ns, bunch_ns, False, False)
    missing = Losses(pattern).count(t_ns)[rows[1:]]
    regular = missing <= longest_loss(interval)
    total = (counts + missing)[regular].sum()
    if total:
        interval = float(steps[regular].sum() / total)
    excess = steps / interval - counts
    is_rounded = bool(
        unit_ns
        and not coarse
        and np.abs(excess - np.rint(excess)).max() <= unit_ns / interval + 1e-6
        and interval > 2.0 * unit_ns
    )
    return StampPattern(interval, unit_ns, bunch_ns, False, is_rounded)


def bunch_limit(t_ns: Times) -> float:
    """Return the longest step within a batch [ns]; -1: none are in batches."""
    steps = np.diff(t_ns)
    positive = steps[steps > 0]
    repeats = len(steps) - len(positive)
    usual = float(np.median(positive))
    regular = positive[positive <= usual * (longest_loss(usual) + 1.0)] if usual else positive
    mean = float(regular.mean()) if len(regular) else 0.0
    short = regular < SHORT * mean
    if np.count_nonzero(short) >= _BUNCHED * len(regular) and not short.all():
        limit = float(regular[short].max())
        rows = np.flatnonzero(np.append(True, steps > limit))
        periods, sizes = np.diff(t_ns[rows]), np.diff(rows)
        if _is_regular(periods) and _is_regular(sizes):
            return limit
    return 0.0 if repeats else -1.0


def _is_regular(values: Integers) -> bool:
    """Return True if values differ little from their median, by one or by a quarter."""
    middle = float(np.median(values))
    return float(np.median(np.abs(values - middle))) <= max(_REGULAR * middle, 1.0)


def _unit(steps: Integers) -> float:
    """Return the unit of which steps (n,) [ns] are whole numbers, 0 if it does not matter.

    Decimal units are exact; those of another clock differ by its skew and by rounding to
    nanoseconds, so that the unit is a greatest common divisor among steps that are a few
    nanoseconds apart.
    """
    values = np.unique(steps)
    middle = float(np.median(steps))
    if values[-1] - values[0] <= 2:
        return 0.0 if values[0] % 1_000_000 else float(decimal_unit(values))
    unit = float(decimal_unit(values))
    if unit >= _FINE * middle:
        return unit
    starts = np.flatnonzero(np.diff(values, prepend=values[0] - 10) > 4)
    if len(starts) > 256:
        return 0.0
    centres = [float(part.mean()) for part in np.split(values, starts[1:])]
    divisor = centres[0]
    for centre in centres[1:]:
        a, b = max(centre, divisor), min(centre, divisor)
        while b > _FINE * middle:
            a, b = b, abs(a - round(a / b) * b)
        if b > 4.0 + 1e-6 * middle:
            return 0.0
        divisor = a
    return divisor if divisor >= _FINE * middle else 0.0


def decimal_unit(values: Integers) -> int:
    """Return the largest power of ten up to 1e9 of which all values are multiples."""
    unit = 1
    while unit < 1_000_000_000 and not np.any(values % (10 * unit)):
        unit *= 10
    return unit


def _clear(excess: Array) -> Integers | None:
    """Return the whole numbers (n,) next to excess steps, None if some are not clear."""
    whole = np.rint(excess)
    if np.all(np.abs(excess - whole) < CLEAR) and np.all(whole >= 0.0):
        return whole.astype(np.int64)
    return None


def _interval_by_count(steps: Integers, samples: Integers, interval: float) -> float:
    """Return the interval [ns] of steps with counted samples, pauses left out."""
    regular = samples <= longest_loss(interval) + 1.0
    if not regular.any():
        return interval
    return float(steps[regular].sum() / samples[regular].sum())


def _typical_interval(rows: Integers, heads: Times) -> float:
    """Return a first estimate of the interval [ns], which losses of a few percent leave alone."""
    single = np.diff(heads) / np.diff(rows)
    middle = float(np.median(single))
    alike = np.mean(np.abs(single - middle) < 0.02 * middle) > 0.5
    uneven = (single < 0.98 * middle) | ((single > 1.02 * middle) & (single < 1.9 * middle))
    if len(heads) < 32 or (alike and np.mean(uneven) < 0.02):
        return middle
    spans, counts = heads[8:] - heads[:-8], rows[8:] - rows[:-8]
    return float(np.median(spans / counts))


def _interval_by_long_spans(rows: Integers, heads: Times, interval: float) -> float:
    """Return the interval [ns] from ever longer spans, so that jitter does not add up."""
    for apart in (4, 16, 64, 256):
        spans = (heads[apart:] - heads[:-apart]).astype(np.float64)
        samples = rows[apart:] - rows[:-apart]
        regular = spans < (samples + apart) * interval  # no gap among them
        if regular.any():
            counts = np.rint(spans[regular] / interval)
            interval = float(spans[regular].sum() / counts.sum())
    return interval


def _interval_by_lines(
    rows: Integers, heads: Times, unit_ns: float, longer: Integers | None
) -> float | None:
    """Return the interval [ns] if most stretches of stamps are on a line but for rounding.

    :param longer: (n - 1,) the samples that are missing if steps are not rounded; stretches with
        only a few of them do not tell rounding from losses.
    """
    for size in (len(rows), *_STRETCHES):
        if size > len(rows):
            continue
        slopes, total = [], len(rows) // size
        for start in range(0, total * size, size):
            part = slice(start, start + size)
            slope, spread = _line(rows[part], heads[part])
            allowed = min(unit_ns, slope) if unit_ns else slope
            wraps = longer is None or np.count_nonzero(longer[part]) >= _FEWEST_WRAPS
            if wraps and spread <= (1.0 + _TOLERANCE) * allowed + 3.0:
                slopes.append(slope)
        if 2 * len(slopes) > total:
            return float(np.median(slopes))
    return None


def _line(rows: Integers, heads: Times) -> tuple[float, float]:
    """Return the slope of stamps over their rows, and the range of the residuals [ns]."""
    k = (rows - rows[0]).astype(np.float64)
    t = (heads - heads[0]).astype(np.float64)
    # Least squares tilt a sawtooth; the line between both ends of it does not.
    centred = k - k.mean()
    slopes = (float(centred @ t / (centred @ centred)), float(t[-1] / k[-1]))
    lines = [(slope, float(np.ptp(t - slope * k))) for slope in slopes]
    return min(lines, key=lambda line: line[1])


def _interval_of_fewest_losses(rows: Integers, heads: Times, unit_ns: float, mean: float) -> float:
    """Return the interval [ns] that explains coarsely rounded stamps by the fewest losses.

    For each of many intervals the stamps are followed in a strip as wide as the rounding: a stamp
    beyond its upper end has losses before it; one beyond its lower end contradicts the interval.

    :param rows: (k,) rows of the first stamps of batches.
    :param heads: (k,) these stamps [ns].
    :param unit_ns: unit to which the stamps are rounded [ns].
    :param mean: duration over the number of stamps [ns]; losses make it longer than the interval.
    """
    steps, counts = np.diff(heads[: _SEARCHED + 1]), np.diff(rows[: _SEARCHED + 1])
    # The slope must be known to a fraction of an interval over all of the stamps.
    number = int((_MOST_LOST + _MARGIN) * 5.0 * counts.sum())
    shares = np.linspace(1.0 - _MOST_LOST, 1.0 + _MARGIN, min(number, _MOST_INTERVALS))
    intervals = mean * shares
    width = np.minimum(unit_ns / intervals, 1.0) + _MARGIN
    # For each interval, in intervals: lateness of the stamp, and limits of the strip about it.
    late, low, high, cost = np.zeros((4, len(intervals)))
    for step, count in zip(steps.tolist(), counts.tolist(), strict=True):
        late += step / intervals - count
        lost = np.ceil(np.maximum(late - low - width, 0.0))
        late -= lost
        contradicts = high - late > width + lost
        cost += lost + _CONTRADICTION * contradicts
        high = np.where(contradicts, late + width, np.maximum(high - lost, late))
        low = np.minimum(low, late)
        low = np.maximum(low, high - width)
    best = np.flatnonzero(cost == cost.min())
    return float(intervals[best[len(best) // 2]])


class Strip:
    """Range of the lateness of coarsely rounded stamps, which losses alone leave."""

    def __init__(self, width: float) -> None:
        """Initialise without steps.

        :param width: range of the errors of rounding, in intervals.
        """
        self.width = width
        self.late = self.low = self.high = 0.0
        """Lateness of the last stamp, the least and the largest of those before, in intervals."""

    def add(self, excess: float, longest: float) -> int:
        """Add the next step; return the samples that are missing in it.

        :param excess: length of the step beyond its readings, in intervals.
        :param longest: so many missing samples are a loss, more are a pause, in which the phase of
            the clock is not unique.
        """
        if excess > longest + 0.5:  # a pause: the strip starts anew
            self.late = self.low = self.high = 0.0
            return round(excess)
        late = self.late + excess
        # The limits by earlier stamps loosen, because the phase of the clock drifts.
        low, high = self.low + _DRIFT, self.high - _DRIFT
        lost = 0
        if late - low > self.width:  # later than rounding can make it: samples are missing
            lost = math.ceil(late - low - self.width)
            late -= lost
            high = max(high - lost, late)
        if high - late > self.width:  # earlier than rounding can make it: the strip follows
            high = late + self.width
        self.late, self.high = late, max(high, late)
        self.low = max(min(low, late), self.high - self.width)
        return lost


class Losses:
    """Counts the samples that are missing before each stamp, block by block."""

    def __init__(self, pattern: StampPattern) -> None:
        """Initialise without stamps.

        :param pattern: pattern of the stamps.
        """
        self.pattern = pattern
        self.interval_ns = pattern.interval_ns
        """[ns]; of coarse rounding followed over all stamps."""
        self.longest = longest_loss(pattern.interval_ns)
        """Largest number of missing samples in a row that is a loss; more are a pause."""
        self.last_ns: int | None = None
        """The latest stamp."""
        self._head_ns, self._head_rows = 0, 0
        """First stamp of the latest batch [ns], and the batch's readings so far."""
        self._late = np.nan
        self._strip = Strip(pattern.error + _SLACK)
        self._partial = pattern.bunch_ns >= 0.0
        """True if the latest batch may have begun before the recording, or within a pause."""
        self.passed = np.zeros(2)
        """Time [ns] and intervals between the first stamps of batches, pauses apart."""
        self.deviations = np.zeros(3)
        """Count, sum and sum of squares of what steps of stamps are longer than their intervals, in
        intervals."""
        self._followed = np.zeros(2)

    def count(self, t_ns: Times) -> Integers:
        """Return the number (n,) of samples missing before each of n stamps in order."""
        missing = np.zeros(len(t_ns), dtype=np.int64)
        for begin in range(0, len(t_ns), _SAMPLE):
            part = slice(begin, begin + _SAMPLE)
            missing[part] = self._count(t_ns[part])
        return missing

    def _count(self, t_ns: Times) -> Integers:
        """Return the number of readings (n,) missing before each of n stamps.

        Stamps of one batch are alike, so only the steps between the first stamps of batches,
        ``heads``, are compared with the readings between them.
        """
        missing = np.zeros(len(t_ns), dtype=np.int64)
        heads = self.pattern.heads(t_ns)
        if self.last_ns is None:
            self._head_ns, self._head_rows = int(t_ns[0]), 0
            heads = heads[1:]
        elif t_ns[0] - self.last_ns <= self.pattern.bunch_ns:
            heads = heads[1:]
        self.last_ns = int(t_ns[-1])
        if not len(heads):
            self._head_rows += len(t_ns)
            return missing
        rows = np.diff(heads, prepend=-self._head_rows)
        steps = np.diff(t_ns[heads], prepend=self._head_ns)
        self._head_ns, self._head_rows = int(t_ns[heads[-1]]), len(t_ns) - int(heads[-1])
        # Intervals of each step beyond those of its readings.
        excess = steps / self.interval_ns
        excess -= rows
        partial = np.zeros(len(steps), dtype=np.bool_)
        if self.pattern.bunch_ns >= 0.0:
            # A recording may begin within a batch, at its start and after a pause.
            partial[0] = self._partial
            partial[1:] = excess[:-1] > self.longest + 0.5
            self._partial = bool(excess[-1] > self.longest + 0.5)
            excess[partial] = 0.0
        if self.pattern.coarse:
            lost = np.empty(len(steps), dtype=np.int64)
            for begin in range(0, len(steps), _STRIP):
                part = slice(begin, begin + _STRIP)
                lost[part] = self._missing_by_rounding(excess[part])
                self._follow(steps[part], rows[part] + lost[part])
        else:
            lost = self._missing_samples(excess)
        missing[heads] = lost
        regular = (lost <= self.longest) & ~partial
        if not regular.all():
            steps, rows, excess, lost = (
                steps[regular],
                rows[regular],
                excess[regular],
                lost[regular],
            )
        self.passed += steps.sum(), rows.sum() + lost.sum()
        excess -= lost
        self.deviations += np.array([len(excess), excess.sum(), excess @ excess])
        return missing

    def _missing_samples(self, excess: Array) -> Integers:
        """Return the missing samples of steps that exceed the intervals of their readings.

        :param excess: (n,) time by which each step is too long, in intervals.
        """
        whole = np.rint(excess)
        clear = self.pattern.rounded or np.all(np.abs(excess - whole) < CLEAR)
        if clear and np.all(whole >= 0.0):
            self._late = 0.0
            return whole.astype(np.int64)
        return self._missing_by_jitter(excess)

    def _missing_by_rounding(self, excess: Array) -> Integers:
        """Return the missing samples if rounding is as coarse as the interval."""
        strip = self._strip
        late = strip.late + np.cumsum(excess)
        lowest, highest = float(late.min()), float(late.max())
        if max(strip.high, highest) - min(strip.low, lowest) <= strip.width:
            forgotten = _DRIFT * len(late)
            strip.late = float(late[-1])
            strip.low = min(strip.low + forgotten, lowest)
            strip.high = max(strip.high - forgotten, highest)
            return np.zeros(len(excess), dtype=np.int64)
        return np.array([strip.add(step, self.longest) for step in excess.tolist()], np.int64)

    def _follow(self, steps: Integers, samples: Integers) -> None:
        """Refine the interval by the latest steps."""
        regular = samples < self.longest
        self._followed += steps[regular].sum(), samples[regular].sum()
        time, count = self._followed.tolist()
        if count > _SAMPLE:
            self.interval_ns = time / count

    def _missing_by_jitter(self, excess: Array) -> Integers:
        """Return the missing samples if stamps jitter: lasting shifts against the count."""
        spread = 1.4826 * float(np.median(np.abs(excess))) / np.sqrt(2.0)
        if spread > _NUMBERED:
            late = excess > 0.5 + 8.0 * np.sqrt(2.0) * spread
            self._late = 0.0
            return np.where(late, np.rint(excess), 0.0).astype(np.int64)
        missing = np.where(excess > self.longest + 0.5, np.rint(excess), 0.0)
        starts = np.concatenate([[0], np.flatnonzero(missing), [len(excess)]])
        for start, stop in pairwise(starts):
            run = excess[start:stop].copy()
            if start < stop and missing[start]:  # a pause: the phase after it is not known
                run[0], self._late = 0.0, np.nan
            for begin in range(0, len(run), _CHUNK):
                part = slice(begin, begin + _CHUNK)
                missing[start:stop][part] += self._shifts(run[part])
        return missing.astype(np.int64)

    def _shifts(self, steps: Array) -> Array:
        """Return how many intervals each stamp is later than its neighbours explain."""
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


def are_batches(t_ns: Times) -> bool:
    """Return True if stamps that repeat are those of several readings, by the stamps alone.

    Repetitions of messages come at random and leave a regular grid without them; readings in
    batches are regular together.

    :param t_ns: (n,) stamps in order [ns].
    """
    t_ns = t_ns[:_SAMPLE]
    repeats = np.diff(t_ns) == 0
    if not repeats.any():
        return False
    if repeats.mean() >= _BUNCHED:
        return True
    # Random repetitions are geometrically distributed: their distances deviate by
    # sqrt(1 - share) of the mean.
    distances = np.diff(np.flatnonzero(repeats))
    if len(distances) < RESET_READINGS:
        return False
    return float(distances.std()) < _EVEN * float(distances.mean())


class Trait(NamedTuple):
    """One thing that stamps show."""

    kind: str
    """Name of the trait: exact, rounded, batches, bunches, jitter; loss, pause, reset,
    clock_change, stray, late, duplicate; unit."""
    number: int
    """Number of stamps, steps or batches that show it."""
    row: int
    """The first of them among all stamps."""
    text: str
    """The evidence in numbers."""


@dataclass(frozen=True, eq=False, repr=False)
class Clock:
    """The clock behind n stamps, and the m readings that follow it."""

    pattern: StampPattern
    """The way in which stamps follow each other."""
    interval_ns: float
    """Time between two samples [ns]."""
    interval_sigma_ns: float
    """Standard deviation of this estimate [ns]."""
    jitter_ns: float
    """Standard deviation of a stamp around equal intervals, if each is late on its own [ns]."""
    rows: Integers
    """(m,) rows of the readings to use, sorted by stamp within each piece."""
    pieces: tuple[slice, ...]
    """Stretches of these rows without a pause, a reset or a change of clock."""
    missing: Integers
    """(m,) samples that are lost before each reading; 0 at the start of a piece."""
    stamps_ns: Times
    """(m,) stamps of the readings [ns]."""
    traits: tuple[Trait, ...]
    """All that the stamps show; the kind of clock is first."""

    @property
    def rate(self) -> float:
        """Samples per second [Hz]."""
        return 1e9 / self.interval_ns

    @property
    def rate_sigma(self) -> float:
        """Standard deviation of the rate [Hz]."""
        return self.rate * self.interval_sigma_ns / self.interval_ns

    @property
    def lost(self) -> int:
        """Samples lost between readings, without those of pauses."""
        return int(self.missing.sum())

    @property
    def duration(self) -> float:
        """Time over all readings, pauses included, steps of the clock left out [s]."""
        steps = np.diff(self.stamps_ns)
        return float(steps[(steps > 0) & (steps <= CLOCK_CHANGE_NS)].sum()) * 1e-9

    @property
    def kind(self) -> str:
        """exact, rounded, batches, bunches or jitter."""
        return self.traits[0].kind

    def __repr__(self) -> str:
        kinds = ", ".join(trait.kind for trait in self.traits)
        return f"<Clock: {len(self.rows)} at {self.rate:.6g} Hz, {kinds}>"

    def trait(self, kind: str) -> Trait | None:
        """Return the trait of a kind, None if the stamps do not show it."""
        return next((trait for trait in self.traits if trait.kind == kind), None)

    def times_ns(self) -> Times:
        """Return times (m,) of the readings [ns], which increase within each piece.

        They are the stamps of an exact clock and of one that jitters. Where stamps are rounded or
        shared, the readings lie on the line through the stamps nearby, at equal intervals; a batch
        begins at its stamp.
        """
        if self.kind in {"exact", "jitter"}:
            return self.stamps_ns
        times = self.stamps_ns.copy()
        for piece in self.pieces:
            times[piece] = self._even(self.stamps_ns[piece], self.missing[piece])
        return times

    def _even(self, t_ns: Times, missing: Integers) -> Times:
        """Return stamps (n,) on an even clock that follows the smoothed lateness of n stamps.

        :param missing: (n,) readings missing before each stamp.
        """
        times_since_start = (np.arange(len(t_ns)) + np.cumsum(missing)) * self.interval_ns
        heads = self.pattern.heads(t_ns)
        late = (t_ns - t_ns[0])[heads] - times_since_start[heads]
        size = min(_SMOOTHED, len(late))
        padded = np.pad(late, (size // 2, size - 1 - size // 2), mode="reflect")
        sums = np.cumsum(np.insert(padded, 0, 0.0))
        smooth = (sums[size:] - sums[:-size]) / size
        even = times_since_start + np.interp(np.arange(len(t_ns)), heads, smooth)
        times: Times = t_ns[0] + np.rint(even).astype(np.int64)
        return times


def estimate_clock(t_ns: Times, equal: Mask | None = None) -> Clock:
    """Return the clock behind the stamps of a recording.

    :param t_ns: (n,) stamps in the order of arrival [ns].
    :param equal: (n,) True where a reading has the same values as the one before it; the same
        values with the same stamp are one message that came twice. None: not known, then stamps
        alone tell.
    :raises InputError: if there are no two different stamps.
    """
    if len(t_ns) < 2 or np.all(t_ns == t_ns[0]):
        values = f": all {len(t_ns)} are {t_ns[0]} ns" if len(t_ns) > 1 else ""
        raise InputError(f"fewer than two different stamps{values}: no rate")
    order = order_stamps(t_ns)
    pieces, duplicates = drop_duplicates(t_ns, order.pieces, equal)
    pattern = find_pattern(t_ns[max(pieces, key=len)])
    losses = [Losses(pattern) for _ in pieces]
    counts = [count.count(t_ns[piece]) for count, piece in zip(losses, pieces, strict=True)]
    rows, missing = np.concatenate(pieces), np.concatenate(counts)
    stamps = t_ns[rows]
    starts = np.cumsum([0, *map(len, pieces[:-1])])
    pause = missing > longest_loss(pattern.interval_ns)
    edges = np.union1d(starts, np.flatnonzero(pause)).tolist()
    missing[pause] = 0
    slices = tuple(slice(a, b) for a, b in pairwise([*edges, len(rows)]))
    time, samples = np.sum([loss.passed for loss in losses], axis=0).tolist()
    number, total, squares = np.sum([loss.deviations for loss in losses], axis=0).tolist()
    # A step has the errors of two stamps.
    variance = 0.5 * max(squares / number - (total / number) ** 2, 0.0) if number else 0.0
    residual = math.sqrt(variance) * pattern.interval_ns
    interval = pattern.interval_ns
    if samples > _SAMPLE or (samples and not pattern.coarse):
        interval = time / samples
    count = max(len(rows), 2)
    sigma = math.sqrt(12.0) * max(residual, 0.3) / count**1.5
    kind, text = kind_of_stamps(pattern, interval, residual, samples / number if number else 1.0)
    trait = Trait(kind, len(rows), int(rows[0]), text)
    clock = Clock(pattern, interval, sigma, residual, rows, slices, missing, stamps, (trait,))
    traits = (trait, *_events(t_ns, clock, order, duplicates))
    return dataclasses.replace(clock, traits=traits)


def repeats(values: Array) -> Mask:
    """Return True (n,) where a reading (n, m) has the values of the one before it."""
    equal = np.zeros(len(values), np.bool_)
    equal[1:] = np.all(values[1:] == values[:-1], axis=1)
    return equal


def repeated_value_rows(gyro: Array | None, accel: Array | None) -> Mask | None:
    """Return True (n,) where readings (n, 3) have the values of the ones before them.

    :returns: None without any triad: then values tell nothing of messages that came twice.
    """
    triads = [triad for triad in (gyro, accel) if triad is not None]
    if not triads or not len(triads[0]):
        return None
    return np.logical_and.reduce([repeats(triad) for triad in triads])


def drop_duplicates(
    t_ns: Times, pieces: tuple[Integers, ...], equal: Mask | None
) -> tuple[list[Integers], Integers]:
    """Return the rows of pieces without messages that came twice, and the rows of those.

    :param equal: (n,) as for :func:`estimate_clock`.
    """
    if equal is not None and len(t_ns) > 1:
        # Readings that hardly ever change do not tell repeated messages from batches.
        changed = np.diff(t_ns) != 0
        if not changed.any() or np.mean(equal[1:][changed]) > 0.5:
            equal = None
    unique, removed = [], []
    for piece in pieces:
        t = t_ns[piece]
        if np.any(t[1:] == t[:-1]):
            repeated = np.append(False, t[1:] == t[:-1])
            if equal is not None:
                repeated &= equal[piece]
            elif are_batches(t):
                repeated[:] = False
            removed.append(piece[repeated])
            piece = piece[~repeated]
        unique.append(piece)
    none = np.empty(0, dtype=np.int64)
    return unique, np.concatenate([none, *removed])


def kind_of_stamps(
    pattern: StampPattern, interval_ns: float, jitter_ns: float, size: float
) -> tuple[str, str]:
    """Return the kind of a clock and its evidence.

    :param interval_ns: time between two samples [ns].
    :param jitter_ns: standard deviation of a stamp around equal intervals [ns].
    :param size: samples for each different stamp.
    """
    rate = f"{1e9 / interval_ns:.6g} Hz"
    if pattern.bunch_ns >= 0.0 and size > 1.0 + _FEW_SHARED:
        interval = f"every {interval_ns * size * 1e-9:.4g} s: {rate}"
        if pattern.bunch_ns == 0.0:
            return "batches", f"readings share a stamp, {size:.4g} of them on average, {interval}"
        apart = f"at most {pattern.bunch_ns * 1e-6:.3g} ms apart"
        return "bunches", f"readings come in bunches of {size:.4g}, {apart}, {interval}"
    rounded = pattern.rounded or jitter_ns < _JITTER_OF_UNIT * pattern.unit_ns
    if pattern.unit_ns and jitter_ns > _EXACT_NS and rounded:
        return "rounded", f"stamps are whole numbers of {pattern.unit_ns * 1e-6:.6g} ms: {rate}"
    if jitter_ns <= max(_EXACT_NS, _EXACT * interval_ns):
        return "exact", f"stamps are {interval_ns * 1e-6:.9g} ms apart: {rate}"
    deviation = f"{jitter_ns * 1e-6:.3g} ms (standard deviation)"
    return "jitter", f"stamps deviate by {deviation} from {rate}"


def _events(t_ns: Times, clock: Clock, order: StampOrder, duplicates: Integers) -> list[Trait]:
    """Return the other traits of the stamps, worst first."""
    traits = []

    def add(kind: str, rows: Integers, text: str, number: int | None = None) -> None:
        if len(rows):
            traits.append(Trait(kind, len(rows) if number is None else number, int(rows[0]), text))

    factor, unit = number_unit(clock.interval_ns)
    if unit:
        text = f"in nanoseconds they would be {clock.interval_ns:.4g} ns apart"
        would = "row numbers" if unit == "index" else f"in {unit}: {clock.rate / factor:.6g} Hz"
        add("unit", clock.rows[:1], f"{text}; they are {would}", len(clock.rows))
    strays = ", ".join(f"{t} ns" for t in t_ns[order.strays[:3]].tolist())
    add("stray", order.strays, f"{_stamps(len(order.strays))} far from the neighbours: {strays}")
    back = t_ns[order.resets] - t_ns[np.maximum(order.resets - 1, 0)]
    add("reset", order.resets, "the clock went back by " + _seconds(-back))
    forward = t_ns[order.changes] - t_ns[np.maximum(order.changes - 1, 0)]
    add("clock_change", order.changes, "another clock, later by " + _seconds(forward))
    begins = np.array([piece.start for piece in clock.pieces[1:]], dtype=np.int64)
    elsewhere = np.isin(clock.rows[begins], np.concatenate([order.resets, order.changes]))
    begins = begins[~elsewhere]
    gap = clock.stamps_ns[begins] - clock.stamps_ns[begins - 1]
    add("pause", clock.rows[begins], "no readings for " + _seconds(gap))
    add("late", order.late, f"{len(order.late)} samples came after later ones")
    add("duplicate", duplicates, f"{len(duplicates)} samples came twice")
    lossy = np.flatnonzero(clock.missing)
    text = f"{clock.lost} samples are lost in {len(lossy)} places"
    add("loss", clock.rows[lossy], text, clock.lost)
    return traits


def _stamps(count: int) -> str:
    """Return a number of stamps as text."""
    return "1 stamp" if count == 1 else f"{count} stamps"


def _seconds(steps_ns: Times) -> str:
    """Return the first of some times as text."""
    return f"{steps_ns[0] * 1e-9:.6g} s" if len(steps_ns) else ""


def number_unit(interval_ns: float) -> tuple[float, str]:
    """Return factor and name of the unit of stamps that cannot be nanoseconds; else 1 and "".

    :param interval_ns: time between samples if they were nanoseconds.
    """
    if interval_ns >= _FASTEST_NS:
        return 1.0, ""
    if abs(interval_ns - 1.0) < 1e-6:
        return 1.0, "index"
    for factor, name in _UNITS:
        if interval_ns * factor >= _FASTEST_NS:
            return factor, name
    return 1.0, "index"
