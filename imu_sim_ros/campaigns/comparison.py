# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""A trajectory that an estimator wrote, compared with the truth."""

import contextlib
from dataclasses import dataclass, field

import numpy as np

from imu_sim_ros.campaigns.metrics import ESTIMATED, Metrics, Relative, pose_metrics
from imu_sim_ros.campaigns.parameters import TrajectoryEstimator
from imu_sim_ros.core.errors import ImuSimError, InputError
from imu_sim_ros.core.records import States
from imu_sim_ros.core.rotation import rotate_inverse
from imu_sim_ros.core.types import Mask, Times
from imu_sim_ros.navigation.association import (
    align,
)
from imu_sim_ros.navigation.comparison import Comparison, compare
from imu_sim_ros.navigation.coverage import beyond, coverage
from imu_sim_ros.navigation.evaluation import (
    LARGEST_SIGMA,
    attitude_sigma,
    invertible,
    nees,
    remainder,
)


@dataclass
class RunOutcome:
    """The results of a run; of one that fails, those up to its failure."""

    metrics: Metrics = field(default_factory=dict)
    track: States | None = None
    """The estimate."""
    findings: list[str] = field(default_factory=list)
    """A line for each mistake that the estimate shows next to the truth."""


def coverage_metrics(
    t_ns: Times, truth_ns: Times, estimator: TrajectoryEstimator, failed: Mask | None = None
) -> Metrics:
    """Return the metrics of the time that an estimate covers.

    :param t_ns: (n,) stamps of the estimate [ns], increasing.
    :param truth_ns: (m,) stamps of the truth [ns].
    :param failed: (n,) True for poses with which the estimate has failed.
    """
    limits = (estimator.max_gap, estimator.initialisation_allowance)
    track_coverage = coverage(t_ns, truth_ns, *limits, failed=failed)
    return {
        "coverage": track_coverage.share,
        ESTIMATED: track_coverage.estimated_s / track_coverage.truth_s,
        "time_to_failure_s": track_coverage.time_to_failure_s,
    }


def estimate_metrics(
    estimate: States,
    truth: States,
    alignment: str,
    relative: tuple[Relative, ...],
    estimator: TrajectoryEstimator,
    diverged_above: float,
) -> Metrics:
    """Return the metrics of an estimate.

    :param alignment: alignment of the estimate with the truth. There is a NEES with ``none`` and
            with ``yaw``, which fixes the gauge at one pose for it.
    :param diverged_above: position error above which the estimate has failed [m]; 0: no limit.
    :raises ImuSimError: if both do not overlap in time, or cannot be aligned.
    """
    errors = compare(estimate, truth, alignment)
    metrics = pose_metrics(errors, relative)
    failed = beyond(errors.position, diverged_above)
    metrics.update(coverage_metrics(errors.t_ns, truth.t_ns, estimator, failed))
    with contextlib.suppress(ImuSimError):
        scale = align(errors.unaligned.position, errors.truth.position, "sim3").scale
        metrics["scale_error"] = scale - 1.0
    metrics["initialisation_s"] = float(estimate.t_ns[0] - truth.t_ns[0]) * 1e-9
    if errors.velocity is not None:
        metrics["final_velocity_error_m_s"] = errors.final_velocity
    if alignment in ("none", "yaw"):
        if estimate.covariance is not None:
            metrics.update(_consistency(errors))
        if not (metrics.get("attitude_sigma_rad") or 0.0) > LARGEST_SIGMA:
            metrics["nees_velocity"] = _velocity_nees(errors)
    return metrics


def check(
    metrics: Metrics, diverged_above: float = 0.0, estimator: TrajectoryEstimator | None = None
) -> None:
    """Refuse numbers that are not finite, an error above the limit, and too small a coverage.

    :param diverged_above: limit of the final position error [m]; 0: none.
    :param estimator: limits of the coverage; None: no path is estimated.
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


def _consistency(errors: Comparison) -> Metrics:
    """Return the NEES of the last pose of an estimate that states covariances."""
    estimate = errors.unaligned
    assert estimate.covariance is not None
    metrics: Metrics = {}
    for name in ("attitude", "position"):
        part = remainder(name, estimate.covariance, estimate, errors.truth, errors.kind)
        if part is None:
            continue
        covariance = part.covariances[-1:]
        if name == "attitude" and np.isfinite(covariance).all():
            sigma = float(attitude_sigma(covariance)[0])
            metrics["attitude_sigma_rad"] = sigma
            if sigma > LARGEST_SIGMA:
                return metrics
        if part.usable[-1]:
            metrics[f"nees_{name}"] = float(nees(part.errors[-1:], covariance)[0])
    return metrics


def _velocity_nees(errors: Comparison) -> float | None:
    """Return the NEES of the last velocity in the body frame, which yaw does not change."""
    estimate, truth = errors.unaligned, errors.truth
    if estimate.velocity is None or estimate.twist_covariance is None:
        return None
    covariance = estimate.twist_covariance[-1:, :3, :3]
    velocity_b = rotate_inverse(estimate.q_wb[-1:], estimate.velocity[-1:])
    error = velocity_b - rotate_inverse(truth.q_wb[-1:], truth.velocities()[-1:])
    return float(nees(error, covariance)[0]) if invertible(covariance)[0] else None
