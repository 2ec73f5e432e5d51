"""Per-sample variances, for the covariance fields of the messages."""

from imu_sim_ros.config.imu import ImuParameters
from imu_sim_ros.config.parameter import Vector


def gyro_variance_discrete(parameters: ImuParameters, rate: float) -> Vector:
    """Return the variance of one sample of the gyroscope per axis [rad^2/s^2]."""
    x, y, z = parameters.gyroscope_noise_density
    return (x * x * rate, y * y * rate, z * z * rate)


def accel_variance_discrete(parameters: ImuParameters, rate: float) -> Vector:
    """Return the variance of one sample of the accelerometer per axis [m^2/s^4]."""
    x, y, z = parameters.accelerometer_noise_density
    return (x * x * rate, y * y * rate, z * z * rate)
