# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""The NEES of a trajectory that states covariances."""

from typing import Any

import numpy as np
from numpy.typing import NDArray

from imu_sim_ros.navigation.comparison.consistency import (
    LARGEST_SIGMA,
    Band,
    anees_band,
    attitude_sigma,
    invertible,
    nees,
)
from imu_sim_ros.navigation.comparison.evaluation import absolute_errors
from imu_sim_ros.navigation.comparison.gauge import gauge_at_first, without_gauge
from imu_sim_ros.poses import PoseSequence

Array = NDArray[np.float64]


def stated_nees(
    pose: Array,
    poses: PoseSequence,
    truth: PoseSequence,
    alignment: str,
    velocity_b: Array | None = None,
    linear: Array | None = None,
) -> dict[str, Any] | None:
    """Return the NEES of position, attitude and velocity; None where all covariances are singular.

    :param pose: (n, 6, 6) covariances of position and rotation about the world's axes.
    :param poses: (n,) of the estimate, not aligned.
    :param truth: (n,) at the same times.
    :param alignment: none, or yaw: then the gauge is fixed at the first pose.
    :param velocity_b: (n, 3) error of the velocity in the body; the gauge does not change it.
    :param linear: (n, 3, 3) its covariances.
    """
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
    if velocity_b is not None and linear is not None and np.all(invertible(linear[usable])):
        result["velocity"] = _nees(velocity_b[usable], linear[usable], band)
    return result


def why_no_nees(alignment: str, pose: Array | None) -> str | None:
    """Return why there can be no NEES; None where there can.

    :param pose: (n, 6, 6) covariances; None: the estimate states none.
    """
    if alignment not in ("none", "yaw"):
        return (
            f"alignment {alignment} removes a part of the error that the covariance still includes"
        )
    if pose is None:
        return (
            "the estimate has no covariance, which nav_msgs/Odometry in a bag has, or text with "
            "OpenVINS' 12 columns"
        )
    attitude = pose[:, 3:, 3:]
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
