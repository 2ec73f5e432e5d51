# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""MCAP files as blocks of messages; damaged and unfinished ones as far as they can be read."""

import struct
import zlib
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import IO, Any, BinaryIO, NamedTuple, cast

import numpy as np

from imu_sim_ros.bags.chunks import decompress
from imu_sim_ros.bags.mcap_writer import (
    CHUNK,
    INDEX_ENTRY,
    MAGIC,
    MESSAGE,
    MESSAGE_HEADER,
    MESSAGE_INDEX,
)
from imu_sim_ros.bags.messages.blocks import MessageBlock, TopicInfo
from imu_sim_ros.bags.messages.schemas import Schema, parse_qos
from imu_sim_ros.bags.reader import DAMAGE, END_NS, ChunkedBag, ContradictionError, gather, in_order
from imu_sim_ros.errors import InputError
from imu_sim_ros.types import Bytes

_HEADER_BYTES = 9
_SCHEMA, _CHANNEL, _FOOTER = 0x03, 0x04, 0x02


class _Chunk(NamedTuple):
    """Position of a chunk in the file, and its times; a truncated one ends with the file."""

    position: int
    length: int
    index_length: int
    start_ns: int
    torn: bool = False


class McapBag(ChunkedBag):
    """One MCAP file with ROS 2 messages.

    One that is to be recovered is read without index and footer, and damaged parts are left out.
    """

    encoding = "cdr"

    def __init__(self, path: Path, recover: bool = False) -> None:
        """Open a file; arguments as for :class:`ChunkedBag`."""
        self._records: dict[int, Any] = {}
        self._schemas: dict[int, Any] = {}
        super().__init__(path, recover)

    def _open(self) -> None:
        if self._file.read(len(MAGIC)) != MAGIC:
            raise InputError(f"{self.path}: not an MCAP file")
        counts = None if self._recover else self._read_summary()
        self._name_topics(self._scan() if counts is None else counts)

    def _read_summary(self) -> Mapping[int, int] | None:
        """Read the summary at the end of the file; None if it has no chunk index."""
        from mcap.exceptions import McapError
        from mcap.reader import SeekingReader

        self._file.seek(0)
        try:
            summary = SeekingReader(cast(IO[bytes], _Bounded(self._file, self._end))).get_summary()
            if summary and self._file.tell() < self._end - len(MAGIC):
                raise ValueError("the summary is that of another file")
        except (McapError, *DAMAGE):
            raise InputError(
                f"{self.path}: no valid end (interrupted or damaged); "
                "convert_bag --recover recovers the complete messages"
            ) from None
        statistics = summary.statistics if summary else None
        if (
            not summary
            or not statistics
            or (statistics.chunk_count == 0 and statistics.message_count)
        ):
            return None
        self._schemas, self._records = dict(summary.schemas), dict(summary.channels)
        if len(summary.chunk_indexes) != statistics.chunk_count or (
            len(summary.channels) != statistics.channel_count
        ):
            return None
        self._chunks = [
            _Chunk(
                index.chunk_start_offset,
                index.chunk_length,
                index.message_index_length,
                index.message_start_time,
            )
            for index in summary.chunk_indexes
        ]
        return statistics.channel_message_counts

    def _scan(self) -> Mapping[int, int]:
        """Find all chunks and channels without an index, and count the messages."""
        counts: dict[int, int] = {}
        self._records, self._schemas, self._chunks = {}, {}, []
        end, position, opcode = self._end, len(MAGIC), 0
        try:
            while position + _HEADER_BYTES <= end and opcode != _FOOTER:
                self._file.seek(position)
                opcode, length = struct.unpack("<BQ", self._file.read(_HEADER_BYTES))
                after = position + _HEADER_BYTES + length
                if opcode == 0 or (after > end and opcode != CHUNK):
                    break
                if opcode == CHUNK:
                    chunk = _Chunk(position, min(after, end) - position, 0, 0, torn=after > end)
                    self._add_scanned(chunk, counts)
                elif opcode == MESSAGE:
                    # Messages outside chunks: neighbours are read as if they were one chunk.
                    after = self._end_of_messages(position, end)
                    self._add_scanned(_Chunk(position, after - position, 0, 0), counts)
                elif opcode in (_SCHEMA, _CHANNEL):
                    self._try_definition(opcode, self._file.read(length), position)
                position = after
        except ContradictionError as error:
            if not self._recover:
                raise
            self._leave_out_rest(position, str(error))
        else:
            self._look_at_end(position, opcode == _FOOTER)
        return counts

    def _look_at_end(self, position: int, whole: bool) -> None:
        """Note the bytes after the last record."""
        if whole:
            position += len(MAGIC)
            if position < self._end:
                self._leave_out_rest(position, "they follow the end of an MCAP file")
        elif position < self._end:
            self._leave_out_rest(position, "no whole record")
        if not whole or position > self._end:
            self.found.append("no end: the recording was interrupted, or its end is lost")

    def _try_definition(self, opcode: int, body: bytes, position: int) -> None:
        """Register a schema or a channel; a damaged one is skipped when recovering."""
        from mcap.exceptions import McapError

        try:
            self._note_definition(opcode, body)
        except ContradictionError:
            raise
        except (McapError, *DAMAGE) as error:
            if not self._recover:
                raise
            self.damage.append(f"definition at byte {position}: {error}")

    def _end_of_messages(self, position: int, end: int) -> int:
        while position + _HEADER_BYTES <= end:
            self._file.seek(position)
            opcode, length = struct.unpack("<BQ", self._file.read(_HEADER_BYTES))
            if opcode != MESSAGE or position + _HEADER_BYTES + length > end:
                break
            position += _HEADER_BYTES + length
        return max(position, self._file.tell()) if opcode == MESSAGE else position

    def _add_scanned(self, chunk: _Chunk, counts: dict[int, int]) -> None:
        try:
            data = self._chunk_data(chunk)
        except DAMAGE as error:
            problem = f"chunk at byte {chunk.position}: {error}"
            if not self._recover:
                raise InputError(f"{self.path}: {problem}") from None
            self.damage.append(problem)
            return
        starts, last, found = [END_NS], 0, dict[int, int]()
        for opcode, start, length in _records(memoryview(data)):
            last = start + _HEADER_BYTES + length
            if opcode == MESSAGE:
                _, channel, _, log_time = struct.unpack_from("<QHIQ", data, start + 1)
                found[channel] = found.get(channel, 0) + 1
                starts.append(log_time)
            else:
                body = bytes(data[start + _HEADER_BYTES : last])
                self._try_definition(opcode, body, chunk.position + start)
        for channel, count in found.items():
            counts[channel] = counts.get(channel, 0) + count
        if chunk.torn:
            self.damage.append(
                f"chunk at byte {chunk.position}: cut off by the end of the file; "
                f"{sum(found.values())} messages before that are kept"
            )
        elif last < len(data):
            self.damage.append(
                f"chunk at byte {chunk.position}: damaged {last} bytes after its beginning"
            )
        if len(starts) > 1:
            self._chunks.append(chunk._replace(start_ns=min(starts)))

    def _note_definition(self, opcode: int, body: bytes) -> None:
        from io import BytesIO

        from mcap.data_stream import ReadDataStream
        from mcap.records import Channel
        from mcap.records import Schema as SchemaRecord

        if opcode == _SCHEMA:
            schema = SchemaRecord.read(ReadDataStream(BytesIO(body)))
            _check_same("schema", schema.id, self._schemas.get(schema.id, schema).name, schema.name)
            self._schemas[schema.id] = schema
        elif opcode == _CHANNEL:
            channel = Channel.read(ReadDataStream(BytesIO(body)))
            before = self._records.get(channel.id, channel)
            _check_same("channel", channel.id, before.topic, channel.topic)
            _check_same("channel", channel.id, before.schema_id, channel.schema_id)
            self._records[channel.id] = channel

    def _name_topics(self, counts: Mapping[int, int]) -> None:
        """Make a topic of all channels with the same name and type."""
        groups: dict[tuple[str, str], list[Any]] = {}
        for channel in self._records.values():
            record = self._schemas.get(channel.schema_id)
            groups.setdefault((channel.topic, record.name if record else ""), []).append(channel)
        for (name, type_name), channels in groups.items():
            encodings = {channel.message_encoding for channel in channels}
            if encodings != {"cdr"} and self._recover and not any(counts.values()):
                continue
            if encodings != {"cdr"}:
                raise InputError(f"{self.path}: {name} holds {encodings.pop()}, not ROS 2 messages")
            record = self._schemas.get(channels[0].schema_id)
            text = record.data.decode("utf-8", "replace") if record else ""
            metadata = channels[0].metadata
            topic = TopicInfo(
                name,
                type_name,
                sum(counts.get(channel.id, 0) for channel in channels),
                Schema(
                    text,
                    metadata.get("topic_type_hash", ""),
                    record.encoding if record and record.encoding else "ros2msg",
                ),
                parse_qos(metadata.get("offered_qos_profiles", "")),
            )
            self.topics.append(topic)
            self._topic_of.update({channel.id: topic for channel in channels})

    def _blocks(self, chunk: _Chunk, wanted: Mapping[int, TopicInfo]) -> list[MessageBlock]:
        data = np.frombuffer(self._chunk_data(chunk), np.uint8)
        offsets = self._indexed(chunk) or _scanned(data)
        by_topic: dict[TopicInfo, list[MessageBlock]] = {}
        for channel, places in offsets.items():
            if channel in wanted and len(places):
                topic = wanted[channel]
                by_topic.setdefault(topic, []).append(_block(topic, channel, data, places))
        return [in_order(blocks) for blocks in by_topic.values()]

    def _chunk_data(self, chunk: _Chunk) -> bytes | memoryview:
        """Return the verified content of a chunk, or as much as there is of a truncated one."""
        record = self._bytes(chunk.position, chunk.length)
        if record[:1] == bytes([MESSAGE]):
            return record
        start = _HEADER_BYTES + 28
        _, _, size, crc = struct.unpack_from("<QQQI", record, _HEADER_BYTES)
        (name_length,) = struct.unpack_from("<I", record, start)
        compression = record[start + 4 : start + 4 + name_length].decode()
        data = memoryview(record)[start + 4 + name_length + 8 :]
        content = decompress(data, compression, size, chunk.torn)
        if not chunk.torn and crc and zlib.crc32(content) != crc:
            raise ValueError("the checksum is wrong")
        return content

    def _bytes(self, offset: int, length: int) -> bytes:
        """Return a part of the file.

        :raises ValueError: if it reaches past the end.
        """
        if offset + length > self._end:
            raise ValueError("it reaches past the end of the file")
        self._file.seek(offset)
        return self._file.read(length)

    def _indexed(self, chunk: _Chunk) -> dict[int, np.ndarray[Any, np.dtype[np.int64]]]:
        """Return by channel where the index says that messages begin; empty without an index."""
        data = self._bytes(chunk.position + chunk.length, chunk.index_length)
        found: dict[int, Any] = {}
        for opcode, start, _ in _records(memoryview(data)):
            if opcode != MESSAGE_INDEX:
                return {}
            channel, size = struct.unpack_from("<HI", data, start + _HEADER_BYTES)
            first = start + _HEADER_BYTES + 6
            entries = np.frombuffer(data, INDEX_ENTRY, size // INDEX_ENTRY.itemsize, first)
            found[channel] = entries["offset"].astype(np.int64)
        return found


class _Bounded:
    """A file of which no more bytes are requested than exist, however absurd a length field is."""

    def __init__(self, file: BinaryIO, end: int) -> None:
        self._file, self._end = file, end
        self.seek, self.tell, self.seekable = file.seek, file.tell, file.seekable

    def read(self, size: int = -1) -> bytes:
        """Return at most as many bytes as remain."""
        left = max(self._end - self._file.tell(), 0)
        return self._file.read(left if size < 0 else min(size, left))


def _check_same(what: str, id_: int, before: object, now: object) -> None:
    if before != now:
        raise ContradictionError(f"{what} {id_} is {now} from here on, and {before} before")


def _block(
    topic: TopicInfo, channel: int, data: Bytes, places: np.ndarray[Any, np.dtype[np.int64]]
) -> MessageBlock:
    """Return the messages at given offsets of a chunk.

    :raises ValueError: if there are other records.
    """
    header = MESSAGE_HEADER.itemsize
    sizes = np.full(len(places), header, dtype=np.int64)
    rows = gather(data, places, sizes)
    fields = np.ascontiguousarray(rows).view(MESSAGE_HEADER)[:, 0]
    if bool(np.any(fields["opcode"] != MESSAGE)) or bool(np.any(fields["channel"] != channel)):
        raise ValueError("the index of the messages is wrong")
    lengths = fields["length"].astype(np.int64) - (header - _HEADER_BYTES)
    payloads = gather(data, places + header, lengths)
    return MessageBlock(topic, fields["log_time"].astype(np.int64), payloads)


def _scanned(data: Bytes) -> dict[int, np.ndarray[Any, np.dtype[np.int64]]]:
    """Return by channel where messages begin, found by going from record to record."""
    found: dict[int, list[int]] = {}
    content = memoryview(data.data)
    for opcode, start, _ in _records(content):
        if opcode == MESSAGE:
            (channel,) = struct.unpack_from("<H", content, start + _HEADER_BYTES)
            found.setdefault(channel, []).append(start)
    return {channel: np.array(starts, dtype=np.int64) for channel, starts in found.items()}


def _records(data: memoryview) -> Iterator[tuple[int, int, int]]:
    """Yield opcode, start and length of all complete records."""
    position = 0
    while position + _HEADER_BYTES <= len(data):
        opcode, length = struct.unpack_from("<BQ", data, position)
        after = position + _HEADER_BYTES + length
        if after > len(data):
            return
        yield opcode, position, length
        position = after
