# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""ULog files of PX4, read by pyulog: FRD and NED become FLU and ENU.

Fields, units and frames are those of PX4's message definitions (PX4/PX4-Autopilot, ``msg/``), the
container that of the ULog description (docs.px4.io, "ULog File Format").
"""

import re
import struct
from collections import Counter
from collections.abc import Callable, Iterator, Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from imu_sim_ros.bags.logs import axes, log
from imu_sim_ros.bags.logs.log import Contents, LogStream, LogTriad
from imu_sim_ros.bags.messages.encode import (
    FLUID_PRESSURE,
    IMU,
    MAGNETIC_FIELD,
    NAV_SAT_FIX,
    ODOMETRY,
    TEMPERATURE,
)
from imu_sim_ros.core.conventions import AXES, TRIADS, TRUTH_TOPIC, WORLD_FRAME
from imu_sim_ros.core.errors import InputError, MissingDependencyError
from imu_sim_ros.core.rotation import to_matrix
from imu_sim_ros.core.timebase import interpolate_columns
from imu_sim_ros.core.types import AnyArray, Array, Mask, Times
from imu_sim_ros.inputs.rows import open_shared
from imu_sim_ros.recordings.findings.clipping import ClippingCounts

if TYPE_CHECKING:
    from pyulog import ULog

MEMORY = 4
"""Memory that reading takes, in sizes of the file, if all of it are readings."""
_MAGIC: Final = b"ULog\x01\x12\x35"
_HEADER_BYTES: Final = 16
"""Bytes of the header of a ULog file."""
_LARGEST_MESSAGE: Final = 1 << 16
"""Size of a message that the container can hold [bytes]."""
_LONGEST_DEFINITIONS: Final = 1 << 24
"""Size of the definitions that are looked through [bytes]; those of PX4 have some 100 kB."""
_ARRAY: Final = re.compile(rb"\[(\d+)\]")
_MICROSECOND: Final = 1000
"""Unit of the stamps [ns]."""
_LAST_STAMP: Final = 2**31 * 10**6
"""End of the stamps that a message of ROS holds [us]."""
_GAUSS: Final = 1e-4
"""One gauss [T]."""
_NO_TIME: Final = 2**31 - 1
"""Relative time of an accelerometer without valid readings."""
_LOWEST_PASCALS: Final = 2000.0
"""Pressures below are in millibar, as firmware before 1.14 logs them (1 bar is 1000 mbar)."""
_TRUTH: Final = "_groundtruth"
"""Suffix of the topics of a simulator's truth."""
_FIFO: Final = "_fifo"
_POSE_NED: Final = 1
"""Value of ``pose_frame``: north, east, down."""
_VELOCITY_BODY: Final = 3
"""Value of ``velocity_frame``: the axes of the body."""
_FIX_2D: Final = 2
"""Type of the fix of a receiver that has a position."""
_PREFERRED: Final = {
    IMU: ("/sensor_combined", "/vehicle_imu_0"),
    ODOMETRY: (f"/{TRUTH_TOPIC}", "/vehicle_local_position", "/vehicle_odometry"),
    MAGNETIC_FIELD: ("/vehicle_magnetometer", "/sensor_mag_0"),
    FLUID_PRESSURE: ("/vehicle_air_data", "/sensor_baro_0"),
    NAV_SAT_FIX: ("/vehicle_gps_position", "/sensor_gps_0"),
    TEMPERATURE: ("/sensor_gyro_0/temperature",),
}
"""Topics that are read if the user names none."""


class _Topic(NamedTuple):
    """Columns of one instance of a topic."""

    name: str
    """Name of the topic in the log."""
    instance: int
    """Number of the instance."""
    alone: bool
    """True if the topic has no other instance."""
    columns: Mapping[str, AnyArray]
    """(n,) numbers by name of the field; those of an array are ``name[0]``, ..."""

    @property
    def topic(self) -> str:
        """Name of the topic in the bag."""
        numbered = self.name.startswith("sensor_") and self.name != "sensor_combined"
        if self.alone and not numbered and self.name != "vehicle_imu":
            return f"/{self.name}"
        return f"/{self.name}_{self.instance}"

    @property
    def aliases(self) -> tuple[str, ...]:
        """Names in PX4's tools: ``sensor_gyro/0``; of instance 0 also ``sensor_gyro``."""
        numbered_name = f"{self.name}/{self.instance}"
        return (numbered_name, self.name) if self.instance == 0 else (numbered_name,)

    @property
    def t_ns(self) -> Times:
        """(n,) times at which the values were measured, else of the message, after the start."""
        return self.stamps.astype(np.int64) * _MICROSECOND

    @property
    def stamps(self) -> NDArray[np.uint64]:
        """(n,) the times of :attr:`t_ns` in microseconds, as they are logged."""
        logged = self.columns["timestamp"]
        sampled = self.columns.get("timestamp_sample")
        return logged if sampled is None else np.where(sampled > 0, sampled, logged)

    def number(self, *names: str) -> Array | None:
        """Return the first column (n,) that exists, None without any."""
        column = next((self.columns[name] for name in names if name in self.columns), None)
        return None if column is None else column.astype(np.float64)

    def vector(self, *names: str) -> Array | None:
        """Return an array field (n, m), or several fields as columns; None: one is missing."""
        if len(names) == 1:
            names = tuple(name for name in _element_names(names[0]) if name in self.columns)
        columns = [self.columns[name] for name in names if name in self.columns]
        if not columns or len(columns) < len(names):
            return None
        return np.column_stack(columns).astype(np.float64)

    def rows(self, rows: Mask) -> "_Topic":
        """Return the messages (m,) of which a mask (n,) is True."""
        return self._replace(columns={key: column[rows] for key, column in self.columns.items()})


Topics = Mapping[str, Sequence[_Topic]]
"""Instances of each topic of a log."""


def holds(path: Path, magic: bytes) -> bool:
    """Return True for a ULog file."""
    return magic.startswith(_MAGIC)


def contents(path: Path) -> Contents:
    """Return the topics of a ULog file; see :class:`imu_sim_ros.bags.logs.log.LogFormat`.

    :raises MissingDependencyError: without pyulog.
    :raises InputError: for a file that is damaged at its start, or has no known topic.
    """
    _check_definitions(path)
    file = _load(path)
    remarks: list[str] = []
    topics = _topics(file, remarks)
    streams = [stream for reader in _READERS for stream in reader(topics, remarks)]
    if not streams:
        raise log.refuse_empty(path, "a ULog file", sorted(file.message_formats))
    damage = ("damaged: pyulog leaves out what it cannot read",) if file.file_corruption else ()
    clippings = tuple(_clippings(topics))
    return Contents(streams, _PREFERRED, clippings, damage, tuple(remarks))


def _load(path: Path) -> "ULog":
    """Return the log, parsed by pyulog, with the topics in ``_NAMES``."""
    try:
        from pyulog import ULog
    except ImportError:
        raise MissingDependencyError(
            f"{path}: a ULog file is read by pyulog: pip install pyulog"
        ) from None
    try:
        with log.capture_output([]), open_shared(path) as file:
            return ULog(file, sorted(_NAMES))
    except (OSError, MemoryError):
        raise
    except Exception as error:  # whatever the library raises for malformed bytes
        reason = " ".join(str(error).split())[:200] or type(error).__name__
        raise InputError(f"{path}: damaged: {reason}") from None


def _check_definitions(path: Path) -> None:
    """Refuse definitions of messages larger than the container can hold, which fill the memory.

    :raises InputError: for those, and for a file that ends in its header.
    """
    with open_shared(path) as file:
        if len(file.read(_HEADER_BYTES)) < _HEADER_BYTES:
            raise InputError(f"{path}: a ULog file that ends in its header")
        position = 0
        while position < _LONGEST_DEFINITIONS:
            head = file.read(3)
            if len(head) < 3:
                return
            size, kind = struct.unpack("<HB", head)
            message = file.read(size)
            position += 3 + size
            if kind == ord("A"):
                return
            if kind == ord("F"):
                total = sum(
                    min(int(number), _LARGEST_MESSAGE) for number in _ARRAY.findall(message)
                )
                if total >= _LARGEST_MESSAGE:
                    raise InputError(f"{path}: damaged: defines a message larger than 64 kB")


def _topics(file: "ULog", remarks: list[str]) -> Topics:
    """Return the instances of each topic with messages, by name."""
    entries = [entry for entry in file.data_list if "timestamp" in entry.data]
    counts = Counter(entry.name for entry in entries)
    topics: dict[str, list[_Topic]] = {}
    for entry in entries:
        topic = _Topic(entry.name, int(entry.multi_id), counts[entry.name] == 1, entry.data)
        rows = topic.stamps < _LAST_STAMP
        if not rows.all():
            remarks.append(
                f"{entry.name}/{entry.multi_id}: {np.count_nonzero(~rows)} messages left out, "
                "whose stamps are no times since the start"
            )
        if rows.any():
            topics.setdefault(entry.name, []).append(topic.rows(rows))
    return topics


def _element_names(name: str) -> list[str]:
    """Return the names of the elements of an array field: name[0], name[1], ..."""
    return [f"{name}[{k}]" for k in range(32)]


def _read_sensor_combined(topics: Topics, remarks: list[str]) -> Iterator[LogStream]:
    """Yield the readings of ``sensor_combined``."""
    for topic in topics.get("sensor_combined", ()):
        relative = topic.columns.get("accelerometer_timestamp_relative")
        if relative is not None and (relative == _NO_TIME).any():
            remarks.append(
                f"sensor_combined: {np.count_nonzero(relative == _NO_TIME)} readings left out, "
                "whose accelerometer is marked as invalid"
            )
            topic = topic.rows(relative != _NO_TIME)
        gyro, accel = topic.vector("gyro_rad"), topic.vector("accelerometer_m_s2")
        if gyro is None or accel is None or not len(gyro):
            continue
        yield log.imu(
            topic.topic, topic.t_ns, axes.flu(gyro), axes.flu(accel), aliases=topic.aliases
        )
        field = topic.vector("magnetometer_ga")  # firmware before 1.9
        if field is not None:
            name = f"{topic.topic}/magnetometer"
            yield log.magnetic_field(name, topic.t_ns, axes.flu(field) * _GAUSS)


def _integrals(topics: Topics, remarks: list[str]) -> Iterator[LogStream]:
    """Yield the mean readings over the integrals of ``vehicle_imu``."""
    for topic in topics.get("vehicle_imu", ()):
        angle, change = topic.vector("delta_angle"), topic.vector("delta_velocity")
        times = [topic.number(f"{name}_dt", "dt") for name in ("delta_angle", "delta_velocity")]
        if angle is None or change is None or any(time is None for time in times):
            continue
        seconds = np.column_stack([time for time in times if time is not None]) * 1e-6
        rows = (seconds > 0.0).all(axis=1)
        if not rows.all():
            remarks.append(
                f"{topic.name}/{topic.instance}: {np.count_nonzero(~rows)} integrals over no time "
                "are left out"
            )
        seconds = seconds[rows]
        if not len(seconds):
            continue
        gyro = axes.flu(angle[rows] / seconds[:, :1])
        accel = axes.flu(change[rows] / seconds[:, 1:])
        yield log.imu(topic.topic, topic.t_ns[rows], gyro, accel, aliases=topic.aliases)


def _instances(topics: Topics, remarks: list[str]) -> Iterator[LogStream]:
    """Yield the readings of each instance of gyroscope and accelerometer, single or in batches."""
    for suffix in ("", _FIFO):
        unpack = _unroll_batches if suffix else _single
        gyros = _triads(topics.get(f"sensor_gyro{suffix}", ()), unpack)
        accels = _triads(topics.get(f"sensor_accel{suffix}", ()), unpack)
        for number in sorted({*gyros, *accels}):
            yield from log.pair(gyros.get(number), accels.get(number), remarks)
    for name in ("sensor_gyro", "sensor_accel"):
        for topic in topics.get(name, ()):
            degrees = topic.number("temperature")
            if degrees is not None and np.isfinite(degrees).any():
                rows = np.isfinite(degrees)
                stream_name = f"{topic.topic}/temperature"
                yield log.temperature(stream_name, topic.t_ns[rows], degrees[rows])


def _triads(
    instances: Sequence[_Topic], unpack: Callable[[_Topic], tuple[Times, Array] | None]
) -> dict[int, LogTriad]:
    """Return the readings of instances by their numbers."""
    triads = {}
    for topic in instances:
        readings = unpack(topic)
        if readings is not None and len(readings[0]):
            t_ns, values = readings
            triads[topic.instance] = LogTriad(topic.topic, topic.aliases, t_ns, axes.flu(values))
    return triads


def _single(topic: _Topic) -> tuple[Times, Array] | None:
    """Return times (n,) and vectors (n, 3) of a topic with one reading in each message."""
    vector = topic.vector(*AXES)
    return None if vector is None else (topic.t_ns, vector)


def _unroll_batches(topic: _Topic) -> tuple[Times, Array] | None:
    """Return the readings of batches: the last of each at its stamp, the others dt apart before it.

    The numbers are counts; ``scale`` is the value of one.
    """
    counts = [topic.vector(axis) for axis in AXES]
    samples, dt, scale = (topic.columns.get(name) for name in ("samples", "dt", "scale"))
    if samples is None or dt is None or scale is None or any(axis is None for axis in counts):
        return None
    batches = np.stack([axis for axis in counts if axis is not None], axis=-1)
    places = np.arange(batches.shape[1])
    valid = places < samples[:, None].astype(np.int64)
    age_us = (samples[:, None].astype(np.float64) - 1.0 - places) * dt[:, None]
    age_us = np.where(np.isfinite(age_us), age_us, 0.0)
    t_ns = topic.t_ns[:, None] - np.rint(age_us * _MICROSECOND).astype(np.int64)
    values = batches * scale[:, None, None].astype(np.float64)
    return t_ns[valid], values[valid]


def _local_position(topics: Topics, remarks: list[str]) -> Iterator[LogStream]:
    """Yield position and velocity of the estimator or simulator, with its attitude."""
    for suffix in ("", _TRUTH):
        attitudes = topics.get(f"vehicle_attitude{suffix}", ())
        for topic in topics.get(f"vehicle_local_position{suffix}", ())[:1]:
            columns = [topic.vector(*AXES), topic.vector("vx", "vy", "vz")]
            if not attitudes or any(column is None for column in columns):
                continue
            position, velocity = (np.asarray(column) for column in columns)
            valid = np.isfinite(np.hstack([position, velocity])).all(axis=1)
            for flag in ("xy_valid", "z_valid", "v_xy_valid", "v_z_valid"):
                valid &= topic.columns.get(flag, valid).astype(bool)
            q = attitudes[0].vector("q")
            if q is None:
                continue
            finite = np.isfinite(q).all(axis=1)
            times = attitudes[0].t_ns[finite]
            if not finite.any():
                continue
            t_ns = topic.t_ns
            rows = valid & (t_ns >= times.min()) & (t_ns <= times.max())
            if not rows.all():
                remarks.append(
                    f"{topic.name}: {np.count_nonzero(~rows)} poses left out, which are marked as "
                    "invalid or have no attitude"
                )
            if not rows.any():
                continue
            q_wb = log.attitudes_at(times, t_ns[rows], axes.q_enu_flu(q[finite]))
            rates = _rates_at(topics.get(f"vehicle_angular_velocity{suffix}", ()), t_ns[rows])
            yield log.odometry(
                f"/{TRUTH_TOPIC}" if suffix else topic.topic,
                t_ns[rows],
                axes.enu(position[rows]),
                q_wb,
                axes.enu(velocity[rows]),
                rates,
                aliases=topic.aliases,
            )


def _rates_at(instances: Sequence[_Topic], t_ns: Times) -> Array | None:
    """Return the angular rates in FLU (n, 3) at times (n,); None: the log does not cover them."""
    for topic in instances[:1]:
        rates = topic.vector("xyz")
        times = topic.t_ns
        if rates is None or times.min() > t_ns.min() or times.max() < t_ns.max():
            return None
        return interpolate_columns(times, t_ns, axes.flu(rates))
    return None


def _odometry(topics: Topics, remarks: list[str]) -> Iterator[LogStream]:
    """Yield the odometry of the estimator, and of cameras or motion capture."""
    for name in ("vehicle_odometry", "vehicle_visual_odometry", "vehicle_mocap_odometry"):
        for topic in topics.get(name, ()):
            yield from _odometry_of(topic, remarks)


def _odometry_of(topic: _Topic, remarks: list[str]) -> Iterator[LogStream]:
    """Yield the poses of a topic of odometry; none if it lacks positions or attitudes."""
    position = topic.vector("position")
    position = topic.vector(*AXES) if position is None else position
    q = topic.vector("q")
    if position is None or q is None:
        return
    rows = np.isfinite(np.hstack([position, q])).all(axis=1) & (np.linalg.norm(q, axis=1) > 0.5)
    if not rows.all():
        remarks.append(
            f"{topic.name}: {np.count_nonzero(~rows)} poses left out, which are marked as invalid"
        )
    if not rows.any():
        return
    topic, position, q = topic.rows(rows), position[rows], q[rows]
    frame = topic.columns.get("pose_frame", topic.columns.get("local_frame"))
    # Firmware before 1.14 counts its frames from 0: NED, then FRD.
    ned_number = _POSE_NED if "pose_frame" in topic.columns else 0
    is_ned = frame is None or bool((frame == ned_number).all())
    convert_axes = axes.enu if is_ned else axes.flu
    q_wb = axes.q_enu_flu(q) if is_ned else axes.q_flu_flu(q)
    frame_id = WORLD_FRAME if is_ned else "odom"
    velocity = topic.vector("velocity")
    velocity = topic.vector("vx", "vy", "vz") if velocity is None else velocity
    names = topic.topic, topic.t_ns, convert_axes(position), q_wb
    if velocity is None or not np.isfinite(velocity).all():
        yield log.poses(*names, frame_id=frame_id, aliases=topic.aliases)
        return
    velocity_frame = topic.columns.get("velocity_frame")
    velocity_w = convert_axes(velocity)
    if velocity_frame is not None:
        body = (velocity_frame == _VELOCITY_BODY)[:, None]
        velocity_from_body = np.einsum("nij,nj->ni", to_matrix(q_wb), axes.flu(velocity))
        velocity_w = np.where(body, velocity_from_body, velocity_w)
    rates = topic.vector("angular_velocity")
    rates = topic.vector("rollspeed", "pitchspeed", "yawspeed") if rates is None else rates
    yield log.odometry(
        *names,
        velocity_w,
        axes.flu(rates) if rates is not None and np.isfinite(rates).all() else None,
        _variances(topic, q_wb, is_ned),
        frame_id,
        topic.aliases,
    )


def _variances(topic: _Topic, q_wb: Array, is_ned: bool) -> tuple[Array, Array, Array] | None:
    """Return the variances of position, rotation about the world's axes, velocity; None: unknown.

    The velocity's axes may be turned, so its variance is the mean of the three.
    """
    names = ("position", "orientation", "velocity")
    variances = []
    for column in (topic.vector(f"{name}_variance") for name in names):
        if column is None or not np.isfinite(column).all():
            return None
        variances.append(column)
    position, rotation, velocity = variances
    position = np.abs(axes.enu(position)) if is_ned else position
    r_wb = to_matrix(q_wb)
    about_world = np.einsum("nij,nj,nij->ni", r_wb, rotation, r_wb)
    return position, about_world, np.tile(velocity.mean(axis=1)[:, None], 3)


def _magnetometers(topics: Topics, remarks: list[str]) -> Iterator[LogStream]:
    """Yield the magnetic fields of ``sensor_mag`` and ``vehicle_magnetometer``."""
    for name, fields in (
        ("sensor_mag", AXES),
        ("vehicle_magnetometer", ("magnetometer_ga",)),
    ):
        for topic in topics.get(name, ()):
            field = topic.vector(*fields)
            if field is not None:
                t_ns = topic.t_ns
                yield log.magnetic_field(topic.topic, t_ns, axes.flu(field) * _GAUSS, topic.aliases)


def _barometers(topics: Topics, remarks: list[str]) -> Iterator[LogStream]:
    """Yield the pressures of ``sensor_baro`` and ``vehicle_air_data``."""
    for name, column in (("sensor_baro", "pressure"), ("vehicle_air_data", "baro_pressure_pa")):
        for topic in topics.get(name, ()):
            pressure = topic.number(column)
            if pressure is None:
                continue
            if float(np.median(pressure)) < _LOWEST_PASCALS:
                pressure = pressure * 100.0
            yield log.pressure(topic.topic, topic.t_ns, pressure, topic.aliases)


def _receivers(topics: Topics, remarks: list[str]) -> Iterator[LogStream]:
    """Yield positions and velocities of GNSS receivers."""
    for name in ("sensor_gps", "vehicle_gps_position"):
        for topic in topics.get(name, ()):
            place = _geodetic(topic)
            if place is None:
                continue
            kind = topic.number("fix_type")
            has_fix = np.ones(len(place[0]), bool) if kind is None else kind >= _FIX_2D
            unknown = np.zeros(len(place[0]))
            eph, epv, speed = (
                unknown if column is None else column
                for column in (topic.number(key) for key in ("eph", "epv", "s_variance_m_s"))
            )
            t_ns = topic.t_ns
            yield log.fix(topic.topic, t_ns, place, has_fix, (eph, epv), topic.aliases)
            velocity = topic.vector("vel_n_m_s", "vel_e_m_s", "vel_d_m_s")
            if velocity is not None:
                valid = topic.columns.get("vel_ned_valid", has_fix).astype(bool)
                valid &= np.isfinite(velocity).all(axis=1)
                yield log.velocity(
                    f"{topic.topic}/velocity", t_ns[valid], axes.enu(velocity[valid]), speed[valid]
                )


def _geodetic(topic: _Topic) -> tuple[Array, Array, Array] | None:
    """Return latitude and longitude [deg] and altitude above the ellipsoid [m]."""
    degrees = [topic.number("latitude_deg"), topic.number("longitude_deg")]
    altitude = topic.number("altitude_ellipsoid_m", "altitude_msl_m")
    if altitude is None:  # firmware before 1.14: 1e-7 deg and mm
        scaled = [topic.number("lat"), topic.number("lon")]
        degrees = [None if column is None else column * 1e-7 for column in scaled]
        altitude = topic.number("alt_ellipsoid", "alt")
        altitude = None if altitude is None else altitude * 1e-3
    latitude, longitude = degrees
    if latitude is None or longitude is None or altitude is None:
        return None
    return latitude, longitude, altitude


def _clippings(topics: Topics) -> Iterator[ClippingCounts]:
    """Yield the counts of clipped readings of each IMU."""
    for topic in topics.get("vehicle_imu_status", ()):
        for triad, name in zip(TRIADS, ("gyro_clipping", "accel_clipping"), strict=True):
            counts = topic.vector(name)
            if counts is not None:
                total = counts.sum(axis=1).astype(np.int64)
                yield ClippingCounts(f"vehicle_imu/{topic.instance}", triad, topic.t_ns, total)


_READERS: Final = (
    _read_sensor_combined,
    _integrals,
    _instances,
    _local_position,
    _odometry,
    _magnetometers,
    _barometers,
    _receivers,
)
"""Functions that yield streams of the topics, in the order in which they are listed."""
_NAMES: Final = frozenset(
    {
        *("sensor_combined", "vehicle_imu", "vehicle_imu_status"),
        *(f"sensor_{triad}{suffix}" for triad in ("gyro", "accel") for suffix in ("", _FIFO)),
        *(
            f"vehicle_{name}{suffix}"
            for name in ("local_position", "attitude", "angular_velocity")
            for suffix in ("", _TRUTH)
        ),
        *("vehicle_odometry", "vehicle_visual_odometry", "vehicle_mocap_odometry"),
        *("sensor_mag", "vehicle_magnetometer", "sensor_baro", "vehicle_air_data"),
        *("sensor_gps", "vehicle_gps_position"),
    }
)
"""Names of the topics that are read; pyulog passes over all others."""
