"""From parameters to a trajectory."""

from collections.abc import Callable
from pathlib import Path
from typing import TypeAlias

from imu_sim_ros.config.trajectory import (
    HarmonicParameters,
    StaticParameters,
    TrajectoryParameters,
)
from imu_sim_ros.errors import ConfigurationError
from imu_sim_ros.poses import PoseSequence, read_poses
from imu_sim_ros.trajectory.motion import Trajectory

PoseReader: TypeAlias = Callable[[Path, "str | None"], PoseSequence]
"""Reads the poses of a file, and of a topic where the file is a bag."""


def build_trajectory(
    parameters: TrajectoryParameters, pose_reader: PoseReader = read_poses
) -> Trajectory:
    """Return the trajectory that the parameters describe.

    :param parameters: the section ``trajectory`` of a simulation.
    :param pose_reader: how a file of poses is read; the default knows text files only.
    :raises ConfigurationError: for parameters that make no motion.
    :raises InputError: for a file of poses that cannot be used.
    """
    if isinstance(parameters, StaticParameters):
        from imu_sim_ros.trajectory.static import Static

        return Static.from_parameters(parameters)
    if isinstance(parameters, HarmonicParameters):
        from imu_sim_ros.trajectory.harmonic import Harmonic

        return Harmonic(parameters)
    raise ConfigurationError(f"trajectory.type = {parameters.type!r}: no such motion")
