# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""What is done to some pixels of a picture after the look-up of textures: shadows and gloss."""

from collections.abc import Iterable, Iterator, Sequence
from typing import Final, NamedTuple

import numpy as np

from imu_sim_ros.places.gloss import Active, Polish
from imu_sim_ros.places.shadows import ShadowLine
from imu_sim_ros.sensors.camera.images.cells import Pairs, Planes, within
from imu_sim_ros.sensors.camera.images.edges import Parts
from imu_sim_ros.sensors.camera.images.rays import CELL
from imu_sim_ros.types import Bytes, Integers, Mask, Single

_REGIONS: Final = 250
"""Regions in cells that are dealt with at once: their arrays stay in a processor's cache."""
_ON_FLOOR: Final = np.float32(0.03)
"""Height up to which something is floor [m]."""
_NOTHING: Final = np.zeros((1, 1), np.float32)
_TURNING: Final = np.float32(12.0)
"""Distances change by less than twice within this many pixels."""
_ANYWHERE: Final = np.float32(1e9)
_SPOTS: Final = np.arange(CELL**2)
_ROW, _COLUMN = np.divmod(_SPOTS, CELL)


class Finish(NamedTuple):
    """What becomes of the squares of some values of a picture: ``keep v^2 + add``."""

    pixel: Integers
    """(n,) row by row; of equals the last counts."""
    keep: Single
    """(n,)."""
    add: Single
    """(colours, n) or (1, 1)."""

    def put(self, picture: Bytes) -> None:
        """Change a picture (h, w[, 3])."""
        values = picture.reshape(-1, *picture.shape[2:] or (1,))
        square = values[self.pixel].T.astype(np.float32)
        square *= square
        square *= self.keep
        square += self.add
        np.sqrt(square, out=square)
        square += np.float32(0.5)
        values[self.pixel] = np.minimum(square, np.float32(255.0)).T.astype(np.uint8)


class Glossy(NamedTuple):
    """Glossy regions that may be seen in the cells of p pairs."""

    polish: Polish
    found: Active
    """By number of the pair."""
    face: Integers
    """(p,) of the pairs."""
    first: Integers
    """(p,) number of each pair's first region among those that are found."""
    regions: Integers
    """(p,) number of each pair's regions."""

    @classmethod
    def of(
        cls,
        polish: Polish,
        planes: Planes,
        face: Integers,
        pairs: Pairs,
        probes: tuple[Single, Single, Integers],
        angle: float,
    ) -> "Glossy":
        """Find them.

        :param face: (p,) of the pairs; -1: none that may be glossy.
        :param probes: inverse distance (3, p) and place (3, 2, p) of the probes, row (p,) of the
            first.
        """
        number = np.flatnonzero(face >= 0)
        inverse, places = (each.take(number, axis=-1) for each in probes[:2])
        rows = probes[2].take(number)[:, None]
        start, height = _eye(planes, pairs.which.take(number), rows)
        steps = np.abs(places[1:] - places[0]).sum(axis=0)
        turning = np.abs(inverse[1:] - inverse[0]).sum(axis=0)
        steps[:, inverse[0] <= _TURNING * turning] = _ANYWHERE
        own = face[number]
        sights = polish.sights(own, places[0, ..., None], start, height)
        found = polish.active(own, sights, steps, angle)
        found = found._replace(pair=number[found.pair])
        count = np.bincount(found.pair, minlength=len(face))
        return cls(polish, found, face, np.cumsum(count) - count, count)

    def among(self, pairs: Integers) -> Integers:
        """Return which of some pairs have such regions."""
        return np.flatnonzero(self.regions.take(pairs))

    def parts(self, parts: Parts, which: Integers, rows: Integers) -> "Seen":
        """Return what parts of pixels see of glossy surfaces.

        :param which: (k,) number of the rectangle of each.
        :param rows: (k,) of the rays.
        """
        some = np.flatnonzero(self.regions.take(parts.pair))
        return Seen(
            parts.pair.take(some),
            which.take(some),
            some[:, None],
            rows.take(some)[:, None],
            np.ones((len(some), 1), np.bool_),
            parts.places.take(some, axis=1)[..., None],
        )

    def finishes(self, parts: Sequence["Seen"], planes: Planes) -> Iterator[Finish]:
        """Yield what gloss does to the values of a picture.

        :param parts: what is seen of its regions.
        """
        first = 0
        while first < len(parts):
            sizes = np.cumsum([len(part.pair) for part in parts[first:]])
            stop = first + 1 + int(np.searchsorted(sizes, _REGIONS))
            done = self._finish(_together(parts[first:stop]), planes)
            if done is not None:
                yield done
            first = stop

    def _finish(self, part: "Seen", planes: Planes) -> Finish | None:
        pair, which, pixel, rows, hit, places = part
        count = self.regions.take(pair)
        row = np.repeat(np.arange(len(pair)), count)
        order = np.arange(len(row)) - np.repeat(np.cumsum(count) - count, count)
        number = self.first.take(pair.take(row)) + order
        places = places.take(row, axis=1)
        hit = hit.take(row, axis=0)
        hit &= self.polish.within(self.found.region.take(number), places)
        some = np.flatnonzero(hit.any(axis=1))
        if not len(some):
            return None
        row, number = row.take(some), number.take(some)
        pixel, rows = pixel.take(row, axis=0), rows.take(row, axis=0)
        face = self.face.take(pair.take(row))
        start, height = _eye(planes, which.take(row), rows)
        sights = self.polish.sights(face, places.take(some, axis=1), start, height)
        region, lit = self.found.region.take(number), self.found.lit.take(number, axis=0)
        added = self.polish.added(region, lit, sights)
        seen = np.flatnonzero(hit.take(some, axis=0))
        return Finish(
            pixel.ravel().take(seen),
            added.keep.ravel().take(seen),
            added.add.reshape(len(added.add), -1).take(seen, axis=1),
        )


class Seen(NamedTuple):
    """What is seen of q pairs with glossy regions."""

    pair: Integers
    """(q,)."""
    which: Integers
    """(q,) number of the rectangle."""
    pixel: Integers
    """(q, k) number of each ray's value in the picture."""
    rows: Integers
    """(q, k) of the rays, or (q, 1) for one pose."""
    hit: Mask
    """(q, k) rays whose values there are those of the surface."""
    places: Single
    """(2, q, k) of s and r."""


def _together(parts: Sequence[Seen]) -> Seen:
    pair, which, pixel, rows, hit, places = zip(*parts, strict=True)
    return Seen(
        np.concatenate(pair),
        np.concatenate(which),
        np.concatenate(pixel),
        np.concatenate(rows),
        np.concatenate(hit),
        np.concatenate(places, axis=1),
    )


class Frame(NamedTuple):
    """Where the cells of a band are in its image."""

    base: int
    """Number of the first cell."""
    across: int
    """Cells in a row."""
    last: int
    """Last row of rays of the whole image."""
    width: int
    """Rays in a row."""

    def pixels(self, cell: Integers) -> Integers:
        """Return the places of the rays of cells (p,) in the band's image: (p, CELL^2)."""
        return self.pixel(cell[:, None], _SPOTS)

    def pixel(self, cell: Integers, spot: Integers) -> Integers:
        """Return the places of rays in the band's image.

        :param spot: their numbers in their cells.
        """
        row, column = np.divmod(cell - self.base, self.across)
        first: Integers = (row * self.width + column) * CELL
        return first + (_ROW * self.width + _COLUMN).take(spot)

    def rows(self, cell: Integers) -> Integers:
        """Return the rows of the rays of cells: (p, CELL^2)."""
        return self.row(cell[:, None], _SPOTS)

    def row(self, cell: Integers, spot: Integers) -> Integers:
        """Return the rows of rays, given the numbers of their cells and theirs in these."""
        return np.minimum(cell // self.across * CELL + _ROW.take(spot), self.last)


def _eye(planes: Planes, which: Integers, rows: Integers) -> tuple[Single, Single]:
    """Return s and r of the eye's foot on rectangles (2, p, k), and its height (p, k) [m]."""
    vectors, start = planes.seen(which, rows)
    normal = vectors[0]
    square = normal[0] * normal[0] + normal[1] * normal[1] + normal[2] * normal[2]
    return start, 1 / np.sqrt(square)


class Shaded(NamedTuple):
    """A body's shadow in an image."""

    planes: Planes
    """Of the part of the floor that may be in it."""
    pairs: Pairs
    line: ShadowLine

    def finishes(self, rays: Single, nearest: Single, band: "Frame") -> Iterator[Finish]:
        """Yield what the shadow does to the pixels of a band.

        :param rays: (3, c, CELL^2) of the band.
        :param nearest: (c, CELL^2) inverse distance of what is seen.
        """
        cells = self.pairs.cell
        begin, end = np.searchsorted(cells, [band.base, band.base + len(nearest)]).tolist()
        for first in range(begin, end, _REGIONS):
            cell = cells[first : min(first + _REGIONS, end)]
            own = cell - band.base
            away = nearest.take(own, axis=0)
            rows, pixel = band.rows(cell), band.pixels(cell)
            yield from self._finish(rays.take(own, axis=1), rows, away, pixel)

    def finishes_of(
        self, rays: Single, rows: Integers, cell: Integers, inverse: Single
    ) -> Iterator[Finish]:
        """Yield what it does to k values of parts of pixels.

        :param rays: (3, k, 1) of the pixels.
        :param rows: (k, 1) of these rays.
        :param cell: (k,) of them.
        :param inverse: (k,) inverse distance of what the parts see.
        """
        some = np.flatnonzero(np.isin(cell, self.pairs.cell))
        away = inverse.take(some)[:, None]
        yield from self._finish(rays.take(some, axis=1), rows[some], away, some[:, None])

    def _finish(
        self, rays: Single, rows: Integers, away: Single, pixel: Integers
    ) -> Iterator[Finish]:
        """Yield what it does to values ``pixel`` (q, k), seen at inverse distances ``away``."""
        which = np.zeros(len(rows), np.int64)
        hit, inverse, places = self.planes.meet(which, rays, rows)
        seen = away > 0.0
        _, height = _eye(self.planes, which, rows)
        above = height * (1 - inverse / np.where(seen, away, np.float32(1.0)))
        hit &= within(places)
        hit &= seen & (np.abs(above) < _ON_FLOOR)
        keep = self.line.kept(places)
        some = np.flatnonzero(hit & (keep < 1.0))
        if len(some):
            yield Finish(pixel.ravel().take(some), keep.ravel().take(some), _NOTHING)


def joined(parts: Iterable[Finish]) -> Finish | None:
    """Return all of them as one; None: there are none."""
    some = list(parts)
    if not some:
        return None
    pixel, keep, add = zip(*some, strict=True)
    return Finish(np.concatenate(pixel), np.concatenate(keep), np.concatenate(add, axis=1))
