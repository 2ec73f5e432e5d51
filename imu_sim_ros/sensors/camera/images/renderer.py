# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Pictures of textured rectangles: each pixel's ray meets the nearest surface."""

import math
from collections.abc import Iterator
from typing import Final, NamedTuple, Protocol

import numpy as np

from imu_sim_ros.core import rotation
from imu_sim_ros.core.types import Array, Bytes, Integers, Mask, Single
from imu_sim_ros.places.bodies import Crowd
from imu_sim_ros.places.geometry import Surfaces
from imu_sim_ros.places.shadows import ShadowLine
from imu_sim_ros.sensors.camera.images.cells import CellGrid, patches
from imu_sim_ros.sensors.camera.images.finish import Glossy, Shades
from imu_sim_ros.sensors.camera.images.loops import IN_FRONT, measure, paint, space
from imu_sim_ros.sensors.camera.images.planes import Pairs, Planes
from imu_sim_ros.sensors.camera.images.rays import PixelRays, corners_and_probes
from imu_sim_ros.sensors.camera.images.texture import Atlas
from imu_sim_ros.sensors.camera.images.visible import Visible
from imu_sim_ros.sensors.camera.model import CameraModel
from imu_sim_ros.sensors.camera.view import CameraPoses, Eyes
from imu_sim_ros.terminal.progress import check_interrupted

_GRID: Final = 2.0**30
"""Steps in 1 of rounded poses, so that images do not depend on the last bits of a sine."""
_SIDEWAYS: Final = 0.05
"""Smallest z of the rays of a lens whose rays are bounded by a cone."""
_SLACK: Final = 1e-3
"""Margin of the cone of all rays."""


class PictureMaker(Protocol):
    """Renderer of one camera in one scene, of rectangles or of a mesh."""

    rows: Array
    """Row of the image of each row of rays."""

    def pictures(self, eyes: Eyes) -> Iterator[tuple[slice, Bytes]]:
        """Yield rows of the image, and the values (h, w[, 3]) of all their rays."""
        ...

    def depth(self, eyes: Eyes) -> Single:
        """Return the depth image (h, w) along the axis [m]; 0: nothing is hit."""
        ...

    def depth_and_mask(self, eyes: Eyes) -> tuple[Single, Bytes]:
        """Return :meth:`depth`, and the number of each pixel's moving body (h, w); 0: none."""
        ...


class Renderer:
    """Pictures of one camera in one scene of rectangles and moving bodies."""

    def __init__(
        self,
        model: CameraModel,
        surfaces: Surfaces,
        atlas: Atlas,
        scale: int,
        trilinear: bool = False,
        crowd: Crowd | None = None,
        areas: bool = False,
    ) -> None:
        """Initialise the rays of a camera.

        :param scale: rays along each side of a pixel.
        :param trilinear: look at two mip levels.
        :param areas: pixels see what is in their areas: several surfaces at edges, textures along
            their footprints; else what is at their centres.
        :param crowd: bodies that move; their textures follow those of the surfaces.
        """
        self._trilinear, self._areas, self.crowd = trilinear, areas, crowd
        self.surfaces, self.atlas = surfaces, atlas
        self._fronts = [
            _Fronts.of(where) for where in (surfaces, *(crowd.surfaces if crowd else ()))
        ]
        self._first = np.cumsum([len(faces.normals) for faces in self._fronts])
        self._shining = np.full(self._first[-1], -1)
        if atlas.polish is not None:
            self._shining[atlas.polish.face] = atlas.polish.face
        self._rays = PixelRays(model, scale)
        self.rows = self._rays.row_positions
        """Row of the image of each row of rays."""
        self.bands = self._rays.bands
        corners, self._probes = corners_and_probes(self._rays, areas)
        self._units, self._cell_angle = _units(corners.rays)
        self._grid = CellGrid(corners, self._cell_angle)
        self._corner_rows = corners.rows
        self._cone = self._cone_of_rays()

    def pictures(self, eyes: Eyes) -> Iterator[tuple[slice, Bytes]]:
        """Yield the image of one pose, or of one pose for each row of rays, band by band.

        :returns: rows of the image, and the values (h, w[, 3]) of all their rays.
        """
        visible = self.visible(eyes)
        rays, image = self._rays, self.atlas.image.reshape(*self.atlas.image.shape[:2], -1)
        for number, band in enumerate(self.bands):
            check_interrupted()
            rows = rays.rows(band)
            picture = np.empty((rows.stop - rows.start, rays.width, image.shape[2]), np.uint8)
            paint(
                picture,
                rays.of_band(number),
                (rows.start, rays.height - 1),
                visible,
                image,
                self._areas,
                space(),
            )
            shape = *picture.shape[:2], *self.atlas.image.shape[2:]
            yield slice(rows.start // rays.scale, rows.stop // rays.scale), picture.reshape(shape)

    def _shadows(self, eyes: Eyes) -> Iterator[tuple[Planes, Pairs, ShadowLine]]:
        """Yield planes, cells and line of each shadow of a body that may be in the image."""
        if self.crowd is None:
            return
        (position, r_wc), sun = round_poses(eyes.world), self.crowd.sun
        for body_eyes, shadow in zip(eyes.bodies, self.crowd.shadows, strict=True):
            position_b, r_bc = round_poses(body_eyes)  # the camera in the body's axes
            lines = [shadow.below]
            if sun is not None:
                r_wb = (r_wc[0][:, None] * r_bc[0]).sum(axis=2)
                line = shadow.shadow_line((sun.to_sun[:, None] * r_wb).sum(axis=0), 1.0)
                if self._may_be_seen(line.ball, position_b, r_bc):
                    share = sun.share(position[0] - (r_wb * position_b[0]).sum(axis=1))
                    if share > 0.0:
                        lines.append(line._replace(depth=share))
            for line in lines:
                if self._may_be_seen(line.ball, position_b, r_bc):
                    floor = line.floor()
                    planes = Planes.of(floor, floor.normal, position_b, r_bc)
                    yield planes, self._grid.pairs(planes), line

    def depth(self, eyes: Eyes) -> Single:
        """Return the depth image (h, w) along the axis [m]; 0: nothing is hit."""
        return self.depth_and_mask(eyes)[0]

    def depth_and_mask(self, eyes: Eyes) -> tuple[Single, Bytes]:
        """Return :meth:`depth`, and the number of each pixel's moving body (h, w); 0: none."""
        planes, numbers, pairs = self._candidates(eyes)
        rays = self._rays
        bodies = np.searchsorted(self._first, numbers, side="right").astype(np.uint8)
        depth, mask = np.empty(rays.shape, np.float32), np.empty(rays.shape, np.uint8)
        for number, band in enumerate(self.bands):
            check_interrupted()
            rows, last_row = rays.rows(band), rays.height - 1
            of_band = rays.of_band(number)
            measure(depth[rows], mask[rows], of_band, (rows.start, last_row), planes, pairs, bodies)
        return depth, mask

    def _candidates(self, eyes: Eyes) -> tuple[Planes, Integers, Pairs]:
        """Return the rectangles that may be visible, their numbers (m,), and their cells."""
        position, r_wc = round_poses(eyes.world)
        candidates = [(0, self._facing(0, position, r_wc), position, r_wc)]
        for k, body_eyes in enumerate(eyes.bodies, start=1):
            position, r_wc = round_poses(body_eyes)
            if self.crowd and self._may_be_seen(self.crowd.balls[k - 1], position, r_wc):
                candidates.append((k, self._facing(k, position, r_wc), position, r_wc))
        planes_world, *planes_bodies = (
            Planes.of(*self._fronts[k].some(numbers), *pose) for k, numbers, *pose in candidates
        )
        planes = planes_world.concatenate(planes_bodies)
        start = (0, *self._first)
        numbers = np.concatenate([face_numbers + start[k] for k, face_numbers, *_ in candidates])
        return planes, numbers, self._grid.pairs(planes)

    def visible(self, eyes: Eyes) -> Visible:
        """Return the surfaces that may be visible in the image, with their textures and gloss."""
        planes, numbers, pairs = self._candidates(eyes)
        rows = self._probes.rows.take(pairs.cell, axis=1)
        intersections = [
            planes.meet(
                pairs.which, rays.take(pairs.cell, axis=1)[..., None], row[:, None], IN_FRONT
            )
            for rays, row in zip(self._probes.rays, rows, strict=True)
        ]
        # One probe after the other in memory: loops are long.
        inverse = np.stack([intersection[1] for intersection in intersections])[..., 0]
        positions = np.stack([intersection[2] for intersection in intersections])[..., 0]
        linear = [
            planes.linear(pairs.which, rays.take(pairs.cell, axis=1)[..., None], row[:, None])
            for rays, row in zip(self._probes.rays, rows, strict=True)
        ]
        texture = numbers[pairs.which]
        pair_patches = patches(
            positions,
            np.stack(linear)[..., 0],
            self.atlas,
            texture,
            self._trilinear,
            self._areas,
        )
        polish, gloss = self.atlas.polish, Glossy.none(len(pairs.cell))
        if polish is not None:
            face, probes = self._shining[texture], (inverse, positions, rows[0])
            gloss = Glossy.of(polish, planes, face, pairs, probes, self._cell_angle)
        cells = self._grid.rows * self._grid.columns
        shades = Shades.of(cells, planes.none(), list(self._shadows(eyes)))
        return Visible(planes=planes, pairs=pairs, patches=pair_patches, shades=shades, gloss=gloss)

    def _facing(self, k: int, position: Array, r_wc: Array) -> Integers:
        """Return the numbers of the surfaces of which the front is towards a position of (n, 3).

        Surfaces with all corners beyond one side of the cone of all rays are left out.

        :param k: 0: the surfaces at rest; 1, 2, ...: those of a body.
        """
        faces = self._fronts[k]
        offset = position[:, None] - faces.surfaces.origin
        front = ((offset * faces.normals).sum(axis=2) > 0.0).any(axis=0)
        facing = np.flatnonzero(front | faces.both)
        if k or len(position) > 1 or self._cone is None:
            return facing
        corners = faces.corners[facing] - position[0]
        beyond = (np.matmul(np.matmul(corners, r_wc[0]), self._cone) > 0.0).all(axis=1)
        return facing[~beyond.any(axis=1)]

    def _may_be_seen(self, ball: tuple[Array, float], position: Array, r_wc: Array) -> bool:
        """Return whether a sphere may be in the image.

        :param ball: centre (3,) in the axes of its body, and radius [m].
        :param position: (n, 3) positions of the camera in these axes [m].
        :param r_wc: (n, 3, 3) attitudes of the camera in these axes.
        """
        center, radius = ball
        middle = ((center - position)[:, :, None] * r_wc).sum(axis=1)
        rows = self._corner_rows if len(middle) > 1 else np.zeros(1, np.int64)
        x, y, z = middle[rows].T[..., None]
        away = np.sqrt(x * x + y * y + z * z)
        sine = np.minimum(radius / np.maximum(away, 1e-9), 1.0)
        half_angle = np.minimum(np.arcsin(sine) + self._cell_angle, math.pi)
        along = self._units[0] * x + self._units[1] * y + self._units[2] * z
        return bool(((along >= away * np.cos(half_angle)) | (away <= radius)).any())

    def _cone_of_rays(self) -> Array | None:
        """Return the normals (3, 4) of four planes through the camera that enclose all rays.

        None if a ray looks sideways or backwards.
        """
        bounds = [np.full(4, -np.inf)]
        for number in range(len(self.bands)):
            rays = self._rays.of_band(number)
            x, y, z = rays[:, rays.any(axis=0)].astype(np.float64)
            if not len(z):
                continue
            if not z.min() > _SIDEWAYS:
                return None
            u, v = x / z, y / z
            bounds.append(np.array([u.max(), -u.min(), v.max(), -v.min()]))
        if len(bounds) == 1:
            return None
        right, left, below, above = np.max(bounds, axis=0) + _SLACK
        return np.array(
            [[1.0, -1.0, 0.0, 0.0], [0.0, 0.0, 1.0, -1.0], [-right, -left, -below, -above]]
        )


class _Fronts(NamedTuple):
    """Surfaces with their normals and corners."""

    surfaces: Surfaces
    normals: Array
    """(m, 3) unit normals."""
    corners: Array
    """(m, 4, 3) corners [m]."""
    both: Mask
    """(m,) True for surfaces that are visible from both sides."""

    @classmethod
    def of(cls, surfaces: Surfaces) -> "_Fronts":
        """Return surfaces with their normals and corners."""
        both = np.array(surfaces.texture) == "plane"
        return cls(surfaces, surfaces.normal, surfaces.corners, both)

    def some(self, numbers: Integers) -> tuple[Surfaces, Array]:
        """Return the rectangles of some numbers, and their normals."""
        surfaces = self.surfaces
        some = Surfaces(
            origin=surfaces.origin[numbers],
            across=surfaces.across[numbers],
            up=surfaces.up[numbers],
            hides=surfaces.hides[numbers],
            texture=(),
        )
        return some, self.normals[numbers]


def round_poses(poses: CameraPoses) -> tuple[Array, Array]:
    """Return positions (n, 3) and rotations R_wc (n, 3, 3), rounded so that machines agree."""
    position = np.round(poses.position * _GRID) / _GRID
    r_wc = np.round(rotation.to_matrix(poses.q_wc) * _GRID) / _GRID
    return position, r_wc


def _units(rays: Single) -> tuple[Single, float]:
    """Return unit vectors along rays (3, a, b), and the largest angle across a cell [rad]."""
    length = np.sqrt((rays * rays).sum(axis=0))
    units = rays / np.maximum(length, np.float32(1e-9))
    across = (units[:, :-1, :-1] * units[:, 1:, 1:]).sum(axis=0)
    antidiagonal = (units[:, :-1, 1:] * units[:, 1:, :-1]).sum(axis=0)
    valid = (length[:-1, :-1] > 0) & (length[1:, 1:] > 0) & (length[:-1, 1:] > 0)
    cosine = np.minimum(across, antidiagonal)[valid]
    angle = math.acos(max(-1.0, min(1.0, float(cosine.min())))) if cosine.size else math.pi
    return units, angle + 1e-3
