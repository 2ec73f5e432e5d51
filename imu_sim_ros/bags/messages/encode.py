# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Blocks of samples as the bytes of ROS messages, built by NumPy in one go.

Every encoder turns arrays of n samples into an array (n, size) of uint8; a row is one message as
``publisher.publish(bytes)`` and the bag writers take it. Inside, quaternions are (w, x, y, z); the
messages hold (x, y, z, w).
"""

from typing import Final

import numpy as np
from numpy.typing import ArrayLike, NDArray

from imu_sim_ros.bags.messages.layouts import Bytes, Layout, layout
from imu_sim_ros.errors import InputError
from imu_sim_ros.timebase import NANOSECONDS_PER_SECOND

Array = NDArray[np.float64]
Times = NDArray[np.int64]

IMU: Final = "sensor_msgs/msg/Imu"
ODOMETRY: Final = "nav_msgs/msg/Odometry"
POSE_STAMPED: Final = "geometry_msgs/msg/PoseStamped"
VECTOR3_STAMPED: Final = "geometry_msgs/msg/Vector3Stamped"
TEMPERATURE: Final = "sensor_msgs/msg/Temperature"
MAGNETIC_FIELD: Final = "sensor_msgs/msg/MagneticField"
FLUID_PRESSURE: Final = "sensor_msgs/msg/FluidPressure"
CLOCK: Final = "rosgraph_msgs/msg/Clock"

_LAST_SECOND: Final = {"cdr": 2**31 - 1, "ros1": 2**32 - 1}
ROS_ORDER: Final = [1, 2, 3, 0]
"""Where (x, y, z, w) stand in (w, x, y, z)."""


def seconds(t_ns: Times, encoding: str) -> tuple[Times, Times]:
    """Return the seconds and nanoseconds of stamps (n,).

    :raises InputError: for stamps that a message cannot hold.
    """
    second, nanosecond = np.divmod(t_ns, NANOSECONDS_PER_SECOND)
    last = _LAST_SECOND[encoding]
    if len(t_ns) and (second.min() < 0 or second.max() > last):
        raise InputError(
            f"stamps from {t_ns.min() * 1e-9:.3f} s to {t_ns.max() * 1e-9:.3f} s: a message "
            f"holds 0 to {last} s"
        )
    return second, nanosecond


class Encoder:
    """Common to all encoders: the layout, and messages with their stamps."""

    type_name: str

    def __init__(self, texts: tuple[str, ...], encoding: str) -> None:
        self.layout: Layout = layout(self.type_name, encoding, texts)
        self._template = np.frombuffer(self.layout.template, np.uint8)

    def _messages(self, t_ns: Times) -> tuple[Bytes, NDArray[np.void]]:
        """Return n messages with texts and stamps, as bytes and as fields of the same memory."""
        t_ns = np.asarray(t_ns, dtype=np.int64)
        rows = np.empty((len(t_ns), self.layout.size), np.uint8)
        rows[:] = self._template
        fields = self.layout.view(rows)
        second, nanosecond = seconds(t_ns, self.layout.encoding)
        fields["sec"] = second
        fields["nanosec"] = nanosecond
        return rows, fields


class ImuEncoder(Encoder):
    """sensor_msgs/Imu; without orientation its covariance starts with -1 (REP-145)."""

    type_name = IMU

    def __init__(self, frame_id: str, encoding: str = "cdr") -> None:
        super().__init__((frame_id,), encoding)

    def encode(
        self,
        t_ns: Times,
        gyro: ArrayLike,
        accel: ArrayLike,
        gyro_covariance: ArrayLike = 0.0,
        accel_covariance: ArrayLike = 0.0,
        q_wi: ArrayLike | None = None,
        orientation_covariance: ArrayLike = 0.0,
    ) -> Bytes:
        """Return messages (n, size).

        :param t_ns: (n,) stamps.
        :param gyro: (n, 3) rad/s.
        :param accel: (n, 3) m/s^2.
        :param gyro_covariance: per sample [(rad/s)^2]: 0 (unknown), three variances, or (3, 3).
        :param accel_covariance: likewise [(m/s^2)^2].
        :param q_wi: (n, 4) orientation of the sensor in the world; None: it has none.
        :param orientation_covariance: [rad^2] about the world's axes: 0 (unknown), or three
            variances for each (n, 3).
        """
        rows, fields = self._messages(t_ns)
        if q_wi is None:
            fields["orientation"][:, 3] = 1.0
            fields["orientation_covariance"][:, 0] = -1.0
        else:
            fields["orientation"] = np.asarray(q_wi)[:, ROS_ORDER]
            fields["orientation_covariance"][:, ::4] = orientation_covariance
        fields["angular_velocity"] = gyro
        fields["linear_acceleration"] = accel
        for name, covariance in (
            ("angular_velocity_covariance", gyro_covariance),
            ("linear_acceleration_covariance", accel_covariance),
        ):
            matrix = _matrix3(covariance)
            if matrix.any():
                fields[name] = matrix.reshape(9)
        return rows


class OdometryEncoder(Encoder):
    """nav_msgs/Odometry: the pose in ``header.frame_id``, the twist in ``child_frame_id``."""

    type_name = ODOMETRY

    def __init__(self, frame_id: str, child_frame_id: str, encoding: str = "cdr") -> None:
        super().__init__((frame_id, child_frame_id), encoding)

    def encode(
        self,
        t_ns: Times,
        position: ArrayLike,
        q_wb: ArrayLike,
        velocity_b: ArrayLike,
        angular_velocity_b: ArrayLike,
        pose_covariance: ArrayLike | None = None,
        twist_covariance: ArrayLike | None = None,
    ) -> Bytes:
        """Return messages (n, size).

        :param t_ns: (n,) stamps.
        :param position: (n, 3) p_wb [m].
        :param q_wb: (n, 4).
        :param velocity_b: (n, 3) of the body, resolved in the body frame [m/s].
        :param angular_velocity_b: (n, 3) omega_b [rad/s].
        :param pose_covariance: (n, 6, 6) or (6, 6): position, then rotation about fixed axes.
        :param twist_covariance: (n, 6, 6) or (6, 6): linear, then angular.
        """
        rows, fields = self._messages(t_ns)
        fields["position"] = position
        fields["orientation"] = np.asarray(q_wb)[:, ROS_ORDER]
        fields["linear"] = velocity_b
        fields["angular"] = angular_velocity_b
        for name, covariance in (
            ("pose_covariance", pose_covariance),
            ("twist_covariance", twist_covariance),
        ):
            if covariance is not None:
                matrix = np.asarray(covariance, dtype=np.float64)
                fields[name] = matrix.reshape(*matrix.shape[:-2], 36)
        return rows


class PoseStampedEncoder(Encoder):
    """geometry_msgs/PoseStamped."""

    type_name = POSE_STAMPED

    def __init__(self, frame_id: str, encoding: str = "cdr") -> None:
        super().__init__((frame_id,), encoding)

    def encode(self, t_ns: Times, position: ArrayLike, q_wb: ArrayLike) -> Bytes:
        """Return messages (n, size) of positions (n, 3) [m] and quaternions (n, 4)."""
        rows, fields = self._messages(t_ns)
        fields["position"] = position
        fields["orientation"] = np.asarray(q_wb)[:, ROS_ORDER]
        return rows


class Vector3StampedEncoder(Encoder):
    """geometry_msgs/Vector3Stamped."""

    type_name = VECTOR3_STAMPED

    def __init__(self, frame_id: str, encoding: str = "cdr") -> None:
        super().__init__((frame_id,), encoding)

    def encode(self, t_ns: Times, vector: ArrayLike) -> Bytes:
        """Return messages (n, size) of vectors (n, 3)."""
        rows, fields = self._messages(t_ns)
        fields["vector"] = vector
        return rows


class TemperatureEncoder(Encoder):
    """sensor_msgs/Temperature."""

    type_name = TEMPERATURE

    def __init__(self, frame_id: str, encoding: str = "cdr") -> None:
        super().__init__((frame_id,), encoding)

    def encode(self, t_ns: Times, temperature: ArrayLike, variance: ArrayLike = 0.0) -> Bytes:
        """Return messages (n, size) of temperatures (n,) [degC]; variance 0 means unknown."""
        rows, fields = self._messages(t_ns)
        fields["temperature"] = temperature
        fields["variance"] = variance
        return rows


class MagneticFieldEncoder(Encoder):
    """sensor_msgs/MagneticField."""

    type_name = MAGNETIC_FIELD

    def __init__(self, frame_id: str, encoding: str = "cdr") -> None:
        super().__init__((frame_id,), encoding)

    def encode(self, t_ns: Times, field: ArrayLike, covariance: ArrayLike = 0.0) -> Bytes:
        """Return messages (n, size).

        :param field: (n, 3) [T].
        :param covariance: per sample [T^2]: 0 (unknown), three variances, or (3, 3).
        """
        rows, fields = self._messages(t_ns)
        fields["magnetic_field"] = field
        fields["magnetic_field_covariance"] = _matrix3(covariance).reshape(9)
        return rows


class FluidPressureEncoder(Encoder):
    """sensor_msgs/FluidPressure."""

    type_name = FLUID_PRESSURE

    def __init__(self, frame_id: str, encoding: str = "cdr") -> None:
        super().__init__((frame_id,), encoding)

    def encode(self, t_ns: Times, pressure: ArrayLike, variance: ArrayLike = 0.0) -> Bytes:
        """Return messages (n, size) of pressures (n,) [Pa]; variance 0 means unknown."""
        rows, fields = self._messages(t_ns)
        fields["fluid_pressure"] = pressure
        fields["variance"] = variance
        return rows


class ClockEncoder(Encoder):
    """rosgraph_msgs/Clock."""

    type_name = CLOCK

    def __init__(self, encoding: str = "cdr") -> None:
        super().__init__((), encoding)

    def encode(self, t_ns: Times) -> Bytes:
        """Return messages (n, size) of times (n,)."""
        return self._messages(t_ns)[0]


def _matrix3(covariance: ArrayLike) -> Array:
    """Return a (3, 3) covariance of a number, three variances or a matrix."""
    values = np.asarray(covariance, dtype=np.float64)
    return values.reshape(3, 3) if values.size == 9 else np.diag(np.broadcast_to(values, 3))
