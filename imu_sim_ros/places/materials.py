# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Materials of surfaces: seeded tiles of colour at their real size that repeat without a seam.

A material is named ``KIND`` or ``KIND:RRGGBB``, for instance ``brick`` or ``paint:c8d2d8``.
Colours are sRGB values, 0 to 255, under a light that leaves white white.
"""

import math
from collections.abc import Callable
from typing import Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from imu_sim_ros.core.random_streams import generator
from imu_sim_ros.core.types import Array, Bytes, Integers

Differences = NDArray[np.int8]
Stream = np.random.Generator

CONTRASTS: Final = {"blank": 0.25, "plain": 0.8, "rich": 1.3}
"""Factor on the differences within a material, for each ``scene.texture``."""


class Canvas(NamedTuple):
    """A tile to be painted: its grid of texels, and its random stream."""

    rows: int
    columns: int
    texel: float
    """Edge of a texel [m]."""
    stream: Stream

    def noise(self, cell: float, across: float = 0.0) -> Array:
        """Return smooth noise (rows, columns) from -1 to 1 that repeats without a seam.

        :param cell: distance of its knots along the rows, and along the columns without
            ``across`` [m].
        """
        shape = [
            max(1, min(length, round(length * self.texel / size)))
            for length, size in ((self.rows, across or cell), (self.columns, cell))
        ]
        knots = self.stream.integers(-1000, 1001, shape).astype(np.float32) / np.float32(1000.0)
        return _stretch(_stretch(knots, self.rows, 0), self.columns, 1)

    def grain(self) -> Array:
        """Return noise (rows, columns) from -1 to 1, independent from texel to texel."""
        values = self.stream.integers(-1000, 1001, (self.rows, self.columns))
        return values.astype(np.float32) / np.float32(1000.0)

    def cells(self, length: float, width: float, shift: float = 0.0) -> "Cells":
        """Return a division of the tile into equal cells.

        :param length: approximate length of a cell along a row [m].
        :param width: approximate width of a cell, across the rows [m].
        :param shift: shift of every second row of cells, in lengths of a cell.
        """
        count = [
            max(1, round(size * self.texel / edge))
            for size, edge in ((self.rows, width), (self.columns, length))
        ]
        if shift:
            count[0] += count[0] % 2
        y = (np.arange(self.rows, dtype=np.float32) + np.float32(0.5)) * np.float32(
            count[0] / self.rows
        )
        x = (np.arange(self.columns, dtype=np.float32) + np.float32(0.5)) * np.float32(
            count[1] / self.columns
        )
        row = np.floor(y).astype(np.int64)
        along = x[None, :] + (row[:, None] % 2) * np.float32(shift)
        column = np.floor(along).astype(np.int64) % count[1]
        part = along - np.floor(along)
        edge_x = np.minimum(part, 1 - part) * np.float32(self.columns * self.texel / count[1])
        part_y = y - np.floor(y)
        edge_y = np.minimum(part_y, 1 - part_y) * np.float32(self.rows * self.texel / count[0])
        number = np.broadcast_to(row[:, None], column.shape) * count[1] + column
        return Cells(number, count[0] * count[1], np.minimum(edge_x, edge_y[:, None]))


class Cells(NamedTuple):
    """Division of a tile into rectangular cells, such as bricks."""

    number: Integers
    """(rows, columns) number of each texel's cell."""
    cells: int
    """Number of cells."""
    edge: Array
    """(rows, columns) distance from the cell's edge [m]."""


def _stretch(knots: Array, length: int, axis: int) -> Array:
    """Return knots (a, b) interpolated along an axis, the last followed by the first."""
    count = knots.shape[axis]
    place = np.arange(length, dtype=np.float32) * np.float32(count / length)
    whole = np.floor(place).astype(np.int64) % count
    part = place - np.floor(place)
    part = part * part * (np.float32(3.0) - np.float32(2.0) * part)
    part = part if axis else part[:, None]
    result: Array = knots.take(whole, axis) * (1 - part)
    result += knots.take((whole + 1) % count, axis) * part
    return result


def _tint(colour: Array, value: Array, tint: Array | None = None) -> Array:
    """Return colours (3, rows, columns): a colour (3,) plus a value [grey values] and a tint."""
    result: Array = colour[:, None, None] + value
    return result if tint is None else result + tint


def _plaster_colours(c: Canvas, colour: Array) -> Array:
    """Return the colours (3, rows, columns) of plaster with grain and faint clouds."""
    return _tint(colour, 3 * c.noise(0.6) + 2 * c.noise(0.05) + 4 * c.noise(0.012) + 2 * c.grain())


def _concrete_colours(c: Canvas, colour: Array) -> Array:
    """Return the colours (3, rows, columns) of concrete with clouds, pores and stains."""
    value = 9 * c.noise(0.7) + 7 * c.noise(0.2) + 8 * c.noise(0.03) + 4 * c.grain()
    pores, spots = c.noise(0.012), c.noise(0.05)
    value += 18 * (spots > 0.75) - 22 * (spots < -0.75)  # splashes and stains
    return _tint(colour, value - 45 * (pores > 0.93))


def _wood_colours(c: Canvas, colour: Array) -> Array:
    """Return the colours (3, rows, columns) of planks with grain and joints."""
    planks = c.cells(2.0, 0.13)
    tone = c.stream.integers(-14, 15, planks.cells).astype(np.float32)[planks.number]
    grain = 10 * c.noise(0.35, 0.012) + 6 * c.noise(0.15, 0.005) + 5 * c.noise(0.8, 0.04)
    value = tone + grain - 50 * (planks.edge < 0.0015)
    return _tint(colour, value, np.stack([0.1 * grain, 0 * grain, -0.3 * grain]))


def _board_colours(c: Canvas, colour: Array) -> Array:
    """Return the colours (3, rows, columns) of veneer without joints."""
    grain = 9 * c.noise(0.5, 0.02) + 5 * c.noise(0.2, 0.006) + 2 * c.grain()
    return _tint(colour, grain, np.stack([0.1 * grain, 0 * grain, -0.3 * grain]))


def _brick_colours(c: Canvas, colour: Array) -> Array:
    """Return the colours (3, rows, columns) of bricks in mortar."""
    bricks = c.cells(0.25, 0.0833, 0.5)
    tone = c.stream.integers(-34, 35, bricks.cells).astype(np.float32)[bricks.number]
    hue = c.stream.integers(-10, 11, bricks.cells).astype(np.float32)[bricks.number]
    value = tone + 8 * c.noise(0.03) + 6 * c.grain()
    face = _tint(colour, value, np.stack([hue, -0.3 * hue, -0.5 * hue]))
    mortar = _tint(np.array([176, 170, 160], np.float32), 6 * c.noise(0.02) + 6 * c.grain())
    return np.where(bricks.edge < 0.006, mortar, face)


def _tiles_colours(c: Canvas, colour: Array, edge: float = 0.333, joint: float = 0.003) -> Array:
    """Return the colours (3, rows, columns) of tiles with an edge and joints of some width [m]."""
    tiles = c.cells(edge, edge)
    tone = c.stream.integers(-6, 7, tiles.cells).astype(np.float32)[tiles.number]
    chips = c.noise(0.022)
    value = tone + 3 * c.noise(0.1) + 2 * c.grain() + 24 * (chips > 0.62) - 34 * (chips < -0.62)
    return _tint(colour, value - 55 * (tiles.edge < joint))


def _slabs_colours(c: Canvas, colour: Array) -> Array:
    """Return the colours (3, rows, columns) of stone slabs of half a metre."""
    return _tiles_colours(c, colour, 0.5, 0.005) + (5 * c.grain() + 5 * c.noise(0.06))


def _ceiling_colours(c: Canvas, colour: Array) -> Array:
    """Return the colours (3, rows, columns) of mineral fibre tiles of 0.6 m between bars."""
    tiles = c.cells(0.6, 0.6)
    tone = c.stream.integers(-5, 6, tiles.cells).astype(np.float32)[tiles.number]
    holes, fissures = c.noise(0.009) > 0.82, c.noise(0.035, 0.015) > 0.66
    value = tone + 2 * c.noise(0.4) - 34 * holes - 48 * fissures + 2 * c.grain()
    value = np.where(tiles.edge < 0.018, 6.0 - 76 * (tiles.edge > 0.012), value)
    return _tint(colour, value.astype(np.float32))


def _carpet_colours(c: Canvas, colour: Array) -> Array:
    """Return the colours (3, rows, columns) of carpet tiles of half a metre."""
    tiles = c.cells(0.5, 0.5)
    tone = c.stream.integers(-5, 6, tiles.cells).astype(np.float32)[tiles.number]
    value = (
        tone + 16 * c.grain() + 9 * c.noise(0.015) + 4 * c.noise(0.3) - 10 * (tiles.edge < 0.002)
    )
    return _tint(colour, value)


def _flecked_carpet_colours(c: Canvas, colour: Array) -> Array:
    """Return the colours (3, rows, columns) of carpet tiles with light and dark flecks of yarn."""
    tiles = c.cells(0.5, 0.5)
    tone = c.stream.integers(-9, 10, tiles.cells).astype(np.float32)[tiles.number]
    yarn = c.noise(0.06, 0.018)
    value = tone + 16 * c.grain() + 9 * c.noise(0.015) + 4 * c.noise(0.3)
    value += 46 * (yarn > 0.6) - 40 * (yarn < -0.6) - 16 * (tiles.edge < 0.003)
    return _tint(colour, value)


def _metal_colours(c: Canvas, colour: Array) -> Array:
    """Return the colours (3, rows, columns) of brushed metal."""
    return _tint(colour, 5 * c.noise(0.5) + 4 * c.noise(0.3, 0.004) + 2 * c.grain())


def _ribbed_sheet_colours(c: Canvas, colour: Array) -> Array:
    """Return the colours (3, rows, columns) of trapezoidal sheet with a rib every 0.2 m."""
    x = (np.arange(c.columns, dtype=np.float32) * np.float32(c.texel) % np.float32(0.2)) * 5
    rib = np.where(x < 0.5, 0.0, np.where(x < 0.6, -38.0, np.where(x < 0.9, -14.0, 26.0)))
    return _tint(colour, rib.astype(np.float32)[None, :] + 4 * c.noise(0.5) + 2 * c.grain())


def _paint_colours(c: Canvas, colour: Array) -> Array:
    """Return the colours (3, rows, columns) of an even coat of paint."""
    return _tint(colour, 2 * c.noise(0.3) + 2 * c.grain())


def _asphalt_colours(c: Canvas, colour: Array) -> Array:
    """Return the colours (3, rows, columns) of coarse-grained asphalt."""
    return _tint(colour, 18 * c.grain() + 8 * c.noise(0.02) + 7 * c.noise(0.9) + 5 * c.noise(0.2))


def _cardboard_colours(c: Canvas, colour: Array) -> Array:
    """Return the colours (3, rows, columns) of cardboard with faint flutes."""
    return _tint(colour, 4 * c.noise(0.3) + 4 * c.noise(0.6, 0.008) + 2 * c.grain())


def _leaves_colours(c: Canvas, colour: Array) -> Array:
    """Return the colours (3, rows, columns) of foliage with dark gaps."""
    value = 34 * c.noise(0.05) + 26 * c.noise(0.12) + 18 * c.noise(0.025) + 10 * c.grain()
    value -= 30 * (c.noise(0.08) < -0.45)
    return _tint(colour, value, np.stack([0.2 * value, 0.1 * value, -0.3 * value]))


def _grass_colours(c: Canvas, colour: Array) -> Array:
    """Return the colours (3, rows, columns) of short grass."""
    value = 20 * c.grain() + 10 * c.noise(0.04) + 8 * c.noise(0.4)
    return _tint(colour, value, np.stack([0.3 * value, 0 * value, -0.2 * value]))


_WEAR: Final = {
    "plaster": 4.0,
    "concrete": 8.0,
    "wood": 5.0,
    "board": 4.0,
    "brick": 9.0,
    "tiles": 5.0,
    "slabs": 8.0,
    "ceiling": 4.0,
    "carpet": 9.0,
    "flecked": 9.0,
    "metal": 4.0,
    "ribbed": 4.0,
    "paint": 3.0,
    "asphalt": 10.0,
    "cardboard": 4.0,
    "leaves": 16.0,
    "grass": 12.0,
}
"""Amplitude of stains and wear on each kind [grey values]."""
WEAR_PERIODS: Final = (2.63, 3.49)
"""Lengths after which the layers of wear repeat [m]: with the tile's own, no two are in a ratio of
small whole numbers, so that a surface repeats nowhere within a place."""

_KINDS: Final[dict[str, tuple[Callable[..., Array], str, float]]] = {
    "plaster": (_plaster_colours, "e6e4de", 2.4),
    "concrete": (_concrete_colours, "a09e99", 3.0),
    "wood": (_wood_colours, "a87a4c", 2.0),
    "board": (_board_colours, "c8a478", 2.0),
    "brick": (_brick_colours, "9c5a42", 2.0),
    "tiles": (_tiles_colours, "c4beb2", 2.0),
    "slabs": (_slabs_colours, "a8a49c", 2.0),
    "ceiling": (_ceiling_colours, "ecebe6", 2.4),
    "carpet": (_carpet_colours, "6a7078", 2.0),
    "flecked": (_flecked_carpet_colours, "6a7078", 2.0),
    "metal": (_metal_colours, "9aa0a4", 2.0),
    "ribbed": (_ribbed_sheet_colours, "c2c8ca", 2.0),
    "paint": (_paint_colours, "e0e0dc", 1.2),
    "asphalt": (_asphalt_colours, "5c5c5e", 3.0),
    "cardboard": (_cardboard_colours, "b08c5e", 1.2),
    "leaves": (_leaves_colours, "4c6a34", 1.6),
    "grass": (_grass_colours, "5c7240", 2.0),
}
"""Painter, usual colour and length after which each kind repeats [m]."""


def colour_of(material: str) -> Array:
    """Return the mean colour (3,) of a material, sRGB 0 to 255, float32."""
    kind, _, code = material.partition(":")
    code = code or _KINDS[kind][1]
    return np.array([int(code[k : k + 2], 16) for k in (0, 2, 4)], np.float32)


_REFLECTANCES: Final = {
    "plaster": 0.75,
    "concrete": 0.35,
    "wood": 0.5,
    "board": 0.5,
    "brick": 0.35,
    "tiles": 0.6,
    "slabs": 0.35,
    "ceiling": 0.8,
    "metal": 0.4,
    "ribbed": 0.6,
    "asphalt": 0.15,
    "cardboard": 0.55,
    "leaves": 0.5,
    "grass": 0.5,
}
"""Diffuse reflectances at 905 nm: rounded; plants, asphalt, brick and concrete as in spectral
libraries, the rest assumed."""


def reflectance(material: str) -> float:
    """Return the diffuse reflectance of a material at 905 nm; NaN: it is not known.

    Paint and cloth are taken to be as bright there as they are to the eye.
    """
    kind = material.partition(":")[0]
    if kind in ("paint", "carpet", "flecked"):
        linear = (colour_of(material) / 255.0) ** 2.2
        return float(np.clip(linear @ [0.2126, 0.7152, 0.0722], 0.05, 0.9))
    return _REFLECTANCES.get(kind, math.nan)


def tile(material: str, texel: float, seed: int, contrast: float) -> Bytes:
    """Return a tile (n, n, 3) of a material that repeats without a seam.

    Rows go up, columns to the right, as on a wall.

    :param texel: edge of a texel, about [m].
    :param contrast: factor of the differences from the mean colour.
    """
    kind = material.partition(":")[0]
    painter, _, period = _KINDS[kind]
    count = max(8, 8 * round(period / texel / 8))  # halved three times without a seam
    canvas = Canvas(count, count, period / count, generator(seed, f"material.{material}"))
    colour = colour_of(material)
    mean = colour[:, None, None]
    values = painter(canvas, colour)
    values -= mean
    values *= np.float32(contrast)
    values += mean
    values += np.float32(0.5)
    planes = np.clip(values, 0.0, 255.0, out=values).astype(np.uint8)
    return np.ascontiguousarray(np.moveaxis(planes, 0, -1))


def stains(period: float, texel: float, seed: int) -> Array:
    """Return a pattern of stains and wear (n, n), about -1 to 1, that repeats without a seam.

    :param period: length after which it repeats [m].
    :param texel: edge of a texel, about [m].
    """
    count = max(8, 8 * round(period / texel / 8))
    canvas = Canvas(count, count, period / count, generator(seed, f"wear.{period}"))
    return 0.3 * canvas.noise(0.12) + 0.8 * canvas.noise(0.04) + 0.9 * canvas.noise(0.016)


def wear(kind: str, where: Array, contrast: float) -> Differences:
    """Return the grey values (n, n) that stains and wear add to a tile of a material.

    :param where: (n, n) pattern of :func:`stains`.

    :param contrast: factor of the differences.
    """
    return np.rint(np.float32(contrast * _WEAR[kind]) * where).astype(np.int8)
