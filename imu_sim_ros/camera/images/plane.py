# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""A rectangle as a camera sees it: where rays meet it, in float32, the same on every processor."""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from imu_sim_ros.camera.scene import Surfaces

Single = NDArray[np.float32]
Array = NDArray[np.float64]


class Plane(NamedTuple):
    """A rectangle in the camera's frame, for one pose or one for each row of rays."""

    normal: list[Single]
    across: list[Single]
    up: list[Single]
    start: tuple[Single, Single]
    """s and r of the camera's own place."""

    @classmethod
    def of(cls, surfaces: Surfaces, m: int, position: Array, r_wc: Array) -> "Plane":
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

    def at_rows(self, rows: slice) -> "Plane":
        """Return the part for some rows of rays; one pose stands for all."""

        def part(values: Single) -> Single:
            return values[rows] if len(values) > 1 else values

        return Plane(
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
