# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Definitions of message types as installed, and of types that only their package knows."""

import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from rosbags.typesys import Stores, get_types_from_msg, get_typestore

from imu_sim_ros.bags.create import open_writer
from imu_sim_ros.bags.messages.encode import ImuEncoder
from imu_sim_ros.bags.messages.schemas import message_type
from imu_sim_ros.bags.recorder_parameters import RecorderParameters
from imu_sim_ros.core.errors import ConfigurationError, InputError, MissingDependencyError
from imu_sim_ros.nodes import messages as message_types
from imu_sim_ros.nodes.arguments import ros_arguments
from imu_sim_ros.nodes.recorder.node import _remaining_files, plain_arguments
from imu_sim_ros.nodes.recorder.recording import BagRecording, Message, RecordedTopic
from imu_sim_ros.recordings.live_clock import LiveClock

pytestmark = pytest.mark.ros

WHEEL = "wheel_msgs/msg/Wheel"
WHEEL_TEXT = (
    "std_msgs/Header header\nuint8 LEFT=0\nuint8 side\nfloat64[2] angle # rad\nstring note\n"
    + "=" * 80
    + "\nMSG: std_msgs/Header\nbuiltin_interfaces/Time stamp\nstring frame_id\n"
    + "=" * 80
    + "\nMSG: builtin_interfaces/Time\nint32 sec\nuint32 nanosec\n"
)


@pytest.mark.parametrize(
    "name",
    ["sensor_msgs/msg/Imu", "nav_msgs/msg/Odometry", "diagnostic_msgs/msg/DiagnosticArray"],
)
def test_installed_definitions_are_complete_and_carry_their_hash(name):
    """rosbags' own copy of the definitions of Jazzy is the independent source."""
    store = get_typestore(Stores.ROS2_JAZZY)
    definitions = get_types_from_msg(message_types.definition(name), name)
    assert definitions
    for part, fields in definitions.items():
        assert fields[1] == store.fielddefs[part][1], part
    assert message_types.type_hash(name) == store.hash_rihs01(name)


def test_stamps_are_found_where_messages_have_them():
    stamp_offsets = {
        name: message_types.stamp_offset(message_types.message_class(name))
        for name in ("sensor_msgs/msg/Imu", "rosgraph_msgs/msg/Clock", "std_msgs/msg/Float64")
    }
    assert list(stamp_offsets.values()) == [4, 4, None]


def test_a_type_that_is_not_installed_is_refused():
    with pytest.raises(MissingDependencyError, match="wheel_msgs is not installed here"):
        message_types.message_class(WHEEL)


def wheel_bytes() -> tuple[bytes, bytes]:
    """Return one message of a type unknown to ROS as CDR and, written by hand, as ROS 1."""
    store = get_typestore(Stores.ROS2_JAZZY)
    store.register(
        get_types_from_msg(
            "std_msgs/Header header\nuint8 LEFT=0\nuint8 side\nfloat64[2] angle\nstring note\n",
            WHEEL,
        )
    )
    header = store.types["std_msgs/msg/Header"]
    stamp = store.types["builtin_interfaces/msg/Time"](5, 7)
    message = store.types[WHEEL](header(stamp, "hub"), 1, np.array([0.5, -2.0]), "ok")
    ros1 = (
        np.array([0, 5, 7, 3], "<u4").tobytes()
        + b"hub\x01"
        + np.array([0.5, -2.0], "<f8").tobytes()
        + b"\x02\x00\x00\x00ok"
    )
    return bytes(store.serialize_cdr(message, WHEEL)), ros1


def test_a_type_unknown_to_ros_is_recorded_by_its_installed_definition():
    cdr, ros1 = wheel_bytes()
    cdr_type = message_type(WHEEL, WHEEL_TEXT, "RIHS01_1", "cdr")
    assert cdr_type.convert(cdr) == cdr
    assert cdr_type.schema.text == WHEEL_TEXT
    ros1_type = message_type(WHEEL, WHEEL_TEXT, "", "ros1")
    assert ros1_type.convert(cdr) == ros1
    assert "MSG: std_msgs/Header" in ros1_type.schema.text
    assert "uint32 seq" in ros1_type.schema.text


def test_a_type_without_any_definition_fits_mcap_but_not_ros1():
    assert message_type(WHEEL, "", "", "cdr").schema.text == ""
    with pytest.raises(InputError, match="needs its definition, which is not installed"):
        message_type(WHEEL, "", "", "ros1")


def topic(name: str, type_name: str = "sensor_msgs/msg/Imu") -> RecordedTopic:
    text = message_types.definition(type_name) if type_name != WHEEL else ""
    return RecordedTopic(name, type_name, (), text, "", LiveClock())


def test_messages_beyond_the_buffer_are_dropped_and_counted(tmp_path):
    recording = BagRecording(lambda: open_writer(tmp_path / "bag"), pytest.fail, buffer_bytes=1000)
    recording.add_topic(topic("/imu"))
    recording.put([Message("/imu", 10**9 + k, bytes(100)) for k in range(10)])
    recording.put([Message("/imu", 2 * 10**9, bytes(2000))])
    recording.close()
    assert recording.dropped == 1
    assert recording.messages == 10


def test_topics_and_messages_that_the_bag_cannot_hold_do_not_stop_the_others(tmp_path):
    recording = BagRecording(lambda: open_writer(tmp_path / "bag.bag"), pytest.fail)
    (row,) = ImuEncoder("imu_link").encode(np.array([10**9]), np.zeros((1, 3)), np.zeros((1, 3)))
    message = row.tobytes()
    recording.add_topic(topic("/wheel", WHEEL))
    recording.add_topic(topic("/imu"))
    recording.put([Message("/wheel", 10**9, wheel_bytes()[0])])
    recording.put([Message("/imu", 10**9, message), Message("/imu", 10**9 + 1, b"rubbish")])
    recording.put([Message("/imu", 10**9 + 2, message)])
    recording.close()
    assert not recording.failed
    assert list(recording.refused) == ["/wheel"]
    assert (recording.messages, recording.broken) == (2, 1)


@pytest.mark.parametrize(
    ("command_line", "long"),
    [
        ("-o flight a b", ["--output", "flight", "--topics", '["a", "b"]']),
        ("--duration 2min", ["--duration", "120.0"]),
        ("-d=4h a", ["--duration", "14400.0", "--topics", '["a"]']),
        ("--max-size 5 --ros-args -r a:=b", ["--max-size", "5", "--ros-args", "-r", "a:=b"]),
        ("--help", ["--help"]),
    ],
)
def test_short_arguments_stand_for_long_ones(command_line, long):
    assert plain_arguments(command_line.split()) == long


@pytest.mark.parametrize("section", ["[]", "3", "words", "null"])
def test_a_section_that_is_no_mapping_is_one_line(tmp_path, section):
    """Else rcl says it in two, with its own sources' lines."""
    path = tmp_path / "given.yaml"
    path.write_text(f"/**:\n  ros__parameters: {section}\n")
    file_arguments = ["--ros-args", "--params-file", str(path)]
    with pytest.raises(ConfigurationError) as failed:
        ros_arguments(file_arguments, RecorderParameters, tmp_path)
    assert failed.value.problems == (f"{path}: ros__parameters: must hold names and values",)


def test_bytes_that_are_no_text_are_named(tmp_path):
    with pytest.raises(ConfigurationError, match="not UTF-8"):
        ros_arguments(["--storage", "\udce9"], RecorderParameters, tmp_path)


def test_what_is_left_of_a_failed_recording_is_said(tmp_path: Path) -> None:
    assert (
        _remaining_files([]) == "nothing is kept: it failed before any part of the bag was complete"
    )
    intact_file, removed_file, empty_folder = (
        tmp_path / "x_0.mcap",
        tmp_path / "x_1.mcap",
        tmp_path / "folder",
    )
    intact_file.touch()
    empty_folder.mkdir()
    assert _remaining_files([intact_file]).startswith(
        f"{intact_file} keeps the messages written before"
    )
    assert _remaining_files([removed_file]) == f"{removed_file} was removed and is lost"
    assert _remaining_files([empty_folder]) == f"{empty_folder} was removed and is lost"
    assert _remaining_files([intact_file, removed_file]).startswith(
        f"{removed_file} was removed and is lost; {intact_file} keeps the"
    )


def test_closed_standard_streams_are_not_taken_by_the_watch_over_signals() -> None:
    """The recorder's pipe does not take the place of a closed standard output (``>&- 2>&-``)."""
    program = (
        "import os, sys; os.close(1); os.close(2); sys.stdout = sys.stderr = None\n"
        "from imu_sim_ros.nodes import signals, start\n"
        "import types; sys.modules['imu_sim_ros.nodes.none'] = types.ModuleType('none')\n"
        "node = types.ModuleType('node'); sys.modules['imu_sim_ros.nodes.none.node'] = node\n"
        "null = os.stat(os.devnull).st_rdev\n"
        "node.main = lambda: 40 + sum(os.fstat(n).st_rdev == null for n in (1, 2))\n"
        "os._exit(start._run('none'))"
    )
    assert subprocess.run([sys.executable, "-c", program]).returncode == 42
