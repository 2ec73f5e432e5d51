# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Formulas row by row over long arrays, in blocks, so that intermediate results need no memory.

A row has the same value, bit for bit, in whatever block it is computed.
"""

from collections.abc import Iterator
from typing import Final

import numpy as np

from imu_sim_ros.core.types import Array

ROWS: Final = 65536
"""Rows of a block: their intermediate results need a few megabytes."""


def ceil_divide(count: int, size: int) -> int:
    """Return ``count / size`` rounded up: the number of groups of at most ``size`` elements."""
    return -(-count // size)


def blocks(count: int, window: int = 1) -> Iterator[slice]:
    """Yield consecutive slices of an array of ``count`` rows, which end within it.

    :param window: each slice but the last one has a multiple of so many rows.
    """
    rows = max(ROWS // window, 1) * window
    for begin in range(0, count, rows):
        yield slice(begin, min(begin + rows, count))


def squared_vector_lengths(vectors: Array) -> Array:
    """Return the squared lengths (n,) of vectors (n, k)."""
    squares = np.empty(len(vectors))
    for rows in blocks(len(vectors)):
        squares[rows] = np.sum(np.square(vectors[rows]), axis=1)
    return squares


def vector_lengths(vectors: Array) -> Array:
    """Return the lengths (n,) of vectors (n, k)."""
    squares = squared_vector_lengths(vectors)
    return np.sqrt(squares, out=squares)


def step_lengths(points: Array) -> Array:
    """Return the distances (n - 1,) of neighbours among points (n, k)."""
    distances = np.empty(max(len(points) - 1, 0))
    for rows in blocks(len(distances)):
        distances[rows] = vector_lengths(np.diff(points[rows.start : rows.stop + 1], axis=0))
    return distances
