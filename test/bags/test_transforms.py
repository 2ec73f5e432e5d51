# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Transforms and poses in generated bags, as rosbags reads them."""

import numpy as np
import pytest
from rosbags.highlevel import AnyReader

import imu_sim_ros as ims
from imu_sim_ros.commands import generate

WORDS = ["--trajectory", "figure_eight", "--duration", "1s", "--quiet"]


def messages(path, topic):
    """Return the decoded messages of a topic."""
    with AnyReader([path]) as reader:
        chosen = [connection for connection in reader.connections if connection.topic == topic]
        return [
            reader.deserialize(raw, connection.msgtype)
            for connection, _, raw in reader.messages(chosen)
        ]


@pytest.mark.parametrize("name", ["flight.bag", "flight", "flight.db"])
def test_transforms_and_poses_are_the_truth(tmp_path, name):
    path = tmp_path / name
    storage = ["--storage", "sqlite3"] if name == "flight.db" else []
    topics = "imu/data_raw,ground_truth/odom,ground_truth/pose,tf,tf_static"
    settings = ["--set", "imu.lever_arm=[0.1, 0.2, 0.3]"]
    assert generate.main(["-o", str(path), "--topics", topics, *settings, *storage, *WORDS]) == 0
    truth = ims.read_odometry(path, "ground_truth/odom")
    transforms = [message.transforms[0] for message in messages(path, "/tf")]
    assert len(transforms) == len(truth)
    assert {(transform.header.frame_id, transform.child_frame_id) for transform in transforms} == {
        ("world", "base_link")
    }
    shifts = [transform.transform.translation for transform in transforms]
    assert np.array_equal([[p.x, p.y, p.z] for p in shifts], truth.position)
    poses = messages(path, "/ground_truth/pose")
    turns = [pose.pose.orientation for pose in poses]
    assert np.allclose([[q.w, q.x, q.y, q.z] for q in turns], truth.q_wb, atol=1e-15)
    (fixed,) = messages(path, "/tf_static")
    (mount,) = fixed.transforms
    assert (mount.header.frame_id, mount.child_frame_id) == ("base_link", "imu_link")
    shift = mount.transform.translation
    assert [shift.x, shift.y, shift.z] == [0.1, 0.2, 0.3]


def _latched(connection):
    """Return whether a player keeps the last message for later subscribers, as rosbags reads it."""
    details = connection.ext
    if hasattr(details, "latching"):
        return bool(details.latching)
    return [profile.durability.name for profile in details.offered_qos_profiles] == [
        "TRANSIENT_LOCAL"
    ]


@pytest.mark.parametrize("name", ["flight.bag", "flight", "flight.db", "flight.mcap"])
def test_players_keep_static_transforms_for_later_subscribers(tmp_path, name):
    """Static transforms are latched, as tf2 expects; all other messages are sent once."""
    path = tmp_path / name
    storage = ["--storage", "sqlite3"] if name == "flight.db" else []
    topics = ["--topics", "imu/data_raw,tf,tf_static"]
    assert generate.main(["-o", str(path), *topics, *storage, *WORDS]) == 0
    with AnyReader([path]) as reader:
        latched = {connection.topic: _latched(connection) for connection in reader.connections}
    assert latched == {"/imu/data_raw": False, "/tf": False, "/tf_static": True}


def test_several_imus_share_one_static_message(tmp_path):
    settings = ["--set", "imus=[left, right]", "--set", "left.imu.lever_arm=[0, 0.1, 0]"]
    path, topics = tmp_path / "two.mcap", "imu/data_raw,tf_static,tf"
    arguments = [*settings, "--topics", topics, *WORDS]
    assert generate.main(["-o", str(path), *arguments]) == 0
    (fixed,) = messages(path, "/tf_static")
    frames = {transform.child_frame_id: transform.transform for transform in fixed.transforms}
    assert set(frames) == {"left_imu_link", "right_imu_link"}
    assert frames["left_imu_link"].translation.y == 0.1
    assert frames["right_imu_link"].rotation.w == 1.0


def test_the_antenna_and_the_axle_have_their_places(tmp_path):
    """Each sensor with a frame of its own has a transform; wheels without one have none."""
    settings = ["--gnss", "zed_f9p", "--set", "gnss.lever_arm=[0.3, 0, 1]", "--wheels", "f1tenth"]
    path, topics = tmp_path / "aided.mcap", "imu/data_raw,gps/fix,tf_static"
    assert generate.main(["-o", str(path), *settings, "--topics", topics, *WORDS]) == 0
    (fixed,) = messages(path, "/tf_static")
    frames = {transform.child_frame_id: transform.transform for transform in fixed.transforms}
    assert set(frames) == {"imu_link", "gps_link"}
    place = frames["gps_link"].translation
    assert [place.x, place.y, place.z] == [0.3, 0.0, 1.0]
    assert frames["gps_link"].rotation.w == 1.0
    (fix, *_) = messages(path, "/gps/fix")
    assert fix.header.frame_id == "gps_link"


def test_an_unknown_topic_is_answered_with_each_name_once(tmp_path, capsys):
    arguments = ["-o", str(tmp_path / "a.mcap"), "--gnss", "zed_f9p", "--topics", "gps/fux"]
    assert generate.main([*arguments, *WORDS]) == 2
    assert capsys.readouterr().err.count("gps/velocity,") <= 1


def test_a_dataset_has_no_transforms(tmp_path, capsys):
    arguments = ["-o", str(tmp_path / "mav0"), "--format", "euroc", "--topics", "imu/data_raw,tf"]
    status = generate.main([*arguments, *WORDS])
    assert status == 2
    assert "tf" in capsys.readouterr().err
