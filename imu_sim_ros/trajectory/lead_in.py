# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""A start from which visual-inertial estimators can initialise: rest, a jerk, then the motion."""

import numpy as np

from imu_sim_ros.config import LeadInParameters
from imu_sim_ros.trajectory.motion import Array, Motion, Trajectory, highest_frequency


class LeadIn:
    """A motion that begins with rest, displaced and back once before it sets out.

    The displacement is ``d b(x)`` with ``b = 256 x^4 (1 - x)^4`` and x the fraction of the
    jerk: it rises to d and falls back, and its first three derivatives vanish at both ends.
    """

    def __init__(self, inner: Trajectory, parameters: LeadInParameters) -> None:
        """Displace a motion that rests from 0 until the jerk is over."""
        self.inner = inner
        self._parameters = parameters

    @property
    def duration(self) -> float:
        """Length [s]."""
        return self.inner.duration

    @property
    def highest_frequency(self) -> float:
        """Of the motion and of the jerk, a smooth bump with four periods at most [Hz]."""
        return max(highest_frequency(self.inner), 4.0 / self._parameters.jerk_time)

    def sample(self, t: Array) -> Motion:
        """Return the motion at times t (n,) [s]."""
        p = self._parameters
        motion = self.inner.sample(t)
        x = np.clip((t - p.rest) / p.jerk_time, 0.0, 1.0)
        s, slope = x * (1.0 - x), 1.0 - 2.0 * x
        cube = s * s * s
        value = 256.0 * cube * s
        first = 1024.0 * cube * slope / p.jerk_time
        second = 1024.0 * s * s * (3.0 * slope * slope - 2.0 * s) / p.jerk_time**2
        d = np.asarray(p.jerk)
        return motion._replace(
            position=motion.position + value[:, None] * d,
            velocity=motion.velocity + first[:, None] * d,
            acceleration=motion.acceleration + second[:, None] * d,
        )
