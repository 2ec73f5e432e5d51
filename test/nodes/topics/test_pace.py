# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Polling times of a reader: waiting times of the messages and number of polls."""

import numpy as np
import pytest

from imu_sim_ros.nodes.subscriptions import PollTimer

PERIOD = 0.002
OVERSLEPT_NS = 60_000
"""Excess duration of a sleep, and the duration of a poll [ns]."""
LEARNT_NS = 500_000_000
"""Time after which the period of the messages is known [ns]."""
START_NS = 1_700_000_000_000_000_000


def look_for(arrivals_ns: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return when a reader looked (m,), and how long each of the messages (n,) waited [ns]."""
    pace, now_ns, taken_count = PollTimer(PERIOD), int(arrivals_ns[0]) - 10**9, 0
    looks, waits = [], np.zeros(len(arrivals_ns))
    while taken_count < len(arrivals_ns):
        looks.append(now_ns)
        end = int(np.searchsorted(arrivals_ns, now_ns, side="right"))
        waits[taken_count:end] = now_ns - arrivals_ns[taken_count:end]
        last_arrival_ns = int(arrivals_ns[end - 1]) if end > taken_count else 0
        now_ns += round(pace.wait(end - taken_count, last_arrival_ns, now_ns) * 1e9) + OVERSLEPT_NS
        taken_count = end
    return np.array(looks), waits


def arrivals(rate: float, seconds: float, jitter: float = 0.0) -> np.ndarray:
    """Return arrivals [ns] that are late by up to ``jitter`` seconds."""
    count = round(rate * seconds)
    late = np.random.default_rng(3).uniform(0.0, jitter, count)
    return START_NS + np.round((np.arange(count) / rate + late) * 1e9).astype(np.int64)


@pytest.mark.parametrize(
    ("rate", "jitter", "looks_per_second", "longest"),
    [
        (100, 0.0, 100, 0.3e-3),
        (200, 0.0, 200, 0.3e-3),
        (400, 0.1e-3, 400, 0.4e-3),
        (500, 0.1e-3, 250, 2.4e-3),
        (1000, 0.0, 334, 2.3e-3),
        (1000, 0.1e-3, 334, 2.4e-3),
        (2000, 0.1e-3, 400, 2.4e-3),
        (8000, 0.05e-3, 471, 2.4e-3),
    ],
)
def test_regular_messages_are_found_in_step(
    rate: float, jitter: float, looks_per_second: float, longest: float
) -> None:
    """Messages wait no longer than with a poll every 2 ms (485 polls/s), in fewer polls."""
    sent = arrivals(rate, 3.0, jitter)
    looks, waits = look_for(sent)
    learnt_ns = sent[0] + LEARNT_NS
    assert waits[sent > learnt_ns].max() <= longest * 1e9
    assert np.sum(looks > learnt_ns) <= looks_per_second * (3.0 - 0.5) + 2


@pytest.mark.parametrize(
    "sent",
    [
        arrivals(200, 3.0, 3e-3),
        arrivals(1000, 3.0, 0.8e-3),
        START_NS + np.cumsum(np.random.default_rng(4).exponential(1e6, 3000)).astype(np.int64),
        np.repeat(arrivals(100, 3.0), 10),
        np.concatenate(
            [arrivals(1000, 1.0), 10**9 + arrivals(50, 1.0), 3 * 10**9 + arrivals(2000, 1.0)]
        ),
    ],
    ids=["jitter, 200 Hz", "jitter, 1 kHz", "at random", "in bursts", "at changing rates"],
)
def test_others_wait_hardly_longer_than_a_period(sent: np.ndarray) -> None:
    """And there are no more looks than at a constant pace."""
    looks, waits = look_for(np.sort(sent))
    assert waits.max() <= 10.2e6
    assert np.quantile(waits, 0.99) <= 1.6 * PERIOD * 1e9
    during = (looks >= sent[0]) & (looks <= sent[-1])
    assert np.sum(during) <= (sent[-1] - sent[0]) / (PERIOD * 1e9) + 1


@pytest.mark.parametrize("jump_ns", [-3600 * 10**9, 3600 * 10**9, -(10**6)])
def test_a_clock_that_is_set_changes_nothing_for_long(jump_ns: int) -> None:
    pace, now_ns = PollTimer(PERIOD), START_NS
    for _ in range(100):
        delay = pace.wait(1, now_ns, now_ns + 100_000)
        now_ns += 5_000_000
    assert delay == pytest.approx(5.05e-3)
    now_ns += jump_ns
    delays = []
    for _ in range(100):
        delays.append(pace.wait(1, now_ns, now_ns + 100_000))
        assert 0.0 <= delays[-1] <= 10e-3
        now_ns += 5_000_000
    assert delays[-1] == pytest.approx(5.05e-3)


def test_a_middleware_without_times_of_reception_is_looked_at_every_period() -> None:
    pace = PollTimer(PERIOD)
    assert {pace.wait(2, 0, START_NS + k * 2_000_000) for k in range(100)} == {PERIOD}


def test_a_silent_topic_is_looked_at_every_period() -> None:
    pace, now_ns = PollTimer(PERIOD), START_NS
    for _ in range(100):
        pace.wait(1, now_ns, now_ns)
        now_ns += 5_000_000
    assert pace.wait(0, 0, now_ns + 10**9) == PERIOD
