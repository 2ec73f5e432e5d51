# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Losses as the stamps of a topic reveal them, counted in constant memory as messages arrive."""

import numpy as np

from imu_sim_ros.core.types import Integers

_WINDOW = 256
"""Intervals whose median is the usual one."""
_RESTART_NS = 1_000_000_000
"""A longer step back is a restart."""
_GAP_FACTOR = 1.5
"""Intervals longer than this many usual ones are gaps."""


class StampStatistics:
    """Counts gaps, repeated stamps and stamps out of order of one topic.

    Stamps are taken in batches. Within a batch they are sorted before intervals are examined, so
    that two swapped messages are out of order but leave no gap. A step back by more than a second
    is a clock that was set back or a source that restarted; it, too, is counted as out of order,
    and counting begins again at the next stamp.

    :param max_gap_ns: intervals above it are gaps; 0: above 1.5 times the median of the last 256.
    """

    def __init__(self, max_gap_ns: int = 0) -> None:
        self.messages = 0
        self.gaps = 0
        self.missing = 0
        self.duplicates = 0
        self.out_of_order = 0
        self.first_ns: int | None = None
        self.last_ns: int | None = None
        self._max_gap_ns = max_gap_ns
        self._latest: int | None = None
        self._previous: int | None = None
        self._distances = np.empty(0, dtype=np.int64)

    def add(self, t_ns: Integers) -> None:
        """Take the next stamps, in the order of their arrival.

        :param t_ns: (n,) stamps [ns].
        """
        if len(t_ns) == 0:
            return
        self.messages += len(t_ns)
        self.first_ns = int(t_ns[0]) if self.first_ns is None else self.first_ns
        self.last_ns = int(t_ns[-1])
        previous_ns = t_ns[0] if self._previous is None else self._previous
        steps = np.diff(t_ns, prepend=previous_ns)
        self.out_of_order += int(np.count_nonzero(steps < 0))
        self._previous = int(t_ns[-1])
        for part in np.split(t_ns, np.flatnonzero(steps < -_RESTART_NS)):
            self._add_run(part)

    @property
    def usual_distance_ns(self) -> int:
        """The median interval of the last stamps; 0 before there are two."""
        return int(np.median(self._distances)) if len(self._distances) else 0

    @property
    def rate(self) -> float:
        """Messages per second from first to last stamp [Hz]; 0 if that has no meaning."""
        if self.first_ns is None or self.last_ns is None or self.last_ns <= self.first_ns:
            return 0.0
        return (self.messages - 1) * 1e9 / (self.last_ns - self.first_ns)

    def _add_run(self, t_ns: Integers) -> None:
        """Take stamps between which the source did not restart."""
        if len(t_ns) == 0:
            return
        ordered = np.sort(t_ns)
        latest = self._latest
        if latest is not None and ordered[0] < latest - _RESTART_NS:
            latest = None
        if latest is not None:
            # Late stamps lie below the latest: they were missing there and counted as a gap.
            ordered = np.concatenate([[latest], ordered[ordered >= latest]])
        self._latest = int(ordered[-1])
        distances = np.diff(ordered)
        self.duplicates += int(np.count_nonzero(distances == 0))
        distances = distances[distances > 0]
        self._distances = np.concatenate([self._distances, distances])[-_WINDOW:]
        self._count_gaps(distances)

    def _count_gaps(self, distances: Integers) -> None:
        usual = self.usual_distance_ns
        limit = self._max_gap_ns or _GAP_FACTOR * usual
        wide = distances[distances > limit]
        self.gaps += len(wide)
        if usual:
            self.missing += int(np.sum(np.rint(wide / usual))) - len(wide)
