# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""The realised truth next to a bag, and one parameter file for node and command."""

import json
from pathlib import Path

import numpy as np
import pytest

import imu_sim_ros as ims
from imu_sim_ros.bags.read import read_imu
from imu_sim_ros.bags.recorder_parameters import RecorderParameters
from imu_sim_ros.commands import calibrate, dead_reckon, generate
from imu_sim_ros.core.errors import Problems
from imu_sim_ros.jobs.generate import run_parameters
from imu_sim_ros.jobs.writing import Journal
from imu_sim_ros.parameters import files
from imu_sim_ros.parameters.sections import build
from imu_sim_ros.simulation.parameters import load_simulation
from imu_sim_ros.simulation.playback import load_simulator

SHORT = ["--duration", "0.1s", "--quiet"]


def test_the_truth_of_a_run_has_what_its_seed_drew(tmp_path):
    """The same unit again, with nothing to draw, reads the same: its truth is the realised one."""
    bag = str(tmp_path / "run.mcap")
    quiet = [f"--set=imu.{t}_{key}=0" for t in ("gyroscope", "accelerometer")
             for key in ("noise_density", "bias_instability", "resolution")]  # fmt: skip
    options = ["--imu", "mpu6000", "--trajectory", "lecture", "--seed", "7", *SHORT, *quiet]
    assert generate.main([*options, "-o", bag]) == 0
    truth = tmp_path / "run_truth.yaml"
    imu = load_simulation(files.load(truth)).imu
    assert imu.gyroscope.turn_on_bias_sigma == (0.0,) * 3
    assert np.abs(imu.gyroscope.bias).min() > 0.0
    again = str(tmp_path / "again.mcap")
    options = ["--imu", str(truth), "--trajectory", "lecture", "--seed", "8", *SHORT]
    assert generate.main([*options, "-o", again]) == 0
    readings, repeated = read_imu(bag), read_imu(again)
    np.testing.assert_allclose(readings.gyro, repeated.gyro, rtol=0, atol=1e-12)
    np.testing.assert_allclose(readings.accel, repeated.accel, rtol=0, atol=1e-12)


@pytest.mark.parametrize(
    ("output", "name"),
    [
        ("a.bag", "a_truth.yaml"),
        ("b.csv", "b_truth.yaml"),
        ("v1.2", "v1.2_truth.yaml"),
        ("c.tum", None),
    ],
)
def test_names_of_the_truth(tmp_path, output, name):
    assert generate.main(["-o", str(tmp_path / output), *SHORT]) == 0
    truth_files = [path.name for path in tmp_path.glob("*_truth.yaml")]
    assert truth_files == ([name] if name else [])


def test_an_existing_truth_is_refused_before_any_work(tmp_path, capsys):
    (tmp_path / "a_truth.yaml").write_text("mine")
    assert generate.main(["-o", str(tmp_path / "a.mcap"), *SHORT]) == 2
    assert "a_truth.yaml" in capsys.readouterr().err
    assert (tmp_path / "a_truth.yaml").read_text() == "mine"
    assert not (tmp_path / "a.mcap").exists()


def test_a_correct_calibration_is_not_thousands_of_errors_off(tmp_path, capsys):
    bag = str(tmp_path / "six.mcap")
    options = ["--imu", "mpu6000", "--trajectory", "six_position", "--quiet", "-o", bag]
    assert generate.main(options) == 0
    options = ["six_position", bag, "--no-files", "--json", "--truth"]
    assert calibrate.main([*options, str(tmp_path / "six_truth.yaml")]) == 0
    bias = json.loads(capsys.readouterr().out)["parameters"]["accelerometer_bias"]
    value, truth, sigma = (np.array(bias[key]) for key in ("value", "truth", "sigma"))
    # Normal errors are below 5 sigma in all three axes but once in half a million times.
    assert (np.abs(value - truth) < 5.0 * sigma).all()
    assert np.abs(truth).min() > 100.0 * sigma.max()  # the turn-on bias is what would be off


def shipped():
    folder = files.config_folder()
    return [
        folder / "simulator.yaml",
        *(files.find("imus", name) for name in files.names("imus")),
        *(files.find("trajectories", name) for name in files.names("trajectories")),
    ]


@pytest.mark.parametrize("path", shipped(), ids=lambda path: path.stem)
def test_every_shipped_file_of_the_simulator_serves_generate(tmp_path, path):
    """The node's own loader is the command's: what one accepts, the other does."""
    arguments = ["--params-file", str(path), "-o", str(tmp_path / "a.mcap"), *SHORT]
    assert generate.main(arguments) == 0


DUMP = Path(__file__).parents[2] / "data" / "launch" / "param_dump.yaml"
"""Taken by the real ``ros2 param dump`` of a running simulator with imu/data_raw:=/imu0."""


def test_a_dump_of_a_running_simulator_serves_generate(tmp_path, capsys):
    """ROS's own parameters and overrides of QoS are noted; the samples are those of the node's."""
    dumped, plain = tmp_path / "dumped.mcap", tmp_path / "plain.mcap"
    arguments = ["--duration", "0.5s", "-o"]
    assert generate.main(["--params-file", str(DUMP), *arguments, str(dumped)]) == 0
    (note,) = capsys.readouterr().err.splitlines()
    for name in ("qos_overrides", "use_sim_time", "start_type_description_service", "autostart"):
        assert f" {name}" in note
    assert note.count("qos_overrides") == 1
    values = files.load(DUMP)
    sets = [f"--set={name}={json.dumps(value)}" for name, value in values.items()
            if name.startswith(("imu.", "trajectory.")) and value not in ([], "")]  # fmt: skip
    assert generate.main([*sets, "--quiet", *arguments, str(plain)]) == 0
    readings, repeated = read_imu(dumped), read_imu(plain)
    np.testing.assert_array_equal(readings.gyro, repeated.gyro)
    np.testing.assert_array_equal(readings.accel, repeated.accel)
    flight = ims.simulate(params_file=DUMP, duration=0.5)
    np.testing.assert_array_equal(flight.gyro, readings.gyro)


def everything():
    folder = files.config_folder()
    return sorted(
        path for name in ("imus", "trajectories", "cameras", "scenes")
        for path in (folder / name).glob("*.yaml")
    )  # fmt: skip


@pytest.mark.parametrize("path", everything(), ids=lambda path: f"{path.parent.name}/{path.stem}")
def test_every_shipped_file_is_understood_by_node_and_command(path):
    """Both take it by ``--params-file``; a file for cameras comes with a camera."""
    cameras = {"cameras": ["cam0"]} if path.parent.name in ("cameras", "scenes") else {}
    settings = {**files.load(path, "simulator"), **cameras}
    load_simulator(settings)
    layers, _ = run_parameters(Journal(), Problems(), path, {"parameters": cameras})
    body = load_simulator(layers)
    assert (body.rig is not None) == bool(cameras)


def test_what_concerns_the_node_alone_is_said(tmp_path, capsys):
    file = files.config_folder() / "simulator.yaml"
    arguments = ["--params-file", str(file), "-o", str(tmp_path / "a.mcap"), "--duration", "0.1s"]
    assert generate.main(arguments) == 0
    (line,) = [line for line in capsys.readouterr().err.splitlines() if "no effect" in line]
    assert "real_time_factor" in line
    assert "publish.clock_rate" in line
    assert "imu.preset" not in line
    bad = ["--set", "publish.clock_rate=-1", "-o", str(tmp_path / "b.mcap"), *SHORT]
    assert generate.main(bad) == 2
    assert "publish.clock_rate = -1" in capsys.readouterr().err


def test_the_integrators_and_recorders_files_serve_their_commands(tmp_path, capsys):
    bag = str(tmp_path / "a.mcap")
    assert generate.main(["-o", bag, "--duration", "1s", "--quiet"]) == 0
    file = files.config_folder() / "integrator.yaml"
    assert dead_reckon.main([bag, "--params-file", str(file), "--json"]) == 0
    assert json.loads(capsys.readouterr().out)["samples"] == 200
    recorder = files.load(files.config_folder() / "recorder.yaml", "recorder")
    assert build(RecorderParameters, recorder).compression == "none"


def test_outputs_of_one_name_share_the_truth_of_one_unit(tmp_path, capsys):
    """``x.bag`` next to ``x.mcap``: the same sensor and seed have one truth, which stays."""
    place = str(tmp_path / "x")
    assert generate.main(["--imu", "mpu6000", "-o", f"{place}.mcap", *SHORT]) == 0
    truth = tmp_path / "x_truth.yaml"
    original = truth.read_bytes(), truth.stat().st_mtime_ns
    for name in ("x.bag", "x", "x.csv"):
        assert generate.main(["--imu", "mpu6000", "-o", str(tmp_path / name), *SHORT]) == 0
        assert (truth.read_bytes(), truth.stat().st_mtime_ns) == original
    assert capsys.readouterr().err == ""


@pytest.mark.parametrize("force", [[], ["--force"]])
@pytest.mark.parametrize("second", ["x.bag", "x.csv", "x"])
def test_a_truth_that_another_output_relies_on_is_never_replaced(tmp_path, capsys, force, second):
    place = str(tmp_path / "x")
    assert generate.main(["--imu", "mpu6000", "-o", f"{place}.mcap", *SHORT]) == 0
    original = (tmp_path / "x_truth.yaml").read_bytes()
    options = ["--imu", "mpu6000", "--seed", "7", *SHORT, *force]
    assert generate.main([*options, "-o", str(tmp_path / second)]) == 2
    (line,) = capsys.readouterr().err.splitlines()
    assert "x_truth.yaml: is the truth of" in line
    assert "x.mcap" in line
    assert (tmp_path / "x_truth.yaml").read_bytes() == original
    assert {path.name for path in tmp_path.iterdir()} == {"x.mcap", "x_truth.yaml"}


def test_a_truth_is_replaced_with_its_own_output(tmp_path):
    place = str(tmp_path / "x.mcap")
    assert generate.main(["--imu", "mpu6000", "-o", place, *SHORT]) == 0
    original = (tmp_path / "x_truth.yaml").read_bytes()
    again = ["--imu", "mpu6000", "--seed", "7", "-o", place, *SHORT]
    assert generate.main(again) == 2
    assert generate.main([*again, "--force"]) == 0
    assert (tmp_path / "x_truth.yaml").read_bytes() != original
