# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Bags of several files: splitting, and the folder of rosbag2 with its metadata."""

import os
import shutil
from collections.abc import Callable, Sequence
from itertools import pairwise
from pathlib import Path

import numpy as np

from imu_sim_ros.bags.messages.blocks import RowTemplate
from imu_sim_ros.bags.outputs import make_locked_folder
from imu_sim_ros.bags.writer import (
    MAX_PARTS,
    METADATA_FILE,
    BagTopic,
    Block,
    Writer,
    count_messages,
    rosbag2_metadata,
    time_order,
)
from imu_sim_ros.core.errors import InputError
from imu_sim_ros.core.types import Integers
from imu_sim_ros.core.yaml_output import as_yaml


class PartsWriter(Writer):
    """A writer of a series of files; the next one is begun with its first message."""

    def __init__(
        self,
        path: Path,
        open_part: Callable[[int], Writer],
        split_ns: int = 0,
        split_bytes: int = 0,
    ) -> None:
        """Open the first part.

        :param open_part: opens part k.
        :param split_ns: time span of a part [ns] from its first message on; 0 for any.
        :param split_bytes: a part ends with the message that reaches this size; 0: never.
        """
        super().__init__(path)
        self._open_part, self._split_ns, self._split_bytes = open_part, split_ns, split_bytes
        self._parts: list[Writer] = [open_part(0)]
        self._ended = False
        """True if the last part is closed."""
        self._end_ns: int | None = None
        self.encoding = self._parts[0].encoding

    @property
    def size(self) -> int:
        """Bytes of all parts."""
        return sum(part.size for part in self._parts)

    @property
    def files(self) -> list[Path]:
        """The files of all parts."""
        return [file for part in self._parts for file in part.files]

    def _register(self, topic: BagTopic) -> None:
        """Add a topic to the part that is being written."""
        if not self._ended:
            _add(self._parts[-1], topic)

    def write_blocks(self, blocks: Sequence[Block]) -> None:
        """Write the messages of several topics; those after a boundary go into the next part."""
        blocks = count_messages(blocks)
        while blocks:
            part = self._current_part()
            within, past = self._split_by_time(blocks)
            first_blocks, remaining = self._split_by_size(within, part)
            part.write_blocks(
                [Block(part.topics[b.topic.index], b.t_ns, b.payloads) for b in first_blocks]
            )
            if (past and not remaining) or 0 < self._split_bytes <= part.size:
                self._end_part()
            blocks = remaining + past

    def _current_part(self) -> Writer:
        """Return the part that is being written, or a new one if the last is closed."""
        if self._ended:
            if len(self._parts) >= MAX_PARTS:
                raise InputError(
                    f"{self.path}: more than {MAX_PARTS} parts; split at a longer time or a "
                    "larger size"
                )
            self._parts.append(self._open_part(len(self._parts)))
            self._ended = False
            for topic in self.topics:
                previous_count = sum(part.topics[topic.index].count for part in self._parts[:-1])
                _add(self._parts[-1], topic, previous_count)
        return self._parts[-1]

    def _split_by_time(self, blocks: list[Block]) -> tuple[list[Block], list[Block]]:
        """Return the messages before the part's end, on which its first one decides, and others.

        If times run backwards, the part changes at the first message past its end.
        """
        if not self._split_ns:
            return blocks, []
        if self._end_ns is None:
            self._end_ns = min(int(block.t_ns.min()) for block in blocks) + self._split_ns
        counts = []
        for block in blocks:
            past = np.flatnonzero(block.t_ns >= self._end_ns)
            counts.append(int(past[0]) if len(past) else len(block.t_ns))
        return _divide(blocks, counts)

    def _split_by_size(self, blocks: list[Block], part: Writer) -> tuple[list[Block], list[Block]]:
        """Return the messages that fit into the part, at least one, and the others."""
        if not self._split_bytes or not blocks:
            return blocks, []
        sizes = [_sizes(block) for block in blocks]
        room = self._split_bytes - part.size
        if sum(int(size.sum()) for size in sizes) < room:
            return blocks, []
        order = time_order([block.t_ns for block in blocks])
        ends = np.cumsum(np.concatenate(sizes)[order])
        fitting = order[: int(np.searchsorted(ends, room)) + 1]
        starts = np.cumsum([0, *(len(block.t_ns) for block in blocks)])
        # A block whose times run backwards goes on up to the last message that fits.
        counts = [
            int(rows.max(initial=start - 1)) + 1 - start
            for start, stop in pairwise(starts.tolist())
            for rows in [fitting[(fitting >= start) & (fitting < stop)]]
        ]
        return _divide(blocks, counts)

    def _end_part(self) -> None:
        """Close the part that is being written; the next message begins a new one."""
        self._parts[-1].close()
        self._ended, self._end_ns = True, None

    def flush(self, durable: bool = False) -> None:
        """Flush the part that is being written; all others are complete."""
        if not self._ended:
            self._parts[-1].flush(durable)

    def close(self) -> None:
        """Close the last part."""
        if not self._ended:
            self._end_part()

    def abandon(self) -> list[Path]:
        """Keep the complete parts, and the last one as a partial file."""
        whole = self._parts if self._ended else self._parts[:-1]
        files = [file for part in whole for file in part.files]
        return files if self._ended else files + self._parts[-1].abandon()

    def stop(self) -> None:
        """Finish the last part early, without it if nothing is in it."""
        self._parts[-1].stop()
        if not self._parts[-1].count:
            self._parts.pop()
        for topic in self.topics:
            topics = [p.topics[topic.index] for p in self._parts if topic.index < len(p.topics)]
            topic.count = sum(part_topic.count for part_topic in topics)
            topic.last_ns = max((part_topic.last_ns for part_topic in topics), default=-1)
        self._ended = True


def _add(part: Writer, topic: BagTopic, previous_count: int = 0) -> None:
    """Add a topic to a part, which continues the numbers of its messages."""
    part_topic = part.add_topic(
        topic.name, topic.type_name, topic.qos, topic.schema, topic.keeps_seq
    )
    part_topic.earlier_messages = previous_count


def _sizes(block: Block) -> Integers:
    """Return the bytes of each message."""
    if isinstance(block.payloads, list):
        return np.array([len(payload) for payload in block.payloads], dtype=np.int64)
    row = block.payloads.template if isinstance(block.payloads, RowTemplate) else block.payloads[0]
    return np.full(len(block.t_ns), len(row), dtype=np.int64)


def _divide(blocks: list[Block], counts: list[int]) -> tuple[list[Block], list[Block]]:
    """Return the first messages of blocks, and the others; empty blocks are left out."""
    pairs = list(zip(blocks, counts, strict=True))
    first_blocks = [Block(b.topic, b.t_ns[:n], b.payloads[:n]) for b, n in pairs if n]
    return first_blocks, [
        Block(b.topic, b.t_ns[n:], b.payloads[n:]) for b, n in pairs if n < len(b.t_ns)
    ]


class Rosbag2Writer(PartsWriter):
    """A rosbag2 folder; the metadata, which makes it whole, is written last."""

    def __init__(
        self,
        path: Path,
        storage: str,
        open_part: Callable[[Path], Writer],
        split_ns: int = 0,
        split_bytes: int = 0,
    ) -> None:
        """Make the folder.

        :param storage: mcap or sqlite3.
        :param open_part: opens a file of that storage.
        """
        self._lock = make_locked_folder(path)
        self._storage = storage
        suffix = {"mcap": ".mcap", "sqlite3": ".db3"}[storage]
        super().__init__(
            path, lambda k: open_part(path / f"{path.name}_{k}{suffix}"), split_ns, split_bytes
        )

    def close(self) -> None:
        """Close the last file and write metadata.yaml."""
        super().close()
        self._describe()
        self._unlock()

    def _unlock(self) -> None:
        """Release the lock of the folder: readers may open it."""
        if self._lock >= 0:
            os.close(self._lock)
            self._lock = -1

    def stop(self) -> None:
        """Finish the last file early, and write metadata.yaml."""
        super().stop()
        if self._parts:
            self._describe()
        else:
            shutil.rmtree(self.path, ignore_errors=True)
        self._unlock()

    def _describe(self) -> None:
        """Write metadata.yaml, which is there as a whole or not at all."""
        content = rosbag2_metadata(self._storage, self.topics, self._parts)
        text = as_yaml({"rosbag2_bagfile_information": content})
        temporary = self.path / (METADATA_FILE + ".tmp")
        temporary.write_text(text, encoding="utf-8")
        temporary.rename(self.path / METADATA_FILE)

    def abandon(self) -> list[Path]:
        """Leave the folder without metadata."""
        paths = [self.path] if super().abandon() else []
        if not paths:
            shutil.rmtree(self.path, ignore_errors=True)
        self._unlock()
        return paths
