# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""rosbag2 folders: the metadata, and the sqlite3 storage."""
