# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Fields of points as the drivers of makers write them, and as estimators read them."""

from collections.abc import Callable
from typing import Final, NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from imu_sim_ros.core.errors import ConfigurationError
from imu_sim_ros.core.types import Array, Single

Fields = tuple[tuple[str, str, int], ...]
"""Names, types and offsets [bytes]."""


class Cloud(NamedTuple):
    """The k points of one scan, in the order of their times."""

    t_ns: int
    """Stamp of the scan's start [ns]."""
    xyz: Single
    """(k, 3) points in the sensor's frame at each point's own time [m]."""
    intensity: Single
    """(k,) 100 for a white surface square on."""
    ring: NDArray[np.uint16]
    """(k,) numbers of the rings."""
    time: Array
    """(k,) times of the points since the stamp [s]."""
    range: Single
    """(k,) measured range of each point [m]."""


class PointLayout(NamedTuple):
    """A kind of points."""

    fields: Fields
    """Name, type and offset [bytes] of each field of a point."""
    size: int
    """Size of a point [bytes]."""
    values: dict[str, Callable[[Cloud], ArrayLike]]
    """Values of each field except x, y, z, as functions of the point cloud."""

    @property
    def dtype(self) -> np.dtype[np.void]:
        """The structured type of a point."""
        names, formats, offsets = zip(*self.fields, strict=True)
        return np.dtype(
            {"names": names, "formats": formats, "offsets": offsets, "itemsize": self.size}
        )

    @property
    def most_rings(self) -> int:
        """Largest number of rings or lines that a point's field can hold."""
        kind = next(kind for name, kind, _ in self.fields if name in ("ring", "line"))
        return np.iinfo(kind).max + 1

    def rows(self, cloud: Cloud) -> NDArray[np.void]:
        """Return the points (k,) of a scan."""
        rows = np.zeros(len(cloud.xyz), self.dtype)
        for k, name in enumerate("xyz"):
            rows[name] = cloud.xyz[:, k]
        for name, value in self.values.items():
            rows[name] = value(cloud)
        return rows


_XYZ: Final = (("x", "<f4", 0), ("y", "<f4", 4), ("z", "<f4", 8))


def _intensity(cloud: Cloud) -> Single:
    """Return the intensities of the points."""
    return cloud.intensity


def _ring(cloud: Cloud) -> NDArray[np.uint16]:
    """Return the rings of the points."""
    return cloud.ring


def _nanoseconds(cloud: Cloud) -> Array:
    """Return the times of the points after the scan's stamp [ns]."""
    return np.rint(cloud.time * 1e9)


def reflectivity_of(cloud: Cloud) -> Single:
    """Return intensities as a byte: 100 for a white surface, up to 255 for mirrors."""
    return np.clip(np.rint(cloud.intensity), 0, 255)


LAYOUTS: Final[dict[str, PointLayout]] = {
    # velodyne_pointcloud of ROS 2, pointcloudXYZIRT.cpp.
    "velodyne": PointLayout(
        (*_XYZ, ("intensity", "<f4", 12), ("ring", "<u2", 16), ("time", "<f4", 18)),
        22,
        {"intensity": _intensity, "ring": _ring, "time": lambda cloud: cloud.time},
    ),
    # ouster-ros, os_point.h; ring as FAST-LIO and LIO-SAM declare it.
    "ouster": PointLayout(
        (
            *_XYZ,
            ("intensity", "<f4", 16),
            ("t", "<u4", 20),
            ("reflectivity", "<u2", 24),
            ("ring", "<u1", 26),
            ("ambient", "<u2", 28),
            ("range", "<u4", 32),
        ),
        48,
        {
            "intensity": _intensity,
            "t": _nanoseconds,
            "reflectivity": reflectivity_of,
            "ring": _ring,
            "range": lambda cloud: np.rint(1000.0 * cloud.range.astype(np.float64)),
        },
    ),
    # HesaiLidar_ROS_2.0, source_driver_ros2.hpp: absolute times.
    "hesai": PointLayout(
        (*_XYZ, ("intensity", "<f4", 12), ("ring", "<u2", 16), ("timestamp", "<f8", 18)),
        26,
        {
            "intensity": _intensity,
            "ring": _ring,
            "timestamp": lambda cloud: 1e-9 * cloud.t_ns + cloud.time,
        },
    ),
    # livox_ros_driver2, comm.h, LivoxPointXyzrtlt: absolute times in ns.
    "livox": PointLayout(
        (
            *_XYZ,
            ("intensity", "<f4", 12),
            ("tag", "<u1", 16),
            ("line", "<u1", 17),
            ("timestamp", "<f8", 18),
        ),
        26,
        {
            "intensity": _intensity,
            "tag": lambda cloud: 0x10,  # the first return, with normal confidence
            "line": _ring,
            "timestamp": lambda cloud: cloud.t_ns + _nanoseconds(cloud),
        },
    ),
}


def custom_points(cloud: Cloud) -> NDArray[np.void]:
    """Return the points (k,) of a livox_ros_driver2/CustomMsg.

    :raises ConfigurationError: for more lines than it can tell apart.
    """
    from imu_sim_ros.bags.messages.encode_cameras import LIVOX_POINT

    if cloud.ring.max(initial=0) > 255:
        raise ConfigurationError("livox_ros_driver2/CustomMsg counts lines in a byte: at most 256")
    rows = np.zeros(len(cloud.xyz), LIVOX_POINT)
    for k, name in enumerate("xyz"):
        rows[name] = cloud.xyz[:, k]
    rows["offset_time"], rows["reflectivity"] = _nanoseconds(cloud), reflectivity_of(cloud)
    rows["tag"], rows["line"] = 0x10, cloud.ring
    return rows
