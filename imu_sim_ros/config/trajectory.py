# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Parameters of trajectories: :mod:`imu_sim_ros.trajectory.parameters`."""

from imu_sim_ros.trajectory.parameters import *  # noqa: F403
