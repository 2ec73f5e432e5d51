# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""NMEA 0183 sentences of fixes: GGA, GSA, RMC and VTG."""

import functools
import math
import operator
from collections.abc import Iterator, Sequence
from datetime import datetime, timezone
from typing import TYPE_CHECKING, Final

from imu_sim_ros.core.gps_time import calendar_ns
from imu_sim_ros.sensors.samples import Rows, Samples

if TYPE_CHECKING:
    from imu_sim_ros.sensors.gnss.declaration import GnssReadings

_KNOTS: Final = 3600.0 / 1852.0
"""One metre per second in knots."""
_IN_GSA: Final = 12
"""Number of satellites in a sentence; further ones are in the next."""
_QUALITY: Final = (1, 2, 5, 4, 0)
"""Quality in GGA for single, dgps, float, fixed and no fix."""


def sentences(fixes: "Samples | GnssReadings", rows: Rows) -> list[str]:
    """Return the sentences of each fix, with checksums and line ends.

    Times are the UTC of the stamps, rounded to a hundredth; without a fix, place, height, speed and
    course are empty. Heights are above the ellipsoid: the separation of the geoid is 0.

    :param fixes: samples or readings of a receiver.
    :param rows: rows of the fixes.
    """
    columns = (
        *(
            calendar_ns(fixes.t_ns),
            fixes.geodetic,
            fixes.velocity,
            fixes.mode,
            fixes.satellites,
            fixes.used,
        ),
        *(fixes.pdop, fixes.hdop, fixes.vdop),
    )
    listed = (column[rows].tolist() for column in columns)
    return ["".join(map(_add_checksum, _lines(*row))) for row in zip(*listed, strict=True)]


def _lines(
    t_ns: int,
    geodetic: Sequence[float],
    velocity: Sequence[float],
    mode: int,
    satellites: int,
    used: int,
    *dops: float,
) -> Iterator[str]:
    """Yield the sentences of one fix, without ``$`` and checksum: GGA, GSA, RMC, VTG.

    :param t_ns: time of the fix, UTC [ns].
    :param geodetic: latitude and longitude [deg], height above the ellipsoid [m].
    :param velocity: velocity east, north, up [m/s].
    :param mode: 0 single, 1 dgps, 2 float, 3 fixed, -1 no fix.
    :param satellites: number of satellites in use.
    :param used: bits ``prn - 1`` of these satellites.
    :param dops: dilutions of precision: of position, horizontal, vertical.
    """
    latitude, longitude, height = geodetic
    east, north, _ = velocity
    when = datetime.fromtimestamp(round(t_ns * 1e-7) / 100.0, timezone.utc)
    time = f"{when:%H%M%S}.{when.microsecond // 10000:02d}"
    position, height_text, course, knots, kilometres = ",,,", ",M,,M", "", "", ""
    valid, kind = ("A", "D" if mode else "A") if mode >= 0 else ("V", "N")
    if mode >= 0:
        position = f"{_angle(latitude, 2, 'NS')},{_angle(longitude, 3, 'EW')}"
        height_text = f"{height:.4f},M,0.0,M"
        course = f"{math.degrees(math.atan2(east, north)) % 360.0:.2f}"
        speed = math.hypot(east, north)
        knots, kilometres = f"{speed * _KNOTS:.3f}", f"{speed * 3.6:.3f}"
    quality = f"{_QUALITY[mode]},{satellites:02d},{dops[1]:.2f}"
    yield f"GNGGA,{time},{position},{quality},{height_text},,"
    numbers = [f"{prn + 1:02d}" for prn in range(used.bit_length()) if used >> prn & 1]
    for start in range(0, max(len(numbers), 1), _IN_GSA):
        satellites_text = ",".join((numbers[start:] + [""] * _IN_GSA)[:_IN_GSA])
        dilutions = ",".join(f"{d:.2f}" for d in dops)
        yield f"GNGSA,A,{3 if mode >= 0 else 1},{satellites_text},{dilutions}"
    yield f"GNRMC,{time},{valid},{position},{knots},{course},{when:%d%m%y},,,{kind}"
    yield f"GNVTG,{course},T,,M,{knots},N,{kilometres},K,{kind}"


def _add_checksum(line: str) -> str:
    """Return a sentence with its checksum."""
    return f"${line}*{_checksum(line):02X}\r\n"


def _angle(degrees: float, digits: int, sides: str) -> str:
    """Return ``ddmm.mmmmmmm,N``; 1e-7 minutes are 0.2 mm."""
    minutes = round(abs(degrees) * 60.0, 7)
    whole, rest = divmod(minutes, 60.0)
    return f"{int(whole):0{digits}d}{rest:010.7f},{sides[degrees < 0.0]}"


def _checksum(line: str) -> int:
    """Return the exclusive or of the letters of a sentence."""
    return functools.reduce(operator.xor, line.encode("ascii"))
