# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""A motion that is sampled once for many simulations."""

from typing import Final

import numpy as np
from numpy.typing import NDArray

from imu_sim_ros.trajectory.motion import (
    Felt,
    Later,
    Motion,
    Trajectory,
    delayed,
    highest_frequency,
)

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
        self._kept_later: list[tuple[Array, Array, Motion, Later]] = []
        self._count = 0

    def sample(self, t: Array) -> Motion:
        """Return the motion at times t (n,) [s]."""
        for times, motion in self._kept:
            if np.array_equal(times, t):
                return motion
        motion = self._trajectory.sample(t)
        if self._has_room(len(t)):
            _freeze(motion)
            self._kept.append((t.copy(), motion))
        return motion

    def delayed(self, t: Array, delays: Array) -> tuple[Motion, Later] | None:
        """Return the motion at times t and after constant delays, where the motion offers that."""
        for times, own, motion, later in self._kept_later:
            if np.array_equal(times, t) and np.array_equal(own, delays):
                return motion, later
        found = delayed(self._trajectory, t, delays)
        if found is None or not self._has_room(len(t) * (1 + len(delays))):
            return found
        motion, later = found[0], _remembered(found[1])
        _freeze(motion)
        self._kept_later.append((t.copy(), delays.copy(), motion, later))
        return motion, later

    def _has_room(self, count: int) -> bool:
        """Return whether so many more times can be kept, and count them."""
        if self._count + count > _MOST:
            return False
        self._count += count
        return True


def _remembered(later: Later) -> Later:
    """Return a function that works out each of its motions once."""
    kept: dict[tuple[int, int, int, int, bool], Felt | Motion] = {}

    def again(rows: slice, which: slice, only_felt: bool) -> Felt | Motion:
        key = (rows.start, rows.stop, which.start, which.stop, only_felt)
        if key not in kept:
            kept[key] = later(rows, which, only_felt)
            _freeze(kept[key])
        return kept[key]

    return again


def _freeze(motion: Felt | Motion) -> None:
    for values in motion:
        values.flags.writeable = False
