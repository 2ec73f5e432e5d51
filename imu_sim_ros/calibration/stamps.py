# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""What stamps say about a sensor's clock: its rate, and which samples are missing."""

from itertools import pairwise
from typing import Final

import numpy as np

from imu_sim_ros.errors import InputError
from imu_sim_ros.types import Array, Integers, Times

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
    missing = SampleClock(interval).missing(t)[1:]
    regular = missing <= longest_loss(interval)
    return float(np.sum(steps[regular]) / np.sum(1.0 + missing[regular]))


def longest_loss(interval: float) -> float:
    """Return how many missing samples in a row are a loss; above it is a gap.

    :param interval: of the samples [ns].
    """
    return max(10.0, 1e9 / interval)


class SampleClock:
    """Counts the samples that are missing before each stamp, block by block."""

    def __init__(self, interval: float) -> None:
        """Set up.

        :param interval: nominal sampling interval [ns].
        """
        self.interval = interval
        self.longest = longest_loss(interval)
        self.restart()

    def restart(self) -> None:
        """Announce that the next stamp is not connected to the last one."""
        self._last: int | None = None
        self._late = np.nan

    def missing(self, t_ns: Times) -> Integers:
        """Return (n,) how many samples are missing before each of n rising stamps."""
        first = t_ns[:1] if self._last is None else np.array([self._last])
        steps = np.diff(t_ns, prepend=first) / self.interval
        if self._last is None:
            steps[0] = 1.0
        self._last = int(t_ns[-1])
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
