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
from imu_sim_ros.camera.images.mip import CELL, SHARES, levels
from imu_sim_ros.camera.images.plane import Plane
from imu_sim_ros.camera.images.texture import Atlas
from imu_sim_ros.camera.model import CameraModel
from imu_sim_ros.camera.scene import Surfaces
from imu_sim_ros.camera.view import Poses
from imu_sim_ros.errors import MissingDependencyError

Single = NDArray[np.float32]
Array = NDArray[np.float64]
Bytes = NDArray[np.uint8]

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
    coarse: "Maps | None" = None
    """The same in the next level, where there are two."""
    share: NDArray[np.uint16] | None = None
    """(h, w) what the coarse level contributes, in 1/256."""


class _Region(NamedTuple):
    rows: slice
    columns: slice


class _Drawn(NamedTuple):
    """What a band of rays sees so far."""

    nearest: Single
    """(h, w) inverse distance."""
    places: list[tuple[Single, Single]]
    """Column and row (h, w) in the atlas, of one level or of two."""
    share: NDArray[np.uint16] | None
    """(h, w) of the second level."""

    def part(self, rows: slice, columns: slice) -> "_Drawn":
        """Return the same for a part of the band, to draw into."""
        share = None if self.share is None else self.share[rows, columns]
        places = [(x[rows, columns], y[rows, columns]) for x, y in self.places]
        return _Drawn(self.nearest[rows, columns], places, share)


class Renderer:
    """Pictures of one camera in one scene."""

    def __init__(
        self,
        model: CameraModel,
        surfaces: Surfaces,
        atlas: Atlas,
        scale: int,
        trilinear: bool = False,
    ) -> None:
        """Set up the rays.

        :param scale: rays along each side of a pixel.
        :param trilinear: look at two mip levels.
        """
        self._trilinear = trilinear
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
        shape = (self.height, self.width)
        fixed = [
            (np.empty((*shape, 2), np.int16), np.empty(shape, np.uint16))
            for _ in range(1 + self._trilinear)
        ]
        share = np.empty(shape, np.uint16) if self._trilinear else None
        visible = self._visible(poses)
        for band in self._bands():
            drawn = self._drawn(visible, band)
            for (x, y), (whole, part) in zip(drawn.places, fixed, strict=True):
                _fix(x, y, whole[band], part[band])
            if share is not None and drawn.share is not None:
                share[band] = drawn.share
        coarse = Maps(*fixed[1]) if self._trilinear else None
        return Maps(*fixed[0], coarse, share)

    def depth(self, poses: Poses) -> Single:
        """Return the distance along the axis (h, w) [m] of what each pixel sees; 0: nothing."""
        visible = self._visible(poses)
        nearest = np.concatenate([self._drawn(visible, band).nearest for band in self._bands()])
        safe = np.where(nearest > 0.0, nearest, np.float32(1.0))
        result: Single = np.where(nearest > 0.0, self._rays[2] / safe, np.float32(0.0))
        return result

    def _bands(self) -> list[slice]:
        """Return the image in pieces of a few rows, whose arrays stay in a processor's cache."""
        return [slice(k, min(k + _BAND, self.height)) for k in range(0, self.height, _BAND)]

    def _visible(self, poses: Poses) -> list[tuple[int, Plane, _Region]]:
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
            plane = Plane.of(self.surfaces, m, position, r_wc)
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

    def _drawn(self, visible: list[tuple[int, Plane, _Region]], band: slice) -> _Drawn:
        """Return what a band of rays sees."""
        shape = (band.stop - band.start, self.width)
        background = [
            (np.ones(shape, np.float32), np.ones(shape, np.float32))  # its corner of the atlas
            for _ in range(1 + self._trilinear)
        ]
        share = np.zeros(shape, np.uint16) if self._trilinear else None
        drawn = _Drawn(np.zeros(shape, np.float32), background, share)
        for m, plane, region in visible:
            first = max(region.rows.start, band.start)
            last = min(region.rows.stop, band.stop)
            if first < last:
                rows = slice(first, last)
                here = drawn.part(slice(first - band.start, last - band.start), region.columns)
                self._draw(plane, m, _Region(rows, region.columns), here)
        return drawn

    def _region(self, plane: Plane, m: int, poses: Poses) -> _Region | None:
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

    def _draw(self, plane: Plane, m: int, region: _Region, drawn: _Drawn) -> None:
        """Put a surface where it is nearer than what was drawn before."""
        rays = self._rays[:, region.rows, region.columns]
        inverse, u, v = plane.at_rows(region.rows).meet(rays)
        shown = inverse > drawn.nearest
        if not shown.any():
            return
        columns, rows = self.atlas.size[m]
        u *= columns
        v *= rows
        found, share = levels(u, v, self.atlas, m, self._trilinear)
        np.copyto(drawn.nearest, inverse, where=shown)
        if share is not None and drawn.share is not None:
            np.copyto(drawn.share, share, where=shown)
        for level, (x, y) in zip(found, drawn.places, strict=True):
            np.copyto(x, u * level.scale + level.column, where=shown)
            np.copyto(y, v * level.scale + level.row, where=shown)


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
