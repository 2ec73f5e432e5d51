# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Topics that stop while others go on."""

from dataclasses import dataclass
from typing import Final, NamedTuple

_SHORTEST: Final = 3.0
"""Shortest silence of a topic that is a stop [s]."""
_INTERVALS: Final = 10.0
"""Length of a silence in mean intervals of the topic from which on it is a stop."""
_LEAST_MESSAGES: Final = 10
"""Number of messages from which on the mean interval is known."""


class Stop(NamedTuple):
    """A topic without messages while others have some."""

    topic: str
    """Name of the topic."""
    silence: float
    """Time from its latest message to the latest of any topic [s]."""


@dataclass
class _Arrivals:
    """The arrivals of the messages of one topic."""

    first_s: float
    latest_s: float
    count: int = 0
    reported: bool = False

    def shortest_stop(self) -> float:
        """Return the silence from which on the topic has stopped [s]."""
        return max(_SHORTEST, _INTERVALS * (self.latest_s - self.first_s) / (self.count - 1))


class TopicStops:
    """Finds topics that stop; seldom ones, such as those of settings, are none."""

    def __init__(self) -> None:
        """Initialise without topics."""
        self._arrivals: dict[str, _Arrivals] = {}

    def add(self, topic: str, count: int, time_s: float) -> None:
        """Add messages of a topic that arrive at a time [s]."""
        arrivals = self._arrivals.get(topic)
        if arrivals is None:
            arrivals = self._arrivals[topic] = _Arrivals(time_s, time_s)
        arrivals.latest_s = time_s
        arrivals.count += count

    def all(self) -> list[Stop]:
        """Return the topics that have stopped."""
        topics = list(self._arrivals.items())
        latest_s = max((arrivals.latest_s for _, arrivals in topics), default=0.0)
        return [
            Stop(topic, latest_s - arrivals.latest_s)
            for topic, arrivals in topics
            if arrivals.count >= _LEAST_MESSAGES
            and latest_s - arrivals.latest_s > arrivals.shortest_stop()
        ]

    def changes(self) -> tuple[list[Stop], list[str]]:
        """Return the topics that have stopped, and those that go on again, since the last call."""
        stops = {stop.topic: stop for stop in self.all()}
        begun, ended = [], []
        for topic, arrivals in list(self._arrivals.items()):
            stop = stops.get(topic)
            if stop is not None and not arrivals.reported:
                begun.append(stop)
            elif stop is None and arrivals.reported:
                ended.append(topic)
            arrivals.reported = stop is not None
        return begun, ended
