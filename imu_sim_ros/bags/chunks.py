# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Writers of chunked containers: blocks of messages become chunks of records, built by NumPy."""

from abc import abstractmethod
from collections.abc import Sequence
from contextlib import suppress
from itertools import pairwise
from pathlib import Path
from typing import Any, Final, NamedTuple

import numpy as np

from imu_sim_ros.bags.atomic_file import OutputFile
from imu_sim_ros.bags.messages import Bytes, Payloads, Times, as_list
from imu_sim_ros.bags.writer import Block, Topic, Writer, tally, time_order
from imu_sim_ros.errors import InputError

CHUNK_BYTES: Final = 1 << 20


class Indexed(NamedTuple):
    """The messages of one topic in a chunk."""

    topic: Topic
    t_ns: Times
    offsets: Times
    """Where the records start in the chunk."""


class _Mark(NamedTuple):
    """How far a file is whole."""

    position: int
    chunks: int
    counts: list[tuple[int, int, int]]
    """Of each topic: messages, first and last time."""


class ChunkWriter(Writer):
    """Collects messages until a chunk is full; containers say what a record and a chunk are."""

    def __init__(self, path: Path, renamed: bool) -> None:
        super().__init__(path)
        self.file = OutputFile(path, renamed)
        self._pending: list[Block] = []
        self._pending_bytes = 0
        self._raw: list[tuple[Topic, int, bytes]] = []
        self._written: list[Any] = []
        """What the containers note about every chunk."""
        self._emitting = False
        self._mark = _Mark(0, 0, [])

    @abstractmethod
    def _records(self, topic: Topic, first: int, t_ns: Times, payloads: Bytes) -> Bytes:
        """Return messages of equal size as records (n, record size).

        :param first: how many messages of the topic were written before.
        """

    @abstractmethod
    def _record(self, topic: Topic, index: int, t_ns: int, payload: bytes) -> bytes:
        """Return one message as a record."""

    @abstractmethod
    def _write_chunk(self, records: Bytes, messages: Sequence[Indexed]) -> None:
        """Write records (bytes,) as a chunk with its index; offsets count from the first record."""

    @abstractmethod
    def _finish(self) -> None:
        """Write what follows the last chunk."""

    @property
    def size(self) -> int:
        """Bytes in the file, with what waits in memory."""
        return self.file.position + self._pending_bytes

    @property
    def files(self) -> list[Path]:
        """The file, by the name that it has now."""
        return [self.file.current]

    def write_blocks(self, blocks: Sequence[Block]) -> None:
        """Write the messages of several topics, ordered by record time among each other."""
        self._collect_raw()
        for block in (block for block in blocks if len(block.t_ns)):
            self._pending.append(block)
            self._pending_bytes += _bytes(block.payloads)
        if self._pending_bytes >= CHUNK_BYTES:
            self._emit()

    def write_raw(self, topic: Topic, t_ns: int, payload: bytes) -> None:
        """Write one message."""
        self._raw.append((topic, t_ns, payload))
        self._pending_bytes += len(payload)
        if self._pending_bytes >= CHUNK_BYTES:
            self._collect_raw()
            self._emit()

    def flush(self, durable: bool = False) -> None:
        """Write what waits in memory as a chunk of its own."""
        self._collect_raw()
        self._emit()
        if durable:
            self.file.sync()

    def close(self) -> None:
        """Write the last chunk and the index; give the file its name."""
        self.flush()
        self._finish()
        self.file.finish()

    def abandon(self) -> list[Path]:
        """Finish the file where that is still possible; it keeps the name of a part."""
        self._pending, self._raw, self._pending_bytes = [], [], 0
        with suppress(InputError):  # without an index the chunks are complete all the same
            self._finish()
        self.file.abandon(empty=not self.count)
        return [self.file.current] if self.count else []

    def stop(self) -> None:
        """Finish with all whole chunks, and with what waits where no chunk was being written."""
        if self.file.closed:
            return
        if self._emitting:
            self.file.cut(self._mark.position)
            del self._written[self._mark.chunks :]
            for topic, (count, first_ns, last_ns) in zip(
                self.topics, self._mark.counts, strict=False
            ):
                topic.count, topic.first_ns, topic.last_ns = count, first_ns, last_ns
            self._pending, self._raw, self._pending_bytes = [], [], 0
        self.flush()
        if self.count:
            self.close()
        else:
            self.file.abandon(empty=True)

    def _collect_raw(self) -> None:
        """Turn single messages into blocks, one for each topic."""
        by_topic: dict[Topic, tuple[list[int], list[bytes]]] = {}
        for topic, t_ns, payload in self._raw:
            times, payloads = by_topic.setdefault(topic, ([], []))
            times.append(t_ns)
            payloads.append(payload)
        self._raw = []
        for topic, (times, payloads) in by_topic.items():
            self._pending.append(Block(topic, np.array(times, dtype=np.int64), payloads))

    def _emit(self) -> None:
        """Write everything that waits, in chunks of about equal size."""
        blocks = self._pending
        self._pending, self._pending_bytes = [], 0
        if not blocks:
            return
        self._note()
        self._emitting = True
        if _simultaneous(blocks):
            self._emit_rows(blocks)
        else:
            self._emit_merged(blocks)
        self._emitting = False

    def _note(self) -> None:
        """Remember how far everything is whole."""
        counts = [(topic.count, topic.first_ns, topic.last_ns) for topic in self.topics]
        self._mark = _Mark(self.file.position, len(self._written), counts)

    def _emit_rows(self, blocks: Sequence[Block]) -> None:
        """Write blocks of different topics with the same times: one message of each in turn."""
        t_ns = blocks[0].t_ns
        row_bytes = sum(_bytes(block.payloads) for block in blocks) // len(t_ns)
        parts = max(1, round(len(t_ns) * row_bytes / CHUNK_BYTES))
        edges = np.linspace(0, len(t_ns), parts + 1).astype(int).tolist()
        for start, stop in pairwise(edges):
            chunk = [
                Block(topic, times[start:stop], payloads[start:stop])
                for topic, times, payloads in blocks
            ]
            tables = [
                self._records(topic, topic.count, times, payloads)
                for topic, times, payloads in chunk
                if not isinstance(payloads, list)
            ]
            table = tables[0] if len(tables) == 1 else np.concatenate(tables, axis=1)
            first = np.cumsum([0, *(records.shape[1] for records in tables[:-1])])
            rows = np.arange(stop - start, dtype=np.int64) * table.shape[1]
            index = [
                Indexed(block.topic, block.t_ns, rows + offset)
                for block, offset in zip(chunk, first.tolist(), strict=True)
            ]
            self._write_chunk(table.reshape(-1), index)
            tally(chunk)
            self._note()

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
            self._write_chunk(chunk, index)
            for topic, times, _ in index:
                topic.add(len(times), int(times.min()), int(times.max()))
            self._note()
            start = stop

    def _record_list(
        self, topic: Topic, first: int, t_ns: Times, payloads: Payloads
    ) -> list[bytes]:
        if isinstance(payloads, list):
            return [
                self._record(topic, first + k, time, payload)
                for k, (time, payload) in enumerate(zip(t_ns.tolist(), payloads, strict=True))
            ]
        return as_list(self._records(topic, first, t_ns, payloads))


def _bytes(payloads: Payloads) -> int:
    return sum(map(len, payloads)) if isinstance(payloads, list) else payloads.size


def _simultaneous(blocks: Sequence[Block]) -> bool:
    """Return whether blocks are of different topics, of constant sizes and have ordered times."""
    t_ns = blocks[0].t_ns
    return (
        len({block.topic for block in blocks}) == len(blocks)
        and not any(isinstance(block.payloads, list) for block in blocks)
        and all(np.array_equal(block.t_ns, t_ns) for block in blocks[1:])
        and bool(np.all(t_ns[1:] >= t_ns[:-1]))
    )
