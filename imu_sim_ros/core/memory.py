# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Memory of arrays as long as a recording."""

import ctypes
from functools import cache
from typing import Final

import numpy as np

from imu_sim_ros.core.types import AnyArray

_RELEASED: Final = 1 << 25
"""Bytes of free memory that are worth returning."""


def release_memory() -> None:
    """Return freed memory to the system.

    The C library keeps what lies between other blocks: of a long record, several times the memory
    of a column.
    """
    library = _c_library()
    if hasattr(library, "malloc_trim"):  # a function of glibc
        library.malloc_trim(0)


@cache
def _c_library() -> ctypes.CDLL:
    """Return the C library; each object of it is a cycle of references, which would stay."""
    return ctypes.CDLL(None)


def join(parts: list[AnyArray]) -> AnyArray:
    """Return consecutive arrays as one; each is free as soon as it is copied.

    :param parts: one or more arrays, which are removed from the list.
    """
    total = sum(map(len, parts))
    joined = np.empty((total, *parts[0].shape[1:]), np.result_type(*parts))
    begin = released = 0
    parts.reverse()
    while parts:
        part = parts.pop()
        joined[begin : begin + len(part)] = part
        begin += len(part)
        del part
        if joined[released:begin].nbytes > _RELEASED:
            release_memory()
            released = begin
    return joined
