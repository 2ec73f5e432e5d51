# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Motions of a body: position and attitude at any time, and their parameters.

A trajectory of another package needs the two names exported here.
"""

from imu_sim_ros.trajectory.motion import Motion
from imu_sim_ros.trajectory.parameters import TrajectoryParameters

__all__ = ["Motion", "TrajectoryParameters"]
