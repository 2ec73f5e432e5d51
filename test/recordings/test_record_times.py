# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Record times of messages that arrive: readers, which sort by them, keep the order of arrival."""

import numpy as np
import pytest

from imu_sim_ros.recordings.record_times import LiveRecordTimes

T_NS = 10**18 + 5_000_000 * np.arange(400)


def record_times(t_ns, topic="imu", times=None):
    times = times or LiveRecordTimes()
    return np.array([times.of(topic, stamp) for stamp in t_ns.tolist()])


def test_stamps_in_order_late_ones_and_pauses_are_record_times():
    t_ns = T_NS.copy()
    t_ns[[100, 101]] = t_ns[[101, 100]]
    t_ns[300:] += 3600 * 10**9
    np.testing.assert_array_equal(record_times(t_ns), t_ns)


@pytest.mark.parametrize("step_s", [-4, -(10**9) + 5])
def test_behind_a_reset_record_times_go_on(step_s):
    t_ns = T_NS.copy()
    t_ns[200:] += step_s * 10**9
    record_ns = record_times(t_ns)
    assert np.diff(record_ns).min() >= 0
    # The first four wait for the fifth, which tells a reset from strays.
    np.testing.assert_array_equal(np.diff(record_ns[204:]), 5_000_000)
    assert record_ns[-1] - record_ns[0] == T_NS[-1] - T_NS[0] - 25_000_000


@pytest.mark.parametrize("stray_ns", [1, 2 * 10**18])
def test_a_stray_stamp_changes_no_other_record_time(stray_ns):
    t_ns = T_NS.copy()
    t_ns[200] = stray_ns
    record_ns = record_times(t_ns)
    np.testing.assert_array_equal(np.delete(record_ns, 200), np.delete(T_NS, 200))
    assert record_ns[200] == T_NS[199]


def test_topics_that_are_reset_together_keep_their_distances():
    t_ns, times = T_NS.copy(), LiveRecordTimes()
    t_ns[200:] -= 4 * 10**9
    imu_ns = record_times(t_ns, "imu", times)
    odom_ns = record_times(t_ns + 2_000_000, "odom", times)
    np.testing.assert_array_equal(odom_ns[204:] - imu_ns[204:], 2_000_000)
