# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""A folder with a file for each scan, next to an output: KITTI's, PLY or PCD."""

from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Final

import numpy as np

from imu_sim_ros.bags.outputs import make_folder
from imu_sim_ros.sensors.environment import EnvironmentParameters
from imu_sim_ros.sensors.lidar.declaration import clouds
from imu_sim_ros.sensors.lidar.layouts import LAYOUTS, Cloud
from imu_sim_ros.sensors.lidar.parameters import LidarParameters
from imu_sim_ros.sensors.samples import Samples

_FIELDS: Final = LAYOUTS["velodyne"]
"""Fields of a point in PLY and PCD files."""
_PLY: Final = {"<f4": "float", "<u2": "ushort"}
_PCD: Final = {"f": "F", "u": "U"}


def _kitti(cloud: Cloud) -> bytes:
    """Return x, y, z and reflectance, 1 for a white surface, as KITTI's velodyne/*.bin has them."""
    reflectance = (np.float32(0.01) * cloud.intensity)[:, None]
    return np.concatenate([cloud.xyz, reflectance], axis=1).astype("<f4").tobytes()


def _ply(cloud: Cloud) -> bytes:
    """Return a scan as a binary PLY file."""
    rows = _FIELDS.rows(cloud)
    fields = "".join(f"property {_PLY[kind]} {name}\n" for name, kind, _ in _FIELDS.fields)
    head = f"ply\nformat binary_little_endian 1.0\nelement vertex {len(rows)}\n{fields}end_header\n"
    return head.encode() + rows.tobytes()


def _pcd(cloud: Cloud) -> bytes:
    """Return version 0.7 of the Point Cloud Library's format."""
    rows = _FIELDS.rows(cloud)
    kinds = [np.dtype(kind) for _, kind, _ in _FIELDS.fields]
    lines = {
        "VERSION": "0.7",
        "FIELDS": " ".join(name for name, _, _ in _FIELDS.fields),
        "SIZE": " ".join(str(kind.itemsize) for kind in kinds),
        "TYPE": " ".join(_PCD[kind.kind] for kind in kinds),
        "COUNT": " ".join("1" for _ in kinds),
        "WIDTH": len(rows),
        "HEIGHT": 1,
        "VIEWPOINT": "0 0 0 1 0 0 0",
        "POINTS": len(rows),
        "DATA": "binary",
    }
    return "".join(f"{key} {value}\n" for key, value in lines.items()).encode() + rows.tobytes()


_FORMS: Final[dict[str, tuple[str, Callable[[Cloud], bytes]]]] = {
    "kitti": ("bin", _kitti),
    "ply": ("ply", _ply),
    "pcd": ("pcd", _pcd),
}


class ScanFiles:
    """``000000.bin``, ..., and ``times.txt`` with the stamps of the scans [s]."""

    def __init__(
        self,
        parameters: LidarParameters,
        _: EnvironmentParameters,
        __: int,
        folders: Sequence[Path],
    ) -> None:
        """Make the folder.

        :param folders: the folder alone.
        """
        (self._folder,) = folders
        make_folder(self._folder)
        self._suffix, self._content = _FORMS[parameters.files]
        self._times = (self._folder / "times.txt").open("w", encoding="ascii", newline="\n")
        self._count = 0

    def write(self, readings: Samples) -> None:
        """Write the next scans."""
        for cloud in clouds(readings, readings.delivered):
            path = self._folder / f"{self._count:06d}.{self._suffix}"
            path.write_bytes(self._content(cloud))
            second, nanosecond = divmod(cloud.t_ns, 1_000_000_000)
            self._times.write(f"{second}.{nanosecond:09d}\n")
            self._count += 1

    def close(self) -> None:
        """Complete the times."""
        self._times.close()
