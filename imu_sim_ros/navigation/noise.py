# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""The random errors of an IMU, as used by a covariance."""

from typing import Final, NamedTuple

import numpy as np

from imu_sim_ros.navigation.parameters import IntegratorImuParameters
from imu_sim_ros.sensors.imu.parameters import ImuParameters
from imu_sim_ros.types import Array

_NONE: Final = np.zeros(3)


class TriadErrors(NamedTuple):
    """Sizes of a triad's errors, each (3,) per axis, named as the parameters of an IMU are.

    Below, u is the unit of the readings: rad/s or m/s^2. The first two are densities in continuous
    time with kalibr's names.
    """

    noise_density: Array = _NONE
    """[u/sqrt(Hz)]"""
    random_walk: Array = _NONE
    """[u/s/sqrt(Hz)]"""
    gauss_markov_sigma: Array = _NONE
    """[u]"""
    gauss_markov_density: Array = _NONE
    """[u/s/sqrt(Hz)]"""
    correlation_time: Array = _NONE
    """[s]"""
    bias_instability: Array = _NONE
    """[u]"""
    turn_on_scale_sigma: Array = _NONE
    """[1]"""
    misalignment_sigma: Array = _NONE
    """[1]"""
    quadratic_sigma: Array = _NONE
    """[1/u]"""
    g_sensitivity_sigma: Array = _NONE
    """[u/(m/s^2)], of the gyroscope alone"""
    resolution: Array = _NONE
    """[u]"""


class ImuErrors(NamedTuple):
    """Sizes of the errors of both triads."""

    gyroscope: TriadErrors = TriadErrors()
    accelerometer: TriadErrors = TriadErrors()


def noise_of(parameters: ImuParameters | IntegratorImuParameters) -> ImuErrors:
    """Return the errors that a section of parameters describes."""
    gyroscope, accelerometer = (
        TriadErrors(*(np.asarray(getattr(triad, name), float) for name in TriadErrors._fields))
        for triad in (parameters.gyroscope, parameters.accelerometer)
    )
    return ImuErrors(gyroscope, accelerometer)
