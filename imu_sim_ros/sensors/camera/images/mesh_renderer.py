# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Pictures of a mesh: each pixel's ray meets the nearest triangle."""

from collections.abc import Iterator
from typing import Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from imu_sim_ros.places.geometry import Floats
from imu_sim_ros.places.mesh import MeshCaster
from imu_sim_ros.places.mesh_file import Numbers
from imu_sim_ros.sensors.camera.images.cells import COUNTS, SHARES, looks, steps_along
from imu_sim_ros.sensors.camera.images.edges import PLACES
from imu_sim_ros.sensors.camera.images.mesh_look import Look
from imu_sim_ros.sensors.camera.images.rays import PixelRays
from imu_sim_ros.sensors.camera.images.renderer import Maps, Stretch, in_rows, look_up, rounded
from imu_sim_ros.sensors.camera.images.texture import BACKGROUND, BLANK, LEVELS
from imu_sim_ros.sensors.camera.model import CameraModel
from imu_sim_ros.sensors.camera.view import Eyes
from imu_sim_ros.types import Array, Bytes, Integers, Mask, Single

_CONTRAST: Final = 12
"""Grey values by which pixels differ at an edge at least."""
_STEP: Final = 0.01
"""Step in depth, of the distance, from which on two triangles are two surfaces."""
_FLAT: Final = 0.9
"""Cosine between their normals below which they are."""
_RAYS_OF_EDGES: Final = 65_536
"""Rays that are cast at once."""
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
    way: Single
    """(n, 3) unit vectors along the rays in the world."""

    def some(self, which: Integers) -> "_Seen":
        """Return what some of the rays see."""
        return _Seen(
            self.number.take(which),
            self.nothing.take(which),
            self.distance.take(which),
            self.along.take(which),
            self.place.take(which, axis=1),
            self.way.take(which, axis=0),
        )


class MeshRenderer:
    """Pictures of one camera in a mesh; :class:`~.renderer.Renderer` for rectangles."""

    def __init__(
        self,
        model: CameraModel,
        caster: MeshCaster,
        look: Look,
        scale: int,
        trilinear: bool = False,
        areas: bool = False,
    ) -> None:
        """Set up the rays.

        :param scale: rays along each side of a pixel.
        :param trilinear: look at two mip levels.
        :param areas: as of :class:`~.renderer.Renderer`.
        """
        self._caster, self._look, self._trilinear = caster, look, trilinear
        self._areas = areas
        self._rays = PixelRays(model, scale)
        self.rows = self._rays.row_places
        """Row of the image of each row of rays."""
        self._pitches: dict[int, NDArray[np.float16]] = {}

    def pictures(self, eyes: Eyes) -> Iterator[tuple[slice, Bytes]]:
        """Yield what one pose sees, or one pose for each row of rays, a band at a time.

        :returns: rows of the image, and the values (h, w[, 3]) of all their rays.
        """
        scale = self._rays.scale
        poses = rounded(eyes.world)
        for number, rows, rays, seen in self._seen(poses):
            if number not in self._pitches:
                self._pitches[number] = _pitch(rays).reshape(-1).astype(np.float16)
            pitch = self._pitches[number].astype(np.float32)
            picture = self._painted(seen, pitch).reshape(
                *rays.shape[1:], *self._look.image.shape[2:]
            )
            if self._areas:
                self._put_edges(picture, seen, pitch, rays, (poses, rows))
            yield slice(rows.start // scale, rows.stop // scale), picture

    def _put_edges(
        self,
        picture: Bytes,
        seen: _Seen,
        pitch: Single,
        rays: Single,
        at: tuple[tuple[Array, Array], slice],
    ) -> None:
        """Give pixels whose neighbours look different the mean of eight rays each.

        :param rays: (3, h, w) of the picture.
        :param at: the poses, and the rows of the picture.
        """
        (position, r_wc), rows = at
        eyes = position if len(position) == 1 else position[rows].repeat(rays.shape[2], axis=0)
        pixel = np.flatnonzero(self._at_edges(picture, seen, eyes))
        if not len(pixel):
            return
        row, column = np.divmod(pixel, picture.shape[1])
        steps = [_step(rays, axis, row, column) for axis in (2, 1)]
        own = row + rows.start if len(position) > 1 else np.zeros(len(row), np.int64)
        turn, eye = r_wc[own].astype(np.float32), position[own]
        total = np.zeros((len(pixel), *picture.shape[2:]), np.uint16)
        part = _RAYS_OF_EDGES // len(PLACES[0])
        for first in range(0, len(pixel), part):
            some = slice(first, first + part)
            middle = rays[:, row[some], column[some]]
            x, y = (each[:, some, None] for each in steps)
            ray = middle[..., None] + x * PLACES[0].T + y * PLACES[1].T
            way = np.stack(
                [sum(turn[some, k, j, None] * ray[j] for j in range(3)) for k in range(3)]
            )
            way = np.ascontiguousarray(way.reshape(3, -1).T)
            count = ray.shape[2]
            met = self._met(eye[some].repeat(count, axis=0), way)
            values = self._painted(met, pitch.take(pixel[some]).repeat(count))
            values = values.reshape(-1, count, *picture.shape[2:])
            total[some] = values.sum(axis=1, dtype=np.uint16)
        total += len(PLACES[0]) // 2
        picture.reshape(-1, *picture.shape[2:])[pixel] = total // len(PLACES[0])

    def _at_edges(self, picture: Bytes, seen: _Seen, eyes: Array) -> Mask:
        """Tell which pixels (h w,) differ from a neighbour that sees another surface.

        Triangles of one surface are those whose planes go on in each other, at a small angle.
        Without textures any difference between two triangles counts.
        """
        height, width = picture.shape[:2]
        result = np.zeros(height * width, np.bool_)
        triangle = np.where(seen.nothing, -1, seen.number).reshape(height, width)
        values = picture.astype(np.int16).reshape(height, width, -1)
        for axis, step in ((0, width), (1, 1)):
            apart = (np.abs(np.diff(values, axis=axis)) > _CONTRAST).any(axis=2)
            apart &= np.diff(triangle, axis=axis) != 0
            first = np.flatnonzero(apart)
            if axis == 1:
                first += first // (width - 1)
            if self._look.textured:
                first = first[self._another(seen, eyes, first, first + step)]
            result[first] = result[first + step] = True
        return result

    def _another(self, seen: _Seen, eyes: Array, one: Integers, other: Integers) -> Mask:
        """Tell which of n pairs of pixels see two surfaces."""
        first, second = seen.some(one), seen.some(other)
        planes = [self._caster.planes.take(each.number, axis=0) for each in (first, second)]
        start = (eyes if len(eyes) == 1 else eyes.take(other, axis=0)) - self._caster.middle
        away = planes[0][:, 3] - (planes[0][:, :3] * start).sum(axis=1)
        along = (planes[0][:, :3] * second.way).sum(axis=1)
        # Without a division: the first one's plane is where the second one is.
        missed = np.abs(away - second.distance * along) > _STEP * np.abs(away)
        cosine = (planes[0][:, :3] * planes[1][:, :3]).sum(axis=1)
        cosine *= np.sign(first.along * second.along)
        look = self._look.texture
        return np.asarray(
            missed
            | (cosine < _FLAT)
            | (first.nothing | second.nothing)
            | (look.take(first.number) != look.take(second.number))
        )

    def depth(self, eyes: Eyes) -> Single:
        """Return the distance along the axis (h, w) [m] of what each pixel sees; 0: nothing."""
        result = np.empty(self._rays.shape, np.float32)
        for _, rows, rays, seen in self._seen(rounded(eyes.world)):
            distance = np.where(seen.nothing, 0.0, seen.distance)
            result[rows] = distance.reshape(rays.shape[1:]) * rays[2]
        return result

    def depth_and_mask(self, eyes: Eyes) -> tuple[Single, Bytes]:
        """Return :meth:`depth`, and 0 for each pixel: nothing moves in a mesh."""
        return self.depth(eyes), np.zeros(self._rays.shape, np.uint8)

    def _seen(self, poses: tuple[Array, Array]) -> Iterator[tuple[int, slice, Single, _Seen]]:
        """Yield each band's number, rows and rays (3, h, w), and what they meet first."""
        position, r_wc = poses
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
        number = np.where(nothing, 0, hits.surface)
        return _Seen(number, nothing, hits.distance, along, place, ways)

    def _painted(self, seen: _Seen, pitch: Single) -> Bytes:
        """Return the values (n,) or (n, 3) of rays."""
        look = self._look
        picture: Bytes | None = None
        if look.textured:
            picture = look_up(look.image, self._maps(seen, pitch))
            picture = picture.reshape(-1, *look.image.shape[2:])[: len(seen.number)]
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
        return result.reshape(-1, *look.image.shape[2:])

    @staticmethod
    def _values(coefficients: Single, k: int, seen: _Seen) -> Single:
        """Return one of the functions on the triangles at the places of the rays (n,)."""
        value: Single = coefficients[4 * k + 3].take(seen.number)
        for j in range(3):
            term = coefficients[4 * k + j].take(seen.number)
            term *= seen.place[j]
            value += term
        return value

    def _maps(self, seen: _Seen, pitch: Single) -> Maps:
        """Return where in the atlas the rays look."""
        look = self._look
        places = np.stack([self._values(look.places, k, seen) for k in range(2)])
        texture = look.texture.take(seen.number)
        square, length, along = self._footprint(seen, pitch)
        levels, share = _levels(square, self._trilinear, self._areas)
        maps = self._look_up(places, texture, levels, share, seen.nothing)
        if along is None or length is None:
            return maps
        longest = length * (np.float32(0.5) ** np.arange(LEVELS, dtype=np.float32)).take(levels[0])
        counts = looks(longest)
        counts[seen.nothing] = 1
        stretches = []
        for count in COUNTS:
            some = np.flatnonzero(counts == count)
            if not len(some):
                continue
            at = places[:, None].take(some, axis=2) + steps_along(count)[:, None] * along.take(
                some, axis=1
            ).reshape(2, 1, -1)
            every = np.tile(some, count)
            own = [each.take(every) for each in levels]
            of_coarse = share.take(every) if share is not None else None
            looked = self._look_up(
                at.reshape(2, -1),
                texture.take(every),
                own,
                of_coarse,
                np.zeros(len(every), np.bool_),
            )
            stretches.append(Stretch(some, count, looked))
        return maps._replace(stretches=stretches)

    def _look_up(
        self,
        places: Single,
        texture: Numbers,
        levels: list[Integers],
        share: NDArray[np.uint16] | None,
        nothing: Mask,
    ) -> Maps:
        """Return where in the atlas n places (2, n) of textures (n,) are; places repeat."""
        atlas = self._look.atlas
        places -= np.floor(places)
        found = []
        for level in levels:
            row = texture * LEVELS + level
            factor = (np.float32(0.5) ** np.arange(LEVELS, dtype=np.float32)).take(level)
            at = []
            for k in range(2):
                texel = atlas.size[:, k].take(texture)
                texel *= places[k]
                texel *= factor
                texel += (atlas.place[..., k].reshape(-1) - np.float32(0.5)).take(row)
                texel[nothing] = BLANK
                at.append(texel)
            found.append(at)
        return in_rows(found, share)

    def _footprint(self, seen: _Seen, pitch: Single) -> tuple[Single, Single | None, Single | None]:
        """Return what decides the levels of rays, and for areas length and long axis of footprints.

        That is the square of the texels (n,) along which a ray's pixel extends at most,
        ``(density pitch t / cos)^2`` with the cosine between the ray and the triangle's normal; for
        areas that of its width, ``(density pitch t)^2``, or of an eighth of its length. The axis is
        (2, n) in u and v, the ray's projection onto the triangle.
        """
        size = np.where(seen.nothing, 0.0, seen.distance) * pitch
        cosine = np.maximum(np.abs(seen.along), _GRAZING)
        density = self._look.density.take(seen.number)
        if not self._areas:
            size /= cosine
            size *= size
            return (size * density).astype(np.float32), None, None
        look = self._look
        sine = np.sqrt(np.maximum(1.0 - cosine * cosine, _GRAZING))
        factor = (size / (cosine * sine)).astype(np.float32)
        axis = np.empty((2, len(factor)), np.float32)
        length = np.zeros(len(factor), np.float32)
        texture = look.texture.take(seen.number)
        for k in range(2):
            slope = look.places[4 * k].take(seen.number) * seen.way[:, 0]
            for j in (1, 2):
                slope += look.places[4 * k + j].take(seen.number) * seen.way[:, j]
            axis[k] = slope * factor
            texels = axis[k] * look.atlas.size[:, k].take(texture)
            length += texels * texels
        size *= size
        width = np.maximum(
            (size * density).astype(np.float32), length / np.float32(COUNTS[-1] ** 2)
        )
        return width, np.sqrt(length), axis


def _step(rays: Single, axis: int, row: Integers, column: Integers) -> Single:
    """Return the change (3, n) of rays (3, h, w) from a pixel to the next along an axis."""
    at = [row, column]
    before, after = list(at), list(at)
    last = rays.shape[axis] - 1
    before[axis - 1] = np.maximum(at[axis - 1] - 1, 0)
    after[axis - 1] = np.minimum(at[axis - 1] + 1, last)
    span = np.maximum(after[axis - 1] - before[axis - 1], 1).astype(np.float32)
    result: Single = (rays[:, after[0], after[1]] - rays[:, before[0], before[1]]) / span
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


def _levels(
    square: Single, trilinear: bool, areas: bool
) -> tuple[list[Integers], NDArray[np.uint16] | None]:
    """Return the nearest level (n,) of footprints (n,), or two and the share of the second.

    As with rectangles: steps between levels are sqrt(2) times 1, 2, 4, ..., of two, and for areas,
    1, 2, 4, ...
    """
    exponent = np.frexp(np.maximum(square, np.float32(1e-6)))[1].astype(np.int64) - 1
    if not trilinear:
        return [np.clip((exponent + (not areas)) >> 1, 0, LEVELS - 1)], None
    level = np.clip(exponent >> 1, 0, LEVELS - 2)
    excess = np.sqrt(square) * (np.float32(0.5) ** level.astype(np.float32)) - np.float32(1.0)
    share = np.rint(np.clip(excess, 0.0, 1.0) * np.float32(SHARES)).astype(np.uint16)
    return [level, level + 1], share
