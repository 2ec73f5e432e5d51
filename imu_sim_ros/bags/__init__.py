# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Messages and the containers they are stored in: mcap, rosbag2, ROS 1."""
