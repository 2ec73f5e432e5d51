# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""An estimate and its truth: same times, the offset between their clocks, the alignment."""

from typing import Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from imu_sim_ros.core import rotation
from imu_sim_ros.core.errors import ConfigurationError, InputError
from imu_sim_ros.core.names import suggestion
from imu_sim_ros.core.records import States, replace_fields
from imu_sim_ros.core.spelling import argument
from imu_sim_ros.core.types import Array, Times
from imu_sim_ros.recordings.order import POSES_GAP, gap_length, longest_step_ns


def interpolate_vectors(t_ns: Times, values: Array, at_ns: Times) -> Array:
    """Return values (m, k) at other times, linear between stamps.

    :param t_ns: (n,) stamps [ns], increasing.
    :param values: (n, k) values at the stamps.
    :param at_ns: (m,) times within the stamps [ns].
    """
    index, part = _intervals(t_ns, at_ns)
    start = values[index]
    return start + part[:, None] * (values[index + 1] - start)


def poses_at(poses: States, at_ns: Times) -> States:
    """Return poses at other times: linear in position and velocity, at constant rate in attitude.

    :param at_ns: (m,) times within the stamps [ns], in any order.
    """
    velocity = poses.velocity
    if np.array_equal(poses.t_ns, at_ns):
        return States.unchecked(
            t_ns=at_ns,
            position=poses.position,
            q_wb=poses.q_wb,
            velocity=velocity,
            source=poses.source,
        )
    index, part = _intervals(poses.t_ns, at_ns)
    q_wb = rotation.interpolate(poses.q_wb[index], poses.q_wb[index + 1], part)
    if velocity is not None:
        velocity = interpolate_vectors(poses.t_ns, velocity, at_ns)
    return States.unchecked(
        t_ns=at_ns,
        position=interpolate_vectors(poses.t_ns, poses.position, at_ns),
        q_wb=q_wb,
        velocity=velocity,
        source=poses.source,
    )


def _intervals(t_ns: Times, at_ns: Times) -> tuple[NDArray[np.intp], Array]:
    """Return for each time the row before it and its fraction of the way to the next, 0..1."""
    index = np.clip(np.searchsorted(t_ns, at_ns, side="right") - 1, 0, len(t_ns) - 2)
    part = (at_ns - t_ns[index]) / (t_ns[index + 1] - t_ns[index])
    return index, part


def common_rows(estimate_ns: Times, truth_ns: Times, max_gap: float = 0.0) -> NDArray[np.intp]:
    """Return the rows of the estimate at which the truth is known.

    :param estimate_ns: (n,) stamps of the estimate [ns], increasing.
    :param truth_ns: (m,) stamps of the truth [ns], increasing.
    :param max_gap: the truth is not interpolated over more than this [s]; 0: 2.5 times its usual
        interval, from 0.5 to 2 s.
    :raises InputError: if fewer than two rows remain.
    """
    if len(truth_ns) < 2:
        raise InputError(f"{len(truth_ns)} poses of the truth: at least two are needed")
    if np.array_equal(estimate_ns, truth_ns):
        return np.arange(len(truth_ns))
    in_truth = (estimate_ns >= truth_ns[0]) & (estimate_ns <= truth_ns[-1])
    index, part = _intervals(truth_ns, estimate_ns)
    max_gap = gap_length(max_gap, POSES_GAP, truth_ns)
    long = np.diff(truth_ns)[index] > longest_step_ns(max_gap)
    on_stamp = (part == 0.0) | (part == 1.0)
    rows = np.flatnonzero(in_truth & (~long | on_stamp))
    if len(rows) < 2 <= np.count_nonzero(in_truth):
        step = float(np.median(np.diff(truth_ns))) * 1e-9
        raise InputError(
            f"the truth has a pose each {step:.4g} s, and is not interpolated over more than "
            f"max_gap = {max_gap:g} s; {argument('max_gap', float(f'{1.5 * step:.2g}'), 's')} "
            "allows it"
        )
    if len(rows) < 2:
        raise InputError(
            "estimate and truth do not overlap in time: the estimate lasts from "
            f"{_seconds(estimate_ns[0])} to {_seconds(estimate_ns[-1])}, the truth from "
            f"{_seconds(truth_ns[0])} to {_seconds(truth_ns[-1])}"
        )
    return rows


def _seconds(t_ns: np.int64) -> str:
    return f"{int(t_ns) / 1e9:.3f} s"


ALIGNMENTS: Final = ("none", "yaw", "se3", "sim3")


class Alignment(NamedTuple):
    """Similarity from an estimate to its truth: ``p_truth ~ scale R p_estimate + t``."""

    scale: float
    """Factor of lengths; 1 for a rigid alignment."""
    r: Array
    """(3, 3) rotation."""
    t: Array
    """(3,) translation [m]."""

    def apply(self, poses: States) -> States:
        """Return the poses in the frame of the truth."""
        position = self.scale * poses.position @ self.r.T + self.t
        q_wb = rotation.multiply(rotation.from_matrix(self.r), poses.q_wb)
        velocity = poses.velocity
        if velocity is not None:
            velocity = self.scale * velocity @ self.r.T
        return replace_fields(poses, position=position, q_wb=q_wb, velocity=velocity)


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
    """Return the rotation (3, 3) of a cross-covariance (Umeyama 1991, eq. 43).

    :raises InputError: if the positions determine none.
    """
    u, values, vt = np.linalg.svd(cross_covariance)
    if values[1] < 1e-12 * max(values[0], 1e-300):
        raise InputError(
            "the positions lie on a line or in one place: no rotation can be found for se3 or "
            "sim3; use the alignment yaw or none"
        )
    # A reflection would fit better if the last sign is negative; it is not a rotation.
    sign = np.sign(np.linalg.det(u) * np.linalg.det(vt))
    return u @ np.diag([1.0, 1.0, sign]) @ vt


def _yaw(cross_covariance: Array) -> Array:
    """Return the rotation Rz with the largest trace of ``Rz.T @ cross_covariance``."""
    sine = cross_covariance[1, 0] - cross_covariance[0, 1]
    cosine = cross_covariance[0, 0] + cross_covariance[1, 1]
    return rotation.to_matrix(rotation.exp([0.0, 0.0, np.arctan2(sine, cosine)]))


Rows = NDArray[np.intp]
