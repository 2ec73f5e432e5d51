# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""The textures on the surfaces of a scene, with corners at every scale, and their mip levels."""

import math
from collections.abc import Callable, Iterator, Sequence
from typing import Final, NamedTuple

import numpy as np

from imu_sim_ros.core.blocks import ceil_divide
from imu_sim_ros.core.random_streams import generator_at
from imu_sim_ros.core.types import Array, Bytes, Single
from imu_sim_ros.places.bodies import Crowd
from imu_sim_ros.places.geometry import Surfaces
from imu_sim_ros.places.gloss import Polish
from imu_sim_ros.places.paint import Painter
from imu_sim_ros.sensors.camera.images.loops import LEVELS
from imu_sim_ros.sensors.camera.images.tag36h11 import tag
from imu_sim_ros.sensors.camera.scene_parameters import (
    AprilgridParameters,
    CheckerboardParameters,
    SceneParameters,
    TargetParameters,
    check_surfaces,
)

MOST_TEXELS: Final = 24_000_000
"""Largest number of texels of a texture."""
MOST_TEXELS_OF_PLACES: Final = 36_000_000
"""Largest number of texels of all textures of a place."""
SMALLEST_TEXEL: Final = 0.0025
"""Smallest size of a texel of a wall [m]."""
_TEXEL_OF_BODIES: Final = 0.004
"""Size of a texel of a body [m]."""
_WIDTH: Final = 8192
"""Width of the atlas of textures [texels]."""
_EDGE: Final = 1
"""Texels around each texture that repeat its edge, for interpolation."""
_CELLS: Final = ((4, 1), (8, 1), (16, 2), (32, 2), (64, 3), (128, 3))
"""Edge of an octave's cells [texels], and its weight."""
_CONTRAST: Final = 8
"""Contrast in fifths: the sum of the octaves is stretched by 1.6 around the middle."""
_TINT: Final = 40
"""Largest difference of a colour from the grey value in one octave."""
_TINT_CELLS: Final = (16, 64)
"""Sizes of the cells of a random tint [texels]."""
_TAG_CELL: Final = 8
"""Texels along the edge of a tag's cell; the cells' edges lie between texels."""
_SQUARE: Final = 64
"""Texels along the edge of a checkerboard's square."""
_ROWS: Final = 128
"""Rows of a texture that are computed at once: a multiple of the largest cell."""


class Atlas(NamedTuple):
    """All textures of a scene with their mip levels, in one image."""

    image: Bytes
    """(height, width) grey values, or (height, width, 3) red, green and blue."""
    size: Single
    """(m, 2) columns and rows of each surface's texture."""
    corner: Single
    """(m, LEVELS, 2) column and row of each level's first texel."""
    polish: Polish | None = None
    """Gloss of the first surfaces; None: all is matt."""


def atlas(
    surfaces: Surfaces,
    parameters: SceneParameters,
    colour: bool = False,
    painter: Painter | None = None,
    crowd: Crowd | None = None,
) -> Atlas:
    """Return the textures of all surfaces, and behind them those of bodies, with their mip levels.

    :param colour: True: red, green and blue; targets stay black and white.
    :param painter: painter of a place; None: the scene is no place.
    :param crowd: moving bodies; None: nothing moves.
    :raises ConfigurationError: for a scene without surfaces.
    """
    check_surfaces(parameters)
    if painter is not None:
        return _place_atlas(surfaces, painter, colour, crowd)
    shapes = [_shape(surfaces, m, parameters) for m in range(len(surfaces.origin))]

    def texture(m: int) -> Bytes:
        level = _texture(surfaces, m, parameters)
        return _colour(parameters, m, level) if colour else level

    return assemble_atlas(shapes, texture, colour)


def _place_atlas(surfaces: Surfaces, painter: Painter, colour: bool, crowd: Crowd | None) -> Atlas:
    """Return the textures of the faces of a place, and behind them those of its moving bodies."""
    texels = painter.texels(MOST_TEXELS_OF_PLACES)
    shapes = _texture_sizes(surfaces.sides, texels)
    count = len(shapes)
    bodies: list[tuple[int, int]] = []
    if crowd is not None:
        sides = np.concatenate([body_surfaces.sides for body_surfaces in crowd.surfaces])
        bodies = _texture_sizes(sides, np.full(len(sides), _TEXEL_OF_BODIES))

    def texture(m: int) -> Bytes:
        if m < count or crowd is None:
            return painter.texture(m, *shapes[m], float(texels[m]), colour)
        return crowd.painter.texture(m - count, *bodies[m - count], _TEXEL_OF_BODIES, colour)

    return assemble_atlas(shapes, texture, colour, bodies)._replace(polish=painter.polish(colour))


def _texture_sizes(sides: Array, texels: Array) -> list[tuple[int, int]]:
    """Return rows and columns of the textures of rectangles.

    :param sides: (m, 2) width and height [m].
    :param texels: (m,) edge of a texel [m].
    """
    return [
        (
            min(max(1, round(height / texel)), _WIDTH - 8),
            min(max(1, round(width / texel)), _WIDTH - 8),
        )
        for (width, height), texel in zip(sides.tolist(), texels.tolist(), strict=True)
    ]


def assemble_atlas(
    shapes: Sequence[tuple[int, int]],
    texture: Callable[[int], Bytes],
    colour: bool,
    further: Sequence[tuple[int, int]] = (),
    repeat: bool = False,
) -> Atlas:
    """Return textures in one image, each computed when it is put there.

    :param shapes: rows and columns of each texture.
    :param texture: returns the texture (h, w) or (h, w, 3) of a number.
    :param further: shapes of textures behind the others, which stay where they are.
    :param repeat: True: textures continue periodically at their edges; False: constantly.
    """
    corners, height, width = _corners(shapes)
    if further:
        further_corners, more_height, more_width = _corners(further)
        corners += [(row + height, column) for row, column in further_corners]
        height, width = height + more_height, max(width, more_width)
        shapes = [*shapes, *further]
    image = np.zeros((height, width, *(3,) * colour), np.uint8)
    for m in range(len(shapes)):
        level = texture(m)
        for k, (row, column) in enumerate(corners[m * LEVELS : (m + 1) * LEVELS]):
            level = _next_level(level) if k else level
            _put(image, level, row, column, repeat)
    size = np.array(shapes, dtype=np.float32).reshape(-1, 2)[:, ::-1]
    corner = np.array(corners, dtype=np.float32).reshape(len(shapes), LEVELS, 2)[..., ::-1]
    return Atlas(image, size, corner + np.float32(_EDGE))


def _put(image: Bytes, level: Bytes, row: int, column: int, repeat: bool) -> None:
    """Copy a level into the atlas, with a border of one texel."""
    rows, columns = (length + 2 * _EDGE for length in level.shape[:2])
    region = image[row : row + rows, column : column + columns]
    region[_EDGE:-_EDGE, _EDGE:-_EDGE] = level
    start_source, end_source = (-2, 1) if repeat else (1, -2)
    region[:, 0], region[:, -1] = region[:, start_source], region[:, end_source]
    region[0], region[-1] = region[start_source], region[end_source]


def _corners(shapes: Sequence[tuple[int, int]]) -> tuple[list[tuple[int, int]], int, int]:
    """Return row and column of all levels of textures, and height and width of the atlas."""
    of_levels = [shape for height, width in shapes for shape in _shapes_of_levels(height, width)]
    corners, height = _pack([(rows + 2 * _EDGE, cols + 2 * _EDGE) for rows, cols in of_levels])
    return corners, height, max(_WIDTH, *(columns + 2 * _EDGE for _, columns in of_levels))


_EMPTY: Final = 4
"""Edge of an empty corner of the atlas: it keeps the positions of the textures, on which the last
bits of texture coordinates depend [texels]."""


def _pack(shapes: list[tuple[int, int]]) -> tuple[list[tuple[int, int]], int]:
    """Return row and column of each rectangle on shelves, and the height of the shelves."""
    corners: list[tuple[int, int]] = [(0, 0)] * len(shapes)
    row, column, shelf = 0, _EMPTY, _EMPTY
    for k in sorted(range(len(shapes)), key=lambda k: -shapes[k][0]):
        height, width = shapes[k]
        if column + width > _WIDTH and column:
            row, column, shelf = row + shelf, 0, 0
        corners[k] = (row, column)
        column, shelf = column + width, max(shelf, height)
    return corners, row + shelf


def _shapes_of_levels(height: int, width: int) -> Iterator[tuple[int, int]]:
    """Yield the shapes of a texture and its mip levels."""
    for _ in range(LEVELS):
        yield height, width
        height, width = ceil_divide(height, 2), ceil_divide(width, 2)


def _next_level(finer: Bytes) -> Bytes:
    """Return the next coarser mip level: each texel is the rounded mean of four."""
    even = finer
    for axis in (0, 1):
        if finer.shape[axis] % 2:
            even = np.concatenate([even, even.take([-1], axis=axis)], axis=axis)
    two = even[::2].astype(np.uint16)
    two += even[1::2]
    four = two[:, ::2] + two[:, 1::2]
    four += 2
    four >>= 2
    return four.astype(np.uint8)


def _shape(surfaces: Surfaces, m: int, parameters: SceneParameters) -> tuple[int, int]:
    """Return rows and columns of a surface's texture."""
    match parameters:
        case AprilgridParameters() if surfaces.texture[m] == "aprilgrid":
            pitch, gap = _tag_texels(parameters)
            return parameters.rows * pitch + gap, parameters.columns * pitch + gap
        case CheckerboardParameters() if surfaces.texture[m] == "checkerboard":
            return (parameters.rows + 1) * _SQUARE, (parameters.columns + 1) * _SQUARE
    sides = [np.sqrt((side * side).sum(axis=1)) for side in (surfaces.across, surfaces.up)]
    texel = max(SMALLEST_TEXEL, math.sqrt(float((sides[0] * sides[1]).sum()) / MOST_TEXELS))
    width, height = (max(4, round(float(side[m]) / texel)) for side in sides)
    return min(height, _WIDTH - 8), min(width, _WIDTH - 8)


def _texture(surfaces: Surfaces, m: int, parameters: SceneParameters) -> Bytes:
    """Return a surface's texture; its first row lies at t = 0, its first column at s = 0."""
    match parameters:
        case AprilgridParameters() if surfaces.texture[m] == "aprilgrid":
            return _aprilgrid(parameters)
        case CheckerboardParameters() if surfaces.texture[m] == "checkerboard":
            return _checkerboard(parameters)
    return _blocks(parameters.seed, m, *_shape(surfaces, m, parameters))


def _blocks(seed: int, number: int, height: int, width: int) -> Bytes:
    """Return a sum of octaves of squares with random grey values: corners at every scale."""
    grids = []
    for cell, weight in _CELLS:
        stream = generator_at(seed, f"scene.texture.{cell}", number)
        shape = ceil_divide(height, cell), ceil_divide(width, cell)
        grids.append(weight * stream.integers(0, 256, shape, dtype=np.int32))
    everything = sum(weight for _, weight in _CELLS)
    result = np.empty((height, width), np.uint8)
    for top in range(0, height, _ROWS):
        part = result[top : top + _ROWS]
        total = np.zeros(part.shape, np.int32)
        for (cell, _), grid in zip(_CELLS, grids, strict=True):
            cells = grid[top // cell : (top + _ROWS) // cell]
            total += cells.repeat(cell, axis=0).repeat(cell, axis=1)[: len(part), :width]
        total //= everything
        total -= 128
        part[:] = np.clip(128 + total * _CONTRAST // 5, 0, 255)
    return result


def _colour(parameters: SceneParameters, number: int, texture: Bytes) -> Bytes:
    """Return a texture in red, green and blue: squares of random tints on its grey values."""
    if isinstance(parameters, TargetParameters):
        return np.repeat(texture[..., None], 3, axis=2)
    height, width = texture.shape
    total = np.repeat(texture[..., None], 3, axis=2).astype(np.int16)
    for cell in _TINT_CELLS:
        stream = generator_at(parameters.seed, f"scene.tint.{cell}", number)
        shape = (ceil_divide(height, cell), ceil_divide(width, cell), 3)
        tint = stream.integers(-_TINT, _TINT + 1, shape, dtype=np.int16)
        total += tint.repeat(cell, axis=0).repeat(cell, axis=1)[:height, :width]
    return np.clip(total, 0, 255).astype(np.uint8)


def _tag_texels(p: AprilgridParameters) -> tuple[int, int]:
    """Return the distance from tag to tag, and the width of the gap between two [texels]."""
    gap = max(1, round(p.tag_spacing * 10 * _TAG_CELL))
    return 10 * _TAG_CELL + gap, gap


def _aprilgrid(p: AprilgridParameters) -> Bytes:
    """Return kalibr's grid: tags of ten cells, a black square in each corner between them.

    Texels divide cells and gaps alike if the spacing is a multiple of 1/80 of a tag.
    """
    pitch, gap = _tag_texels(p)
    tag_texels = pitch - gap
    image = np.full((p.rows * pitch + gap, p.columns * pitch + gap), 255, np.uint8)
    for number in range(p.rows * p.columns):
        row, column = divmod(number, p.columns)
        cells = tag(number).repeat(_TAG_CELL, axis=0).repeat(_TAG_CELL, axis=1)
        top, left = gap + row * pitch, gap + column * pitch
        # Rows of the texture go up, those of a printed tag down.
        image[top : top + tag_texels, left : left + tag_texels] = cells[::-1]
    for row in range(p.rows + 1):
        for column in range(p.columns + 1):
            image[row * pitch : row * pitch + gap, column * pitch : column * pitch + gap] = 0
    return image


def _checkerboard(p: CheckerboardParameters) -> Bytes:
    """Return (columns + 1) x (rows + 1) squares, black in the lower left."""
    row, column = np.indices((p.rows + 1, p.columns + 1))
    squares = np.where((row + column) % 2, 255, 0).astype(np.uint8)
    return squares.repeat(_SQUARE, axis=0).repeat(_SQUARE, axis=1)
