# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""A block of samples: what the IMU reports, and the truth beside it."""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from imu_sim_ros.trajectory.motion import Motion

Array = NDArray[np.float64]


class MagneticBlock(NamedTuple):
    """n samples of a magnetometer, in the window of time of the IMU's block."""

    true_t_ns: NDArray[np.int64]
    """(n,) true times [ns]."""
    t_ns: NDArray[np.int64]
    """(n,) the stamps of the messages, with the errors of the board's clock [ns]."""
    release_t_ns: NDArray[np.int64]
    """(n,) when a message leaves the driver [ns]."""
    delivered: NDArray[np.int64]
    """(m,) rows that are delivered, in order."""
    field: Array
    """(n, 3) reading [T]."""
    ideal_field: Array
    """(n, 3) field at the IMU in its own frame, without any error [T]."""
    bias: Array
    """(n, 3) what in the reading does not depend on the field, without white noise [T]."""


class PressureBlock(NamedTuple):
    """n samples of a barometer, in the window of time of the IMU's block."""

    true_t_ns: NDArray[np.int64]
    """(n,) true times [ns]."""
    t_ns: NDArray[np.int64]
    """(n,) the stamps of the messages, with the errors of the board's clock [ns]."""
    release_t_ns: NDArray[np.int64]
    """(n,) when a message leaves the driver [ns]."""
    delivered: NDArray[np.int64]
    """(m,) rows that are delivered, in order."""
    pressure: Array
    """(n,) reading [Pa]."""
    ideal_pressure: Array
    """(n,) of the still air at the IMU's height [Pa]."""
    bias: Array
    """(n,) what is added to it, without white noise and rounding [Pa]."""


class OrientationBlock(NamedTuple):
    """n orientations that a board states, at samples of the IMU's block."""

    true_t_ns: NDArray[np.int64]
    """(n,) true times [ns]."""
    t_ns: NDArray[np.int64]
    """(n,) the stamps of the messages [ns]."""
    release_t_ns: NDArray[np.int64]
    """(n,) when a message leaves the driver [ns]."""
    delivered: NDArray[np.int64]
    """(m,) rows that are delivered, in order."""
    q_wi: Array
    """(n, 4) orientation of the IMU in the world."""
    variance: Array
    """(n, 3) stated, of the error about the world's axes [rad^2]; 0: unknown."""
    ideal_q_wi: Array
    """(n, 4) the true one."""
    rows: NDArray[np.int64]
    """(n,) rows of the IMU's block that they belong to."""


class ImuBlock(NamedTuple):
    """n consecutive samples of one IMU; all arrays but ``delivered`` have n rows.

    Samples of the board's other sensors in the same window of time stand beside them on request.
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
    magnetic_field: MagneticBlock | None = None
    pressure: PressureBlock | None = None
    orientation: OrientationBlock | None = None
