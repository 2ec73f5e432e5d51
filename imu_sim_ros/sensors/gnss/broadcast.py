# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""The broadcast ephemerides of a run: of a RINEX file, or of the stand-in for GPS."""

from collections.abc import Iterator
from datetime import timedelta
from pathlib import Path
from typing import Final

import numpy as np

from imu_sim_ros.errors import ConfigurationError, InputError
from imu_sim_ros.sensors.gnss import rinex
from imu_sim_ros.sensors.gnss.satellites import (
    GPS_EPOCH,
    VALIDITY,
    WEEK,
    Ephemerides,
    GpsTime,
    almanac,
)
from imu_sim_ros.types import Array, Integers

SATELLITES: Final = 32
"""Numbers that a satellite of GPS may have: 1 to this."""


class Broadcast:
    """Which ephemeris of each satellite holds when: the one whose reference time is nearest."""

    def __init__(self, file: str, start: GpsTime) -> None:
        """Read a file; without one the satellites are those of :func:`almanac`.

        :param file: of RINEX navigation data, version 2 or 3; empty: none.
        :param start: of the run.
        :raises ConfigurationError: for a file that cannot be read or has nothing for the start.
        """
        self.ionosphere: Array | None = None
        self._known: Ephemerides | None = None
        if not file:
            return
        try:
            self._known, self.ionosphere = rinex.read_navigation(Path(file))
        except InputError as error:
            raise ConfigurationError([f"gnss.ephemeris: {one}" for one in error.problems]) from None
        self._toe = self._known.toe + WEEK * self._known.week.astype(np.float64)
        if (self._nearest(start, np.zeros(1)) < 0).all():
            first, last = _shown(float(self._toe.min())), _shown(float(self._toe.max()))
            raise ConfigurationError(
                f"gnss.ephemeris = {file}: holds GPS from {first} to {last}; the run begins at "
                f"{_shown(start.week * WEEK + start.second)} (start_time, taken as Unix time)"
            )

    def sets(self, start: GpsTime, t: Array) -> Iterator[tuple[Integers, Ephemerides]]:
        """Yield rows of times (n,) since the start [s], with the ephemerides that hold then."""
        if self._known is not None:
            kinds, number = np.unique(self._nearest(start, t), axis=0, return_inverse=True)
            for k, rows in enumerate(kinds):
                yield np.flatnonzero(np.ravel(number) == k), self._known.take(rows[rows >= 0])
            return
        nearest = np.round((start.second + t) / VALIDITY).astype(np.int64)
        for one in np.unique(nearest):
            carry, toe = divmod(int(one) * VALIDITY, WEEK)
            known = almanac(start.week + int(carry), float(toe))
            yield np.flatnonzero(nearest == one), known

    def written(self, start: GpsTime, last: float) -> list[Ephemerides]:
        """Return all that holds until a time since the start [s]."""
        if self._known is not None:
            return [self._known]
        times = np.append(np.arange(0.0, last, VALIDITY / 2.0), last)
        return [known for _, known in self.sets(start, times)]

    def _nearest(self, start: GpsTime, t: Array) -> Integers:
        """Return which ephemeris of each satellite holds at times (n,): (n, k); -1: none."""
        assert self._known is not None
        at = start.week * WEEK + start.second + t
        found = np.full((len(t), SATELLITES), -1)
        for prn in np.unique(self._known.prn):
            own = np.flatnonzero(self._known.prn == prn)
            own = own[np.argsort(self._toe[own], kind="stable")]
            toe = self._toe[own]
            chosen = np.searchsorted(0.5 * (toe[1:] + toe[:-1]), at)
            valid = np.abs(at - toe[chosen]) <= VALIDITY
            found[:, prn - 1] = np.where(valid, own[chosen], -1)
        return found


def _shown(second: float) -> str:
    """Return a GPS time as text."""
    return f"{GPS_EPOCH + timedelta(seconds=second):%Y-%m-%d %H:%M:%S} GPS time"
