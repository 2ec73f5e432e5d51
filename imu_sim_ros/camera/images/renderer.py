# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Pictures of textured rectangles: each pixel's ray meets the nearest surface, one look-up each.

Along a ray ``c + t d`` a rectangle ``o + s a + r b`` with normal n is met at

    1 / t = (n d) / (n (o - c)),   s = ((c - o) a + t (d a)) / a^2,   r likewise with b.

Nothing but +, -, *, / and comparisons of float32 acts on whole arrays, and NumPy does these without
fusing, so results do not depend on the processor. The look-up has integer coordinates in steps of
1/32 texel: OpenCV's remap with fixed-point maps does it exactly, in every version.
"""

from typing import Any, Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from imu_sim_ros import rotation
from imu_sim_ros.camera.images.texture import LEVELS, Atlas
from imu_sim_ros.camera.model import CameraModel
from imu_sim_ros.camera.scene import Surfaces
from imu_sim_ros.camera.view import Poses
from imu_sim_ros.errors import MissingDependencyError

Single = NDArray[np.float32]
Array = NDArray[np.float64]
Bytes = NDArray[np.uint8]

CELL: Final = 8
"""Pixels along which the mip level is constant, in both directions."""
_FRACTION: Final = 32
"""Steps of a texel in the look-up, OpenCV's INTER_TAB_SIZE."""
_GRID: Final = 2.0**30
"""Poses are rounded to steps of 1e-9, so that the last bits of a sine decide nothing."""
_EDGE_POINTS: Final = 48
_BAND: Final = 48
"""Rows of rays that are processed at once."""


class Maps(NamedTuple):
    """Where in the atlas each pixel looks, in fixed point."""

    whole: NDArray[np.int16]
    """(h, w, 2) column and row."""
    part: NDArray[np.uint16]
    """(h, w) 32 * fraction of the row + fraction of the column, in 1/32."""


class _Region(NamedTuple):
    rows: slice
    columns: slice


class Renderer:
    """Pictures of one camera in one scene; ``scale`` rays along each side of a pixel."""

    def __init__(self, model: CameraModel, surfaces: Surfaces, atlas: Atlas, scale: int) -> None:
        self.model, self.surfaces, self.atlas, self.scale = model, surfaces, atlas, scale
        self.height, self.width = model.height * scale, model.width * scale
        rows = (np.arange(self.height) + 0.5) / scale - 0.5
        columns = (np.arange(self.width) + 0.5) / scale - 0.5
        grid = np.stack(np.meshgrid(columns, rows), axis=-1).reshape(-1, 2)
        rays = model.unproject(grid)
        # A pixel without a direction looks backwards through nothing.
        direction = np.where(rays.valid[:, None], rays.direction, 0.0).astype(np.float32)
        self._rays = np.ascontiguousarray(direction.T.reshape(3, self.height, self.width))
        self._coarse = np.ascontiguousarray(self._rays[:, ::CELL, ::CELL])
        self._cone = _cone(direction)
        self.rows = rows
        """Row of the image of each row of rays."""

    def maps(self, poses: Poses) -> Maps:
        """Return the look-up for one pose, or one pose for each row of rays."""
        whole = np.empty((self.height, self.width, 2), np.int16)
        part = np.empty((self.height, self.width), np.uint16)
        visible = self._visible(poses)
        for band in self._bands():
            x, y, _ = self._drawn(visible, band)
            _fix(x, y, whole[band], part[band])
        return Maps(whole, part)

    def depth(self, poses: Poses) -> Single:
        """Return the distance along the axis (h, w) [m] of what each pixel sees; 0: nothing."""
        visible = self._visible(poses)
        nearest = np.concatenate([self._drawn(visible, band)[2] for band in self._bands()])
        safe = np.where(nearest > 0.0, nearest, np.float32(1.0))
        result: Single = np.where(nearest > 0.0, self._rays[2] / safe, np.float32(0.0))
        return result

    def _bands(self) -> list[slice]:
        """Return the image in pieces of a few rows, whose arrays stay in a processor's cache."""
        return [slice(k, min(k + _BAND, self.height)) for k in range(0, self.height, _BAND)]

    def _visible(self, poses: Poses) -> list[tuple[int, "_Plane", _Region]]:
        """Return the surfaces that may be in the image, and where."""
        position = np.round(poses.position * _GRID) / _GRID
        r_wc = np.round(rotation.to_matrix(poses.q_wc) * _GRID) / _GRID
        found = []
        facing = self._facing(position)
        # A surface is not seen where all its corners lie beyond one side of the cone of all rays.
        if len(position) == 1 and self._cone is not None:
            corners = self._corners(facing) - position[0]
            beyond = (np.matmul(np.matmul(corners, r_wc[0]), self._cone) > 0.0).all(axis=1)
            facing = facing[~beyond.any(axis=1)]
        for m in facing.tolist():
            plane = _Plane.of(self.surfaces, m, position, r_wc)
            region = self._region(plane, m, poses)
            if region is not None:
                found.append((m, plane, region))
        return found

    def _corners(self, surfaces: NDArray[np.int64]) -> Array:
        """Return the corners (n, 4, 3) of surfaces."""
        o, a, b = (part[surfaces] for part in self.surfaces[:3])
        return np.stack([o, o + a, o + b, o + a + b], axis=1)

    def _facing(self, position: Array) -> NDArray[np.int64]:
        """Return the surfaces whose front is seen from one of some places (n, 3)."""
        s = self.surfaces
        offset = position[:, None] - s.origin
        front = ((offset * s.normal).sum(axis=2) > 0.0).any(axis=0)
        return np.flatnonzero(front | (np.array(s.texture) == "plane"))

    def _drawn(
        self, visible: list[tuple[int, "_Plane", _Region]], band: slice
    ) -> tuple[Single, Single, Single]:
        """Return column and row in the atlas, and the inverse distance, of a band of rays."""
        shape = (band.stop - band.start, self.width)
        nearest = np.zeros(shape, np.float32)
        x, y = np.ones(shape, np.float32), np.ones(shape, np.float32)  # the background's corner
        for m, plane, region in visible:
            first = max(region.rows.start, band.start)
            last = min(region.rows.stop, band.stop)
            if first < last:
                rows = slice(first, last)
                here = (slice(first - band.start, last - band.start), region.columns)
                self._draw(plane, m, _Region(rows, region.columns), nearest[here], x[here], y[here])
        return x, y, nearest

    def _region(self, plane: "_Plane", m: int, poses: Poses) -> _Region | None:
        """Return a part of the image outside which the surface cannot be seen.

        Every eighth ray finds its inside, points along its edges what lies between them.
        """
        hit, _, _ = plane.at_rows(slice(0, None, CELL)).meet(self._coarse)
        rows, columns = np.nonzero(hit > 0.0)
        found = [np.stack([columns, rows], axis=1) * CELL]
        edge = np.linspace(0.0, 1.0, _EDGE_POINTS)[:, None]
        o, a, b = (part[m] for part in self.surfaces[:3])
        outline = np.concatenate([o + edge * a, o + edge * b, o + a + edge * b, o + b + edge * a])
        for k in {0, len(poses.position) - 1}:
            local = rotation.rotate_inverse(poses.q_wc[k], outline - poses.position[k])
            uv, valid = self.model.project(local)
            valid &= self.model.inside(uv, -CELL)
            found.append(np.rint((uv[valid] + 0.5) * self.scale - 0.5).astype(np.int64))
        places = np.concatenate(found)
        if not len(places):
            return None
        margin = 2 * CELL * self.scale
        low = (np.maximum(places.min(axis=0) - margin, 0) // CELL) * CELL
        high = places.max(axis=0) + margin
        return _Region(
            slice(int(low[1]), int(min(high[1], self.height))),
            slice(int(low[0]), int(min(high[0], self.width))),
        )

    def _draw(
        self, plane: "_Plane", m: int, region: _Region, nearest: Single, x: Single, y: Single
    ) -> None:
        """Put a surface where it is nearer than what was drawn before."""
        rays = self._rays[:, region.rows, region.columns]
        inverse, u, v = plane.at_rows(region.rows).meet(rays)
        shown = inverse > nearest
        if not shown.any():
            return
        columns, rows = self.atlas.size[m]
        u *= columns
        v *= rows
        scale, shift = self._levels(u, v, m)
        np.copyto(nearest, inverse, where=shown)
        u *= scale
        u += shift[0]
        v *= scale
        v += shift[1]
        np.copyto(x, u, where=shown)
        np.copyto(y, v, where=shown)

    def _levels(self, u: Single, v: Single, m: int) -> tuple[Single, list[Single]]:
        """Return the scale, and the shifts of column and row, of each pixel's mip level.

        The level is that at which a step of one pixel is about one texel, in each cell of
        CELL x CELL pixels that of the larger of the steps along its first row and column.
        """
        height, width = u.shape
        i = np.minimum(np.arange(0, height, CELL) + CELL // 2, height - 2)[:, None]
        j = np.minimum(np.arange(0, width, CELL) + CELL // 2, width - 2)
        i, j = np.maximum(i, 0), np.maximum(j, 0)
        below, right = np.minimum(i + 1, height - 1), np.minimum(j + 1, width - 1)
        squares = [
            (u[a, b] - u[i, j]) ** 2 + (v[a, b] - v[i, j]) ** 2 for a, b in ((i, right), (below, j))
        ]
        step = np.maximum(*squares)
        thresholds = np.float32(2.0) ** np.arange(1, 2 * LEVELS - 1, 2, dtype=np.float32)
        level = np.searchsorted(thresholds, step.ravel()).reshape(step.shape)
        factor = np.float32(0.5) ** level.astype(np.float32)
        place = self.atlas.place[m]
        # Texel k of a level covers k to k + 1 in its own units; a look-up at k is its centre.
        small = [factor, place[level, 0] - np.float32(0.5), place[level, 1] - np.float32(0.5)]
        large = [_enlarged(part, height, width) for part in small]
        return large[0], large[1:]


def _enlarged(cells: Single, height: int, width: int) -> Single:
    result: Single = cells.repeat(CELL, axis=0)[:height].repeat(CELL, axis=1)[:, :width]
    return result


def _cone(directions: NDArray[Any]) -> Array | None:
    """Return the normals (3, 4) of planes through the camera that have all rays on one side.

    :param directions: (n, 3), zero where there is none.
    :returns: None where a ray looks sideways or backwards.
    """
    x, y, z = directions[directions.any(axis=1)].astype(np.float64).T
    if not len(z) or z.min() <= 0.05:
        return None
    u, v = x / z, y / z
    slack = 1e-3
    normals = np.array(
        [
            [1.0, 0.0, -(u.max() + slack)],
            [-1.0, 0.0, u.min() - slack],
            [0.0, 1.0, -(v.max() + slack)],
            [0.0, -1.0, v.min() - slack],
        ]
    )
    result: Array = normals.transpose()
    return result


class _Plane(NamedTuple):
    """A rectangle in the camera's frame, for one pose or one for each row of rays."""

    normal: list[Single]
    across: list[Single]
    up: list[Single]
    start: tuple[Single, Single]
    """s and r of the camera's own place."""

    @classmethod
    def of(cls, surfaces: Surfaces, m: int, position: Array, r_wc: Array) -> "_Plane":
        """Return a surface as poses (n, 3), (n, 3, 3) see it."""
        o, a, b = surfaces.origin[m], surfaces.across[m], surfaces.up[m]
        n = surfaces.normal[m]
        distance = ((o - position) * n).sum(axis=1)
        safe = np.where(distance == 0.0, 1e-12, distance)
        a, b = a / (a * a).sum(), b / (b * b).sum()
        parts = [
            [_single((r_wc[:, :, k] * vector).sum(axis=1)) for k in range(3)]
            for vector in (n / safe[:, None], a, b)
        ]
        start = [_single(((position - o) * side).sum(axis=1)) for side in (a, b)]
        return cls(parts[0], parts[1], parts[2], (start[0], start[1]))

    def at_rows(self, rows: slice) -> "_Plane":
        """Return the part for some rows of rays; one pose stands for all."""

        def part(values: Single) -> Single:
            return values[rows] if len(values) > 1 else values

        return _Plane(
            [part(v) for v in self.normal],
            [part(v) for v in self.across],
            [part(v) for v in self.up],
            (part(self.start[0]), part(self.start[1])),
        )

    def meet(self, rays: Single) -> tuple[Single, Single, Single]:
        """Return 1 / t, s and r (h, w) of rays (3, h, w); 1 / t is 0 beside the rectangle."""
        inverse = _dot(self.normal, rays)
        ahead = inverse > np.float32(1e-6)
        t = np.float32(1.0) / np.where(ahead, inverse, np.float32(1.0))
        s = _dot(self.across, rays)
        s *= t
        s += self.start[0]
        r = _dot(self.up, rays)
        r *= t
        r += self.start[1]
        ahead &= s >= 0.0
        ahead &= s <= 1.0
        ahead &= r >= 0.0
        ahead &= r <= 1.0
        inverse *= ahead
        return inverse, s, r


def _single(values: Array) -> Single:
    """Return numbers (n,) as a column (n, 1) of float32."""
    return values.astype(np.float32)[:, None]


def _dot(vector: list[Single], rays: Single) -> Single:
    result = vector[0] * rays[0]
    result += vector[1] * rays[1]
    result += vector[2] * rays[2]
    return np.asarray(result)


def _fix(x: Single, y: Single, whole: NDArray[np.int16], part: NDArray[np.uint16]) -> None:
    """Fill a look-up with coordinates in the atlas in steps of 1/32 texel, the nearest ones."""
    x *= np.float32(_FRACTION)
    y *= np.float32(_FRACTION)
    column = np.rint(x, out=x).astype(np.int32)
    row = np.rint(y, out=y).astype(np.int32)
    whole[..., 0] = column >> 5
    whole[..., 1] = row >> 5
    column &= 31
    row &= 31
    row <<= 5
    row |= column
    part[...] = row


def look_up(atlas: Bytes, maps: Maps) -> Bytes:
    """Return the picture (h, w): bilinear in integers, ``(sum w_i a_i + 2^14) >> 15``."""
    cv2 = opencv()
    picture: Bytes = cv2.remap(
        atlas, maps.whole, maps.part, cv2.INTER_LINEAR, borderMode=cv2.BORDER_REPLICATE
    )
    return picture


def opencv() -> Any:
    """Return OpenCV's module.

    :raises MissingDependencyError: where it is not installed.
    """
    try:
        import cv2
    except ImportError as error:
        raise MissingDependencyError(
            f"images need OpenCV ({error}): apt install python3-opencv, or pip install "
            "opencv-python-headless"
        ) from None
    return cv2
