# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""The definitions of the message types that this package writes, of ROS 1 and of ROS 2.

Texts and digests stand here because reading those of all of ROS takes rosbags 0.1 s. Imports
nothing.
"""

from imu_sim_ros.bags.messages.definitions.ros1 import MD5_SUMS, full_text
from imu_sim_ros.bags.messages.definitions.ros2 import RIHS01, joined_text

__all__ = ["MD5_SUMS", "RIHS01", "full_text", "joined_text"]
