# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""A vehicle on the ground: its heading is that of its path, its pitch and roll the ground's.

The body's x axis is the tangent of the path in space, or opposite to it where the vehicle backs up,
and its y axis lies in the ground, so that its velocity is along x alone. Suspension and road turn
and shake the body on top of that.
"""

import math
from pathlib import Path as FilePath
from typing import Final

import numpy as np

from imu_sim_ros.core import rotation
from imu_sim_ros.core.errors import ConfigurationError
from imu_sim_ros.core.types import Array, Mask
from imu_sim_ros.trajectory.bspline import DEGREE
from imu_sim_ros.trajectory.ground import (
    GradeProfile,
    Ground,
    PlaneProfile,
    map_profile,
    read_height_map,
)
from imu_sim_ros.trajectory.motion import Motion, Trajectory
from imu_sim_ros.trajectory.parameters import DriveParameters
from imu_sim_ros.trajectory.path import Path, UniformSpline, find_path
from imu_sim_ros.trajectory.profile import Derivatives
from imu_sim_ros.trajectory.route import MOST_POINTS, Route, read_route
from imu_sim_ros.trajectory.schedule import Visits, find_schedule, planar_motion
from imu_sim_ros.trajectory.vibration import Vibrating, Vibration

_PREFIX: Final = "trajectory."
_SAME: Final = 1e-3
"""Largest distance of waypoints that are one place [m]."""
_SAME_ORIGIN: Final = 1e-6
"""Largest difference of equal origins [deg]."""
_RESPONSE_STEPS: Final = 40.0
"""Samples of the suspension in one of its periods."""


class Drive:
    """The motion of a drive; ``route`` has the waypoints, ``path`` and ``schedule`` the way."""

    highest_frequency = 0.0
    """The polynomials are smooth over the time between two readings."""

    def __init__(self, parameters: DriveParameters) -> None:
        """Read the files, and find path and schedule.

        :raises ConfigurationError: for what cannot be driven, a line for each problem.
        :raises InputError: for a file that cannot be used.
        """
        p = parameters
        self.route, visits = _waypoints(p)
        backward = np.array(p.speeds) < 0.0 if p.speeds else None
        self.path = find_path(
            self.route.waypoints, p.turning_radius, p.deviation, _PREFIX, backward
        )
        self.schedule = find_schedule(self.path, p, visits, _PREFIX)
        self.duration = self.schedule.length
        self._ground = _ground(p, self.path, self.route.heights)
        self._suspension = _suspension(self.path, self.schedule, p)
        self._headings = self._continuous_headings()

    def sample(self, t: Array) -> Motion:
        """Return the motion at times t (n,) [s]."""
        (u,), (rate,), (change,) = self.schedule.sample(t, 2)
        position, d1, d2, d3 = self.path.sample(u, 3)
        ground = self._ground.sample(u, 3)
        height, rise, curve, kink = (values[0] for values in ground)
        facing = self.path.driving_direction(u)
        p, v, a = np.empty((3, len(t), 3))
        for column, value, slope, bend in (
            *zip((0, 1), position, d1, d2, strict=True),
            (2, height, rise, curve),
        ):
            p[:, column], v[:, column] = value, slope * rate
            a[:, column] = bend * rate**2 + slope * change
        yaw = _yaw(facing * d1, facing * d2, facing * d3)
        pitch = _pitch(d1, d2, d3, (facing * rise, facing * curve, facing * kink))
        roll = _roll(pitch, _lateral_slope([values[1:] for values in ground[:3]], yaw))
        yaw = yaw._replace(value=self._add_turns(u, yaw.value))
        angles = np.array([_time_derivatives(x, rate, change) for x in (roll, pitch, yaw)])
        if self._suspension is not None:
            angles[:2] += np.array(self._suspension.sample(t, 2)).swapaxes(0, 1)
        return Motion(p, v, a, *rotation.euler_motion(*angles.transpose(1, 2, 0)))

    def way(self, t: Array) -> Derivatives:
        """Return the way along the path [m], its rate and the rate of that, at times t (n,)."""
        (u,), (rate,), (change,) = self.schedule.sample(t, 2)
        return Derivatives(u, rate, change)

    def _continuous_headings(self) -> tuple[Array, Array]:
        """Return places along the path, and headings there that do not jump."""
        u = self.path.bends().u
        d1 = self.path.driving_direction(u) * self.path.sample(u, 1)[1]
        return u, np.unwrap(np.arctan2(d1[1], d1[0]))

    def _add_turns(self, u: Array, yaw: Array) -> Array:
        """Return headings with whole turns added, so that they do not jump along the path."""
        nearest = np.interp(u, *self._headings)
        return yaw + 2.0 * math.pi * np.rint((nearest - yaw) / (2.0 * math.pi))


def drive(parameters: DriveParameters) -> Trajectory:
    """Return the motion of a drive, shaken by its road."""
    bare = Drive(parameters)
    road = Vibration(parameters.road)
    return Vibrating(bare, road, bare.way, parameters.road_speed) if road else bare


def route_in(trajectory: object) -> Route | None:
    """Return the route of a drive, which other motions may be wrapped around; None: there is none.

    :param trajectory: any motion.
    """
    while not isinstance(trajectory, Drive):
        if not hasattr(trajectory, "inner"):
            return None
        trajectory = trajectory.inner
    return trajectory.route


def elsewhere_on_earth(
    trajectory: Trajectory, latitude_deg: float, longitude_deg: float
) -> list[str]:
    """Return a line if the world's origin on the Earth is not that of a drive's route."""
    route = route_in(trajectory)
    if route is None or route.origin is None:
        return []
    latitude, longitude = route.origin
    if abs(latitude - latitude_deg) + abs(longitude - longitude_deg) < _SAME_ORIGIN:
        return []
    return [
        f"the route's origin is at {latitude:.7f}, {longitude:.7f} deg, the world's at "
        f"{latitude_deg:.7f}, {longitude_deg:.7f}: fixes are on the route with "
        f"latitude_deg={latitude:.7f} and longitude_deg={longitude:.7f}"
    ]


def _waypoints(p: DriveParameters) -> tuple[Route, Visits | None]:
    """Return the route without waypoints twice in a row, and when each is visited."""
    if p.file:
        route = read_route(FilePath(p.file), p.origin)
        times = route.times if p.use_times else None
        if p.use_times and times is None:
            raise ConfigurationError(f"{_PREFIX}use_times = true: {p.file} has no times")
    else:
        count = len(p.positions) // 2
        heights = np.array(p.elevations) if p.elevations else np.full(count, np.nan)
        route = Route(np.reshape(p.positions, (-1, 2)), None, None, heights)
        times = np.array(p.times) if p.times else None
    waypoints, heights = route.waypoints, _elevations(p, route)
    if p.laps * len(waypoints) > MOST_POINTS:
        raise ConfigurationError(
            f"{_PREFIX}laps = {p.laps}: {p.laps * len(waypoints)} waypoints; at most {MOST_POINTS}"
        )
    if p.laps:
        waypoints = np.vstack([*[waypoints] * p.laps, waypoints[:1]])
        heights = np.concatenate([*[heights] * p.laps, heights[:1]])
    moves = np.linalg.norm(np.diff(waypoints, axis=0), axis=1) > _SAME
    _check(p, moves, times)
    starts = np.flatnonzero(np.concatenate([[True], moves]))
    route = route._replace(waypoints=waypoints[starts], heights=heights[starts])
    if times is None:
        return route, None
    ends = np.append(starts[1:], len(waypoints)) - 1
    visits = Visits(times[starts], times[ends])
    # At the ends there is rest before and after the drive, by other parameters.
    visits.arrivals[0], visits.departures[-1] = visits.departures[0], visits.arrivals[-1]
    if visits.departures[0]:
        raise ConfigurationError(
            f"{_PREFIX}times: waypoint 2 is waypoint 1: {_PREFIX}rest_before adds rest at the start"
        )
    return route._replace(times=times[starts]), visits


def _elevations(p: DriveParameters, route: Route) -> Array:
    """Return z (n,) of the waypoints, nan for those of the ground."""
    if p.elevations:
        return route.heights
    if not p.use_elevations:
        return np.full(len(route.waypoints), np.nan)
    missing = np.flatnonzero(np.isnan(route.heights))
    if len(missing):
        raise ConfigurationError(
            f"{_PREFIX}use_elevations = true: {p.file}: {len(missing)} of {len(route.heights)} "
            f"points have no elevation, the first is point {missing[0] + 1}"
        )
    return route.heights - (route.heights[0] if route.origin else 0.0)


def _ground(p: DriveParameters, path: Path, heights: Array) -> Ground:
    """Return the ground below a path: of a map, of elevations (w,) of its waypoints, or a plane."""
    if p.height_map:
        return map_profile(read_height_map(p.height_map), path.splines[0], p.track)
    if not np.isnan(heights[0]):
        return GradeProfile(path, heights, p.elevation_smoothing)
    return PlaneProfile(p.slope, path)


def _check(p: DriveParameters, moves: Mask, times: Array | None) -> None:
    """Check the waypoints of a drive, their times, stops and speeds.

    :param moves: (w - 1,) True where a waypoint differs from the one before it.
    :param times: (w,) times of the waypoints [s]; None: they have none.
    :raises ConfigurationError: if all waypoints coincide, times do not increase, a stop is at no
        waypoint between the ends, or the number of speeds differs from that of ways.
    """
    problems = []
    if not moves.any():
        problems.append(f"{_PREFIX}{'file' if p.file else 'positions'}: all waypoints are one")
    if times is None and not p.file and not moves.all():
        k = int(np.argmin(moves))
        problems.append(
            f"{_PREFIX}positions: waypoints {k + 1} and {k + 2} are the same; leave one out, or "
            f"give {_PREFIX}times"
        )
    if times is not None:
        late = np.flatnonzero(np.diff(times) <= 0.0)
        problems += [
            f"{p.file or _PREFIX + 'times'}: point {k + 2} at {times[k + 1]:g} s: must be after "
            f"point {k + 1} at {times[k]:g} s"
            for k in late[:10]
        ]
    count = 1 + int(np.count_nonzero(moves))
    for number, wait in np.reshape(p.stops, (-1, 2)):
        if number % 1 or not 2 <= number <= count - 1:
            problems.append(
                f"{_PREFIX}stops: waypoint {number:g}: must be from 2 to {count - 1}; it stands at "
                "both ends anyway"
            )
        elif not wait:
            problems.append(f"{_PREFIX}stops: waypoint {number:g}: must stand for more than 0 s")
    if p.speeds and len(p.speeds) != count - 1:
        problems.append(
            f"{_PREFIX}speeds: {len(p.speeds)} entries; must be empty or {count - 1}, one for each "
            "way between two waypoints"
        )
    if problems:
        raise ConfigurationError(problems)


def _suspension(path: Path, schedule: UniformSpline, p: DriveParameters) -> UniformSpline | None:
    """Return roll and pitch of the body over the ground, as springs and dampers follow.

    ``x'' + 2 d w x' + w^2 x = w^2 k a`` with the acceleration a across or along.
    """
    if not (p.suspension_pitch or p.suspension_roll):
        return None
    from scipy.signal import cont2discrete, lfilter

    segments = max(1, math.ceil(schedule.length * p.suspension_frequency * _RESPONSE_STEPS))
    step = schedule.length / segments
    t = (np.arange(segments + DEGREE) - 2) * step
    done = planar_motion(path, schedule, np.clip(t, 0.0, schedule.length))
    w = 2.0 * math.pi * p.suspension_frequency
    transfer = ([w * w], [1.0, 2.0 * p.suspension_damping * w, w * w])
    ((numerator,), denominator, _) = cont2discrete(transfer, step, method="foh")
    facing = path.driving_direction(schedule.sample(np.clip(t, 0.0, schedule.length), 0)[0][0])
    force = np.stack([p.suspension_roll * done.across, -p.suspension_pitch * done.along]) * facing
    return UniformSpline(lfilter(numerator, denominator, force, axis=1).T, step)


def _time_derivatives(angle: Derivatives, rate: Array, change: Array) -> Derivatives:
    """Return derivatives by time of an angle with derivatives by u."""
    return Derivatives(
        angle.value, angle.first * rate, angle.second * rate**2 + angle.first * change
    )


def _yaw(d1: Array, d2: Array, d3: Array) -> Derivatives:
    """Return ``atan2(y', x')`` and its derivatives, from derivatives (2, n)."""
    (x1, y1), (x2, y2), (x3, y3) = d1, d2, d3
    square = x1 * x1 + y1 * y1
    slope = (x1 * y2 - y1 * x2) / square
    bend = (x1 * y3 - y1 * x3) / square - 2.0 * slope * (x1 * x2 + y1 * y2) / square
    return Derivatives(np.arctan2(y1, x1), slope, bend)


def _pitch(d1: Array, d2: Array, d3: Array, height: tuple[Array, Array, Array]) -> Derivatives:
    """Return the pitch ``-atan2(z', |(x', y')|)`` [rad] and its derivatives by the path's u.

    :param d1, d2, d3: (2, n) first to third derivatives of x and y by u.
    :param height: first to third derivatives (n,) of z by u.
    """
    (x1, y1), (x2, y2), (x3, y3) = d1, d2, d3
    z1, z2, z3 = height
    r = np.sqrt(x1 * x1 + y1 * y1)
    r1 = (x1 * x2 + y1 * y2) / r
    r2 = (x2 * x2 + y2 * y2 + x1 * x3 + y1 * y3 - r1 * r1) / r
    numerator, denominator = z2 * r - z1 * r1, r * r + z1 * z1
    slope = -numerator / denominator
    bend = -(z3 * r - z1 * r2 + 2.0 * slope * (r * r1 + z1 * z2)) / denominator
    return Derivatives(-np.arctan2(z1, r), slope, bend)


def _lateral_slope(slopes: list[Array], yaw: Derivatives) -> Derivatives:
    """Return the slope to the left, from slopes along x and y (2, n) and their derivatives."""
    c, s = np.cos(yaw.value), np.sin(yaw.value)

    def sideways(slope: Array) -> Array:
        return slope[1] * c - slope[0] * s

    def ahead(slope: Array) -> Array:
        return slope[0] * c + slope[1] * s

    value, d1, d2 = slopes
    return Derivatives(
        sideways(value),
        sideways(d1) - ahead(value) * yaw.first,
        sideways(d2)
        - 2.0 * ahead(d1) * yaw.first
        - ahead(value) * yaw.second
        - sideways(value) * yaw.first * yaw.first,
    )


def _roll(pitch: Derivatives, across: Derivatives) -> Derivatives:
    """Return ``atan(across cos(pitch))``: the left of the body lies in the ground."""
    c, s = np.cos(pitch.value), np.sin(pitch.value)
    x = across.value * c
    x1 = across.first * c - across.value * s * pitch.first
    x2 = (
        across.second * c
        - 2.0 * across.first * s * pitch.first
        - across.value * (c * pitch.first * pitch.first + s * pitch.second)
    )
    flat = 1.0 + x * x
    slope = x1 / flat
    return Derivatives(np.arctan(x), slope, (x2 - 2.0 * x * x1 * slope) / flat)
