# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Optical flow: from each pixel to the pixel of the same surface point in the next image.

The depth of a pixel gives the surface point in the world, or in the axes of the body that it
belongs to; from there it is projected into the next image. With a rolling shutter each row has its
own time, in the next image as well: the row v of a point solves v = v(point, t(v)).
"""

from collections.abc import Callable
from functools import partial
from typing import Final, Protocol

import numpy as np
from numpy.typing import NDArray

from imu_sim_ros.core import rotation
from imu_sim_ros.core.types import Array, Bytes, Integers, Mask, Single
from imu_sim_ros.sensors.camera.model import CameraModel
from imu_sim_ros.sensors.camera.view import CameraPoses, Eyes

_ROUNDS: Final = 12
"""Largest number of steps of the search for a row."""
_CLOSE: Final = 1e-6
"""Change of a row below which the search has converged [px]."""
_FOUND: Final = 1e-3
"""Change of a row after the last step from which on a point has no flow [px]."""
_BEHIND: Final = 0.005
"""Depth of a point over that of the visible surface, minus 1, from which on it is hidden."""
_KITTI: Final = 64.0
"""Steps of KITTI's 16-bit flow in a pixel."""
_KITTI_ZERO: Final = 1 << 15
"""Value of KITTI's 16-bit flow for no motion."""


def flow(
    model: CameraModel,
    image: tuple[Single, Bytes | None],
    next_image: tuple[Single, Bytes | None],
    eyes: Callable[[int], Callable[[Array], Eyes]],
) -> Single:
    """Return the steps (h, w, 2) in u and v [px] from each pixel's centre to the next image.

    NaN for pixels without a surface, and for points outside the next image or hidden there.

    :param image: depth (h, w) [m] and mask (h, w) of the image.
    :param next_image: depth and mask of the next image.
    :param eyes: returns the poses of rows of the image (0) or of the next one (1), as a function.
    """
    depth, mask = image
    height, width = depth.shape
    result = np.full((height * width, 2), np.nan, np.float32)
    everywhere = np.flatnonzero(depth.reshape(-1) > 0.0)
    bodies = np.zeros(len(everywhere), np.uint8)
    if mask is not None:
        bodies = mask.reshape(-1)[everywhere]
    current, following = (_row_poses(eyes(k), height) for k in (0, 1))
    for body in np.unique(bodies):
        pixel = everywhere[bodies == body]
        row, column = np.divmod(pixel, width)
        uv = np.stack([column, row], axis=1).astype(np.float64)
        ray = model.unproject(uv).direction
        local = ray * (depth.reshape(-1)[pixel].astype(np.float64) / ray[:, 2])[:, None]
        pose = current(uv[:, 1], int(body))
        point = pose.position + rotation.rotate(pose.q_wc, local)
        uv_next, away, valid = _project(model, point, uv[:, 1], partial(following, body=int(body)))
        valid &= ~_is_hidden(uv_next, away, valid, int(body), next_image)
        result[pixel[valid]] = (uv_next - uv)[valid]
    return result.reshape(height, width, 2)


class _Poses(Protocol):
    """Poses of a camera at rows (n,), in the world (0) or in the axes of a body (1, ...)."""

    def __call__(self, v: Array, body: int) -> CameraPoses:
        """Return one pose, or n."""


def _row_poses(eyes: Callable[[Array], Eyes], height: int) -> _Poses:
    """Return the poses of a camera at rows (n,), in the world (0) or in a body's axes (1, ...).

    Between whole rows, over microseconds, they are interpolated.
    """
    rows = np.arange(-1.0, height + 1.0)
    row_eyes = eyes(rows)

    def poses(v: Array, body: int) -> CameraPoses:
        row_poses = row_eyes.bodies[body - 1] if body else row_eyes.world
        if len(row_poses.position) == 1:
            return row_poses
        low = np.clip(np.floor(v).astype(np.int64) + 1, 0, height)
        share = (np.clip(v, -1.0, height) - rows[low])[:, None]
        ends = [CameraPoses(*(column[k] for column in row_poses)) for k in (low, low + 1)]
        position, q = (a + share * (b - a) for a, b in zip(*ends, strict=True))
        return CameraPoses(position, q / np.linalg.norm(q, axis=1, keepdims=True))

    return poses


def _project(
    model: CameraModel, points: Array, row: Array, poses: Callable[[Array], CameraPoses]
) -> tuple[Array, Array, Mask]:
    """Return pixels (n, 2) and depths (n,) [m] of points (n, 3), and True (n,) if in the image.

    A rolling shutter exposes each row from a pose of its own: the row of a point decides the pose
    that the point is projected from, and is iterated until it no longer changes.

    :param points: positions in the axes in which ``poses`` are [m].
    :param row: (n,) rows at which the iteration begins [px].
    :param poses: returns the poses of the camera at rows (n,), or a single pose for all rows.
    """
    v = row
    for _ in range(_ROUNDS):
        pose = poses(v)
        local = rotation.rotate_inverse(pose.q_wc, points - pose.position)
        uv, valid = model.project(local)
        change = np.where(valid, np.abs(uv[:, 1] - v), 0.0)
        v = np.where(valid, uv[:, 1], v)
        if len(pose.position) == 1 or change.max(initial=0.0) < _CLOSE:
            break
    else:
        valid &= change < _FOUND
    return uv, local[:, 2], valid & model.inside(uv)


def _is_hidden(
    uv: Array, away: Array, valid: Mask, body: int, next_image: tuple[Single, Bytes | None]
) -> Mask:
    """Return True for points behind everything in the four pixels around them.

    :param uv: (n, 2) pixels of the points in the next image.
    :param away: (n,) depths of the points [m].
    :param valid: (n,) True for points in the image; all others are hidden.
    :param body: number of the body that the points are on; 0: at rest.
    :param next_image: depths (h, w) [m], 0 for the sky, and numbers of the bodies (h, w); None: no
        body moves.
    """
    depth, mask = next_image
    result = np.ones(len(uv), np.bool_)
    some = np.flatnonzero(valid)
    corner: Integers = np.floor(uv[some]).astype(np.int64)
    limit = np.array(depth.shape[::-1]) - 1
    for k in range(4):
        column, row = np.clip(corner + np.array([k % 2, k // 2]), 0, limit).T
        surface_depth = depth[row, column]
        free = (surface_depth == 0.0) | (away[some] <= surface_depth * (1.0 + _BEHIND))
        if mask is not None:
            free &= mask[row, column] == body
        result[some[free]] = False
    return result


def kitti_flow(steps: Single) -> NDArray[np.uint16]:
    """Return flow (h, w, 2) as KITTI's PNGs have it (h, w, 3): ``64 u + 2^15``, v, validity.

    Steps beyond 512 px are not valid (KITTI's development kit, io_flow.h).

    >>> kitti_flow(np.array([[[1.0, -0.5], [np.nan, np.nan]]], np.float32)).tolist()
    [[[32832, 32736, 1], [0, 0, 0]]]
    """
    steps_kitti = np.rint(steps.astype(np.float64) * _KITTI) + _KITTI_ZERO
    with np.errstate(invalid="ignore"):
        valid = ((steps_kitti >= 0.0) & (steps_kitti < 1 << 16)).all(axis=2, keepdims=True)
    values = np.concatenate([np.where(valid, steps_kitti, 0.0), valid], axis=2)
    return values.astype(np.uint16)
