# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Vibration of the body on top of its motion: sinusoids and band-limited noise."""

from collections.abc import Callable, Iterator, Sequence
from typing import Final, NamedTuple

import numpy as np
from numpy.random import PCG64, Generator, SeedSequence

from imu_sim_ros.core import rotation
from imu_sim_ros.core.types import Array
from imu_sim_ros.trajectory.motion import Motion, Trajectory
from imu_sim_ros.trajectory.parameters import VibrationParameters
from imu_sim_ros.trajectory.profile import Derivatives

_AXES: Final = 3
"""Number of axes: x, y, z."""
_TURNS: Final = 1
"""Names the stream of the turning noise; the shaking noise has the seed's own."""


_MAX_TIMES_AT_ONCE: Final = 64
"""Number of times up to which all lines are evaluated at once; above it, line by line."""


class _Lines(NamedTuple):
    """The lines of one axis, in columns (lines, 1)."""

    amplitude: Array
    """Amplitude in the unit of the sum."""
    w: Array
    """Angular frequency [rad/s]."""
    phase: Array
    """Phase at time 0 [rad]."""


class Sinusoids:
    """``sum A sin(w t + phase)`` on each of three axes, with integrals and derivative.

    Lines are added one after the other, in the same order for any number of times, so that a sum
    at a time does not depend on the times next to it.
    """

    def __init__(self, tones: "_Tones", noise: "_Tones") -> None:
        self._lines = []
        for axis in range(_AXES):
            columns = [
                np.concatenate([a[axis], b[axis]]) for a, b in zip(tones, noise, strict=True)
            ]
            is_used = columns[0] != 0.0
            self._lines.append(_Lines(*(column[is_used][:, None] for column in columns)))

    def __bool__(self) -> bool:
        """Return whether there is any line."""
        return any(len(lines.w) for lines in self._lines)

    @property
    def highest_frequency(self) -> float:
        """Highest frequency of the lines [Hz]; 0 without lines."""
        frequencies = [float(lines.w.max()) for lines in self._lines if len(lines.w)]
        return max(frequencies, default=0.0) / (2.0 * np.pi)

    def with_integrals(self, t: Array) -> tuple[Array, Array, Array]:
        """Return second and first integral, without constants, and the sum (n, 3)."""
        sums = np.zeros((3, len(t), _AXES))
        for axis, lines in enumerate(self._lines):
            for amplitude, w, phase in _groups(lines, len(t)):
                angle = w * t + phase
                wave = amplitude * np.sin(angle)
                parts = (-(wave / (w * w)), -((amplitude / w) * np.cos(angle)), wave)
                for total, part in zip(sums, parts, strict=True):
                    _add(total[:, axis], part)
        d2, d1, value = sums
        return d2, d1, value

    def with_derivative(self, t: Array) -> tuple[Array, Array, Array]:
        """Return the first integral, the sum, and its derivative (n, 3)."""
        sums = np.zeros((3, len(t), _AXES))
        for axis, lines in enumerate(self._lines):
            for amplitude, w, phase in _groups(lines, len(t)):
                angle = w * t + phase
                cosine = np.cos(angle)
                parts = (
                    -((amplitude / w) * cosine),
                    amplitude * np.sin(angle),
                    (amplitude * w) * cosine,
                )
                for total, part in zip(sums, parts, strict=True):
                    _add(total[:, axis], part)
        d1, value, slope = sums
        return d1, value, slope


def _groups(lines: _Lines, count: int) -> Iterator[_Lines]:
    """Yield the groups of lines that are evaluated together for a number of times."""
    if count <= _MAX_TIMES_AT_ONCE:
        yield lines
        return
    for k in range(len(lines.w)):
        yield _Lines(*(column[k : k + 1] for column in lines))


def _add(total: Array, parts: Array) -> None:
    """Add rows (lines, n) in order to a sum (n,), bit for bit as one by one."""
    if len(parts) == 1:
        total += parts[0]
    elif len(parts):
        total += np.add.accumulate(parts, axis=0)[-1]


class Vibration:
    """A displacement in body axes and a turn about them, of sinusoids, with exact derivatives.

    The acceleration of the displacement is ``sum A sin(w t + phase)``; velocity and displacement
    are the integrals without constants. The turn is ``Exp(phi)``, and the derivative of the
    rotation vector phi is such a sum. The noise is a sum of lines of equal power, one at a random
    place in each of ``lines`` equal parts of the band and with a random phase, so that it does not
    repeat; its mean square over a long time is ``lines * A^2 / 2``, the square of the given RMS.
    """

    def __init__(self, parameters: VibrationParameters) -> None:
        p = parameters
        shaking, turning = p.phase, p.angular_phase or p.phase
        self.shift = Sinusoids(
            _tones(p, p.acceleration, shaking), _noise(p, p.noise_rms, SeedSequence(p.seed))
        )
        stream = SeedSequence(p.seed, spawn_key=(_TURNS,))
        self.turn = Sinusoids(
            _tones(p, p.angular_rate, turning), _noise(p, p.angular_noise_rms, stream)
        )

    def __bool__(self) -> bool:
        """Return whether there is any vibration."""
        return bool(self.shift) or bool(self.turn)


_Tones = tuple[Array, Array, Array]
"""Amplitude, angular frequency [rad/s] and phase [rad] (3, lines)."""


def _tones(
    parameters: VibrationParameters, amplitudes: Sequence[float], phases: Sequence[float]
) -> _Tones:
    """Return the given sinusoids; none if there are no amplitudes."""
    amplitude = np.array(amplitudes, dtype=np.float64).reshape(-1, _AXES).T
    count = amplitude.shape[1]
    w = 2.0 * np.pi * np.array(parameters.frequency)[:count]
    phase = np.array(phases or (0.0,) * count)[:count]
    return amplitude, np.tile(w, (_AXES, 1)), np.tile(phase, (_AXES, 1))


def _noise(parameters: VibrationParameters, rms: Sequence[float], seed: SeedSequence) -> _Tones:
    """Return amplitude, angular frequency and phase of the noise's lines, each (axes, lines)."""
    random = Generator(PCG64(seed))
    lines = parameters.noise_lines
    share = (np.arange(lines) + random.random((_AXES, lines))) / lines
    low, high = parameters.noise_low, parameters.noise_high
    w = 2.0 * np.pi * (low + (high - low) * share)
    amplitude = np.sqrt(2.0 / lines) * np.array(rms)
    phase = 2.0 * np.pi * random.random((_AXES, lines))
    return np.broadcast_to(amplitude[:, None], w.shape), w, phase


class Vibrating:
    """A motion whose body is displaced and turned by a vibration in its own axes.

    ``p = p0 + R0 d``, hence ``v = v0 + R0 (d' + omega0 x d)`` and
    ``a = a0 + R0 (d'' + 2 omega0 x d' + alpha0 x d + omega0 x (omega0 x d))``; the attitude is
    ``R = R0 E`` with the turn E, hence ``omega = E^T omega0 + omega_E`` and
    ``alpha = E^T alpha0 - omega_E x (E^T omega0) + alpha_E``.
    """

    def __init__(
        self,
        inner: Trajectory,
        vibration: Vibration,
        way: Callable[[Array], Derivatives] | None = None,
        speed: float = 1.0,
    ) -> None:
        """Shake a motion.

        :param way: way along which the body goes [m], and its derivatives, at times (n,); the
            vibration is bound to it and holds at a speed. None: it is bound to time.
        :param speed: the speed [m/s].
        """
        self.inner = inner
        self._vibration, self._way, self._speed = vibration, way, speed
        self.duration = inner.duration
        self.highest_frequency = max(
            inner.highest_frequency,
            vibration.shift.highest_frequency,
            vibration.turn.highest_frequency,
        )

    def sample(self, t: Array) -> Motion:
        """Return the motion at times t (n,) [s]."""
        motion = self.inner.sample(t)
        clock = None
        if self._way is not None:
            clock = Derivatives(*(x / self._speed for x in self._way(t)))
        if self._vibration.shift:
            motion = self._shift(motion, t, clock)
        if self._vibration.turn:
            motion = self._turn(motion, t, clock)
        return motion

    def _shift(self, motion: Motion, t: Array, clock: Derivatives | None) -> Motion:
        """Return the motion with the translational vibration."""
        d, d_first, d_second = _time_derivatives(self._vibration.shift.with_integrals, t, clock)
        omega, alpha = motion.angular_velocity, motion.angular_acceleration
        swept = np.cross(omega, d)
        force = d_second + 2.0 * np.cross(omega, d_first) + np.cross(alpha, d)
        force += np.cross(omega, swept)
        return motion._replace(
            position=motion.position + rotation.rotate(motion.q_wb, d),
            velocity=motion.velocity + rotation.rotate(motion.q_wb, d_first + swept),
            acceleration=motion.acceleration + rotation.rotate(motion.q_wb, force),
        )

    def _turn(self, motion: Motion, t: Array, clock: Derivatives | None) -> Motion:
        """Return the motion with the rotational vibration."""
        phi, d1, d2 = _time_derivatives(self._vibration.turn.with_derivative, t, clock)
        turn = rotation.exp(phi)
        own_rate, own_acceleration = rotation.rate_and_acceleration(phi, d1, d2)
        rate = rotation.rotate_inverse(turn, motion.angular_velocity)
        acceleration = rotation.rotate_inverse(turn, motion.angular_acceleration)
        return motion._replace(
            q_wb=rotation.normalise(rotation.multiply(motion.q_wb, turn)),
            angular_velocity=rate + own_rate,
            angular_acceleration=acceleration - np.cross(own_rate, rate) + own_acceleration,
        )


def _time_derivatives(
    function: Callable[[Array], tuple[Array, Array, Array]], t: Array, clock: Derivatives | None
) -> tuple[Array, Array, Array]:
    """Return a function (n, 3) of a clock that runs unevenly, and its derivatives by time."""
    if clock is None:
        return function(t)
    value, rate, acceleration = clock
    values, d1, d2 = function(value)
    rate = rate[:, None]
    return values, d1 * rate, d2 * rate**2 + d1 * acceleration[:, None]
