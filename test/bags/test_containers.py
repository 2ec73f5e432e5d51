# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Every container as other people's software reads it."""

import os
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
import yaml
from rosbags.highlevel import AnyReader

from imu_sim_ros.bags.create import open_writer
from imu_sim_ros.bags.mcap_writer import McapWriter
from imu_sim_ros.bags.messages.blocks import as_list
from imu_sim_ros.bags.messages.encode import (
    IMU,
    VECTOR3_STAMPED,
    ImuEncoder,
    Vector3StampedEncoder,
)
from imu_sim_ros.bags.messages.schemas import Qos
from imu_sim_ros.bags.read import open_bag, read_imu
from imu_sim_ros.bags.writer import BagOptions, Block
from imu_sim_ros.core.errors import InputError
from imu_sim_ros.formats.choice import Choice
from imu_sim_ros.formats.door import read_readings

ROS1_PYTHON = Path("/usr/bin/python3")
ROS1_BAGS = ("none.bag", "lz4.bag", "bz2.bag")
MCAP_FILES = ("none.mcap", "lz4.mcap", "zstd.mcap")


def _ros1(*arguments: str) -> subprocess.CompletedProcess[str]:
    """Run the system's Python, where Debian's real ROS 1 lives, without anything of this venv."""
    return subprocess.run(
        [str(ROS1_PYTHON), *arguments],
        env={"PATH": "/usr/bin:/bin", "HOME": os.environ.get("HOME", "/")},
        capture_output=True,
        text=True,
        check=False,
        timeout=300,
    )


def _has_ros1() -> bool:
    code = "import rosbag, sensor_msgs.msg, nav_msgs.msg"
    return ROS1_PYTHON.exists() and _ros1("-c", code).returncode == 0


ros1 = pytest.mark.skipif(
    not _has_ros1(),
    reason="REAL ROS 1 NOT TESTED: apt-get install python3-rosbag python3-sensor-msgs "
    "python3-nav-msgs python3-geometry-msgs",
)


def test_rosbags_reads_every_message(bags, form, content):
    with AnyReader([bags[form]]) as reader:
        times = {connection.topic: [] for connection in reader.connections}
        last_messages = {}
        for connection, t_ns, raw in reader.messages():
            times[connection.topic].append(t_ns)
            last_messages[connection.topic] = reader.deserialize(raw, connection.msgtype)
    np.testing.assert_array_equal(times["/imu/data_raw"], content.t_ns)
    np.testing.assert_array_equal(times["/imu/temperature"], content.t_ns)
    np.testing.assert_array_equal(times["/ground_truth/odom"], content.truth_t_ns)
    np.testing.assert_array_equal(times["/vector"], content.truth_t_ns)
    assert last_messages["/imu/data_raw"].angular_velocity.z == content.gyro[-1, 2]
    assert last_messages["/ground_truth/odom"].pose.pose.orientation.w == content.q_wb[-1, 0]
    assert last_messages["/imu/temperature"].temperature == content.temperature[-1]
    assert last_messages["/vector"].vector.x == content.accel[-1, 0]


@pytest.mark.parametrize("name", MCAP_FILES)
def test_mcap_library_and_decoder_read_every_message(bags, name, content):
    from mcap.reader import make_reader
    from mcap_ros2.decoder import DecoderFactory

    with bags[name].open("rb") as file:
        reader = make_reader(file, decoder_factories=[DecoderFactory()], validate_crcs=True)
        statistics = reader.get_summary().statistics
        rows = [
            (message.log_time, decoded.angular_velocity.x, decoded.linear_acceleration.z)
            for _, channel, message, decoded in reader.iter_decoded_messages(["/imu/data_raw"])
            if channel.topic == "/imu/data_raw"
        ]
    assert statistics.message_count == 4 * len(content.t_ns)
    assert statistics.message_start_time == content.t_ns[0]
    assert statistics.message_end_time == content.truth_t_ns[-1]
    t_ns, gyro_x, accel_z = zip(*rows, strict=True)
    np.testing.assert_array_equal(t_ns, content.t_ns)
    np.testing.assert_array_equal(gyro_x, content.gyro[:, 0])
    np.testing.assert_array_equal(accel_z, content.accel[:, 2])


@pytest.mark.parametrize("name", MCAP_FILES)
def test_mcap_messages_stand_in_the_order_of_time(bags, name):
    from mcap.reader import NonSeekingReader

    with bags[name].open("rb") as file:
        times = [
            m.log_time for _, _, m in NonSeekingReader(file).iter_messages(log_time_order=False)
        ]
    assert np.all(np.diff(times) >= 0)


EXAMINE_ALL = """
import sys
from pymcap_cli.cli import main
for path in sys.argv[1:]:
    print("examined:", path)
    sys.argv = ["pymcap-cli", "doctor", path]
    try:
        status = main()
    except SystemExit as end:
        status = end.code
    print("status:", status or 0)
"""


def test_mcap_doctor_finds_nothing(tmp_path, content):
    """One chunk, or three: a first, a middle and a last one; the doctor looks at each message.

    One process examines all files: a third of its time is its start.
    """
    pytest.importorskip("pymcap_cli")
    chunks = dict(zip(MCAP_FILES, (1, 1, 3), strict=True))
    for name, count in chunks.items():
        with open_writer(tmp_path / name, BagOptions("mcap", name.removesuffix(".mcap"))) as writer:
            type(content)(800 * count - 200).write(writer)
    paths = [str(tmp_path / name) for name in MCAP_FILES]
    result = subprocess.run(
        [sys.executable, "-c", EXAMINE_ALL, *paths], capture_output=True, text=True, check=False
    )
    assert result.returncode == 0, result.stdout + result.stderr
    _, *reports = result.stdout.split("examined:")
    for report, count in zip(reports, chunks.values(), strict=True):
        summary = " ".join(report.split())
        assert summary.endswith("status: 0"), report
        assert f"{count} chunk" in summary
        assert "passed" in summary
        assert "warning" not in summary.lower()


CHECK_ALL = """
import sys, rosbag
for path in sys.argv[1:]:
    try:
        rosbag.rosbagmain(["rosbag", "check", path])
    except SystemExit as end:
        assert not end.code, (path, end.code)
"""


@ros1
def test_real_ros1_info_and_check(bags, content):
    paths = [str(bags[name]) for name in ROS1_BAGS]
    info = _ros1("/usr/bin/rosbag", "info", "--yaml", *paths)
    for name, facts in zip(ROS1_BAGS, yaml.safe_load_all(info.stdout), strict=True):
        assert facts["indexed"] is True
        assert facts["messages"] == 4 * len(content.t_ns)
        assert facts["compression"] == name.split(".")[0]
    check = _ros1("-c", CHECK_ALL, *paths)
    assert check.returncode == 0, check.stdout + check.stderr
    assert check.stdout.count("does not need any migrations") == len(paths)


READ_ALL = """
import sys, rosbag
for path in sys.argv[1:]:
    with rosbag.Bag(path) as bag:
        for _, m, t in bag.read_messages(["/imu/data_raw"]):
            v = m.angular_velocity
            print(t.to_nsec(), m.header.stamp.to_nsec(), repr(v.x), repr(v.y), repr(v.z))
"""


@ros1
def test_real_ros1_reads_the_same_messages(bags, content):
    result = _ros1("-c", READ_ALL, *(str(bags[name]) for name in ROS1_BAGS))
    assert result.returncode == 0, result.stderr
    rows = [line.split() for line in result.stdout.splitlines()]
    count = len(ROS1_BAGS)
    np.testing.assert_array_equal([int(row[0]) for row in rows], np.tile(content.t_ns, count))
    np.testing.assert_array_equal([int(row[1]) for row in rows], np.tile(content.t_ns, count))
    rates = [[float(x) for x in row[2:]] for row in rows]
    np.testing.assert_array_equal(rates, np.tile(content.gyro, (count, 1)))


@ros1
def test_real_ros1_reindexes_an_interrupted_bag(tmp_path, content):
    writer = open_writer(tmp_path / "torn.bag")
    content.write(writer)
    writer.flush()
    torn = tmp_path / "torn.bag.active"
    assert torn.exists()
    assert not (tmp_path / "torn.bag").exists()
    copy = tmp_path / "copy.bag"
    copy.write_bytes(torn.read_bytes())
    result = _ros1("/usr/bin/rosbag", "reindex", str(copy))
    assert result.returncode == 0, result.stdout + result.stderr
    assert len(read_imu(copy).t_ns) == len(content.t_ns)
    writer.close()


def test_metadata_of_a_folder(bags, content):
    for name in ("folder_mcap", "folder_sqlite3"):
        text = (bags[name] / "metadata.yaml").read_text()
        facts = yaml.safe_load(text)["rosbag2_bagfile_information"]
        assert facts["version"] == 9
        assert facts["message_count"] == 4 * len(content.t_ns)
        assert facts["starting_time"]["nanoseconds_since_epoch"] == content.t_ns[0]
        assert facts["duration"]["nanoseconds"] == content.truth_t_ns[-1] - content.t_ns[0]
        topics = {t["topic_metadata"]["name"]: t for t in facts["topics_with_message_count"]}
        metadata = topics["/imu/data_raw"]["topic_metadata"]
        assert metadata["type"] == IMU
        assert metadata["type_description_hash"].startswith("RIHS01_7d9a00ff131080897a5ec7e26e31")
        qos = metadata["offered_qos_profiles"][0]
        assert qos["deadline"] == {"sec": 9223372036, "nsec": 854775807}
        assert (qos["reliability"], qos["durability"]) == ("reliable", "volatile")


def test_splitting_by_time_and_size(tmp_path, content):
    with open_writer(tmp_path / "time", BagOptions(split_duration=5.0)) as writer:
        content.write(writer)
    with open_writer(tmp_path / "size.bag", BagOptions(split_size=1_500_000)) as writer:
        content.write(writer)
    parts = sorted((tmp_path / "time").glob("*.mcap"))
    # 4500 samples at 200 Hz are 22.5 s.
    assert len(parts) == 5
    for part in parts:
        t_ns = read_imu(part).t_ns
        assert t_ns[-1] - t_ns[0] < 5e9
    np.testing.assert_array_equal(read_imu(tmp_path / "time").t_ns, content.t_ns)
    files = sorted(tmp_path.glob("size_*.bag"))
    assert len(files) > 2
    joined = np.concatenate([read_imu(file).t_ns for file in files])
    np.testing.assert_array_equal(joined, content.t_ns)


def test_single_messages_and_varying_sizes(tmp_path, content):
    frames = ["a", "imu_link", "some_longer_name"]
    for name in ("x.mcap", "x.bag", "x"):
        with open_writer(tmp_path / name) as writer:
            topic = writer.add_topic("/imu", IMU, [Qos("best_effort", "transient_local")])
            for k in range(300):
                encoder = ImuEncoder(frames[k % 3], writer.encoding)
                row = encoder.encode(
                    content.t_ns[k : k + 1], content.gyro[k : k + 1], content.accel[k : k + 1]
                )
                writer.write(topic, content.t_ns[k : k + 1], [row.tobytes()])
        for k, frame in enumerate(frames):
            readings = read_readings(tmp_path / name, Choice(frame=frame))
            np.testing.assert_array_equal(readings.t_ns, content.t_ns[k:300:3])
            np.testing.assert_array_equal(readings.gyro, content.gyro[k:300:3])
        with open_bag(tmp_path / name) as bag:
            assert bag.topics[0].qos[0].durability == "transient_local"


def test_a_message_of_zeros_after_others_is_one_of_zeros(tmp_path, content):
    """Chunks are made in the same memory, one after the other."""
    encoder = Vector3StampedEncoder("imu_link")
    with McapWriter(tmp_path / "x.mcap") as writer:
        topic = writer.add_topic("/vector", VECTOR3_STAMPED)
        for rows in (slice(0, 200), slice(200, 400)):
            t_ns = content.t_ns[rows]
            writer.write_blocks([Block(topic, t_ns, encoder.pattern(t_ns, content.gyro[rows]))])
            writer.flush()
        zeros = encoder.pattern(np.zeros(1, np.int64), np.zeros((1, 3)))
        writer.write_blocks([Block(topic, content.t_ns[400:401], zeros)])
    with open_bag(tmp_path / "x.mcap") as bag:
        payloads = [p for group in bag.groups() for b in group for p in as_list(b.payloads)]
    assert payloads[-1] == encoder.layout.template
    assert payloads[0] != payloads[-1]


def test_chunks_that_overlap_in_time_are_merged(tmp_path, content):
    encoder = ImuEncoder("imu_link")
    order = np.arange(4000).reshape(2, 2000).T.reshape(-1)  # 0, 2000, 1, 2001, ...
    with McapWriter(tmp_path / "x.mcap") as writer:
        topic = writer.add_topic("/imu", IMU)
        for rows in np.split(order, 8):
            t_ns = content.t_ns[rows]
            payloads = encoder.encode(t_ns, content.gyro[rows], content.accel[rows])
            writer.write_blocks([Block(topic, t_ns, payloads)])
            writer.flush()
    readings = read_imu(tmp_path / "x.mcap")
    np.testing.assert_array_equal(readings.t_ns, content.t_ns[:4000])
    np.testing.assert_array_equal(readings.gyro, content.gyro[:4000])


@pytest.mark.parametrize("name", ["a.mcap", "a.bag"])
def test_topics_with_times_of_their_own_are_merged_by_time(tmp_path, name):
    """Rows that are copied in runs stand as single messages would: in order, the same bytes.

    Three chunks of topics at 1000, 1000, 7 and 250 Hz, the third and fourth with times of others
    too; of equal times the first topic comes first. A topic whose times repeat is among them.
    """
    rng = np.random.default_rng(2)
    fast = np.arange(12_000, dtype=np.int64) * 1_000_000
    repeated = np.repeat(fast[::40], 2)
    grids = [fast, fast, fast[::143] + 5, fast[::4], fast[::4], repeated, repeated]
    messages = {}
    for kind in ("rows", "single"):
        path = tmp_path / kind / name
        path.parent.mkdir()
        with open_writer(path) as writer:
            topics = [writer.add_topic(f"/t{k}", IMU) for k in range(len(grids))]
            encoders = [ImuEncoder(f"frame{k}", writer.encoding) for k in range(len(grids))]
            if kind == "rows":
                blocks = [
                    Block(topic, t_ns, encoder.pattern(t_ns, *rng.normal(size=(2, len(t_ns), 3))))
                    for topic, encoder, t_ns in zip(topics, encoders, grids, strict=True)
                ]
                singles = [as_list(b.payloads) for b in blocks]
            else:
                blocks = [
                    Block(topic, t_ns, payloads)
                    for topic, t_ns, payloads in zip(topics, grids, singles, strict=True)
                ]
            writer.write_blocks(blocks)
        with open_bag(path) as bag, AnyReader([path]) as reader:
            assert len(bag.topics) == len(grids)
            messages[kind] = [(c.topic, t_ns, bytes(raw)) for c, t_ns, raw in reader.messages()]
    assert len(messages["rows"]) == sum(map(len, grids))
    times = [t_ns for _, t_ns, _ in messages["rows"]]
    assert times == sorted(times)
    assert sorted(messages["rows"]) == sorted(messages["single"])
    if name.endswith(".mcap"):  # the reader keeps the file's order of equal times
        assert messages["rows"] == messages["single"]


def test_places_and_options_that_cannot_be_used(tmp_path):
    (tmp_path / "there.mcap").write_text("mine")
    for path, options, reason in (
        ("there.mcap", {}, "already exists"),
        ("there.mcap/x.mcap", {}, "Not a directory|File exists"),
        ("x.bag", {"compression": "zstd"}, "ros1 takes none, lz4, bz2"),
        ("x.mcap", {"storage": "sqlite3"}, "has the storage mcap"),
        ("x", {"storage": "paper"}, "must be one of mcap, sqlite3, ros1"),
    ):
        with pytest.raises(InputError, match=reason):
            open_writer(tmp_path / path, BagOptions(**options))
    assert (tmp_path / "there.mcap").read_text() == "mine"


def test_a_topic_is_added_once(tmp_path):
    with open_writer(tmp_path / "x.mcap") as writer:
        writer.add_topic("/imu", IMU)
        with pytest.raises(InputError, match="/imu already exists"):
            writer.add_topic("/imu", IMU)
        with pytest.raises(InputError, match="definition of this message type is not known"):
            writer.add_topic("/other", "my_msgs/msg/Unknown")


def _fail_with_a_topic(path, storage):
    with open_writer(path, BagOptions(storage)) as writer:
        writer.add_topic("/imu", IMU)
        raise RuntimeError


@pytest.mark.parametrize(
    ("name", "storage"), [("x.mcap", None), ("x.bag", None), ("x", None), ("y", "sqlite3")]
)
def test_a_failure_leaves_no_empty_files(tmp_path, name, storage):
    with pytest.raises(RuntimeError):
        _fail_with_a_topic(tmp_path / name, storage)
    assert list(tmp_path.iterdir()) == []
