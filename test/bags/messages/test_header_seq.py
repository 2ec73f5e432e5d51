# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""header.seq in ROS 1 bags: it counts the messages of each topic, whatever wrote them."""

import numpy as np
import pytest
from rosbags.rosbag1 import Reader
from rosbags.typesys import Stores, get_typestore

from imu_sim_ros.bags.create import open_writer
from imu_sim_ros.bags.messages.encode import CLOCK, IMU, ClockEncoder, ImuEncoder
from imu_sim_ros.bags.writer import BagOptions, Block
from imu_sim_ros.commands import convert_bag

TYPES = get_typestore(Stores.ROS1_NOETIC)


def sequences(*paths):
    """Return the header.seq of each topic over the parts of a bag, as rosbags reads them."""
    numbers = {}
    for path in paths:
        with Reader(path) as reader:
            for connection, _, payload in reader.messages():
                if connection.msgtype == CLOCK:
                    continue
                message = TYPES.deserialize_ros1(payload, connection.msgtype)
                numbers.setdefault(connection.topic, []).append(message.header.seq)
    return numbers


def counts(numbers):
    return all(seq == list(range(len(seq))) for seq in numbers.values())


@pytest.mark.parametrize("compression", ["none", "lz4", "bz2"])
def test_messages_written_in_blocks_are_numbered_in_order(bags, content, compression):
    if compression == "lz4":
        pytest.importorskip("lz4")
    numbers = sequences(bags[f"{compression}.bag"])
    assert len(numbers) == 4
    assert {len(seq) for seq in numbers.values()} == {len(content.t_ns)}
    assert counts(numbers)


def test_the_parts_of_a_split_bag_go_on_counting(tmp_path, content):
    with open_writer(tmp_path / "split.bag", BagOptions(split_duration=5.0)) as writer:
        content.write(writer)
    parts = sorted(tmp_path.glob("*.bag"))
    assert len(parts) > 3
    numbers = sequences(*parts)
    assert {len(seq) for seq in numbers.values()} == {len(content.t_ns)}
    assert counts(numbers)


def test_single_messages_of_a_recorder_are_counted_and_the_clock_has_no_header(tmp_path):
    path = tmp_path / "raw.bag"
    t_ns = 10**9 * np.arange(1, 6)
    with open_writer(path) as writer:
        readings = writer.add_topic("/imu", IMU)
        clock = writer.add_topic("/clock", CLOCK)
        rows = ImuEncoder("imu_link", "ros1").encode(t_ns, np.zeros((5, 3)), np.zeros((5, 3)))
        ticks = ClockEncoder("ros1").encode(t_ns)
        for time, row, tick in zip(t_ns.tolist(), rows, ticks, strict=True):
            writer.write(readings, np.array([time]), [row.tobytes()])
            writer.write(clock, np.array([time]), [tick.tobytes()])
        writer.write_blocks([Block(clock, t_ns + 10**10, ticks)])
    assert sequences(path) == {"/imu": [0, 1, 2, 3, 4]}
    with Reader(path) as reader:
        stored = [bytes(payload) for c, _, payload in reader.messages() if c.topic == "/clock"]
    assert stored == [tick.tobytes() for tick in ticks] * 2


@pytest.mark.parametrize("source", ["none.mcap", "folder_sqlite3"])
def test_a_bag_of_ros_2_is_counted_when_it_is_converted(bags, tmp_path, source):
    out = tmp_path / "converted.bag"
    assert convert_bag.main([str(bags[source]), "-o", str(out), "--quiet"]) == 0
    numbers = sequences(out)
    assert len(numbers) == 4
    assert counts(numbers)


def test_a_bag_of_ros_1_keeps_its_own(tmp_path):
    """A recording with lost messages still shows them after a change of compression."""
    t_ns = 10**9 * np.arange(1, 4)
    rows = ImuEncoder("imu_link", "ros1").encode(t_ns, np.zeros((3, 3)), np.zeros((3, 3)))
    rows[:, :4] = np.array([7, 8, 11], "<u4").view(np.uint8).reshape(3, 4)
    with open_writer(tmp_path / "lossy.bag") as writer:
        writer.write(writer.add_topic("/imu", IMU, keeps_seq=True), t_ns, rows)
    out = tmp_path / "copy.bag"
    arguments = [str(tmp_path / "lossy.bag"), "-o", str(out), "--compression", "bz2", "--quiet"]
    assert convert_bag.main(arguments) == 0
    assert sequences(out) == {"/imu": [7, 8, 11]}
