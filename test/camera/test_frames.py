# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Cameras as sensors of a body: frames in windows, mounts, topics, and what is made when."""

import threading
from concurrent.futures import ThreadPoolExecutor

import numpy as np
import pytest
from rosbags.highlevel import AnyReader

from imu_sim_ros.bags.messages.blocks import as_list
from imu_sim_ros.camera import build_rig
from imu_sim_ros.commands import generate
from imu_sim_ros.core.errors import ConfigurationError
from imu_sim_ros.sensors.deferred import Deferred, DeferredValues
from imu_sim_ros.simulation.engine import Body
from imu_sim_ros.simulation.parameters import load_simulation
from imu_sim_ros.simulation.sensors import mount_sensors
from imu_sim_ros.simulation.topics import sensor_topics

STEREO = {
    "cameras": ["cam0", "cam1"],
    "cam0.camera.preset": "euroc_cam0",
    "cam1.camera.preset": "euroc_cam1",
    "cam1.camera.phase": 0.013,
    "camera.trigger": "free",
    "camera.dropout_probability": 0.2,
    "camera.jitter": 0.001,
    "camera.images": "none",
    "trajectory.type": "figure_eight",
    "scene.type": "office",
    "scene.bodies.people": 1,
    "duration": 2.0,
    "seed": 5,
}
SEEN = (
    *("cam0", "cam1", "feature_tracker/feature", "ground_truth/landmarks"),
    "ground_truth/bodies/person_1",
)


def messages(size):
    """Return the times and messages of all topics of what is seen, with windows of some size."""
    parameters = load_simulation(STEREO)
    sensors = mount_sensors(parameters)
    topics = {n: topic for n, topic in sensor_topics(sensors).items() if topic.name in SEEN}
    encoders = {name: topic.encoder() for name, topic in topics.items()}
    messages_by_topic = {name: [] for name in topics}
    for window in Body(parameters, sensors=SEEN).windows(size):
        for name, topic in topics.items():
            batch = encoders[name](window[topic.name], sensors[topic.name].valid)
            rows = as_list(batch.made())
            messages_by_topic[name] += zip(
                batch.record_t_ns.tolist(), batch.due_t_ns.tolist(), rows, strict=True
            )
    return messages_by_topic


def test_what_is_seen_does_not_depend_on_the_windows():
    whole = messages(400)
    counts = {name: len(rows) for name, rows in whole.items()}
    assert counts["ground_truth/landmarks"] == 1
    assert 20 < counts["cam0/camera_info"] < 40  # some are lost
    assert counts["feature_tracker/feature"] == counts["cam0/camera_info"] - 1
    assert counts["ground_truth/bodies/person_1"] == counts["cam0/camera_info"]
    for size in (1, 37):
        assert messages(size) == whole


def test_tracks_of_windows_are_those_of_the_rig():
    parameters = {**STEREO, "scene.bodies.people": 0}
    windows = list(Body(load_simulation(parameters), sensors=["cam1"]).windows(50))
    rig = build_rig(parameters)
    expected = np.concatenate([track_block.uv for track_block in rig.tracks("cam1")])
    assert np.array_equal(
        np.concatenate([window["cam1"].tracks.uv for window in windows]), expected
    )


def test_lines_of_windows_are_those_of_all_frames():
    """Most windows of one reading have no frame."""
    parameters = {**STEREO, "scene.type": "house", "duration": 0.5}
    del parameters["scene.bodies.people"]
    body = Body(load_simulation(parameters), sensors=["cam0"])
    window_ends = np.concatenate([window["cam0"].lines.ends for window in body.windows(1)])
    assert np.array_equal(window_ends, build_rig(parameters).tracker("cam0").lines(0, 10).ends)
    assert len(window_ends) > 10


def test_frames_after_the_last_reading_are_in_a_file_as_they_are_live(tmp_path):
    """The last of 10 readings a second is at 0.9 s, and frames follow until 1 s."""
    arguments = ["--rate", "10", "--duration", "1s", "--camera", "euroc_cam0", "--scene", "house"]
    camera_arguments = ["--set", "camera.images=none", "--set", "camera.trigger=free"]
    path = tmp_path / "a.mcap"
    assert generate.main(["-o", str(path), "--quiet", *arguments, *camera_arguments]) == 0
    with AnyReader([path]) as reader:
        counts = {topic: info.msgcount for topic, info in reader.topics.items()}
    assert (counts["/imu/data_raw"], counts["/cam0/camera_info"]) == (10, 20)


def test_cameras_are_in_the_transforms_of_a_bag(tmp_path):
    camera_arguments = ["--camera", "euroc_cam0", "--camera", "euroc_cam1", "--scene", "house"]
    topic_arguments = ["--duration", "1s", "--set", "camera.images=none", "--topics", "tf_static"]
    path = tmp_path / "a.mcap"
    assert generate.main(["-o", str(path), "--quiet", *camera_arguments, *topic_arguments]) == 0
    rig = build_rig(
        {
            "cameras": ["cam0", "cam1"],
            "cam0.camera.preset": "euroc_cam0",
            "cam1.camera.preset": "euroc_cam1",
            "scene.type": "house",
            "duration": 1.0,
        }
    )
    with AnyReader([path]) as reader:
        [(connection, _, raw)] = reader.messages()
        transforms = {
            transform.child_frame_id: transform
            for transform in reader.deserialize(raw, connection.msgtype).transforms
        }
    for name, view in rig.views.items():
        transform = transforms[f"{name}_optical_frame"]
        place, q = transform.transform.translation, transform.transform.rotation
        assert transform.header.frame_id == "base_link"
        assert np.allclose([place.x, place.y, place.z], view.p_bc, atol=1e-15)
        assert abs(abs(np.dot([q.w, q.x, q.y, q.z], view.q_bc)) - 1.0) < 1e-15


def test_a_topic_without_its_namespace_is_that_of_every_camera(tmp_path):
    camera_arguments = ["--camera", "euroc_cam0", "--camera", "euroc_cam1", "--scene", "house"]
    topic_arguments = ["--duration", "1s", "--set", "camera.images=none", "--topics", "camera_info"]
    path = tmp_path / "a.mcap"
    assert generate.main(["-o", str(path), "--quiet", *camera_arguments, *topic_arguments]) == 0
    with AnyReader([path]) as reader:
        assert set(reader.topics) == {"/cam0/camera_info", "/cam1/camera_info"}


@pytest.mark.parametrize("name", ["pose", "magnetic_field", "gyroscope"])
def test_a_camera_has_a_name_of_its_own(name):
    with pytest.raises(ConfigurationError, match=f"cameras: '{name}': is another sensor"):
        mount_sensors(load_simulation({"cameras": [name]}))


def test_no_scene_is_built_for_frames_of_which_nobody_asks_what_they_show():
    parameters = {**STEREO, "scene.type": "mesh", "scene.mesh": "not_there.ply"}
    del parameters["scene.bodies.people"]
    frames = Body(load_simulation(parameters), sensors=["cam0"]).next(400)["cam0"]
    assert len(frames.t_ns) == 40


def test_values_are_made_once_when_they_are_asked_for():
    calls = []
    values = Deferred(a=lambda: calls.append("a") or 1, b=lambda: calls.append("b") or 2)
    assert list(values) == ["a", "b"]
    assert (calls, values["b"], values["b"], calls) == (calls, 2, 2, ["b"])


@pytest.mark.parametrize("cached", [True, False])
def test_large_values_are_made_by_threads_in_order(cached):
    calls, both = [], threading.Barrier(2, timeout=30)

    def make(number):
        calls.append(number)
        if number < 9:
            both.wait()  # two threads are here at a time
        return number * 10

    with ThreadPoolExecutor(2) as threads:
        pool = DeferredValues(make, [5, 6, 9], threads, cached)
        forward = pool.begin([1, 0], lambda k, value: (k, value))
        assert list(forward) == [(1, 60), (0, 50)]
        again = pool.begin([2, 2], lambda k, value: (k, value))
        assert again[1:][0] == (2, 90)
        assert list(again) == [(2, 90)] * 2
    assert sorted(calls) == ([5, 6, 9] if cached else [5, 6, 9, 9])
