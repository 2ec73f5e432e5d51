# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Messages as bytes, bytes in files: encode, write, read, convert.

``messages/`` holds the messages' bytes; ``mcap/``, ``ros1/``, ``rosbag2/`` and ``text/`` one format
each; on top are the reader and writer of any format. The only room that imports rosbags and mcap;
it imports the leaves. Its exports are imported when they are first used.
"""

from typing import TYPE_CHECKING

from imu_sim_ros.lazy import exported

if TYPE_CHECKING:
    from imu_sim_ros.bags import beside as beside
    from imu_sim_ros.bags import convert as convert
    from imu_sim_ros.bags.beside import Beside as Beside
    from imu_sim_ros.bags.beside import read_beside as read_beside
    from imu_sim_ros.bags.beside import read_magnetic_field as read_magnetic_field
    from imu_sim_ros.bags.output_file import OutputFile as OutputFile
    from imu_sim_ros.bags.output_file import active_path as active_path
    from imu_sim_ros.bags.output_file import make_folder as make_folder
    from imu_sim_ros.bags.outputs import Outputs as Outputs
    from imu_sim_ros.bags.read import ImuMessages as ImuMessages
    from imu_sim_ros.bags.read import OdometryMessages as OdometryMessages
    from imu_sim_ros.bags.read import decoded_messages as decoded_messages
    from imu_sim_ros.bags.read import imu_blocks as imu_blocks
    from imu_sim_ros.bags.read import odometry_blocks as odometry_blocks
    from imu_sim_ros.bags.read import open_bag as open_bag
    from imu_sim_ros.bags.read import read_imu as read_imu
    from imu_sim_ros.bags.read import read_odometry as read_odometry
    from imu_sim_ros.bags.read import read_poses as read_poses
    from imu_sim_ros.bags.read import read_temperature as read_temperature
    from imu_sim_ros.bags.read import vector_blocks as vector_blocks
    from imu_sim_ros.bags.reader import Bag as Bag
    from imu_sim_ros.bags.reader import told as told
    from imu_sim_ros.bags.split import MAX_PARTS as MAX_PARTS
    from imu_sim_ros.bags.threads import ahead as ahead
    from imu_sim_ros.bags.write import COMPRESSIONS as COMPRESSIONS
    from imu_sim_ros.bags.write import STORAGES as STORAGES
    from imu_sim_ros.bags.write import check_writer as check_writer
    from imu_sim_ros.bags.write import open_writer as open_writer
    from imu_sim_ros.bags.writer import Block as Block
    from imu_sim_ros.bags.writer import Topic as Topic
    from imu_sim_ros.bags.writer import Writer as Writer
    from imu_sim_ros.bags.writer import amount as amount
    from imu_sim_ros.bags.writer import described as described
else:
    __getattr__, __dir__, __all__ = exported(
        __name__,
        {
            "": ["beside", "convert"],
            "output_file": ["OutputFile", "active_path", "make_folder"],
            "beside": ["Beside", "read_beside", "read_magnetic_field"],
            "outputs": ["Outputs"],
            "read": [
                "vector_blocks",
                "ImuMessages",
                "OdometryMessages",
                "decoded_messages",
                "imu_blocks",
                "odometry_blocks",
                "open_bag",
                "read_imu",
                "read_odometry",
                "read_poses",
                "read_temperature",
            ],
            "reader": ["told", "Bag"],
            "split": ["MAX_PARTS"],
            "threads": ["ahead"],
            "write": ["COMPRESSIONS", "STORAGES", "check_writer", "open_writer"],
            "writer": ["Block", "Topic", "Writer", "amount", "described"],
        },
    )
