# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""A body that is thrown and falls, tumbling at a constant rate."""

import math

import numpy as np

from imu_sim_ros import rotation
from imu_sim_ros.config import FreeFallParameters
from imu_sim_ros.trajectory.motion import Array, Motion


class FreeFall:
    """``p = p0 + v0 t + g t^2 / 2``, without end; an ideal accelerometer reads 0."""

    def __init__(self, parameters: FreeFallParameters) -> None:
        self._position = np.array(parameters.position)
        self._velocity = np.array(parameters.velocity)
        self._gravity = np.array(parameters.gravity)
        self._omega = np.array(parameters.angular_velocity)
        self._q_wb = rotation.from_euler(parameters.roll_pitch_yaw)

    @property
    def duration(self) -> float:
        """Infinite."""
        return math.inf

    def sample(self, t: Array) -> Motion:
        """Return the motion at times t (n,) [s]."""
        shape = (len(t), 3)
        time = t[:, None]
        return Motion(
            position=self._position + time * (self._velocity + 0.5 * time * self._gravity),
            velocity=self._velocity + time * self._gravity,
            acceleration=np.broadcast_to(self._gravity, shape),
            q_wb=rotation.multiply(self._q_wb, rotation.exp(time * self._omega)),
            angular_velocity=np.broadcast_to(self._omega, shape),
            angular_acceleration=np.broadcast_to(np.zeros(3), shape),
        )
