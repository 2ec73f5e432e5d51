# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""MCAP files: chunks of records built by NumPy, everything else by the mcap library.

The format is that of https://mcap.dev/spec, with the profile ``ros2`` of rosbag2's storage plugin.
"""

import struct
import threading
import zlib
from collections.abc import Callable, Sequence
from itertools import accumulate
from pathlib import Path
from typing import TYPE_CHECKING, Final

import numpy as np

from imu_sim_ros.bags.chunks import Chunk, ChunkWriter, Stored
from imu_sim_ros.bags.messages.blocks import Column, RowTemplate
from imu_sim_ros.bags.messages.schemas import qos_text
from imu_sim_ros.bags.writer import ROS_DISTRO, BagTopic, rosbag2_metadata
from imu_sim_ros.core.types import Times
from imu_sim_ros.core.yaml_output import as_yaml

if TYPE_CHECKING:
    from mcap.records import Channel, ChunkIndex, McapRecord, Statistics
    from mcap.records import Schema as SchemaRecord

MAGIC: Final = b"\x89MCAP0\r\n"
MESSAGE: Final = 0x05
CHUNK: Final = 0x06
MESSAGE_INDEX: Final = 0x07

MESSAGE_HEADER: Final = np.dtype(
    [
        ("opcode", "u1"),
        ("length", "<u8"),
        ("channel", "<u2"),
        ("sequence", "<u4"),
        ("log_time", "<u8"),
        ("publish_time", "<u8"),
    ]
)
_OFFSETS: Final = {name: field[1] for name, field in (MESSAGE_HEADER.fields or {}).items()}
INDEX_ENTRY: Final = np.dtype([("time", "<u8"), ("offset", "<u8")])
_RECORD_HEADER_BYTES: Final = 9
"""Bytes in front of a record's content: opcode and length."""
_UNKNOWN_SCHEMA: Final = 0
"""Number of the schema of a channel without a known definition."""
_ZSTD_LEVEL: Final = 1
"""Lowest level of compression: noise hardly becomes smaller with higher ones."""
_ZSTD_HASH_LOG: Final = 12
_ZSTD_MIN_MATCH: Final = 6
"""Level 1 has 14 and 7. What messages repeat is near: a table that fits in the processor's cache
takes a fifth less time, and the files are a little smaller."""


def compressor(compression: str) -> Callable[[bytes | memoryview], bytes | memoryview]:
    """Return the function that compresses a chunk; several threads may call it.

    :param compression: none, lz4 or zstd.
    """
    if compression == "lz4":
        import lz4.frame

        # Independent blocks of 64 kB take a fifth less time than linked ones and are no larger.
        return lambda data: lz4.frame.compress(data, block_linked=False)
    if compression == "zstd":
        import zstandard

        thread_data = threading.local()

        def zstd(data: bytes | memoryview) -> bytes:
            if not hasattr(thread_data, "compress"):  # a compressor serves one thread
                thread_data.compress = zstandard.ZstdCompressor(
                    compression_params=zstandard.ZstdCompressionParameters.from_level(
                        _ZSTD_LEVEL, hash_log=_ZSTD_HASH_LOG, min_match=_ZSTD_MIN_MATCH
                    )
                ).compress
            return thread_data.compress(data)

        return zstd
    return lambda data: data


class McapWriter(ChunkWriter):
    """One MCAP file with ROS 2 messages."""

    encoding = "cdr"

    def __init__(self, path: Path, compression: str = "none", renamed: bool = True) -> None:
        from mcap import __version__
        from mcap.records import Header

        super().__init__(path, "" if compression == "none" else compression, renamed)
        self._compress = compressor(compression)
        self._schemas: dict[str, SchemaRecord] = {}
        self._channels: list[Channel] = []
        # The library's own identifier, without the import of mcap.writer, which has it.
        self.file.write(MAGIC, _pack_record(Header("ros2", f"mcap-python/{__version__}")))

    def _register(self, topic: BagTopic) -> None:
        """Write schema and channel immediately, so that a truncated file can be read."""
        from mcap.records import Channel
        from mcap.records import Schema as SchemaRecord

        self._wait()
        text, digest, language = topic.schema
        schema_id = _UNKNOWN_SCHEMA
        if text:
            if topic.type_name not in self._schemas:
                record = SchemaRecord(
                    id=len(self._schemas) + 1,
                    data=text.encode(),
                    encoding=language,
                    name=topic.type_name,
                )
                self._schemas[topic.type_name] = record
                self.file.write(_pack_record(record))
            schema_id = self._schemas[topic.type_name].id
        metadata = {
            "offered_qos_profiles": qos_text(topic.qos),
            "topic_type_hash": digest,
        }
        channel = Channel(
            id=topic.index + 1,
            topic=topic.name,
            message_encoding="cdr",
            metadata=metadata,
            schema_id=schema_id,
        )
        self._channels.append(channel)
        self.file.write(_pack_record(channel))
        self._mark = (self.file.position, len(self._written))

    def _records(
        self, topic: BagTopic, start: int, t_ns: Times, payloads: RowTemplate
    ) -> list[RowTemplate]:
        """Return messages of equal size as records, with the sequence numbers of their topic."""
        count = payloads.count
        header = np.zeros(1, MESSAGE_HEADER)
        header["opcode"] = MESSAGE
        length = MESSAGE_HEADER.itemsize - _RECORD_HEADER_BYTES + len(payloads.template)
        header["length"] = length
        header["channel"] = topic.index + 1
        columns = [
            Column(_OFFSETS["sequence"], np.arange(start, start + count).astype("<u4")),
            Column(_OFFSETS["log_time"], t_ns),
            Column(_OFFSETS["publish_time"], t_ns),
        ]
        return [RowTemplate(header.tobytes(), columns, count), payloads]

    def _record(self, topic: BagTopic, index: int, t_ns: int, payload: bytes) -> bytes:
        """Return one message as a record."""
        length = MESSAGE_HEADER.itemsize - _RECORD_HEADER_BYTES + len(payload)
        sequence = index & 0xFFFFFFFF
        return (
            struct.pack("<BQHIQQ", MESSAGE, length, topic.index + 1, sequence, t_ns, t_ns) + payload
        )

    def _pack(self, chunk: Chunk) -> Sequence[bytes | memoryview]:
        """Return the head, the compressed content and the message indexes of a chunk."""
        data = memoryview(chunk.records.data)
        compressed = self._compress(data)
        name = self._compression.encode()
        header = struct.pack(
            f"<QQQII{len(name)}sQ",
            min(int(t_ns.min()) for _, t_ns, _ in chunk.messages),
            max(int(t_ns.max()) for _, t_ns, _ in chunk.messages),
            len(data),
            zlib.crc32(data),
            len(name),
            name,
            len(compressed),
        )
        indexes = []
        for topic, t_ns, offsets in chunk.messages:
            entries = np.empty(len(t_ns), INDEX_ENTRY)
            entries["time"], entries["offset"] = t_ns, offsets
            size = entries.nbytes
            start = struct.pack("<BQHI", MESSAGE_INDEX, 2 + 4 + size, topic.index + 1, size)
            indexes.append(start + entries.tobytes())
        length = len(header) + len(compressed)
        return [struct.pack("<BQ", CHUNK, length) + header, compressed, *indexes]

    def _finish(self) -> None:
        """Write the end of the data, the summary with all indexes, and the footer."""
        from mcap.data_stream import RecordBuilder
        from mcap.opcode import Opcode
        from mcap.records import DataEnd, Footer, Metadata, MetadataIndex, SummaryOffset

        # What rosbag2 stores in each of its files. Jazzy reads the first entry; the second is that
        # of Humble and Iron.
        content = rosbag2_metadata("mcap", self.topics, [self])
        text = as_yaml(content)
        entries = {"serialized_metadata": text, "ROS_DISTRO": ROS_DISTRO}
        metadata = _pack_record(Metadata(name="rosbag2", metadata=entries))
        metadata_index = MetadataIndex(self.file.position, len(metadata), "rosbag2")
        self.file.write(metadata, _pack_record(DataEnd(0)))
        summary_start = self.file.position
        builder = RecordBuilder()
        offsets = []
        for opcode, records in (
            (Opcode.SCHEMA, list(self._schemas.values())),
            (Opcode.CHANNEL, self._channels),
            (Opcode.STATISTICS, [self._statistics()]),
            (Opcode.CHUNK_INDEX, [self._chunk_index(chunk) for chunk in self._written]),
            (Opcode.METADATA_INDEX, [metadata_index]),
        ):
            start = builder.count
            for record in records:
                record.write(builder)
            if records:
                offsets.append(SummaryOffset(opcode, summary_start + start, builder.count - start))
        offset_start = summary_start + builder.count
        for group in offsets:
            group.write(builder)
        summary = builder.end()  # type: ignore[no-untyped-call]
        # The checksum covers the summary and the footer up to the checksum itself.
        footer = struct.pack("<BQQQ", Opcode.FOOTER, 8 + 8 + 4, summary_start, offset_start)
        crc = zlib.crc32(footer, zlib.crc32(summary))
        self.file.write(summary, _pack_record(Footer(summary_start, offset_start, crc)), MAGIC)

    def _chunk_index(self, chunk: Stored) -> "ChunkIndex":
        """Return the record that tells where a chunk and the indexes behind it are."""
        from mcap.records import ChunkIndex

        head, compressed, *indexes = chunk.sizes
        channels = [stored.topic.index + 1 for stored in chunk.topics]
        index_offsets = accumulate(indexes, initial=chunk.position + head + compressed)
        return ChunkIndex(
            chunk_length=head + compressed,
            chunk_start_offset=chunk.position,
            compression=self._compression,
            compressed_size=compressed,
            message_end_time=chunk.last_ns,
            message_index_length=sum(indexes),
            message_index_offsets=dict(zip(channels, index_offsets, strict=False)),
            message_start_time=chunk.first_ns,
            uncompressed_size=chunk.whole,
        )

    def _statistics(self) -> "Statistics":
        """Return the record with the numbers of messages, and their first and last time."""
        from mcap.records import Statistics

        filled = [topic for topic in self.topics if topic.count]
        return Statistics(
            attachment_count=0,
            channel_count=len(self._channels),
            channel_message_counts={topic.index + 1: topic.count for topic in filled},
            chunk_count=len(self._written),
            message_count=self.count,
            message_end_time=max((topic.last_ns for topic in filled), default=0),
            message_start_time=min((topic.first_ns for topic in filled), default=0),
            metadata_count=1,
            schema_count=len(self._schemas),
        )


def _pack_record(record: "McapRecord") -> bytes:
    """Return one of the mcap library's records as bytes."""
    from mcap.data_stream import RecordBuilder

    builder = RecordBuilder()
    record.write(builder)
    return builder.end()  # type: ignore[no-untyped-call]
