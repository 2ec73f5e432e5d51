# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""From parameters to a trajectory."""

from collections.abc import Callable
from pathlib import Path
from typing import TypeAlias, cast

from imu_sim_ros.config import (
    FreeFallParameters,
    HarmonicParameters,
    PolarParameters,
    PosesParameters,
    SixPositionParameters,
    StaticParameters,
    TrajectoryParameters,
    TurntableParameters,
    WaypointsParameters,
)
from imu_sim_ros.errors import ConfigurationError
from imu_sim_ros.poses import PoseSequence, read_poses
from imu_sim_ros.trajectory.motion import Trajectory
from imu_sim_ros.trajectory.retime import retimed

PoseReader: TypeAlias = Callable[..., PoseSequence]
"""Reads the poses of a file; called with the path, and the topic where one is given."""


def build_trajectory(
    parameters: TrajectoryParameters, pose_reader: PoseReader = read_poses
) -> Trajectory:
    """Return the trajectory that the parameters describe.

    :param parameters: the section ``trajectory`` of a simulation.
    :param pose_reader: reads a file of poses; the default reads text files only.
    :raises ConfigurationError: for parameters that do not describe a motion.
    :raises InputError: for a file of poses that cannot be used.
    """
    trajectory = retimed(_motion(parameters, pose_reader), parameters)
    if parameters.lead_in.rest > 0.0:
        from imu_sim_ros.trajectory.lead_in import LeadIn

        trajectory = LeadIn(trajectory, parameters.lead_in)
    v = parameters.vibration
    if any(v.acceleration + v.noise_rms + v.angular_rate + v.angular_noise_rms):
        from imu_sim_ros.trajectory.kinds import Vibrating, Vibration

        return Vibrating(trajectory, Vibration(v))
    return trajectory


def _motion(parameters: TrajectoryParameters, pose_reader: PoseReader) -> Trajectory:
    """Return the bare motion; each kind is imported on demand, some with SciPy."""
    match parameters:
        case StaticParameters():
            from imu_sim_ros.trajectory.kinds import Static

            return Static.from_parameters(parameters)
        case HarmonicParameters():
            from imu_sim_ros.trajectory.kinds import Harmonic

            return Harmonic(parameters)
        case PolarParameters():
            from imu_sim_ros.trajectory.kinds import Polar

            return Polar(parameters)
        case FreeFallParameters():
            from imu_sim_ros.trajectory.kinds import FreeFall

            return FreeFall(parameters)
        case WaypointsParameters():
            from imu_sim_ros.trajectory.kinds import Waypoints

            return Waypoints(parameters)
        case TurntableParameters():
            from imu_sim_ros.trajectory.kinds import turntable

            return turntable(parameters)
        case SixPositionParameters():
            from imu_sim_ros.trajectory.kinds import six_position

            return six_position(parameters)
        case PosesParameters():
            from imu_sim_ros.trajectory.splines import Recorded

            topic = (parameters.topic,) if parameters.topic else ()
            return Recorded(pose_reader(Path(parameters.file), *topic), parameters)
    return _own_motion(parameters)


def _own_motion(parameters: TrajectoryParameters) -> Trajectory:
    """Return a user's own trajectory: parameters that know how to ``sample`` themselves."""
    if not (hasattr(parameters, "sample") and hasattr(parameters, "duration")):
        raise ConfigurationError(
            f"trajectory.type = {parameters.type!r}: {type(parameters).__name__} lacks "
            "duration or sample(t)"
        )
    return cast(Trajectory, parameters)
