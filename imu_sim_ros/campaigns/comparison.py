# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""A trajectory that an estimator wrote, compared with the truth."""

import contextlib
from pathlib import Path
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from imu_sim_ros.bags.messages.encode import ODOMETRY
from imu_sim_ros.bags.read import open_bag, read_odometry, read_poses
from imu_sim_ros.bags.text.reader import is_text
from imu_sim_ros.campaigns.metrics import Metrics, Relative, pose_metrics
from imu_sim_ros.campaigns.parameters import TrajectoryEstimator
from imu_sim_ros.errors import ImuSimError, InputError
from imu_sim_ros.navigation.association import (
    Alignment,
    align,
    common_rows,
    interpolate_poses,
    interpolate_vectors,
)
from imu_sim_ros.navigation.coverage import beyond, coverage
from imu_sim_ros.navigation.evaluation import (
    LARGEST_SIGMA,
    absolute_errors,
    attitude_sigma,
    gauge_at_first,
    invertible,
    nees,
    without_gauge,
)
from imu_sim_ros.poses import PoseSequence
from imu_sim_ros.rotation import rotate, rotate_inverse
from imu_sim_ros.sensors.block import ImuBlock
from imu_sim_ros.types import Array, Mask, Times


class EstimatedTrack(NamedTuple):
    """A trajectory with further data from its source."""

    poses: PoseSequence
    velocity: Array | None = None
    """(n, 3) in the world [m/s]."""
    velocity_covariance: Array | None = None
    """(n, 3, 3) in the body."""


def read_estimate(path: Path, topic: str | None) -> EstimatedTrack:
    """Read a file of poses (TUM, EuRoC), or a topic of a bag.

    :param topic: None: the only topic of Odometry, else of PoseStamped.
    :raises InputError: for what cannot be read or is not a trajectory.
    """
    if is_text(path) or not _has_odometry(path, topic):
        found = EstimatedTrack(read_poses(path, topic, covariance=True))
    else:
        odometry = read_odometry(path, topic)
        pose, twist = odometry.pose_covariance, odometry.twist_covariance[:, :3, :3]
        poses = PoseSequence(odometry.t_ns, odometry.position, odometry.q_wb)
        found = EstimatedTrack(
            poses._replace(covariance=pose if pose.any() else None),
            rotate(odometry.q_wb, odometry.velocity_b),
            twist if twist.any() else None,
        )
    if len(found.poses.t_ns) < 2:
        raise InputError(f"{len(found.poses.t_ns)} poses; a trajectory needs two or more")
    return found


def _has_odometry(path: Path, topic: str | None) -> bool:
    with open_bag(path) as bag:
        return any(
            info.type == ODOMETRY and (topic is None or info.name.strip("/") == topic.strip("/"))
            for info in bag.topics
        )


def coverage_metrics(
    t_ns: Times, truth_ns: Times, estimator: TrajectoryEstimator, failed: Mask | None = None
) -> Metrics:
    """Return how long an estimate lasts.

    :param t_ns: (n,) its stamps [ns], increasing.
    :param truth_ns: (m,) those of the truth.
    :param failed: (n,) poses with which it has failed.
    """
    limits = (estimator.max_gap, estimator.initialisation_allowance)
    found = coverage(t_ns, truth_ns, *limits, failed=failed)
    return {"coverage": found.share, "time_to_failure_s": found.time_to_failure_s}


def estimate_metrics(
    found: EstimatedTrack,
    block: ImuBlock,
    alignment: str,
    relative: tuple[Relative, ...],
    estimator: TrajectoryEstimator,
    diverged_above: float,
) -> Metrics:
    """Return the metrics of an estimate of the motion of a block of samples.

    :param alignment: of the estimate with the truth. There is a NEES with ``none`` and with
        ``yaw``, which fixes the gauge at the first pose for it.
    :param diverged_above: error of the position with which it has failed [m]; 0: none.
    :raises ImuSimError: if both do not overlap in time, or cannot be aligned.
    """
    motion = block.motion
    truth = PoseSequence(block.true_t_ns, motion.position, motion.q_wb)
    rows = common_rows(found.poses.t_ns, truth.t_ns)
    estimate = _at_rows(found.poses, rows)
    there = interpolate_poses(truth, estimate.t_ns)
    aligned = align(estimate.position, there.position, alignment)
    laid_on = aligned.apply(estimate)
    metrics = pose_metrics(laid_on, there, relative)
    failed = beyond(there.position - laid_on.position, diverged_above)
    metrics.update(coverage_metrics(estimate.t_ns, truth.t_ns, estimator, failed))
    with contextlib.suppress(ImuSimError):
        metrics["scale_error"] = align(estimate.position, there.position, "sim3").scale - 1.0
    metrics["initialisation_s"] = float(found.poses.t_ns[0] - block.true_t_ns[0]) * 1e-9
    velocity = _velocity_error(found, rows[-1:], aligned, block)
    if velocity is not None:
        metrics["final_velocity_error_m_s"] = float(np.linalg.norm(velocity))
    if alignment == "yaw" and found.poses.covariance is not None:
        aligned = gauge_at_first(estimate, there)
        position = aligned.apply(found.poses).position
        stated = without_gauge(found.poses.covariance[rows], position[rows], aligned)
        covariance = np.zeros_like(found.poses.covariance)
        covariance[rows] = stated
        found = found._replace(
            poses=aligned.apply(found.poses)._replace(covariance=covariance),
            velocity=None if found.velocity is None else found.velocity @ aligned.r.T,
        )
        velocity = _velocity_error(found, rows[-1:], Alignment(1.0, np.eye(3), np.zeros(3)), block)
    if alignment in ("none", "yaw"):
        metrics.update(_consistency(found, rows[-1:], _at_rows(there, np.array([-1])), velocity))
    return metrics


def check(
    metrics: Metrics, diverged_above: float = 0.0, estimator: TrajectoryEstimator | None = None
) -> None:
    """Refuse numbers that are not finite, an error above the limit, and too little of a path.

    :param diverged_above: limit of the final position error [m]; 0: none.
    :param estimator: None: it estimates no path.
    :raises InputError: with the reason.
    """
    for name, value in metrics.items():
        if value is not None and not np.isfinite(value):
            raise InputError(f"{name} is not finite")
    final = metrics.get("final_position_error_m")
    if diverged_above and final is not None and final > diverged_above:
        raise InputError(f"diverged: {final:.4g} m at the end")
    covered = metrics.get("coverage")
    if estimator is not None and covered is not None and covered < estimator.coverage:
        raise InputError(
            f"covers {100.0 * covered:.3g} % of the truth's time, less than coverage = "
            f"{estimator.coverage:g}; gaps are longer than max_gap = {estimator.max_gap:g} s"
        )


def _at_rows(poses: PoseSequence, rows: NDArray[np.intp]) -> PoseSequence:
    return PoseSequence(poses.t_ns[rows], poses.position[rows], poses.q_wb[rows])


def _velocity_error(
    found: EstimatedTrack, row: NDArray[np.intp], aligned: Alignment, block: ImuBlock
) -> Array | None:
    """Return truth minus estimate (1, 3), in the world; None if there is no velocity."""
    if found.velocity is None:
        return None
    at_ns = found.poses.t_ns[row]
    true = interpolate_vectors(block.true_t_ns, block.motion.velocity, at_ns)
    return true - aligned.scale * found.velocity[row] @ aligned.r.T


def _consistency(
    found: EstimatedTrack, row: NDArray[np.intp], truth: PoseSequence, velocity: Array | None
) -> Metrics:
    """Return the NEES of those parts of the last state that have a covariance.

    :param truth: at that time, (1,).
    :param velocity: (1, 3) its error in the world.
    """
    result: Metrics = {}
    estimate = _at_rows(found.poses, row)
    if found.poses.covariance is not None:
        errors, covariance = absolute_errors(estimate, truth), found.poses.covariance[row]
        if np.isfinite(covariance).all():
            sigma = float(attitude_sigma(covariance[:, 3:, 3:])[0])
            result["attitude_sigma_rad"] = sigma
            if sigma > LARGEST_SIGMA:
                return result
        result["nees_position"] = _nees(errors.position, covariance[:, :3, :3])
        result["nees_attitude"] = _nees(errors.attitude, covariance[:, 3:, 3:])
    velocities, covariances = found.velocity, found.velocity_covariance
    if velocity is not None and velocities is not None and covariances is not None:
        # The twist's covariance is that of the velocity in the body.
        true = rotate_inverse(truth.q_wb, velocities[row] + velocity)
        error = true - rotate_inverse(estimate.q_wb, velocities[row])
        result["nees_velocity"] = _nees(error, covariances[row])
    return result


def _nees(error: Array, covariance: Array) -> float | None:
    """Return the NEES of one error (1, 3); None if its covariance has no inverse."""
    if not invertible(covariance)[0]:
        return None
    return float(nees(error, covariance)[0])
