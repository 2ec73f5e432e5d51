# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""GNSS and wheels of a body, which aid its IMU, in the terms of the stacks' configurations."""

import math
from dataclasses import dataclass
from typing import Final

import numpy as np

from imu_sim_ros.core.types import Array
from imu_sim_ros.datasets.consumers.values import ImuValues
from imu_sim_ros.sensors.gnss.parameters import MODES, GnssParameters
from imu_sim_ros.sensors.wheels.model import rim_speeds
from imu_sim_ros.sensors.wheels.parameters import WheelsParameters
from imu_sim_ros.sensors.wheels.uncertainty import StatedCovariance
from imu_sim_ros.simulation.parameters import SimulationParameters

SPEED: Final = 1.0
"""Speed at which the noise of wheels, which grows with it, is stated as one number [m/s]."""


@dataclass(frozen=True)
class Aiding:
    """One IMU, and the GNSS and wheels of its body, which are None if it has none."""

    values: ImuValues
    """Values of the IMU."""
    parameters: SimulationParameters
    """Parameters of the simulation."""
    gnss: GnssParameters | None
    wheels: WheelsParameters | None

    def point_in_imu(self, point: tuple[float, ...]) -> Array:
        """Return a point of the body (3,) in the IMU's frame [m]."""
        imu = self.values.imu
        return self.rotation() @ (np.asarray(point) - np.asarray(imu.lever_arm))

    def rotation(self) -> Array:
        """Return R_ib (3, 3), from the body's axes to the IMU's."""
        return np.reshape(self.values.imu.mounting, (3, 3)).T

    def stamp_correction(
        self, parameters: GnssParameters | WheelsParameters, lag: float = 0.0
    ) -> float:
        """Return the correction of a sensor's stamps to the clock of the IMU's stamps [s].

        :param lag: delay of the stamps behind the middle of the measurement [s].
        """
        return self.values.lateness - parameters.stamp_offset - lag

    @property
    def position_sigma(self) -> tuple[float, float]:
        """Horizontal and vertical standard deviations that the receiver first states [m]."""
        assert self.gnss is not None
        factor, mode = math.sqrt(self.gnss.covariance_factor), MODES.index(self.gnss.mode)
        return factor * self.gnss.horizontal_sigma[mode], factor * self.gnss.vertical_sigma[mode]

    @property
    def twist_sigma(self) -> tuple[float, float]:
        """Standard deviations of forward speed [m/s] and yaw rate [rad/s] stated at 1 m/s."""
        assert self.wheels is not None
        p = self.wheels
        jacobian = rim_speeds(p.model, p.track, p.wheelbase)
        covariance = StatedCovariance(p, jacobian, np.asarray(np.linalg.pinv(jacobian), np.float64))
        straight = np.array([[SPEED, 0.0, 0.0]])
        variances = np.diag(covariance.twist_covariance(straight, np.zeros((1, len(p.joints))))[0])
        return math.sqrt(variances[0]), math.sqrt(variances[2])

    @property
    def wheel_speed_density(self) -> float:
        """White noise of a wheel's rate at 1 m/s, from counts and random slip [rad/s/sqrt(Hz)]."""
        assert self.wheels is not None
        p = self.wheels
        tick = math.tau / p.ticks if p.ticks else 0.0
        counted = 2.0 * p.rate * (p.encoder_noise**2 + tick**2 / 12.0)
        return math.sqrt(counted + p.slip_noise**2 * SPEED / p.radius**2)


def aiding_of_imu(values: ImuValues, parameters: SimulationParameters) -> Aiding | None:
    """Return the aiding sensors of a body for an IMU; None: neither GNSS nor wheels."""
    gnss, wheels = parameters.each_sensor.get("gnss"), parameters.each_sensor.get("wheels")
    gnss = gnss if isinstance(gnss, GnssParameters) else None
    wheels = wheels if isinstance(wheels, WheelsParameters) else None
    return Aiding(values, parameters, gnss, wheels) if gnss or wheels else None
