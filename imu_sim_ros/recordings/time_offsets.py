# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Time offsets between two recordings of the same body, from what both say of its rotation.

Each recording gives the angle that it has turned about its axes until any time; angular rates over
a window are differences of it, whatever the rates of the recordings are. The offset is the one at
which the rates of a gyroscope explain the other rates best, by a matrix that is constant and
unknown: mounting, scales and misalignment. A misalignment of 1 % looks like an offset of 10 ms in a
motion of 1 rad/s that turns about two axes in quadrature; in such a motion the offset is unknown.
"""

import math
from typing import Final, NamedTuple

import numpy as np

from imu_sim_ros.core import rotation
from imu_sim_ros.core.types import Array, Mask
from imu_sim_ros.recordings.findings.measures import ReadingMeasures
from imu_sim_ros.recordings.findings.states import StateMeasures

LARGEST: Final = 1.0
"""Largest offset of the search, in both directions [s]."""
_WINDOW: Final = 0.05
"""Shortest window over which rates are averaged: long against the noise of poses [s]."""
_LONGEST_WINDOW: Final = 0.5
"""Length of a window in which the motion of a body is lost [s]."""
_SHORTEST: Final = 4.0
"""Least time in common, apart from the largest offset on both sides [s]."""
_FEWEST: Final = 50
"""Windows from which on rates are compared."""
_POINTS: Final = 5000
"""Number of windows that are compared, at most."""
_STEPS: Final = (0.1, 0.01)
"""Steps of the finer grids, in windows, each around the best offset of the grid before."""
_DIFFERENCE: Final = np.array([-0.1, 0.0, 0.1])
"""Shifts, in windows, between which the slope of the residuals is taken."""
_TURNING: Final = 0.01
"""Deviation of angular rates below which there is no motion to compare [rad/s]."""
_COHERENT: Final = 0.5
"""Correlation from which on both recordings are those of one body."""
_DISTINCT: Final = 1.5
"""Ratio of what another offset leaves to what the best one does, above which it is told apart."""
_WIDEST: Final = 0.02
"""Largest half of a 95 % interval that is a result: a fiftieth of the search [s]."""
_CORRELATED: Final = 2.0 * _LONGEST_WINDOW
"""Shortest block of time whose sum is nearly independent of that of its neighbours [s]."""
_BLOCKS: Final = (4, 30)
"""Fewest and most blocks."""


class OffsetInterval(NamedTuple):
    """An offset to add to stamps [s], with its 95 % interval."""

    value: float
    low: float
    high: float


class TurnAngles(NamedTuple):
    """Angles that a body has turned about its axes since the first of n times."""

    t_ns: int
    """Stamp of the first time [ns]."""
    t: Array
    """(n,) times since then [s]."""
    angle: Array
    """(n, 3) integrals of the angular rate in the axes of the body [rad]."""

    def at(self, t: Array) -> Array:
        """Return the angles (m, 3) at times (m,) since the first, by a cubic B-spline.

        Its control points are the angles: noise is averaged alike at any time. Linear interpolation
        averages it most half way between two stamps, to which it would draw the offset.
        """
        place = np.interp(t, self.t, np.arange(len(self.t), dtype=np.float64))
        begin = np.floor(place).astype(np.intp)
        f = (place - begin)[:, None]
        weights = (
            (1.0 - f) ** 3,
            3.0 * f**3 - 6.0 * f**2 + 4.0,
            3.0 * (f + f**2 - f**3) + 1.0,
            f**3,
        )
        angles = np.zeros((len(t), 3))
        for k, weight in enumerate(weights):
            angles += weight * self.angle[np.clip(begin + k - 1, 0, len(self.t) - 1)]
        return angles / 6.0


def turn_angles_of_readings(measures: ReadingMeasures) -> TurnAngles | None:
    """Return the angles by a gyroscope, over its longest piece without a pause; None: too short."""
    clock = measures.clock
    if clock is None or measures.values is None or measures.swapped is not None:
        return None
    piece = max(clock.pieces, key=lambda rows: rows.stop - rows.start)
    times = clock.times_ns()[piece]
    rate = measures.values[0] * measures.rate_unit.scale
    return _angles(int(times[0]), (times - times[0]) * 1e-9, 0.5 * (rate[1:] + rate[:-1]))


def turn_angles_of_poses(measures: StateMeasures) -> TurnAngles | None:
    """Return the angles by attitudes, over the longest run without a gap; None: too short."""
    states = measures.states
    starts, _ = measures.runs
    if len(starts) < 3 or np.any(np.diff(states.t_ns) <= 0):
        return None
    # Poses that are held have moved only where the next one begins.
    distinct = StateMeasures(states.rows(starts)) if len(starts) < len(states) else measures
    rows = _longest_run(distinct.regular)
    states = distinct.states.rows(rows)
    if len(states) < 3:
        return None
    q_wb = states.q_wb
    steps = rotation.log(rotation.multiply(rotation.conjugate(q_wb[:-1]), q_wb[1:]))
    t = states.t
    return _angles(int(states.t_ns[0]), t, steps / np.diff(t)[:, None])


def _angles(start_ns: int, t: Array, rate: Array) -> TurnAngles:
    """Return the integrals of rates (n - 1, 3) between times (n,)."""
    turned = np.cumsum(rate * np.diff(t)[:, None], axis=0)
    return TurnAngles(start_ns, t, np.concatenate([np.zeros((1, 3)), turned]))


def _longest_run(regular: Mask) -> slice:
    """Return the rows of the longest run of steps (n - 1,) that are regular."""
    edges = np.flatnonzero(np.concatenate([[True], ~regular, [True]]))
    k = int(np.argmax(np.diff(edges)))
    return slice(int(edges[k]), int(edges[k + 1]))


def time_offset_of_turns(reference: TurnAngles, moved: TurnAngles) -> OffsetInterval | None:
    """Return the offset to add to the stamps of ``moved``, so that it turns with ``reference``.

    :param reference: angles by a gyroscope.
    :param moved: angles by another gyroscope, or by poses.
    :returns: None: too little time in common or motion, a motion that repeats itself, or two
        bodies.
    """
    pair = _Pair.of(reference, moved)
    if pair is None:
        return None
    step = 0.5 * pair.window
    count = round(LARGEST / step)
    shifts = np.linspace(-count * step, count * step, 2 * count + 1)
    residuals = np.array([pair.residual(shift) for shift in shifts])
    best = int(np.argmin(residuals))
    if not 0 < best < len(shifts) - 1 or residuals[best] > 1.0 - _COHERENT**2:
        return None
    shift, remains = float(shifts[best]), float(residuals[best])
    for share in _STEPS:
        fine = shift + share * pair.window * np.arange(-10, 11)
        values = np.array([pair.residual(candidate) for candidate in fine])
        k = int(np.clip(np.argmin(values), 1, len(fine) - 2))
        shift, remains = float(fine[k]), float(values[k])
    left, middle, right = values[k - 1 : k + 2]
    if left - 2.0 * middle + right > 0.0:
        vertex = 0.5 * (left - right) / (left - 2.0 * middle + right)
        shift += float(np.clip(vertex, -1.0, 1.0)) * _STEPS[-1] * pair.window
    # A motion that repeats itself looks alike at several offsets.
    dips = (residuals[1:-1] <= residuals[:-2]) & (residuals[1:-1] <= residuals[2:])
    distant = np.abs(np.arange(1, len(shifts) - 1) - best) > 2
    if np.any(residuals[1:-1][dips & distant] < _DISTINCT * remains):
        return None
    half = pair.half_interval(shift)
    if half > _WIDEST:
        return None
    return OffsetInterval(shift, shift - half, shift + half)


class _Pair:
    """Mean angular rates in windows between stamps of a recording, and those of a gyroscope.

    Attitudes have noise of their own at each stamp, which interpolation would average: windows end
    at their stamps, and the gyroscope is shifted.
    """

    def __init__(self, reference: TurnAngles, ends: Array, rates: Array, slopes: Array) -> None:
        """Take the rates of the other recording.

        :param reference: angles by the gyroscope.
        :param ends: (2, n) begin and end of each window, after the first time of the reference [s].
        :param rates: (n, 3) mean angular rates in these windows [rad/s].
        :param slopes: (n, 3) their changes over a window, half of it before and half of it behind
            [rad/s^2].
        """
        self._reference, self._ends, self._rates = reference, ends, _centred(rates)
        self._slopes = slopes
        self._length = ends[1] - ends[0]
        self.window = float(np.mean(self._length))
        self._size = float(np.sum(self._rates**2))

    @classmethod
    def of(cls, reference: TurnAngles, moved: TurnAngles) -> "_Pair | None":
        """Return the pair over the time in common; None: it is too short, or nothing moves."""
        intervals = [float(angles.t[-1]) / (len(angles.t) - 1) for angles in (reference, moved)]
        steps = math.ceil(max(_WINDOW, 2.0 * max(intervals)) / intervals[1])
        t = moved.t + (moved.t_ns - reference.t_ns) * 1e-9
        ends = np.stack([t[:-steps], t[steps:]])
        half = steps // 2
        common = (ends[0] >= LARGEST) & (ends[1] <= float(reference.t[-1]) - LARGEST)
        common[:half] = common[len(common) - half :] = False
        rows = np.flatnonzero(common)
        rows = rows[:: max(-(-len(rows) // _POINTS), steps // 2, 1)]
        if steps * intervals[1] > _LONGEST_WINDOW or len(rows) < _FEWEST:
            return None
        if t[rows[-1]] - t[rows[0]] < _SHORTEST:
            return None
        rates = (moved.angle[steps:] - moved.angle[:-steps]) / (ends[1] - ends[0])[:, None]
        middles = ends.mean(axis=0)
        changes = rates[rows + half] - rates[rows - half]
        slopes = changes / (middles[rows + half] - middles[rows - half])[:, None]
        pair = cls(reference, ends[:, rows], rates[rows], slopes)
        sizes = (pair._size, float(np.sum(pair._shifted(0.0) ** 2)))
        return pair if min(sizes) > len(rows) * _TURNING**2 else None

    def _shifted(self, shift: float) -> Array:
        """Return the rates (n, 3) of the gyroscope in windows that are later by a shift [s]."""
        begin, end = (self._reference.at(times + shift) for times in self._ends)
        return _centred((end - begin) / self._length[:, None])

    def residual(self, shift: float) -> float:
        """Return the share of the rates that those of the gyroscope do not explain."""
        _, residuals = self._fit(self._shifted(shift))
        return float(np.sum(residuals**2)) / self._size

    def _fit(self, rates: Array) -> tuple[Array, Array]:
        """Return an orthonormal base of rates (n, 3), and the part of the other rates outside it.

        Directions in which nothing turns are left out.
        """
        values, axes = np.linalg.eigh(rates.T @ rates)
        turning = values > len(rates) * _TURNING**2
        axes = rates @ axes[:, turning] / np.sqrt(values[turning])
        explained = axes @ (axes.T @ self._rates)
        return axes, self._rates - explained

    def half_interval(self, shift: float) -> float:
        """Return half of the 95 % interval [s] of the best shift.

        What other axes and scales explain of the effect of a shift does not count.
        """
        earlier, rates, later = (self._shifted(shift + s) for s in self.window * _DIFFERENCE)
        axes, residuals = self._fit(rates)
        mounting = np.linalg.lstsq(rates, self._rates, rcond=None)[0]

        def effect(slopes: Array) -> Array:
            return np.asarray(slopes - axes @ (axes.T @ slopes))

        step = 2.0 * self.window * _DIFFERENCE[-1]
        parts = np.sum(residuals * effect((later - earlier) @ mounting / step), axis=1)
        # The noise of both recordings is independent: the slopes of both tell those of the motion.
        before, behind = (self._shifted(shift + s) for s in (-0.5 * self.window, 0.5 * self.window))
        slopes = effect((behind - before) @ mounting / self.window)
        information = float(np.sum(slopes * effect(self._slopes)))
        squares = np.sum(slopes**2, axis=1)
        if information <= 0.0:
            return np.inf
        t = self._ends[0] - self._ends[0, 0]
        scale = information / max(float(np.sum(squares)), 1e-300)
        return half_interval(t, parts, scale * squares, _CORRELATED)


def half_interval(t: Array, parts: Array, slopes: Array, correlated: float) -> float:
    """Return half of the 95 % interval of the zero of a sum of n parts.

    The variance of an estimating equation: that of the sum, whose correlated parts are added in
    blocks of time (batch means; Conway, Management Science 10, 1963), over the square of its slope
    (the "sandwich"; Huber 1967). A few turns of a body often have most of the slope: the sum of
    each block is corrected for its leverage, and Student's degrees of freedom are those that the
    leverages leave (Bell and McCaffrey, Survey Methodology 28, 2002).

    :param t: (n,) times of the parts, from 0 [s].
    :param parts: (n,) parts of the sum.
    :param slopes: (n,) their derivatives, at least 0.
    :param correlated: shortest block [s].
    """
    from scipy.special import stdtrit  # scipy.stats has t.ppf and takes 0.5 s to import

    fewest, largest = _BLOCKS
    count = int(np.clip(t[-1] / correlated, fewest, largest))
    block = np.minimum((t / max(float(t[-1]), 1e-9) * count).astype(np.int64), count - 1)
    slope = max(float(np.sum(slopes)), 1e-300)
    leverage = np.bincount(block, weights=slopes, minlength=count) / slope
    factor = 1.0 / np.maximum(1.0 - leverage, 1e-9)
    variance = np.sum(factor * np.bincount(block, weights=parts, minlength=count) ** 2)
    # The sums have a covariance of diag(h) - h h', h the leverages, times a constant.
    share = factor * leverage**2
    freedom = 1.0 / (np.sum(leverage**2) + np.sum(share) ** 2 - np.sum(share**2))
    return float(stdtrit(freedom, 0.975) * np.sqrt(variance)) / slope


def _centred(rates: Array) -> Array:
    """Return rates (n, 3) without their mean, in which a bias is."""
    return np.asarray(rates - rates.mean(axis=0))
