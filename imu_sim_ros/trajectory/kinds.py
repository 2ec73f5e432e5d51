# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Trajectories in closed form: static, thrown, harmonic, on a turning disc, waypoints."""

import itertools
import math
from collections.abc import Callable, Mapping, Sequence
from typing import TYPE_CHECKING, Any, Final, NamedTuple

import numpy as np

from imu_sim_ros.core import rotation
from imu_sim_ros.core.types import Array
from imu_sim_ros.trajectory.motion import Motion, Trajectory
from imu_sim_ros.trajectory.parameters import (
    FreeFallParameters,
    HarmonicParameters,
    PolarParameters,
    SeriesParameters,
    StaticParameters,
    TrajectoryParameters,
    WaypointsParameters,
)

if TYPE_CHECKING:
    from scipy.interpolate import CubicSpline


class _Endless:
    """A motion without end; one of sinusoids states their highest frequency."""

    duration = math.inf
    highest_frequency = 0.0


class Static(_Endless):
    """A body that stays where it is."""

    def __init__(self, parameters: StaticParameters) -> None:
        self._position = np.array(parameters.position)
        self._q_wb = rotation.from_euler(parameters.roll_pitch_yaw)

    def sample(self, t: Array) -> Motion:
        """Return the motion at times t (n,); the arrays are read-only views of one row."""
        n = len(t)
        zero = np.broadcast_to(np.zeros(3), (n, 3))
        return Motion(
            position=np.broadcast_to(self._position, (n, 3)),
            velocity=zero,
            acceleration=zero,
            q_wb=np.broadcast_to(self._q_wb, (n, 4)),
            angular_velocity=zero,
            angular_acceleration=zero,
        )


class FreeFall(_Endless):
    """``p = p0 + v0 t + g t^2 / 2``, without end; an ideal accelerometer reads 0."""

    def __init__(self, parameters: FreeFallParameters) -> None:
        self._position = np.array(parameters.position)
        self._velocity = np.array(parameters.velocity)
        self._gravity = np.array(parameters.gravity)
        self._omega = np.array(parameters.angular_velocity)
        self._q_wb = rotation.from_euler(parameters.roll_pitch_yaw)

    def sample(self, t: Array) -> Motion:
        """Return the motion at times t (n,) [s]."""
        shape = (len(t), 3)
        time = t[:, None]
        return Motion(
            position=self._position + time * (self._velocity + 0.5 * time * self._gravity),
            velocity=self._velocity + time * self._gravity,
            acceleration=np.broadcast_to(self._gravity, shape),
            q_wb=rotation.multiply(self._q_wb, rotation.exp(time * self._omega)),
            angular_velocity=np.broadcast_to(self._omega, shape),
            angular_acceleration=np.broadcast_to(np.zeros(3), shape),
        )


class _Wave(NamedTuple):
    """A term ``sine sin(w t) + cosine cos(w t)`` of a coordinate."""

    number: int
    """Index of the angular frequency w."""
    w: float
    """Angular frequency [rad/s]."""
    sine: float
    """Amplitude of the sine, in the unit of the coordinate."""
    cosine: float
    """Amplitude of the cosine, in the unit of the coordinate."""


def _trim_leading_zeros(coefficients: list[float]) -> list[float]:
    """Return the coefficients of a polynomial, the highest that is not 0 before the others."""
    while len(coefficients) > 1 and not coefficients[-1]:
        coefficients = coefficients[:-1]
    return coefficients[::-1] or [0.0]


class _Coordinates:
    """Functions of time, each ``sum c_k t^k + sum A_j sin(w_j t + phase_j)``.

    They share the sine and cosine of each distinct frequency: ``A sin(w t + phase)`` is
    ``A cos(phase) sin(w t) + A sin(phase) cos(w t)``, so that the lecture's six coordinates cost
    three sines and three cosines.
    """

    def __init__(self, series: Sequence[SeriesParameters]) -> None:
        """Collect the frequencies, the waves and the polynomials of k functions."""
        w = sorted({w_value for sinusoids in series for w_value in sinusoids.angular_frequency})
        self._frequencies = np.array(w)
        self.highest_frequency = max(w, default=0.0) / (2.0 * math.pi)
        """Highest frequency of the sinusoids [Hz]."""
        self._waves = [
            [
                _Wave(w.index(w_value), w_value, float(a * np.cos(phase)), float(a * np.sin(phase)))
                for a, w_value, phase in zip(
                    sinusoids.amplitude,
                    sinusoids.angular_frequency,
                    sinusoids.phase or (0.0,) * len(sinusoids.amplitude),
                    strict=True,
                )
            ]
            for sinusoids in series
        ]
        degree = max((len(sinusoids.polynomial) for sinusoids in series), default=1)
        powers: Array = np.arange(degree, dtype=np.float64)
        c = np.zeros((3, len(series), degree))  # of the functions and two derivatives
        for row, sinusoids in zip(c[0], series, strict=True):
            row[: len(sinusoids.polynomial)] = sinusoids.polynomial
        for lower, higher in itertools.pairwise(c):
            higher[:, :-1] = (powers * lower)[:, 1:]
        rows = c.reshape(3 * len(series), degree)
        self._polynomials = [_trim_leading_zeros(row) for row in rows.tolist()]
        """Coefficients of k functions, of their derivatives, and of those of these: of each the
        highest that is not 0 comes first."""

    def sample(self, t: Array) -> Array:
        """Return k functions and their first two derivatives at times t (n,): (3, n, k)."""
        angles = self._frequencies[:, None] * t
        sines, cosines = np.sin(angles), np.cos(angles)
        table = np.empty((3, len(self._waves), len(t)))
        rows = table.reshape(len(self._polynomials), len(t))
        for row, (highest, *lower) in zip(rows, self._polynomials, strict=True):
            row[:] = highest
            for coefficient in lower:
                row *= t
                row += coefficient
        for (value, d1, d2), waves in zip(table.swapaxes(0, 1), self._waves, strict=True):
            for number, w, a, b in waves:
                sine, cosine = sines[number], cosines[number]
                wave, slope = a * sine, w * a * cosine
                if b:  # a wave without phase is a sine
                    wave += b * cosine
                    slope -= w * b * sine
                value += wave
                d1 += slope
                wave *= w * w
                d2 -= wave
        return table.swapaxes(1, 2)


class Harmonic(_Endless):
    """Position and Euler angles in closed form (lecture, section 5, first method), without end."""

    def __init__(self, parameters: HarmonicParameters) -> None:
        p = parameters
        self._coordinates = _Coordinates([p.x, p.y, p.z, p.roll, p.pitch, p.yaw])
        # Gravity turns in a steadily turning body.
        spin = max(abs(sum(angle.polynomial[1:2])) for angle in (p.roll, p.pitch, p.yaw))
        self.highest_frequency = max(self._coordinates.highest_frequency, spin / (2.0 * math.pi))

    def sample(self, t: Array) -> Motion:
        """Return the motion at times t (n,) [s]."""
        table = self._coordinates.sample(t)
        # A copy: parts of the table would keep all of it in memory, the angles too.
        position, velocity, acceleration = np.copy(table[:, :, :3])
        return Motion(position, velocity, acceleration, *rotation.euler_motion(*table[:, :, 3:]))


class Polar(_Endless):
    """``p = (r cos angle, r sin angle, height)`` with the body turned by the same angle about z.

    In the body, x pointing outward, the acceleration is
    ``(r'' - r angle'^2, 2 r' angle' + r angle'', 0)``: the relative, centrifugal, Coriolis and
    Euler terms of the lecture's eq. 4. Without end.
    """

    def __init__(self, parameters: PolarParameters) -> None:
        self._coordinates = _Coordinates([parameters.radius, parameters.angle])
        self._height = parameters.height
        # The turn of an upright body adds no frequency.
        self.highest_frequency = self._coordinates.highest_frequency

    def sample(self, t: Array) -> Motion:
        """Return the motion at times t (n,) [s]."""
        (r, angle), (r1, angle1), (r2, angle2) = self._coordinates.sample(t).swapaxes(1, 2)
        along, across = r2 - r * angle1 * angle1, 2.0 * r1 * angle1 + r * angle2
        c, s = np.cos(angle), np.sin(angle)
        p, v, a = np.zeros((3, len(t), 3))
        p[:, 0], p[:, 1], p[:, 2] = r * c, r * s, self._height
        sweep = r * angle1
        v[:, 0], v[:, 1] = r1 * c - sweep * s, r1 * s + sweep * c
        a[:, 0], a[:, 1] = along * c - across * s, along * s + across * c
        return Motion(p, v, a, *_yaw_motion(angle, angle1, angle2))


def _yaw_motion(yaw: Array, d1: Array, d2: Array) -> tuple[Array, Array, Array]:
    """Return q_wb, omega_b and alpha_b of an upright body from its yaw and the derivatives (n,)."""
    angles = np.zeros((3, 3, len(yaw)))
    angles[:, 2] = yaw, d1, d2
    return rotation.euler_motion(*angles.swapaxes(1, 2))


_DEGREE: Final = 5
"""Degree of the spline through waypoints."""
_PEAK_SAMPLES: Final = 200  # per way between two waypoints; a peak is missed by less than 1e-4


class Waypoints:
    """Positions and headings interpolated over time; roll and pitch are 0.

    Velocity, acceleration and their angular counterparts vanish at both ends. Without given times
    each leg lasts as long as its speed or turn at the limits would take; then all are stretched
    alike until the peaks of speed, acceleration and turn rate are within their limits.
    """

    highest_frequency = 0.0
    """The polynomials are smooth over the time between two readings."""

    def __init__(self, parameters: WaypointsParameters) -> None:
        positions = np.array(parameters.positions).reshape(-1, 3)
        headings = np.array(parameters.headings or (0.0,) * len(positions))
        coordinates = np.column_stack([positions, headings])
        if parameters.times:
            times = np.array(parameters.times)
        else:
            times = _times_within_limits(coordinates, parameters)
        self.times: Array = times
        """(n,) when the body is at each waypoint [s]."""
        self._splines = _splines(times, coordinates)
        self.duration = float(times[-1])

    def sample(self, t: Array) -> Motion:
        """Return the motion at times t (n,) [s]."""
        table = np.array([spline(t) for spline in self._splines])
        position, velocity, acceleration = table[:, :, :3]
        return Motion(position, velocity, acceleration, *_yaw_motion(*table[:, :, 3]))


def _splines(times: Array, coordinates: Array) -> "list[CubicSpline]":
    """Return the interpolating spline of coordinates (n, k) and its first two derivatives."""
    from scipy.interpolate import make_interp_spline

    rest = [(1, np.zeros(coordinates.shape[1])), (2, np.zeros(coordinates.shape[1]))]
    spline = make_interp_spline(times, coordinates, k=_DEGREE, bc_type=(rest, rest))
    return [spline, spline.derivative(1), spline.derivative(2)]


def _times_within_limits(coordinates: Array, parameters: WaypointsParameters) -> Array:
    """Return the times (n,) of waypoints at which no limit is exceeded."""
    steps = np.diff(coordinates, axis=0)
    ways = np.linalg.norm(steps[:, :3], axis=-1) / parameters.speed_limit
    turns = np.abs(steps[:, 3]) / parameters.heading_rate_limit
    times = np.concatenate([[0.0], np.cumsum(np.maximum(ways, turns))])
    indices = np.arange(0.0, len(times) - 1.0, 1.0 / _PEAK_SAMPLES)
    dense = np.interp(indices, np.arange(len(times)), times)
    _, d1, d2 = (spline(dense) for spline in _splines(times, coordinates))
    speed = np.max(np.linalg.norm(d1[:, :3], axis=-1)) / parameters.speed_limit
    force = np.max(np.linalg.norm(d2[:, :3], axis=-1)) / parameters.acceleration_limit
    rate = np.max(np.abs(d1[:, 3])) / parameters.heading_rate_limit
    # Slower by a factor k: speeds fall with k, accelerations with k^2, and the shape stays.
    return times * max(speed, np.sqrt(force), rate)


MOTIONS: Final[Mapping[type[TrajectoryParameters], Callable[[Any], Trajectory]]] = {
    StaticParameters: Static,
    HarmonicParameters: Harmonic,
    PolarParameters: Polar,
    FreeFallParameters: FreeFall,
    WaypointsParameters: Waypoints,
}
"""Motions in closed form by their sections."""
