# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""IMU, receiver and wheels live at their usual rates: a subscriber to everything misses nothing."""

from typing import Any

import pytest
from ros_messages import stamps_ns

from imu_sim_ros.core import timebase

pytestmark = pytest.mark.ros

DURATION = 2
RATES = {
    200: ("imu/data_raw", "ground_truth/odom", "ground_truth/imu"),
    10: ("gps/fix", "gps/velocity", "ground_truth/gps_fix", "ground_truth/gps_velocity"),
    50: ("wheel/odom", "joint_states", "ground_truth/wheel_odom", "ground_truth/joint_states"),
}
ERRORS = {10: ("ground_truth/gps_error",), 50: ("ground_truth/wheel_slip",)}


def test_nothing_is_lost_with_all_topics_at_once(start: Any, listener: Any) -> None:
    from geometry_msgs.msg import TwistWithCovarianceStamped, Vector3Stamped
    from nav_msgs.msg import Odometry
    from sensor_msgs.msg import Imu, JointState, NavSatFix

    kinds = (Imu, Odometry, Imu, NavSatFix, TwistWithCovarianceStamped, NavSatFix)
    kinds += (TwistWithCovarianceStamped, Odometry, JointState, Odometry, JointState)
    rates = {topic: rate for rate, topics in RATES.items() for topic in topics}
    for topic, kind in zip(rates, kinds, strict=True):
        listener.listen(topic, kind)
    for rate, topics in ERRORS.items():
        for topic in topics:
            rates[topic] = rate
            listener.listen(topic, Vector3Stamped)
    settings = {"rate": 200.0, "duration": float(DURATION), "trajectory__type": "circle"}
    settings |= {
        "publish__ground_truth_imu": True,
        "gnss__preset": "zed_f9p",
        "wheels__preset": "husky_a200",
    }
    settings |= {"wait_for_subscribers": 1, "wait_for_truth_subscribers": 1, "start_time": 100.0}
    node = start("simulator", "--sensors", "[gnss, wheels]", "--ros-args", **settings)
    assert listener.wait_for_end(node) == 0, node.output
    stamps = {topic: stamps_ns(listener.messages(topic)) for topic in rates}
    assert {topic: len(came) for topic, came in stamps.items()} == {
        topic: DURATION * rate for topic, rate in rates.items()
    }
    for topic, came in stamps.items():  # in order, each once
        times = timebase.sample_times_ns(0, DURATION * rates[topic], rates[topic], 100 * 10**9)
        assert came == times.tolist(), topic
