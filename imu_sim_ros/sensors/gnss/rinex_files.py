# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""The RINEX files of a run: ephemerides read, or those of the stand-in for GPS; what it writes."""

from collections.abc import Iterator, Sequence
from datetime import timedelta
from pathlib import Path
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from imu_sim_ros.errors import ConfigurationError, InputError
from imu_sim_ros.sensors.environment import EnvironmentParameters
from imu_sim_ros.sensors.gnss import rinex
from imu_sim_ros.sensors.gnss.parameters import GnssParameters
from imu_sim_ros.sensors.gnss.satellites import (
    GPS_EPOCH,
    VALIDITY,
    WEEK,
    Ephemerides,
    GpsTime,
    almanac,
    gps_time,
)
from imu_sim_ros.sensors.gravity import earth_fixed
from imu_sim_ros.types import Array

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

    def sets(self, start: GpsTime, t: Array) -> Iterator[tuple[NDArray[np.int64], Ephemerides]]:
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

    def _nearest(self, start: GpsTime, t: Array) -> NDArray[np.int64]:
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


class RinexFiles:
    """An observation file and a navigation file."""

    def __init__(
        self,
        own: GnssParameters,
        environment: EnvironmentParameters,
        t0_ns: int,
        files: Sequence[Path],
    ) -> None:
        """Open them.

        :param files: of observations, and of navigation data.
        """
        self._own, self._t0_ns = own, t0_ns
        self._start = gps_time(t0_ns)
        self._broadcast = Broadcast(own.ephemeris, self._start)
        self._observations = files[0].open("w", encoding="ascii", newline="\n")
        self._navigation = files[1]
        self._last = 0.0
        self._lock: np.ndarray[Any, Any] | None = None
        self._begun = False

    def write(self, read: Any) -> None:
        """Write the measurements of the next samples."""
        if not len(read.tag_ns):
            return
        lock = read.lock
        if self._lock is None:
            self._lock = np.zeros(lock.shape[1], np.int64)
        reached = np.maximum.accumulate(np.concatenate([self._lock[None], lock]), axis=0)
        epochs = rinex.Epochs(
            read.tag_ns,
            read.pseudorange,
            read.carrier_phase,
            read.doppler,
            read.elevation,
            lock > reached[:-1],
        )
        self._lock = reached[-1]
        if not self._begun:
            self._begun = True
            place = earth_fixed(*read.ideal_geodetic[:1].T)[0]
            self._observations.write(
                rinex.observation_header(
                    place,
                    self._own.raw.frequencies,
                    int(read.tag_ns[0]),
                    1.0 / self._own.rate,
                    self._start.leap_seconds,
                )
            )
        self._observations.writelines(rinex.observations(epochs))
        self._last = (int(read.true_t_ns[-1]) - self._t0_ns) * 1e-9

    def close(self) -> None:
        """Write the navigation data, and close both."""
        self._observations.close()
        raw = self._own.raw
        known = self._broadcast.ionosphere
        given = np.array(raw.klobuchar) if known is None else known
        ionosphere = given if raw.ionosphere else None
        with self._navigation.open("w", encoding="ascii", newline="\n") as file:
            satellites = self._broadcast.written(self._start, self._last)
            rinex.write_navigation(file, satellites, ionosphere, self._start.leap_seconds)


def _shown(second: float) -> str:
    """Return a GPS time as text."""
    return f"{GPS_EPOCH + timedelta(seconds=second):%Y-%m-%d %H:%M:%S} GPS time"
