# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Types that have other fields in ROS 1 than in ROS 2, through bags of both, read by rosbags."""

import numpy as np
import pytest
from rosbags.highlevel import AnyReader
from rosbags.rosbag1 import Writer as Ros1Writer
from rosbags.rosbag2 import Writer as Ros2Writer
from rosbags.typesys import Stores, get_typestore

import imu_sim_ros as ims
from imu_sim_ros.bags.messages.schemas import Translation, message_type, typestore_of_format

ROS1, ROS2 = get_typestore(Stores.ROS1_NOETIC), get_typestore(Stores.ROS2_JAZZY)
DIGESTS = {
    "sensor_msgs/msg/Range": "c005c34273dc426c67a020a87bc24148",
    "visualization_msgs/msg/Marker": "4048c9de2a16f4ae8e0538085ebf1b97",
    "visualization_msgs/msg/MarkerArray": "d155b9ce5188fbaf89745847fd5882d7",
    "shape_msgs/msg/SolidPrimitive": "d8f8cbc74c5ff283fca29569ccefb45d",
    "sensor_msgs/msg/CameraInfo": "c9a58c1b0b154e0e6da7578cb991d214",
}
"""MD5 sums in ROS 1 Noetic (wiki.ros.org and the installed packages)."""
LEFT_OUT = "texture, texture_resource, uv_coordinates"


def make_message(types, name, **fields):
    """Return a message with these fields, all others 0 or empty."""
    kinds = types.fielddefs[name][1]
    values = []
    for field, (node, inner) in kinds:
        if field.lower() in fields:
            values.append(fields[field.lower()])
        elif node.name == "NAME":
            values.append(make_message(types, inner))
        elif node.name == "BASE":
            values.append("" if inner[0] == "string" else 0)
        else:
            size = inner[1] if node.name == "ARRAY" else 0
            plain = inner[0][0].name == "BASE" and inner[0][1][0] != "string"
            values.append(np.zeros(size, inner[0][1][0]) if plain else [])
    return types.types[name](*values)


def header(types, k):
    stamp = types.types["builtin_interfaces/msg/Time"](10 + k, 5)
    return make_message(types, "std_msgs/msg/Header", stamp=stamp, frame_id="base")


def messages(types, k):
    point = types.types["geometry_msgs/msg/Point"](1.0, 2.0, 3.0)
    head = header(types, k)
    marker = make_message(types, "visualization_msgs/msg/Marker", header=head, ns="n", text="hi",
                          id=k, points=[point], texture_resource="away")  # fmt: skip
    k_matrix = np.arange(9.0)
    return {
        "sensor_msgs/msg/Range": make_message(
            types, "sensor_msgs/msg/Range", header=head, radiation_type=1, field_of_view=0.25,
            min_range=0.5, max_range=4.0, range=1.5 + k, variance=0.25,
        ),
        "visualization_msgs/msg/Marker": marker,
        "visualization_msgs/msg/MarkerArray": make_message(
            types, "visualization_msgs/msg/MarkerArray", markers=[marker, marker]
        ),
        "shape_msgs/msg/SolidPrimitive": make_message(
            types, "shape_msgs/msg/SolidPrimitive", type=1, dimensions=np.array([1.0, 2.0, 3.0])
        ),
        "sensor_msgs/msg/CameraInfo": make_message(
            types, "sensor_msgs/msg/CameraInfo", header=head, width=3, d=np.ones(2), k=k_matrix
        ),
    }  # fmt: skip


@pytest.fixture
def ros2_bag(tmp_path):
    with Ros2Writer(tmp_path / "two", version=9) as writer:
        topics = {}
        for k in range(3):
            for name, message in messages(ROS2, k).items():
                if name not in topics:
                    topics[name] = writer.add_connection(f"/{name}", name, typestore=ROS2)
                data = ROS2.serialize_cdr(message, name)
                writer.write(topics[name], (10 + k) * 10**9 + 5, data)
    return tmp_path / "two"


@pytest.fixture
def ros1_bag(tmp_path):
    with Ros1Writer(tmp_path / "one.bag") as writer:
        topics = {}
        for k in range(3):
            for name, message in messages(ROS1, k).items():
                if name not in topics:
                    topics[name] = writer.add_connection(f"/{name}", name, typestore=ROS1)
                data = ROS1.serialize_ros1(message, name)
                writer.write(topics[name], (10 + k) * 10**9 + 5, data)
    return tmp_path / "one.bag"


def content(path):
    by_type = {}
    with AnyReader([path], default_typestore=ROS2) as reader:
        digests = {connection.msgtype: connection.digest for connection in reader.connections}
        for connection, _, raw in reader.messages():
            by_type.setdefault(connection.msgtype, []).append(
                reader.deserialize(raw, connection.msgtype)
            )
    return by_type, digests


def check(messages_by_type):
    for k in range(3):
        message = {name: series[k] for name, series in messages_by_type.items()}
        distance, marker = (
            message["sensor_msgs/msg/Range"],
            message["visualization_msgs/msg/Marker"],
        )
        assert (distance.range, distance.max_range, distance.radiation_type) == (1.5 + k, 4.0, 1)
        assert distance.header.stamp.sec == 10 + k
        assert distance.header.frame_id == "base"
        inner = message["visualization_msgs/msg/MarkerArray"].markers[1]
        for candidate in (marker, inner):
            assert (candidate.ns, candidate.text, candidate.id, candidate.points[0].z) == (
                "n",
                "hi",
                k,
                3.0,
            )
        assert list(message["shape_msgs/msg/SolidPrimitive"].dimensions) == [1.0, 2.0, 3.0]


def test_from_ros2_each_type_has_the_fields_and_the_digest_of_ros1(ros2_bag, tmp_path):
    result = ims.convert(ros2_bag, tmp_path / "out.bag")
    by_type, digests = content(tmp_path / "out.bag")
    check(by_type)
    assert digests == DIGESTS
    camera = by_type["sensor_msgs/msg/CameraInfo"][-1]
    assert (list(camera.D), camera.K[8], camera.width) == ([1.0, 1.0], 8.0, 3)
    assert not hasattr(by_type["sensor_msgs/msg/Range"][0], "variance")
    report = "\n".join(result.warnings)
    assert "/Range: sensor_msgs/Range of ROS 1 is another one: variance left out" in report
    assert f"Marker of ROS 1 is another one: mesh_file, {LEFT_OUT} left out" in report
    assert "CameraInfo" not in report


def test_from_ros1_each_type_has_the_fields_of_ros2(ros1_bag, tmp_path):
    result = ims.convert(ros1_bag, tmp_path / "out.mcap")
    by_type, _ = content(tmp_path / "out.mcap")
    check(by_type)
    assert by_type["sensor_msgs/msg/Range"][0].variance == 0.0
    assert by_type["visualization_msgs/msg/Marker"][0].texture.format == ""
    assert "Range of ROS 2 is another one: variance 0 or empty" in "\n".join(result.warnings)


def test_what_is_recorded_into_a_ros1_bag_has_the_fields_of_ros1():
    name = "sensor_msgs/msg/Range"
    text, _ = ROS2.generate_msgdef(name, ros_version=2)
    recording = message_type(name, text, "", "ros1")
    assert recording.schema.digest == DIGESTS[name]
    data = recording.convert(bytes(ROS2.serialize_cdr(messages(ROS2, 0)[name], name)))
    assert ROS1.deserialize_ros1(data, name).range == 1.5


def test_a_type_that_both_have_is_of_the_other_generation():
    """All that comes with both: definition and digest are those of the other generation."""
    for types, encoding in ((ROS2, "ros1"), (ROS1, "cdr")):
        translation, theirs = Translation(types, encoding), typestore_of_format(encoding)
        for name in types.fielddefs.keys() & theirs.fielddefs.keys():
            assert translation.target_types.fielddefs[name] == theirs.fielddefs[name], name
