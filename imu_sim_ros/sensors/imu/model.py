# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""An IMU on a moving body: both triads, the temperature and the clock."""

from collections.abc import Collection
from typing import TYPE_CHECKING, Final

import numpy as np

from imu_sim_ros import timebase
from imu_sim_ros.conventions import TRIADS
from imu_sim_ros.sensors import with_faults
from imu_sim_ros.sensors.block import ImuBlock
from imu_sim_ros.sensors.environment import EnvironmentParameters
from imu_sim_ros.sensors.errors.response import TemperatureProfile
from imu_sim_ros.sensors.errors.triad import Reading, Triad
from imu_sim_ros.sensors.faults import Fault, FaultSchedule
from imu_sim_ros.sensors.imu.ideal import IdealImu, Quadrature, quadrature
from imu_sim_ros.sensors.imu.parameters import ImuParameters
from imu_sim_ros.sensors.timing import Clock, Transport
from imu_sim_ros.trajectory.motion import Motion, Trajectory
from imu_sim_ros.types import Array

if TYPE_CHECKING:
    from imu_sim_ros.sensors.auxiliary import Auxiliary
    from imu_sim_ros.sensors.imu.vibration import BoardVibration


_INTERNAL_READINGS: Final = 16384
"""Generated at a time inside an oversampled sensor."""


class Imu:
    """One IMU; its samples are read in order."""

    def __init__(
        self,
        imu: ImuParameters,
        environment: EnvironmentParameters,
        t0_ns: int,
        sensors: Collection[str] = (),
    ) -> None:
        """Set up all errors at their start.

        :param t0_ns: time of sample 0 [ns].
        :param sensors: names of what is read beside the IMU .
        """
        seed, rate = environment.seed, environment.rate
        self._rate, self._t0_ns = rate, t0_ns
        self._averaged = imu.sampling == "averaged"
        self._quadrature: Quadrature | None = None
        self._ratio = int(imu.internal_ratio(rate))
        self._ideal = IdealImu(imu, environment)
        self._temperature = TemperatureProfile(environment.temperature)
        self._triads = [Triad(triad, imu, seed, rate) for triad in TRIADS]
        self._clock = Clock(seed, imu, rate, t0_ns)
        self._transport = Transport(seed, rate)
        self._faults = FaultSchedule(seed, 1.0 / rate)
        self._auxiliary = _beside(imu, environment, t0_ns, sensors) if sensors else None
        self._vibration = _vibration(imu, environment)
        self.configure(imu)

    def configure(self, imu: ImuParameters) -> None:
        """Take new values of live parameters, from the next sample on."""
        self._reference_temperature = imu.reference_temperature
        for triad in self._triads:
            triad.configure(imu)
        self._clock.configure(imu)
        self._transport.configure(imu)
        if self._auxiliary is not None:
            self._auxiliary.configure(imu)

    def prepare(self, trajectory: Trajectory) -> None:
        """Determine how finely a motion has to be sampled, before the first reading.

        :raises ConfigurationError: where its frequencies are too high for averaging.
        """
        if self._averaged:
            self._quadrature = quadrature(trajectory.highest_frequency, 1.0 / self._rate)

    def inject(self, fault: Fault, first: int, now: int) -> None:
        """Let a fault begin at a sample that is still to come.

        :param now: index of the next sample.
        """
        quantity = with_faults().get(fault.triad)
        if quantity is None:
            self._faults.add(fault, first, now)
        elif self._auxiliary is not None:
            self._auxiliary.inject(fault, quantity, first)

    def read(self, first: int, count: int, trajectory: Trajectory) -> ImuBlock:
        """Return samples ``first .. first + count - 1``; ``first`` follows the last call's."""
        true_t_ns = timebase.sample_times_ns(first, count, self._rate, self._t0_ns)
        t = timebase.seconds_since(true_t_ns, self._t0_ns)
        motion, ideal_gyro, ideal_accel = self._ideal_readings(first, t, trajectory)
        temperature = self._temperature.at(t)
        vibration = self._vibration.read(first, motion) if self._vibration else None
        if self._ratio == 1:
            gyro, accel = self._triad_readings(
                first, ideal_gyro, ideal_accel, temperature, vibration
            )
        else:
            gyro, accel = self._oversampled(first, count, trajectory, vibration)
        block = ImuBlock(
            first=first,
            true_t_ns=true_t_ns,
            t_ns=self._clock.stamp(true_t_ns),
            release_t_ns=self._transport.release(first, true_t_ns, self._faults),
            delivered=self._transport.deliver(first, count, self._faults),
            gyro=gyro.reading.T,
            accel=accel.reading.T,
            temperature=temperature,
            ideal_gyro=ideal_gyro.T,
            ideal_accel=ideal_accel.T,
            gyro_bias=gyro.bias.T,
            accel_bias=accel.bias.T,
            gyro_scale=gyro.scale.T,
            accel_scale=accel.scale.T,
            motion=motion,
        )
        if self._auxiliary is None:
            return block
        return self._auxiliary.add_to(block, trajectory, self._temperature)

    def _triad_readings(
        self,
        first: int,
        ideal_gyro: Array,
        ideal_accel: Array,
        temperature: Array,
        vibration: Array | None,
    ) -> tuple[Reading, Reading]:
        offset = temperature - self._reference_temperature
        shaken = (None, None) if vibration is None else (vibration[:3], vibration[3:])
        gyro, accel = (
            triad.read(first, ideal, ideal_accel, offset, self._faults, own)
            for triad, ideal, own in zip(
                self._triads, (ideal_gyro, ideal_accel), shaken, strict=True
            )
        )
        return gyro, accel

    def _oversampled(
        self, first: int, count: int, trajectory: Trajectory, vibration: Array | None
    ) -> tuple[Reading, Reading]:
        """Return the triads' samples, each the last of ``ratio`` readings at the internal rate.

        In pieces, so that the readings inside the sensor need no more memory than a block. Before
        the first sample the body is assumed to be where it is at the first.
        """
        made = []
        step = max(_INTERNAL_READINGS // self._ratio, 1)
        for begin in range(first, first + max(count, 1), step):
            end = min(begin + step, first + count)
            since = max((begin - 1) * self._ratio + 1, 0)
            t_ns = timebase.sample_times_ns(
                since, max((end - 1) * self._ratio + 1 - since, 0), self._rate * self._ratio
            )
            missing = (end - begin) * self._ratio - len(t_ns)
            t = timebase.seconds_since(np.concatenate([np.zeros(missing, np.int64), t_ns]), 0)
            ideal = self._ideal.read(trajectory.sample(t))
            own = None if vibration is None else vibration[:, begin - first : end - first]
            made.append(self._triad_readings(begin, *ideal, self._temperature.at(t), own))
        gyro, accel = (
            Reading(*(np.concatenate(parts, axis=1) for parts in zip(*readings, strict=True)))
            for readings in zip(*made, strict=True)
        )
        return gyro, accel

    def _ideal_readings(
        self, first: int, t: Array, trajectory: Trajectory
    ) -> tuple[Motion, Array, Array]:
        """Return the motion at times t (n,) and what a perfect IMU reads, (3, n) twice."""
        if not self._averaged:
            motion = trajectory.sample(t)
            return motion, *self._ideal.read(motion)
        if self._quadrature is None:
            self.prepare(trajectory)
            assert self._quadrature is not None
        before = timebase.sample_times_ns(max(first - 1, 0), 1, self._rate)
        ends = np.concatenate([timebase.seconds_since(before, 0), t])
        motion, rate, force = self._ideal.read_mean(trajectory, ends, self._quadrature)
        motion = Motion(*(values[1:] for values in motion))
        if first == 0:  # nothing lies before the first sample: it is the value at its time
            at_once = self._ideal.read(Motion(*(values[:1] for values in motion)))
            rate[:, :1], force[:, :1] = at_once
        return motion, rate, force


def _beside(
    imu: ImuParameters, environment: EnvironmentParameters, t0_ns: int, sensors: Collection[str]
) -> "Auxiliary":
    """Return what is read beside the IMU; most runs have nothing of it."""
    from imu_sim_ros.sensors.auxiliary import Auxiliary

    return Auxiliary(imu, environment, t0_ns, sensors)


def _vibration(imu: ImuParameters, environment: EnvironmentParameters) -> "BoardVibration | None":
    """Return the vehicle's vibration in the readings, if there is any."""
    if not imu.vibration.there:
        return None
    from imu_sim_ros.sensors.imu.vibration import BoardVibration  # most sensors have no vehicle

    return BoardVibration(environment.seed, imu.vibration, environment.rate)
