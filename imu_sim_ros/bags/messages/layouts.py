# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Where each field of a message lies in its bytes, as a NumPy structured type.

A message whose texts (the frame names) have known lengths has a constant size. A block of such
messages is one array with the structured type of :class:`Layout`, filled or read column by column.

Two encodings exist: ``cdr``, little-endian plain CDR as ROS 2 writes it (four bytes of
encapsulation header, each primitive aligned to its size relative to the byte after that header),
and ``ros1``, the packed little-endian form of ROS 1.
"""

from collections.abc import Sequence
from functools import lru_cache
from typing import Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

Bytes = NDArray[np.uint8]

ENCODINGS: Final = ("cdr", "ros1")

_CDR_HEADER: Final = b"\x00\x01\x00\x00"
_STAMPED: Final = (("stamp", "header", 1), ("frame_id", "text", 1))

# Fields in the order of the message definitions of common_interfaces (the same in ROS 1): name,
# kind (f8, text, time, or header: in ROS 1 a sequence number precedes the stamp) and count.
FIELDS: Final[dict[str, tuple[tuple[str, str, int], ...]]] = {
    "sensor_msgs/msg/Imu": (
        *_STAMPED,
        ("orientation", "f8", 4),
        ("orientation_covariance", "f8", 9),
        ("angular_velocity", "f8", 3),
        ("angular_velocity_covariance", "f8", 9),
        ("linear_acceleration", "f8", 3),
        ("linear_acceleration_covariance", "f8", 9),
    ),
    "nav_msgs/msg/Odometry": (
        *_STAMPED,
        ("child_frame_id", "text", 1),
        ("position", "f8", 3),
        ("orientation", "f8", 4),
        ("pose_covariance", "f8", 36),
        ("linear", "f8", 3),
        ("angular", "f8", 3),
        ("twist_covariance", "f8", 36),
    ),
    "geometry_msgs/msg/PoseStamped": (
        *_STAMPED,
        ("position", "f8", 3),
        ("orientation", "f8", 4),
    ),
    "geometry_msgs/msg/Vector3Stamped": (*_STAMPED, ("vector", "f8", 3)),
    "sensor_msgs/msg/Temperature": (
        *_STAMPED,
        ("temperature", "f8", 1),
        ("variance", "f8", 1),
    ),
    "rosgraph_msgs/msg/Clock": (("clock", "time", 1),),
}


class Layout(NamedTuple):
    """The bytes of one message type in one encoding, for given texts."""

    type_name: str
    encoding: str
    dtype: np.dtype[np.void]
    """Structured type of the size of a message; times are the fields sec and nanosec."""
    template: bytes
    """A message with the texts filled in and all numbers zero."""
    fixed: tuple[tuple[int, int], ...]
    """Spans (start, stop) where every message of this layout has the template's bytes."""

    @property
    def size(self) -> int:
        """Bytes of one message."""
        return self.dtype.itemsize

    def matches(self, payloads: Bytes) -> bool:
        """Tell whether all payloads (n, size) have this layout's texts and header."""
        if payloads.shape[1] != self.size:
            return False
        template = np.frombuffer(self.template, np.uint8)
        return all(
            bool(np.all(payloads[:, start:stop] == template[start:stop]))
            for start, stop in self.fixed
        )

    def view(self, payloads: Bytes) -> NDArray[np.void]:
        """Return payloads (n, size) as structured messages (n,), without a copy."""
        fields: NDArray[np.void] = payloads.view(self.dtype)[:, 0]
        return fields


class Builder:
    """Collects fields at their offsets."""

    def __init__(self, encoding: str) -> None:
        self.cdr = encoding == "cdr"
        self.names: list[str] = []
        self.formats: list[object] = []
        self.offsets: list[int] = []
        self.template = bytearray(_CDR_HEADER if self.cdr else b"")
        self.fixed = [(0, len(self.template))]

    def align(self, size: int) -> None:
        """Pad to a multiple of the size, counted after the encapsulation header."""
        padding = -(len(self.template) - len(_CDR_HEADER)) % size if self.cdr else 0
        # Padding is not compared: other writers leave whatever was in their buffer.
        self.template += bytes(padding)

    def constant(self, content: bytes) -> None:
        """Add bytes that are the same in all messages."""
        self.fixed.append((len(self.template), len(self.template) + len(content)))
        self.template += content

    def number(self, name: str, code: str, count: int = 1) -> None:
        """Add a field of one or more numbers."""
        size = np.dtype(code).itemsize
        self.align(size)
        self.names.append(name)
        self.formats.append(code if count == 1 else (code, (count,)))
        self.offsets.append(len(self.template))
        self.template += bytes(size * count)

    def time(self) -> None:
        """Add a stamp."""
        self.number("sec", "<i4" if self.cdr else "<u4")
        self.number("nanosec", "<u4")

    def text(self, content: str) -> None:
        """Add a string: its length, its bytes and, in CDR, a zero that counts."""
        encoded = content.encode() + (b"\0" if self.cdr else b"")
        self.align(4)
        self.constant(len(encoded).to_bytes(4, "little") + encoded)

    def dtype(self) -> np.dtype[np.void]:
        """Return the structured type of the size of a message."""
        return np.dtype(
            {
                "names": self.names,
                "formats": self.formats,
                "offsets": self.offsets,
                "itemsize": len(self.template),
            }
        )


@lru_cache(maxsize=64)
def layout(type_name: str, encoding: str, texts: Sequence[str] = ()) -> Layout:
    """Return the layout of a message type.

    :param type_name: a key of FIELDS.
    :param encoding: one of ENCODINGS.
    :param texts: contents of the message's text fields, in order; a tuple.
    """
    if encoding not in ENCODINGS:
        raise ValueError(f"encoding {encoding!r}: must be one of {', '.join(ENCODINGS)}")
    builder = Builder(encoding)
    remaining = iter(texts)
    for name, kind, count in FIELDS[type_name]:
        if kind == "text":
            builder.text(next(remaining))
        elif kind in ("time", "header"):
            if kind == "header" and encoding == "ros1":
                builder.number("seq", "<u4")
            builder.time()
        else:
            builder.number(name, "<" + kind, count)
    return Layout(
        type_name, encoding, builder.dtype(), bytes(builder.template), tuple(builder.fixed)
    )


def texts_of(type_name: str, encoding: str, payload: bytes) -> tuple[str, ...]:
    """Return the text fields of one message.

    All texts of the known types stand before the first number of eight bytes.

    :raises ValueError: where the bytes are not a message of this type in little-endian form.
    """
    position = 0
    if encoding == "cdr":
        if payload[:2] != _CDR_HEADER[:2]:
            raise ValueError("not little-endian CDR")
        position = len(_CDR_HEADER)
    start = position
    texts: list[str] = []
    for _, kind, _ in FIELDS[type_name]:
        if kind in ("time", "header"):
            position += 12 if kind == "header" and encoding == "ros1" else 8
        elif kind == "text":
            if encoding == "cdr":
                position += -(position - start) % 4
            length = int.from_bytes(payload[position : position + 4], "little")
            content = payload[position + 4 : position + 4 + length]
            if len(content) != length:
                raise ValueError("a string is longer than the message")
            position += 4 + length
            texts.append(content.rstrip(b"\0").decode())
    return tuple(texts)
