# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Samples of a sensor with a rate of its own, in the windows of an IMU's blocks."""

import dataclasses
import math
from fractions import Fraction
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from imu_sim_ros import timebase
from imu_sim_ros.sensors.block import ImuBlock
from imu_sim_ros.sensors.environment import EnvironmentParameters
from imu_sim_ros.sensors.errors.response import TemperatureProfile
from imu_sim_ros.sensors.faults import Fault, FaultSchedule
from imu_sim_ros.sensors.own_rate_parameters import (
    LARGEST_JITTER_SIGMA,
    OwnRateParameters,
    TimingParameters,
)
from imu_sim_ros.sensors.timing import Clock, Transport
from imu_sim_ros.trajectory.motion import Motion, Trajectory
from imu_sim_ros.types import Array, Mask, Times

if TYPE_CHECKING:
    from imu_sim_ros.sensors.imu.parameters import ImuParameters


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
    """Sample times, clock, transport and faults of one auxiliary sensor.

    Sample k is taken at ``time_offset + k / rate`` after the IMU's first sample. It belongs to the
    block of the IMU's samples ``first .. first + count - 1`` whose window, ``[first, first +
    count)`` intervals, it lies in; this is decided in exact fractions. Clock and transport have the
    IMU's parameters and random streams of their own; the jitter is at most a quarter of this
    sensor's interval.
    """

    def __init__(
        self,
        name: str,
        own: OwnRateParameters,
        timing: TimingParameters,
        environment: EnvironmentParameters,
        t0_ns: int,
    ) -> None:
        """Start before the first sample.

        :param name: of the sensor, the first part of its random streams' names.
        :param timing: of clock and transport; an auxiliary sensor has those of its board.
        :param t0_ns: time of the IMU's sample 0 [ns].
        """
        self._rate, self._t0_ns = own.rate, t0_ns
        self._offset = Fraction(repr(own.time_offset))
        self._imu_rate = timebase.exact_rate(environment.rate)
        self._duration = environment.duration or math.inf
        self._start_ns = t0_ns + timebase.to_nanoseconds(own.time_offset)
        exact = timebase.exact_rate(own.rate)
        self._count_before = _Grid(exact / self._imu_rate, self._offset * exact)
        self._imu_index = _Grid(self._imu_rate / exact, -self._offset * self._imu_rate)
        self._longest: tuple[float, int] | None = None
        every = self._imu_rate / exact
        together = not self._offset and every.denominator == 1
        self._every = every.numerator if together else 0
        self._position = 0
        self._clock = Clock(environment.seed, timing, own.rate, t0_ns, f"{name}.")
        self._transport = Transport(environment.seed, own.rate, f"{name}.")
        self.faults = FaultSchedule(environment.seed, 1.0 / own.rate, f"{name}.")
        self.configure(timing)

    def configure(self, timing: TimingParameters) -> None:
        """Take new values of live parameters, from the next sample on."""
        # What suits the IMU's interval may be more than this sensor's allows.
        jitter = min(timing.jitter, LARGEST_JITTER_SIGMA / self._rate)
        self._clock.configure(dataclasses.replace(timing, jitter=jitter))
        self._transport.configure(timing)

    def inject(self, fault: Fault, first: int) -> None:
        """Let a fault begin with the first sample that is not before the IMU's sample ``first``."""
        index = self._count_before.ceiling(first)
        self.faults.add(fault, max(index, self._position), self._position)

    def next(self, end: int, longest: float) -> Sampled:
        """Return the samples that were not returned yet and lie before the IMU's sample ``end``.

        :param longest: the trajectory's length [s].
        """
        limit = max(self._count_before.ceiling(end), 0)
        longest = min(longest, self._duration)
        if not math.isinf(longest):
            if self._longest is None or self._longest[0] != longest:
                self._longest = (longest, self._count(Fraction(repr(longest))))
            limit = min(limit, self._longest[1])
        first = self._position
        self._position = max(first, limit)
        count = self._position - first
        true_t_ns = timebase.sample_times_ns(first, count, self._rate, self._start_ns)
        return Sampled(first, true_t_ns, timebase.seconds_since(true_t_ns, self._t0_ns))

    def stamp(self, samples: Sampled) -> Stamped:
        """Return stamps and transport of the samples that were returned last."""
        count = len(samples.true_t_ns)
        return Stamped(
            self._clock.stamp(samples.true_t_ns),
            self._transport.release(samples.first, samples.true_t_ns, self.faults),
            self._transport.deliver(samples.first, count, self.faults),
        )

    def imu_samples(self, samples: Sampled) -> tuple[Times, Mask]:
        """Return the IMU's sample that each of n samples follows, and whether at the same time.

        ``floor((time_offset + k / rate) * imu_rate)``, in exact fractions.
        """
        return self._imu_index.floor(samples.first, len(samples.t))

    def place(
        self,
        samples: Sampled,
        block: ImuBlock,
        trajectory: Trajectory,
        temperature: TemperatureProfile,
    ) -> tuple[Array, Array, Array]:
        """Return positions (3, n), attitudes q_wb (4, n) and temperatures (n,) of n samples.

        :param block: of the IMU, in whose window the samples lie.
        """
        motion = self.motion(samples, block, trajectory)
        if self._every:
            celsius = block.temperature[self._rows(samples, block)]
        else:
            celsius = temperature.at(samples.t)
        return motion.position.T, np.ascontiguousarray(motion.q_wb.T), celsius

    def motion(self, samples: Sampled, block: ImuBlock, trajectory: Trajectory) -> Motion:
        """Return the body's motion at the times of n samples.

        If these are among the IMU's, it is known already.

        :param block: of the IMU, in whose window the samples lie.
        """
        if not self._every:
            return trajectory.sample(samples.t)
        rows = self._rows(samples, block)
        return Motion(*(values[rows] for values in block.motion))

    def _rows(self, samples: Sampled, block: ImuBlock) -> slice:
        """Return the rows of the block at whose times the samples are."""
        start = samples.first * self._every - block.first
        return slice(start, start + self._every * len(samples.t), self._every)

    def _count(self, end: Fraction) -> int:
        """Return how many samples lie before a time [s]."""
        return max(math.ceil((end - self._offset) * timebase.exact_rate(self._rate)), 0)


class _Grid:
    """``k step - shift`` for integers k, in exact numbers."""

    def __init__(self, step: Fraction, shift: Fraction) -> None:
        self._common = math.lcm(step.denominator, shift.denominator)
        self._step = int(step * self._common)
        self._shift = int(shift * self._common)

    def ceiling(self, k: int) -> int:
        """Return the smallest integer that is not below the number k."""
        return -((self._shift - k * self._step) // self._common)

    def floor(self, first: int, n: int) -> tuple[Times, Mask]:
        """Return the largest integers (n,) not above the next n numbers; whether they are equal."""
        whole, rest = divmod(first * self._step - self._shift, self._common)
        small = self._step * n + self._common < np.iinfo(np.int64).max
        k = np.arange(n, dtype=np.int64 if small else object)
        quotient, remainder = np.divmod(rest + self._step * k, self._common)
        return (whole + quotient).astype(np.int64), (remainder == 0).astype(np.bool_)


def instantaneous(imu: "ImuParameters") -> "ImuParameters":
    """Return the board with readings at an instant: only gyroscope and accelerometer average."""
    return dataclasses.replace(imu, sampling="instantaneous")
