# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Clock and mount of a truth against the readings: offset, skew, wander, lever arm."""

from typing import Final

import numpy as np

from imu_sim_ros.calibration.twin.model import BodyMotion, MotionAt
from imu_sim_ros.core.conventions import AXES, TRIADS
from imu_sim_ros.core.types import Array

_GRID: Final = 0.005
"""Step of the times that are correlated [s]."""
_MIN_POSES: Final = 200
"""Smallest number of times to correlate."""
_TURNING: Final = 1e-3
"""Deviation of the rate below which a motion does not determine the clock [rad/s]."""
_WEAKEST_SHARE: Final = 0.01
"""Smallest share of a motion about its weakest axis with which that axis is judged."""
_MAX_MISALIGNMENT: Final = 30.0
"""Largest angle between the axes of two triads that a misalignment explains [deg]."""


def coarse_offset(
    stamps: Array, gyro: Array, motion_at: MotionAt, duration: float, largest: float
) -> float:
    """Return true time minus stamp [s] at which the gyroscope's norm fits the truth's best.

    The norm does not depend on the mounting. The offset with the largest correlation coefficient
    over the common part, on a grid of 5 ms.

    :param stamps: (n,) stamps after the truth's first pose [s].
    :param gyro: (n, 3) [rad/s].
    :param duration: duration of the truth [s].
    :param largest: largest offset that is tried, either way [s].
    """
    times = np.arange(0.0, duration, _GRID)
    if len(times) < _MIN_POSES:
        return 0.0
    true = np.linalg.norm(motion_at(times).rate, axis=1)
    if true.std() < _TURNING:
        return 0.0
    measured = np.linalg.norm(gyro - np.median(gyro, axis=0), axis=1)
    measured = _running_mean(measured, stamps)
    best, offset = -np.inf, 0.0
    for shift in np.arange(-round(largest / _GRID), round(largest / _GRID) + 1) * _GRID:
        stamps_of_times = times - shift
        common = (stamps_of_times >= stamps[0]) & (stamps_of_times <= stamps[-1])
        if np.count_nonzero(common) < _MIN_POSES:
            continue
        a, b = np.interp(stamps_of_times[common], stamps, measured), true[common]
        spread = a.std() * b.std()
        correlation = float(np.mean((a - a.mean()) * (b - b.mean())) / spread) if spread else -1.0
        if correlation > best:
            best, offset = correlation, float(shift)
    return offset


def _running_mean(values: Array, stamps: Array) -> Array:
    """Return the running mean over 50 ms of values (n,), which removes vibration."""
    count = max(round(0.05 / float(np.median(np.diff(stamps)))), 1)
    kernel = np.ones(count) / count
    return np.convolve(np.pad(values, count // 2, mode="edge"), kernel, mode="valid")[: len(values)]


def fit_mounting(gyro: Array, accel: Array, motion: BodyMotion) -> Array:
    """Return the rotation R_ib (3, 3) that takes rates and forces to the readings best.

    Wahba's problem, solved by a singular value decomposition (Markley, "Attitude determination
    using vector observations and the singular value decomposition", 1988). Rates without their
    means, for the bias; both scaled to their own size.

    :param gyro: (n, 3) readings of the gyroscope [rad/s].
    :param accel: (n, 3) readings of the accelerometer [m/s^2].
    :param motion: rates and specific forces of the body at the same times.
    """
    products = [_product(gyro - gyro.mean(axis=0), motion.rate - motion.rate.mean(axis=0))]
    products.append(_product(accel, motion.force))
    u, _, vt = np.linalg.svd(products[0] + products[1])
    sign = np.sign(np.linalg.det(u @ vt))
    return u @ np.diag([1.0, 1.0, sign]) @ vt


def _product(measured: Array, true: Array) -> Array:
    """Return the sum (3, 3) of products of readings and truth (n, 3), over the truth's energy."""
    size = float(np.sum(true**2))
    return measured.T @ true / size if size > 0.0 else np.zeros((3, 3))


def axis_problems(gyro: Array, accel: Array, motion: BodyMotion) -> list[str]:
    """Return a line for each triad whose axes no rotation takes to the truth's.

    A mirrored triad has a negative determinant; two triads with different rotations do not share
    their axes. Only axes about which the motion is large enough are judged.

    :param gyro: (n, 3) [rad/s].
    :param accel: (n, 3) [m/s^2].
    :param motion: the true motion at the readings.
    """
    pairs = ((gyro, motion.rate), (accel, motion.force))
    fits = [np.linalg.svd(_product(r - r.mean(axis=0), t - t.mean(axis=0))) for r, t in pairs]
    visible = [
        bool(singular[2] > _WEAKEST_SHARE * singular.sum() and singular.sum() > 0.5)
        for _, singular, _ in fits
    ]
    turns = [u @ vt for u, _, vt in fits]
    mirrored = [
        is_visible and bool(np.linalg.det(turn) < 0.0)
        for is_visible, turn in zip(visible, turns, strict=True)
    ]
    problems = []
    for k, (triad, partner) in enumerate(zip(TRIADS, TRIADS[::-1], strict=True)):
        if not mirrored[k]:
            continue
        line = f"the axes of the {triad} are mirrored: one is inverted, or two are exchanged"
        if visible[1 - k] and not mirrored[1 - k]:
            relative = turns[k] @ turns[1 - k].T
            axis = int(np.argmin(np.diag(relative)))
            if relative[axis, axis] < -0.9:
                line = f"the {triad} {AXES[axis]} is inverted against the {partner}"
        problems.append(line)
    if all(visible) and not any(mirrored):
        cosine = 0.5 * (float(np.trace(turns[0] @ turns[1].T)) - 1.0)
        angle = float(np.degrees(np.arccos(np.clip(cosine, -1.0, 1.0))))
        if angle > _MAX_MISALIGNMENT:
            level = [float(np.trace(turn)) for turn in turns]
            triad, partner = TRIADS[int(np.argmin(level))], TRIADS[int(np.argmax(level))]
            problems.append(
                f"the axes of the {triad} are turned by {angle:.0f} deg against those of the "
                f"{partner}: two are inverted, or they are exchanged"
            )
    return problems


_WINDOW: Final = 2.0
"""Length of the windows of the offset [s]."""
_HIGHEST: Final = 5.0
"""Highest frequency of the residual that counts: above it there is vibration [Hz]."""
_STEPS: Final = (3e-5, 1e-4, 3e-4, 1e-3)
"""Steps between neighbouring windows that are tried [s]."""
_GAIN: Final = 3.0
"""Log-likelihood that a wandering clock must gain."""


def wander(
    stamps: Array, residuals: Array, slope: Array, rate: float, *, steady: bool = True
) -> Array:
    """Return the correction of the true times (n,) [s]; 0 if the clock is steady.

    In windows the gyroscope's residual is compared with the rate of change of the readings. A
    random walk of the offset is then fitted to these, with the most likely step; the clock is
    steady if the walk gains too little.

    :param residuals: (n, 6) reading minus model.
    :param slope: (n, 6) derivative of the model in time.
    :param steady: False: return the course even if the clock is steady.
    """
    from scipy.fft import dct

    size = round(_WINDOW * rate)
    count = len(stamps) // (size // 2) - 1
    highest = int(2.0 * _WINDOW * _HIGHEST)
    if count < 4 or highest < 4:
        return np.zeros(len(stamps))
    centre, offset, sigma = np.zeros((3, count))
    for k in range(count):
        rows = slice(k * (size // 2), k * (size // 2) + size)
        y = dct(residuals[rows, :3], norm="ortho", axis=0)[1:highest]
        x = dct(slope[rows, :3], norm="ortho", axis=0)[1:highest]
        power = np.mean(y**2, axis=0) + 1e-30
        for _ in range(3):
            weight = max(float(np.sum(x**2 / power)), 1e-30)
            offset[k] = np.sum(x * y / power) / weight
            power = np.mean((y - x * offset[k]) ** 2, axis=0) + 1e-30
        centre[k] = stamps[rows].mean()
        sigma[k] = np.sqrt(2.0 / weight)  # half of a window is the next one's
    steady_likelihood, _ = _random_walk(offset, sigma, 0.0)
    walks = (_random_walk(offset, sigma, step) for step in _STEPS)
    likelihood, course = max(walks, key=lambda walk: walk[0])
    if steady and likelihood < steady_likelihood + _GAIN:
        return np.zeros(len(stamps))
    return np.interp(stamps, centre, course)


def _random_walk(offset: Array, sigma: Array, step: float) -> tuple[float, Array]:
    """Return the log-likelihood of a random walk of unknown start, and its most likely course (m,).

    :param offset: (m,) measured offsets [s], with standard errors ``sigma`` (m,).
    :param step: standard deviation of the walk from one offset to the next [s].
    """
    index = np.arange(len(offset))
    covariance = step**2 * np.minimum.outer(index, index)
    total = covariance + np.diag(sigma**2)
    inverse = np.linalg.inv(total)
    information = float(inverse.sum())
    start = float(inverse.sum(axis=0) @ offset) / information
    deviation = offset - start
    course = start + covariance @ inverse @ deviation
    squares = deviation @ inverse @ deviation
    log_likelihood = -0.5 * (np.linalg.slogdet(total)[1] + squares + np.log(information))
    return float(log_likelihood), course
