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
from collections.abc import Callable
from itertools import pairwise
from typing import Final, NamedTuple

import numpy as np

from imu_sim_ros.core import rotation
from imu_sim_ros.core.blocks import blocks, ceil_divide
from imu_sim_ros.core.conventions import STANDARD_GRAVITY
from imu_sim_ros.core.errors import InputError
from imu_sim_ros.core.timebase import seconds_since
from imu_sim_ros.core.types import Array, Mask
from imu_sim_ros.recordings.findings.measures import ReadingMeasures
from imu_sim_ros.recordings.findings.states import StateMeasures
from imu_sim_ros.recordings.tracks import FeatureTracks, rotation_between_frames

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
_BASES: Final = np.array([0.5, 1.5])
"""Distances of two windows from their middle, in windows, whose difference is a slope."""
_LEAST_SIGNAL: Final = 0.2
"""Smallest share of the motion in the slopes of the rates; in more noise the offset is that of a
chance resemblance, which the interval does not know."""
_STEP: Final = 0.08
"""Shortest time between two frames whose features are compared [s]."""
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
_TAPER: Final = math.sqrt(1.2)
"""Deviation of the sum of a block of white noise over that of a block whose edges rise and fall
over half of its length: the mean square of such a block is 1/2 + 2 (1/2)/3 = 1/1.2."""
_BLOCKS: Final = (4, 30)
"""Fewest and most blocks."""


_G_SENSITIVITY: Final = 3.3e-5
"""Angular rate per acceleration [rad/s/(m/s^2)]: a third of 0.06 deg/s/g, which data sheets have,
goes with the effect of an offset."""
_SHORT: Final = "it is too short without a pause"


class UnknownOffsetError(InputError):
    """Recordings do not tell their time offset; the line says why."""


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
    disturbance: float = 0.0
    """Half of a 95 % interval of what a gyroscope measures of accelerations [rad/s]."""

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


def turn_angles_of_readings(measures: ReadingMeasures) -> TurnAngles:
    """Return the angles by a gyroscope, over its longest piece without a pause.

    :raises UnknownOffsetError: for readings whose times or rates are unknown.
    """
    clock = measures.clock
    if clock is None:
        raise UnknownOffsetError("its stamps have no rate")
    if measures.values is None or measures.swapped is not None:
        raise UnknownOffsetError("it has too few readings of both triads, or they are swapped")
    piece = max(clock.pieces, key=lambda rows: rows.stop - rows.start)
    times = clock.times_ns()[piece]
    if len(times) < 3:
        raise UnknownOffsetError(_SHORT)
    gyro, scale = measures.values[0], measures.rate_unit.scale

    def mean_rates(rows: slice) -> Array:
        """Return the mean rates between neighbouring readings."""
        rate = gyro[rows] * scale
        return 0.5 * (rate[1:] + rate[:-1])

    force = measures.values[1] * (STANDARD_GRAVITY / max(measures.mean_force, 1e-300))
    spread = float(np.linalg.norm(force.std(axis=0)))
    del force
    angles = _angles(int(times[0]), (times - times[0]) * 1e-9, mean_rates)
    return angles._replace(disturbance=_G_SENSITIVITY * spread)


def turn_angles_of_poses(measures: StateMeasures) -> TurnAngles:
    """Return the angles by attitudes, over the longest run without a gap.

    :raises UnknownOffsetError: for poses that are too few, or out of order.
    """
    states = measures.states
    if np.any(np.diff(states.t_ns) <= 0):
        raise UnknownOffsetError("its stamps do not increase")
    changes = measures.changes
    if np.count_nonzero(changes) < 3:
        raise UnknownOffsetError("its poses stay the same")
    # Poses that are held have moved only where the next one begins.
    distinct = measures if changes.all() else StateMeasures(states.rows(changes))
    rows = _longest_run(distinct.regular)
    states = distinct.states.rows(rows)
    if len(states) < 3:
        raise UnknownOffsetError(_SHORT)
    t, attitudes = states.t, states.q_wb

    def mean_rates(rows: slice) -> Array:
        """Return the mean rates between neighbouring poses."""
        q_wb = attitudes[rows]
        steps = rotation.log(rotation.multiply(rotation.conjugate(q_wb[:-1]), q_wb[1:]))
        return steps / np.diff(t[rows])[:, None]

    return _angles(int(states.t_ns[0]), t, mean_rates)


def turn_angles_of_tracks(tracks: FeatureTracks) -> TurnAngles:
    """Return the angles by the features of a camera, over the longest run of its frames.

    :raises UnknownOffsetError: for frames that are too few, out of order or without features.
    """
    frames = tracks.frames
    t_ns = np.array([frame.t_ns for frame in frames], np.int64)
    if len(frames) < 2:
        raise UnknownOffsetError("it has fewer than two frames")
    if np.any(np.diff(t_ns) <= 0):
        raise UnknownOffsetError("its stamps do not increase")
    # The translation in a short step is hardly told from a rotation.
    apart = max(math.ceil(_STEP * (len(frames) - 1) * 1e9 / max(int(np.ptp(t_ns)), 1)), 1)
    frames, t_ns = frames[::apart], t_ns[::apart]
    turns = [rotation_between_frames(*neighbours) for neighbours in pairwise(frames)]
    is_joined = np.array([turn is not None for turn in turns])
    is_joined &= np.diff(t_ns) < _LONGEST_WINDOW * 1e9
    rows = _longest_run(is_joined)
    start_ns = int(t_ns[rows.start])
    t = seconds_since(t_ns[rows], start_ns)
    if len(t) < 3:
        raise UnknownOffsetError("its frames have too few features in common, or none")
    steps = np.array([turn for turn in turns[rows.start : rows.stop - 1] if turn is not None])
    rates = steps / np.diff(t)[:, None]
    return _angles(start_ns, t, lambda rows: rates[rows.start : rows.stop - 1])


def _angles(start_ns: int, t: Array, mean_rates: Callable[[slice], Array]) -> TurnAngles:
    """Return the integrals of rates between times (n,), computed in blocks.

    :param mean_rates: function that returns the mean rates (m, 3) between m + 1 of these times.
    """
    angle = np.zeros((len(t), 3))
    for rows in blocks(len(t) - 1):
        ends = slice(rows.start, rows.stop + 1)
        turned = mean_rates(ends) * np.diff(t[ends])[:, None]
        turned[0] += angle[rows.start]
        np.cumsum(turned, axis=0, out=angle[rows.start + 1 : rows.stop + 1])
    return TurnAngles(start_ns, t, angle)


def _longest_run(regular: Mask) -> slice:
    """Return the rows of the longest run of steps (n - 1,) that are regular."""
    edges = np.flatnonzero(np.concatenate([[True], ~regular, [True]]))
    k = int(np.argmax(np.diff(edges)))
    return slice(int(edges[k]), int(edges[k + 1]))


def time_offset_of_turns(reference: TurnAngles, moved: TurnAngles) -> OffsetInterval:
    """Return the offset to add to the stamps of ``moved``, so that it turns with ``reference``.

    :param reference: angles by a gyroscope or by poses.
    :param moved: angles by another gyroscope, or by other poses.
    :raises UnknownOffsetError: for too little time in common or motion, a motion that repeats
        itself, and two bodies.
    """
    pair = _Pair.of(reference, moved)
    step = 0.5 * pair.window
    count = round(LARGEST / step)
    shifts = np.linspace(-count * step, count * step, 2 * count + 1)
    residuals = np.array([pair.residual(shift) for shift in shifts])
    best = int(np.argmin(residuals))
    if residuals[best] > 1.0 - _COHERENT**2:
        raise UnknownOffsetError("their rotations have nothing in common: two bodies, or two times")
    if not 0 < best < len(shifts) - 1:
        raise UnknownOffsetError(f"no offset within {LARGEST:g} s brings their rotations together")
    shift, remains = float(shifts[best]), float(residuals[best])
    for share in _STEPS:
        fine = shift + share * pair.window * np.arange(-10, 11)
        values = np.array([pair.residual(candidate) for candidate in fine])
        k = int(np.clip(np.argmin(values), 1, len(fine) - 2))
        shift, remains = float(fine[k]), float(values[k])
    before, middle, after = values[k - 1 : k + 2]
    if before - 2.0 * middle + after > 0.0:
        vertex = 0.5 * (before - after) / (before - 2.0 * middle + after)
        shift += float(np.clip(vertex, -1.0, 1.0)) * _STEPS[-1] * pair.window
    # A motion that repeats itself looks alike at several offsets.
    dips = (residuals[1:-1] <= residuals[:-2]) & (residuals[1:-1] <= residuals[2:])
    distant = np.abs(np.arange(1, len(shifts) - 1) - best) > 2
    if np.any(residuals[1:-1][dips & distant] < _DISTINCT * remains):
        raise UnknownOffsetError("the rotation repeats itself: several offsets fit alike")
    half = pair.half_interval(shift)
    if half > _WIDEST:
        raise UnknownOffsetError(
            "the rotation does not tell it to 20 ms: it is uniform, of a single frequency, or "
            "hidden by noise"
        )
    return OffsetInterval(shift, shift - half, shift + half)


class _Pair:
    """Mean angular rates in windows between stamps of a recording, and those of a gyroscope.

    Attitudes have noise of their own at each stamp, which interpolation would average: windows end
    at their stamps, and the gyroscope is shifted.
    """

    def __init__(
        self, reference: TurnAngles, ends: Array, rates: Array, disturbance: float
    ) -> None:
        """Initialise with the rates of the other recording.

        :param reference: angles by the first recording.
        :param ends: (2, n) begin and end of each window, after the first time of the reference [s].
        :param rates: (n, 3) mean angular rates in these windows [rad/s].
        :param disturbance: disturbance of both recordings together [rad/s].
        """
        self._disturbance = disturbance
        self._reference, self._ends, self._rates = reference, ends, _centre(rates)
        self._length = ends[1] - ends[0]
        self.window = float(np.mean(self._length))
        self._size = float(np.sum(self._rates**2))

    @classmethod
    def of(cls, reference: TurnAngles, moved: TurnAngles) -> "_Pair":
        """Return the pair of two recordings over their time in common.

        :raises UnknownOffsetError: if it is too short, or nothing turns.
        """
        intervals = [float(angles.t[-1]) / (len(angles.t) - 1) for angles in (reference, moved)]
        steps = math.ceil(max(_WINDOW, 2.0 * max(intervals)) / intervals[1])
        t = moved.t + (moved.t_ns - reference.t_ns) * 1e-9
        ends = np.stack([t[:-steps], t[steps:]])
        common = (ends[0] >= LARGEST) & (ends[1] <= float(reference.t[-1]) - LARGEST)
        rows = np.flatnonzero(common)
        rows = rows[:: max(ceil_divide(len(rows), _POINTS), steps // 2, 1)]
        if steps * intervals[1] > _LONGEST_WINDOW:
            raise UnknownOffsetError("the rates of both are too low: 4 Hz at least are needed")
        if len(rows) < _FEWEST or t[rows[-1]] - t[rows[0]] < _SHORTEST:
            raise UnknownOffsetError(
                f"too little time in common: {_SHORTEST + 2.0 * LARGEST:g} s without a pause are "
                "needed"
            )
        ends = ends[:, rows]
        turned = moved.angle[rows + steps] - moved.angle[rows]
        disturbance = float(np.hypot(reference.disturbance, moved.disturbance))
        pair = cls(reference, ends, turned / (ends[1] - ends[0])[:, None], disturbance)
        sizes = (pair._size, float(np.sum(pair._shift(0.0) ** 2)))
        if min(sizes) <= len(rows) * _TURNING**2:
            raise UnknownOffsetError("the body does not turn, or turns uniformly")
        return pair

    def _shift(self, shift: float) -> Array:
        """Return the rates (n, 3) of the gyroscope in windows that are later by a shift [s]."""
        begin, end = (self._reference.at(times + shift) for times in self._ends)
        return _centre((end - begin) / self._length[:, None])

    def residual(self, shift: float) -> float:
        """Return the share of the rates that those of the gyroscope do not explain."""
        _, residuals = self._fit(self._shift(shift))
        return float(np.sum(residuals**2)) / self._size

    def _fit(self, rates: Array) -> tuple[Array, Array]:
        """Return an orthonormal base of rates (n, 3), and the part of the other rates outside it.

        Directions in which nothing turns are left out.
        """
        axes = rates @ _turn_directions(rates)
        axes = axes / np.linalg.norm(axes, axis=0)
        explained = axes @ (axes.T @ self._rates)
        return axes, self._rates - explained

    def half_interval(self, shift: float) -> float:
        """Return half of the 95 % interval [s] of the best shift.

        At the best shift a sum over the windows is zero: the residuals times the derivatives of the
        explained rates with respect to the shift. Its variance and slope give the interval. The
        part of a derivative that another mounting matrix explains says nothing about the shift.
        """
        earlier, rates, later = (self._shift(shift + s) for s in self.window * _DIFFERENCE)
        axes, residuals = self._fit(rates)
        directions = _turn_directions(rates)
        solution = np.linalg.lstsq(rates @ directions, self._rates, rcond=None)[0]
        # (3, 3) matrix by which the rates of the gyroscope explain the others.
        mounting = directions @ solution

        def shift_derivatives(differences: Array, seconds: float) -> Array:
            """Return derivatives (n, 3) [rad/s^2] outside the axes that the mounting can explain.

            :param differences: (n, 3) change of the gyroscope's rates over so many seconds.
            """
            derivatives = differences @ mounting / seconds
            return np.asarray(derivatives - axes @ (axes.T @ derivatives))

        step = 2.0 * self.window * _DIFFERENCE[-1]
        parts = np.sum(residuals * shift_derivatives(later - earlier, step), axis=1)
        # The noise of a single difference would count as motion when it is squared. That of two
        # differences over windows without common time is independent: their product has no bias.
        slopes, wide_slopes = (
            shift_derivatives(self._shift(shift + s) - self._shift(shift - s), 2.0 * s)
            for s in self.window * _BASES
        )
        information = float(np.sum(slopes * wide_slopes))
        squares = np.sum(slopes**2, axis=1)
        if information < _LEAST_SIGNAL * float(np.sum(squares)):
            raise UnknownOffsetError("noise of the angular rates hides it")
        t = self._ends[0] - self._ends[0, 0]
        scale = information / max(float(np.sum(squares)), 1e-300)
        half_from_noise = half_interval(t, _taper(t, parts), scale * squares, _CORRELATED)
        half_from_disturbance = self._disturbance / np.sqrt(information / len(t))
        return float(np.hypot(half_from_noise, half_from_disturbance))


def _taper(t: Array, parts: Array) -> Array:
    """Return parts (n,) of a sum averaged over half a block, so that sums of blocks have no edges.

    The noise of an attitude is in two windows with opposite signs: it is in the sum of a block only
    if an edge of the block is between them, but not in the sum of all blocks.
    """
    from scipy.ndimage import uniform_filter1d  # loaded when two recordings are compared

    size = max(round(0.5 * _CORRELATED * (len(t) - 1) / float(t[-1])), 1)
    return np.asarray(_TAPER * uniform_filter1d(parts, size, mode="reflect"))


def half_interval(t: Array, parts: Array, slopes: Array, correlated: float) -> float:
    """Return half of the 95 % interval of the zero of a sum of n parts.

    The variance of an estimating equation: that of the sum, whose correlated parts are added in
    blocks of time (batch means; Conway, Management Science 10, 1963), over the square of its slope
    (the "sandwich"; Huber 1967). A few turns of a body often have most of the slope: the sum of
    each block is corrected for its leverage, and Student's degrees of freedom are those that the
    leverages leave (Bell and McCaffrey, Survey Methodology 28, 2002).

    :param t: (n,) times of the parts, from 0 [s].
    :param parts: (n,) parts of the sum.
    :param slopes: (n,) derivatives of the parts, at least 0.
    :param correlated: shortest block [s].
    """
    from scipy.special import stdtrit  # instead of t.ppf of scipy.stats: quick to import

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


def _turn_directions(rates: Array) -> Array:
    """Return the directions (3, m), orthonormal, about which rates (n, 3) turn."""
    values, directions = np.linalg.eigh(rates.T @ rates)
    return np.asarray(directions[:, values > len(rates) * _TURNING**2])


def _centre(rates: Array) -> Array:
    """Return rates (n, 3) without their mean, in which a bias is."""
    return np.asarray(rates - rates.mean(axis=0))
