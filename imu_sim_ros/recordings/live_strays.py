# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Stray stamps of messages that arrive live, by the rules for those of a file."""

import time
from collections.abc import Callable, Sequence
from typing import Final, Generic, Protocol, TypeVar

from imu_sim_ros.core import gate
from imu_sim_ros.core.timebase import NANOSECONDS_PER_SECOND
from imu_sim_ros.recordings.order import (
    LONGEST_PAUSE_NS,
    READINGS_GAP,
    RESET_READINGS,
    RESTART_NS,
    LiveGap,
    longest_loss,
)

RELEASE_PERIOD: Final = 0.1
"""Time between two calls of :meth:`LiveStrays.release` [s]."""
_SILENCE: Final = 0.5
"""Time without a message after which those in doubt are passed on [s]: a simulator that waits for
an answer to each reading sends no further one."""
_SILENT_STEPS: Final = 3.0
"""Usual steps without a message after which those in doubt are passed on."""
_REPORTED: Final = 3
"""Stray stamps that are told; all of them are counted."""


class Stamped(Protocol):
    """Anything with a stamp."""

    @property
    def t_ns(self) -> int:
        """Stamp [ns]."""


StampedT = TypeVar("StampedT", bound=Stamped)


class LiveStrays(Generic[StampedT]):
    """Leaves out messages whose stamps are far from those before and behind them.

    A message whose stamp is far from the one before it waits until the next ones tell: if their
    stamps follow the earlier ones, it is stray; five in a row begin another time, after a pause or
    a reset, or at the start. :func:`order_stamps` is the same for files.
    """

    def __init__(self, complain: Callable[[str], object]) -> None:
        """Begin with the next message.

        :param complain: receives a line for each of the first stray stamps.
        """
        self.count = 0
        """Number of stray stamps so far."""
        self._complain = complain
        self.begin()

    def begin(self) -> None:
        """Begin with the next message; those in doubt are forgotten."""
        self._gap = LiveGap(0.0, READINGS_GAP)
        self._latest_ns: int | None = None
        self._waiting: list[StampedT] = []
        self._arrival = 0.0

    def apply(self, messages: Sequence[StampedT]) -> list[StampedT]:
        """Add messages; return those that are known to be in order, earlier ones included."""
        gap, passed = self._gap, list[StampedT]()
        for message in messages:
            t_ns, latest_ns = message.t_ns, self._latest_ns
            if (
                latest_ns is None
                or self._waiting
                or not -RESTART_NS <= t_ns - latest_ns <= gap.longest_step_ns
            ):
                passed += self._doubt(message)
            else:
                gap.add(t_ns)
                if t_ns > latest_ns:
                    self._latest_ns = t_ns
                passed.append(message)
        return passed

    def release(self) -> list[StampedT]:
        """Return messages in doubt that no other one has followed for half a second."""
        silence = max(_SILENCE, _SILENT_STEPS * self._gap.usual_step_ns / NANOSECONDS_PER_SECOND)
        if not self._waiting or time.monotonic() - self._arrival < silence:
            return []
        return self._pass_on()

    def finish(self) -> list[StampedT]:
        """Return the messages in doubt at the end of a stream, without stray ones."""
        if self._waiting and self._latest_ns is not None:
            step_ns = self._waiting[0].t_ns - self._latest_ns
            if not 0 <= step_ns <= LONGEST_PAUSE_NS:
                self._leave_out(len(self._waiting))
        return self._pass_on()

    def _doubt(self, message: StampedT) -> list[StampedT]:
        """Add a message that is far from the one before, or comes while others wait."""
        self._arrival = time.monotonic()
        waiting, latest_ns, t_ns = self._waiting, self._latest_ns, message.t_ns
        if latest_ns is None:
            return self._begin_with(message)
        after_latest = t_ns - latest_ns
        after_waiting = t_ns - waiting[-1].t_ns if waiting else -1
        follows_latest = 0 <= after_latest <= self._longest_loss_ns()
        follows_waiting = 0 <= after_waiting <= self._gap.longest_step_ns
        if waiting and follows_latest and not (follows_waiting and after_waiting <= after_latest):
            self._leave_out(len(waiting))
            return self._take(message)
        if -RESTART_NS <= after_latest < 0 and not follows_waiting:
            return [message]  # late: it does not tell
        waiting.append(message)
        return self._pass_on() if len(waiting) == RESET_READINGS else []

    def _begin_with(self, message: StampedT) -> list[StampedT]:
        """Add one of the first messages, until five follow each other."""
        waiting, t_ns = self._waiting, message.t_ns
        if waiting:
            step_ns = t_ns - waiting[-1].t_ns
            if step_ns < -RESTART_NS or step_ns > LONGEST_PAUSE_NS:
                self._leave_out(len(waiting))
        waiting.append(message)
        if len(waiting) < RESET_READINGS:
            return []
        ahead = next(k for k, earlier in enumerate(waiting) if earlier.t_ns <= t_ns)
        self._leave_out(ahead)
        return [] if ahead else self._pass_on()

    def _longest_loss_ns(self) -> float:
        """Return the longest step over which stamps follow each other [ns]."""
        step_ns = self._gap.usual_step_ns
        return step_ns * (longest_loss(step_ns) + 1.0) if step_ns else float(RESTART_NS)

    def _take(self, message: StampedT) -> list[StampedT]:
        """Return a message that follows the latest one."""
        self._gap.add(message.t_ns)
        self._latest_ns = message.t_ns
        return [message]

    def _pass_on(self) -> list[StampedT]:
        """Return all messages in doubt, after which the others go on."""
        waiting, self._waiting = self._waiting, []
        for message in waiting:
            self._take(message)
        return waiting

    def _leave_out(self, count: int) -> None:
        """Count the first of the messages in doubt as stray."""
        for message in self._waiting[:count]:
            self.count += 1
            if self.count <= _REPORTED:
                addition = "; further ones are only counted" if self.count == _REPORTED else ""
                self._complain(
                    f"{gate.stamp_text(message.t_ns)} is far from its neighbours: left out"
                    f"{addition} [stamps_stray]"
                )
        del self._waiting[:count]
