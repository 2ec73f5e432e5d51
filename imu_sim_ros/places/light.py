# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Light on rectangles, computed once: lamps, windows, sun, sky, and what surfaces give back.

Surfaces are matt. In units of pi times a radiance, the irradiance of a point is

``E = sum over lamps of L A cos cos' / (pi r^2) + sun cos + mean over the hemisphere of rho E'``

with the lamps and the sun only as far as nothing is between, which makes soft shadows, and the last
term, cosine-weighted, of what each direction meets first: corners are darker, and a red wall tints
the floor (Goral et al., Modeling the interaction of light between diffuse surfaces, 1984).
"""

import math
from collections.abc import Sequence
from functools import cache
from typing import Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from imu_sim_ros.core.types import Array, Integers, Mask, Single
from imu_sim_ros.places.geometry import Caster, Floats, Rectangle, Surfaces, surfaces
from imu_sim_ros.places.sight import is_hidden_place

_POINTS: Final = 24_000
"""Points at which light is computed, about."""
_COARSE: Final = 3_500
"""Points for the light that surfaces give to each other, which is smooth."""
_NEAREST: Final = 0.1
"""Smallest distance of two points at which light is computed [m]."""
_SMALL: Final = 0.02
"""Area of a surface below which its shadow is too small to be visible [m^2]."""
_DIRECTIONS: Final = 28
"""Directions from each point into its hemisphere; neighbours use four turns of the pattern."""
_BOUNCES: Final = 4
"""Number of reflections of the light."""
_SAMPLES: Final = 2
"""Points along each side of a lamp."""
_LEAST: Final = np.float32(1e-3)
"""Irradiance by a lamp that is left out on matt surfaces. Gloss needs it at any distance: a lobe
multiplies it by up to 2049, and where it ended a highlight would end at once."""
_OFF: Final = np.float32(2e-3)
"""Distance in front of a surface at which its rays start [m]."""


class Lamp(NamedTuple):
    """A rectangle that gives light to the side of its normal; a window by day is one, too."""

    rectangle: Rectangle
    colour: tuple[float, float, float]
    """Radiance of red, green and blue."""


class Lighting(NamedTuple):
    """Sources of light of a place: lamps, windows, sun and sky."""

    lamps: Sequence[Lamp] = ()
    to_sun: tuple[float, float, float] = (0.0, 0.0, 1.0)
    """Unit vector towards the sun."""
    sun: tuple[float, float, float] = (0.0, 0.0, 0.0)
    """Irradiance of red, green and blue across the sun's rays; 0: there is no sun."""
    windows: Sequence[Rectangle] = ()
    """Openings through which the sun shines into a house; none: it shines everywhere."""
    sky: tuple[float, float, float] = (0.0, 0.0, 0.0)
    """Radiance of the sky, for directions that hit no matt surface."""


class Baked(NamedTuple):
    """Light on m surfaces; rows go up, columns across, values are of the middles of even parts."""

    total: list[Single]
    """Irradiance of red, green and blue on each surface, (rows, columns, 3)."""
    sources: list[Single]
    """Light of each lamp and the sun on each surface, (lamps + 1, rows, columns), without colour
    and exposure."""
    exposure: np.float32 = np.float32(1.0)
    """Exposure factor contained in the total."""

    def expose(self, factor: np.float32) -> "Baked":
        """Return the same light with another exposure factor."""
        return Baked([factor * irradiance for irradiance in self.total], self.sources, factor)


class _Points(NamedTuple):
    """The points of all surfaces, one surface after the other, row by row."""

    places: Single
    """(n, 3) positions, a little in front of the surface [m]."""
    normals: Single
    """(n, 3) unit normals."""
    surface: Integers
    """(n,) numbers of the surfaces."""
    shapes: Integers
    """(m, 2) rows and columns of each surface."""
    first: Integers
    """(m,) number of each surface's first point."""

    @classmethod
    def on(cls, where: Surfaces, lit: Mask, count: int, detail: Array | float) -> "_Points":
        """Return about ``count`` points spread evenly; unlit surfaces have one each."""
        sides = where.sides
        density = np.broadcast_to(detail, (len(sides),))
        area = float((sides.prod(axis=1) * density * density)[lit].sum())
        spacing = max(_NEAREST, math.sqrt(area / count))
        shapes = np.maximum(np.ceil(sides[:, ::-1] * density[:, None] / spacing), 1).astype(
            np.int64
        )
        shapes[~lit] = 1
        places, normals, numbers = [], [], []
        for m, (rows, columns) in enumerate(shapes.tolist()):
            t, s = ((np.arange(n) + 0.5) / n for n in (rows, columns))
            grid = (
                where.origin[m]
                + s[None, :, None] * where.across[m]
                + t[:, None, None] * where.up[m]
            )
            places.append(grid.reshape(-1, 3))
            numbers.append(np.full(rows * columns, m))
        surface = np.concatenate(numbers)
        normals = where.normal.astype(np.float32)[surface]
        first = np.cumsum(shapes.prod(axis=1)) - shapes.prod(axis=1)
        positions = np.concatenate(places).astype(np.float32) + _OFF * normals
        return cls(places=positions, normals=normals, surface=surface, shapes=shapes, first=first)

    def of(self, m: int, values: Single) -> Single:
        """Return the values (..., rows, columns) of surface m out of those (..., n) of all."""
        rows, columns = self.shapes[m].tolist()
        part = values[..., self.first[m] : self.first[m] + rows * columns]
        return part.reshape(*part.shape[:-1], rows, columns)

    def at(self, where: Surfaces, number: Integers, places: Single) -> Integers:
        """Return the numbers (n,) of the points nearest to places (n, 3) on surfaces (n,)."""
        offset = places - where.origin.astype(np.float32)[number]
        index = []
        for k, side in ((1, where.across), (0, where.up)):
            unit = (side / (side * side).sum(axis=1, keepdims=True)).astype(np.float32)[number]
            share = (
                offset[:, 0] * unit[:, 0] + offset[:, 1] * unit[:, 1] + offset[:, 2] * unit[:, 2]
            )
            count = self.shapes[number, k]
            index.append(np.clip((share * count).astype(np.int64), 0, count - 1))
        result: Integers = self.first[number] + index[1] * self.shapes[number, 1] + index[0]
        return result


def bake(
    where: Surfaces,
    albedo: Floats,
    sky: Mask,
    lighting: Lighting,
    detail: Array | float = 1.0,
    mirrors: Mask | None = None,
) -> Baked:
    """Return the light on m surfaces.

    :param albedo: (m, 3) mean share of red, green and blue that each surface reflects.
    :param sky: (m,) surfaces of the sky, which give its light and let the sun through.
    :param detail: (m,) density of the points on each surface, relative to the mean.
    :param mirrors: (m,) surfaces with gloss, which lamps light at any distance; None: none.
    """
    casting = ~sky & (where.sides.prod(axis=1) > _SMALL)
    solid = Caster(where.some(casting), np.float32)
    fine, coarse = (_Points.on(where, ~sky, count, detail) for count in (_POINTS, _COARSE))
    thresholds = np.full(len(sky), _LEAST) if mirrors is None else np.where(mirrors, 0, _LEAST)
    (direct, sources), (start, _) = (
        _direct(points, solid, lighting, threshold)
        for points, threshold in ((fine, thresholds), (coarse, np.full(len(sky), _LEAST)))
    )
    bounced = _reflected_irradiance(coarse, where, albedo.astype(np.float32), sky, start, lighting)
    maps = []
    for m, (rows, columns) in enumerate(fine.shapes.tolist()):
        fine_map, coarse_map = (
            np.moveaxis(p.of(m, v.T), 0, 2) for p, v in ((fine, direct), (coarse, bounced))
        )
        maps.append(fine_map + resample(resample(coarse_map, 1, columns), 0, rows))
    return Baked(maps, [fine.of(m, sources) for m in range(len(maps))])


def resample(grid: Single, axis: int, length: int, start: int = 0, some: int = 0) -> Single:
    """Return values on an even grid along an axis, interpolated to another even grid.

    Values belong to the middles of the cells.

    :param length: number of cells of the new grid.
    :param start: first cell that is returned.
    :param some: number of cells that are returned; 0: all.
    """
    parts = grid.shape[axis]
    index = np.arange(start, start + (some or length)).astype(np.float32) + np.float32(0.5)
    place = np.clip(index * np.float32(parts / length) - np.float32(0.5), 0, parts - 1)
    index_below = np.floor(place).astype(np.int64)
    share = place - index_below.astype(np.float32)
    share = share.reshape(-1, *(1,) * (grid.ndim - 1 - axis))
    low = grid.take(index_below, axis=axis)
    low *= 1 - share
    result = grid.take(np.minimum(index_below + 1, parts - 1), axis=axis)
    result *= share
    result += low
    return result


def _direct(
    points: _Points, solid: Caster, lighting: Lighting, threshold: Single
) -> tuple[Single, Single]:
    """Return the irradiance (n, 3) by lamps and sun, and that by each source (lamps + 1, n).

    The latter is without the colour of the source.

    :param threshold: (m,) irradiance by a lamp that is left out on each surface.
    """
    sources = np.zeros((len(lighting.lamps) + 1, len(points.places)), np.float32)
    total = _lamp_irradiance(points, solid, lighting, sources, threshold[points.surface])
    total += _sun_irradiance(points, solid, lighting, sources[-1])
    return total, sources


def _lamp_irradiance(
    points: _Points, solid: Caster, lighting: Lighting, sources: Single, threshold: Single
) -> Single:
    """Return the irradiance (n, 3) by lamps, and add that of each lamp to ``sources``.

    A lamp is a grid of small Lambertian emitters: each gives ``cos cos' area / (pi d^2)`` of its
    radiance to points at a distance d that see it.

    :param solid: surfaces that cast shadows.
    :param sources: (lamps, n) irradiance of each lamp without its colour, which is added to.
    :param threshold: (n,) irradiance by a lamp that is left out at each point.
    """
    result = np.zeros_like(points.places)
    for lamp, alone in zip(lighting.lamps, sources, strict=False):
        origin, across, up = lamp.rectangle
        normal = np.cross(across, up)
        area = math.sqrt(float(normal @ normal))
        colour = np.array(lamp.colour, np.float32)
        normal = (normal / area).astype(np.float32)
        share = np.float32(area / (math.pi * _SAMPLES**2))
        for i, j in np.ndindex(_SAMPLES, _SAMPLES):
            place = origin + (i + 0.5) / _SAMPLES * across + (j + 0.5) / _SAMPLES * up
            place = place.astype(np.float32) + _OFF * normal
            way = place - points.places
            square = _dot(way, way)
            cos_lamp, cos_surface = (
                -_dot(way, normal[None].astype(np.float32)),
                _dot(way, points.normals),
            )
            square = np.maximum(square, np.float32(0.02))
            value = share * np.maximum(cos_lamp, 0) * np.maximum(cos_surface, 0) / (square * square)
            rows = np.flatnonzero(value * colour.max() > threshold / _SAMPLES**2)
            lit = rows[~is_hidden_place(solid.surfaces, place, normal, points.places[rows])]
            result[lit] += value[lit, None] * colour
            alone[lit] += value[lit]
    return result


def _sun_irradiance(points: _Points, solid: Caster, lighting: Lighting, alone: Single) -> Single:
    """Return the irradiance (n, 3) by the sun; add it without colour to ``alone`` (n,)."""
    result = np.zeros_like(points.places)
    colour = np.array(lighting.sun, np.float32)
    if not colour.any():
        return result
    to_sun = np.array(lighting.to_sun, np.float32)
    height = _dot(points.normals, to_sun[None])
    rows = np.flatnonzero(height > 0)
    way = np.broadcast_to(to_sun, (len(rows), 3))
    ends: Floats | float = math.inf
    if lighting.windows:
        panes = Caster(surfaces(lighting.windows, hides=True), np.float32)
        ends = panes.cast(points.places[rows], way).distance
        finite = np.isfinite(ends)
        rows, way = rows[finite], way[finite]
        ends = ends[finite] - np.float32(0.02)
    lit = rows[~solid.is_blocked(points.places[rows], way, ends)]
    result[lit] = height[lit, None] * colour
    alone[lit] = height[lit]
    return result


def _reflected_irradiance(
    points: _Points,
    where: Surfaces,
    albedo: Single,
    sky: Mask,
    direct: Single,
    lighting: Lighting,
) -> Single:
    """Return the irradiance (n, 3) of red, green and blue by light that other surfaces reflect.

    :param points: n points on the surfaces.
    :param albedo: (m, 3) albedo of each surface.
    :param sky: (m,) True for surfaces that are the sky, which give its light.
    :param direct: (n, 3) irradiance by lamps, sun and sky.
    """
    hits = _ray_hits(points, Caster(where, np.float32))
    colour = np.array(lighting.sky, np.float32)
    of_point = albedo[points.surface]
    dark = sky[points.surface]
    total = direct
    for _ in range(_BOUNCES):
        reflected = np.concatenate([of_point * total, colour[None]])
        reflected[:-1][dark] = colour
        sums = np.zeros_like(direct)
        for k in range(_DIRECTIONS):
            sums += reflected[hits[k]]
        sums /= np.float32(_DIRECTIONS)
        returned = _smooth_on_surface(sums, points)
        total = direct + returned
    return returned


def _ray_hits(points: _Points, caster: Caster) -> NDArray[np.int32]:
    """Return the number of the point that each ray meets (directions, n); n: it meets none."""
    count, where = len(points.places), caster.surfaces
    sides = [
        (side / np.sqrt((side * side).sum(axis=1, keepdims=True))).astype(np.float32)[
            points.surface
        ]
        for side in (where.across, where.up)
    ]
    index = np.arange(count) - points.first[points.surface]
    columns = points.shapes[points.surface, 1]
    turn = 2 * ((index // columns) % 2) + (index % columns) % 2
    turns = [[_direction(k, quarter) for quarter in range(4)] for k in range(_DIRECTIONS)]
    pattern = np.array(turns, np.float32)[:, turn]
    ways = pattern[..., :1] * sides[0] + pattern[..., 1:2] * sides[1]
    ways += pattern[..., 2:] * points.normals
    starts, ways = np.tile(points.places, (_DIRECTIONS, 1)), ways.reshape(-1, 3)
    hits = caster.cast(starts, ways)
    rays = np.flatnonzero(hits.surface >= 0)
    positions = starts[rays] + hits.distance[rays, None] * ways[rays]
    result = np.full(len(starts), count, np.int32)
    result[rays] = points.at(where, hits.surface[rays], positions)
    return result.reshape(_DIRECTIONS, count)


def _direction(k: int, quarter: int) -> tuple[float, float, float]:
    """Return unit vector k of a pattern around z whose density goes with the cosine to z.

    :param quarter: turn of the pattern, 0 to 3 quarters of its step.
    """
    share = (k + 0.125 + 0.25 * quarter) / _DIRECTIONS
    angle = (k + 0.25 * quarter) * math.pi * (3.0 - math.sqrt(5.0))
    radius = math.sqrt(share)
    x, y, z = radius * math.cos(angle), radius * math.sin(angle), math.sqrt(1.0 - share)
    return round(x, 7), round(y, 7), round(z, 7)


def _smooth_on_surface(values: Single, points: _Points) -> Single:
    """Return values of all points averaged with their neighbours on the same surface."""
    result = values.copy()
    for (rows, columns), start in zip(points.shapes.tolist(), points.first.tolist(), strict=True):
        part = slice(start, start + rows * columns)
        grid = values[part].reshape(rows, columns, 3)
        for _ in range(2):
            for axis in (0, 1):
                if grid.shape[axis] > 2:
                    grid = _blur(grid, axis)
        result[part] = grid.reshape(-1, 3)
    return result


def _blur(grid: Single, axis: int) -> Single:
    """Return values averaged with their neighbours along an axis, with weights 1, 2, 1."""
    wide = [(0, 0)] * 3
    wide[axis] = (1, 1)
    padded = np.pad(grid, wide, mode="edge")
    length = grid.shape[axis]
    parts = [np.take(padded, np.arange(k, k + length), axis=axis) for k in range(3)]
    result: Single = (parts[0] + parts[1] + parts[1] + parts[2]) * np.float32(0.25)
    return result


def _dot(a: Single, b: Single) -> Single:
    """Return the scalar products (n,) of vectors (n, 3)."""
    result: Single = a[:, 0] * b[:, 0] + a[:, 1] * b[:, 1] + a[:, 2] * b[:, 2]
    return result


GAMMA: Final = 2.2
"""Exponent of the light over an sRGB value, nearly."""
_STEPS: Final = 1024
"""Steps of irradiance 1 in the table of factors."""
_BRIGHTEST: Final = 8.0
"""Largest irradiance in the table of grey values."""
_KNEE: Final = 0.5
"""Irradiance up to which the film is linear."""
_WHITE: Final = 1.08
"""Limit of the film's response."""


def factors(irradiance: Single) -> Single:
    """Return the factors of sRGB values under an irradiance.

    That is the power 1 / 2.2 of an irradiance that tends to 1.08, as a film's: bright walls keep
    their texture. A table of powers holds the same bits everywhere.
    """
    steps = np.clip(irradiance, 0, _BRIGHTEST) * np.float32(_STEPS)
    return _table()[steps.astype(np.int64)]


@cache
def _table() -> Single:
    """Return the pixel values (m,) of m steps of light, with a shoulder above the knee."""
    values = []
    for k in range(int(_BRIGHTEST * _STEPS) + 1):
        light, room = (k + 0.5) / _STEPS, _WHITE - _KNEE
        if light > _KNEE:
            light = _KNEE + room * (1.0 - math.exp((_KNEE - light) / room))
        values.append(round(light ** (1.0 / GAMMA), 6))
    return np.array(values, np.float32)
