# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""The sensor of one run: the constants drawn from its seed, in place of the parameters."""

import dataclasses

from imu_sim_ros.conventions import TRIADS
from imu_sim_ros.sensors.barometer.parameters import BarometerParameters
from imu_sim_ros.sensors.errors.realised import as_matrix, unit_of_seed, with_turn_on
from imu_sim_ros.sensors.errors.response import TurnOn
from imu_sim_ros.sensors.imu.parameters import ImuParameters
from imu_sim_ros.sensors.imu.triads import TriadParameters
from imu_sim_ros.sensors.magnetometer.parameters import MagnetometerParameters


def realised_imu(imu: ImuParameters, seed: int) -> ImuParameters:
    """Return the IMU of this seed with nothing left to draw but the noise.

    Constants that differ from unit to unit are drawn. A turn-on bias is added to the constant one.
    A turn-on scale s, drawn per axis, multiplies the whole response of its axis,
    ``(1 + s + c) (S x + q x^2 + G f + H f^2)`` with the parts c of temperature and age: which
    parameters it multiplies and which it divides, their declarations say (``turn_on_scale``).
    Readings of the result differ from those of the seed by rounding only.
    """
    gyroscope, accelerometer = (_realised(imu.triad(name), name, seed) for name in TRIADS)
    magnetometer = imu.magnetometer
    if magnetometer != MagnetometerParameters():
        from imu_sim_ros.sensors.magnetometer.model import (
            realised_magnetometer,  # most boards have none
        )

        magnetometer = realised_magnetometer(magnetometer, seed)
    return dataclasses.replace(
        imu,
        gyroscope=gyroscope,
        accelerometer=accelerometer,
        magnetometer=magnetometer,
        barometer=_realised_barometer(imu.barometer, seed),
    )


def _realised(parameters: TriadParameters, triad: str, seed: int) -> TriadParameters:
    p = unit_of_seed(parameters, triad, seed)
    p = dataclasses.replace(p, **as_matrix(p.response()))
    result: TriadParameters = with_turn_on(p, TurnOn(seed, triad, p))
    return result


def _realised_barometer(own: BarometerParameters, seed: int) -> BarometerParameters:
    """Return the barometer, whose errors are those of a triad's first axis."""
    p = _realised(own.as_triad(), "barometer", seed)
    return dataclasses.replace(
        own,
        bias=p.bias[0],
        turn_on_bias_sigma=0.0,
        temperature_bias=p.temperature_bias[::3],
        temperature_bias_sigma=0.0,
    )
