# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Chunked containers: blocks of messages become chunks of records by time, built by NumPy."""

from abc import abstractmethod
from collections.abc import Iterator, Sequence
from contextlib import suppress
from itertools import pairwise
from pathlib import Path
from typing import Any, Final, NamedTuple

import numpy as np

from imu_sim_ros.bags.messages.blocks import (
    Payloads,
    RowTemplate,
    as_list,
    as_row_template,
    side_by_side,
)
from imu_sim_ros.bags.messages.schemas import Schema
from imu_sim_ros.bags.outputs import OutputFile
from imu_sim_ros.bags.threads import Pipeline
from imu_sim_ros.bags.writer import BagTopic, Block, Writer, time_order
from imu_sim_ros.errors import InputError
from imu_sim_ros.machine import cores
from imu_sim_ros.types import Bytes, Integers, Times

CHUNK_BYTES: Final = 1 << 20
_MAX_WORKERS: Final = 4
"""More than this the thread that writes cannot follow; each has a few chunks in memory."""


class Records(NamedTuple):
    """n messages of one topic as records of equal size, in the order of time."""

    topic: BagTopic
    t_ns: Times
    rows: RowTemplate


class Indexed(NamedTuple):
    """The messages of one topic in a chunk."""

    topic: BagTopic
    t_ns: Times
    offsets: Integers
    """Offsets of the records in the chunk."""


_Counts = list[tuple[int, int, int]]
"""Messages, first and last time of each topic."""


class _Mark(NamedTuple):
    """The state of a file up to which it is complete."""

    position: int
    chunks: int
    counts: _Counts


class _Chunk(NamedTuple):
    """A chunk on its way into the file."""

    records: Bytes
    messages: Sequence[Indexed]
    counts: _Counts
    """This chunk included."""


class ChunkWriter(Writer):
    """Collects messages until a chunk is full; containers define records and chunks."""

    def __init__(self, path: Path, compression: str, renamed: bool) -> None:
        super().__init__(path)
        self._compression = compression
        self.file = OutputFile(path, renamed)
        self._pending: list[Block] = []
        self._pending_bytes = 0
        self._raw: list[tuple[BagTopic, int, bytes]] = []
        self._written: list[Any] = []
        """Index of every chunk, as the containers record it."""
        self._emitting = False
        self._finishing: int | None = None
        """Where the file's end begins, once that is being written."""
        self._mark = _Mark(0, 0, [])
        self._before = b""
        """What stands before the records of the next chunk."""
        self._pipeline: Pipeline[_Chunk, tuple[_Counts, Any]] | None = None

    @abstractmethod
    def _records(
        self, topic: BagTopic, first: int, t_ns: Times, payloads: RowTemplate
    ) -> RowTemplate:
        """Return messages of equal size as records.

        :param first: how many messages of the topic were written before.
        """

    @abstractmethod
    def _record(self, topic: BagTopic, index: int, t_ns: int, payload: bytes) -> bytes:
        """Return one message as a record."""

    @abstractmethod
    def _pack(self, records: Bytes, messages: Sequence[Indexed]) -> Any:
        """Return records (bytes,) as a chunk with its index; runs in several threads.

        The offsets of the messages count from the first byte of the chunk.
        """

    @abstractmethod
    def _store(self, packed: Any) -> None:
        """Write a chunk at the end of the file and note it."""

    @abstractmethod
    def _finish(self) -> None:
        """Write everything after the last chunk."""

    def add_topic(
        self,
        name: str,
        type_name: str,
        qos: Sequence[Any] | None = None,
        definition: Schema | None = None,
        keeps_seq: bool = False,
    ) -> BagTopic:
        """Return the handle of a new topic; its description follows the chunks so far."""
        self._wait()
        topic = super().add_topic(name, type_name, qos, definition, keeps_seq)
        self._mark = _Mark(self.file.position, len(self._written), self._counts())
        return topic

    @property
    def size(self) -> int:
        """Bytes in the file and in memory."""
        self._wait()
        return self.file.position + self._pending_bytes

    @property
    def files(self) -> list[Path]:
        """The file, by its current name."""
        return [self.file.current]

    def write_blocks(self, blocks: Sequence[Block]) -> None:
        """Write the messages of several topics, ordered by record time among each other."""
        if self._raw:
            self._collect_raw()
        for block in (block for block in blocks if len(block.t_ns)):
            self._pending.append(block)
            many = block.payloads
            self._pending_bytes += sum(map(len, many)) if isinstance(many, list) else many.size
        if self._pending_bytes >= CHUNK_BYTES:
            self._emit(in_threads=True)

    def write_raw(self, topic: BagTopic, t_ns: int, payload: bytes) -> None:
        """Write one message."""
        self._raw.append((topic, t_ns, payload))
        self._pending_bytes += len(payload)
        if self._pending_bytes >= CHUNK_BYTES:
            self._collect_raw()
            self._emit(in_threads=True)

    def flush(self, durable: bool = False) -> None:
        """Write the messages in memory as a chunk of their own."""
        self._write_rest()
        if durable:
            self.file.sync()

    def _write_rest(self) -> None:
        self._collect_raw()
        self._emit()
        self._wait()

    def close(self) -> None:
        """Write the last chunk and the index; give the file its name."""
        self._write_rest()
        self._end_threads()
        self._finishing = self.file.position
        self._finish()
        self.file.finish()

    def abandon(self) -> list[Path]:
        """Finish the file if that is still possible; it keeps its partial name."""
        self._end_threads()
        self._return_to_mark()
        with suppress(InputError):  # without an index the chunks are complete all the same
            self._finish()
        self.file.abandon(empty=not self.count)
        return [self.file.current] if self.count else []

    def stop(self) -> None:
        """Finish with all whole chunks, and those in memory if no chunk was being written."""
        if self.file.closed:
            return
        emitting = self._emitting
        self._end_threads()
        if self._finishing is not None:
            self.file.cut(self._finishing)
        elif emitting:
            self._return_to_mark()
        self.flush()
        if self.count:
            self.close()
        else:
            self.file.abandon(empty=True)

    def _return_to_mark(self) -> None:
        """Remove an incomplete chunk from the file."""
        self._pending, self._raw, self._pending_bytes = [], [], 0
        self.file.cut(self._mark.position)
        del self._written[self._mark.chunks :]
        for topic, (count, first_ns, last_ns) in zip(self.topics, self._mark.counts, strict=False):
            topic.count, topic.first_ns, topic.last_ns = count, first_ns, last_ns

    def _collect_raw(self) -> None:
        """Turn single messages into blocks, one for each topic."""
        by_topic: dict[BagTopic, tuple[list[int], list[bytes]]] = {}
        for topic, t_ns, payload in self._raw:
            times, payloads = by_topic.setdefault(topic, ([], []))
            times.append(t_ns)
            payloads.append(payload)
        self._raw = []
        for topic, (times, payloads) in by_topic.items():
            self._pending.append(Block(topic, np.array(times, dtype=np.int64), payloads))

    def _emit(self, in_threads: bool = False) -> None:
        """Write everything in memory, in chunks of about equal size.

        :param in_threads: threads, which cost a little, take the chunks from now on; the last chunk
            of a small file, and those that are flushed one by one, do without.
        """
        if in_threads and self._pipeline is None:
            # A checksum alone is quick, and quickest where the records are still in the cache.
            workers = min(cores(), _MAX_WORKERS) if self._compression not in ("", "none") else 0
            self._pipeline = Pipeline(self._packed, self._keep, workers)
        blocks = self._pending
        self._pending, self._pending_bytes = [], 0
        if not blocks:
            return
        self._emitting = True
        if _mergeable(blocks):
            records = [
                Records(topic, t_ns, self._records(topic, topic.count, t_ns, as_row_template(many)))
                for topic, t_ns, many in blocks
                if not isinstance(many, list)
            ]
            for part in parts(records, CHUNK_BYTES):
                content, index = merged(part)
                for topic, t_ns, _ in index:
                    topic.add(len(t_ns), int(t_ns[0]), int(t_ns[-1]))
                self._hand_over(content, index)
        else:
            self._emit_merged(blocks)
        self._emitting = False

    def _wait(self) -> None:
        """Wait until the chunks so far are in the file."""
        if self._pipeline is not None:
            self._pipeline.wait()

    def _end_threads(self) -> None:
        if self._pipeline is not None:
            self._pipeline.close()
            self._pipeline = None

    def _counts(self) -> _Counts:
        return [(topic.count, topic.first_ns, topic.last_ns) for topic in self.topics]

    def _hand_over(self, records: Bytes, messages: Sequence[Indexed]) -> None:
        """Let a chunk be written."""
        if before := self._before:
            self._before = b""
            records = np.concatenate([np.frombuffer(before, np.uint8), records])
            messages = [Indexed(t, t_ns, offsets + len(before)) for t, t_ns, offsets in messages]
        chunk = _Chunk(records, messages, self._counts())
        if self._pipeline is None:
            self._keep(self._packed(chunk))
        else:
            self._pipeline.give(chunk)

    def _packed(self, chunk: _Chunk) -> tuple[_Counts, Any]:
        return chunk.counts, self._pack(chunk.records, chunk.messages)

    def _keep(self, made: tuple[_Counts, Any]) -> None:
        """Write a chunk, and remember that everything is whole up to here."""
        counts, packed = made
        self._store(packed)
        self._mark = _Mark(self.file.position, len(self._written), counts)

    def _emit_merged(self, blocks: Sequence[Block]) -> None:
        """Write any blocks, message by message in the order of time."""
        before = {block.topic: block.topic.count for block in blocks}
        records: list[bytes] = []
        for topic, times, payloads in blocks:
            records += self._record_list(topic, before[topic], times, payloads)
            before[topic] += len(times)
        order = time_order([block.t_ns for block in blocks])
        t_ns = np.concatenate([block.t_ns for block in blocks])[order]
        owner = np.repeat(
            [block.topic.index for block in blocks], [len(block.t_ns) for block in blocks]
        )[order]
        records = [records[k] for k in order.tolist()]
        sizes = np.array([len(record) for record in records], dtype=np.int64)
        ends = np.cumsum(sizes)
        start = 0
        while start < len(records):
            base = int(ends[start] - sizes[start])
            stop = max(start + 1, int(np.searchsorted(ends, base + CHUNK_BYTES, side="right")))
            part = slice(start, stop)
            index = [
                Indexed(self.topics[k], t_ns[part][owner[part] == k], offsets)
                for k in np.unique(owner[part]).tolist()
                for offsets in [(ends[part] - sizes[part] - base)[owner[part] == k]]
            ]
            chunk = np.frombuffer(b"".join(records[part]), np.uint8)
            for topic, times, _ in index:
                topic.add(len(times), int(times.min()), int(times.max()))
            self._hand_over(chunk, index)
            start = stop

    def _record_list(
        self, topic: BagTopic, first: int, t_ns: Times, payloads: Payloads | RowTemplate
    ) -> list[bytes]:
        if isinstance(payloads, list):
            return [
                self._record(topic, first + k, time, payload)
                for k, (time, payload) in enumerate(zip(t_ns.tolist(), payloads, strict=True))
            ]
        return as_list(self._records(topic, first, t_ns, as_row_template(payloads)))


def _mergeable(blocks: Sequence[Block]) -> bool:
    """Return whether blocks are of different topics, of constant sizes and each in order."""
    return (
        len({block.topic for block in blocks}) == len(blocks)
        and not any(isinstance(block.payloads, list) for block in blocks)
        and all(bool(np.all(block.t_ns[1:] >= block.t_ns[:-1])) for block in blocks)
    )


def parts(records: Sequence[Records], size: int) -> Iterator[list[Records]]:
    """Yield records in pieces of time of about equal size [bytes]."""
    longest = max((one.t_ns for one in records), key=len)
    count = min(max(1, round(sum(one.rows.size for one in records) / size)), len(longest))
    inner = np.linspace(0, len(longest), count + 1).astype(int)[1:-1]
    edges = [np.searchsorted(one.t_ns, longest[inner]).tolist() for one in records]
    cuts = [pairwise([0, *own, len(one.t_ns)]) for own, one in zip(edges, records, strict=True)]
    for spans in zip(*cuts, strict=True):
        yield [
            Records(topic, t_ns[start:stop], rows[start:stop])
            for (topic, t_ns, rows), (start, stop) in zip(records, spans, strict=True)
            if stop > start
        ]


def merged(records: Sequence[Records]) -> tuple[Bytes, list[Indexed]]:
    """Return records by time, and where they are; of equal times those of the first topic first.

    Topics with the same times, as the readings and the truth of an IMU, are one table with rows
    side by side. Between tables, what follows each other from one of them is copied at once.
    """
    tables = _tables(records)
    rows = [side_by_side([one.rows for one in table]).array() for table in tables]
    counts = [len(one) for one in rows]
    order = time_order([table[0].t_ns for table in tables])
    owner = np.repeat(np.arange(len(tables)), counts)[order]
    row = order - np.cumsum([0, *counts[:-1]])[owner]
    widths = np.array([one.shape[1] for one in rows])
    ends = np.cumsum(widths[owner])
    begins = ends - widths[owner]
    index = []
    for k, table in enumerate(tables):
        offsets = begins[owner == k]
        for topic, t_ns, own in table:
            index.append(Indexed(topic, t_ns, offsets))
            offsets = offsets + own.shape[1]
    if len(tables) == 1:
        return rows[0].reshape(-1), index
    starts = np.flatnonzero(np.concatenate([[True], owner[1:] != owner[:-1]]))
    sources = owner[starts]
    first = (row[starts] * widths[sources]).tolist()
    last = ((row[np.append(starts[1:], len(owner)) - 1] + 1) * widths[sources]).tolist()
    content = [memoryview(one.reshape(-1).data) for one in rows]
    pieces = zip(sources.tolist(), first, last, strict=True)
    joined = b"".join([content[k][begin:end] for k, begin, end in pieces])
    return np.frombuffer(joined, np.uint8), index


def _tables(records: Sequence[Records]) -> list[list[Records]]:
    """Return neighbours with the same times together.

    Not if two times are equal: rows of equal times would mix.
    """
    tables: list[list[Records]] = []
    for one in records:
        increases = bool(np.all(one.t_ns[1:] > one.t_ns[:-1]))
        if tables and increases and np.array_equal(tables[-1][0].t_ns, one.t_ns):
            tables[-1].append(one)
        else:
            tables.append([one])
    return tables
