# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Bags as arrays."""

import os
from pathlib import Path

import numpy as np
import pytest

import imu_sim_ros as ims
from imu_sim_ros.bags.create import open_writer
from imu_sim_ros.bags.messages.encode import IMU, ImuEncoder
from imu_sim_ros.bags.read import (
    decode_blocks,
    imu_blocks,
    open_bag,
    read_imu,
    read_odometry,
    read_temperature,
)
from imu_sim_ros.core.errors import InputError
from imu_sim_ros.core.rotation import rotate
from imu_sim_ros.formats.choice import Choice
from imu_sim_ros.formats.door import read_readings, read_states


def test_arrays_are_what_was_written(bags, form, content):
    imu = read_imu(bags[form])
    np.testing.assert_array_equal(imu.t_ns, content.t_ns)
    np.testing.assert_array_equal(imu.gyro, content.gyro)
    np.testing.assert_array_equal(imu.accel, content.accel)
    assert imu.frame_id == "imu_link"
    odometry = read_odometry(bags[form], "/ground_truth/odom")
    np.testing.assert_array_equal(odometry.position, content.position)
    np.testing.assert_array_equal(odometry.q_wb, content.q_wb)
    np.testing.assert_array_equal(odometry.velocity, rotate(content.q_wb, content.gyro))
    np.testing.assert_array_equal(odometry.angular_velocity, content.accel)
    assert (odometry.frame_id, odometry.child_frame_id) == ("world", "base_link")
    np.testing.assert_array_equal(read_states(bags[form]).q_wb, content.q_wb)
    np.testing.assert_array_equal(read_temperature(bags[form]).temperature, content.temperature)


def test_a_bag_lists_its_topics_with_their_message_counts(bags, form, content):
    with open_bag(bags[form]) as bag:
        assert {topic.name: topic.count for topic in bag.topics} == dict.fromkeys(
            ("/imu/data_raw", "/ground_truth/odom", "/imu/temperature", "/vector"),
            len(content.t_ns),
        )


def test_blocks_are_small_and_joined_they_are_all(bags, content):
    blocks = list(imu_blocks(bags["lz4.mcap"]))
    assert len(blocks) > 2
    np.testing.assert_array_equal(np.concatenate([b.gyro for b in blocks]), content.gyro)


def test_a_reader_that_is_left_early_ends(bags):
    blocks = imu_blocks(bags["none.bag"])
    next(blocks)
    blocks.close()
    assert str(bags["none.bag"]) not in map(os.path.realpath, Path("/proc/self/fd").iterdir())


def test_several_topics_are_listed(tmp_path, content):
    path = tmp_path / "two.mcap"
    with open_writer(path) as writer:
        for name in ("/left/imu", "/right/imu"):
            encoder = ImuEncoder(name[1:])
            topic = writer.add_topic(name, IMU)
            writer.write(
                topic,
                content.t_ns[:10],
                encoder.encode(content.t_ns[:10], content.gyro[:10], content.accel[:10]),
            )
    with pytest.raises(InputError, match=r"several topics .*/left/imu, /right/imu"):
        read_imu(path)
    assert read_imu(path, "right/imu").frame_id == "right/imu"
    with pytest.raises(InputError, match=r"no topic /middle.*/left/imu"):
        read_imu(path, "/middle")
    with pytest.raises(InputError, match="has no topic of nav_msgs/msg/Odometry"):
        read_odometry(path)


def test_inputs_that_are_no_bags(tmp_path):
    (tmp_path / "empty.bag").write_bytes(b"")
    for name in ("words.bag", "words.txt.xyz"):
        (tmp_path / name).write_text("some words, more than sixteen bytes")
    (tmp_path / "folder").mkdir()
    for name, reason in (
        ("missing.bag", "No such file"),
        ("empty.bag", "an empty file"),
        (
            "words.bag",
            r"not a bag, or its first bytes are damaged; convert\(\.\.\., recover=True\)",
        ),
        ("words.txt.xyz", r"not a bag; the name of a text file ends in one of \.csv, \.tum, \.txt"),
        ("folder", r"no metadata\.yaml"),
    ):
        with pytest.raises(InputError, match=reason):
            read_imu(tmp_path / name)


@pytest.mark.parametrize("name", ["none.mcap", "zstd.mcap", "lz4.mcap", "lz4.bag", "bz2.bag"])
def test_a_flipped_byte_in_a_chunk_is_noticed(bags, name, tmp_path):
    data = bytearray(bags[name].read_bytes())
    data[len(data) // 2] ^= 0xFF
    path = tmp_path / name
    path.write_bytes(data)
    with pytest.raises(InputError, match="chunk at byte"):
        read_imu(path)


def test_writing_another_softwares_way_is_read(tmp_path, content):
    """Messages of varying frames, in rosbags' own containers."""
    from rosbags.rosbag1 import Writer as Writer1
    from rosbags.rosbag2 import StoragePlugin
    from rosbags.rosbag2 import Writer as Writer2

    from imu_sim_ros.bags.messages.schemas import typestore_of_format

    for name, encoding in (("one.bag", "ros1"), ("mcap", "cdr"), ("sqlite3", "cdr")):
        path = tmp_path / name
        if encoding == "ros1":
            writer = Writer1(path)
        else:
            writer = Writer2(path, version=9, storage_plugin=StoragePlugin[name.upper()])
        with writer:
            connection = writer.add_connection("/imu", IMU, typestore=typestore_of_format(encoding))
            for k in range(500):
                row = ImuEncoder("f" * (k % 7), encoding).encode(
                    content.t_ns[k : k + 1], content.gyro[k : k + 1], content.accel[k : k + 1]
                )
                writer.write(connection, int(content.t_ns[k]), row.tobytes())
        blocks = list(decode_blocks(path, IMU, None, ("angular_velocity",)))
        rates = np.concatenate([block.numbers["angular_velocity"] for block in blocks])
        np.testing.assert_array_equal(rates, content.gyro[:500])
        t_ns = np.concatenate([block.t_ns for block in blocks])
        np.testing.assert_array_equal(t_ns, content.t_ns[:500])
        np.testing.assert_array_equal(read_readings(path, Choice(frame="fff")).gyro, rates[3::7])


def test_the_truth_of_readings_is_not_taken_for_them(tmp_path):
    bag = ims.generate(tmp_path / "a.mcap", duration=1, topics=["imu/data_raw", "ground_truth/imu"])
    assert set(bag.messages) == {"/imu/data_raw", "/ground_truth/imu"}
    by_default, by_name = (ims.read_imu(bag.output, topic) for topic in (None, "/imu/data_raw"))
    np.testing.assert_array_equal(by_default.gyro, by_name.gyro)
