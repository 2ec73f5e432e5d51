# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""A mesh in the world: its pose, the rays that meet it, points on it, and its defects."""

from collections.abc import Iterator
from typing import Final, NamedTuple

import numpy as np

from imu_sim_ros.core.errors import MissingDependencyError
from imu_sim_ros.core.types import Array, Mask
from imu_sim_ros.places.geometry import Floats, Hits
from imu_sim_ros.places.mesh_file import Mesh, normals

UPS: Final = ("file", "x", "y", "z", "-x", "-y", "-z")
"""Axes of a file that may point up; file: as its kind says."""
ANCHORS: Final = ("origin", "path")

_TURNS: Final = {
    "x": ((0, 1, 0), (0, 0, 1), (1, 0, 0)),
    "y": ((1, 0, 0), (0, 0, -1), (0, 1, 0)),
    "z": ((1, 0, 0), (0, 1, 0), (0, 0, 1)),
    "-x": ((0, 1, 0), (0, 0, -1), (-1, 0, 0)),
    "-y": ((1, 0, 0), (0, 0, 1), (0, -1, 0)),
    "-z": ((1, 0, 0), (0, -1, 0), (0, 0, -1)),
}
_ODD: Final = np.array([0x9E3779B97F4A7C15, 0xC2B2AE3D27D4EB4F, 0x165667B19E3779F9], np.uint64)
"""Large odd numbers, by which the bits of places are mixed."""
_RAYS: Final = 65_536
"""Rays that are processed at once."""
_SELF: Final = 1e-5
"""Relative distance within which a point lies on a surface and is not hidden by it."""
_AGREE: Final = 1e-3
"""Relative difference of the distances in double and in single precision, at most."""


def up_axis_rotation(up: str, suffix: str) -> Array:
    """Return the rotation (3, 3) that turns an axis of a file upwards, to z.

    :param up: one of :data:`UPS`.
    :param suffix: suffix of the file: y is up in glTF (glTF 2.0, 3.4), z in the other formats.

    >>> (up_axis_rotation("file", ".glb") @ [1.0, 2.0, 3.0]).tolist()
    [1.0, -3.0, 2.0]
    """
    if up == "file":
        up = "y" if suffix.lower() in (".glb", ".gltf") else "z"
    return np.array(_TURNS[up], np.float64)


def place_mesh(mesh: Mesh, matrix: Array, position: Array, middle: Array | None = None) -> Mesh:
    """Return a mesh in the world: ``matrix p + position``.

    :param matrix: (3, 3) rotation times scale.
    :param position: (3,) [m].
    :param middle: (3,) to which the middle of its box goes before ``position`` is added.
    """
    vertices: Array = mesh.vertices @ matrix.T
    if middle is not None:
        low, high = box(mesh._replace(vertices=vertices))
        vertices = vertices + (middle - 0.5 * (low + high))
    return mesh._replace(vertices=vertices + position)


def box(mesh: Mesh) -> tuple[Array, Array]:
    """Return the lowest and highest corner (3,) of the box around all faces."""
    used = np.zeros(len(mesh.vertices), np.bool_)
    used[mesh.faces] = True
    return mesh.vertices[used].min(axis=0), mesh.vertices[used].max(axis=0)


class Meeting(NamedTuple):
    """Nearest intersections of n rays with a mesh, and the angles of incidence."""

    hits: Hits
    along: Array
    """(n,) the face's unit normal times the ray's direction; above 0: seen from behind."""


class MeshCaster:
    """Meets rays with the triangles of a mesh, from either side; :class:`Caster` for rectangles.

    Embree finds the triangle, in single precision; the distance is that of the triangle's own
    plane, in double precision. May be used by several threads.
    """

    def __init__(self, mesh: Mesh) -> None:
        """Initialise with a mesh in the world.

        :raises MissingDependencyError: if embreex is not installed.
        """
        try:
            from embreex.mesh_construction import TriangleMesh
            from embreex.rtcore_scene import EmbreeScene
        except ImportError as error:
            raise MissingDependencyError(
                f"scene.type mesh needs embreex ({error}): pip install trimesh pillow embreex"
            ) from None
        low, high = box(mesh)
        self.middle: Array = 0.5 * (low + high)
        """(3,) origin of the coordinates, so that single precision suffices [m]."""
        local = mesh.vertices - self.middle
        self._scene = EmbreeScene(robust=True)
        self._built = TriangleMesh(
            self._scene,
            np.ascontiguousarray(local, np.float32),
            np.ascontiguousarray(mesh.faces, np.int32),
        )
        self.planes = _planes(mesh, self.middle)
        """(m, 4) unit normal, and its product with the plane's points from the middle."""
        self.meet(low[None], np.array([[0.0, 0.0, 1.0]], np.float32))  # builds its tree

    def meet(self, origins: Array, directions: Floats) -> Meeting:
        """Return the nearest intersection of each ray.

        Embree's distances have single precision; those from the triangles' planes have double.

        :param origins: (n, 3), or (1, 3) for all [m].
        :param directions: (n, 3) of any length.
        """
        start = np.asarray(origins, np.float64) - self.middle
        from_here = np.broadcast_to(start.astype(np.float32), directions.shape)
        ways = np.ascontiguousarray(directions, np.float32)
        hits = self._scene.run(np.ascontiguousarray(from_here), ways, output=True)
        number = hits["primID"].astype(np.int64)
        nothing = number < 0
        planes = self.planes.take(np.where(nothing, 0, number), axis=0)
        along = _dot(planes, directions)
        distance = planes[:, 3] - _dot(planes, start)
        single = hits["tfar"].astype(np.float64)
        with np.errstate(divide="ignore", invalid="ignore"):
            distance /= along
            # Along a ray that is nearly parallel to the triangle, its plane determines no distance.
            disagrees = ~(np.abs(distance - single) <= _AGREE * single)
        np.copyto(distance, single, where=disagrees)
        distance[nothing] = np.inf
        return Meeting(Hits(distance, number), along)

    def cast(self, origins: Floats, directions: Floats, nearest: float = 1e-4) -> Hits:
        """Return the first intersection of each ray ``origin + t direction``.

        :param origins: (n, 3) [m].
        :param directions: (n, 3) of any length.
        :param nearest: smallest t of an intersection.
        """
        distance, number = np.full(len(origins), np.inf), np.full(len(origins), -1, np.int64)
        for begin in range(0, len(origins), _RAYS):
            part = slice(begin, begin + _RAYS)
            start = np.asarray(origins[part], np.float64) + nearest * directions[part]
            hits = self.meet(start, directions[part]).hits
            distance[part], number[part] = hits.distance + nearest, hits.surface
        return Hits(distance, number)

    def is_blocked(self, origins: Floats, directions: Floats, ends: Floats | float = 1.0) -> Mask:
        """Return True for rays (n,) that hit a triangle between their origin and t = ``ends``.

        :param origins: (n, 3) [m].
        :param directions: (n, 3) of any length.
        :param ends: (n,) largest t of an intersection, or one number.
        """
        result: Mask = self.cast(origins, directions).distance < ends
        return result

    def is_hidden(self, eye: Array, points: Array) -> Mask:
        """Return True for points (n, 3) on the mesh that another part hides from eye (n, 3).

        A point is met itself, at its own distance, to the accuracy of double precision.
        """
        sight = points - eye
        return self.is_blocked(eye, sight, 1.0 - _SELF)


def _planes(mesh: Mesh, middle: Array) -> Array:
    """Return unit normal and offset (m, 4) of triangles, counted from the middle."""
    result = np.empty((len(mesh.faces), 4))
    for part, corner, normal in normals(mesh):
        normal /= np.sqrt((normal * normal).sum(axis=1, keepdims=True))
        result[part, :3] = normal
        result[part, 3] = (normal * (corner - middle)).sum(axis=1)
    return result


def _dot(planes: Array, vectors: Floats) -> Array:
    """Return the scalar products (n,) of the normals of planes (n, 4) and vectors (n, 3)."""
    result: Array = planes[:, 0] * vectors[:, 0]
    result += planes[:, 1] * vectors[:, 1]
    result += planes[:, 2] * vectors[:, 2]
    return result


def scatter_points(mesh: Mesh, sums: Array, count: int, stream: np.random.Generator) -> Array:
    """Return points (count, 3) spread evenly over all triangles.

    :param sums: (m,) sums of the areas up to each triangle.
    """
    number = np.searchsorted(sums, stream.random(count) * sums[-1]).clip(max=len(sums) - 1)
    corners = mesh.vertices[mesh.faces[number]]
    sides = corners[:, 1:] - corners[:, :1]
    s, t = stream.random((2, count, 1))
    beyond = s + t > 1.0
    s, t = np.where(beyond, 1.0 - s, s), np.where(beyond, 1.0 - t, t)
    points: Array = corners[:, 0] + s * sides[:, 0] + t * sides[:, 1]
    return points


def fibonacci_directions(count: int) -> Array:
    """Return unit vectors (count, 3) that are spread evenly over a sphere: Fibonacci's spiral."""
    k = np.arange(count) + 0.5
    z = 1.0 - 2.0 * k / count
    angle = k * np.pi * (3.0 - 5.0**0.5)
    radius = np.sqrt(1.0 - z * z)
    return np.stack([radius * np.cos(angle), radius * np.sin(angle), z], axis=1)


def open_edges(mesh: Mesh) -> int:
    """Return the number of edges of one face only; vertices at the same place count as one."""
    places = mesh.vertices.astype(np.float32) + np.float32(0.0)  # of -0 the same bits as of 0
    bits = places.view(np.uint32).astype(np.uint64)
    # Of places that differ two in 2^64 are alike.
    key = (bits[:, 0] * _ODD[0]) ^ (bits[:, 1] * _ODD[1]) ^ (bits[:, 2] * _ODD[2])
    _, place_ids = np.unique(key, return_inverse=True)
    corner = place_ids.reshape(-1)[mesh.faces]
    edges = np.empty((3, len(corner)), np.int64)
    for k in range(3):
        start, end = corner[:, k], corner[:, (k + 1) % 3]
        edges[k] = np.minimum(start, end) * len(places) + np.maximum(start, end)
    edge_ids = edges.reshape(-1)
    edge_ids.sort()
    alone = np.ones(len(edge_ids) + 1, np.bool_)
    alone[1:-1] = edge_ids[1:] != edge_ids[:-1]
    return int((alone[1:] & alone[:-1]).sum())


def size_remarks(mesh: Mesh) -> Iterator[str]:
    """Yield lines about an unlikely size of a mesh."""
    low, high = box(mesh)
    across = float(np.linalg.norm(high - low))
    if across > 2000.0 or across < 0.1:
        yield (
            f"the mesh is {across:.3g} m across; scene.scale is the length of its unit in metres "
            "(0.001 for millimetres)"
        )
    edges = open_edges(mesh)
    if edges:
        yield (
            f"the mesh is not watertight: {edges:,} edges belong to one face only, and what is "
            "seen through a hole is grey, without depth"
        )
