# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""New bags of any container, by name and options."""

from pathlib import Path

from imu_sim_ros.bags.mcap_writer import McapWriter
from imu_sim_ros.bags.outputs import refuse_existing
from imu_sim_ros.bags.split import PartsWriter, Rosbag2Writer
from imu_sim_ros.bags.writer import AS_NAMED, BagOptions, Writer, check_writer


def open_writer(path: str | Path, options: BagOptions = AS_NAMED) -> Writer:
    """Open a bag that does not exist yet.

    ``NAME.bag`` is a ROS 1 bag, ``NAME.mcap`` one MCAP file, any other name a rosbag2 folder. While
    a single file is written its name ends in ``.active``; a folder gets its metadata.yaml last.
    When single files are split they are named ``NAME_0.bag``, ``NAME_1.bag`` and so on.

    :raises InputError: for a place or an option that cannot be used.
    """
    path = Path(path)
    container, compressed = check_writer(path, options.storage, options.compression)
    single = container == "ros1" or path.suffix == ".mcap"
    split_ns, split_size = round(options.split_duration * 1e9), options.split_size

    def open_file(file: Path) -> Writer:
        if container == "ros1":
            from imu_sim_ros.bags.ros1_writer import Rosbag1Writer

            return Rosbag1Writer(file, compressed)
        if container == "sqlite3":
            from imu_sim_ros.bags.sqlite_writer import SqliteWriter

            return SqliteWriter(file)

        return McapWriter(file, compressed, renamed=single)

    if single:
        if not (split_ns or split_size):
            return open_file(path)
        refuse_existing(path)
        return PartsWriter(
            path,
            lambda k: open_file(path.with_name(f"{path.stem}_{k}{path.suffix}")),
            split_ns,
            split_size,
        )
    return Rosbag2Writer(path, container, open_file, split_ns, split_size)
