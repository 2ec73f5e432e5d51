# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""The covariance of a dead-reckoned state, from every error of the IMU that is known in size."""

from imu_sim_ros.navigation.covariance.propagation import (
    ACCEL_BIAS,
    ATTITUDE,
    GYRO_BIAS,
    POSITION,
    SIZE,
    VELOCITY,
    Covariance,
    initial_covariance,
    propagate,
)
from imu_sim_ros.navigation.covariance.rest import after_rest
from imu_sim_ros.navigation.covariance.slow_errors import of_mean, processes, response_terms

__all__ = [
    "ACCEL_BIAS",
    "ATTITUDE",
    "GYRO_BIAS",
    "POSITION",
    "SIZE",
    "VELOCITY",
    "Covariance",
    "after_rest",
    "initial_covariance",
    "of_mean",
    "processes",
    "propagate",
    "response_terms",
]
