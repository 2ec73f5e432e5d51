# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""An object in a process of its own, and the Allan deviation that is computed there."""

import os
import signal
import subprocess
import sys
import time
from collections import Counter

import numpy as np
import pytest

from imu_sim_ros.calibration.noise import deviation
from imu_sim_ros.calibration.noise.deviation import DeviationAccumulator, DeviationElsewhere
from imu_sim_ros.calibration.second_process import SecondProcess
from imu_sim_ros.errors import MachineError

LIMIT = 60.0
"""Seconds after which what should end at once counts as stuck."""


def of_pieces(accumulator, y: np.ndarray, lengths: tuple[int, ...]) -> deviation.Deviation:
    for length in lengths:
        for first in range(0, length, 16384):
            accumulator.add(y[first : min(first + 16384, length)])
        accumulator.end_piece()
    return accumulator.result()


@pytest.mark.parametrize("lengths", [(40_000,), (9, 20_000, 15_000)])
def test_the_deviation_of_a_second_process_is_the_same_to_the_last_bit(lengths):
    y = np.random.default_rng(1).standard_normal((40_000, 6))
    here = of_pieces(DeviationAccumulator(200.0, 6), y, lengths)
    with SecondProcess() as second:
        there = of_pieces(DeviationElsewhere(second, 200.0, 6), y, lengths)
    assert here.size[-1] > 1024
    for own, other in zip(here, there, strict=True):
        assert np.array_equal(own, other)


@pytest.mark.parametrize("phases", [1 << 21, 25_000])
def test_sums_made_early_are_the_same_to_the_last_bit(monkeypatch, phases):
    """Also where the early ones are in vain, for only every second phase is kept in the end."""
    monkeypatch.setattr(deviation, "_PHASES", phases)
    y = np.random.default_rng(2).standard_normal((60_000, 2))
    late, early = (
        of_pieces(DeviationAccumulator(200.0, 2, early=early), y, (60_000, 40_000))
        for early in (False, True)
    )
    for one, other in zip(late, early, strict=True):
        assert np.array_equal(one, other)


def test_an_error_there_is_raised_here():
    with SecondProcess() as second:
        second.make(Counter)
        second.call("subtract", 5)
        for _ in range(20):  # more calls than wait: none of them may block
            second.call("clear")
        with pytest.raises(TypeError, match="not iterable"):
            second.result("most_common")


def test_a_process_that_was_killed_is_reported():
    with SecondProcess() as second:
        second.make(os.kill, 0, 0)
        second._process.send_signal(signal.SIGKILL)
        with pytest.raises(MachineError, match="ended with status -9"):
            second.result("real")


def test_the_end_does_not_wait_for_its_work():
    started = time.monotonic()
    with SecondProcess() as second:
        second.make(time.sleep, 2.0 * LIMIT)
        second.call("nothing")
    assert time.monotonic() - started < LIMIT
    assert second._process.returncode == -signal.SIGKILL


def test_it_ends_where_its_owner_is_killed():
    program = (
        "import os, signal\n"
        "from imu_sim_ros.calibration.second_process import SecondProcess\n"
        "second = SecondProcess()\n"
        "print(second._process.pid, flush=True)\n"
        "os.kill(os.getpid(), signal.SIGKILL)\n"
    )
    command = [sys.executable, "-c", program]
    # The other process inherits standard error: the pipe ends when both have ended.
    done = subprocess.run(command, capture_output=True, text=True, timeout=LIMIT)
    assert done.returncode == -signal.SIGKILL
    assert int(done.stdout) > 0
    assert done.stderr == ""
