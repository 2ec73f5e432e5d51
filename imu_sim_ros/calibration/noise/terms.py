# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""The terms of an inertial sensor's random error: spectrum, Allan deviation, name and unit."""

from collections.abc import Callable
from typing import Final, NamedTuple

import numpy as np

from imu_sim_ros.calibration.noise.spectrum import CLUSTER, Spectrum
from imu_sim_ros.core.conventions import STANDARD_GRAVITY
from imu_sim_ros.core.types import Array

_DEGREES: Final = 180.0 / np.pi
_HOUR: Final = 3600.0
"""One hour [s]."""
_MILLI_G: Final = 1e3 / STANDARD_GRAVITY


class QuantityFormat(NamedTuple):
    """Presentation of one parameter of one triad."""

    symbol: str
    text: str
    unit: str
    field_unit: str
    field_factor: float
    """Value in ``field_unit`` of 1 ``unit``."""


_TEXTS: Final = {
    "noise_density": ("N", "white noise"),
    "random_walk": ("K", "random walk"),
    "bias_instability": ("B", "bias instability"),
    "quantisation": ("Q", "quantisation"),
    "rate_ramp": ("R", "rate ramp"),
    "gauss_markov_sigma": ("sigma", "Gauss-Markov sigma"),
    "correlation_time": ("tau", "Gauss-Markov correlation time"),
}
_UNITS: Final = {
    ("gyroscope", "noise_density"): ("rad/s/sqrt(Hz)", "deg/sqrt(h)", _DEGREES * _HOUR**0.5),
    ("gyroscope", "random_walk"): ("rad/s^2/sqrt(Hz)", "deg/h/sqrt(h)", _DEGREES * _HOUR**1.5),
    ("gyroscope", "bias_instability"): ("rad/s", "deg/h", _DEGREES * _HOUR),
    ("gyroscope", "quantisation"): ("rad", "arcsec", _DEGREES * 3600.0),
    ("gyroscope", "rate_ramp"): ("rad/s^2", "deg/h/h", _DEGREES * _HOUR**2),
    ("gyroscope", "gauss_markov_sigma"): ("rad/s", "deg/h", _DEGREES * _HOUR),
    ("gyroscope", "correlation_time"): ("s", "s", 1.0),
    ("accelerometer", "noise_density"): ("m/s^2/sqrt(Hz)", "m/s/sqrt(h)", _HOUR**0.5),
    ("accelerometer", "random_walk"): ("m/s^3/sqrt(Hz)", "m/s^2/sqrt(h)", _HOUR**0.5),
    ("accelerometer", "bias_instability"): ("m/s^2", "mg", _MILLI_G),
    ("accelerometer", "quantisation"): ("m/s", "m/s", 1.0),
    ("accelerometer", "rate_ramp"): ("m/s^3", "mg/h", _MILLI_G * _HOUR),
    ("accelerometer", "gauss_markov_sigma"): ("m/s^2", "mg", _MILLI_G),
    ("accelerometer", "correlation_time"): ("s", "s", 1.0),
}
QUANTITIES: Final = {
    (triad, key): QuantityFormat(*_TEXTS[key], unit, field_unit, float(factor))
    for (triad, key), (unit, field_unit, factor) in _UNITS.items()
}
"""Presentation of the parameters of ``gyroscope`` and ``accelerometer``."""


FLICKER_FLOOR: Final = float(np.sqrt(2.0 * np.log(2.0) / np.pi))
"""Flat Allan deviation of a bias instability of 1: 0.664."""


class Term(NamedTuple):
    """One term with a coefficient whose square is proportional to its part of the spectrum."""

    key: str
    """Name in results."""
    expectation: Callable[[Spectrum], Array]
    """(m,) expected row of the spectrum for a coefficient of 1."""
    deviation: Callable[[Array], Array]
    """Allan deviation at cluster times for a coefficient of 1."""


def _white(spectrum: Spectrum) -> Array:
    """Return the spectrum (m,) of white noise with a density of 1."""
    return np.ones(len(spectrum.frequency))


def _walk(spectrum: Spectrum) -> Array:
    """Return ``tau^2 (1 / (4 sin^2(pi f tau)) - (1 - 1/c^2) / 6)`` for averages of c samples.

    Averages of a walk: their differences have the covariance q tau (2/3, 1/6), a tridiagonal
    matrix again, so that the cosine transform still diagonalises it exactly.
    """
    tau = spectrum.interval
    samples = np.where(tau > 1.5 * spectrum.sample_interval, CLUSTER, 1)
    sine = 4.0 * np.sin(np.pi * spectrum.frequency * tau) ** 2
    return tau**2 * (1.0 / sine - (1.0 - 1.0 / samples**2) / 6.0)


def _flicker(spectrum: Spectrum) -> Array:
    """Return ``g(k) / (2 pi f)``: a coefficient k sees less of 1/f noise than the density at f.

    The exact integral of 1/f over the response of the k-th cosine on a finite record is the
    density times ``g = (2 / pi) (Si(pi k) - (1 - (-1)^k) / (pi k))``: 0.77, 0.90, 0.93, ... 1.
    """
    from scipy.special import sici

    order = np.where(spectrum.order > 0, spectrum.order, 1e9)
    odd = (spectrum.order % 2 == 1).astype(np.float64)
    edge = 2.0 / np.pi * (sici(np.pi * order)[0] - 2.0 * odd / (np.pi * order))
    return edge / (2.0 * np.pi * spectrum.frequency)


def _quantisation(spectrum: Spectrum) -> Array:
    """Return the spectrum (m,) of quantisation noise with a coefficient of 1."""
    sine = np.sin(np.pi * spectrum.frequency * spectrum.interval)
    return 4.0 * sine**2 / spectrum.interval


def gauss_markov_expectation(spectrum: Spectrum, correlation_time: float) -> Array:
    """Return the expected rows for a first-order Gauss-Markov process with sigma = 1.

    The discrete-time density ``dt (1 - phi^2) / |1 - phi e^{i w}|^2``, ``phi = exp(-dt / T)``,
    times the exact effect of the record's edges,
    ``1 - 2 b (1 - (-1)^k e^{-b D}) / (D (a^2 + b^2))`` with ``b = 1 / T``, ``a = 2 pi f`` and the
    record's length D.
    """
    dt, b = spectrum.sample_interval, 1.0 / correlation_time
    phi = np.exp(-dt * b)
    angle = 2.0 * np.pi * spectrum.frequency
    half_sine = np.sin(0.5 * angle * dt)
    density = dt * (1.0 - phi**2) / ((1.0 - phi) ** 2 + 4.0 * phi * half_sine**2)
    sign = np.where(spectrum.order > 0, (-1.0) ** spectrum.order, 0.0)
    duration = spectrum.duration
    edge = 2.0 * b * (1.0 - sign * np.exp(-b * duration)) / (duration * (angle**2 + b**2))
    return density * (1.0 - edge)


def gauss_markov_deviation(tau: Array, correlation_time: float) -> Array:
    """Return the Allan deviation of a Gauss-Markov process with sigma = 1 (IEEE 952 eq. C.17).

    :param tau: cluster times [s].
    """
    x = tau / correlation_time
    # 2/x (1 - (3 - 4 e^-x + e^-2x) / (2x)) is 2 x / 3 for small x, where it cancels.
    small = x < 1e-3
    safe = np.where(small, 1.0, x)
    exact = 2.0 / safe * (1.0 - (3.0 - 4.0 * np.exp(-safe) + np.exp(-2.0 * safe)) / (2.0 * safe))
    return np.sqrt(np.where(small, 2.0 * x / 3.0, exact))


WHITE: Final = Term("noise_density", _white, lambda tau: 1.0 / np.sqrt(tau))
FLICKER: Final = Term("bias_instability", _flicker, lambda tau: np.full(len(tau), FLICKER_FLOOR))
WALK: Final = Term("random_walk", _walk, lambda tau: np.sqrt(tau / 3.0))
QUANTISATION: Final = Term("quantisation", _quantisation, lambda tau: np.sqrt(3.0) / tau)
TERMS: Final = (QUANTISATION, WHITE, FLICKER, WALK)
"""The random terms, by increasing cluster time; the ramp is a trend and treated separately."""


def ramp_amplitude(spectrum: Spectrum) -> Array:
    """Return (m,) the additions of a rate ramp of 1 per second to the single coefficients.

    The cosine transform of a straight line: ``-sqrt(2 D) D 2 / (pi k)^2`` for odd k (in the scaling
    of :class:`Spectrum`), 0 for even k, exact to ``(k / n)^2``.
    """
    order = np.where(spectrum.order % 2 == 1, spectrum.order, np.inf)
    duration = np.where(np.isfinite(spectrum.duration), spectrum.duration, 0.0)
    return -2.0 * np.sqrt(2.0) * duration**1.5 / (np.pi * order) ** 2


def ramp_deviation(tau: Array) -> Array:
    """Return the Allan deviation of a rate ramp of 1 per second."""
    return tau / np.sqrt(2.0)
