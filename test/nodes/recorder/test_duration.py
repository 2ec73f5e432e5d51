# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""``--duration`` of the recorder counts stamps."""

import pytest

from imu_sim_ros.nodes.recorder.recording import DurationLimit, Message

pytestmark = pytest.mark.ros


def stream(topic, rate, count, start_ns=10**18):
    return [Message(topic, start_ns + round(k * 1e9 / rate), b"") for k in range(count)]


@pytest.mark.parametrize("batch", [1, 7, 5000])
@pytest.mark.parametrize("rate", [200.0, 333.0])
def test_eight_seconds_are_eight_seconds_of_stamps_in_each_topic(batch, rate):
    limit = DurationLimit(8.0)
    recorded_counts = {"a": 0, "b": 0}
    for topic, shift in (("a", 0), ("b", 3_000_000)):
        messages = stream(topic, rate, 3000, 10**18 + shift)
        for k in range(0, len(messages), batch):
            recorded_counts[topic] += len(limit.take(messages[k : k + batch], 0.0))
    assert recorded_counts == {"a": 8 * rate, "b": 8 * rate}
    assert limit.reached(0.1, 0.0)


def test_a_topic_that_began_later_is_waited_for_and_one_that_ended_is_not():
    limit = DurationLimit(1.0)
    limit.take(stream("early", 100, 101), 0.0)
    limit.take(stream("late", 100, 50), 0.5)
    assert not limit.reached(0.5, 1.0)
    assert limit.reached(0.5, 1.6)
    limit.take(stream("late", 100, 60, 10**18 + 500_000_000), 1.7)
    assert limit.reached(0.5, 1.7)


def test_stamps_that_stand_still_end_by_the_clock():
    limit = DurationLimit(2.0)
    for k in range(5):
        assert len(limit.take([Message("zero", 0, b"")], 0.5 * k)) == 1
    assert not limit.reached(1.9, 2.0)
    assert limit.reached(2.0, 2.0)


def test_a_first_stamp_of_the_wall_clock_does_not_hide_the_others():
    """The first sample of a run with start_time 0 has stamp zero, like an unset stamp."""
    limit = DurationLimit(1.0)
    limit.take([Message("a", 17 * 10**17, b"")], 0.0)
    recorded_messages = limit.take(stream("a", 100, 300, 10_000_000), 0.1)
    assert len(recorded_messages) == 100
    assert limit.reached(0.1, 0.1)


def test_slow_stamps_are_waited_for():
    limit = DurationLimit(2.0)
    limit.take(stream("slow", 100, 100), 9.9)
    assert not limit.reached(10.0, 10.0)


def test_a_duration_of_zero_is_no_limit():
    limit = DurationLimit(0.0)
    assert len(limit.take(stream("a", 1, 100), 0.0)) == 100
    assert not limit.reached(1e9, 1e9)
