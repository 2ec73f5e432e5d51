# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Messages as a bag records them: with their time, that of the stamp or of the reception."""

import struct
import time
from collections.abc import Iterable
from typing import NamedTuple

from rclpy.clock import ROSClock
from rclpy.node import Node

from imu_sim_ros.nodes.topics import Taken

_STAMPS = {0: struct.Struct(">iI"), 1: struct.Struct("<iI")}


class Message(NamedTuple):
    """One message as received."""

    topic: str
    t_ns: int
    """The time that a bag records: that of the stamp or of the reception."""
    payload: bytes
    stamp_ns: int | None = None
    """The stamp; None where there is none or it was never set."""


class Timestamps:
    """Gives the messages that were taken their times.

    :param node: its clock counts where time is simulated.
    :param by_reception: a message's time is that of its reception, stamp or not.
    """

    def __init__(self, node: Node, by_reception: bool) -> None:
        self._node, self._by_reception = node, by_reception
        self._offsets: dict[str, int | None] = {}

    def add_topic(self, topic: str, stamp_offset: int | None) -> None:
        """Add a topic.

        :param stamp_offset: where the stamp is in the bytes; None: the time of reception counts.
        """
        self._offsets[topic] = stamp_offset

    def messages(self, topic: str, taken: Iterable[Taken]) -> list[Message]:
        """Return the messages of one topic with their times."""
        offset = self._offsets[topic]
        result: list[Message] = []
        for payload, info in taken:
            stamp_ns = _stamp_ns(payload, offset)
            t_ns = stamp_ns
            if t_ns is None or self._by_reception:
                t_ns = self._now(info)
            result.append(Message(topic, t_ns, payload, stamp_ns))
        return result

    def _now(self, info: dict[str, int]) -> int:
        clock = self._node.get_clock()
        if isinstance(clock, ROSClock) and clock.ros_time_is_active:
            return clock.now().nanoseconds
        return info["received_timestamp"] or time.time_ns()


def _stamp_ns(payload: bytes, offset: int | None) -> int | None:
    """Return the stamp [ns] in a message's bytes; None where there is none that a bag can hold.

    A stamp of zero, the header's default, was never set.
    """
    if offset is None or len(payload) < offset + 8:  # a TFMessage may be empty
        return None
    second, nanosecond = _STAMPS[payload[1] & 1].unpack_from(payload, offset)
    t_ns: int = second * 1_000_000_000 + nanosecond
    return t_ns if t_ns > 0 else None
