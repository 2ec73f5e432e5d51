# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Preintegrated readings between frames."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from numpy.typing import ArrayLike

from imu_sim_ros.core import arguments, gate
from imu_sim_ros.core.arguments import array, number, stamps, suggest_keywords
from imu_sim_ros.core.errors import InputError
from imu_sim_ros.core.records import Readings
from imu_sim_ros.core.types import Array
from imu_sim_ros.jobs.flight import Flight, readings_of
from imu_sim_ros.jobs.readings import judge_readings
from imu_sim_ros.navigation.preintegration import METHODS, Preintegration, between
from imu_sim_ros.navigation.preintegration import preintegrate as over_intervals
from imu_sim_ros.navigation.stepper import check_readings
from imu_sim_ros.recordings.findings.policy import PREINTEGRATE
from imu_sim_ros.recordings.order import READINGS_GAP, gap_length


@suggest_keywords
def preintegrate(
    readings: Flight | Readings | str | Path,
    edges_ns: ArrayLike | None = None,
    *,
    every: float | None = None,
    gyro_bias: ArrayLike = 0.0,
    accel_bias: ArrayLike = 0.0,
    method: str = "midpoint",
    max_gap: float = 0.0,
    topic: str | None = None,
    frame: str | None = None,
    gyro_topic: str | None = None,
    accel_topic: str | None = None,
    gyro_unit: str | None = None,
    accel_unit: str | None = None,
) -> Preintegration:
    """Preintegrate the readings between neighbouring times, all intervals at once.

    ``alpha``, ``beta``, ``gamma`` are position, velocity and attitude in the frame of an interval's
    start, without gravity, with the Jacobian by the biases and the covariance (15, 15), ordered
    alpha, theta, beta, accelerometer's bias, gyroscope's bias. For a flight, the noise is known;
    for other readings, the covariance is zero.

    :param readings: a flight, readings, or a file that :func:`imu_sim_ros.read_imu` reads.
    :param edges_ns: (B + 1,) times of the frames [ns], increasing, within the stamps.
    :param every: instead, the time from frame to frame [s].
    :param gyro_bias: (B, 3), (3,) or one number [rad/s], subtracted from the readings.
    :param accel_bias: likewise [m/s^2].
    :param method: euler or midpoint.
    :param max_gap: longest time between two readings that is integrated over [s]; 0: 2.5 times the
        usual interval, from 0.1 to 2 s.
    :param topic: topic of the readings in a file, if it has several.
    :param frame: frame of the readings, if a topic carries several IMUs.
    :param gyro_topic: topic of the gyroscope, if the accelerometer has another one.
    :param accel_topic: topic of the accelerometer, interpolated to the gyroscope's times.
    :param gyro_unit: unit of the gyroscope in the file: rad/s, deg/s.
    :param accel_unit: unit of the accelerometer in the file: m/s^2, g, mg.
    :returns: a :class:`Preintegration` of all intervals.
    :raises ConfigurationError: for an invalid argument.
    :raises InputError: for times outside the stamps, and for a gap between the first and the last.

    >>> import imu_sim_ros as ims
    >>> flight = ims.simulate(imu="adis16448", trajectory="figure_eight", duration=10)
    >>> increments = ims.preintegrate(flight, every=0.5)
    >>> increments.alpha.shape, increments.covariance.shape
    ((19, 3), (19, 15, 15))
    """
    arguments.choice("method", method, METHODS)
    number("max_gap", max_gap, "a number of seconds, 0 or above", 0.0)
    noise = readings.parameters.imu if isinstance(readings, Flight) else None
    selection = frame, gyro_topic, accel_topic, gyro_unit, accel_unit
    imu = readings_of("readings", readings, topic, selection=selection)
    imu = judge_readings(imu, PREINTEGRATE)
    if (edges_ns is None) == (every is None):
        raise InputError("give the times of the frames, edges_ns, or the time between them, every")
    if every is not None:
        number("every", every, "a number of seconds from 1e-9 to 1e9", 1e-9, 1e9)
        step = round(every * 1e9)
        edges_ns = np.arange(imu.t_ns[0], imu.t_ns[-1] + 1, step)
    edges = stamps("edges_ns", edges_ns)
    max_gap = gap_length(max_gap, READINGS_GAP, imu.t_ns)
    gyro, accel = imu.triads()
    pieces = between(imu.t_ns, gyro, accel, edges)
    begin, end = np.searchsorted(imu.t_ns, [edges[0], edges[-1]])
    used = slice(max(begin - 1, 0), end + 1)
    check_readings(imu.t_ns[used], gyro[used], accel[used], max_gap)
    count = len(pieces.h)
    gyro_bias = _bias("gyro_bias", gyro_bias, count, gate.RATE)
    accel_bias = _bias("accel_bias", accel_bias, count, gate.FORCE)
    return over_intervals(pieces, noise, gyro_bias, accel_bias, method)


def _bias(name: str, values: ArrayLike, count: int, quantity: gate.Quantity) -> Array:
    """Return a bias (count, 3), (3,) or () that readings can have."""
    try:
        dimensions = min(np.ndim(np.asarray(values)), 2)
    except ValueError:  # rows of different lengths
        dimensions = 2
    bias = array(name, values, ((), (3,), (count, 3))[dimensions])
    if (np.abs(bias) > quantity.largest).any():
        arguments.refuse(name, values, f"at most {quantity.largest:g} {quantity.unit}")
    return bias
