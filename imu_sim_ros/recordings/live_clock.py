# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""The clock behind stamps that arrive live, by the rules for those of a file."""

from collections.abc import Iterator
from typing import Final

import numpy as np

from imu_sim_ros.core.errors import InputError
from imu_sim_ros.core.types import Mask, Times
from imu_sim_ros.recordings.clock import Clock, estimate_clock
from imu_sim_ros.recordings.order import longest_step_ns
from imu_sim_ros.recordings.stream import ClockStream, Stretch

_HELD: Final = 65536
"""Stamps up to which all are looked at together, as in a file; the later ones block by block."""
_FEWEST: Final = 32
"""Stamps from which on the clock is estimated while more arrive."""
_GROWTH: Final = 1.25
"""Growth of their number after which it is estimated again: the work grows with the number."""


class LiveClock:
    """Rate, losses and order of the stamps of one topic.

    The same stamps give the same counts live and in a file. Between two estimates the counts are
    those of the one before; :meth:`finish` brings them up to date.
    """

    def __init__(self, max_gap: float = 0.0) -> None:
        """Initialise without stamps.

        :param max_gap: length above which a step is a gap [s]; 0: by the clock.
        """
        self.messages = 0
        """Number of stamps."""
        self.rate = 0.0
        """Samples per second [Hz]; 0: the stamps have no rate."""
        self.gaps = 0
        """Places where samples are missing, pauses included."""
        self.missing = 0
        """Samples that are missing in these places, pauses apart."""
        self.duplicates = 0
        """Messages that came twice."""
        self.out_of_order = 0
        """Stamps that came late, are stray, or begin at an earlier time."""
        self.longest = 0.0
        """Longest step between two stamps in order [s]."""
        self.clock: Clock | None = None
        """Clock behind the first 65,536 stamps, as of the latest estimate; None: without a rate."""
        self._max_gap, self._longest_ns = max_gap, longest_step_ns(max_gap)
        self._stamps: list[Times] = []
        self._changes: list[Mask] = []
        self._due = _FEWEST
        self._stream: ClockStream | None = None
        self._last_ns: int | None = None
        self._change_count = self._pauses = 0

    def copy_without_stamps(self) -> "LiveClock":
        """Return a clock with the same length of a gap, before its first stamp."""
        return LiveClock(self._max_gap)

    def add(self, t_ns: Times, changes: Mask | None = None) -> None:
        """Add stamps in the order of their arrival.

        :param t_ns: (n,) stamps [ns].
        :param changes: (n,) True where a message has other contents than the one before; None: not
            known.
        """
        if not len(t_ns):
            return
        self.messages += len(t_ns)
        if self._stream is not None:
            self._pass_on(t_ns, changes)
            return
        self._stamps.append(t_ns)
        if changes is not None:
            self._changes.append(changes)
        if self.messages >= min(self._due, _HELD):
            self._estimate()
            self._due = int(_GROWTH * self.messages) + 1
        if self.messages >= _HELD and self.clock is not None:
            self._stream = ClockStream()
            stamps, unchanged = self._arrays()
            self.gaps, self.longest = 0, 0.0
            self._pass_on(stamps, None if unchanged is None else ~unchanged)
            self._stamps, self._changes = [], []

    def finish(self) -> None:
        """Bring all counts up to date with the stamps so far; none may follow."""
        if self._stream is None:
            self._estimate()
            return
        width = 1 if self._change_count else 0
        nothing = np.empty(0, np.int64), np.empty((0, width))
        self._count(self._stream.add(*nothing, at_end=True))

    def _arrays(self) -> tuple[Times, Mask | None]:
        """Return all stamps that are held, and where a message repeats the one before."""
        stamps = np.concatenate([np.empty(0, np.int64), *self._stamps])
        changes = np.concatenate([np.empty(0, np.bool_), *self._changes])
        return stamps, ~changes if len(changes) == len(stamps) else None

    def _estimate(self) -> None:
        """Estimate the clock from all stamps that are held."""
        stamps, unchanged = self._arrays()
        try:
            clock = estimate_clock(stamps, unchanged)
        except InputError:  # fewer than two different stamps
            return
        numbers = {trait.kind: trait.number for trait in clock.traits}
        self.clock, self.rate, self.missing = clock, clock.rate, clock.lost
        self.duplicates = numbers.get("duplicate", 0)
        self.out_of_order = sum(numbers.get(kind, 0) for kind in ("late", "stray", "reset"))
        steps = np.diff(clock.stamps_ns)
        pauses = numbers.get("pause", 0)
        self.gaps = int(np.count_nonzero(clock.missing)) + pauses
        if self._max_gap:
            self.gaps = int(np.count_nonzero(steps > self._longest_ns))
        self.longest = float(steps.max()) * 1e-9 if len(steps) else 0.0

    def _pass_on(self, t_ns: Times, changes: Mask | None) -> None:
        """Process stamps block by block, the first 65,536 of them at once."""
        assert self._stream is not None
        values = np.empty((len(t_ns), 0))
        if changes is not None:
            numbers = self._change_count + np.cumsum(changes)
            self._change_count = int(numbers[-1])
            values = numbers[:, None].astype(np.float64)
        self._count(self._stream.add(t_ns, values))

    def _count(self, stretches: Iterator[Stretch]) -> None:
        """Count readings, losses and jumps in stretches of stamps."""
        stream = self._stream
        assert stream is not None
        gaps = 0
        for stretch in stretches:
            stamps = stretch.t_ns
            if self._last_ns is not None:
                stamps = np.concatenate([[self._last_ns], stamps])
            self._last_ns = int(stamps[-1])
            steps = np.diff(stamps)
            self.longest = max(self.longest, float(steps.max(initial=0)) * 1e-9)
            if self._max_gap:
                gaps += int(np.count_nonzero(steps > self._longest_ns))
            else:
                gaps += int(np.count_nonzero(stretch.missing))
        self.gaps += gaps
        if not self._max_gap:
            self.gaps += stream.pauses - self._pauses
            self._pauses = stream.pauses
        if stream.pattern is not None:
            self.rate = 1e9 / stream.interval_ns
        self.missing, self.duplicates = stream.lost, stream.duplicates
        self.out_of_order = stream.late + stream.strays + stream.resets
