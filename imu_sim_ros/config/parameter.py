# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Fields of a section of parameters: :mod:`imu_sim_ros.parameters.kinds`."""

from imu_sim_ros.parameters.kinds import *  # noqa: F403
