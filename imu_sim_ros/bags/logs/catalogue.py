# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""All kinds of logs, and the logs that were read last, which stay in memory."""

from functools import lru_cache
from pathlib import Path
from typing import Final

from imu_sim_ros.bags.logs import (
    ardupilot,
    bvh,
    c3d,
    kitti,
    nclt,
    phyphox,
    px4,
    sensor_logger,
    vectornav,
    xsens,
)
from imu_sim_ros.bags.logs.archive import Archive
from imu_sim_ros.bags.logs.log import Contents, LogBag, LogFormat
from imu_sim_ros.bags.reader import Recover
from imu_sim_ros.core.errors import MachineError, Remark, warn
from imu_sim_ros.inputs.rows import open_shared

LOGS: Final[tuple[LogFormat, ...]] = (
    px4,
    ardupilot,
    bvh,
    c3d,
    sensor_logger,
    phyphox,
    kitti,
    nclt,
    xsens,
    vectornav,
)
"""All kinds; the first that recognises a path reads it."""
MAGIC_BYTES: Final = 16
"""First bytes of a file by which its kind is recognised."""
_NEVER_LOGS: Final = frozenset({".tum"})
"""Endings of text files that no kind of log has."""
_LARGE: Final = 256 << 20
"""Size from which on users are told the memory that reading takes [bytes]."""


def open_log(path: Path, magic: bytes, recover: Recover) -> LogBag | None:
    """Return a log as a bag; None: the path is of no known kind.

    :param magic: first bytes of a file; empty for a folder.
    """
    number = _kind(path, magic)
    if number is None:
        return None
    changed_ns, size = _state(path)
    return LogBag(path, _contents(number, path, changed_ns, size), recover)


def is_log(path: Path) -> bool:
    """Return True for a file that a kind of log recognises."""
    return path.suffix.lower() not in _NEVER_LOGS and _is_log(path, *_state(path))


@lru_cache(maxsize=16)
def _is_log(path: Path, changed_ns: int, size: int) -> bool:
    """Return :func:`is_log` of a file in a known state, from a cache if it was asked before.

    :param changed_ns: time of its last change [ns].
    :param size: size [bytes].
    """
    with open_shared(path) as file:
        magic = file.read(MAGIC_BYTES)
    return _kind(path, magic) is not None


def _kind(path: Path, magic: bytes) -> int | None:
    """Return the place in :data:`LOGS` of the kind of a path; None: it is of no known kind."""
    return next((number for number, entry in enumerate(LOGS) if entry.holds(path, magic)), None)


def _state(path: Path) -> tuple[int, int]:
    """Return the time of the last change [ns] and the size [bytes] of a file or a folder."""
    if not path.is_dir():
        state = path.stat()
        return state.st_mtime_ns, state.st_size
    with Archive(path) as files:
        states = [(path / name).stat() for name in files.names]
    return max(state.st_mtime_ns for state in states), sum(state.st_size for state in states)


@lru_cache(maxsize=2)
def _contents(number: int, path: Path, changed_ns: int, size: int) -> Contents:
    """Return the topics of a log in a known state, from a cache if it was parsed before.

    :param number: place in :data:`LOGS`.
    :param changed_ns: time of its last change [ns].
    :param size: size [bytes].
    """
    need = f"up to {size * LOGS[number].MEMORY / 1e6:.0f} MB of memory"
    if size > _LARGE:
        warn(f"{path}: {size / 1e6:.0f} MB, read as a whole, which takes {need}", Remark)
    try:
        return LOGS[number].contents(path)
    except MemoryError:
        raise MachineError(f"{path}: is read as a whole, which takes {need}") from None
