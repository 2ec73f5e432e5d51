# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""What depends on the place of the eye: highlights of lamps and sun, glass that mirrors a little.

A glossy surface adds to its baked light, in units of pi times a radiance,

``F(cos) env(z) + F(cos) (n + 2) / 2 sum over sources of max(cos a, 0)^n E / max(cos, cos')``

with Fresnel's reflectance F by Schlick's approximation (An inexpensive BRDF model for
physically-based rendering, 1994), the angle a between the mirrored sight and the source, the angles
of sight and source from the normal, and the irradiance E from the source alone, shadows included:
Phong's lobe, normalised as by Neumann, Neumann and Szirmay-Kalos (Compact metallic reflectance
models, 1999), so that it keeps its power at grazing angles. Lamps are no points. The highlight of
one is its mirrored rectangle, blurred by the lobe: with s, A and w the place along a side, half of
that side and the half-width of the blur, where the mirrored sight meets the lamp's plane, the
product over both sides of ``S((A - s) / w) - S((-A - s) / w)``, where the smooth step S from -1 to
1 has the variance 1 / n of the lobe at ``w = sqrt(5 / n)`` times the distance and the slant. It is
divided by its value at s = 0; there the lobe is x times the light of the lamp itself, of which
x / (1 + x) is seen, because nothing mirrored is brighter. What is seen,
env, follows from the upward part of the mirrored direction alone: the mean of the ceiling or the
sky, the walls and the floor. The colour of what one cannot see through is that of a face seen
within 60 degrees of its normal, so that only ``F(cos) - F(1/2)`` counts there.
"""

from collections.abc import Sequence
from typing import Final, NamedTuple

import numpy as np

from imu_sim_ros.places.light import GAMMA, Baked
from imu_sim_ros.places.place import Face, Place
from imu_sim_ros.places.sheet import Print
from imu_sim_ros.types import Array, Integers, Mask, Single

_ONE: Final = np.float32(1.0)
_FULL: Final = np.float32(255.0**2)
_LEAST: Final = 0.006
"""Light, of that which is white, below which nobody looks for gloss."""
_FAINT: Final = 0.02
"""Light by which a highlight is lowered, so that it ends somewhere."""
_NARROW: Final = 0.15
"""Faces with a shorter side show none [m]."""
_SLANT: Final = np.float32(2.0)
"""By which a lobe that meets a lamp at a slant is wider at most."""
_WIDEST: Final = 2.0 * 2.0**0.5
"""Angle from the mirrored direction at which a lobe ends, in half-widths of its blur: at the
largest slant, along the diagonal of a lamp."""
_PIXELS: Final = np.float32(6.0)
"""Half a cell, and what perspective may add to it [pixels]."""


def normal_reflectance(index: float) -> float:
    """Return the share of light that is mirrored by a surface seen square on: Fresnel's equation.

    :param index: of refraction.

    >>> round(normal_reflectance(1.5), 6)
    0.04
    """
    return ((index - 1.0) / (index + 1.0)) ** 2


def reflectance(cosine: Single, normal: Single | float) -> Single:
    """Return the share of light that is mirrored, by Schlick: ``F + (1 - F) (1 - cos)^5``.

    :param cosine: of the angle from the normal.
    :param normal: the share F seen square on.
    """
    x = _ONE - cosine
    square = x * x
    square *= square
    square *= x
    square *= 1 - normal
    square += normal
    return square


class Gloss(NamedTuple):
    """How a surface mirrors."""

    normal: float
    """Share that is mirrored square on."""
    smooth: float
    """Share of the environment that is mirrored at all; a rough surface shows less of it."""
    doublings: int
    """The exponent of Phong's lobe is 2 to the power of this."""
    clear: bool = False
    """One sees through it; its colour is that of what is behind."""


_MATERIALS: Final = {
    "tiles": Gloss(normal_reflectance(1.5), 0.6, 11),
    "board": Gloss(normal_reflectance(1.5), 0.3, 7),
    "paint": Gloss(normal_reflectance(1.5), 0.3, 8),
    "metal": Gloss(0.55, 0.5, 7),
}
"""Glazed, varnished, lacquered; brushed steel."""
_GLASS: Final = Gloss(normal_reflectance(1.52), 1.0, 12, clear=True)
_PRINTS: Final[dict[str, tuple[Gloss, tuple[float, float, float, float]]]] = {
    "glass": (_GLASS, (0.07, 0.06, 0.07, 0.07)),
    "night": (_GLASS, (0.055, 0.055, 0.055, 0.055)),
    "panes": (_GLASS, (0.0, 0.0, 0.0, 0.0)),
    "shop": (_GLASS, (0.07, 0.35, 0.07, 0.68)),
    "screen": (_GLASS, (0.02, 0.02, 0.02, 0.02)),
    "whiteboard": (Gloss(normal_reflectance(1.5), 0.6, 9), (0.0, 0.0, 0.0, 0.0)),
}
"""Gloss of a print, but for a frame at its left, bottom, right and top [m]."""


class Region(NamedTuple):
    """A glossy part of a face."""

    face: int
    gloss: Gloss
    low: tuple[float, float]
    """s and r of its lower left corner."""
    high: tuple[float, float]


def regions(faces: Sequence[Face], sides: Array) -> list[Region]:
    """Return the glossy parts of faces in their order; what lies on another comes after it.

    :param sides: (m, 2) lengths of across and up [m].
    """
    found = []
    for m, face in enumerate(faces):
        width, height = sides[m].tolist()
        if face.glows or face.sky or min(width, height) < _NARROW:
            continue
        whole = _MATERIALS.get(face.material.partition(":")[0])
        if whole is not None:
            found.append(Region(m, whole, (0.0, 0.0), (1.0, 1.0)))
        for each in face.prints:
            if each.kind in _PRINTS and not each.glows:
                gloss, (left, bottom, right, top) = _PRINTS[each.kind]
                low = (each.left + left) / width, (each.bottom + bottom) / height
                end = each.left + each.width - right, each.bottom + each.height - top
                found.append(Region(m, gloss, low, (end[0] / width, end[1] / height)))
    return found


def panes(faces: Sequence[Face], sides: Array) -> list[Region]:
    """Return the parts of faces that are glass, windows through which it is bright, too.

    :param sides: (m, 2) lengths of across and up [m].
    """
    dark = [face._replace(prints=tuple(map(_unlit, face.prints))) for face in faces]
    return [region for region in regions(dark, sides) if region.gloss.clear]


def _unlit(each: Print) -> Print:
    """Return a window as one that does not glow."""
    return each._replace(kind="glass", glows=False) if each.kind == "window" else each


class Sights(NamedTuple):
    """Places (p, k) of surfaces, and the eyes that see them."""

    s: Single
    """Place across, from 0 to 1."""
    r: Single
    """Place up."""
    across: Single
    """From the eye's foot on the plane [m]."""
    up: Single
    height: Single
    """Of the eye above the plane [m]; (p, k) or (p, 1)."""
    away: Single
    """Distance of the eye [m]."""

    @classmethod
    def of(cls, places: Single, start: Single, height: Single, sides: Single) -> "Sights":
        """Return them.

        :param places: (2, p, k) s and r.
        :param start: (2, p, k) or (2, p, 1) s and r of the eye's foot.
        :param sides: (2, p, 1) lengths of the surface [m].
        """
        across, up = (places - start) * sides
        away = np.sqrt(across * across + up * up + height * height)
        return cls(places[0], places[1], across, up, height, away)

    def some(self, rows: Integers) -> "Sights":
        """Return those of some rows."""
        return Sights(*(each.take(rows, axis=0) for each in self))


class Added(NamedTuple):
    """What becomes of the square of a grey value v: ``keep v^2 + add``.

    A square instead of the power 2.2, since a root is exact everywhere.
    """

    keep: Single
    """(n,)."""
    add: Single
    """(colours, n)."""


class Polish:
    """The gloss of a place."""

    def __init__(self, place: Place, light: Baked, radiance: Single, weights: Single) -> None:
        """Take a place and its light.

        :param light: as exposed.
        :param radiance: (m, 3) mean light that each face gives.
        :param weights: (colours, 3) of red, green and blue in each of the image's colours.
        """
        where = place.surfaces()
        found = regions(place.faces, where.sides)
        self.face = np.array([each.face for each in found], np.int64)
        self.count = np.bincount(self.face, minlength=len(place.faces))
        """(m,) number of regions of each face."""
        self._first = np.cumsum(self.count) - self.count
        self._bounds = np.array([[*each.low, *each.high] for each in found], np.float32).T
        glosses = [each.gloss for each in found]
        self._normal, self._smooth = (
            np.array([gloss[k] for gloss in glosses], np.float32) for k in (0, 1)
        )
        at_60 = reflectance(np.full(len(found), 0.5, np.float32), self._normal)
        self._base = np.where([g.clear for g in glosses], np.float32(0.0), at_60)
        self._doublings = np.array([gloss.doublings for gloss in glosses], np.int64)
        self._sides = where.sides.T.astype(np.float32)
        units = np.stack(
            [where.across / where.sides[:, :1], where.up / where.sides[:, 1:], where.normal]
        )
        self._upwards = units[..., 2].astype(np.float32)
        self._mirrored = _environment(place, radiance, where.normal[:, 2], weights)
        self._sources = _Sources.of(place, units, where.origin, light, weights)
        power = np.float32(2.0) ** self._doublings.astype(np.float32)
        self._gain = np.float32(0.5) * (power + np.float32(2.0))
        peak = self._sources.mirrored(self._sources.most[self.face] * self._gain[:, None])
        peak *= self._sources.brightest * at_60[:, None]
        self._blur = np.sqrt(np.float32(5.0) / power)
        self._floor, self._lobe, self._sine = _lobes(peak, power, self._blur, self._sources.near)

    def active(self, face: Integers, sights: Sights, steps: Single, angle: float) -> "Active":
        """Return the regions of some faces (p,) that may be seen in a cell, and their sources.

        :param sights: (p, 1) of the middles of cells.
        :param steps: (2, p) differences of s and r from one pixel to the next; huge: unknown.
        :param angle: between two rays of a cell at most [rad].
        """
        counts = self.count[face]
        pair = np.repeat(np.arange(len(face)), counts)
        order = np.arange(len(pair)) - np.repeat(np.cumsum(counts) - counts, counts)
        region = self._first[face[pair]] + order
        for place, step, low, high in (
            (sights.r, steps[1], self._bounds[1], self._bounds[3]),
            (sights.s, steps[0], self._bounds[0], self._bounds[2]),
        ):
            least, most = place[:, 0] - _PIXELS * step, place[:, 0] + _PIXELS * step
            seen = (most.take(pair) >= low.take(region)) & (least.take(pair) <= high.take(region))
            pair, region = pair[seen], region[seen]
        there = sights.some(pair)
        cosine = there.height / there.away - np.float32(angle)
        faint = self._share(region, np.maximum(cosine, 0))[:, 0] < np.float32(_LEAST)
        sides = self._sides[:, self.face[region]]
        size = np.sqrt(((_PIXELS * steps[:, pair] * sides) ** 2).sum(axis=0))
        lit = self._sources.near_lobe(
            self.face[region], there, (self._lobe[region], self._sine[region]), size, angle
        )
        keep = ~faint | lit.any(axis=1)
        return Active(pair[keep], region[keep], lit[keep])

    def sights(self, face: Integers, places: Single, start: Single, height: Single) -> Sights:
        """Return the sights of places s and r (2, p, k) of faces (p,).

        :param start: (2, p, k) or (2, p, 1) s and r of the eye's foot.
        """
        return Sights.of(places, start, height, self._sides[:, face, None])

    def within(self, region: Integers, places: Single) -> Mask:
        """Tell which places s and r (2, p, k) lie in their region (p,)."""
        low, high = self._bounds[:2, region, None], self._bounds[2:, region, None]
        inside = places >= low
        inside &= places <= high
        inside[0] &= inside[1]
        return np.asarray(inside[0])

    def added(self, region: Integers, lit: Mask, sights: Sights) -> Added:
        """Return what gloss adds at places (p, k) of regions (p,): keep (p, k), add (c, p, k).

        :param lit: (p, sources) whose highlight may be there.
        """
        cosine = sights.height / sights.away
        share = self._share(region, cosine)
        upwards = self._upwards[:, self.face[region], None]
        z = sights.across * upwards[0] + sights.up * upwards[1] + sights.height * upwards[2]
        z /= sights.away
        down, level, up = self._mirrored[:, :, None, None]
        rise, fall = np.maximum(z, 0), np.maximum(-z, 0)
        add = level + rise * (up - level) + fall * (down - level)
        add *= share
        share = _ONE - share
        rows, sources = np.nonzero(lit)
        if len(rows):
            rank = np.arange(len(rows)) - np.searchsorted(rows, rows)
            mirrored = reflectance(cosine, self._normal[region, None])
            for k in range(int(rank.max()) + 1):
                some, source = rows[rank == k], sources[rank == k]
                here = sights.some(some)
                own = region[some]
                ends = self._floor[own, source]
                lobe = Lobe(self._doublings[own], ends, self._gain[own], self._blur[own])
                value = self._sources.seen(self.face[own], source, here, lobe)
                value *= mirrored[some]
                add[:, some] += self._sources.colour[:, source, None] * value
        return Added(share, add)

    def _share(self, region: Integers, cosine: Single) -> Single:
        """Return the share (p, k) of the environment that regions (p,) mirror."""
        share = reflectance(cosine, self._normal[region, None])
        share -= self._base[region, None]
        np.maximum(share, 0, out=share)
        share *= self._smooth[region, None]
        return share


class Active(NamedTuple):
    """Glossy regions that may be seen."""

    pair: Integers
    """(q,) number of the place where they are seen, ascending."""
    region: Integers
    """(q,)."""
    lit: Mask
    """(q, sources) whose highlight may be there."""


class Lobe(NamedTuple):
    """How p surfaces spread what they mirror."""

    doublings: Integers
    """(p,) The exponent is 2 to the power of them."""
    floor: Single
    """(p,) by which the power is lowered."""
    gain: Single
    """(p,) of the middle."""
    blur: Single
    """(p,) half-width of a smooth step that is as wide [rad]."""


def _lobes(
    peak: Single, power: Single, blur: Single, near: Single
) -> tuple[Single, Single, Single]:
    """Return the share of a lobe's middle (k, sources) below which no highlight is seen.

    And cosine and sine of the angle at which that is.

    :param peak: (k, sources) brightest highlights.
    :param power: (k,) exponents of the lobes.
    :param blur: (k,) half-widths of their smooth steps [rad].
    :param near: (sources,) 1 for lamps.
    """
    with np.errstate(divide="ignore"):
        floor = np.round(np.minimum(_FAINT / peak.astype(np.float64), 1.0), 6)
    of_sun = floor ** (1.0 / power[:, None].astype(np.float64))
    of_lamps = np.cos(np.minimum(_WIDEST * blur.astype(np.float64), 1.5))[:, None]
    cosine = np.round(np.where(near > 0, of_lamps, of_sun) - 1e-4, 4)
    sine = np.sqrt(np.maximum(1.0 - cosine * cosine, 0.0))
    cosine[floor >= 1.0] = np.inf
    return floor.astype(np.float32), cosine.astype(np.float32), sine.astype(np.float32)


def _environment(place: Place, radiance: Single, upwards: Array, weights: Single) -> Single:
    """Return what is seen in a mirror that looks down, level and up: (3, colours), squared.

    :param upwards: (m,) z of the normals.
    """
    areas = place.surfaces().sides.prod(axis=1) * place.detail**2
    found = []
    for which in (upwards > 0.5, (np.abs(upwards) <= 0.5) & ~place.sky, upwards < -0.5):
        area = np.where(which, areas, 0.0)
        if not area.any():
            found.append(np.zeros(3))
            continue
        mean = (radiance * area[:, None]).sum(axis=0) / area.sum()
        found.append(np.round(255.0 * np.minimum(mean, 1.0) ** (1.0 / GAMMA), 2))
    colours = np.array(found, np.float32)[:, None] * weights
    values: Single = colours.sum(axis=2)
    return values * values


class _Sources(NamedTuple):
    """Lamps, and the sun, as faces see them."""

    place: Single
    """(3, m, l) middle, along the sides and the normal of each face [m]; of the sun its direction.
    """
    axes: Single
    """(3, 3, m, l) unit vectors of a lamp's sides and normal, likewise."""
    halves: Single
    """(2, l) half of its sides [m]."""
    sides: Single
    """(2, m) lengths of the sides [m]."""
    near: Single
    """(l,) 1 for a lamp, 0 for the sun."""
    colour: Single
    """(colours, l), times 255^2."""
    light: Single
    """(all,) irradiance on points of faces, source by source, without its colour."""
    first: Integers
    """(m,) where a face's light begins."""
    shapes: Integers
    """(m, 2) rows and columns of it."""
    most: Single
    """(m, l) largest light, without its colour."""
    brightest: Single
    """(l,) largest of the colours."""

    @classmethod
    def of(
        cls, place: Place, units: Array, origins: Array, light: Baked, weights: Single
    ) -> "_Sources":
        """Take the sources of a place in the order of the light.

        :param units: (3, m, 3) directions of sides and normal of each face.
        """
        lamps, sun = place.lighting.lamps, np.array(place.lighting.to_sun)
        middles = [sum(0.5 * side for side in (2 * o, a, b)) for (o, a, b), _ in lamps]
        offsets = [middle - origins for middle in middles] + [np.broadcast_to(sun, origins.shape)]
        local = [[(unit * offset).sum(axis=1) for offset in offsets] for unit in units]
        shapes_of = np.array([(a, b) for (_, a, b), _ in lamps] + [np.eye(3)[:2]])
        lengths = np.sqrt((shapes_of * shapes_of).sum(axis=2))
        own = shapes_of / lengths[..., None]
        own = np.concatenate([own, np.cross(own[:, :1], own[:, 1:])], axis=1)
        # (3, 3, m, l): each axis of each lamp along each direction of each face.
        axes = (own[:, :, None, None] * units).sum(axis=-1).transpose(1, 2, 3, 0)
        colours = np.array([*(each.colour for each in lamps), place.lighting.sun], np.float32)
        colours *= light.exposure
        shapes = np.array([each.shape[1:] for each in light.sources], np.int64)
        sizes = shapes.prod(axis=1) * len(offsets)
        most = np.array([each.max(axis=(1, 2)) for each in light.sources], np.float32)
        return cls(
            np.array(local, np.float32).swapaxes(1, 2),
            np.ascontiguousarray(axes, np.float32),
            (0.5 * lengths.T).astype(np.float32),
            place.surfaces().sides.T.astype(np.float32),
            np.array([1.0] * len(lamps) + [0.0], np.float32),
            (weights @ colours.T) * _FULL,
            np.concatenate([each.ravel() for each in light.sources]),
            np.cumsum(sizes) - sizes,
            shapes,
            2 * most,  # twice: at a slant, lobes are brighter
            colours.max(axis=1),
        )

    def mirrored(self, light: Single, source: Integers | slice = slice(None)) -> Single:
        """Return what is seen of a lobe: of a lamp, not more than the lamp itself."""
        return light / (_ONE + self.near[source] * light)

    def near_lobe(
        self,
        face: Integers,
        sights: Sights,
        lobe: tuple[Single, Single],
        size: Single,
        angle: float,
    ) -> Mask:
        """Tell which sources (p, l) may be mirrored in cells around places (p, 1) of faces (p,).

        :param lobe: cosine and sine (p, l) of the angle from the mirrored direction.
        :param size: (p,) of the cells [m].
        """
        x, y, z = self.place[:, face]
        width, height = self.sides[:, face, None]
        x, y = x - self.near * (width * sights.s), y - self.near * (height * sights.r)
        dot = sights.across * x + sights.up * y + sights.height * z
        away = np.sqrt(x * x + y * y + z * z)
        cosine, sine = lobe
        near = self.near * (size[:, None] + np.sqrt((self.halves * self.halves).sum(axis=0)))
        wide = np.float32(angle) + near / np.maximum(away, np.float32(1e-3))
        seen: Mask = dot > (cosine - sine * wide) * away * sights.away
        return seen | (near > away) & np.isfinite(cosine)

    def seen(self, face: Integers, source: Integers, sights: Sights, lobe: Lobe) -> Single:
        """Return the light that is seen of sources in the mirrored direction (p, k).

        :param source: (p,) one for each.
        """
        middle = self.place[:, face, source, None]
        near = self.near[source, None] * self.sides[:, face, None]
        x, y, z = middle[0] - near[0] * sights.s, middle[1] - near[1] * sights.r, middle[2]
        share = np.empty_like(x)
        lamp = self.near[source] > 0
        for rows in (np.flatnonzero(lamp), np.flatnonzero(~lamp)):
            if len(rows):
                some, to = sights.some(rows), (x[rows], y[rows], z[rows])
                if lamp[rows[0]]:
                    blur = lobe.blur[rows]
                    share[rows] = self._of_lamp(face[rows], source[rows], some, to, blur)
                else:
                    share[rows] = _of_sun(some, to, lobe.doublings[rows], lobe.floor[rows])
        rows = np.flatnonzero(share.any(axis=1))
        result = np.zeros_like(share)
        if len(rows):
            here = sights.some(rows)
            x, y, z = x[rows], y[rows], z[rows]
            away = np.maximum(np.sqrt(x * x + y * y + z * z), np.float32(1e-6))
            value = self.light_at(face[rows], source[rows], here)
            value *= lobe.gain[rows, None]
            value /= np.maximum(here.height / here.away, z / away)
            value = self.mirrored(value, source[rows, None])
            value *= share[rows]
            result[rows] = value
        return result

    def _of_lamp(
        self,
        face: Integers,
        source: Integers,
        sights: Sights,
        to: tuple[Single, Single, Single],
        blur: Single,
    ) -> Single:
        """Return the share (p, k) of a highlight's middle that lamps (p,) have.

        :param to: the lamp's middle from the place that mirrors, along each direction of the face.
        """
        ray = sights.across, sights.up, sights.height

        def along(axis: Single, vector: tuple[Single, Single, Single]) -> Single:
            result: Single = axis[0] * vector[0] + axis[1] * vector[1] + axis[2] * vector[2]
            return result

        axes = self.axes[:, :, face, source, None]
        steepness, height = along(axes[2], ray), along(axes[2], to)
        ahead = height * steepness > 0  # the others never meet the lamp's plane
        steepness = np.where(ahead, steepness, _ONE)
        far = np.where(ahead, height, 0) / steepness
        wide = far * sights.away * blur[:, None]
        result: Single = ahead.astype(np.float32)
        for axis, half in zip(axes, self.halves[:, source, None], strict=False):
            side = along(axis, ray)
            place = far * side - along(axis, to)
            side /= steepness
            side *= side
            side += _ONE
            inverse = _ONE / np.maximum(
                wide * np.minimum(np.sqrt(side, out=side), _SLANT), np.float32(1e-6)
            )
            result *= _step((half - place) * inverse) + _step((half + place) * inverse)
            result /= 2 * _step(half * inverse)
        return result

    def light_at(self, face: Integers, source: Integers, sights: Sights) -> Single:
        """Return the light of sources (p,) at places (p, k), interpolated between its points."""
        rows, columns = self.shapes[face].T[..., None]
        first = (self.first[face] + source * self.shapes[face].prod(axis=1))[:, None]
        (low, down), (left, across) = (
            _between(place, count) for place, count in ((sights.r, rows), (sights.s, columns))
        )
        above, right = np.minimum(low + 1, rows - 1), np.minimum(left + 1, columns - 1)
        value: Single = np.zeros_like(sights.s)
        for row, part in ((low, _ONE - down), (above, down)):
            start = first + row * columns
            line = self.light.take(start + left) * (_ONE - across)
            line += self.light.take(start + right) * across
            value += part * line
        return value


def _between(place: Single, count: Integers) -> tuple[Integers, Single]:
    """Return the part before places from 0 to 1 among even parts, and how far the next one is."""
    at = np.clip(
        place * count.astype(np.float32) - np.float32(0.5), 0, (count - 1).astype(np.float32)
    )
    whole = at.astype(np.int64)
    return whole, at - whole.astype(np.float32)


def _step(place: Single) -> Single:
    """Return a smooth step from -1/2 to 1/2 between -1 and 1, whose slope has the variance 1/5."""
    x = np.clip(place, -_ONE, _ONE)
    result: Single = x * (np.float32(0.75) - np.float32(0.25) * x * x)
    return result


def _of_sun(
    sights: Sights, to: tuple[Single, Single, Single], doublings: Integers, floor: Single
) -> Single:
    """Return the share (p, k) of a highlight's middle that the sun has.

    :param to: direction of the sun along each direction of the face.
    :param doublings: (p,) and ``floor`` (p,): as those of :class:`Lobe`.
    """
    x, y, z = to
    dot = sights.across * x + sights.up * y + sights.height * z
    dot /= sights.away * np.sqrt(x * x + y * y + z * z)
    np.maximum(dot, 0, out=dot)
    for k in range(int(doublings.max())):
        np.multiply(dot, dot, out=dot, where=(doublings > k)[:, None])
    dot -= floor[:, None]
    return np.maximum(dot, 0, out=dot)
