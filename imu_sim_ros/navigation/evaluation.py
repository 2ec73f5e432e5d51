# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Errors of an estimated trajectory against the truth, and consistency with its covariance."""

from typing import Final, NamedTuple, TypedDict

import numpy as np
from numpy.typing import NDArray

from imu_sim_ros.core import rotation
from imu_sim_ros.core.blocks import blocks, step_lengths
from imu_sim_ros.core.components import (
    Component,
    Quaternion,
    Vector,
    conjugate,
    log,
    multiply,
    quaternion,
    stack,
)
from imu_sim_ros.core.errors import ConfigurationError, InputError
from imu_sim_ros.core.names import suggestion
from imu_sim_ros.core.records import States
from imu_sim_ros.core.types import Array, Mask
from imu_sim_ros.navigation.association import (
    Alignment,
    interpolate_vectors,
    poses_at,
)
from imu_sim_ros.navigation.state import NavigationState


def state_at(truth: States, t_ns: int) -> NavigationState:
    """Return the state at one time within the stamps, linear between them.

    :param truth: states with velocities.
    :param t_ns: time [ns].
    :raises InputError: for states without velocities.
    """
    at_ns = np.array([t_ns])
    pose = poses_at(truth, at_ns)
    velocity = interpolate_vectors(truth.t_ns, truth.velocities(), at_ns)
    return NavigationState(pose.position[0], velocity[0], pose.q_wb[0])


_GAUGE: Final = np.array([0, 1, 2, 5])
"""Position and yaw among the numbers of a pose's error."""


def gauge_at(estimate: States, truth: States, row: int = 0) -> Alignment:
    """Return the turn about z and the translation that give one pose the truth's gauge.

    :param truth: (n,) true poses at the times of the estimate.
    """
    q_wb, q_true = estimate.q_wb[row : row + 1], truth.q_wb[row : row + 1]
    heading_error = tilt_and_heading_errors(q_wb, q_true)[1][0]
    r = rotation.to_matrix(rotation.exp(np.array([0.0, 0.0, -heading_error])))
    return Alignment(1.0, r, truth.position[row] - r @ estimate.position[row])


def fix_gauge(covariance: Array, position: Array, row: int = 0) -> Array:
    """Return the covariances (n, 6, 6) that remain when the gauge of one pose is fixed.

    The errors g of position and yaw of that pose are taken to be those of all later ones, too, as
    they are of odometry: N_k g, with the lever arm between both in N_k. Then e_k - N_k g has the
    covariance P_k - N_k P_g N_k^T.

    :param covariance: (n, 6, 6) for position and rotation about the world's axes.
    :param position: (n, 3) positions in the same frame [m].
    :returns: covariances, of which that of the fixed pose has rank 2: its tilt.
    """
    n = np.zeros((len(covariance), 6, 4))
    n[:, :3, :3], n[:, 5, 3] = np.eye(3), 1.0
    x, y, _ = (position - position[row]).T
    n[:, 0, 3], n[:, 1, 3] = -y, x
    return covariance - n @ covariance[row][np.ix_(_GAUGE, _GAUGE)] @ n.swapaxes(1, 2)


LARGEST_SIGMA: Final = 0.5
"""Largest standard deviation of an attitude with a valid covariance, along its worst axis [rad]."""


def attitude_sigma(covariances: Array) -> Array:
    """Return the standard deviation (n,) along the worst axis [rad].

    :param covariances: (n, 3, 3) of the attitudes' errors, finite.
    """
    largest = np.linalg.eigvalsh(covariances)[..., -1]
    return np.sqrt(np.maximum(largest, 0.0))


class Band(NamedTuple):
    """The range of a chi-square mean with a given probability."""

    low: float
    """Lower end."""
    high: float
    """Upper end."""


_ROUNDING: Final = 1e-6
"""Share of a stated covariance that may be rounding of text."""


def invertible(covariances: Array, stated: Array | None = None) -> Mask:
    """Return which covariances (n, k, k) have a NEES: at a true start they are zero.

    :param stated: (n, k, k) the stated covariances, of which a part was removed.
    """
    mask: Mask = np.asarray(np.isfinite(covariances).all(axis=(1, 2)))
    sizes = np.linalg.eigvalsh(covariances[mask])
    smallest = covariances.shape[-1] * np.finfo(float).eps * np.abs(sizes).max(axis=1, initial=0.0)
    if stated is not None:
        smallest = _ROUNDING * np.abs(np.linalg.eigvalsh(stated[mask])).max(axis=1, initial=0.0)
    mask[mask] = sizes[:, 0] > smallest
    return mask


def nees(errors: Array, covariances: Array) -> Array:
    """Return ``e^T P^-1 e`` (n,).

    :param errors: (n, k) errors.
    :param covariances: (n, k, k), or one (k, k) for all; each invertible.
    """
    solved = np.linalg.solve(covariances, errors[..., None])[..., 0]
    return np.sum(errors * solved, axis=-1)


def anees_band(freedom: int, runs: int, probability: float = 0.95) -> Band:
    """Return the two-sided band of the mean NEES over independent runs.

    :param freedom: numbers in the error.
    :param runs: independent errors in the mean.
    """
    from scipy.special import gammaincinv  # instead of chi2.ppf of scipy.stats: quick to import

    tail = 0.5 * (1.0 - probability)
    low, high = 2.0 * gammaincinv(0.5 * freedom * runs, [tail, 1.0 - tail]) / runs
    return Band(float(low), float(high))


_PARTS: Final = {"position": slice(0, 3), "attitude": slice(3, 6)}
_ORDER: Final = {name: number for number, name in enumerate(_PARTS)}
_CANDIDATES: Final = 64
"""Poses in the first quarter at which the gauge may be fixed."""
_LATER: Final = 400
"""Later poses that each of them is compared with."""
_HELD: Final = 0.95
"""Share of them that have to contain its gauge; right after it little has been added to it."""


class Remainder(NamedTuple):
    """Errors of position or attitude relative to a fixed gauge, with their covariances."""

    row: int
    """The pose at which the gauge is fixed, and from which on there is a NEES."""
    errors: Array
    """(n, 3) errors [m] or [rad]."""
    covariances: Array
    """(n, 3, 3) covariances of the errors, without the part that the gauge removes."""
    usable: Mask
    """(n,) True for poses that have a NEES."""


def remainder(
    name: str, pose: Array, poses: States, truth: States, alignment: str
) -> Remainder | None:
    """Return the errors of a part of the poses, with yaw and position fixed at one of them.

    Each part has its own: the position of an odometry that is still converging is corrected later,
    its yaw is not. None: there is no pose at which they can be fixed.

    :param name: position or attitude.
    :param pose: (n, 6, 6) covariances of position and rotation about the world's axes. Those
        between both may be missing (zero), as in texts.
    :param poses: (n,) poses of the estimate, not aligned.
    :param truth: (n,) true poses at the same times.
    :param alignment: none, which fixes nothing, or yaw.
    """
    part = _PARTS[name]
    if alignment == "none":
        stated = pose[:, part, part]
        errors = absolute_errors(poses, truth)[_ORDER[name]]
        return Remainder(0, errors, stated, invertible(stated))
    pose = _complete_covariances(pose, poses.position)
    row = _gauge_row(name, pose, poses.position)
    if row is None:
        return None
    gauge = gauge_at(poses, truth, row)
    poses, turn = gauge.apply(poses), np.kron(np.eye(2), gauge.r)
    turned = turn @ pose @ turn.T
    covariances = fix_gauge(turned, poses.position, row)[:, part, part]
    usable = invertible(covariances, turned[:, part, part])
    usable[:row] = False
    return Remainder(row, absolute_errors(poses, truth)[_ORDER[name]], covariances, usable)


def _complete_covariances(pose: Array, position: Array) -> Array:
    """Return covariances with those of position with yaw, if none are stated.

    The yaw that a filter begins with turns its path about where it begins, which is where the
    position is known best: at a lever arm (x, y) from there, the covariance of the position with
    the yaw is the variance of that yaw times (-y, x).
    """
    if pose[:, :3, 3:].any():
        return pose
    spread = np.trace(pose[:, :3, :3], axis1=1, axis2=2)
    start = int(np.argmin(np.where(np.isfinite(spread), spread, np.inf)))
    x, y, _ = pose[start, 5, 5] * (position - position[start]).T
    pose = pose.copy()
    pose[:, 0, 5] = pose[:, 5, 0] = -y
    pose[:, 1, 5] = pose[:, 5, 1] = x
    return pose


def _gauge_row(name: str, pose: Array, position: Array) -> int | None:
    """Return the pose at which the gauge holds: the first one of which later ones state no less.

    A filter's first poses are uncertain by errors that it corrects later, of its velocity, tilt and
    biases: what is subtracted for them would be more than later poses state. The position is looked
    at from the pose on at which the tilt, which is measured, has converged to twice the variance
    that it has half of the time.
    """
    part, count, first_row = _PARTS[name], len(pose), 0
    if name == "position":
        tilt = np.trace(pose[:, 3:5, 3:5], axis1=1, axis2=2)
        first_row = int(np.argmax(tilt <= 2.0 * np.median(tilt)))
    last_row = max(first_row, count // 4)
    for row in np.unique(np.linspace(first_row, last_row, _CANDIDATES).astype(int)):
        later = np.unique(np.linspace(row + 1, count - 1, _LATER).astype(int))
        rows = np.append(row, later)
        covariances = fix_gauge(pose[rows], position[rows])[1:, part, part]
        if invertible(covariances, pose[later, part, part]).mean() >= _HELD:
            return int(row)
    return None


class _MeanNees(TypedDict):
    """Mean NEES and its distribution."""

    mean: float
    final: float
    inside_band: float
    """Share of the poses whose NEES lies in the band."""
    poses: int
    of: int


class PartNees(_MeanNees, total=False):
    """The NEES of a part of the poses."""

    fixed_s: float | None
    """Time of the gauge since the first pose [s]; None: nowhere. The velocity has no gauge."""


class PoseNees(TypedDict):
    """The NEES of poses and of their velocity, by part; None: a part has none.

    Its fields are statistics of errors, no states.
    """

    poses: int
    gauge: str | None
    """Pose at which yaw and position are fixed; None: nowhere."""
    band_95: list[float]
    position: PartNees | None
    attitude: PartNees | None
    velocity: PartNees | None


def pose_nees(
    pose: Array | None,
    poses: States,
    truth: States,
    alignment: str,
    velocity_b: Array | None = None,
    linear: Array | None = None,
) -> tuple[PoseNees | None, str | None]:
    """Return the NEES of position, attitude and velocity, and why one of the first two has none.

    :param pose: (n, 6, 6) covariances of position and rotation about the world's axes; None: the
        estimate states none.
    :param poses: (n,) poses of the estimate, not aligned.
    :param truth: (n,) true poses at the same times.
    :param alignment: alignment of the estimate with the truth; with yaw the gauge is fixed at one
        pose.
    :param velocity_b: (n, 3) error of the velocity in the body; the gauge does not change it.
    :param linear: (n, 3, 3) covariances of that error.
    """
    if alignment not in ("none", "yaw"):
        return None, (
            f"alignment {alignment} removes a part of the error that the covariance still includes"
        )
    if pose is None:
        return None, (
            "the estimate has no covariance; give it as nav_msgs/Odometry in a bag, or as text "
            "with OpenVINS' 12 columns"
        )
    is_invertible = {name: invertible(pose[:, part, part]).any() for name, part in _PARTS.items()}
    parts = {
        name: remainder(name, pose, poses, truth, alignment) if is_invertible[name] else None
        for name in _PARTS
    }
    attitude = parts["attitude"]
    # Without a gauge the tilt, which has none, is looked at.
    turns = pose[:, 3:5, 3:5] if attitude is None else attitude.covariances[attitude.row :]
    sigma = float(attitude_sigma(turns[np.isfinite(turns).all(axis=(1, 2))]).max(initial=0.0))
    if sigma > LARGEST_SIGMA:
        return None, (
            f"not valid: the attitude is uncertain by {sigma:.3g} rad (one sigma); errors "
            f"are linear up to {LARGEST_SIGMA:g} rad"
        )
    t_ns, band = poses.t_ns, anees_band(3, 1)
    nees_by_part: dict[str, PartNees] = {}
    reasons = []
    for name, remainder_of_part in parts.items():
        if remainder_of_part is not None and remainder_of_part.usable.any():
            later = slice(remainder_of_part.row, None)
            part_nees = _nees(
                remainder_of_part.errors[later],
                remainder_of_part.covariances[later],
                remainder_of_part.usable[later],
                band,
            )
            fixed = float(t_ns[remainder_of_part.row] - t_ns[0]) * 1e-9
            part_nees["fixed_s"] = None if alignment == "none" else fixed
            nees_by_part[name] = part_nees
        else:
            reasons.append(f"{name}: {_NO_GAUGE if is_invertible[name] else _SINGULAR}")
    why = "; ".join(reasons) or None
    if len(reasons) == len(parts):
        return None, _SINGULAR if not any(is_invertible.values()) else why
    rows = {
        name: remainder_of_part.row
        for name, remainder_of_part in parts.items()
        if remainder_of_part is not None and name in nees_by_part
    }
    at_first = "first pose" if not any(rows.values()) else "a later pose"
    if velocity_b is not None and linear is not None and invertible(linear).any():
        nees_by_part["velocity"] = _nees(velocity_b, linear, invertible(linear), band)
    summary: PoseNees = {
        "poses": max(nees_by_part[name]["poses"] for name in rows),
        "gauge": at_first if alignment == "yaw" else None,
        "band_95": list(band),
        "position": nees_by_part.get("position"),
        "attitude": nees_by_part.get("attitude"),
        "velocity": nees_by_part.get("velocity"),
    }
    return summary, why


_SINGULAR: Final = "the estimate's covariances are singular"
_NO_GAUGE: Final = (
    "later poses state no larger covariances than earlier ones, although nothing measures yaw and "
    "position; there is no pose in the first quarter at which both can be fixed"
)


def _nees(errors: Array, covariances: Array, usable: Mask, band: Band) -> PartNees:
    """Return the NEES of errors (n, 3) with covariances (n, 3, 3), of usable rows."""
    values = nees(errors[usable], covariances[usable])
    return {
        "mean": float(values.mean()),
        "final": float(values[-1]),
        "inside_band": float(np.mean((values >= band.low) & (values <= band.high))),
        "poses": len(values),
        "of": len(usable),
    }


DELTA_UNITS: Final = ("s", "m", "frames")


class Statistics(NamedTuple):
    """Statistics of n errors, each a length [m] or an angle [rad]."""

    rmse: float
    """Root mean square."""
    mean: float
    """Mean."""
    median: float
    """Median."""
    std: float
    """Standard deviation around the mean."""
    min: float
    """Smallest error."""
    max: float
    """Largest error."""


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
    return np.concatenate([np.zeros(1), np.cumsum(step_lengths(position))])


def attitude_errors(estimate: Array, truth: Array) -> Array:
    """Return attitude errors ``Log(q_estimate q_truth^-1)`` (n, 3) about the world's axes [rad].

    :param estimate: (n, 4) estimated q_wb.
    :param truth: (n, 4) true q_wb.
    """
    errors = np.empty((len(estimate), 3), order="F")
    for rows in blocks(len(estimate)):
        errors[rows] = stack(attitude_error(quaternion(estimate[rows]), quaternion(truth[rows])))
    return errors


def attitude_error(
    estimate: Quaternion[Component], truth: Quaternion[Component]
) -> Vector[Component]:
    """Return :func:`attitude_errors` of components, floats or arrays (n,)."""
    return log(multiply(estimate, conjugate(truth)))


def tilt_and_heading_errors(estimate: Array, truth: Array) -> tuple[Array, Array]:
    """Return the error of the vertical (n,) and the heading error about it (n,) [rad].

    ``q_estimate q_truth^-1`` is a turn by the heading error about the world's z, followed by one
    about a horizontal axis, the tilt error (swing and twist): with its parts (w, x, y, z) the tilt
    is ``2 atan2(|(x, y)|, |(w, z)|)``, the heading error ``2 atan2(z, w)``.

    :param estimate: (n, 4) estimated q_wb.
    :param truth: (n, 4) true q_wb.
    """
    w, x, y, z = rotation.multiply(estimate, rotation.conjugate(truth)).T
    tilt = 2.0 * np.arctan2(np.hypot(x, y), np.hypot(w, z))
    heading = 2.0 * np.arctan2(np.copysign(1.0, w) * z, np.abs(w))
    return tilt, heading


def absolute_errors(estimate: States, truth: States) -> tuple[Array, Array]:
    """Return position errors (n, 3) [m] and attitude errors (n, 3) [rad], estimate minus truth.

    :param estimate: (n,) aligned estimate.
    :param truth: (n,) truth at the same times.
    """
    return estimate.position - truth.position, attitude_errors(estimate.q_wb, truth.q_wb)


LONGEST_PAIR: Final = 1.5
"""Length of a pair of poses over the length that was asked for, up to which it is compared."""


class PosePairs(NamedTuple):
    """Pairs of poses a time or a distance apart."""

    start: NDArray[np.intp]
    """(m,) rows where the pairs start."""
    end: NDArray[np.intp]
    """(m,) rows where the pairs end."""
    left_out: int
    """Number of pairs that are more than half longer than asked: across gaps, or between poses
    that are further apart than that."""


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
    left_out: int
    """Number of pairs that are not compared: they are more than half longer than asked."""


def relative_errors(estimate: States, truth: States, chosen: PosePairs) -> RelativeErrors:
    """Return the errors of relative poses (RPE): ``E = (T_i^-1 T_j)_truth^-1 (T_i^-1 T_j)``.

    :param estimate: (n,) aligned estimate.
    :param truth: (n,) truth at the same times.
    :param chosen: pairs of rows i and j.
    """
    start, end, left_out = chosen
    p_truth, q_truth = _relative(truth, start, end)
    p_estimate, q_estimate = _relative(estimate, start, end)
    turn = rotation.log(rotation.multiply(rotation.conjugate(q_truth), q_estimate))
    travelled = distances(truth.position)
    return RelativeErrors(
        first=start,
        second=end,
        translation=np.linalg.norm(p_estimate - p_truth, axis=1),
        rotation=np.linalg.norm(turn, axis=1),
        length=travelled[end] - travelled[start],
        left_out=left_out,
    )


def _relative(poses: States, begin: NDArray[np.intp], end: NDArray[np.intp]) -> tuple[Array, Array]:
    """Return the motion between pairs of poses, in the first one's body frame."""
    position = rotation.rotate_inverse(
        poses.q_wb[begin], poses.position[end] - poses.position[begin]
    )
    turn = rotation.multiply(rotation.conjugate(poses.q_wb[begin]), poses.q_wb[end])
    return position, turn


def pairs(truth: States, delta: float, unit: str, overlapping: bool = True) -> PosePairs:
    """Return pairs of rows that lie a time or a distance apart.

    The end is the first row at least ``delta`` behind the start. Pairs longer than
    ``LONGEST_PAIR * delta`` are left out: their error is that of another length.

    :param delta: time or distance between the rows of a pair, in the unit, > 0.
    :param unit: s, m (along the truth's path), or frames.
    :param overlapping: every row starts a pair; else each pair starts where the previous one ended.
    :raises InputError: if the trajectory is shorter than delta.
    """
    if unit not in DELTA_UNITS:
        raise ConfigurationError(f"unit {unit!r}: {suggestion(unit, DELTA_UNITS)}")
    if not delta > 0:
        raise ConfigurationError(f"delta = {delta}: must be above 0 {unit}")
    mark = _marks(truth, unit)
    # A tenth of a nanosecond, or of a nanometre, of rounding must not cost a whole sample.
    behind = np.searchsorted(mark, mark + delta * (1.0 - 1e-12) - 1e-10)
    start = np.flatnonzero(behind < len(mark))
    if not len(start):
        raise InputError(f"delta = {delta:g} {unit}: the trajectory has only {mark[-1]:.6g} {unit}")
    if not overlapping:
        chain = [0]
        while behind[chain[-1]] < len(mark):
            chain.append(int(behind[chain[-1]]))
        start = np.array(chain[:-1])
    end = behind[start]
    compared = mark[end] - mark[start] <= LONGEST_PAIR * delta
    if unit == "frames":
        compared[:] = True
    return PosePairs(start[compared], end[compared], int(np.count_nonzero(~compared)))


def _marks(truth: States, unit: str) -> Array:
    """Return the progress (n,) in a unit: distance [m], time [s], or frames."""
    if unit == "m":
        return distances(truth.position)
    if unit == "s":
        return np.asarray((truth.t_ns - truth.t_ns[0]) * 1e-9)
    return np.arange(len(truth.t_ns), dtype=np.float64)
