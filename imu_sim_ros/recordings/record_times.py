# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Record times of messages whose stamps may go back."""

from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from imu_sim_ros.core.types import Times
from imu_sim_ros.recordings.order import (
    LONGEST_PAUSE_NS,
    RESET_READINGS,
    RESTART_NS,
    order_stamps,
    usual_step,
)


class RecordTimes:
    """Record times of messages whose stamps may go back, for a table that becomes a bag.

    They are the stamps; a late or stray one is recorded with the message before it, and behind a
    reset the clock of recording goes on from the last message. So readers, which take messages in
    the order of their record times, find them in the order of the table.
    """

    def __init__(self) -> None:
        """Initialise without stamps."""
        self._latest_ns: int | None = None
        self._offset_ns = 0
        """Record time less stamp [ns]."""

    def of(self, t_ns: Times) -> Times:
        """Return the record times of the next messages, which never go back.

        :param t_ns: (n,) stamps in the order of the table [ns].
        """
        if not len(t_ns):
            return t_ns
        order, step_ns = order_stamps(t_ns), int(usual_step(t_ns))
        usual = np.delete(np.arange(len(t_ns)), order.strays)
        if not len(usual):
            usual = np.arange(len(t_ns))
        latest_ns = int(t_ns[usual[0]]) if self._latest_ns is None else self._latest_ns
        times = np.full(len(t_ns), latest_ns, dtype=np.int64)
        for begin, end in pairwise([0, *order.resets.tolist(), len(t_ns)]):
            rows = usual[(usual >= begin) & (usual < end)]
            if not len(rows):
                continue
            step_back = latest_ns - (int(t_ns[rows[0]]) + self._offset_ns)
            if step_back > RESTART_NS or (begin and step_back > 0):
                self._offset_ns += step_back + step_ns
            times[rows] = t_ns[rows] + self._offset_ns
            latest_ns = max(latest_ns, int(times[rows].max()))
        self._latest_ns = latest_ns
        return np.maximum.accumulate(times)


@dataclass
class _TopicTime:
    """Record time of the latest message of a topic."""

    latest_ns: int
    offset_ns: int = 0
    """Record time less stamp [ns]."""
    distant_count: int = 0
    """Number of the latest stamps in a row that are far from those before them."""


class LiveRecordTimes:
    """Record times of messages of several topics as they arrive; see :class:`RecordTimes`.

    Up to four stamps in a row that are far from those before them are stray, or the start of a
    reset; they are recorded with the message before them. Topics that are reset together keep
    their distances.
    """

    def __init__(self) -> None:
        """Initialise without stamps."""
        self._offset_ns = 0
        self._topics: dict[str, _TopicTime] = {}

    def latest(self, topic: str) -> int | None:
        """Return the record time of the latest message of a topic, None if there is none."""
        time = self._topics.get(topic)
        return None if time is None else time.latest_ns

    def of(self, topic: str, stamp_ns: int) -> int:
        """Return the record time of the next message of a topic, which is its stamp in order."""
        time = self._topics.get(topic)
        if time is None:
            self._topics[topic] = _TopicTime(stamp_ns)
            return stamp_ns
        t_ns = stamp_ns + time.offset_ns
        if not _follows(time.latest_ns, t_ns):
            time.distant_count += 1
            if time.distant_count < RESET_READINGS:
                return time.latest_ns
            if t_ns < time.latest_ns:
                if not _follows(time.latest_ns, stamp_ns + self._offset_ns):
                    self._offset_ns = time.latest_ns - stamp_ns
                time.offset_ns = self._offset_ns
                t_ns = stamp_ns + time.offset_ns
        time.distant_count, time.latest_ns = 0, max(time.latest_ns, t_ns)
        return t_ns


def _follows(latest_ns: int, t_ns: int) -> bool:
    """Return True for a time that is neither before a reset nor behind a pause of a day."""
    return -RESTART_NS <= t_ns - latest_ns <= LONGEST_PAUSE_NS
