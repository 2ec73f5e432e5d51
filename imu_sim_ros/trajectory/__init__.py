# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Where the body is: position, velocity, attitude, rates and their derivatives at any time.

One file per kind of trajectory; :func:`build_trajectory` builds the one the parameters name.
Imports the leaves: conventions, errors, rotation, timebase, config, poses.
"""

from imu_sim_ros.trajectory.build import PoseReader, build_trajectory
from imu_sim_ros.trajectory.motion import Felt, Motion, Trajectory, felt, highest_frequency
from imu_sim_ros.trajectory.plausible import implausible
from imu_sim_ros.trajectory.remembered import RememberedTrajectory
from imu_sim_ros.trajectory.splines import fit_report, recorded_in

__all__ = [
    "Felt",
    "Motion",
    "PoseReader",
    "RememberedTrajectory",
    "Trajectory",
    "build_trajectory",
    "felt",
    "fit_report",
    "highest_frequency",
    "implausible",
    "recorded_in",
]
