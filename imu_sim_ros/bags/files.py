# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Bags and logs by what their files hold: the reader of each container, and compressed files."""

import os
from contextlib import ExitStack
from pathlib import Path
from typing import BinaryIO, Final

from imu_sim_ros.bags.compressed_files import compression_of, unpack
from imu_sim_ros.bags.logs.catalogue import MAGIC_BYTES, open_log
from imu_sim_ros.bags.mcap_reader import McapBag
from imu_sim_ros.bags.outputs import (
    active_path,
    find_unfinished_output,
    is_being_written,
    is_locked,
)
from imu_sim_ros.bags.reader import Bag, Recover, errors_naming, recovery_advice
from imu_sim_ros.bags.ros1_reader import Rosbag1Bag
from imu_sim_ros.bags.rosbag2_reader import SQLITE, Rosbag2Folder, SqliteBag
from imu_sim_ros.bags.text.writer import TEXT_SUFFIXES
from imu_sim_ros.core.errors import InputError
from imu_sim_ros.core.spelling import job_argument
from imu_sim_ros.inputs.rows import open_regular, open_shared
from imu_sim_ros.inputs.sharing import shared_files

_ROS1: Final = b"#ROSBAG V"
_MCAP: Final = b"\x89MCAP"
_ENDINGS: Final = frozenset({".mcap", ".bag", ".db3"})
"""Endings of the names of bags, which tell the container of one whose first bytes are damaged."""


def open_bag(path: str | Path, recover: Recover = False) -> Bag:
    """Open a ROS 1 bag, an MCAP file, a rosbag2 folder or database, or a log.

    Contents decide, not names.

    A file that is compressed as a whole is unpacked into the folder for temporary files.

    :param recover: read an interrupted or damaged bag as far as it goes, and ``NAME.active`` if
        NAME does not exist; ``"keep_damaged"`` also keeps chunks whose checksum is wrong.
    :raises InputError: for a path that is missing, no bag, or a bag that is not whole.
    """
    files = None if recover else shared_files()
    if files is None:
        return _open_ready(Path(path), recover)
    return files.get(Path(path), _open_ready)


def _open_ready(path: Path, recover: Recover = False) -> Bag:
    """Open a bag, unless a program is writing it."""
    if recover and not path.exists():
        path = find_unfinished_output(path) or path
    if not path.exists():
        active = next(
            filter(is_being_written, (active_path(path), find_unfinished_output(path) or path)),
            None,
        )
        if active is not None:
            raise _unready(path)
    with errors_naming(path, "" if recover else f"; {recovery_advice()}"):
        if path.is_dir():
            is_written = is_being_written(path)
            if is_written and not recover:
                raise _unready(path)
            log = open_log(path, b"", recover)
            bag: Bag = log or Rosbag2Folder(path, _open_file, recover)
        else:
            with _regular(path) as file:
                is_written = is_locked(file.fileno())
                if is_written and not recover:
                    raise _unready(path)
                bag = _open_content(path, file, recover)
    if is_written:
        bag.found.append("it is being written: these are the messages so far")
    return bag


def _unready(path: Path) -> InputError:
    """Return the error of a bag that another program is writing."""
    return InputError(
        f"{path}: another program is writing it; read it when that has ended, or "
        f"{job_argument('convert', 'recover')} takes the messages so far"
    )


def _regular(path: Path) -> BinaryIO:
    """Open a file, and name the unfinished one if there is none."""
    try:
        return open_shared(path)
    except InputError as error:
        rest = find_unfinished_output(path)
        hint = f"; {rest} is an unfinished one, {recovery_advice()}" if rest else ""
        raise InputError(f"{error}{hint}") from None


def _open_file(path: Path, recover: Recover = False) -> Bag:
    """Open a bag that is one file, compressed or not."""
    with open_regular(path) as file:
        return _open_content(path, file, recover)


def _open_content(path: Path, file: BinaryIO, recover: Recover) -> Bag:
    """Return the bag in an open file, compressed or not; other bags than chunked ones open it anew.

    :param file: may be closed when the bag is open.
    """
    magic = file.read(MAGIC_BYTES)
    compression = compression_of(magic)
    if compression is None:
        return _open_plain(path, file, magic, recover)
    file.seek(0)
    with ExitStack() as stack:
        unpacked = unpack(path, file, compression, stack)
        if unpacked.torn and not recover:
            raise InputError(
                f"{path}: its {compression} data are damaged or end early; {recovery_advice()}"
            )
        with open_regular(unpacked.path) as content:
            magic = content.read(MAGIC_BYTES)
            try:
                bag = _open_plain(unpacked.path, content, magic, recover)
            except InputError as error:
                lines = [line.replace(str(unpacked.path), str(path)) for line in error.problems]
                raise InputError(lines) from None
        bag.path = path
        if unpacked.torn:
            bag.found.append(f"its {compression} data are damaged or end early")
        bag.close_with(stack.pop_all())
    return bag


def _open_plain(path: Path, file: BinaryIO, magic: bytes, recover: Recover) -> Bag:
    """Return the bag in an open file that is not compressed.

    :param magic: first bytes of the file.
    """
    if magic.startswith((_ROS1, _MCAP)):
        kind = Rosbag1Bag if magic.startswith(_ROS1) else McapBag
        return kind(path, os.fdopen(os.dup(file.fileno()), "rb"), recover)
    if magic.startswith(SQLITE):
        return SqliteBag(path, recover)
    log = open_log(path, magic, recover)
    if log is not None:
        return log
    endings = _ENDINGS.intersection(path.suffixes)
    if endings and magic:
        if not recover:
            raise InputError(
                f"{path}: not a bag, or its first bytes are damaged; {recovery_advice()}"
            )
        if ".db3" in endings:
            return SqliteBag(path, recover)
        reader = Rosbag1Bag if ".bag" in endings else McapBag
        bag = reader(path, os.fdopen(os.dup(file.fileno()), "rb"), recover)
        if bag.topics:
            return bag
        bag.release()
    no_bag = f"not a bag; the name of a text file ends in one of {', '.join(TEXT_SUFFIXES)}"
    raise InputError(f"{path}: {no_bag if magic else 'an empty file'}")
