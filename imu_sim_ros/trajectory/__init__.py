# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Where the body is: position, attitude and their derivatives at any time."""

from imu_sim_ros.trajectory.build import PoseReader, build_trajectory
from imu_sim_ros.trajectory.motion import Motion, Trajectory

__all__ = ["Motion", "PoseReader", "Trajectory", "build_trajectory"]
