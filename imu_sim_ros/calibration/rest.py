# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Whether a record is at rest: slow motion is reported, single disturbances are cut out."""

from collections.abc import Iterator
from typing import Final, NamedTuple

import numpy as np

from imu_sim_ros.types import Array, Mask

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

    def __init__(self, rate: float) -> None:
        self._window = max(round(rate), 4)
        self._rate = rate
        self._buffer: list[Array] = []
        self._buffered = 0
        self._before: Array | None = None
        self._time = 0.0
        self.moving: list[Movement] = []
        """Stretches of continued motion, or of a walk of such size; they are handed on."""
        self.step = np.zeros(6)
        """(6,) digital steps of the readings, if they are known."""
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
        if self._buffered == 0:
            return
        y = np.concatenate(self._buffer)
        self._buffer, self._buffered = [], 0
        begin, self._time = self._time, self._time + len(y) / self._rate
        self.seconds += len(y) / self._rate
        count = len(y) // self._window
        if count < 8:
            yield y
            return
        mean, variance = _by_window(y[: count * self._window].reshape(count, self._window, 6))
        if np.isnan(mean[:, 0]).any():
            mean, variance = self._with_losses(y[: count * self._window], count)
        typical = np.median(variance, axis=0)
        self._note_motion(mean, typical, begin)
        bad = self._disturbances(mean, variance, typical, begin)
        self._variance += variance[~bad].sum(axis=0)
        self._windows_seen += int(np.count_nonzero(~bad))
        yield from self._without(y, bad)

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
        return result + self.step

    def _disturbances(self, mean: Array, variance: Array, typical: Array, begin: float) -> Mask:
        """Return (windows,) which were disturbed, with one window of margin on both sides."""
        before = mean[:1] if self._before is None else self._before
        jump = np.abs(np.diff(mean, axis=0, prepend=before))
        self._before = mean[-1:]
        limit = self._jump_limit(jump, typical)
        # An axis that hardly changes its last digit has a typical variance of zero.
        # One that goes to and fro between two codes has half a step as its deviation.
        noisy = _NOISIER * (typical + 0.25 * self.step**2)
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

    def _without(self, y: Array, bad: Mask) -> Iterator[Array | None]:
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


def _by_window(windows: Array) -> tuple[Array, Array]:
    """Return means and variances (windows, 6) of windows (windows, samples, 6).

    With the samples first NumPy adds long rows, four times as fast as six numbers at a time.
    """
    count, samples, axes = windows.shape
    rows = np.ascontiguousarray(windows.transpose(1, 0, 2)).reshape(samples, -1)
    mean = np.add.reduce(rows, axis=0) / samples
    rows -= mean
    rows *= rows
    variance = np.add.reduce(rows, axis=0) / samples
    return mean.reshape(count, axes), variance.reshape(count, axes)
