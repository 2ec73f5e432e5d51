# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Appearance of a mesh's triangles: functions of the point on each, and textures."""

from collections.abc import Iterator
from typing import Final

import numpy as np

from imu_sim_ros.core.types import Array, Bytes, Single
from imu_sim_ros.places.mesh_file import Mesh, normals
from imu_sim_ros.places.paint import grey
from imu_sim_ros.sensors.camera.images.texture import Atlas, assemble_atlas
from imu_sim_ros.sensors.camera.images.visible import Triangles

_WHITE: Final = np.full((4, 4, 3), 255, np.uint8)
_PART: Final = 100_000
"""Triangles that are looked at at once."""
_TO_SUN: Final = (0.36, 0.48, 0.8)
"""Unit vector to the light that shades surfaces without a texture."""
_SKY: Final = 0.45
"""Light of a face that looks up in the shade, as a share of one that faces the sun."""
_GROUND: Final = 0.25
"""Light of a face that looks down, as a share of one that faces the sun."""


class Look:
    """Textures of a mesh, with the texture coordinates and colours of each triangle.

    A value on triangle j at p is ``(coefficients[:3, j] * p).sum() + coefficients[3, j]``, p from
    ``middle`` on.
    """

    def __init__(self, mesh: Mesh, middle: Array, colour: bool, sun: bool) -> None:
        """Initialise with a mesh in the world.

        :param middle: (3,) origin of the points p [m].
        :param colour: True: red, green and blue; False: grey.
        :param sun: True: shade the colours by the angle to a sun.
        """
        self.atlas = _atlas(mesh, colour)
        self.textured = bool(mesh.textures)
        colours = mesh.colours if colour else grey(mesh.colours)[..., None]
        tinted = not self.textured or bool((colours != 255).any())
        count, none = len(mesh.faces), np.zeros((0, 0), np.float32)
        self.triangles = Triangles(
            texture=mesh.texture + np.int32(1),
            uv=np.zeros((8, count), np.float32) if self.textured else none,
            density=np.zeros(count if self.textured else 0, np.float32),
            tints=np.zeros((4 * colours.shape[2], count), np.float32) if tinted else none,
            shades=_shades(mesh) if sun else none,
        )
        for part, gradient in _gradients(mesh, middle):
            if self.textured:
                self.triangles.uv[:, part] = gradient(mesh.places[part])
                size = self.atlas.size[self.triangles.texture[part]].T.astype(np.float64)
                uv = self.triangles.uv[:, part]
                self.triangles.density[part] = _density(uv, size)
            if tinted:
                self.triangles.tints[:, part] = gradient(colours[part])

    @property
    def image(self) -> Bytes:
        """All textures in one image, (h, w) in grey or (h, w, 3) in colour."""
        return self.atlas.image


def _atlas(mesh: Mesh, colour: bool) -> Atlas:
    """Return a white texture and those of the mesh, each with its first row at the bottom."""
    textures = [_WHITE, *mesh.textures]

    def texture(m: int) -> Bytes:
        rows = textures[m][::-1]
        return np.ascontiguousarray(rows if colour else grey(rows))

    return assemble_atlas([image.shape[:2] for image in textures], texture, colour, repeat=True)


class _Gradient:
    """Linear functions of the point on each of m triangles, from values at their corners."""

    def __init__(self, corners: Array) -> None:
        """Initialise with the corners (m, 3, 3) of triangles [m]."""
        first, second = corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]
        normal = np.cross(first, second)
        normal /= (normal * normal).sum(axis=1, keepdims=True)
        self._start = corners[:, 0]
        # Vectors in the triangle's plane that are 1 along one side and 0 along the other.
        self._along = np.cross(second, normal), np.cross(normal, first)

    def __call__(self, values: Bytes | Single) -> Array:
        """Return coefficients (4 k, m) of values (m, 3, k)."""
        parts = []
        for k in range(values.shape[2]):
            value = values[..., k].astype(np.float64)
            slope = sum((value[:, j + 1] - value[:, 0])[:, None] * self._along[j] for j in range(2))
            rest = value[:, 0] - (slope * self._start).sum(axis=1)
            parts += [*np.asarray(slope).T, rest]
        return np.array(parts)


def _gradients(mesh: Mesh, middle: Array) -> Iterator[tuple[slice, _Gradient]]:
    """Yield parts of the faces with the gradients on them."""
    for start in range(0, len(mesh.faces), _PART):
        part = slice(start, start + _PART)
        yield part, _Gradient(mesh.vertices[mesh.faces[part]] - middle)


def _density(uv: Single, size: Array) -> Array:
    """Return the square of the largest number of texels along a metre (m,) on each triangle.

    :param uv: (8, m) coefficients of u and v.
    :param size: (2, m) columns and rows of the textures.
    """
    u, v = uv[:3] * size[0], uv[4:7] * size[1]
    uu, vv, both = (u * u).sum(axis=0), (v * v).sum(axis=0), (u * v).sum(axis=0)
    largest: Array = 0.5 * (uu + vv) + np.sqrt(0.25 * (uu - vv) ** 2 + both * both)
    return largest


def _shades(mesh: Mesh) -> Single:
    """Return the light (2, m) on both sides of matt faces under a sun and an even sky."""
    result = np.empty((2, len(mesh.faces)), np.float32)
    for part, _, normal in normals(mesh):
        normal /= np.sqrt((normal * normal).sum(axis=1, keepdims=True))
        for side, sign in enumerate((1.0, -1.0)):
            height = 0.5 + 0.5 * sign * normal[:, 2]
            sun = np.maximum(0.0, sign * (normal * _TO_SUN).sum(axis=1))
            light = _GROUND + (_SKY - _GROUND) * height + (1.0 - _SKY) * sun
            # From light to the values of an sRGB picture.
            result[side, part] = np.round(light ** (1.0 / 2.2), 6)
    return result
