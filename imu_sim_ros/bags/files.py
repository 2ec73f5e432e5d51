# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Bags and logs by what their files hold: the reader of each container, and compressed files."""

from contextlib import ExitStack
from pathlib import Path
from typing import Final

from imu_sim_ros.bags.compressed_files import compression_of, unpack
from imu_sim_ros.bags.logs.catalogue import MAGIC_BYTES, open_log
from imu_sim_ros.bags.mcap_reader import McapBag
from imu_sim_ros.bags.outputs import active_path, is_being_written, unfinished
from imu_sim_ros.bags.reader import Bag, Recover, errors_naming
from imu_sim_ros.bags.ros1_reader import Rosbag1Bag
from imu_sim_ros.bags.rosbag2_reader import Rosbag2Folder, SqliteBag
from imu_sim_ros.bags.text.writer import DATASET_SUFFIXES
from imu_sim_ros.core.errors import InputError
from imu_sim_ros.inputs.rows import open_regular

_ADVICE: Final = "convert_bag --recover recovers the complete messages"


def open_bag(path: str | Path, recover: Recover = False) -> Bag:
    """Open a ROS 1 bag, an MCAP file, a rosbag2 folder or database, or a log.

    Contents decide, not names.

    A file that is compressed as a whole is unpacked into the folder for temporary files.

    :param recover: read an interrupted or damaged bag as far as it goes; ``NAME.active`` is looked
        if NAME does not exist; ``"keep_damaged"`` also keeps chunks whose checksum is wrong.
    :raises InputError: for a path that is missing, no bag, or a bag that is not whole.
    """
    path = Path(path)
    if recover and not path.exists():
        path = unfinished(path) or path
    if not path.exists():
        active = next(filter(is_being_written, (active_path(path), unfinished(path) or path)), None)
        if active is not None:
            raise _unready(path)
    elif is_being_written(path):
        if not recover:
            raise _unready(path)
        bag = _open(path, recover)
        bag.found.append("it is being written: these are the messages so far")
        return bag
    return _open(path, recover)


def _unready(path: Path) -> InputError:
    return InputError(
        f"{path}: another program is writing it; read it when that has ended, or "
        "convert_bag --recover takes the messages so far"
    )


def _open(path: Path, recover: Recover) -> Bag:
    """Open a file or folder that nobody writes, or as much as there is of it in recovery."""
    with errors_naming(path, "" if recover else f"; {_ADVICE}"):
        if path.is_dir():
            return open_log(path, b"", recover) or Rosbag2Folder(path, _open_file, recover)
        try:
            open_regular(path).close()
        except InputError as error:
            rest = unfinished(path)
            hint = f"; {rest} is an unfinished one, {_ADVICE}" if rest else ""
            raise InputError(f"{error}{hint}") from None
        return _open_file(path, recover)


def _open_file(path: Path, recover: Recover = False) -> Bag:
    """Open a bag that is one file, compressed or not."""
    with open_regular(path) as file:
        magic = file.read(MAGIC_BYTES)
    compression = compression_of(magic)
    if compression is None:
        return _open_plain(path, magic, recover)
    with ExitStack() as stack:
        unpacked = unpack(path, compression, stack)
        if unpacked.torn and not recover:
            raise InputError(f"{path}: its {compression} data are damaged or end early; {_ADVICE}")
        with open_regular(unpacked.path) as file:
            magic = file.read(MAGIC_BYTES)
        try:
            bag = _open_plain(unpacked.path, magic, recover)
        except InputError as error:
            lines = [line.replace(str(unpacked.path), str(path)) for line in error.problems]
            raise InputError(lines) from None
        bag.path = path
        if unpacked.torn:
            bag.found.append(f"its {compression} data are damaged or end early")
        bag.close_with(stack.pop_all())
    return bag


def _open_plain(path: Path, magic: bytes, recover: Recover) -> Bag:
    """Open a bag that is one file, not compressed.

    :param magic: first bytes of the file.
    """
    if magic.startswith(b"#ROSBAG V"):
        return Rosbag1Bag(path, recover)
    if magic.startswith(b"\x89MCAP"):
        return McapBag(path, recover)
    if magic.startswith(b"SQLite format 3\0"):
        return SqliteBag(path, recover)
    log = open_log(path, magic, recover)
    if log is not None:
        return log
    no_bag = f"not a bag; the name of a text file ends in {' or '.join(DATASET_SUFFIXES)}"
    raise InputError(f"{path}: {no_bag if magic else 'an empty file'}")
