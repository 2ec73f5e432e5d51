# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Pictures of textured rectangles: each pixel's ray meets the nearest surface."""

import math
import os
from collections.abc import Iterator, Sequence
from typing import Any, Final, NamedTuple, Protocol, TypeVar

import numpy as np
from numpy.typing import NDArray

from imu_sim_ros import rotation
from imu_sim_ros.errors import MissingDependencyError
from imu_sim_ros.places.bodies import Crowd
from imu_sim_ros.places.geometry import Surfaces
from imu_sim_ros.sensors.camera.images.cells import (
    COUNTS,
    SHARES,
    CellGrid,
    Levels,
    Pairs,
    Planes,
    Shares,
    levels,
    steps_along,
    within,
)
from imu_sim_ros.sensors.camera.images.edges import Parts, Slopes, parts, together
from imu_sim_ros.sensors.camera.images.finish import Finish, Frame, Glossy, Seen, Shaded, joined
from imu_sim_ros.sensors.camera.images.rays import CELL, PixelRays, corners_and_probes, row_by_row
from imu_sim_ros.sensors.camera.images.texture import BACKGROUND, BLANK, Atlas
from imu_sim_ros.sensors.camera.model import CameraModel
from imu_sim_ros.sensors.camera.view import CameraPoses, Eyes
from imu_sim_ros.types import Array, Bytes, Integers, Mask, Single

_Value = TypeVar("_Value", bound=np.generic)

_GRID: Final = 2.0**30
"""Poses are rounded to steps of 1e-9, so that the last bits of a sine decide nothing."""
_SIDEWAYS: Final = 0.05
"""Least cosine between the axis and a ray of a lens whose rays are in one cone."""
_SLACK: Final = 1e-3
"""By which the cone of all rays is wider."""
_NONE: Final = np.zeros(0, np.int64)
_ROW_OF_PIXEL: Final = np.arange(CELL**2) // CELL


class Maps(NamedTuple):
    """Where in the atlas each pixel looks, in fixed point."""

    whole: NDArray[np.int16]
    """(h, w, 2) column and row."""
    part: NDArray[np.uint16]
    """(h, w) 32 * fraction of the row + fraction of the column, in 1/32."""
    coarse: "Maps | None" = None
    """The same in the next level, if there are two levels."""
    share: NDArray[np.uint16] | None = None
    """(h, w) what the coarse level contributes, in 1/256."""
    stretches: "Sequence[Stretch]" = ()
    """Pixels that look at several places."""
    finishes: Sequence[Finish] = ()
    """What is done to some pixels afterwards, one after the other."""
    edges: "Edges | None" = None
    """Pixels that see more than one surface; what they become in the end."""


class Stretch(NamedTuple):
    """Pixels that look at several places, and are the mean of them."""

    pixel: Integers
    """(n,) row by row."""
    places: int
    """How many each pixel looks at."""
    looks: Maps
    """Its first ``places n`` values are those of all pixels' first places, of their second, ..."""


class Edges(NamedTuple):
    """Pixels that see more than one surface, and what they see next to their centres."""

    pixel: Integers
    """(e,) row by row."""
    own: Integers
    """(e,) weight of what is there."""
    nothing: Integers
    """(e,) weight of the background."""
    parts: Maps
    """Their first k values are those of the parts."""
    which: Integers
    """(k,) to which pixel each belongs, ascending."""
    weight: Integers
    """(k,)."""

    def put(self, picture: Bytes, atlas: Bytes) -> None:
        """Change a picture (h, w[, 3])."""
        values = picture.reshape(-1, *picture.shape[2:] or (1,))
        parts = look_up(atlas, self.parts).reshape(-1, values.shape[1])[: len(self.which)]
        total = values[self.pixel] * self.own[:, None]
        total += self.nothing[:, None] * BACKGROUND
        count = self.own + self.nothing
        for k in range(values.shape[1]):
            of_parts = np.bincount(self.which, self.weight * parts[:, k], len(total))
            total[:, k] += of_parts.astype(np.int64)
        count += np.bincount(self.which, self.weight, len(total)).astype(np.int64)
        values[self.pixel] = (total + count[:, None] // 2) // count[:, None]


class PictureMaker(Protocol):
    """What makes pictures of one camera in one scene, whatever it is made of."""

    rows: Array
    """Row of the image of each row of rays."""

    def pictures(self, eyes: Eyes) -> Iterator[tuple[slice, Bytes]]:
        """Yield rows of the image, and the values (h, w[, 3]) of all their rays."""
        ...

    def depth(self, eyes: Eyes) -> Single:
        """Return the distance along the axis (h, w) [m] of what each pixel sees; 0: nothing."""
        ...

    def depth_and_mask(self, eyes: Eyes) -> tuple[Single, Bytes]:
        """Return :meth:`depth`, and which body each pixel sees (h, w): 1, 2, ...; 0: none."""
        ...


class _Visible(NamedTuple):
    """The surfaces that may be in an image."""

    planes: Planes
    numbers: Integers
    """(m,) of each."""
    pairs: Pairs
    """With the rectangles' numbers among these."""
    levels: Levels
    """Of the pairs."""
    glossy: Glossy | None = None
    """Regions whose gloss is seen in the cells of the pairs."""
    slopes: Slopes | None = None
    """Of the pairs; None: edges are as the centres of pixels see them."""


class _Band(NamedTuple):
    """What the c cells of a band see."""

    nearest: Single
    """(c, CELL^2) inverse distance; 0: nothing."""
    places: list[Single]
    """(2, c, CELL^2) column and row in the atlas, of one level or of two."""
    pair: Integers
    """(c, CELL^2) number of the pair, if it is wanted."""
    glossy: list[Seen]
    """What is seen of glossy surfaces."""
    parts: list[Parts]
    """What pixels at edges see, with the cells' numbers in the image."""


class Renderer:
    """Pictures of one camera in one scene."""

    def __init__(
        self,
        model: CameraModel,
        surfaces: Surfaces,
        atlas: Atlas,
        scale: int,
        trilinear: bool = False,
        crowd: Crowd | None = None,
        areas: bool = False,
    ) -> None:
        """Set up the rays.

        :param scale: rays along each side of a pixel.
        :param trilinear: look at two mip levels.
        :param areas: pixels see what is in their areas: several surfaces at edges, textures along
            their footprints; else what is at their centres.
        :param crowd: bodies that move; their textures follow those of the surfaces.
        """
        self._trilinear, self._areas, self.crowd = trilinear, areas, crowd
        self.surfaces, self.atlas = surfaces, atlas
        self._each = [_Fronts.of(where) for where in (surfaces, *(crowd.surfaces if crowd else ()))]
        self._first = np.cumsum([len(each.normals) for each in self._each])
        self._shining = np.full(self._first[-1], -1)
        if atlas.polish is not None:
            self._shining[atlas.polish.face] = atlas.polish.face
        self._rays = PixelRays(model, scale, by_cells=True)
        self.rows = self._rays.row_places
        """Row of the image of each row of rays."""
        self.bands = self._rays.bands
        corners, self._probes = corners_and_probes(self._rays, areas)
        self._units, self._cell_angle = _units(corners.rays)
        self._grid = CellGrid(corners, self._cell_angle)
        self._corner_rows = corners.rows
        self._cone = self._cone_of_rays()

    def pictures(self, eyes: Eyes) -> Iterator[tuple[slice, Bytes]]:
        """Yield what one pose sees, or one pose for each row of rays, a band at a time.

        :returns: rows of the image, and the values (h, w[, 3]) of all their rays.
        """
        for rows, maps in self.maps(eyes):
            yield rows, look_up(self.atlas.image, maps)

    def maps(self, eyes: Eyes) -> Iterator[tuple[slice, Maps]]:
        """Yield the look-up for one pose, or one pose for each row of rays, a band at a time.

        :returns: rows of the image, and the maps (h, w) of all their rays.
        """
        cv2 = opencv()
        visible, shaded = self._visible(eyes, gloss=True), list(self._shaded(eyes))
        scale = self._rays.scale
        for number, band in enumerate(self.bands):
            rows = self._rays.rows(band)
            drawn = self._drawn(visible, number, self._trilinear or self._areas, self._areas)
            places = [self._image(number, each) for each in drawn.places]
            # The nearest steps of 1/32 texel, of two the even one.
            fixed = [cv2.convertMaps(x, y, cv2.CV_16SC2) for x, y in places]
            fine, *coarse = (Maps(*each) for each in fixed)
            if visible.levels.share is not None:
                share = np.append(visible.levels.share, np.uint16(0))[drawn.pair]
                share *= drawn.nearest > 0.0
                fine = fine._replace(coarse=coarse[0], share=self._image(number, share))
            frame = self._frame(number)
            if visible.levels.looks is not None:
                fine = fine._replace(stretches=list(self._long(visible, drawn, frame)))
            finishes = list(self._finishes(visible, shaded, drawn, number))
            edges = self._edges(visible, shaded, drawn, number)
            fine = fine._replace(finishes=finishes, edges=edges)
            yield slice(rows.start // scale, rows.stop // scale), fine

    def _long(self, visible: _Visible, drawn: _Band, frame: Frame) -> Iterator[Stretch]:
        """Yield the pixels of a band whose footprints are long."""
        first = visible.pairs.cell.searchsorted(np.arange(len(drawn.nearest) + 1) + frame.base)
        alone = np.diff(first) == 1
        alone[alone] = visible.pairs.fills.take(first[:-1][alone])
        # Of cells beyond the image some pixels are none.
        row, column = np.divmod(np.arange(len(alone)), frame.across)
        alone &= (column + 1) * CELL <= frame.width
        alone &= (row + 1) * CELL + frame.base // frame.across * CELL <= frame.last + 1
        numbers = frame.pixels(np.arange(len(alone)) + frame.base)
        whole, mixed = np.flatnonzero(alone), np.flatnonzero(~alone)
        texels = [each.take(whole, axis=1) for each in drawn.places]
        pixel = numbers.take(whole, axis=0)
        yield from _stretches_of_cells(visible.levels, first.take(whole), texels, pixel)
        seen = drawn.nearest.take(mixed, axis=0) > 0.0
        pair = np.where(seen, drawn.pair.take(mixed, axis=0), -1).reshape(-1)
        texels = [each.take(mixed, axis=1).reshape(2, -1) for each in drawn.places]
        yield from _stretches(visible.levels, pair, texels, numbers.take(mixed, axis=0).reshape(-1))

    def _frame(self, number: int) -> Frame:
        across, rays = self._grid.columns, self._rays
        return Frame(self.bands[number].start * across, across, rays.height - 1, rays.width)

    def _edges(
        self, visible: _Visible, shaded: Sequence[Shaded], drawn: _Band, number: int
    ) -> Edges | None:
        """Return what the pixels at the edges of a band see."""
        if not drawn.parts:
            return None
        every, frame = together(drawn.parts), self._frame(number)
        levels, pair = visible.levels, every.pair
        texels: list[Single] = [
            every.places * scale.take(pair, axis=1) + offset.take(pair, axis=1)
            for scale, offset in zip(levels.scale, levels.offset, strict=True)
        ]
        looks = in_rows(texels, levels.share.take(pair) if levels.share is not None else None)
        every_part = np.arange(len(pair))
        stretches = [Stretch(every_part, _OF_PARTS, _along(levels, pair, texels, _OF_PARTS))]
        cell, spot = every.cell.take(every.pixel), every.spot.take(every.pixel)
        rows, rays = frame.row(cell, spot), self._rays.of_band(number)
        finishes = [
            finish
            for each in shaded
            for finish in each.finishes_of(
                rays[:, cell - frame.base, spot, None], rows[:, None], cell, every.inverse
            )
        ]
        if visible.glossy is not None:
            seen = visible.glossy.parts(every, visible.pairs.which.take(pair), rows)
            gloss = joined(visible.glossy.finishes([seen], visible.planes))
            finishes += [gloss] if gloss is not None else []
        looks = looks._replace(stretches=stretches, finishes=finishes)
        pixel = frame.pixel(every.cell, every.spot)
        return Edges(pixel, every.own, every.nothing, looks, every.pixel, every.weight)

    def _finishes(
        self, visible: _Visible, shaded: Sequence[Shaded], drawn: _Band, number: int
    ) -> Iterator[Finish]:
        """Yield what is done to a band after its textures are looked up."""
        frame = self._frame(number)
        for each in shaded:
            yield from each.finishes(self._rays.of_band(number), drawn.nearest, frame)
        if visible.glossy is not None:
            gloss = joined(visible.glossy.finishes(drawn.glossy, visible.planes))
            if gloss is not None:
                yield gloss

    def _shaded(self, eyes: Eyes) -> Iterator[Shaded]:
        """Yield the shadows of bodies in the image."""
        if self.crowd is None:
            return
        world, sun = rounded(eyes.world), self.crowd.sun
        for seen, shadow in zip(eyes.bodies, self.crowd.shadows, strict=True):
            own = rounded(seen)
            lines = [shadow.below]
            if sun is not None:
                r_wb = (world[1][0][:, None] * own[1][0]).sum(axis=2)
                line = shadow.thrown((sun.to_sun[:, None] * r_wb).sum(axis=0), 1.0)
                if self._may_be_seen(line.ball, *own):
                    share = sun.share(world[0][0] - (r_wb * own[0][0]).sum(axis=1))
                    lines += [line._replace(depth=share)] * (share > 0.0)
            for line in lines:
                if self._may_be_seen(line.ball, *own):
                    floor = line.floor()
                    planes = Planes.of(floor, floor.normal, *own)
                    yield Shaded(planes, self._grid.pairs(planes), line)

    def depth(self, eyes: Eyes) -> Single:
        """Return the distance along the axis (h, w) [m] of what each pixel sees; 0: nothing."""
        visible = self._visible(eyes)
        return np.concatenate(
            [self._depth(self._drawn(visible, k), k) for k in range(len(self.bands))]
        )

    def depth_and_mask(self, eyes: Eyes) -> tuple[Single, Bytes]:
        """Return :meth:`depth`, and which body each pixel sees (h, w): 1, 2, ...; 0: none."""
        visible = self._visible(eyes)
        body = np.searchsorted(self._first, visible.numbers, side="right").astype(np.uint8)
        of_pair = np.append(body[visible.pairs.which], np.uint8(0))  # the last stands for nothing
        depth, mask = [], []
        for number in range(len(self.bands)):
            drawn = self._drawn(visible, number, with_pairs=True)
            depth.append(self._depth(drawn, number))
            pair = np.where(drawn.nearest > 0.0, drawn.pair, -1)
            mask.append(self._image(number, of_pair[pair]))
        return np.concatenate(depth), np.concatenate(mask)

    def _depth(self, drawn: _Band, number: int) -> Single:
        seen, rays = drawn.nearest > 0.0, self._rays.of_band(number)[2]
        away = rays / np.where(seen, drawn.nearest, np.float32(1.0))
        return self._image(number, np.where(seen, away, np.float32(0.0)))

    def _visible(self, eyes: Eyes, gloss: bool = False) -> _Visible:
        """Return what may be in the image, and where.

        :param gloss: its gloss, too.
        """
        position, r_wc = rounded(eyes.world)
        found = [(0, self._facing(0, position, r_wc), position, r_wc)]
        for k, seen in enumerate(eyes.bodies, start=1):
            position, r_wc = rounded(seen)
            if self.crowd and self._may_be_seen(self.crowd.balls[k - 1], position, r_wc):
                found.append((k, self._facing(k, position, r_wc), position, r_wc))
        first, *others = (
            Planes.of(*self._each[k].some(numbers), *pose) for k, numbers, *pose in found
        )
        planes = first.joined(others)
        start = (0, *self._first)
        numbers = np.concatenate([each + start[k] for k, each, *_ in found])
        pairs = self._grid.pairs(planes)
        rows = self._probes.rows.take(pairs.cell, axis=1)
        met = [
            planes.meet(pairs.which, rays.take(pairs.cell, axis=1)[..., None], row[:, None])
            for rays, row in zip(self._probes.rays, rows, strict=True)
        ]
        # One probe after the other in memory: loops are long.
        inverse = np.stack([one[1] for one in met])[..., 0]
        places = np.stack([one[2] for one in met])[..., 0]
        trilinear, slopes = self._trilinear, None
        found_levels = levels(places, self.atlas, numbers[pairs.which], trilinear, self._areas)
        if self._areas:
            linear = [
                planes.linear(pairs.which, rays.take(pairs.cell, axis=1)[..., None], row[:, None])
                for rays, row in zip(self._probes.rays, rows, strict=True)
            ]
            slopes = Slopes.of(np.stack(linear)[..., 0])
        polish, shining = self.atlas.polish, None
        if gloss and polish is not None:
            face = self._shining[numbers[pairs.which]]
            probes = inverse, places, rows[0]
            shining = Glossy.of(polish, planes, face, pairs, probes, self._cell_angle)
        return _Visible(planes, numbers, pairs, found_levels, shining, slopes)

    def _facing(self, k: int, position: Array, r_wc: Array) -> Integers:
        """Return the surfaces whose front is seen from one of some places (n, 3).

        A surface is not seen if all its corners lie beyond one side of the cone of all rays.
        """
        each = self._each[k]
        offset = position[:, None] - each.surfaces.origin
        front = ((offset * each.normals).sum(axis=2) > 0.0).any(axis=0)
        facing = np.flatnonzero(front | each.both)
        if k or len(position) > 1 or self._cone is None:
            return facing
        corners = each.corners[facing] - position[0]
        beyond = (np.matmul(np.matmul(corners, r_wc[0]), self._cone) > 0.0).all(axis=1)
        return facing[~beyond.any(axis=1)]

    def _may_be_seen(self, ball: tuple[Array, float], position: Array, r_wc: Array) -> bool:
        """Tell whether a ball, its middle and radius, may be in the image."""
        center, radius = ball
        middle = ((center - position)[:, :, None] * r_wc).sum(axis=1)
        rows = self._corner_rows if len(middle) > 1 else np.zeros(1, np.int64)
        x, y, z = middle[rows].T[..., None]
        away = np.sqrt(x * x + y * y + z * z)
        sine = np.minimum(radius / np.maximum(away, 1e-9), 1.0)
        near = np.minimum(np.arcsin(sine) + self._cell_angle, math.pi)
        along = self._units[0] * x + self._units[1] * y + self._units[2] * z
        return bool(((along >= away * np.cos(near)) | (away <= radius)).any())

    def _cone_of_rays(self) -> Array | None:
        """Return the normals (3, 4) of planes through the camera that have all rays on one side.

        None if a ray looks sideways or backwards.
        """
        bounds = [np.full(4, -np.inf)]
        for number in range(len(self.bands)):
            rays = self._rays.of_band(number)
            x, y, z = rays[:, rays.any(axis=0)].astype(np.float64)
            if not len(z):
                continue
            if not z.min() > _SIDEWAYS:
                return None
            u, v = x / z, y / z
            bounds.append(np.array([u.max(), -u.min(), v.max(), -v.min()]))
        if len(bounds) == 1:
            return None
        right, left, below, above = np.max(bounds, axis=0) + _SLACK
        return np.array(
            [[1.0, -1.0, 0.0, 0.0], [0.0, 0.0, 1.0, -1.0], [-right, -left, -below, -above]]
        )

    def _drawn(
        self, visible: _Visible, number: int, with_pairs: bool = False, edges: bool = False
    ) -> _Band:
        """Return what a band of cells sees.

        :param edges: what pixels at edges see, too.
        """
        band, frame, rays = self.bands[number], self._frame(number), self._rays.of_band(number)
        base, across = frame.base, frame.across
        shape, (scales, offsets, *_) = rays.shape[1:], visible.levels
        drawn = _Band(
            np.zeros(shape, np.float32),
            [np.full((2, *shape), BLANK) for _ in scales],
            np.zeros(shape if with_pairs else (0, 1), np.int64),
            [],
            [],
        )
        last, moving = self._rays.height - 1, visible.planes.start.shape[1] > 1
        for pairs, sizes in visible.pairs.chunks(base, band.stop * across):
            cell, which = visible.pairs.cell.take(pairs), visible.pairs.which.take(pairs)
            fills = visible.pairs.fills.take(pairs)
            rows = cell[:, None] // across * CELL + _ROW_OF_PIXEL if moving else cell
            in_front, inverse, places = visible.planes.meet(
                which, rays.take(cell - base, axis=1), np.minimum(rows, last)
            )
            filled = len(sizes) == 1 and bool(fills.all())
            of_planes = inverse * in_front if edges and not filled else inverse
            if not filled:
                in_front &= within(places)
            inverse *= in_front
            texels = []
            for scale, offset in zip(scales, offsets, strict=True):
                texels.append(places * scale.take(pairs, axis=1)[..., None])
                texels[-1] += offset.take(pairs, axis=1)[..., None]
            own = [pairs[:, None].repeat(CELL**2, axis=1)] * with_pairs
            row = visible.glossy.among(pairs) if visible.glossy else _NONE
            before = inverse.take(row, axis=0)
            _keep_nearest([inverse, *texels, *own], sizes)
            if len(row):
                hit = before == inverse.take(_cells_of_rows(sizes).take(row), axis=0)
                hit &= before > 0.0
                there = cell.take(row)
                pixel = frame.pixels(there)
                of_rays = frame.rows(there) if moving else there[:, None]
                at = which.take(row), pixel, of_rays, hit, places.take(row, axis=1)
                drawn.glossy.append(Seen(pairs.take(row), *at))
            here = cell[: sizes[0]] - base
            drawn.nearest[here] = inverse[: sizes[0]]
            seen = inverse[: sizes[0]] > 0.0
            for texel, whole in zip(texels, drawn.places, strict=True):
                best = texel[:, : sizes[0]]
                if not seen.all():
                    np.copyto(best, BLANK, where=~seen)
                whole[:, here] = best
            for each in own:
                drawn.pair[here] = each[: sizes[0]]
            if edges and not filled:
                assert visible.slopes is not None
                local, mixed = _cells_of_rows(sizes), ~fills[: sizes[0]]
                mixed[: sum(sizes[1:2])] = True
                some = np.flatnonzero(mixed.take(local))
                found = parts(
                    pairs.take(some),
                    local.take(some),
                    of_planes.take(some, axis=0),
                    places.take(some, axis=1),
                    (drawn.nearest[here], np.where(seen, own[0][: sizes[0]], -1)),
                    visible.slopes,
                )
                if found is not None:
                    drawn.parts.append(found._replace(cell=cell.take(found.cell)))
        return drawn

    def _image(self, number: int, values: NDArray[_Value]) -> NDArray[_Value]:
        """Return values of the cells of a band (..., c, CELL^2) as an image (..., h, w)."""
        rows = self._rays.rows(self.bands[number])
        image = row_by_row(values, self._rays.width, rows.stop - rows.start)
        return np.ascontiguousarray(image)


class _Fronts(NamedTuple):
    """Surfaces, and what is often asked of them."""

    surfaces: Surfaces
    normals: Array
    """(m, 3)."""
    corners: Array
    """(m, 4, 3)."""
    both: Mask
    """(m,) they are seen from both sides."""

    @classmethod
    def of(cls, surfaces: Surfaces) -> "_Fronts":
        o, a, b = surfaces[:3]
        corners = np.stack([o, o + a, o + b, o + a + b], axis=1)
        return cls(surfaces, surfaces.normal, corners, np.array(surfaces.texture) == "plane")

    def some(self, numbers: Integers) -> tuple[Surfaces, Array]:
        """Return some rectangles and their normals."""
        o, a, b, hides, _ = self.surfaces
        some = Surfaces(o[numbers], a[numbers], b[numbers], hides[numbers], ())
        return some, self.normals[numbers]


_OF_PARTS: Final = 4
"""How many places a part of a pixel looks at, whatever its footprint."""
_LOOKS_WIDTH: Final = 64
"""Columns of the maps of some pixels: OpenCV's rows are limited."""


def in_rows(texels: Sequence[Single | Sequence[Single]], share: Shares | None) -> Maps:
    """Return the look-up of n places, columns and rows (n,), of each level, followed by others.

    :param share: (n,) of the coarser of two levels.
    """
    cv2 = opencv()
    count = len(texels[0][0])
    shape = max(1, -(-count // _LOOKS_WIDTH)), _LOOKS_WIDTH
    more = shape[0] * shape[1] - count
    found = []
    for each in texels:
        x, y = (np.append(k, np.full(more, BLANK)) if more else k for k in each)
        found.append(Maps(*cv2.convertMaps(x.reshape(shape), y.reshape(shape), cv2.CV_16SC2)))
    fine, *coarse = found
    if share is None:
        return fine
    padded = np.append(share, np.zeros(more, np.uint16)).reshape(shape)
    return fine._replace(coarse=coarse[0], share=padded)


def _stretches(
    levels: Levels, pair: Integers, texels: Sequence[Single], pixel: Integers
) -> Iterator[Stretch]:
    """Yield those of n values whose footprints are long.

    :param pair: (n,) that each sees; -1: none.
    :param texels: (2, n) place of each in the atlas, of each level.
    :param pixel: (n,) number of each in the picture.
    """
    if levels.looks is None or levels.along is None:
        return
    looks = np.append(levels.looks, np.uint8(1))[pair]
    for count in COUNTS:
        some = np.flatnonzero(looks == count)
        if len(some):
            own = pair.take(some)
            middles = [texel.take(some, axis=1) for texel in texels]
            yield Stretch(pixel.take(some), count, _along(levels, own, middles, count))


def _stretches_of_cells(
    levels: Levels, pair: Integers, texels: Sequence[Single], pixel: Integers
) -> Iterator[Stretch]:
    """Yield those of q cells, of which each is all of one pair, whose footprints are long.

    :param pair: (q,).
    :param texels: (2, q, CELL^2) place in the atlas, of each level.
    :param pixel: (q, CELL^2) number in the picture.
    """
    assert levels.looks is not None
    looks = levels.looks.take(pair)
    for count in COUNTS:
        some = np.flatnonzero(looks == count)
        if len(some):
            own = pair.take(some)[:, None]
            middles = [texel.take(some, axis=1) for texel in texels]
            looked = _along(levels, own, middles, count)
            yield Stretch(pixel.take(some, axis=0).reshape(-1), count, looked)


def _along(levels: Levels, pair: Integers, middles: Sequence[Single], count: int) -> Maps:
    """Return the look-up of some places along the footprints of n values, or of (q, CELL^2).

    :param pair: (n,) or (q, 1).
    :param middles: (2, n) or (2, q, CELL^2) of each level.
    """
    assert levels.along is not None
    steps = steps_along(count).reshape(-1, *(1,) * pair.ndim)
    found = []
    for scale, offset, middle in zip(levels.scale, levels.offset, middles, strict=True):
        places = []
        for k in range(2):
            size, first = scale[k].take(pair), offset[k].take(pair)
            at = steps * (levels.along[k].take(pair) * size) + middle[k]
            # No look leaves the rectangle.
            np.maximum(at, first, out=at)
            np.minimum(at, first + size, out=at)
            places.append(at.reshape(-1))
        found.append(places)
    if levels.share is None:
        return in_rows(found, None)
    share = np.broadcast_to(levels.share.take(pair), middles[0].shape[1:])
    return in_rows(found, np.tile(share.reshape(-1), count))


def _keep_nearest(values: Sequence[NDArray[Any]], sizes: Sequence[int]) -> None:
    """Put the values of the nearest pair of each cell to the place of its first pair.

    :param values: (..., q, n) of pairs in ranks; the first of them 1 / t, of equals the first.
    :param sizes: of the ranks.
    """
    inverse, start = values[0], sizes[0]
    for size in sizes[1:]:
        nearer = inverse[start : start + size] > inverse[:size]
        if nearer.any():
            for each in values:
                np.copyto(each[..., :size, :], each[..., start : start + size, :], where=nearer)
        start += size


def _cells_of_rows(sizes: Sequence[int]) -> Integers:
    """Return which of the first rank's rows has the same cell, for all rows of some ranks."""
    return np.concatenate([np.arange(size) for size in sizes])


def rounded(poses: CameraPoses) -> tuple[Array, Array]:
    """Return positions (n, 3) and rotations R_wc (n, 3, 3) without the last bits of a sine."""
    position = np.round(poses.position * _GRID) / _GRID
    r_wc = np.round(rotation.to_matrix(poses.q_wc) * _GRID) / _GRID
    return position, r_wc


def _units(rays: Single) -> tuple[Single, float]:
    """Return unit vectors along rays (3, a, b), and the largest angle across a cell [rad]."""
    length = np.sqrt((rays * rays).sum(axis=0))
    units = rays / np.maximum(length, np.float32(1e-9))
    across = (units[:, :-1, :-1] * units[:, 1:, 1:]).sum(axis=0)
    other = (units[:, :-1, 1:] * units[:, 1:, :-1]).sum(axis=0)
    seen = (length[:-1, :-1] > 0) & (length[1:, 1:] > 0) & (length[:-1, 1:] > 0)
    least = np.minimum(across, other)[seen]
    angle = math.acos(max(-1.0, min(1.0, float(least.min())))) if least.size else math.pi
    return units, angle + 1e-3


def look_up(atlas: Bytes, maps: Maps) -> Bytes:
    """Return the picture (h, w[, 3]): bilinear in integers, ``(sum w_i a_i + 2^14) >> 15``.

    Of two levels: ``((256 - share) fine + share coarse + 128) >> 8``.
    """
    picture = _mixed(atlas, maps)
    values = picture.reshape(-1, *picture.shape[2:])
    for pixel, count, looks in maps.stretches:
        each = _mixed(atlas, looks).reshape(-1, *values.shape[1:])[: count * len(pixel)]
        total = each.reshape(count, -1, *values.shape[1:]).sum(axis=0, dtype=np.uint16)
        total += count // 2
        values[pixel] = total // count
    for finish in maps.finishes:
        finish.put(picture)
    if maps.edges is not None:
        maps.edges.put(picture, atlas)
    return picture


def _mixed(atlas: Bytes, maps: Maps) -> Bytes:
    cv2 = opencv()
    picture: Bytes = cv2.remap(
        atlas, maps.whole, maps.part, cv2.INTER_LINEAR, borderMode=cv2.BORDER_REPLICATE
    )
    if maps.coarse is None or maps.share is None:
        return picture
    share = maps.share.reshape(*maps.share.shape, *(1,) * (picture.ndim - 2))
    total = picture * (SHARES - share)
    total += _mixed(atlas, maps.coarse) * share
    total += SHARES // 2
    total >>= 8
    return total.astype(np.uint8)


def opencv() -> Any:
    """Return OpenCV's module.

    :raises MissingDependencyError: if it is not installed.
    """
    try:
        os.environ.setdefault("OPENCV_LOG_LEVEL", "OFF")  # what it logs goes to standard error
        import cv2
    except ImportError as error:
        raise MissingDependencyError(
            f"images need OpenCV ({error}): apt install python3-opencv, or pip install "
            "opencv-python-headless"
        ) from None
    return cv2
