# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""A truth's clock and mount against the readings': offset, skew, wander, lever arm."""

from typing import Final

import numpy as np

from imu_sim_ros.calibration.twin.model import BodyMotion, MotionAt
from imu_sim_ros.conventions import AXES, TRIADS
from imu_sim_ros.types import Array

_GRID: Final = 0.005
"""[s] between the times that are correlated."""
_MIN_POSES: Final = 200
"""Times below which there is nothing to correlate."""
_TURNING: Final = 1e-3
"""[rad/s] deviation of the rate below which a motion says nothing about the clock."""
_SHOWN: Final = 0.01
"""Share of a motion about its weakest axis with which that axis is judged."""
_APART: Final = 30.0
"""[deg] between the axes of two triads of one sensor that no misalignment explains."""


def coarse_offset(
    stamps: Array, gyro: Array, motion_at: MotionAt, duration: float, largest: float
) -> float:
    """Return true time minus stamp [s] at which the gyroscope's norm fits the truth's best.

    The norm does not depend on the mounting. The offset with the largest correlation coefficient
    over the common part, on a grid of 5 ms.

    :param stamps: (n,) [s] after the truth's first pose.
    :param gyro: (n, 3) [rad/s].
    :param duration: duration of the truth [s].
    :param largest: offset that is looked for, either way [s].
    """
    times = np.arange(0.0, duration, _GRID)
    if len(times) < _MIN_POSES:
        return 0.0
    true = np.linalg.norm(motion_at(times).rate, axis=1)
    if true.std() < _TURNING:
        return 0.0
    read = np.linalg.norm(gyro - np.median(gyro, axis=0), axis=1)
    read = _smoothed(read, stamps)
    best, found = -np.inf, 0.0
    for shift in np.arange(-round(largest / _GRID), round(largest / _GRID) + 1) * _GRID:
        at = times - shift
        inside = (at >= stamps[0]) & (at <= stamps[-1])
        if np.count_nonzero(inside) < _MIN_POSES:
            continue
        a, b = np.interp(at[inside], stamps, read), true[inside]
        spread = a.std() * b.std()
        value = float(np.mean((a - a.mean()) * (b - b.mean())) / spread) if spread else -1.0
        if value > best:
            best, found = value, float(shift)
    return found


def _smoothed(values: Array, stamps: Array) -> Array:
    """Return the mean over 50 ms: vibration would hide the motion."""
    count = max(round(0.05 / float(np.median(np.diff(stamps)))), 1)
    kernel = np.ones(count) / count
    return np.convolve(np.pad(values, count // 2, mode="edge"), kernel, mode="valid")[: len(values)]


def mounting(gyro: Array, accel: Array, motion: BodyMotion) -> Array:
    """Return the rotation R_ib (3, 3) that takes rates and forces to the readings best.

    Wahba's problem, solved by a singular value decomposition (Markley, "Attitude determination
    using vector observations and the singular value decomposition", 1988). Rates without their
    means, for the bias; both scaled to their own size.
    """
    products = [_product(gyro - gyro.mean(axis=0), motion.rate - motion.rate.mean(axis=0))]
    products.append(_product(accel, motion.force))
    u, _, vt = np.linalg.svd(products[0] + products[1])
    sign = np.sign(np.linalg.det(u @ vt))
    return u @ np.diag([1.0, 1.0, sign]) @ vt


def _product(read: Array, true: Array) -> Array:
    """Return (3, 3) the sum of products of readings and truth (n, 3), over the truth's size."""
    size = float(np.sum(true**2))
    return read.T @ true / size if size > 0.0 else np.zeros((3, 3))


def axis_problems(gyro: Array, accel: Array, motion: BodyMotion) -> list[str]:
    """Return a line for each triad whose axes no rotation takes to the truth's.

    A mirrored triad has a negative determinant; two triads with different rotations have axes of
    their own. Only what the motion shows about all three axes is judged.

    :param gyro: (n, 3) [rad/s].
    :param accel: (n, 3) [m/s^2].
    :param motion: the true motion at the readings.
    """
    pairs = ((gyro, motion.rate), (accel, motion.force))
    fits = [np.linalg.svd(_product(r - r.mean(axis=0), t - t.mean(axis=0))) for r, t in pairs]
    shown = [
        bool(values[2] > _SHOWN * values.sum() and values.sum() > 0.5) for _, values, _ in fits
    ]
    turns = [u @ vt for u, _, vt in fits]
    mirrored = [
        is_shown and bool(np.linalg.det(turn) < 0.0)
        for is_shown, turn in zip(shown, turns, strict=True)
    ]
    problems = []
    for k, (triad, other) in enumerate(zip(TRIADS, TRIADS[::-1], strict=True)):
        if not mirrored[k]:
            continue
        line = f"the axes of the {triad} are mirrored: one is inverted, or two are exchanged"
        if shown[1 - k] and not mirrored[1 - k]:
            relative = turns[k] @ turns[1 - k].T
            axis = int(np.argmin(np.diag(relative)))
            if relative[axis, axis] < -0.9:
                line = f"the {triad} {AXES[axis]} is inverted against the {other}"
        problems.append(line)
    if all(shown) and not any(mirrored):
        cosine = 0.5 * (float(np.trace(turns[0] @ turns[1].T)) - 1.0)
        angle = float(np.degrees(np.arccos(np.clip(cosine, -1.0, 1.0))))
        if angle > _APART:
            level = [float(np.trace(turn)) for turn in turns]
            triad, other = TRIADS[int(np.argmin(level))], TRIADS[int(np.argmax(level))]
            problems.append(
                f"the axes of the {triad} are turned by {angle:.0f} deg against those of the "
                f"{other}: two are inverted, or they are exchanged"
            )
    return problems


_WINDOW: Final = 2.0
"""[s] in which an offset is taken."""
_HIGHEST: Final = 5.0
"""[Hz] what counts of the residual: above it there is vibration."""
_STEPS: Final = (3e-5, 1e-4, 3e-4, 1e-3)
"""[s] between neighbouring windows that are tried."""
_GAIN: Final = 3.0
"""In log-likelihood; below it the clock does not wander."""


def wander(
    stamps: Array, residuals: Array, slope: Array, rate: float, *, steady: bool = True
) -> Array:
    """Return what is to be added to the true times (n,) [s]; 0 if the clock is steady.

    In windows the gyroscope's residual is compared with the rate of change of the readings. A
    random walk of the offset is then fitted to these, with the step that is most likely; steady is
    what gains too little by walking.

    :param residuals: (n, 6) reading minus model.
    :param slope: (n, 6) derivative of the model in time.
    :param steady: whether the clock may be found steady; false: the course in any case.
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
    still = _walk(offset, sigma, 0.0)
    best = max((_walk(offset, sigma, step) for step in _STEPS), key=lambda found: found[0])
    if steady and best[0] < still[0] + _GAIN:
        return np.zeros(len(stamps))
    return np.interp(stamps, centre, best[1])


def _walk(offset: Array, sigma: Array, step: float) -> tuple[float, Array]:
    """Return the log-likelihood of a walk of unknown start, and its most likely course (m,)."""
    index = np.arange(len(offset))
    covariance = step**2 * np.minimum.outer(index, index)
    total = covariance + np.diag(sigma**2)
    inverse = np.linalg.inv(total)
    information = float(inverse.sum())
    start = float(inverse.sum(axis=0) @ offset) / information
    rest = offset - start
    course = start + covariance @ inverse @ rest
    log = -0.5 * (np.linalg.slogdet(total)[1] + rest @ inverse @ rest + np.log(information))
    return float(log), course
