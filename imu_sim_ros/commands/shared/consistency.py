# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""The NEES of a trajectory that states covariances."""

from typing import Any

import numpy as np
from numpy.typing import NDArray

from imu_sim_ros.commands import common
from imu_sim_ros.commands.shared.tracks import Track
from imu_sim_ros.navigation.comparison import (
    LARGEST_SIGMA,
    Band,
    absolute_errors,
    anees_band,
    attitude_sigma,
    gauge_at_first,
    invertible,
    nees,
    without_gauge,
)
from imu_sim_ros.poses import PoseSequence

Array = NDArray[np.float64]


def of_track(
    estimate: Track,
    rows: NDArray[np.intp],
    poses: PoseSequence,
    truth: PoseSequence,
    velocity_b: Array | None,
    alignment: str,
) -> dict[str, Any] | None:
    """Return the NEES of position, attitude and velocity where the estimate has covariances.

    :param poses: of the estimate at these rows, not aligned.
    :param velocity_b: (n, 3) error of the velocity in the body, as the twist's covariance has it;
        the gauge does not change it.
    :param alignment: none, or yaw: then the gauge is fixed at the first pose.
    """
    if estimate.pose_covariance is None:
        return None
    pose = estimate.pose_covariance[rows]
    if alignment == "yaw":
        gauge = gauge_at_first(poses, truth)
        poses = gauge.apply(poses)
        pose = without_gauge(pose, poses.position, gauge)
    errors = absolute_errors(poses, truth)
    usable = invertible(pose)
    if not usable.any():
        return None
    band = anees_band(3, 1)
    result: dict[str, Any] = {
        "poses": int(np.count_nonzero(usable)),
        "gauge": "first pose" if alignment == "yaw" else None,
        "band_95": list(band),
        "position": _nees(errors.position[usable], pose[usable, :3, :3], band),
        "attitude": _nees(errors.attitude[usable], pose[usable, 3:, 3:], band),
        "velocity": None,
    }
    if velocity_b is not None and estimate.twist_covariance is not None:
        linear = estimate.twist_covariance[rows][usable, :3, :3]
        if np.all(invertible(linear)):
            result["velocity"] = _nees(velocity_b[usable], linear, band)
    return result


def why_none(alignment: str, estimate: Track, rows: NDArray[np.intp]) -> str | None:
    """Return why there can be no NEES; None where there can."""
    if alignment not in ("none", "yaw"):
        return f"--align {alignment} removes a part of the error that the covariance still includes"
    if estimate.pose_covariance is None:
        return (
            "the estimate has no covariance, which nav_msgs/Odometry in a bag has, or text with "
            "OpenVINS' 12 columns"
        )
    attitude = estimate.pose_covariance[rows, 3:, 3:]
    sigma = float(attitude_sigma(attitude[np.isfinite(attitude).all(axis=(1, 2))]).max(initial=0.0))
    if sigma > LARGEST_SIGMA:
        return (
            f"not valid: the estimate knows its attitude to {sigma:.3g} rad (one sigma); errors "
            f"are linear up to {LARGEST_SIGMA:g} rad"
        )
    return None


def _nees(errors: Array, covariances: Array, band: Band) -> dict[str, float]:
    values = nees(errors, covariances)
    return {
        "mean": float(values.mean()),
        "final": float(values[-1]),
        "inside_band": float(np.mean((values >= band.low) & (values <= band.high))),
    }


def show(result: dict[str, Any]) -> None:
    """Print the table of the NEES."""
    low, high = result["band_95"]
    rows = [
        [name]
        + [f"{result[name][key]:.3g}" for key in ("mean", "final")]
        + [f"{100.0 * result[name]['inside_band']:.0f} %"]
        for name in ("position", "attitude", "velocity")
        if result[name] is not None
    ]
    title = f"NEES, 3 expected; 95 % of the time between {low:.3g} and {high:.3g}"
    if result["gauge"] is not None:
        title += "; yaw and position fixed at the first pose"
    common.print_table(["of", "mean", "final", "inside"], rows, title)
