# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

import math
from dataclasses import dataclass

import numpy as np

from imu_sim_ros.core import rotation
from imu_sim_ros.parameters.kinds import number
from imu_sim_ros.trajectory.motion import Motion
from imu_sim_ros.trajectory.parameters import TrajectoryParameters


@dataclass(frozen=True)
class Pendulum(TrajectoryParameters):
    rod: float = number(1.0, "length of the rod", unit="m", minimum=0.0, above_minimum=True)
    swing: float = number(0.1, "largest angle", unit="rad")
    duration = math.inf

    def sample(self, t):
        w, z = math.sqrt(9.81 / self.rod), np.zeros_like(t)
        angle, rate = self.swing * np.sin(w * t), self.swing * w * np.cos(w * t)
        slowing, s, c = -w * w * angle, np.sin(angle), np.cos(angle)
        along, down = np.stack([c, z, s], axis=-1), np.stack([s, z, -c], axis=-1)
        return Motion(
            position=self.rod * down,
            velocity=self.rod * rate[:, None] * along,
            acceleration=self.rod * (slowing[:, None] * along - rate[:, None] ** 2 * down),
            q_wb=rotation.from_euler(np.stack([z, -angle, z], axis=-1)),
            angular_velocity=np.stack([z, -rate, z], axis=-1),
            angular_acceleration=np.stack([z, -slowing, z], axis=-1),
        )
