# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Writing bags: one interface for every container, and what their writers share."""

from abc import ABC, abstractmethod
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Final, NamedTuple

import numpy as np

from imu_sim_ros.bags.messages.blocks import Payloads, RowTemplate
from imu_sim_ros.bags.messages.schemas import Qos, Schema, qos_profiles, schema
from imu_sim_ros.core.errors import InputError
from imu_sim_ros.core.names import suggestion
from imu_sim_ros.core.spelling import argument_prefix
from imu_sim_ros.core.types import Integers, Times

STORAGES: Final = ("mcap", "sqlite3", "ros1")
COMPRESSIONS: Final[dict[str, tuple[str, ...]]] = {
    "mcap": ("none", "lz4", "zstd"),
    "sqlite3": ("none",),
    "ros1": ("none", "lz4", "bz2"),
}
COMPRESSED: Final = tuple(dict.fromkeys(name for names in COMPRESSIONS.values() for name in names))
"""The compressions of any storage."""


NO_FIRST_NS: Final = 2**63 - 1
"""First time of a topic without messages: later than any."""
NO_LAST_NS: Final = -1
"""Last time of a topic without messages: earlier than any."""


@dataclass(eq=False)
class BagTopic:
    """A topic of a bag that is being written, and its contents so far."""

    index: int
    """Number of the topic in the bag, from 0."""
    name: str
    type_name: str
    schema: Schema
    qos: tuple[Qos, ...]
    """Profiles of its publishers."""
    count: int = 0
    first_ns: int = NO_FIRST_NS
    """Earliest record time [ns]."""
    last_ns: int = NO_LAST_NS
    """Latest record time [ns]."""
    keeps_seq: bool = False
    """ROS 1: the messages come with a header.seq of their own; else the writer counts."""
    earlier_messages: int = 0
    """Messages of this topic in earlier parts of the same bag."""

    def add(self, count: int, first_ns: int, last_ns: int) -> None:
        """Count messages."""
        self.count += count
        self.first_ns = min(self.first_ns, first_ns)
        self.last_ns = max(self.last_ns, last_ns)


class Block(NamedTuple):
    """n messages of one topic."""

    topic: BagTopic
    t_ns: Times
    """(n,) record times."""
    payloads: Payloads | RowTemplate
    """(n, size) bytes of messages of equal size, or a list of n messages."""


class Writer(ABC):
    """Messages as bytes into a bag; use as a context manager."""

    encoding: str
    """cdr or ros1: the encoding of the messages that this container takes."""

    def __init__(self, path: Path) -> None:
        self.path = path
        self.topics: list[BagTopic] = []

    def add_topic(
        self,
        name: str,
        type_name: str,
        qos: Sequence[Qos] | None = None,
        definition: Schema | None = None,
        keeps_seq: bool = False,
    ) -> BagTopic:
        """Return the handle of a new topic.

        :param name: name with its slash, for instance /imu/data_raw.
        :param type_name: type in the form of ROS 2, for instance sensor_msgs/msg/Imu.
        :param qos: profiles that the topic was offered with; None: the default one.
        :param definition: definition of a type that does not come with ROS.
        :param keeps_seq: the messages come from a ROS 1 bag, with a header.seq of their own.
        """
        if any(topic.name == name for topic in self.topics):
            raise InputError(f"{self.path}: the topic {name} already exists")
        topic_schema = definition or schema(type_name, self.encoding)
        profiles = (Qos(),) if qos is None else tuple(qos)
        topic = BagTopic(
            len(self.topics), name, type_name, topic_schema, profiles, keeps_seq=keeps_seq
        )
        self._register(topic)
        self.topics.append(topic)
        return topic

    def write(self, topic: BagTopic, t_ns: Times, payloads: Payloads | RowTemplate) -> None:
        """Write n messages with record times (n,)."""
        self.write_blocks([Block(topic, t_ns, payloads)])

    @abstractmethod
    def write_blocks(self, blocks: Sequence[Block]) -> None:
        """Write the messages of several topics, ordered by record time among each other."""

    @abstractmethod
    def flush(self, durable: bool = False) -> None:
        """Make everything so far survive the end of this process.

        :param durable: make it survive a power failure, too.
        """

    @abstractmethod
    def close(self) -> None:
        """Finish the bag: it is complete afterwards."""

    @abstractmethod
    def abandon(self) -> list[Path]:
        """Stop after a failure, and keep the valid part under a name that marks it as partial.

        :returns: the files that hold it.
        """

    @abstractmethod
    def stop(self) -> None:
        """Finish the bag early: it is complete, with every message that was fully written.

        A signal may have interrupted any other method of this writer.
        """

    @property
    @abstractmethod
    def size(self) -> int:
        """Bytes written so far, including those in memory."""

    @property
    def count(self) -> int:
        """Messages so far."""
        return sum(topic.count for topic in self.topics)

    @property
    def files(self) -> list[Path]:
        """All files of this bag so far."""
        return [self.path]

    @abstractmethod
    def _register(self, topic: BagTopic) -> None:
        """Prepare a new topic."""

    def __enter__(self) -> "Writer":
        return self

    def __exit__(self, kind: object, error: BaseException | None, trace: object) -> None:
        if error is None:
            try:
                self.close()
            except BaseException as stopped:
                if not isinstance(stopped, Exception):
                    self.stop()
                raise
        elif isinstance(error, Exception):
            self.abandon()
        else:
            self.stop()


class BagOptions(NamedTuple):
    """Options of writing a bag."""

    storage: str | None = None
    """mcap, sqlite3 or ros1; None: the one that the name implies."""
    compression: str | None = None
    """none, lz4 or zstd for mcap, none, lz4 or bz2 for ros1; None: none."""
    split_duration: float = 0.0
    """Length of one file [s]; 0 for a single file."""
    split_size: int = 0
    """Bytes after which a new file begins; 0: never."""


AS_NAMED: Final = BagOptions()
"""Options implied by the name: one file, not compressed."""


def check_writer(path: Path, storage: str | None, compression: str | None) -> tuple[str, str]:
    """Return the storage and the compression of a bag, by its name if they are not given.

    :raises InputError: for a name, a storage and a compression that contradict each other.
    """
    storage = storage or ("ros1" if path.suffix == ".bag" else "mcap")
    compression = compression or "none"
    if storage not in STORAGES:
        raise InputError(f"storage {storage!r}: {suggestion(storage, STORAGES)}")
    if compression not in COMPRESSIONS[storage]:
        raise InputError(
            f"compression {compression!r}: {storage} takes {', '.join(COMPRESSIONS[storage])}"
        )
    if path.suffix == ".mcap" and storage != "mcap":
        raise InputError(f"{path}: a .mcap file has the storage mcap, not {storage}")
    if path.suffix == ".bag" and storage != "ros1":
        raise InputError(f"{path}: a .bag file is a ROS 1 bag; give {storage} a folder's name")
    return storage, compression


MAX_PARTS: Final = 10_000
"""More files in one folder are a mistake in the splitting."""


def check_split(split_duration: float, period: float, duration: float) -> None:
    """Refuse parts that are shorter than the time between two messages, or very many.

    :param split_duration: duration of one part [s]; 0: no parts.
    :param period: time between two messages [s].
    :param duration: total duration [s].
    :raises InputError: with what is allowed.
    """
    shortest = max(period, duration / MAX_PARTS)
    if 0.0 < split_duration < shortest:
        raise InputError(
            f"{argument_prefix('split_duration', f'{split_duration:g}s')}: must be at least "
            f"{shortest:g} s, "
            f"which gives every message a part of its own, or {MAX_PARTS} parts"
        )


METADATA_FILE: Final = "metadata.yaml"
"""Metadata file of a rosbag2 folder."""
METADATA_VERSION: Final = 9
"""Version of rosbag2's metadata.yaml, that of Jazzy."""
ROS_DISTRO: Final = "jazzy"


def rosbag2_metadata(
    storage: str, topics: Sequence[BagTopic], files: Sequence[Writer]
) -> dict[str, object]:
    """Return the content of a folder's metadata.yaml below its root, which each file has as well.

    It is that of version 9, as ROS 2 Jazzy writes and reads it.

    :param storage: mcap or sqlite3.
    :param topics: topics of the bag.
    :param files: the writers of its files, each with the messages of its own.
    """
    parts = []
    for file in files:
        filled = [topic for topic in file.topics if topic.count]
        start = min((topic.first_ns for topic in filled), default=NO_FIRST_NS)
        end = max((topic.last_ns for topic in filled), default=start)
        parts.append((file.path.name, start, end, file.count))
    start = min((start for _, start, _, count in parts if count), default=NO_FIRST_NS)
    end = max((end for _, _, end, count in parts if count), default=start)
    return {
        "version": METADATA_VERSION,
        "storage_identifier": storage,
        "duration": {"nanoseconds": end - start},
        "starting_time": {"nanoseconds_since_epoch": start},
        "message_count": sum(count for *_, count in parts),
        "topics_with_message_count": [
            {
                "topic_metadata": {
                    "name": topic.name,
                    "type": topic.type_name,
                    "serialization_format": "cdr",
                    "offered_qos_profiles": qos_profiles(topic.qos),
                    "type_description_hash": topic.schema.digest,
                },
                "message_count": topic.count,
            }
            for topic in topics
        ],
        "compression_format": "",
        "compression_mode": "",
        "relative_file_paths": [name for name, *_ in parts],
        "files": [
            {
                "path": name,
                "starting_time": {"nanoseconds_since_epoch": start},
                "duration": {"nanoseconds": end - start},
                "message_count": count,
            }
            for name, start, end, count in parts
        ],
        "custom_data": None,
        "ros_distro": ROS_DISTRO,
    }


def topics_summary(topics: Iterable[BagTopic]) -> str:
    """Return how much was written to the topics of a bag."""
    written = list(topics)
    last_ns = max((topic.last_ns for topic in written), default=-1)
    return describe_amount(sum(topic.count for topic in written), last_ns, "messages")


def describe_amount(count: int, last_ns: int, unit: str) -> str:
    """Return a count and the last stamp as text."""
    until = f" up to stamp {last_ns / 1e9:.9f} s" if count else ""
    return f"{count:,} {unit}{until}"


def count_messages(blocks: Sequence[Block]) -> list[Block]:
    """Count the messages of blocks in their topics; returns those that are not empty."""
    filled = [block for block in blocks if len(block.t_ns)]
    for topic, t_ns, _ in filled:
        topic.add(len(t_ns), int(t_ns.min()), int(t_ns.max()))
    return filled


def time_order(times: Sequence[Times]) -> Integers:
    """Return the order of all messages of several blocks by time; of equal ones, the first block's.

    :returns: indices into the concatenation of the blocks.
    """
    joined = np.concatenate(times)
    if bool(np.all(joined[1:] >= joined[:-1])):
        return np.arange(len(joined))
    return np.argsort(joined, kind="stable")
