# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""A motion along a radius that turns: the lecture's ball on a turning disc, in the disc's axes."""

import math

import numpy as np

from imu_sim_ros.config import PolarParameters
from imu_sim_ros.trajectory.euler import attitude
from imu_sim_ros.trajectory.motion import Array, Motion
from imu_sim_ros.trajectory.profile import Derivatives
from imu_sim_ros.trajectory.series import SeriesSet


class Polar:
    """``p = (r cos angle, r sin angle, height)`` with the body turned by the same angle about z.

    In the body, x pointing outward, the acceleration is
    ``(r'' - r angle'^2, 2 r' angle' + r angle'', 0)``: the relative, centrifugal, Coriolis and
    Euler terms of the lecture's eq. 4. Without end.
    """

    def __init__(self, parameters: PolarParameters) -> None:
        self._coordinates = SeriesSet([parameters.radius, parameters.angle])
        self._height = parameters.height

    @property
    def duration(self) -> float:
        """Infinite."""
        return math.inf

    @property
    def highest_frequency(self) -> float:
        """Of radius and angle [Hz]; the steady turn adds none, as the body stays upright."""
        return self._coordinates.highest_frequency

    def sample(self, t: Array) -> Motion:
        """Return the motion at times t (n,) [s]."""
        n = len(t)
        _, (r, angle) = self._coordinates.sample(t, self._coordinates.waves(t))
        along, across = (
            r.second - r.value * angle.first * angle.first,
            2.0 * r.first * angle.first + r.value * angle.second,
        )
        c, s = np.cos(angle.value), np.sin(angle.value)
        p, v, a = np.zeros((3, n, 3))
        p[:, 0], p[:, 1], p[:, 2] = r.value * c, r.value * s, self._height
        sweep = r.value * angle.first
        v[:, 0], v[:, 1] = r.first * c - sweep * s, r.first * s + sweep * c
        a[:, 0], a[:, 1] = along * c - across * s, along * s + across * c
        level = Derivatives(0.0, 0.0, 0.0)
        return Motion(p, v, a, *attitude(level, level, angle, n))
