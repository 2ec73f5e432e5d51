# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Opening a bag for writing: one interface for every container."""

from collections.abc import Mapping
from pathlib import Path
from typing import Final

from imu_sim_ros.bags.messages.schemas import Qos
from imu_sim_ros.bags.outputs import refuse_existing
from imu_sim_ros.bags.split import MAX_PARTS, PartsWriter, Rosbag2Writer
from imu_sim_ros.bags.writer import BagTopic, Block, Writer
from imu_sim_ros.errors import InputError
from imu_sim_ros.names import suggestion

__all__ = ["COMPRESSIONS", "STORAGES", "BagTopic", "Block", "Qos", "Writer", "open_writer"]

STORAGES: Final = ("mcap", "sqlite3", "ros1")
COMPRESSIONS: Final[dict[str, tuple[str, ...]]] = {
    "mcap": ("none", "lz4", "zstd"),
    "sqlite3": ("none",),
    "ros1": ("none", "lz4", "bz2"),
}
COMPRESSED: Final = tuple(dict.fromkeys(name for names in COMPRESSIONS.values() for name in names))
"""The compressions of any storage."""


def storage_of(path: Path) -> str:
    """Return the storage that a name implies: ros1 for ``.bag``, else mcap."""
    return "ros1" if path.suffix == ".bag" else "mcap"


def open_writer(
    path: str | Path,
    storage: str | None = None,
    compression: str | None = None,
    split_duration: float = 0.0,
    split_size: int = 0,
) -> Writer:
    """Open a bag that does not exist yet.

    ``NAME.bag`` is a ROS 1 bag, ``NAME.mcap`` one MCAP file, any other name a rosbag2 folder. While
    a single file is written its name ends in ``.active``; a folder gets its metadata.yaml last.
    When single files are split they are named ``NAME_0.bag``, ``NAME_1.bag`` and so on.

    :param storage: mcap, sqlite3 or ros1; by default the one that the name implies.
    :param compression: none, lz4 or zstd for mcap, none, lz4 or bz2 for ros1; default none.
    :param split_duration: length of one file [s]; 0 for a single file.
    :param split_size: bytes after which a new file begins; 0: never.
    :raises InputError: for a place or an option that cannot be used.
    """
    path = Path(path)
    check_writer(path, storage, compression)
    storage, compression = storage or storage_of(path), compression or "none"
    split_ns = round(split_duration * 1e9)

    def open_file(file: Path) -> Writer:
        single = path.suffix in (".mcap", ".bag") or storage == "ros1"
        if storage == "ros1":
            from imu_sim_ros.bags.ros1_writer import Rosbag1Writer

            return Rosbag1Writer(file, compression)
        if storage == "sqlite3":
            from imu_sim_ros.bags.sqlite_writer import SqliteWriter

            return SqliteWriter(file)
        from imu_sim_ros.bags.mcap_writer import McapWriter

        return McapWriter(file, compression, renamed=single)

    if storage == "ros1" or path.suffix == ".mcap":
        if not (split_ns or split_size):
            return open_file(path)
        refuse_existing(path)
        return PartsWriter(
            path,
            lambda k: open_file(path.with_name(f"{path.stem}_{k}{path.suffix}")),
            split_ns,
            split_size,
        )
    return Rosbag2Writer(path, storage, open_file, split_ns, split_size)


def check_writer(path: Path, storage: str | None, compression: str | None) -> None:
    """Check the options of a bag.

    :raises InputError: for a name, a storage and a compression that contradict each other.
    """
    storage, compression = storage or storage_of(path), compression or "none"
    if storage not in STORAGES:
        raise InputError(f"storage {storage!r}: {suggestion(storage, STORAGES)}")
    if compression not in COMPRESSIONS[storage]:
        raise InputError(
            f"compression {compression!r}: {storage} takes {', '.join(COMPRESSIONS[storage])}"
        )
    if path.suffix == ".mcap" and storage != "mcap":
        raise InputError(f"{path}: a .mcap file has the storage mcap, not {storage}")
    if path.suffix == ".bag" and storage != "ros1":
        raise InputError(f"{path}: a .bag file is a ROS 1 bag; give {storage} a folder's name")


DATASET_SUFFIXES: Final = {".csv": "csv", ".tum": "tum", ".txt": "tum"}


def dataset_form(path: Path, named: str | None, of_bags: Mapping[str, object]) -> str | None:
    """Return the form of the dataset that a name or a suffix implies; None for a bag.

    :param of_bags: arguments of :func:`open_writer`.
    :raises InputError: for options of bags with a dataset.
    """
    result = named or DATASET_SUFFIXES.get(path.suffix.lower())
    unfit = [
        f"--{name.replace('_', '-')}: does not apply to {result}"
        for name in of_bags
        if result and of_bags[name]
    ]
    if unfit:
        raise InputError(unfit)
    return result


def check_split(split_duration: float, period: float, duration: float) -> None:
    """Refuse parts that are shorter than the time between two messages, or very many.

    :param split_duration: of one part [s]; 0: no parts.
    :param period: between two messages [s].
    :param duration: of all [s].
    :raises InputError: with what is allowed.
    """
    shortest = max(period, duration / MAX_PARTS)
    if 0.0 < split_duration < shortest:
        raise InputError(
            f"--split-duration {split_duration:g}s: must be at least {shortest:g} s, which gives "
            f"every message a part of its own, or {MAX_PARTS} parts"
        )
