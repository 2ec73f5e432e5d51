# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Features that a tracker follows through the frames of a camera, and its rotation between them."""

from __future__ import annotations

from typing import Final, NamedTuple

import numpy as np

from imu_sim_ros.core import rotation
from imu_sim_ros.core.types import Array, Integers

FEWEST_COMMON: Final = 12
"""Features in two frames from which on a rotation is computed; five determine the motion."""
_FIRST_STEPS: Final = 4
_LAST_STEPS: Final = 6
_OUTLYING: Final = 3.0
"""Residual, in medians of their sizes, from which on a feature weighs less."""
_FLAT: Final = 1e-9
"""Weight that keeps the direction of a translation where none is seen."""


class TrackedFrame(NamedTuple):
    """Features of one frame of a camera."""

    t_ns: int
    """Stamp of the frame [ns]."""
    ids: Integers
    """(n,) numbers of the features, all different."""
    bearings: Array
    """(n, 3) unit vectors to them in the axes of the camera."""


class FeatureTracks(NamedTuple):
    """Features of consecutive frames of a camera."""

    source: str
    """Name of the file and topic."""
    frames: tuple[TrackedFrame, ...]
    """Frames in the order of arrival."""


def rotation_between_frames(earlier: TrackedFrame, later: TrackedFrame) -> Array | None:
    """Return the rotation vector (3,) from one frame of a camera to the next [rad].

    It is resolved in the axes of the camera; None: the frames have too few features in common.
    """
    _, rows, next_rows = np.intersect1d(
        earlier.ids, later.ids, assume_unique=True, return_indices=True
    )
    if len(rows) < FEWEST_COMMON:
        return None
    return _turn(earlier.bearings[rows], later.bearings[next_rows])


class _Epipolar(NamedTuple):
    """Motion of a camera between two frames, and how far features are from what it explains.

    A residual is the distance of a pair of bearings from the plane of the epipolar constraint
    ``t . (b x R b_next) = 0``, over its slope (Sampson; Hartley and Zisserman, equation 11.9).
    """

    matrix: Array
    """(3, 3) R, from the axes of the later frame to those of the earlier one."""
    direction: Array
    """(3,) unit vector of the translation t."""
    turned: Array
    """(n, 3) bearings of the next frame, turned."""
    normals: Array
    """(n, 3) bearings x bearings of the next frame, turned."""
    scale: Array
    """(n,) slopes."""
    residuals: Array
    """(n,) [rad]."""

    @classmethod
    def of(
        cls, bearings: Array, next_bearings: Array, matrix: Array, direction: Array
    ) -> _Epipolar:
        """Return the residuals of bearings (n, 3) by a motion."""
        turned = next_bearings @ matrix.T
        normals = np.cross(bearings, turned)
        along, along_turned = np.cross(bearings, direction), np.cross(turned, direction)
        squares = np.sum(along**2, axis=1) + np.sum(along_turned**2, axis=1)
        scale = np.sqrt(np.maximum(squares, 1e-12))
        residuals = normals @ direction / scale
        return cls(matrix, direction, turned, normals, scale, residuals)

    @property
    def limit(self) -> float:
        """Size of residuals above which their influence is bounded [rad]."""
        return max(_OUTLYING * float(np.median(np.abs(self.residuals))), 1e-12)

    def cost(self, limit: float) -> float:
        """Return the sum of the squares, linear beyond a limit (Huber)."""
        size = np.abs(self.residuals)
        return float(np.sum(np.where(size < limit, size**2, limit * (2.0 * size - limit))))


def _turn(bearings: Array, next_bearings: Array) -> Array:
    """Return the rotation vector (3,) of the motion that explains bearings (n, 3) best.

    The smallest residual of several directions of the translation is looked for: with one alone,
    a translation is often taken for a rotation.
    """
    u, _, v = np.linalg.svd(bearings.T @ next_bearings)  # as if there were no translation
    matrix = u @ np.diag([1.0, 1.0, np.linalg.det(u @ v)]) @ v
    candidates = [
        _refine_motion(
            bearings,
            next_bearings,
            _Epipolar.of(bearings, next_bearings, matrix, axis),
            _FIRST_STEPS,
        )
        for axis in np.eye(3)
    ]
    limit = min(candidate.limit for candidate in candidates)
    best = min(candidates, key=lambda candidate: candidate.cost(limit))
    best = _refine_motion(bearings, next_bearings, best, _LAST_STEPS)
    return rotation.log(rotation.from_matrix(best.matrix))


def _refine_motion(
    bearings: Array, next_bearings: Array, motion: _Epipolar, count: int
) -> _Epipolar:
    """Return a motion after some steps of Levenberg and Marquardt, from a start."""
    damping = 1e-3
    for _ in range(count):
        limit = motion.limit
        weights = limit / np.maximum(np.abs(motion.residuals), limit)
        across = np.linalg.svd(motion.direction[None])[2][1:].T
        slopes = np.hstack(
            [
                np.cross(motion.turned, np.cross(motion.direction, bearings)),
                motion.normals @ across,
            ]
        )
        slopes /= motion.scale[:, None]
        squares = (slopes * weights[:, None]).T @ slopes
        diagonal = np.diag(np.diag(squares) + _FLAT * len(bearings))
        gradient = slopes.T @ (weights * motion.residuals)
        step = -np.linalg.solve(squares + damping * diagonal, gradient)
        direction = motion.direction + across @ step[3:]
        moved = _Epipolar.of(
            bearings,
            next_bearings,
            rotation.to_matrix(rotation.exp(step[:3])) @ motion.matrix,
            direction / np.linalg.norm(direction),
        )
        if moved.cost(limit) < motion.cost(limit):
            motion, damping = moved, 0.1 * damping
        else:
            damping *= 10.0
    return motion
