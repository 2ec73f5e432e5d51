# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Light that depends on the eye: highlights of lamps and sun, and reflections in glass.

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
from numpy.typing import NDArray

from imu_sim_ros.core.types import Array, Integers, Mask, Single
from imu_sim_ros.places.light import GAMMA, Baked
from imu_sim_ros.places.place import Face, Place
from imu_sim_ros.places.sheet import Print

_ONE: Final = np.float32(1.0)
_FULL: Final = np.float32(255.0**2)
_LEAST: Final = 0.006
"""Mirrored light below which gloss is left out, as a share of white."""
_FAINT: Final = 0.02
"""Light that is subtracted from a highlight, so that it has an end."""
_NARROW: Final = 0.15
"""Side below which a face has no gloss [m]."""
_WIDEST: Final = 2.0 * 2.0**0.5
"""Angle from the mirrored direction at which a lobe ends, in half-widths of its blur: at the
largest slant, along the diagonal of a lamp."""
_PIXELS: Final = np.float32(6.0)
"""Half a cell, with a margin for perspective [pixels]."""


def normal_reflectance(index: float) -> float:
    """Return the share of light that is mirrored by a surface seen square on: Fresnel's equation.

    :param index: refractive index.

    >>> round(normal_reflectance(1.5), 6)
    0.04
    """
    return ((index - 1.0) / (index + 1.0)) ** 2


def reflectance(cosine: Single, normal: Single | float) -> Single:
    """Return the share of light that is mirrored, by Schlick: ``F + (1 - F) (1 - cos)^5``.

    :param cosine: cosine of the angle from the normal.
    :param normal: share F at normal incidence.
    """
    x = _ONE - cosine
    square = x * x
    return square * square * x * (_ONE - normal) + normal


def limit_highlight(light: Single, is_lamp: Single) -> Single:
    """Return the visible light of a highlight; that of a lamp is never brighter than the lamp.

    :param is_lamp: 1 for a lamp, 0 for the sun.
    """
    return light / (_ONE + is_lamp * light)


class Gloss(NamedTuple):
    """Parameters of specular reflection of a surface."""

    normal: float
    """Share of the light that is mirrored at normal incidence."""
    smooth: float
    """Share of the environment that is mirrored at all; a rough surface shows less of it."""
    doublings: int
    """The exponent of Phong's lobe is 2 to the power of this."""
    clear: bool = False
    """True for glass, whose colour is that of what is behind it."""


_MATERIALS: Final = {
    "tiles": Gloss(normal_reflectance(1.5), 0.6, 11),
    "board": Gloss(normal_reflectance(1.5), 0.3, 7),
    "paint": Gloss(normal_reflectance(1.5), 0.3, 8),
    "metal": Gloss(0.55, 0.5, 7),
}
"""Gloss of materials: glazed, varnished, lacquered; brushed steel."""
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
    """Number of the face."""
    gloss: Gloss
    low: tuple[float, float]
    """Coordinates s and r of the lower left corner on the face."""
    high: tuple[float, float]
    """Coordinates s and r of the upper right corner."""


def regions(faces: Sequence[Face], sides: Array) -> list[Region]:
    """Return the glossy parts of faces in order; a print comes after the material below it.

    :param sides: (m, 2) lengths of across and up [m].
    """
    glossy = []
    for m, face in enumerate(faces):
        width, height = sides[m].tolist()
        if face.glows or face.sky or min(width, height) < _NARROW:
            continue
        whole = _MATERIALS.get(face.material.partition(":")[0])
        if whole is not None:
            glossy.append(Region(m, whole, (0.0, 0.0), (1.0, 1.0)))
        for print_ in face.prints:
            if print_.kind in _PRINTS and not print_.glows:
                gloss, (left, bottom, right, top) = _PRINTS[print_.kind]
                low = (print_.left + left) / width, (print_.bottom + bottom) / height
                end = print_.left + print_.width - right, print_.bottom + print_.height - top
                glossy.append(Region(m, gloss, low, (end[0] / width, end[1] / height)))
    return glossy


def glossy(faces: Sequence[Face], sides: Array) -> Mask:
    """Return True for faces (m,) with glossy parts.

    :param sides: (m, 2) lengths of across and up [m].
    """
    mask = np.zeros(len(faces), np.bool_)
    mask[[region.face for region in regions(faces, sides)]] = True
    return mask


def panes(faces: Sequence[Face], sides: Array) -> list[Region]:
    """Return the parts of faces that are glass, including windows that glow by day.

    :param sides: (m, 2) lengths of across and up [m].
    """
    dark = [face._replace(prints=tuple(map(_unlit, face.prints))) for face in faces]
    return [region for region in regions(dark, sides) if region.gloss.clear]


def _unlit(print_: Print) -> Print:
    """Return a window as one that does not glow."""
    return print_._replace(kind="glass", glows=False) if print_.kind == "window" else print_


class Sights(NamedTuple):
    """Places (p, k) of surfaces, and the eyes that see them."""

    s: Single
    """Place across, from 0 to 1."""
    r: Single
    """Place up."""
    across: Single
    """Distance across from the eye's foot on the plane [m]."""
    up: Single
    height: Single
    """Height of the eye above the plane [m]; (p, k) or (p, 1)."""
    away: Single
    """Distance of the eye [m]."""

    @classmethod
    def of(cls, places: Single, start: Single, height: Single, sides: Single) -> "Sights":
        """Return the sights of places from an eye.

        :param places: (2, p, k) s and r.
        :param start: (2, p, k) or (2, p, 1) s and r of the eye's foot.
        :param height: (p, k) or (p, 1) height of the eye above the plane [m].
        :param sides: (2, p, 1) lengths of the sides of the surface [m].
        """
        across, up = (places - start) * sides
        away = np.sqrt(across * across + up * up + height * height)
        return cls(s=places[0], r=places[1], across=across, up=up, height=height, away=away)

    def some(self, rows: Integers) -> "Sights":
        """Return the sights of the rows (q,) of an index."""
        return Sights(*(column.take(rows, axis=0) for column in self))


_REGION: Final = np.dtype(
    [
        ("face", np.int64),
        ("bounds", np.float32, 4),  # s and r of the lower left corner, and of the upper right one
        ("normal", np.float32),  # share that is mirrored square on
        ("base", np.float32),  # share that is in the colour of the surface already
        ("smooth", np.float32),  # share of the environment that is mirrored at all
        ("doublings", np.int64),  # the exponent of the lobe is 2 to the power of them
        ("gain", np.float32),  # of the middle of the lobe
        ("blur", np.float32),  # half-width of a smooth step that is as wide [rad]
    ],
    align=True,
)
_FACE: Final = np.dtype(
    [
        ("sides", np.float32, 2),  # their lengths [m]
        ("upwards", np.float32, 3),  # upward part of the directions of sides and normal
        ("first", np.int64),  # where its light begins
        ("shape", np.int64, 2),  # rows and columns of its light
    ],
    align=True,
)
_SOURCE: Final = np.dtype(
    [
        ("near", np.float32),  # 1 for a lamp, 0 for the sun
        ("halves", np.float32, 2),  # of a lamp's sides [m]
        ("colour", np.float32, 3),  # in each of the image's colours, times 255^2
    ],
    align=True,
)
_SIGHT: Final = np.dtype(
    [
        # Middle of a lamp, direction of the sun, along the face's sides and normal [m].
        ("place", np.float32, 3),
        ("axes", np.float32, (3, 3)),  # unit vectors of a lamp's sides and normal, likewise
    ],
    align=True,
)


class Sheen(NamedTuple):
    """Appearance of k glossy regions: records, and arrays."""

    regions: NDArray[np.void]
    """(k,) records of the regions."""
    floor: Single
    """(k, sources) reduction of a lobe's power."""
    faces: NDArray[np.void]
    """(m,) records of the faces."""
    sources: NDArray[np.void]
    """(sources,) records of the lamps and the sun."""
    sights: NDArray[np.void]
    """(m, sources) records of each source as seen from each face."""
    light: Single
    """(all,) irradiance on points of faces, source by source, without its colour."""
    mirrored: Single
    """(3, colours) squares of the colours seen in mirrors that look down, level and up."""

    @classmethod
    def empty(cls, regions: int, faces: int, sources: int, colours: int) -> "Sheen":
        """Return records and arrays of zeros for some regions, faces, sources and colours."""
        return cls(
            regions=np.zeros(regions, _REGION),
            floor=np.zeros((regions, sources), np.float32),
            faces=np.zeros(faces, _FACE),
            sources=np.zeros(sources, _SOURCE),
            sights=np.zeros((faces, sources), _SIGHT),
            light=np.zeros(0, np.float32),
            mirrored=np.zeros((3, colours), np.float32),
        )


class Polish:
    """The gloss of a place."""

    def __init__(self, place: Place, light: Baked, radiance: Single, weights: Single) -> None:
        """Initialise with a place and its light.

        :param light: light on the faces with its exposure.
        :param radiance: (m, 3) mean light that each face gives.
        :param weights: (colours, 3) weights of red, green and blue in each colour of the image.
        """
        where = place.surfaces()
        glossy = regions(place.faces, where.sides)
        self.face = np.array([region.face for region in glossy], np.int64)
        self.count = np.bincount(self.face, minlength=len(place.faces))
        """(m,) number of regions of each face."""
        self._first = np.cumsum(self.count) - self.count
        glosses = [region.gloss for region in glossy]
        normal, smooth = (np.array([gloss[k] for gloss in glosses], np.float32) for k in (0, 1))
        at_60 = reflectance(np.full(len(glossy), 0.5, np.float32), normal)
        doublings = np.array([gloss.doublings for gloss in glosses], np.int64)
        units = np.stack(
            [where.across / where.sides[:, :1], where.up / where.sides[:, 1:], where.normal]
        )
        sources = _Sources.of(place, units, where.origin, light, weights)
        power = np.float32(2.0) ** doublings.astype(np.float32)
        gain = np.float32(0.5) * (power + np.float32(2.0))
        peak = limit_highlight(sources.most[self.face] * gain[:, None], sources.near)
        peak *= sources.brightest * at_60[:, None]
        blur = np.sqrt(np.float32(5.0) / power)
        floor, self._lobe, self._sine = _lobes(peak, power, blur, sources.near)
        bounds = [[*region.low, *region.high] for region in glossy]
        self._bounds = np.array(bounds, np.float32).reshape(-1, 4).T
        self._normal, self._smooth = normal, smooth
        self._base = np.where([g.clear for g in glosses], np.float32(0.0), at_60)
        self._sources = sources
        environment = _environment(place, radiance, where.normal[:, 2], weights)
        sheen = Sheen.empty(len(glossy), len(units[0]), len(sources.near), len(weights))
        self.sheen = sheen._replace(floor=floor, light=sources.light, mirrored=environment)
        for name, values in (
            ("face", self.face),
            ("bounds", self._bounds.T),
            ("normal", normal),
            ("base", self._base),
            ("smooth", smooth),
            ("doublings", doublings),
            ("gain", gain),
            ("blur", blur),
        ):
            sheen.regions[name] = values
        sheen.faces["sides"] = sources.sides.T
        sheen.faces["upwards"] = units[..., 2].T
        sheen.faces["first"], sheen.faces["shape"] = sources.first, sources.shapes
        sheen.sources["near"], sheen.sources["halves"] = sources.near, sources.halves.T
        sheen.sources["colour"][:, : len(weights)] = sources.colour.T
        sheen.sights["place"] = sources.place.transpose(1, 2, 0)
        sheen.sights["axes"] = sources.axes.transpose(2, 3, 0, 1)

    def active(self, face: Integers, sights: Sights, steps: Single, angle: float) -> "Active":
        """Return the regions of faces (p,) that may be visible in cells, and their light sources.

        :param sights: (p, 1) sights of the middles of the cells.
        :param steps: (2, p) differences of s and r from one pixel to the next; huge: unknown.
        :param angle: largest angle between two rays of a cell [rad].
        """
        pair, region = self._regions_in_cells(face, sights, steps)
        pair_sights = sights.some(pair)
        # The flattest view within a cell mirrors most.
        cosine = pair_sights.height / pair_sights.away - np.float32(angle)
        faint = self._share(region, np.maximum(cosine, 0))[:, 0] < np.float32(_LEAST)
        sides = self._sources.sides[:, self.face[region]]
        cell_size = np.sqrt(((_PIXELS * steps[:, pair] * sides) ** 2).sum(axis=0))
        lobe = self._lobe[region], self._sine[region]
        lit = self._sources.near_lobe(self.face[region], pair_sights, lobe, cell_size, angle)
        visible = ~faint | lit.any(axis=1)
        return Active(pair[visible], region[visible], lit[visible])

    def _regions_in_cells(
        self, face: Integers, sights: Sights, steps: Single
    ) -> tuple[Integers, Integers]:
        """Return pairs (q,): numbers of cells, ascending, and of regions that may reach into them.

        A cell extends by ``_PIXELS`` steps around its middle. Arguments as for :meth:`active`.
        """
        counts = self.count[face]
        pair = np.repeat(np.arange(len(face)), counts)
        order = np.arange(len(pair)) - np.repeat(np.cumsum(counts) - counts, counts)
        region = self._first[face[pair]] + order
        s_low, r_low, s_high, r_high = self._bounds
        for place, step, low, high in (
            (sights.r, steps[1], r_low, r_high),
            (sights.s, steps[0], s_low, s_high),
        ):
            lower, upper = place[:, 0] - _PIXELS * step, place[:, 0] + _PIXELS * step
            overlaps = (upper.take(pair) >= low.take(region)) & (
                lower.take(pair) <= high.take(region)
            )
            pair, region = pair[overlaps], region[overlaps]
        return pair, region

    def sights(self, face: Integers, places: Single, start: Single, height: Single) -> Sights:
        """Return the sights of places s and r (2, p, k) of faces (p,).

        :param start: (2, p, k) or (2, p, 1) s and r of the eye's foot.
        """
        return Sights.of(places, start, height, self._sources.sides[:, face, None])

    def _share(self, region: Integers, cosine: Single) -> Single:
        """Return the share (p, k) of the environment that regions (p,) mirror."""
        share = reflectance(cosine, self._normal[region, None])
        share -= self._base[region, None]
        np.maximum(share, 0, out=share)
        share *= self._smooth[region, None]
        return share


class Active(NamedTuple):
    """Glossy regions that may be visible in cells."""

    pair: Integers
    """(q,) number of the place where they are seen, ascending."""
    region: Integers
    """(q,) numbers of the regions."""
    lit: Mask
    """(q, sources) True if the source's highlight may be there."""


def _lobes(
    peak: Single, power: Single, blur: Single, is_lamp: Single
) -> tuple[Single, Single, Single]:
    """Return the share of a lobe's peak (k, sources) below which its highlight is not visible.

    The other results are cosine and sine of the angle at which the lobe falls below it.

    :param peak: (k, sources) brightest highlights.
    :param power: (k,) exponents of the lobes.
    :param blur: (k,) half-widths of their smooth steps [rad].
    :param is_lamp: (sources,) 1 for lamps.
    """
    with np.errstate(divide="ignore"):
        floor = np.round(np.minimum(_FAINT / peak.astype(np.float64), 1.0), 6)
    of_sun = floor ** (1.0 / power[:, None].astype(np.float64))
    of_lamps = np.cos(np.minimum(_WIDEST * blur.astype(np.float64), 1.5))[:, None]
    cosine = np.round(np.where(is_lamp > 0, of_lamps, of_sun) - 1e-4, 4)
    sine = np.sqrt(np.maximum(1.0 - cosine * cosine, 0.0))
    cosine[floor >= 1.0] = np.inf
    return floor.astype(np.float32), cosine.astype(np.float32), sine.astype(np.float32)


def _environment(place: Place, radiance: Single, upwards: Array, weights: Single) -> Single:
    """Return squares (3, colours) of the colours in mirrors that look down, level and up.

    :param upwards: (m,) z of the normals.
    """
    areas = place.surfaces().sides.prod(axis=1) * place.detail**2
    means = []
    for which in (upwards > 0.5, (np.abs(upwards) <= 0.5) & ~place.sky, upwards < -0.5):
        area = np.where(which, areas, 0.0)
        if not area.any():
            means.append(np.zeros(3))
            continue
        mean = (radiance * area[:, None]).sum(axis=0) / area.sum()
        means.append(np.round(255.0 * np.minimum(mean, 1.0) ** (1.0 / GAMMA), 2))
    colours = np.array(means, np.float32)[:, None] * weights
    values: Single = colours.sum(axis=2)
    return values * values


class _Sources(NamedTuple):
    """l light sources, lamps and the sun, as m faces see them."""

    place: Single
    """(3, m, l) middle, along the sides and the normal of each face [m]; of the sun its direction.
    """
    axes: Single
    """(3, 3, m, l) unit vectors of a lamp's sides and normal, likewise."""
    halves: Single
    """(2, l) halves of the sides of lamps [m]."""
    sides: Single
    """(2, m) lengths of the sides of faces [m]."""
    near: Single
    """(l,) 1 for a lamp, 0 for the sun."""
    colour: Single
    """(colours, l) light in the colours of the image, times 255^2."""
    light: Single
    """(all,) irradiance on points of faces, source by source, without its colour."""
    first: Integers
    """(m,) index at which a face's light begins."""
    shapes: Integers
    """(m, 2) rows and columns of a face's light."""
    most: Single
    """(m, l) largest light, without its colour."""
    brightest: Single
    """(l,) largest of red, green and blue."""

    @classmethod
    def of(
        cls, place: Place, units: Array, origins: Array, light: Baked, weights: Single
    ) -> "_Sources":
        """Return the sources of a place in the order of its light.

        :param units: (3, m, 3) directions of sides and normal of each face.
        """
        lamps, sun = place.lighting.lamps, np.array(place.lighting.to_sun)
        middles = [sum(0.5 * side for side in (2 * o, a, b)) for (o, a, b), _ in lamps]
        offsets = [middle - origins for middle in middles] + [np.broadcast_to(sun, origins.shape)]
        local = [[(unit * offset).sum(axis=1) for offset in offsets] for unit in units]
        shapes_of = np.array([(a, b) for (_, a, b), _ in lamps] + [np.eye(3)[:2]])
        lengths = np.sqrt((shapes_of * shapes_of).sum(axis=2))
        lamp_axes = shapes_of / lengths[..., None]
        lamp_axes = np.concatenate(
            [lamp_axes, np.cross(lamp_axes[:, :1], lamp_axes[:, 1:])], axis=1
        )
        # (3, 3, m, l): each axis of each lamp along each direction of each face.
        axes = (lamp_axes[:, :, None, None] * units).sum(axis=-1).transpose(1, 2, 3, 0)
        colours = np.array([*(lamp.colour for lamp in lamps), place.lighting.sun], np.float32)
        colours *= light.exposure
        shapes = np.array([source.shape[1:] for source in light.sources], np.int64)
        sizes = shapes.prod(axis=1) * len(offsets)
        brightest = np.array([source.max(axis=(1, 2)) for source in light.sources], np.float32)
        return cls(
            place=np.array(local, np.float32).swapaxes(1, 2),
            axes=np.ascontiguousarray(axes, np.float32),
            halves=(0.5 * lengths.T).astype(np.float32),
            sides=place.surfaces().sides.T.astype(np.float32),
            near=np.array([1.0] * len(lamps) + [0.0], np.float32),
            colour=(weights @ colours.T) * _FULL,
            light=np.concatenate([source.ravel() for source in light.sources]),
            first=np.cumsum(sizes) - sizes,
            shapes=shapes,
            most=2 * brightest,  # twice: at a slant, lobes are brighter
            brightest=colours.max(axis=1),
        )

    def near_lobe(
        self,
        face: Integers,
        sights: Sights,
        lobe: tuple[Single, Single],
        size: Single,
        angle: float,
    ) -> Mask:
        """Return True for sources (p, l) that cells around places (p, 1) of faces (p,) may mirror.

        :param lobe: cosine and sine (p, l) of the angle at which the lobes end.
        :param size: (p,) sizes of the cells on the faces [m].
        :param angle: largest angle between two rays of a cell [rad].
        """
        x, y, z = self.place[:, face]
        width, height = self.sides[:, face, None]
        x, y = x - self.near * (width * sights.s), y - self.near * (height * sights.r)
        dot = sights.across * x + sights.up * y + sights.height * z
        away = np.sqrt(x * x + y * y + z * z)
        cosine, sine = lobe
        extent = self.near * (size[:, None] + np.sqrt((self.halves * self.halves).sum(axis=0)))
        wide = np.float32(angle) + extent / np.maximum(away, np.float32(1e-3))
        in_lobe: Mask = dot > (cosine - sine * wide) * away * sights.away
        return in_lobe | (extent > away) & np.isfinite(cosine)
