# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Triangles with their colours, read from a file by trimesh, and checks of the file."""

import gc
import io
import json
import logging
import re
import struct
import warnings
from base64 import b64decode
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from types import ModuleType
from typing import TYPE_CHECKING, Final, NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from imu_sim_ros.core.errors import InputError, MissingDependencyError, system_error
from imu_sim_ros.core.types import Array, Bytes, Single
from imu_sim_ros.inputs.rows import open_regular
from imu_sim_ros.places.mesh_textures import Textures, examine
from imu_sim_ros.places.neighbours import Neighbours

if TYPE_CHECKING:
    from PIL.Image import Image
    from trimesh import Trimesh

Numbers = NDArray[np.int32]

SUFFIXES: Final = (".glb", ".gltf", ".obj", ".ply", ".stl")
MOST_TRIANGLES: Final = 800_000
"""Each needs some 300 bytes of memory; the limits keep a process below 500 MB."""
MOST_VERTICES: Final = 1_200_000
"""Largest number of vertices."""
LARGEST: Final = 100 << 20
"""Largest mesh file, and largest sum of the files that it names [bytes]."""
_LARGEST_TEXT: Final = {".ply": 20 << 20, ".stl": 40 << 20, ".obj": 50 << 20}
"""Largest files in text form [bytes]: the loader needs many times their size."""
_UNREADABLE: Final = ("KHR_draco_mesh_compression", "EXT_meshopt_compression", "KHR_texture_basisu")
"""Extensions of glTF that trimesh does not read by itself."""
_PART: Final = 100_000
"""Triangles that are looked at at once."""
_FARTHEST: Final = 1e15
"""Largest magnitude of a coordinate, so that its square is finite."""
_LEAST_AREA: Final = 1e-15
"""Smallest area of a visible triangle, in squares of the mesh's size."""


class Mesh(NamedTuple):
    """m triangles between n vertices."""

    vertices: Array
    """(n, 3) positions of the vertices."""
    faces: Numbers
    """(m, 3) rows in the vertices; counterclockwise as seen from the front."""
    places: Single
    """(m, 3, 2) u and v of each corner in its texture, v up; they repeat outside of 0 to 1."""
    texture: Numbers
    """(m,) number of each triangle's texture; -1: none."""
    textures: tuple[Bytes, ...]
    """Each (h, w, 3) red, green and blue, its first row at the top."""
    colours: Bytes
    """(m, 3, 3) red, green and blue of each corner, by which the texture is multiplied."""
    painted: bool
    """True if it has textures, or colours other than those of whole parts."""

    @property
    def corners(self) -> Array:
        """(m, 3, 3) places of the corners of all triangles."""
        positions: Array = self.vertices[self.faces]
        return positions


def normals(mesh: Mesh) -> Iterator[tuple[slice, Array, Array]]:
    """Yield slices of k triangles, their corners a (k, 3), and (b - a) x (c - a) (k, 3)."""
    for start in range(0, len(mesh.faces), _PART):
        part = slice(start, start + _PART)
        a, b, c = (mesh.vertices[mesh.faces[part, k]] for k in range(3))
        yield part, a, np.cross(b - a, c - a)


def mesh_of_rectangles(corners: Array) -> Mesh:
    """Return m rectangles as 2 m triangles in pairs.

    :param corners: (m, 4, 3) corners, once around each rectangle [m].
    """
    count = len(corners)
    corner = 4 * np.arange(count, dtype=np.int32)[:, None]
    faces = (corner[:, None] + np.array([[0, 1, 2], [0, 2, 3]], np.int32)).reshape(-1, 3)
    places = np.zeros((2 * count, 3, 2), np.float32)
    colours = np.full((2 * count, 3, 3), 255, np.uint8)
    untextured = np.full(2 * count, -1, np.int32)
    return Mesh(
        vertices=corners.reshape(-1, 3),
        faces=faces,
        places=places,
        texture=untextured,
        textures=(),
        colours=colours,
        painted=False,
    )


def areas(mesh: Mesh) -> Array:
    """Return the areas of all triangles (m,)."""
    result = np.empty(len(mesh.faces))
    for part, _, normal in normals(mesh):
        result[part] = 0.5 * np.sqrt((normal * normal).sum(axis=1))
    return result


def read_mesh(path: str | Path) -> Mesh:
    """Return the triangles of a GLB, glTF, OBJ, PLY or STL file, in its own axes and unit.

    Parts that the file places several times are there as often.

    :raises InputError: for a file that cannot be used, with the reason.
    :raises MissingDependencyError: if trimesh is not installed.
    """
    path = Path(path)
    if path.suffix.lower() not in SUFFIXES:
        raise InputError(f"{path}: must be one of {', '.join(s[1:] for s in SUFFIXES)}")
    content = _content(path)
    if path.suffix.lower() in (".glb", ".gltf"):
        _check_gltf(path, content)
    loaded = [(place, part) for place, part in _load(path, content) if len(part.faces)]
    del content
    if not loaded:
        points = path.suffix.lower() in (".obj", ".ply")
        hint = "; of points alone scene.type file makes landmarks" if points else ", or is cut off"
        raise InputError(f"{path}: has no faces{hint}")
    _check_count(path, sum(len(part.faces) for _, part in loaded))
    _check_count(path, sum(len(part.vertices) for _, part in loaded), "vertices", MOST_VERTICES)
    images = [image for _, part in loaded if (image := _image(part)) is not None]
    textures = Textures(path, images, sum(len(part.faces) for _, part in loaded))
    parts = []
    while loaded:  # the loader's own copies go one by one
        place, part = loaded.pop(0)
        parts.append(_Part.of(path, place, part, textures))
        del part
    gc.collect()  # its parts refer to each other
    return _drop_slivers(path, _join(parts, textures.decode_all()))


def _check_count(path: Path, count: int, what: str = "triangles", limit: int | None = None) -> None:
    """Refuse a mesh with too many triangles, or with too many other parts."""
    limit = MOST_TRIANGLES if limit is None else limit
    if count > limit:
        raise InputError(
            f"{path}: has {count:,} {what}; at most {limit:,}: simplify (decimate) it, as MeshLab "
            "and Blender do"
        )


def is_mesh(path: str | Path) -> bool:
    """Return whether a file has faces, by its name or, of a PLY, by its header."""
    path = Path(path)
    if path.suffix.lower() != ".ply":
        return path.suffix.lower() in SUFFIXES
    try:
        with open_regular(path) as file:
            header, _, _ = file.read(65536).partition(b"end_header")
    except (InputError, OSError):
        return False
    tokens = [line.split() for line in header.splitlines()]
    return any(line[:2] == [b"element", b"face"] and line[2:] != [b"0"] for line in tokens)


def _content(path: Path) -> bytes:
    """Return the bytes of a mesh file of limited size."""
    try:
        with open_regular(path) as file:
            content = file.read(LARGEST + 1)
    except OSError as error:
        raise system_error(path, error) from None
    if not content:
        raise InputError(f"{path}: is empty")
    suffix, limit, hint = path.suffix.lower(), LARGEST, ""
    if _is_text(suffix, content):
        limit, hint = _LARGEST_TEXT[suffix], ", as text: write it as a binary file (GLB, PLY), or"
    if len(content) > limit:
        raise InputError(
            f"{path}: is larger than {limit >> 20} MB{hint or ':'} simplify (decimate) the mesh"
        )
    _check_count(path, _stated_triangles(suffix, content))
    return content


def _is_text(suffix: str, content: bytes) -> bool:
    """Return True for a mesh file in the text form of its format."""
    if suffix == ".ply":
        return b"format ascii" in content[:200]
    if suffix == ".stl":
        return content[:5] == b"solid" and b"facet" in content[:1000]
    return suffix == ".obj"


def _stated_triangles(suffix: str, content: bytes) -> int:
    """Return the number of triangles that a file states, 0 if it states none."""
    if suffix == ".ply":
        match = re.search(rb"element face (\d{1,18})\s", content[:65536])
        return int(match[1]) if match else 0
    if suffix == ".stl" and len(content) >= 84 and not _is_text(suffix, content):
        return int.from_bytes(content[80:84], "little")
    return content.count(b"\nf ") if suffix == ".obj" else 0


def _check_gltf(path: Path, content: bytes) -> None:
    """Refuse compressed parts and damaged textures, which trimesh would leave out."""
    try:
        text, end = content, 0
        if content[:4] == b"glTF":
            (stated,) = struct.unpack("<I", content[8:12])
            if stated > len(content):
                raise ValueError(f"{len(content)} of {stated} bytes")
            end = 20 + struct.unpack("<I", content[12:16])[0]
            text = content[20:end]
        tree = json.loads(text)
        needed = tree.get("extensionsRequired", [])
        views, images = tree.get("bufferViews", []), tree.get("images", [])
        numbers = [
            0 if "bufferView" in accessor else accessor["count"]
            for accessor in tree.get("accessors", [])
        ]
        embedded = [views[image["bufferView"]] for image in images if "bufferView" in image]
        starts = [end + 8 + view.get("byteOffset", 0) for view in embedded]
        pictures = [
            content[start : start + view["byteLength"]]
            for start, view in zip(starts, embedded, strict=True)
        ]
        pictures = pictures if end else []
        uris = [image["uri"] for image in images if "uri" in image]
        pictures += [b64decode(uri.partition(",")[2]) for uri in uris if uri.startswith("data:")]
    except ValueError as error:
        reason = " ".join(str(error).split())[:100]
        raise InputError(
            f"{path}: cannot be read as {path.suffix[1:].upper()}: damaged or cut off ({reason})"
        ) from None
    except (AttributeError, KeyError, IndexError, TypeError, struct.error):
        return  # trimesh reports it
    for name in needed:
        if name in _UNREADABLE:
            raise InputError(f"{path}: is compressed by {name}: export it without compression")
    _check_count(path, sum(numbers) // 3)
    for picture in pictures:
        examine(picture, f"{path}: a texture")


def _trimesh() -> ModuleType:
    """Return trimesh's module.

    :raises MissingDependencyError: if it is not installed.
    """
    try:
        import PIL.Image  # noqa: F401 - trimesh reads textures with it, and leaves them out without
        import trimesh
        import trimesh.resolvers
    except ImportError as error:
        raise MissingDependencyError(
            f"scene.type mesh needs trimesh, Pillow and embreex ({error}): "
            "pip install trimesh pillow embreex"
        ) from None
    return trimesh


@contextmanager
def _quiet() -> Iterator[None]:
    """Suppress log lines and warnings of libraries."""
    log = logging.getLogger("trimesh")
    level = log.level
    log.setLevel(logging.CRITICAL + 1)
    try:
        with warnings.catch_warnings(), np.errstate(all="ignore"):
            warnings.simplefilter("ignore")
            yield
    finally:
        log.setLevel(level)


def _load(path: Path, content: bytes) -> "list[tuple[Array, Trimesh]]":
    """Return each part's place (4, 4) in the file, and trimesh's mesh.

    :raises InputError: for what trimesh cannot read, or files next to it that are missing.
    """
    trimesh = _trimesh()
    kind = path.suffix.lower()[1:]
    neighbours = Neighbours(path, LARGEST - len(content))
    resolver = trimesh.resolvers.FilePathResolver(str(path))
    resolver.get = neighbours.read
    with _quiet():
        try:
            scene = trimesh.load(
                io.BytesIO(content),
                file_type=kind,
                resolver=resolver,
                force="scene",
                process=False,
            )
            parts = []
            for node in scene.graph.nodes_geometry:
                place, name = scene.graph[node]
                if isinstance(scene.geometry[name], trimesh.Trimesh):
                    parts.append((np.array(place, np.float64), scene.geometry[name]))
        except MemoryError:
            raise
        except Exception as error:  # damaged files raise errors of many classes in its readers
            if not neighbours.lost:
                message = " ".join(str(error).split())[:100]
                reason = f" ({message})" if message and not isinstance(error, ImportError) else ""
                raise InputError(
                    f"{path}: cannot be read as {kind.upper()}: damaged or cut off{reason}"
                ) from None
    if neighbours.lost:
        raise InputError(neighbours.lost)
    return parts


class _Part(NamedTuple):
    """One of trimesh's meshes; the names are those of :class:`Mesh`."""

    vertices: Array
    faces: Numbers
    places: Single
    texture: int
    """-1: none."""
    colours: Bytes
    painted: bool

    @classmethod
    def of(cls, path: Path, place: Array, part: "Trimesh", textures: Textures) -> "_Part":
        """Return a part of a mesh with its vertices in the world.

        :param place: (4, 4) pose of the part.
        :param part: a part as trimesh loads it.
        :raises InputError: for numbers that are none.
        """
        vertices = np.array(part.vertices, np.float64)
        numbers = np.asarray(part.faces).reshape(-1, 3)
        if len(numbers) and (numbers.min() < 0 or numbers.max() >= len(vertices)):
            raise InputError(f"{path}: a face refers to a vertex that is not there")
        faces = numbers.astype(np.int32)
        used = np.zeros(len(vertices), np.bool_)
        used[faces] = True
        bad = np.flatnonzero(~(np.abs(vertices) < _FARTHEST).all(axis=1) & used)
        if len(bad):
            shown = ", ".join(f"{x:g}" for x in vertices[bad[0]])
            rest = f", as are {len(bad) - 1} more" if len(bad) > 1 else ""
            raise InputError(
                f"{path}: vertex {bad[0] + 1} is at ({shown}), not a finite place{rest}"
            )
        vertices[~used] = 0.0
        if not np.array_equal(place, np.eye(4)):
            vertices = vertices @ place[:3, :3].T
            vertices += place[:3, 3]
        image = _image(part)
        places, colours, painted = _look(path, part, faces, image)
        if np.linalg.det(place[:3, :3]) < 0.0:  # a mirror
            faces, places, colours = faces[:, ::-1], places[:, ::-1], colours[:, ::-1]
        number = -1 if image is None else textures.number(image)
        return cls(
            vertices=vertices,
            faces=faces,
            places=places,
            texture=number,
            colours=colours,
            painted=painted,
        )


def _look(
    path: Path, part: "Trimesh", faces: Numbers, image: "Image | None"
) -> tuple[Single, Bytes, bool]:
    """Return texture coordinates (m, 3, 2) and colours (m, 3, 3) of the corners of m faces.

    The third result is True if the part has a texture, or colours that differ within it.
    """
    visual = part.visual
    count = len(faces)
    # What is the same everywhere takes no memory.
    places: Single = np.broadcast_to(np.zeros(2, np.float32), (count, 3, 2))
    colours: Bytes = np.broadcast_to(np.full(3, 200, np.uint8), (count, 3, 3))
    with _quiet():
        if visual.kind == "texture":
            colour = _factor(getattr(visual, "material", None), image)
            colours = np.broadcast_to(colour, (count, 3, 3))
            uv = getattr(visual, "uv", None)
            if image is not None and (uv is None or len(uv) != len(part.vertices)):
                raise InputError(f"{path}: has a texture, but not where it lies on the faces")
            if image is not None:
                places = np.asarray(uv, np.float32)[faces][..., :2]
                if not np.isfinite(places).all():
                    raise InputError(f"{path}: a texture's coordinate is not finite")
            vertex_colours = getattr(visual, "vertex_attributes", {}).get("color")
            if vertex_colours is not None and len(vertex_colours) == len(part.vertices):
                vertex_colours = _bytes(vertex_colours)[faces][..., :3].astype(np.uint16)
                colours = ((vertex_colours * colours + 127) // 255).astype(np.uint8)
                return places, colours, True
            return places, colours, image is not None
        if visual.kind == "vertex":
            return places, _bytes(visual.vertex_colors)[faces][..., :3], True
        if visual.kind == "face":
            vertex_colours = _bytes(visual.face_colors)[:, None, :3]
            return places, np.broadcast_to(vertex_colours, (count, 3, 3)), True
    return places, colours, False


def _bytes(colours: ArrayLike) -> Bytes:
    """Return colours of any type as bytes."""
    values = np.asarray(colours)
    if values.dtype.kind == "f":
        values = np.clip(np.rint(values * 255.0), 0, 255)
    elif values.dtype == np.uint16:
        values = values >> 8
    return values.astype(np.uint8)


def _image(part: "Trimesh") -> "Image | None":
    """Return the texture of one of trimesh's meshes, as Pillow's image, or None."""
    if part.visual.kind != "texture":
        return None
    material = getattr(part.visual, "material", None)
    image = getattr(material, "baseColorTexture", None)
    return getattr(material, "image", None) if image is None else image


def _factor(material: object, image: "Image | None") -> Bytes:
    """Return the colour (3,) by which a material's texture is multiplied, in sRGB."""
    factor = getattr(material, "baseColorFactor", None)
    if factor is not None:
        linear = np.asarray(_bytes(factor)[:3], np.float64) / 255.0  # glTF 2.0, 3.9.2
        encoded = np.where(linear <= 0.0031308, 12.92 * linear, 1.055 * linear ** (1 / 2.4) - 0.055)
        return np.rint(255.0 * encoded).astype(np.uint8)
    diffuse = getattr(material, "diffuse", None)
    if image is None and diffuse is not None:
        return _bytes(diffuse)[:3]
    return np.full(3, 255, np.uint8)


def _join(parts: Sequence[_Part], textures: tuple[Bytes, ...]) -> Mesh:
    """Return one mesh of all parts, with the textures (h, w, 3) to which their numbers refer."""
    numbers = [np.full(len(part.faces), part.texture, np.int32) for part in parts]
    if len(parts) == 1:
        vertices, faces, places, _, colours, painted = parts[0]
        return Mesh(
            vertices=vertices,
            faces=faces,
            places=places,
            texture=numbers[0],
            textures=textures,
            colours=colours,
            painted=painted,
        )
    starts = np.cumsum([0, *(len(part.vertices) for part in parts[:-1])]).astype(np.int32)
    count = sum(len(part.faces) for part in parts)
    nowhere: Single = np.broadcast_to(np.zeros(2, np.float32), (count, 3, 2))
    return Mesh(
        vertices=np.concatenate([part.vertices for part in parts]),
        faces=np.concatenate(
            [part.faces + start for part, start in zip(parts, starts, strict=True)]
        ),
        places=np.concatenate([part.places for part in parts]) if textures else nowhere,
        texture=np.concatenate(numbers),
        textures=textures,
        colours=np.concatenate([part.colours for part in parts]),
        painted=any(part.painted for part in parts),
    )


def _drop_slivers(path: Path, mesh: Mesh) -> Mesh:
    """Return a mesh without triangles of no area, which no ray hits."""
    square = float((np.ptp(mesh.vertices, axis=0) ** 2).sum())
    keep = areas(mesh) > _LEAST_AREA * square
    if not keep.any():
        raise InputError(f"{path}: no face has an area")
    if keep.all():
        return mesh
    return mesh._replace(
        faces=mesh.faces[keep],
        places=mesh.places[keep],
        texture=mesh.texture[keep],
        colours=mesh.colours[keep],
    )
