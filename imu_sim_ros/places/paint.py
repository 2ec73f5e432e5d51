# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""The textures of a place: materials and prints under its light."""

import math
from collections.abc import Iterator, Sequence
from functools import cached_property
from typing import Final, TypeVar

import numpy as np
from numpy.typing import NDArray

from imu_sim_ros.core.random_streams import generator_at
from imu_sim_ros.core.types import Array, Bytes, Integers, Mask, Single
from imu_sim_ros.places.clouds import CLOUDED, clouds
from imu_sim_ros.places.geometry import nearest_distances
from imu_sim_ros.places.gloss import Polish, glossy
from imu_sim_ros.places.light import GAMMA, Baked, bake, factors, resample
from imu_sim_ros.places.materials import (
    CONTRASTS,
    WEAR_PERIODS,
    Differences,
    colour_of,
    stains,
    tile,
    wear,
)
from imu_sim_ros.places.place import Place, Site
from imu_sim_ros.places.prints import picture

_Value = TypeVar("_Value", np.uint8, np.int8)

MIDDLE: Final = {"day": 0.55, "lamps": 0.5, "dim": 0.16}
"""Median irradiance of a place's surfaces after exposure, by its light; 1 makes white white."""
_IN_LEAVES: Final = 0.7
"""Smallest light on leaves as a share of the mean of their crown."""
_TEXEL: Final = 0.0025
"""Usual edge of a texel [m]."""
_PIXEL: Final = 0.0022
"""Angle of a pixel of EuRoC's cameras [rad]."""
_SMALL: Final = 2.0
"""Area below which a face with prints may have texels of half the usual edge [m^2]."""
_STEPS: Final = 3.0
"""Largest number of doublings of the texels."""
_ROWS: Final = 256
"""Rows of a texture that are lit at once."""
_WEIGHTS: Final = (77, 150, 29)
"""Weights of red, green and blue in a grey value, in 1/256 (ITU-R BT.601)."""


class Painter:
    """Textures of the faces of a place: materials, wear, prints and light."""

    def __init__(self, place: Place, site: Site, path: Array | None = None) -> None:
        """Initialise with a place; its light is computed with the first texture.

        :param path: (n, 3) positions from which the place is seen [m]; None: unknown.
        """
        self.place, self._site = place, site
        self._surfaces = place.surfaces()
        self._path = path
        self._base: float | None = None
        """Edge of the texels of tiles, from which those of other sizes are made [m]."""
        self._tiles: dict[tuple[str, float, bool], Bytes] = {}
        self._stains: dict[tuple[float, float], Array] = {}
        self._layers: dict[tuple[str, float, float], Differences] = {}

    @cached_property
    def _albedo(self) -> Single:
        """Reflectance (m, 3) of the faces, linear."""
        return np.array([_linear(face.material) for face in self.place.faces], np.float32)

    @cached_property
    def _exposed(self) -> Baked:
        """Light on the faces, scaled to the exposure of the place."""
        sky = self.place.sky
        place, mirrors = self.place, glossy(self.place.faces, self._surfaces.sides)
        light = bake(self._surfaces, self._albedo, sky, place.lighting, place.detail, mirrors)
        self._scattered_in_leaves(light.total)
        return light.expose(_exposure(light.total, sky, self._areas(), MIDDLE[self._site.light]))

    def _scattered_in_leaves(self, light: Sequence[Single]) -> None:
        """Raise the light on leaves to a share of their crown's mean, since leaves scatter light.

        Otherwise the inner faces of a crown, of boxes that overlap, would be black.
        """
        leaves = [face.material.startswith("leaves") for face in self.place.faces]
        ends = np.flatnonzero(np.diff([False, *leaves, False]))
        for begin, end in ends.reshape(-1, 2).tolist():
            crown = light[begin:end]
            points = np.concatenate([grid.reshape(-1, 3) for grid in crown])
            for grid in crown:
                np.maximum(grid, np.float32(_IN_LEAVES) * points.mean(axis=0), out=grid)

    @cached_property
    def _light(self) -> list[Single]:
        """Factors of the sRGB values on each face (rows, columns, 3)."""
        return [factors(values) for values in self._exposed.total]

    def polish(self, colour: bool) -> Polish | None:
        """Return the gloss of the place for images in colour or in grey; None: all is matt."""
        lit = np.array([irradiance.mean(axis=(0, 1)) for irradiance in self._exposed.total])
        lit[self.place.sky] = 1.0
        weights = np.eye(3) if colour else np.array([_WEIGHTS]) / 256.0
        finish = Polish(self.place, self._exposed, self._albedo * lit, weights.astype(np.float32))
        return finish if len(finish.face) else None

    def texels(self, limit: float) -> Array:
        """Return the edge of the texels of each face (m,) [m]: about a pixel where it is nearest.

        In steps of two, so that few tiles serve all faces. Small faces with prints, such as desks
        with papers, have finer ones. Floors and ceilings have larger ones: what is straight below
        or above is not what a camera looks at.

        :param limit: largest number of texels; beyond it all become larger, but those of the small
            faces with prints only if they alone are a quarter of it.
        """
        detail, surfaces = self.place.detail, self._surfaces
        areas, usual = surfaces.sides.prod(axis=1), _TEXEL / detail
        if self._path is None:
            return usual * _enlargement(usual, areas, limit)
        steps = np.log2(np.maximum(nearest_distances(surfaces, self._path), 1e-3) * _PIXEL / _TEXEL)
        printed = np.array([bool(face.prints) for face in self.place.faces])
        small = areas < _SMALL
        steps += ~small & (np.abs(surfaces.normal[:, 2]) > 0.9)
        steps = np.clip(np.rint(steps), np.where(printed & small, -1.0, 0.0), _STEPS)
        result = np.where(detail == 1.0, _TEXEL * 2.0**steps, usual)
        fine = steps < 0
        result[fine] *= _enlargement(result[fine], areas[fine], 0.25 * limit)
        budget = limit - float((areas[fine] / result[fine] ** 2).sum())
        larger = _enlargement(result[~fine], areas[~fine], budget)
        result[~fine] *= larger
        self._base = _TEXEL * larger
        return result

    def _areas(self) -> Array:
        """Weights of the faces in the exposure: their areas times the square of the detail."""
        areas: Array = self._surfaces.sides.prod(axis=1) * self.place.detail**2
        return areas

    def texture(self, m: int, rows: int, columns: int, texel: float, colour: bool) -> Bytes:
        """Return the texture of face m: (rows, columns) in grey, or (rows, columns, 3) in colour.

        Its first row is the lowest, as seen from its front its first column is on the left. The
        material with traces of wear comes first, then prints, then light; glowing prints are put on
        after the light, which does not change them.

        :param texel: edge of its texels, about [m].
        """
        face = self.place.faces[m]
        if face.sky and face.material == CLOUDED:
            return self._clouds(m, rows, columns, colour)
        starts = generator_at(self._site.seed, "place.start", m)
        base = self._base if face.detail == 1.0 else None
        pattern = self._tile(face.material, texel, colour, base)
        result = _repeat(pattern, starts.integers(0, len(pattern), 2), rows, columns)
        if not (face.glows or face.sky):
            self._put_wear(result, face.material, texel, starts, base)
        width, height = self._surfaces.sides[m].tolist()
        scale = rows / height, columns / width
        for glowing in (False, True):
            for print_ in face.prints:
                if print_.glows != glowing:
                    continue
                image = picture(print_, (1 / scale[0], 1 / scale[1]), self._site.seed)
                _put(
                    result,
                    image if colour else grey(image),
                    round(print_.bottom * scale[0]),
                    round(print_.left * scale[1]),
                )
            if not (glowing or face.sky or face.glows):
                self._apply_light(result, m)
        return result

    def _clouds(self, m: int, rows: int, columns: int, colour: bool) -> Bytes:
        """Return the clouds on face m, a part of the sky around the middle of the place."""
        origin, across, up = self.place.faces[m].rectangle
        eye = 0.5 * (self.place.low + self.place.high)
        eye[2] = self.place.low[2]
        contrast = CONTRASTS[self._site.texture]
        values = clouds((origin - eye, across, up), (rows, columns), self._site.seed, contrast)
        return values if colour else grey(values)

    def _tile(self, material: str, texel: float, colour: bool, base: float | None) -> Bytes:
        """Return the repeating pixels of a material; coarse texels are means of finer ones.

        :param texel: edge of a texel [m].
        :param base: edge of the finest texel [m], which coarser ones are means of; None: this one.
        """
        key = material, round(texel, 4), colour
        if key not in self._tiles and base is not None and round(base, 4) != key[1]:
            self._tiles[key] = _resize(self._tile(material, base, colour, None), texel / base)
        elif key not in self._tiles:
            values = tile(material, key[1], self._site.seed, CONTRASTS[self._site.texture])
            self._tiles[key] = values if colour else grey(values)
        return self._tiles[key]

    def _put_wear(
        self,
        texture: Bytes,
        material: str,
        texel: float,
        starts: np.random.Generator,
        base: float | None,
    ) -> None:
        """Add the layers of wear to a texture, each shifted by random offsets."""
        layers = [self._wear(material, period, texel, base) for period in WEAR_PERIODS]
        offsets = [starts.integers(0, len(layer), 2) for layer in layers]
        for top in range(0, len(texture), _ROWS):
            part = texture[top : top + _ROWS]
            value = np.zeros(part.shape[:2], np.int16)
            for layer, (row, column) in zip(layers, offsets, strict=True):
                value += _repeat(layer, (row + top, column), *part.shape[:2])
            if part.ndim == 3:
                value = np.stack([value] * 3, axis=-1)
            value += part
            part[:] = np.clip(value, 0, 255, out=value)

    def _wear(self, material: str, period: float, texel: float, base: float | None) -> Differences:
        """Return stains and wear of a material; coarser texels are averages of finer ones."""
        key = material.partition(":")[0], period, round(texel, 4)
        if key not in self._layers and base is not None and round(base, 4) != key[2]:
            self._layers[key] = _resize(self._wear(material, period, base, None), texel / base)
        elif key not in self._layers:
            if key[1:] not in self._stains:
                self._stains[key[1:]] = stains(*key[1:], self._site.seed)
            contrast = CONTRASTS[self._site.texture]
            self._layers[key] = wear(key[0], self._stains[key[1:]], contrast)
        return self._layers[key]

    def _apply_light(self, texture: Bytes, m: int) -> None:
        """Multiply a texture by the light on its face, interpolated to its texels."""
        light = self._light[m]
        if texture.ndim == 2:
            red, green, blue = (np.float32(w / 256) for w in _WEIGHTS)
            light = light[..., 0] * red + light[..., 1] * green + light[..., 2] * blue
        rows, columns = texture.shape[:2]
        wide = resample(light, 1, columns)
        for top in range(0, rows, _ROWS):
            part = texture[top : top + _ROWS]
            value = resample(wide, 0, rows, top, len(part))
            value *= part
            value += np.float32(0.5)
            part[:] = np.minimum(value, np.float32(255.0), out=value).astype(np.uint8)


def _enlargement(texels: Array, areas: Array, limit: float) -> float:
    """Return the factor by which texels must be larger to be at most ``limit``."""
    return max(1.0, math.sqrt(float((areas / (texels * texels)).sum()) / limit))


def _resize(tile: NDArray[_Value], factor: float) -> NDArray[_Value]:
    """Return a tile with texels that are larger by a factor, rounded to a whole number."""
    if factor < 1.0:
        times = round(1.0 / factor)
        return tile.repeat(times, axis=0).repeat(times, axis=1)
    step = round(factor)
    rows = len(tile) // step
    total = np.zeros((rows, rows, *tile.shape[2:]), np.int32)
    for i, j in np.ndindex(step, step):
        total += tile[i : rows * step : step, j : rows * step : step]
    return np.rint(total / step**2).astype(tile.dtype)


def _repeat(
    tile: NDArray[_Value], start: Sequence[int] | Integers, rows: int, columns: int
) -> NDArray[_Value]:
    """Return a tile that repeats, from a row and a column on: (rows, columns, ...)."""
    result = np.empty((rows, columns, *tile.shape[2:]), tile.dtype)
    for down, of_tile in _repeats(int(start[0]), rows, len(tile)):
        for across, part in _repeats(int(start[1]), columns, len(tile)):
            result[down, across] = tile[of_tile, part]
    return result


def _repeats(start: int, count: int, period: int) -> Iterator[tuple[slice, slice]]:
    """Yield slices of a range, each with the slice of a periodic tile that covers it."""
    begin = 0
    while begin < count:
        offset = (start + begin) % period
        length = min(period - offset, count - begin)
        yield slice(begin, begin + length), slice(offset, offset + length)
        begin += length


def grey(colours: Bytes) -> Bytes:
    """Return the grey values (...) of colours (..., 3)."""
    red, green, blue = (colours[..., k].astype(np.uint16) * w for k, w in enumerate(_WEIGHTS))
    total = red + green + blue
    total += 128
    total >>= 8
    return total.astype(np.uint8)


def _put(texture: Bytes, image: Bytes, row: int, column: int) -> None:
    """Draw an image on a texture, cut at the texture's edges."""
    height, width = texture.shape[:2]
    low, left_column = max(row, 0), max(column, 0)
    high, right_column = min(row + image.shape[0], height), min(column + image.shape[1], width)
    if high > low and right_column > left_column:
        texture[low:high, left_column:right_column] = image[
            low - row : high - row, left_column - column : right_column - column
        ]


def _linear(material: str) -> list[float]:
    """Return the share of red, green and blue light that a material reflects."""
    return [round(min(0.85, (float(c) / 255.0) ** GAMMA), 6) for c in colour_of(material)]


def _exposure(maps: list[Single], sky: Mask, areas: Array, middle: float) -> np.float32:
    """Return the factor with which half of the area of all surfaces is brighter than ``middle``.

    :param maps: irradiance (rows, columns, 3) on each of m surfaces, of which green counts.
    :param sky: (m,) True for surfaces that are the sky, which do not count.
    :param areas: (m,) areas [m^2].
    :param middle: brightness that half of the area is to exceed.
    """
    values, weights = [], []
    for grid, dark, area in zip(maps, sky, areas, strict=True):
        if not dark:
            green = grid[..., 1].ravel()
            values.append(green)
            weights.append(np.full(len(green), area / len(green)))
    value, weight = np.concatenate(values), np.concatenate(weights)
    order = np.argsort(value, kind="stable")
    sums = np.cumsum(weight[order])
    median = float(value[order][np.searchsorted(sums, 0.5 * sums[-1])])
    return np.float32(round(middle / max(median, 1e-6), 6))
