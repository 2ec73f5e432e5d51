# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Rectangles in the world, and the rays that meet them."""

import math
from collections.abc import Iterator, Sequence
from typing import Any, Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from imu_sim_ros.core.types import Array, Integers, Mask

Floats = NDArray[np.floating[Any]]
Kind = type[np.float32] | type[np.float64]
"""Type of the numbers to calculate with."""
Rectangle = tuple[Array, Array, Array]
"""Origin, across and up, each (3,) [m]."""

_SELF: float = 1e-6
"""Relative depth within which a landmark lies on a surface and is not hidden by it."""
_RAYS: Final = 16_384
"""Rays that are processed at once: their arrays stay in a processor's cache."""


class Surfaces(NamedTuple):
    """m rectangles: ``origin + s across + t up`` for s and t from 0 to 1."""

    origin: Array
    """(m, 3) p_w of a corner [m]."""
    across: Array
    """(m, 3) the side from the origin, s [m]."""
    up: Array
    """(m, 3) the other side from the origin, t [m]."""
    hides: Mask
    """(m,) True if a rectangle may hide something; False for the walls of a room."""
    texture: tuple[str, ...]
    """Names of the textures of the m surfaces."""

    @property
    def normal(self) -> Array:
        """(m, 3) unit vectors, across x up."""
        n = np.cross(self.across, self.up)
        unit: Array = n / np.linalg.norm(n, axis=1, keepdims=True)
        return unit

    @property
    def corners(self) -> Array:
        """(m, 4, 3) corners from the origin on, across first, once around each rectangle [m]."""
        end = self.origin + self.across
        return np.stack([self.origin, end, end + self.up, self.origin + self.up], axis=1)

    def some(self, which: Mask) -> "Surfaces":
        """Return the rectangles for which a mask (m,) is True."""
        names = tuple(self.texture[m] for m in np.flatnonzero(which))
        return Surfaces(
            origin=self.origin[which],
            across=self.across[which],
            up=self.up[which],
            hides=self.hides[which],
            texture=names,
        )

    @property
    def sides(self) -> Array:
        """(m, 2) lengths of across and up [m]."""
        squares = [(side * side).sum(axis=1) for side in (self.across, self.up)]
        return np.sqrt(np.stack(squares, axis=1))


def surfaces(rectangles: Sequence[Rectangle], hides: bool, texture: str = "wall") -> Surfaces:
    """Return rectangles as arrays, all with the same texture and the same ``hides``."""
    columns = np.array(rectangles, dtype=np.float64).reshape(-1, 3, 3)
    count = len(columns)
    return Surfaces(
        origin=columns[:, 0],
        across=columns[:, 1],
        up=columns[:, 2],
        hides=np.full(count, hides),
        texture=(texture,) * count,
    )


def join_surfaces(first: Surfaces, second: Surfaces) -> Surfaces:
    """Return the rectangles of two sets, one after the other."""
    return Surfaces(
        origin=np.concatenate([first.origin, second.origin]),
        across=np.concatenate([first.across, second.across]),
        up=np.concatenate([first.up, second.up]),
        hides=np.concatenate([first.hides, second.hides]),
        texture=first.texture + second.texture,
    )


NO_SURFACES = surfaces([], hides=True)


def is_hidden(surfaces: Surfaces, eye: Array, points: Array) -> Mask:
    """Return True for points behind a surface.

    The line of sight ``eye + s (point - eye)`` meets the plane of a surface at
    ``s = n (origin - eye) / n (point - eye)``.

    :param eye: (n, 3) where each point is seen from [m].
    :param points: (n, 3) [m].
    """
    result = np.zeros(len(points), dtype=bool)
    sight = [points[:, k] - eye[:, k] for k in range(3)]
    normals = surfaces.normal
    for m in np.flatnonzero(surfaces.hides):
        n, o = normals[m], surfaces.origin[m]
        along = n[0] * sight[0] + n[1] * sight[1] + n[2] * sight[2]
        start = n[0] * (o[0] - eye[:, 0]) + n[1] * (o[1] - eye[:, 1]) + n[2] * (o[2] - eye[:, 2])
        with np.errstate(divide="ignore", invalid="ignore"):
            s = start / along
        between = (s > 0.0) & (s < 1.0 - _SELF)
        if not between.any():
            continue
        rows = np.flatnonzero(between)
        offset = [eye[rows, k] + s[rows] * sight[k][rows] - o[k] for k in range(3)]
        within = np.ones(len(rows), dtype=bool)
        for side in (surfaces.across[m], surfaces.up[m]):
            place = offset[0] * side[0] + offset[1] * side[1] + offset[2] * side[2]
            within &= (place >= 0.0) & (place <= float(side @ side))
        result[rows[within]] = True
    return result


def nearest_distances(surfaces: Surfaces, points: Array) -> Array:
    """Return the distance (m,) of each rectangle from the nearest of points (n, 3) [m]."""
    result = np.empty(len(surfaces.origin))
    for k, (o, a, b) in enumerate(zip(*surfaces[:3], strict=True)):
        offset = points - o
        s, r = ((offset @ side / (side @ side)).clip(0.0, 1.0)[:, None] for side in (a, b))
        rest = offset - s * a - r * b
        result[k] = math.sqrt(float((rest * rest).sum(axis=1).min()))
    return result


class Hits(NamedTuple):
    """Nearest intersections of n rays with the surfaces."""

    distance: Floats
    """(n,) distances in lengths of the ray's direction; infinite: the ray meets nothing."""
    surface: Integers
    """(n,) numbers of the surfaces; -1: the ray meets nothing."""


class Caster:
    """Meets rays with rectangles, from either side.

    >>> import numpy as np
    >>> sides = np.array([2.0, -1, -1]), np.array([0.0, 2, 0]), np.array([0.0, 0, 2])
    >>> rays = np.array([[1.0, 0, 0], [0, 1, 0]])
    >>> Caster(surfaces([sides], hides=True)).cast(np.zeros((2, 3)), rays)
    Hits(distance=array([ 2., inf]), surface=array([ 0, -1]))
    """

    def __init__(self, surfaces: Surfaces, kind: Kind = np.float64) -> None:
        """Initialise with rectangles.

        :param kind: type of the numbers to calculate with: float32 or float64.
        """
        self.surfaces, self._kind = surfaces, kind
        self._planes = list(_planes(surfaces, kind))

    def cast(self, origins: Floats, directions: Floats, nearest: float = 1e-4) -> Hits:
        """Return the first intersection of each ray ``origin + t direction``.

        :param origins: (n, 3) [m].
        :param directions: (n, 3) of any length.
        :param nearest: smallest t of an intersection.
        """
        distance: Floats = np.full(len(origins), np.inf, self._kind)
        number = np.full(len(origins), -1, np.int64)
        for part in _parts(len(origins)):
            rays = _Rays.of(origins[part], directions[part], self._kind)
            best, which = distance[part], number[part]
            for m, plane in enumerate(self._planes):
                t, hit = plane.meet(rays)
                hit &= t > nearest
                hit &= t < best
                if hit.any():
                    np.copyto(best, t, where=hit)
                    which[hit] = m
        return Hits(distance, number)

    def is_blocked(self, origins: Floats, directions: Floats, ends: Floats | float = 1.0) -> Mask:
        """Return True for rays (n,) that hit a surface between their origin and t = ``ends``.

        :param origins: (n, 3) [m].
        :param directions: (n, 3) of any length.
        :param ends: (n,) largest t of an intersection, or one number.
        """
        result = np.zeros(len(origins), np.bool_)
        ends = np.broadcast_to(np.asarray(ends, self._kind), (len(origins),))
        for part in _parts(len(origins)):
            rays = _Rays.of(origins[part], directions[part], self._kind)
            hit_part, end = result[part], ends[part]
            for plane in self._planes:
                t, hit = plane.meet(rays)
                hit &= t > 1e-4
                hit &= t < end
                hit_part |= hit
        return result


class _Rays(NamedTuple):
    """n rays in components: x, y and z of each quantity, (n,) each."""

    origin: list[Floats]
    direction: list[Floats]
    inverse: list[Floats]
    """1 / direction, a large number instead of an infinite one."""

    @classmethod
    def of(cls, origins: Floats, directions: Floats, kind: Kind) -> "_Rays":
        """Return rays (n, 3) in components; directions of 0 along an axis become tiny ones."""
        starts: list[Floats] = [np.ascontiguousarray(origins[:, k], kind) for k in range(3)]
        axes: list[Floats] = [np.ascontiguousarray(directions[:, k], kind) for k in range(3)]
        tiny, unity = kind(1e-12), kind(1.0)
        inverse = [unity / np.where(np.abs(axis) < tiny, tiny, axis) for axis in axes]
        return cls(starts, axes, inverse)


class _Plane(NamedTuple):
    """A rectangle that is perpendicular to an axis, with sides along the other two."""

    axis: int
    """Axis of its normal: 0, 1, 2."""
    place: float
    """Coordinate of its plane on this axis [m]."""
    sides: tuple[tuple[int, float, float], tuple[int, float, float]]
    """Axis, smallest and largest coordinate [m] of each side."""

    def meet(self, rays: _Rays) -> tuple[Floats, Mask]:
        """Return t (n,) where rays meet the plane, and True (n,) for those within the rectangle."""
        t = self.place - rays.origin[self.axis]
        t *= rays.inverse[self.axis]
        within_bounds: Mask | None = None
        for axis, low, high in self.sides:
            position = t * rays.direction[axis]
            position += rays.origin[axis]
            within = position >= low
            within &= position <= high
            within_bounds = within if within_bounds is None else within_bounds & within
        assert within_bounds is not None
        return t, within_bounds


class _Oblique(NamedTuple):
    """A rectangle in any attitude."""

    normal: Floats
    """(3,) unit normal."""
    offset: float
    """Normal times any point of the plane [m]."""
    sides: tuple[tuple[Floats, float], tuple[Floats, float]]
    """Each side (3,) over the square of its length, and its product with the origin: along the
    side, a point p of the rectangle has ``side p - start`` from 0 to 1."""

    def meet(self, rays: _Rays) -> tuple[Floats, Mask]:
        """Return t (n,) where rays meet the plane, and True (n,) for those within the rectangle."""
        along = _dot(self.normal, rays.direction)
        tiny = along.dtype.type(1e-12)
        along = np.where(np.abs(along) < tiny, tiny, along)
        t = (self.offset - _dot(self.normal, rays.origin)) / along
        within_bounds: Mask | None = None
        for side, start in self.sides:
            coordinate = _dot(side, rays.origin) - start + t * _dot(side, rays.direction)
            within = coordinate >= 0.0
            within &= coordinate <= 1.0
            within_bounds = within if within_bounds is None else within_bounds & within
        assert within_bounds is not None
        return t, within_bounds


def _dot(vector: Floats, axes: Sequence[Floats]) -> Floats:
    """Return the scalar products (n,) of a vector (3,) and n vectors in components."""
    result: Floats = vector[0] * axes[0] + vector[1] * axes[1] + vector[2] * axes[2]
    return result


def _planes(surfaces: Surfaces, kind: Kind) -> Iterator[_Plane | _Oblique]:
    """Yield each rectangle in the form for which intersections take the fewest operations."""
    normals = surfaces.normal
    for m, (o, a, b) in enumerate(zip(*surfaces[:3], strict=True)):
        axes = [np.flatnonzero(np.abs(vector) > 1e-9) for vector in (normals[m], a, b)]
        if all(len(components) == 1 for components in axes):
            ends = [
                (int(axes[k][0]), o[axes[k][0]], (o + side)[axes[k][0]])
                for k, side in ((1, a), (2, b))
            ]
            first, second = ((axis, kind(min(u, v)), kind(max(u, v))) for axis, u, v in ends)
            yield _Plane(int(axes[0][0]), kind(o[axes[0][0]]), (first, second))
            continue
        n = normals[m]
        shares = [side / (side * side).sum() for side in (a, b)]
        across_side, up_side = ((side.astype(kind), kind(side @ o)) for side in shares)
        yield _Oblique(n.astype(kind), kind(n @ o), (across_side, up_side))


def _parts(count: int) -> Iterator[slice]:
    """Yield slices of ``count`` rays, each of as many as are processed at once."""
    for start in range(0, count, _RAYS):
        yield slice(start, min(start + _RAYS, count))
