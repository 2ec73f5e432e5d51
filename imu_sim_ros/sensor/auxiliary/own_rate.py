# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Samples of a sensor with a rate of its own, in the windows of an IMU's blocks."""

import dataclasses
import math
from fractions import Fraction
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from imu_sim_ros import timebase
from imu_sim_ros.config import LARGEST_JITTER, ImuParameters, SimulationParameters
from imu_sim_ros.config.auxiliary import OwnRateParameters
from imu_sim_ros.sensor.faults import Fault, FaultSchedule
from imu_sim_ros.sensor.timing import Clock, Transport

Array = NDArray[np.float64]
Times = NDArray[np.int64]


class Sampled(NamedTuple):
    """n samples that lie in a window of time."""

    first: int
    """Index of the first of them."""
    true_t_ns: Times
    """(n,) [ns]."""
    t: Array
    """(n,) since the IMU's first sample [s]."""


class Stamped(NamedTuple):
    """What becomes of n samples on their way."""

    t_ns: Times
    """(n,) stamps [ns]."""
    release_t_ns: Times
    """(n,) when the message leaves the driver [ns]."""
    delivered: Times
    """(m,) rows that are delivered."""


class OwnRate:
    """Sample times, clock, transport and faults of one sensor beside the IMU.

    Sample k is taken at ``time_offset + k / rate`` after the IMU's first sample. It belongs to the
    block of the IMU's samples ``first .. first + count - 1`` whose window, ``[first, first +
    count)`` intervals, it lies in; this is decided in exact fractions. Clock and transport have the
    IMU's parameters and random streams of their own; the jitter is at most a quarter of this
    sensor's interval.
    """

    def __init__(
        self, name: str, own: OwnRateParameters, parameters: SimulationParameters, t0_ns: int
    ) -> None:
        """Start before the first sample.

        :param name: of the sensor, the first part of its random streams' names.
        :param t0_ns: time of the IMU's sample 0 [ns].
        """
        self._rate, self._t0_ns = own.rate, t0_ns
        self._offset = Fraction(repr(own.time_offset))
        self._imu_rate = timebase.exact_rate(parameters.rate)
        self._duration = parameters.duration or math.inf
        self._position = 0
        self._clock = Clock(parameters.seed, parameters.imu, own.rate, t0_ns, f"{name}.")
        self._transport = Transport(parameters.seed, own.rate, f"{name}.")
        self.faults = FaultSchedule(parameters.seed, 1.0 / own.rate, f"{name}.")
        self.configure(parameters)

    def configure(self, parameters: SimulationParameters) -> None:
        """Take new values of live parameters, from the next sample on."""
        imu = parameters.imu
        # What suits the IMU's interval may be more than this sensor's allows.
        jitter = min(imu.jitter, LARGEST_JITTER / self._rate)
        self._clock.configure(dataclasses.replace(imu, jitter=jitter))
        self._transport.configure(imu)

    def inject(self, fault: Fault, first: int) -> None:
        """Let a fault begin with the first sample that is not before the IMU's sample ``first``."""
        index = self._count(Fraction(first) / self._imu_rate)
        self.faults.add(fault, max(index, self._position), self._position)

    def next(self, end: int, longest: float) -> Sampled:
        """Return the samples that were not returned yet and lie before the IMU's sample ``end``.

        :param longest: the trajectory's length [s].
        """
        longest = min(longest, self._duration)
        limit = Fraction(end) / self._imu_rate
        if not math.isinf(longest):
            limit = min(limit, Fraction(repr(longest)))
        first = self._position
        self._position = max(first, self._count(limit))
        start_ns = self._t0_ns + timebase.to_nanoseconds(float(self._offset))
        true_t_ns = timebase.sample_times_ns(first, self._position - first, self._rate, start_ns)
        return Sampled(first, true_t_ns, timebase.seconds_since(true_t_ns, self._t0_ns))

    def stamp(self, samples: Sampled) -> Stamped:
        """Return stamps and transport of the samples that were returned last."""
        count = len(samples.true_t_ns)
        return Stamped(
            self._clock.stamp(samples.true_t_ns),
            self._transport.release(samples.first, samples.true_t_ns, self.faults),
            self._transport.deliver(samples.first, count, self.faults),
        )

    def imu_samples(self, samples: Sampled) -> tuple[Times, NDArray[np.bool_]]:
        """Return the IMU's sample that each of n samples follows, and whether at the same time.

        ``floor((time_offset + k / rate) * imu_rate)``, in exact fractions.
        """
        rate = timebase.exact_rate(self._rate)
        start = (self._offset + samples.first / rate) * self._imu_rate
        step = self._imu_rate / rate
        common = math.lcm(start.denominator, step.denominator)
        whole, rest = divmod(int(start * common), common)
        each, n = int(step * common), len(samples.t)
        small = each * n + common < np.iinfo(np.int64).max
        k = np.arange(n, dtype=np.int64 if small else object)
        quotient, remainder = np.divmod(rest + each * k, common)
        return (whole + quotient).astype(np.int64), (remainder == 0).astype(np.bool_)

    def _count(self, end: Fraction) -> int:
        """Return how many samples lie before a time [s]."""
        return max(math.ceil((end - self._offset) * timebase.exact_rate(self._rate)), 0)


def instantaneous(parameters: SimulationParameters) -> ImuParameters:
    """Return the board with readings at an instant: only gyroscope and accelerometer average."""
    return dataclasses.replace(parameters.imu, sampling="instantaneous")
