# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Bias and scale against temperature, from soak or ramp runs."""

from collections.abc import Mapping
from typing import Final, NamedTuple

import numpy as np

from imu_sim_ros.calibration.deterministic.positions import observations
from imu_sim_ros.calibration.deterministic.response import (
    AxisResponse,
    Observations,
    fit_axis,
    is_distinguishable,
    walk_whitener,
)
from imu_sim_ros.calibration.deterministic.steady import Steady
from imu_sim_ros.core.conventions import TRIADS
from imu_sim_ros.core.errors import InputError
from imu_sim_ros.core.types import Array, Integers

HIGHEST_ORDER: Final = 4
"""Highest order of the polynomial over temperature."""
_SMALLEST_SPAN: Final = 5.0
"""Smallest range of temperatures [K]."""
_STEP: Final = 1.0
"""Difference of temperatures [K] below which they count as one for the highest order."""


class TriadTemperature(NamedTuple):
    """One triad: ``reading = (1 + s(T - T0)) (S x + G f) + b(T - T0)``."""

    axes: tuple[AxisResponse, ...]
    inputs: Array
    """(m, p) inputs of the gain of each axis; p is 0 if there is only one orientation."""
    readings: Array
    """(m, 3) fitted readings, less the known input if p is 0."""
    difference: Array
    """(m,) T - T0 [K]."""


class Temperature(NamedTuple):
    """Both triads against temperature."""

    reference: float
    """Reference temperature T0 [degC]."""
    triads: Mapping[str, TriadTemperature]
    """Fit of each triad by its name, ``gyroscope`` and ``accelerometer``."""


def calibrate_temperature(
    steady: Steady, temperature: Array, rate: Array, force: Array, reference: float
) -> Temperature:
    """Return both triads' bias and scale as polynomials of the temperature.

    The orders are those of the smallest Bayesian information criterion (Schwarz 1978), for bias and
    scale each from 1 to 4, at most one less than there are different temperatures. (Without a
    slope that is merely uncertain, the values at T0 would look surer than they are.)

    :param steady: stretches at rest or at constant rates.
    :param temperature: (m,) temperature of the sensor in each piece [degC].
    :param rate: (m, 3) true angular rates [rad/s].
    :param force: (m, 3) true specific forces [m/s^2].
    :param reference: T0 [degC].
    :raises InputError: for temperatures that barely differ.
    """
    span = float(np.ptp(temperature))
    if span < _SMALLEST_SPAN:
        raise InputError(
            f"temperatures from {temperature.min():.1f} to {temperature.max():.1f} degC: "
            f"they must span at least {_SMALLEST_SPAN:g} K"
        )
    difference = temperature - reference
    both = np.concatenate([rate, force], axis=1)
    gyro_inputs = next((x for x in (both, rate) if is_distinguishable(x)), rate[:, :0])
    accel_inputs = force if is_distinguishable(force) else force[:, :0]
    gyro = _triad(steady, gyro_inputs, steady.gyro, rate, steady.gyro_sigma, difference)
    accel = _triad(steady, accel_inputs, steady.accel, force, steady.accel_sigma, difference)
    return Temperature(reference, dict(zip(TRIADS, (gyro, accel), strict=True)))


def _triad(
    steady: Steady,
    inputs: Array,
    readings: Array,
    true_inputs: Array,
    sigma: Array,
    difference: Array,
) -> TriadTemperature:
    """Return the fit of one triad.

    :param inputs: (m, p) known inputs; p is 0 if there is only one orientation.
    :param readings: (m, 3) mean readings.
    :param true_inputs: (m, 3) true rates or forces.
    :param sigma: (m, 3) standard errors of the readings.
    :param difference: (m,) T - T0 [K].
    """
    if inputs.shape[1] == 0:  # one orientation: every change is attributed to the bias
        readings = readings - true_inputs
    axes = tuple(
        _select_order(observations(steady, inputs, readings, sigma, k, difference))
        for k in range(3)
    )
    return TriadTemperature(axes, inputs, readings, difference)


def _select_order(data: Observations) -> AxisResponse:
    """Return the fit with the orders that the criterion prefers."""
    different = len(np.unique(np.round(data.temperature / _STEP)))
    highest = min(HIGHEST_ORDER, different - 1)
    highest_scale = highest if data.inputs.shape[1] else 0
    whitener = walk_whitener(data, highest, highest_scale)
    fits = [
        fit_axis(data, bias_order, scale_order, whitener)
        for bias_order in range(1, highest + 1)
        for scale_order in range(min(1, highest_scale), highest_scale + 1)
    ]
    return min(fits, key=lambda fitted: fitted.criterion)


def polynomial_sigma(powers: Array, covariance: Array) -> Array:
    """Return (n,) the standard error of a polynomial.

    :param powers: (n, k) powers of the temperature difference.
    :param covariance: (k, k) covariance of the coefficients.
    """
    variance = np.sum((powers @ covariance) * powers, axis=1)
    return np.sqrt(np.maximum(variance, 0.0))


def temperatures_at(steady: Steady, t_ns: Integers, temperature: Array) -> Array:
    """Return (m,) the temperature in the middle of each piece, interpolated.

    :param t_ns: (n,) stamps of the temperature messages.
    :param temperature: (n,) temperatures of the messages [degC].
    :raises InputError: for no message, or pieces outside the messages' time.
    """
    if len(t_ns) == 0:
        raise InputError("no temperature messages")
    start = int(steady.begin_ns[0])
    message_times = (t_ns - start) * 1e-9
    piece_times = steady.time
    slack = 10.0
    if message_times[0] > piece_times[0] + slack or message_times[-1] < piece_times[-1] - slack:
        raise InputError(
            f"temperature messages from {message_times[0]:.1f} to {message_times[-1]:.1f} s do not "
            f"span the readings from {piece_times[0]:.1f} to {piece_times[-1]:.1f} s"
        )
    return np.interp(piece_times, message_times, temperature)
