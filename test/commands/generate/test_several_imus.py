# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Several IMUs on one body: the samples of the node, and those of each IMU alone."""

import filecmp
import itertools
import json
import math
import tracemalloc

import numpy as np
import pytest
from rosbags.highlevel import AnyReader

from imu_sim_ros.bags.read import read_imu, read_odometry
from imu_sim_ros.commands import convert_bag, generate
from imu_sim_ros.nodes.simulator.publish_queue import BodyStream, PublishQueue
from imu_sim_ros.parameters import files
from imu_sim_ros.simulation import topics
from imu_sim_ros.simulation.engine import Body
from imu_sim_ros.simulation.parameters import load_simulation
from imu_sim_ros.simulation.playback import load_simulator
from imu_sim_ros.simulation.sensors import mount_sensors

GIVEN = {
    "imus": ["left", "right"],
    "duration": 2.0,
    "seed": 11,
    "rate": 100.0,
    "trajectory.type": "figure_eight",
    "imu.preset": "mpu6000",
    "left.imu.lever_arm": [0.1, 0.02, -0.03],
    "right.rate": 333.3,
    "right.imu.preset": "phone",
    "right.imu.dropout_probability": 0.1,
}
"""Other rates, presets, places and losses, so that nothing of one passes for the other's."""
OPTIONS = [f"--set={name}={json.dumps(value)}" for name, value in GIVEN.items()]
ALL = (*(f"{n}/{t}" for n in ("left", "right") for t in ("imu/data_raw", "ground_truth/imu")),
       "ground_truth/odom")  # fmt: skip


@pytest.fixture(scope="module")
def place(tmp_path_factory):
    return tmp_path_factory.mktemp("several")


@pytest.fixture(scope="module")
def bag(place):
    path = place / "two.mcap"
    chosen = ["--topics", "imu/data_raw,ground_truth/imu,ground_truth/odom", "--with-configs"]
    assert generate.main([*OPTIONS, *chosen, "-o", str(path), "--quiet"]) == 0
    return path


def raw(path):
    """Return the messages of each topic, with their record times, as another reader sees them."""
    messages = {}
    with AnyReader([path]) as reader:
        for connection, t_ns, data in reader.messages():
            messages.setdefault(connection.topic.lstrip("/"), []).append((t_ns, bytes(data)))
    return messages


def test_a_bag_holds_what_the_node_publishes(bag):
    """The node's queue of all streams, played without a node, sends the same bytes."""
    sent = {name: [] for name in ALL}
    parameters = load_simulator(GIVEN)
    topics_offered = topics.sensor_topics(mount_sensors(parameters))
    outputs = [
        (topics_offered[name].name, topics_offered[name].encoder(), sent[name].append)
        for name in ALL
    ]
    body = Body(parameters, sensors=("pose",))
    queue = PublishQueue([BodyStream(body, outputs)], GIVEN["duration"])
    queue.restart(10**9)
    while not queue.finished:
        for _, messages in queue.next_groups(0.2):
            for send, payload in messages:
                send(payload)
    written = raw(bag)
    assert set(written) == set(ALL)
    assert {name: [data for _, data in by_topic] for name, by_topic in written.items()} == sent


@pytest.mark.parametrize(("name", "place_in_imus"), [("left", 0), ("right", 1)])
def test_an_imu_of_several_reads_what_it_reads_alone(bag, place, name, place_in_imus):
    imu_settings = {
        k.removeprefix(f"{name}."): v for k, v in GIVEN.items() if k.startswith(f"{name}.")
    }
    common_names = [k for k in GIVEN if "." not in k or k.startswith(("trajectory.", "imu."))]
    common = {key: GIVEN[key] for key in common_names if key != "imus"}
    values = {**common, **imu_settings, "seed": GIVEN["seed"] + place_in_imus}
    alone = place / f"{name}_alone.mcap"
    options = [f"--set={key}={json.dumps(value)}" for key, value in values.items()]
    assert generate.main([*options, "-o", str(alone), "--quiet"]) == 0
    among_several, alone_readings = read_imu(bag, f"/{name}/imu/data_raw"), read_imu(alone)
    for field in ("t_ns", "gyro", "accel"):
        np.testing.assert_array_equal(getattr(among_several, field), getattr(alone_readings, field))
    assert among_several.frame_id == f"{name}_imu_link"
    truth = place / f"two_truth_{name}.yaml"
    assert filecmp.cmp(truth, place / f"{name}_alone_truth.yaml", shallow=False) or (
        load_simulation(files.load(truth)).imu
        == load_simulation(files.load(place / f"{name}_alone_truth.yaml")).imu
    )


def test_record_times_rise_over_all_topics(bag):
    """A window of time ends for all topics alike: no message lies behind a later one."""
    with AnyReader([bag]) as reader:
        times = {
            topic: [t for c, t, _ in reader.messages() if c.topic == topic]
            for topic in reader.topics
        }
    assert all(np.all(np.diff(t) >= 0) for t in times.values())
    assert len(times["/ground_truth/odom"]) == 200
    assert len(times["/right/ground_truth/imu"]) == math.ceil(2 * 333.3)


def test_each_imu_has_configurations_and_the_run_can_be_repeated_from_them(bag, place):
    folder = place / "two.mcap_configs"
    assert sorted(p.name for p in folder.iterdir()) == ["left", "right", "simulation.yaml"]
    assert "/left/imu/data_raw" in (folder / "left" / "imu.yaml").read_text()
    assert "update_rate: 333.3" in (folder / "right" / "imu.yaml").read_text()
    lengths = (folder / "left" / "allan_variance_ros.yaml").read_text()
    assert "sequence_time: 2\n" in lengths
    again = place / "again.mcap"
    file = str(folder / "simulation.yaml")
    chosen = ["--topics", "imu/data_raw,ground_truth/imu,ground_truth/odom"]
    assert generate.main(["--params-file", file, *chosen, "-o", str(again), "--quiet"]) == 0
    assert raw(again) == raw(bag)


def test_euroc_folders_have_each_imu_with_its_biases(place):
    folder = place / "mav0"
    assert generate.main([*OPTIONS, "--format", "euroc", "-o", str(folder), "--quiet"]) == 0
    samples = Body(load_simulator(GIVEN)).next(10**6)
    for k, name in enumerate(["left", "right"]):
        block = samples[f"{name}/imu"]
        readings = read_imu(folder, f"imu{k}")
        np.testing.assert_array_equal(readings.gyro, block.gyro[block.delivered])
        table = folder / f"state_groundtruth_estimate{k}" / "data.csv"
        states = np.loadtxt(table, delimiter=",")
        np.testing.assert_array_equal(states[:, 11:14], block.gyro_bias)
        np.testing.assert_array_equal(states[:, 1:4], block.motion.position)
    assert "0, 0, 1, -0.03" in (folder / "imu0" / "sensor.yaml").read_text()
    assert "rate_hz: 333.3" in (folder / "imu1" / "sensor.yaml").read_text()


def test_a_euroc_folder_of_several_is_converted_as_a_whole(place):
    folder, path = place / "mav1", place / "converted.bag"
    assert generate.main([*OPTIONS, "--format", "euroc", "-o", str(folder), "--quiet"]) == 0
    assert convert_bag.main([str(folder), "-o", str(path), "--quiet"]) == 0
    for name in ("imu0", "imu1"):
        of_folder, of_bag = read_imu(folder, name), read_imu(path, f"/{name}/imu/data_raw")
        np.testing.assert_array_equal(of_folder.t_ns, of_bag.t_ns)
        np.testing.assert_array_equal(of_folder.accel, of_bag.accel)


def test_tables_of_each_and_poses_of_the_body(place, bag):
    folder = place / "tables"
    assert generate.main([*OPTIONS, "--format", "csv", "-o", str(folder), "--quiet"]) == 0
    assert {p.name for p in folder.iterdir()} == {"imu0.csv", "imu1.csv", "groundtruth.tum"}
    np.testing.assert_array_equal(
        read_imu(folder, "imu1").accel, read_imu(bag, "/right/imu/data_raw").accel
    )
    poses = np.loadtxt(folder / "groundtruth.tum")
    np.testing.assert_array_equal(poses[:, 1:4], read_odometry(bag).position)


def test_cameras_follow_the_body_whatever_imus_it_carries(place):
    """Tracks with two IMUs are those with one that the body's rate has."""
    options = ["--format", "tracks", "--camera", "euroc_cam0", "--duration", "0.2s", "--quiet"]
    common = ["--set=rate=100", "--set=trajectory.type=figure_eight", "--seed", "11"]
    tracks_of_one, tracks_of_two = place / "one_tracks", place / "two_tracks"
    assert generate.main([*common, *options, "-o", str(tracks_of_one)]) == 0
    assert generate.main([*OPTIONS, *options, "--set=duration=0.2", "-o", str(tracks_of_two)]) == 0
    for name in ("tracks.csv", "landmarks.csv", "groundtruth.tum"):
        assert filecmp.cmp(tracks_of_one / name, tracks_of_two / name, shallow=False), name
    assert (tracks_of_one / "tracks.csv").stat().st_size > 1000


@pytest.mark.parametrize(
    ("options", "message"),
    [
        (["--topic", "imu/data_raw=/imu0"], "unknown topic 'imu/data_raw'; did you mean left/"),
        (["--topic", "left/imu/data_raw=/i", "--topic", "right/imu/data_raw=/i"],
         "two topics would have this name"),
        (["--topics", "middle/imu/data_raw"], "did you mean left/imu/data_raw?"),
        (["-o", "x.csv"], "one table has room for one IMU, not 2"),
        (["-o", "x", "--format", "vio_data_simulation", "--camera", "euroc_cam0"],
         "has room for one IMU, not 2"),
        (["--set", "left.rate=0"], "left.rate"),
        (["--set", "imus=[left, left]"], "names must differ"),
        (["--set", "centre.rate=100"], "centre.rate: unknown parameter"),
        (["-o", "x", "--format", "euroc", "--topics", "left/imu/temperature"], "does not exist"),
    ],
)  # fmt: skip
def test_what_does_not_fit_is_one_line(tmp_path, monkeypatch, capsys, options, message):
    monkeypatch.chdir(tmp_path)
    assert generate.main([*OPTIONS, "-o", "y.mcap", "--quiet", *options]) == 2
    lines = capsys.readouterr().err.splitlines()
    assert len(lines) == 1, lines
    assert message in lines[0]
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize(
    ("assignments", "line"),
    [
        (["imus=[gnss]", "sensors=[gnss]"], "sensors: 'gnss': is a name in imus"),
        (["imus=[cam0]", "cameras=[cam0]"], "cameras: 'cam0': is a name in imus"),
        (["sensors=[pose]", "pose.type=gnss"], "sensors: 'pose': is another sensor, or what"),
        (["sensors=[gyroscope]", "gyroscope.type=gnss"], "sensors: 'gyroscope': is another"),
    ],
)
def test_a_name_is_that_of_one_sensor(tmp_path, capsys, assignments, line):
    options = [word for assignment in assignments for word in ("--set", assignment)]
    assert generate.main(["-o", str(tmp_path / "x.mcap"), "--duration", "1s", *options]) == 2
    (error_line,) = capsys.readouterr().err.splitlines()
    assert error_line.startswith(f"generate: {line}")


def test_a_topic_of_one_imu_and_new_names(place):
    path = place / "renamed.bag"
    options = ["--topics", "left/imu/data_raw,ground_truth/odom", "--topic",
               "left/imu/data_raw=/imu0"]  # fmt: skip
    assert generate.main([*OPTIONS, *options, "-o", str(path), "--quiet"]) == 0
    assert set(raw(path)) == {"imu0", "ground_truth/odom"}


def test_memory_does_not_grow_with_the_duration():
    """250 windows take no more memory than 50; each has 64 samples of the fastest."""
    body = Body(load_simulator({**GIVEN, "duration": 400 * 64 / 333.3}))
    windows = body.windows(64)
    tracemalloc.start()
    few, many = (_peak(windows, count) for count in (50, 250))
    tracemalloc.stop()
    assert many < 1.5 * few, (few, many)
    assert sum(1 for _ in windows) >= 90


def _peak(windows, count):
    """Return the largest memory [bytes] while windows come."""
    tracemalloc.reset_peak()
    assert sum(1 for _ in itertools.islice(windows, count)) == count
    return tracemalloc.get_traced_memory()[1]
