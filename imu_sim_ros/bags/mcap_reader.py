# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""MCAP files as blocks of messages; damaged and unfinished ones as far as they can be read."""

import re
import struct
import zlib
from collections.abc import Iterator, Mapping, Sequence
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from imu_sim_ros.bags.mcap_writer import (
    CHUNK,
    INDEX_ENTRY,
    MAGIC,
    MESSAGE,
    MESSAGE_HEADER,
    MESSAGE_INDEX,
)
from imu_sim_ros.bags.messages.blocks import MessageBlock, TopicInfo
from imu_sim_ros.bags.messages.schemas import Qos, Schema, ros2_name, typestore
from imu_sim_ros.bags.reader import (
    DAMAGE,
    END_NS,
    LOOSE_BYTES,
    ChunkedBag,
    ContradictionError,
    decompress,
    gather_messages,
    recovery_advice,
)
from imu_sim_ros.core.errors import InputError
from imu_sim_ros.core.spelling import argument
from imu_sim_ros.core.types import Bytes, Integers

if TYPE_CHECKING:
    from mcap.records import Channel, ChunkIndex, Statistics
    from mcap.records import Schema as SchemaRecord

_HEADER_BYTES = 9
"""Bytes in front of a record's content: opcode and length."""
_SCHEMA, _CHANNEL, _FOOTER = 0x03, 0x04, 0x02
_CHUNK_INDEX, _STATISTICS = 0x08, 0x0B
_LAST_OPCODE, _PRIVATE = 0x0F, 0x80
_FOOTER_BYTES = 20
"""Bytes of the content of the footer."""
_CHUNK_BYTES = 40
"""Size of a chunk's fields but its records and the name of their compression."""
_LONGEST_HEAD = _HEADER_BYTES + _CHUNK_BYTES + len("zstd")
_HEADS = re.compile(rb"(?=[\x02-\x0f].{4}\x00{4})", re.DOTALL)
"""Possible beginnings of records of less than 4 GiB."""
_FIELDS = {
    0x01: "ss",
    _FOOTER: "884",
    _SCHEMA: "2sss",
    _CHANNEL: "22sss",
    MESSAGE_INDEX: "2s",
    _CHUNK_INDEX: "8888s8s88",
    0x09: "88ssS4",
    0x0A: "88888ss",
    _STATISTICS: "82444488s",
    0x0C: "ss",
    0x0D: "88s",
    0x0E: "188",
    0x0F: "4",
}
"""Sizes of the fields of records by opcode [bytes]; s: 4 bytes that hold the size of what follows
them, S: 8."""
_INDEX_HEAD_BYTES = _HEADER_BYTES + 6
"""Size of a message index without its entries."""


_GENERATIONS = {"cdr": "ROS 2", "ros1": "ROS 1"}


class _RecordSpan(NamedTuple):
    """A record of the file."""

    opcode: int
    end: int
    """Offset behind the record."""


class _Chunk(NamedTuple):
    """Position of a chunk in the file, and its times; a truncated one ends with the file."""

    position: int
    length: int
    index_length: int
    start_ns: int
    torn: bool = False
    checked: bool = True
    """False: kept, although its checksum is wrong."""


class _Summary(NamedTuple):
    """Records of the summary section of a file."""

    schemas: dict[int, "SchemaRecord"]
    channels: dict[int, "Channel"]
    chunk_indexes: list["ChunkIndex"]
    statistics: "Statistics | None"


def _parse_summary(summary: bytes) -> _Summary:
    """Return the records of a summary.

    :raises ValueError: if they are not whole; the parser of ``mcap`` raises McapError as well.
    """
    from io import BytesIO

    from mcap.data_stream import ReadDataStream
    from mcap.records import Channel, ChunkIndex, Statistics
    from mcap.records import Schema as SchemaRecord

    schemas, channels = dict[int, SchemaRecord](), dict[int, Channel]()
    chunk_indexes: list[ChunkIndex] = []
    statistics = None
    record_end = 0
    for opcode, start, length in _records(memoryview(summary)):
        record_end = start + _HEADER_BYTES + length
        body = ReadDataStream(BytesIO(summary[start + _HEADER_BYTES : record_end]))
        if opcode == _SCHEMA:
            schema = SchemaRecord.read(body)
            schemas[schema.id] = schema
        elif opcode == _CHANNEL:
            channel = Channel.read(body)
            channels[channel.id] = channel
        elif opcode == _CHUNK_INDEX:
            chunk_indexes.append(ChunkIndex.read(body))
        elif opcode == _STATISTICS:
            statistics = Statistics.read(body)
    if record_end != len(summary):
        raise ValueError("the summary is that of another file")
    return _Summary(schemas, channels, chunk_indexes, statistics)


class WrongChecksumError(ValueError):
    """A chunk whose checksum is not that of its content."""


class McapBag(ChunkedBag[_Chunk]):
    """One MCAP file with messages of ROS 2, or of ROS 1.

    One that is to be recovered is read without index and footer, and damaged parts are left out.
    """

    encoding = "cdr"

    def _open(self) -> None:
        """Read the summary, or scan the file if there is none, or in recovery."""
        self._channels: dict[int, Channel] = {}
        self._schemas: dict[int, SchemaRecord] = {}
        self._summary_channels: frozenset[int] = frozenset()
        """Channels that the summary names, in recovery: they tell messages from other bytes."""
        self._check_start(MAGIC, "an MCAP file")
        counts = None
        try:
            counts = self._read_summary()
        except (InputError, OSError):
            if not self._recover:
                raise
        self._name_topics(self._scan() if counts is None or self._recover else counts)

    def _read_summary(self) -> Mapping[int, int] | None:
        """Read definitions and chunks from the summary at the end of the file.

        :returns: number of messages by channel; None: the file has no index of all chunks.
        :raises InputError: for a file without a valid end.
        """
        from mcap.exceptions import McapError

        try:
            summary = _parse_summary(self._summary_bytes())
        except (McapError, *DAMAGE):
            raise InputError(
                f"{self.path}: no valid end (interrupted or damaged); {recovery_advice()}"
            ) from None
        statistics = summary.statistics
        if statistics is None or (statistics.chunk_count == 0 and statistics.message_count):
            return None
        self._schemas, self._channels = summary.schemas, summary.channels
        if (
            len(summary.chunk_indexes) != statistics.chunk_count
            or len(summary.channels) != statistics.channel_count
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

    def _summary_bytes(self) -> bytes:
        """Return the records between the beginning of the summary and the footer; empty: none.

        :raises ValueError: if the file does not end with a footer that points into the file.
        """
        footer = self._end - len(MAGIC) - _FOOTER_BYTES - _HEADER_BYTES
        opcode, _, begin = struct.unpack_from("<BQQ", self._bytes(footer, self._end - footer))
        if opcode != _FOOTER or begin > footer:
            raise ValueError("there is no footer, or that of another file")
        return self._bytes(begin, footer - begin) if begin else b""

    def _scan(self) -> Mapping[int, int]:
        """Find all chunks and channels without an index, and count the messages.

        In recovery, what is no record is left out up to the next place where one begins for sure.
        """
        counts: dict[int, int] = {}
        self._summary_channels = frozenset(self._channels)
        self._channels, self._schemas, self._chunks = {}, {}, []
        position, opcode = self._start, 0
        try:
            while position < self._end and opcode != _FOOTER:
                record = self._record_at(position)
                if record is None:
                    if not self._recover:
                        raise InputError(f"{self.path}: no whole record at byte {position}")
                    following = self._next_record(position + 1)
                    self._leave_out(position, following, "no whole record")
                    position = following
                    continue
                opcode, end = record
                if opcode == CHUNK:
                    end = self._add_chunk(position, end, counts)
                elif opcode == MESSAGE:
                    # Messages outside chunks: neighbours are read as if they were one chunk.
                    end = self._add_messages(position, counts)
                elif opcode in (_SCHEMA, _CHANNEL):
                    body = self._bytes(position, end - position)[_HEADER_BYTES:]
                    self._try_definition(opcode, body, position)
                elif opcode >= _PRIVATE and self._recover:  # or a damaged opcode of a chunk
                    self._leave_out(position, end, f"record of the unknown kind {opcode:#x}")
                position = end
        except ContradictionError as error:
            if not self._recover:
                raise
            self._leave_out(position, self._end, str(error))
        else:
            self._look_at_end(position, opcode == _FOOTER)
        return counts

    def _look_at_end(self, position: int, whole: bool) -> None:
        """Note the bytes after the last record."""
        if whole:
            position += len(MAGIC)
            if position < self._end:
                self._leave_out(position, self._end, "they follow the end of an MCAP file")
        if not whole or position > self._end:
            self.found.append("no end: the recording was interrupted, or its end is lost")

    def _record_at(self, position: int) -> _RecordSpan | None:
        """Return the record that begins at an offset of the file.

        :returns: None if none does, or if it is not whole; the last chunk may be truncated.
        """
        head = self._head(position)
        if len(head) < _HEADER_BYTES:
            return None
        opcode, length = struct.unpack_from("<BQ", head)
        end = position + _HEADER_BYTES + length
        if opcode == CHUNK:
            plausible = _begins_chunk(head)
        elif opcode == MESSAGE:
            plausible = end <= self._end and self._begins_message(head)
        elif opcode == _FOOTER:
            plausible = length == _FOOTER_BYTES and MAGIC.startswith(self._head(end)[:8])
        elif self._recover:
            fields = position + _HEADER_BYTES
            plausible = end <= self._end and self._is_filled(opcode, fields, end)
        else:
            plausible = end <= self._end and (0 < opcode <= _LAST_OPCODE or opcode >= _PRIVATE)
        return _RecordSpan(opcode, end) if plausible else None

    def _is_filled(self, opcode: int, position: int, end: int) -> bool:
        """Return whether the fields of a record end where the record does.

        :param position: begin of its fields.
        """
        if opcode >= _PRIVATE:  # its fields are not known: it counts if a known record follows
            following = self._head(end)[:1]
            return following < bytes([_PRIVATE]) and self._record_at(end) is not None
        for field in _FIELDS.get(opcode, ""):
            size = {"s": 4, "S": 8}.get(field, 0)
            if size:
                position += int.from_bytes(self._read_at(position, size), "little")
            position += size or int(field)
            if position > end:
                return False
        return position == end and opcode in _FIELDS

    def _is_followed(self, position: int) -> bool:
        """Return whether a record begins at an offset that another one, or the end, follows."""
        record = self._record_at(position)
        return record is not None and (
            record.opcode == _FOOTER
            or record.end >= self._end
            or self._record_at(record.end) is not None
        )

    def _next_record(self, position: int) -> int:
        """Return the next offset at which a record begins that another one follows."""
        offsets = self._offsets_of(_HEADS, position)
        return next(filter(self._is_followed, offsets), self._end)

    def _begins_message(self, head: bytes) -> bool:
        """Return whether the header is that of a message of a known channel."""
        if len(head) < MESSAGE_HEADER.itemsize:
            return False
        opcode, length, channel = struct.unpack_from("<BQH", head)
        if opcode != MESSAGE or length < MESSAGE_HEADER.itemsize - _HEADER_BYTES:
            return False
        known_channels, summary_channels = self._channels, self._summary_channels
        return (
            channel in known_channels
            or channel in summary_channels
            or not (known_channels or summary_channels)
        )

    def _add_chunk(self, position: int, end: int, counts: dict[int, int]) -> int:
        """Note a chunk and count its messages; returns where to go on.

        The records of a damaged chunk without compression are gone through like messages outside
        chunks: what breaks their sequence shows which of them are lost. If nothing does, any of
        them may be wrong.
        """
        chunk = _Chunk(position, min(end, self._end) - position, 0, 0, torn=end > self._end)
        content: bytes | memoryview = b""
        try:
            content = self._chunk_data(chunk)
            problem = "cut off by the end of the file" if chunk.torn else "damaged records"
        except WrongChecksumError as error:
            problem = str(error)
            content = self._chunk_data(chunk, checked=False)
            if self._keeps_damaged and _are_records(content):
                chunk = chunk._replace(checked=False)
                message_count = self._add_scanned(chunk, content, counts)
                self.found.append(
                    f"chunk at byte {position}: {problem}; its {message_count} messages are kept, "
                    "and any of them may be wrong"
                )
                return end
            if self._recover and _are_records(content):
                problem += f"; {argument('keep_damaged', True)} keeps its messages"
        except DAMAGE as error:
            problem = str(error)
        else:
            if not chunk.torn and _are_records(content):
                self._add_scanned(chunk, content, counts)
                return end
        if not self._recover:
            raise InputError(f"{self.path}: chunk at byte {position}: {problem}")
        if not self._is_compressed(position):
            inner_position = position + _LONGEST_HEAD - len("zstd")
            if not self._is_sequence(inner_position, end):
                return inner_position
        elif chunk.torn and self._next_record(position + 1) == self._end:
            self._add_scanned(chunk, content, counts)
            return end
        if end != self._end and not self._is_followed(end):
            end = self._next_record(position + 1)
        messages = self._indexed_count(end)
        self._leave_out(position, end, f"chunk: {problem}", messages)
        return end

    def _indexed_count(self, position: int) -> int:
        """Return how many messages the indexes at an offset name: those of the chunk before it."""
        entries = 0
        while (record := self._record_at(position)) and record.opcode == MESSAGE_INDEX:
            entries += (record.end - position - _INDEX_HEAD_BYTES) // INDEX_ENTRY.itemsize
            position = record.end
        return entries

    def _add_messages(self, position: int, counts: dict[int, int]) -> int:
        """Note messages that follow each other outside chunks; returns where to go on.

        The message before a damaged place is left out, because its size and its end may be damaged
        as well; the search for the next record begins at its second byte.
        """
        previous = end = position
        while (
            end - position < LOOSE_BYTES
            and (record := self._record_at(end))
            and record.opcode == MESSAGE
        ):
            previous, end = end, record.end
        next_position = end
        if end < self._end and not self._record_at(end) and not self._is_cut(end):
            next_position = self._next_record(previous + 1)
            self._leave_out(previous, next_position, "no whole record")
            end = previous
        if end > position:
            chunk = _Chunk(position, end - position, 0, 0)
            self._add_scanned(chunk, self._chunk_data(chunk), counts)
        return next_position

    def _is_cut(self, position: int) -> bool:
        """Return whether a message begins here that the end of the file cuts off."""
        head = self._head(position)
        return len(head) < MESSAGE_HEADER.itemsize or (
            self._begins_message(head) and self._next_record(position + 1) == self._end
        )

    def _is_sequence(self, position: int, end: int) -> bool:
        """Return whether records follow each other from one offset to another."""
        while position < min(end, self._end) and (record := self._record_at(position)):
            position = record.end
        return position == end

    def _head(self, position: int) -> bytes:
        """Return the bytes at an offset that hold the longest head of a record."""
        return self._read_at(position, _LONGEST_HEAD)

    def _is_compressed(self, position: int) -> bool:
        """Return True if the chunk at an offset names a compression."""
        return self._bytes(position + _HEADER_BYTES + 28, 4) != bytes(4)

    def _add_scanned(self, chunk: _Chunk, data: bytes | memoryview, counts: dict[int, int]) -> int:
        """Note a chunk, its definitions and messages; returns how many messages it has."""
        starts, counts_by_channel = [END_NS], dict[int, int]()
        for opcode, start, length in _records(memoryview(data)):
            if opcode == MESSAGE:
                _, channel, _, log_time = struct.unpack_from("<QHIQ", data, start + 1)
                counts_by_channel[channel] = counts_by_channel.get(channel, 0) + 1
                starts.append(log_time)
            else:
                body = bytes(data[start + _HEADER_BYTES : start + _HEADER_BYTES + length])
                self._try_definition(opcode, body, chunk.position + start)
        for channel, count in counts_by_channel.items():
            counts[channel] = counts.get(channel, 0) + count
        if chunk.torn:
            self._leave_out(
                chunk.position,
                self._end,
                "chunk: cut off by the end of the file; "
                f"{sum(counts_by_channel.values())} messages before that are kept",
            )
        if len(starts) > 1:
            self._chunks.append(chunk._replace(start_ns=min(starts)))
        return sum(counts_by_channel.values())

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
            self._leave_out(position, position + _HEADER_BYTES + len(body), f"definition: {error}")

    def _note_definition(self, opcode: int, body: bytes) -> None:
        """Register the schema or the channel in the body of a record."""
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
            previous = self._channels.get(channel.id, channel)
            _check_same("channel", channel.id, previous.topic, channel.topic)
            _check_same("channel", channel.id, previous.schema_id, channel.schema_id)
            self._channels[channel.id] = channel

    def _name_topics(self, counts: Mapping[int, int]) -> None:
        """Make a topic of all channels with the same name and type."""
        groups: dict[tuple[str, str], list[Channel]] = {}
        for id_, count in counts.items():
            if count and id_ not in self._channels:
                self._leave_out_messages(count, f"the definition of channel {id_} is lost")
        for channel in self._channels.values():
            record = self._schemas.get(channel.schema_id)
            groups.setdefault((channel.topic, record.name if record else ""), []).append(channel)
        self.encoding = self._message_encoding(groups, counts)
        for (name, type_name), channels in groups.items():
            if {channel.message_encoding for channel in channels} != {self.encoding}:
                continue
            record = self._schemas.get(channels[0].schema_id)
            count = sum(counts.get(channel.id, 0) for channel in channels)
            kind = self._ros1_type if self.encoding == "ros1" else self._ros2_type
            topic = kind(name, type_name, count, record, channels[0].metadata)
            self.topics.append(topic)
            self._topic_of.update({channel.id: topic for channel in channels})

    def _message_encoding(
        self, groups: Mapping[tuple[str, str], Sequence["Channel"]], counts: Mapping[int, int]
    ) -> str:
        """Return the encoding of the messages that are read: cdr, or ros1 if no topic has cdr.

        Topics with messages of another one are noted as unreadable.

        :raises InputError: if no topic with messages has one of the two.
        """
        encodings: dict[str, str] = {}
        """Encoding by topic, of those with messages."""
        for (name, _), channels in groups.items():
            for channel in channels:
                if counts.get(channel.id, 0):
                    encodings[name] = channel.message_encoding
        readable = [form for form in ("cdr", "ros1") if form in encodings.values()]
        encoding = readable[0] if readable else "cdr"
        other_encodings = {name: form for name, form in encodings.items() if form != encoding}
        self.unreadable = {
            name: f"holds {form or 'no encoding'}, not {_GENERATIONS[encoding]} messages"
            for name, form in other_encodings.items()
        }
        if other_encodings and not readable and not self._recover:
            raise InputError([f"{self.path}: {n} {why}" for n, why in self.unreadable.items()])
        return encoding

    def _ros2_type(
        self,
        name: str,
        type_name: str,
        count: int,
        record: "SchemaRecord | None",
        metadata: Mapping[str, str],
    ) -> TopicInfo:
        """Return a topic of ROS 2 messages."""
        text = record.data.decode("utf-8", "replace") if record else ""
        digest = metadata.get("topic_type_hash", "")
        language = record.encoding if record and record.encoding else "ros2msg"
        qos_profiles = metadata.get("offered_qos_profiles", "")
        return TopicInfo(name, type_name, count, Schema(text, digest, language), qos_profiles)

    def _ros1_type(
        self,
        name: str,
        type_name: str,
        count: int,
        record: "SchemaRecord | None",
        metadata: Mapping[str, str],
    ) -> TopicInfo:
        """Return a topic of ROS 1 messages, as ``mcap convert`` writes them."""
        text = record.data.decode("utf-8", "replace") if record else ""
        type_name = ros2_name(type_name) if type_name else ""
        digest = metadata.get("md5sum", "")
        if text and not digest:
            types = typestore([(type_name, Schema(text, ""))], "ros1")
            digest = types.generate_msgdef(type_name, ros_version=1)[1]
        is_latched = metadata.get("latching", "").lower() in ("1", "true")
        qos = Qos(durability="transient_local") if is_latched else Qos()
        return TopicInfo(name, type_name, count, Schema(text, digest), (qos,))

    def _blocks(
        self, chunk: _Chunk, topics_by_channel: Mapping[int, TopicInfo]
    ) -> list[MessageBlock]:
        """Return the messages of a chunk, in blocks of one topic each."""
        data = np.frombuffer(self._chunk_data(chunk), np.uint8)
        offsets = self._read_chunk_index(chunk) or _scan_records(data)
        blocks = []
        header = MESSAGE_HEADER.itemsize
        for channel, rows_of_channel in offsets.items():
            if channel not in topics_by_channel or not len(rows_of_channel):
                continue
            rows = gather_messages(
                data, rows_of_channel, np.full(len(rows_of_channel), header, dtype=np.int64)
            )
            fields = np.ascontiguousarray(rows).view(MESSAGE_HEADER)[:, 0]
            is_of_channel = (fields["opcode"] == MESSAGE) & (fields["channel"] == channel)
            if not is_of_channel.all():
                raise ValueError("the index of the messages is wrong")
            lengths = fields["length"].astype(np.int64) - (header - _HEADER_BYTES)
            payloads = gather_messages(data, rows_of_channel + header, lengths)
            t_ns = fields["log_time"].astype(np.int64)
            blocks.append(MessageBlock(topics_by_channel[channel], t_ns, payloads))
        return blocks

    def _chunk_data(self, chunk: _Chunk, checked: bool = True) -> bytes | memoryview:
        """Return the content of a chunk, or as much as there is of a truncated one.

        :raises WrongChecksumError: if it has another checksum, unless it is not checked.
        """
        record = self._bytes(chunk.position, chunk.length)
        if record[:1] == bytes([MESSAGE]):
            return record
        start = _HEADER_BYTES + 28
        _, _, size, crc = struct.unpack_from("<QQQI", record, _HEADER_BYTES)
        (name_length,) = struct.unpack_from("<I", record, start)
        compression = record[start + 4 : start + 4 + name_length].decode()
        data = memoryview(record)[start + 4 + name_length + 8 :]
        content = decompress(data, compression, size, chunk.torn)
        if checked and chunk.checked and not chunk.torn and crc and zlib.crc32(content) != crc:
            raise WrongChecksumError("the checksum is wrong")
        return content

    def _bytes(self, offset: int, length: int) -> bytes:
        """Return a part of the file.

        :raises ValueError: if it reaches past the end.
        """
        if offset + length > self._end:
            raise ValueError("it reaches past the end of the file")
        return self._read_at(offset, length)

    def _read_chunk_index(self, chunk: _Chunk) -> dict[int, Integers]:
        """Return by channel where the index says that messages begin; empty without an index."""
        data = self._bytes(chunk.position + chunk.length, chunk.index_length)
        offsets: dict[int, Integers] = {}
        for opcode, start, _ in _records(memoryview(data)):
            if opcode != MESSAGE_INDEX:
                return {}
            channel, size = struct.unpack_from("<HI", data, start + _HEADER_BYTES)
            begin = start + _HEADER_BYTES + 6
            entries = np.frombuffer(data, INDEX_ENTRY, size // INDEX_ENTRY.itemsize, begin)
            offsets[channel] = entries["offset"].astype(np.int64)
        return offsets


def _are_records(data: bytes | memoryview) -> bool:
    """Return whether data are records, each after the other, up to the end."""
    end = 0
    for _, start, length in _records(memoryview(data)):
        end = start + _HEADER_BYTES + length
    return end == len(data)


def _begins_chunk(head: bytes) -> bool:
    """Return whether the sizes in the header of a chunk agree with each other."""
    if len(head) < _HEADER_BYTES + _CHUNK_BYTES:
        return False
    length, name_length = struct.unpack_from("<xQ28xI", head)
    if name_length > len("zstd"):
        return False
    (stored,) = struct.unpack_from("<Q", head, _HEADER_BYTES + 32 + name_length)
    return bool(length == _CHUNK_BYTES + name_length + stored)


def _check_same(kind: str, id_: int, previous: object, current: object) -> None:
    """Refuse a second definition of an id that differs from the first."""
    if previous != current:
        raise ContradictionError(f"{kind} {id_} is {current} from here on, and {previous} before")


def _scan_records(data: Bytes) -> dict[int, Integers]:
    """Return by channel where messages begin, found by going from record to record."""
    starts_by_channel: dict[int, list[int]] = {}
    content = memoryview(data.data)
    for opcode, start, _ in _records(content):
        if opcode == MESSAGE:
            (channel,) = struct.unpack_from("<H", content, start + _HEADER_BYTES)
            starts_by_channel.setdefault(channel, []).append(start)
    return {
        channel: np.array(starts, dtype=np.int64) for channel, starts in starts_by_channel.items()
    }


def _records(data: memoryview) -> Iterator[tuple[int, int, int]]:
    """Yield opcode, start and length of all complete records."""
    position = 0
    while position + _HEADER_BYTES <= len(data):
        opcode, length = struct.unpack_from("<BQ", data, position)
        end = position + _HEADER_BYTES + length
        if end > len(data):
            return
        yield opcode, position, length
        position = end
