# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""What is the truth's and not the sensor's: its clock, its smoothing, and its noise."""

from math import comb
from typing import Final

import numpy as np
from numpy.typing import NDArray

from imu_sim_ros import rotation
from imu_sim_ros.calibration.twin import clock
from imu_sim_ros.calibration.twin.fit import Fit, Recording, fit
from imu_sim_ros.calibration.twin.model import CURVATURE, OFFSET, SKEW, MotionAt

Array = NDArray[np.float64]

OF_THE_TRUTH: Final = np.r_[OFFSET, SKEW, CURVATURE]
"""Parameters that may differ from one part of a recording to the next."""
_ALIGNMENTS: Final = 2
_ORDER: Final = 8
"""Of the differences that leave a truth's noise and none of the motion."""
_SLOWER: Final = 2
"""Orders less, to tell noise from fast motion."""
_NOISY: Final = 0.5
"""Share of the lower order's noise that the higher one must find: white noise has 1, motion 0."""
_EVEN: Final = 1.5
"""Intervals from which on a pose is missing."""
_WINDOW: Final = 1.0
"""[s] over which the noise is averaged."""


def laid_on(recording: Recording, motion_at: MotionAt, found: Fit, cutoff: float) -> Fit:
    """Return a fit of the truth's clock and smoothing on a recording; all else stays as found.

    :param found: of another recording, or of this one.
    """
    errors = found.errors
    middle = float(recording.stamps[0] + recording.stamps[-1]) / 2.0
    start = errors._replace(offset=errors.offset + errors.skew * (middle - found.reference))
    result = fit(recording, motion_at, start, cutoff, free=OF_THE_TRUTH)
    for _ in range(_ALIGNMENTS):
        stamps, residuals = recording.stamps, result.residuals
        course = clock.wander(stamps, residuals, result.slope, recording.rate, steady=False)
        wander = result.wander + course
        result = fit(recording, motion_at, result.errors, cutoff, wander=wander, free=OF_THE_TRUTH)
    return result


def pose_noise(t: Array, position: Array, q_wb: Array) -> tuple[Array, Array]:
    """Return times (m,) and what poses scatter by at their highest frequencies (m, 6).

    Differences of eighth order, over the factor by which they enlarge white noise: attitude [rad]
    and position [m], both in the body's axes. 0 where these differences are mostly motion.

    :param t: (n,) times of the poses [s].
    :param position: (n, 3) [m].
    :param q_wb: (n, 4).
    """
    if len(t) <= _ORDER:
        return np.zeros(0), np.zeros((0, 6))
    turns = rotation.log(rotation.multiply(rotation.conjugate(q_wb[:-1]), q_wb[1:]))
    steps = np.concatenate([turns, np.diff(position, axis=0)], axis=1)
    high, low = (_scatter(steps, order) for order in (_ORDER, _ORDER - _SLOWER))
    half = _ORDER // 2
    middle = slice(half, half + len(high))
    intervals = np.diff(t)
    longest = np.lib.stride_tricks.sliding_window_view(intervals, _ORDER).max(axis=1)
    regular = longest < _EVEN * np.median(intervals)
    high[:, 3:] = rotation.rotate_inverse(q_wb[middle], high[:, 3:])
    for triad in (slice(0, 3), slice(3, 6)):
        if np.mean(high[:, triad] ** 2) <= _NOISY**2 * np.mean(low[:, triad] ** 2):
            high[:, triad] = 0.0
    return t[middle][regular], high[regular]


def _scatter(steps: Array, order: int) -> Array:
    """Return differences of an order, of the first ones, over the root of their variance."""
    result: Array = np.diff(steps, order - 1, axis=0) / np.sqrt(comb(2 * order, order))
    return result


def noise_over(t: Array, noise: Array, reference: tuple[float, float], at: Array) -> Array:
    """Return the local size of a noise over that in a reference interval (n, 6).

    1 where there is none to compare.

    :param t: (m,) times [s] of the noise (m, 6).
    :param reference: first and last time [s].
    :param at: (n,) times [s].
    """
    inside = (t >= reference[0]) & (t <= reference[1])
    if np.count_nonzero(inside) < 2 or len(t) < 2:
        return np.ones((len(at), noise.shape[1]))
    usual = np.mean(noise[inside] ** 2, axis=0)
    sums = np.concatenate([np.zeros((1, noise.shape[1])), np.cumsum(noise**2, axis=0)])
    first = np.minimum(np.searchsorted(t, at - 0.5 * _WINDOW), len(t) - 1)
    last = np.maximum(np.searchsorted(t, at + 0.5 * _WINDOW), first + 1)
    local = (sums[last] - sums[first]) / (last - first)[:, None]
    ratio = np.divide(local, usual, out=np.ones_like(local), where=usual > 0.0)
    return np.sqrt(np.where(usual > 0.0, ratio, 1.0))
