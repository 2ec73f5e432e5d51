# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""The ideal reading: specific force and angular rate of a perfect IMU."""

import numpy as np
from numpy.typing import NDArray

from imu_sim_ros.config import SimulationParameters
from imu_sim_ros.rotation.components import cross, rotate_inverse, transform
from imu_sim_ros.sensor.gravity import earth_rate_vector, gravity_vector
from imu_sim_ros.trajectory import Motion, Trajectory

Array = NDArray[np.float64]

# Gauss-Legendre nodes and weights on [0, 1]: exact up to the fifth power of time.
_NODES = 0.5 + 0.5 * np.sqrt(0.6) * np.array([-1.0, 0.0, 1.0])
_WEIGHTS = (5.0 / 18.0, 8.0 / 18.0, 5.0 / 18.0)


class IdealImu:
    """An IMU without errors at its place in the body."""

    def __init__(self, parameters: SimulationParameters) -> None:
        self._gravity_w = gravity_vector(parameters)[:, None]
        self._earth_rate_w = earth_rate_vector(parameters)[:, None]
        self._lever_arm_b = np.reshape(parameters.imu.lever_arm, (3, 1))
        self._has_lever_arm = bool(self._lever_arm_b.any())
        self._earth_turns = bool(self._earth_rate_w.any())
        self._r_ib = np.reshape(parameters.imu.mounting, (3, 3)).T

    def read(self, motion: Motion) -> tuple[Array, Array]:
        """Return angular rate [rad/s] and specific force [m/s^2], both (3, n), in the IMU's frame.

        Without Earth rotation ``omega_b`` and ``f_b = R_wb.T (a_w - g_w)`` (lecture eq. 22); at a
        lever arm r the IMU's own acceleration has ``alpha x r + omega x (omega x r)`` more.
        With Earth rotation the gyroscope also reads ``R_wb.T omega_ie`` and the accelerometer the
        Coriolis term ``2 omega_ie x v`` of the IMU's velocity (Groves, "Principles of GNSS,
        Inertial, and Multisensor Integrated Navigation Systems", 2nd ed., eq. 5.41); the
        centrifugal term is a part of gravity. The world is flat: no transport rate.
        """
        if _at_rest(motion):
            rate, force = self._read(Motion(*(values[:1] for values in motion)))
            n = len(motion.position)
            return np.broadcast_to(rate, (3, n)), np.broadcast_to(force, (3, n))
        return self._read(motion)

    def _read(self, motion: Motion) -> tuple[Array, Array]:
        q_wb = motion.q_wb.T
        rate = motion.angular_velocity.T
        force = rotate_inverse(q_wb, motion.acceleration.T - self._gravity_w)
        arm = self._lever_arm_b
        if self._has_lever_arm:
            force += cross(motion.angular_acceleration.T, arm)
            force += cross(rate, cross(rate, arm))
        if self._earth_turns:
            earth_rate = rotate_inverse(q_wb, self._earth_rate_w)
            velocity = rotate_inverse(q_wb, motion.velocity.T) + cross(rate, arm)
            force += 2.0 * cross(earth_rate, velocity)
            rate = rate + earth_rate
        return transform(self._r_ib, rate), transform(self._r_ib, force)

    def read_mean(self, trajectory: Trajectory, start: Array, end: Array) -> tuple[Array, Array]:
        """Return the mean readings over intervals (lecture eq. 11), both (3, n).

        Times the interval's length they are the delta angle and the delta velocity. Three-point
        Gauss-Legendre quadrature: the error falls with the sixth power of the interval.

        :param start: (n,) seconds.
        :param end: (n,) seconds, not before start.
        """
        rate, force = np.zeros((2, 3, len(start)))
        for node, weight in zip(_NODES, _WEIGHTS, strict=True):
            omega, f = self.read(trajectory.sample(start + node * (end - start)))
            rate += weight * omega
            force += weight * f
        return rate, force


def _at_rest(motion: Motion) -> bool:
    """Tell whether a motion is one row that stands for all times (see the static trajectory)."""
    return len(motion.position) > 1 and all(values.strides[0] == 0 for values in motion)
