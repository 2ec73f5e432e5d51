# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""``oxts`` of KITTI's raw data: the OXTS RT 3003, a file for each time.

A drive, its ``oxts`` or a zip of either: ``timestamps.txt`` has a UTC with nanoseconds a line, and
``data/0000000000.txt`` the 30 numbers of ``dataformat.txt`` (Geiger et al., "Vision meets Robotics:
The KITTI Dataset", IJRR 2013, and the development kit of the raw data). Axes of the body are
forward, left, up and yaw is 0 to the east, so that the angles are those of this package. Positions
are those in the tangent plane of the first one, and the truth, as in KITTI's benchmarks. The kit's
Mercator projection, on a sphere, changes distances by about 0.2 %, so that they contradict the
velocities.
"""

from collections.abc import Iterator
from pathlib import Path
from typing import Final

import numpy as np

from imu_sim_ros.bags.logs import archive, columns, log
from imu_sim_ros.bags.logs.archive import Archive
from imu_sim_ros.bags.logs.log import Contents, LogStream
from imu_sim_ros.core.conventions import TRUTH_TOPIC
from imu_sim_ros.core.errors import InputError
from imu_sim_ros.core.geodesy import tangent_plane
from imu_sim_ros.core.rotation import from_euler
from imu_sim_ros.core.types import Array, Times
from imu_sim_ros.inputs.rows import number_of, open_shared

MEMORY = 6
"""Memory that reading takes, in sizes of the file."""
_TIMES: Final = "/oxts/timestamps.txt"
_FIELDS: Final = (
    *("lat", "lon", "alt", "roll", "pitch", "yaw", "vn", "ve", "vf", "vl", "vu"),
    *("ax", "ay", "az", "af", "al", "au", "wx", "wy", "wz", "wf", "wl", "wu"),
    *("pos_accuracy", "vel_accuracy", "navstat", "numsats", "posmode", "velmode", "orimode"),
)
"""Numbers of a file in their order: deg, m, rad, m/s, m/s^2, rad/s."""


def holds(path: Path, magic: bytes) -> bool:
    """Return True for a drive of KITTI's raw data, its oxts, or a zip of them."""
    if not archive.is_archive(path, magic):
        return False
    if path.is_dir():
        folder = _folder(path)
        return folder is not None and (folder / "timestamps.txt").is_file()
    with Archive(path) as files:
        return bool(files.names_of(_TIMES))


def _folder(path: Path) -> Path | None:
    """Return the folder of the files of a drive; None: it has none of 30 numbers."""
    folder = path / "oxts" if (path / "oxts").is_dir() else path
    for file in sorted((folder / "data").glob("*.txt"))[:1]:
        with open_shared(file) as content:
            head = content.read(columns.HEAD_BYTES)
        if len(head.split()) == len(_FIELDS):
            return folder
    return None


def contents(path: Path) -> Contents:
    """Return the topics of a drive; see :class:`imu_sim_ros.bags.logs.log.LogFormat`."""
    damage: list[str] = []
    with Archive(_folder(path) or path) as files:
        times = (files.names_of(_TIMES) or files.names_of("/timestamps.txt"))[:1]
        if not times:
            raise InputError(f"{path}: has no timestamps.txt")
        files.refuse_several(files.names_of(_TIMES))
        prefix = times[0][: -len("timestamps.txt")]
        lines = files.read(times[0]).splitlines()
        stamps = [columns.utc_ns(line) for line in lines if line.strip()]
        rows = []
        names = set(files.names)
        for k, stamp in enumerate(stamps):
            name = f"{prefix}data/{k:010d}.txt"
            numbers = _numbers(files.read(name)) if name in names else None
            if stamp is not None and stamp >= 0 and numbers is not None:
                rows.append((stamp, numbers))
    if len(rows) < len(stamps):
        damage.append(
            f"{len(stamps) - len(rows)} of {len(stamps)} times left out, which have no file of "
            f"{len(_FIELDS)} numbers"
        )
    if not rows:
        raise InputError(f"{path}: drive of KITTI without readings")
    t_ns = np.array([stamp for stamp, _ in rows], np.int64)
    table = dict(zip(_FIELDS, np.array([numbers for _, numbers in rows]).T, strict=True))
    return Contents(list(_streams(t_ns, table)), damage=tuple(damage))


def _streams(t_ns: Times, table: dict[str, Array]) -> Iterator[LogStream]:
    """Yield readings with orientation, poses with velocities, positions and velocities."""

    def vector(*names: str) -> Array:
        return np.column_stack([table[name] for name in names])

    q_wb = from_euler(vector("roll", "pitch", "yaw"))
    gyro, accel = vector("wx", "wy", "wz"), vector("ax", "ay", "az")
    geodetic, velocity = vector("lat", "lon", "alt"), vector("ve", "vn", "vu")
    yield log.imu("/oxts/imu", t_ns, gyro, accel, q_wi=q_wb)
    position = tangent_plane(geodetic, geodetic[0])
    topic = f"/{TRUTH_TOPIC}"
    yield log.odometry(topic, t_ns, position, q_wb, velocity, gyro, aliases=("oxts/odom",))
    deviation, has_fix = table["pos_accuracy"], table["numsats"] > 0
    latitude, longitude, height = geodetic.T
    place = (latitude, longitude, height)
    yield log.fix("/oxts/fix", t_ns, place, has_fix, (deviation, deviation))
    yield log.velocity("/oxts/velocity", t_ns, velocity, table["vel_accuracy"])


def _numbers(content: bytes) -> list[float] | None:
    """Return the 30 numbers of a file; None: it has fewer, or others."""
    try:
        numbers = [number_of(word) for word in content.decode("ascii", "replace").split()]
    except ValueError:
        return None
    return numbers if len(numbers) == len(_FIELDS) and np.isfinite(numbers).all() else None
