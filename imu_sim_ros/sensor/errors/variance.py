# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Per-sample variances, for the covariance fields of the messages.

They are the variances of what varies at random from sample to sample: white noise, as much of it
as the low-pass leaves, and rounding to whole steps, ``LSB^2 / 12`` (uniform, which holds where the
noise spans a step; twice that for increments, whose sums are rounded). Biases of every kind are
not noise of a sample and are left out.
"""

import numpy as np

from imu_sim_ros.config import ImuParameters, TriadParameters, Vector
from imu_sim_ros.sensor.errors.output import noise_gain


def gyro_variance_discrete(imu: ImuParameters, rate: float) -> Vector:
    """Return the variance of one sample of the gyroscope per axis [rad^2/s^2].

    :param rate: samples per second [Hz].
    """
    return _variance_discrete(imu, imu.gyroscope, rate)


def accel_variance_discrete(imu: ImuParameters, rate: float) -> Vector:
    """Return the variance of one sample of the accelerometer per axis [m^2/s^4].

    :param rate: samples per second [Hz].
    """
    return _variance_discrete(imu, imu.accelerometer, rate)


def field_variance_discrete(imu: ImuParameters) -> Vector:
    """Return the variance of one sample of the magnetometer per axis [T^2]."""
    p = imu.magnetometer
    density, step = np.asarray(p.noise_density), np.asarray(p.resolution)
    x, y, z = (density * density * p.rate + step * step / 12.0).tolist()
    return (x, y, z)


def pressure_variance_discrete(imu: ImuParameters) -> float:
    """Return the variance of one sample of the barometer [Pa^2]."""
    p = imu.barometer
    return p.noise_density**2 * p.rate + p.resolution**2 / 12.0


def _variance_discrete(imu: ImuParameters, triad: TriadParameters, rate: float) -> Vector:
    internal = rate * float(imu.internal_ratio(rate))
    white = [
        d * d * internal * noise_gain(f, imu.bandwidth_order, internal)
        for d, f in zip(triad.noise_density, triad.bandwidth, strict=True)
    ]
    step, increment = np.asarray(triad.resolution), np.asarray(triad.increment_resolution)
    rounding = step * step / 12.0 + np.square(increment * rate) / 6.0
    x, y, z = (float(w + r) for w, r in zip(white, rounding, strict=True))
    return (x, y, z)
