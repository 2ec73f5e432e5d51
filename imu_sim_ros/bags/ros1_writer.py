# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""ROS 1 bags, format 2.0 (http://wiki.ros.org/Bags/Format/2.0), chunks built by NumPy."""

import re
import struct
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Final

import numpy as np

from imu_sim_ros.bags.chunks import Chunk, ChunkWriter, Stored
from imu_sim_ros.bags.messages.blocks import Column, RowTemplate
from imu_sim_ros.bags.messages.encode import split_seconds
from imu_sim_ros.bags.messages.schemas import ros1_name
from imu_sim_ros.bags.writer import BagTopic
from imu_sim_ros.core.errors import InputError
from imu_sim_ros.core.timebase import NANOSECONDS_PER_SECOND
from imu_sim_ros.core.types import Times

MAGIC: Final = b"#ROSBAG V2.0\n"
BAG_HEADER_BYTES: Final = 4096
"""Bytes of the record of the bag's header, padding included."""
OP_MESSAGE: Final = 2
OP_BAG_HEADER: Final = 3
OP_INDEX: Final = 4
OP_CHUNK: Final = 5
OP_CHUNK_INFO: Final = 6
OP_CONNECTION: Final = 7

INDEX_ENTRY: Final = np.dtype([("sec", "<u4"), ("nanosec", "<u4"), ("offset", "<u4")])
_BZIP2_LEVEL: Final = 9
_SEQ_BYTES: Final = 4
"""Size of header.seq, in which ROS 1 publishers count, so that a loss shows."""


def fields(**values: bytes) -> bytes:
    """Return the fields of a record header, behind their total length."""
    body = b"".join(
        struct.pack("<I", len(name) + 1 + len(value)) + name.encode() + b"=" + value
        for name, value in values.items()
    )
    return struct.pack("<I", len(body)) + body


def _u1(value: int) -> bytes:
    return struct.pack("<B", value)


def _u4(value: int) -> bytes:
    return struct.pack("<I", value)


def _u8(value: int) -> bytes:
    return struct.pack("<Q", value)


def _time(t_ns: int) -> bytes:
    """Return a time as ROS 1 stores it: seconds and nanoseconds, four bytes each."""
    return struct.pack("<II", *divmod(t_ns, NANOSECONDS_PER_SECOND))


def _message_header() -> tuple[bytes, np.dtype[np.void]]:
    """Return the header of a message record, with its numbers zero, and where they lie in it."""
    # The order of roscpp, which sorts the fields by name.
    header = fields(conn=_u4(0), op=_u1(OP_MESSAGE), time=_u8(0)) + _u4(0)
    offsets = {
        "connection": header.index(b"conn=") + 5,
        "sec": header.index(b"time=") + 5,
        "nanosec": header.index(b"time=") + 9,
        "length": len(header) - 4,
    }
    dtype = np.dtype(
        {
            "names": list(offsets),
            "formats": ["<u4"] * len(offsets),
            "offsets": list(offsets.values()),
            "itemsize": len(header),
        }
    )
    return header, dtype


_HEADER, _HEADER_TYPE = _message_header()
_OFFSETS: Final = {name: field[1] for name, field in (_HEADER_TYPE.fields or {}).items()}


def _begins_with_header(definition: str) -> bool:
    """Return whether the first field of a message is a header, whose first field is seq."""
    lines = (line.partition("#")[0].strip() for line in definition.splitlines())
    first_line = next((line for line in lines if line and "=" not in line), "")
    return re.fullmatch(r"(std_msgs/)?Header\s+\w+", first_line) is not None


def compressor(compression: str) -> Callable[[bytes | memoryview], bytes | memoryview]:
    """Return the function that compresses a chunk.

    :param compression: none, bz2 or lz4.
    """
    if compression == "lz4":
        import lz4.frame

        # roslz4 reads only independent blocks, a checksum of the content and no stored size.
        return lambda data: lz4.frame.compress(
            data, block_linked=False, content_checksum=True, store_size=False
        )
    if compression == "bz2":
        import bz2

        return lambda data: bz2.compress(data, _BZIP2_LEVEL)
    return lambda data: data


class Rosbag1Writer(ChunkWriter):
    """One ROS 1 bag."""

    encoding = "ros1"

    def __init__(self, path: Path, compression: str = "none") -> None:
        super().__init__(path, compression, renamed=True)
        self._compress = compressor(compression)
        self._numbered: set[BagTopic] = set()
        self.file.write(MAGIC, self._bag_header(0))

    def _bag_header(self, index_position: int) -> bytes:
        """Return the record at the start of the file, padded to 4096 bytes."""
        header = fields(
            chunk_count=_u4(len(self._written)),
            conn_count=_u4(len(self.topics)),
            index_pos=_u8(index_position),
            op=_u1(OP_BAG_HEADER),
        )
        # Without the two lengths, as roscpp and rospy count: rosbag reindex writes over it.
        padding = BAG_HEADER_BYTES - (len(header) - 4)
        return header + _u4(padding) + b" " * padding

    def _register(self, topic: BagTopic) -> None:
        """Write the connection of a topic, whose definition must be known."""
        if not topic.schema.text:
            raise InputError(
                f"{topic.name}: a ROS 1 bag needs the definition of {topic.type_name}, "
                "which is not known"
            )
        if not topic.keeps_seq and _begins_with_header(topic.schema.text):
            self._numbered.add(topic)
        # Connections stand in the first chunk after they were made, before any of their messages.
        self._before += self._connection(topic)

    def _connection(self, topic: BagTopic) -> bytes:
        """Return the record that names a topic, its type and its definition."""
        name = topic.name.encode()
        latched = bool(topic.qos) and all(qos.durability == "transient_local" for qos in topic.qos)
        details = fields(
            callerid=b"/imu_sim_ros",
            latching=b"1" if latched else b"0",
            md5sum=topic.schema.digest.encode(),
            message_definition=topic.schema.text.encode(),
            topic=name,
            type=ros1_name(topic.type_name).encode(),
        )
        return fields(conn=_u4(topic.index), op=_u1(OP_CONNECTION), topic=name) + details

    def _records(
        self, topic: BagTopic, start: int, t_ns: Times, payloads: RowTemplate
    ) -> list[RowTemplate]:
        """Return messages of equal size as records, their headers numbered if need be."""
        count, size = payloads.count, len(payloads.template)
        header = np.frombuffer(bytearray(_HEADER), _HEADER_TYPE)
        header["connection"], header["length"] = topic.index, size
        second, nanosecond = (numbers.astype("<u4") for numbers in split_seconds(t_ns))
        columns = [
            Column(_OFFSETS["sec"], second),
            Column(_OFFSETS["nanosec"], nanosecond),
        ]
        if topic in self._numbered and size >= _SEQ_BYTES:
            start += topic.earlier_messages
            seq = Column(0, np.arange(start, start + count).astype("<u4"))
            payloads = RowTemplate(payloads.template, [*payloads.columns, seq], count)
        return [RowTemplate(header.tobytes(), columns, count), payloads]

    def _record(self, topic: BagTopic, index: int, t_ns: int, payload: bytes) -> bytes:
        """Return one message as a record, its header numbered if need be."""
        header = fields(conn=_u4(topic.index), op=_u1(OP_MESSAGE), time=_time(t_ns))
        if topic in self._numbered and len(payload) >= _SEQ_BYTES:
            payload = _u4((topic.earlier_messages + index) & 0xFFFFFFFF) + payload[_SEQ_BYTES:]
        return header + _u4(len(payload)) + payload

    def _pack(self, chunk: Chunk) -> Sequence[bytes | memoryview]:
        """Return the head, the content and the message indexes of a chunk."""
        data = memoryview(chunk.records.data)
        compressed = self._compress(data)
        header = fields(
            compression=self._compression.encode(), op=_u1(OP_CHUNK), size=_u4(len(data))
        )
        indexes = []
        for topic, t_ns, offsets in chunk.messages:
            entries = np.empty(len(t_ns), INDEX_ENTRY)
            entries["sec"], entries["nanosec"] = split_seconds(t_ns)
            entries["offset"] = offsets
            connection, count = _u4(topic.index), _u4(len(entries))
            start = fields(conn=connection, count=count, op=_u1(OP_INDEX), ver=_u4(1))
            indexes.append(start + _u4(entries.nbytes) + entries.tobytes())
        return [header + _u4(len(compressed)), compressed, *indexes]

    def _finish(self) -> None:
        """Write the index at the end, and its place into the bag header."""
        index_position = self.file.position
        connections = b"".join(self._connection(topic) for topic in self.topics)
        self.file.write(connections, b"".join(_chunk_info(chunk) for chunk in self._written))
        self.file.rewrite(len(MAGIC), self._bag_header(index_position))


def _chunk_info(chunk: Stored) -> bytes:
    """Return the record that states times and message counts of a chunk."""
    header = fields(
        chunk_pos=_u8(chunk.position),
        count=_u4(len(chunk.topics)),
        end_time=_time(chunk.last_ns),
        op=_u1(OP_CHUNK_INFO),
        start_time=_time(chunk.first_ns),
        ver=_u4(1),
    )
    counts = b"".join(
        struct.pack("<II", stored.topic.index, stored.messages) for stored in chunk.topics
    )
    return header + _u4(len(counts)) + counts
