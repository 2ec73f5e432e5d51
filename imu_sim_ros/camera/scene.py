# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""What cameras see: landmarks, lines, and the surfaces that carry them and hide what is behind."""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

_SELF: float = 1e-6
"""Relative depth within which a landmark lies on a surface and is not hidden by it."""


class Surfaces(NamedTuple):
    """m rectangles: ``origin + s across + t up`` for s and t from 0 to 1."""

    origin: Array
    """(m, 3) p_w of a corner [m]."""
    across: Array
    """(m, 3) the side from the origin, s [m]."""
    up: Array
    """(m, 3) the other side from the origin, t [m]."""
    hides: NDArray[np.bool_]
    """(m,) something may be behind it; false for the walls of a room seen from inside."""
    texture: tuple[str, ...]
    """m names of what is on it."""

    @property
    def normal(self) -> Array:
        """(m, 3) unit vectors, across x up."""
        n = np.cross(self.across, self.up)
        unit: Array = n / np.linalg.norm(n, axis=1, keepdims=True)
        return unit


def surfaces(
    rectangles: list[tuple[Array, Array, Array]], hides: bool, texture: str = "wall"
) -> Surfaces:
    """Return rectangles (origin, across, up) as one."""
    columns = np.array(rectangles, dtype=np.float64).reshape(-1, 3, 3)
    count = len(columns)
    return Surfaces(
        columns[:, 0],
        columns[:, 1],
        columns[:, 2],
        np.full(count, hides),
        (texture,) * count,
    )


def joined(first: Surfaces, second: Surfaces) -> Surfaces:
    """Return the surfaces of both."""
    return Surfaces(
        np.concatenate([first.origin, second.origin]),
        np.concatenate([first.across, second.across]),
        np.concatenate([first.up, second.up]),
        np.concatenate([first.hides, second.hides]),
        first.texture + second.texture,
    )


NO_SURFACES = surfaces([], hides=True)


class Scene(NamedTuple):
    """A scene at rest in the world."""

    landmarks: Array
    """(n, 3) p_w [m]; a landmark's id is its row."""
    normals: Array
    """(n, 3) the side from which each is seen; zero: from everywhere."""
    lines: Array
    """(l, 2, 3) both ends of each line [m]."""
    surfaces: Surfaces
    extent: float
    """Largest distance of anything from anything else, about [m]."""

    @classmethod
    def of_points(cls, points: Array) -> "Scene":
        """Return a scene of landmarks (n, 3) alone, seen from everywhere."""
        extent = float(np.linalg.norm(np.ptp(points, axis=0))) if len(points) else 0.0
        return cls(points, np.zeros_like(points), np.zeros((0, 2, 3)), NO_SURFACES, extent)


def hidden(surfaces: Surfaces, eye: Array, points: Array) -> NDArray[np.bool_]:
    """Tell which points are behind a surface.

    The line of sight ``eye + s (point - eye)`` meets the plane of a surface at
    ``s = n (origin - eye) / n (point - eye)``.

    :param eye: (n, 3) where each point is seen from [m].
    :param points: (n, 3) [m].
    """
    result = np.zeros(len(points), dtype=bool)
    sight = [points[:, k] - eye[:, k] for k in range(3)]
    normals = surfaces.normal
    for m in np.flatnonzero(surfaces.hides):
        n, o = normals[m], surfaces.origin[m]
        along = n[0] * sight[0] + n[1] * sight[1] + n[2] * sight[2]
        start = n[0] * (o[0] - eye[:, 0]) + n[1] * (o[1] - eye[:, 1]) + n[2] * (o[2] - eye[:, 2])
        with np.errstate(divide="ignore", invalid="ignore"):
            s = start / along
        between = (s > 0.0) & (s < 1.0 - _SELF)
        if not between.any():
            continue
        rows = np.flatnonzero(between)
        at = [eye[rows, k] + s[rows] * sight[k][rows] - o[k] for k in range(3)]
        within = np.ones(len(rows), dtype=bool)
        for side in (surfaces.across[m], surfaces.up[m]):
            place = at[0] * side[0] + at[1] * side[1] + at[2] * side[2]
            within &= (place >= 0.0) & (place <= float(side @ side))
        result[rows[within]] = True
    return result
