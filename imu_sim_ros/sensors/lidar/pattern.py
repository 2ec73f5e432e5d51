# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Times and directions of a LiDAR's rays, in its frame: x ahead, y to the left, z up."""

import math
from collections.abc import Callable
from pathlib import Path
from typing import Final

import numpy as np
from numpy.typing import NDArray

from imu_sim_ros.core.errors import InputError, system_error
from imu_sim_ros.core.types import Array
from imu_sim_ros.inputs.rows import open_regular
from imu_sim_ros.sensors.lidar.layouts import LAYOUTS
from imu_sim_ros.sensors.lidar.parameters import MOST_RAYS, LidarParameters

_LARGEST_FILE: Final = 200 << 20
"""Largest file of a scan pattern [bytes]."""


class Pattern:
    """The m rays of every scan."""

    def __init__(
        self,
        time: Array,
        ring: NDArray[np.uint16],
        directions: Array | Callable[[float], Array],
    ) -> None:
        """Initialise with the directions and times of the rays.

        :param time: (m,) since the start of the scan [s].
        :param directions: (m, 3) unit vectors, or what returns them for the time from the start of
            the run to that of the scan [s].
        """
        self.time, self.ring, self._directions = time, ring, directions

    def directions(self, start: float) -> Array:
        """Return the nominal directions (m, 3) of a scan.

        :param start: start of the scan, since the start of the run [s].
        """
        if callable(self._directions):
            return self._directions(start)
        return self._directions


def build_pattern(p: LidarParameters) -> Pattern:
    """Return the rays that the parameters describe.

    :raises InputError: for a table that cannot be used, naming its line.
    """
    build = {
        "spinning": _spinning_pattern,
        "rosette": _rosette_pattern,
        "nodding": _nodding_pattern,
        "table": _table_pattern,
    }
    return build[p.pattern](p)


def towards(azimuth: Array, elevation: Array) -> Array:
    """Return unit vectors (m, 3) of azimuths, counterclockwise from x, and elevations [rad]."""
    flat = np.cos(elevation)
    return np.stack([flat * np.cos(azimuth), flat * np.sin(azimuth), np.sin(elevation)], axis=-1)


def _spinning_pattern(p: LidarParameters) -> Pattern:
    """Return channels that turn; all start again at the same azimuth with each scan."""
    elevation = np.radians(p.elevations_deg)
    channels = len(elevation)
    firings = max(1, math.floor(p.span / p.firing_period + 1e-9))
    begin = np.arange(firings) * p.firing_period
    time = (begin[:, None] + np.arange(channels) * p.channel_interval).reshape(-1)
    offsets = np.radians(p.azimuth_offsets_deg or [0.0] * channels)
    azimuth = _azimuths_at(p, time, p.rate) + np.tile(offsets, firings)
    order = np.argsort(elevation, kind="stable")[:: -1 if p.top_ring_first else 1]
    ring = np.empty(channels, np.uint16)
    ring[order] = np.arange(channels)
    directions = towards(azimuth, np.tile(elevation, firings))
    return Pattern(time, np.tile(ring, firings), directions)


def _azimuths_at(p: LidarParameters, time: Array, rate: float) -> Array:
    """Return azimuths at times after an azimuth of ``start_azimuth_deg`` [rad]."""
    turn = -2.0 * math.pi if p.clockwise else 2.0 * math.pi
    return math.radians(p.start_azimuth_deg) + turn * ((rate * time) % 1.0)


def _lines(p: LidarParameters) -> tuple[Array, NDArray[np.uint16], Array]:
    """Return time [s], line and elevation above the middle of the lines [rad] of each ray."""
    count = math.floor(p.point_rate * p.span + 1e-9)
    line = np.arange(count) % p.lines
    middle = 0.5 * (p.lines - 1)
    offset = np.radians(p.line_spacing_deg * (line - middle)).astype(np.float64)
    ring = (p.lines - 1 - line if p.top_ring_first else line).astype(np.uint16)
    return np.arange(count) / p.point_rate, ring, offset


def _rosette_pattern(p: LidarParameters) -> Pattern:
    """Return beams that turning prisms deflect from x, as Livox describes its Mid-40 and Avia.

    To first order the deflections add up as vectors in the plane of azimuth and elevation: prism k
    turns its own by ``2 pi rate_k t`` (Risley prisms; Marshall, Optical Engineering 38, 1999).
    """
    time, ring, offset = _lines(p)

    def directions(start: float) -> Array:
        azimuth, elevation = np.zeros(len(time)), offset.copy()
        for rate, deflection in zip(p.prism_rates, p.prism_deflections_deg, strict=True):
            angle = 2.0 * math.pi * ((rate * (start + time)) % 1.0)
            azimuth += math.radians(deflection) * np.cos(angle)
            elevation += math.radians(deflection) * np.sin(angle)
        return towards(azimuth, elevation)

    return Pattern(time, ring, directions)


def _nodding_pattern(p: LidarParameters) -> Pattern:
    """Return beams that turn about z and go up and down on a sine."""
    time, ring, offset = _lines(p)
    low, high = np.radians(p.elevation_limits_deg)

    def directions(start: float) -> Array:
        t = start + time
        nod = np.sin(2.0 * math.pi * ((p.nod_rate * t) % 1.0))
        return towards(
            _azimuths_at(p, t, p.turn_rate), offset + 0.5 * (low + high + (high - low) * nod)
        )

    return Pattern(time, ring, directions)


def _table_pattern(p: LidarParameters) -> Pattern:
    """Return the pattern of a table of times and angles."""
    path = Path(p.table)
    try:
        with open_regular(path) as file:
            data = file.read(_LARGEST_FILE + 1)
    except OSError as error:
        raise system_error(path, error) from None
    if len(data) > _LARGEST_FILE:
        raise InputError(f"{path}: larger than {_LARGEST_FILE >> 20} MiB")
    try:
        lines = data.decode("utf-8").splitlines()
    except UnicodeDecodeError:
        raise InputError(f"{path}: is no text") from None
    if len(lines) > MOST_RAYS:  # said before a quarter of a minute is spent on them
        count = sum(not line.lstrip().startswith("#") for line in lines if line.strip())
        if count > MOST_RAYS + 1:
            raise InputError(f"{path}: {count:,} lines of rays; at most {MOST_RAYS:,}")
    rows: list[list[float]] = []
    for number, line in enumerate(lines, start=1):
        tokens = line.split("#")[0].replace(",", " ").replace(";", " ").split()
        try:
            row = [float(word) for word in tokens]
        except ValueError:
            if rows:
                raise InputError(f"{path}: line {number}: {line!r} is not numeric") from None
            continue  # its header
        if not row:
            continue
        if len(row) not in (3, 4) or (rows and len(row) != len(rows[0])):
            raise InputError(
                f"{path}: line {number}: {len(row)} columns; must be time, azimuth, elevation, and "
                "a ring in all lines or in none"
            )
        _check_row(path, number, row, rows[-1][0] if rows else 0.0, p)
        rows.append(row)
    if not rows:
        raise InputError(f"{path}: contains no rays")
    if len(rows) > MOST_RAYS:
        raise InputError(f"{path}: {len(rows):,} rays; at most {MOST_RAYS:,}")
    table = np.array(rows)
    ring = table[:, 3].astype(np.uint16) if table.shape[1] == 4 else np.zeros(len(rows), np.uint16)
    return Pattern(table[:, 0].copy(), ring, towards(*np.radians(table[:, 1:3]).T))


def _check_row(
    path: Path, number: int, row: list[float], previous_time: float, p: LidarParameters
) -> None:
    """Check a ray of a table.

    :param number: number of its line.
    :param row: time [s], azimuth and elevation [deg], and a ring if the table has them.
    :param previous_time: time of the ray before it [s].
    :raises InputError: for a ray that no scan has, naming its line.
    """
    where = f"{path}: line {number}"
    if not all(map(math.isfinite, row)):
        raise InputError(f"{where}: a value that is not finite")
    if not previous_time <= row[0] < p.span:
        raise InputError(
            f"{where}: time {row[0]:g} s: must not decrease, from 0 to below 1 / rate, {p.span:g} s"
        )
    if abs(row[2]) > 90.0:
        raise InputError(f"{where}: elevation {row[2]:g} deg: must be between -90 and 90")
    max_ring = LAYOUTS[p.layout].most_rings - 1
    if len(row) == 4 and not (row[3].is_integer() and 0 <= row[3] <= max_ring):
        raise InputError(
            f"{where}: ring {row[3]:g}: must be an integer from 0 to {max_ring} for {p.layout}"
        )
