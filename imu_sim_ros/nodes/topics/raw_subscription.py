# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Subscriptions that one thread empties at its own pace, as bytes.

An executor wakes up for every message and builds a new wait set each time, some 70 us of Python; a
thread that takes whatever has accumulated every few milliseconds needs a few microseconds. The
middleware's queue holds the messages meanwhile.
"""

import struct
import threading
import time
from collections.abc import Callable, Iterable
from typing import Any, NamedTuple

from rclpy.callback_groups import CallbackGroup
from rclpy.clock import ROSClock
from rclpy.node import Node
from rclpy.qos import DurabilityPolicy, HistoryPolicy, QoSProfile, ReliabilityPolicy

from imu_sim_ros.bags.messages import Qos
from imu_sim_ros.nodes.supervised_thread import Fail, SupervisedThread

DEPTH = 5000
"""Messages that wait in the middleware: 2.5 s at 2 kHz, while the machine does other things."""

_STAMPS = {0: struct.Struct(">iI"), 1: struct.Struct("<iI")}


class Message(NamedTuple):
    """One message as received."""

    topic: str
    t_ns: int
    """The time that a bag records: that of the stamp or of the reception."""
    payload: bytes
    stamp_ns: int | None = None
    """The stamp; None where there is none or it was never set."""


class _OutsideTheExecutor(CallbackGroup):
    """A group whose members the executor leaves alone."""

    def can_execute(self, entity: Any) -> bool:
        return False

    def beginning_execution(self, entity: Any) -> bool:
        return False

    def ending_execution(self, entity: Any) -> None:
        raise AssertionError("nothing of this group is ever executed")


class _Source(NamedTuple):
    name: str
    subscription: Any
    stamp_offset: int | None


class RawSubscriptions:
    """Takes the messages of all subscribed topics and delivers them in batches.

    :param deliver: receives the messages of one topic, in the reader's thread.
    :param fail: receives the error that this raised; no more messages are taken.
    :param period: polling period [s].
    :param by_reception: a message's time is that of its reception, stamp or not.
    """

    def __init__(
        self,
        node: Node,
        deliver: Callable[[list[Message]], None],
        fail: Fail,
        period: float,
        by_reception: bool = False,
    ) -> None:
        self.first_at = 0.0
        """When the first message was taken, on the steady clock [s]; 0 before."""
        self._node, self._deliver, self._period = node, deliver, period
        self._by_reception = by_reception
        self._group = _OutsideTheExecutor()
        self._sources: dict[str, _Source] = {}
        self._lock = threading.Lock()
        self._ended = threading.Event()
        self._thread = SupervisedThread("reader", self._run, fail)
        self._thread.start()

    def subscribe(self, name: str, message: Any, qos: QoSProfile, stamp_offset: int | None) -> None:
        """Subscribe to a topic; an older subscription of it is emptied and replaced.

        :param stamp_offset: where the stamp is in the bytes; None: the time of reception counts.
        """
        with self._lock:
            old = self._sources.pop(name, None)
            if old is not None:
                self._pass_on(old)
                self._node.destroy_subscription(old.subscription)
            subscription = self._node.create_subscription(
                message, name, _never, qos, raw=True, callback_group=self._group
            )
            self._sources[name] = _Source(name, subscription, stamp_offset)

    def close(self) -> None:
        """Take what has arrived and end the thread."""
        self._ended.set()
        self._thread.join()

    def _run(self) -> None:
        while not self._ended.wait(self._period):
            self._look()
        self._look()

    def _look(self) -> None:
        with self._lock:
            for source in self._sources.values():
                self._pass_on(source)

    def _pass_on(self, source: _Source) -> None:
        messages = self._take(source)
        if messages:
            self.first_at = self.first_at or time.monotonic()
            self._deliver(messages)

    def _take(self, source: _Source) -> list[Message]:
        take, message = source.subscription.handle.take_message, source.subscription.msg_type
        result: list[Message] = []
        while len(result) < DEPTH and (taken := take(message, True)) is not None:
            payload, info = taken
            stamp_ns = _stamp_ns(payload, source.stamp_offset)
            t_ns = stamp_ns
            if t_ns is None or self._by_reception:
                t_ns = self._now(info)
            result.append(Message(source.name, t_ns, payload, stamp_ns))
        return result

    def _now(self, info: dict[str, int]) -> int:
        clock = self._node.get_clock()
        if isinstance(clock, ROSClock) and clock.ros_time_is_active:
            return clock.now().nanoseconds
        return info["received_timestamp"] or time.time_ns()


def _never(message: bytes) -> None:
    raise AssertionError("the reader takes messages itself")


def _stamp_ns(payload: bytes, offset: int | None) -> int | None:
    """Return the stamp [ns] in a message's bytes; None where there is none that a bag can hold.

    A stamp of zero, the header's default, was never set.
    """
    if offset is None or len(payload) < offset + 8:  # a TFMessage may be empty
        return None
    second, nanosecond = _STAMPS[payload[1] & 1].unpack_from(payload, offset)
    t_ns: int = second * 1_000_000_000 + nanosecond
    return t_ns if t_ns > 0 else None


def offered_qos(publishers: Iterable[Any]) -> tuple[Qos, ...]:
    """Return what the publishers offer, each distinct profile once, in the terms of a bag."""
    profiles = (publisher.qos_profile for publisher in publishers)
    words = {
        Qos(
            _word(profile.reliability),
            _word(profile.durability),
            # The graph does not reveal the history of others: rosbag2 writes keep_last, too.
            "keep_last",
            max(profile.depth, 10),
        ): None
        for profile in profiles
    }
    return tuple(words)


def _word(policy: Any) -> str:
    return str(policy.name).lower()


def matching_qos(publishers: Iterable[Any], depth: int = DEPTH) -> QoSProfile:
    """Return the strictest profile that all of the publishers satisfy.

    :param publishers: ``TopicEndpointInfo`` of each.
    """
    profiles = [publisher.qos_profile for publisher in publishers]
    reliable = all(p.reliability == ReliabilityPolicy.RELIABLE for p in profiles)
    keeps = all(p.durability == DurabilityPolicy.TRANSIENT_LOCAL for p in profiles)
    return QoSProfile(
        history=HistoryPolicy.KEEP_LAST,
        depth=depth,
        reliability=ReliabilityPolicy.RELIABLE if reliable else ReliabilityPolicy.BEST_EFFORT,
        durability=DurabilityPolicy.TRANSIENT_LOCAL if keeps else DurabilityPolicy.VOLATILE,
    )


def is_weaker(new: QoSProfile, old: QoSProfile) -> bool:
    """Return whether a subscription must request less than before to match all publishers."""
    less_reliable = new.reliability == ReliabilityPolicy.BEST_EFFORT != old.reliability
    less_durable = new.durability == DurabilityPolicy.VOLATILE != old.durability
    return bool(less_reliable or less_durable)
