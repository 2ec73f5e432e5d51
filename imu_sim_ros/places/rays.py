# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Nearest intersections of rays with the surfaces and the moving bodies of a scene."""

from collections.abc import Sequence
from typing import Final, NamedTuple, Protocol

import numpy as np
from numpy.typing import NDArray

from imu_sim_ros.core import rotation
from imu_sim_ros.core.errors import MissingDependencyError
from imu_sim_ros.core.types import Array, Integers, Mask
from imu_sim_ros.places.bodies import MovingBody, ball
from imu_sim_ros.places.geometry import Caster, Floats, Surfaces
from imu_sim_ros.places.mesh import MeshCaster
from imu_sim_ros.places.mesh_file import mesh_of_rectangles

_RAYS: Final = 65_536
"""Rays that are processed at once."""
_LOOKS: Final = 9
"""Number of times at which the position of a body is sampled."""
_SLACK: Final = 0.1
"""Margin for a body's position between two sampled times [m]: more than it moves."""


class Traced(NamedTuple):
    """Nearest intersections of n rays with surfaces at rest and moving bodies."""

    distance: Array
    """(n,) distances in lengths of the ray's direction; infinite: the ray meets nothing."""
    surface: Integers
    """(n,) number of the rectangle or triangle in its body or scene; -1: the ray meets nothing."""
    body: NDArray[np.uint8]
    """(n,) number of the moving body, from 1; 0: a surface at rest, or nothing."""
    along: Array
    """(n,) unit normal of the surface times the ray's direction; 0: nothing."""


class _Solid(Protocol):
    """A rigid set of surfaces with which rays are intersected."""

    def meet(self, origins: Array, directions: Array) -> tuple[Floats, Integers, Array]:
        """Return distances, numbers of surfaces and ``along`` (n,) of rays (n, 3)."""


class _Triangles:
    """Triangles, which embreex intersects."""

    def __init__(self, caster: MeshCaster, pieces: int = 1) -> None:
        """Initialise with triangles.

        :param pieces: number of consecutive triangles of one surface, 2 for rectangles.
        """
        self._caster, self._pieces = caster, pieces

    def meet(self, origins: Array, directions: Array) -> tuple[Floats, Integers, Array]:
        """Return distances (n,), surfaces (n,), and direction times normal (n,) of the hits."""
        hits, along = self._caster.meet(origins, directions)
        number = hits.surface // self._pieces if self._pieces > 1 else hits.surface
        along[number < 0] = 0.0
        return hits.distance, number, along


class _Rectangles:
    """Rectangles, for which embreex is not needed; its intersections are the same."""

    def __init__(self, surfaces: Surfaces) -> None:
        self._caster, self._normals = Caster(surfaces), surfaces.normal

    def meet(self, origins: Array, directions: Array) -> tuple[Floats, Integers, Array]:
        """Return distances (n,), surfaces (n,), and direction times normal (n,) of the hits."""
        distance, number = self._caster.cast(origins, directions)
        along: Array = (self._normals[number] * directions).sum(axis=1)
        along[number < 0] = 0.0
        return distance, number, along


def _solid(surfaces: Surfaces) -> _Solid:
    """Return the surfaces as triangles for the mesh library, or as rectangles without it."""
    if not len(surfaces.origin):
        return _Nothing()
    try:
        return _Triangles(MeshCaster(mesh_of_rectangles(surfaces.corners)), 2)
    except MissingDependencyError:
        return _Rectangles(surfaces)


class _Nothing:
    """A scene without surfaces."""

    def meet(self, origins: Array, _: Array) -> tuple[Floats, Integers, Array]:
        """Return rays that hit nothing: infinite distances, surfaces -1."""
        count = len(origins)
        return np.full(count, np.inf), np.full(count, -1), np.zeros(count)


class RayTracer:
    """Intersects rays with surfaces at rest and with moving bodies, each ray at its own time.

    >>> import numpy as np
    >>> from imu_sim_ros.places.geometry import surfaces
    >>> ground = np.array([-9.0, -9, 0]), np.array([18.0, 0, 0]), np.array([0.0, 18, 0])
    >>> tracer = RayTracer(surfaces([ground], hides=True))
    >>> down = np.array([[0.6, 0.0, -0.8]])
    >>> tracer.trace(np.zeros(1), np.array([[0.0, 0, 2]]), down).distance
    array([2.5])
    """

    def __init__(
        self,
        surfaces: Surfaces,
        mesh: MeshCaster | None = None,
        bodies: Sequence[MovingBody] = (),
        seen_through: Mask | None = None,
    ) -> None:
        """Initialise with the surfaces and bodies.

        :param mesh: mesh instead of ``surfaces``; None: the scene has rectangles.
        :param seen_through: (m,) True for rectangles without intersections, such as the sky.
        """
        solid = np.ones(len(surfaces.origin), np.bool_) if seen_through is None else ~seen_through
        self._kept = None if solid.all() else np.append(np.flatnonzero(solid), -1)
        self._rest = _Triangles(mesh) if mesh is not None else _solid(surfaces.some(solid))
        self._bodies = [(body, ball(body.surfaces()), _solid(body.surfaces())) for body in bodies]

    def trace(self, t: Array, origins: Array, directions: Array) -> Traced:
        """Return the nearest intersection of each ray ``origin + s direction``, s > 0.

        :param t: (n,) time of each ray [s]; those of one call are near each other.
        :param origins: (n, 3) [m].
        :param directions: (n, 3) unit vectors.
        """
        count = len(t)
        distance, along = np.empty(count), np.empty(count)
        surface, body = np.empty(count, np.int64), np.zeros(count, np.uint8)
        for start in range(0, count, _RAYS):
            part = slice(start, start + _RAYS)
            distance[part], surface[part], along[part] = self._rest.meet(
                origins[part], directions[part]
            )
        if self._kept is not None:
            surface = self._kept[surface]
        traced = Traced(distance, surface, body, along)
        for number, (moving, extent, solid) in enumerate(self._bodies, start=1):
            rows = _rays_near_body(moving, extent, t, origins, directions)
            if len(rows):
                _put(
                    traced, rows, number, *_trace_body(moving, solid, t, origins, directions, rows)
                )
        return traced


def _rays_near_body(
    body: MovingBody, extent: tuple[Array, float], t: Array, origins: Array, directions: Array
) -> Integers:
    """Return the rows of rays that pass a ball in which a body stays from their first to last time.

    :param extent: middle (3,) and radius of the body in its own axes [m].
    """
    middle, radius = extent
    looks = np.linspace(t.min(), t.max(), _LOOKS)
    centers = body.to_world(looks, np.broadcast_to(middle, (_LOOKS, 3)))
    center = 0.5 * (centers.min(axis=0) + centers.max(axis=0))
    moved = np.sqrt(((centers - center) ** 2).sum(axis=1)).max()
    reach = radius + 2.0 * float(moved) + _SLACK
    away = [center[k] - origins[:, k] for k in range(3)]
    ahead = sum(away[k] * directions[:, k] for k in range(3))
    square = sum(component * component for component in away)
    within_reach = square - np.maximum(ahead, 0.0) ** 2 < reach * reach
    return np.flatnonzero(within_reach)


def _trace_body(
    body: MovingBody, solid: _Solid, t: Array, origins: Array, directions: Array, rows: Integers
) -> tuple[Floats, Integers, Array]:
    """Return distances, surfaces and ``along`` of the rows of rays with a moving body."""
    position, q_wb = body.pose(t[rows])
    start = rotation.rotate_inverse(q_wb, origins[rows] - position)
    return solid.meet(start, rotation.rotate_inverse(q_wb, directions[rows]))


def _put(
    traced: Traced, rows: Integers, number: int, distance: Floats, surface: Integers, along: Array
) -> None:
    """Replace the intersections of rows of rays by those with body ``number`` that are nearer."""
    nearer = distance < traced.distance[rows]
    rows = rows[nearer]
    traced.distance[rows], traced.surface[rows] = distance[nearer], surface[nearer]
    traced.along[rows], traced.body[rows] = along[nearer], number
