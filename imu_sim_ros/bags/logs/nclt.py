# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Tables of the NCLT dataset: the IMU ``ms25.csv``, ``gps.csv`` and the ground truth.

They have no header; the first column is the time in microseconds (Carlevaris-Bianco, Ushani and
Eustice, the data set of the North Campus, IJRR 35(9), 2016, doi 10.1177/0278364915614638, and
the scripts of its development kit). The body is forward-right-down, the world north-east-down,
angles are roll, pitch and heading [rad]. A folder with the tables, ``sensor_data`` and
``ground_truth`` below it, or a single table.
"""

import re
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Final, NamedTuple

import numpy as np

from imu_sim_ros.bags.logs import archive, axes, columns, log
from imu_sim_ros.bags.logs.archive import Archive
from imu_sim_ros.bags.logs.columns import Columns, ColumnTable
from imu_sim_ros.bags.logs.log import Contents, LogStream
from imu_sim_ros.bags.messages.encode import ODOMETRY
from imu_sim_ros.core.conventions import TRUTH_TOPIC
from imu_sim_ros.core.rotation import from_euler

MEMORY = 7
"""Memory that reading takes, in sizes of the file."""
_GAUSS: Final = 1e-4
"""One gauss [T]."""
_MICROSECONDS: Final = 3
"""Decimal digits between the unit of the stamps and a nanosecond."""
_UTIME: Final = re.compile(rb"\d{16}")
"""A time in microseconds of the years 2001 to 2286."""
_NEEDED_OF_GNSS: Final = 5
"""Columns of gps.csv that must be numbers: time, mode, satellites, latitude, longitude."""
_TRUTH: Final = "groundtruth"
_FIX: Final = 2
"""Smallest mode of gpsd with a position."""


class _Kind(NamedTuple):
    """One of the dataset's tables, which have no header."""

    name: re.Pattern[str]
    """Name of the file."""
    width: int
    """Number of columns, with the time."""


_IMU: Final = _Kind(re.compile(r"ms25(?!_euler).*\.csv"), 10)
_GNSS: Final = _Kind(re.compile(r"gps(_rtk)?\.csv"), 8)
_POSES: Final = _Kind(re.compile(r"(groundtruth|odometry_mu).*\.csv"), 7)
_KINDS: Final = (_IMU, _GNSS, _POSES)


def holds(path: Path, magic: bytes) -> bool:
    """Return True for a table of the dataset, or a folder that has its IMU or its ground truth."""
    if path.is_dir():
        with Archive(path, depth=2) as files:
            return any(_kind(name, files.read(name, columns.HEAD_BYTES)) for name in _names(files))
    return _kind(path.name, columns.head_of(path, magic)) is not None


def contents(path: Path) -> Contents:
    """Return the topics of the tables; see :class:`imu_sim_ros.bags.logs.log.LogFormat`."""
    damage: list[str] = []
    streams: list[LogStream] = []
    tables: dict[str, bytes] = {}
    if path.is_dir():
        with Archive(path, depth=2) as files:
            files.refuse_several([name for name in _names(files) if _is_imu(name)])
            tables = {name: files.read(name) for name in _names(files)}
    else:
        tables = {path.name: b"\n".join(columns.read_lines(path))}
    for name, content in tables.items():
        kind = _kind(name, content)
        if kind is not None:
            rows = _rows(columns.lines_of(f"{path}: {name}", content), name, kind, damage)
            streams += _streams(archive.stem(name), kind, rows) if len(rows.t_ns) else ()
    if not streams:
        raise log.refuse_empty(path, "a folder of NCLT", sorted(tables))
    remarks = ("velocities and rates of poses are differences of them",)
    has_poses = any(stream.type == ODOMETRY for stream in streams)
    preferred = {ODOMETRY: (f"/{TRUTH_TOPIC}",)}
    return Contents(streams, preferred, (), tuple(damage), remarks * has_poses)


def _names(files: Archive) -> list[str]:
    """Return the files whose names are those of tables."""
    names = files.names_of(".csv")
    return [
        name for name in names if any(kind.name.fullmatch(name.split("/")[-1]) for kind in _KINDS)
    ]


def _is_imu(name: str) -> bool:
    """Return True for the name of the table of the IMU."""
    return name.split("/")[-1] == "ms25.csv"


def _kind(name: str, content: bytes) -> _Kind | None:
    """Return the kind of a table by its name and its first row; None: it is none."""
    cells = content.partition(b"\n")[0].split(b",")
    if not _UTIME.fullmatch(cells[0].strip()):
        return None
    short = name.split("/")[-1].lower()
    return next(
        (kind for kind in _KINDS if kind.name.fullmatch(short) and kind.width == len(cells)), None
    )


def _rows(lines: Sequence[bytes], name: str, kind: _Kind, damage: list[str]) -> Columns:
    """Return the stamps and the numbers of the lines of a table.

    :param damage: receives a line with the number of bad rows.
    """
    names = [f"column {k}" for k in range(kind.width)]
    table = ColumnTable(name, names, lines, ",")
    needed = len(names) if kind is not _GNSS else _NEEDED_OF_GNSS
    return table.columns(names[0], _MICROSECONDS, names[1:needed], damage, names[needed:])


def _streams(name: str, kind: _Kind, rows: Columns) -> Iterator[LogStream]:
    """Yield the messages of a table.

    :param name: name of the file without its ending.
    """
    t_ns, values = rows
    if kind is _IMU:
        field, accel, gyro = (axes.flu(part) for part in np.split(values, 3, axis=1))
        yield log.imu(f"/{name}", t_ns, gyro, accel)
        yield log.magnetic_field(f"/{name}/magnetic_field", t_ns, field * _GAUSS)
    elif kind is _GNSS:
        mode, _, latitude, longitude, height = values.T[:5]
        place = (np.degrees(latitude), np.degrees(longitude), np.nan_to_num(height))
        zeros = np.zeros(len(t_ns))
        yield log.fix(f"/{name}", t_ns, place, mode >= _FIX, (zeros, zeros))
    else:
        is_truth = name.startswith(_TRUTH)
        topic = f"/{TRUTH_TOPIC}" if is_truth else f"/{name}"
        position_ned, angles = np.split(values, 2, axis=1)
        position, q_wb = axes.enu(position_ned), axes.q_enu_flu(from_euler(angles))
        velocity = log.velocities(t_ns, position)
        yield log.odometry(topic, t_ns, position, q_wb, velocity, aliases=(name,))
