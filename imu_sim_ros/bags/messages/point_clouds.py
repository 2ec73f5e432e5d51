# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Points as the bytes of ROS messages: sensor_msgs/PointCloud and sensor_msgs/PointCloud2."""

from collections.abc import Mapping, Sequence
from typing import Final

import numpy as np
from numpy.typing import ArrayLike, NDArray

from imu_sim_ros.bags.messages.images import StampedBuilder

POINT_CLOUD: Final = "sensor_msgs/msg/PointCloud"
POINT_CLOUD2: Final = "sensor_msgs/msg/PointCloud2"

# sensor_msgs/PointField's numbers of the types.
_UINT32: Final = 6
_FLOAT32: Final = 7


class PointCloudEncoder:
    """sensor_msgs/PointCloud: points with channels of float32."""

    type_name = POINT_CLOUD

    def __init__(self, frame_id: str, channels: Sequence[str], encoding: str = "cdr") -> None:
        """Set up the messages.

        :param channels: names of the m channels.
        """
        self._frame_id, self._channels, self._encoding = frame_id, channels, encoding

    def encode(self, t_ns: int, points: ArrayLike, values: NDArray[np.float64]) -> bytes:
        """Return a message.

        :param points: (n, 3).
        :param values: (n, m) of the channels.
        """
        place = np.asarray(points, dtype="<f4")
        message = StampedBuilder(self._frame_id, self._encoding)
        message.length(len(place))
        message.values(place, "<f4")
        message.length(len(self._channels))
        for name, column in zip(self._channels, values.T, strict=True):
            message.text(name)
            message.length(len(column))
            message.values(column, "<f4")
        return bytes(message.stamped(t_ns))


class PointCloud2Encoder:
    """sensor_msgs/PointCloud2: x, y, z [m] and further numbers of each point, one row."""

    type_name = POINT_CLOUD2

    def __init__(self, frame_id: str, encoding: str = "cdr") -> None:
        self._frame_id, self._encoding = frame_id, encoding

    def encode(
        self, t_ns: int, points: ArrayLike, numbers: Mapping[str, NDArray[np.int64]]
    ) -> bytes:
        """Return a message.

        :param points: (n, 3) [m].
        :param numbers: of each point, (n,) by name, as uint32.
        """
        names = ["x", "y", "z", *numbers]
        kinds = [_FLOAT32] * 3 + [_UINT32] * len(numbers)
        place = np.asarray(points)
        codes = {_FLOAT32: "<f4", _UINT32: "<u4"}
        fields = [(name, codes[kind]) for name, kind in zip(names, kinds, strict=True)]
        rows = np.zeros(len(place), fields)
        for k, name in enumerate("xyz"):
            rows[name] = place[:, k]
        for name, column in numbers.items():
            rows[name] = column
        message = StampedBuilder(self._frame_id, self._encoding)
        message.values([1, len(rows)], "<u4")
        message.length(len(names))
        for k, (name, kind) in enumerate(zip(names, kinds, strict=True)):
            message.text(name)
            message.values([4 * k], "<u4")
            message.values([kind], "u1")
            message.values([1], "<u4")
        message.values([0], "u1")  # little-endian
        message.values([rows.itemsize, rows.nbytes, rows.nbytes], "<u4")
        message.constant(rows.tobytes())
        message.values([1], "u1")  # dense: all points are there
        return bytes(message.stamped(t_ns))
