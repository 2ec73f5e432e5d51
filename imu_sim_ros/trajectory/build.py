# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""From parameters to a trajectory, with its lead-in; whether a sensor could follow it."""

import math
from typing import Final

import numpy as np
from numpy.typing import ArrayLike

from imu_sim_ros import rotation
from imu_sim_ros.poses import read_poses
from imu_sim_ros.trajectory.motion import Motion, Trajectory
from imu_sim_ros.trajectory.parameters import (
    LeadInParameters,
    PoseReader,
    TrajectoryParameters,
)
from imu_sim_ros.trajectory.retime import retimed
from imu_sim_ros.types import Array


class LeadIn:
    """A motion that begins with rest, displaced and back once before it sets out.

    The displacement is ``d b(x)`` with ``b = 256 x^4 (1 - x)^4`` and x the fraction of the
    jerk: it rises to d and falls back, and its first three derivatives vanish at both ends.
    """

    def __init__(self, inner: Trajectory, parameters: LeadInParameters) -> None:
        """Displace a motion that rests from 0 until the jerk is over."""
        self.inner = inner
        self._parameters = parameters

    @property
    def duration(self) -> float:
        """Length [s]."""
        return self.inner.duration

    @property
    def highest_frequency(self) -> float:
        """Highest frequency of motion and jerk, a smooth bump of at most four periods [Hz]."""
        return max(self.inner.highest_frequency, 4.0 / self._parameters.jerk_time)

    def sample(self, t: Array) -> Motion:
        """Return the motion at times t (n,) [s]."""
        p = self._parameters
        motion = self.inner.sample(t)
        x = np.clip((t - p.rest) / p.jerk_time, 0.0, 1.0)
        s, slope = x * (1.0 - x), 1.0 - 2.0 * x
        cube = s * s * s
        value = 256.0 * cube * s
        first = 1024.0 * cube * slope / p.jerk_time
        second = 1024.0 * s * s * (3.0 * slope * slope - 2.0 * s) / p.jerk_time**2
        d = np.asarray(p.jerk)
        return motion._replace(
            position=motion.position + value[:, None] * d,
            velocity=motion.velocity + first[:, None] * d,
            acceleration=motion.acceleration + second[:, None] * d,
        )


_LONGEST_LOOK: Final = 3600.0  # s
_SAMPLES: Final = 100_000
_BLOCK: Final = 10_000


def implausible(
    trajectory: Trajectory,
    gyroscope_range: ArrayLike,
    accelerometer_range: ArrayLike,
    gravity: ArrayLike,
    duration: float,
    rate: float,
) -> list[str]:
    """Return a line for each triad whose range the motion exceeds when it is read.

    At most the first hour is examined, at 100,000 times or fewer.

    :param gyroscope_range: (3,) or one number [rad/s]; 0: no limit.
    :param accelerometer_range: (3,) or one number [m/s^2]; 0: no limit.
    :param gravity: (3,) g_w [m/s^2].
    :param duration: length of the run [s]; may be infinite.
    :param rate: of the readings [Hz].
    """
    if not (np.any(gyroscope_range) or np.any(accelerometer_range)):
        return []
    end = min(duration, trajectory.duration, _LONGEST_LOOK)
    rates, forces, times = np.zeros(3), np.zeros(3), np.zeros((2, 3))
    samples = max(1, min(_SAMPLES, math.ceil(end * rate)))
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


def build_trajectory(
    parameters: TrajectoryParameters,
    pose_reader: PoseReader = read_poses,
    given: Trajectory | None = None,
) -> Trajectory:
    """Return the trajectory that the parameters describe.

    :param parameters: the section ``trajectory`` of a simulation.
    :param pose_reader: reads a file of poses; the default reads text files only.
    :param given: the bare motion of the type ``given``.
    :raises ConfigurationError: for parameters that do not describe a motion.
    :raises InputError: for a file of poses that cannot be used.
    """
    bare = parameters.motion(pose_reader) if given is None else given
    trajectory = retimed(bare, parameters)
    if parameters.lead_in.rest > 0.0:
        trajectory = LeadIn(trajectory, parameters.lead_in)
    v = parameters.vibration
    if any(v.acceleration + v.noise_rms + v.angular_rate + v.angular_noise_rms):
        from imu_sim_ros.trajectory.vibration import Vibrating, Vibration

        return Vibrating(trajectory, Vibration(v))
    return trajectory
