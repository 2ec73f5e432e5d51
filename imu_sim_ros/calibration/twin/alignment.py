# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""A first guess of clock and mounting: how a recording lies on a known motion."""

from typing import Final

import numpy as np
from numpy.typing import NDArray

from imu_sim_ros.calibration.twin.model import BodyMotion, MotionAt

Array = NDArray[np.float64]

_GRID: Final = 0.005
"""[s] between the times that are correlated."""
_FEWEST: Final = 200
"""Times below which there is nothing to correlate."""
_TURNING: Final = 1e-3
"""[rad/s] deviation of the rate below which a motion says nothing about the clock."""


def coarse_offset(
    stamps: Array, gyro: Array, motion_at: MotionAt, duration: float, largest: float
) -> float:
    """Return true time minus stamp [s] at which the gyroscope's norm fits the truth's best.

    The norm does not depend on the mounting. The offset with the largest correlation coefficient
    over the common part, on a grid of 5 ms.

    :param stamps: (n,) [s] after the truth's first pose.
    :param gyro: (n, 3) [rad/s].
    :param duration: of the truth [s].
    :param largest: offset that is looked for, either way [s].
    """
    times = np.arange(0.0, duration, _GRID)
    if len(times) < _FEWEST:
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
        if np.count_nonzero(inside) < _FEWEST:
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
    pairs = [(gyro - gyro.mean(axis=0), motion.rate - motion.rate.mean(axis=0))]
    pairs.append((accel, motion.force))
    total = np.zeros((3, 3))
    for read, true in pairs:
        size = float(np.sum(true**2))
        if size > 0.0:
            total += read.T @ true / size
    u, _, vt = np.linalg.svd(total)
    sign = np.sign(np.linalg.det(u @ vt))
    result: Array = u @ np.diag([1.0, 1.0, sign]) @ vt
    return result
