# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Rectangles as a camera sees them: where rays meet them, in float32, the same on every processor.

Along a ray ``c + t d`` a rectangle ``o + s a + r b`` with normal n is met at

    1 / t = (n d) / (n (o - c)),   s = ((c - o) a + t (d a)) / a^2,   r likewise with b.
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from imu_sim_ros.camera.scene import Surfaces

Single = NDArray[np.float32]
Array = NDArray[np.float64]
Mask = NDArray[np.bool_]
Integers = NDArray[np.int64]

_ONE = np.float32(1.0)
_AHEAD = np.float32(1e-6)
"""Least 1 / t of what is in front of the camera."""


class Planes(NamedTuple):
    """m rectangles in the camera's frame, for one pose (n = 1) or for one each row of rays."""

    vectors: Single
    """(m, 3, 3, n): n / (n (o - c)), a / a^2 and b / b^2, each with its x, y, z."""
    start: Single
    """(m, 2, n) s and r of the camera's own place."""

    @classmethod
    def of(cls, surfaces: Surfaces, numbers: Integers, position: Array, r_wc: Array) -> "Planes":
        """Return some surfaces (m,) as poses (n, 3), (n, 3, 3) see them."""
        o, a, b, normal = (
            part[numbers, None]
            for part in (surfaces.origin, surfaces.across, surfaces.up, surfaces.normal)
        )
        distance = ((o - position) * normal).sum(axis=2, keepdims=True)
        safe = np.where(distance == 0.0, 1e-12, distance)
        sides = [side / (side * side).sum(axis=2, keepdims=True) for side in (a, b)]
        shape = (len(numbers), len(position), 3)
        world = np.stack([np.broadcast_to(x, shape) for x in (normal / safe, *sides)], axis=1)
        vectors = (world[..., None] * r_wc).sum(axis=3)
        start = np.stack([((position - o) * side).sum(axis=2) for side in sides], axis=1)
        return cls(vectors.swapaxes(2, 3).astype(np.float32), start.astype(np.float32))

    def meet(self, m: int, rays: Single, rows: Integers | slice) -> tuple[Mask, Single, Single]:
        """Return which rays (3, ..., w) have a plane before them, 1 / t, and s and r (2, ..., w).

        :param m: number of the rectangle among these.
        :param rows: (...) of the rays.
        """
        vectors, start = self.vectors[m], self.start[m]
        if start.shape[1] == 1:
            around = (1,) * (rays.ndim - 1)
            vectors, start = vectors.reshape(3, 3, *around), start.reshape(2, *around)
        else:
            vectors, start = vectors[..., rows, None], start[..., rows, None]
        dots = vectors[:, 0] * rays[0]
        term = vectors[:, 1] * rays[1]
        dots += term
        dots += np.multiply(vectors[:, 2], rays[2], out=term)
        inverse, places = dots[0], dots[1:]
        ahead = inverse > _AHEAD
        places *= _ONE / np.where(ahead, inverse, _ONE)
        places += start
        return ahead, inverse, places


def within(places: Single) -> Mask:
    """Tell which places (2, ...) lie on a rectangle."""
    inside = places >= 0.0
    inside &= places <= 1.0
    inside[0] &= inside[1]
    return np.asarray(inside[0])
