# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""The flight through a place, as waypoints and as a trajectory."""

from collections.abc import Callable

import numpy as np

from imu_sim_ros.core.types import Array
from imu_sim_ros.parameters import files
from imu_sim_ros.parameters.kinds import Value
from imu_sim_ros.places.catalogue import build, usual
from imu_sim_ros.places.place import Site
from imu_sim_ros.places.tour import WaypointList
from imu_sim_ros.places.tour import tour as planned
from imu_sim_ros.trajectory.kinds import Waypoints
from imu_sim_ros.trajectory.parameters import TourParameters, WaypointsParameters


def tour(parameters: TourParameters) -> Waypoints:
    """Return the flight.

    :raises ConfigurationError: for a place without a way through it.
    """
    return Waypoints(waypoints(parameters))


def waypoints(parameters: TourParameters) -> WaypointsParameters:
    """Return the flight as a list of waypoints: the parameters of ``trajectory.type: waypoints``.

    :raises ConfigurationError: for a place without a way through it.

    >>> from imu_sim_ros.trajectory.parameters import TourParameters
    >>> flight = waypoints(TourParameters(place="corridor", place_size=(14.0, 2.4, 2.6)))
    >>> len(flight.positions) == 3 * len(flight.headings)
    True
    """
    low, high = usual(parameters.place, parameters.place_size)
    site = Site(low, high, np.zeros((0, 3)), parameters.place_seed)
    best = planned(
        build(parameters.place, site),
        lambda waypoint_list: _flight_positions(_motion_along(waypoint_list, parameters)),
    )
    return _motion_along(best, parameters)


def waypoint_parameters(parameters: TourParameters) -> dict[str, Value]:
    """Return the flight as parameters by dotted name, for a parameter file.

    :raises ConfigurationError: for a place without a way through it.

    >>> from imu_sim_ros.trajectory.parameters import TourParameters
    >>> small = TourParameters(place="corridor", place_size=(14.0, 2.4, 2.6))
    >>> sorted(waypoint_parameters(small))[-2:]
    ['trajectory.speed_limit', 'trajectory.type']
    """
    waypoint_set = waypoints(parameters)
    return {
        "trajectory.type": waypoint_set.type,
        "trajectory.positions": waypoint_set.positions,
        "trajectory.headings": tuple(heading + 0.0 for heading in waypoint_set.headings),  # no -0.0
        "trajectory.speed_limit": waypoint_set.speed_limit,
        "trajectory.acceleration_limit": waypoint_set.acceleration_limit,
        "trajectory.heading_rate_limit": waypoint_set.heading_rate_limit,
    }


def waypoints_file(parameters: TourParameters) -> str:
    """Return the flight as the text of a parameter file, with the scene that cameras see.

    :raises ConfigurationError: for a place without a way through it.
    """
    low, high = usual(parameters.place, parameters.place_size)
    size, center = (
        "[" + ",".join(f"{value:g}" for value in values) + "]"
        for values in (high - low, 0.5 * (low + high))
    )
    comment = (
        f"The waypoints of a tour through a place; cameras see it with\n"
        f"--scene {parameters.place} --set scene.seed={parameters.place_seed} "
        f"--set scene.size={size} --set scene.center={center}"
    )
    return files.text(waypoint_parameters(parameters), comment=comment)


def _motion_along(waypoint_list: WaypointList, parameters: TourParameters) -> WaypointsParameters:
    """Return the parameters of a motion along waypoints."""
    return WaypointsParameters(
        positions=tuple(waypoint_list.positions.ravel().tolist()),
        headings=tuple(waypoint_list.headings.tolist()),
        speed_limit=parameters.speed_limit,
        acceleration_limit=parameters.acceleration_limit,
        heading_rate_limit=parameters.heading_rate_limit,
    )


def _flight_positions(parameters: WaypointsParameters) -> Callable[[int], Array]:
    """Return the function that gives positions along a flight."""
    flight = Waypoints(parameters)
    return lambda count: flight.sample(np.linspace(0.0, flight.duration, count)).position
