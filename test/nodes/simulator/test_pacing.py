# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

import itertools
import threading
import time

import numpy as np
import pytest

from imu_sim_ros.nodes.simulator import pacing
from imu_sim_ros.nodes.simulator.pacing import Pacer, RosClockPacer, SampleAction, Stall

SPACING_NS = 5_000_000


class Player:
    """Waits for one sample after the other in a thread, as the engine does."""

    def __init__(self, pacer: Pacer) -> None:
        self.pacer = pacer
        self.verdicts: list[SampleAction] = []
        self.thread = threading.Thread(target=self.play)

    def play(self) -> None:
        self.pacer.interrupt(False)  # a run begins
        for k in itertools.count():
            self.verdicts.append(self.pacer.wait(k * SPACING_NS))
            if self.verdicts[-1] is SampleAction.INTERRUPTED:
                return

    def __enter__(self) -> "Player":
        self.thread.start()
        return self

    def __exit__(self, *_: object) -> None:
        self.pacer.interrupt()
        self.thread.join()


@pytest.fixture
def pacer() -> Pacer:
    paused = Pacer(1.0, catch_up=True)
    paused.pause(True)
    return paused


def test_steps_that_are_asked_for_before_the_run_begins_are_not_lost(pacer: Pacer) -> None:
    passed: list[int] = []
    asking = threading.Thread(target=lambda: passed.append(pacer.step(3, 30.0)))
    asking.start()
    time.sleep(0.2)  # it is waiting by now; if not, the test proves less and does not fail
    with Player(pacer) as player:
        asking.join()
        assert passed == [3]
        assert player.verdicts == [SampleAction.GO] * 3


def test_steps_that_were_not_taken_in_time_never_are(pacer: Pacer) -> None:
    assert pacer.step(3, 0.1) == 0
    with Player(pacer) as player:
        assert pacer.step(2, 30.0) == 2
        assert player.verdicts == [SampleAction.GO] * 2


def test_an_interruption_ends_what_was_asked_for(pacer: Pacer) -> None:
    with Player(pacer) as player:
        assert pacer.step(2, 30.0) == 2
    assert player.verdicts == [SampleAction.GO] * 2 + [SampleAction.INTERRUPTED]


class Clock:
    """A steady clock that passes only in sleep, each of which lasts too long as on a busy machine.

    On the real one the machine's own stalls decide what is seen.
    """

    def __init__(self, monkeypatch: pytest.MonkeyPatch, sleeps_longer_ns: int) -> None:
        self.now_ns = 10**12
        self._longer_ns = sleeps_longer_ns
        monkeypatch.setattr(pacing, "monotonic_ns", lambda: self.now_ns)
        monkeypatch.setattr(pacing, "sleep", self.sleep)

    def sleep(self, seconds: float) -> None:
        self.now_ns += round(seconds * 1e9) + self._longer_ns


@pytest.mark.parametrize("sleeps_longer_ns", [0, 60_000, 1_000_000])
@pytest.mark.parametrize("late_ns", [30_000_000, 100_000_000])
def test_late_samples_follow_at_a_limited_speed(
    monkeypatch: pytest.MonkeyPatch, late_ns: int, sleeps_longer_ns: int
) -> None:
    """A queue of 10 must not overflow: rosbag2's. With all at once, 30 ms are 12 samples."""
    clock = Clock(monkeypatch, sleeps_longer_ns)
    pacer = Pacer(1.0, catch_up=True)
    spacing_ns = 2_500_000
    begin = clock.now_ns
    pacer.anchor(0, begin)
    passed = []
    for k in range(300):
        if k in (10, 20):  # the second time while the first is made up for
            clock.now_ns += late_ns
        assert pacer.wait(k * spacing_ns) is SampleAction.GO
        passed.append(clock.now_ns)
    behind = np.array(passed) - (begin + np.arange(300) * spacing_ns)
    assert (behind >= 0).all()
    # What is less than 2 ms late may follow at once. From the first later sample on, m of them take
    # at least m - 1 spacings at eight times the speed.
    limited = behind >= 4_000_000
    m = int(np.argmin(limited[10:]))
    assert m >= 24  # 60 ms are made up for in steps of 7/8 of 2.5 ms
    elapsed_ns = np.array(passed[10 : 10 + m]) - passed[10]
    assert (elapsed_ns >= np.arange(m) * spacing_ns // 8).all()
    # And that speed is reached.
    assert elapsed_ns[9] <= 9 * spacing_ns // 8 + sleeps_longer_ns


@pytest.mark.parametrize("again", [False, True])
def test_a_stall_that_lasts_to_the_end_of_a_run_is_reported(again: bool) -> None:
    """The end and the restart of a run report the stall: no punctual sample follows it."""
    stalls: list[Stall] = []
    pacer = Pacer(1.0, True, stalls.append)
    second = 1_000_000_000
    pacer.anchor(0, time.monotonic_ns() - 2 * second)
    for k in range(3):
        assert pacer.wait(k * 1_000_000) is SampleAction.GO
    assert not stalls
    if again:
        pacer.anchor(0, time.monotonic_ns())
    else:
        pacer.end_stall()
    (stall,) = stalls
    assert (stall.samples, stall.skipped) == (3, False)
    assert stall.late_ns >= 2 * second


@pytest.mark.parametrize(("period_ms", "speed"), [(1, 1.0), (10, 1.0), (100, 1.0), (10, 5.0)])
def test_samples_follow_a_jump_of_an_external_clock_at_a_limited_speed(
    monkeypatch: pytest.MonkeyPatch, period_ms: int, speed: float
) -> None:
    """After +5 s, at eight times the clock's usual speed; the jump is reported, ticks are not."""
    clock = Clock(monkeypatch, 0)
    stalls: list[Stall] = []
    simulated = [0]
    pacer = RosClockPacer(lambda: simulated[0], True, stalls.append)

    ticks = itertools.count(1)
    origin = clock.now_ns

    def advance() -> None:
        clock.now_ns = max(origin + next(ticks) * period_ms * 1_000_000, clock.now_ns)
        simulated[0] += round(period_ms * 1_000_000 * speed)
        pacer.tick()

    pacer.tick()
    passed, k = [], 0
    for _ in range(3000 // period_ms):
        advance()
        while k * SPACING_NS <= simulated[0]:
            assert pacer.wait(k * SPACING_NS) is SampleAction.GO
            k += 1
    assert stalls == []
    begin, jump_index = clock.now_ns, k
    simulated[0] += 5_000_000_000
    pacer.tick()
    while k * SPACING_NS <= simulated[0]:
        assert pacer.wait(k * SPACING_NS) is SampleAction.GO
        passed.append(clock.now_ns - begin)
        k += 1
    m = k - jump_index
    assert m >= 1000
    spacing = SPACING_NS / 8.0 / speed
    allowed = 2_000_000 / spacing + 2  # what is less than 2 ms late may follow at once
    assert (np.array(passed) >= (np.arange(m) - allowed) * spacing * 0.99).all()
    assert passed[-1] <= m * spacing * 1.01
    while not stalls:
        advance()
        pacer.wait(k * SPACING_NS)
        k += round(period_ms * 1_000_000 * speed) // SPACING_NS or 1
    (stall,) = stalls
    assert m - 110 <= stall.samples <= m + 1  # those late by less than a tick and 50 ms are on time
    assert abs(stall.late_ns * speed / 5e9 - 1.0) < 0.05
