# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Errors in time: the sensor's clock, the transport of the messages, losses and duplicates."""

import math
from functools import cache, cached_property
from typing import Final

import numpy as np
from numpy.random import Generator

from imu_sim_ros import timebase
from imu_sim_ros.random_streams import generator
from imu_sim_ros.sensors.faults import FaultSchedule
from imu_sim_ros.sensors.parameters import TimingParameters
from imu_sim_ros.types import Integers, Mask, Times

LARGEST_JITTER: Final = 0.45
"""Jitter is cut off here, in intervals between two samples, so that stamps always increase."""
_NEVER: Final = np.iinfo(np.int64).min


class Clock:
    """The clock that stamps the samples.

    ``stamp = t + offset + skew (t - t0) + drift (t - t0)^2 / 2 + jitter``, t the true time.
    """

    def __init__(
        self, seed: int, timing: TimingParameters, rate: float, t0_ns: int, prefix: str = ""
    ) -> None:
        """Set up the clock.

        :param prefix: of the random streams' names; another for each sensor.
        """
        self._t0_ns = t0_ns
        self._interval_ns = timebase.NANOSECONDS_PER_SECOND / rate
        self._offset_ns = timebase.to_nanoseconds(timing.stamp_offset)
        self._skew = timing.clock_skew_ppm * 1e-6
        self._drift = timing.clock_drift_ppm_per_hour * 1e-6 / 3600.0  # per second
        self._seed, self._source = seed, f"{prefix}clock.jitter"
        self._jitter_ns = 0.0

    @cached_property
    def _stream(self) -> Generator:
        return generator(self._seed, self._source)

    def configure(self, timing: TimingParameters) -> None:
        """Take the jitter."""
        limit = LARGEST_JITTER * self._interval_ns
        stated = timing.jitter * timebase.NANOSECONDS_PER_SECOND
        self._jitter_ns = deviation_before_cut(stated, limit) if stated else 0.0

    def stamp(self, true_t_ns: Times) -> Times:
        """Return the stamps (n,) of the next n samples."""
        stamps: Times = true_t_ns + self._offset_ns
        if self._skew or self._drift:
            since_ns = (true_t_ns - self._t0_ns).astype(np.float64)
            error = self._skew + 0.5 * self._drift * (since_ns * 1e-9)
            stamps += np.rint(error * since_ns).astype(np.int64)
        if self._jitter_ns:
            jitter = self._stream.standard_normal(len(stamps)) * self._jitter_ns
            limit = LARGEST_JITTER * self._interval_ns
            stamps += np.rint(np.clip(jitter, -limit, limit)).astype(np.int64)
        return stamps


class Transport:
    """When messages leave the driver, and which of them are lost or duplicated."""

    def __init__(self, seed: int, rate: float, prefix: str = "") -> None:
        """Set up the transport; the prefix is that of the random streams' names."""
        self._dt = 1.0 / rate
        self._stream = cache(lambda name: generator(seed, f"{prefix}transport.{name}"))
        self._last_release_ns = int(_NEVER)
        self._burst_end = 0
        self._latency_ns, self._latency_jitter_ns = 0, 0.0

    def configure(self, timing: TimingParameters) -> None:
        """Take latency, losses and duplicates.

        A lowered latency applies to the next message at once: those still waiting leave first.
        """
        before = (self._latency_ns, self._latency_jitter_ns)
        self._latency_ns = timebase.to_nanoseconds(timing.latency)
        self._latency_jitter_ns = timing.latency_jitter * timebase.NANOSECONDS_PER_SECOND
        if self._latency_ns < before[0] or self._latency_jitter_ns < before[1]:
            self._last_release_ns = int(_NEVER)
        self._dropout = timing.dropout_probability
        # The first burst of an interval; a Poisson process of the given rate.
        self._burst = -np.expm1(-timing.dropout_burst_rate * self._dt)
        self._burst_samples = timing.dropout_burst_duration / self._dt
        self._duplicate = timing.duplicate_probability
        self._loses = bool(self._dropout or self._burst or self._duplicate)

    def release(self, first: int, true_t_ns: Times, faults: FaultSchedule) -> Times:
        """Return when the next n messages leave (n,) [ns]; none overtakes another."""
        if not (self._latency_jitter_ns or faults.any):
            steady: Times = true_t_ns + self._latency_ns
            if len(steady) and steady[0] >= self._last_release_ns:
                self._last_release_ns = int(steady[-1])
                return steady
        latency = np.full(len(true_t_ns), self._latency_ns)
        if self._latency_jitter_ns:
            extra = (
                self._stream("latency").standard_exponential(len(latency)) * self._latency_jitter_ns
            )
            latency += np.rint(extra).astype(np.int64)
        faults.delay(first, latency)
        times: Times = true_t_ns + latency
        if len(times):
            times[0] = max(times[0], self._last_release_ns)
            np.maximum.accumulate(times, out=times)
            self._last_release_ns = int(times[-1])
        return times

    def deliver(self, first: int, count: int, faults: FaultSchedule) -> Integers:
        """Return the rows of the next n messages that arrive, in order (m,)."""
        if self._burst_end <= first and not (self._loses or faults.any):
            return np.arange(count)
        lost = np.zeros(count, dtype=np.bool_)
        if self._dropout:
            lost |= self._stream("dropout").random(count) < self._dropout
        self._lose_in_bursts(first, lost)
        faults.lose(first, lost)
        rows = np.flatnonzero(~lost)
        if self._duplicate:
            # A number for each sample, lost or not: losses do not shift the duplicates.
            twice = self._stream("duplicate").random(count) < self._duplicate
            rows = np.repeat(rows, 1 + twice[rows])
        return rows

    def _lose_in_bursts(self, first: int, lost: Mask) -> None:
        """Mark samples lost in bursts: from each start, for an exponentially distributed time."""
        if not self._burst and self._burst_end <= first:
            return
        index = np.arange(first, first + len(lost))
        ends = np.zeros(len(lost), dtype=np.int64)
        if self._burst:
            starts = np.flatnonzero(self._stream("burst").random(len(lost)) < self._burst)
            lengths = (
                self._stream("burst_length").standard_exponential(len(starts)) * self._burst_samples
            )
            ends[starts] = index[starts] + np.ceil(lengths).astype(np.int64)
        if len(ends):
            ends[0] = max(ends[0], self._burst_end)
            np.maximum.accumulate(ends, out=ends)
            self._burst_end = int(ends[-1])
        lost |= ends > index


def deviation_before_cut(deviation: float, limit: float) -> float:
    """Return the deviation s of normal numbers that have the given one after clipping.

    Numbers beyond ``+-limit`` are set to it. With ``c = limit / s`` what is left has the variance
    ``s^2 (erf(c / sqrt 2) - c sqrt(2 / pi) exp(-c^2 / 2) + c^2 erfc(c / sqrt 2))``, the integral of
    ``min(x^2, limit^2)`` over the normal density; it grows with s up to ``limit^2``.

    :param deviation: the target, > 0 and below limit.
    """
    low, high = deviation, deviation
    while _deviation_after_cut(high, limit) < deviation:
        high *= 2.0
    for _ in range(60):
        middle = 0.5 * (low + high)
        if _deviation_after_cut(middle, limit) < deviation:
            low = middle
        else:
            high = middle
    return high


def _deviation_after_cut(s: float, limit: float) -> float:
    c = limit / s
    inner = math.erf(c / math.sqrt(2.0)) - c * math.sqrt(2.0 / math.pi) * math.exp(-0.5 * c * c)
    return s * math.sqrt(inner + c * c * math.erfc(c / math.sqrt(2.0)))
