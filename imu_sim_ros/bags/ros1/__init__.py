# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""ROS 1 bags (format 2.0), read and written. Imports bags and its messages."""

from typing import TYPE_CHECKING

from imu_sim_ros.lazy import exported

if TYPE_CHECKING:
    from imu_sim_ros.bags.ros1.reader import Rosbag1Bag as Rosbag1Bag
    from imu_sim_ros.bags.ros1.writer import Rosbag1Writer as Rosbag1Writer
else:
    __getattr__, __dir__, __all__ = exported(
        __name__,
        {
            "reader": ["Rosbag1Bag"],
            "writer": ["Rosbag1Writer"],
        },
    )
