# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Blocks of samples as the bytes of ROS messages, built by NumPy in one go.

Every encoder turns arrays of n samples into a pattern of n messages, which the bag writers take, or
into an array (n, size) of uint8; a row of that is one message as ``publisher.publish(bytes)`` takes
it. Inside, quaternions are (w, x, y, z); the messages hold (x, y, z, w).
"""

import struct
from collections.abc import Callable, Iterable, Mapping
from typing import Final

import numpy as np
from numpy.typing import ArrayLike

from imu_sim_ros.bags.messages.blocks import Column, RowTemplate, interleave
from imu_sim_ros.bags.messages.layouts import Layout, fields, layout
from imu_sim_ros.core.errors import InputError
from imu_sim_ros.core.timebase import NANOSECONDS_PER_SECOND
from imu_sim_ros.core.types import Array, Bytes, Times

IMU: Final = "sensor_msgs/msg/Imu"
ODOMETRY: Final = "nav_msgs/msg/Odometry"
POSE_STAMPED: Final = "geometry_msgs/msg/PoseStamped"
POSE_WITH_COVARIANCE: Final = "geometry_msgs/msg/PoseWithCovarianceStamped"
TRANSFORM_STAMPED: Final = "geometry_msgs/msg/TransformStamped"
PATH: Final = "nav_msgs/msg/Path"
VECTOR3_STAMPED: Final = "geometry_msgs/msg/Vector3Stamped"
TEMPERATURE: Final = "sensor_msgs/msg/Temperature"
NAV_SAT_FIX: Final = "sensor_msgs/msg/NavSatFix"
TWIST_WITH_COVARIANCE: Final = "geometry_msgs/msg/TwistWithCovarianceStamped"
MAGNETIC_FIELD: Final = "sensor_msgs/msg/MagneticField"
FLUID_PRESSURE: Final = "sensor_msgs/msg/FluidPressure"
GPS_FIX: Final = "gps_msgs/msg/GPSFix"
CLOCK: Final = "rosgraph_msgs/msg/Clock"

_LAST_SECOND: Final = {"cdr": 2**31 - 1, "ros1": 2**32 - 1}
_GPS: Final = 1
"""sensor_msgs/NavSatStatus.SERVICE_GPS"""
_COVARIANCE_TYPE_KNOWN: Final = 3
"""sensor_msgs/NavSatFix"""
_COVARIANCE_TYPE_DIAGONAL: Final = 2
"""``NavSatFix.COVARIANCE_TYPE_DIAGONAL_KNOWN``."""
_SOURCE_DOPPLER: Final = 4
"""gps_msgs/GPSStatus"""
_FEW: Final = 16
"""Largest number of messages that are encoded row by row; more are encoded by columns."""
_STAMP: Final = struct.Struct("<II")
ROS_ORDER: Final = [1, 2, 3, 0]
"""Indices of (x, y, z, w) in (w, x, y, z)."""


def split_seconds(t_ns: Times) -> tuple[Times, Times]:
    """Return the whole seconds of times (n,), rounded down, and the nanoseconds left."""
    second = t_ns // NANOSECONDS_PER_SECOND  # cheaper than np.divmod
    return second, t_ns - second * NANOSECONDS_PER_SECOND


def seconds(t_ns: Times, encoding: str) -> tuple[Times, Times]:
    """Return the seconds and nanoseconds of stamps (n,).

    :raises InputError: for stamps that a message cannot hold.
    """
    second, nanosecond = split_seconds(t_ns)
    last_second = _LAST_SECOND[encoding]
    if len(t_ns) and (second.min() < 0 or second.max() > last_second):
        raise InputError(
            f"stamps from {t_ns.min() * 1e-9:.3f} s to {t_ns.max() * 1e-9:.3f} s: a message "
            f"holds 0 to {last_second} s"
        )
    return second, nanosecond


class Encoder:
    """Common to all encoders: the layout, and messages with their stamps."""

    type_name: str
    pattern: Callable[..., RowTemplate]
    """Method of each encoder: returns n messages of stamps (n,) and columns of values."""

    def __init__(self, layout: Layout, **constant: ArrayLike) -> None:
        """Set up the fields that all messages share.

        :param constant: the numbers of fields, (m,) or one.
        """
        self.layout = layout
        entries = (self.layout.dtype.fields or {}).items()
        self._fields = {name: (kind, offset) for name, (kind, offset, *_) in entries}
        generations = ("cdr", layout.encoding)
        ros2_fields, own_fields = (
            {name for name, _, _ in fields(layout.type_name, encoding)} for encoding in generations
        )
        self._left_out = ros2_fields - own_fields
        """Fields that the message has in ROS 2 only, if it is one of ROS 1."""
        self._whole = np.dtype((np.void, self.layout.dtype.itemsize))
        self._template = self.layout.template
        self._template = self._row(constant)

    def encode(self, *columns: ArrayLike, **keywords: object) -> Bytes:
        """Return messages (n, size) as bytes; the arguments are those of ``pattern``."""
        return interleave([self.pattern(*columns, **keywords)])

    def _stamp(self, t_ns: int) -> tuple[int, int]:
        """Return the seconds and nanoseconds of one stamp, in less time than :func:`seconds`."""
        second, nanosecond = divmod(t_ns, NANOSECONDS_PER_SECOND)
        if not 0 <= second <= _LAST_SECOND[self.layout.encoding]:
            seconds(np.array([t_ns]), self.layout.encoding)  # raises
        return second, nanosecond

    def _row(self, numbers: Mapping[str, ArrayLike]) -> bytes:
        """Return the template with some of its numbers: (m,) or one for each field."""
        row = bytearray(self._template)
        for name, number in self._existing_fields(numbers).items():
            field, offset = self._fields[name]
            values = np.asarray(number, field.base)
            if values.nbytes != field.itemsize:
                values = np.broadcast_to(values, field.shape)
            row[offset : offset + field.itemsize] = values.tobytes()
        return bytes(row)

    def _existing_fields(self, numbers: Mapping[str, ArrayLike]) -> Mapping[str, ArrayLike]:
        """Return the numbers of fields that the message has in this generation of ROS."""
        if not self._left_out:
            return numbers
        return {name: number for name, number in numbers.items() if name not in self._left_out}

    def _row_template(self, t_ns: Times, **numbers: ArrayLike) -> RowTemplate:
        """Return n messages with texts, stamps and some of their fields; the others are constant.

        :param numbers: numbers by field: (n, m), or (n,) of a field of one number, if they differ
            from message to message; else (m,) or one number.
        """
        t_ns = np.asarray(t_ns, dtype=np.int64)
        if 0 < len(t_ns) <= _FEW:  # the same bytes, without the overhead of columns
            memory, stamp_offset = bytearray(self._template) * len(t_ns), self._fields["sec"][1]
            for k, row_t_ns in enumerate(t_ns.tolist()):
                _STAMP.pack_into(
                    memory, stamp_offset + k * len(self._template), *self._stamp(row_t_ns)
                )
            rows = np.frombuffer(memory, self.layout.dtype)
            for name, numbers_of_field in self._existing_fields(numbers).items():
                rows[name] = numbers_of_field
            return RowTemplate(self._template, [Column(0, rows.view(self._whole))], len(rows))
        stamp = zip(("sec", "nanosec"), seconds(t_ns, self.layout.encoding), strict=True)
        columns, constant = [], {}
        for name, numbers_of_field in (*stamp, *self._existing_fields(numbers).items()):
            field, offset = self._fields[name]
            values = np.asarray(numbers_of_field)
            if values.ndim > field.ndim:
                columns.append(Column(offset, values.astype(field.base, copy=False)))
            else:
                constant[name] = values
        return RowTemplate(self._row(constant), columns, len(t_ns))


class _OfFrame(Encoder):
    """Messages whose only string is the frame in their header."""

    def __init__(self, frame_id: str, encoding: str = "cdr") -> None:
        super().__init__(layout(self.type_name, encoding, (frame_id,)))


class ImuEncoder(Encoder):
    """sensor_msgs/Imu; without orientation its covariance starts with -1 (REP-145)."""

    type_name = IMU

    def __init__(
        self,
        frame_id: str,
        encoding: str = "cdr",
        gyro_covariance: ArrayLike = 0.0,
        accel_covariance: ArrayLike = 0.0,
    ) -> None:
        """Set up the fields that all messages share.

        :param gyro_covariance: per sample [(rad/s)^2]: 0 (unknown), three variances, or (3, 3).
        :param accel_covariance: covariance of the accelerometer [(m/s^2)^2].
        """
        super().__init__(
            layout(self.type_name, encoding, (frame_id,)),
            orientation=(0.0, 0.0, 0.0, 1.0),
            orientation_covariance=(-1.0, *[0.0] * 8),
            angular_velocity_covariance=_matrix3(gyro_covariance).ravel(),
            linear_acceleration_covariance=_matrix3(accel_covariance).ravel(),
        )
        numbers = ("sec", "nanosec", "angular_velocity", "linear_acceleration")
        self._struct, self._parts = self.layout.packer(numbers, self._template)

    def pattern(
        self,
        t_ns: Times,
        gyro: ArrayLike,
        accel: ArrayLike,
        q_wi: ArrayLike | None = None,
        orientation_covariance: ArrayLike = 0.0,
    ) -> RowTemplate:
        """Return n messages.

        :param t_ns: (n,) stamps.
        :param gyro: (n, 3) rad/s.
        :param accel: (n, 3) m/s^2.
        :param q_wi: (n, 4) orientation of the sensor in the world; None: there is none.
        :param orientation_covariance: [rad^2] about the world's axes: 0 (unknown), or three
            variances for each (n, 3).
        """
        if q_wi is None:
            return self._row_template(t_ns, angular_velocity=gyro, linear_acceleration=accel)
        variances = np.asarray(orientation_covariance) * np.ones(3)
        covariance = np.zeros((*variances.shape[:-1], 9))
        covariance[..., ::4] = variances
        return self._row_template(
            t_ns,
            orientation=np.asarray(q_wi)[:, ROS_ORDER],
            orientation_covariance=covariance,
            angular_velocity=gyro,
            linear_acceleration=accel,
        )

    def message(self, t_ns: int, gyro: Iterable[float], accel: Iterable[float]) -> bytes:
        """Return one message without orientation, with the bytes that :meth:`encode` gives it.

        The arguments are rows of those of :meth:`pattern`.
        """
        header, frame, gyro_covariance, accel_covariance = self._parts
        stamp = self._stamp(t_ns)
        numbers = (header, *stamp, frame, *gyro, gyro_covariance, *accel, accel_covariance)
        return self._struct.pack(*numbers)


class OdometryEncoder(Encoder):
    """nav_msgs/Odometry: the pose in ``header.frame_id``, the twist in ``child_frame_id``."""

    type_name = ODOMETRY

    def __init__(self, frame_id: str, child_frame_id: str, encoding: str = "cdr") -> None:
        super().__init__(layout(self.type_name, encoding, (frame_id, child_frame_id)))
        numbers = ("sec", "nanosec", "position", "orientation", "linear", "angular")
        self._struct, self._parts = self.layout.packer(numbers, self._template)

    def pattern(
        self,
        t_ns: Times,
        position: ArrayLike,
        q_wb: ArrayLike,
        velocity_b: ArrayLike,
        angular_velocity_b: ArrayLike,
        pose_covariance: ArrayLike | None = None,
        twist_covariance: ArrayLike | None = None,
    ) -> RowTemplate:
        """Return n messages.

        :param t_ns: (n,) stamps.
        :param position: (n, 3) p_wb [m].
        :param q_wb: (n, 4) attitudes.
        :param velocity_b: (n, 3) velocities of the body in the body frame [m/s].
        :param angular_velocity_b: (n, 3) omega_b [rad/s].
        :param pose_covariance: (n, 6, 6) or (6, 6): position, then rotation about fixed axes.
        :param twist_covariance: (n, 6, 6) or (6, 6): linear, then angular.
        """
        covariances = {
            name: np.reshape(covariance, (*np.shape(covariance)[:-2], 36))
            for name, covariance in (
                ("pose_covariance", pose_covariance),
                ("twist_covariance", twist_covariance),
            )
            if covariance is not None
        }
        return self._row_template(
            t_ns,
            position=position,
            orientation=np.asarray(q_wb)[:, ROS_ORDER],
            linear=velocity_b,
            angular=angular_velocity_b,
            **covariances,
        )

    def message(
        self,
        t_ns: int,
        position: Iterable[float],
        q_wb: Iterable[float],
        velocity_b: Iterable[float],
        angular_velocity_b: Iterable[float],
        pose_covariance: Array | None = None,
        twist_covariance: Array | None = None,
    ) -> bytes:
        """Return one message with the bytes that :meth:`encode` gives it, but faster.

        The arguments are rows of those of :meth:`pattern`.
        """
        header, frames, of_pose, of_twist = self._parts
        if pose_covariance is not None:
            of_pose = pose_covariance.tobytes()
        if twist_covariance is not None:
            of_twist = twist_covariance.tobytes()
        w, x, y, z = q_wb
        pose = (header, *self._stamp(t_ns), frames, *position, x, y, z, w, of_pose)
        return self._struct.pack(*pose, *velocity_b, *angular_velocity_b, of_twist)


class PoseStampedEncoder(_OfFrame):
    """geometry_msgs/PoseStamped."""

    type_name = POSE_STAMPED

    def pattern(self, t_ns: Times, position: ArrayLike, q_wb: ArrayLike) -> RowTemplate:
        """Return n messages of positions (n, 3) [m] and quaternions (n, 4)."""
        q_xyzw = np.asarray(q_wb)[:, ROS_ORDER]
        return self._row_template(t_ns, position=position, orientation=q_xyzw)


class Vector3StampedEncoder(_OfFrame):
    """geometry_msgs/Vector3Stamped."""

    type_name = VECTOR3_STAMPED

    def pattern(self, t_ns: Times, vector: ArrayLike) -> RowTemplate:
        """Return n messages of vectors (n, 3)."""
        return self._row_template(t_ns, vector=vector)


class TemperatureEncoder(_OfFrame):
    """sensor_msgs/Temperature."""

    type_name = TEMPERATURE

    def pattern(
        self, t_ns: Times, temperature: ArrayLike, variance: ArrayLike = 0.0
    ) -> RowTemplate:
        """Return n messages of temperatures (n,) [degC]; variance 0 means unknown."""
        return self._row_template(t_ns, temperature=temperature, variance=variance)


class MagneticFieldEncoder(_OfFrame):
    """sensor_msgs/MagneticField."""

    type_name = MAGNETIC_FIELD

    def pattern(self, t_ns: Times, field: ArrayLike, covariance: ArrayLike = 0.0) -> RowTemplate:
        """Return n messages.

        :param field: (n, 3) fields [T].
        :param covariance: per sample [T^2]: 0 (unknown), three variances, or (3, 3).
        """
        row_major = _matrix3(covariance).ravel()
        return self._row_template(t_ns, magnetic_field=field, magnetic_field_covariance=row_major)


class FluidPressureEncoder(_OfFrame):
    """sensor_msgs/FluidPressure."""

    type_name = FLUID_PRESSURE

    def pattern(self, t_ns: Times, pressure: ArrayLike, variance: ArrayLike = 0.0) -> RowTemplate:
        """Return n messages of pressures (n,) [Pa]; variance 0 means unknown."""
        return self._row_template(t_ns, fluid_pressure=pressure, variance=variance)


class TwistWithCovarianceEncoder(_OfFrame):
    """geometry_msgs/TwistWithCovarianceStamped of a velocity alone."""

    type_name = TWIST_WITH_COVARIANCE

    def pattern(self, t_ns: Times, velocity: ArrayLike, variance: ArrayLike) -> RowTemplate:
        """Return n messages; the angular velocity is 0 and its covariance -1: unknown.

        :param velocity: (n, 3) velocities [m/s].
        :param variance: (n, 3) or (3,) [m^2/s^2].
        """
        variances = np.asarray(variance, dtype=np.float64)
        covariance = np.zeros((*variances.shape[:-1], 36))
        covariance[..., [0, 7, 14]] = variances
        covariance[..., [21, 28, 35]] = -1.0
        return self._row_template(t_ns, linear=velocity, twist_covariance=covariance)


class NavSatFixEncoder(_OfFrame):
    """sensor_msgs/NavSatFix, as a receiver without errors would give it, or a real one."""

    type_name = NAV_SAT_FIX

    def pattern(
        self,
        t_ns: Times,
        latitude: ArrayLike,
        longitude: ArrayLike,
        altitude: ArrayLike,
        status: ArrayLike | None = None,
        variance: ArrayLike = 0.0,
    ) -> RowTemplate:
        """Return n messages.

        :param latitude: (n,) geodetic latitudes [deg].
        :param longitude: (n,) longitudes [deg].
        :param altitude: (n,) altitudes above the ellipsoid [m].
        :param status: (n,) states; -1: no fix, of unknown covariance. None: all have a fix, with a
            covariance that is known, and zero.
        :param variance: (n, 3) variances of the errors east, north, up [m^2].
        """
        if status is not None:
            statuses = np.asarray(status)
            covariance = np.zeros((len(statuses), 9))
            covariance[:, ::4] = variance
            return self._row_template(
                t_ns,
                status=statuses,
                service=_GPS,
                latitude=latitude,
                longitude=longitude,
                altitude=altitude,
                position_covariance=covariance,
                position_covariance_type=np.where(statuses < 0, 0, _COVARIANCE_TYPE_DIAGONAL),
            )
        return self._row_template(
            t_ns,
            service=_GPS,
            latitude=latitude,
            longitude=longitude,
            altitude=altitude,
            position_covariance_type=_COVARIANCE_TYPE_KNOWN,
        )


class GpsFixEncoder(Encoder):
    """gps_msgs/GPSFix, whose lists of single satellites are left empty."""

    type_name = GPS_FIX

    def __init__(self, frame_id: str, encoding: str = "cdr") -> None:
        super().__init__(layout(self.type_name, encoding, (frame_id, frame_id)))

    def pattern(
        self,
        t_ns: Times,
        status: ArrayLike,
        satellites: ArrayLike,
        numbers: Mapping[str, ArrayLike],
        variance: ArrayLike,
    ) -> RowTemplate:
        """Return n messages.

        :param status: (n,) as GPSStatus has it; -1: no fix, of unknown covariance.
        :param satellites: (n,) numbers of satellites in use, and of visible ones.
        :param numbers: (n,) latitude [deg], speed [m/s], hdop and so on, by the field's name; those
            left out are 0.
        :param variance: (n, 3) variances of the errors east, north, up [m^2].
        """
        statuses, (second, nanosecond) = np.asarray(status), split_seconds(np.asarray(t_ns))
        covariance = np.zeros((len(statuses), 9))
        covariance[:, ::4] = variance
        return self._row_template(
            t_ns,
            sec_of_status=second,
            nanosec_of_status=nanosecond,
            satellites_used=satellites,
            satellites_visible=satellites,
            status=statuses,
            motion_source=_SOURCE_DOPPLER,
            position_source=_GPS,
            position_covariance=covariance,
            position_covariance_type=np.where(statuses < 0, 0, _COVARIANCE_TYPE_DIAGONAL),
            **numbers,
        )


class ClockEncoder(Encoder):
    """rosgraph_msgs/Clock."""

    type_name = CLOCK

    def __init__(self, encoding: str = "cdr") -> None:
        super().__init__(layout(self.type_name, encoding))

    def pattern(self, t_ns: Times) -> RowTemplate:
        """Return n messages of times (n,)."""
        return self._row_template(t_ns)


def _matrix3(covariance: ArrayLike) -> Array:
    """Return a (3, 3) covariance of a number, three variances or a matrix."""
    values = np.asarray(covariance, dtype=np.float64)
    return values.reshape(3, 3) if values.size == 9 else np.diag(np.broadcast_to(values, 3))
