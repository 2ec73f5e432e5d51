# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Deadlines of samples: simulated time against the steady clock, without drift."""

import enum
import itertools
import statistics
import threading
from collections import deque
from collections.abc import Callable, Sequence
from time import monotonic_ns, sleep
from typing import Final, NamedTuple

_SETTLE: Final = 0.3
"""Time in which a discovered subscriber discovers this publisher [s]."""


class Settling:
    """Waits until the numbers of subscribers have been constant for a while.

    A recorder subscribes to its topics one after the other, so some subscriptions come after the
    first has been discovered here: the first samples of the last topic would be lost.
    """

    def __init__(self) -> None:
        self._counts: tuple[int, ...] = ()
        self._since = 0.0

    def has_settled(self, counts: Sequence[int], time_s: float) -> bool:
        """Return whether the subscribers of all topics are there to stay.

        :param time_s: time on the steady clock [s].
        """
        if tuple(counts) != self._counts:
            self._counts, self._since = tuple(counts), time_s
        return time_s - self._since >= _SETTLE


STALL_NS: Final = 50_000_000
"""A sample later than this means that the process stalled."""

CATCH_UP_SPEED: Final = 8
"""Speed of late samples relative to normal: subscribers' queues are short."""

_BURST_NS: Final = 2_000_000
"""Samples no later than this may follow at once: 4 at 2 kHz; rosbag2's queues hold 10."""

_LONGEST_SLEEP: Final = 0.1
"""Longest wait for a change of the clock [s]."""
_LONG_NS: Final = 20_000_000
"""Time to the next sample from which on the wait can be interrupted [ns]."""
_ON_TIME_NS: Final = 1_000_000
"""Lateness of a sample that is still on time [ns]."""


class SampleAction(enum.Enum):
    """Decision about a sample."""

    GO = enum.auto()
    SKIP = enum.auto()
    INTERRUPTED = enum.auto()


_GO: Final = SampleAction.GO  # an enumeration's members are slow to look up


class Stall(NamedTuple):
    """A stall that is over."""

    late_ns: int
    """Lateness of the first sample [ns]."""
    samples: int
    """Number of samples published late, or skipped."""
    skipped: bool
    """True if the samples were skipped."""


class Pacer:
    """Lets samples pass when they are due; one thread waits, others control.

    A sample at simulated time s is due at ``wall + (s - sim) / speed``; ``(sim, wall)`` is the
    anchor, set at the start, after a pause and when the speed changes, and never moved by delays.
    """

    def __init__(
        self, speed: float, catch_up: bool, on_stall: Callable[[Stall], None] = lambda stall: None
    ) -> None:
        """Set up a pacer that has not begun.

        :param speed: real-time factor; 0: samples pass as fast as they come.
        :param catch_up: True if late samples follow at a higher speed, False if they are skipped.
        :param on_stall: receives each stall when it is over.
        """
        self._on_stall = on_stall
        self._condition = threading.Condition()
        # Set while there is anything to attend to in addition to the next deadline.
        self._attention = threading.Event()
        # True while samples follow each other in time: no attention, no stall.
        self._calm = False
        self._paused = self._interrupted = self._idle = self._moved = False
        self._steps = self._interruptions = 0
        # Requested speed and catch_up; the waiting thread adopts them when it next checks.
        self._wanted = (speed, catch_up)
        self._speed, self._catch_up = self._wanted
        self._sim_ns = self._wall_ns = 0
        # Start of late samples' limited speed: simulated time and steady clock [ns].
        self._burst: tuple[int, int] | None = None
        self._stall: Stall | None = None
        # Usual step of the simulated time [ns]: no sample can be more on time.
        self._grain_ns = 0
        self.caught_up = self.skipped = 0
        self.lateness_ns: list[int] = []

    # Control, from any thread.

    @property
    def paused(self) -> bool:
        """True if the simulated time is stopped."""
        return self._paused

    def pause(self, paused: bool) -> None:
        """Stop the simulated time, or resume it at the same time."""
        with self._condition:
            self._moved |= self._paused and not paused
            self._paused = paused
            self._look()

    def step(self, samples: int, timeout: float) -> int:
        """Publish samples while paused; returns how many were in time, the rest are not published.

        An interruption ends the wait; the count is then unknown, and 0 is returned.
        """
        with self._condition:
            self._steps += samples
            self._look()
            begun = self._interruptions
            self._condition.wait_for(
                lambda: self._interruptions > begun or (self._idle and self._steps == 0), timeout
            )
            if self._interruptions > begun:
                return 0
            passed, self._steps = samples - self._steps, 0
            return passed

    def configure(self, speed: float, catch_up: bool) -> None:
        """Change the speed and the behaviour after a stall."""
        with self._condition:
            self._moved |= speed != self._wanted[0]
            self._wanted = (speed, catch_up)
            self._look()

    def interrupt(self, interrupted: bool = True) -> None:
        """Block all samples, until this is called with False."""
        with self._condition:
            self._interrupted = interrupted
            if interrupted:
                self._steps = 0
                self._interruptions += 1
            self._look()

    def take_lateness(self) -> list[int]:
        """Return the lateness [ns] of every sample since the last call."""
        latenesses, self.lateness_ns = self.lateness_ns, []
        return latenesses

    def _look(self) -> None:
        """Wake the waiting thread up: a request has arrived."""
        self._calm = False
        self._attention.set()
        self._condition.notify_all()

    # The waiting thread.

    def anchor(self, sim_ns: int, wall_ns: int) -> None:
        """Set the time ``wall_ns`` on the steady clock at which the sample of ``sim_ns`` is due."""
        self.end_stall()
        self._sim_ns, self._wall_ns = sim_ns, wall_ns
        self._burst = None

    def end_stall(self) -> None:
        """Report a stall that nothing on time follows any more: the run ends or begins again."""
        if self._stall is not None:
            self._on_stall(self._stall)
            self._stall = None

    @property
    def speed(self) -> float:
        """The requested real-time factor; 0: samples pass as fast as they come."""
        return self._wanted[0]

    def wait(self, sim_ns: int) -> SampleAction:
        """Wait until the sample at a simulated time is due."""
        if self._calm:
            # The usual case, a few thousand times a second; anything unusual takes the slow path.
            due = self._wall_ns + int((sim_ns - self._sim_ns) / self._speed)
            now_ns = monotonic_ns()
            if 0 < due - now_ns <= _LONG_NS:
                sleep((due - now_ns) * 1e-9)
                now_ns = monotonic_ns()
            late = now_ns - due
            if self._calm and 0 <= late < _BURST_NS:
                self.lateness_ns.append(late)
                return _GO
            self._calm = False
        return self._wait_watchfully(sim_ns)

    def _wait_watchfully(self, sim_ns: int) -> SampleAction:
        """Wait for the time of a sample, and for requests in the meantime."""
        while True:
            if self._attention.is_set():
                verdict = self._attend(sim_ns)
                if verdict is not None:
                    return verdict
            if self._speed == 0:
                return _GO
            now_ns = monotonic_ns()
            delay = self._deadline(sim_ns) - now_ns
            if delay <= 0:
                return self._due(sim_ns, now_ns)
            if delay > _LONG_NS:
                self._attention.wait((delay - _LONG_NS // 2) * 1e-9)
            else:
                sleep(delay * 1e-9)

    def _attend(self, sim_ns: int) -> SampleAction | None:
        """Handle pause, step and interruption; return the action, None: continue to wait."""
        with self._condition:
            while self._paused and not self._steps and not self._interrupted:
                self._idle = True
                self._condition.notify_all()
                self._condition.wait()
            self._idle = False
            if self._interrupted:
                return SampleAction.INTERRUPTED
            if self._paused:
                self._steps -= 1
                return _GO
            self._attention.clear()
            self._adopt()
            if self._moved:
                self._moved = False
                self.anchor(sim_ns, monotonic_ns())
        return None

    def _adopt(self) -> None:
        """Adopt the requested speed and behaviour."""
        self._speed, self._catch_up = self._wanted

    def _settle(self) -> None:
        """Note that nothing but the next deadline needs attention, unless a request has arrived."""
        with self._condition:  # a request that arrives meanwhile must not be missed
            self._calm = not self._attention.is_set()

    def _due_ns(self, sim_ns: int) -> int:
        """Return the time on the steady clock at which a sample is due [ns]."""
        return self._wall_ns + int((sim_ns - self._sim_ns) / self._speed)

    def _deadline(self, sim_ns: int) -> int:
        """Return the time at which a sample is published [ns]; late ones follow quickly."""
        due = self._due_ns(sim_ns)
        if self._burst is None:
            return due
        first_sim_ns, first_wall_ns = self._burst
        offset_ns = int((sim_ns - first_sim_ns) / (self._speed * CATCH_UP_SPEED))
        return max(due, first_wall_ns + offset_ns)

    def _due(self, sim_ns: int, now_ns: int) -> SampleAction:
        """Return the action for a sample that is due: publish it, or skip it."""
        late = now_ns - self._due_ns(sim_ns)
        if late < _BURST_NS:
            self._burst = None
        elif self._burst is None or now_ns - self._deadline(sim_ns) >= _BURST_NS:
            self._burst = (sim_ns, now_ns)
        if late < _ON_TIME_NS + self._grain_ns:
            self.end_stall()
        if self._stall is None and late < STALL_NS + self._grain_ns:
            if self._burst is None:
                self._settle()
            self.lateness_ns.append(max(late - self._grain_ns, 0))
            return _GO
        stall = self._stall or Stall(late, 0, skipped=not self._catch_up)
        self._stall = stall._replace(samples=stall.samples + 1)
        if stall.skipped:
            self._burst = None
            self.skipped += 1
            return SampleAction.SKIP
        self.caught_up += 1
        self.lateness_ns.append(late)
        return _GO


_TICKS: Final = 64
"""Steps of an external clock from which its usual speed is taken."""
_JUMP: Final = 10.0
"""Steps that are so many times longer than most are jumps."""


class RosClockPacer(Pacer):
    """Lets samples pass when an external clock (``use_sim_time``) reaches their times.

    After a jump forward late samples follow at the same limit as after a stall, in terms of the
    speed at which the clock usually goes.
    """

    def __init__(
        self,
        now_ns: Callable[[], int],
        catch_up: bool,
        on_stall: Callable[[Stall], None] = lambda stall: None,
    ) -> None:
        """Follow a clock; :meth:`tick` must be called whenever it has advanced."""
        super().__init__(1.0, catch_up, on_stall)
        self._now_ns = now_ns
        self._ticks: deque[tuple[int, int]] = deque(maxlen=_TICKS)

    def tick(self) -> None:
        """Read the clock again."""
        self._ticks.append((self._now_ns(), monotonic_ns()))
        steps = [(b[0] - a[0], b[1] - a[1]) for a, b in itertools.pairwise(self._ticks)]
        if steps:
            longest = _JUMP * statistics.median(sim for sim, _ in steps)
            usual = [(sim, wall) for sim, wall in steps if 0 < sim <= longest]
            if usual:
                simulated, passed = (sum(column) for column in zip(*usual, strict=True))
                self._speed = simulated / max(passed, 1)
                self._grain_ns = max(sim for sim, _ in usual)
        self._attention.set()

    def wait(self, sim_ns: int) -> SampleAction:
        """Wait until the clock reaches a time."""
        while True:
            if self._attention.is_set():
                verdict = self._attend(sim_ns)
                if verdict is not None:
                    return verdict
            if self._now_ns() < sim_ns:
                self._attention.wait(_LONGEST_SLEEP)
                continue
            now_ns = monotonic_ns()
            delay = self._deadline(sim_ns) - now_ns
            if delay <= 0:
                return self._due(sim_ns, now_ns)
            if delay > _LONG_NS:
                self._attention.wait((delay - _LONG_NS // 2) * 1e-9)
            else:
                sleep(delay * 1e-9)

    def _adopt(self) -> None:
        """Adopt the requested setting of catching up."""
        self._catch_up = self._wanted[1]

    def _due_ns(self, sim_ns: int) -> int:
        """Return when the sample was due on the steady clock, had the other not jumped."""
        return monotonic_ns() - int((self._now_ns() - sim_ns) / self._speed)
