# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Candidate rectangles for each cell of an image, and their texture coordinates in the atlas.

A pair is a cell and a rectangle that may be seen in it. All pairs of an image are dealt with at
once: what an image costs follows from its pixels, hardly from the number of its rectangles.
"""

import math
from typing import Final

import numpy as np
from numpy.typing import NDArray

from imu_sim_ros.core.blocks import ceil_divide
from imu_sim_ros.core.types import Integers, Single
from imu_sim_ros.sensors.camera.images.loops import (
    LEVELS,
    LOOKS,
    SHARES,
    TILE,
    arrange,
    candidates,
)
from imu_sim_ros.sensors.camera.images.planes import Pairs, Planes
from imu_sim_ros.sensors.camera.images.rays import Corners
from imu_sim_ros.sensors.camera.images.texture import Atlas

_ONE = np.float32(1.0)


_APART: Final = np.float32(1e-5)
"""Smallest difference in 1 / t of a surface from one that it hides, as a share."""
_BENT: Final = 0.03
"""Smallest bend of the image of a straight line within a cell that is assumed, as a share of it."""


_CANDIDATE: Final = np.dtype(
    [
        ("cell", np.int64),
        ("which", np.int64),  # number of the rectangle
        ("nearest", np.float32),  # largest 1 / t
        ("hiding", np.float32),  # 1 / t beyond which it hides all of the cell; -1: it does not
        ("corners", np.float32, 4),  # 1 / t at the corners of the cell
    ],
    align=True,
)


class CellGrid:
    """The cells of an image, and tiles of them."""

    def __init__(self, corners: Corners, angle: float) -> None:
        """Initialise with the corners of all cells.

        :param angle: across a cell at most [rad]. Rays are longer within a cell than at its corners
            by up to 1 - cos, and the image of a line bends by about an eighth of the angle.
        """
        self._slack = np.float32(1.0 - math.cos(angle))
        self._bent = np.float32(max(_BENT, 0.25 * angle))
        self.rows, self.columns = (length - 1 for length in corners.rays.shape[1:])
        self._corners = corners
        # Corners of the tiles, one more than tiles in each direction.
        self._tiles = ceil_divide(self.rows, TILE) + 1, ceil_divide(self.columns, TILE) + 1

    def pairs(self, planes: Planes) -> Pairs:
        """Return the pairs of cells and rectangles that may be visible in them.

        :param planes: planes of the rectangles, in the camera's frame.
        """
        cells = self.rows * self.columns
        slots = self._candidates(planes)
        size = len(slots)
        pairs = Pairs(
            cell=np.empty(size, np.int64),
            first=np.empty(cells + 1, np.int64),
            which=np.empty(size, np.int64),
            fills=np.empty(size, np.bool_),
        )
        hiding, front = np.empty(cells, np.float32), np.empty(cells, np.int64)
        count = arrange(pairs, slots, hiding, front, self._bent, _APART)
        return Pairs(pairs.cell[:count], pairs.first, pairs.which[:count], pairs.fills[:count])

    def _candidates(self, planes: Planes) -> NDArray[np.void]:
        """Return records of the cells in which each rectangle may be, hidden or not.

        Their number is not known before: with too few slots the search is repeated with enough.
        """
        slot_count = 4 * self.rows * self.columns
        edges = np.empty((5, *self._tiles), np.float32)
        rays, rows = self._corners.rays, self._corners.rows
        while True:
            slots = np.empty(slot_count, _CANDIDATE)
            count = candidates(slots, planes, rays, rows, edges, self._bent, self._slack)
            if count <= slot_count:
                return slots[:count]
            slot_count = count


_HALF: Final = np.float32(0.5)
_FACTOR: Final = _HALF ** np.arange(LEVELS, dtype=np.float32)
"""Size of each level over that of the first one."""
_NEAREST: Final = np.float32(2.0) ** np.arange(1, 2 * LEVELS - 1, 2, dtype=np.float32)
"""Squares of the steps between levels: those are sqrt(2) times 1, 2, 4, ..."""
_NOT_COARSER: Final = np.float32(4.0) ** np.arange(1, LEVELS, dtype=np.float32)
"""Squares of the steps between levels whose texels are half a pixel to a whole one: the nearest
level, coarser by up to sqrt(2), blurs what a pixel's area still tells."""
_NEXT: Final = np.float32(4.0) ** np.arange(1, LEVELS - 1, dtype=np.float32)
"""Squares of the steps of levels, of which a pixel looks at two."""


PATCH: Final = np.dtype(
    [
        # Where s and r lie in the atlas, scale s + offset [texels], in one level or in two.
        ("scale", np.float32, (2, 2)),
        ("offset", np.float32, (2, 2)),
        ("share", np.int64),  # of the second, in 1 / SHARES
        ("along", np.float32, 2),  # the longer axis of a pixel's footprint in s and r
        ("doublings", np.int64),  # 1, 2, 4 or 8 points along it are looked at: 2 to this power
        # How 1 / t, s / t and r / t differ from a pixel to that on its right, and below.
        ("steps", np.float32, (2, 3)),
        # 1 / the largest change in half a pixel: of s / t and (1 - s) / t, r / t and (1 - r) / t.
        ("inside", np.float32, 2),
        ("depth", np.float32),  # the largest change of 1 / t in half a pixel
    ],
    align=True,
)
"""Texture mapping of a rectangle in a cell."""


def patches(
    positions: Single,
    linear: Single,
    atlas: Atlas,
    number: Integers,
    trilinear: bool,
    areas: bool = False,
) -> NDArray[np.void]:
    """Return the texture mapping of p pairs of a rectangle and a cell.

    :param positions: (3, 2, p) s and r of each of three probes of the cell.
    :param linear: (3, 3, p) 1 / t, s / t and r / t of each of the probes.
    :param number: (p,) numbers of the rectangles' textures in the atlas.
    :param areas: levels suit the width of a pixel's footprint, with looks along its length; else
        they suit its length.
    """
    result = np.zeros(len(number), PATCH)
    size = atlas.size[number].T
    texels = positions * size
    steps = texels[1:] - texels[:1]
    if areas:
        square, length, along = _footprint(steps)
        result["along"] = (along / size).T
        _put_slopes(result, linear)
    else:
        steps *= steps
        squares = steps[:, 0] + steps[:, 1]
        square = np.maximum(squares[0], squares[1])
    if trilinear:
        level = np.searchsorted(_NEXT, square, side="right")
        # Between 2^k and 2^(k + 1) the share goes from 0 to 1; a square root is exact everywhere.
        excess = np.sqrt(square) * _FACTOR[level] - _ONE
        result["share"] = np.rint(np.clip(excess, 0.0, 1.0) * np.float32(SHARES))
    else:
        level = np.searchsorted(_NOT_COARSER if areas else _NEAREST, square)
    for k, mip in enumerate((level, level + 1)[: 1 + trilinear]):
        result["scale"][:, k] = (size * _FACTOR[mip]).T
        # Texel k of a level covers k to k + 1 in its own units; a look-up at k is its centre.
        result["offset"][:, k] = atlas.corner[number, mip] - _HALF
    if areas:
        result["doublings"] = np.searchsorted(LOOKS, length * _FACTOR[level])
    return result


def _put_slopes(patches: NDArray[np.void], linear: Single) -> None:
    """Set the changes of depth and texture coordinates from pixel to pixel in patches.

    ``inside`` is the inverse of the largest change of a distance from the edges along s, and along
    r, within half a pixel; ``depth`` is that of 1 / t.

    :param linear: (3, 3, p) 1 / t, s / t and r / t of each of the probes: a pixel, that on its
        right, and that below it.
    """
    steps = linear[1:] - linear[:1]
    patches["steps"] = steps.transpose(2, 0, 1)
    n, s, r = steps.transpose(1, 0, 2)
    half_changes = [_HALF * np.abs(change).sum(axis=0) for change in (s, n - s, r, n - r, n)]
    for k in range(2):
        side = np.maximum(half_changes[2 * k], half_changes[2 * k + 1])
        patches["inside"][:, k] = _ONE / np.maximum(side, _SHORTEST)
    patches["depth"] = half_changes[4]


_SHORTEST: Final = np.float32(1e-12)
_LONGEST: Final = np.float32(1e12)


def _footprint(steps: Single) -> tuple[Single, Single, Single]:
    """Return width^2, length (p,) and long axis (2, p) of the ellipse of a pixel on a texture.

    With the steps as the columns of J, they are the singular values of J, and the direction of the
    larger one; the width is at least an eighth of the length.

    :param steps: (2, 2, p) column and row [texels] of the steps to the right and down.
    """
    (a, c), (b, d) = np.clip(steps, -_LONGEST, _LONGEST)
    xx, xy, yy = a * a + b * b, a * c + b * d, c * c + d * d
    half = _HALF * (xx - yy)
    root = np.sqrt(half * half + xy * xy)
    long = np.maximum(_HALF * (xx + yy) + root, _SHORTEST)
    determinant = a * d - b * c
    width_floor = long * np.float32(1.0 / 4.0 ** len(LOOKS))
    width = np.maximum(determinant * determinant / long, width_floor)
    # Of the two ways to write the axis the one without a difference of equal numbers.
    wide = half > 0.0
    axis = np.stack([np.where(wide, half + root, xy), np.where(wide, xy, root - half)])
    norm = np.sqrt(axis[0] * axis[0] + axis[1] * axis[1])
    length = np.sqrt(long)
    axis *= length / np.maximum(norm, _SHORTEST)
    return width, length, axis
