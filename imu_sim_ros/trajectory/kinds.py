# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Trajectories in closed form: static, thrown, harmonic, on a turning disc, waypoints."""

import math
from typing import Any, Final

import numpy as np

from imu_sim_ros import rotation
from imu_sim_ros.trajectory.motion import Motion
from imu_sim_ros.trajectory.parameters import (
    FreeFallParameters,
    HarmonicParameters,
    PolarParameters,
    StaticParameters,
    WaypointsParameters,
)
from imu_sim_ros.trajectory.profile import Derivatives, attitude
from imu_sim_ros.trajectory.series import SeriesSet
from imu_sim_ros.types import Array


class _Endless:
    """A motion without end, smooth over any interval."""

    @property
    def duration(self) -> float:
        """Infinite."""
        return math.inf

    @property
    def highest_frequency(self) -> float:
        """0."""
        return 0.0


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


class Harmonic(_Endless):
    """Position and Euler angles in closed form (lecture, section 5, first method), without end."""

    def __init__(self, parameters: HarmonicParameters) -> None:
        p = parameters
        self._coordinates = SeriesSet([p.x, p.y, p.z, p.roll, p.pitch, p.yaw])
        rates = [abs(sum(angle.polynomial[1:2])) for angle in (p.roll, p.pitch, p.yaw)]
        self._spin = max(rates) / (2.0 * math.pi)

    @property
    def highest_frequency(self) -> float:
        """Highest frequency of the coordinates, and of gravity in a steadily turning body [Hz]."""
        return max(self._coordinates.highest_frequency, self._spin)

    def sample(self, t: Array) -> Motion:
        """Return the motion at times t (n,) [s]."""
        table, (*_, roll, pitch, yaw) = self._coordinates.sample(t)
        position, velocity, acceleration = table[:, :3]
        attitudes = attitude(roll, pitch, yaw, len(t))
        return Motion(position.T, velocity.T, acceleration.T, *attitudes)


class Polar(_Endless):
    """``p = (r cos angle, r sin angle, height)`` with the body turned by the same angle about z.

    In the body, x pointing outward, the acceleration is
    ``(r'' - r angle'^2, 2 r' angle' + r angle'', 0)``: the relative, centrifugal, Coriolis and
    Euler terms of the lecture's eq. 4. Without end.
    """

    def __init__(self, parameters: PolarParameters) -> None:
        self._coordinates = SeriesSet([parameters.radius, parameters.angle])
        self._height = parameters.height

    @property
    def highest_frequency(self) -> float:
        """Highest frequency of radius and angle [Hz]; the turn of an upright body adds none."""
        return self._coordinates.highest_frequency

    def sample(self, t: Array) -> Motion:
        """Return the motion at times t (n,) [s]."""
        n = len(t)
        _, (r, angle) = self._coordinates.sample(t)
        along, across = (
            r.second - r.value * angle.first * angle.first,
            2.0 * r.first * angle.first + r.value * angle.second,
        )
        c, s = np.cos(angle.value), np.sin(angle.value)
        p, v, a = np.zeros((3, n, 3))
        p[:, 0], p[:, 1], p[:, 2] = r.value * c, r.value * s, self._height
        sweep = r.value * angle.first
        v[:, 0], v[:, 1] = r.first * c - sweep * s, r.first * s + sweep * c
        a[:, 0], a[:, 1] = along * c - across * s, along * s + across * c
        level = Derivatives(0.0, 0.0, 0.0)
        return Motion(p, v, a, *attitude(level, level, angle, n))


_DEGREE: Final = 5
_PEAK_SAMPLES: Final = 200  # per way between two waypoints; a peak is missed by less than 1e-4


class Waypoints:
    """Positions and headings interpolated over time; roll and pitch are 0.

    Velocity, acceleration and their angular counterparts vanish at both ends. Without given times
    each leg lasts as long as its speed or turn at the limits would take; then all are stretched
    alike until the peaks of speed, acceleration and turn rate are within their limits.
    """

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

    @property
    def duration(self) -> float:
        """Time of the last waypoint [s]."""
        return float(self.times[-1])

    @property
    def highest_frequency(self) -> float:
        """0: the polynomials are smooth over the time between two readings."""
        return 0.0

    def sample(self, t: Array) -> Motion:
        """Return the motion at times t (n,) [s]."""
        value, first, second = (spline(t) for spline in self._splines)
        yaw = Derivatives(*(np.ascontiguousarray(x[:, 3]) for x in (value, first, second)))
        level = Derivatives(0.0, 0.0, 0.0)
        p, v, a = (np.ascontiguousarray(x[:, :3]) for x in (value, first, second))
        return Motion(p, v, a, *attitude(level, level, yaw, len(t)))


def _splines(times: Array, coordinates: Array) -> list[Any]:
    """Return the interpolating spline of coordinates (n, k) and its first two derivatives."""
    from scipy.interpolate import make_interp_spline

    rest = [(1, np.zeros(coordinates.shape[1])), (2, np.zeros(coordinates.shape[1]))]
    spline = make_interp_spline(times, coordinates, k=_DEGREE, bc_type=(rest, rest))
    return [spline, spline.derivative(1), spline.derivative(2)]


def _times_within_limits(coordinates: Array, parameters: WaypointsParameters) -> Array:
    steps = np.diff(coordinates, axis=0)
    ways = np.linalg.norm(steps[:, :3], axis=-1) / parameters.speed_limit
    turns = np.abs(steps[:, 3]) / parameters.heading_rate_limit
    times = np.concatenate([[0.0], np.cumsum(np.maximum(ways, turns))])
    indices = np.arange(0.0, len(times) - 1.0, 1.0 / _PEAK_SAMPLES)
    dense = np.interp(indices, np.arange(len(times)), times)
    _, first, second = (spline(dense) for spline in _splines(times, coordinates))
    speed = np.max(np.linalg.norm(first[:, :3], axis=-1)) / parameters.speed_limit
    force = np.max(np.linalg.norm(second[:, :3], axis=-1)) / parameters.acceleration_limit
    rate = np.max(np.abs(first[:, 3])) / parameters.heading_rate_limit
    # Slower by a factor k: speeds fall with k, accelerations with k^2, and the shape stays.
    return times * max(speed, np.sqrt(force), rate)
