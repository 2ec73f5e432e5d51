# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""The fields of Imu and Odometry messages that the integrator reads from their bytes."""

from typing import Final, NamedTuple

import numpy as np

from imu_sim_ros.bags.messages import IMU, ODOMETRY, MessageDecoder
from imu_sim_ros.errors import InputError
from imu_sim_ros.inputs import gate
from imu_sim_ros.rotation.scalars import normalise
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
_ROUNDING: Final = 1e-12
"""Of the squared length of a quaternion that was written as a unit one."""
_imu = MessageDecoder(IMU, _READINGS)
_odometry = MessageDecoder(ODOMETRY, _STATES)


def imu_reading(payload: bytes) -> ImuReading:
    """Return the reading in a sensor_msgs/Imu.

    :raises InputError: for bytes that are not such a message in little-endian CDR, and for a
        reading that the gate refuses.
    """
    second, nanosecond, gx, gy, gz, ax, ay, az = _imu.numbers(payload)
    t_ns = _stamp(second, nanosecond)
    result = ImuReading(t_ns, (gx, gy, gz), (ax, ay, az))
    if not gate.is_reading(*result):
        raise _refused(t_ns, (gate.RATE, result.gyro), (gate.FORCE, result.accel))
    return result


def truth(payload: bytes) -> Truth:
    """Return the state in a nav_msgs/Odometry.

    :raises InputError: for bytes that are not such a message in little-endian CDR, and for a
        state that the gate refuses.
    """
    second, nanosecond, *values = _odometry.numbers(payload)
    t_ns = _stamp(second, nanosecond)
    px, py, pz, x, y, z, w, vx, vy, vz, rx, ry, rz = values
    position, q_wb, velocity, rate = (px, py, pz), (w, x, y, z), (vx, vy, vz), (rx, ry, rz)
    sound = gate.is_pose(t_ns, position, q_wb)
    if not (sound and gate.within(velocity, gate.VELOCITY) and gate.within(rate, gate.RATE)):
        pose = (gate.POSITION, position), (gate.ORIENTATION, q_wb)
        raise _refused(t_ns, *pose, (gate.VELOCITY, velocity), (gate.RATE, rate))
    off = abs(w * w + x * x + y * y + z * z - 1.0) > _ROUNDING
    return Truth(t_ns, position, normalise(q_wb) if off else q_wb, velocity, rate)


def _stamp(second: int, nanosecond: int) -> int:
    if second < 0:
        raise InputError(f"negative timestamp: {second} s")
    return second * NANOSECONDS_PER_SECOND + nanosecond


def _refused(t_ns: int, *columns: tuple[gate.Quantity, tuple[float, ...]]) -> InputError:
    rows = [(quantity, np.array([values])) for quantity, values in columns]
    words = gate.Verdict(np.array([t_ns]), rows).why(0)
    return InputError(f"{gate.stamp_words(t_ns)}: {words}")
