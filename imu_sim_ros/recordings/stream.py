# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""The clock of a recording that is read block by block, in memory for a few blocks."""

from collections.abc import Iterator
from itertools import pairwise
from typing import Final, NamedTuple

import numpy as np

from imu_sim_ros.core.errors import InputError
from imu_sim_ros.core.types import Array, Integers, Times
from imu_sim_ros.recordings.clock import (
    Losses,
    StampPattern,
    drop_duplicates,
    find_pattern,
    kind_of_stamps,
    number_unit,
)
from imu_sim_ros.recordings.order import CLOCK_CHANGE_NS, RESET_READINGS, order_stamps, usual_step

_FIRST: Final = 65536
"""Readings from which the pattern of the stamps is found."""
_HELD: Final = 2 * RESET_READINGS
"""Readings whose order depends on those after them."""


_FINDINGS: Final = {
    "rounded": "stamps_rounded",
    "batches": "stamps_shared",
    "bunches": "stamps_bunched",
}
"""Kinds of findings by the kinds of clocks that have them."""


class Stretch(NamedTuple):
    """n readings in the order of their stamps, without a pause between them."""

    t_ns: Times
    """(n,) stamps [ns]."""
    values: Array
    """(n, k) readings."""
    missing: Integers
    """(n,) samples that are lost before each of them."""
    begins: bool
    """True if a pause, a reset, or the start of a recording is before them."""


class ClockStream:
    """Orders the readings of recordings of one sensor, and counts the lost ones.

    The recordings share a clock: its pattern is found from the first one.
    """

    def __init__(self) -> None:
        """Initialise without recordings."""
        self.pattern: StampPattern | None = None
        """Known from the first stretch on."""
        self.strays = self.late = self.resets = self.duplicates = self.pauses = self.lost = 0
        self.longest_pause_ns = 0
        self._usual_ns = 0.0
        """Usual step of the stamps [ns]; 0: not known yet."""
        self._jitter = np.zeros(3)  # count, sum and sum of squares of deviations in intervals
        self._passed = np.zeros(2)  # time [ns] and samples
        self._end()

    def _end(self) -> None:
        """Forget the stretch; the next stamps begin another one."""
        self._waiting: list[tuple[Times, Array]] = []
        self._count = self._context = 0
        self._losses: Losses | None = None

    @property
    def interval_ns(self) -> float:
        """Time between two samples, over all that has passed [ns]."""
        time, samples = self._passed.tolist()
        assert self.pattern is not None
        return time / samples if samples else self.pattern.interval_ns

    @property
    def jitter_ns(self) -> float:
        """Standard deviation of a stamp around equal intervals, if each is late on its own [ns]."""
        count, total, squares = self._jitter.tolist()
        if not count:
            return 0.0
        # A step has the errors of two stamps.
        variance = 0.5 * max(squares / count - (total / count) ** 2, 0.0)
        assert self.pattern is not None
        return float(np.sqrt(variance)) * self.pattern.interval_ns

    def add(self, t_ns: Times, values: Array, *, at_end: bool = False) -> Iterator[Stretch]:
        """Add readings; yield those whose order is known.

        :param t_ns: (n,) stamps in the order of arrival [ns].
        :param values: (n, k) readings; k = 0: unknown, then stamps alone tell repeated messages.
        :param at_end: True at the end of a recording.
        :raises InputError: if there are no two different stamps, or they are in another unit.
        """
        if len(t_ns):
            self._waiting.append((t_ns, values))
            self._count += len(t_ns)
        if not at_end and (self.pattern is None or self._context == 0) and self._count < _FIRST:
            return
        if self._count > self._context:
            waiting = self._waiting
            t_ns = np.concatenate([part for part, _ in waiting])
            values = np.concatenate([part for _, part in waiting])
            end = len(t_ns) if at_end else max(len(t_ns) - _HELD, self._context)
            yield from self._in_order(t_ns, values, end)
            begin = max(end - _HELD, 0)
            self._waiting = [(t_ns[begin:], values[begin:])]
            self._count, self._context = len(t_ns) - begin, end - begin
        if at_end:
            self._end()

    def _in_order(self, t_ns: Times, values: Array, end: int) -> Iterator[Stretch]:
        """Yield the readings in order, those that were not yielded before.

        :param t_ns: (n,) waiting stamps in the order of arrival [ns]. The first ``_context`` ones
            were yielded before: they tell which of the next ones are late or repeated.
        :param values: (n, k) readings.
        :param end: first row that is not yielded yet, since readings before it may still come.
        """
        context = self._context
        if self.pattern is None:
            self._usual_ns = usual_step(t_ns)
        order = order_stamps(t_ns, self._usual_ns or None)
        equal = None
        if values.shape[1] and np.any(t_ns[1:] == t_ns[:-1]):
            equal = np.append(False, np.all(values[1:] == values[:-1], axis=1))
        pieces, duplicates = drop_duplicates(t_ns, order.pieces, equal)
        self.strays += self._number(order.strays, end)
        self.late += self._number(order.late, end)
        self.resets += self._number(order.resets, end)
        self.duplicates += self._number(duplicates, end)
        if self.pattern is None:
            self.pattern = self._first_pattern(t_ns, pieces)
        for piece in pieces:
            rows = piece[(piece >= context) & (piece < end)]
            is_continued = bool(context) and bool(np.any(piece < context))
            is_continued = is_continued and self._losses is not None
            if is_continued and self._losses is not None and self._losses.last_ns is not None:
                rows = rows[t_ns[rows] >= self._losses.last_ns]
            if len(rows):
                yield from self._stretches(t_ns[rows], values[rows], not is_continued)

    def _number(self, rows: Integers, end: int) -> int:
        """Return how many of some rows are new and before ``end``."""
        return int(np.count_nonzero((rows >= self._context) & (rows < end)))

    def _first_pattern(self, t_ns: Times, pieces: list[Integers]) -> StampPattern:
        """Return the pattern of the first stamps, or refuse stamps that are numbers of rows."""
        pattern = find_pattern(t_ns[max(pieces, key=len)])
        factor, unit = number_unit(pattern.interval_ns)
        if unit:
            would = (
                "row numbers"
                if unit == "index"
                else f"{1e9 / pattern.interval_ns / factor:.6g} Hz in {unit}"
            )
            raise InputError(
                f"stamps are {pattern.interval_ns:.4g} ns apart: they are not nanoseconds ({would})"
            )
        return pattern

    def _stretches(self, t_ns: Times, values: Array, begins: bool) -> Iterator[Stretch]:
        """Yield readings cut at pauses."""
        assert self.pattern is not None
        if begins or self._losses is None:
            if self._losses is not None and self._losses.last_ns is not None:
                self._pause(int(t_ns[0]) - self._losses.last_ns)
            self._losses = Losses(self.pattern)
        losses = self._losses
        previous_ns = losses.last_ns
        missing = losses.count(t_ns)
        self._passed += losses.passed
        self._jitter += losses.deviations
        losses.passed[:] = losses.deviations[:] = 0.0
        cuts = np.flatnonzero(missing > losses.longest)
        for cut in cuts.tolist():
            previous = t_ns[cut - 1] if cut else previous_ns
            self._pause(int(t_ns[cut] - previous))
        missing[cuts] = 0
        self.lost += int(missing.sum())
        edges = [*([] if len(cuts) and cuts[0] == 0 else [0]), *cuts.tolist(), len(t_ns)]
        for start, stop in pairwise(edges):
            rows = slice(start, stop)
            yield Stretch(t_ns[rows], values[rows], missing[rows], begins or start in cuts)
            begins = False

    def _pause(self, step_ns: int) -> None:
        """Note a step forward between two stretches; other ones are resets."""
        if 0 < step_ns <= CLOCK_CHANGE_NS:
            self.pauses += 1
            self.longest_pause_ns = max(self.longest_pause_ns, step_ns)

    def remarks(self) -> Iterator[str]:
        """Yield a line for each thing that the stamps show and that is not counted elsewhere."""
        assert self.pattern is not None
        steps, samples = float(self._jitter[0]), float(self._passed[1])
        size = samples / steps if steps else 1.0
        kind, text = kind_of_stamps(self.pattern, self.interval_ns, self.jitter_ns, size)
        if kind in _FINDINGS:
            yield f"{text}; equal intervals are assumed [{_FINDINGS[kind]}]"
        strays = "stamps are far from their neighbours: those readings are left out"
        resets = "times the clock went back: the pieces are analysed separately"
        late = "readings came after later ones: their stamps put them in order"
        for number, text, finding in (
            (self.strays, strays, "stamps_stray"),
            (self.resets, resets, "clock_reset"),
            (self.late, late, "stamps_late"),
        ):
            if number:
                yield f"{number} {text} [{finding}]"
