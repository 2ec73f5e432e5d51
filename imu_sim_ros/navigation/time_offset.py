# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""The offset between the clocks of an estimate and its truth, from their motion, with its interval.

Relative poses over half a second depend neither on the frames nor on slow drift. The offset is the
one at which ``J = ln sum |dp|^2 + ln sum |dtheta|^2`` of their differences is smallest; its
interval is that of an estimating equation, J's slope.
"""

from typing import Final

import numpy as np

from imu_sim_ros.core import rotation
from imu_sim_ros.core.blocks import ceil_divide
from imu_sim_ros.core.errors import InputError
from imu_sim_ros.core.records import States
from imu_sim_ros.core.spelling import argument_prefix
from imu_sim_ros.core.types import Array
from imu_sim_ros.navigation.association import Rows, common_rows, poses_at
from imu_sim_ros.recordings.time_offsets import OffsetInterval, half_interval

LARGEST: Final = 1.0
"""Largest offset of the search, in both directions [s]."""
_INTERVAL: Final = 0.5
"""Length of the relative poses: long against the noise of one pose, short against drift [s]."""
_STEPS: Final = (0.02, 0.002, 0.0002)
"""Steps of the grids, each around the best value of the previous one, before a parabola [s]."""
_PAIRS: Final = 4000
"""Largest number of relative poses that are compared."""
_LEAST_PAIRS: Final = 10
"""Smallest number of relative poses."""
_SHARPNESS: Final = 1.1
"""The errors at most offsets must be at least this much larger than at the best one."""
_ROUNDING: Final = 1e-12
"""Smallest sum of squares: logarithms and quotients stay finite."""
_CORRELATED: Final = 4.0 * _INTERVAL
"""Shortest block: relative poses without common time are nearly independent [s]."""
_DOUBTFUL: Final = 0.01
"""Largest half of a 95 % interval: a body at 1 m/s moves by a centimetre in it [s]."""


def time_offset(
    estimate: States, truth: States, max_gap: float = 0.0, scaled: bool = False
) -> OffsetInterval:
    """Return the offset to add to the stamps of the estimate, at most :data:`LARGEST`.

    :param max_gap: the truth is not interpolated across longer gaps [s].
    :param scaled: True if the estimate's scale is unknown.
    :raises InputError: if the two overlap too little, or their motion does not determine it.
    """
    pairs = _pairs(estimate, truth, max_gap)
    coarse = np.arange(-LARGEST, LARGEST + 0.5 * _STEPS[0], _STEPS[0])
    costs = np.array([pairs.cost(offset, scaled) for offset in coarse])
    best = float(coarse[np.argmin(costs)])
    if np.median(costs) - costs.min() < 2.0 * np.log(_SHARPNESS):
        raise InputError(
            f"{argument_prefix('time_offset')}: the motion does not reveal a time offset, because "
            "it looks the same at any; changes of speed or direction reveal it"
        )
    if abs(best) > LARGEST - 1.5 * _STEPS[0]:
        raise InputError(
            f"{argument_prefix('time_offset')}: no time offset within {LARGEST:g} s brings "
            "estimate and truth together"
        )
    for step in _STEPS[1:]:
        offsets = best + step * np.arange(-10, 11)
        costs = np.array([pairs.cost(offset, scaled) for offset in offsets])
        k = int(np.clip(np.argmin(costs), 1, len(costs) - 2))
        best = float(offsets[k])
    before_cost, middle, after_cost = costs[k - 1 : k + 2]
    curvature = before_cost - 2.0 * middle + after_cost
    if curvature > 0.0:
        best += float(np.clip(0.5 * (before_cost - after_cost) / curvature, -1.0, 1.0)) * _STEPS[-1]
    half = pairs.half_interval(best, scaled)
    if half > _DOUBTFUL:
        raise InputError(
            f"{argument_prefix('time_offset')}: the motion does not determine the time offset: "
            f"{1e3 * best:.1f} ms is known to {1e3 * half:.2g} ms (95 %); "
            "changes of speed or direction reveal it"
        )
    return OffsetInterval(best, best - half, best + half)


class _Pairs:
    """Relative poses of the estimate, to be compared with those of the truth at other times."""

    def __init__(self, estimate: States, truth: States, begin: Rows, end: Rows) -> None:
        self._truth = truth
        self._first_ns, self._second_ns = estimate.t_ns[begin], estimate.t_ns[end]
        self._position, self._turn = _relative(estimate.rows(begin), estimate.rows(end))
        self._interpolation_error = len(begin) * (np.square(_chord_errors(truth)) + _ROUNDING)

    def cost(self, offset: float, scaled: bool) -> float:
        """Return J at an offset [s]."""
        return float(np.sum(np.log(self._sums(self._residuals(offset, scaled)))))

    def half_interval(self, offset: float, scaled: bool) -> float:
        """Return half of the 95 % interval [s] of an offset at which J is smallest."""
        step = _STEPS[1]
        residuals = self._residuals(offset, scaled)
        earlier, later = (self._residuals(offset + s, scaled) for s in (-step, step))
        slopes = (later - earlier) / (2.0 * step)
        weight = 2.0 / self._sums(residuals)
        parts = np.einsum("c,cnk,cnk->n", weight, residuals, slopes)
        information = np.einsum("c,cnk,cnk->n", weight, slopes, slopes)
        seconds = (self._first_ns - self._first_ns[0]) * 1e-9
        return half_interval(seconds, parts, information, _CORRELATED)

    def _sums(self, residuals: Array) -> Array:
        """Return (2,) sums of squares of position and turn, with the error of interpolation."""
        return np.asarray(np.sum(residuals**2, axis=(1, 2)) + self._interpolation_error)

    def _residuals(self, offset: float, scaled: bool) -> Array:
        """Return (2, n, 3) the differences of the relative positions [m] and turns [rad].

        :param offset: offset that is added to the stamps of the estimate [s].
        """
        shift = round(offset * 1e9)
        position, turn = _relative(
            poses_at(self._truth, self._first_ns + shift),
            poses_at(self._truth, self._second_ns + shift),
        )
        estimated = self._position
        if scaled:
            scale = np.sum(estimated * position) / max(np.sum(estimated**2), _ROUNDING)
            estimated = estimated * scale
        turned = rotation.log(rotation.multiply(rotation.conjugate(turn), self._turn))
        return np.stack([estimated - position, turned])


def _chord_errors(truth: States) -> tuple[float, float]:
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


def _pairs(estimate: States, truth: States, max_gap: float) -> _Pairs:
    """Return relative poses over ``_INTERVAL`` whose truth is known at every offset examined.

    :param max_gap: longest gap of the truth over which poses are interpolated [s].
    """
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
            f"{argument_prefix('time_offset')}: estimate and truth have too little time in common; "
            f"the truth has to reach {LARGEST:g} s beyond {_LEAST_PAIRS} poses of the estimate on "
            "either side"
        )
    start = start[:: ceil_divide(len(start), _PAIRS)]
    return _Pairs(estimate, truth, rows[start], rows[behind[start]])


def _relative(begin: States, end: States) -> tuple[Array, Array]:
    """Return the motion between poses in the body: positions (n, 3), rotations (n, 4)."""
    position = rotation.rotate_inverse(begin.q_wb, end.position - begin.position)
    return position, rotation.multiply(rotation.conjugate(begin.q_wb), end.q_wb)
