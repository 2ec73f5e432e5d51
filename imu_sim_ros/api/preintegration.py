# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Preintegrated readings between frames."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from numpy.typing import ArrayLike

from imu_sim_ros.api.flight import Flight
from imu_sim_ros.api.readings import Readings, read_imu
from imu_sim_ros.arguments import array, number
from imu_sim_ros.errors import InputError
from imu_sim_ros.navigation import noise_of
from imu_sim_ros.navigation.preintegration import Preintegration, between
from imu_sim_ros.navigation.preintegration import preintegrate as over_intervals


def preintegrate(
    readings: Flight | Readings | str | Path,
    edges_ns: ArrayLike | None = None,
    *,
    every: float | None = None,
    gyro_bias: ArrayLike = 0.0,
    accel_bias: ArrayLike = 0.0,
    method: str = "midpoint",
) -> Preintegration:
    """Preintegrate the readings between neighbouring times, all intervals at once.

    ``alpha``, ``beta``, ``gamma`` are position, velocity and attitude in the frame of an interval's
    start, without gravity, with the Jacobian by the biases and the covariance (15, 15), ordered
    alpha, theta, beta, accelerometer's bias, gyroscope's bias. The noise of a flight is known;
    for other readings the covariance is zero.

    :param readings: a flight, readings, or a file that :func:`imu_sim_ros.read_imu` reads.
    :param edges_ns: (B + 1,) times of the frames [ns], increasing, within the stamps.
    :param every: instead, the time from frame to frame [s].
    :param gyro_bias: (B, 3), (3,) or one number [rad/s], subtracted from the readings.
    :param accel_bias: likewise [m/s^2].
    :param method: euler or midpoint.
    :raises InputError: for times outside the stamps.

    >>> import imu_sim_ros as ims
    >>> flight = ims.simulate(imu="adis16448", trajectory="figure_eight", duration=10)
    >>> found = ims.preintegrate(flight, every=0.5)
    >>> found.alpha.shape, found.covariance.shape
    ((19, 3), (19, 15, 15))
    """
    for name, bias in (("gyro_bias", gyro_bias), ("accel_bias", accel_bias)):
        array(name, bias, ((), (3,), (None, 3))[min(np.ndim(np.asarray(bias)), 2)])
    noise = None
    if isinstance(readings, Flight):
        noise = noise_of(readings.parameters.imu)
        readings = readings.readings
    elif not isinstance(readings, Readings):
        readings = read_imu(readings)
    if (edges_ns is None) == (every is None):
        raise InputError("give the times of the frames, edges_ns, or the time between them, every")
    if every is not None:
        number("every", every, "a number of seconds of at least 1e-9", 1e-9)
        step = round(every * 1e9)
        edges_ns = np.arange(readings.t_ns[0], readings.t_ns[-1] + 1, step)
    pieces = between(readings.t_ns, readings.gyro, readings.accel, np.asarray(edges_ns))
    return over_intervals(pieces, noise, gyro_bias, accel_bias, method)
