# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""The end of a recording after a time: counted on the stamps of each topic, not on arrivals."""

from collections.abc import Iterable
from dataclasses import dataclass

from imu_sim_ros.nodes.recorder.messages import Message

_QUIET = 1.0
"""[s] A topic that has been silent for this long is not waited for."""


@dataclass
class _Topic:
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

    def take(self, messages: list[Message], now: float) -> list[Message]:
        """Return those of one topic's messages that lie within its time.

        :param now: on the steady clock [s].
        """
        if not self._length_ns or not messages:
            return messages
        first, last = messages[0], messages[-1]
        topic = self._topics.get(first.topic)
        if topic is None:
            topic = self._topics[first.topic] = _Topic(first.t_ns, first.t_ns, now)
        topic.last_ns, topic.seen_at = last.t_ns, now
        # For a first stamp that was never set the time of reception, perhaps much later, is used.
        topic.first_ns = min(topic.first_ns, *(message.t_ns for message in messages))
        end_ns = topic.first_ns + self._length_ns
        if max(message.t_ns for message in messages) < end_ns:
            return messages
        topic.complete = True
        return [message for message in messages if message.t_ns < end_ns]

    def reached(self, elapsed: float, now: float) -> bool:
        """Return whether every topic that is still active has reached the limit.

        :param elapsed: since the first message, on the clock of the node [s]. Decides where stamps
            do not advance, or nothing arrives any more.
        """
        if not self._length_ns:
            return False
        topics = list(self._topics.values())
        if not any(topic.complete for topic in topics) and elapsed < self._duration:
            return False
        return bool(topics) and not any(_is_awaited(topics, now))


def _is_awaited(topics: Iterable[_Topic], now: float) -> Iterable[bool]:
    """Yield for each topic whether it is active and has not reached the limit."""
    for topic in topics:
        moves = topic.last_ns != topic.first_ns and now - topic.seen_at <= _QUIET
        yield moves and not topic.complete
