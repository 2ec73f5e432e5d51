# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Soft shadows of bodies on the floor that they stand on, each in the body's own axes.

A shadow takes ``depth (1 - (d / radius)^2)^2`` of the light at a distance d from a line: one below
the body, where the body hides a part of the room or the sky from the floor, and out of doors one
away from the sun, as long as the body's shadow is.
"""

from typing import Final, NamedTuple

import numpy as np

from imu_sim_ros.core.types import Array, Mask
from imu_sim_ros.places.geometry import Surfaces, surfaces
from imu_sim_ros.places.light import Lighting

_BELOW: Final = 0.55
"""Share of the light that is missing below a body."""
_EDGE: Final = 0.18
"""Excess of a shadow's radius over that of its body [m]."""
_LONGEST: Final = 2.0
"""Length of a shadow at most, in heights of the body."""


class ShadowLine(NamedTuple):
    """A soft shadow on the floor, darkest along a line."""

    start: Array
    """(2,) x and y of the start of the line in the body's axes [m]."""
    end: Array
    """(2,) x and y of its end [m]."""
    radius: float
    """Distance from the line at which the shadow ends [m]."""
    depth: float
    """Share of the light that is missing on the line."""

    @property
    def length(self) -> float:
        """Distance from start to end [m]."""
        return float(np.sqrt(((self.end - self.start) ** 2).sum()))

    @property
    def ball(self) -> tuple[Array, float]:
        """Middle (3,) and radius [m] of the bounding sphere."""
        return np.append(0.5 * (self.start + self.end), 0.0), 0.5 * self.length + self.radius

    def floor(self) -> Surfaces:
        """Return the rectangle around the shadow; its first side is parallel to the line."""
        ahead = (self.end - self.start) / self.length if self.length > 0.0 else np.array([1.0, 0.0])
        x, y = self.radius * np.append(ahead, 0.0), self.radius * np.array([-ahead[1], ahead[0], 0])
        corner = np.append(self.start, 0.0) - x - y
        return surfaces([(corner, x * (2.0 + self.length / self.radius), 2.0 * y)], hides=True)


class Shadow(NamedTuple):
    """The shadow below a body, from which the shadow in the sun follows."""

    below: ShadowLine
    """Shadow on the floor below the body."""
    height: float
    """Height of the body [m]."""

    @classmethod
    def of(cls, body: Surfaces) -> "Shadow":
        """Return the shadow of a body.

        Its line is along the longer side of the box around the body, shorter than that by half the
        shorter side at each end.

        :param body: rectangles in the body's axes, whose floor is at z = 0.
        """
        corners = body.corners.reshape(-1, 3)
        low, high = corners.min(axis=0), corners.max(axis=0)
        middle, half_sides = 0.5 * (low + high)[:2], 0.5 * (high - low)[:2]
        to_end = (half_sides - half_sides.min()) * (half_sides == half_sides.max())
        radius = float(half_sides.min()) + _EDGE
        return cls(ShadowLine(middle - to_end, middle + to_end, radius, _BELOW), float(high[2]))

    def shadow_line(self, to_sun: Array, share: float) -> ShadowLine:
        """Return the shadow away from the sun.

        :param to_sun: (3,) unit vector in the body's axes.
        :param share: share of the sun in the light.
        """
        foot = 0.5 * (self.below.start + self.below.end)
        length = self.height * min(1.0 / max(float(to_sun[2]), 1e-3), _LONGEST)
        return ShadowLine(foot, foot - length * to_sun[:2], self.below.radius, share)


class Sunlight:
    """The sun on the ground of a place."""

    def __init__(self, where: Surfaces, lighting: Lighting) -> None:
        """Initialise with the faces that may hide the sun."""
        self.to_sun = np.array(lighting.to_sun)
        direct = lighting.sun[1] * lighting.to_sun[2]
        self._share = direct / (direct + lighting.sky[1])
        self._where, self._normals = where, where.normal

    def share(self, place: Array) -> float:
        """Return the share of the sun in the light at a place (3,) of the ground: 0 in a shadow."""
        offset = self._where.origin - (place + 0.05 * self.to_sun)
        along = (self._normals * self.to_sun).sum(axis=1)
        t = (self._normals * offset).sum(axis=1) / np.where(along == 0.0, 1e-12, along)
        offset_on_ray = t[:, None] * self.to_sun - offset
        blocked = t > 0.0
        for side in (self._where.across, self._where.up):
            s = (offset_on_ray * side).sum(axis=1) / (side * side).sum(axis=1)
            blocked &= (s >= 0.0) & (s <= 1.0)
        return 0.0 if blocked.any() else self._share


def sunlight(where: Surfaces, sky: Mask, lighting: Lighting) -> Sunlight | None:
    """Return the sun of a place under the open sky; None: there is none."""
    if lighting.windows or not any(lighting.sun) or not sky.any():
        return None
    return Sunlight(where.some(~sky), lighting)
