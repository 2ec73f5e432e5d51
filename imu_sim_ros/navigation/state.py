# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""A navigation state: position, velocity and attitude, at one time or along a record."""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]


class NavigationState(NamedTuple):
    """The state at one time."""

    position: Array
    """(3,) p_wb [m]."""
    velocity: Array
    """(3,) of the body in the world frame [m/s]."""
    q_wb: Array
    """(4,) unit quaternion (w, x, y, z)."""


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
        return NavigationState(self.position[k], self.velocity[k], self.q_wb[k])


AT_REST = NavigationState(np.zeros(3), np.zeros(3), np.array([1.0, 0.0, 0.0, 0.0]))
"""At the origin, level, not moving."""
