# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Clouds of a sky that encloses a place: a function of the direction, so that no edge is seen."""

from typing import Final

import numpy as np

from imu_sim_ros.core.blocks import ceil_divide
from imu_sim_ros.core.random_streams import generator
from imu_sim_ros.core.types import Array, Bytes, Single
from imu_sim_ros.places.geometry import Rectangle
from imu_sim_ros.places.light import resample

CLOUDED: Final = "paint:86b0de"
"""Material of a face of the sky that has clouds: the colour between them."""
_LAYERS: Final = ((2.5, 12.0, 1.0), (6.0, 24.0, 0.5), (16.0, 48.0, 0.25))
"""Layers of noise: cells per unit of the direction's horizontal components, cells per unit of its
height, and amplitude; clouds are wide and flat."""
_STEP: Final = 4
"""Texels between two places at which noise is computed."""
_ROWS: Final = 256
"""Rows that are interpolated at once."""


def clouds(sky: Rectangle, shape: tuple[int, int], seed: int, contrast: float) -> Bytes:
    """Return the texture (rows, columns, 3) of a rectangle of the sky.

    :param sky: the rectangle, from the eye that is in the middle [m].
    :param shape: rows and columns; rows go along the rectangle's second side.
    :param contrast: factor of the difference between clouds and sky.
    """
    rows, columns = shape
    directions = _directions(sky, (ceil_divide(rows, _STEP), ceil_divide(columns, _STEP)))
    stream = generator(seed, "place.clouds")
    total = np.zeros(directions.shape[:2], np.float32)
    for wide, high, amplitude in _LAYERS:
        cells = directions * np.array([wide, wide, high], np.float32)
        total += np.float32(amplitude) * _noise(cells, (wide, wide, high), stream)
    share = np.clip(total, 0.0, 1.0) * np.float32(contrast)
    colour = np.array([int(CLOUDED[k : k + 2], 16) for k in (6, 8, 10)], np.float32)
    values = np.empty((rows, columns, 3), np.uint8)
    wide_share = resample(share, 1, columns)
    for top in range(0, rows, _ROWS):
        part = resample(wide_share, 0, rows, top, min(_ROWS, rows - top))[..., None]
        grey = colour + (np.float32(255.0) - colour) * part + np.float32(0.5)
        values[top : top + _ROWS] = np.clip(grey, 0.0, 255.0).astype(np.uint8)
    return values


def _directions(sky: Rectangle, shape: tuple[int, int]) -> Single:
    """Return the unit vectors (rows, columns, 3) to the middles of even parts of a rectangle."""
    origin, across, up = sky
    r, s = ((np.arange(count) + 0.5)[:, None] / count for count in shape)
    places: Array = origin + (r * up)[:, None] + (s * across)[None]
    lengths = np.sqrt((places * places).sum(axis=2, keepdims=True))
    return (places / lengths).astype(np.float32)


def _noise(
    cells: Single, largest: tuple[float, float, float], stream: np.random.Generator
) -> Single:
    """Return smooth noise (rows, columns) from -1 to 1 at places in a lattice.

    :param cells: (rows, columns, 3) places, in cells.
    :param largest: largest absolute value of each component.
    """
    count = [2 * int(np.ceil(size)) + 3 for size in largest]
    knots = stream.integers(-1000, 1001, count).astype(np.float32) / np.float32(1000.0)
    moved = cells + np.array([np.ceil(size) + 1.0 for size in largest], np.float32)
    whole = np.floor(moved)
    part = moved - whole
    part = part * part * (np.float32(3.0) - np.float32(2.0) * part)
    x, y, z = np.moveaxis(whole.astype(np.int64), 2, 0)
    total = np.zeros(cells.shape[:2], np.float32)
    for corner in np.ndindex(2, 2, 2):
        weight = np.ones(cells.shape[:2], np.float32)
        for axis, upper in enumerate(corner):
            weight *= part[..., axis] if upper else 1 - part[..., axis]
        total += weight * knots[x + corner[0], y + corner[1], z + corner[2]]
    return total
