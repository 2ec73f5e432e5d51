# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Sample times, clock, transport and faults of a sensor with a rate of its own."""

import dataclasses
from fractions import Fraction
from typing import TYPE_CHECKING, NamedTuple

from imu_sim_ros import timebase
from imu_sim_ros.sensors.environment import EnvironmentParameters
from imu_sim_ros.sensors.faults import Fault, FaultSchedule
from imu_sim_ros.sensors.parameters import (
    LARGEST_JITTER_SIGMA,
    OwnRateParameters,
    TimingParameters,
)
from imu_sim_ros.sensors.timing import Clock, Transport
from imu_sim_ros.sensors.world import Sampled, SampleTimes, Window
from imu_sim_ros.types import Times

if TYPE_CHECKING:
    from imu_sim_ros.sensors.imu.parameters import ImuParameters


class Stamped(NamedTuple):
    """What becomes of n samples on their way."""

    t_ns: Times
    """(n,) stamps [ns]."""
    release_t_ns: Times
    """(n,) when the message leaves the driver [ns]."""
    delivered: Times
    """(m,) rows that are delivered."""


class OwnRate:
    """Sample times, clock, transport and faults of one sensor.

    Clock and transport have random streams of their own, for a sensor of an IMU with the
    parameters of its IMU; the jitter is at most a quarter of this sensor's interval.
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
        :param timing: of clock and transport.
        :param t0_ns: time of the start [ns].
        """
        self._rate, self._position = own.rate, 0
        self.times = SampleTimes(own.rate, t0_ns, own.time_offset, own.span)
        self.span_ns = timebase.to_nanoseconds(own.span)
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

    def inject(self, fault: Fault, begin: Fraction) -> None:
        """Let a fault begin with the first sample that is not before a time since the start [s]."""
        self.faults.add(fault, max(self.times.index(begin), self._position), self._position)

    def within(self, window: Window) -> Sampled:
        """Return the samples in a window, which begins where the last one ended."""
        samples = self.times.within(window)
        self._position = samples.first + len(samples.t)
        return samples

    def given(self, true_t_ns: Times) -> Sampled:
        """Return the next samples, whose times somebody gives; errors follow the nominal ones.

        :param true_t_ns: (n,) [ns].
        """
        nominal = self.times.following(self._position, len(true_t_ns))
        self._position += len(true_t_ns)
        return nominal._replace(true_t_ns=true_t_ns)

    def stamp(self, samples: Sampled) -> Stamped:
        """Return stamps and transport of the samples that were returned last."""
        count = len(samples.true_t_ns)
        return Stamped(
            self._clock.stamp(samples.true_t_ns),
            self._transport.release(samples.first, samples.true_t_ns + self.span_ns, self.faults),
            self._transport.deliver(samples.first, count, self.faults),
        )


def instantaneous(imu: "ImuParameters") -> "ImuParameters":
    """Return the IMU with readings at an instant: only gyroscope and accelerometer average."""
    return dataclasses.replace(imu, sampling="instantaneous")
