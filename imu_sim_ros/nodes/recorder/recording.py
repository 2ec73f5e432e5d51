# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""A bag that is written while messages arrive: in its own thread, safe against a sudden end."""

import queue
import struct
import threading
import time
from collections.abc import Callable, Iterable
from contextlib import suppress
from dataclasses import dataclass, field
from pathlib import Path
from typing import NamedTuple

import numpy as np
from rclpy.clock import ROSClock
from rclpy.node import Node

from imu_sim_ros.bags.messages.schemas import BrokenMessageError, Qos, message_type
from imu_sim_ros.bags.outputs import active_path
from imu_sim_ros.bags.writer import BagTopic, Block, Writer
from imu_sim_ros.core.errors import InputError
from imu_sim_ros.core.timebase import NANOSECONDS_PER_SECOND
from imu_sim_ros.nodes.lifetime import Fail, SupervisedThread
from imu_sim_ros.nodes.messages import imu_reading
from imu_sim_ros.nodes.subscriptions import Taken
from imu_sim_ros.recordings.findings.catalogue import stamp_findings
from imu_sim_ros.recordings.findings.finding import Finding
from imu_sim_ros.recordings.findings.live import UnitWatch
from imu_sim_ros.recordings.live_clock import LiveClock
from imu_sim_ros.recordings.record_times import LiveRecordTimes

_STAMPS = {0: struct.Struct(">iI"), 1: struct.Struct("<iI")}


class Message(NamedTuple):
    """One message as received."""

    topic: str
    t_ns: int
    """Record time: that of the stamp, of :class:`LiveRecordTimes`, or of the reception."""
    payload: bytes
    stamp_ns: int | None = None
    """The stamp; None if there is none or it was never set."""


class Timestamps:
    """Gives the messages that were taken their times.

    :param node: node whose clock is used if time is simulated.
    :param by_reception: a message's time is that of its reception, stamp or not.
    """

    def __init__(self, node: Node, by_reception: bool) -> None:
        self._node, self._by_reception = node, by_reception
        self._offsets: dict[str, int | None] = {}
        self._record_times = LiveRecordTimes()

    def add_topic(self, topic: str, stamp_offset: int | None) -> None:
        """Add a topic.

        :param stamp_offset: place of the stamp in the bytes; None for the time of reception.
        """
        self._offsets[topic] = stamp_offset

    def messages(self, topic: str, batch: Iterable[Taken]) -> list[Message]:
        """Return the messages of one topic with their record times.

        They are those of the reception, or those of the stamps in order; without a stamp the latest
        one of the topic.
        """
        offset = self._offsets[topic]
        messages: list[Message] = []
        for payload, info in batch:
            stamp_ns = _stamp_ns(payload, offset)
            if self._by_reception:
                t_ns = self._now(info)
            elif stamp_ns is None:
                latest_ns = self._record_times.latest(topic)
                t_ns = self._now(info) if latest_ns is None else latest_ns
            else:
                t_ns = self._record_times.of(topic, stamp_ns)
            messages.append(Message(topic, t_ns, payload, stamp_ns))
        return messages

    def _now(self, info: dict[str, int]) -> int:
        """Return the record time of a message [ns]: simulated time, or that of reception."""
        clock = self._node.get_clock()
        if isinstance(clock, ROSClock) and clock.ros_time_is_active:
            return clock.now().nanoseconds
        return info["received_timestamp"] or time.time_ns()


def _stamp_ns(payload: bytes, offset: int | None) -> int | None:
    """Return the stamp [ns] in a message's bytes; None if there is none that is possible.

    A stamp of zero, the header's default, was never set.
    """
    if offset is None or len(payload) < offset + 8:  # a TFMessage may be empty
        return None
    second, nanosecond = _STAMPS[payload[1] & 1].unpack_from(payload, offset)
    t_ns: int = second * NANOSECONDS_PER_SECOND + nanosecond
    return t_ns if t_ns > 0 and nanosecond < NANOSECONDS_PER_SECOND else None


_QUIET = 1.0
"""Silence after which a topic is not waited for [s]."""


@dataclass
class _Topic:
    """Stamps of a topic's first and last message, while its recording is limited in time."""

    first_ns: int
    last_ns: int
    seen_at: float
    complete: bool = False


class DurationLimit:
    """Lets the messages of a topic pass until their stamps exceed its first one by the limit.

    So 8 s of a topic at 200 Hz are 1600 messages, at whatever speed they arrive.
    """

    def __init__(self, duration: float) -> None:
        """Set the limit [s]; 0: none."""
        self._duration = duration
        self._length_ns = round(duration * 1e9)
        self._topics: dict[str, _Topic] = {}

    def take(self, messages: list[Message], time_s: float) -> list[Message]:
        """Return those of a topic's messages that lie within the limit.

        :param time_s: time on the steady clock [s].
        """
        if not self._length_ns or not messages:
            return messages
        first, last = messages[0], messages[-1]
        topic = self._topics.get(first.topic)
        if topic is None:
            topic = self._topics[first.topic] = _Topic(first.t_ns, first.t_ns, time_s)
        topic.last_ns, topic.seen_at = last.t_ns, time_s
        # For a first stamp that was never set the time of reception, perhaps much later, is used.
        topic.first_ns = min(topic.first_ns, *(message.t_ns for message in messages))
        end_ns = topic.first_ns + self._length_ns
        if max(message.t_ns for message in messages) < end_ns:
            return messages
        topic.complete = True
        return [message for message in messages if message.t_ns < end_ns]

    def reached(self, elapsed: float, time_s: float) -> bool:
        """Return whether every topic that is still active has reached the limit.

        :param elapsed: time since the first message, on the node's clock [s]. Decides if stamps
            do not advance, or nothing arrives any more.
        """
        if not self._length_ns:
            return False
        topics = list(self._topics.values())
        if not any(topic.complete for topic in topics) and elapsed < self._duration:
            return False
        return bool(topics) and not any(_is_awaited(topics, time_s))


def _is_awaited(topics: Iterable[_Topic], time_s: float) -> Iterable[bool]:
    """Yield for each topic whether it is active and has not reached the limit."""
    for topic in topics:
        moves = topic.last_ns != topic.first_ns and time_s - topic.seen_at <= _QUIET
        yield moves and not topic.complete


_CONTENTS = 12
"""Place in the bytes of a message behind encapsulation and stamp."""
_COMPARED = 4096
"""Bytes of a message up to which its contents are compared without the stamp."""
FLUSH_PERIOD = 0.5
"""Period of flushing: older data survive the end of the process [s]."""


@dataclass
class RecordedTopic:
    """A recorded topic: its description in the bag, and statistics of its messages."""

    name: str
    type_name: str
    qos: tuple[Qos, ...]
    definition: str
    digest: str
    clock: LiveClock
    """Clock behind its stamps; behind the times of reception until a stamp is set."""
    stamped: bool = False
    """True if a message so far had a stamp that was set."""
    unset: int = 0
    """Messages whose stamp was not set."""
    messages: int = 0
    """Messages written."""
    convert: Callable[[bytes], bytes] = bytes
    unseen: list[int] = field(default_factory=list)
    """Stamps that the clock has not taken yet."""
    changes: list[bool] = field(default_factory=list)
    """True for each of them whose message has other contents than the one before."""
    units: UnitWatch | None = None
    """Judgement of the units, of a topic of readings."""
    findings: list[Finding] = field(default_factory=list)
    """Findings about its readings so far."""
    _latest: bytes = b""

    def take(self, t_ns: int, stamp_ns: int | None, payload: bytes) -> None:
        """Count a message that is written.

        :param t_ns: record time of the message [ns].
        :param stamp_ns: stamp of the message [ns]; None: there is none, or it was not set.
        """
        self.messages += 1
        self.unset += stamp_ns is None
        if stamp_ns is not None and not self.stamped:
            self.stamped, self.clock = True, self.clock.copy_without_stamps()
            self.unseen.clear()
            self.changes.clear()
        if stamp_ns is None and self.stamped:
            return
        # The stamp of the header stands first; of large messages it is compared, too.
        contents = payload[_CONTENTS:] if len(payload) <= _COMPARED else payload
        self.changes.append(contents != self._latest)
        self._latest = contents
        self.unseen.append(t_ns if stamp_ns is None else stamp_ns)
        if self.units is not None and not self.units.done:
            with suppress(InputError):  # the bag keeps what no program can read
                self.findings += self.units.add(imu_reading(payload))

    def update_clock(self) -> None:
        """Pass the accumulated stamps on to the clock."""
        self.clock.add(
            np.array(self.unseen, dtype=np.int64), np.array(self.changes, dtype=np.bool_)
        )
        self.unseen.clear()
        self.changes.clear()

    def finish(self) -> None:
        """Look at the last stamps, and at the clock behind them all."""
        self.update_clock()
        self.clock.finish()
        if self.units is not None and self.stamped and self.clock.clock is not None:
            self.findings += stamp_findings(self.clock.clock, self.name)


class BagRecording:
    """Writes messages into a bag and finishes it at any end.

    :param open_bag: opens the bag.
    :param fail: receives the error that ended the writing; earlier messages are kept.
    :param buffer_bytes: how much may wait in memory while the disk stalls.
    :raises Exception: whatever ``open_bag`` raised, if the bag cannot be opened.
    """

    def __init__(
        self, open_bag: Callable[[], Writer], fail: Fail, buffer_bytes: float = 512e6
    ) -> None:
        self.topics: dict[str, RecordedTopic] = {}
        self._written: dict[str, BagTopic] = {}
        self.refused: dict[str, str] = {}
        """Topics that the bag cannot hold, and why."""
        self.failed = False
        """True if writing ended with an error."""
        self.dropped = 0
        """Messages dropped because the buffer was full."""
        self.broken = 0
        """Messages that cannot be translated for this bag."""
        self.files: list[Path] = []
        self.size = 0
        """Bytes written, as of the last flush."""
        self._open_bag, self._fail, self._buffer_bytes = open_bag, fail, buffer_bytes
        self._queue: queue.SimpleQueue[list[Message] | RecordedTopic | None] = queue.SimpleQueue()
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
        return sum(topic.messages for topic in topics)

    def add_topic(self, topic: RecordedTopic) -> None:
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
        """Write the queued messages, finish the bag and end the thread."""
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
        """Write messages until the end, and close the bag; runs in a thread."""
        # Opened here, not by the caller: a database may belong to the thread that opened it.
        self._bag = self._open_bag()
        try:
            # Loads the translation of messages, so that the first ones need not wait for it.
            message_type("std_msgs/msg/Header", "", "", self._bag.encoding)
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
                topic.finish()

    def _write_all(self) -> None:
        """Write the messages in the queue until the end, and flush now and then."""
        due = time.monotonic() + FLUSH_PERIOD
        while True:
            try:
                entry = self._queue.get(timeout=max(due - time.monotonic(), 0.0))
            except queue.Empty:
                entry = []
            if entry is None:
                self._flush()
                return
            if isinstance(entry, RecordedTopic):
                self._begin(entry)
            else:
                self._write(entry)
            if time.monotonic() >= due:
                self._flush()
                due = time.monotonic() + FLUSH_PERIOD

    def _begin(self, topic: RecordedTopic) -> None:
        """Add a topic to the bag, or note why the bag cannot hold it."""
        try:
            schema, topic.convert = message_type(
                topic.type_name, topic.definition, topic.digest, self._bag.encoding
            )
        except InputError as error:
            self.refused[topic.name] = str(error)
            return
        written = self._bag.add_topic(topic.name, topic.type_name, topic.qos, schema)
        self._written[topic.name] = written
        self.topics[topic.name] = topic

    def _write(self, messages: list[Message]) -> None:
        """Write a batch of messages, topic by topic."""
        received: dict[BagTopic, tuple[list[int], list[bytes]]] = {}
        for name, t_ns, payload, stamp_ns in messages:
            topic = self.topics.get(name)
            if topic is None:
                continue
            try:
                converted = topic.convert(payload)
            except BrokenMessageError:
                self.broken += 1
                continue
            times, payloads = received.setdefault(self._written[name], ([], []))
            times.append(t_ns)
            payloads.append(converted)
            topic.take(t_ns, stamp_ns, payload)
        self._bag.write_blocks(
            [Block(topic, np.array(times), many) for topic, (times, many) in received.items()]
        )
        with self._lock:
            self._queued_bytes -= sum(len(message.payload) for message in messages)

    def _flush(self) -> None:
        """Flush everything to the file, and check that the file still exists."""
        self._bag.flush()
        self.size = self._bag.size
        self.files = self._bag.files
        for topic in self.topics.values():
            topic.update_clock()
        # Writing to a removed file keeps succeeding without a sign.
        path = self.files[-1]
        if not (path.exists() or active_path(path).exists()):
            raise InputError(f"{path}: it was removed while it was being written")
