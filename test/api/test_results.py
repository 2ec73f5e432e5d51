# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Dead reckoning, evaluation, Allan, calibration and preintegration through the front door."""

import json

import numpy as np
import pytest

import imu_sim_ros as ims
from imu_sim_ros.commands.allan import main as allan
from imu_sim_ros.commands.dead_reckon import main as dead_reckon


def test_dead_reckoning_is_the_commands(tmp_path, capsys):
    flight = ims.simulate(imu="mpu9250", trajectory="lecture", duration=20, seed=5)
    bag = flight.save(tmp_path / "lecture.mcap")
    for method in ("euler", "midpoint", "rk4"):
        assert dead_reckon([str(bag), "--method", method, "--json"]) == 0
        program_output = json.loads(capsys.readouterr().out)
        for source in (flight, bag):
            evaluation = ims.evaluate(ims.dead_reckon(source, method=method), flight.truth)
            # The bag's truth has its velocity turned to the body and back: 1e-14 m/s at the start.
            assert evaluation.final_position == pytest.approx(
                program_output["final_position_error_m"], abs=1e-9
            )
            assert evaluation.rms_position == pytest.approx(
                program_output["rms_position_error_m"], abs=1e-9
            )
            assert evaluation.final_attitude == pytest.approx(
                program_output["final_attitude_error_rad"], abs=1e-9
            )


def test_the_start_is_the_truth_level_or_given():
    flight = ims.simulate(imu="tactical", trajectory="static", duration=30, seed=2)
    assert ims.evaluate(ims.dead_reckon(flight), flight.truth).position[0] @ np.ones(3) == 0.0
    levelled = ims.dead_reckon(flight, initial="level", level_time=5.0)
    assert len(levelled) == len(flight) - 1000
    state = ims.NavigationState(np.ones(3), np.zeros(3), np.array([1.0, 0.0, 0.0, 0.0]))
    np.testing.assert_array_equal(ims.dead_reckon(flight, initial=state).position[0], 1.0)
    readings = ims.Readings(flight.t_ns, flight.gyro, flight.accel)
    assert ims.dead_reckon(readings, initial="parameters").truth is None
    with pytest.raises(ims.InputError, match="no truth"):
        ims.dead_reckon(readings, initial="truth")
    with pytest.raises(ims.ConfigurationError, match="level_tim"):
        ims.dead_reckon(readings, level_tim=3.0)


def test_evaluation_aligns_and_gives_relative_errors():
    flight = ims.simulate(imu="perfect", trajectory="figure_eight", duration=30)
    track = ims.dead_reckon(flight)
    shifted = track.position + np.array([1.0, 2.0, 3.0])
    moved = ims.States(track.t_ns, shifted, track.q_wb, track.velocity)
    evaluation = ims.evaluate(moved, flight.truth)
    assert evaluation.rms_position == pytest.approx(14.0**0.5, abs=0.01)
    assert ims.evaluate(moved, flight.truth, align="yaw").rms_position < 0.01
    assert evaluation.relative(1.0, "s").translation.max() < 0.01


def test_allan_is_the_commands_and_covers_the_truth(tmp_path, capsys):
    flight = ims.simulate(imu="adis16448", trajectory="static", duration="20min", rate=50, seed=4)
    noise = ims.allan(flight)
    bag = flight.save(tmp_path / "rest.mcap", imu_only=True)
    assert allan([str(bag), "--json", "--no-files"]) == 0
    program_output = json.loads(capsys.readouterr().out)
    for triad in ("gyroscope", "accelerometer"):
        for key in ("noise_density", "random_walk", "bias_instability"):
            coefficient = getattr(getattr(noise, triad), key)
            for side in ("low", "high"):
                np.testing.assert_allclose(
                    getattr(coefficient, side), program_output[triad][key][side], rtol=1e-9
                )
            values = [np.nan if v is None else v for v in program_output[triad][key]["value"]]
            np.testing.assert_allclose(coefficient.value, values, rtol=1e-9)
    assert noise.save(tmp_path / "one.png").read_bytes()[:4] == b"\x89PNG"
    assert allan([str(bag), str(bag), "-o", str(tmp_path / "two"), "--quiet"]) == 0
    both = ims.allan([bag, bag])
    assert both.duration == 2.0 * noise.duration
    folder = both.save(tmp_path / "both")
    assert sorted(file.name for file in folder.iterdir()) == list(both.files)
    for name in set(both.files) - {"allan.png"}:
        assert (folder / name).read_text() == (tmp_path / "two" / name).read_text()
    # 18 intervals of 95 % that are not independent: half of them miss by a mistake only.
    covered = [comparison.covered for comparison in noise.compare("adis16448")]
    assert sum(covered) > len(covered) / 2
    kalibr = noise.save(tmp_path / "imu.yaml").read_text()
    assert "gyroscope_noise_density" in kalibr
    assert "rad/s/sqrt(Hz)" in repr(noise.gyroscope.noise_density)


def test_calibration_gives_back_what_went_in(tmp_path):
    imu = {
        "preset": "perfect",
        "accelerometer_bias": [0.1, -0.2, 0.05],
        "accelerometer_scale_error_percent": [1.0, -1.0, 0.5],
        "gyroscope_bias": [0.01, 0.02, -0.01],
    }
    calibration = ims.calibrate_six_position(ims.simulate(imu=imu, trajectory="six_position"))
    np.testing.assert_allclose(calibration.accelerometer.bias.value, [0.1, -0.2, 0.05], atol=1e-6)
    matrix = calibration.accelerometer.scale_misalignment.value.reshape(3, 3)
    np.testing.assert_allclose(matrix, np.diag([1.01, 0.99, 1.005]), atol=1e-6)
    # The file is the integrator's: what it corrects is perfect again.
    file = calibration.save(tmp_path / "correction.yaml")
    flight = ims.simulate(imu=imu, trajectory="circle", duration=10)
    track = ims.dead_reckon(flight, calibration=str(file))
    assert ims.evaluate(track, flight.truth).final_position < 1e-3
    with pytest.raises(AttributeError, match="this run does not determine it"):
        _ = calibration.gyroscope.scale_misalignment
    with pytest.raises(ims.InputError, match="rates"):
        ims.calibrate_turntable(flight.readings)


def test_preintegration_is_dead_reckoning_without_gravity():
    """``p_j = p_i + v_i T + g T^2 / 2 + R_i alpha`` over every interval."""
    flight = ims.simulate(imu="perfect", trajectory="figure_eight", duration=10, rate=200)
    preintegrated = ims.preintegrate(flight, every=0.5)
    truth, rows = flight.truth, np.arange(0, 2000, 100)
    begin_rows, end_rows = rows[:-1], rows[1:]
    g, t = np.array([0.0, 0.0, -9.81]), 0.5
    from imu_sim_ros.core.rotation import rotate

    alpha = rotate(truth.q_wb[begin_rows], preintegrated.alpha)
    predicted = truth.position[begin_rows] + truth.velocity[begin_rows] * t + 0.5 * g * t**2 + alpha
    # Midpoint at 200 Hz: h^2 / 12 of the jerk (below 30 m/s^3) over 0.5 s, twice integrated.
    np.testing.assert_allclose(predicted, truth.position[end_rows], rtol=0, atol=1e-5)
    for arguments in ({}, {"edges_ns": truth.t_ns[rows], "every": 0.5}):
        with pytest.raises(ims.InputError):
            ims.preintegrate(flight, **arguments)
    with pytest.raises(ims.ConfigurationError, match="every = 0.0"):
        ims.preintegrate(flight, every=0.0)


def test_a_gap_in_the_readings_is_not_preintegrated_over():
    """3 s without readings were integrated with the mean of both ends, without a word."""
    flight = ims.simulate(imu="perfect", trajectory="figure_eight", duration=10, rate=100)
    flight_readings, keep = flight.readings, np.r_[0:300, 600:1000]
    readings = ims.Readings(
        flight_readings.t_ns[keep], flight_readings.gyro[keep], flight_readings.accel[keep]
    )
    with pytest.raises(ims.InputError, match="1 gaps are longer than max_gap = 0.1 s"):
        ims.preintegrate(readings, every=0.5)
    after_gap = ims.preintegrate(readings, flight_readings.t_ns[[700, 800, 900]])
    np.testing.assert_array_equal(
        after_gap.alpha, ims.preintegrate(flight, flight_readings.t_ns[[700, 800, 900]]).alpha
    )
    assert len(ims.preintegrate(readings, every=0.5, max_gap=3.5).alpha) == 19


def test_a_notebook_shows_a_figure_without_pyplot():
    flight = ims.simulate(imu="perfect", trajectory="circle", duration=1)
    for figure in (flight.plot(), ims.dead_reckon(flight).plot()):
        assert figure._repr_png_().startswith(b"\x89PNG\r\n")


def test_calibration_of_a_bag_needs_nothing_that_the_bag_has(tmp_path):
    """Rates from its truth, temperatures from its topic, the accelerometer from another run."""
    imu = {"preset": "perfect", "gyroscope_bias": [0.01, 0.02, -0.01]}
    six = ims.calibrate_six_position(ims.simulate(imu=imu, trajectory="six_position"))
    table, soak = tmp_path / "table.mcap", tmp_path / "soak.mcap"
    ims.generate(table, imu=imu, trajectory="turntable", rate=50)
    turned = ims.calibrate_turntable(table, accelerometer=six)
    np.testing.assert_allclose(turned.gyroscope.bias.value, imu["gyroscope_bias"], atol=1e-6)
    assert turned.facts["rates"] == pytest.approx([0.0, 0.5, 1.0, 2.0], abs=1e-4)
    topics = ["imu/data_raw", "imu/temperature"]
    ims.generate(soak, imu=imu, trajectory="temperature_soak", rate=20, topics=topics)
    soaked = ims.calibrate_temperature(soak)
    assert soaked.facts["temperature_degC"] == pytest.approx([-20.0, 60.0], abs=0.5)
    bias_output = soaked.to_dict("perfect")["parameters"]["gyroscope_bias"]
    np.testing.assert_allclose(bias_output["value"], imu["gyroscope_bias"], atol=1e-6)
    assert bias_output["truth"] == [0.0, 0.0, 0.0]
    for calibration in (six, turned, soaked):
        picture = calibration.save(tmp_path / f"{calibration.kind}.png")
        assert picture.read_bytes()[:4] == b"\x89PNG"


def test_a_bag_is_dead_reckoned_as_the_program_does(tmp_path, capsys):
    """Same numbers through both doors, skipped seconds and a level start with the truth's yaw."""
    from imu_sim_ros.commands import dead_reckon

    bag = tmp_path / "flight.mcap"
    lead_in = {"lead_in": {"rest": 3.0}}
    ims.generate(bag, imu="mpu6000", trajectory={"type": "circle", **lead_in}, duration=10, seed=1)
    program_arguments = [
        "--initial-state",
        "level",
        "--set",
        "level_time=1.0",
        "--skip",
        "1s",
        "--json",
    ]
    assert dead_reckon.main([str(bag), *program_arguments]) == 0
    program_output = json.loads(capsys.readouterr().out)
    track = ims.dead_reckon(bag, initial="level", level_time=1.0, skip=1.0)
    assert json.loads(json.dumps(track.to_dict())) == program_output
    assert track.truth is not None
    start = np.searchsorted(track.truth.t_ns, track.t_ns[0])
    np.testing.assert_allclose(track.position[0], track.truth.position[start], atol=1e-6)
    with pytest.raises(ims.InputError, match="no topic|holds no|/nowhere"):
        ims.dead_reckon(bag, truth_topic="/nowhere")
    assert track.save(tmp_path / "track.csv").read_text().startswith("#timestamp,p_RS_R_x [m]")


def test_the_working_folder_is_a_recording_like_any_other(tmp_path, monkeypatch):
    folder = tmp_path / "euroc"
    ims.generate(folder, duration=1, format="euroc", rate=100)
    monkeypatch.chdir(folder)
    assert ims.read_imu(".").source == "euroc"
    assert len(ims.dead_reckon(".")) == 100
    with pytest.raises(ims.InputError, match="nearest|at least|0 readings|rest"):
        ims.calibrate_six_position(".")


def test_evaluation_of_a_bag_is_that_of_the_program(tmp_path, capsys):
    from imu_sim_ros.commands import evaluate

    flight = ims.simulate(imu="tactical", trajectory="figure_eight", duration=20, seed=2)
    bag, path = flight.save(tmp_path / "flight.mcap"), tmp_path / "track.csv"
    ims.dead_reckon(flight).save(path)
    program_arguments = ["--align", "se3", "--time-offset", "--rpe", "2s", "--json"]
    assert evaluate.main([str(path), str(bag), *program_arguments]) == 0
    program_output = json.loads(capsys.readouterr().out)
    evaluation = ims.evaluate(path, bag, align="se3", time_offset=True)
    mine = json.loads(json.dumps(evaluation.to_dict([(2.0, "s")])))
    assert mine == {name: program_output[name] for name in mine}
    assert ims.evaluate(ims.dead_reckon(flight), bag).to_dict()["velocity_error_m_s"] is not None
    written = ims.evaluate(evaluation.save(tmp_path / "aligned.tum"), bag)
    np.testing.assert_allclose(written.rms_position, evaluation.rms_position, rtol=1e-6)


def test_what_holds_arrays_prints_as_one_line():
    """A console shows what a function returns: a preintegration used to fill 463 lines."""
    flight = ims.simulate(imu="perfect", trajectory="lecture", duration=2)
    block = next(ims.blocks(imu="perfect", trajectory="lecture", duration=2))
    pre = ims.preintegrate(flight, every=0.5)
    assert "covariance (3, 15, 15)" in repr(pre)
    truth = flight.truth
    poses = ims.PoseSequence(truth.t_ns, truth.position, truth.q_wb)
    assert repr(poses) == "<States states: 400 at 200 Hz, 1.995 s>"
    motion = flight.trajectory.sample(np.arange(3.0))
    for record in (pre, block, motion, poses):
        assert "\n" not in repr(record)
        assert len(repr(record)) < 600
