# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""NMEA 0183 sentences of fixes: GGA, GSA, RMC and VTG."""

import functools
import math
import operator
from collections.abc import Iterator, Sequence
from datetime import datetime, timezone
from typing import TYPE_CHECKING, Final

from imu_sim_ros.sensors.gnss.satellites import calendar_ns
from imu_sim_ros.sensors.samples import Rows, Samples

if TYPE_CHECKING:
    from imu_sim_ros.sensors.gnss.declaration import GnssReadings

_KNOTS: Final = 3600.0 / 1852.0
"""In a metre per second."""
_IN_GSA: Final = 12
"""Satellites in a sentence; further ones are in another."""
_QUALITY: Final = (1, 2, 5, 4, 0)
"""GGA's quality for single, dgps, float, fixed and no fix."""


def sentences(read: "Samples | GnssReadings", rows: Rows) -> list[str]:
    """Return the sentences of each fix, with checksums and line ends.

    Times are the UTC of the stamps, rounded to a hundredth; without a fix, place, height, speed and
    course are empty. Heights are above the ellipsoid: the separation of the geoid is 0.

    :param read: samples or readings of a receiver.
    :param rows: which of them.
    """
    columns = (
        *(
            calendar_ns(read.t_ns),
            read.geodetic,
            read.velocity,
            read.mode,
            read.satellites,
            read.used,
        ),
        *(read.pdop, read.hdop, read.vdop),
    )
    listed = (column[rows].tolist() for column in columns)
    return ["".join(map(_framed, _lines(*row))) for row in zip(*listed, strict=True)]


def _lines(
    t_ns: int,
    geodetic: Sequence[float],
    velocity: Sequence[float],
    mode: int,
    satellites: int,
    used: int,
    *dops: float,
) -> Iterator[str]:
    """Yield the sentences of one fix, without their frames."""
    latitude, longitude, height = geodetic
    east, north, _ = velocity
    when = datetime.fromtimestamp(round(t_ns * 1e-7) / 100.0, timezone.utc)
    time = f"{when:%H%M%S}.{when.microsecond // 10000:02d}"
    position, above, course, knots, kilometres = ",,,", ",M,,M", "", "", ""
    valid, kind = ("A", "D" if mode else "A") if mode >= 0 else ("V", "N")
    if mode >= 0:
        position = f"{_angle(latitude, 2, 'NS')},{_angle(longitude, 3, 'EW')}"
        above = f"{height:.4f},M,0.0,M"
        course = f"{math.degrees(math.atan2(east, north)) % 360.0:.2f}"
        speed = math.hypot(east, north)
        knots, kilometres = f"{speed * _KNOTS:.3f}", f"{speed * 3.6:.3f}"
    quality = f"{_QUALITY[mode]},{satellites:02d},{dops[1]:.2f}"
    yield f"GNGGA,{time},{position},{quality},{above},,"
    numbers = [f"{prn + 1:02d}" for prn in range(used.bit_length()) if used >> prn & 1]
    for first in range(0, max(len(numbers), 1), _IN_GSA):
        shown = ",".join((numbers[first:] + [""] * _IN_GSA)[:_IN_GSA])
        yield f"GNGSA,A,{3 if mode >= 0 else 1},{shown},{','.join(f'{d:.2f}' for d in dops)}"
    yield f"GNRMC,{time},{valid},{position},{knots},{course},{when:%d%m%y},,,{kind}"
    yield f"GNVTG,{course},T,,M,{knots},N,{kilometres},K,{kind}"


def _framed(line: str) -> str:
    return f"${line}*{_checksum(line):02X}\r\n"


def _angle(degrees: float, digits: int, sides: str) -> str:
    """Return ``ddmm.mmmmmmm,N``; 1e-7 minutes are 0.2 mm."""
    minutes = round(abs(degrees) * 60.0, 7)
    whole, rest = divmod(minutes, 60.0)
    return f"{int(whole):0{digits}d}{rest:010.7f},{sides[degrees < 0.0]}"


def _checksum(line: str) -> int:
    return functools.reduce(operator.xor, line.encode("ascii"))
