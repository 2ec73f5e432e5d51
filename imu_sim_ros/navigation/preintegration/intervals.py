# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""A record of readings, cut at given times into the intervals that are preintegrated."""

from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from imu_sim_ros.errors import InputError
from imu_sim_ros.navigation.comparison import interpolate_vectors

Array = NDArray[np.float64]


class Readings(NamedTuple):
    """The readings of B intervals of at most m steps; shorter ones end in steps of length 0."""

    h: Array
    """(B, m) lengths of the steps [s]."""
    gyro: Array
    """(B, m + 1, 3) at the ends of the steps [rad/s]."""
    accel: Array
    """(B, m + 1, 3) at the ends of the steps [m/s^2]."""


def between(t_ns: NDArray[np.int64], gyro: Array, accel: Array, edges_ns: ArrayLike) -> Readings:
    """Return the readings between neighbouring times; at these, readings are interpolated.

    :param t_ns: (n,) stamps [ns], increasing.
    :param gyro: (n, 3) [rad/s].
    :param accel: (n, 3) [m/s^2].
    :param edges_ns: (B + 1,) times within the stamps, increasing [ns].
    :raises InputError: for times outside of the stamps or out of order.
    """
    edges = np.asarray(edges_ns, dtype=np.int64)
    if len(edges) < 2 or np.any(np.diff(edges) <= 0):
        raise InputError("the times between which to preintegrate must increase, two or more")
    if edges[0] < t_ns[0] or edges[-1] > t_ns[-1]:
        raise InputError(
            f"preintegration from {edges[0]} to {edges[-1]} ns needs readings over all of it: "
            f"they last from {t_ns[0]} to {t_ns[-1]} ns"
        )
    times = np.union1d(t_ns, edges)
    first, last = np.searchsorted(times, edges[:-1]), np.searchsorted(times, edges[1:])
    most = int(np.max(last - first))
    # Behind an interval's end its last row is repeated, which makes steps of length 0.
    rows = np.minimum(first[:, None] + np.arange(most + 1), last[:, None])
    return Readings(
        np.diff(times[rows], axis=1) * 1e-9,
        interpolate_vectors(t_ns, gyro, times)[rows],
        interpolate_vectors(t_ns, accel, times)[rows],
    )
