# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""ROS 1 bags (format 2.0), read and written. Imports bags and its messages."""

from imu_sim_ros.bags.ros1.reader import Rosbag1Bag
from imu_sim_ros.bags.ros1.writer import Rosbag1Writer

__all__ = ["Rosbag1Bag", "Rosbag1Writer"]
