# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""A smooth path through waypoints: a C4 spline of degree 5, at rest at both ends."""

from typing import Any, Final

import numpy as np

from imu_sim_ros.config import WaypointsParameters
from imu_sim_ros.trajectory.euler import attitude
from imu_sim_ros.trajectory.motion import Array, Motion
from imu_sim_ros.trajectory.profile import Derivatives

_DEGREE: Final = 5
_PEAK_SAMPLES: Final = 200  # per way between two waypoints; a peak is missed by less than 1e-4


class Waypoints:
    """Positions and headings interpolated over time; roll and pitch are 0.

    Velocity, acceleration and their angular counterparts vanish at both ends. Without given times
    each leg lasts as long as its speed or turn at the limits would take; then all are stretched
    alike until the peaks of speed, acceleration and turn rate are within their limits.
    """

    def __init__(self, parameters: WaypointsParameters) -> None:
        places = np.array(parameters.positions).reshape(-1, 3)
        headings = np.array(parameters.headings or (0.0,) * len(places))
        coordinates = np.column_stack([places, headings])
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
    places = np.arange(0.0, len(times) - 1.0, 1.0 / _PEAK_SAMPLES)
    dense = np.interp(places, np.arange(len(times)), times)
    _, first, second = (spline(dense) for spline in _splines(times, coordinates))
    speed = np.max(np.linalg.norm(first[:, :3], axis=-1)) / parameters.speed_limit
    force = np.max(np.linalg.norm(second[:, :3], axis=-1)) / parameters.acceleration_limit
    rate = np.max(np.abs(first[:, 3])) / parameters.heading_rate_limit
    # Slower by a factor k: speeds fall with k, accelerations with k^2, and the shape stays.
    result: Array = times * max(speed, np.sqrt(force), rate)
    return result
