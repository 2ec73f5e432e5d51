# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Recordings of phones by Sensor Logger (tszheichoi.com): a folder or zip, one CSV a sensor.

Names, units and axes are those of the pages UNITS, COORDINATES and CROSSPLATFORM of the repository
tszheichoi/awesome-sensor-logger. ``time`` is UTC in nanoseconds; the columns have any order, as
``time,seconds_elapsed,z,y,x``. The axes are those of the screen: x to the right, y up, z out of it.

Android's accelerations have the signs of a specific force. Apple's are its negative, on all axes,
unless the app standardises them (``standardisation`` in ``Metadata.csv``); so are its gravity and
the accelerations of its watch and headphones.
"""

from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import Final, NamedTuple

import numpy as np

from imu_sim_ros.bags.logs import archive, columns, log
from imu_sim_ros.bags.logs.archive import Archive
from imu_sim_ros.bags.logs.columns import ColumnTable
from imu_sim_ros.bags.logs.log import Contents, LogOrientations, LogStream, LogTriad
from imu_sim_ros.bags.messages.encode import FLUID_PRESSURE, IMU, MAGNETIC_FIELD
from imu_sim_ros.core.conventions import STANDARD_GRAVITY
from imu_sim_ros.core.rotation import multiply, normalise, rotate
from imu_sim_ros.core.timebase import interpolate_columns
from imu_sim_ros.core.types import Array, Times

MEMORY = 7
"""Memory that reading takes, in sizes of the file."""
_STAMP: Final = "time"
_HEAD: Final = frozenset((_STAMP, "seconds_elapsed"))
"""Columns that the table of each sensor has."""
_METADATA: Final = "/metadata.csv"
_XYZ: Final = ("x", "y", "z")
_Q: Final = ("qw", "qx", "qy", "qz")
_MICROTESLA: Final = 1e-6
"""One microtesla [T]."""
_MILLIBAR: Final = 100.0
"""One millibar [Pa]."""
_WEARABLES: Final = ("WristMotion", "Headphone")
"""Tables of devices with an IMU of their own."""
_NORTH_IS_X: Final = np.array([np.sqrt(0.5), 0.0, 0.0, np.sqrt(0.5)])
"""Quaternion of the axes north, west, up in ENU."""
_UPRIGHT: Final = 0.8
"""Least cosine between up and the mean specific force of a correct orientation."""
_PREFERRED: Final = {
    IMU: (
        *("/Gyroscope", "/TotalAcceleration", "/Accelerometer"),
        *("/GyroscopeUncalibrated", "/AccelerometerUncalibrated", "/WristMotion", "/Headphone"),
    ),
    MAGNETIC_FIELD: ("/Magnetometer",),
    FLUID_PRESSURE: ("/Barometer",),
}
"""Topics that are read if the user names none."""


class _Platform(NamedTuple):
    """Conventions of the operating system that made a recording."""

    sign: float
    """Factor of accelerations and gravity that makes them parts of a specific force."""
    uncalibrated: float
    """Value of the unit of uncalibrated accelerations [m/s^2]."""
    is_apple: bool
    """True if the axes of the world are north, west, up."""


class _Samples(NamedTuple):
    """n rows of the table of a sensor."""

    t_ns: Times
    """(n,) stamps."""
    values: Array
    """(n, m) columns."""


def holds(path: Path, magic: bytes) -> bool:
    """Return True for a folder or zip with tables of Sensor Logger."""
    if not archive.is_archive(path, magic):
        return False
    with Archive(path, depth=1) as files:
        return any(_is_table(files, name) for name in _tables_in(files))


def contents(path: Path) -> Contents:
    """Return the topics of a recording; see :class:`imu_sim_ros.bags.logs.log.LogFormat`."""
    damage: list[str] = []
    remarks: list[str] = []
    with Archive(path, depth=1) as files:
        names = [name for name in _tables_in(files) if _is_table(files, name)]
        files.refuse_several(names)
        platform = _platform(files, remarks)
        tables: dict[str, ColumnTable] = {}
        for name in names:
            lines = columns.lines_of(f"{path}: {name}", files.read(name))
            tables[archive.stem(name)] = columns.table_of(name, lines)
    recording = _Recording(tables, platform, damage, remarks)
    streams = list(recording.streams())
    if not streams:
        raise log.refuse_empty(path, "a recording of Sensor Logger", sorted(tables))
    return Contents(streams, _PREFERRED, (), tuple(damage), tuple(remarks))


def _tables_in(files: Archive) -> list[str]:
    """Return the names of the CSV files that may be tables of sensors."""
    return [name for name in files.names_of(".csv") if name.count("/") <= 1]


def _is_table(files: Archive, name: str) -> bool:
    """Return True if a file begins with the names of the columns that all tables have."""
    return _is_head(files.read(name, columns.HEAD_BYTES).partition(b"\n")[0])


def _is_head(line: bytes) -> bool:
    """Return True for a header that names the columns common to all tables."""
    names = line.decode("utf-8", "replace").lstrip("\ufeff").split(",")
    return {name.strip().strip('"') for name in names} >= _HEAD


def _platform(files: Archive, remarks: list[str]) -> _Platform:
    """Return the conventions that Metadata.csv states; without it those of Android."""
    entries: Mapping[str, str] = {}
    for name in files.names_of(_METADATA)[:1]:
        lines = files.read(name).decode("utf-8", "replace").lstrip("\ufeff").splitlines()
        if len(lines) > 1:
            cells = (line.split(",") for line in lines[:2])
            entries = {
                key.strip().strip('"').lower(): value.strip().strip('"').lower()
                for key, value in zip(*cells, strict=False)
            }
    system = entries.get("platform", "")
    if not system and not files.names_of("/totalacceleration.csv"):  # which Android alone has
        remarks.append(
            "there is no Metadata.csv that names the system: the signs are taken as Android's; "
            "Apple's accelerations have the opposite ones"
        )
    is_apple = system == "ios"
    if not is_apple:
        return _Platform(1.0, 1.0, False)
    if entries.get("standardisation") == "true":
        return _Platform(1.0, 1.0, False)
    return _Platform(-1.0, STANDARD_GRAVITY, True)


class _Recording:
    """Tables of a recording while they become streams."""

    def __init__(
        self,
        tables: Mapping[str, ColumnTable],
        platform: _Platform,
        damage: list[str],
        remarks: list[str],
    ) -> None:
        self._tables, self._platform = tables, platform
        self._damage, self._remarks = damage, remarks

    def streams(self) -> Iterator[LogStream]:
        """Yield the readings of all sensors."""
        accel = self._specific_force()
        gyro = self._triad("Gyroscope", 1.0)
        yield from log.pair(gyro, accel, self._remarks, self._orientations(accel))
        factor = self._platform.sign * self._platform.uncalibrated
        yield from log.pair(
            self._triad("GyroscopeUncalibrated", 1.0),
            self._triad("AccelerometerUncalibrated", factor),
            self._remarks,
        )
        for name in _WEARABLES:
            yield from self._wearable(name)
        for name in ("Magnetometer", "MagnetometerUncalibrated"):
            field = self._triad(name, _MICROTESLA)
            if field is not None:
                yield log.magnetic_field(field.topic, field.t_ns, field.values)
        pressure = self._samples("Barometer", ("pressure",))
        if pressure is not None:
            yield log.pressure("/Barometer", pressure.t_ns, pressure.values[:, 0] * _MILLIBAR)
        yield from self._location()

    def _samples(
        self, name: str, names: Sequence[str], optional: Sequence[str] = ()
    ) -> _Samples | None:
        """Return stamps and columns of a sensor's table; None: the recording has no rows of it."""
        table = self._tables.get(name)
        if table is None or not table.has(_STAMP, *names):
            return None
        rows = table.columns(_STAMP, 0, names, self._damage, optional)
        return _Samples(rows.t_ns, rows.values) if len(rows.t_ns) else None

    def _triad(self, name: str, factor: float) -> LogTriad | None:
        """Return the readings of a table with columns x, y, z times a factor."""
        samples = self._samples(name, _XYZ)
        if samples is None:
            return None
        return LogTriad(f"/{name}", (f"{name}.csv",), samples.t_ns, samples.values * factor)

    def _specific_force(self) -> LogTriad | None:
        """Return the acceleration with gravity: a table of its own, or the sum of two tables."""
        total = self._triad("TotalAcceleration", self._platform.sign)
        if total is not None:
            return total
        motion, gravity = (
            self._triad(name, self._platform.sign) for name in ("Accelerometer", "Gravity")
        )
        if motion is None:
            return None
        if gravity is None:
            self._remarks.append(
                "Accelerometer is left out: it is without gravity, and neither Gravity nor "
                "TotalAcceleration was recorded"
            )
            return None
        t_ns, values = motion.t_ns, gravity.values
        if not np.array_equal(t_ns, gravity.t_ns):
            values = interpolate_columns(gravity.t_ns, t_ns, values)
        self._remarks.append("Accelerometer: the specific force is the sum with Gravity")
        return LogTriad(motion.topic, motion.aliases, t_ns, motion.values + values)

    def _orientations(self, accel: LogTriad | None) -> LogOrientations | None:
        """Return the orientation of the phone in ENU, if it agrees with the specific force."""
        samples = self._samples("Orientation", _Q)
        if samples is None:
            return None
        norms = np.linalg.norm(samples.values, axis=1)
        rows = norms > 0.5
        if not rows.any():
            return None
        q_wi = normalise(samples.values[rows])
        if self._platform.is_apple:
            q_wi = multiply(_NORTH_IS_X, q_wi)
        orientations = LogOrientations(samples.t_ns[rows], q_wi)
        if accel is not None:
            q_at = log.attitudes_at(orientations.t_ns, accel.t_ns, orientations.q_wi)
            force = rotate(q_at, accel.values).mean(axis=0)
            if force[2] < _UPRIGHT * np.linalg.norm(accel.values, axis=1).mean():
                self._remarks.append(
                    "Orientation is left out: it contradicts the direction of gravity"
                )
                return None
        return orientations

    def _wearable(self, name: str) -> Iterator[LogStream]:
        """Yield the readings of a watch or of headphones: rates, and acceleration with gravity."""
        triads = [
            [f"{quantity}{axis}" for axis in "XYZ"]
            for quantity in ("rotationRate", "acceleration", "gravity")
        ]
        samples = self._samples(name, [column for names in triads for column in names])
        if samples is None:
            return
        rates, motion, gravity = np.split(samples.values, 3, axis=1)
        unit = self._platform.uncalibrated
        # The headphones' gravity is in m/s^2 always, and the watch's in g as its acceleration.
        unit_of_gravity = unit if name == _WEARABLES[0] else 1.0
        force = self._platform.sign * (motion * unit + gravity * unit_of_gravity)
        yield log.imu(f"/{name}", samples.t_ns, rates, force, aliases=(f"{name}.csv",))

    def _location(self) -> Iterator[LogStream]:
        """Yield the positions of the phone."""
        names = ("latitude", "longitude")
        optional = ("altitude", "horizontalAccuracy", "verticalAccuracy")
        samples = self._samples("Location", names, optional)
        if samples is None:
            return
        latitude, longitude, height, across, up = samples.values.T
        # A negative accuracy marks its value as invalid.
        deviations = np.maximum(across, 0.0), np.maximum(up, 0.0)
        position = (latitude, longitude, np.nan_to_num(height))
        yield log.fix("/Location", samples.t_ns, position, ~(across < 0.0), deviations)
