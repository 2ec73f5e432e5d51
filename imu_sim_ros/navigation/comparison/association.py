# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Truth and estimate at the same times: by stamp, with interpolation."""

import numpy as np
from numpy.typing import NDArray

from imu_sim_ros import rotation
from imu_sim_ros.errors import InputError
from imu_sim_ros.poses import PoseSequence

Array = NDArray[np.float64]
Times = NDArray[np.int64]


def interpolate_vectors(t_ns: Times, values: Array, at_ns: Times) -> Array:
    """Return values (m, k) at other times, linear between stamps.

    :param t_ns: (n,) stamps [ns], increasing.
    :param values: (n, k).
    :param at_ns: (m,) times within the stamps [ns].
    """
    before, part = _places(t_ns, at_ns)
    start = values[before]
    result: Array = start + part[:, None] * (values[before + 1] - start)
    return result


def interpolate_poses(poses: PoseSequence, at_ns: Times) -> PoseSequence:
    """Return the poses at other times: linear in position, at constant rate in attitude."""
    before, part = _places(poses.t_ns, at_ns)
    start = poses.q_wb[before]
    turn = rotation.log(rotation.multiply(rotation.conjugate(start), poses.q_wb[before + 1]))
    q_wb = rotation.multiply(start, rotation.exp(part[:, None] * turn))
    return PoseSequence(at_ns, interpolate_vectors(poses.t_ns, poses.position, at_ns), q_wb)


def _places(t_ns: Times, at_ns: Times) -> tuple[NDArray[np.intp], Array]:
    """Return for each time the row before it and its fraction of the way to the next, 0..1."""
    before = np.clip(np.searchsorted(t_ns, at_ns, side="right") - 1, 0, len(t_ns) - 2)
    part = (at_ns - t_ns[before]) / (t_ns[before + 1] - t_ns[before])
    return before, part


def common_rows(estimate_ns: Times, truth_ns: Times, max_gap: float = 0.5) -> NDArray[np.intp]:
    """Return the rows of the estimate at which the truth is known.

    :param estimate_ns: (n,) stamps of the estimate [ns], increasing.
    :param truth_ns: (m,) stamps of the truth [ns], increasing.
    :param max_gap: the truth is not interpolated over more than this [s].
    :raises InputError: where fewer than two rows remain.
    """
    if len(truth_ns) < 2:
        raise InputError(f"{len(truth_ns)} poses of the truth: at least two are needed")
    inside = (estimate_ns >= truth_ns[0]) & (estimate_ns <= truth_ns[-1])
    before, part = _places(truth_ns, estimate_ns)
    long = np.diff(truth_ns)[before] * 1e-9 > max_gap
    on_stamp = (part == 0.0) | (part == 1.0)
    rows = np.flatnonzero(inside & (~long | on_stamp))
    if len(rows) < 2:
        raise InputError(
            "estimate and truth do not overlap in time: the estimate lasts from "
            f"{_seconds(estimate_ns[0])} to {_seconds(estimate_ns[-1])}, the truth from "
            f"{_seconds(truth_ns[0])} to {_seconds(truth_ns[-1])}"
        )
    return rows


def _seconds(t_ns: np.int64) -> str:
    return f"{int(t_ns) / 1e9:.3f} s"
