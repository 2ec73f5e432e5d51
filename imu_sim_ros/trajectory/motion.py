# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Where a body is at given times: what every trajectory provides."""

from typing import NamedTuple, Protocol

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]


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
