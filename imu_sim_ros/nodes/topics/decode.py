# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""The fields of Imu and Odometry messages that the integrator reads from their bytes."""

from typing import Final, NamedTuple

from imu_sim_ros.bags.messages import IMU, ODOMETRY, MessageDecoder
from imu_sim_ros.errors import InputError
from imu_sim_ros.timebase import NANOSECONDS_PER_SECOND

Vector = tuple[float, float, float]
Quaternion = tuple[float, float, float, float]


class ImuReading(NamedTuple):
    """The fields of a sensor_msgs/Imu that the integrator uses."""

    t_ns: int
    gyro: Vector
    """[rad/s]"""
    accel: Vector
    """[m/s^2]"""


class Truth(NamedTuple):
    """The fields of a nav_msgs/Odometry that the integrator uses."""

    t_ns: int
    position: Vector
    """[m]"""
    q_wb: Quaternion
    """(w, x, y, z)"""
    velocity_b: Vector
    """of the body, in the body frame [m/s]"""
    angular_velocity_b: Vector
    """[rad/s]"""


_READINGS: Final = ("angular_velocity", "linear_acceleration")
_STATES: Final = ("position", "orientation", "linear", "angular")
_imu = MessageDecoder(IMU, _READINGS)
_odometry = MessageDecoder(ODOMETRY, _STATES)


def imu_reading(payload: bytes) -> ImuReading:
    """Return the reading in a sensor_msgs/Imu.

    :raises InputError: for bytes that are not such a message in little-endian CDR.
    """
    second, nanosecond, gx, gy, gz, ax, ay, az = _imu.numbers(payload)
    if second < 0:
        raise _before_epoch(second)
    t_ns = second * NANOSECONDS_PER_SECOND + nanosecond
    return ImuReading(t_ns, (gx, gy, gz), (ax, ay, az))


def truth(payload: bytes) -> Truth:
    """Return the state in a nav_msgs/Odometry.

    :raises InputError: for bytes that are not such a message in little-endian CDR.
    """
    values = _odometry.numbers(payload)
    x, y, z, w = values[5:9]
    if values[0] < 0:
        raise _before_epoch(values[0])
    t_ns = values[0] * NANOSECONDS_PER_SECOND + values[1]
    return Truth(t_ns, values[2:5], (w, x, y, z), values[9:12], values[12:])


def _before_epoch(second: int) -> InputError:
    return InputError(f"negative timestamp: {second} s")
