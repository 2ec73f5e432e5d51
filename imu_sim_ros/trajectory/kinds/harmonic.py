# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Motions in closed form: every coordinate is a polynomial and a sum of sinusoids."""

import math
from typing import Final

import numpy as np

from imu_sim_ros.config import HarmonicParameters
from imu_sim_ros.trajectory.euler import attitude, attitude_and_rate
from imu_sim_ros.trajectory.motion import Array, Felt, Later, Motion
from imu_sim_ros.trajectory.series import SeriesSet, Waves

_FEW: Final = 1000
"""Times and delays together up to which all are evaluated at once."""


class Harmonic:
    """Position and Euler angles in closed form (lecture, section 5, first method), without end."""

    def __init__(self, parameters: HarmonicParameters) -> None:
        p = parameters
        self._coordinates = SeriesSet([p.x, p.y, p.z, p.roll, p.pitch, p.yaw])
        rates = [abs(sum(angle.polynomial[1:2])) for angle in (p.roll, p.pitch, p.yaw)]
        self._spin = max(rates) / (2.0 * math.pi)

    @property
    def duration(self) -> float:
        """Infinite."""
        return math.inf

    @property
    def highest_frequency(self) -> float:
        """Of the coordinates, and of gravity in a body that turns at a constant rate [Hz]."""
        return max(self._coordinates.highest_frequency, self._spin)

    def sample(self, t: Array) -> Motion:
        """Return the motion at times t (n,) [s]."""
        return self._motion(t, self._coordinates.waves(t))

    def felt(self, t: Array) -> Felt:
        """Return what is felt of the motion at times t (n,) [s], at two thirds of the cost."""
        return self._felt(t, self._coordinates.waves(t))

    def delayed(self, t: Array, delays: Array) -> tuple[Motion, Later]:
        """Return the motion at times t (n,) [s], and that after constant delays (m,) [s].

        The sines at t serve for all of them; see :class:`Later`.
        """
        waves = self._coordinates.waves(t)
        if len(t) * len(delays) <= _FEW:
            return self._at_once(t, delays, waves)

        def later(rows: slice, which: slice, only_felt: bool) -> Felt | Motion:
            times = (delays[which, None] + t[rows]).ravel()
            own = self._coordinates.turned(waves.at(rows), delays[which])
            return self._felt(times, own) if only_felt else self._motion(times, own)

        return self._motion(t, waves), later

    def _at_once(self, t: Array, delays: Array, waves: Waves) -> tuple[Motion, Later]:
        """Return the same of few times, with one evaluation: its calls are what takes time."""
        n = len(t)
        turned = self._coordinates.turned(waves, delays)
        every = Waves(*(np.concatenate(pair, axis=1) for pair in zip(waves, turned, strict=True)))
        times = np.concatenate([t, (delays[:, None] + t).ravel()])
        motion = self._motion(times, every)

        def later(rows: slice, which: slice, only_felt: bool) -> Felt | Motion:
            of_delays = (values[n:].reshape(len(delays), n, -1)[which, rows] for values in motion)
            found = Motion(*(values.reshape(-1, values.shape[-1]) for values in of_delays))
            return Felt(*found[2:5]) if only_felt else found

        return Motion(*(values[:n] for values in motion)), later

    def _motion(self, t: Array, waves: Waves) -> Motion:
        table, (*_, roll, pitch, yaw) = self._coordinates.sample(t, waves)
        position, velocity, acceleration = table[:, :3]
        attitudes = attitude(roll, pitch, yaw, len(t))
        return Motion(position.T, velocity.T, acceleration.T, *attitudes)

    def _felt(self, t: Array, waves: Waves) -> Felt:
        acceleration, (roll, pitch, yaw) = self._coordinates.felt(t, waves)
        return Felt(acceleration.T, *attitude_and_rate(roll, pitch, yaw, len(t)))
