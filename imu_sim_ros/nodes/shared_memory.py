# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Shared memory of Fast DDS that a killed process left half-initialised.

Fast DDS opens the segment of a port by ``boost::interprocess::managed_open_or_create`` (in
``SharedMemGlobal::open_port_internal``; seen in 2.14): its creator writes 2 into its first word
when it is ready, and whoever opens it waits for that, without limit. A process that is killed in
between leaves a file that makes every later participant of that domain hang while it starts.
"""

import time
from contextlib import suppress
from pathlib import Path
from typing import Final

FOLDER: Final = Path("/dev/shm")
_READY: Final = (2).to_bytes(4, "little")
_LONGEST_CREATION: Final = 1.0
"""A segment that is not ready after this time never will be; it takes microseconds [s]."""


def remove_torn_segments(folder: Path = FOLDER) -> list[Path]:
    """Remove the segments of ports that were never finished.

    :param folder: folder of shared memory.
    :returns: those that cannot be removed because they belong to another user.
    """
    left: list[Path] = []
    for path in folder.glob("fastrtps_port*"):
        if path.name.endswith("_el") or not _torn(path):
            continue
        try:
            path.unlink()
        except FileNotFoundError:
            continue
        except OSError:
            left.append(path)
    return left


def _torn(path: Path) -> bool:
    """Return whether a segment was created a while ago and is not ready."""
    with suppress(OSError):
        if time.time() - path.stat().st_mtime > _LONGEST_CREATION:
            with path.open("rb") as file:
                return file.read(len(_READY)) != _READY
    return False
