# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""rosbag2 folders: the metadata, and the sqlite3 storage. Imports bags, its messages and mcap."""

from imu_sim_ros.bags.rosbag2 import metadata
from imu_sim_ros.bags.rosbag2.reader import Rosbag2Folder, SqliteBag
from imu_sim_ros.bags.rosbag2.sqlite_writer import SqliteWriter

__all__ = ["Rosbag2Folder", "SqliteBag", "SqliteWriter", "metadata"]
