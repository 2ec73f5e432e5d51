# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""The time offset between an estimate and the truth, from their motion.

An estimate whose stamps are late by d is compared with where the body was d later: at 1 m/s, 50 ms
look like an error of 50 mm. The offset is found from relative poses, the motion over an interval:
they depend neither on the frame of either trajectory nor on an error that grew slowly before. With
independent errors of unknown size in rotation and translation, the most likely offset is the least

    J(d) = log sum |Log(dq_truth(t + d)^-1 dq)|^2 + log sum |s dp - dp_truth(t + d)|^2,

the concentrated likelihood of the two sums of squares (Seber and Wild, "Nonlinear regression",
1989, section 5.1), with the scale s of the estimate by least squares where it is free.
"""

from typing import Final

import numpy as np
from numpy.typing import NDArray

from imu_sim_ros import rotation
from imu_sim_ros.errors import InputError
from imu_sim_ros.navigation.comparison.association import common_rows, interpolate_poses
from imu_sim_ros.poses import PoseSequence

Array = NDArray[np.float64]
Rows = NDArray[np.intp]

LARGEST: Final = 1.0
"""[s] The offset is searched up to this, in both directions."""
_INTERVAL: Final = 0.5
"""[s] Length of the relative poses: long against the noise of one pose, short against drift."""
_STEPS: Final = (0.02, 0.002, 0.0002)
"""[s] Grids, each around the best value of the one before; a parabola gives the rest."""
_PAIRS: Final = 4000
_LEAST_PAIRS: Final = 10
_SHARPNESS: Final = 1.1
"""The errors at most offsets must be at least this much larger than at the best one."""
_ROUNDING: Final = 1e-12


def time_offset(
    estimate: PoseSequence, truth: PoseSequence, max_gap: float = 0.5, scaled: bool = False
) -> float:
    """Return the offset to add to the stamps of the estimate [s], at most :data:`LARGEST`.

    :param max_gap: the truth is not interpolated across longer gaps [s].
    :param scaled: the estimate's scale is unknown.
    :raises InputError: where the two overlap too little, or their motion does not reveal it.
    """
    pairs = _pairs(estimate, truth, max_gap)
    coarse = np.arange(-LARGEST, LARGEST + 0.5 * _STEPS[0], _STEPS[0])
    costs = np.array([pairs.cost(offset, scaled) for offset in coarse])
    best = float(coarse[np.argmin(costs)])
    if np.median(costs) - costs.min() < 2.0 * np.log(_SHARPNESS):
        raise InputError(
            "--time-offset: the motion does not show a time offset: it looks the same at any; "
            "it shows where speed or turning change"
        )
    if abs(best) > LARGEST - 1.5 * _STEPS[0]:
        raise InputError(
            f"--time-offset: no time offset within {LARGEST:g} s brings estimate and truth together"
        )
    for step in _STEPS[1:]:
        offsets = best + step * np.arange(-10, 11)
        costs = np.array([pairs.cost(offset, scaled) for offset in offsets])
        k = int(np.clip(np.argmin(costs), 1, len(costs) - 2))
        best = float(offsets[k])
    left, middle, right = costs[k - 1 : k + 2]
    curvature = left - 2.0 * middle + right
    if curvature > 0.0:
        best += float(np.clip(0.5 * (left - right) / curvature, -1.0, 1.0)) * _STEPS[-1]
    return best


class _Pairs:
    """Relative poses of the estimate, to be compared with those of the truth at other times."""

    def __init__(
        self, estimate: PoseSequence, truth: PoseSequence, first: Rows, second: Rows
    ) -> None:
        self._truth = truth
        self._first_ns, self._second_ns = estimate.t_ns[first], estimate.t_ns[second]
        self._position, self._turn = _relative(_rows(estimate, first), _rows(estimate, second))
        self._least = len(first) * (np.square(_chord_errors(truth)) + _ROUNDING)

    def cost(self, offset: float, scaled: bool) -> float:
        """Return J at an offset [s]."""
        shift = round(offset * 1e9)
        position, turn = _relative(
            interpolate_poses(self._truth, self._first_ns + shift),
            interpolate_poses(self._truth, self._second_ns + shift),
        )
        own = self._position
        if scaled:
            own = own * (np.sum(own * position) / max(np.sum(own * own), _ROUNDING))
        turned = rotation.log(rotation.multiply(rotation.conjugate(turn), self._turn))
        squares = np.array([np.sum((own - position) ** 2), np.sum(turned**2)])
        return float(np.sum(np.log(squares + self._least)))


def _chord_errors(truth: PoseSequence) -> tuple[float, float]:
    """Return by how much interpolation is off, rms [m, rad]: a h^2 / 8 half way between stamps.

    Without it an offset at which stamps coincide would be preferred to all others.
    """
    bend = np.diff(truth.position, n=2, axis=0)
    turns = rotation.log(rotation.multiply(rotation.conjugate(truth.q_wb[:-1]), truth.q_wb[1:]))
    position, turn = (
        float(np.sqrt(np.mean(np.sum(np.square(steps), axis=1)))) / 8 if len(steps) else 0.0
        for steps in (bend, np.diff(turns, axis=0))
    )
    return position, turn


def _pairs(estimate: PoseSequence, truth: PoseSequence, max_gap: float) -> _Pairs:
    """Return the pairs whose truth is known at every offset examined."""
    margin = round(LARGEST * 1e9)
    rows = common_rows(estimate.t_ns, truth.t_ns, max_gap)
    t_ns = estimate.t_ns[rows]
    behind = np.searchsorted(t_ns, t_ns + round(_INTERVAL * 1e9))
    start = np.flatnonzero(
        (t_ns >= truth.t_ns[0] + margin)
        & (behind < len(t_ns))
        & (t_ns[np.minimum(behind, len(t_ns) - 1)] <= truth.t_ns[-1] - margin)
    )
    if len(start) < _LEAST_PAIRS:
        raise InputError(
            f"--time-offset: estimate and truth have too little time in common; the truth has to "
            f"reach {LARGEST:g} s beyond {_LEAST_PAIRS} poses of the estimate on either side"
        )
    start = start[:: -(-len(start) // _PAIRS)]
    return _Pairs(estimate, truth, rows[start], rows[behind[start]])


def _rows(poses: PoseSequence, rows: Rows) -> PoseSequence:
    return PoseSequence(poses.t_ns[rows], poses.position[rows], poses.q_wb[rows])


def _relative(first: PoseSequence, second: PoseSequence) -> tuple[Array, Array]:
    """Return the motion between poses in the body: positions (n, 3), rotations (n, 4)."""
    position = rotation.rotate_inverse(first.q_wb, second.position - first.position)
    return position, rotation.multiply(rotation.conjugate(first.q_wb), second.q_wb)
