# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""What a receiver sees of the satellites: which are in use, and how they dilute its precision."""

from typing import Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from imu_sim_ros.sensors.environment import EnvironmentParameters
from imu_sim_ros.sensors.gnss.broadcast import SATELLITES, Broadcast
from imu_sim_ros.sensors.gnss.parameters import GnssParameters
from imu_sim_ros.sensors.gnss.satellites import gps_time, orbits
from imu_sim_ros.sensors.gravity import earth_fixed, east_north_up, geodetic
from imu_sim_ros.types import Array, Integers, Mask

RENEWED: Final = 10.0
"""[s] The geometry is that of the first fix in each interval of this length."""
UNUSABLE: Final = 99.99
"""Dilution of precision without a fix, as receivers print it."""
_LEAST: Final = 4
"""Satellites that place and clock need."""


Used = NDArray[np.int64]


class Geometry(NamedTuple):
    """What n fixes are made of."""

    used: Integers
    """(n,) bit ``prn - 1`` is set for each satellite in use."""
    satellites: Integers
    """(n,) how many these are."""
    dilution: Array
    """(n, 4) east, north, up and clock: standard deviation of the solution over that of a range;
    infinite if there is none. The clock's is 0 if it is not known."""

    @property
    def usable(self) -> Mask:
        """(n,) whether there is a solution."""
        return np.isfinite(self.dilution[:, 0])


def constant(parameters: GnssParameters, count: int) -> Geometry:
    """Return the geometry of n fixes under a sky that is always the same."""
    across = parameters.hdop / np.sqrt(2.0)
    found = np.array([across, across, parameters.vdop, 0.0])
    satellites = np.full(count, parameters.satellites)
    return Geometry(np.zeros(count, np.int64), satellites, np.broadcast_to(found, (count, 4)))


def dilution(directions: Array, used: Mask) -> Array:
    """Return the dilution of precision (..., 4) along the axes of the directions, and of the clock.

    The roots of the diagonal of ``inv(H^T H)`` with rows ``(-u, 1)`` of H (Kaplan and Hegarty, 3rd
    ed., section 11.2.1); infinite for fewer than four satellites.

    :param directions: (..., k, 3) unit vectors to the satellites.
    :param used: (..., k) which count.

    >>> import numpy as np
    >>> from imu_sim_ros.sensors.gnss.sky import dilution
    >>> s = np.sqrt(3.0) / 2.0  # one satellite overhead and three on the horizon
    >>> sky = np.array([[0.0, 0.0, 1.0], [1.0, 0.0, 0.0], [-0.5, s, 0.0], [-0.5, -s, 0.0]])
    >>> np.round(dilution(sky, np.ones(4, bool)) ** 2, 3)
    array([0.667, 0.667, 1.333, 0.333])
    """
    rows = np.concatenate([-directions, np.ones((*directions.shape[:-1], 1))], axis=-1)
    rows = rows * used[..., None]
    normal = np.swapaxes(rows, -1, -2) @ rows
    sound = (used.sum(axis=-1) >= _LEAST) & (np.linalg.det(normal) > 1e-9)
    normal = np.where(sound[..., None, None], normal, np.eye(4))
    diagonal = np.diagonal(np.linalg.inv(normal), axis1=-2, axis2=-1)
    return np.where(sound[..., None], np.sqrt(diagonal), np.inf)


class Sky:
    """The satellites above a receiver, and what hides them."""

    def __init__(
        self, parameters: GnssParameters, environment: EnvironmentParameters, t0_ns: int
    ) -> None:
        """Start at time zero [ns]."""
        self._environment, self.start = environment, gps_time(t0_ns)
        self.broadcast = Broadcast(parameters.ephemeris, self.start)
        boxes = np.reshape(parameters.mask_boxes, (-1, 7))
        boxes = boxes[np.argsort(boxes[:, 6], kind="stable")]  # the highest of several counts
        self._boxes = boxes[:, :6]
        self._masks = np.concatenate([[parameters.elevation_mask_deg], boxes[:, 6]])
        self._masks = np.radians(np.maximum(self._masks, parameters.elevation_mask_deg))
        self._interval = -1
        self._last: tuple[Used, Array] | None = None

    def over(self, t: Array, position: Array) -> Geometry:
        """Return what the next n fixes are made of.

        :param t: (n,) since time zero [s].
        :param position: (n, 3) true position in the world [m].
        """
        intervals = np.floor(t / RENEWED).astype(np.int64)
        new, first, rows = np.unique(intervals, return_index=True, return_inverse=True)
        used, found = self._of_intervals(new, t[first], position[first])
        level = self._level(position)
        bits = used[rows, level]
        return Geometry(
            bits @ (1 << np.arange(bits.shape[1])), bits.sum(axis=1), found[rows, level]
        )

    def _of_intervals(self, new: Integers, t: Array, position: Array) -> tuple[Used, Array]:
        """Return satellites in use (m, levels, 32) and dilutions (m, levels, 4) of intervals.

        The interval that the last block ended in keeps the geometry of its first fix.
        """
        kept = self._last if len(new) and new[0] == self._interval else None
        skipped = int(kept is not None)
        parts = [kept] if kept is not None else []
        parts.append(self._seen(t[skipped:], position[skipped:]))
        used, found = (np.concatenate(both) for both in zip(*parts, strict=True))
        if len(new):
            self._interval, self._last = int(new[-1]), (used[-1:], found[-1:])
        return used, found

    def _seen(self, t: Array, position: Array) -> tuple[Used, Array]:
        used = np.zeros((len(t), len(self._masks), SATELLITES), np.int64)
        if not len(t):
            return used, np.zeros((0, len(self._masks), 4))
        latitude, longitude, height = geodetic(self._environment, position)
        origin = earth_fixed(latitude, longitude, height)
        axes = east_north_up(latitude, longitude)
        found = np.full((*used.shape[:2], 4), np.inf)
        for rows, known in self.broadcast.sets(self.start, t):
            second = self.start.second + t[rows, None]
            away = orbits(known, self.start.week, second).position - origin[rows, None]
            away /= np.linalg.norm(away, axis=-1, keepdims=True)
            directions = away @ np.swapaxes(axes[rows], -1, -2)
            above = np.arcsin(directions[:, None, :, 2]) > self._masks[:, None]
            used[rows[:, None, None], np.arange(len(self._masks))[:, None], known.prn - 1] = above
            found[rows] = dilution(directions[:, None], above)
        return used, found

    def _level(self, position: Array) -> Integers:
        """Return the number of the mask (n,) that hides satellites at positions (n, 3)."""
        level = np.zeros(len(position), np.int64)
        for k, box in enumerate(self._boxes):
            level[((position >= box[:3]) & (position <= box[3:])).all(axis=1)] = k + 1
        return level
