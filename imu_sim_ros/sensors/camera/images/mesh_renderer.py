# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Pictures of a mesh: each pixel's ray meets the nearest triangle."""

from collections.abc import Iterator
from typing import Final

import numpy as np
from numpy.typing import NDArray

from imu_sim_ros.core.types import Array, Bytes, Integers, Mask, Single
from imu_sim_ros.places.mesh import MeshCaster
from imu_sim_ros.sensors.camera.images.loops import POINTS, paint_mesh, space
from imu_sim_ros.sensors.camera.images.mesh_look import Look
from imu_sim_ros.sensors.camera.images.rays import PixelRays
from imu_sim_ros.sensors.camera.images.renderer import round_poses
from imu_sim_ros.sensors.camera.images.visible import MeshHits
from imu_sim_ros.sensors.camera.model import CameraModel
from imu_sim_ros.sensors.camera.view import Eyes
from imu_sim_ros.terminal.progress import check_interrupted

_CONTRAST: Final = 12
"""Smallest difference of neighbouring pixels at an edge [grey values]."""
_STEP: Final = 0.01
"""Step in depth over the distance from which on two triangles belong to different surfaces."""
_FLAT: Final = 0.9
"""Cosine between normals below which two triangles belong to different surfaces."""
_RAYS_OF_EDGES: Final = 65_536
"""Rays that are cast at once."""


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
        """Initialise the rays of a camera.

        :param scale: rays along each side of a pixel.
        :param trilinear: look at two mip levels.
        :param areas: as of :class:`~.renderer.Renderer`.
        """
        self._caster, self._look, self._trilinear = caster, look, trilinear
        self._areas = areas
        self._rays = PixelRays(model, scale)
        self.rows = self._rays.row_positions
        """Row of the image of each row of rays."""
        self._pitches: dict[int, NDArray[np.float16]] = {}

    def pictures(self, eyes: Eyes) -> Iterator[tuple[slice, Bytes]]:
        """Yield the image of one pose, or of one pose for each row of rays, band by band.

        :returns: rows of the image, and the values (h, w[, 3]) of all their rays.
        """
        scale = self._rays.scale
        poses = round_poses(eyes.world)
        for number, rows, rays, hits in self._ray_hits(poses):
            if number not in self._pitches:
                self._pitches[number] = _pitch(rays).reshape(-1).astype(np.float16)
            pitch = self._pitches[number].astype(np.float32)
            picture = self._paint(hits, pitch).reshape(*rays.shape[1:], *self._look.image.shape[2:])
            if self._areas:
                self._put_edges(picture, hits, pitch, rays, (poses, rows))
            yield slice(rows.start // scale, rows.stop // scale), picture

    def _put_edges(
        self,
        picture: Bytes,
        picture_hits: MeshHits,
        pitch: Single,
        rays: Single,
        poses_and_rows: tuple[tuple[Array, Array], slice],
    ) -> None:
        """Draw pixels whose neighbours look different as means of eight rays.

        :param picture: (h, w) or (h, w, 3), which is changed; ``picture_hits`` what its rays meet.
        :param pitch: (h w,) angles between neighbouring rays [rad].
        :param rays: (3, h, w) rays of the picture in the camera's frame.
        :param poses_and_rows: positions and rotations R_wc of the camera, one or one for each row
            of the image, and the rows of the picture.
        """
        (position, r_wc), rows = poses_and_rows
        eyes = position if len(position) == 1 else position[rows].repeat(rays.shape[2], axis=0)
        pixel = np.flatnonzero(self._at_edges(picture, picture_hits, eyes))
        if not len(pixel):
            return
        row, column = np.divmod(pixel, picture.shape[1])
        steps = [_step(rays, axis, row, column) for axis in (2, 1)]
        pose_rows = row + rows.start if len(position) > 1 else np.zeros(len(row), np.int64)
        turn, eye = r_wc[pose_rows].astype(np.float32), position[pose_rows]
        total = np.zeros((len(pixel), *picture.shape[2:]), np.uint16)
        part = _RAYS_OF_EDGES // len(POINTS)
        for start in range(0, len(pixel), part):
            some = slice(start, start + part)
            middle = rays[:, row[some], column[some]]
            x, y = (step[:, some, None] for step in steps)
            ray = middle[..., None] + x * POINTS[:, 0] + y * POINTS[:, 1]
            way = np.stack(
                [sum(turn[some, k, j, None] * ray[j] for j in range(3)) for k in range(3)]
            )
            way = np.ascontiguousarray(way.reshape(3, -1).T)
            count = ray.shape[2]
            hits = self._intersections(eye[some].repeat(count, axis=0), way)
            values = self._paint(hits, pitch.take(pixel[some]).repeat(count))
            values = values.reshape(-1, count, *picture.shape[2:])
            total[some] = values.sum(axis=1, dtype=np.uint16)
        total += len(POINTS) // 2
        picture.reshape(-1, *picture.shape[2:])[pixel] = total // len(POINTS)

    def _at_edges(self, picture: Bytes, hits: MeshHits, eyes: Array) -> Mask:
        """Return True for pixels (h w,) that differ from a neighbour on another surface.

        Triangles of one surface are those whose planes go on in each other, at a small angle.
        Without textures any difference between two triangles counts.
        """
        height, width = picture.shape[:2]
        result = np.zeros(height * width, np.bool_)
        triangle = np.where(hits.nothing, -1, hits.number).reshape(height, width)
        values = picture.astype(np.int16).reshape(height, width, -1)
        for axis, step in ((0, width), (1, 1)):
            apart = (np.abs(np.diff(values, axis=axis)) > _CONTRAST).any(axis=2)
            apart &= np.diff(triangle, axis=axis) != 0
            edge_pixels = np.flatnonzero(apart)
            if axis == 1:
                edge_pixels += edge_pixels // (width - 1)
            if self._look.textured:
                edge_pixels = edge_pixels[
                    self._on_two_surfaces(hits, eyes, edge_pixels, edge_pixels + step)
                ]
            result[edge_pixels] = result[edge_pixels + step] = True
        return result

    def _on_two_surfaces(
        self, hits: MeshHits, eyes: Array, pixels: Integers, neighbours: Integers
    ) -> Mask:
        """Return True for pairs (n,) of neighbouring pixels on different surfaces."""
        first, second = hits.some(pixels), hits.some(neighbours)
        planes = [self._caster.planes.take(side.number, axis=0) for side in (first, second)]
        start = (eyes if len(eyes) == 1 else eyes.take(neighbours, axis=0)) - self._caster.middle
        away = planes[0][:, 3] - (planes[0][:, :3] * start).sum(axis=1)
        along = (planes[0][:, :3] * second.way).sum(axis=1)
        # Distance of the first plane along the second ray against the second hit, without division.
        missed = np.abs(away - second.distance * along) > _STEP * np.abs(away)
        cosine = (planes[0][:, :3] * planes[1][:, :3]).sum(axis=1)
        cosine *= np.sign(first.along * second.along)
        look = self._look.triangles.texture
        return np.asarray(
            missed
            | (cosine < _FLAT)
            | (first.nothing | second.nothing)
            | (look.take(first.number) != look.take(second.number))
        )

    def depth(self, eyes: Eyes) -> Single:
        """Return the depth image (h, w) along the axis [m]; 0: nothing is hit."""
        result = np.empty(self._rays.shape, np.float32)
        for _, rows, rays, hits in self._ray_hits(round_poses(eyes.world)):
            distance = np.where(hits.nothing, 0.0, hits.distance)
            result[rows] = distance.reshape(rays.shape[1:]) * rays[2]
        return result

    def depth_and_mask(self, eyes: Eyes) -> tuple[Single, Bytes]:
        """Return :meth:`depth`, and 0 for each pixel: nothing moves in a mesh."""
        return self.depth(eyes), np.zeros(self._rays.shape, np.uint8)

    def _ray_hits(
        self, poses: tuple[Array, Array]
    ) -> Iterator[tuple[int, slice, Single, MeshHits]]:
        """Yield each band's number, rows and rays (3, h, w), and the nearest intersections."""
        position, r_wc = poses
        for number, band in enumerate(self._rays.bands):
            check_interrupted()
            rows, rays = self._rays.rows(band), self._rays.of_band(number)
            pose_rows = slice(None) if len(position) == 1 else rows
            turn = r_wc[pose_rows].astype(np.float32)[:, None]
            ways = np.empty((*rays.shape[1:], 3), np.float32)
            for k in range(3):
                ways[..., k] = sum(turn[..., k, j] * rays[j] for j in range(3))
            eye = position[pose_rows]
            if len(position) > 1:
                eye = eye.repeat(rays.shape[2], axis=0)
            yield number, rows, rays, self._intersections(eye, ways.reshape(-1, 3))

    def _intersections(self, eye: Array, ways: Single) -> MeshHits:
        """Return the nearest intersections of rays with the mesh.

        :param eye: (n, 3) or (1, 3) positions of the camera [m].
        :param ways: (n, 3) directions in the world.
        """
        hits, along = self._caster.meet(eye, ways)
        nothing = hits.surface < 0
        start = eye - self._caster.middle
        distance = np.where(nothing, 0.0, hits.distance)
        point = np.empty((3, len(ways)), np.float32)
        for k in range(3):
            point[k] = start[:, k] + distance * ways[:, k]
        number = np.where(nothing, 0, hits.surface)
        return MeshHits(
            number=number,
            nothing=nothing,
            distance=hits.distance,
            along=along,
            point=point,
            way=ways,
        )

    def _paint(self, hits: MeshHits, pitch: Single) -> Bytes:
        """Return the grey values (n,) or colours (n, 3) of rays.

        :param pitch: (n,) angle from each ray to the next [rad].
        """
        atlas, image = self._look.atlas, self._look.image
        textures = image.reshape(*image.shape[:2], -1), atlas.size, atlas.corner
        values = np.empty((len(hits.number), textures[0].shape[2]), np.uint8)
        modes, triangles = (self._trilinear, self._areas), self._look.triangles
        paint_mesh(values, hits, pitch, triangles, textures, modes, space())
        return values.reshape(-1, *image.shape[2:])


def _step(rays: Single, axis: int, row: Integers, column: Integers) -> Single:
    """Return the change (3, n) of rays (3, h, w) from a pixel to the next along an axis."""
    index = [row, column]
    previous_index, next_index = list(index), list(index)
    limit = rays.shape[axis] - 1
    previous_index[axis - 1] = np.maximum(index[axis - 1] - 1, 0)
    next_index[axis - 1] = np.minimum(index[axis - 1] + 1, limit)
    span = np.maximum(next_index[axis - 1] - previous_index[axis - 1], 1).astype(np.float32)
    result: Single = (
        rays[:, next_index[0], next_index[1]] - rays[:, previous_index[0], previous_index[1]]
    ) / span
    return result


def _pitch(rays: Single) -> Single:
    """Return the angle (h, w) from each ray to the next, across or down, the larger [rad]."""
    result = np.zeros(rays.shape[1:], np.float32)
    for axis in (1, 2):
        if rays.shape[axis] < 2:
            continue
        step = np.diff(rays, axis=axis)
        angle = np.sqrt((step * step).sum(axis=0))
        edge = angle[-1:] if axis == 1 else angle[:, -1:]
        np.maximum(result, np.concatenate([angle, edge], axis=axis - 1), out=result)
    # Next to a pixel without a direction the step says nothing.
    usual = float(np.median(result[result > 0.0])) if (result > 0.0).any() else 1.0
    result[result > 8.0 * usual] = usual
    return result
