# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""rosbag2 folders: the metadata, and the sqlite3 storage. Imports bags, its messages and mcap."""

from typing import TYPE_CHECKING

from imu_sim_ros.lazy import exported

if TYPE_CHECKING:
    from imu_sim_ros.bags.rosbag2 import metadata as metadata
    from imu_sim_ros.bags.rosbag2.reader import Rosbag2Folder as Rosbag2Folder
    from imu_sim_ros.bags.rosbag2.reader import SqliteBag as SqliteBag
    from imu_sim_ros.bags.rosbag2.sqlite_writer import SqliteWriter as SqliteWriter
else:
    __getattr__, __dir__, __all__ = exported(
        __name__,
        {
            "": ["metadata"],
            "reader": ["Rosbag2Folder", "SqliteBag"],
            "sqlite_writer": ["SqliteWriter"],
        },
    )
