# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Place of each field in the bytes of a message, as a NumPy structured type.

A message whose texts (the frame names) have known lengths has a constant size. A block of such
messages is one array with the structured type of :class:`Layout`, filled or read column by column;
a single message is read through a ``struct`` made of the same.

Two encodings exist: ``cdr``, little-endian plain CDR as ROS 2 writes it (four bytes of
encapsulation header, each primitive aligned to its size relative to the byte after that header),
and ``ros1``, the packed little-endian form of ROS 1.
"""

import struct
from collections.abc import Iterator, Sequence
from functools import lru_cache
from typing import Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from imu_sim_ros.bags.messages.definitions.gps import NUMBERS as GPS_NUMBERS
from imu_sim_ros.types import Bytes

ENCODINGS: Final = ("cdr", "ros1")

_CDR_HEADER: Final = b"\x00\x01\x00\x00"
_LENGTH: Final = 4
"""Bytes of the length of a string or an array."""
_STAMPED: Final = (("stamp", "header", 1), ("frame_id", "text", 1))

# The one description of each message, from which the bytes' places follow everywhere. Fields in the
# order of the message definitions of common_interfaces (the same in ROS 1): name, kind (f8, text,
# i1, u1, u2, time, or header: in ROS 1 a sequence number precedes the stamp) and count.
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
    "geometry_msgs/msg/TwistWithCovarianceStamped": (
        *_STAMPED,
        ("linear", "f8", 3),
        ("angular", "f8", 3),
        ("twist_covariance", "f8", 36),
    ),
    "sensor_msgs/msg/Temperature": (
        *_STAMPED,
        ("temperature", "f8", 1),
        ("variance", "f8", 1),
    ),
    "sensor_msgs/msg/MagneticField": (
        *_STAMPED,
        ("magnetic_field", "f8", 3),
        ("magnetic_field_covariance", "f8", 9),
    ),
    "sensor_msgs/msg/FluidPressure": (
        *_STAMPED,
        ("fluid_pressure", "f8", 1),
        ("variance", "f8", 1),
    ),
    "sensor_msgs/msg/NavSatFix": (
        *_STAMPED,
        ("status", "i1", 1),
        ("service", "u2", 1),
        ("latitude", "f8", 1),
        ("longitude", "f8", 1),
        ("altitude", "f8", 1),
        ("position_covariance", "f8", 9),
        ("position_covariance_type", "u1", 1),
    ),
    "gps_msgs/msg/GPSFix": (
        *_STAMPED,
        ("status_stamp", "header", 1),
        ("status_frame_id", "text", 1),
        ("satellites_used", "u2", 1),
        ("satellite_used_prn", "u4", 1),  # the length of an array, as with the next four: empty
        ("satellites_visible", "u2", 1),
        *((f"satellite_visible_{one}", "u4", 1) for one in ("prn", "z", "azimuth", "snr")),
        ("status", "i2", 1),
        *((f"{one}_source", "u2", 1) for one in ("motion", "orientation", "position")),
        *((name, "f8", 1) for name in GPS_NUMBERS),
        ("position_covariance", "f8", 9),
        ("position_covariance_type", "u1", 1),
    ),
    "rosgraph_msgs/msg/Clock": (("clock", "time", 1),),
}


def _numbers(name: str, kind: str, count: int, cdr: bool) -> Iterator[tuple[str, str, int]]:
    """Return the numbers of a field other than a string: name, code of NumPy, count."""
    if kind == "header" and not cdr:
        yield "seq", "<u4", 1
    if kind in ("header", "time"):
        yield "sec", "<i4" if cdr else "<u4", 1
        yield "nanosec", "<u4", 1
    else:
        yield name, f"<{kind}", count


def _suffix(name: str, kind: str) -> str:
    """Return the suffix that distinguishes the parts of a second header."""
    return f"_of_{name.removesuffix('_stamp')}" if kind == "header" and name != "stamp" else ""


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
        """Return whether all payloads (n, size) have this layout's texts and header."""
        if payloads.shape[1] != self.size:
            return False
        words = _words(self.size, self.fixed)
        rows, template = payloads.view(words)[:, 0], np.frombuffer(self.template, words)
        return all(bool(np.all(rows[name] == template[name])) for name in words.names or ())

    def offset(self, name: str) -> int:
        """Return the first byte of a field."""
        return int(self.dtype.fields[name][1]) if self.dtype.fields else 0

    def unpacker(self, names: Sequence[str]) -> struct.Struct:
        """Return what unpacks the numbers of some fields of one message, in the message's order."""
        form, end = "<", 0
        for name in sorted(names, key=self.offset):
            numbers = self.dtype[name]
            count = int(np.prod(numbers.shape, dtype=int))
            form += f"{self.offset(name) - end}x{count}{numbers.base.char}"
            end = self.offset(name) + numbers.itemsize
        return struct.Struct(form)

    def view(self, payloads: Bytes) -> NDArray[np.void]:
        """Return payloads (n, size) as structured messages (n,), without a copy."""
        return payloads.view(self.dtype)[:, 0]


class LayoutBuilder:
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
        # Padding is not compared: other writers leave arbitrary bytes there.
        self.template += bytes(padding)

    def constant(self, content: bytes) -> None:
        """Add bytes that are the same in all messages."""
        start, stop = len(self.template), len(self.template) + len(content)
        if self.fixed[-1][1] == start:
            start, _ = self.fixed.pop()
        self.fixed.append((start, stop))
        self.template += content

    def number(self, name: str, code: str, count: int = 1) -> None:
        """Add a field of one or more numbers."""
        size = np.dtype(code).itemsize
        self.align(size)
        self.names.append(name)
        self.formats.append(code if count == 1 else (code, (count,)))
        self.offsets.append(len(self.template))
        self.template += bytes(size * count)

    def field(self, name: str, kind: str, count: int = 1, suffix: str = "") -> None:
        """Add a field other than a string, kind and count as in :data:`FIELDS`.

        :param suffix: behind the names of its parts, if there are several such fields.
        """
        for part, code, times in _numbers(name, kind, count, self.cdr):
            self.number(part + suffix, code, times)

    def length(self, count: int) -> None:
        """Add the length of an array."""
        self.align(_LENGTH)
        self.constant(count.to_bytes(_LENGTH, "little"))

    def text(self, content: str | bytes) -> None:
        """Add a string: its length, its bytes and, in CDR, a zero that counts.

        :param content: bytes are taken as they stand in a message, behind the length.
        """
        if isinstance(content, str):
            content = content.encode() + (b"\0" if self.cdr else b"")
        self.length(len(content))
        self.constant(content)

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
def _words(size: int, spans: Sequence[tuple[int, int]]) -> np.dtype[np.void]:
    """Return spans of bytes as a structured type of long integers: few comparisons for each.

    :param size: of the whole.
    :param spans: (start, stop); a tuple.
    """
    formats, offsets = [], []
    for begin, stop in spans:
        start = begin
        while start < stop:
            width = min(8, 1 << (stop - start).bit_length() - 1)
            formats.append(f"<u{width}")
            offsets.append(start)
            start += width
    names = [f"at_{offset}" for offset in offsets]
    return np.dtype({"names": names, "formats": formats, "offsets": offsets, "itemsize": size})


@lru_cache(maxsize=64)
def layout(type_name: str, encoding: str, texts: Sequence[str | bytes] = ()) -> Layout:
    """Return the layout of a message type.

    :param type_name: a key of FIELDS.
    :param encoding: one of ENCODINGS.
    :param texts: contents of the message's text fields, in order; a tuple. Bytes are those of a
        message, as :func:`raw_texts` returns them.
    """
    if encoding not in ENCODINGS:
        raise ValueError(f"encoding {encoding!r}: must be one of {', '.join(ENCODINGS)}")
    builder = LayoutBuilder(encoding)
    remaining = iter(texts)
    for name, kind, count in FIELDS[type_name]:
        if kind == "text":
            builder.text(next(remaining))
        else:
            builder.field(name, kind, count, _suffix(name, kind))
    return Layout(
        type_name, encoding, builder.dtype(), bytes(builder.template), tuple(builder.fixed)
    )


@lru_cache
def _ahead_of_texts(type_name: str, encoding: str) -> tuple[int, ...]:
    """Return how many bytes of numbers lie between each string and the one before it."""
    gaps = [0]
    for name, kind, count in FIELDS[type_name]:
        if kind == "text":
            gaps.append(0)
        else:
            numbers = _numbers(name, kind, count, encoding == "cdr")
            gaps[-1] += sum(np.dtype(code).itemsize * times for _, code, times in numbers)
    return tuple(gaps[:-1])


def raw_texts(type_name: str, encoding: str, payload: bytes) -> tuple[bytes, ...]:
    """Return the text fields of one message as they stand there, without their lengths.

    All texts of the known types stand before the first number of eight bytes.

    :raises ValueError: if the bytes are not a message of this type in little-endian form.
    """
    cdr = encoding == "cdr"
    if cdr and payload[:2] != _CDR_HEADER[:2]:
        raise ValueError("not little-endian CDR")
    start = position = len(_CDR_HEADER) if cdr else 0
    texts = []
    for gap in _ahead_of_texts(type_name, encoding):
        position += gap
        if cdr:
            position += -(position - start) % _LENGTH
        content_at = position + _LENGTH
        length = int.from_bytes(payload[position:content_at], "little")
        content = payload[content_at : content_at + length]
        if len(content) != length:
            raise ValueError("a string is longer than the message")
        position = content_at + length
        texts.append(content)
    return tuple(texts)


def texts_of(type_name: str, encoding: str, payload: bytes) -> tuple[str, ...]:
    """Return the text fields of one message.

    :raises ValueError: if the bytes are not a message of this type in little-endian form.
    """
    raw = raw_texts(type_name, encoding, payload)
    return tuple(content.rstrip(b"\0").decode() for content in raw)


STAMP_OFFSET: Final = layout("rosgraph_msgs/msg/Clock", "cdr").offset("sec")
"""Where the stamp is in a CDR message that begins with one, or with a header."""
