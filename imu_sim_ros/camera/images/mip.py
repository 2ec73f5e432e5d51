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
Integers = NDArray[np.int64]
_T = TypeVar("_T", bound=np.generic)

CELL: Final = 8
"""Pixels along which the mip level is constant, in both directions."""
SHARES: Final = 256
"""Steps of the share of the coarser of two levels."""
_HALF: Final = np.float32(0.5)


class Level(NamedTuple):
    """Where the texture's coordinates u and v (h, w) lie in the atlas: ``scale u + column``."""

    scale: Single
    column: Single
    row: Single


def levels(
    u: Single, v: Single, atlas: Atlas, m: int, trilinear: bool
) -> tuple[list[Level], NDArray[np.uint16] | None]:
    """Return the level of each pixel (h, w); of two, the finer first, also the other one's share.

    :param u: (h, w) columns of texture m of the atlas, in texels of its first level; v: rows.
    """
    square = _squares(u, v)
    if not trilinear:
        # The nearest of 1, 2, 4, ...: thresholds are sqrt(2) times those.
        thresholds = np.float32(2.0) ** np.arange(1, 2 * LEVELS - 1, 2, dtype=np.float32)
        level = np.searchsorted(thresholds, square.ravel()).reshape(square.shape)
        return [_level(level, atlas, m, u.shape)], None
    thresholds = np.float32(4.0) ** np.arange(1, LEVELS - 1, dtype=np.float32)
    level = np.searchsorted(thresholds, square.ravel(), side="right").reshape(square.shape)
    # Between 2^k and 2^(k + 1) the share goes from 0 to 1; a square root is exact everywhere.
    excess = np.sqrt(square) * _factor(level) - np.float32(1.0)
    share = np.rint(np.clip(excess, 0.0, 1.0) * np.float32(SHARES)).astype(np.uint16)
    both = [_level(k, atlas, m, u.shape) for k in (level, level + 1)]
    return both, _enlarged(share, *u.shape)


def _squares(u: Single, v: Single) -> Single:
    """Return the square of the step from one pixel to the next in each cell [texels^2]."""
    height, width = u.shape
    i = np.minimum(np.arange(0, height, CELL) + CELL // 2, height - 2)[:, None]
    j = np.minimum(np.arange(0, width, CELL) + CELL // 2, width - 2)
    i, j = np.maximum(i, 0), np.maximum(j, 0)
    below, right = np.minimum(i + 1, height - 1), np.minimum(j + 1, width - 1)
    result: Single = np.maximum(
        *((u[a, b] - u[i, j]) ** 2 + (v[a, b] - v[i, j]) ** 2 for a, b in ((i, right), (below, j)))
    )
    return result


def _factor(level: Integers) -> Single:
    return np.asarray(_HALF ** level.astype(np.float32))


def _level(level: Integers, atlas: Atlas, m: int, shape: tuple[int, ...]) -> Level:
    place = atlas.place[m]
    # Texel k of a level covers k to k + 1 in its own units; a look-up at k is its centre.
    small = (_factor(level), place[level, 0] - _HALF, place[level, 1] - _HALF)
    return Level(*(_enlarged(part, *shape) for part in small))


def _enlarged(cells: NDArray[_T], height: int, width: int) -> NDArray[_T]:
    return cells.repeat(CELL, axis=0)[:height].repeat(CELL, axis=1)[:, :width]
