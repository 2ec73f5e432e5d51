# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""ROS 1 bags (format 2.0) as blocks of messages; damaged ones as far as readable."""

import re
import struct
from collections.abc import Iterator, Mapping, Sequence
from typing import Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from imu_sim_ros.bags.messages.blocks import MessageBlock, TopicInfo
from imu_sim_ros.bags.messages.schemas import Qos, Schema, ros2_name
from imu_sim_ros.bags.reader import (
    DAMAGE,
    LOOSE_BYTES,
    ChunkedBag,
    ContradictionError,
    decompress,
    gather_messages,
    recovery_advice,
)
from imu_sim_ros.bags.ros1_writer import (
    INDEX_ENTRY,
    MAGIC,
    OP_BAG_HEADER,
    OP_CHUNK,
    OP_CHUNK_INFO,
    OP_CONNECTION,
    OP_INDEX,
    OP_MESSAGE,
)
from imu_sim_ros.core.errors import InputError
from imu_sim_ros.core.timebase import NANOSECONDS_PER_SECOND
from imu_sim_ros.core.types import Bytes, Integers

_LONGEST_HEADER = 1 << 24
"""Longest header of a record [bytes]; longer ones are damage."""
_LARGEST_BAG_HEADER: Final = 1 << 16
"""Largest bag header [bytes]; bag headers usually have 4096."""
_CHUNK_COUNT: Final = struct.Struct("<II")
"""Connection and number of its messages, in the data of a chunk's information."""
_FIELDS: Final = {
    OP_MESSAGE: {"conn", "time"},
    OP_BAG_HEADER: {"index_pos", "conn_count", "chunk_count"},
    OP_INDEX: {"ver", "conn", "count"},
    OP_CHUNK: {"compression", "size"},
    OP_CHUNK_INFO: {"ver", "chunk_pos", "start_time", "end_time", "count"},
    OP_CONNECTION: {"conn", "topic"},
}
"""The fields that records have by their kind."""
_NAMES: Final = "|".join(sorted({"op"}.union(*_FIELDS.values())))
_HEADS: Final = re.compile(rb"(?=..\0\0..\0\0(?:%b)=)" % _NAMES.encode(), re.DOTALL)
"""Possible beginnings of records: lengths of header and first field, and that field's name."""

_MESSAGE_HEAD_BYTES: Final = 8 + sum(
    4 + len(field) for field in ("op=_", "conn=____", "time=________")
)
"""Size of a message's header and of the length of its data."""


class _Connection(NamedTuple):
    """A publisher's connection to a topic."""

    topic: str
    type_name: str
    """Name of the type in ROS 2: ``sensor_msgs/msg/Imu``."""
    schema: Schema
    is_latched: bool
    """True if late subscribers got the last message."""


class _Record(NamedTuple):
    """A record: the fields of its header, and the place of its data in the file or chunk."""

    fields: dict[str, bytes]
    start: int
    """First byte of the data."""
    size: int
    """Bytes of the data."""
    whole: bool

    @property
    def op(self) -> int:
        """Opcode: the kind of the record."""
        return self.fields["op"][0]

    @property
    def after(self) -> int:
        """The end of the record in the file or chunk."""
        return self.start + self.size

    def number(self, name: str) -> int:
        """Return a field as a number of its own size."""
        return int.from_bytes(self.fields[name], "little")

    def time(self, name: str) -> int:
        """Return a field as nanoseconds."""
        second, nanosecond = struct.unpack("<II", self.fields[name][:8])
        return int(second * NANOSECONDS_PER_SECOND + nanosecond)


class _Chunk(NamedTuple):
    """A chunk, or messages outside chunks, with its place in the file and its first time."""

    position: int
    start_ns: int
    indexed: bool
    loose: int = 0
    """Size of messages outside chunks that are read as one [bytes]; 0: a chunk."""


class Rosbag1Bag(ChunkedBag[_Chunk]):
    """One ROS 1 bag.

    One that is to be recovered is read without its index, and damaged parts are left out.
    """

    encoding = "ros1"

    def _open(self) -> None:
        """Read the index at the end of the bag; in recovery, scan the file."""
        self._connections: dict[int, _Connection] = {}
        """Connections by their ids."""
        self._check_start(MAGIC, "a ROS 1 bag of format 2.0")
        try:
            self._name_topics(self._scan() if self._recover else self._read_index())
        except DAMAGE:
            hint = "" if self._recover else f"; {recovery_advice()}"
            raise InputError(f"{self.path}: the index is damaged{hint}") from None

    def _read_index(self) -> Mapping[int, int]:
        """Read connections and the list of chunks at the end of the bag; return the counts."""
        counts: dict[int, int] = {}
        header = self._record(len(MAGIC))
        if header.op != OP_BAG_HEADER:
            raise InputError(f"{self.path}: not a ROS 1 bag of format 2.0")
        position = header.number("index_pos")
        if not position or position > self._end:
            raise InputError(
                f"{self.path}: not indexed (interrupted or damaged); {recovery_advice()}"
            )
        while position < self._end:
            record = self._record(position)
            if not record.whole:
                raise ValueError("the index is truncated")
            if record.op == OP_CONNECTION:
                self._note_connection(record, self._data(record))
            elif record.op == OP_CHUNK_INFO:
                self._chunks.append(
                    _Chunk(record.number("chunk_pos"), record.time("start_time"), True)
                )
                for connection, count in _CHUNK_COUNT.iter_unpack(self._data(record)):
                    counts[connection] = counts.get(connection, 0) + count
            position = record.after
        if len(self._chunks) != header.number("chunk_count") or (
            len(self._connections) != header.number("conn_count")
        ):
            raise ValueError("the index is not complete")
        return counts

    def _scan(self) -> Mapping[int, int]:
        """Find all chunks without an index, and count the messages.

        What is no record is left out up to the next place where one begins for sure.
        """
        counts: dict[int, int] = {}
        position, indexed = self._start, False
        try:
            while position < self._end:
                record = self._record_at(position)
                if record is None:
                    if self._read_at(position, len(MAGIC)) == MAGIC:
                        self._leave_out(position, self._end, "another bag begins there")
                        break
                    following = self._next_record(position + 1)
                    self._leave_out(position, following, "no whole record")
                    position = following
                    continue
                indexed |= record.op == OP_CHUNK_INFO
                if record.op == OP_CHUNK:
                    position = self._scan_chunk(position, record, counts)
                elif record.op == OP_MESSAGE:
                    position = self._add_messages(position, counts)
                else:
                    if record.op == OP_CONNECTION:
                        self._try_connection(record, self._data(record))
                    position = record.after
        except ContradictionError as error:
            self._leave_out(position, self._end, str(error))
        if not indexed:
            self.found.append("no index: the recording was interrupted, or its end is lost")
        return counts

    def _record_at(self, position: int) -> _Record | None:
        """Return the record that begins at an offset of the file.

        :returns: None if none does, or if it is not whole; the last chunk may be truncated.
        """
        try:
            record = self._record(position)
            plausible = _FIELDS[record.op] <= set(record.fields) and self._is_filled(record)
        except DAMAGE:
            return None
        return record if plausible and (record.whole or record.op == OP_CHUNK) else None

    def _is_filled(self, record: _Record) -> bool:
        """Return whether the data of a record have the size that its header implies."""
        if record.op == OP_INDEX:
            return record.size == record.number("count") * INDEX_ENTRY.itemsize
        if record.op == OP_CHUNK_INFO:
            return record.size == record.number("count") * _CHUNK_COUNT.size
        if record.op == OP_BAG_HEADER:
            return record.after <= _LARGEST_BAG_HEADER
        if record.op == OP_CONNECTION:
            return "type" in _fields(self._data(record), record.size)
        return True

    def _is_followed(self, position: int) -> bool:
        """Return whether a record begins at an offset that another one, or the end, follows."""
        record = self._record_at(position)
        return record is not None and (
            record.after >= self._end or self._record_at(record.after) is not None
        )

    def _next_record(self, position: int) -> int:
        """Return the next offset at which a record begins that another one follows."""
        offsets = self._offsets_of(_HEADS, position)
        return next(filter(self._is_followed, offsets), self._end)

    def _try_connection(self, record: _Record, data: bytes) -> None:
        """Note a connection; a damaged one is left out."""
        try:
            self._note_connection(record, data)
        except ContradictionError:
            raise
        except DAMAGE as error:
            self._leave_out(record.start, record.after, f"connection: {error}")

    def _scan_chunk(self, position: int, record: _Record, counts: dict[int, int]) -> int:
        """Register a chunk and count its messages; return the position where the scan goes on.

        The records of a damaged chunk without compression are scanned like messages outside
        chunks, so that only the damaged ones are lost.

        :param position: position of the chunk's record in the file.
        :param counts: numbers of messages by connection, to which those of the chunk are added.
        """
        is_last = record.whole or self._next_record(position + 1) == self._end
        is_uncompressed = record.fields["compression"] == b"none"
        problem = "" if record.whole else "cut off by the end of the file"
        data = b""
        try:
            data = self._chunk(position)[0]
        except DAMAGE as error:
            problem = str(error)
        records = list(_records(data))
        if is_uncompressed and (problem or not records or records[-1].after < len(data)):
            return record.start  # scan the records in the chunk one by one
        end = record.after
        if problem and not (data and is_last):
            if end != self._end and not self._is_followed(end):
                end = self._next_record(position + 1)
            messages = self._indexed_count(end)
            self._leave_out(position, end, f"chunk: {problem}", messages)
            return end
        self._add_scanned(_Chunk(position, 0, False), data, records, counts)
        if problem:
            message_count = sum(record.op == OP_MESSAGE for record in records)
            problem = f"chunk: {problem}; {message_count} messages before that are kept"
            self._leave_out(position, self._end, problem)
        elif not records or records[-1].after < len(data):
            kept_bytes = records[-1].after if records else 0
            problem = f"chunk: {len(data) - kept_bytes} of its {len(data)} bytes are no records"
            self._leave_out(position, end, problem)
        return end

    def _indexed_count(self, position: int) -> int:
        """Return how many messages the indexes at an offset name: those of the chunk before it."""
        entries = 0
        while (record := self._record_at(position)) and record.op == OP_INDEX:
            entries += record.number("count")
            position = record.after
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
            and record.op in (OP_MESSAGE, OP_CONNECTION)
        ):
            previous, end = end, record.after
        next_position = end
        if end < self._end and not self._record_at(end) and not self._is_cut(end):
            next_position = self._next_record(previous + 1)
            self._leave_out(previous, next_position, "no whole record")
            end = previous
        if end > position:
            chunk = _Chunk(position, 0, False, end - position)
            data = self._content(chunk)
            self._add_scanned(chunk, data, list(_records(data)), counts)
        return next_position

    def _is_cut(self, position: int) -> bool:
        """Return whether a message begins here that the end of the file cuts off."""
        try:
            record = self._record(position)
        except DAMAGE:
            return self._end - position < _MESSAGE_HEAD_BYTES
        whole = _FIELDS[OP_MESSAGE] <= set(record.fields)
        return whole and self._next_record(position + 1) == self._end

    def _add_scanned(
        self, chunk: _Chunk, data: bytes, records: Sequence[_Record], counts: dict[int, int]
    ) -> None:
        """Note a chunk without index, its connections, and the number of its messages."""
        times = []
        for record in records:
            if record.op == OP_CONNECTION:
                self._try_connection(record, data[record.start : record.after])
            elif record.op == OP_MESSAGE and _FIELDS[OP_MESSAGE] <= set(record.fields):
                connection = record.number("conn")
                counts[connection] = counts.get(connection, 0) + 1
                times.append(record.time("time"))
        if times:
            self._chunks.append(chunk._replace(start_ns=min(times)))

    def _record(self, position: int) -> _Record:
        """Return the record at an offset of the file.

        :raises ValueError: if there is no record header.
        """
        (length,) = struct.unpack("<I", self._read_at(position, 4))
        if length > _LONGEST_HEADER:
            raise ValueError("not a record")
        head = self._read_at(position + 4, length + 4)
        fields = _fields(head[:length], length)
        (size,) = struct.unpack("<I", head[length:])
        start = position + 8 + length
        return _Record(fields, start, size, start + size <= self._end)

    def _data(self, record: _Record) -> bytes:
        """Return the data of a record in the file."""
        return self._read_at(record.start, record.size)

    def _note_connection(self, record: _Record, data: bytes) -> None:
        """Register topic, type and definition of a connection."""
        details = _fields(data, len(data))
        # The data has the name before remapping; the header's is the one that counts.
        id_ = record.number("conn")
        connection = _Connection(
            topic=record.fields["topic"].decode(),
            type_name=ros2_name(details["type"].decode()),
            schema=Schema(
                details["message_definition"].decode("utf-8", "replace"),
                details["md5sum"].decode(),
            ),
            is_latched=details.get("latching") == b"1",
        )
        previous = self._connections.get(id_, connection)
        if (previous.topic, previous.type_name) != (connection.topic, connection.type_name):
            raise ContradictionError(
                f"connection {id_} is {connection.topic} from here on, and {previous.topic} before"
            )
        self._connections[id_] = connection

    def _name_topics(self, counts: Mapping[int, int]) -> None:
        """Make a topic of all connections with the same name and type.

        :param counts: numbers of messages by the ids of connections.
        """
        groups: dict[tuple[str, str], list[int]] = {}
        for id_, count in counts.items():
            if count and id_ not in self._connections:
                self._leave_out_messages(count, f"the definition of connection {id_} is lost")
        for id_, connection in self._connections.items():
            groups.setdefault((connection.topic, connection.type_name), []).append(id_)
        for (name, type_name), ids in groups.items():
            connection = self._connections[ids[0]]
            qos = Qos(durability="transient_local") if connection.is_latched else Qos()
            count = sum(counts.get(id_, 0) for id_ in ids)
            topic = TopicInfo(name, type_name, count, connection.schema, (qos,))
            self.topics.append(topic)
            self._topic_of.update(dict.fromkeys(ids, topic))

    def _chunk(self, position: int) -> tuple[bytes, int]:
        """Return the content of a chunk, and the offset of the record behind it."""
        record = self._record(position)
        if record.op != OP_CHUNK:
            raise ValueError("there is no chunk")
        compression = record.fields["compression"].decode()
        torn = not record.whole
        data = decompress(self._data(record), compression, record.number("size"), torn)
        return data, record.after

    def _content(self, chunk: _Chunk) -> bytes:
        """Return the content of a chunk, or of messages outside chunks."""
        if not chunk.loose:
            return self._chunk(chunk.position)[0]
        return self._read_at(chunk.position, chunk.loose)

    def _blocks(
        self, chunk: _Chunk, topics_by_connection: Mapping[int, TopicInfo]
    ) -> list[MessageBlock]:
        """Return the messages of a chunk, in blocks of one topic each."""
        if chunk.indexed:
            content, index_position = self._chunk(chunk.position)
            index = self._read_chunk_index(index_position)
        else:
            content = self._content(chunk)
            index = _scan_records(content)
        data = np.frombuffer(content, np.uint8)
        return [
            _block(topics_by_connection[connection], data, entries)
            for connection, entries in index.items()
            if connection in topics_by_connection and len(entries)
        ]

    def _read_chunk_index(self, position: int) -> dict[int, NDArray[np.void]]:
        """Return the index records that follow a chunk, by connection."""
        entries_by_connection: dict[int, list[NDArray[np.void]]] = {}
        while position < self._end:
            record = self._record(position)
            if record.op != OP_INDEX:
                break
            entries = np.frombuffer(self._data(record), INDEX_ENTRY, record.number("count"))
            entries_by_connection.setdefault(record.number("conn"), []).append(entries)
            position = record.after
        return {
            connection: np.concatenate(parts) for connection, parts in entries_by_connection.items()
        }


def _block(topic: TopicInfo, data: Bytes, entries: NDArray[np.void]) -> MessageBlock:
    """Return the messages whose records begin at an index's offsets."""
    t_ns = entries["sec"].astype(np.int64) * NANOSECONDS_PER_SECOND + entries["nanosec"]
    offsets = entries["offset"].astype(np.int64)
    after_header = offsets + 4 + _numbers(data, offsets)
    sizes = _numbers(data, after_header)
    return MessageBlock(topic, t_ns, gather_messages(data, after_header + 4, sizes))


def _numbers(data: Bytes, offsets: Integers) -> Integers:
    """Return the four-byte numbers at given offsets."""
    rows = gather_messages(data, offsets, np.full(len(offsets), 4, dtype=np.int64))
    return np.ascontiguousarray(rows).view("<u4")[:, 0].astype(np.int64)


def _scan_records(data: bytes) -> dict[int, NDArray[np.void]]:
    """Return the index of a chunk, found by going from record to record."""
    rows_by_connection: dict[int, list[tuple[int, int, int]]] = {}
    for record in _records(data):
        if record.op == OP_MESSAGE and _FIELDS[OP_MESSAGE] <= set(record.fields):
            second, nanosecond = struct.unpack("<II", record.fields["time"][:8])
            header = sum(len(name) + len(value) + 5 for name, value in record.fields.items())
            offset = record.start - 8 - header
            rows_by_connection.setdefault(record.number("conn"), []).append(
                (second, nanosecond, offset)
            )
    return {
        connection: np.array(rows, INDEX_ENTRY) for connection, rows in rows_by_connection.items()
    }


def _records(data: bytes) -> Iterator[_Record]:
    """Yield the complete records of a chunk, up to the first malformed one."""
    position = 0
    while position + 4 <= len(data):
        (length,) = struct.unpack_from("<I", data, position)
        start = position + 8 + length
        if start > len(data):
            return
        (size,) = struct.unpack_from("<I", data, start - 4)
        if start + size > len(data):
            return
        try:
            fields = _fields(data[position + 4 : start - 4], length)
        except (ValueError, struct.error):
            return
        if len(fields.get("op", b"")) != 1:
            return
        yield _Record(fields, start, size, True)
        position = start + size


def _fields(data: bytes, length: int) -> dict[str, bytes]:
    """Return the fields of a record header.

    :raises ValueError: if the header is torn or is none.
    """
    if len(data) != length:
        raise ValueError("a record header is truncated")
    fields = {}
    position = 0
    while position < length:
        (size,) = struct.unpack_from("<I", data, position)
        name, equals, value = data[position + 4 : position + 4 + size].partition(b"=")
        if not equals or position + 4 + size > length:
            raise ValueError("not a record header")
        fields[name.decode()] = value
        position += 4 + size
    return fields
