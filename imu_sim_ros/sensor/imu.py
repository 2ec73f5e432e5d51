# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""An IMU on a moving body: both triads, the temperature and the clock."""

import numpy as np
from numpy.typing import NDArray

from imu_sim_ros import timebase
from imu_sim_ros.config import SimulationParameters
from imu_sim_ros.conventions import TRIADS
from imu_sim_ros.sensor.block import ImuBlock
from imu_sim_ros.sensor.errors import TemperatureProfile, Triad
from imu_sim_ros.sensor.faults import Fault, FaultSchedule
from imu_sim_ros.sensor.ideal import IdealImu
from imu_sim_ros.sensor.timing import Clock, Transport
from imu_sim_ros.trajectory import Motion, Trajectory

Array = NDArray[np.float64]


class Imu:
    """One IMU; its samples are read in order."""

    def __init__(self, parameters: SimulationParameters, t0_ns: int) -> None:
        """Set up all errors at their start.

        :param t0_ns: time of sample 0 [ns].
        """
        p = parameters
        self._rate, self._t0_ns = p.rate, t0_ns
        self._averaged = p.imu.sampling == "averaged"
        self._ideal = IdealImu(p)
        self._temperature = TemperatureProfile(p.temperature)
        self._triads = [Triad(triad, p.imu, p.seed, p.rate) for triad in TRIADS]
        self._clock = Clock(p.seed, p.imu, p.rate, t0_ns)
        self._transport = Transport(p.seed, p.rate)
        self._faults = FaultSchedule(p.seed, 1.0 / p.rate)
        self.configure(p)

    def configure(self, parameters: SimulationParameters) -> None:
        """Take new values of live parameters, from the next sample on."""
        self._reference_temperature = parameters.imu.reference_temperature
        for triad in self._triads:
            triad.configure(parameters.imu)
        self._clock.configure(parameters.imu)
        self._transport.configure(parameters.imu)

    def inject(self, fault: Fault, first: int, now: int) -> None:
        """Let a fault begin at a sample that is still to come.

        :param now: index of the next sample.
        """
        self._faults.add(fault, first, now)

    def read(self, first: int, count: int, trajectory: Trajectory) -> ImuBlock:
        """Return samples ``first .. first + count - 1``; ``first`` follows the last call's."""
        true_t_ns = timebase.sample_times_ns(first, count, self._rate, self._t0_ns)
        t = timebase.seconds_since(true_t_ns, self._t0_ns)
        motion = trajectory.sample(t)
        ideal_gyro, ideal_accel = self._ideal_readings(first, t, motion, trajectory)
        temperature = self._temperature.at(t)
        temperature_offset = temperature - self._reference_temperature
        gyro, accel = (
            triad.read(first, ideal, ideal_accel, temperature_offset, self._faults)
            for triad, ideal in zip(self._triads, (ideal_gyro, ideal_accel), strict=True)
        )
        return ImuBlock(
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

    def _ideal_readings(
        self, first: int, t: Array, motion: Motion, trajectory: Trajectory
    ) -> tuple[Array, Array]:
        if not self._averaged:
            return self._ideal.read(motion)
        before = timebase.sample_times_ns(max(first - 1, 0), len(t), self._rate)
        if first == 0 and len(t):  # nothing lies before the first sample: its interval is empty
            before = np.concatenate([before[:1], before[:-1]])
        return self._ideal.read_mean(trajectory, timebase.seconds_since(before, 0), t)
