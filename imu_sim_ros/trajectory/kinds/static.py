# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""A body at rest."""

import math

import numpy as np

from imu_sim_ros import rotation
from imu_sim_ros.config import StaticParameters, Vector
from imu_sim_ros.trajectory.motion import Array, Motion


class Static:
    """A body that stays where it is, without end."""

    def __init__(self, position: Vector, roll_pitch_yaw: Vector) -> None:
        self._position = np.array(position)
        self._q_wb = rotation.from_euler(roll_pitch_yaw)

    @classmethod
    def from_parameters(cls, parameters: StaticParameters) -> "Static":
        """Return the trajectory that the parameters describe."""
        return cls(parameters.position, parameters.roll_pitch_yaw)

    @property
    def duration(self) -> float:
        """Infinite."""
        return math.inf

    def sample(self, t: Array) -> Motion:
        """Return the motion at times t (n,); the arrays are read-only views of one row."""
        n = len(t)
        zero = np.broadcast_to(np.zeros(3), (n, 3))
        return Motion(
            position=np.broadcast_to(self._position, (n, 3)),
            velocity=zero,
            acceleration=zero,
            q_wb=np.broadcast_to(self._q_wb, (n, 4)),
            angular_velocity=zero,
            angular_acceleration=zero,
        )
