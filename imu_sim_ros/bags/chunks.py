# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Chunked containers: blocks of messages become chunks of records by time, built by NumPy."""

from abc import abstractmethod
from collections.abc import Iterator, Sequence
from contextlib import suppress
from itertools import pairwise
from pathlib import Path
from typing import Final, NamedTuple

import numpy as np

from imu_sim_ros.bags.messages.blocks import RowTemplate, as_list, as_row_template, interleave
from imu_sim_ros.bags.outputs import OutputFile
from imu_sim_ros.bags.threads import Pipeline, core_count
from imu_sim_ros.bags.writer import NO_FIRST_NS, NO_LAST_NS, BagTopic, Block, Writer, time_order
from imu_sim_ros.core.errors import InputError
from imu_sim_ros.core.types import Bytes, Integers, Times

CHUNK_BYTES: Final = 1 << 20
"""Bytes of messages from which on a chunk is written."""
_MAX_WORKERS: Final = 4
"""More than this the thread that writes cannot follow; each has a few chunks in memory."""


class Indexed(NamedTuple):
    """The messages of one topic in a chunk."""

    topic: BagTopic
    t_ns: Times
    offsets: Integers
    """Offsets of the records in the chunk."""


class Chunk(NamedTuple):
    """Records of some topics, one after the other."""

    records: Bytes
    messages: Sequence[Indexed]


class StoredTopic(NamedTuple):
    """Messages of a topic in a chunk."""

    topic: BagTopic
    messages: int
    """Number of the messages."""
    first_ns: int
    """Their earliest record time [ns]."""
    last_ns: int
    """Their latest record time [ns]."""


class Stored(NamedTuple):
    """A chunk in the file."""

    position: int
    """Offset of the chunk in the file."""
    sizes: Sequence[int]
    """Bytes of its parts: its head, its content, and the index of each topic."""
    whole: int
    """Bytes of its records, uncompressed."""
    topics: Sequence[StoredTopic]

    @property
    def first_ns(self) -> int:
        """Earliest record time of its messages [ns]."""
        return min(stored.first_ns for stored in self.topics)

    @property
    def last_ns(self) -> int:
        """Latest record time of its messages [ns]."""
        return max(stored.last_ns for stored in self.topics)


class Simultaneous(NamedTuple):
    """Records of topics with the same times: row k has those of time k, side by side."""

    t_ns: Times
    topics: list[tuple[BagTopic, int]]
    """Topics and the bytes of a record."""
    rows: list[RowTemplate]
    """Header and message of each topic."""


class ChunkWriter(Writer):
    """Collects messages until a chunk is full; containers define records and chunks."""

    def __init__(self, path: Path, compression: str, renamed: bool) -> None:
        super().__init__(path)
        self._compression = compression
        self.file = OutputFile(path, renamed)
        self._pending: list[tuple[BagTopic, Times, list[bytes] | RowTemplate]] = []
        self._pending_bytes = 0
        self._written: list[Stored] = []
        self._emitting = False
        self._finishing: int | None = None
        """Byte at which the file's end begins, once it is being written."""
        self._mark = (0, 0)
        """Bytes and chunks up to which the file is whole."""
        self._before = b""
        """Bytes in front of the records of the next chunk."""
        self._pipeline: Pipeline[Chunk, Sequence[bytes | memoryview]] | None = None
        """Threads that take the chunks, once a file has as much as one; a small file does without.

        They leave half of the time to the thread that writes, even without compression.
        """

    @abstractmethod
    def _records(
        self, topic: BagTopic, start: int, t_ns: Times, payloads: RowTemplate
    ) -> list[RowTemplate]:
        """Return messages of equal size as records: the parts of each record, side by side.

        :param start: number of messages of the topic that were written before.
        """

    @abstractmethod
    def _record(self, topic: BagTopic, index: int, t_ns: int, payload: bytes) -> bytes:
        """Return one message as a record."""

    @abstractmethod
    def _pack(self, chunk: Chunk) -> Sequence[bytes | memoryview]:
        """Return a chunk's head, content and indexes; runs in several threads.

        The offsets of the messages count from the first byte of the chunk.
        """

    @abstractmethod
    def _finish(self) -> None:
        """Write everything after the last chunk."""

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
        for topic, t_ns, payloads in (block for block in blocks if len(block.t_ns)):
            if isinstance(payloads, list):
                self._pending.append((topic, t_ns, payloads))
                self._pending_bytes += sum(map(len, payloads))
            else:
                rows = as_row_template(payloads)
                self._pending.append((topic, t_ns, rows))
                self._pending_bytes += rows.count * len(rows.template)
        if self._pending_bytes >= CHUNK_BYTES:
            if self._pipeline is None:
                workers = (
                    1 if self._compression in ("", "none") else min(core_count(), _MAX_WORKERS)
                )
                self._pipeline = Pipeline(self._pack, self._store, workers)
            self._emit()

    def flush(self, durable: bool = False) -> None:
        """Write the messages in memory as a chunk of their own."""
        self._emit()
        self._wait()
        if durable:
            self.file.sync()

    def close(self) -> None:
        """Write the last chunk and the index; give the file its name."""
        self.flush()
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
        """Remove an incomplete chunk from the file, and all messages in memory."""
        self._pending, self._pending_bytes = [], 0
        position, chunks = self._mark
        self.file.cut(position)
        del self._written[chunks:]
        for topic in self.topics:
            topic.count, topic.first_ns, topic.last_ns = 0, NO_FIRST_NS, NO_LAST_NS
        for chunk in self._written:
            for stored in chunk.topics:
                stored.topic.add(stored.messages, stored.first_ns, stored.last_ns)

    def _wait(self) -> None:
        """Wait until the chunks so far are in the file."""
        if self._pipeline is not None:
            self._pipeline.wait()

    def _end_threads(self) -> None:
        """End the threads that compress, if any were started."""
        if self._pipeline is not None:
            self._pipeline.close()
            self._pipeline = None

    def _emit(self) -> None:
        """Write everything in memory, in chunks of about equal size."""
        blocks = self._pending
        self._pending, self._pending_bytes = [], 0
        if not blocks:
            return
        self._emitting = True
        in_order = [
            (topic, t_ns, payloads)
            for topic, t_ns, payloads in blocks
            if isinstance(payloads, RowTemplate) and bool(np.all(t_ns[1:] >= t_ns[:-1]))
        ]
        by_rows = len({topic for topic, _, _ in in_order}) == len(blocks)
        for message_chunk in (
            self._interleave_rows(in_order) if by_rows else self._interleave_messages(blocks)
        ):
            chunk = _prepend(self._before, message_chunk) if self._before else message_chunk
            self._before = b""
            for topic, t_ns, _ in chunk.messages:
                topic.add(len(t_ns), int(t_ns.min()), int(t_ns.max()))
            if self._pipeline is None:
                self._store(chunk, self._pack(chunk))
            else:
                self._pipeline.give(chunk)
        self._emitting = False

    def _store(self, chunk: Chunk, parts: Sequence[bytes | memoryview]) -> None:
        """Write a chunk at the end of the file, and remember that everything is whole up to it."""
        position = self.file.position
        self.file.write(*parts)
        topics = [
            StoredTopic(topic, len(t_ns), int(t_ns.min()), int(t_ns.max()))
            for topic, t_ns, _ in chunk.messages
        ]
        sizes = [len(part) for part in parts]
        self._written.append(Stored(position, sizes, len(chunk.records), topics))
        self._mark = (self.file.position, len(self._written))

    def _interleave_rows(
        self, blocks: Sequence[tuple[BagTopic, Times, RowTemplate]]
    ) -> Iterator[Chunk]:
        """Yield chunks of blocks of different topics, each in the order of time.

        Each chunk covers a span of time; all have about equal size.
        """
        tables: list[Simultaneous] = []
        for topic, t_ns, payloads in blocks:
            records = self._records(topic, topic.count, t_ns, payloads)
            size = sum(len(part.template) for part in records)
            increases = bool(np.all(t_ns[1:] > t_ns[:-1]))  # rows of equal times would mix
            if tables and increases and np.array_equal(tables[-1].t_ns, t_ns):
                tables[-1].topics.append((topic, size))
                tables[-1].rows.extend(records)
            else:
                tables.append(Simultaneous(t_ns, [(topic, size)], records))
        total = sum(len(table.t_ns) * size for table in tables for _, size in table.topics)
        longest = max((table.t_ns for table in tables), key=len)
        count = min(max(1, round(total / CHUNK_BYTES)), len(longest))
        begins = longest[np.linspace(0, len(longest), count + 1).astype(int)[1:-1]]
        cuts = [
            pairwise([0, *np.searchsorted(table.t_ns, begins).tolist(), len(table.t_ns)])
            for table in tables
        ]
        for spans in zip(*cuts, strict=True):
            parts = [
                (table, slice(begin, end))
                for table, (begin, end) in zip(tables, spans, strict=True)
                if end > begin
            ]
            if parts:  # of equal stamps, one piece has all
                yield merge_tables(parts)

    def _interleave_messages(
        self, blocks: Sequence[tuple[BagTopic, Times, list[bytes] | RowTemplate]]
    ) -> Iterator[Chunk]:
        """Yield chunks of any blocks, message by message in the order of time."""
        message_counts = {topic: topic.count for topic, _, _ in blocks}
        records: list[bytes] = []
        for topic, times, payloads in blocks:
            first_index = message_counts[topic]
            message_counts[topic] += len(times)
            if isinstance(payloads, RowTemplate):
                records += as_list(interleave(self._records(topic, first_index, times, payloads)))
                continue
            records += [
                self._record(topic, first_index + k, time, payload)
                for k, (time, payload) in enumerate(zip(times.tolist(), payloads, strict=True))
            ]
        order = time_order([times for _, times, _ in blocks])
        t_ns = np.concatenate([times for _, times, _ in blocks])[order]
        counts = [len(times) for _, times, _ in blocks]
        owner = np.repeat([topic.index for topic, _, _ in blocks], counts)[order]
        records = [records[k] for k in order.tolist()]
        sizes = np.array([len(record) for record in records], dtype=np.int64)
        ends = np.cumsum(sizes)
        start = 0
        while start < len(records):
            base = int(ends[start] - sizes[start])
            stop = max(start + 1, int(np.searchsorted(ends, base + CHUNK_BYTES, side="right")))
            part = slice(start, stop)
            messages = [
                Indexed(self.topics[k], t_ns[part][owner[part] == k], offsets)
                for k in np.unique(owner[part]).tolist()
                for offsets in [(ends[part] - sizes[part] - base)[owner[part] == k]]
            ]
            yield Chunk(np.frombuffer(b"".join(records[part]), np.uint8), messages)
            start = stop


def _prepend(records: bytes, chunk: Chunk) -> Chunk:
    """Return a chunk with records without messages, such as connections, in front of its own."""
    return Chunk(
        np.concatenate([np.frombuffer(records, np.uint8), chunk.records]),
        [Indexed(topic, t_ns, offsets + len(records)) for topic, t_ns, offsets in chunk.messages],
    )


def merge_tables(tables: Sequence[tuple[Simultaneous, slice]]) -> Chunk:
    """Return rows of tables by time; of equal times those of the first table first.

    Consecutive rows of one table, a run, are copied at once.

    :param tables: records of each table, and the rows that are taken.
    """
    times = [table.t_ns[rows] for table, rows in tables]
    content = [interleave(table.rows, rows) for table, rows in tables]
    widths = np.array([rows.shape[1] for rows in content])
    if len(tables) == 1:
        records = content[0].reshape(-1)
        positions = [widths[0] * np.arange(len(times[0]))]
    else:
        counts = [len(t_ns) for t_ns in times]
        order = time_order(times)
        # For each row of the chunk: index of its table, row in that table, end in the chunk.
        owner = np.repeat(np.arange(len(tables)), counts)[order]
        row = order - np.cumsum([0, *counts[:-1]])[owner]
        ends = np.cumsum(widths[owner])
        positions = [(ends - widths[owner])[owner == k] for k in range(len(tables))]
        # For each run: its first row, its table, and its bytes in that table.
        starts = np.flatnonzero(np.concatenate([[True], owner[1:] != owner[:-1]]))
        last_rows = np.append(starts[1:], len(owner)) - 1
        sources = owner[starts]
        run_begins = (row[starts] * widths[sources]).tolist()
        run_ends = ((row[last_rows] + 1) * widths[sources]).tolist()
        memory = [memoryview(rows.reshape(-1).data) for rows in content]
        runs = zip(sources.tolist(), run_begins, run_ends, strict=True)
        record_bytes = b"".join([memory[k][begin:end] for k, begin, end in runs])
        records = np.frombuffer(record_bytes, np.uint8)
    messages = []
    for (table, _), t_ns, offsets in zip(tables, times, positions, strict=True):
        for topic, size in table.topics:
            messages.append(Indexed(topic, t_ns, offsets))
            offsets = offsets + size
    return Chunk(records, messages)
