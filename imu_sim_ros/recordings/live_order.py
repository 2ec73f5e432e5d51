# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Order, gaps and shared stamps of rows that arrive a few at a time, at a rate that is declared.

Everything is carried from one call to the next, so that the result does not depend on how many rows
come at a time; nothing waits for later rows, but those that may follow a reset.
"""

from collections.abc import Callable, Iterable, Iterator, Sequence
from typing import Final, Generic

import numpy as np

from imu_sim_ros.core.records import SeriesT, TimeSeries, concatenate, replace_fields
from imu_sim_ros.core.types import Mask, Times, field_values
from imu_sim_ros.recordings.clock import SHORT, decimal_unit
from imu_sim_ros.recordings.order import RESET_READINGS, RESTART_NS

_LOOKED_BACK: Final = 4
"""Intervals in which a burst of readings may make up for a long one."""
_LARGEST_BUNCH: Final = 64
"""Readings of a bunch; where stamps come in bunches, so many intervals are looked back."""
_COARSE: Final = 0.25
"""Intervals in a unit of the stamps from which on rounding can look like a loss."""
_FEW: Final = 8
"""Readings for which Python's numbers take less time than NumPy's arrays."""


def _changes(series: TimeSeries) -> Mask:
    """Return (n - 1,) True where a value differs from the row before it.

    An orientation does not count: it need not be that of the reading's message.
    """
    values_by_name = field_values(series)
    columns = [values_by_name[name] for name in series.columns() if name != "q_wb"]
    changes = np.zeros(len(series.t_ns) - 1, dtype=np.bool_)
    for values in columns:
        if values is not None:
            rows = values.reshape(len(values), -1)
            changes |= np.any(rows[1:] != rows[:-1], axis=1)
    return changes


class Spreading(Generic[SeriesT]):
    """Spreads readings that share a stamp over the interval after it, at equal distances.

    Only readings that differ from the one before them are spread; the same reading with the same
    stamp is a message that came twice.
    """

    def __init__(self, nominal_ns: float) -> None:
        """Initialise without readings.

        :param nominal_ns: interval of the readings [ns].
        """
        self._nominal_ns = nominal_ns
        self._last: SeriesT | None = None
        self._last_ns: int | None = None
        self._rank = 0
        self.spread = 0
        """Number of readings whose stamps were changed."""

    def take(self, readings: SeriesT) -> None:
        """Note the last of some readings, whose stamp the next one may repeat."""
        self._last, self._last_ns, self._rank = readings, int(readings.t_ns[-1]), 0

    def apply(self, readings: SeriesT) -> SeriesT:
        """Return readings with a stamp of their own each."""
        t_ns = readings.t_ns
        if not len(t_ns):
            return readings
        previous, repeats = self._last, int(t_ns[0]) == self._last_ns
        self._last, self._last_ns = readings, int(t_ns[-1])
        if not repeats and (len(t_ns) == 1 or not np.any(t_ns[1:] == t_ns[:-1])):
            self._rank = 0
            return readings
        if repeats and previous is not None:
            changes = _changes(concatenate([previous.rows(slice(-1, None)), readings])).tolist()
        else:
            changes, self._rank = [False, *_changes(readings).tolist()], 0
        ranks, rank = [], self._rank
        repetitions = [repeats, *(t_ns[1:] == t_ns[:-1]).tolist()]
        for repeated, changed in zip(repetitions, changes, strict=True):
            rank = rank + changed if repeated else 0
            ranks.append(rank)
        self._rank = rank
        self.spread += int(np.count_nonzero(ranks))
        later = np.rint(np.array(ranks) * self._nominal_ns).astype(np.int64)
        return replace_fields(readings, t_ns=t_ns + later)


class Order(Generic[SeriesT]):
    """Tells readings that come late from those of a simulator that was reset.

    The stamps of a reset are at or before the first one, or more than a second back, or several
    in a row increase. Readings that may still be either wait for the next ones.
    """

    def __init__(self) -> None:
        """Initialise without readings."""
        self._first_ns: int | None = None
        self.last_ns = 0
        """Stamp of the last reading that was passed on."""
        self._waiting: SeriesT | None = None

    def follow(self, times: Sequence[int]) -> bool:
        """Return whether stamps [ns] increase and are after the last one, and no reading waits."""
        previous_ns = self.last_ns
        for t_ns in times:
            if t_ns <= previous_ns:
                return False
            previous_ns = t_ns
        return self._waiting is None

    def parts(
        self,
        readings: SeriesT,
        left_out: Callable[[int], object] = lambda step_ns: None,
        taken_back: Callable[[int], object] = lambda count: None,
    ) -> Iterable[tuple[SeriesT, int]]:
        """Return stretches of readings whose stamps increase.

        Each comes with the length of the jump back before it [ns]; 0: it follows without a jump.

        :param left_out: receives, for each reading left out, its step from the last one [ns],
            0 if it repeats the stamp.
        :param taken_back: receives how many of these belong to a simulator that was reset.
        """
        waiting_count = 0 if self._waiting is None else len(self._waiting.t_ns)
        if self._waiting is not None:
            readings, self._waiting = concatenate([self._waiting, readings]), None
        t_ns = readings.t_ns.tolist()
        if not t_ns:
            return ()
        if self._first_ns is None:
            self._first_ns, self.last_ns = t_ns[0], t_ns[0] - 1
        increase = len(t_ns) == 1 or bool((readings.t_ns[1:] > readings.t_ns[:-1]).all())
        if t_ns[0] > self.last_ns and increase:
            self.last_ns = t_ns[-1]
            return ((readings, 0),)
        return self._sort_late_readings(readings, t_ns, waiting_count, left_out, taken_back)

    def _sort_late_readings(
        self,
        readings: SeriesT,
        t_ns: Sequence[int],
        waiting_count: int,
        left_out: Callable[[int], object],
        taken_back: Callable[[int], object],
    ) -> Iterator[tuple[SeriesT, int]]:
        """Yield stretches of readings some of which are late, repeated, or after a reset.

        :param t_ns: (n,) their stamps [ns].
        :param waiting_count: readings at the beginning that had waited.
        :param left_out, taken_back: as of :meth:`parts`.
        """
        assert self._first_ns is not None
        keep = np.zeros(len(t_ns), dtype=np.bool_)
        begin, back, run = 0, 0, list[int]()
        for k, stamp_ns in enumerate(t_ns):
            if stamp_ns > self.last_ns:
                keep[k], self.last_ns, run = True, stamp_ns, []
                continue
            if stamp_ns == self.last_ns or (run and stamp_ns == t_ns[run[-1]]):
                left_out(0)
                continue
            again = (
                self.last_ns > self._first_ns >= stamp_ns or stamp_ns < self.last_ns - RESTART_NS
            )
            if again or (run and stamp_ns < t_ns[run[-1]]):
                run = []
            run.append(k)
            if not again and k >= waiting_count:
                left_out(stamp_ns - self.last_ns)
            if not again and len(run) < RESET_READINGS:
                continue
            taken_back(0 if again else len(run))
            if keep[begin:].any():
                yield readings.rows(slice(begin, None)).rows(keep[begin:]), back
            begin, self._first_ns = run[0], t_ns[run[0]]
            back = self.last_ns - self._first_ns
            keep[:begin], keep[run] = False, True
            self.last_ns, run = stamp_ns, []
        if keep[begin:].any():
            yield readings.rows(slice(begin, None)).rows(keep[begin:]), back
        if run:
            waiting = np.zeros(len(t_ns), dtype=np.bool_)
            waiting[run] = True
            self._waiting = readings.rows(waiting)


class Gaps:
    """Tells missing readings by the last stamps, without a clock of its own.

    Irregular stamps are no gap as long as the last few intervals have enough of them together.
    """

    def __init__(self, nominal_ns: float, longest_ns: float) -> None:
        """Initialise without readings.

        :param nominal_ns: interval of the readings [ns].
        :param longest_ns: a longer gap is a pause, in which no readings count as missing [ns].
        """
        self._nominal_ns, self._longest_ns = nominal_ns, longest_ns
        self._without_gap_ns = 1.5 * nominal_ns
        self._recent_ns: list[int] = []
        """The last stamps."""

    def parts(self, t_ns: Times) -> Iterable[tuple[slice | None, int, int]]:
        """Return rows without a gap (None: all), the number missing before them, and the pause.

        :param t_ns: (n,) the next stamps, which increase [ns].
        """
        times = t_ns.tolist() if len(t_ns) <= _FEW else ()
        if times and self.none_in(times):
            self.take(times)
            return ((None, 0, 0),)
        return self._split(t_ns)

    def none_in(self, times: Sequence[int]) -> bool:
        """Return whether no reading is missing before or between a few stamps [ns]."""
        previous_ns = self._recent_ns[-1] if self._recent_ns else times[0]
        for t_ns in times:
            if t_ns - previous_ns > self._without_gap_ns:
                return False
            previous_ns = t_ns
        return True

    def take(self, times: Sequence[int]) -> None:
        """Add stamps [ns] without a gap."""
        self._recent_ns += times
        del self._recent_ns[:-_LARGEST_BUNCH]

    def _split(self, t_ns: Times) -> Iterator[tuple[slice | None, int, int]]:
        """Yield rows between long steps, the readings missing before them, and the pause [ns].

        :param t_ns: (n,) the next stamps, which increase [ns]; rows count from their start. None
            for all rows.
        """
        recent_count, count = len(self._recent_ns), len(t_ns)
        t_ns = np.concatenate([np.array(self._recent_ns, np.int64), t_ns])
        first_step = max(recent_count, 1)  # the first stamp of all has no step before it
        is_long = t_ns[first_step:] - t_ns[first_step - 1 : -1] > self._without_gap_ns
        # ``begin``: first row of the part; ``gap_end``: index of the reading after the last gap.
        begin = missing = pause = gap_end = 0
        for k in (np.flatnonzero(is_long) + first_step).tolist() if is_long.any() else ():
            if k > recent_count:
                yield slice(begin, k - recent_count), missing, pause
            begin = k - recent_count
            missing, pause = self._gap(t_ns[gap_end : k + 1])
            if missing or pause:
                gap_end = k
        self._recent_ns = t_ns[max(gap_end, len(t_ns) - _LARGEST_BUNCH) :].tolist()
        yield (slice(begin, count) if begin else None), missing, pause

    def _gap(self, t_ns: Times) -> tuple[int, int]:
        """Return how many readings the last step leaves out, or its length if it is a pause."""
        step_ns = int(t_ns[-1] - t_ns[-2])
        if step_ns > self._longest_ns:
            return 0, step_ns
        previous_ns = t_ns[-_LARGEST_BUNCH - 1 : -1][::-1]
        unit_ns = decimal_unit(np.diff(t_ns[-_LARGEST_BUNCH - 1 :]))
        if unit_ns > _COARSE * self._nominal_ns and self._nominal_ns % unit_ns:
            # Rounding shortens a step by less than a unit.
            intervals = (t_ns[-1] - previous_ns - unit_ns) / self._nominal_ns - _COARSE
            fewest = np.ceil(intervals).astype(np.int64)
            return max(int((fewest - np.arange(1, len(previous_ns) + 1)).max()), 0), 0
        short = np.count_nonzero(previous_ns[:-1] - previous_ns[1:] < SHORT * self._nominal_ns)
        if 2 * short < len(previous_ns) - 1:
            previous_ns = previous_ns[:_LOOKED_BACK]
        expected = np.rint((t_ns[-1] - previous_ns) / self._nominal_ns).astype(np.int64)
        return max(int((expected - np.arange(1, len(previous_ns) + 1)).min()), 0), 0
