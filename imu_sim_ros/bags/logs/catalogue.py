# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""All kinds of logs, and the memory that the last ones take."""

from functools import lru_cache
from pathlib import Path
from typing import Final

from imu_sim_ros.bags.logs import ardupilot, bvh, c3d, px4
from imu_sim_ros.bags.logs.log import Contents, LogBag, LogFormat
from imu_sim_ros.bags.reader import Recover
from imu_sim_ros.core.errors import MachineError, Remark, warn

LOGS: Final[tuple[LogFormat, ...]] = (px4, ardupilot, bvh, c3d)
"""All kinds; the first that recognises a path reads it."""
_LARGE: Final = 256 << 20
"""Size from which on the memory is told [bytes]."""


def open_log(path: Path, magic: bytes, recover: Recover) -> LogBag | None:
    """Return a log as a bag; None: the path is of no known kind.

    :param magic: first bytes of a file; empty for a folder.
    """
    for number, entry in enumerate(LOGS):
        if entry.holds(path, magic):
            state = path.stat()
            return LogBag(path, _contents(number, path, state.st_mtime_ns, state.st_size), recover)
    return None


@lru_cache(maxsize=2)
def _contents(number: int, path: Path, changed_ns: int, size: int) -> Contents:
    """Return the topics of a log; a program that opens it several times parses it once.

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
