# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Satellites in view of a receiver: those in use, and their dilution of precision."""

from collections.abc import Iterator
from datetime import timedelta
from pathlib import Path
from typing import Final, NamedTuple

import numpy as np

from imu_sim_ros.core.errors import ConfigurationError, InputError
from imu_sim_ros.core.geodesy import east_north_up, ecef_of_geodetic
from imu_sim_ros.core.gps_time import GPS_EPOCH, WEEK, GpsTime, gps_time
from imu_sim_ros.core.types import Array, Integers, Mask
from imu_sim_ros.sensors.environment import EnvironmentParameters
from imu_sim_ros.sensors.gnss import rinex
from imu_sim_ros.sensors.gnss.parameters import GnssParameters
from imu_sim_ros.sensors.gnss.satellites import (
    VALIDITY,
    Ephemerides,
    almanac,
    orbits,
)
from imu_sim_ros.sensors.gravity import geodetic

SATELLITES: Final = 32
"""Largest number of a satellite of GPS."""
GEOMETRY_INTERVAL: Final = 10.0
"""Interval in which the geometry is that of its first fix [s]."""
UNUSABLE: Final = 99.99
"""Dilution of precision without a fix, as receivers print it."""
_MIN_SATELLITES: Final = 4
"""Smallest number of satellites for a fix of position and clock."""


class Broadcast:
    """Ephemerides of the satellites at any time: those with the nearest reference time."""

    def __init__(self, file: str, start: GpsTime) -> None:
        """Read a file; without one the satellites are those of :func:`almanac`.

        :param file: file of RINEX navigation data, version 2 or 3; empty: none.
        :param start: start of the run.
        :raises ConfigurationError: for a file that cannot be read or has nothing for the start.
        """
        self.ionosphere: Array | None = None
        self._ephemerides: Ephemerides | None = None
        if not file:
            return
        try:
            self._ephemerides, self.ionosphere = rinex.read_navigation(Path(file))
        except InputError as error:
            raise ConfigurationError(
                [f"gnss.ephemeris: {line}" for line in error.problems]
            ) from None
        self._toe = self._ephemerides.toe + WEEK * self._ephemerides.week.astype(np.float64)
        if (self._nearest(start, np.zeros(1)) < 0).all():
            begin_text, end_text = (
                _time_text(float(self._toe.min())),
                _time_text(float(self._toe.max())),
            )
            raise ConfigurationError(
                f"gnss.ephemeris = {file}: holds GPS from {begin_text} to {end_text}; the run "
                f"begins at {_time_text(start.week * WEEK + start.second)} (start_time, taken as "
                "Unix time)"
            )

    def sets(self, start: GpsTime, t: Array) -> Iterator[tuple[Integers, Ephemerides]]:
        """Yield rows of times (n,) since the start [s], with the ephemerides valid then."""
        if self._ephemerides is not None:
            kinds, number = np.unique(self._nearest(start, t), axis=0, return_inverse=True)
            for k, rows in enumerate(kinds):
                yield np.flatnonzero(np.ravel(number) == k), self._ephemerides.take(rows[rows >= 0])
            return
        nearest = np.round((start.second + t) / VALIDITY).astype(np.int64)
        for interval in np.unique(nearest):
            carry, toe = divmod(int(interval) * VALIDITY, WEEK)
            ephemerides = almanac(start.week + int(carry), float(toe))
            yield np.flatnonzero(nearest == interval), ephemerides

    def until(self, start: GpsTime, end: float) -> list[Ephemerides]:
        """Return all ephemerides until a time since the start [s]."""
        if self._ephemerides is not None:
            return [self._ephemerides]
        times = np.append(np.arange(0.0, end, VALIDITY / 2.0), end)
        return [ephemerides for _, ephemerides in self.sets(start, times)]

    def _nearest(self, start: GpsTime, t: Array) -> Integers:
        """Return the ephemeris of each satellite at times (n,), as row numbers (n, k); -1: none."""
        assert self._ephemerides is not None
        seconds = start.week * WEEK + start.second + t
        rows = np.full((len(t), SATELLITES), -1)
        for prn in np.unique(self._ephemerides.prn):
            candidates = np.flatnonzero(self._ephemerides.prn == prn)
            candidates = candidates[np.argsort(self._toe[candidates], kind="stable")]
            toe = self._toe[candidates]
            chosen = np.searchsorted(0.5 * (toe[1:] + toe[:-1]), seconds)
            valid = np.abs(seconds - toe[chosen]) <= VALIDITY
            rows[:, prn - 1] = np.where(valid, candidates[chosen], -1)
        return rows


def _time_text(second: float) -> str:
    """Return a GPS time as text."""
    return f"{GPS_EPOCH + timedelta(seconds=second):%Y-%m-%d %H:%M:%S} GPS time"


class Geometry(NamedTuple):
    """Satellites and dilution of n fixes."""

    used: Integers
    """(n,) bits ``prn - 1`` of the satellites in use."""
    satellites: Integers
    """(n,) number of satellites in use."""
    dilution: Array
    """(n, 4) east, north, up and clock: standard deviation of the solution over that of a range;
    infinite if there is none. The clock's is 0 if it is unknown."""

    @property
    def usable(self) -> Mask:
        """(n,) True if there is a solution."""
        return np.isfinite(self.dilution[:, 0])


def constant(parameters: GnssParameters, count: int) -> Geometry:
    """Return the geometry of n fixes under a constant sky."""
    across = parameters.hdop / np.sqrt(2.0)
    dilutions = np.array([across, across, parameters.vdop, 0.0])
    satellites = np.full(count, parameters.satellites)
    return Geometry(np.zeros(count, np.int64), satellites, np.broadcast_to(dilutions, (count, 4)))


def dilution(directions: Array, used: Mask) -> Array:
    """Return the dilution of precision (..., 4) along the axes of the directions, and of the clock.

    The roots of the diagonal of ``inv(H^T H)`` with rows ``(-u, 1)`` of H (Kaplan and Hegarty, 3rd
    ed., section 11.2.1); infinite for fewer than four satellites.

    :param directions: (..., k, 3) unit vectors to the satellites.
    :param used: (..., k) True for satellites that count.

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
    sound = (used.sum(axis=-1) >= _MIN_SATELLITES) & (np.linalg.det(normal) > 1e-9)
    normal = np.where(sound[..., None, None], normal, np.eye(4))
    diagonal = np.diagonal(np.linalg.inv(normal), axis1=-2, axis2=-1)
    return np.where(sound[..., None], np.sqrt(diagonal), np.inf)


class Sky:
    """Satellites above a receiver, and the masks that hide them."""

    def __init__(
        self, parameters: GnssParameters, environment: EnvironmentParameters, t0_ns: int
    ) -> None:
        """Start at time zero [ns]."""
        self._environment, self.start = environment, gps_time(t0_ns)
        self.broadcast = Broadcast(parameters.ephemeris, self.start)
        boxes = np.reshape(parameters.mask_boxes, (-1, 7))
        boxes = boxes[np.argsort(boxes[:, 6], kind="stable")]  # the highest of several masks counts
        self._boxes = boxes[:, :6]
        self._masks = np.concatenate([[parameters.elevation_mask_deg], boxes[:, 6]])
        self._masks = np.radians(np.maximum(self._masks, parameters.elevation_mask_deg))
        self._interval = -1
        self._last_geometry: tuple[Integers, Array] | None = None

    def over(self, t: Array, position: Array) -> Geometry:
        """Return the geometry of the next n fixes.

        :param t: (n,) times since time zero [s].
        :param position: (n, 3) true position in the world [m].
        """
        intervals = np.floor(t / GEOMETRY_INTERVAL).astype(np.int64)
        new_intervals, first_rows, rows = np.unique(
            intervals, return_index=True, return_inverse=True
        )
        if (
            self._last_geometry is not None
            and len(new_intervals)
            and new_intervals[0] == self._interval
        ):
            # The interval in which the last block ended keeps the geometry of its first fix.
            computed = self._compute(t[first_rows[1:]], position[first_rows[1:]])
            used, dilutions = (
                np.concatenate(pair) for pair in zip(self._last_geometry, computed, strict=True)
            )
        else:
            used, dilutions = self._compute(t[first_rows], position[first_rows])
        if len(new_intervals):
            self._interval, self._last_geometry = (
                int(new_intervals[-1]),
                (used[-1:], dilutions[-1:]),
            )
        level = self._level(position)
        bits = used[rows, level]
        return Geometry(
            bits @ (1 << np.arange(bits.shape[1])), bits.sum(axis=1), dilutions[rows, level]
        )

    def _compute(self, t: Array, position: Array) -> tuple[Integers, Array]:
        """Return satellites in use (m, levels, 32) and dilutions (m, levels, 4) at m times."""
        used = np.zeros((len(t), len(self._masks), SATELLITES), np.int64)
        if not len(t):
            return used, np.zeros((0, len(self._masks), 4))
        latitude, longitude, height = geodetic(self._environment, position)
        origin = ecef_of_geodetic(latitude, longitude, height)
        axes = east_north_up(latitude, longitude)
        dilutions = np.full((*used.shape[:2], 4), np.inf)
        for rows, ephemerides in self.broadcast.sets(self.start, t):
            second = self.start.second + t[rows, None]
            away = orbits(ephemerides, self.start.week, second).position - origin[rows, None]
            away /= np.linalg.norm(away, axis=-1, keepdims=True)
            directions = away @ np.swapaxes(axes[rows], -1, -2)
            visible = np.arcsin(directions[:, None, :, 2]) > self._masks[:, None]
            used[rows[:, None, None], np.arange(len(self._masks))[:, None], ephemerides.prn - 1] = (
                visible
            )
            dilutions[rows] = dilution(directions[:, None], visible)
        return used, dilutions

    def _level(self, position: Array) -> Integers:
        """Return the number of the mask (n,) at positions (n, 3)."""
        level = np.zeros(len(position), np.int64)
        for k, box in enumerate(self._boxes):
            level[((position >= box[:3]) & (position <= box[3:])).all(axis=1)] = k + 1
        return level
