# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Whether a sensor could have followed a motion at all."""

import math
from typing import Final

import numpy as np
from numpy.typing import ArrayLike

from imu_sim_ros import rotation
from imu_sim_ros.trajectory.motion import Array, Trajectory

_LONGEST_LOOK: Final = 3600.0  # s
_SAMPLES: Final = 100_000
_SHORTEST_STEP: Final = 1e-4  # s
_BLOCK: Final = 10_000


def implausible(
    trajectory: Trajectory,
    gyroscope_range: ArrayLike,
    accelerometer_range: ArrayLike,
    gravity: ArrayLike,
    duration: float,
) -> list[str]:
    """Return a line for each triad whose range the motion exceeds.

    At most the first hour is examined, at 100,000 times or every 0.1 ms.

    :param gyroscope_range: (3,) or one number [rad/s]; 0: no limit.
    :param accelerometer_range: (3,) or one number [m/s^2]; 0: no limit.
    :param gravity: (3,) g_w [m/s^2].
    :param duration: length of the run [s]; may be infinite.
    """
    if not (np.any(gyroscope_range) or np.any(accelerometer_range)):
        return []
    end = min(duration, trajectory.duration, _LONGEST_LOOK)
    rates, forces, times = np.zeros(3), np.zeros(3), np.zeros((2, 3))
    samples = max(1, min(_SAMPLES, math.ceil(end / _SHORTEST_STEP)))
    for first in range(0, samples, _BLOCK):
        last = min(first + _BLOCK, samples)
        t: Array = np.arange(first, last, dtype=np.float64) * (end / samples)
        motion = trajectory.sample(t)
        force = rotation.rotate_inverse(motion.q_wb, motion.acceleration - np.asarray(gravity))
        _keep_peaks(rates, times[0], motion.angular_velocity, t)
        _keep_peaks(forces, times[1], force, t)
    return [
        f"the motion exceeds the {triad}'s range: {quantity} {peaks[k]:.4g} {unit} on "
        f"{'xyz'[k]} at {at[k]:.3f} s, range {limits[k]:.4g} {unit}"
        for triad, quantity, unit, peaks, at, limits in (
            ("gyroscope", "rate", "rad/s", rates, times[0], _limits(gyroscope_range)),
            (
                "accelerometer",
                "specific force",
                "m/s^2",
                forces,
                times[1],
                _limits(accelerometer_range),
            ),
        )
        for k in [int(np.argmax(peaks / limits))]
        if peaks[k] > limits[k]
    ]


def _limits(ranges: ArrayLike) -> Array:
    values = np.broadcast_to(np.asarray(ranges, dtype=np.float64), (3,))
    return np.where(values > 0.0, values, np.inf)


def _keep_peaks(peaks: Array, times: Array, values: Array, t: Array) -> None:
    """Raise peaks (3,), and the times at which they occur, to those of values (n, 3)."""
    size = np.abs(values)
    rows = np.argmax(size, axis=0)
    largest = size[rows, np.arange(3)]
    higher = largest > peaks
    peaks[higher] = largest[higher]
    times[higher] = t[rows][higher]
