# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Distances of features from the projections of their landmarks, for an estimate and the truth."""

from pathlib import Path
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from imu_sim_ros.errors import InputError
from imu_sim_ros.navigation.association import poses_at
from imu_sim_ros.poses import PoseSequence

_LONGEST_GAP_NS: Final = 20_000_000
"""Poses further apart are not interpolated."""
_SAME_NS: Final = 1_000
"""A pose this near to a frame is of its time."""


def reprojection(folder: Path, estimate: PoseSequence, truth: PoseSequence) -> list[dict[str, Any]]:
    """Return the reprojection errors of each camera, for the estimate and for the truth.

    :param estimate: aligned with the world of the landmarks.
    :raises InputError: if no feature has a pose of the estimate.
    """
    from imu_sim_ros.datasets.tracks import read_track_folder
    from imu_sim_ros.sensors.camera.model import (
        reprojection_errors,  # most evaluations have no camera
    )

    tracks = read_track_folder(folder)
    result = []
    for k, (name, camera) in enumerate(tracks.cameras.items()):
        rows = np.flatnonzero((tracks.camera == k) & ~tracks.wrong)
        row = tracks.uv[rows, 1] - 0.5 * (camera.height - 1)
        t_ns = tracks.true_t_ns[rows] + np.rint(camera.row_time * row * 1e9).astype(np.int64)
        known = _known(estimate.t_ns, t_ns) & _known(truth.t_ns, t_ns)
        rows, t_ns = rows[known], t_ns[known]
        if not len(rows):
            continue
        points, uv = tracks.landmarks[tracks.landmark[rows]], tracks.uv[rows]
        entry: dict[str, Any] = {"camera": name, "features": len(rows)}
        for what, poses in (("", estimate), ("_of_truth", truth)):
            at = poses_at(poses, t_ns)
            errors = reprojection_errors(camera, at.position, at.q_wb, points, uv)
            lengths = np.linalg.norm(errors[np.isfinite(errors[:, 0])], axis=1)
            entry["behind" + what] = len(errors) - len(lengths)
            entry["rms_px" + what] = _rms(lengths)
            entry["median_px" + what] = float(np.median(lengths)) if len(lengths) else None
        result.append(entry)
    if not result:
        raise InputError(
            f"{folder}: no frame has poses of estimate and truth at its time, or within 20 ms "
            "before and after it"
        )
    return result


def _rms(lengths: NDArray[np.float64]) -> float | None:
    """Return the deviation in u and in v: the root of half the mean square of the distances."""
    return float(np.sqrt(np.mean(lengths**2) / 2.0)) if len(lengths) else None


def _known(poses_ns: NDArray[np.int64], at_ns: NDArray[np.int64]) -> NDArray[np.bool_]:
    """Return at which times there is a pose, or are two that are near enough to interpolate."""
    after = np.searchsorted(poses_ns, at_ns)
    before = poses_ns[np.clip(after - 1, 0, len(poses_ns) - 1)]
    following = poses_ns[np.clip(after, 0, len(poses_ns) - 1)]
    near = np.minimum(np.abs(at_ns - before), np.abs(at_ns - following)) <= _SAME_NS
    between = (before <= at_ns) & (at_ns <= following) & (following - before <= _LONGEST_GAP_NS)
    return np.asarray((near | between) & (at_ns >= poses_ns[0]) & (at_ns <= poses_ns[-1]))


def lines(result: list[dict[str, Any]]) -> list[str]:
    """Return the result, one line for each camera."""
    return [
        f"reprojection, {entry['camera']}: {_shown(entry['rms_px'])} px in u and in v over "
        f"{entry['features']:,} features; from the true poses {_shown(entry['rms_px_of_truth'])} px"
        + (f"; {entry['behind']} landmarks would not be seen" if entry["behind"] else "")
        for entry in result
    ]


def _shown(value: float | None) -> str:
    return "no" if value is None else f"{value:.3g}"
