"""What an IMU on a moving body reads: the ideal reading, then the errors."""

from imu_sim_ros.sensor.block import ImuBlock
from imu_sim_ros.sensor.variance import accel_variance_discrete, gyro_variance_discrete

__all__ = ["ImuBlock", "accel_variance_discrete", "gyro_variance_discrete"]
