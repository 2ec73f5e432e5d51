# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Which level of a texture each pixel looks at (Williams, Pyramidal Parametrics, 1983).

The step from one pixel to the next, in texels, decides: at level k a texel is 2^k of the first's.
It is taken once in each cell of CELL x CELL pixels, the larger of the steps along row and column.
"""

from typing import Final, NamedTuple, TypeVar

import numpy as np
from numpy.typing import NDArray

from imu_sim_ros.camera.images.texture import LEVELS, Atlas

Single = NDArray[np.float32]
Mask = NDArray[np.bool_]
Integers = NDArray[np.int64]
Shares = NDArray[np.uint16]
_T = TypeVar("_T", bound=np.generic)

CELL: Final = 8
"""Pixels along which the mip level is constant, in both directions."""
SHARES: Final = 256
"""Steps of the share of the coarser of two levels."""
_HALF: Final = np.float32(0.5)
_FACTOR: Final = _HALF ** np.arange(LEVELS, dtype=np.float32)
"""Size of a level, of the first one's."""
_NEAREST: Final = np.float32(2.0) ** np.arange(1, 2 * LEVELS - 1, 2, dtype=np.float32)
"""Squares of the steps between levels: those are sqrt(2) times 1, 2, 4, ..."""
_NEXT: Final = np.float32(4.0) ** np.arange(1, LEVELS - 1, dtype=np.float32)
"""Squares of the steps of levels, of which a pixel looks at two."""


class Level(NamedTuple):
    """Where places s and r on a rectangle lie in the atlas: ``scale s + offset`` [texels]."""

    scale: Single
    """(2, a, b) in each cell."""
    offset: Single
    """(2, a, b)."""


class Levels(NamedTuple):
    """The level of each cell of a part of an image, or two of them, the finer first."""

    each: list[Level]
    share: Shares | None
    """(a, b) of the coarser of two."""
    corner: tuple[int, int]
    """Row and column of the part's first cell."""

    def part(self, rows: slice, columns: slice) -> "Levels":
        """Return those of some of the cells, by their rows and columns in the image."""
        top, left = self.corner
        at = (
            slice(rows.start - top, rows.stop - top),
            slice(columns.start - left, columns.stop - left),
        )
        each = [Level(*(values[:, at[0], at[1]] for values in level)) for level in self.each]
        share = None if self.share is None else self.share[at]
        return Levels(each, share, (rows.start, columns.start))


class Probes(NamedTuple):
    """For each cell (a, b) of an image a pixel, and those on its right and below it."""

    rays: Single
    """(3, 3, a, b): x, y, z of the pixel, of the one on its right, of the one below."""
    rows: Integers
    """(3, a) their rows."""

    def part(self, rows: slice, columns: slice) -> "Probes":
        """Return those of some of the cells."""
        return Probes(self.rays[:, :, rows, columns], self.rows[:, rows])

    @classmethod
    def of(cls, rays: Single) -> "Probes":
        """Return the pixels in the middle of cells.

        :param rays: (3, h, w) of all pixels.
        """
        height, width = rays.shape[1:]
        i, j = (
            np.maximum(np.minimum(np.arange(0, length, CELL) + CELL // 2, length - 2), 0)
            for length in (height, width)
        )
        below, right = np.minimum(i + 1, height - 1), np.minimum(j + 1, width - 1)
        places = [(i, j), (i, right), (below, j)]
        found = [rays[:, rows[:, None], columns] for rows, columns in places]
        return cls(np.stack(found, axis=1), np.stack([i, i, below]))


def levels(
    places: Single, atlas: Atlas, m: int, trilinear: bool, corner: tuple[int, int]
) -> Levels:
    """Return the levels of cells (a, b).

    :param places: (2, 3, a, b) s and r of their probes.
    :param m: number of the rectangle's texture in the atlas.
    :param corner: row and column of the first cell.
    """
    square = _squares(places * atlas.size[m][:, None, None, None])
    if not trilinear:
        return Levels([_level(np.searchsorted(_NEAREST, square), atlas, m)], None, corner)
    level = np.searchsorted(_NEXT, square, side="right")
    # Between 2^k and 2^(k + 1) the share goes from 0 to 1; a square root is exact everywhere.
    excess = np.sqrt(square) * _FACTOR[level] - np.float32(1.0)
    share = np.rint(np.clip(excess, 0.0, 1.0) * np.float32(SHARES)).astype(np.uint16)
    return Levels([_level(k, atlas, m) for k in (level, level + 1)], share, corner)


def _squares(places: Single) -> Single:
    """Return the square of the step from one pixel to the next (a, b) [texels^2].

    :param places: (2, 3, a, b) column and row of probes.
    """
    steps = places[:, 1:] - places[:, :1]
    steps *= steps
    squares = steps[0] + steps[1]
    return np.asarray(np.maximum(squares[0], squares[1]))


def _level(level: Integers, atlas: Atlas, m: int) -> Level:
    """Return a level (a, b) in each cell."""
    # Texel k of a level covers k to k + 1 in its own units; a look-up at k is its centre.
    corner = (atlas.place[m] - _HALF).T
    return Level(atlas.size[m][:, None, None] * _FACTOR[level], corner[:, level])


def in_atlas(places: Single, level: Level) -> Single:
    """Return where places s and r (2, h, w) in cells (2, a, b) lie in the atlas [texels]."""
    _, height, width = places.shape
    scale, offset = (cells.repeat(CELL, axis=2)[..., :width] for cells in level)
    if height % CELL:  # of the last cells a part
        scale, offset = (rows.repeat(CELL, axis=1)[:, :height] for rows in (scale, offset))
        return np.asarray(places * scale + offset)
    texels = places.reshape(2, -1, CELL, width) * scale[:, :, None]
    texels += offset[:, :, None]
    return np.asarray(texels.reshape(places.shape))


def in_pixels(cells: NDArray[_T], height: int, width: int) -> NDArray[_T]:
    """Return what cells (..., a, b) have for each of their pixels (..., h, w)."""
    return cells.repeat(CELL, axis=-1)[..., :width].repeat(CELL, axis=-2)[..., :height, :]
