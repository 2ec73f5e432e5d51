# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""A bag that is written while messages arrive: in its own thread, safe against a sudden end."""

import queue
import threading
import time
from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

from imu_sim_ros.bags import Writer, active_path
from imu_sim_ros.bags.messages import BrokenMessageError, Qos, recorded_type
from imu_sim_ros.errors import InputError
from imu_sim_ros.nodes.recorder.messages import Message
from imu_sim_ros.nodes.recorder.stamp_statistics import StampStatistics
from imu_sim_ros.nodes.supervised_thread import Fail, SupervisedThread

FLUSH_PERIOD = 0.5
"""[s] Period of flushing: older data survive the process. Half of the second that is promised."""


@dataclass
class Topic:
    """A recorded topic: how it is described in the bag, and what was seen of it."""

    name: str
    type_name: str
    qos: tuple[Qos, ...]
    definition: str
    digest: str
    stamped: bool
    """Whether every message so far had a stamp that was set."""
    statistics: StampStatistics
    handle: Any = None
    convert: Callable[[bytes], bytes] = bytes
    unseen: list[int] = field(default_factory=list)
    """Stamps that are not in the statistics yet."""

    def look(self) -> None:
        """Add the accumulated stamps to the statistics."""
        self.statistics.add(np.array(self.unseen, dtype=np.int64))
        self.unseen.clear()


class Recording:
    """Writes messages into a bag and finishes it properly, whatever happens.

    :param open_bag: opens the bag.
    :param fail: receives the error that ended the writing; what was written before is kept.
    :param buffer_bytes: how much may wait in memory while the disk stalls.
    :raises Exception: whatever ``open_bag`` raised, where the bag cannot be opened.
    """

    def __init__(
        self, open_bag: Callable[[], Writer], fail: Fail, buffer_bytes: float = 512e6
    ) -> None:
        self.topics: dict[str, Topic] = {}
        self.refused: dict[str, str] = {}
        """Topics that the bag cannot hold, and why."""
        self.failed = False
        """Whether writing ended with an error."""
        self.dropped = 0
        """Messages dropped because the buffer was full."""
        self.broken = 0
        """Messages that cannot be translated for this bag."""
        self.files: list[Path] = []
        self.size = 0
        """Bytes written, as of the last flush."""
        self._open_bag, self._fail, self._buffer_bytes = open_bag, fail, buffer_bytes
        self._queue: queue.SimpleQueue[list[Message] | Topic | None] = queue.SimpleQueue()
        self._queued_bytes = 0
        self._lock = threading.Lock()
        self._begun = threading.Event()
        self._refusal: BaseException | None = None
        self._thread = SupervisedThread("writer", self._run, self._take_failure)
        self._thread.start()
        self._begun.wait()
        if self._refusal is not None:
            raise self._refusal

    @property
    def messages(self) -> int:
        """Messages written, of all topics."""
        topics = list(self.topics.values())
        return sum(topic.statistics.messages + len(topic.unseen) for topic in topics)

    def add_topic(self, topic: Topic) -> None:
        """Add a topic; its messages may follow at once."""
        self._queue.put(topic)

    def put(self, messages: list[Message]) -> None:
        """Queue messages for writing; never blocks.

        While the disk stalls they wait in memory. Those that no longer fit are dropped and counted.
        """
        size = sum(len(message.payload) for message in messages)
        with self._lock:
            if self.failed or self._queued_bytes + size > self._buffer_bytes:
                self.dropped += len(messages)
                return
            self._queued_bytes += size
        self._queue.put(messages)

    def close(self) -> None:
        """Write what is queued, finish the bag and end the thread."""
        self._queue.put(None)
        self._thread.join()

    def _take_failure(self, error: BaseException) -> None:
        """Handle the error that ended the thread: while opening the bag, or later."""
        if self._begun.is_set():
            self.failed = True
            self._fail(error)
        else:
            self._refusal = error
            self._begun.set()

    def _run(self) -> None:
        # Opened here, not by the caller: a database may belong to the thread that opened it.
        self._bag = self._open_bag()
        try:
            # Loads the translation of messages, so that the first ones need not wait for it.
            recorded_type("std_msgs/msg/Header", "", "", self._bag.encoding)
            self.files = self._bag.files
            self._begun.set()
            self._write_all()
            self._bag.close()
            self.files = self._bag.files
        except BaseException:
            self.files = self._bag.abandon()
            raise
        finally:
            for topic in self.topics.values():
                topic.look()

    def _write_all(self) -> None:
        due = time.monotonic() + FLUSH_PERIOD
        while True:
            try:
                item = self._queue.get(timeout=max(due - time.monotonic(), 0.0))
            except queue.Empty:
                item = []
            if item is None:
                self._flush()
                return
            if isinstance(item, Topic):
                self._begin(item)
            else:
                self._write(item)
            if time.monotonic() >= due:
                self._flush()
                due = time.monotonic() + FLUSH_PERIOD

    def _begin(self, topic: Topic) -> None:
        try:
            schema, topic.convert = recorded_type(
                topic.type_name, topic.definition, topic.digest, self._bag.encoding
            )
        except InputError as error:
            self.refused[topic.name] = str(error)
            return
        topic.handle = self._bag.add_topic(topic.name, topic.type_name, topic.qos, schema)
        self.topics[topic.name] = topic

    def _write(self, messages: list[Message]) -> None:
        write, topics = self._bag.write_raw, self.topics
        for name, t_ns, payload, stamp_ns in messages:
            topic = topics.get(name)
            if topic is None:
                continue
            try:
                write(topic.handle, t_ns, topic.convert(payload))
            except BrokenMessageError:
                self.broken += 1
                continue
            topic.stamped &= stamp_ns is not None
            topic.unseen.append(t_ns if stamp_ns is None else stamp_ns)
        with self._lock:
            self._queued_bytes -= sum(len(message.payload) for message in messages)

    def _flush(self) -> None:
        """Flush everything to the file, and notice where the file no longer exists."""
        self._bag.flush()
        self.size = self._bag.size
        self.files = self._bag.files
        for topic in self.topics.values():
            topic.look()
        # Writing to a removed file keeps succeeding without a sign.
        last = self.files[-1]
        if not (last.exists() or active_path(last).exists()):
            raise InputError(f"{last}: it was removed while it was being written")
