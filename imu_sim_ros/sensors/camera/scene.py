# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Scenes that cameras see: landmarks on surfaces; landmarks from a file (CSV, PLY)."""

from pathlib import Path
from typing import Final, NamedTuple

import numpy as np

from imu_sim_ros.core.errors import InputError, system_error
from imu_sim_ros.core.types import Array, Mask
from imu_sim_ros.inputs.rows import open_regular
from imu_sim_ros.places.bodies import Crowd
from imu_sim_ros.places.geometry import NO_SURFACES, Surfaces, is_hidden
from imu_sim_ros.places.mesh import MeshCaster, box
from imu_sim_ros.places.mesh_file import Mesh
from imu_sim_ros.places.paint import Painter
from imu_sim_ros.places.rays import RayTracer

_NO_LINES: Final[Array] = np.zeros((0, 2, 3))


class Scene(NamedTuple):
    """A scene at rest in the world, and its moving bodies."""

    landmarks: Array
    """(n, 3) p_w [m]; a landmark's id is its row."""
    normals: Array
    """(n, 3) normal of the surface at each, to the side that sees it; zero: seen from all sides."""
    surfaces: Surfaces
    extent: float
    """Largest distance of anything from anything else, about [m]."""
    lines: Array = _NO_LINES
    """(l, 2, 3) ends of each line [m]."""
    painter: Painter | None = None
    """Painter of a place's surfaces; None: the texture follows from their kind."""
    mesh: Mesh | None = None
    """Triangles instead of rectangles, in the world."""
    caster: MeshCaster | None = None
    """Ray caster of the mesh."""
    crowd: Crowd | None = None
    """Moving bodies; None: nothing moves."""
    note: str = ""
    """Description of how the scene was fitted to the path; empty: its size is as configured."""

    def is_hidden(self, eye: Array, points: Array) -> Mask:
        """Return True for landmarks (n, 3) that surfaces hide from their eyes (n, 3)."""
        if self.caster is not None:
            return self.caster.is_hidden(eye, points)
        return is_hidden(self.surfaces, eye, points)

    def tracer(self, moving: bool = True) -> RayTracer:
        """Return the ray tracer of the surfaces, without the sky.

        :param moving: with the bodies that move.
        """
        sky = self.painter.place.sky if self.painter is not None else None
        bodies = self.crowd.bodies if moving and self.crowd is not None else ()
        return RayTracer(self.surfaces, self.caster, bodies, sky)

    def box(self) -> tuple[Array, Array]:
        """Return the lowest and highest corner (3,) of the box around all surfaces [m]."""
        if self.mesh is not None:
            return box(self.mesh)
        corners = self.surfaces.corners
        return corners.min(axis=(0, 1)), corners.max(axis=(0, 1))

    @classmethod
    def of_points(cls, points: Array) -> "Scene":
        """Return a scene of landmarks (n, 3) alone, seen from everywhere."""
        extent = float(np.linalg.norm(np.ptp(points, axis=0))) if len(points) else 0.0
        return cls(
            landmarks=points,
            normals=np.zeros_like(points),
            surfaces=NO_SURFACES,
            extent=extent,
        )


_MAX_LANDMARKS: Final = 10_000_000
"""Largest number of landmarks of a file."""
_PLY_TYPES: Final = {
    "char": "i1",
    "int8": "i1",
    "uchar": "u1",
    "uint8": "u1",
    "short": "i2",
    "int16": "i2",
    "ushort": "u2",
    "uint16": "u2",
    "int": "i4",
    "int32": "i4",
    "uint": "u4",
    "uint32": "u4",
    "float": "f4",
    "float32": "f4",
    "double": "f8",
    "float64": "f8",
}


def read_points(path: str | Path) -> Array:
    """Return the points (n, 3) of a file [m].

    :raises InputError: naming the line that cannot be read.
    """
    path = Path(path)
    try:
        with open_regular(path) as file:
            content = file.read()
    except OSError as error:
        raise system_error(path, error) from None
    points = _ply(path, content) if content[:3] == b"ply" else _csv(path, content)
    if not len(points):
        raise InputError(f"{path}: contains no points")
    bad = np.flatnonzero(~np.isfinite(points).all(axis=1))
    if len(bad):
        raise InputError(f"{path}: point {bad[0] + 1}: a value that is not finite")
    return points


def _csv(path: Path, content: bytes) -> Array:
    """Return the points (n, 3) of a CSV file."""
    try:
        lines = content.decode("utf-8").splitlines()
    except UnicodeDecodeError:
        raise InputError(f"{path}: neither CSV nor PLY") from None
    rows: list[list[float]] = []
    for number, line in enumerate(lines, start=1):
        text = line.split("#")[0].strip()
        fields = text.replace(",", " ").split()
        if not fields or (not rows and not any(map(_is_number, fields))):
            continue  # a comment, or the header
        if len(fields) not in (3, 4) or (rows and len(fields) != len(rows[0])):
            raise InputError(f"{path}: line {number}: {len(fields)} columns; must be x, y, z")
        try:
            rows.append([float(field) for field in fields])
        except ValueError:
            raise InputError(f"{path}: line {number}: {text!r} is not numeric") from None
    table = np.array(rows, dtype=np.float64)
    return table[:, -3:] if len(rows) else np.zeros((0, 3))


def _is_number(word: str) -> bool:
    try:
        float(word)
    except ValueError:
        return False
    return True


def _ply(path: Path, content: bytes) -> Array:
    """Read the vertices: the first element of the file."""
    end = content.find(b"end_header")
    if end < 0:
        raise InputError(f"{path}: the PLY header is not terminated")
    header = content[:end].decode("ascii", "replace").splitlines()
    body = content[content.index(b"\n", end) + 1 :] if b"\n" in content[end:] else b""
    form, count, names, types = _ply_header(path, header)
    if form == "ascii":
        text = body.decode("ascii", "replace").split("\n")[:count]
        try:
            table = np.array([[float(x) for x in row.split()[: len(names)]] for row in text])
            points = table.reshape(count, len(names))[:, [names.index(axis) for axis in "xyz"]]
        except ValueError:
            raise InputError(
                f"{path}: must hold {count} vertices of {len(names)} numbers"
            ) from None
        return np.asarray(points, dtype=np.float64)
    order = "<" if form == "binary_little_endian" else ">"
    dtype = np.dtype([(name, order + kind) for name, kind in zip(names, types, strict=True)])
    if len(body) < count * dtype.itemsize:
        raise InputError(f"{path}: ends before the {count} vertices announced in its header")
    vertices = np.frombuffer(body, dtype, count)
    return np.stack([vertices[axis].astype(np.float64) for axis in "xyz"], axis=1)


def _ply_header(path: Path, lines: list[str]) -> tuple[str, int, list[str], list[str]]:
    """Return format, number of vertices, and names and types of a vertex's properties."""
    form, count, names, types, element = "", -1, [], [], ""
    for line in lines:
        match line.split():
            case ["format", encoding, _]:
                form = encoding
            case ["element", name, number] if number.isdigit():
                if count < 0 and name != "vertex":
                    raise InputError(f"{path}: the first element must be vertex, not {name}")
                element = name
                count = int(number) if name == "vertex" else count
            case ["property", kind, name] if element == "vertex":
                names.append(name)
                types.append(_PLY_TYPES.get(kind, ""))
            case ["property", "list", *_] if element == "vertex":
                raise InputError(f"{path}: a vertex with a list property is not supported")
    supported = form in ("ascii", "binary_little_endian", "binary_big_endian")
    if (
        not supported
        or not {"x", "y", "z"} <= set(names)
        or "" in types
        or not 0 <= count <= _MAX_LANDMARKS
    ):
        raise InputError(f"{path}: the PLY header does not describe vertices with x, y and z")
    return form, count, names, types
