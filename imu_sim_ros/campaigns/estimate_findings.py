# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Mistakes that an estimated trajectory shows next to the truth, in a line each.

A small error does not exclude them: an attitude in other axes leaves the position as it is, and a
frozen estimate of a short motion has an error of its size.
"""

from collections.abc import Iterator
from typing import Final

import numpy as np

from imu_sim_ros import rotation
from imu_sim_ros.errors import InputError
from imu_sim_ros.navigation.association import align, common_rows, poses_at
from imu_sim_ros.records import States
from imu_sim_ros.types import Array, Mask, Times

_ROUNDING_NS: Final = 1_000_000
"""Stamps of text are rounded: a pose outside the truth by no more is at its end."""
_STILL: Final = (1e-6, 1e-6)
"""[m], [rad]: steps of a position and an attitude that stay the same."""
_MOVES: Final = (0.1, 0.1)
"""[m], [rad]: motion of the truth while an estimate that stays the same is wrong."""
_FROZEN_S: Final = 1.0
"""[s]: shorter times in which an estimate stays the same are those between its updates."""
_HELD: Final = 0.3
"""Share of poses that repeat the one before from which they are told."""
_CONSTANT_RAD: Final = 0.17
"""[rad], 10 deg: constant error of the attitude from which its axes are told to be others."""
_TELLS_APART_RAD: Final = 0.01
"""[rad]: difference of what two explanations leave from which one of them is the better one."""
_LEFT: Final = 1.0 / 3.0
"""Share of an error that may be left once its explanation is taken out."""
_RIGHT: Final = 0.1
"""Position error over the extent of the motion up to which the position is right."""
_SCALE: Final = 1.5
"""Factor of the positions from which their unit, or their integration, is told to be another."""


def estimate_findings(poses: States, truth: States, alignment: str) -> list[str]:
    """Return a line for each mistake of an estimate; none if it has no time in common.

    :param alignment: of the estimate with the truth.
    """
    lines = list(_without_truth(poses.t_ns, truth.t_ns))
    try:
        rows = common_rows(poses.t_ns, truth.t_ns)
        estimate = poses.rows(rows)
        there = poses_at(truth, estimate.t_ns)
        lines += _repetitions(estimate, there)
        aligned = align(estimate.position, there.position, alignment)
        extent = float(np.sqrt(np.mean(np.square(there.position - there.position.mean(axis=0)))))
        error = aligned.apply(estimate).position - there.position
        if float(np.sqrt(np.mean(np.square(error)))) <= _RIGHT * extent:
            q_wb = rotation.multiply(rotation.from_matrix(aligned.r), estimate.q_wb)
            lines += _attitude(q_wb, there.q_wb)
        if alignment != "sim3":
            lines += _scale(estimate.position, there.position, extent)
    except InputError:  # the comparison says why
        return lines
    return lines


def _without_truth(t_ns: Times, truth_ns: Times) -> Iterator[str]:
    first, last = truth_ns[0] - _ROUNDING_NS, truth_ns[-1] + _ROUNDING_NS
    count = int(np.sum((t_ns < first) | (t_ns > last)))
    if count:
        yield f"{count} of {len(t_ns)} poses skipped: no truth at their times"


def _repetitions(estimate: States, truth: States) -> Iterator[str]:
    """Yield what stays the same while the truth moves: for a time, or from pose to pose."""
    steps = {
        "position": (_steps(estimate.position), _steps(truth.position)),
        "attitude": (_turns(estimate.q_wb), _turns(truth.q_wb)),
    }
    frozen: dict[str, tuple[int, int]] = {}
    for (name, (own, true)), still, moves in zip(steps.items(), _STILL, _MOVES, strict=True):
        begin, end = _longest(own <= still)
        long = (estimate.t_ns[end] - estimate.t_ns[begin]) * 1e-9 >= _FROZEN_S
        if long and float(true[begin:end].sum()) >= moves:
            frozen[name] = begin, end
    for name, (begin, end) in frozen.items():
        same = len(frozen) == 2 and len(set(frozen.values())) == 1
        if same and name == "attitude":
            continue
        seconds = (estimate.t_ns[end] - estimate.t_ns[begin]) * 1e-9
        at = (estimate.t_ns[begin] - truth.t_ns[0]) * 1e-9
        yield (
            f"frozen: the {'pose' if same else name} stays the same for {seconds:.3g} s from "
            f"{at:.3g} s on, while the truth moves"
        )
    if frozen:
        return
    held = (steps["position"][0] <= _STILL[0]) & (steps["attitude"][0] <= _STILL[1])
    moving = (steps["position"][1] > _STILL[0]) | (steps["attitude"][1] > _STILL[1])
    repeats = held & moving
    if repeats.mean() >= _HELD:
        yield (
            f"{100.0 * repeats.mean():.0f} % of the poses repeat the one before, while the truth "
            "moves"
        )


def _steps(position: Array) -> Array:
    lengths: Array = np.linalg.norm(np.diff(position, axis=0), axis=1)
    return lengths


def _turns(q_wb: Array) -> Array:
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
    """Yield by which constant, or which other convention, an attitude differs from the truth."""
    error = _rms(_difference(q_wb, truth))
    if error < _CONSTANT_RAD:
        return
    others = {
        "those of the inverse rotation": rotation.conjugate(q_wb),
        "in the order w, x, y, z": np.roll(q_wb, -1, axis=1),
        "in the order x, y, z, w": np.roll(q_wb, 1, axis=1),
    }
    left_of = {words: _rms(_difference(other, truth)) for words, other in others.items()}
    convention = min(left_of, key=lambda words: left_of[words])
    sides = {
        "the body": rotation.multiply(rotation.conjugate(truth), q_wb),
        "the world": rotation.multiply(q_wb, rotation.conjugate(truth)),
    }
    constants = {name: _mean_rotation(turns) for name, turns in sides.items()}
    left = {
        name: _rms(_difference(turns, np.broadcast_to(constants[name], turns.shape)))
        for name, turns in sides.items()
    }
    side = min(left, key=lambda name: left[name])
    # In a plane, half a turn about an axis of the body exchanges components of a quaternion.
    if left_of[convention] < min(_LEFT * error, left[side] - _TELLS_APART_RAD):
        yield f"the attitude is wrong, and the position is right: its quaternions are {convention}"
        return
    turn = rotation.log(constants[side])
    angle = float(np.linalg.norm(turn))
    if angle < _CONSTANT_RAD or left[side] > _LEFT * angle:
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
    """Yield by which factor positions (n, 3) are too large, if nothing else is wrong with them."""
    similar = align(estimate, truth, "sim3")
    left = similar.scale * estimate @ similar.r.T + similar.t - truth
    right = float(np.sqrt(np.mean(np.square(left)))) <= _RIGHT * extent
    factor = 1.0 / similar.scale if similar.scale > 0.0 else 1.0
    if right and not 1.0 / _SCALE < factor < _SCALE:
        yield f"the positions are {factor:.3g} times as large as those of the truth"
