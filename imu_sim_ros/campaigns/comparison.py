# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""A trajectory that an estimator wrote, compared with the truth."""

import contextlib
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from imu_sim_ros.bags.messages.encode import ODOMETRY
from imu_sim_ros.bags.read import open_bag, read_odometry, read_poses
from imu_sim_ros.bags.text.reader import is_text
from imu_sim_ros.campaigns.metrics import ESTIMATED, Metrics, Relative, pose_metrics
from imu_sim_ros.campaigns.parameters import TrajectoryEstimator
from imu_sim_ros.errors import ImuSimError, InputError
from imu_sim_ros.navigation.association import (
    Alignment,
    align,
    common_rows,
    interpolate_vectors,
    poses_at,
)
from imu_sim_ros.navigation.coverage import beyond, coverage
from imu_sim_ros.navigation.evaluation import (
    LARGEST_SIGMA,
    attitude_sigma,
    invertible,
    nees,
    remainder,
)
from imu_sim_ros.records import States, with_fields
from imu_sim_ros.rotation import rotate_inverse
from imu_sim_ros.sensors.samples import Samples
from imu_sim_ros.types import Array, Mask, Times


@dataclass
class RunOutcome:
    """The results of a run; of one that fails, those up to its failure."""

    metrics: Metrics = field(default_factory=dict)
    track: States | None = None
    """The estimate."""
    findings: list[str] = field(default_factory=list)
    """A line for each mistake that the estimate shows next to the truth."""


def read_estimate(path: Path, topic: str | None) -> States:
    """Read a file of poses (TUM, EuRoC), or a topic of a bag.

    :param topic: None: the only topic of Odometry, else of PoseStamped.
    :raises InputError: for what cannot be read or is not a trajectory.
    """
    if is_text(path) or not _has_odometry(path, topic):
        states = read_poses(path, topic, covariance=True)
    else:
        states = read_odometry(path, topic).in_order()
        unknown = {  # all zeros (REP-145)
            name: None
            for name in ("covariance", "twist_covariance")
            if not np.any(getattr(states, name))
        }
        states = with_fields(states, **unknown)
    if len(states) < 2:
        raise InputError(f"{len(states)} poses; a trajectory needs two or more")
    return states


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
    return {
        "coverage": found.share,
        ESTIMATED: found.estimated_s / found.truth_s,
        "time_to_failure_s": found.time_to_failure_s,
    }


def estimate_metrics(
    found: States,
    block: Samples,
    alignment: str,
    relative: tuple[Relative, ...],
    estimator: TrajectoryEstimator,
    diverged_above: float,
) -> Metrics:
    """Return the metrics of an estimate of the motion of a block of samples.

    :param alignment: of the estimate with the truth. There is a NEES with ``none`` and with
        ``yaw``, which fixes the gauge at one pose for it.
    :param diverged_above: error of the position with which it has failed [m]; 0: none.
    :raises ImuSimError: if both do not overlap in time, or cannot be aligned.
    """
    motion = block.motion
    truth = States(block.true_t_ns, motion.position, motion.q_wb)
    rows = common_rows(found.t_ns, truth.t_ns)
    estimate = found.rows(rows)
    there = poses_at(truth, estimate.t_ns)
    aligned = align(estimate.position, there.position, alignment)
    laid_on = aligned.apply(estimate)
    metrics = pose_metrics(laid_on, there, relative)
    failed = beyond(there.position - laid_on.position, diverged_above)
    metrics.update(coverage_metrics(estimate.t_ns, truth.t_ns, estimator, failed))
    with contextlib.suppress(ImuSimError):
        metrics["scale_error"] = align(estimate.position, there.position, "sim3").scale - 1.0
    metrics["initialisation_s"] = float(found.t_ns[0] - block.true_t_ns[0]) * 1e-9
    velocity = _velocity_error(found, rows[-1:], aligned, block)
    if velocity is not None:
        metrics["final_velocity_error_m_s"] = float(np.linalg.norm(velocity))
    if alignment in ("none", "yaw"):
        stated = found.covariance
        if stated is not None:
            metrics.update(_consistency(stated[rows], estimate, there, alignment))
        if not (metrics.get("attitude_sigma_rad") or 0.0) > LARGEST_SIGMA:
            metrics["nees_velocity"] = _velocity_nees(found, rows[-1:], there, block)
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


def _velocity_error(
    found: States, row: NDArray[np.intp], aligned: Alignment, block: Samples
) -> Array | None:
    """Return truth minus estimate (1, 3), in the world; None if there is no velocity."""
    if found.velocity is None:
        return None
    at_ns = found.t_ns[row]
    true = interpolate_vectors(block.true_t_ns, block.motion.velocity, at_ns)
    return true - aligned.scale * found.velocity[row] @ aligned.r.T


def _consistency(stated: Array, estimate: States, truth: States, alignment: str) -> Metrics:
    """Return the NEES of the last pose.

    :param stated: (n, 6, 6) of the estimate (n,).
    :param truth: (n,) at the same times.
    """
    result: Metrics = {}
    for name in ("attitude", "position"):
        part = remainder(name, stated, estimate, truth, alignment)
        if part is None:
            continue
        covariance = part.covariances[-1:]
        if name == "attitude" and np.isfinite(covariance).all():
            sigma = float(attitude_sigma(covariance)[0])
            result["attitude_sigma_rad"] = sigma
            if sigma > LARGEST_SIGMA:
                return result
        if part.usable[-1]:
            result[f"nees_{name}"] = float(nees(part.errors[-1:], covariance)[0])
    return result


def _velocity_nees(
    found: States, row: NDArray[np.intp], truth: States, block: Samples
) -> float | None:
    """Return the NEES of the last velocity in the body, which yaw and position do not change.

    :param truth: ends at the time of the row.
    """
    if found.velocity is None or found.twist_covariance is None:
        return None
    at_ns, covariance = found.t_ns[row], found.twist_covariance[row, :3, :3]
    true = interpolate_vectors(block.true_t_ns, block.motion.velocity, at_ns)
    own = rotate_inverse(found.q_wb[row], found.velocity[row])
    error = rotate_inverse(truth.q_wb[-1:], true) - own
    return float(nees(error, covariance)[0]) if invertible(covariance)[0] else None
