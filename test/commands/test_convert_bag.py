# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""convert_bag: every form into every other, recovery, refusals."""

import json
import operator
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from recordings import TUM
from rosbags.highlevel import AnyReader
from rosbags.rosbag1 import Writer as Writer1
from rosbags.rosbag2 import StoragePlugin
from rosbags.rosbag2 import Writer as Writer2

from imu_sim_ros.bags.messages.schemas import typestore_of_format
from imu_sim_ros.bags.read import read_imu, read_odometry
from imu_sim_ros.commands import convert_bag, generate
from imu_sim_ros.formats.door import read_states

EXTRA = (
    "imu/data_raw,ground_truth/odom,ground_truth/gyroscope_bias,ground_truth/accelerometer_bias,"
    "imu/temperature"
)
FORMS = {
    "a.mcap": [],
    "b.bag": ["--compression", "lz4"],
    "c": ["--compression", "zstd"],
    "d": ["--storage", "sqlite3"],
}


@pytest.fixture(scope="module")
def sources(tmp_path_factory) -> dict[str, Path]:
    folder = tmp_path_factory.mktemp("sources")
    for name, options in FORMS.items():
        arguments = ["-o", str(folder / name), "--duration", "4s", "--topics", EXTRA, "--quiet"]
        assert generate.main([*arguments, *options]) == 0
    return {name: folder / name for name in FORMS}


def _convert(capsys, *arguments) -> dict:
    assert convert_bag.main([*map(str, arguments), "--json"]) == 0
    return json.loads(capsys.readouterr().out)


def _assert_same(path: Path, expected_path: Path) -> None:
    columns = operator.attrgetter("t_ns", "gyro", "accel")
    for a, b in zip(columns(read_imu(path)), columns(read_imu(expected_path)), strict=True):
        np.testing.assert_array_equal(a, b)
    columns = operator.attrgetter(
        *("t_ns", "position", "q_wb", "velocity", "angular_velocity"),
        *("covariance", "twist_covariance"),
    )
    for a, b in zip(
        columns(read_odometry(path)), columns(read_odometry(expected_path)), strict=True
    ):
        np.testing.assert_array_equal(a, b)


@pytest.mark.parametrize("target", list(FORMS))
@pytest.mark.parametrize("source", list(FORMS))
def test_bags_of_every_form_convert_into_every_other_without_change(
    sources, source, target, tmp_path, capsys
):
    output = tmp_path / target
    result = _convert(capsys, sources[source], "-o", output, *FORMS[target])
    assert result == {
        "output": str(output),
        "messages": {f"/{name}": 800 for name in EXTRA.split(",")},
        "recovered": False,
        "last_stamp_ns": 10**9 + 799 * 5_000_000,
        "not_converted": [],
        "notes": [],
    }
    _assert_same(sources[source], output)
    with AnyReader([output]) as reader:
        assert sum(1 for _ in reader.messages()) == 5 * 800


def test_there_and_back_again_through_euroc(sources, tmp_path, capsys):
    euroc, back = tmp_path / "mav0", tmp_path / "back.bag"
    _convert(capsys, sources["a.mcap"], "-o", euroc, "--format", "euroc")
    result = _convert(capsys, euroc, "-o", back)
    assert set(result["messages"]) == {f"/{name}" for name in EXTRA.split(",")[:4]}
    original, imu = read_imu(sources["a.mcap"]), read_imu(back)
    np.testing.assert_array_equal(original.gyro, imu.gyro)
    np.testing.assert_array_equal(original.t_ns, imu.t_ns)
    truth, odometry = read_odometry(sources["a.mcap"]), read_odometry(back)
    np.testing.assert_array_equal(truth.position, odometry.position)
    np.testing.assert_allclose(truth.velocity, odometry.velocity, atol=1e-13)
    # The biases stand in the states of the folder.
    table = np.loadtxt(euroc / "state_groundtruth_estimate0" / "data.csv", delimiter=",")
    assert np.any(table[1:, 11:] != 0.0)


NINE = "imu/data_raw,imu/data,imu/mag,imu/pressure,ground_truth/mag"


@pytest.fixture(scope="module")
def nine_axes(tmp_path_factory) -> Path:
    """Return a bag whose sensors have rates of their own, gaps, and messages that came twice."""
    bag = tmp_path_factory.mktemp("nine") / "nine.mcap"
    names = ("imu.magnetometer_rate=70", "imu.barometer_rate=30", "imu.orientation_rate=40")
    transport = ("imu.dropout_probability=0.02", "imu.duplicate_probability=0.02")
    options = [word for value in (*names, *transport) for word in ("--set", value)]
    arguments = ["-o", str(bag), "--trajectory", "figure_eight", "--duration", "3s", "--quiet"]
    assert generate.main([*arguments, "--topics", NINE, *options]) == 0
    return bag


@pytest.mark.parametrize("form", ["euroc", "csv"])
def test_sensors_beside_the_imu_there_and_back_again(nine_axes, form, tmp_path, capsys):
    conversion = _convert(capsys, nine_axes, "-o", tmp_path / form, "--format", form)
    again = _convert(capsys, tmp_path / form, "-o", tmp_path / "again", "--format", form)
    assert again["messages"] == conversion["messages"]
    back = _convert(capsys, tmp_path / form, "-o", tmp_path / "back.bag")
    assert {name: back["messages"][name] for name in conversion["messages"]} == conversion[
        "messages"
    ]
    fields = {
        "/imu/mag": ("magnetic_field",),
        "/imu/pressure": ("fluid_pressure",),
        "/imu/data": ("orientation", "angular_velocity", "linear_acceleration"),
    }
    readings = []
    for path in (nine_axes, tmp_path / "back.bag"):
        with AnyReader([path]) as reader:
            readings.append(
                [
                    (c.topic, m.header.stamp, m.header.frame_id, [getattr(m, f) for f in fields[t]])
                    for c, _, raw in reader.messages()
                    if (t := c.topic) in fields
                    for m in [reader.deserialize(raw, c.msgtype)]
                ]
            )
    for topic in fields:
        original, converted = ([m for m in messages if m[0] == topic] for messages in readings)
        assert len(original) == conversion["messages"][topic] > 80
        assert str(original) == str(converted)


def test_several_imus_have_their_own_beside_them(tmp_path, capsys):
    topics = ["--topics", "imu/data_raw,imu/mag", "--format", "euroc", "--quiet"]
    imus = ["--set", "imus=[left, right]", "--set", "right.imu.magnetometer_rate=40"]
    assert generate.main(["-o", str(tmp_path / "e"), "--duration", "1s", *topics, *imus]) == 0
    result = _convert(capsys, tmp_path / "e", "-o", tmp_path / "two.mcap")
    assert result["messages"] == {
        "/imu0/imu/data_raw": 200,
        "/imu1/imu/data_raw": 200,
        "/imu0/imu/mag": 100,
        "/imu1/imu/mag": 40,
    }


def test_bad_rows_beside_the_imu(nine_axes, tmp_path, capsys):
    folder = tmp_path / "e"
    _convert(capsys, nine_axes, "-o", folder, "--format", "euroc")
    for table, original in (("pressure0", ","), ("mag0", ","), ("orientation0", "1")):
        file = folder / table / "data.csv"
        lines = file.read_text().splitlines()
        lines[7] = lines[7].replace(original, "x" if original == "," else "2", 1)
        file.write_text("\n".join(lines))
    assert convert_bag.main([str(folder), "-o", str(tmp_path / "z.bag")]) == 2
    error = capsys.readouterr().err
    assert "pressure0/data.csv: line 8: 1 columns" in error
    assert not (tmp_path / "z.bag").exists()
    result = _convert(capsys, folder, "-o", tmp_path / "z.bag", "--skip-bad-rows")
    rows = {
        kind: len((folder / f"{kind}0/data.csv").read_text().splitlines()) - 2
        for kind in ("mag", "pressure")
    }
    assert result["messages"]["/imu/mag"] == rows["mag"]
    assert result["messages"]["/imu/pressure"] == rows["pressure"]


def test_csv_and_tum_files_keep_readings_and_poses_exactly(sources, tmp_path, capsys):
    _convert(capsys, sources["b.bag"], "-o", tmp_path / "imu.csv")
    np.testing.assert_array_equal(
        read_imu(tmp_path / "imu.csv").accel, read_imu(sources["b.bag"]).accel
    )
    result = _convert(capsys, sources["c"], "-o", tmp_path / "truth.tum")
    assert result["messages"] == {"/ground_truth/odom": 800}
    truth = read_odometry(sources["c"])
    np.testing.assert_array_equal(read_states(tmp_path / "truth.tum").position, truth.position)
    _convert(capsys, tmp_path / "truth.tum", "-o", tmp_path / "poses.mcap")
    np.testing.assert_array_equal(
        read_states(tmp_path / "poses.mcap").position, read_states(tmp_path / "truth.tum").position
    )


def test_topics_are_chosen_and_renamed(sources, tmp_path, capsys):
    result = _convert(
        capsys,
        sources["d"],
        *("-o", tmp_path / "x.bag", "--topics", "imu/data_raw", "--topic", "imu/data_raw=/imu0"),
    )
    assert result["messages"] == {"/imu0": 800}


def _foreign(path: Path, encoding: str) -> None:
    """Write topics of types that this package has no layout for, with varying sizes."""
    store = typestore_of_format(encoding)
    types = store.types
    header = types["std_msgs/msg/Header"]
    time = types["builtin_interfaces/msg/Time"]
    if encoding == "ros1":
        writer = Writer1(path)
    else:
        writer = Writer2(path, version=9, storage_plugin=StoragePlugin.MCAP)
    with writer:
        texts = writer.add_connection("/words", "std_msgs/msg/String", typestore=store)
        joints = writer.add_connection("/joints", "sensor_msgs/msg/JointState", typestore=store)
        for k in range(200):
            text = types["std_msgs/msg/String"](data="w" * (k % 9))
            stamp = (time(sec=k, nanosec=k), "frame" + "x" * (k % 5))
            joint = types["sensor_msgs/msg/JointState"](
                header=header(k, *stamp) if encoding == "ros1" else header(*stamp),
                name=["j"] * (k % 4),
                position=np.arange(k % 4, dtype=np.float64),
                velocity=np.zeros(0),
                effort=np.ones(k % 3),
            )
            for connection, message in ((texts, text), (joints, joint)):
                raw = getattr(store, f"serialize_{encoding}")(message, connection.msgtype)
                writer.write(connection, 10**9 + k, bytes(raw))


@pytest.mark.parametrize(("source", "target"), [("ros1", "x.mcap"), ("cdr", "x.bag"), ("cdr", "y")])
def test_topics_of_any_type(source, target, tmp_path, capsys):
    path = tmp_path / ("s.bag" if source == "ros1" else "s")
    _foreign(path, source)
    result = _convert(capsys, path, "-o", tmp_path / target)
    assert result["messages"] == {"/words": 200, "/joints": 200}
    rows = []
    for bag in (path, tmp_path / target):
        with AnyReader([bag]) as reader:
            rows.append(
                [
                    (c.topic, t, getattr(m, "data", None), getattr(m, "name", None))
                    + (
                        (m.header.stamp.sec, m.header.frame_id, m.position.tolist())
                        if c.topic == "/joints"
                        else ()
                    )
                    for c, t, raw in reader.messages()
                    for m in [reader.deserialize(raw, c.msgtype)]
                ]
            )
    assert sorted(map(repr, rows[0])) == sorted(map(repr, rows[1]))


def test_recovery_says_how_many_and_up_to_when(sources, tmp_path, capsys):
    data = sources["a.mcap"].read_bytes()
    torn = tmp_path / "torn.mcap"
    torn.write_bytes(data[: len(data) // 2])
    assert convert_bag.main([str(torn), "-o", str(tmp_path / "no.mcap")]) == 2
    assert "--recover" in capsys.readouterr().err
    result = _convert(capsys, torn, "-o", tmp_path / "whole.mcap", "--recover")
    assert result["recovered"] is True
    imu = read_imu(tmp_path / "whole.mcap")
    assert result["messages"]["/imu/data_raw"] == len(imu.t_ns) > 300
    assert result["last_stamp_ns"] == imu.t_ns[-1]
    assert convert_bag.main([str(torn), "-o", str(tmp_path / "z.bag"), "--recover"]) == 0
    assert "recovered" in capsys.readouterr().out
    whole = _convert(capsys, sources["a.mcap"], "-o", tmp_path / "same.mcap", "--recover")
    assert whole["recovered"] is False
    assert whole["messages"]["/imu/data_raw"] == 800


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (["missing.bag", "-o", "x.mcap"], "No such file"),
        (["{a}", "-o", "x.mcap", "--topics", "/nothing"], "has no topic /nothing; it has /imu"),
        (["{a}", "-o", "there.bag"], "already exists"),
        (["{a}", "-o", "x.csv", "--compression", "lz4"], "--compression: does not apply to csv"),
        (["there.bag", "-o", "x.mcap"], "not a bag"),
        (["{a}", "-o", "x", "--format", "euroc", "--topics", "/imu/temperature"], "none of them"),
    ],
)
def test_bad_arguments_are_one_line(sources, tmp_path, monkeypatch, capsys, arguments, message):
    monkeypatch.chdir(tmp_path)
    Path("there.bag").write_text("words, more than sixteen of them")
    filled = [argument.replace("{a}", str(sources["a.mcap"])) for argument in arguments]
    assert convert_bag.main(filled) == 2
    error = capsys.readouterr().err
    assert message in error
    assert len(error.splitlines()) == 1


def test_two_imus_and_none_named(tmp_path, capsys):
    source = tmp_path / "two.mcap"
    topics = ["--topics", "imu/data_raw,ground_truth/imu,ground_truth/odom"]
    topics += ["--topic", "ground_truth/imu=second/imu"]
    assert generate.main(["-o", str(source), "--duration", "1s", *topics, "--quiet"]) == 0
    assert convert_bag.main([str(source), "-o", str(tmp_path / "e"), "--format", "euroc"]) == 2
    error = capsys.readouterr().err
    assert "/imu/data_raw" in error
    assert "/second/imu" in error
    options = ["--format", "euroc", "--topics", "/imu/data_raw,/ground_truth/odom"]
    assert convert_bag.main([str(source), "-o", str(tmp_path / "e"), *options, "--quiet"]) == 0


def test_a_flight_along_recorded_poses_converts_with_all_its_readings(tmp_path, capsys):
    options = ["--trajectory", str(TUM), "--duration", "5s", "--format", "euroc", "--quiet"]
    assert generate.main(["-o", str(tmp_path / "mav0"), *options]) == 0
    result = _convert(capsys, tmp_path / "mav0", "-o", tmp_path / "x.bag")
    assert result["messages"]["/imu/data_raw"] == 1000


def test_topics_without_a_place_in_a_dataset_are_named_whatever_was_loaded(tmp_path, capsys):
    """Two processes convert alike, one of which has used the sensors before."""
    bag = tmp_path / "a.bag"
    assert generate.main(["-o", str(bag), "--duration", "2s", "--gnss", "ublox_m8", "--quiet"]) == 0
    topic_options = []
    for preamble in ("", "from imu_sim_ros.sensors import all_sensors; all_sensors(); "):
        program = f"{preamble}from imu_sim_ros.commands.convert_bag import main; main()"
        output = tmp_path / f"out{len(topic_options)}"
        argv = [str(bag), "-o", str(output), "--format", "csv", "--json"]
        done = subprocess.run(
            [sys.executable, "-c", program, *argv], capture_output=True, text=True, check=True
        )
        topic_options.append(json.loads(done.stdout)["not_converted"])
    assert "/gps/fix" in topic_options[0]
    assert "/imu/data_raw" not in topic_options[0]
    assert topic_options[0] == topic_options[1]
    capsys.readouterr()
    assert convert_bag.main([str(bag), "-o", str(tmp_path / "text"), "--format", "csv"]) == 0
    assert "has no place for" in capsys.readouterr().out


EUROC = ["--format", "euroc"]


def test_the_truth_of_a_dataset_is_ground_truth_or_named(tmp_path, capsys):
    """A drive was refused for its two odometries; that of wheels alone became the truth unsaid."""
    drive, wheels = tmp_path / "drive.mcap", tmp_path / "wheels.mcap"
    argv = ["--duration", "2s", "--wheels", "husky_a200", "--trajectory", "yard", "--quiet"]
    for bag, options in ((drive, ",ground_truth/odom"), (wheels, "")):
        topics = ["--topics", f"imu/data_raw,wheel/odom{options}"]
        assert generate.main(["-o", str(bag), *argv, *topics]) == 0
    converted = _convert(capsys, drive, "-o", tmp_path / "drive", *EUROC)
    assert converted["messages"] == {"/imu/data_raw": 400, "/ground_truth/odom": 400}
    assert converted["not_converted"] == ["/wheel/odom"]
    whole = ["-o", tmp_path / "wheels", *EUROC]
    for options, count in (([], 1), (["--topics", "imu/data_raw,wheel/odom", "--force"], 0)):
        assert convert_bag.main([str(path) for path in (wheels, *whole, *options)]) == 0
        lines = capsys.readouterr().err
        assert lines.count("/wheel/odom becomes the truth of the dataset") == count
    tum = _convert(capsys, wheels, "-o", tmp_path / "wheels.tum")
    assert list(tum["messages"]) == ["/wheel/odom"]  # it said /ground_truth/odom
    assert tum["not_converted"] == ["/imu/data_raw"]


def test_the_true_poses_of_a_folder_of_tables_are_kept(tmp_path, capsys):
    """A bag made of the folder has them again."""
    argv = ["--trajectory", "figure_eight", "--duration", "2s", "--quiet", "--force"]
    tables, bag = tmp_path / "tables", tmp_path / "back.mcap"
    assert generate.main(["-o", str(tables), "--format", "csv", *argv]) == 0
    capsys.readouterr()
    assert convert_bag.main([str(tables), "-o", str(bag), "--json"]) == 0
    result = json.loads(capsys.readouterr().out)
    assert result["messages"] == {"/imu/data_raw": 400, "/ground_truth/pose": 400}
    assert result["not_converted"] == []
    states = read_states(bag, "ground_truth/pose")
    np.testing.assert_allclose(
        states.position, read_states(tables / "groundtruth.tum").position, atol=1e-9
    )
    assert convert_bag.main([str(tables), "-o", str(tmp_path / "t.tum"), "--quiet"]) == 0
    assert len(read_states(tmp_path / "t.tum").t_ns) == 400
    assert convert_bag.main([str(tables), "-o", str(tmp_path / "euroc"), "--json", *EUROC]) == 0
    assert json.loads(capsys.readouterr().out)["not_converted"] == ["groundtruth.tum"]


def test_images_without_a_place_are_named(tmp_path, capsys):
    bag, small = tmp_path / "flow.mcap", ["camera.width=64", "camera.height=48"]
    values = [*small, "camera.intrinsics=[40,40,32,24]", "camera.flow=raw", "camera.depth=true"]
    argv = [word for value in values for word in ("--set", value)]
    argv += ["--camera", "euroc_cam0", "--duration", "0.2s", "--quiet"]
    assert generate.main(["-o", str(bag), *argv]) == 0
    capsys.readouterr()
    assert convert_bag.main([str(bag), "-o", str(tmp_path / "euroc"), "--json", *EUROC]) == 0
    result = json.loads(capsys.readouterr().out)
    assert {"/cam0/image_raw", "/cam0/depth/image_raw"} <= set(result["messages"])
    assert result["not_converted"] == [
        *("/cam0/flow/image_raw", "/feature_tracker/feature", "/ground_truth/landmarks")
    ]
