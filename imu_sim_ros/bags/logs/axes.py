# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Axes of autopilots in those of this package: FRD bodies are FLU, NED worlds are ENU.

With D = diag(1, -1, -1) and P, which exchanges north and east and inverts down,
``v_flu = D v_frd``, ``v_enu = P v_ned``, ``R_enu_flu = P R_ned_frd D`` (REP-103).
"""

from typing import Final

import numpy as np
from numpy.typing import ArrayLike

from imu_sim_ros.core.rotation import multiply
from imu_sim_ros.core.types import Array

_HALF_TURN_ABOUT_X: Final = np.array([0.0, 1.0, 0.0, 0.0])
"""Quaternion of D."""
_HALF_TURN_ABOUT_XY: Final = np.array([0.0, np.sqrt(0.5), np.sqrt(0.5), 0.0])
"""Quaternion of P."""


def flu(vector_frd: ArrayLike) -> Array:
    """Return vectors (n, 3) of a forward-right-down frame in forward-left-up."""
    return np.asarray(vector_frd, np.float64) * (1.0, -1.0, -1.0)


def enu(vector_ned: ArrayLike) -> Array:
    """Return vectors (n, 3) of a north-east-down frame in east-north-up."""
    return np.asarray(vector_ned, np.float64)[:, [1, 0, 2]] * (1.0, 1.0, -1.0)


def q_enu_flu(q_ned_frd: ArrayLike) -> Array:
    """Return attitudes (n, 4) of an FLU body in ENU from those of the FRD body in NED."""
    return multiply(multiply(_HALF_TURN_ABOUT_XY, q_ned_frd), _HALF_TURN_ABOUT_X)


def q_enu_of_ned(q_nb: ArrayLike) -> Array:
    """Return attitudes (n, 4) in ENU from those of the same body in NED."""
    return multiply(_HALF_TURN_ABOUT_XY, q_nb)


def q_flu_flu(q_frd_frd: ArrayLike) -> Array:
    """Return attitudes (n, 4) of an FLU body in a forward-left-up world.

    :param q_frd_frd: (n, 4) of the FRD body in a forward-right-down world of any heading.
    """
    return multiply(multiply(_HALF_TURN_ABOUT_X, q_frd_frd), _HALF_TURN_ABOUT_X)
