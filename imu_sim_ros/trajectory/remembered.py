# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""A motion that is sampled once for many simulations."""

from typing import Final

import numpy as np
from numpy.typing import NDArray

from imu_sim_ros.trajectory.motion import Motion, Trajectory, highest_frequency

Array = NDArray[np.float64]

_MOST: Final = 100_000
"""Times that are kept, 22 MB; what is sampled beyond them is sampled again."""


class RememberedTrajectory:
    """A trajectory that keeps what it was sampled at; the arrays it returns are read-only.

    A simulation samples the motion at the same times whatever its seed.
    """

    def __init__(self, trajectory: Trajectory) -> None:
        self.duration = trajectory.duration
        self.highest_frequency = highest_frequency(trajectory)
        self._trajectory = trajectory
        self._kept: list[tuple[Array, Motion]] = []
        self._count = 0

    def sample(self, t: Array) -> Motion:
        """Return the motion at times t (n,) [s]."""
        for times, motion in self._kept:
            if np.array_equal(times, t):
                return motion
        motion = self._trajectory.sample(t)
        if self._count + len(t) <= _MOST:
            self._count += len(t)
            for values in motion:
                values.flags.writeable = False
            self._kept.append((t.copy(), motion))
        return motion
