# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""What a program makes of the machine: its cores, and the memory that it has had before."""

import os
from functools import cache
from typing import Final

import numpy as np

_KEPT: Final = 16 * 2**20
"""Bytes; glibc learns thresholds of up to 32 MiB."""


def cores() -> int:
    """Return how many processor cores this process may use."""
    if hasattr(os, "sched_getaffinity"):
        return len(os.sched_getaffinity(0))
    return os.cpu_count() or 1


@cache
def keep_freed_memory() -> None:
    """Let the C library keep what a block frees for the next block, once in a process.

    glibc maps large blocks one by one, and gives memory back to the system where more than twice
    the largest block freed so far is free (``M_MMAP_THRESHOLD`` and ``M_TRIM_THRESHOLD`` in
    mallopt(3)): with arrays of 200 kB that may be after every block, and fresh pages cost a sixth
    of white noise at rest. A larger block that is freed unused ends that. Elsewhere this does
    nothing.
    """
    np.empty(_KEPT, dtype=np.uint8)
