# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Rectangles in the frame of a camera, and the cells of its image in which they may be visible."""

from typing import Final, NamedTuple

import numpy as np

from imu_sim_ros.core.types import Array, Integers, Mask, Single
from imu_sim_ros.places.geometry import Surfaces

_ONE: Final = np.float32(1.0)
_FIRST: Final = np.zeros(1, np.int64)


class Planes(NamedTuple):
    """m rectangles in the camera's frame, for one pose (n = 1) or for one each row of rays."""

    vectors: Single
    """(m, n, 3, 3) vectors n / (n (o - c)), a / a^2 and b / b^2 of each rectangle, by component."""
    start: Single
    """(m, n, 2) s and r of the camera itself."""

    @classmethod
    def of(cls, surfaces: Surfaces, normals: Array, position: Array, r_wc: Array) -> "Planes":
        """Return surfaces with normals (m, 3) in the frames of poses (n, 3), (n, 3, 3)."""
        o, a, b, normal = (
            part[:, None] for part in (surfaces.origin, surfaces.across, surfaces.up, normals)
        )
        distance = ((o - position) * normal).sum(axis=2, keepdims=True)
        safe = np.where(distance == 0.0, 1e-12, distance)
        sides = [side / (side * side).sum(axis=2, keepdims=True) for side in (a, b)]
        shape = (len(o), len(position), 3)
        world = np.stack([np.broadcast_to(x, shape) for x in (normal / safe, *sides)], axis=2)
        vectors = (world[..., None] * r_wc[:, None]).sum(axis=3)
        start = np.stack([((position - o) * side).sum(axis=2) for side in sides], axis=2)
        return cls(vectors.astype(np.float32), start.astype(np.float32))

    def concatenate(self, tables: "list[Planes]") -> "Planes":
        """Return the rectangles of several tables, one after the other, for the same poses."""
        columns = zip(self, *tables, strict=True)
        return Planes(*(np.concatenate(parts) for parts in columns))

    def none(self) -> "Planes":
        """Return a table without rectangles, for the same poses."""
        return Planes(self.vectors[:0], self.start[:0])

    def select(self, which: Integers, rows: Integers) -> tuple[Single, Single]:
        """Return vectors (3, 3, p, k) and start (2, p, k) of some rectangles (p,).

        :param rows: (p, k) rows of the rays; k is 1 for one pose.
        """
        pose_rows = rows if self.start.shape[1] > 1 else _FIRST
        vectors, start = (
            self.vectors[which[:, None], pose_rows],
            self.start[which[:, None], pose_rows],
        )
        return vectors.transpose(2, 3, 0, 1), start.transpose(2, 0, 1)

    def meet(
        self, which: Integers, rays: Single, rows: Integers, threshold: np.float32
    ) -> tuple[Mask, Single, Single]:
        """Return True (p, k) for rays with a plane before them, 1 / t (p, k), s and r (2, p, k).

        :param rays: (3, p, k) directions.

        :param which: (p,) numbers of the rectangles in this table.
        :param rows: (p, k) rows of the rays.
        :param threshold: 1 / t above which a plane is before a ray.
        """
        vectors, start = self.select(which, rows)
        dots = _dots(vectors, rays)
        inverse, positions = dots[0], dots[1:]
        in_front = inverse > threshold
        positions *= _ONE / np.where(in_front, inverse, _ONE)
        positions += start
        return in_front, inverse, positions

    def linear(self, which: Integers, rays: Single, rows: Integers) -> Single:
        """Return 1 / t, s / t and r / t (3, p, k) of rays (3, p, k): linear in the ray."""
        vectors, start = self.select(which, rows)
        dots = _dots(vectors, rays)
        dots[1:] += start * dots[0]
        return dots


def _dots(vectors: Single, rays: Single) -> Single:
    """Return the scalar products (m, ...) of vectors (m, 3, ...) and rays (3, ...)."""
    dots: Single = vectors[:, 0] * rays[0]
    term = vectors[:, 1] * rays[1]
    dots += term
    dots += np.multiply(vectors[:, 2], rays[2], out=term)
    return dots


class Pairs(NamedTuple):
    """p pairs of a cell and a rectangle, by cell."""

    cell: Integers
    """(p,) number of the cell, row by row."""
    first: Integers
    """(cells + 1,) first pair of each cell; the last is p."""
    which: Integers
    """(p,) number of the rectangle; in a cell they ascend."""
    fills: Mask
    """(p,) True if the rectangle fills its cell."""
