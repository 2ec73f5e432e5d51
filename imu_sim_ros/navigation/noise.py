# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""The random errors of an IMU, as a covariance takes them."""

from typing import NamedTuple, Protocol

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
_Vector = tuple[float, float, float]


class NoiseSource(Protocol):
    """Any section of parameters with the four numbers of the noise, per axis."""

    @property
    def gyroscope_noise_density(self) -> _Vector:
        """[rad/s/sqrt(Hz)]"""

    @property
    def gyroscope_random_walk(self) -> _Vector:
        """[rad/s^2/sqrt(Hz)]"""

    @property
    def accelerometer_noise_density(self) -> _Vector:
        """[m/s^2/sqrt(Hz)]"""

    @property
    def accelerometer_random_walk(self) -> _Vector:
        """[m/s^3/sqrt(Hz)]"""


class Noise(NamedTuple):
    """Densities in continuous time, each (3,) per axis; names and units are kalibr's."""

    gyroscope_noise_density: Array
    """[rad/s/sqrt(Hz)]"""
    gyroscope_random_walk: Array
    """[rad/s^2/sqrt(Hz)]"""
    accelerometer_noise_density: Array
    """[m/s^2/sqrt(Hz)]"""
    accelerometer_random_walk: Array
    """[m/s^3/sqrt(Hz)]"""


def noise_of(parameters: NoiseSource) -> Noise:
    """Return the noise that a section of parameters describes."""
    return Noise(*(np.asarray(getattr(parameters, name), dtype=float) for name in Noise._fields))
