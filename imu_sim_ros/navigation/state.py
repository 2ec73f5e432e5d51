# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""A navigation state: position, velocity and attitude, at one time or along a record."""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from imu_sim_ros.arguments import array, refuse
from imu_sim_ros.inputs import gate

if TYPE_CHECKING:
    from typing_extensions import Self

Array = NDArray[np.float64]


class _State(NamedTuple):
    position: Array
    """(3,) p_wb [m]."""
    velocity: Array
    """(3,) of the body in the world frame [m/s]."""
    q_wb: Array
    """(4,) unit quaternion (w, x, y, z)."""


class NavigationState(_State):
    """The state at one time; it is checked when it is made."""

    __slots__ = ()

    def __new__(cls, position: ArrayLike, velocity: ArrayLike, q_wb: ArrayLike) -> Self:
        """Check the state.

        :raises ConfigurationError: for what is not finite, of another shape or no unit quaternion.
        """
        q = array("q_wb", q_wb, (4,))
        if abs(float(np.linalg.norm(q)) - 1.0) > gate.UNIT_TOLERANCE:
            refuse("q_wb", q_wb, "a unit quaternion (w, x, y, z)")
        return super().__new__(
            cls, array("position", position, (3,)), array("velocity", velocity, (3,)), q
        )


class NavigationStates(NamedTuple):
    """The states at n times; time first."""

    t_ns: NDArray[np.int64]
    """(n,) [ns]."""
    position: Array
    """(n, 3) p_wb [m]."""
    velocity: Array
    """(n, 3) of the body in the world frame [m/s]."""
    q_wb: Array
    """(n, 4) unit quaternions (w, x, y, z)."""

    def at(self, k: int) -> NavigationState:
        """Return the state of row k."""
        return NavigationState._make((self.position[k], self.velocity[k], self.q_wb[k]))


AT_REST = NavigationState(np.zeros(3), np.zeros(3), np.array([1.0, 0.0, 0.0, 0.0]))
"""At the origin, level, not moving."""
