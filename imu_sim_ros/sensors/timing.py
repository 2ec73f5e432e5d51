# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""A sensor in time: when it samples, what its clock says of that, how its messages travel."""

import math
from collections.abc import Mapping, Sequence
from fractions import Fraction
from typing import Final, NamedTuple

import numpy as np
from numpy.random import Generator

from imu_sim_ros.core import timebase
from imu_sim_ros.core.components import clip, nearest_integer
from imu_sim_ros.core.random_streams import generator
from imu_sim_ros.core.types import Array, Integers, Mask, Times
from imu_sim_ros.sensors.faults import Fault, FaultSchedule
from imu_sim_ros.sensors.parameters import LARGEST_JITTER_SIGMA, TimingParameters
from imu_sim_ros.sensors.samples import Samples, all_rows
from imu_sim_ros.sensors.world import Window

LARGEST_JITTER: Final = 0.45
"""Jitter is cut off here, in intervals between two samples, so that stamps always increase."""
_NEVER: Final = np.iinfo(np.int64).min


class Sampled(NamedTuple):
    """n samples that lie in a window of time."""

    first: int
    """Index of the first of them."""
    true_t_ns: Times
    """(n,) true times of the samples [ns]."""
    t: Array
    """(n,) true times since the start of the run [s]."""


class SampleTimes:
    """Times of a sensor's samples: sample k is taken at ``offset + k / rate`` after the start."""

    def __init__(self, rate: float, t0_ns: int, offset: float = 0.0, span: float = 0.0) -> None:
        """Initialise with exact numbers: sample k begins at ``offset + k / rate`` after the start.

        :param rate: samples per second [Hz].
        :param t0_ns: true time of the start [ns].
        :param offset: time of the first sample after the start [s].
        :param span: time from the start of a sample to its end [s].
        """
        self._rate, self._exact_rate = rate, timebase.exact_rate(rate)
        self._offset, self._span = timebase.exact_fraction(offset), timebase.exact_fraction(span)
        self._t0_ns, self._first_ns = t0_ns, t0_ns + timebase.to_nanoseconds(offset)

    def index(self, t: Fraction) -> int:
        """Return the index of the first sample not before a time, or not complete by then.

        :param t: time since the start [s].
        """
        intervals = (t - self._offset - self._span) * self._exact_rate
        if self._span:
            return max(math.floor(intervals) + 1, 0)
        return max(math.ceil(intervals), 0)

    def time(self, index: int) -> Fraction:
        """Return the time of a sample since the start [s]."""
        return self._offset + index / self._exact_rate

    def within(self, window: Window) -> Sampled:
        """Return the samples in a window."""
        begin = self.index(window.begin)
        return self.at_indices(begin, self.index(window.end) - begin)

    def at_indices(self, first: int, count: int) -> Sampled:
        """Return the samples from an index on."""
        true_t_ns = timebase.sample_times_ns(first, count, self._rate, self._first_ns)
        return Sampled(first, true_t_ns, timebase.seconds_since(true_t_ns, self._t0_ns))


class SampleTiming:
    """Sample times, clock, transport and faults of one sensor.

    Clock and transport have random streams of their own. A sensor of an IMU has the IMU's
    parameters of both, but its jitter is at most a quarter of its own interval.
    """

    def __init__(
        self,
        name: str,
        rate: float,
        timing: TimingParameters,
        seed: int,
        t0_ns: int,
        offset: float = 0.0,
        span: float = 0.0,
    ) -> None:
        """Initialise before the first sample.

        :param name: name of the sensor, with which the names of its random streams begin; that of
            an IMU is empty.
        :param timing: timing of clock and transport.
        :param t0_ns: time of the start [ns].
        :param offset: offset of the first sample after the start [s].
        :param span: how long a sample takes [s].
        """
        self._prefix = f"{name}." if name else ""
        self._rate, self._dt, self._t0_ns = rate, 1.0 / rate, t0_ns
        self._limit_ns = LARGEST_JITTER * (timebase.NANOSECONDS_PER_SECOND / rate)
        self._span_ns = timebase.to_nanoseconds(span)
        self.times = SampleTimes(rate, t0_ns, offset, span)
        self.position = 0
        """Index of the next sample."""
        self.faults = FaultSchedule(seed, self._dt, self._prefix)
        self._seed, self._streams = seed, dict[str, Generator]()
        self._last_release_ns = int(_NEVER)
        self._burst_end = 0
        self._latency_ns, self._latency_jitter_ns = 0, 0.0
        self.configure(timing)

    def configure(self, timing: TimingParameters) -> None:
        """Apply new values of live parameters, from the next sample on.

        A lowered latency applies to the next message at once: those still waiting leave first.
        """
        second = timebase.NANOSECONDS_PER_SECOND
        self._offset_ns = timebase.to_nanoseconds(timing.stamp_offset)
        self._skew = timing.clock_skew_ppm * 1e-6
        self._drift = timing.clock_drift_ppm_per_hour * 1e-6 / 3600.0  # per second
        # What suits the IMU's interval may be more than this sensor's allows.
        stated = min(timing.jitter, LARGEST_JITTER_SIGMA / self._rate) * second
        self._jitter_ns = unclipped_deviation(stated, self._limit_ns) if stated else 0.0
        previous = (self._latency_ns, self._latency_jitter_ns)
        self._latency_ns = timebase.to_nanoseconds(timing.latency)
        self._latency_jitter_ns = timing.latency_jitter * second
        if self._latency_ns < previous[0] or self._latency_jitter_ns < previous[1]:
            self._last_release_ns = int(_NEVER)
        self._dropout = timing.dropout_probability
        # The first burst of an interval; a Poisson process of the given rate.
        self._burst = -np.expm1(-timing.dropout_burst_rate * self._dt)
        self._burst_samples = timing.dropout_burst_duration / self._dt
        self._duplicate = timing.duplicate_probability
        self._is_steady = not (
            (self._skew or self._drift or self._jitter_ns)
            or (self._span_ns or self._latency_ns or self._latency_jitter_ns)
            or (self._dropout or self._burst or self._duplicate)
        )

    def inject(self, fault: Fault, begin: Fraction) -> None:
        """Start a fault at the first sample at or after a time since the start [s]."""
        self.faults.add(fault, max(self.times.index(begin), self.position), self.position)

    def external_samples(self, true_t_ns: Times) -> Sampled:
        """Return the next samples at times from outside; errors follow the nominal times.

        :param true_t_ns: (n,) true times [ns].
        """
        nominal = self.times.at_indices(self.position, len(true_t_ns))
        return nominal._replace(true_t_ns=true_t_ns)

    def samples(self, first: int, true_t_ns: Times, values: Mapping[str, object]) -> Samples:
        """Return the next n samples, with their stamps and their transport.

        :param first: index of the first of them.
        :param values: (n, ...) readings and their truth, by name.
        """
        self.position = first + len(true_t_ns)
        return Samples(
            true_t_ns=true_t_ns,
            t_ns=self._stamps(true_t_ns),
            release_t_ns=self._releases(first, true_t_ns),
            delivered=self._delivered_rows(first, len(true_t_ns)),
            values=values,
            first=first,
            span_ns=self._span_ns,
        )

    def steady_stamps(self, start: int, times: Sequence[int]) -> list[int] | None:
        """Return the stamps of the next samples, which leave the driver at once and once each.

        :param start: index of the first of them.
        :param times: true times of these samples, at least one [ns].
        :returns: the stamps of :meth:`samples`; None where the clock drifts or jitters, or the
            transport delays, loses or repeats messages: nothing has changed then.
        """
        steady = self._is_steady and not self.faults.windows and self._burst_end <= start
        if not steady or times[0] < self._last_release_ns:
            return None
        self.position, self._last_release_ns = start + len(times), times[-1]
        return [t_ns + self._offset_ns for t_ns in times]

    def _stream(self, source: str) -> Generator:
        """Return the random stream of a source, which begins when it is first needed."""
        if source not in self._streams:
            self._streams[source] = generator(self._seed, f"{self._prefix}{source}")
        return self._streams[source]

    def _stamps(self, true_t_ns: Times) -> Times:
        """Return the stamps (n,) that the sensor's clock gives the next n samples [ns].

        ``stamp = t + offset + skew (t - t0) + drift (t - t0)^2 / 2 + jitter``, t the true time.
        """
        stamps = true_t_ns + self._offset_ns
        if self._skew or self._drift:
            since_ns = (true_t_ns - self._t0_ns) * 1.0
            error = self._skew + 0.5 * self._drift * (since_ns * 1e-9)
            stamps = stamps + nearest_integer(error * since_ns)
        if self._jitter_ns:
            jitter = self._stream("clock.jitter").standard_normal(len(stamps)) * self._jitter_ns
            stamps = stamps + nearest_integer(clip(jitter, -self._limit_ns, self._limit_ns))
        return stamps

    def _releases(self, first: int, true_t_ns: Times) -> Times:
        """Return when the next n messages leave the driver (n,) [ns]; none overtakes another."""
        after_ns = self._span_ns + self._latency_ns
        if not (self._latency_jitter_ns or self.faults.windows):
            steady: Times = true_t_ns + after_ns if after_ns else true_t_ns
            if len(steady) and steady[0] >= self._last_release_ns:
                self._last_release_ns = int(steady[-1])
                return steady
        latency = np.full(len(true_t_ns), after_ns)
        if self._latency_jitter_ns:
            extra = self._stream("transport.latency").standard_exponential(len(latency))
            latency += np.rint(extra * self._latency_jitter_ns).astype(np.int64)
        self.faults.delay(first, latency)
        times: Times = true_t_ns + latency
        if len(times):
            times[0] = max(times[0], self._last_release_ns)
            np.maximum.accumulate(times, out=times)
            self._last_release_ns = int(times[-1])
        return times

    def _delivered_rows(self, first: int, count: int) -> Integers:
        """Return the rows of the next n messages that are not lost, in order (m,)."""
        loses = self._dropout or self._burst or self._duplicate or self.faults.windows
        if not loses and self._burst_end <= first:
            return all_rows(count)
        lost = np.zeros(count, dtype=np.bool_)
        if self._dropout:
            lost |= self._stream("transport.dropout").random(count) < self._dropout
        self._lose_in_bursts(first, lost)
        self.faults.lose(first, lost)
        rows = np.flatnonzero(~lost)
        if self._duplicate:
            # A number for each sample, lost or not: losses do not shift the duplicates.
            twice = self._stream("transport.duplicate").random(count) < self._duplicate
            rows = np.repeat(rows, 1 + twice[rows])
        return rows

    def _lose_in_bursts(self, first: int, lost: Mask) -> None:
        """Mark samples lost in bursts: from each start, for an exponentially distributed time."""
        if not self._burst and self._burst_end <= first:
            return
        index = np.arange(first, first + len(lost))
        ends = np.zeros(len(lost), dtype=np.int64)
        if self._burst:
            begins = self._stream("transport.burst").random(len(lost)) < self._burst
            starts = np.flatnonzero(begins)
            lengths = self._stream("transport.burst_length").standard_exponential(len(starts))
            ends[starts] = index[starts] + np.ceil(lengths * self._burst_samples).astype(np.int64)
        if len(ends):
            ends[0] = max(ends[0], self._burst_end)
            np.maximum.accumulate(ends, out=ends)
            self._burst_end = int(ends[-1])
        lost |= ends > index


def unclipped_deviation(deviation: float, limit: float) -> float:
    """Return the deviation of normal numbers that have a given one after clipping.

    Numbers beyond ``+-limit`` are set to it. With ``c = limit / s`` what is left has the variance
    ``s^2 (erf(c / sqrt 2) - c sqrt(2 / pi) exp(-c^2 / 2) + c^2 erfc(c / sqrt 2))``, the integral of
    ``min(x^2, limit^2)`` over the normal density; it grows with s up to ``limit^2``.

    :param deviation: the target, > 0 and below limit.
    """
    low, high = deviation, deviation
    while _clipped_deviation(high, limit) < deviation:
        high *= 2.0
    for _ in range(60):
        middle = 0.5 * (low + high)
        if _clipped_deviation(middle, limit) < deviation:
            low = middle
        else:
            high = middle
    return high


def _clipped_deviation(s: float, limit: float) -> float:
    """Return the standard deviation of normal jitter s that is limited to +-limit."""
    c = limit / s
    inner = math.erf(c / math.sqrt(2.0)) - c * math.sqrt(2.0 / math.pi) * math.exp(-0.5 * c * c)
    return s * math.sqrt(inner + c * c * math.erfc(c / math.sqrt(2.0)))
