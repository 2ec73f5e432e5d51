# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""The sensor of one run: the constants drawn from its seed, in place of the parameters."""

import dataclasses
from typing import Any

import numpy as np

from imu_sim_ros.config import (
    ZERO_VECTOR,
    ImuParameters,
    SimulationParameters,
    TriadParameters,
)
from imu_sim_ros.config.auxiliary import MagnetometerParameters
from imu_sim_ros.conventions import TRIADS
from imu_sim_ros.sensor.errors import TurnOn, as_matrix, unit_of_seed


def realised_imu(parameters: SimulationParameters) -> ImuParameters:
    """Return the IMU of this seed with nothing left to draw but the noise.

    Constants that differ from unit to unit are drawn. A turn-on bias is added to the constant one.
    A turn-on scale s, drawn per axis, multiplies the whole response of its axis,
    ``(1 + s + c) (S x + q x^2 + G f + H f^2)`` with the parts c of temperature and age: it goes
    into S, q, G and H, and c becomes ``c / (1 + s)``. Readings of the result differ from those of
    the seed by rounding only.
    """
    imu = parameters.imu
    gyroscope, accelerometer = (
        _realised(imu.triad(name), name, parameters.seed) for name in TRIADS
    )
    magnetometer = imu.magnetometer
    if magnetometer != MagnetometerParameters():
        from imu_sim_ros.sensor.auxiliary import realised_magnetometer  # most boards have none

        magnetometer = realised_magnetometer(magnetometer, parameters.seed)
    return dataclasses.replace(
        imu, gyroscope=gyroscope, accelerometer=accelerometer, magnetometer=magnetometer
    )


def _realised(parameters: TriadParameters, triad: str, seed: int) -> TriadParameters:
    p = unit_of_seed(parameters, triad, seed)
    drawn = TurnOn(seed, triad, p)
    gain = 1.0 + drawn.scale
    values = {
        "bias": np.asarray(p.bias) + drawn.bias,
        "quadratic": gain * p.quadratic,
        "g_sensitivity": gain[:, None] * np.reshape(p.g_sensitivity, (3, 3)),
        "g_squared_sensitivity": gain[:, None] * np.reshape(p.g_squared_sensitivity, (3, 3)),
        "temperature_scale": np.reshape(p.temperature_scale, (-1, 3)) / gain,
        "ageing_scale": np.asarray(p.ageing_scale) / gain,
    }
    changed: dict[str, Any] = {name: tuple(np.ravel(v).tolist()) for name, v in values.items()}
    changed |= as_matrix(gain[:, None] * p.response())
    changed |= {"turn_on_bias_sigma": ZERO_VECTOR, "turn_on_scale_sigma": ZERO_VECTOR}
    return dataclasses.replace(p, **changed)
