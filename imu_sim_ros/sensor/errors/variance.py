# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Per-sample variances, for the covariance fields of the messages.

They are the variances of what differs at random from sample to sample: white noise, as much of it
as the low-pass leaves, and rounding to whole steps, ``LSB^2 / 12`` (uniform, which holds where the
noise spans a step). Biases of every kind are not noise of a sample and are left out.
"""

from imu_sim_ros.config import ImuParameters, Vector
from imu_sim_ros.sensor.errors.noise import axis_values
from imu_sim_ros.sensor.errors.output import noise_gain


def gyro_variance_discrete(imu: ImuParameters, rate: float) -> Vector:
    """Return the variance of one sample of the gyroscope per axis [rad^2/s^2].

    :param rate: samples per second [Hz].
    """
    return _variance_discrete(imu, "gyroscope", rate)


def accel_variance_discrete(imu: ImuParameters, rate: float) -> Vector:
    """Return the variance of one sample of the accelerometer per axis [m^2/s^4].

    :param rate: samples per second [Hz].
    """
    return _variance_discrete(imu, "accelerometer", rate)


def _variance_discrete(imu: ImuParameters, triad: str, rate: float) -> Vector:
    density, cutoff, step = (
        axis_values(imu, triad, name) for name in ("noise_density", "bandwidth", "resolution")
    )
    x, y, z = (
        float(d * d * rate * noise_gain(f, imu.bandwidth_order, rate) + s * s / 12.0)
        for d, f, s in zip(density, cutoff, step, strict=True)
    )
    return (x, y, z)
