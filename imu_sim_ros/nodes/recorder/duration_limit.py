# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""The end of a recording after a time: counted on the stamps of each topic, not on arrivals."""

from collections.abc import Iterable
from dataclasses import dataclass

from imu_sim_ros.nodes.topics import Message

_QUIET = 1.0
"""[s] A topic from which nothing came for so long is not waited for."""


@dataclass
class _Topic:
    first_ns: int
    last_ns: int
    seen_at: float
    complete: bool = False


class DurationLimit:
    """Lets the messages of a topic pass until their stamps are a time past its first one.

    So 8 s of a topic at 200 Hz are 1600 messages, whatever the speed at which they come.
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
        # A first stamp that was never set stands for the time of reception, perhaps much later.
        topic.first_ns = min(topic.first_ns, *(message.t_ns for message in messages))
        end_ns = topic.first_ns + self._length_ns
        if max(message.t_ns for message in messages) < end_ns:
            return messages
        topic.complete = True
        return [message for message in messages if message.t_ns < end_ns]

    def reached(self, elapsed: float, now: float) -> bool:
        """Return whether every topic that still comes has had its time.

        :param elapsed: since the first message, on the clock of the node [s]. Decides where stamps
            make no progress: they do not advance, or nothing arrives any more.
        """
        if not self._length_ns:
            return False
        topics = list(self._topics.values())
        if not any(topic.complete for topic in topics) and elapsed < self._duration:
            return False
        return bool(topics) and not any(_is_awaited(topics, now))


def _is_awaited(topics: Iterable[_Topic], now: float) -> Iterable[bool]:
    """Yield for each topic whether it moves and has not had its time."""
    for topic in topics:
        moves = topic.last_ns != topic.first_ns and now - topic.seen_at <= _QUIET
        yield moves and not topic.complete
