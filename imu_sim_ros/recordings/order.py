# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Order of stamps: stretches of one time, late readings, stray stamps and resets."""

import math
from collections import deque
from typing import Final, NamedTuple

import numpy as np

from imu_sim_ros.core.types import Integers, Times

RESTART_NS: Final = 1_000_000_000
"""A longer step back is a clock that was reset [ns]."""
RESET_READINGS: Final = 5
"""Number of earlier stamps in a row from which on the clock was reset."""
STRAY_READINGS: Final = RESET_READINGS - 1
"""Largest number of neighbouring readings whose stamps can be stray."""
LONGEST_PAUSE_NS: Final = 86_400_000_000_000
"""A step forward of more, from or to a few readings, makes their stamps stray [ns]."""
CLOCK_CHANGE_NS: Final = 100_000_000_000_000_000
"""A step forward of more (three years) is another clock: time since boot turns into UTC [ns]."""
_USUAL: Final = 65536
"""Stamps of which the usual step is taken."""
LONGEST_LOSS: Final = 10.0
"""Number of missing readings in a row that is a loss at any rate."""


_LONGEST_GAP: Final = 1e10
"""Length of a gap [s] above which every step between two stamps is allowed."""
_ROUNDING: Final = 1e-3
"""Error of a product that is a whole number of nanoseconds [ns]."""
READINGS_GAP: Final = 0.1
"""Longest step between readings that is no gap at any rate [s]."""
POSES_GAP: Final = 0.5
"""Longest step between poses that is no gap at any rate [s]."""
_USUAL_STEPS: Final = 2.5
"""Length of a gap in usual steps: one lost reading is none."""
_SLOWEST_GAP: Final = 2.0
"""Longest step that is no gap unless it is allowed, however slow the rate is [s]."""
_FEWEST_STEPS: Final = 3
"""Number of steps from which on the usual one can be told."""
_RECENT_STEPS: Final = 99
"""Number of the latest steps whose median is the usual one of a live stream."""


def longest_step_ns(max_gap: float) -> float:
    """Return the longest step that is no gap [ns], in whole nanoseconds if it is finite.

    Stamps are rounded to nanoseconds: steps of 300 Hz are a third of one shorter or longer.
    """
    return math.ceil(max_gap * 1e9 - _ROUNDING) if max_gap < _LONGEST_GAP else math.inf


def gap_length(max_gap: float, shortest: float, t_ns: Times) -> float:
    """Return the longest step between stamps that is no gap [s].

    If it is not stated, it is 2.5 times the usual step, at least ``shortest`` and at most 2 s.

    :param max_gap: as stated [s]; 0: it suits the rate.
    :param shortest: longest step that is no gap at any rate [s].
    :param t_ns: (n,) stamps [ns].
    """
    if max_gap:
        return max_gap
    if len(t_ns) <= _FEWEST_STEPS:
        return _usual_gap(0.0, shortest)
    largest_step = float(np.diff(t_ns[:_USUAL]).max())
    if largest_step > 0.0 and _usual_gap(largest_step, shortest) == shortest:
        return shortest  # whatever the median is
    return _usual_gap(usual_step(t_ns), shortest)


def _usual_gap(step_ns: float, shortest: float) -> float:
    """Return the longest step that is no gap [s] by the usual step [ns]."""
    return max(shortest, min(_USUAL_STEPS * step_ns * 1e-9, _SLOWEST_GAP))


class LiveGap:
    """The longest step that is no gap in a stream, by the stamps so far; see :func:`gap_length`."""

    def __init__(self, max_gap: float, shortest: float) -> None:
        """Initialise without stamps.

        :param max_gap, shortest: as in :func:`gap_length`.
        """
        self._shortest = shortest
        self._shortest_ns = longest_step_ns(shortest)
        self.longest_step_ns = longest_step_ns(max_gap or shortest)
        """Longest step that is no gap [ns]."""
        self.is_known = True
        """False while the first steps are too few to tell whether they are gaps."""
        self._steps: deque[int] | None = None if max_gap else deque(maxlen=_RECENT_STEPS)
        self._t_ns: int | None = None

    @property
    def usual_step_ns(self) -> float:
        """Median of the latest steps [ns]; 0: there is none, or the gap is stated."""
        return sorted(self._steps)[len(self._steps) // 2] if self._steps else 0.0

    def add(self, t_ns: int) -> None:
        """Add the next stamp."""
        steps = self._steps
        if steps is None:
            return
        step = 0 if self._t_ns is None else t_ns - self._t_ns
        self._t_ns = t_ns
        if step <= 0:
            return
        steps.append(step)
        if step > self._shortest_ns or not self.is_known:
            gap = _usual_gap(self.usual_step_ns, self._shortest)
            self.longest_step_ns = longest_step_ns(gap)
            self.is_known = len(steps) >= _FEWEST_STEPS

    def is_gap(self, step_ns: int) -> bool:
        """Return True if a step cannot be integrated over: back, none, or too long [ns]."""
        return not 0 < step_ns <= self.longest_step_ns


def longest_loss(interval_ns: float) -> float:
    """Return the largest number of consecutive missing readings that is a loss, not a pause.

    Ten readings, or a second if that is more.
    """
    return max(LONGEST_LOSS, 1e9 / interval_ns)


class StampOrder(NamedTuple):
    """Rows of n stamps by their kind: in order, late, stray, after a reset."""

    pieces: tuple[Integers, ...]
    """Rows of each stretch of one time, sorted by stamp."""
    strays: Integers
    """Rows with stray stamps."""
    late: Integers
    """Rows that came after later ones of the same time."""
    resets: Integers
    """First rows after a step back to an earlier time."""
    changes: Integers
    """First rows after a step forward from one clock to another."""


def usual_step(t_ns: Times) -> float:
    """Return the usual distance [ns] of different stamps, 0 if there are no two in order.

    :param t_ns: (n,) stamps, of which the first 65,536 are used if they differ [ns].
    """
    for stamps in (t_ns[:_USUAL], t_ns):
        steps = np.diff(stamps)
        steps = steps[steps > 0]
        if len(steps):
            return float(np.median(steps))
    return 0.0


def order_stamps(t_ns: Times, step_ns: float | None = None) -> StampOrder:
    """Return which stamps follow each other in one time.

    A few readings whose stamps are far from those on both sides are stray. A few that are earlier
    than what is before them, by a second at most, are late and take their place by stamp. Any
    other step back is a reset: sorting would mix two times.

    :param t_ns: (n,) stamps in the order of arrival [ns].
    :param step_ns: usual distance of different stamps [ns]; None: that of these.
    """
    step_ns = usual_step(t_ns) if step_ns is None else step_ns
    limit = step_ns * (longest_loss(step_ns) + 1.0) if step_ns else float(RESTART_NS)
    # Steps between stamps at both ends of 64 bits overflow: compare as floats there.
    steps = np.diff(t_ns)
    if len(t_ns) and float(t_ns.max()) - float(t_ns.min()) >= 2.0**63:
        steps = np.diff(t_ns.astype(np.float64)).clip(-(2.0**62), 2.0**62).astype(np.int64)
    breaks = np.flatnonzero((steps < 0) | (steps > limit)) + 1
    none = np.empty(0, dtype=np.int64)
    if not len(breaks):
        return StampOrder((np.arange(len(t_ns)),) if len(t_ns) else (), none, none, none, none)
    return _Sorting(t_ns, [0, *breaks.tolist(), len(t_ns)], step_ns, limit).order()


class _Sorting:
    """Assigns the runs between unusual steps to stretches of one time."""

    def __init__(self, t_ns: Times, edges: list[int], step_ns: float, limit: float) -> None:
        self._t_ns, self._edges, self._limit = t_ns, edges, limit
        self._usual_ns = _USUAL_STEPS * step_ns
        self._first_ns = [int(t_ns[edge]) for edge in edges[:-1]]
        self._pieces: list[list[tuple[int, int]]] = []
        self._latest_ns = 0
        self._strays: list[int] = []
        self._late: list[int] = []
        self._resets: list[int] = []
        self._changes: list[int] = []

    def order(self) -> StampOrder:
        """Return the order of all stamps."""
        run, edges = 0, self._edges
        while run < len(edges) - 1:
            skipped = self._stray_runs(run)
            if skipped:
                self._strays += range(edges[run], edges[run + skipped])
                run += skipped
                continue
            self._take(edges[run], edges[run + 1])
            run += 1
        pieces = []
        for runs in self._pieces:
            rows = np.concatenate([np.arange(begin, end) for begin, end in runs])
            pieces.append(rows[np.argsort(self._t_ns[rows], kind="stable")])
        lists = (self._strays, self._late, self._resets, self._changes)
        return StampOrder(tuple(pieces), *(np.array(rows, dtype=np.int64) for rows in lists))

    def _follows(self, before_ns: int, t_ns: int) -> bool:
        """Return True if a stamp is next to an earlier one of its stream."""
        return 0 <= t_ns - before_ns <= self._limit

    def _stray_runs(self, run: int) -> int:
        """Return how many runs from this one on have stray stamps."""
        edges = self._edges
        begin, final = edges[run], len(edges) - 1
        if edges[run + 1] - begin > STRAY_READINGS:
            return 0
        if not self._pieces:
            if run + 1 == final or edges[-1] - begin <= 4 * STRAY_READINGS:
                return 0
            end = edges[run + 1]
            last_ns = int(self._t_ns[end - 1])
            step = self._first_ns[run + 1] - last_ns
            is_far = step < -RESTART_NS or step > LONGEST_PAUSE_NS
            ahead = step < 0 and last_ns > self._t_ns[end : end + RESET_READINGS].max()
            return int(is_far or ahead)
        step = self._first_ns[run] - self._latest_ns
        if self._follows(self._latest_ns, self._first_ns[run]) or -RESTART_NS <= step < 0:
            return 0
        for following in range(run + 1, final):
            if edges[following] - begin > STRAY_READINGS:
                return 0
            if self._follows(self._latest_ns, self._first_ns[following]):
                return following - run
        few = edges[-1] - begin <= STRAY_READINGS
        return final - run if few and not 0 <= step <= LONGEST_PAUSE_NS else 0

    def _take(self, begin: int, end: int) -> None:
        """Add a run to the stretch before it, or begin another one.

        :param begin: first row of the run, whose stamps increase.
        :param end: row behind the run.
        """
        first_ns, last_ns = int(self._t_ns[begin]), int(self._t_ns[end - 1])
        step = first_ns - self._latest_ns
        if self._pieces and self._follows(self._latest_ns, first_ns):
            self._pieces[-1].append((begin, end))
            self._latest_ns = last_ns
            return
        if self._pieces and -RESTART_NS <= step < 0:
            # A few late readings belong to the stretch, if they are no reset to before its start.
            late_count = int(np.searchsorted(self._t_ns[begin:end], self._latest_ns))
            start, _ = self._pieces[-1][0]
            _, stop = self._pieces[-1][-1]
            is_within = first_ns > self._t_ns[start] or stop - start <= STRAY_READINGS
            if late_count < RESET_READINGS and is_within:
                self._late += range(begin, begin + late_count)
                self._pieces[-1].append((begin, end))
                self._latest_ns = max(self._latest_ns, last_ns)
                return
        if self._pieces and step < 0 and self._leave_out(begin, end):
            self._latest_ns = last_ns
            return
        if self._pieces and step < 0:
            self._resets.append(begin)
        elif self._pieces and step > CLOCK_CHANGE_NS:
            self._changes.append(begin)
        self._pieces.append([(begin, end)])
        self._latest_ns = last_ns

    def _leave_out(self, begin: int, end: int) -> bool:
        """Leave out strays on one side of a step back; return False if there are none.

        Strays by less than the longest loss have an unusual step on their other side, in a run.
        """
        t_ns, (start, stop) = self._t_ns, self._pieces[-1][-1]
        for count in range(1, STRAY_READINGS + 1):
            ahead, behind = stop - count, begin + count
            if (
                ahead > start
                and t_ns[ahead] - t_ns[ahead - 1] > self._usual_ns
                and self._follows(int(t_ns[ahead - 1]), int(t_ns[begin]))
            ):
                self._strays += range(ahead, stop)
                self._pieces[-1][-1:] = [(start, ahead), (begin, end)]
                return True
            if (
                behind < end
                and t_ns[behind] - t_ns[behind - 1] > self._usual_ns
                and self._follows(int(t_ns[stop - 1]), int(t_ns[behind]))
            ):
                self._strays += range(begin, behind)
                self._pieces[-1].append((behind, end))
                return True
        return False
