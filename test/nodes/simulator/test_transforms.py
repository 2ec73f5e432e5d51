# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""/tf and /tf_static of the running simulator, with tf2_msgs."""

import hashlib
import json
import os
from typing import Any

import numpy as np
import pytest
from rosbags.typesys import Stores, get_typestore

from imu_sim_ros.core import rotation
from imu_sim_ros.nodes.messages import definition, message_class, stamp_offset, type_hash

pytestmark = [pytest.mark.ros, pytest.mark.usefixtures("tf2_msgs")]

TYPE = "tf2_msgs/msg/TFMessage"
STORE = get_typestore(Stores.ROS2_JAZZY)


def transforms(payloads: list[bytes]) -> list[Any]:
    return [t for data in payloads for t in STORE.deserialize_cdr(data, TYPE).transforms]


def wait_for_static(listener: Any) -> list[Any]:
    from rclpy.qos import DurabilityPolicy

    durability = DurabilityPolicy.TRANSIENT_LOCAL
    listener.listen("/tf_static", message_class(TYPE), depth=10, durability=durability)
    listener.wait_for("/tf_static", 1)
    listener.spin(0.5)
    assert len(listener.raw["/tf_static"]) == 1
    return transforms(listener.raw["/tf_static"])


def numbers(transform: Any) -> tuple[list[float], list[float]]:
    p, r = transform.transform.translation, transform.transform.rotation
    return [p.x, p.y, p.z], [r.w, r.x, r.y, r.z]


def test_the_place_of_each_imu_reaches_who_comes_late(start, listener):
    # A quarter turn about z: the right IMU's x looks along the body's y.
    mounting = [0.0, -1.0, 0.0, 1.0, 0.0, 0.0, 0.0, 0.0, 1.0]
    start(
        "simulator",
        imus="[left, right]",
        left__imu__lever_arm="[0.0, 0.1, 0.0]",
        right__imu__lever_arm="[0.1, -0.2, 0.05]",
        right__imu__mounting=mounting,
        rate=50,
    )
    listener.spin(1.5)
    transforms = wait_for_static(listener)
    assert {t.header.frame_id for t in transforms} == {"base_link"}
    places = {t.child_frame_id: numbers(t) for t in transforms}
    assert places.keys() == {"left_imu_link", "right_imu_link"}
    assert places["left_imu_link"] == ([0.0, 0.1, 0.0], [1.0, 0.0, 0.0, 0.0])
    position, q = places["right_imu_link"]
    assert position == [0.1, -0.2, 0.05]
    np.testing.assert_allclose(
        rotation.rotate(np.array([q]), np.array([[1.0, 0, 0]])), [[0.0, 1.0, 0.0]], atol=1e-15
    )


@pytest.mark.parametrize("parameters", [{"publish__tf_static": False}, {"imu_frame": "base_link"}])
def test_without_a_transform_there_is_no_topic(start, listener, parameters):
    from sensor_msgs.msg import Imu

    listener.listen("imu/data_raw", Imu)
    start("simulator", **parameters)
    listener.wait_for("imu/data_raw", 10)
    topics = dict(listener.node.get_topic_names_and_types())
    assert "/tf_static" not in topics
    assert "/tf" not in topics


def test_the_moving_transform_is_the_true_pose(start, listener):
    from nav_msgs.msg import Odometry

    listener.listen("/tf", message_class(TYPE))
    listener.listen("ground_truth/odom", Odometry)
    listener.spin(0.3)
    node = start(
        "simulator",
        rate=100,
        publish__tf_rate=50.0,
        duration=1.0,
        wait_for_subscribers=0,
        wait_for_truth_subscribers=1,
        world_frame="map",
    )
    assert listener.wait_for_end(node) == 0, node.output
    assert "published 50 messages on /tf" in node.output
    moved = transforms(listener.raw["/tf"])
    poses = {
        (m.header.stamp.sec, m.header.stamp.nanosec): m
        for m in listener.messages("ground_truth/odom")
    }
    assert len(moved) == 50
    for transform in moved:
        stamp = transform.header.stamp
        odometry = poses[stamp.sec, stamp.nanosec]
        assert (transform.header.frame_id, transform.child_frame_id) == ("map", "base_link")
        p, q = odometry.pose.pose.position, odometry.pose.pose.orientation
        assert numbers(transform) == ([p.x, p.y, p.z], [q.w, q.x, q.y, q.z])


def test_the_graph_and_the_description_are_those_of_tf2_msgs(start, listener):
    """The hash of the description that the node gives is the type's: REP-2016's RIHS01."""
    from type_description_interfaces.srv import GetTypeDescription

    start("simulator", publish__tf_rate=10.0, imu__lever_arm="[0.1, -0.2, 0.05]")
    (transform,) = wait_for_static(listener)
    assert (transform.header.frame_id, transform.child_frame_id) == ("base_link", "imu_link")
    assert numbers(transform) == ([0.1, -0.2, 0.05], [1.0, 0.0, 0.0, 0.0])
    (info,) = listener.node.get_publishers_info_by_topic("/tf_static")
    assert (info.topic_type, str(info.topic_type_hash)) == (TYPE, type_hash(TYPE))
    answer = listener.call(
        "simulator/get_type_description",
        GetTypeDescription,
        type_name=TYPE,
        type_hash=type_hash(TYPE),
        include_type_sources=False,
    )
    assert answer.successful, answer.failure_reason
    described = answer.type_description
    content = {
        "type_description": individual(described.type_description),
        "referenced_type_descriptions": [
            individual(referenced_type)
            for referenced_type in described.referenced_type_descriptions
        ],
    }
    digest = hashlib.sha256(json.dumps(content).encode()).hexdigest()
    assert f"RIHS01_{digest}" == type_hash(TYPE)


def individual(described: Any) -> dict[str, Any]:
    """Return what the hash is made of: all but the default values."""
    return {
        "type_name": described.type_name,
        "fields": [
            {
                "name": field.name,
                "type": {
                    "type_id": field.type.type_id,
                    "capacity": field.type.capacity,
                    "string_capacity": field.type.string_capacity,
                    "nested_type_name": field.type.nested_type_name,
                },
            }
            for field in described.fields
        ],
    }


def test_transforms_are_recorded(start, tmp_path):
    from rosbags.highlevel import AnyReader

    bag = tmp_path / "bag"
    recorder = start("recorder", topics="[/tf, /tf_static]", output=str(bag))
    node = start(
        "simulator", publish__tf_rate=100.0, duration=2.0, start_time=100.0, wait_for_subscribers=0
    )
    assert node.status() == 0, node.output
    assert recorder.end() == 0, recorder.output
    with AnyReader([bag]) as reader:
        assert {c.topic: c.msgtype for c in reader.connections} == {"/tf": TYPE, "/tf_static": TYPE}
        assert all(c.digest == type_hash(TYPE) for c in reader.connections)
        times = [t for c, t, data in reader.messages() if c.topic == "/tf"]
    assert 100 < len(times) <= 200
    # The stamp of the transform, not the wall clock.
    assert max(times) == 101_990_000_000


def test_what_is_known_of_the_type():
    assert definition(TYPE).startswith("geometry_msgs/TransformStamped[] transforms\n")
    assert "MSG: geometry_msgs/Quaternion" in definition(TYPE)
    assert stamp_offset(message_class(TYPE)) == 8


def test_an_empty_message_of_transforms_has_no_stamp_and_ends_no_recorder(
    start, listener, tmp_path
):
    from rosbags.highlevel import AnyReader

    bag = tmp_path / "bag"
    publisher = listener.node.create_publisher(message_class(TYPE), "/tf", 10)
    recorder = start("recorder", topics="[/tf]", output=str(bag))
    while publisher.get_subscription_count() < 1:
        listener.spin(0.1)
    listener.spin(0.5)
    for _ in range(3):
        publisher.publish(bytes([0, 1, 0, 0, 0, 0, 0, 0]))
        listener.spin(0.2)
    assert recorder.end() == 0, recorder.output
    with AnyReader([bag]) as reader:
        assert len(list(reader.messages())) == 3


def test_without_tf2_msgs_the_simulator_says_that_there_are_no_transforms(
    start, refused, monkeypatch
):
    if "PYTHONPATH" not in os.environ:
        pytest.skip("tf2_msgs is installed")
    monkeypatch.delenv("PYTHONPATH")
    node = start("simulator", duration=0.1, wait_for_subscribers=0)
    assert node.status() == 0, node.output
    assert (
        "/tf_static is not published: tf2_msgs/msg/TFMessage: the package tf2_msgs" in node.output
    )
    asked = [["--publish.tf_static", "true"], ["--publish.tf_rate", "10"]]
    for lines in refused("simulator", asked):
        assert any("ROS 2 from apt has it as ros-jazzy-tf2-msgs" in line for line in lines)
        assert not any("Traceback" in line for line in lines)
