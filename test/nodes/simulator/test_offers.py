# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Peers that ask for more than the simulator offers by itself, or offer more than is asked for."""

from pathlib import Path
from typing import Any

import pytest
from rosbags.highlevel import AnyReader

from imu_sim_ros.core.conventions import IMU_TOPIC, TRUTH_TOPIC

pytestmark = pytest.mark.ros

OF_IMU = f"qos_overrides./{IMU_TOPIC}.publisher"
OF_TRUTH = f"qos_overrides./{TRUTH_TOPIC}.publisher"


@pytest.fixture
def demanding(listener: Any) -> Any:
    """Listen before any publisher is there.

    rmw takes BEST_AVAILABLE for the strictest then: transient_local and manual_by_topic.
    """
    from nav_msgs.msg import Odometry
    from rclpy.duration import Duration
    from rclpy.qos import QoSPresetProfiles
    from sensor_msgs.msg import Imu

    any_offer = QoSPresetProfiles.BEST_AVAILABLE.value
    listener.listen(
        IMU_TOPIC,
        Imu,
        reliability=any_offer.reliability,
        durability=any_offer.durability,
        liveliness=any_offer.liveliness,
    )
    listener.listen(TRUTH_TOPIC, Odometry, deadline=Duration(seconds=5.0))
    return listener


def test_what_is_offered_by_overrides_reaches_those_who_ask_for_it(
    start: Any, demanding: Any
) -> None:
    overrides = (
        *("-p", f"{OF_IMU}.durability:=transient_local"),
        *("-p", f"{OF_IMU}.liveliness:=manual_by_topic"),
        *("-p", f"{OF_TRUTH}.deadline:=5000000000"),
    )
    waiting = {"wait_for_subscribers": 1, "wait_for_truth_subscribers": 1}
    node = start("simulator", "--ros-args", *overrides, duration=0.5, **waiting)
    assert demanding.wait_for_end(node) == 0, node.output
    assert {topic: len(payloads) for topic, payloads in demanding.raw.items()} == {
        IMU_TOPIC: 100,
        TRUTH_TOPIC: 100,
    }
    assert "incompatible" not in node.output


def test_the_simulator_tells_which_request_it_does_not_meet(start: Any, demanding: Any) -> None:
    node = start("simulator", duration=30.0)
    # A reader that misses several policies is told of the last that was looked at.
    policies = {IMU_TOPIC: ("DURABILITY", "LIVELINESS"), TRUTH_TOPIC: ("DEADLINE",)}

    def told(topic: str) -> bool:
        return any(
            f"'{topic}', requesting incompatible QoS" in line and line.endswith(policies[topic])
            for line in node.output.splitlines()
        )

    demanding.wait_until(lambda: all(map(told, policies)), "both warnings")
    assert demanding.raw == {IMU_TOPIC: [], TRUTH_TOPIC: []}


@pytest.mark.parametrize("name", ["recorder", "integrator"])
def test_a_publisher_that_offers_a_deadline_is_heard(
    start: Any, listener: Any, tmp_path: Path, name: str
) -> None:
    from rclpy.duration import Duration
    from rclpy.qos import DurabilityPolicy, LivelinessPolicy, QoSProfile
    from sensor_msgs.msg import Imu

    offer = QoSProfile(
        depth=100,
        deadline=Duration(seconds=5.0),
        liveliness=LivelinessPolicy.MANUAL_BY_TOPIC,
        durability=DurabilityPolicy.TRANSIENT_LOCAL,
    )
    publisher = listener.node.create_publisher(Imu, IMU_TOPIC, offer)
    settings = (
        {"output": str(tmp_path / "bag"), "topics": f"[{IMU_TOPIC}]"} if name == "recorder" else {}
    )
    node = start(name, **settings)
    listener.wait_until(publisher.get_subscription_count, "a subscription")
    listener.spin(0.5)
    for k in range(1, 11):
        message = Imu()
        message.header.stamp.sec = k
        publisher.publish(message)
    listener.wait_until(lambda: publisher.wait_for_all_acked(Duration(seconds=0.05)), "receipt")
    listener.spin(0.5)
    assert node.end() == 0, node.output
    if name == "recorder":
        with AnyReader([tmp_path / "bag"]) as reader:
            assert len(list(reader.messages())) == 10
    else:
        assert f"received 10 messages on {IMU_TOPIC}" in node.output
