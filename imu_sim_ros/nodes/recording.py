"""A bag that is written while messages arrive: in its own thread, safe against sudden ends."""

import os
import queue
import threading
import time
from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from imu_sim_ros.errors import ImuSimError
from imu_sim_ros.nodes.stamp_statistics import StampStatistics

FLUSH_PERIOD = 0.5
"""[s] What is older survives the process; twice as often as the promise of one second needs."""
MEGABYTE = 1_000_000


class Message(NamedTuple):
    """One message as it came."""

    topic: str
    t_ns: int
    payload: bytes


@dataclass
class Topic:
    """A recorded topic: how it is described in the bag, and what was seen of it."""

    name: str
    type_name: str
    qos: Any
    definition: str
    stamped: bool
    statistics: StampStatistics
    handle: Any = None
    unseen: list[int] = field(default_factory=list)
    """Stamps that the statistics do not know yet."""

    def look(self) -> None:
        """Let the statistics see the stamps that have gathered."""
        self.statistics.add(np.array(self.unseen, dtype=np.int64))
        self.unseen.clear()


class Limits(NamedTuple):
    """When a bag ends and another begins; 0: never."""

    split_bytes: float = 0.0
    split_ns: float = 0.0
    buffer_bytes: float = 512e6


class Recording:
    """Writes messages into a bag, or into a row of bags, and finishes each of them properly.

    :param path: the bag; with splitting, ``_0``, ``_1``, ... is put behind its name.
    :param open_bag: opens the writer of one bag.
    :raises InputError: from ``open_bag``, where the first bag cannot be begun.
    """

    def __init__(self, path: Path, open_bag: Callable[[Path], Any], limits: Limits) -> None:
        self.topics: dict[str, Topic] = {}
        self.failure = ""
        self.dropped = 0
        self.parts: list[Path] = []
        self.closed_bytes = 0
        self.part_bytes = 0
        self._path, self._open_bag, self._limits = path, open_bag, limits
        self._queue: queue.SimpleQueue[list[Message] | Topic | None] = queue.SimpleQueue()
        self._queued_bytes = 0
        self._lock = threading.Lock()
        self._begun = threading.Event()
        self._refusal: ImuSimError | None = None
        self._thread = threading.Thread(target=self._run, name="writer")
        self._thread.start()
        self._begun.wait()
        if self._refusal is not None:
            raise self._refusal

    @property
    def size(self) -> int:
        """Bytes on the disk, of all parts."""
        return self.closed_bytes + self.part_bytes

    @property
    def messages(self) -> int:
        """Messages written, of all topics."""
        return sum(t.statistics.messages + len(t.unseen) for t in list(self.topics.values()))

    def add_topic(self, topic: Topic) -> None:
        """Begin a topic; its messages may follow at once."""
        self._queue.put(topic)

    def put(self, messages: list[Message]) -> None:
        """Hand over messages to be written; never blocks.

        While the disk stalls they wait in memory. What no longer fits there is dropped and counted.
        """
        size = sum(len(message.payload) for message in messages)
        with self._lock:
            if self._queued_bytes + size > self._limits.buffer_bytes:
                self.dropped += len(messages)
                return
            self._queued_bytes += size
        self._queue.put(messages)

    def close(self) -> None:
        """Write what waits, finish the bag and end the thread."""
        self._queue.put(None)
        self._thread.join()

    def _run(self) -> None:
        # Opened here, not by the caller: a SQLite connection belongs to the thread that made it.
        try:
            self._begin_part()
        except ImuSimError as error:
            self._refusal = error
            return
        finally:
            self._begun.set()
        try:
            self._write_all()
        except Exception as error:  # whatever it is, the node must hear of it and end
            self.failure = _reason(error)
        try:
            self._end_part()
        except Exception as error:
            self.failure = self.failure or _reason(error)

    def _write_all(self) -> None:
        due = time.monotonic() + FLUSH_PERIOD
        while True:
            try:
                item = self._queue.get(timeout=max(due - time.monotonic(), 0.0))
            except queue.Empty:
                item = []
            if item is None:
                return
            if isinstance(item, Topic):
                self.topics[item.name] = item
                self._add(item)
            else:
                self._write(item)
            if time.monotonic() >= due:
                self._flush()
                due = time.monotonic() + FLUSH_PERIOD

    def _write(self, messages: list[Message]) -> None:
        write, topics = self._bag.write_raw, self.topics
        for message in messages:
            topic = topics[message.topic]
            write(topic.handle, message.t_ns, message.payload)
            topic.unseen.append(message.t_ns)
        with self._lock:
            self._queued_bytes -= sum(len(message.payload) for message in messages)

    def _flush(self) -> None:
        self._bag.flush()
        self._measure()
        for topic in self.topics.values():
            topic.look()
        full = 0 < self._limits.split_bytes <= self.part_bytes
        elapsed = time.monotonic_ns() - self._part_begin_ns
        if full or 0 < self._limits.split_ns <= elapsed:
            self._end_part()
            self._begin_part()

    def _measure(self) -> None:
        """Notice a bag that was removed or replaced: writing into it would succeed for ever."""
        path = self.parts[-1]
        size = size_on_disk(path)
        if _identity(path) != self._identity or (self.part_bytes and not size):
            raise FileNotFoundError(None, "it was removed while it was being written")
        self.part_bytes = size

    def _begin_part(self) -> None:
        path = self._path
        if self._limits.split_bytes or self._limits.split_ns:
            path = path.with_name(f"{path.stem}_{len(self.parts)}{path.suffix}")
        self._bag = self._open_bag(path)
        self.parts.append(path)
        self._identity = _identity(path)
        self._part_begin_ns = time.monotonic_ns()
        for topic in self.topics.values():
            self._add(topic)

    def _add(self, topic: Topic) -> None:
        topic.handle = self._bag.add_topic(
            topic.name,
            topic.type_name,
            qos=topic.qos,
        )

    def _end_part(self) -> None:
        for topic in self.topics.values():
            topic.look()
        try:
            self._bag.close()
        finally:
            self.closed_bytes += size_on_disk(self.parts[-1])
            self.part_bytes = 0


def size_on_disk(path: Path) -> int:
    """Return the bytes of a file, or of all files of a folder; 0 where nothing is left."""
    files = path.iterdir() if path.is_dir() else [path]
    total = 0
    for file in files:
        try:
            total += file.stat().st_size
        except FileNotFoundError:  # sqlite's journal comes and goes
            continue
    return total


def _identity(path: Path) -> tuple[int, int] | None:
    try:
        status = os.stat(path)
    except FileNotFoundError:
        return None
    return status.st_dev, status.st_ino


def _reason(error: Exception) -> str:
    if isinstance(error, OSError):
        return error.strerror or str(error)
    return str(error) or type(error).__name__
