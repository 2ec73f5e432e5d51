# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""A body's position and attitude over time with their derivatives; once for many runs."""

from typing import Final, NamedTuple, Protocol

import numpy as np

from imu_sim_ros.types import Array


class Motion(NamedTuple):
    """The body's state at n times; time first."""

    position: Array
    """(n, 3) p_wb [m]."""
    velocity: Array
    """(n, 3) of the body in the world frame [m/s]."""
    acceleration: Array
    """(n, 3) of the body in the world frame, without gravity [m/s^2]."""
    q_wb: Array
    """(n, 4) unit quaternions (w, x, y, z)."""
    angular_velocity: Array
    """(n, 3) omega_b, in the body frame [rad/s]."""
    angular_acceleration: Array
    """(n, 3) time derivative of omega_b, in the body frame [rad/s^2]."""


class Trajectory(Protocol):
    """An exact motion, known at any time.

    It may also have ``highest_frequency`` [Hz], see :func:`highest_frequency`, ``felt``, see
    :func:`felt`, and ``delayed``, see :func:`delayed`.
    """

    @property
    def duration(self) -> float:
        """Length [s]; ``math.inf`` where the motion has no end."""

    def sample(self, t: Array) -> Motion:
        """Return the motion at times t (n,) [s], each in [0, duration], in any order."""


class Felt(NamedTuple):
    """What a point at the body's origin feels of a motion in a world that does not turn."""

    acceleration: Array
    """(n, 3) of the body in the world frame, without gravity [m/s^2]."""
    q_wb: Array
    """(n, 4) unit quaternions (w, x, y, z)."""
    angular_velocity: Array
    """(n, 3) omega_b, in the body frame [rad/s]."""


def felt(trajectory: Trajectory, t: Array) -> Felt | Motion:
    """Return what is felt of the motion at times t (n,) [s].

    A trajectory that has a ``felt(t)`` leaves out what is not needed for it, with the same numbers
    as its ``sample(t)``; most do not.
    """
    found: Felt | Motion = getattr(trajectory, "felt", trajectory.sample)(t)
    return found


class Later(Protocol):
    """What follows after constant delays."""

    def __call__(self, rows: slice, which: slice, only_felt: bool) -> Felt | Motion:
        """Return the motion after some of the times, after each of some of the delays in turn.

        :param rows: of the n times.
        :param which: of the m delays.
        :param only_felt: whether :class:`Felt` is all that is needed.
        """


def delayed(trajectory: Trajectory, t: Array, delays: Array) -> tuple[Motion, Later] | None:
    """Return the motion at times t (n,) [s], and what follows after constant delays (m,) [s].

    The motion is that of ``sample(t)``, bit for bit; what follows may differ by rounding from
    ``sample(t + delay)``. None where the trajectory has nothing that is faster than that.
    """
    own = getattr(trajectory, "delayed", None)
    found: tuple[Motion, Later] | None = own(t, delays) if own is not None else None
    return found


def highest_frequency(trajectory: Trajectory) -> float:
    """Return the highest frequency in a motion [Hz]; 0 where the motion states none.

    Averaged readings are integrated as finely as it demands; a motion that states none must be
    smooth over the interval between two readings.
    """
    return float(getattr(trajectory, "highest_frequency", 0.0))


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
