# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Bags of several files: splitting, and the folder of rosbag2 with its metadata."""

import shutil
from collections.abc import Callable, Sequence
from pathlib import Path

import numpy as np

from imu_sim_ros.bags.atomic_file import make_folder
from imu_sim_ros.bags.rosbag2 import metadata as rosbag2_metadata
from imu_sim_ros.bags.writer import Block, Topic, Writer, tally


class PartsWriter(Writer):
    """A writer of one file after the other."""

    def __init__(
        self,
        path: Path,
        open_part: Callable[[int], Writer],
        split_ns: int = 0,
        split_bytes: int = 0,
    ) -> None:
        """Open the first part.

        :param open_part: opens part k.
        :param split_ns: a part holds messages of this time span [ns]; 0: of any.
        :param split_bytes: the next part begins when this size is passed; 0: never.
        """
        super().__init__(path)
        self._open_part, self._split_ns, self._split_bytes = open_part, split_ns, split_bytes
        self._closed: list[Writer] = []
        self._part = open_part(0)
        self._end_ns = 2**63 - 1 if not split_ns else None
        self.encoding = self._part.encoding

    @property
    def size(self) -> int:
        """Bytes of all parts."""
        return sum(part.size for part in [*self._closed, self._part])

    @property
    def files(self) -> list[Path]:
        """The files of all parts."""
        return [file for part in [*self._closed, self._part] for file in part.files]

    def _register(self, topic: Topic) -> None:
        here = self._part.add_topic(
            topic.name, topic.type_name, topic.qos, topic.schema, topic.keeps_seq
        )
        here.before = sum(part.topics[topic.index].count for part in self._closed)

    def write_blocks(self, blocks: Sequence[Block]) -> None:
        """Write the messages of several topics; those after a boundary go into the next part."""
        blocks = tally(blocks)
        while blocks:
            end_ns = self._boundary(min(int(block.t_ns.min()) for block in blocks))
            now, later = [], []
            for topic, t_ns, payloads in blocks:
                # Where times run backwards the part changes at the first message past its end.
                past = np.flatnonzero(t_ns >= end_ns)
                cut = int(past[0]) if len(past) else len(t_ns)
                here = self._part.topics[topic.index]
                if cut:
                    now.append(Block(here, t_ns[:cut], payloads[:cut]))
                if cut < len(t_ns):
                    later.append(Block(topic, t_ns[cut:], payloads[cut:]))
            self._part.write_blocks(now)
            blocks = later
            if later or 0 < self._split_bytes <= self._part.size:
                self._next_part()

    def write_raw(self, topic: Topic, t_ns: int, payload: bytes) -> None:
        """Write one message."""
        if t_ns >= self._boundary(t_ns) or 0 < self._split_bytes <= self._part.size:
            self._next_part()
        topic.add(1, t_ns, t_ns)
        self._part.write_raw(self._part.topics[topic.index], t_ns, payload)

    def _boundary(self, t_ns: int) -> int:
        """Return the time at which the next part begins; the first message decides on all."""
        if self._end_ns is None:
            self._end_ns = t_ns + self._split_ns
        return self._end_ns

    def _next_part(self) -> None:
        self._part.close()
        self._closed.append(self._part)
        self._part = self._open_part(len(self._closed))
        if self._split_ns and self._end_ns is not None:
            self._end_ns += self._split_ns
        for topic in self.topics:
            self._register(topic)

    def flush(self, durable: bool = False) -> None:
        """Flush the part that is being written; all others are complete."""
        self._part.flush(durable)

    def close(self) -> None:
        """Close the last part."""
        self._part.close()

    def abandon(self) -> list[Path]:
        """Keep the complete parts, and the last one as what it is."""
        kept = [file for part in self._closed for file in part.files]
        return kept + self._part.abandon()

    def _parts(self) -> list[Writer]:
        return [*self._closed, self._part]


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
        make_folder(path)
        self._storage = storage
        suffix = {"mcap": ".mcap", "sqlite3": ".db3"}[storage]
        super().__init__(
            path, lambda k: open_part(path / f"{path.name}_{k}{suffix}"), split_ns, split_bytes
        )

    def close(self) -> None:
        """Close the last file and write metadata.yaml."""
        super().close()
        parts = [rosbag2_metadata.part(part.path, part.topics) for part in self._parts()]
        content = rosbag2_metadata.document(self._storage, self.topics, parts)
        rosbag2_metadata.write(self.path, content)

    def abandon(self) -> list[Path]:
        """Leave the folder without metadata."""
        if not super().abandon():
            shutil.rmtree(self.path)
            return []
        return [self.path]
