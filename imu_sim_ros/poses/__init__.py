# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Poses over time, and their form as text. Imports the other leaves."""

from imu_sim_ros.poses.read import read_poses
from imu_sim_ros.poses.sequence import PoseSequence
from imu_sim_ros.poses.write import write_tum

__all__ = ["PoseSequence", "read_poses", "write_tum"]
