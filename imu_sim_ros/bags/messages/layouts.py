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
from collections.abc import Iterator, Mapping, Sequence
from functools import cache, lru_cache
from typing import Final, NamedTuple

import numpy as np

from imu_sim_ros.bags.messages.schemas import definitions
from imu_sim_ros.core.conventions import AXES
from imu_sim_ros.core.types import Bytes

ENCODINGS: Final = ("cdr", "ros1")

_CDR_HEADER: Final = b"\x00\x01\x00\x00"
_LENGTH: Final = 4
"""Bytes of the length of a string or an array."""
TYPES: Final = (
    "geometry_msgs/msg/PoseStamped",
    "geometry_msgs/msg/PoseWithCovarianceStamped",
    "geometry_msgs/msg/TransformStamped",
    "geometry_msgs/msg/TwistWithCovarianceStamped",
    "geometry_msgs/msg/Vector3Stamped",
    "gps_msgs/msg/GPSFix",
    "nav_msgs/msg/Odometry",
    "rosgraph_msgs/msg/Clock",
    "sensor_msgs/msg/FluidPressure",
    "sensor_msgs/msg/Imu",
    "sensor_msgs/msg/MagneticField",
    "sensor_msgs/msg/NavSatFix",
    "sensor_msgs/msg/Temperature",
)
"""Types of messages that are read and translated in bulk, by their layouts."""
_CODES: Final = {
    **{f"float{bits}": f"f{bits // 8}" for bits in (32, 64)},
    **{f"int{bits}": f"i{bits // 8}" for bits in (8, 16, 32, 64)},
    **{f"uint{bits}": f"u{bits // 8}" for bits in (8, 16, 32, 64)},
    "bool": "u1",
}
_VECTORS: Final = ([*AXES], [*AXES, "w"])


@cache
def fields(type_name: str, encoding: str = "cdr") -> tuple[tuple[str, str, int], ...]:
    """Return the fields of a type in the order of its definition: name, kind and count.

    The kind is f8, text, i1, u1, u2, ..., time, or header (in ROS 1 a sequence number precedes the
    stamp). Vectors and quaternions are fields of three and four numbers; parts of parts have their
    last name, ``position`` of ``pose.pose.position``, covariances and headers also the one before,
    ``pose_covariance``. Arrays of any length are taken to be empty: the field is their length.
    """
    return tuple(_fields("", definitions(type_name, encoding)))


def _fields(
    name: str, texts: Mapping[str, str], within: str = ""
) -> Iterator[tuple[str, str, int]]:
    """Yield name, kind and count of the fields of a definition, nested types included.

    :param texts: definitions by name of the type.
    :param within: name of the field that has this type; empty: a message.
    """
    prefix = f"{within}_" if within else ""
    for line in texts[name].splitlines():
        tokens = line.partition("#")[0].split()
        if not tokens or "=" in line.partition("#")[0]:  # a constant
            continue
        (kind, _, size), field = tokens[0].partition("["), tokens[1]
        if kind in ("std_msgs/Header", "Header"):
            yield f"{prefix}stamp", "header", 1
            yield f"{prefix}frame_id", "text", 1
        elif size == "]":
            yield field, "u4", 1
        elif kind == "string":
            yield field, "text", 1
        elif kind in ("builtin_interfaces/Time", "time"):
            yield field, "time", 1
        elif kind in _CODES:
            field_name = f"{prefix}{field}" if field == "covariance" else field
            yield field_name, _CODES[kind], int(size.rstrip("]") or 1)
        else:  # ROS 1 leaves out the package of neighbours
            whole = next(
                text_name
                for text_name in texts
                if text_name == kind or text_name.endswith(f"/{kind}")
            )
            parts = list(_fields(whole, texts, field))
            if [part for part, _, _ in parts] in _VECTORS:
                yield field, parts[0][1], len(parts)
            else:
                yield from parts


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


FIRST: Final = "[0]"
"""Suffix of the name of a field of which the first number alone is read."""


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

    def matches(self, payloads: Bytes) -> bool:
        """Return whether all payloads (n, size) have this layout's texts and header."""
        size = self.dtype.itemsize
        if payloads.shape[1] != size:
            return False
        spans = _words(size, self.fixed)
        rows, template = payloads.view(spans)[:, 0], np.frombuffer(self.template, spans)
        return all(bool(np.all(rows[name] == template[name])) for name in spans.names or ())

    def offset(self, name: str) -> int:
        """Return the first byte of a field."""
        return int(self.dtype.fields[name][1]) if self.dtype.fields else 0

    def unpacker(self, names: Sequence[str]) -> struct.Struct:
        """Return the struct that unpacks the numbers of some fields, in the message's order.

        :param names: names of fields; with :data:`FIRST` behind it the first number alone.
        """
        form, end = "<", 0  # for each field the bytes before it, and its numbers: 36x3d
        for start, stop, code in self._spans(names):
            form += f"{start - end}x{code}"
            end = stop
        return struct.Struct(form)

    def packer(self, names: Sequence[str], template: bytes) -> tuple[struct.Struct, list[bytes]]:
        """Return the struct that packs a message, and its constant parts.

        The struct takes the numbers of some fields in the message's order, and the parts in front
        of them, between them and behind them.

        :param template: message with all other numbers.
        """
        form, end, parts = "<", 0, []
        for start, stop, code in (*self._spans(names), (len(template), len(template), "")):
            if start > end:
                form += f"{start - end}s"
                parts.append(template[end:start])
            form += code
            end = stop
        return struct.Struct(form), parts

    def _spans(self, names: Sequence[str]) -> Iterator[tuple[int, int, str]]:
        """Yield start and stop of fields in the message's order, and the code of their numbers."""
        for name in sorted(names, key=lambda name: self.offset(name.removesuffix(FIRST))):
            field = name.removesuffix(FIRST)
            numbers = self.dtype[field]
            count = 1 if name != field else int(np.prod(numbers.shape, dtype=int))
            start = self.offset(field)
            yield start, start + count * numbers.base.itemsize, f"{count}{numbers.base.char}"


class LayoutBuilder:
    """Collects fields at their offsets."""

    def __init__(self, encoding: str) -> None:
        self.encoding, self.cdr = encoding, encoding == "cdr"
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
        """Add a field other than a string, kind and count as in :func:`fields`.

        :param suffix: added to the names of its parts, if there are several such fields.
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

    def layout(self, type_name: str) -> Layout:
        """Return the layout of a type with these fields."""
        dtype = np.dtype(
            {
                "names": self.names,
                "formats": self.formats,
                "offsets": self.offsets,
                "itemsize": len(self.template),
            }
        )
        return Layout(type_name, self.encoding, dtype, bytes(self.template), tuple(self.fixed))


@lru_cache(maxsize=64)
def _words(size: int, spans: Sequence[tuple[int, int]]) -> np.dtype[np.void]:
    """Return spans of bytes as a structured type of long integers: few comparisons for each.

    :param size: size of the whole.
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

    :param type_name: type in the form of ROS 2; one whose texts stand before its numbers of eight
        bytes.
    :param encoding: one of ENCODINGS.
    :param texts: contents of the message's text fields, in order; a tuple. Bytes are those of a
        message, as :func:`text_bytes` returns them.
    """
    if encoding not in ENCODINGS:
        raise ValueError(f"encoding {encoding!r}: must be one of {', '.join(ENCODINGS)}")
    builder = LayoutBuilder(encoding)
    remaining = iter(texts)
    for name, kind, count in fields(type_name, encoding):
        if kind == "text":
            builder.text(next(remaining))
        else:
            builder.field(name, kind, count, _suffix(name, kind))
    return builder.layout(type_name)


@lru_cache
def _ahead_of_texts(type_name: str, encoding: str) -> tuple[int, ...]:
    """Return the number of bytes between each string of a message and the preceding string."""
    gaps = [0]
    for name, kind, count in fields(type_name, encoding):
        if kind == "text":
            gaps.append(0)
        else:
            numbers = _numbers(name, kind, count, encoding == "cdr")
            gaps[-1] += sum(np.dtype(code).itemsize * times for _, code, times in numbers)
    return tuple(gaps[:-1])


def text_bytes(type_name: str, encoding: str, payload: bytes) -> tuple[bytes, ...]:
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
    raw = text_bytes(type_name, encoding, payload)
    return tuple(content.rstrip(b"\0").decode() for content in raw)


STAMP_OFFSET: Final = layout("rosgraph_msgs/msg/Clock", "cdr").offset("sec")
"""Offset of the stamp in a CDR message that begins with one, or with a header."""
