# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Topics that stop while others go on."""

import pytest

from imu_sim_ros.nodes.recorder.stops import Stop, TopicStops


def fed(intervals, end, stop, length):
    """Return what is noticed each second: topics by their intervals, one of which pauses."""
    stops, noticed, arrivals = TopicStops(), [], []
    for topic, interval in intervals.items():
        times = [k * interval for k in range(int(end / interval))]
        arrivals += [(t, topic) for t in times if topic != "/imu" or not stop <= t < stop + length]
    second = 1.0
    for time_s, topic in sorted(arrivals):
        while time_s >= second:
            noticed.append((second, *stops.changes()))
            second += 1.0
        stops.add(topic, 1, time_s)
    return stops, [entry for entry in noticed if entry[1] or entry[2]]


def test_a_topic_that_stops_is_noticed_once_and_when_it_goes_on():
    stops, noticed = fed({"/imu": 0.005, "/odom": 0.05}, 30.0, 10.0, 8.0)
    (_, begun, ended), (_, begun_later, ended_later) = noticed
    assert [stop.topic for stop in begun] == ["/imu"]
    assert begun[0].silence == pytest.approx(3.5, abs=0.6)
    assert (ended, begun_later, ended_later) == ([], [], ["/imu"])
    assert stops.all() == []


def test_a_topic_that_stays_away_is_a_stop_at_the_end():
    stops, _ = fed({"/imu": 0.005, "/odom": 0.05}, 30.0, 10.0, 100.0)
    (stop,) = stops.all()
    assert stop == Stop("/imu", pytest.approx(19.96, abs=0.06))


def test_slow_and_seldom_topics_and_the_end_of_all_are_no_stops():
    """A topic at 0.5 Hz is silent for 20 s before it has stopped; /settings came once."""
    stops, noticed = fed({"/imu": 2.0, "/odom": 0.05, "/settings": 59.0}, 60.0, 30.0, 12.0)
    assert (stops.all(), noticed) == ([], [])
    assert fed({"/imu": 0.005}, 10.0, 5.0, 100.0)[0].all() == []
