# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""The files each consumer wants beside a bag; one file per stack.

Imports the leaves and bags (the files' folders and numbers).
"""

from imu_sim_ros.consumers import imu_noise

__all__ = ["imu_noise"]
