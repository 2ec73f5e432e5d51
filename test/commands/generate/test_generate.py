# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""generate: samples, formats, names, refusals."""

import json
import os
import resource
import signal
import subprocess
from pathlib import Path

import numpy as np
import pytest
import yaml
from programs import program, until

from imu_sim_ros.bags.read import open_bag, read_imu, read_odometry
from imu_sim_ros.commands.generate import main
from imu_sim_ros.formats.door import read_states
from imu_sim_ros.parameters import files
from imu_sim_ros.sensors.errors.triad import variance_discrete
from imu_sim_ros.simulation.engine import Body
from imu_sim_ros.simulation.parameters import load_simulation

LAYER = {"trajectory.type": "lecture", "imu.preset": "lecture", "duration": 4.0, "seed": 3}
ARGUMENTS = ["--trajectory", "lecture", "--imu", "lecture", "--duration", "4s", "--seed", "3"]
OUTPUTS = ["x.mcap", "x.bag", "x"]


def _all_samples(**changes):
    simulation = Body(load_simulation({**LAYER, **changes}))
    return simulation.next(simulation.total)["imu"]


@pytest.mark.parametrize("name", OUTPUTS)
def test_samples_are_those_of_the_stream_bit_for_bit(tmp_path, name, capsys):
    output = tmp_path / name
    assert main(["-o", str(output), *ARGUMENTS, "--json"]) == 0
    result = json.loads(capsys.readouterr().out)
    assert set(result) == {"output", "messages", "samples", "wall_s", "bytes"}
    assert result["messages"] == {"/imu/data_raw": 800, "/ground_truth/odom": 800}
    assert result["samples"] == 800
    files = [output] if output.is_file() else list(output.iterdir())
    assert result["bytes"] == sum(file.stat().st_size for file in files)
    block = _all_samples()
    imu, truth = read_imu(output), read_odometry(output)
    np.testing.assert_array_equal(imu.t_ns, block.t_ns)
    np.testing.assert_array_equal(imu.gyro, block.gyro)
    np.testing.assert_array_equal(imu.accel, block.accel)
    np.testing.assert_array_equal(truth.position, block.motion.position)
    np.testing.assert_array_equal(truth.q_wb, block.motion.q_wb)
    np.testing.assert_allclose(truth.velocity, block.motion.velocity, atol=1e-12)


@pytest.mark.parametrize("form", ["euroc", "csv"])
def test_datasets_have_the_same_samples(tmp_path, form):
    assert main(["-o", str(tmp_path / "d"), *ARGUMENTS, "--format", form, "--quiet"]) == 0
    block = _all_samples()
    imu = read_imu(tmp_path / "d")
    np.testing.assert_array_equal(imu.gyro, block.gyro)
    np.testing.assert_array_equal(imu.t_ns, block.t_ns)
    truth = {"euroc": "state_groundtruth_estimate0/data.csv", "csv": "groundtruth.tum"}[form]
    poses = read_states(tmp_path / "d" / truth)
    np.testing.assert_array_equal(poses.position, block.motion.position)


def test_covariances_and_absent_orientation(tmp_path):
    from rosbags.highlevel import AnyReader

    assert main(["-o", str(tmp_path / "x"), *ARGUMENTS, "--quiet"]) == 0
    parameters = load_simulation(LAYER)
    with AnyReader([tmp_path / "x"]) as reader:
        connection, _, raw = next(reader.messages())
        message = reader.deserialize(raw, connection.msgtype)
    assert message.header.frame_id == "imu_link"
    assert message.orientation_covariance[0] == -1.0
    np.testing.assert_array_equal(
        message.angular_velocity_covariance[[0, 4, 8]],
        variance_discrete(parameters.imu, "gyroscope", parameters.rate),
    )


def test_only_delivered_readings_with_their_own_stamps(tmp_path):
    faults = {"imu.dropout_probability": 0.2, "imu.stamp_offset": 0.003}
    options = [word for key, value in faults.items() for word in ("--set", f"{key}={value}")]
    assert main(["-o", str(tmp_path / "x.bag"), *ARGUMENTS, *options, "--quiet"]) == 0
    block = _all_samples(**faults)
    imu, truth = read_imu(tmp_path / "x.bag"), read_odometry(tmp_path / "x.bag")
    assert 0.7 * 800 < len(imu.t_ns) < 0.9 * 800
    np.testing.assert_array_equal(imu.t_ns, block.t_ns[block.delivered])
    np.testing.assert_array_equal(imu.gyro, block.gyro[block.delivered])
    np.testing.assert_array_equal(truth.t_ns, block.true_t_ns)


def test_topics_and_their_names(tmp_path, capsys):
    topics = "imu/data_raw,ground_truth/gyroscope_bias,imu/temperature,ground_truth/imu"
    output = tmp_path / "x.mcap"
    names = ["--topics", topics, "--topic", "imu/data_raw=/imu0"]
    assert main(["-o", str(output), *ARGUMENTS, *names, "--json"]) == 0
    counts = json.loads(capsys.readouterr().out)["messages"]
    assert counts == dict.fromkeys(
        ("/imu0", "/ground_truth/gyroscope_bias", "/imu/temperature", "/ground_truth/imu"), 800
    )
    ideal = read_imu(output, "/ground_truth/imu")
    np.testing.assert_array_equal(ideal.gyro, _all_samples().ideal_gyro)
    with open_bag(output) as bag:
        assert {topic.name for topic in bag.topics} == set(counts)


def test_configurations_beside_kalibr_bagcreaters_folder_have_its_topics(tmp_path):
    """Topics bear the names of the files; the bag has no /imu/data_raw."""
    output = tmp_path / "x"
    argv = [*ARGUMENTS, "--format", "csv", "--with-configs", "--quiet"]
    assert main(["-o", str(output), *argv]) == 0
    assert (output / "imu0.csv").exists()
    kalibr = yaml.safe_load((tmp_path / "x_configs" / "imu.yaml").read_text())
    assert kalibr["rostopic"] == "/imu0"


def test_configurations_of_the_consumers(tmp_path):
    output = tmp_path / "x.bag"
    assert main(["-o", str(output), *ARGUMENTS, "--imu-only", "--with-configs", "--quiet"]) == 0
    folder = tmp_path / "x.bag_configs"
    kalibr = yaml.safe_load((folder / "imu.yaml").read_text())
    assert kalibr == {
        "gyroscope_noise_density": 0.015,
        "gyroscope_random_walk": 5e-5,
        "accelerometer_noise_density": 0.019,
        "accelerometer_random_walk": 5e-4,
        "rostopic": "/imu/data_raw",
        "update_rate": 200,
    }

    def opencv(name):
        return yaml.safe_load((folder / name).read_text().split("\n", 1)[1].replace("---\n", ""))

    root = np.sqrt(200.0)
    vins = opencv("vins_mono.yaml")
    assert vins["gyr_n"] == pytest.approx(0.015 * root)
    assert vins["acc_w"] == pytest.approx(5e-4 * root)
    assert opencv("orb_slam3.yaml")["IMU.NoiseGyro"] == 0.015
    assert opencv("kalibr_imu_chain.yaml")["imu0"]["accelerometer_noise_density"] == 0.019
    utils = opencv("imu_utils.yaml")
    assert float(utils["Gyr"]["x-axis"]["gyr_n"]) == pytest.approx(0.015 * root)
    # sqrt(N^2 / tau + K^2 tau / 3) has its minimum sqrt(2 N K / sqrt(3)) at tau = sqrt(3) N / K.
    assert float(utils["Acc"]["avg-axis"]["acc_w"]) == pytest.approx(
        np.sqrt(2 * 0.019 * 5e-4 / np.sqrt(3))
    )
    again = tmp_path / "again.bag"
    assert (
        main(["-o", str(again), "--params-file", str(folder / "simulation.yaml"), "--quiet"]) == 0
    )
    np.testing.assert_array_equal(read_imu(again).accel, read_imu(output).accel)


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (["-o", "new.mcap", "--trajectory", "static"], "duration"),
        (["-o", "there.mcap", "--duration", "1s"], "already exists"),
        (
            ["-o", "new", "--duration", "1s", "--topics", "imu/raw"],
            "unknown topic 'imu/raw'; did you mean imu/data_raw?",
        ),
        (["-o", "new.bag", "--duration", "1s", "--compression", "zstd"], "ros1 takes none"),
        (["-o", "there.mcap/new.bag", "--duration", "1s"], "is not a folder"),
        (["-o", "d", "--format", "csv", "--duration", "1s", "--storage", "mcap"], "--storage"),
        (["-o", "new.mcap", "--duration", "1s", "--rate", "0"], "rate"),
        (
            ["-o", "new.mcap", "--duration", "1s", "--topic", "ground_truth/odom=imu/data_raw"],
            "two",
        ),
    ],
)
def test_bad_arguments_are_one_line_and_leave_no_files(
    tmp_path, monkeypatch, capsys, arguments, message
):
    monkeypatch.chdir(tmp_path)
    Path("there.mcap").write_text("mine")
    assert main(arguments) == 2
    error = capsys.readouterr().err
    assert message in error
    assert len(error.splitlines()) == 1
    assert os.listdir() == ["there.mcap"]


@pytest.mark.parametrize(
    "arguments", [["-o", "x", "--format", "paper"], ["-o", "x", "--rate", "fast"], []]
)
def test_bad_arguments_end_with_status_2(arguments):
    with pytest.raises(SystemExit) as ended:
        main(arguments)
    assert ended.value.code == 2


COMMAND = program("generate")


@pytest.mark.parametrize(
    ("name", "number"),
    [
        ("x.mcap", signal.SIGINT),
        ("x.bag", signal.SIGTERM),
        ("x", signal.SIGINT),
        ("y", signal.SIGTERM),
        ("x.csv", signal.SIGINT),
    ],
)
def test_a_stopped_run_keeps_a_whole_part(tmp_path, name, number):
    arguments = ["-o", str(tmp_path / name), "--trajectory", "static", "--duration", "40h"]
    if name == "y":
        arguments += ["--storage", "sqlite3"]
    process = subprocess.Popen([*COMMAND, *arguments], stderr=subprocess.PIPE, text=True)
    until(lambda: any(f.is_file() and f.stat().st_size > 10**7 for f in tmp_path.rglob("*")))
    process.send_signal(number)
    error = process.communicate(timeout=300)[1]
    assert process.returncode != 0
    part = (tmp_path / name).with_name(f"{Path(name).stem}.partial{Path(name).suffix}")
    truth = f"{Path(name).stem}.partial_truth.yaml"
    assert sorted(os.listdir(tmp_path)) == sorted([part.name, truth])
    assert error.rstrip().endswith(f", with {truth}")
    load_simulation(files.load(tmp_path / truth))
    t_ns = read_imu(part).t_ns
    # Readings and truth; a file of readings has these only.
    count = len(t_ns) * (1 if name == "x.csv" else 2)
    assert f"{part}: {count:,} " in error
    assert f"up to stamp {t_ns[-1] / 1e9:.9f} s" in error
    assert len(t_ns) > 1000
    assert np.all(np.diff(t_ns) == 5_000_000)


def _limit_file_size():
    resource.setrlimit(resource.RLIMIT_FSIZE, (3_000_000, 3_000_000))


@pytest.mark.parametrize("name", ["x.mcap", "x.bag", "x", "y", "x.csv"])
def test_a_full_disk_is_said_in_a_line_and_nothing_looks_whole(tmp_path, name):
    arguments = ["-o", str(tmp_path / name), "--trajectory", "static", "--duration", "1h"]
    if name == "y":
        arguments += ["--storage", "sqlite3"]
    result = subprocess.run(
        [*COMMAND, *arguments],
        preexec_fn=_limit_file_size,
        capture_output=True,
        text=True,
        check=False,
        timeout=300,
    )
    assert result.returncode == 1, result.stderr
    assert "Traceback" not in result.stderr
    assert len(result.stderr.splitlines()) == 1
    assert os.listdir(tmp_path) == []

    assert len(result.stderr.splitlines()) <= 2
    output = tmp_path / name
    assert not output.exists() or (output.is_dir() and not (output / "metadata.yaml").exists())


def test_increments_of_an_averaged_sensor_are_in_the_bag(tmp_path: Path) -> None:
    """Read back by another library: the mean readings times the interval, in whole steps."""
    from rosbags.highlevel import AnyReader
    from rosbags.typesys import Stores, get_typestore

    topics = "imu/data_raw,imu/delta_angle,imu/delta_velocity,ground_truth/delta_velocity"
    bag = tmp_path / "bag.mcap"
    chosen = ["--set", "imu.sampling=averaged", "--set", "imu.gyroscope_increment_resolution=1e-5"]
    arguments = ["-o", str(bag), "--duration", "2s", "--topics", topics, "--quiet", *chosen]
    assert main(arguments) == 0
    arrays_by_topic: dict[str, list[np.ndarray]] = {}
    with AnyReader([bag], default_typestore=get_typestore(Stores.ROS2_JAZZY)) as reader:
        for connection, _, raw in reader.messages():
            message = reader.deserialize(raw, connection.msgtype)
            vector = getattr(message, "vector", None) or message.angular_velocity
            arrays_by_topic.setdefault(connection.topic, []).append([vector.x, vector.y, vector.z])
    assert {len(rows) for rows in arrays_by_topic.values()} == {400}
    angles = np.array(arrays_by_topic["/imu/delta_angle"])
    np.testing.assert_allclose(
        angles, np.array(arrays_by_topic["/imu/data_raw"]) / 200.0, rtol=1e-12
    )
    np.testing.assert_allclose(angles / 1e-5, np.rint(angles / 1e-5), atol=1e-6)
    block = Body(load_simulation({"imu.sampling": "averaged"})).next(400)["imu"]
    np.testing.assert_allclose(
        arrays_by_topic["/ground_truth/delta_velocity"], block.ideal_accel / 200.0, rtol=1e-12
    )


def test_increments_of_instants_are_refused(tmp_path: Path, capsys) -> None:
    bag = tmp_path / "bag.mcap"
    assert main(["-o", str(bag), "--duration", "2s", "--topics", "imu/delta_angle"]) == 2
    assert "topic imu/delta_angle: needs imu.sampling averaged" in capsys.readouterr().err
    assert not bag.exists()
