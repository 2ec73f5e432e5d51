# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Pictures of textured rectangles: each pixel's ray meets the nearest surface."""

import math
import os
from collections.abc import Iterator, Sequence
from typing import Any, Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from imu_sim_ros import rotation
from imu_sim_ros.errors import MissingDependencyError
from imu_sim_ros.places.bodies import Crowd
from imu_sim_ros.places.geometry import Surfaces
from imu_sim_ros.sensors.camera.images.rays import (
    Corners,
    PixelRays,
    corners_and_probes,
    in_cells,
)
from imu_sim_ros.sensors.camera.images.texture import (
    CELL,
    SHARES,
    Atlas,
    Levels,
    Planes,
    in_atlas,
    in_pixels,
    levels,
    within,
)
from imu_sim_ros.sensors.camera.model import CameraModel
from imu_sim_ros.sensors.camera.view import Poses
from imu_sim_ros.types import Array

Single = NDArray[np.float32]
Mask = NDArray[np.bool_]
Integers = NDArray[np.int64]


def covered(planes: Planes, corners: Corners) -> Mask:
    """Return in which cells (m, a, b) of the image each of m rectangles may be seen."""
    rows = corners.rows if planes.start.shape[2] > 1 else slice(None)
    x, y, z = corners.rays
    count, (height, width) = len(planes.start), x.shape
    result = np.empty((count, height - 1, width - 1), np.bool_)
    for m in range(count):  # one at a time: those of all take a hundred times the image's memory
        vectors = planes.vectors[m][..., rows, None]
        n, s, r = vectors[:, 0] * x + vectors[:, 1] * y + vectors[:, 2] * z
        start = planes.start[m][..., rows, None]
        possible = _any_corner(n > 0.0)
        for value in (s + start[0] * n, r + start[1] * n):
            possible &= _any_corner(value >= 0.0)
            possible &= _any_corner(value <= n)
        result[m] = possible
    return _with_neighbours(result)


def _any_corner(holds: Mask) -> Mask:
    """Return where any of a cell's corners (a + 1, b + 1) fulfils a condition: (a, b)."""
    rows = holds[:-1] | holds[1:]
    return np.asarray(rows[:, :-1] | rows[:, 1:])


def _with_neighbours(cells: Mask) -> Mask:
    """Return cells (m, a, b) and the eight around each."""
    rows: Mask = cells.copy()
    rows[:, 1:] |= cells[:, :-1]
    rows[:, :-1] |= cells[:, 1:]
    result: Mask = rows.copy()
    result[..., 1:] |= rows[..., :-1]
    result[..., :-1] |= rows[..., 1:]
    return result


def regions(cells: Mask) -> Iterator[tuple[int, slice, slice]]:
    """Yield the number of each rectangle in some rows of cells (m, a, b), and where it may be."""
    rows, columns = (_extents(np.asarray(cells.any(axis=k))) for k in (2, 1))
    for m, (top, bottom) in enumerate(rows):
        if bottom:
            yield m, slice(top, bottom), slice(*columns[m])


def _extents(cells: Mask) -> list[list[int]]:
    """Return the range from the first to the last that is set of each row (m, n); 0, 0: none."""
    first, last = cells.argmax(axis=1), cells.shape[1] - cells[:, ::-1].argmax(axis=1)
    ranges = np.stack([first, last], axis=1)
    ranges[~cells.any(axis=1)] = 0
    found: list[list[int]] = ranges.tolist()
    return found


Bytes = NDArray[np.uint8]

_GRID: Final = 2.0**30
"""Poses are rounded to steps of 1e-9, so that the last bits of a sine decide nothing."""
_SIDEWAYS: Final = 0.05
"""Least cosine between the axis and a ray of a lens whose rays are in one cone."""
_SLACK: Final = 1e-3
"""By which the cone of all rays is wider."""


_MANY: Final = 40
"""Surfaces above which it pays to leave out those that others hide."""
_OCCLUDERS: Final = 32
"""How many, the largest, may hide others."""
_BEHIND: Final = 1e-4
"""How far behind, relatively, and how far inside the other's edges, in metres, they must be."""


class Maps(NamedTuple):
    """Where in the atlas each pixel looks, in fixed point."""

    whole: NDArray[np.int16]
    """(h, w, 2) column and row."""
    part: NDArray[np.uint16]
    """(h, w) 32 * fraction of the row + fraction of the column, in 1/32."""
    coarse: "Maps | None" = None
    """The same in the next level, if there are two levels."""
    share: NDArray[np.uint16] | None = None
    """(h, w) what the coarse level contributes, in 1/256."""


class _Visible(NamedTuple):
    """The surfaces that may be in an image."""

    planes: Planes
    cells: NDArray[np.bool_]
    """(m, a, b) where each may be."""
    numbers: Integers
    """(m,) of each."""
    largest: Array
    """(m,) what the inverse distance of each is at most; infinite: not known."""
    places: dict[int, tuple[slice, slice]]
    """Rows and columns of cells of each that is anywhere."""
    levels: dict[int, Levels]
    """Mip levels of the surfaces seen so far."""


class _Band(NamedTuple):
    """What a band of rays sees so far."""

    first: int
    """Its first row of cells."""
    rays: Single
    """(3, h, w)."""
    nearest: Single
    """(h, w) inverse distance."""
    places: list[Single]
    """Column and row (2, h, w) in the atlas, of one level or of two."""
    share: NDArray[np.uint16] | None
    """(h, w) of the second level."""
    number: NDArray[np.int32] | None = None
    """(h, w) of the surface, if it is wanted; -1: nothing."""


class Renderer:
    """Pictures of one camera in one scene."""

    def __init__(
        self,
        model: CameraModel,
        surfaces: Surfaces,
        atlas: Atlas,
        scale: int,
        trilinear: bool = False,
        crowd: Crowd | None = None,
    ) -> None:
        """Set up the rays.

        :param scale: rays along each side of a pixel.
        :param trilinear: look at two mip levels.
        :param crowd: bodies that move; their textures follow those of the surfaces.
        """
        self._trilinear, self.crowd = trilinear, crowd
        self.surfaces, self.atlas = surfaces, atlas
        self._first = [len(surfaces.origin)]
        for where in crowd.surfaces if crowd else ():
            self._first.append(self._first[-1] + len(where.origin))
        self._rays = PixelRays(model, scale)
        self.rows = self._rays.row_places
        """Row of the image of each row of rays."""
        self.bands = self._rays.bands
        self._corners_of_cells, self._probes = corners_and_probes(self._rays)
        self._units, self._cell_angle = _units(self._corners_of_cells.rays)
        self._cone, self._longest_ray = self._cone_of_rays()

    def pictures(self, poses: Poses, bodies: Sequence[Poses] = ()) -> Iterator[tuple[slice, Bytes]]:
        """Yield what one pose sees, or one pose for each row of rays, a band at a time.

        :param bodies: the same poses in the axes of each body.
        :returns: rows of the image, and the values (h, w[, 3]) of all their rays.
        """
        for rows, maps in self.maps(poses, bodies):
            yield rows, look_up(self.atlas.image, maps)

    def maps(self, poses: Poses, bodies: Sequence[Poses] = ()) -> Iterator[tuple[slice, Maps]]:
        """Yield the look-up for one pose, or one pose for each row of rays, a band at a time.

        :param bodies: as for :meth:`pictures`.
        :returns: rows of the image, and the maps (h, w) of all their rays.
        """
        cv2 = opencv()
        visible = self._with_bodies(self._visible(poses), bodies)
        scale = self._rays.scale
        for number, band in enumerate(self.bands):
            rows = self._rays.rows(band)
            drawn = self._drawn(visible, band, self._rays.of_band(number))
            # The nearest steps of 1/32 texel, of two the even one.
            fixed = [cv2.convertMaps(x, y, cv2.CV_16SC2) for x, y in drawn.places]
            fine, *coarse = (Maps(*each) for each in fixed)
            image = slice(rows.start // scale, rows.stop // scale)
            yield image, fine._replace(coarse=coarse[0] if coarse else None, share=drawn.share)

    def depth(self, poses: Poses, bodies: Sequence[Poses] = ()) -> Single:
        """Return the distance along the axis (h, w) [m] of what each pixel sees; 0: nothing."""
        visible = self._with_bodies(self._visible(poses), bodies)
        bands = enumerate(self.bands)
        return np.concatenate(
            [_depth(self._drawn(visible, band, self._rays.of_band(k))) for k, band in bands]
        )

    def depth_and_mask(self, poses: Poses, bodies: Sequence[Poses]) -> tuple[Single, Bytes]:
        """Return :meth:`depth`, and which body each pixel sees (h, w): 1, 2, ...; 0: none.

        :param bodies: as for :meth:`pictures`.
        """
        visible = self._with_bodies(self._visible(poses), bodies)
        depth, numbers = [], []
        for k, band in enumerate(self.bands):
            number = np.full(self._rays.of_band(k).shape[1:], -1, np.int32)
            depth.append(_depth(self._drawn(visible, band, self._rays.of_band(k), number)))
            numbers.append(number)
        mask = np.searchsorted(self._first, np.concatenate(numbers), side="right")
        return np.concatenate(depth), mask.astype(np.uint8)

    def _visible(self, poses: Poses) -> _Visible:
        """Return the surfaces that may be in the image, and where."""
        position, r_wc = rounded(poses)
        facing = _facing(self.surfaces, position)
        # A surface is not seen where all its corners lie beyond one side of the cone of all rays.
        if len(position) == 1 and self._cone is not None:
            corners = self._corners(facing) - position[0]
            beyond = (np.matmul(np.matmul(corners, r_wc[0]), self._cone) > 0.0).all(axis=1)
            inside = ~beyond.any(axis=1)
            facing, corners = facing[inside], corners[inside]
            if len(facing) > _MANY:
                facing = self._nearest_first(facing[~covered_by_another(corners)], position[0])
        planes = Planes.of(self.surfaces, facing, position, r_wc)
        cells = covered(planes, self._corners_of_cells)
        largest = np.full(len(facing), np.inf)
        if len(position) == 1:
            distance = distances(self.surfaces, facing, position[0])
            largest = self._longest_ray * (1.0 + _BEHIND) / np.maximum(distance, 1e-9)
        places = {m: (rows, columns) for m, rows, columns in regions(cells)}
        return _Visible(planes, cells, facing, largest, places, {})

    def _with_bodies(self, rest: _Visible, bodies: Sequence[Poses]) -> _Visible:
        """Return what may be in the image with the bodies that may, the nearest first if known."""
        found = [
            seen for k, poses in enumerate(bodies) if (seen := self._of_body(k, poses)) is not None
        ]
        if not found:
            return rest
        every = [*found, rest]
        largest = np.concatenate([seen.largest for seen in every])
        order = np.arange(len(largest))
        if (rest.largest[1:] <= rest.largest[:-1]).all():  # the rest begins with the nearest, too
            order = np.argsort(-largest, kind="stable")
        cells, numbers = (
            np.concatenate([getattr(seen, name) for seen in every])[order]
            for name in ("cells", "numbers")
        )
        planes = Planes(
            np.concatenate([seen.planes.vectors for seen in every])[order],
            np.concatenate([seen.planes.start for seen in every])[order],
        )
        places = {m: (rows, columns) for m, rows, columns in regions(cells)}
        return _Visible(planes, cells, numbers, largest[order], places, {})

    def _of_body(self, number: int, poses: Poses) -> _Visible | None:
        """Return what may be seen of a body; None: it is not in the image."""
        assert self.crowd is not None
        where, (middle, radius) = self.crowd.surfaces[number], self.crowd.balls[number]
        position, r_wc = rounded(poses)
        region = self._region(((middle - position)[:, :, None] * r_wc).sum(axis=1), radius)
        if region is None:
            return None
        facing = _facing(where, position)
        planes = Planes.of(where, facing, position, r_wc)
        a, b = (length - 1 for length in self._units.shape[1:])
        cells = np.zeros((len(facing), a, b), np.bool_)
        cells[:, region[0], region[1]] = covered(planes, self._corners_of_cells.part(*region))
        largest = np.full(len(facing), np.inf)
        if len(position) == 1:
            distance = distances(where, facing, position[0])
            largest = self._longest_ray * (1.0 + _BEHIND) / np.maximum(distance, 1e-9)
        return _Visible(planes, cells, facing + self._first[number], largest, {}, {})

    def _region(self, middle: Array, radius: float) -> tuple[slice, slice] | None:
        """Return rows and columns of the cells in which a ball may be seen; None: in none.

        :param middle: (n, 3) in the camera's frame, for one pose or for one each row of rays.
        """
        rows = self._corners_of_cells.rows if len(middle) > 1 else np.zeros(1, np.int64)
        x, y, z = middle[rows].T[..., None]
        away = np.sqrt(x * x + y * y + z * z)
        sine = np.minimum(radius / np.maximum(away, 1e-9), 1.0)
        near = np.minimum(np.arcsin(sine) + self._cell_angle, math.pi)
        along = self._units[0] * x + self._units[1] * y + self._units[2] * z
        seen = (along >= away * np.cos(near)) | (away <= radius)
        if not seen.any():
            return None
        ranges = []
        for axis, length in ((1, seen.shape[0] - 1), (0, seen.shape[1] - 1)):
            places = np.flatnonzero(seen.any(axis=axis))
            first = max(int(places[0]) - 1, 0)
            ranges.append(slice(min(first, length - 1), min(int(places[-1]) + 1, length)))
        return ranges[0], ranges[1]

    def _nearest_first(self, numbers: Integers, eye: Array) -> Integers:
        """Return surfaces by their distance: who comes first hides who comes later."""
        return numbers[np.argsort(distances(self.surfaces, numbers, eye), kind="stable")]

    def _levels(self, visible: _Visible, m: int) -> Levels:
        """Return the mip levels of a surface in all cells where it may be."""
        if m not in visible.levels:
            rows, columns = visible.places[m]
            probes = self._probes.part(rows, columns)
            _, _, places = visible.planes.meet(m, probes.rays, probes.rows)
            corner, number = (rows.start, columns.start), int(visible.numbers[m])
            visible.levels[m] = levels(places, self.atlas, number, self._trilinear, corner)
        return visible.levels[m]

    def _cone_of_rays(self) -> tuple[Array | None, float]:
        """Return the normals (3, 4) of planes through the camera that have all rays on one side.

        None if a ray looks sideways or backwards. And the length of the longest ray.
        """
        bounds, lengths, ahead = [np.full(4, -np.inf)], [0.0], True
        for number in range(len(self.bands)):
            rays = self._rays.of_band(number)
            lengths.append(float((rays * rays).sum(axis=0).max()) ** 0.5)
            x, y, z = rays[:, rays.any(axis=0)].astype(np.float64)
            if not len(z):
                continue
            ahead &= bool(z.min() > _SIDEWAYS)
            if ahead:
                u, v = x / z, y / z
                bounds.append(np.array([u.max(), -u.min(), v.max(), -v.min()]))
        if not ahead or len(bounds) == 1:
            return None, max(lengths)
        right, left, below, above = np.max(bounds, axis=0) + _SLACK
        cone = np.array(
            [[1.0, -1.0, 0.0, 0.0], [0.0, 0.0, 1.0, -1.0], [-right, -left, -below, -above]]
        )
        return cone, max(lengths)

    def _corners(self, surfaces: NDArray[np.int64]) -> Array:
        """Return the corners (n, 4, 3) of surfaces."""
        o, a, b = (part[surfaces] for part in self.surfaces[:3])
        return np.stack([o, o + a, o + b, o + a + b], axis=1)

    def _drawn(
        self,
        visible: _Visible,
        band: slice,
        rays: Single,
        number: NDArray[np.int32] | None = None,
    ) -> _Band:
        """Return what a band of cells sees.

        :param rays: (3, h, w) of the band.
        :param number: (h, w) that gets the number of the surface that each ray meets.
        """
        shape = rays.shape[1:]
        count = 1 + self._trilinear
        background = [np.ones((2, *shape), np.float32) for _ in range(count)]  # the atlas' corner
        share = np.zeros(shape, np.uint16) if self._trilinear else None
        nearest = np.zeros(shape, np.float32)
        drawn = _Band(band.start, rays, nearest, background, share, number)
        for m, cells, columns in regions(visible.cells[:, band]):
            self._draw(visible, m, cells, columns, drawn)
        return drawn

    def _draw(self, visible: _Visible, m: int, cells: slice, across: slice, drawn: _Band) -> None:
        """Put a surface where it is nearer than what was drawn before.

        :param cells: rows of cells of the band.
        :param across: columns of cells.
        """
        _, height, width = drawn.rays.shape
        below, columns = in_cells(cells, height), in_cells(across, width)
        here = below, columns
        nearest = drawn.nearest[here]
        if nearest.min() >= visible.largest[m]:
            return
        top = drawn.first * CELL
        rows = slice(top + below.start, top + below.stop)
        in_front, inverse, places = visible.planes.meet(m, drawn.rays[:, below, columns], rows)
        shown = inverse > nearest
        shown &= in_front
        shown &= within(places)
        if not shown.any():
            return
        np.copyto(nearest, inverse, where=shown)
        if drawn.number is not None:
            drawn.number[here][shown] = visible.numbers[m]
        of_image = slice(drawn.first + cells.start, drawn.first + cells.stop)
        found = self._levels(visible, m).part(of_image, across)
        if found.share is not None and drawn.share is not None:
            np.copyto(drawn.share[here], in_pixels(found.share, *shown.shape), where=shown)
        for level, target in zip(found.each, drawn.places, strict=True):
            np.copyto(target[:, below, columns], in_atlas(places, level), where=shown)


def rounded(poses: Poses) -> tuple[Array, Array]:
    """Return positions (n, 3) and rotations R_wc (n, 3, 3) without the last bits of a sine."""
    position = np.round(poses.position * _GRID) / _GRID
    r_wc = np.round(rotation.to_matrix(poses.q_wc) * _GRID) / _GRID
    return position, r_wc


def _depth(drawn: _Band) -> Single:
    """Return the distance along the axis (h, w) [m] of what a band sees; 0: nothing."""
    nearest = drawn.nearest
    safe = np.where(nearest > 0.0, nearest, np.float32(1.0))
    return np.where(nearest > 0.0, drawn.rays[2] / safe, np.float32(0.0))


def _facing(s: Surfaces, position: Array) -> Integers:
    """Return the surfaces whose front is seen from one of some places (n, 3)."""
    offset = position[:, None] - s.origin
    front = ((offset * s.normal).sum(axis=2) > 0.0).any(axis=0)
    return np.flatnonzero(front | (np.array(s.texture) == "plane"))


def _units(rays: Single) -> tuple[Single, float]:
    """Return unit vectors along rays (3, a, b), and the largest angle across a cell [rad]."""
    length = np.sqrt((rays * rays).sum(axis=0))
    units = rays / np.maximum(length, np.float32(1e-9))
    across = (units[:, :-1, :-1] * units[:, 1:, 1:]).sum(axis=0)
    other = (units[:, :-1, 1:] * units[:, 1:, :-1]).sum(axis=0)
    seen = (length[:-1, :-1] > 0) & (length[1:, 1:] > 0) & (length[:-1, 1:] > 0)
    least = np.minimum(across, other)[seen]
    angle = math.acos(max(-1.0, min(1.0, float(least.min())))) if least.size else math.pi
    return units, angle + 1e-3


def distances(surfaces: Surfaces, numbers: Integers, eye: Array) -> Array:
    """Return how far some rectangles (m,) are from a place (3,) at their nearest [m]."""
    offset = eye - surfaces.origin[numbers]
    rest = offset
    for side in (surfaces.across[numbers], surfaces.up[numbers]):
        share = (offset * side).sum(axis=1) / (side * side).sum(axis=1)
        rest = rest - np.clip(share, 0.0, 1.0)[:, None] * side
    return np.asarray(np.sqrt((rest * rest).sum(axis=1)))


def covered_by_another(corners: Array) -> Mask:
    """Tell which rectangles are behind a single other one, as a whole.

    :param corners: (m, 4, 3) of each, from the eye: the origin and its ends across, up and both.
    """
    around = corners[:, [0, 1, 3, 2]]
    normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    distance = np.abs((normals * corners[:, 0]).sum(axis=1))
    middle = corners.mean(axis=1)
    size = (
        distance / np.maximum((middle * middle).sum(axis=1), 1e-6) ** 1.5
    )  # about its solid angle
    largest = np.argsort(-size, kind="stable")[:_OCCLUDERS]
    near = around[largest]
    sides = np.cross(near, np.roll(near, -1, axis=1))  # planes through the eye and an edge
    lengths = np.sqrt((sides * sides).sum(axis=2, keepdims=True))
    sides /= np.maximum(lengths, 1e-12)
    inwards = np.sign((sides * middle[largest, None]).sum(axis=2, keepdims=True))
    plane = normals[largest] / np.maximum(distance[largest, None], 1e-12)
    plane *= np.sign((plane * near[:, 0]).sum(axis=1, keepdims=True))
    beyond = np.tensordot(plane, corners, (1, 2)) > 1.0 + _BEHIND
    within = np.tensordot(sides * inwards, corners, (2, 2)) > _BEHIND
    hidden = np.asarray((beyond & within.all(axis=1)).all(axis=2))
    return np.asarray(hidden.any(axis=0))


def look_up(atlas: Bytes, maps: Maps) -> Bytes:
    """Return the picture (h, w[, 3]): bilinear in integers, ``(sum w_i a_i + 2^14) >> 15``.

    Of two levels: ``((256 - share) fine + share coarse + 128) >> 8``.
    """
    cv2 = opencv()
    picture: Bytes = cv2.remap(
        atlas, maps.whole, maps.part, cv2.INTER_LINEAR, borderMode=cv2.BORDER_REPLICATE
    )
    if maps.coarse is None or maps.share is None:
        return picture
    share = maps.share.reshape(*maps.share.shape, *(1,) * (picture.ndim - 2))
    total = picture * (SHARES - share)
    total += look_up(atlas, maps.coarse) * share
    total += SHARES // 2
    total >>= 8
    return total.astype(np.uint8)


def opencv() -> Any:
    """Return OpenCV's module.

    :raises MissingDependencyError: if it is not installed.
    """
    try:
        os.environ.setdefault("OPENCV_LOG_LEVEL", "OFF")  # what it logs goes to standard error
        import cv2
    except ImportError as error:
        raise MissingDependencyError(
            f"images need OpenCV ({error}): apt install python3-opencv, or pip install "
            "opencv-python-headless"
        ) from None
    return cv2
