# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""In which cells of an image a rectangle may be seen, so that rays meet it only there.

In front of the camera a ray d meets the plane of a rectangle at s = S / N and r = R / N, with N, S
and R linear in d, and the rectangle itself where N, S, N - S, R and N - R are not negative. The
rays of a cell lie between those of its four corners: where one of the five is negative at all four,
the rectangle is not in the cell. Distortion bends the sides of a cell by less than its width, for
which the cells around one are taken, too.
"""

from collections.abc import Iterator
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from imu_sim_ros.camera.images.plane import Planes

Single = NDArray[np.float32]
Mask = NDArray[np.bool_]
Integers = NDArray[np.int64]


class Corners(NamedTuple):
    """The corners of all cells of an image."""

    rays: Single
    """(3, a + 1, b + 1) in the camera's frame."""
    rows: Integers
    """(a + 1,) their rows."""

    @classmethod
    def of(cls, rays: Single, cell: int) -> "Corners":
        """Return those of square cells.

        :param rays: (3, h, w) of all pixels.
        :param cell: pixels along its side.
        """
        rows, columns = (
            np.minimum(np.arange(0, length + cell, cell), length - 1) for length in rays.shape[1:]
        )
        return cls(np.ascontiguousarray(rays[:, rows[:, None], columns]), rows)


def covered(planes: Planes, corners: Corners) -> Mask:
    """Return in which cells (m, a, b) of the image each of m rectangles may be seen."""
    rows = corners.rows if planes.start.shape[2] > 1 else slice(None)
    x, y, z = corners.rays
    count, (height, width) = len(planes.start), x.shape
    result = np.empty((count, height - 1, width - 1), np.bool_)
    for m in range(count):  # one at a time: those of all take a hundred times the image's memory
        vectors = planes.vectors[m][..., rows, None]
        n, s, r = vectors[:, 0] * x + vectors[:, 1] * y + vectors[:, 2] * z
        start = planes.start[m][..., rows, None]
        possible = _any_corner(n > 0.0)
        for value in (s + start[0] * n, r + start[1] * n):
            possible &= _any_corner(value >= 0.0)
            possible &= _any_corner(value <= n)
        result[m] = possible
    return _with_neighbours(result)


def _any_corner(holds: Mask) -> Mask:
    """Return where any of a cell's corners (a + 1, b + 1) fulfils a condition: (a, b)."""
    rows = holds[:-1] | holds[1:]
    return np.asarray(rows[:, :-1] | rows[:, 1:])


def _with_neighbours(cells: Mask) -> Mask:
    """Return cells (m, a, b) and the eight around each."""
    rows: Mask = cells.copy()
    rows[:, 1:] |= cells[:, :-1]
    rows[:, :-1] |= cells[:, 1:]
    result: Mask = rows.copy()
    result[..., 1:] |= rows[..., :-1]
    result[..., :-1] |= rows[..., 1:]
    return result


def regions(cells: Mask) -> Iterator[tuple[int, slice, slice]]:
    """Yield the number of each rectangle in some rows of cells (m, a, b), and where it may be."""
    rows, columns = np.asarray(cells.any(axis=2)), np.asarray(cells.any(axis=1))
    for m in np.flatnonzero(rows.any(axis=1)).tolist():
        yield m, _extent(rows[m]), _extent(columns[m])


def _extent(cells: Mask) -> slice:
    """Return the range of those (n,) that are set; one is."""
    places = np.flatnonzero(cells)
    return slice(int(places[0]), int(places[-1]) + 1)
