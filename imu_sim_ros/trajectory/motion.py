# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""A body's position and attitude over time with their derivatives; once for many runs."""

from typing import Final, NamedTuple, Protocol

import numpy as np

from imu_sim_ros.core.types import Array, shapes


class Motion(NamedTuple):
    """The body's state at n times; time first.

    It is the exact motion at any times, with accelerations and without stamps, so that it is no
    :class:`imu_sim_ros.core.records.States`.
    """

    position: Array
    """(n, 3) p_wb [m]."""
    velocity: Array
    """(n, 3) velocity of the body in the world frame [m/s]."""
    acceleration: Array
    """(n, 3) acceleration of the body in the world frame, without gravity [m/s^2]."""
    q_wb: Array
    """(n, 4) unit quaternions (w, x, y, z)."""
    angular_velocity: Array
    """(n, 3) omega_b, in the body frame [rad/s]."""
    angular_acceleration: Array
    """(n, 3) time derivative of omega_b, in the body frame [rad/s^2]."""

    def __repr__(self) -> str:
        return shapes(self)


class Trajectory(Protocol):
    """An exact motion, known at any time."""

    @property
    def duration(self) -> float:
        """Length [s]; ``math.inf`` if the motion has no end."""

    @property
    def highest_frequency(self) -> float:
        """Highest frequency in the motion [Hz]; 0 if unknown.

        Averaged readings are integrated as finely as it demands; a motion that states none must be
        smooth over the interval between two readings.
        """

    def sample(self, t: Array) -> Motion:
        """Return the motion at times t (n,) [s], each in [0, duration], in any order."""


_KEPT_TIMES: Final = 100_000
"""Times that are kept, 22 MB; what is sampled beyond them is sampled again."""


class RememberedTrajectory:
    """A trajectory that keeps its samples; the arrays that it returns are read-only.

    A simulation samples the motion at the same times whatever its seed.
    """

    def __init__(self, trajectory: Trajectory) -> None:
        self.duration = trajectory.duration
        self.highest_frequency = trajectory.highest_frequency
        self._trajectory = trajectory
        self._cache: list[tuple[Array, Motion]] = []
        self._count = 0

    def sample(self, t: Array) -> Motion:
        """Return the motion at times t (n,) [s]."""
        for times, motion in self._cache:
            if np.array_equal(times, t):
                return motion
        motion = self._trajectory.sample(t)
        if self._count + len(t) <= _KEPT_TIMES:
            self._count += len(t)
            for values in motion:
                values.flags.writeable = False
            self._cache.append((t.copy(), motion))
        return motion
