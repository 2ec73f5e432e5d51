# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""The folder of vio_data_simulation, written and read by every program that takes readings."""

import json

import numpy as np
import pytest

import imu_sim_ros as ims
from imu_sim_ros.bags.text import vio_data_simulation as form
from imu_sim_ros.commands import allan, convert_bag, dead_reckon, evaluate, generate
from imu_sim_ros.core.errors import InputError
from imu_sim_ros.core.rotation import rotate


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    path = tmp_path_factory.mktemp("sim") / "sim"
    scene = ["--camera", "vio_data_simulation", "--scene", "house", "--trajectory", "lecture"]
    arguments = ["--format", "vio_data_simulation", "--duration", "20s", "--quiet", "--seed", "3"]
    assert generate.main(["-o", str(path), *arguments, *scene]) == 0
    return path


def run(program, capsys, *arguments):
    assert program.main([*map(str, arguments), "--json", "--quiet"]) == 0
    return json.loads(capsys.readouterr().out)


def test_the_truth_dead_reckons_to_its_end(folder, capsys):
    """The midpoint method on ideal readings is 1.3 mm off after 20 s."""
    true = run(dead_reckon, capsys, folder / "imu_pose.txt")
    assert true["samples"] == 4000
    assert true["final_position_error_m"] < 2e-3
    noisy = run(dead_reckon, capsys, folder)
    assert noisy == run(dead_reckon, capsys, folder / "imu_pose_noise.txt")
    assert noisy["truth_coverage"] == 1.0
    assert noisy["final_position_error_m"] > 1.0


def test_velocities_are_those_of_the_motion(folder):
    states = form.read_states(folder)
    t = (states.t_ns - states.t_ns[0]) * 1e-9
    motion = ims.simulate(trajectory="lecture", imu="perfect", duration=20, rate=200)
    np.testing.assert_allclose(states.velocity, motion.truth.velocity, atol=2e-4)
    np.testing.assert_allclose(states.position, motion.truth.position, atol=1e-9)
    assert t[-1] == pytest.approx(19.995)


def test_six_digits_as_the_original_writes_them_are_enough(folder, tmp_path, capsys):
    """A C++ stream writes six digits: 5e-5 m in positions of 10 m to 100 m."""
    for name in ("imu_pose.txt", "imu_pose_noise.txt"):
        rows = np.loadtxt(folder / name)
        np.savetxt(tmp_path / name, rows, fmt="%.6g")
    result = run(dead_reckon, capsys, tmp_path / "imu_pose.txt")
    assert result["final_position_error_m"] < 0.02


def test_the_integrated_poses_are_those_of_the_original(folder, capsys):
    """Euler, with the reading at the end of each interval, is 1.04 m off after 20 s."""
    truth = folder / "imu_pose.txt"
    result = run(evaluate, capsys, folder / "imu_int_pose.txt", truth, "--align", "none")
    assert result["ate_m"]["max"] == pytest.approx(1.04, abs=0.01)
    rows, ideal = np.loadtxt(folder / "imu_int_pose.txt"), np.loadtxt(truth)
    assert rows.shape == (3999, 15)
    assert np.array_equal(rows[:, 1:8], rows[:, 8:])
    # One step, written down again (src/imu.cpp, testImu).
    velocity = form.read_states(folder).velocity[0]
    gravity = np.array([0.0, 0.0, -9.81])
    acceleration = rotate(ideal[0, 1:5], ideal[1, 11:14]) + gravity
    velocity = velocity + acceleration * 0.005
    position = ideal[0, 5:8] + velocity * 0.005 + 0.5 * 0.005**2 * acceleration
    np.testing.assert_allclose(rows[0, 5:8], position, atol=2e-6)
    noisy = run(evaluate, capsys, folder / "imu_int_pose_noise.txt", folder, "--align", "none")
    assert noisy["ate_m"]["max"] > 5.0


@pytest.mark.parametrize("name", ["", "imu_pose_noise.txt"])
def test_a_bag_of_the_folder_has_readings_and_truth(folder, tmp_path, capsys, name):
    target = tmp_path / "flight.mcap"
    result = run(convert_bag, capsys, folder / name, "-o", target)
    assert result["messages"]["/imu/data_raw"] == 4000
    assert result["messages"]["/ground_truth/odom"] == 4000
    readings, rows = ims.read_imu(target), np.loadtxt(folder / "imu_pose_noise.txt")
    assert np.array_equal(readings.gyro, rows[:, 8:11])
    assert np.array_equal(readings.accel, rows[:, 11:14])
    states = ims.read_states(target)
    np.testing.assert_array_equal(
        states.angular_velocity, np.loadtxt(folder / "imu_pose.txt")[:, 8:11]
    )
    assert not any("twist" in finding.kind for finding in ims.inspect(target).findings)
    assert run(dead_reckon, capsys, target)["final_position_error_m"] == pytest.approx(
        run(dead_reckon, capsys, folder)["final_position_error_m"], rel=1e-6
    )


def test_allan_finds_the_noise_of_the_folder(tmp_path, capsys):
    path = tmp_path / "still"
    arguments = ["--format", "vio_data_simulation", "--trajectory", "static", "--duration", "2min"]
    scene = ["--camera", "vio_data_simulation", "--scene", "house", "--set", "camera.rate=0.1"]
    assert generate.main(["-o", str(path), *arguments, *scene, "--quiet"]) == 0
    noise = run(allan, capsys, path, "-o", tmp_path / "results")["gyroscope"]["noise_density"]
    # 0.015 rad/s/sqrt(Hz) is in the 95 % intervals of at least two of three axes.
    covered = [low <= 0.015 <= high for low, high in zip(noise["low"], noise["high"], strict=True)]
    assert sum(covered) >= 2


def test_poses_alone_have_no_readings(folder):
    with pytest.raises(InputError, match=r"imu_int_pose.txt: contains poses only"):
        ims.read_imu(folder / "imu_int_pose.txt")


def test_bad_rows_are_lines(folder, tmp_path):
    lines = (folder / "imu_pose_noise.txt").read_text().splitlines()
    lines[10] = lines[10] + " 1"
    lines[20] = lines[20].replace(".", "x", 1)
    lines[30], lines[31] = lines[31], lines[30]
    path = tmp_path / "imu_pose_noise.txt"
    path.write_text("\n".join(lines))
    with pytest.raises(InputError) as caught:
        ims.read_imu(path)
    problems = "\n".join(caught.value.problems)
    assert "line 11: 15 columns; expected 14" in problems
    assert "line 21: not a row of numbers" in problems
    assert "line 32: the stamp is 0.005 s before that of an earlier line" in problems
    with pytest.warns(UserWarning, match="3 bad rows skipped"):
        assert len(ims.read_imu(path, skip_bad_rows=True)) == 3997


def test_rows_of_openvins_in_the_form_of_tum_stay_what_they_are(tmp_path):
    """Rows of OpenVINS have 14 columns, too: t, p, q x y z w, and six more."""
    path = tmp_path / "estimate.txt"
    path.write_text("1 1 0 0 0 0 0 1 0 0 0 0 0 0\n2 0 1 0 0 0 0 1 0 0 0 0 0 0\n")
    assert not form.is_source(path)
