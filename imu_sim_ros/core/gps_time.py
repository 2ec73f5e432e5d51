# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Time of GPS: weeks and seconds since 1980, and leap seconds."""

from datetime import datetime, timezone
from typing import Final, NamedTuple

import numpy as np

from imu_sim_ros.core.timebase import NANOSECONDS_PER_SECOND
from imu_sim_ros.core.types import Integers

WEEK: Final = 604800
"""Length of a week [s]."""
GPS_EPOCH: Final = datetime(1980, 1, 6, tzinfo=timezone.utc)
# GPS time minus UTC grew by a second at each of these dates (IERS Bulletin C).
_LEAPS: Final = tuple(
    datetime(year, month, 1, tzinfo=timezone.utc).timestamp()
    for year, month in (
        *((1981, 7), (1982, 7), (1983, 7), (1985, 7), (1988, 1), (1990, 1), (1991, 1), (1992, 7)),
        *((1993, 7), (1994, 7), (1996, 1), (1997, 7), (1999, 1), (2006, 1), (2009, 1), (2012, 7)),
        *((2015, 7), (2017, 1)),
    )
)
_STAND_IN: Final = datetime(2026, 1, 1, tzinfo=timezone.utc)
"""Origin of stamps that are too early for GPS: those of a file begin with 1 s."""


class GpsTime(NamedTuple):
    """A time of GPS."""

    week: int
    """Week since 6 January 1980, not rolled over."""
    second: float
    """Second of the week [s]."""

    @property
    def leap_seconds(self) -> int:
        """Return GPS time minus UTC [s]."""
        return leap_seconds(GPS_EPOCH.timestamp() + self.week * WEEK + self.second)


def leap_seconds(unix: float) -> int:
    """Return GPS time minus UTC [s] at a Unix time [s].

    >>> from imu_sim_ros.core.gps_time import leap_seconds
    >>> leap_seconds(1.7e9)
    18
    """
    return sum(unix >= leap for leap in _LEAPS)


def calendar_ns(t_ns: Integers) -> Integers:
    """Return the UTC of a receiver's stamps, as Unix times [ns].

    Stamps are Unix times, but one before 6 January 1980 counts from 1 January 2026: files begin at
    1 s.

    >>> import numpy as np
    >>> from imu_sim_ros.core.gps_time import calendar_ns
    >>> calendar_ns(np.array([10**9])).astype("datetime64[ns]").astype("datetime64[s]")
    array(['2026-01-01T00:00:01'], dtype='datetime64[s]')
    """
    too_early = t_ns < int(GPS_EPOCH.timestamp()) * NANOSECONDS_PER_SECOND
    return t_ns + too_early * (int(_STAND_IN.timestamp()) * NANOSECONDS_PER_SECOND)


def gps_time(t_ns: int) -> GpsTime:
    """Return the GPS time of a stamp, as :func:`calendar_ns` dates it.

    >>> from imu_sim_ros.core.gps_time import gps_time
    >>> gps_time(1_704_067_200_000_000_000)
    GpsTime(week=2295, second=86418.0)
    """
    epoch = int(GPS_EPOCH.timestamp())
    t_ns = int(calendar_ns(np.array(t_ns)))
    t_ns += (leap_seconds(t_ns * 1e-9) - epoch) * NANOSECONDS_PER_SECOND
    week, rest = divmod(t_ns, WEEK * NANOSECONDS_PER_SECOND)
    return GpsTime(int(week), rest * 1e-9)
