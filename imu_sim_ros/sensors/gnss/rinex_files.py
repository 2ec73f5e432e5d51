# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""RINEX files of a run: observations as they come, navigation data at the end."""

from collections.abc import Sequence
from pathlib import Path

import numpy as np

from imu_sim_ros.core.geodesy import ecef_of_geodetic
from imu_sim_ros.core.gps_time import gps_time
from imu_sim_ros.core.types import Integers
from imu_sim_ros.sensors.environment import EnvironmentParameters
from imu_sim_ros.sensors.gnss import rinex
from imu_sim_ros.sensors.gnss.parameters import GnssParameters
from imu_sim_ros.sensors.gnss.sky import Broadcast
from imu_sim_ros.sensors.samples import Samples


class RinexFiles:
    """An observation file and a navigation file."""

    def __init__(
        self,
        parameters: GnssParameters,
        environment: EnvironmentParameters,
        t0_ns: int,
        files: Sequence[Path],
    ) -> None:
        """Open the files.

        :param files: paths of observations, and of navigation data.
        """
        self._parameters, self._t0_ns = parameters, t0_ns
        self._start = gps_time(t0_ns)
        self._broadcast = Broadcast(parameters.ephemeris, self._start)
        self._observations = files[0].open("w", encoding="ascii", newline="\n")
        self._navigation = files[1]
        self._end = 0.0
        self._lock: Integers | None = None
        self._begun = False

    def write(self, samples: Samples) -> None:
        """Write the measurements of the next samples."""
        if not len(samples.tag_ns):
            return
        lock = samples.lock
        if self._lock is None:
            self._lock = np.zeros(lock.shape[1], np.int64)
        reached = np.maximum.accumulate(np.concatenate([self._lock[None], lock]), axis=0)
        epochs = rinex.Epochs(
            samples.tag_ns,
            samples.pseudorange,
            samples.carrier_phase,
            samples.doppler,
            samples.elevation,
            lock > reached[:-1],
        )
        self._lock = reached[-1]
        if not self._begun:
            self._begun = True
            position = ecef_of_geodetic(*samples.ideal_geodetic[:1].T)[0]
            self._observations.write(
                rinex.observation_header(
                    position,
                    self._parameters.raw.frequencies,
                    int(samples.tag_ns[0]),
                    1.0 / self._parameters.rate,
                    self._start.leap_seconds,
                )
            )
        self._observations.writelines(rinex.observations(epochs))
        self._end = (int(samples.true_t_ns[-1]) - self._t0_ns) * 1e-9

    def close(self) -> None:
        """Write the navigation data, and close both."""
        self._observations.close()
        raw = self._parameters.raw
        broadcast = self._broadcast.ionosphere
        coefficients = np.array(raw.klobuchar) if broadcast is None else broadcast
        ionosphere = coefficients if raw.ionosphere else None
        with self._navigation.open("w", encoding="ascii", newline="\n") as file:
            satellites = self._broadcast.until(self._start, self._end)
            rinex.write_navigation(file, satellites, ionosphere, self._start.leap_seconds)
