# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Pictures of a mesh: each pixel's ray meets the nearest triangle."""

from collections.abc import Iterator
from typing import Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from imu_sim_ros.places.geometry import Floats
from imu_sim_ros.places.mesh import MeshCaster
from imu_sim_ros.sensors.camera.images.cells import SHARES
from imu_sim_ros.sensors.camera.images.mesh_look import Look
from imu_sim_ros.sensors.camera.images.rays import PixelRays
from imu_sim_ros.sensors.camera.images.renderer import Maps, look_up, opencv, rounded
from imu_sim_ros.sensors.camera.images.texture import BACKGROUND, BLANK, LEVELS
from imu_sim_ros.sensors.camera.model import CameraModel
from imu_sim_ros.sensors.camera.view import CameraPoses, Eyes
from imu_sim_ros.types import Array, Bytes, Integers, Mask, Single

_GRAZING: Final = 1e-6
"""Least cosine between a ray and a normal that counts in a pixel's footprint."""


class _Seen(NamedTuple):
    """What n rays see."""

    number: Integers
    """(n,) triangle; 0 for nothing."""
    nothing: Mask
    """(n,)."""
    distance: Floats
    """(n,) infinite: nothing."""
    along: Array
    """(n,) the triangle's normal times the ray's direction."""
    place: Single
    """(3, n) where, from the mesh's middle [m]."""


class MeshRenderer:
    """Pictures of one camera in a mesh; :class:`~.renderer.Renderer` for rectangles."""

    def __init__(
        self,
        model: CameraModel,
        caster: MeshCaster,
        look: Look,
        scale: int,
        trilinear: bool = False,
    ) -> None:
        """Set up the rays.

        :param scale: rays along each side of a pixel.
        :param trilinear: look at two mip levels.
        """
        self._caster, self._look, self._trilinear = caster, look, trilinear
        self._rays = PixelRays(model, scale)
        self.rows = self._rays.row_places
        """Row of the image of each row of rays."""
        self._pitches: dict[int, NDArray[np.float16]] = {}

    def pictures(self, eyes: Eyes) -> Iterator[tuple[slice, Bytes]]:
        """Yield what one pose sees, or one pose for each row of rays, a band at a time.

        :returns: rows of the image, and the values (h, w[, 3]) of all their rays.
        """
        scale = self._rays.scale
        for number, rows, rays, seen in self._seen(eyes.world):
            if number not in self._pitches:
                self._pitches[number] = _pitch(rays).reshape(-1).astype(np.float16)
            image = slice(rows.start // scale, rows.stop // scale)
            pitch = self._pitches[number].astype(np.float32)
            yield image, self._painted(seen, pitch, (rays.shape[1], rays.shape[2]))

    def depth(self, eyes: Eyes) -> Single:
        """Return the distance along the axis (h, w) [m] of what each pixel sees; 0: nothing."""
        result = np.empty(self._rays.shape, np.float32)
        for _, rows, rays, seen in self._seen(eyes.world):
            distance = np.where(seen.nothing, 0.0, seen.distance)
            result[rows] = distance.reshape(rays.shape[1:]) * rays[2]
        return result

    def depth_and_mask(self, eyes: Eyes) -> tuple[Single, Bytes]:
        """Return :meth:`depth`, and 0 for each pixel: nothing moves in a mesh."""
        return self.depth(eyes), np.zeros(self._rays.shape, np.uint8)

    def _seen(self, poses: CameraPoses) -> Iterator[tuple[int, slice, Single, _Seen]]:
        """Yield each band's number, rows and rays (3, h, w), and what they meet first."""
        position, r_wc = rounded(poses)
        for number, band in enumerate(self._rays.bands):
            rows, rays = self._rays.rows(band), self._rays.of_band(number)
            own = slice(None) if len(position) == 1 else rows
            turn = r_wc[own].astype(np.float32)[:, None]
            ways = np.empty((*rays.shape[1:], 3), np.float32)
            for k in range(3):
                ways[..., k] = sum(turn[..., k, j] * rays[j] for j in range(3))
            eye = position[own]
            if len(position) > 1:
                eye = eye.repeat(rays.shape[2], axis=0)
            yield number, rows, rays, self._met(eye, ways.reshape(-1, 3))

    def _met(self, eye: Array, ways: Single) -> _Seen:
        hits, along = self._caster.meet(eye, ways)
        nothing = hits.surface < 0
        start = eye - self._caster.middle
        distance = np.where(nothing, 0.0, hits.distance)
        place = np.empty((3, len(ways)), np.float32)
        for k in range(3):
            place[k] = start[:, k] + distance * ways[:, k]
        return _Seen(np.where(nothing, 0, hits.surface), nothing, hits.distance, along, place)

    def _painted(self, seen: _Seen, pitch: Single, shape: tuple[int, int]) -> Bytes:
        """Return the values (h, w[, 3]) of rays."""
        look = self._look
        picture: Bytes | None = None
        if look.textured:
            picture = look_up(look.image, self._maps(seen, pitch, shape))
            if not look.tinted and look.shades is None:
                return picture
        channels = 3 if look.image.ndim == 3 else 1
        values = np.empty((len(seen.number), channels), np.float32)
        shade: Single | None = None
        if look.shades is not None:
            behind = (seen.along > 0.0).astype(np.int64)
            shade = look.shades[behind, seen.number]
        for k in range(channels):
            value = self._values(look.tints, k, seen) if look.tinted else np.float32(255.0)
            if picture is not None:
                value = value * picture.reshape(-1, channels)[:, k] * np.float32(1.0 / 255.0)
            if shade is not None:
                value = value * shade
            values[:, k] = value
        values += np.float32(0.5)
        np.clip(values, 0.0, 255.0, out=values)
        result = values.astype(np.uint8)
        result[seen.nothing] = BACKGROUND
        return result.reshape(*shape, *look.image.shape[2:])

    @staticmethod
    def _values(coefficients: Single, k: int, seen: _Seen) -> Single:
        """Return one of the functions on the triangles at the places of the rays (n,)."""
        value: Single = coefficients[4 * k + 3].take(seen.number)
        for j in range(3):
            term = coefficients[4 * k + j].take(seen.number)
            term *= seen.place[j]
            value += term
        return value

    def _maps(self, seen: _Seen, pitch: Single, shape: tuple[int, int]) -> Maps:
        """Return where in the atlas the rays look."""
        cv2, look = opencv(), self._look
        places = []
        for k in range(2):
            place = self._values(look.places, k, seen)
            place -= np.floor(place)
            places.append(place)
        texture = look.texture.take(seen.number)
        square = self._footprint(seen, pitch)
        found = []
        levels, share = _levels(square, self._trilinear)
        for level in levels:
            row = texture * LEVELS + level
            factor = (np.float32(0.5) ** np.arange(LEVELS, dtype=np.float32)).take(level)
            at = []
            for k in range(2):
                texel = look.atlas.size[:, k].take(texture)
                texel *= places[k]
                texel *= factor
                texel += (look.atlas.place[..., k].reshape(-1) - np.float32(0.5)).take(row)
                texel[seen.nothing] = BLANK
                at.append(texel.reshape(shape))
            found.append(Maps(*cv2.convertMaps(at[0], at[1], cv2.CV_16SC2)))
        if share is None:
            return found[0]
        return found[0]._replace(coarse=found[1], share=share.reshape(shape))

    def _footprint(self, seen: _Seen, pitch: Single) -> Single:
        """Return the square of the texels (n,) along which a ray's pixel extends at most.

        That is ``(density pitch t / cos)^2``, the cosine between the ray and the triangle's normal.
        """
        size = np.where(seen.nothing, 0.0, seen.distance) * pitch
        size /= np.maximum(np.abs(seen.along), _GRAZING)
        size *= size
        result: Single = (size * self._look.density.take(seen.number)).astype(np.float32)
        return result


def _pitch(rays: Single) -> Single:
    """Return the angle (h, w) from each ray to the next, across or down, the larger [rad]."""
    result = np.zeros(rays.shape[1:], np.float32)
    for axis in (1, 2):
        if rays.shape[axis] < 2:
            continue
        step = np.diff(rays, axis=axis)
        angle = np.sqrt((step * step).sum(axis=0))
        last = angle[-1:] if axis == 1 else angle[:, -1:]
        np.maximum(result, np.concatenate([angle, last], axis=axis - 1), out=result)
    # Next to a pixel without a direction the step says nothing.
    usual = float(np.median(result[result > 0.0])) if (result > 0.0).any() else 1.0
    result[result > 8.0 * usual] = usual
    return result


def _levels(square: Single, trilinear: bool) -> tuple[list[Integers], NDArray[np.uint16] | None]:
    """Return the nearest level (n,) of footprints (n,), or two and the share of the second.

    As with rectangles: steps between levels are sqrt(2) times 1, 2, 4, ..., of two 1, 2, 4, ...
    """
    exponent = np.frexp(np.maximum(square, np.float32(1e-6)))[1].astype(np.int64) - 1
    if not trilinear:
        return [np.clip((exponent + 1) >> 1, 0, LEVELS - 1)], None
    level = np.clip(exponent >> 1, 0, LEVELS - 2)
    excess = np.sqrt(square) * (np.float32(0.5) ** level.astype(np.float32)) - np.float32(1.0)
    share = np.rint(np.clip(excess, 0.0, 1.0) * np.float32(SHARES)).astype(np.uint16)
    return [level, level + 1], share
