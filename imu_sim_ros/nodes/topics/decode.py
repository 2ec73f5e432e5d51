# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""The numbers in the CDR bytes of Imu and Odometry messages, without making message objects.

Deserialising an Imu takes 15 us, unpacking its nine numbers at known places one. The places depend
on the lengths of the frames' names alone; they are worked out once for each length.
"""

import struct
from functools import cache
from typing import NamedTuple

from imu_sim_ros.errors import InputError

_HEADER = 4
"""Bytes of encapsulation before the message; alignment counts from behind them."""
_LITTLE_ENDIAN = b"\x00\x01"

Vector = tuple[float, float, float]
Quaternion = tuple[float, float, float, float]


class ImuReading(NamedTuple):
    """What the integrator takes of a sensor_msgs/Imu."""

    t_ns: int
    gyro: Vector
    """[rad/s]"""
    accel: Vector
    """[m/s^2]"""


class Truth(NamedTuple):
    """What the integrator takes of a nav_msgs/Odometry."""

    t_ns: int
    position: Vector
    """[m]"""
    q_wb: Quaternion
    """(w, x, y, z)"""
    velocity_b: Vector
    """of the body, in the body frame [m/s]"""
    angular_velocity_b: Vector
    """[rad/s]"""


def imu_reading(payload: bytes) -> ImuReading:
    """Return the reading in a sensor_msgs/Imu.

    :raises InputError: for bytes that are not such a message in little-endian CDR.
    """
    start = _aligned(_after_text(payload, 12), 8)
    try:
        second, nanosecond, gx, gy, gz, ax, ay, az = _imu_fields(start).unpack_from(payload, 4)
    except struct.error:
        raise InputError("a sensor_msgs/Imu that ends too early") from None
    return ImuReading(_nanoseconds(second, nanosecond), (gx, gy, gz), (ax, ay, az))


def truth(payload: bytes) -> Truth:
    """Return the state in a nav_msgs/Odometry.

    :raises InputError: for bytes that are not such a message in little-endian CDR.
    """
    child = _aligned(_after_text(payload, 12), 4)
    start = _aligned(_after_text(payload, child), 8)
    try:
        values = _odometry_fields(start).unpack_from(payload, 4)
    except struct.error:
        raise InputError("a nav_msgs/Odometry that ends too early") from None
    x, y, z, w = values[5:9]
    t_ns = _nanoseconds(values[0], values[1])
    return Truth(t_ns, values[2:5], (w, x, y, z), values[9:12], values[12:])


def _nanoseconds(second: int, nanosecond: int) -> int:
    if second < 0:
        raise InputError(f"negative timestamp: {second} s")
    return second * 1_000_000_000 + nanosecond


def _after_text(payload: bytes, position: int) -> int:
    """Return the position behind a string whose length stands at a position."""
    if payload[:2] != _LITTLE_ENDIAN:
        raise InputError("a message in big-endian CDR")
    if len(payload) < position + 4:
        raise InputError("a message that ends too early")
    return position + 4 + int.from_bytes(payload[position : position + 4], "little")


def _aligned(position: int, size: int) -> int:
    return position + -(position - _HEADER) % size


@cache
def _imu_fields(start: int) -> struct.Struct:
    """Return stamp, rates and accelerations, from byte 4 on.

    :param start: where the orientation begins: 4 + 9 numbers, 3 + 9, 3 + 9.
    """
    return struct.Struct(f"<iI{start - 12 + 13 * 8}x3d{9 * 8}x3d")


@cache
def _odometry_fields(start: int) -> struct.Struct:
    """Return stamp, pose and twist, from byte 4 on.

    :param start: where the position begins: 3 + 4 numbers, a covariance of 36, 3 + 3, 36.
    """
    return struct.Struct(f"<iI{start - 12}x7d{36 * 8}x6d")
