# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""ORB_SLAM3: the IMU's part of a settings file (src/Settings.cc, readIMU)."""

from imu_sim_ros.bags.text import decimal
from imu_sim_ros.consumers.values import ImuValues, comment, remarks


def settings(values: ImuValues) -> str:
    """Return the IMU's keys of a settings file, without ``IMU.T_b_c1``, which needs a camera."""
    head = comment(
        [
            "ORB_SLAM3, fragment: the IMU's keys, to be pasted into a settings file with cameras; "
            "IMU.T_b_c1 comes with them.",
            "Continuous-time densities, as the simulation has them; it multiplies the noise by the "
            "square root of the frequency itself.",
            *remarks(values),
        ]
    )
    return (
        f"%YAML:1.0\n{head}"
        f"IMU.NoiseGyro: {decimal(values.one('gyroscope_noise_density'))}\n"
        f"IMU.NoiseAcc: {decimal(values.one('accelerometer_noise_density'))}\n"
        f"IMU.GyroWalk: {decimal(values.one('gyroscope_random_walk'))}\n"
        f"IMU.AccWalk: {decimal(values.one('accelerometer_random_walk'))}\n"
        f"IMU.Frequency: {decimal(values.rate)}\n"
    )
