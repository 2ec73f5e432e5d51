# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

import itertools
import threading
import time

import pytest

from imu_sim_ros.nodes.simulator.pacing import Pacer, Verdict

SPACING_NS = 5_000_000


class Player:
    """Waits for one sample after the other in a thread, as the engine does."""

    def __init__(self, pacer: Pacer) -> None:
        self.pacer = pacer
        self.verdicts: list[Verdict] = []
        self.thread = threading.Thread(target=self.play)

    def play(self) -> None:
        self.pacer.interrupt(False)  # a run begins
        for k in itertools.count():
            self.verdicts.append(self.pacer.wait(k * SPACING_NS))
            if self.verdicts[-1] is Verdict.INTERRUPTED:
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
        assert player.verdicts == [Verdict.GO] * 3


def test_steps_that_were_not_taken_in_time_never_are(pacer: Pacer) -> None:
    assert pacer.step(3, 0.1) == 0
    with Player(pacer) as player:
        assert pacer.step(2, 30.0) == 2
        assert player.verdicts == [Verdict.GO] * 2


def test_an_interruption_ends_what_was_asked_for(pacer: Pacer) -> None:
    with Player(pacer) as player:
        assert pacer.step(2, 30.0) == 2
    assert player.verdicts == [Verdict.GO] * 2 + [Verdict.INTERRUPTED]
