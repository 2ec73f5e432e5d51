# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Subscriptions to what publishers offer, which one thread empties at its own pace, as bytes.

An executor wakes up for every message and builds a new wait set each time, which is slow in Python;
a thread that takes all messages every few milliseconds costs much less. The middleware's queue
holds the messages meanwhile.
"""

import threading
import time
from collections.abc import Callable, Iterable, Mapping
from functools import partial
from typing import Any, Final, NamedTuple

from rclpy.callback_groups import CallbackGroup
from rclpy.clock import Clock, ClockType
from rclpy.context import Context
from rclpy.event_handler import SubscriptionEventCallbacks
from rclpy.node import Node
from rclpy.qos import DurabilityPolicy, HistoryPolicy, QoSProfile, ReliabilityPolicy
from rclpy.subscription import Subscription
from rclpy.topic_endpoint_info import TopicEndpointInfo

from imu_sim_ros.bags.messages.schemas import Qos
from imu_sim_ros.nodes.lifetime import Fail, SupervisedThread
from imu_sim_ros.nodes.parameters import ConfiguredNode
from imu_sim_ros.recordings.live_strays import RELEASE_PERIOD

DEPTH: Final = 5000
"""Messages that wait in the middleware: 2.5 s at 2 kHz, while the machine does other things."""

_MARGIN_NS: Final = 150_000
"""A look comes this much after the message is due: the usual lateness of a publisher."""
_TOLERANCE: Final = 0.25
"""Relative tolerance of the mean interval of a look."""
_TRUSTED: Final = 5
"""Number of looks with regular intervals from which on more are expected; a look with others
takes as many away."""
_MAX_TRUSTED: Final = 20
"""Largest number of regular looks that are counted."""
_SMOOTHING: Final = 0.125
"""Weight of the newest interval in the mean one."""
_NEARLY: Final = 0.1
"""A period counts as a multiple of the interval if at most this share of one is missing."""
_LONGEST_NS: Final = 10_000_000
"""No look is farther away than this: another topic may have something."""
_MATCHING_PERIOD: Final = 0.02
"""Period of looking for publishers of the inputs, until each has one [s]."""
_COUNTING_PERIOD: Final = 0.1
"""Time between looks for messages that are only counted [s]."""
_CHANGE_PERIOD: Final = 0.5
"""Period of looking for publishers afterwards [s]."""

Taken = tuple[bytes, dict[str, int]]
"""A message's bytes, and its data from the middleware: ``received_timestamp`` and so on."""


_NO_WARNINGS: Final = SubscriptionEventCallbacks(use_default_callbacks=False)
"""The nodes request what is offered as soon as a publisher of less appears; rclpy's warning comes
before."""


class _OutsideTheExecutor(CallbackGroup):
    """A group whose members the executor leaves alone."""

    def can_execute(self, entity: object) -> bool:
        """Return False: the reader takes the messages."""
        return False

    def beginning_execution(self, entity: object) -> bool:
        """Return False: the reader takes the messages."""
        return False

    def ending_execution(self, entity: object) -> None:
        """Refuse to end what never begins."""
        raise AssertionError("nothing of this group is ever executed")


class PollTimer:
    """Decides how long to wait before the next look.

    :param period: time between looks if arrivals are irregular; if they are regular, how long a
        message may wait for others [s].
    """

    def __init__(self, period: float) -> None:
        self._period_ns = period * 1e9
        self._last_ns = 0
        self._interval = 0.0
        """Smoothed time between arrivals [ns]."""
        self._trust = 0

    def wait(self, count: int, last_ns: int, now_ns: int) -> float:
        """Return how long to wait before the next look [s].

        :param count: how many messages the latest look found.
        :param last_ns: when the last of them arrived; does not matter if there is none.
        :param now_ns: the time on the same clock.
        """
        if count:
            interval = (last_ns - self._last_ns) / count
            self._last_ns = last_ns
            off = interval - self._interval
            if abs(off) <= _TOLERANCE * self._interval:
                self._trust = min(self._trust + 1, _MAX_TRUSTED)
                self._interval += _SMOOTHING * off
                passed = now_ns - last_ns
                if self._trust >= _TRUSTED and 0 <= passed < _LONGEST_NS:
                    messages = 1 + int(self._period_ns / self._interval + _NEARLY)
                    delay = messages * self._interval + _MARGIN_NS - passed
                    return max(0.0, min(delay, _LONGEST_NS)) * 1e-9
            else:
                self._trust = max(self._trust - _TRUSTED, 0)
                if not self._trust:
                    self._interval = max(interval, 0.0)
        return self._period_ns * 1e-9


class _Source(NamedTuple):
    """A subscription, and the function that takes its next message."""

    name: str
    subscription: Subscription
    take: Callable[[], Taken | None]


class RawSubscriptions:
    """Takes the messages of all subscribed topics and delivers them in batches.

    :param deliver: receives a topic and messages of it, in the reader's thread.
    :param fail: receives the error that this raised; no more messages are taken.
    :param period: time between looks for messages [s].
    :param leading: a topic in step with which messages are looked for if they arrive regularly,
        see :class:`PollTimer`; None: none.
    :param release: is called every :data:`RELEASE_PERIOD` in the reader's thread, once there is a
        subscription; None: nothing is.
    """

    def __init__(
        self,
        node: Node,
        deliver: Callable[[str, list[Taken]], None],
        fail: Fail,
        period: float,
        leading: str | None = None,
        release: Callable[[], None] | None = None,
    ) -> None:
        self.first_at = 0.0
        """Time at which the first message was taken, on the steady clock [s]; 0 before."""
        self._node, self._deliver, self._period = node, deliver, period
        self._leading, self._pace, self._release = leading, PollTimer(period), release
        self._group = _OutsideTheExecutor()
        self._sources: dict[str, _Source] = {}
        self._lock = threading.Lock()
        self._subscribed, self._ended = threading.Event(), False
        self._thread = SupervisedThread("reader", self._run, fail)
        self._thread.start()

    def subscribe(self, name: str, message: type, qos: QoSProfile) -> None:
        """Subscribe to a topic; an older subscription of it is emptied and replaced.

        The middleware may take long for it: the other topics are read meanwhile.
        """
        with self._lock:
            source = self._sources.pop(name, None)
            if source is not None:
                self._pass_on(source)
        if source is not None:
            self._node.destroy_subscription(source.subscription)
        subscription = self._node.create_subscription(
            message,
            name,
            _never,
            qos,
            raw=True,
            callback_group=self._group,
            event_callbacks=_NO_WARNINGS,
        )
        take = partial(subscription.handle.take_message, subscription.msg_type, True)
        with self._lock:
            self._sources[name] = _Source(name, subscription, take)
        self._subscribed.set()

    def close(self) -> None:
        """Process the messages so far and end the thread."""
        self._ended = True
        self._subscribed.set()
        self._thread.join()

    def _run(self) -> None:
        """Take the messages of all topics until the end; runs in a thread."""
        self._subscribed.wait()
        delay, release_s = self._period, time.monotonic()
        while not self._ended:
            # Waiting for an event would take longer; the end waits for this instead.
            time.sleep(delay)
            leading = self._look()
            if self._release is not None and time.monotonic() >= release_s:
                release_s = time.monotonic() + RELEASE_PERIOD
                self._release()
            if self._leading is not None:
                last_ns = leading[-1][1]["received_timestamp"] if leading else 0
                delay = self._pace.wait(len(leading), last_ns, time.time_ns())
        self._look()

    def _look(self) -> list[Taken]:
        """Pass on the messages so far; return those of the leading topic."""
        leading: list[Taken] = []
        with self._lock:
            for source in self._sources.values():
                batch = self._pass_on(source)
                if source.name == self._leading:
                    leading = batch
        return leading

    def _pass_on(self, source: _Source) -> list[Taken]:
        """Deliver the waiting messages of one topic."""
        batch: list[Taken] = []
        while len(batch) < DEPTH and (message := source.take()) is not None:
            batch.append(message)
        if batch:
            self.first_at = self.first_at or time.monotonic()
            self._deliver(source.name, batch)
        return batch


class MessageCounter:
    """Counts the messages of a topic that its node subscribes to with another type.

    A DDS participant has one type for each topic, so the counter has a participant of its own.
    """

    def __init__(
        self,
        node: Node,
        topic: str,
        message: type,
        qos: QoSProfile,
        fail: Fail,
    ) -> None:
        """Begin to count.

        :param node: node whose domain is used, and whose name identifies the counter in the graph.
        """
        self.messages = 0
        """Messages received."""
        self._context = Context()
        self._context.init(domain_id=node.context.get_domain_id())
        self._node = Node(
            node.get_name(),
            context=self._context,
            namespace=node.get_namespace(),
            use_global_arguments=False,
            enable_rosout=False,
            start_parameter_services=False,
        )
        self._reader = RawSubscriptions(self._node, self._count, fail, _COUNTING_PERIOD)
        self._reader.subscribe(topic, message, qos)

    def close(self) -> None:
        """Count the messages so far and leave the graph."""
        self._reader.close()
        self._node.destroy_node()
        self._context.shutdown()

    def _count(self, topic: str, batch: list[Taken]) -> None:
        """Count messages."""
        self.messages += len(batch)


def _never(message: bytes) -> None:
    """Refuse a message from the executor, which has none to give."""
    raise AssertionError("the reader takes messages itself")


def publisher_qos(publishers: Iterable[TopicEndpointInfo]) -> tuple[Qos, ...]:
    """Return the QoS profiles of the publishers, each distinct one once, in the terms of a bag."""
    profiles = (publisher.qos_profile for publisher in publishers)
    distinct = {
        Qos(
            profile.reliability.name.lower(),
            profile.durability.name.lower(),
            # The graph does not reveal the history of others: rosbag2 writes keep_last, too.
            "keep_last",
            max(profile.depth, 10),
        ): None
        for profile in profiles
    }
    return tuple(distinct)


def matching_qos(publishers: Iterable[TopicEndpointInfo], depth: int = DEPTH) -> QoSProfile:
    """Return the strictest profile that all of the publishers satisfy."""
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


class MatchedInputs:
    """Subscribes to topics once they have publishers, with a quality that all of them offer.

    A request of more matches no publisher and makes each of them warn; one of less may lose
    readings under load. So nothing is requested before a publisher is there.
    """

    def __init__(
        self,
        node: ConfiguredNode[Any],
        reader: RawSubscriptions,
        inputs: Callable[[], Mapping[str, type]],
        depth: int,
    ) -> None:
        """Begin to look for publishers.

        :param inputs: returns the topics with their message classes.
        """
        self._node, self._reader, self._inputs, self._depth = node, reader, inputs, depth
        self._qos: dict[str, QoSProfile] = {}
        # On the steady clock: with use_sim_time and a silent /clock, the node's own stops.
        steady = Clock(clock_type=ClockType.STEADY_TIME)
        self._timer = node.create_timer(_MATCHING_PERIOD, self._match, clock=steady)

    def _match(self) -> None:
        """Subscribe to each topic with the quality of service that its publishers offer."""
        inputs = self._inputs()
        for topic, message in inputs.items():
            publishers = self._node.get_publishers_info_by_topic(topic)
            if not publishers:
                continue
            offered, requested = matching_qos(publishers, self._depth), self._qos.get(topic)
            offered.durability = DurabilityPolicy.VOLATILE  # readings of the past are of no use
            if requested is None or is_weaker(offered, requested):
                if offered.reliability == ReliabilityPolicy.BEST_EFFORT:
                    self._node.get_logger().info(
                        f"{topic} is offered as best effort; subscribing likewise"
                    )
                self._qos[topic] = offered
                self._reader.subscribe(topic, message, offered)
        if len(self._qos) == len(inputs):
            self._timer.timer_period_ns = round(_CHANGE_PERIOD * 1e9)
