# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Names, symbols and units of the noise parameters, in SI and as data sheets print them."""

from typing import Final, NamedTuple

import numpy as np

from imu_sim_ros.conventions import STANDARD_GRAVITY

_DEGREES: Final = 180.0 / np.pi
_HOUR: Final = 3600.0
_MILLI_G: Final = 1e3 / STANDARD_GRAVITY


class Quantity(NamedTuple):
    """How one parameter of one triad is shown."""

    symbol: str
    text: str
    unit: str
    field_unit: str
    field_factor: float
    """Value in ``field_unit`` of 1 in ``unit``."""


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
KEYS: Final = tuple(_TEXTS)


def quantity(triad: str, key: str) -> Quantity:
    """Return how a parameter of ``gyroscope`` or ``accelerometer`` is shown."""
    unit, field_unit, factor = _UNITS[(triad, key)]
    return Quantity(*_TEXTS[key], unit, field_unit, float(factor))
