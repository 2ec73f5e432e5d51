# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""How far an estimated trajectory is from the truth.

Zhang and Scaramuzza, "A tutorial on quantitative trajectory evaluation for visual(-inertial)
odometry", IROS 2018: absolute trajectory error (ATE) and relative pose error (RPE). The numbers
equal those of evo where both define them.
"""

from typing import Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from imu_sim_ros import rotation
from imu_sim_ros.errors import ConfigurationError, InputError
from imu_sim_ros.names import suggestion
from imu_sim_ros.poses import PoseSequence

Array = NDArray[np.float64]

DELTA_UNITS: Final = ("s", "m", "frames")


class Statistics(NamedTuple):
    """Statistics of n errors, each a length or an angle."""

    rmse: float
    mean: float
    median: float
    std: float
    min: float
    max: float


def statistics(errors: Array) -> Statistics:
    """Return the statistics of errors (n,), which are not negative."""
    return Statistics(
        rmse=float(np.sqrt(np.mean(np.square(errors)))),
        mean=float(np.mean(errors)),
        median=float(np.median(errors)),
        std=float(np.std(errors)),
        min=float(np.min(errors)),
        max=float(np.max(errors)),
    )


def distances(position: Array) -> Array:
    """Return the path's length (n,) from the first position to each [m]."""
    steps = np.linalg.norm(np.diff(position, axis=0), axis=1)
    return np.concatenate([np.zeros(1), np.cumsum(steps)])


def attitude_errors(estimate: Array, truth: Array) -> Array:
    """Return ``Log(q_truth q_estimate^-1)`` (n, 3) [rad]: the missing turn about the world's axes.

    :param estimate: (n, 4) q_wb.
    :param truth: (n, 4) q_wb.
    """
    return rotation.log(rotation.multiply(truth, rotation.conjugate(estimate)))


def tilt_and_heading(estimate: Array, truth: Array) -> tuple[Array, Array]:
    """Return what the missing turn does to the vertical (n,), and the turn about it (n,) [rad].

    ``q_truth q_estimate^-1`` is a turn by the heading error about the world's z, followed by one
    about a horizontal axis, the tilt error (swing and twist): with its parts (w, x, y, z) the tilt
    is ``2 atan2(|(x, y)|, |(w, z)|)``, the heading ``2 atan2(z, w)``.

    :param estimate: (n, 4).
    :param truth: (n, 4).
    """
    w, x, y, z = rotation.multiply(truth, rotation.conjugate(estimate)).T
    tilt = 2.0 * np.arctan2(np.hypot(x, y), np.hypot(w, z))
    heading = 2.0 * np.arctan2(np.copysign(1.0, w) * z, np.abs(w))
    return tilt, heading


class AbsoluteErrors(NamedTuple):
    """The errors at n times."""

    position: Array
    """(n, 3) truth minus estimate, in the world [m]."""
    attitude: Array
    """(n, 3) rotation vectors about the world's axes [rad]."""


def absolute_errors(estimate: PoseSequence, truth: PoseSequence) -> AbsoluteErrors:
    """Return the absolute errors (ATE) of an aligned estimate; both (n,) at the same times."""
    return AbsoluteErrors(
        truth.position - estimate.position, attitude_errors(estimate.q_wb, truth.q_wb)
    )


class RelativeErrors(NamedTuple):
    """The errors of m relative poses, each between two times."""

    first: NDArray[np.intp]
    """(m,) rows where the pairs start."""
    second: NDArray[np.intp]
    """(m,) rows where they end."""
    translation: Array
    """(m,) length of the error of the relative position [m]."""
    rotation: Array
    """(m,) angle of the error of the relative attitude [rad]."""
    length: Array
    """(m,) distance that the truth travels in between [m]."""


def relative_errors(
    estimate: PoseSequence, truth: PoseSequence, first: NDArray[np.intp], second: NDArray[np.intp]
) -> RelativeErrors:
    """Return the errors of relative poses (RPE): ``E = (T_i^-1 T_j)_truth^-1 (T_i^-1 T_j)``.

    :param first: (m,) rows i, from :func:`pairs`.
    :param second: (m,) rows j.
    """
    p_truth, q_truth = _relative(truth, first, second)
    p_estimate, q_estimate = _relative(estimate, first, second)
    turn = rotation.log(rotation.multiply(rotation.conjugate(q_truth), q_estimate))
    travelled = distances(truth.position)
    return RelativeErrors(
        first,
        second,
        np.linalg.norm(p_estimate - p_truth, axis=1),
        np.linalg.norm(turn, axis=1),
        travelled[second] - travelled[first],
    )


def _relative(
    poses: PoseSequence, first: NDArray[np.intp], second: NDArray[np.intp]
) -> tuple[Array, Array]:
    position = rotation.rotate_inverse(
        poses.q_wb[first], poses.position[second] - poses.position[first]
    )
    turn = rotation.multiply(rotation.conjugate(poses.q_wb[first]), poses.q_wb[second])
    return position, turn


def pairs(
    truth: PoseSequence, delta: float, unit: str, overlapping: bool = True
) -> tuple[NDArray[np.intp], NDArray[np.intp]]:
    """Return first and second rows of pairs that lie a time or a distance apart.

    The second row is the first one at least ``delta`` behind the first row.

    :param delta: > 0.
    :param unit: s, m (along the truth's path), or frames.
    :param overlapping: every row starts a pair; else each pair starts where the previous one ended.
    :raises InputError: where the trajectory is shorter than delta.
    """
    if unit not in DELTA_UNITS:
        raise ConfigurationError(f"unit {unit!r}: {suggestion(unit, DELTA_UNITS)}")
    if not delta > 0:
        raise ConfigurationError(f"delta = {delta}: must be above 0 {unit}")
    mark = _marks(truth, unit)
    # A tenth of a nanosecond, or of a nanometre, of rounding must not cost a whole sample.
    behind = np.searchsorted(mark, mark + delta * (1.0 - 1e-12) - 1e-10)
    first = np.flatnonzero(behind < len(mark))
    if not len(first):
        raise InputError(f"delta = {delta:g} {unit}: the trajectory has only {mark[-1]:.6g} {unit}")
    if not overlapping:
        chain = [0]
        while behind[chain[-1]] < len(mark):
            chain.append(int(behind[chain[-1]]))
        first = np.array(chain[:-1])
    return first, behind[first]


def _marks(truth: PoseSequence, unit: str) -> Array:
    if unit == "m":
        return distances(truth.position)
    if unit == "s":
        return np.asarray((truth.t_ns - truth.t_ns[0]) * 1e-9)
    return np.arange(len(truth.t_ns), dtype=np.float64)
