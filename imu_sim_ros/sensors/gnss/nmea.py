# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""NMEA 0183 sentences of fixes: GGA, RMC and VTG."""

import functools
import operator
from datetime import datetime, timezone
from typing import Any, Final

import numpy as np

_KNOTS: Final = 3600.0 / 1852.0
"""In a metre per second."""
_QUALITY: Final = (1, 2, 5, 4, 0)
"""Of GGA for single, dgps, float, fixed and no fix."""


def sentences(read: Any, hdop: float) -> str:
    """Return three sentences for each fix, with checksums and line ends.

    Times are UTC, the stamps taken as Unix time and rounded to a hundredth. Heights are above the
    ellipsoid: the separation of the geoid is 0.

    :param read: readings of a receiver.
    """
    lines = []
    rows = zip(
        *(read.t_ns.tolist(), read.geodetic.tolist(), read.velocity.tolist()),
        *(read.mode.tolist(), read.satellites.tolist()),
        strict=True,
    )
    for t_ns, (latitude, longitude, height), (east, north, _), mode, satellites in rows:
        when = datetime.fromtimestamp(round(t_ns * 1e-7) / 100.0, timezone.utc)
        time = f"{when:%H%M%S}.{when.microsecond // 10000:02d}"
        place = f"{_angle(latitude, 2, 'NS')},{_angle(longitude, 3, 'EW')}"
        place = place if mode >= 0 else ",,,"
        speed = float(np.hypot(east, north))
        course = f"{np.degrees(np.arctan2(east, north)) % 360.0:.2f}"
        valid, kind = ("A", "D" if mode else "A") if mode >= 0 else ("V", "N")
        above = f"{height:.4f},M,0.0,M" if mode >= 0 else ",M,,M"
        lines += [
            f"GNGGA,{time},{place},{_QUALITY[mode]},{satellites:02d},{hdop:.2f},{above},,",
            f"GNRMC,{time},{valid},{place},{speed * _KNOTS:.3f},{course},{when:%d%m%y},,,{kind}",
            f"GNVTG,{course},T,,M,{speed * _KNOTS:.3f},N,{speed * 3.6:.3f},K,{kind}",
        ]
    return "".join(f"${line}*{_checksum(line):02X}\r\n" for line in lines)


def _angle(degrees: float, digits: int, sides: str) -> str:
    """Return ``ddmm.mmmmmmm,N``; 1e-7 minutes are 0.2 mm."""
    minutes = round(abs(degrees) * 60.0, 7)
    whole, rest = divmod(minutes, 60.0)
    return f"{int(whole):0{digits}d}{rest:010.7f},{sides[degrees < 0.0]}"


def _checksum(line: str) -> int:
    return functools.reduce(operator.xor, line.encode("ascii"))
