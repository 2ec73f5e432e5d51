# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""The definitions that stand in this package against those that rosbags has."""

import subprocess
import sys

import pytest

from imu_sim_ros.bags.messages.definitions import digests
from imu_sim_ros.bags.messages.schemas import (
    ros1_name,
    ros2_name,
    schema,
    typestore,
    typestore_of_format,
)

GPS_FIX = "gps_msgs/GPSFix"
LIVOX = "livox_ros_driver2/CustomMsg"


@pytest.mark.parametrize(
    ("name", "encoding"),
    sorted(
        {(name, encoding) for name in digests("ros2") for encoding in ("cdr", "ros1")}
        - {(name, encoding) for name in (GPS_FIX, LIVOX) for encoding in ("cdr", "ros1")}
        - {("tf2_msgs/TFMessage", "ros1")}  # which rosbags does not know
    ),
)
def test_texts_and_digests_are_those_of_rosbags(name, encoding):
    name = ros2_name(name)
    ours, theirs = schema(name, encoding), schema(name, encoding, typestore_of_format(encoding))
    assert ours == theirs
    assert ours.text


def test_both_encodings_know_the_same_types():
    assert set(digests("ros1")) == {ros1_name(name) for name in digests("ros2")}


def test_transforms_have_the_digest_and_the_text_of_ros_1():
    text, digest, *_ = schema("tf2_msgs/msg/TFMessage", "ros1")
    assert digest == "94810edda583a504dfda3829e70d7eec"  # rosmsg md5 tf2_msgs/TFMessage
    assert "string child_frame_id # the frame id of the child frame\nTransform transform" in text


@pytest.mark.parametrize("message_type", [GPS_FIX, LIVOX])
@pytest.mark.parametrize("encoding", ["cdr", "ros1"])
def test_a_foreign_type_has_the_digest_of_its_fields(message_type, encoding):
    """rosbags does not know them; from the text it makes the digest that ROS does."""
    ours = schema(ros2_name(message_type), encoding)
    name = ros2_name(message_type if encoding == "cdr" else ros1_name(message_type))
    assert schema(name, encoding, typestore([(name, ours)], encoding)).digest == ours.digest


def test_writing_reads_no_definitions_of_other_types(tmp_path):
    program = (
        "import sys; from imu_sim_ros.commands.generate import main; "
        "code = main(sys.argv[1:]); "
        "assert not any('typesys' in name for name in sys.modules); "
        "sys.exit(code)"
    )
    wheels = ["--wheels", "f1tenth", "--gnss", "phone"]
    for name, options in (("a.mcap", wheels), ("a.bag", [])):
        arguments = ["--duration", "0.1s", "--quiet", *options, "-o", str(tmp_path / name)]
        subprocess.run([sys.executable, "-c", program, *arguments], check=True)
