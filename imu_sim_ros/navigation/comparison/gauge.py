# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Errors and covariances of an estimate whose yaw and position are free: visual-inertial odometry.

No measurement of camera and IMU shows yaw and position (4 degrees of freedom, the gauge). The error
e_k = (position, attitude) of pose k, in the world's axes, is that of the gauge g, carried along,
and an error w_k that grew since: ``e_k = N_k g + w_k``, where with the first position p_0 and the
vertical z

    N_k = [ I   z x (p_k - p_0) ]
          [ 0   z               ].

The gauge is fixed at the first pose: g is that pose's error of position and yaw, so that
``w_k = e_k - N_k g``. Since nothing that was measured changes g, w_k is independent of it if the
first pose's tilt is, and with ``Gamma = Cov(g)``, the (position, yaw) block of P_0,

    Cov(w_k) = P_k - N_k Gamma N_k^T

(the transformation of gauge-fixed covariances, ``Q Sigma Q^T`` with ``Q = I - N_k G``, of Zhang,
Gallego and Scaramuzza, "On the comparison of gauge freedom handling in optimization-based
visual-inertial state estimation", RA-L 2018; ``Cov(e_k, g) = N_k Gamma`` follows from the
independence). An estimator that starts with an exact
yaw and position has ``Gamma = 0``, one with a loose prior carries it in every P_k: what is left is
the same.
"""

from typing import Final

import numpy as np
from numpy.typing import NDArray

from imu_sim_ros import rotation
from imu_sim_ros.navigation.comparison.alignment import Alignment
from imu_sim_ros.navigation.comparison.evaluation import tilt_and_heading
from imu_sim_ros.poses import PoseSequence

Array = NDArray[np.float64]

_GAUGE: Final = np.array([0, 1, 2, 5])
"""Position and yaw among the numbers of a pose's error."""


def gauge_at_first(estimate: PoseSequence, truth: PoseSequence) -> Alignment:
    """Return the turn about z and the translation that give the first pose the truth's gauge.

    :param truth: (n,) at the times of the estimate.
    """
    heading = tilt_and_heading(estimate.q_wb[:1], truth.q_wb[:1])[1][0]
    r = rotation.to_matrix(rotation.exp(np.array([0.0, 0.0, heading])))
    return Alignment(1.0, r, truth.position[0] - r @ estimate.position[0])


def without_gauge(covariance: Array, position: Array, alignment: Alignment) -> Array:
    """Return the covariances (n, 6, 6) of what is left when the first pose's gauge is fixed.

    :param covariance: (n, 6, 6) of position and rotation about the world's axes, as the estimator
        states them, in its own frame.
    :param position: (n, 3) after the alignment [m].
    :param alignment: from :func:`gauge_at_first`.
    :returns: in the truth's frame; that of the first pose has rank 2, its tilt.
    """
    turn = np.kron(np.eye(2), alignment.r)
    p = turn @ covariance @ turn.T
    n = np.zeros((len(p), 6, 4))
    n[:, :3, :3], n[:, 5, 3] = np.eye(3), 1.0
    x, y, _ = (position - position[0]).T
    n[:, 0, 3], n[:, 1, 3] = -y, x
    result: Array = p - n @ p[0][np.ix_(_GAUGE, _GAUGE)] @ n.swapaxes(1, 2)
    return result
