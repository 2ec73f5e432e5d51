# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""The random errors of an IMU, as a covariance takes them."""

from typing import Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

_NONE: Final = np.zeros(3)


class Noise(NamedTuple):
    """Sizes of the errors, each (3,) per axis, named as the parameters of an IMU are.

    The first four are densities in continuous time with kalibr's names and units. Preintegration
    takes these alone, :mod:`imu_sim_ros.navigation.covariance` takes them all.
    """

    gyroscope_noise_density: Array
    """[rad/s/sqrt(Hz)]"""
    gyroscope_random_walk: Array
    """[rad/s^2/sqrt(Hz)]"""
    accelerometer_noise_density: Array
    """[m/s^2/sqrt(Hz)]"""
    accelerometer_random_walk: Array
    """[m/s^3/sqrt(Hz)]"""
    gyroscope_gauss_markov_sigma: Array = _NONE
    """[rad/s]"""
    gyroscope_gauss_markov_density: Array = _NONE
    """[rad/s^2/sqrt(Hz)]"""
    gyroscope_correlation_time: Array = _NONE
    """[s]"""
    gyroscope_bias_instability: Array = _NONE
    """[rad/s]"""
    gyroscope_turn_on_scale_sigma: Array = _NONE
    """[1]"""
    gyroscope_misalignment_sigma: Array = _NONE
    """[1]"""
    gyroscope_quadratic_sigma: Array = _NONE
    """[1/(rad/s)]"""
    gyroscope_g_sensitivity_sigma: Array = _NONE
    """[(rad/s)/(m/s^2)]"""
    gyroscope_resolution: Array = _NONE
    """[rad/s]"""
    accelerometer_gauss_markov_sigma: Array = _NONE
    """[m/s^2]"""
    accelerometer_gauss_markov_density: Array = _NONE
    """[m/s^3/sqrt(Hz)]"""
    accelerometer_correlation_time: Array = _NONE
    """[s]"""
    accelerometer_bias_instability: Array = _NONE
    """[m/s^2]"""
    accelerometer_turn_on_scale_sigma: Array = _NONE
    """[1]"""
    accelerometer_misalignment_sigma: Array = _NONE
    """[1]"""
    accelerometer_quadratic_sigma: Array = _NONE
    """[1/(m/s^2)]"""
    accelerometer_resolution: Array = _NONE
    """[m/s^2]"""


def noise_of(parameters: object) -> Noise:
    """Return the noise that a section of parameters describes; each has the fields of `Noise`."""
    return Noise(*(np.asarray(getattr(parameters, name), dtype=float) for name in Noise._fields))
