# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Mistakes that an estimated trajectory shows, alone and next to the truth, in a line each.

A small error does not exclude them: an attitude in other axes leaves the position as it is, and a
frozen estimate of a short motion has an error of its size.
"""

from collections.abc import Iterator
from typing import Final

import numpy as np

from imu_sim_ros.core import rotation
from imu_sim_ros.core.errors import InputError
from imu_sim_ros.core.records import States
from imu_sim_ros.core.types import Array, Mask, Times
from imu_sim_ros.navigation.association import align, common_rows, poses_at
from imu_sim_ros.recordings.findings.catalogue import pair_findings, pose_findings
from imu_sim_ros.recordings.findings.finding import Finding
from imu_sim_ros.recordings.findings.policy import AXES, CAMPAIGN
from imu_sim_ros.recordings.findings.roles import TruthPairs

_ROUNDING_NS: Final = 1_000_000
"""Stamps of text are rounded: a pose outside the truth by no more is at its end."""
_STILL: Final = (1e-6, 1e-6)
"""Largest steps of a position [m] and an attitude [rad] that count as standing still."""
_MOVES: Final = (0.1, 0.1)
"""Motion of the truth [m], [rad] during which a standing estimate is a mistake."""
_FROZEN_S: Final = 1.0
"""Shortest standstill of an estimate that is a mistake [s]; estimates rest between updates."""
_CONSTANT_RAD: Final = 0.17
"""Constant attitude error above which different axes are reported [rad]; 10 deg."""
_BETTER_BY_RAD: Final = 0.01
"""Difference of the residuals of two explanations above which the smaller one is chosen [rad]."""
_RESIDUAL: Final = 1.0 / 3.0
"""Largest share of an error that its explanation may leave."""
_CORRECT: Final = 0.1
"""Largest position error of a correct position, as a share of the extent of the motion."""
_SCALE: Final = 1.5
"""Factor of the positions above which another unit, or a scale, is reported."""


def estimate_findings(poses: States, truth: States, alignment: str) -> list[str]:
    """Return a line for each mistake of an estimate; none if it has no time in common.

    :param alignment: alignment of the estimate with the truth.
    """
    lines = list(_find_poses_off_truth(poses.t_ns, truth.t_ns))
    alone = [finding for finding in pose_findings(poses) if CAMPAIGN.action(finding.kind)]
    lines += [_line(finding) for finding in alone if finding.kind == "poses_held"]
    axes = [_line(finding) for finding in alone if finding.kind != "poses_held"]
    try:
        rows = common_rows(poses.t_ns, truth.t_ns)
        estimate = poses.rows(rows)
        reference = poses_at(truth, estimate.t_ns)
        pairs = TruthPairs.of("estimate", estimate, truth, reference)
        lines += [_line(finding) for finding in pair_findings(pairs)]
        lines += _repetitions(estimate, reference)
        aligned = align(estimate.position, reference.position, alignment)
        extent = float(
            np.sqrt(np.mean(np.square(reference.position - reference.position.mean(axis=0))))
        )
        error = aligned.apply(estimate).position - reference.position
        if float(np.sqrt(np.mean(np.square(error)))) <= _CORRECT * extent:
            q_wb = rotation.multiply(rotation.from_matrix(aligned.r), estimate.q_wb)
            tags = "".join(f" [{finding.kind}]" for finding in alone if finding.kind in AXES)
            axes = [line + tags for line in _attitude(q_wb, reference.q_wb)] or axes
        if alignment != "sim3":
            lines += _scale(estimate.position, reference.position, extent)
    except InputError:  # the comparison says why
        pass
    return lines + axes


def _line(finding: Finding) -> str:
    """Return a finding as one of the lines of a run, which are joined by semicolons."""
    return f"{finding.evidence} [{finding.kind}]".replace("; ", ", ")


def _find_poses_off_truth(t_ns: Times, truth_ns: Times) -> Iterator[str]:
    """Yield a line about poses of the estimate outside the truth's time."""
    start_ns, end_ns = truth_ns[0] - _ROUNDING_NS, truth_ns[-1] + _ROUNDING_NS
    count = int(np.sum((t_ns < start_ns) | (t_ns > end_ns)))
    if count:
        yield f"{count} of {len(t_ns)} poses skipped: no truth at their times"


def _repetitions(estimate: States, truth: States) -> Iterator[str]:
    """Yield the standstills of an estimate while the truth moves."""
    steps = {
        "position": (_steps(estimate.position), _steps(truth.position)),
        "attitude": (_turns(estimate.q_wb), _turns(truth.q_wb)),
    }
    frozen: dict[str, tuple[int, int]] = {}
    for (name, (estimated_steps, true_steps)), still, moves in zip(
        steps.items(), _STILL, _MOVES, strict=True
    ):
        begin, end = _longest(estimated_steps <= still)
        long = (estimate.t_ns[end] - estimate.t_ns[begin]) * 1e-9 >= _FROZEN_S
        if long and float(true_steps[begin:end].sum()) >= moves:
            frozen[name] = begin, end
    for name, (begin, end) in frozen.items():
        both = len(frozen) == 2 and len(set(frozen.values())) == 1
        if both and name == "attitude":
            continue
        seconds = (estimate.t_ns[end] - estimate.t_ns[begin]) * 1e-9
        start_s = (estimate.t_ns[begin] - truth.t_ns[0]) * 1e-9
        yield (
            f"frozen: the {'pose' if both else name} stays the same for {seconds:.3g} s from "
            f"{start_s:.3g} s on, while the truth moves"
        )


def _steps(position: Array) -> Array:
    """Return the distances (n - 1,) between consecutive positions [m]."""
    lengths: Array = np.linalg.norm(np.diff(position, axis=0), axis=1)
    return lengths


def _turns(q_wb: Array) -> Array:
    """Return the angles (n - 1,) between consecutive attitudes [rad]."""
    turns = rotation.log(rotation.multiply(rotation.conjugate(q_wb[:-1]), q_wb[1:]))
    angles: Array = np.linalg.norm(turns, axis=1)
    return angles


def _longest(still: Mask) -> tuple[int, int]:
    """Return the first and the last pose of the longest run of steps (n - 1,) that are still."""
    edges = np.diff(np.concatenate([[0], still.astype(np.int8), [0]]))
    begins, ends = np.flatnonzero(edges == 1), np.flatnonzero(edges == -1)
    if not len(begins):
        return 0, 0
    longest = int(np.argmax(ends - begins))
    return int(begins[longest]), int(ends[longest])


def _attitude(q_wb: Array, truth: Array) -> Iterator[str]:
    """Yield the constant rotation, or the other convention, that explains an attitude's error.

    :param q_wb: (n, 4) attitudes of an estimate whose positions are aligned with the truth.
    :param truth: (n, 4) true attitudes at the same times.
    """
    error = _rms(_difference(q_wb, truth))
    if error < _CONSTANT_RAD:
        return
    conventions = {
        "those of the inverse rotation": rotation.conjugate(q_wb),
        "in the order w, x, y, z": np.roll(q_wb, -1, axis=1),
        "in the order x, y, z, w": np.roll(q_wb, 1, axis=1),
    }
    residuals = {
        label: _rms(_difference(candidate, truth)) for label, candidate in conventions.items()
    }
    convention = min(residuals, key=lambda label: residuals[label])
    sides = {
        "the body": rotation.multiply(rotation.conjugate(truth), q_wb),
        "the world": rotation.multiply(q_wb, rotation.conjugate(truth)),
    }
    constants = {name: _mean_rotation(turns) for name, turns in sides.items()}
    side_residuals = {
        name: _rms(_difference(turns, np.broadcast_to(constants[name], turns.shape)))
        for name, turns in sides.items()
    }
    side = min(side_residuals, key=lambda name: side_residuals[name])
    # In a plane, half a turn about an axis of the body exchanges components of a quaternion.
    if residuals[convention] < min(_RESIDUAL * error, side_residuals[side] - _BETTER_BY_RAD):
        yield f"the attitude is wrong, and the position is right: its quaternions are {convention}"
        return
    turn = rotation.log(constants[side])
    angle = float(np.linalg.norm(turn))
    if angle < _CONSTANT_RAD or side_residuals[side] > _RESIDUAL * angle:
        return
    axis = ", ".join(f"{value + 0.0:.2f}" for value in (turn / angle).round(2))
    yield (
        f"the attitude is off by a constant {np.degrees(angle):.3g} deg about ({axis}) of "
        f"{side}, and the position is right: are its axes others than those of the truth?"
    )


def _mean_rotation(q: Array) -> Array:
    """Return the mean (4,) of rotations (n, 4).

    The unit quaternion with the largest sum of squared products with all of them: Markley et al.,
    "Averaging quaternions", J. Guidance, Control, and Dynamics 30 (2007), equation 13.
    """
    mean: Array = np.linalg.eigh(q.T @ q)[1][:, -1]
    return mean


def _difference(q: Array, truth: Array) -> Array:
    """Return the angles (n,) between attitudes [rad]."""
    turns = rotation.log(rotation.multiply(rotation.conjugate(truth), q))
    angles: Array = np.linalg.norm(turns, axis=1)
    return angles


def _rms(angles: Array) -> float:
    return float(np.sqrt(np.mean(np.square(angles))))


def _scale(estimate: Array, truth: Array, extent: float) -> Iterator[str]:
    """Yield the factor by which positions (n, 3) are too large, if it explains all errors."""
    similar = align(estimate, truth, "sim3")
    residual = similar.scale * estimate @ similar.r.T + similar.t - truth
    matches = float(np.sqrt(np.mean(np.square(residual)))) <= _CORRECT * extent
    factor = 1.0 / similar.scale if similar.scale > 0.0 else 1.0
    if matches and not 1.0 / _SCALE < factor < _SCALE:
        yield f"the positions are {factor:.3g} times as large as those of the truth"
