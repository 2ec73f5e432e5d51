# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""The barometer of a board: the standard atmosphere at the IMU's height, and its errors.

``reading = p(z) + gust + bias + n``, then steps and the range of the sensor. Its bias, drift and
noise are those of the first axis of a triad.
"""

import math
from typing import Final

import numpy as np
from numpy.typing import NDArray

from imu_sim_ros.config import EnvironmentParameters, ImuParameters
from imu_sim_ros.random_streams import generator
from imu_sim_ros.rotation.components import rotate
from imu_sim_ros.sensor.auxiliary.atmosphere import Atmosphere
from imu_sim_ros.sensor.auxiliary.own_rate import OwnRate, instantaneous
from imu_sim_ros.sensor.block import ImuBlock, PressureBlock
from imu_sim_ros.sensor.errors import TemperatureProfile, Triad
from imu_sim_ros.sensor.faults import Fault
from imu_sim_ros.trajectory import Trajectory

Array = NDArray[np.float64]

NAME: Final = "barometer"


class Gusts:
    """Steps of the pressure at random times: each draws the pressure that is held until the next.

    Between two samples a step occurs with the probability ``1 - exp(-rate dt)`` that a Poisson
    process has an event.
    """

    def __init__(self, seed: int, rate: float, sigma: float, dt: float) -> None:
        """Start in still air.

        :param rate: mean number of steps in a second.
        :param sigma: of the pressure [Pa].
        """
        self._times, self._sizes = (generator(seed, f"{NAME}.gust{part}") for part in ("", "_size"))
        self._probability = -math.expm1(-rate * dt)
        self._sigma = sigma
        self._held = 0.0

    def next(self, count: int) -> Array:
        """Return the next values (count,) [Pa]."""
        if not self._probability:
            return np.zeros(count)
        starts = np.flatnonzero(self._times.random(count) < self._probability)
        sizes = self._sigma * self._sizes.standard_normal(len(starts))
        values = np.concatenate([[self._held], sizes])
        result: Array = values[np.searchsorted(starts, np.arange(count), side="right")]
        self._held = float(values[-1])
        return result


class Barometer:
    """One barometer; its samples are read in order."""

    def __init__(self, imu: ImuParameters, environment: EnvironmentParameters, t0_ns: int) -> None:
        """Set up all errors at their start.

        :param t0_ns: time of the IMU's sample 0 [ns].
        """
        own = imu.barometer
        self._own = OwnRate(NAME, own, imu, environment, t0_ns)
        self._atmosphere = Atmosphere(environment.atmosphere)
        self._height = environment.height
        self._lever_arm_b = np.reshape(imu.lever_arm, (3, 1))
        self._gusts = Gusts(environment.seed, own.gust_rate, own.gust_sigma, 1.0 / own.rate)
        self._triad = Triad(NAME, instantaneous(imu), environment.seed, own.rate)
        self.configure(imu)

    def configure(self, imu: ImuParameters) -> None:
        """Take new values of live parameters, from the next sample on."""
        own = imu.barometer
        self._reference_temperature = imu.reference_temperature
        self._limits = (own.minimum, own.maximum or math.inf)
        self._own.configure(imu)
        self._triad.configure(instantaneous(imu))

    def inject(self, fault: Fault, first: int) -> None:
        """Let a fault begin with the first sample not before the IMU's sample ``first``."""
        self._own.inject(fault, first)

    def read(
        self, block: ImuBlock, trajectory: Trajectory, temperature: TemperatureProfile
    ) -> PressureBlock:
        """Return the samples that were not read yet and lie before the end of the IMU's block."""
        samples = self._own.next(block.first + len(block.true_t_ns), trajectory.duration)
        position, q_wb, celsius = self._own.place(samples, block, trajectory, temperature)
        arm_w = rotate(q_wb, self._lever_arm_b)
        # In a curved world, too, z is the height above the origin's (CurvedEarth).
        ideal = self._atmosphere.pressure(self._height + position[2] + arm_w[2])
        gust = self._gusts.next(len(samples.t))
        values = np.zeros((3, len(samples.t)))
        np.add(ideal, gust, out=values[0])
        offset = celsius - self._reference_temperature
        made = self._triad.read(
            samples.first, values, np.zeros(values.shape), offset, self._own.faults
        )
        return PressureBlock(
            samples.true_t_ns,
            *self._own.stamp(samples),
            np.clip(made.reading[0], *self._limits),
            ideal,
            made.bias[0] + gust,
        )
