# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""The transformation that aligns an estimated trajectory with the truth.

S. Umeyama, "Least-squares estimation of transformation parameters between two point patterns",
PAMI 1991, for SE(3) and Sim(3); Zhang and Scaramuzza, "A tutorial on quantitative trajectory
evaluation for visual(-inertial) odometry", IROS 2018, for yaw and position alone.
"""

from typing import Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from imu_sim_ros import rotation
from imu_sim_ros.errors import ConfigurationError, InputError
from imu_sim_ros.names import suggestion
from imu_sim_ros.poses import PoseSequence

Array = NDArray[np.float64]

ALIGNMENTS: Final = ("none", "yaw", "se3", "sim3")


class Alignment(NamedTuple):
    """``p_truth ~ scale R p_estimate + t``."""

    scale: float
    r: Array
    """(3, 3) rotation."""
    t: Array
    """(3,) [m]."""

    def apply(self, poses: PoseSequence) -> PoseSequence:
        """Return the poses in the frame of the truth."""
        position = self.scale * poses.position @ self.r.T + self.t
        q_wb = rotation.multiply(rotation.from_matrix(self.r), poses.q_wb)
        return poses._replace(position=position, q_wb=q_wb)


def align(estimate: Array, truth: Array, kind: str) -> Alignment:
    """Return the alignment with the least sum of squared distances.

    :param estimate: (n, 3) positions [m].
    :param truth: (n, 3) positions at the same times [m].
    :param kind: none, yaw (rotation about z, and translation), se3, or sim3 (scale as well).
    :raises InputError: for positions that leave the rotation undetermined: all in one place or on a
        line.
    """
    if kind not in ALIGNMENTS:
        raise ConfigurationError(f"alignment {kind!r}: {suggestion(kind, ALIGNMENTS)}")
    if kind == "none":
        return Alignment(1.0, np.eye(3), np.zeros(3))
    mean_estimate, mean_truth = estimate.mean(axis=0), truth.mean(axis=0)
    centred = estimate - mean_estimate
    cross_covariance = (truth - mean_truth).T @ centred / len(estimate)
    r = _yaw(cross_covariance) if kind == "yaw" else _rotation(cross_covariance)
    scale = 1.0
    if kind == "sim3":
        scale = float(np.trace(r.T @ cross_covariance) / np.mean(np.sum(centred**2, axis=1)))
    return Alignment(scale, r, mean_truth - scale * r @ mean_estimate)


def _rotation(cross_covariance: Array) -> Array:
    u, values, vt = np.linalg.svd(cross_covariance)
    if values[1] < 1e-12 * max(values[0], 1e-300):
        raise InputError(
            "the positions lie on a line or in one place: no rotation can be found for se3 or "
            "sim3; use the alignment yaw or none"
        )
    # A reflection would fit better where the last sign is negative; it is not a rotation.
    sign = np.sign(np.linalg.det(u) * np.linalg.det(vt))
    result: Array = u @ np.diag([1.0, 1.0, sign]) @ vt
    return result


def _yaw(cross_covariance: Array) -> Array:
    """Rz with the largest trace of ``Rz.T @ cross_covariance``."""
    sine = cross_covariance[1, 0] - cross_covariance[0, 1]
    cosine = cross_covariance[0, 0] + cross_covariance[1, 1]
    return rotation.to_matrix(rotation.exp([0.0, 0.0, np.arctan2(sine, cosine)]))
