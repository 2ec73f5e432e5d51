# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Statistics of a topic's stamps: all simulated losses are counted, and no others."""

import numpy as np
import pytest

from imu_sim_ros.nodes.recorder.recording import RecordedTopic
from imu_sim_ros.recordings.live_clock import LiveClock

PERIOD_NS = 5_000_000
IMU = "sensor_msgs/msg/Imu"


def stamps(count: int = 1000) -> np.ndarray:
    return 1_000_000_000 + PERIOD_NS * np.arange(count, dtype=np.int64)


def clock_of(t_ns: np.ndarray, batch: int = 100, max_gap: float = 0.0) -> LiveClock:
    statistics = LiveClock(max_gap)
    for start in range(0, len(t_ns), batch):
        statistics.add(t_ns[start : start + batch])
    statistics.finish()
    return statistics


def counts(statistics: LiveClock) -> tuple[int, int, int, int]:
    return (
        statistics.gaps,
        statistics.missing,
        statistics.duplicates,
        statistics.out_of_order,
    )


@pytest.mark.parametrize("batch", [1, 7, 100, 1000])
def test_an_unbroken_stream_has_nothing_to_report(batch):
    statistics = clock_of(stamps(), batch)
    assert counts(statistics) == (0, 0, 0, 0)
    assert statistics.messages == 1000
    assert statistics.rate == pytest.approx(200.0, rel=1e-12)


@pytest.mark.parametrize("batch", [1, 7, 100, 1000])
def test_gaps_are_counted_with_the_messages_that_are_missing(batch):
    t_ns = np.delete(stamps(), [300, 500, 501, 502, 700])
    assert counts(clock_of(t_ns, batch)) == (3, 5, 0, 0)


@pytest.mark.parametrize("batch", [1, 7, 100])
def test_repeated_stamps_are_duplicates(batch):
    t_ns = np.sort(np.concatenate([stamps(), stamps()[[10, 400, 401]]]))
    assert counts(clock_of(t_ns, batch)) == (0, 0, 3, 0)


def test_exchanged_messages_are_out_of_order_and_no_gap():
    t_ns = stamps()
    t_ns[[450, 451]] = t_ns[[451, 450]]
    assert counts(clock_of(t_ns)) == (0, 0, 0, 1)


def test_a_clock_set_back_is_one_step_out_of_order_and_begins_anew():
    t_ns = np.concatenate([stamps(500) + 10**12, stamps(500)])
    assert counts(clock_of(t_ns)) == (0, 0, 0, 1)


def test_jitter_below_half_an_interval_is_no_gap():
    generator = np.random.default_rng(1)
    jitter = generator.uniform(-0.2, 0.2, 1000) * PERIOD_NS
    assert counts(clock_of(stamps() + jitter.astype(np.int64))) == (0, 0, 0, 0)


def test_a_given_limit_takes_the_place_of_the_usual_distance():
    t_ns = np.delete(stamps(), [300, 500, 501, 502])
    assert clock_of(t_ns, max_gap=3e-9 * PERIOD_NS).gaps == 1


def test_random_losses_are_all_found():
    generator = np.random.default_rng(2)
    received = generator.random(20000) > 0.05
    received[[0, -1]] = True
    t_ns = stamps(20000)[received]
    assert clock_of(t_ns).missing == 20000 - received.sum()


@pytest.mark.parametrize("rows", [[0], [500], [0, 1, 700]], ids=str)
def test_a_stamp_that_was_not_set_leaves_the_statistics_of_the_others(rows):
    topic = RecordedTopic("/imu", IMU, (), "", "", LiveClock())
    for k, stamp_ns in enumerate(stamps().tolist()):
        reception_ns = 10**18 + k
        topic.take(reception_ns, None if k in rows else stamp_ns, bytes(12) + bytes([k % 251]))
    topic.finish()
    assert (topic.stamped, topic.messages, topic.unset) == (True, 1000, len(rows))
    assert topic.clock.rate == pytest.approx(200.0, rel=1e-9)


def test_messages_without_a_stamp_have_the_rate_of_their_reception():
    topic = RecordedTopic("/text", "std_msgs/msg/String", (), "", "", LiveClock())
    for t_ns in stamps().tolist():
        topic.take(t_ns, None, b"the same")
    topic.finish()
    assert (topic.stamped, topic.messages) == (False, 1000)
    assert topic.clock.rate == pytest.approx(200.0, rel=1e-9)
