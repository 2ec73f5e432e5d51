# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Schedule of a vehicle on its path: as fast as limits allow, or at given times.

The fastest schedule within limits of speed and acceleration by place follows from one pass forward
and one back over the squares of speeds, which a constant acceleration changes in proportion to the
way. It becomes the control points of a uniform B-spline over time, C4, whose speeds and
accelerations are means of those of the schedule. While it rests it rests exactly.
"""

import dataclasses
import math
from typing import Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from imu_sim_ros.core.errors import ConfigurationError
from imu_sim_ros.core.types import Array, Mask
from imu_sim_ros.trajectory.bspline import DEGREE
from imu_sim_ros.trajectory.parameters import DriveParameters
from imu_sim_ros.trajectory.path import Path, UniformSpline

_KERNEL: Final = 3.0
"""Half of the reach of a control point, in steps: how long a rest has to be for one to show."""
_MOST_STEPS: Final = 2_000_000
"""Largest number of steps of a schedule: less than 2 GB."""
_ROUNDING: Final = 1e-6
"""Rounding of times [steps]."""
_AIMS: Final = 6
"""Largest number of schedules, each planned with lower limits than the one before."""
_ROUNDS: Final = 400
"""Largest number of iterations of a schedule."""
_TIMES_MET: Final = 1e-9
"""Largest deviation of the schedule from given times before smoothing [s]."""
_LATE: Final = 1e-3
"""Largest delay of a waypoint that is still in time [s]."""
_EXACT: Final = 1e-9
"""Largest error of a position at a given time [m]."""
_OVER: Final = 0.02
"""Share of a limit by which given times may exceed it."""
_FASTEST: Final = 1e4
"""Largest speed [m/s]."""
_FINE: Final = 4
"""Samples in a step, to look at speeds."""


class Visits(NamedTuple):
    """Times at which each of w waypoints is reached and left; the first time is 0."""

    arrivals: Array
    """(w,) times of arrival [s]."""
    departures: Array
    """(w,) times of departure [s]."""


class _Way(NamedTuple):
    """A path at n places, with the limits of the vehicle there."""

    u: Array
    """(n,) parameter of the path, ascending."""
    s: Array
    """(n,) way from the start [m]."""
    slope: Array
    """(n,) derivative of u by the way [1/m]."""
    square: Array
    """(n,) largest square of the speed [m^2/s^2]."""
    waypoint_index: NDArray[np.intp]
    """(w,) rows of the waypoints."""


class Driven(NamedTuple):
    """Motion along a path at n times."""

    speed: Array
    """(n,) speeds [m/s]."""
    along: Array
    """(n,) accelerations along the path [m/s^2]."""
    across: Array
    """(n,) accelerations to the left [m/s^2]."""
    turn: Array
    """(n,) heading rates [rad/s]."""


def planar_motion(path: Path, schedule: UniformSpline, t: Array) -> Driven:
    """Return speeds and accelerations in the plane at times t (n,) [s]."""
    (u,), (rate,), (change,) = schedule.sample(t, 2)
    _, d1, d2 = path.sample(u, 2)
    size = np.hypot(*d1)
    speed = size * rate
    turning = (d1[0] * d2[1] - d1[1] * d2[0]) / size**3
    along = (d1[0] * d2[0] + d1[1] * d2[1]) / size * rate**2 + size * change
    return Driven(speed, along, speed**2 * turning, speed * turning)


def find_schedule(
    path: Path, p: DriveParameters, visits: Visits | None, prefix: str = "trajectory."
) -> UniformSpline:
    """Return u over time, at rest at both ends.

    :param visits: visits of the waypoints; None: as fast as limits allow, with the stops and speeds
        of the parameters.
    :raises ConfigurationError: for times that cannot be met within limits, a line for each.
    """
    if visits is not None:
        return _fit_times(path, p, visits, prefix)
    step = p.smoothing_time / (2.0 * _KERNEL)
    stops = {int(k) - 1: wait for k, wait in np.reshape(p.stops, (-1, 2))}
    waits = np.array([stops.get(k, 0.0) for k in range(len(path.waypoint_u))])
    # Where it turns back it has to rest for a moment.
    waits[path.turns] = np.maximum(waits[path.turns], step)
    speeds = np.array(p.speeds) if p.speeds else np.full(len(path.waypoint_u) - 1, np.inf)
    aim = p
    for _ in range(_AIMS):
        way = _way(path, aim)
        _, controls = _controls(way, _limit_speeds(way, aim, speeds, waits), waits, step)
        schedule = UniformSpline(controls[:, None], step)
        shares = _shares(planar_motion(path, schedule, _fine_grid(schedule)), p).max(axis=1)
        if shares.max() <= 1.0:
            return schedule
        aim = _below(aim, np.maximum(shares, 1.0))
    # Slower by a factor k: speeds fall with k, accelerations with k^2.
    slower = float((shares ** [1.0, 0.5, 0.5, 1.0]).max())
    return UniformSpline(controls[:, None], step * slower)


def _below(p: DriveParameters, shares: Array) -> DriveParameters:
    """Return limits lowered by the shares by which smoothing exceeds them."""
    speed, along, across, turn = (float(share) for share in shares)
    return dataclasses.replace(
        p,
        speed_limit=p.speed_limit / speed,
        acceleration_limit=p.acceleration_limit / along,
        braking_limit=p.braking_limit / along,
        lateral_limit=p.lateral_limit / across,
        heading_rate_limit=p.heading_rate_limit / turn,
    )


def _fine_grid(schedule: UniformSpline) -> Array:
    """Return times (n,) of a fine grid over a schedule."""
    count = schedule.segments * _FINE
    return np.arange(count + 1, dtype=np.float64) * (schedule.length / count)


def _shares(done: Driven, p: DriveParameters) -> Array:
    """Return speed, accelerations along and across, and heading rate over their limits (4, n)."""
    along = np.where(
        done.along > 0.0, done.along / p.acceleration_limit, -done.along / p.braking_limit
    )
    across, turn = np.abs(done.across) / p.lateral_limit, np.abs(done.turn) / p.heading_rate_limit
    return np.stack([done.speed / p.speed_limit, along, across, turn])


def _way(path: Path, p: DriveParameters) -> _Way:
    """Return the way along a path with its bends and speed limits."""
    bends = path.bends()
    u = np.union1d(bends.u, path.waypoint_u)
    middle = 0.5 * (u[:-1] + u[1:])
    size, between = (np.hypot(*path.sample(x, 1)[1]) for x in (u, middle))
    # Simpson's rule
    steps = np.diff(u) * (size[:-1] + 4.0 * between + size[1:]) / 6.0
    curvature = np.maximum(np.abs(np.interp(u, bends.u, bends.curvature)), 1e-12)
    square = np.minimum(p.lateral_limit / curvature, (p.heading_rate_limit / curvature) ** 2)
    s = np.concatenate([[0.0], np.cumsum(steps)])
    square = np.minimum(square, p.speed_limit**2)
    return _Way(
        u=u,
        s=s,
        slope=1.0 / size,
        square=square,
        waypoint_index=np.searchsorted(u, path.waypoint_u),
    )


def _limit_speeds(way: _Way, p: DriveParameters, speeds: Array, waits: Array) -> Array:
    """Return the squares of the speeds (n,) [m^2/s^2]: the fastest schedule from rest to rest.

    At a constant acceleration a the square of the speed rises by 2 a per metre: less that rise, the
    squares must not increase along the way; nor backwards, with the limit of braking.

    :param speeds: (w - 1,) largest speed on each leg [m/s].
    :param waits: (w,) rest at each waypoint [s].
    """
    leg = np.searchsorted(way.waypoint_index, np.arange(len(way.u)), side="right") - 1
    square = np.minimum(way.square, speeds[np.minimum(leg, len(speeds) - 1)] ** 2)
    square[way.waypoint_index[1:-1]] = np.minimum(
        square[way.waypoint_index[1:-1]], speeds[:-1] ** 2
    )
    rests = np.concatenate([[0], way.waypoint_index[waits > 0.0], [len(square) - 1]])
    square[rests] = 0.0
    rise = 2.0 * p.acceleration_limit * way.s
    square = np.minimum.accumulate(square - rise) + rise
    fall = 2.0 * p.braking_limit * (way.s[-1] - way.s)
    square = np.minimum.accumulate((square - fall)[::-1])[::-1] + fall
    square = np.maximum(square, 0.0)
    square[rests] = 0.0
    return square


def _durations(way: _Way, square: Array) -> Array:
    """Return the time (n - 1,) of each step at constant acceleration."""
    speed = np.sqrt(square)
    return 2.0 * np.diff(way.s) / np.maximum(speed[:-1] + speed[1:], 1e-9)


def _controls(way: _Way, square: Array, waits: Array, step: float) -> tuple[Array, Array]:
    """Return times (c,), from two steps before 0, and u of the schedule there.

    A smoothed schedule moves three steps before and after: it waits so much longer.
    """
    margin = _KERNEL * step
    rest = np.zeros(len(way.u))
    rest[way.waypoint_index] = np.where(waits > 0.0, waits + 2.0 * margin, 0.0)
    rest[[0, -1]] = 0.0
    durations = _durations(way, square)
    arrival = margin + np.concatenate([[0.0], np.cumsum(durations + rest[:-1])])
    end = float(arrival[-1]) + margin
    _check_steps(end / step, np.diff(arrival[way.waypoint_index]))
    count = math.ceil(end / step - _ROUNDING) + DEGREE
    t: Array = (np.arange(count, dtype=np.float64) - 2.0) * step
    return t, _piecewise_schedule(way, square, arrival, arrival + rest, t)


def _check_steps(count: float, legs: Array) -> None:
    """Refuse a drive of too many steps, with the leg (of w - 1, [s]) that takes longest."""
    if count > _MOST_STEPS:
        k = int(np.argmax(legs))
        raise ConfigurationError(
            f"the drive takes {legs.sum():.3g} s, of which {legs[k]:.3g} s are from waypoint "
            f"{k + 1} to {k + 2}: too long for its smoothing_time, which would have to be "
            f"{count / _MOST_STEPS:.3g} times as long"
        )


def _piecewise_schedule(
    way: _Way, square: Array, arrival: Array, departure: Array, t: Array
) -> Array:
    """Return u (m,) of the schedule: constant acceleration from place to place.

    :param way: n places along the path.
    :param square: (n,) squares of the speeds there [m^2/s^2].
    :param arrival, departure: (n,) times at which the vehicle reaches and leaves them [s].
    :param t: (m,) times [s].
    """
    from scipy.interpolate import CubicHermiteSpline

    row = np.clip(np.searchsorted(departure, t, side="right") - 1, 0, len(way.u) - 2)
    passed = np.clip(t - departure[row], 0.0, arrival[row + 1] - departure[row])
    acceleration = np.diff(square) / (2.0 * np.diff(way.s))
    s = way.s[row] + passed * (np.sqrt(square[row]) + 0.5 * passed * acceleration[row])
    s = np.clip(s, way.s[row], way.s[row + 1])
    return CubicHermiteSpline(way.s, way.u, way.slope)(s)


def _fit_times(path: Path, p: DriveParameters, visits: Visits, prefix: str) -> UniformSpline:
    """Return a schedule that keeps given times, with even speeds as far as limits allow.

    The speed allowed on each leg is raised or lowered until the leg takes the time that it has.

    :param visits: times at which the vehicle arrives at waypoints and departs from them [s].
    :param prefix: start of the names of its parameters, for messages.
    :raises ConfigurationError: for a waypoint that cannot be reached in time.
    """
    end = float(visits.arrivals[-1])
    _check_steps(end * 2.0 * _KERNEL / p.smoothing_time, np.diff(visits.arrivals))
    way = _way(path, p)
    step = end / math.ceil(end * 2.0 * _KERNEL / p.smoothing_time)
    waits = visits.departures - visits.arrivals
    rests = waits > 0.0
    rests[[0, -1]] = True
    # Smoothing spreads a rest's control points: motion is scheduled a margin away from each rest.
    margin = np.where(rests, _KERNEL * step, 0.0)
    needed = visits.arrivals[1:] - margin[1:] - visits.departures[:-1] - margin[:-1]
    lengths = np.diff(way.s[way.waypoint_index])
    speeds = lengths / np.maximum(needed, 1e-3)
    for _ in range(_ROUNDS):
        square = _limit_speeds(way, p, speeds, waits)
        durations = np.add.reduceat(_durations(way, square), way.waypoint_index[:-1])
        if np.abs(durations - needed).max() < _TIMES_MET:
            break
        speeds = speeds * np.clip(durations / np.maximum(needed, 1e-3), 0.5, 2.0)
        speeds = np.minimum(speeds, _FASTEST)
    late = durations - needed
    problems = [
        f"{prefix}times: waypoint {k + 2} at {visits.arrivals[k + 1]:g} s: cannot be reached from "
        f"waypoint {k + 1} before {visits.arrivals[k + 1] + late[k]:.2f} s within the limits"
        for k in np.flatnonzero(late > _LATE)
    ]
    if problems:
        raise ConfigurationError(problems)
    t, controls = _controls(way, square, np.where(rests, waits, 0.0), step)
    schedule = _keep_visits(path, visits, rests, t, controls)
    _check_limits(path, schedule, p, visits, prefix)
    return schedule


def _keep_visits(
    path: Path, visits: Visits, rests: Mask, t: Array, controls: Array
) -> UniformSpline:
    """Return the smoothed schedule, corrected so that it keeps the times of the visits.

    Smoothing shifts u at the visits a little. The control points are shifted back by a monotone
    interpolation of these errors, in a few rounds.

    :param rests: (visits,) True where the vehicle rests.
    :param t: (c,) times of the control points [s], evenly spaced.
    :param controls: (c,) control points of the smoothed schedule.
    """
    from scipy.interpolate import PchipInterpolator

    step = float(t[1] - t[0])
    # It must stay at rest as long as control points of a rest act.
    # Smoothing spreads a rest's control points: motion is scheduled a margin away from each rest.
    margin = np.where(rests, _KERNEL * step, 0.0)
    times = np.concatenate(
        [visits.arrivals - margin, visits.arrivals, visits.departures, visits.departures + margin]
    )
    times, first_rows = np.unique(np.clip(times, 0.0, visits.arrivals[-1]), return_index=True)
    waypoint = first_rows % len(path.waypoint_u)
    for _ in range(_ROUNDS):
        schedule = UniformSpline(controls[:, None], step)
        error = (path.waypoint_u - schedule.sample(visits.arrivals, 0)[0][0])[waypoint]
        if np.abs(error).max() < _EXACT:
            break
        controls = controls + PchipInterpolator(times, error)(np.clip(t, times[0], times[-1]))
    return schedule


def _check_limits(
    path: Path, schedule: UniformSpline, p: DriveParameters, visits: Visits, prefix: str
) -> None:
    """Refuse a schedule that exceeds a limit, or that goes back.

    :param schedule: u [m] along the path as a function of time [s].
    :param prefix: start of the names of its parameters, for messages.
    :raises ConfigurationError: with a line for each limit, and the leg where it is exceeded most.
    """
    t = _fine_grid(schedule)
    done = planar_motion(path, schedule, t)
    shares = _shares(done, p)
    values = (done.speed, done.along, done.across, done.turn)
    names = (
        ("speed_limit", "m/s"),
        ("braking_limit or acceleration_limit", "m/s^2"),
        ("lateral_limit", "m/s^2"),
        ("heading_rate_limit", "rad/s"),
    )
    problems = []
    for share, value, (name, unit) in zip(shares, values, names, strict=True):
        worst = int(np.argmax(share))
        leg = int(np.clip(np.searchsorted(visits.arrivals, t[worst]), 1, len(path.waypoint_u) - 1))
        if share[worst] > 1.0 + _OVER:
            problems.append(
                f"{prefix}times: from waypoint {leg} to {leg + 1}: {abs(value[worst]):.3g} {unit} "
                f"would be needed, above {prefix}{name}"
            )
    if not problems and done.speed.min() < -1e-6:
        leg = int(np.clip(np.searchsorted(visits.arrivals, t[np.argmin(done.speed)]), 1, None))
        problems.append(
            f"{prefix}times: near waypoint {leg}: speeds differ so much between its legs that "
            "the vehicle would have to go back"
        )
    if problems:
        raise ConfigurationError(problems)
