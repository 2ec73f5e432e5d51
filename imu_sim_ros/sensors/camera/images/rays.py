# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""The rays of all pixels of a camera, a band of rows at a time."""

import math
from functools import cached_property
from typing import Final, NamedTuple

import numpy as np

from imu_sim_ros.core.blocks import ceil_divide
from imu_sim_ros.core.types import Array, Integers, Single
from imu_sim_ros.sensors.camera.images.loops import CELL
from imu_sim_ros.sensors.camera.model import CameraModel

_BAND: Final = 190_000
"""Approximate number of rays that are processed at once: half of 752 x 480."""
_AT_ONCE: Final = 4096
"""Pixels whose rays are computed at once: the arrays stay in a processor's cache."""
_KEPT: Final = 6_000_000
"""Largest number of rays that are kept, 12 bytes each; else they are computed for each image."""


class PixelRays:
    """Directions in the camera's frame, one for each of ``scale`` by ``scale`` parts of a pixel.

    A pixel without a direction has (0, 0, 0): it looks through nothing.
    """

    def __init__(self, model: CameraModel, scale: int) -> None:
        """Initialise without rays.

        :param scale: rays along each side of a pixel.
        """
        self._model, self.scale = model, scale
        self.shape = self.height, self.width = model.height * scale, model.width * scale
        self.row_positions = (np.arange(self.height) + 0.5) / scale - 0.5
        """Row of the image of each row of rays."""
        self._columns = (np.arange(self.width) + 0.5) / scale - 0.5

    @cached_property
    def bands(self) -> list[slice]:
        """Ranges of rows of cells that are processed at once, each of whole pixels."""
        count, step = ceil_divide(self.height, CELL), self.scale // math.gcd(self.scale, CELL)
        size = step * max(1, _BAND // (step * CELL * self.width))
        return [slice(k, min(k + size, count)) for k in range(0, count, size)]

    def rows(self, cells: slice) -> slice:
        """Return the rows of rays in a range of rows of cells."""
        return cell_slice(cells, self.height)

    def of_band(self, number: int) -> Single:
        """Return the rays of a band (3, rows, width)."""
        return (
            self._cached_bands[number] if self._cached_bands is not None else self._compute(number)
        )

    def at(self, *selections: tuple[Integers, Integers]) -> list[Single]:
        """Return the rays (3, a, b) of rows (a,) in ascending order and columns (b,), of each."""
        parts: list[list[Single]] = [[] for _ in selections]
        for number, band in enumerate(self.bands):
            rays, span = self.of_band(number), self.rows(band)
            for (rows, columns), selected in zip(selections, parts, strict=True):
                band_rows = rows[(rows >= span.start) & (rows < span.stop)] - span.start
                selected.append(rays[:, band_rows[:, None], columns])
        return [np.concatenate(selected, axis=1) for selected in parts]

    def interpolate(self, rows: Array, columns: Array) -> Single:
        """Return the rays (3, a, b) of rows (a,) and columns (b,) that need not be whole."""
        u, v = ((ray + 0.5) / self.scale - 0.5 for ray in (columns, rows))
        grid = np.stack(np.meshgrid(u, v), axis=-1).reshape(-1, 2)
        return self._through(grid, len(rows))

    def _through(self, grid: Array, height: int) -> Single:
        """Return the unit directions (3, height, width) through pixels (n, 2); 0: none."""
        directions = np.zeros((3, len(grid)), np.float32)
        for start in range(0, len(grid), _AT_ONCE):
            part = slice(start, start + _AT_ONCE)
            rays = self._model.unproject(grid[part])
            directions[:, part] = np.where(rays.valid[:, None], rays.direction, 0.0).T
        return directions.reshape(3, height, -1)

    @cached_property
    def _cached_bands(self) -> list[Single] | None:
        """Rays of all bands, if they fit into memory."""
        if self.height * self.width > _KEPT:
            return None
        return [self._compute(number) for number in range(len(self.bands))]

    def _compute(self, number: int) -> Single:
        """Compute and return the rays (3, rows, width) of a band."""
        rows = self.row_positions[self.rows(self.bands[number])]
        grid = np.stack(np.meshgrid(self._columns, rows), axis=-1).reshape(-1, 2)
        return self._through(grid, len(rows))


class Corners(NamedTuple):
    """The corners of all cells of an image."""

    rays: Single
    """(3, a + 1, b + 1) unit directions in the camera's frame."""
    rows: Integers
    """(a + 1,) rows of the corners among the rows of rays."""


class Probes(NamedTuple):
    """Three pixels of each cell: the middle one, and those on its right and below it."""

    rays: Single
    """(3, 3, cells) rays: x, y, z of the middle pixel, of that on its right, of that below."""
    rows: Integers
    """(3, cells) rows of these pixels."""


def corners_and_probes(rays: PixelRays, areas: bool = False) -> tuple[Corners, Probes]:
    """Return the corners and the probes of all cells.

    The probes of a cell are the pixel at its middle, the one to the right, and the one below: the
    differences between them are the steps of a texture from pixel to pixel.

    :param areas: True: cells reach to the edges of their pixels; False: to their centres.
    """
    height, width = rays.shape
    edges = [np.minimum(np.arange(0, n + CELL, CELL), n - 1) for n in rays.shape]
    i, j = (np.maximum(np.minimum(np.arange(0, n, CELL) + CELL // 2, n - 2), 0) for n in rays.shape)
    i_next, j_next = np.minimum(i + 1, height - 1), np.minimum(j + 1, width - 1)
    corners, *middle = rays.at((edges[0], edges[1]), (i, j), (i, j_next), (i_next, j))
    rows = np.stack([i, i, i_next]).repeat(len(j), axis=1)
    probes = Probes(np.stack(middle).reshape(3, 3, -1), rows)
    if areas:
        down, across = (np.minimum(np.arange(0, n + CELL, CELL), n) - 0.5 for n in rays.shape)
        corners = rays.interpolate(down, across)
    return Corners(np.ascontiguousarray(corners), edges[0]), probes


def cell_slice(cells: slice, length: int) -> slice:
    """Return the pixels of a range of cells along one side of an image."""
    return slice(cells.start * CELL, min(cells.stop * CELL, length))
