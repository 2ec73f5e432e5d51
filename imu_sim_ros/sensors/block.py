# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""A block of samples: what the IMU reports, and the truth of it."""

from collections.abc import Mapping
from types import MappingProxyType
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from imu_sim_ros.trajectory.motion import Motion
from imu_sim_ros.types import Array


class ImuBlock(NamedTuple):
    """n consecutive samples of one IMU; all arrays but ``delivered`` have n rows.

    Samples of the board's auxiliary sensors in the same window of time are with them on request.
    """

    first: int
    """Index of the first sample."""
    true_t_ns: NDArray[np.int64]
    """(n,) true times of the samples [ns]."""
    t_ns: NDArray[np.int64]
    """(n,) the stamps of the messages, with the errors of the sensor's clock [ns]."""
    release_t_ns: NDArray[np.int64]
    """(n,) when a message leaves the driver: true time and transport latency [ns]."""
    delivered: NDArray[np.int64]
    """(m,) rows that are delivered, in order: dropped ones are missing, duplicates occur twice."""
    gyro: Array
    """(n, 3) reading of the gyroscope [rad/s]."""
    accel: Array
    """(n, 3) reading of the accelerometer [m/s^2]."""
    temperature: Array
    """(n,) temperature of the sensor [degC]."""
    ideal_gyro: Array
    """(n, 3) angular rate of the IMU in its own frame, without any error [rad/s]."""
    ideal_accel: Array
    """(n, 3) specific force at the IMU in its own frame, without any error [m/s^2]."""
    gyro_bias: Array
    """(n, 3) sum of all bias terms of the gyroscope [rad/s]."""
    accel_bias: Array
    """(n, 3) sum of all bias terms of the accelerometer [m/s^2]."""
    gyro_scale: Array
    """(n, 3) scale factor of the gyroscope from turn-on and temperature; 1 without error."""
    accel_scale: Array
    """(n, 3) scale factor of the accelerometer from turn-on and temperature; 1 without error."""
    motion: Motion
    """The body's motion at ``true_t_ns``."""
    auxiliary: Mapping[str, Any] = MappingProxyType({})
    """Samples of the board's auxiliary sensors by what they measure, on request."""
