# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Vibration of the body on top of its motion: sinusoids and band-limited noise."""

from typing import Final

import numpy as np

from imu_sim_ros import rotation
from imu_sim_ros.config import VibrationParameters
from imu_sim_ros.trajectory.motion import Array, Motion, Trajectory

_AXES: Final = 3


class Vibration:
    """A displacement in body axes, of sinusoids, with exact derivatives.

    Its acceleration is ``sum A sin(w t + phase)``; velocity and displacement are the integrals
    without constants. The noise is a sum of lines of equal power, one at a random place in each of
    ``lines`` equal parts of the band and with a random phase, so that it does not repeat; its mean
    square over a long time is ``lines * A^2 / 2``, the square of the given RMS.
    """

    def __init__(self, parameters: VibrationParameters) -> None:
        tones = np.array(parameters.acceleration).reshape(-1, _AXES)
        frequency = 2.0 * np.pi * np.array(parameters.frequency)
        phase = np.array(parameters.phase or (0.0,) * len(frequency))
        noise = _noise_lines(parameters)
        # For each axis: amplitude [m/s^2], angular frequency [rad/s], phase [rad] of every line.
        self._lines = [
            [
                line
                for line in zip(
                    np.concatenate([tones[:, axis], noise[0][axis]]).tolist(),
                    np.concatenate([frequency, noise[1][axis]]).tolist(),
                    np.concatenate([phase, noise[2][axis]]).tolist(),
                    strict=True,
                )
                if line[0] != 0.0
            ]
            for axis in range(_AXES)
        ]

    def __bool__(self) -> bool:
        """Tell whether there is any vibration."""
        return any(self._lines)

    def sample(self, t: Array) -> tuple[Array, Array, Array]:
        """Return displacement, velocity and acceleration (n, 3) in body axes at times t (n,)."""
        displacement, velocity, acceleration = np.zeros((3, len(t), _AXES))
        for axis, lines in enumerate(self._lines):
            for amplitude, w, phase in lines:
                angle = w * t + phase
                wave = amplitude * np.sin(angle)
                acceleration[:, axis] += wave
                displacement[:, axis] -= wave / (w * w)
                velocity[:, axis] -= (amplitude / w) * np.cos(angle)
        return displacement, velocity, acceleration


def _noise_lines(parameters: VibrationParameters) -> tuple[Array, Array, Array]:
    """Return amplitude [m/s^2], angular frequency [rad/s] and phase (3, lines) of the noise."""
    random = np.random.Generator(np.random.PCG64(parameters.seed))
    lines = parameters.noise_lines
    place = (np.arange(lines) + random.random((_AXES, lines))) / lines
    low, high = parameters.noise_low, parameters.noise_high
    frequency = 2.0 * np.pi * (low + (high - low) * place)
    amplitude = np.sqrt(2.0 / lines) * np.array(parameters.noise_rms)
    phase = 2.0 * np.pi * random.random((_AXES, lines))
    return np.broadcast_to(amplitude[:, None], frequency.shape), frequency, phase


class Vibrating:
    """A motion whose body is displaced by a vibration in its own axes.

    ``p = p0 + R d``, hence ``v = v0 + R (d' + omega x d)`` and
    ``a = a0 + R (d'' + 2 omega x d' + alpha x d + omega x (omega x d))``; the attitude stays.
    """

    def __init__(self, inner: Trajectory, vibration: Vibration) -> None:
        self.inner = inner
        self._vibration = vibration

    @property
    def duration(self) -> float:
        """Length [s]."""
        return self.inner.duration

    def sample(self, t: Array) -> Motion:
        """Return the motion at times t (n,) [s]."""
        motion = self.inner.sample(t)
        d, d_first, d_second = self._vibration.sample(t)
        omega, alpha = motion.angular_velocity, motion.angular_acceleration
        swept = np.cross(omega, d)
        force = d_second + 2.0 * np.cross(omega, d_first) + np.cross(alpha, d)
        force += np.cross(omega, swept)
        return motion._replace(
            position=motion.position + rotation.rotate(motion.q_wb, d),
            velocity=motion.velocity + rotation.rotate(motion.q_wb, d_first + swept),
            acceleration=motion.acceleration + rotation.rotate(motion.q_wb, force),
        )
