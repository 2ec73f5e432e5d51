# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""generate with cameras into bags, read back by rosbags, mcap and real ROS 1."""

import functools
import json
import os
import subprocess
from pathlib import Path

import cv2
import numpy as np
import pytest
from mcap.reader import make_reader
from ros_messages import stamp_ns
from rosbags.highlevel import AnyReader
from rosbags.typesys import Stores, get_typestore
from small_stereo import SETTINGS, small_stereo

from imu_sim_ros.camera import build_rig
from imu_sim_ros.commands import generate
from imu_sim_ros.core import conventions
from imu_sim_ros.sensors.camera.features import FeatureStream
from imu_sim_ros.simulation.parameters import load_simulation
from imu_sim_ros.simulation.sensors import mount_sensors
from imu_sim_ros.simulation.topics import sensor_topics
from imu_sim_ros.trajectory.parameters import trajectory_layer

STORE = get_typestore(Stores.ROS2_JAZZY)
EXTRA = {"camera.time_offset": "0.005", "camera.images": "both", "features.layout": "fusion"}
RIG = small_stereo("1.2s", EXTRA)
FORMS = ("ros1.bag", "one.mcap", "folder", "sqlite")


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    """Write the same flight into every container."""
    place = tmp_path_factory.mktemp("bags")
    for form in FORMS:
        options = ["--storage", "sqlite3"] if form == "sqlite" else []
        jobs = "1" if form == "ros1.bag" else "3"
        argv = ["-o", str(place / form), *RIG, *options, "--jobs", jobs]
        assert generate.main(argv) == 0
    return place


@pytest.fixture(scope="module")
def rig():
    """Build the same cameras in Python."""
    settings = {**SETTINGS, **EXTRA}
    values = {k: json.loads(v) if v[0] in "[0123456789t" else v for k, v in settings.items()}
    presets = {"cam0.camera.preset": "euroc_cam0", "cam1.camera.preset": "euroc_cam1"}
    return build_rig(
        {
            **trajectory_layer("target"),
            "scene.type": "aprilgrid",
            **values,
            **presets,
            "cameras": ["cam0", "cam1"],
            "duration": 1.2,
            "seed": 5,
        }
    )


@pytest.fixture(scope="module")
def pictures(rig):
    return {name: list(rig.images(name)) for name in rig.views}


@functools.cache
def contents(path):
    """Return record times and messages by topic, as rosbags reads them."""
    messages = {}
    with AnyReader([path]) as reader:
        for connection, t_ns, raw in reader.messages():
            message = reader.deserialize(raw, connection.msgtype)
            messages.setdefault(connection.topic, []).append((t_ns, message))
    return messages


@pytest.mark.parametrize("form", FORMS)
def test_images_in_a_bag_are_those_of_the_camera(folder, pictures, form):
    messages = contents(folder / form)
    for name in ("cam0", "cam1"):
        expected = pictures[name]
        raw, png = messages[f"/{name}/image_raw"], messages[f"/{name}/image_raw/compressed"]
        infos = messages[f"/{name}/camera_info"]
        assert len(raw) == len(png) == len(infos) == len(expected) < 24
        for (t_ns, image), (record, message), (_, small), (_, info) in zip(
            expected, raw, png, infos, strict=True
        ):
            assert record == stamp_ns(message) == stamp_ns(small) == stamp_ns(info) == t_ns
            assert message.header.frame_id == info.header.frame_id == f"{name}_optical_frame"
            assert np.array_equal(message.data.reshape(image.shape), image)
            assert message.encoding == {2: "mono8", 3: "rgb8"}[image.ndim]
            decoded = cv2.imdecode(small.data, cv2.IMREAD_UNCHANGED)
            assert np.array_equal(decoded if image.ndim == 2 else decoded[..., ::-1], image)
    assert raw[0][1].encoding == "rgb8"  # of the second camera


@pytest.mark.parametrize("form", ["ros1.bag", "folder"])
def test_depth_is_in_the_bag_where_it_is_asked_for(folder, rig, form):
    messages = contents(folder / form)
    assert "/cam0/depth/image_raw" not in messages
    expected = list(rig.depths("cam1"))
    assert len(messages["/cam1/depth/image_raw"]) == len(expected)
    for (t_ns, depth), (_, message) in zip(
        expected, messages["/cam1/depth/image_raw"], strict=True
    ):
        assert (stamp_ns(message), message.encoding, message.step) == (t_ns, "32FC1", 4 * 94)
        assert np.array_equal(message.data.view("<f4").reshape(depth.shape), depth)
    assert 0.3 < expected[0][1].max() < 10.0


def test_camera_info_projects_as_the_camera_does(folder, rig):
    _, info = contents(folder / "folder")["/cam1/camera_info"][0]
    points = np.array([[0.1, 0.2, 1.5], [-0.5, 0.1, 2.0]])
    by_opencv, _ = cv2.projectPoints(points, np.zeros(3), np.zeros(3), info.k.reshape(3, 3), info.d)
    assert info.distortion_model == "plumb_bob"
    ours, _ = rig.views["cam1"].model.project(points)
    assert np.abs(by_opencv[:, 0] - ours).max() < 1e-9


@pytest.mark.parametrize("form", FORMS)
def test_features_are_the_tracks_as_vins_fusion_reads_them(folder, rig, form):
    """Message by message against a slow plain loop over the tracks."""
    messages = [message for _, message in contents(folder / form)["/feature_tracker/feature"]]
    expected = list(plain_features(rig))
    assert [stamp_ns(message) for message in messages] == [t_ns for t_ns, _ in expected]
    assert len(messages) > 10
    for message, (_, rows) in zip(messages, expected, strict=True):
        assert message.header.frame_id == "world"
        values = np.column_stack([channel.values for channel in message.channels])
        points = np.array([(p.x, p.y, p.z) for p in message.points])
        assert values.shape[1] == 9
        np.testing.assert_allclose(np.column_stack([points, values]), rows, rtol=1e-6, atol=1e-6)


def plain_features(rig):
    """Yield stamps and rows (n, 12) of VINS-Fusion's messages; feature by feature."""
    tracks = [next(rig.tracks(name)) for name in ("cam0", "cam1")]
    places = []
    for name, t in zip(("cam0", "cam1"), tracks, strict=True):
        ray = rig.views[name].model.unproject(t.uv).direction
        places.append(ray[:, :2] / ray[:, 2:])
    previous = [{}, {}]
    is_first = True
    total, lives, last_frame = len(rig.scene.landmarks), {}, set()
    for k in range(24):
        if not tracks[0].frames.delivered[k]:
            continue
        rows, sent = [], set()
        for camera, (t, place) in enumerate(zip(tracks, places, strict=True)):
            if not t.frames.delivered[k]:
                continue
            current = {int(t.id[i]): (i, t.frames.t_ns[k]) for i in np.flatnonzero(t.frame == k)}
            for key in sorted(current):
                i, t_ns = current[key]
                if key not in previous[camera] or (camera and key not in sent):
                    continue
                j, previous_row = previous[camera][key]
                speed = (place[i] - place[j]) / ((t_ns - previous_row) * 1e-9)
                truth = rig.scene.landmarks[t.landmark[i]]
                landmark = int(t.landmark[i])
                if key not in last_frame | sent:
                    lives[landmark] = lives.get(landmark, -1) + 1
                track = landmark + total * lives[landmark]
                rows.append([*place[i], 1.0, track, camera, *t.uv[i], *speed, *truth])
                sent.add(key)
            previous[camera] = current
        last_frame = sent
        if not is_first:
            yield int(tracks[0].frames.t_ns[k]), np.array(rows)
        is_first = False


def stream_of(rig, layout):
    return FeatureStream([rig.tracker(name) for name in rig.views], layout)


@pytest.mark.parametrize(("layout", "cameras"), [("mono", 1), ("mono", 2), ("fusion", 2)])
def test_an_id_is_that_of_one_uninterrupted_track(layout, cameras):
    """VINS counts the frames of a feature from its first: after a gap it would take wrong ones."""
    names = ["cam0", "cam1"][:cameras]
    rig = build_rig(
        {
            **trajectory_layer("figure_eight"),
            "cameras": names,
            **{f"{name}.camera.preset": f"euroc_{name}" for name in names},
            "camera.body_axes": "flu",
            "camera.max_features": 30,
            "camera.images": "none",
            "scene.type": "room",
            "duration": 5.0,
        }
    )
    stream = stream_of(rig, layout)
    total, frames, shared = len(rig.scene.landmarks), {}, 0
    for number, message in enumerate(stream.next(40) + stream.next(60)):
        ids = message.values[:, 3].astype(int)
        if layout == "mono":
            ids = ids // cameras
        places = [set(ids.tolist()), set((ids % total).tolist())]
        shared += len(ids) - len(places[0])
        assert len(places[0]) == len(places[1])  # one track of a landmark at a time
        for track in places[0]:
            frames.setdefault(track, []).append(number)
    assert all(numbers == list(range(numbers[0], numbers[-1] + 1)) for numbers in frames.values())
    assert any(track >= total for track in frames)  # some came back
    assert (shared > 500) == (cameras == 2)


def test_mono_has_five_channels_and_an_id_for_each_camera(rig):
    fusion, mono = (stream_of(rig, layout) for layout in ("fusion", "mono"))
    assert len(fusion.next(24)) == len(mono.next(24))
    halves, again = stream_of(rig, "mono"), stream_of(rig, "mono").next(24)
    pairs = list(zip(halves.next(7) + halves.next(17), again, strict=True))
    assert all(a.number == b.number and np.array_equal(a.values, b.values) for a, b in pairs)
    ids = set()
    for message in again:
        assert message.values.shape[1] == 3 + 5
        ids |= {(int(v) // 2, int(v) % 2) for v in message.values[:, 3]}
    tracks = {camera: next(rig.tracks(f"cam{camera}")) for camera in (0, 1)}
    observations = {(int(i), camera) for camera, track in tracks.items() for i in track.landmark}
    total = len(rig.scene.landmarks)
    assert {(i % total, camera) for i, camera in ids} <= observations
    assert {camera for _, camera in ids} == {0, 1}


@pytest.mark.parametrize("form", FORMS)
def test_landmarks_stand_in_the_bag_once(folder, rig, form):
    ((_, cloud),) = contents(folder / form)["/ground_truth/landmarks"]
    rows = cloud.data.view([("xyz", "<f4", 3), ("id", "<u4")])
    assert np.array_equal(rows["xyz"], rig.scene.landmarks.astype("f4"))
    assert np.array_equal(rows["id"], np.arange(len(rig.scene.landmarks)))


def test_readings_are_the_same_with_and_without_cameras(folder, tmp_path):
    alone = [word for word in RIG if word not in ("--camera", "euroc_cam0", "euroc_cam1")]
    argv = [w for w in alone if not w.startswith(("cam", "features.", "--scene", "aprilgrid"))]
    argv = [w for w in argv if w != "--set"]
    assert generate.main(["-o", str(tmp_path / "a.mcap"), *argv]) == 0
    bare, with_cameras = contents(tmp_path / "a.mcap"), contents(folder / "one.mcap")
    for topic in ("/imu/data_raw", "/ground_truth/odom"):
        assert [repr(m) for m in bare[topic]] == [repr(m) for m in with_cameras[topic]]


def test_the_mcap_library_reads_all_in_order(folder):
    with (folder / "one.mcap").open("rb") as file:
        reader = make_reader(file)
        times = [message.log_time for _, _, message in reader.iter_messages()]
        summary = reader.get_summary()
    assert times == sorted(times)
    assert summary.statistics.message_count == len(times)
    latched = next(c for c in summary.channels.values() if c.topic == "/ground_truth/landmarks")
    assert "transient_local" in latched.metadata["offered_qos_profiles"]


def test_real_ros_1_takes_the_bag_without_a_complaint(folder):
    environment = {"PATH": "/usr/bin:/bin", "HOME": os.environ.get("HOME", "/")}

    def run(*arguments):
        return subprocess.run(
            arguments, env=environment, capture_output=True, text=True, check=False
        )

    code = "import rosbag, sensor_msgs.msg, nav_msgs.msg"
    python = "/usr/bin/python3"
    if not Path(python).exists() or run(python, "-c", code).returncode:
        pytest.skip(
            "REAL ROS 1 NOT TESTED: apt-get install python3-rosbag python3-sensor-msgs "
            "python3-nav-msgs python3-geometry-msgs"
        )
    path = str(folder / "ros1.bag")
    done = run("/usr/bin/rosbag", "check", path)
    assert done.returncode == 0, done.stdout + done.stderr
    code = (
        "import rosbag, sys\n"
        "for t, m, _ in rosbag.Bag(sys.argv[1]).read_messages(topics=['/cam0/image_raw']):\n"
        "    print(m.header.seq, m.height, m.width, m.encoding, len(m.data))"
    )
    lines = run(python, "-c", code, path).stdout.splitlines()
    assert lines == [f"{k} 60 94 mono8 5640" for k in range(len(lines))]
    assert lines


def test_topics_are_chosen_and_renamed(tmp_path, capsys):
    argv = [
        "-o",
        str(tmp_path / "a.mcap"),
        *RIG,
        "--json",
        "--topics",
        "imu/data_raw,cam1/image_raw",
    ]
    assert generate.main([*argv, "--topic", "cam1/image_raw=/right/image"]) == 0
    counts = json.loads(capsys.readouterr().out)["messages"]
    assert set(counts) == {"/imu/data_raw", "/right/image"}
    assert generate.main([*argv, "--force", "--topics", "cam2/image_raw"]) == 2
    assert "unknown topic 'cam2/image_raw'; did you mean cam" in capsys.readouterr().err


def test_a_scene_without_surfaces_gives_tracks_alone(tmp_path, capsys):
    argv = ["-o", str(tmp_path / "a.mcap"), *RIG, "--scene", "cloud"]
    assert generate.main(argv) == 2
    assert "nothing to make images" in capsys.readouterr().err
    assert not list(tmp_path.iterdir())
    none = ["--set", "camera.images=none", "--set", "cam1.camera.depth=false"]
    assert generate.main([*argv, *none]) == 0
    messages = contents(tmp_path / "a.mcap")
    assert "/cam0/image_raw" not in messages
    assert {"/cam0/camera_info", "/feature_tracker/feature"} < set(messages)


def test_the_topics_of_a_rig_follow_its_parameters():
    settings = {
        "right.camera.images": "none",
        "features.layout": "none",
        "left.camera.frame": "eye",
    }
    lens = {"right.camera.lever_arm": [0.0, 0.1, 0.0]}
    sensors = mount_sensors(load_simulation({"cameras": ["left", "right"], **settings, **lens}))
    assert [n for n, topic in sensor_topics(sensors).items() if topic.mounted.sensor.apart] == [
        *("left/image_raw", "left/camera_info", "right/camera_info"),
        conventions.LANDMARKS_TOPIC,
    ]
    assert (sensors["left"].frame, sensors["right"].frame) == ("eye", "right_optical_frame")
