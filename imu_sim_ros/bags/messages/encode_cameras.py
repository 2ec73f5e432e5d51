# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Images, points and transforms as the bytes of ROS messages."""

import struct
from collections.abc import Sequence
from typing import Any, Final

import numpy as np
from numpy.typing import ArrayLike, NDArray

from imu_sim_ros.bags.messages.encode import seconds
from imu_sim_ros.bags.messages.layouts import STAMP_OFFSET, LayoutBuilder
from imu_sim_ros.core.timebase import NANOSECONDS_PER_SECOND
from imu_sim_ros.core.types import Array
from imu_sim_ros.recordings.cameras import CameraInfo

IMAGE: Final = "sensor_msgs/msg/Image"
COMPRESSED_IMAGE: Final = "sensor_msgs/msg/CompressedImage"
CAMERA_INFO: Final = "sensor_msgs/msg/CameraInfo"
_PIXEL_BYTES: Final = {
    "mono8": 1,
    "rgb8": 3,
    "rgba8": 4,
    "mono16": 2,
    "rgb16": 6,
    "16UC1": 2,
    "32FC1": 4,
    "32FC2": 8,
}
_PNG_COLOURS: Final = {"rgb8": "bgr8", "rgba8": "bgra8", "rgb16": "bgr16"}
"""Colours of encoded images in image_transport, which has no word for grey ones."""


class StampedBuilder(LayoutBuilder):
    """A message that begins with a header; its texts and lengths are known."""

    def __init__(self, frame_id: str, encoding: str) -> None:
        super().__init__(encoding)
        self.field("stamp", "header")
        self.text(frame_id)

    def values(self, values: ArrayLike, code: str) -> None:
        """Add numbers that are known."""
        data = np.asarray(values, dtype=code)
        if data.size:
            self.align(data.dtype.itemsize)
            self.constant(data.tobytes())

    def copy_with_stamp(self, t_ns: int) -> bytearray:
        """Return the message with a stamp.

        :raises InputError: for a stamp that a message cannot hold.
        """
        second, nanosecond = seconds(np.array([t_ns]), self.encoding)
        message = bytearray(self.template)
        for name, value in (("sec", second), ("nanosec", nanosecond)):
            offset = self.offsets[self.names.index(name)]
            message[offset : offset + 4] = int(value[0]).to_bytes(4, "little")
        return message


def shift_stamp(payload: bytes, by_ns: int) -> bytes:
    """Return a message in CDR that begins with a header, its stamp moved by so many nanoseconds.

    :raises InputError: for a stamp that a message cannot hold.
    """
    second, nanosecond = struct.unpack_from("<iI", payload, STAMP_OFFSET)
    t_ns = np.array([second * NANOSECONDS_PER_SECOND + nanosecond + by_ns])
    (second,), (nanosecond,) = seconds(t_ns, "cdr")
    stamp = struct.pack("<iI", second, nanosecond)
    return b"".join([payload[:STAMP_OFFSET], stamp, payload[STAMP_OFFSET + len(stamp) :]])


class ImageEncoder:
    """sensor_msgs/Image of one size and pixel encoding."""

    type_name = IMAGE

    def __init__(
        self, frame_id: str, height: int, width: int, pixels: str = "mono8", encoding: str = "cdr"
    ) -> None:
        """Set up the messages.

        :param pixels: mono8, mono16, rgb8, rgba8, rgb16, 16UC1, 32FC1 or 32FC2.
        """
        step = width * _PIXEL_BYTES[pixels]
        self._head = StampedBuilder(frame_id, encoding)
        self._head.values([height, width], "<u4")
        self._head.text(pixels)
        self._head.values([0], "u1")  # little-endian
        self._head.values([step, step * height], "<u4")

    def encode(self, t_ns: int, image: NDArray[np.generic]) -> bytes:
        """Return the message of an image (h, w), (h, w, 2) or (h, w, 3)."""
        return bytes(self._head.copy_with_stamp(t_ns) + np.ascontiguousarray(image).data.cast("B"))


class CompressedImageEncoder:
    """sensor_msgs/CompressedImage with PNG or JPEG, as image_transport names it."""

    type_name = COMPRESSED_IMAGE

    def __init__(
        self, frame_id: str, pixels: str = "mono8", encoding: str = "cdr", form: str = "png"
    ) -> None:
        """Set up the messages.

        :param pixels: mono8, mono16, rgb8, rgba8 or rgb16.
        :param form: png or jpeg.
        """
        self._head = StampedBuilder(frame_id, encoding)
        self._head.text(f"{pixels}; {form} compressed {_PNG_COLOURS.get(pixels, '')}")
        self._head.align(4)

    def encode(self, t_ns: int, image: bytes) -> bytes:
        """Return the message of an encoded image."""
        return bytes(self._head.copy_with_stamp(t_ns) + len(image).to_bytes(4, "little") + image)


class CameraInfoEncoder:
    """sensor_msgs/CameraInfo of one camera."""

    type_name = CAMERA_INFO

    def __init__(self, frame_id: str, info: CameraInfo, encoding: str = "cdr") -> None:
        self._all = StampedBuilder(frame_id, encoding)
        self._all.values([info.height, info.width], "<u4")
        self._all.text(info.distortion_model)
        self._all.length(len(info.d))
        self._all.values(info.d, "<f8")
        for matrix in (info.k, info.r, info.p):
            self._all.values(matrix, "<f8")
        self._all.values([*info.binning, *info.region], "<u4")
        self._all.values([0], "u1")

    def encode(self, t_ns: int) -> bytes:
        """Return the message."""
        return bytes(self._all.copy_with_stamp(t_ns))


POINT_CLOUD: Final = "sensor_msgs/msg/PointCloud"
POINT_CLOUD2: Final = "sensor_msgs/msg/PointCloud2"
LIVOX: Final = "livox_ros_driver2/msg/CustomMsg"

POINT_TYPES: Final = {"i1": 1, "u1": 2, "i2": 3, "u2": 4, "i4": 5, "u4": 6, "f4": 7, "f8": 8}
"""sensor_msgs/PointField's numbers of the types."""


LIVOX_POINT: Final = np.dtype(
    [
        ("offset_time", "<u4"),
        *((axis, "<f4") for axis in "xyz"),
        *((name, "u1") for name in ("reflectivity", "tag", "line")),
    ]
)
"""livox_ros_driver2/CustomPoint, without gaps."""


class PointCloudEncoder:
    """sensor_msgs/PointCloud: points with channels of float32."""

    type_name = POINT_CLOUD

    def __init__(self, frame_id: str, channels: Sequence[str], encoding: str = "cdr") -> None:
        """Set up the messages.

        :param channels: names of the m channels.
        """
        self._frame_id, self._channels, self._encoding = frame_id, channels, encoding

    def encode(self, t_ns: int, points: ArrayLike, values: Array) -> bytes:
        """Return a message.

        :param points: (n, 3) points [m].
        :param values: (n, m) values of the m channels.
        """
        positions = np.asarray(points, dtype="<f4")
        message = StampedBuilder(self._frame_id, self._encoding)
        message.length(len(positions))
        message.values(positions, "<f4")
        message.length(len(self._channels))
        for name, column in zip(self._channels, values.T, strict=True):
            message.text(name)
            message.length(len(column))
            message.values(column, "<f4")
        return bytes(message.copy_with_stamp(t_ns))


class PointCloud2Encoder:
    """sensor_msgs/PointCloud2: the points of a structured array, one row."""

    type_name = POINT_CLOUD2

    def __init__(self, frame_id: str, encoding: str = "cdr") -> None:
        self._frame_id, self._encoding = frame_id, encoding

    def encode(self, t_ns: int, rows: NDArray[np.void]) -> bytes:
        """Return a message.

        :param rows: (n,) little-endian fields x, y, z [m] and others, at their offsets in a point.
        """
        message = StampedBuilder(self._frame_id, self._encoding)
        message.values([1, len(rows)], "<u4")
        fields: Any = rows.dtype.fields or {}
        message.length(len(fields))
        for name, (kind, offset, *_) in fields.items():
            message.text(name)
            message.values([offset], "<u4")
            message.values([POINT_TYPES[kind.str[1:]]], "u1")
            message.values([1], "<u4")
        message.values([0], "u1")  # little-endian
        message.values([rows.itemsize, rows.nbytes, rows.nbytes], "<u4")
        message.constant(rows.tobytes())
        message.values([1], "u1")  # dense: all points are there
        return bytes(message.copy_with_stamp(t_ns))


class LivoxEncoder:
    """livox_ros_driver2/CustomMsg."""

    type_name = LIVOX

    def __init__(self, frame_id: str, encoding: str = "cdr") -> None:
        self._frame_id, self._encoding = frame_id, encoding

    def encode(self, t_ns: int, points: NDArray[np.void]) -> bytes:
        """Return a message.

        :param points: (n,) points of type LIVOX_POINT.
        """
        message = StampedBuilder(self._frame_id, self._encoding)
        message.values([t_ns], "<u8")
        message.values([len(points)], "<u4")
        message.values([0, 0, 0, 0], "u1")  # the number of the LiDAR; reserved
        message.length(len(points))
        content = points.tobytes()
        if message.cdr and len(points):  # each point is aligned to its largest number
            size = points.itemsize
            padded = np.zeros((len(points), size + 1), np.uint8)
            padded[:, :size] = points.view(np.uint8).reshape(-1, size)
            content = padded.tobytes()[:-1]
        message.constant(content)
        return bytes(message.copy_with_stamp(t_ns))
