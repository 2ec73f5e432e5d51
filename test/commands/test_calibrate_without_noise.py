# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Readings without noise: exact parameters, no structure of rounding, no failure."""

import json

import numpy as np
import pytest
import yaml

from imu_sim_ros.calibration.deterministic.steady import find_steady
from imu_sim_ros.calibration.record import Record
from imu_sim_ros.commands import allan, calibrate, generate
from imu_sim_ros.core.records import Readings

FULL = {
    "preset": "perfect",
    "accelerometer_scale_error_percent": [1.0, -2.0, 0.5],
    "accelerometer_misalignment_percent": [0.3, -0.4, 0.5, 0.6, -0.7, 0.8],
    "accelerometer_bias": [0.1, 0.2, -0.3],
    "gyroscope_bias": [0.01, -0.02, 0.03],
    "gyroscope_misalignment_percent": [0.3, -0.4, 0.5, 0.6, -0.7, 0.8],
    "gyroscope_g_sensitivity": [1e-3, 0.0, 2e-3, 0.0, -1e-3, 0.0, 3e-4, 0.0, 1e-3],
}


def record(folder, trajectory, imu):
    """Generate a run; returns the arguments of calibrate."""
    file = folder / "sensor.yaml"
    file.write_text(yaml.safe_dump({"/**": {"ros__parameters": {"imu": imu}}}))
    bag = str(folder / "run.mcap")
    options = ["--imu", str(file), "--trajectory", trajectory, "--quiet"]
    assert generate.main([*options, "-o", bag]) == 0
    return [trajectory, bag, "--truth", str(file)]


def run(folder, capsys, trajectory, imu):
    """Generate a run and return what calibrate finds."""
    assert calibrate.main([*record(folder, trajectory, imu), "--no-files", "--json"]) == 0
    return json.loads(capsys.readouterr().out)["parameters"]


@pytest.mark.parametrize("imu", [{"preset": "perfect"}, FULL], ids=["perfect", "errors"])
@pytest.mark.parametrize("trajectory", ["six_position", "turntable"])
def test_without_noise_the_result_is_exact(tmp_path, capsys, trajectory, imu):
    calibration = run(tmp_path, capsys, trajectory, imu)
    for name, parameter in calibration.items():
        assert parameter["sigma"] == [0.0] * len(parameter["value"]), name
        # The mean of thousands of float64 of size 10 has fifteen digits at best.
        np.testing.assert_allclose(parameter["value"], parameter["truth"], rtol=0, atol=1e-14)


def test_what_is_printed_and_drawn_is_quiet(tmp_path, capsys):
    options = record(tmp_path, "six_position", FULL)
    assert calibrate.main([*options, "-o", str(tmp_path / "out")]) == 0
    printed = capsys.readouterr()
    assert "e-" not in printed.out
    table = printed.out.partition("Accelerometer:")[2].splitlines()
    rows = [line.split() for line in table if line.startswith(("  scale", "  bias"))]
    assert len(rows) == 12
    assert {row[-1] for row in rows} == {"0.0"}
    assert printed.err == ""


def test_without_noise_the_drift_with_temperature_is_no_motion():
    """Two positions without noise, warming up: 1.6e-5 m/s^2 from window to window."""
    count = 4000
    drift = 3.2e-5 * np.arange(count)[:, None] * 0.005 * np.array([1.0, 0.5, 2.0])
    accel = np.where(np.arange(count)[:, None] < 2000, [0.0, 0.0, 9.81], [0.0, 0.0, -9.81])
    t_ns = 10**9 + 5_000_000 * np.arange(count)
    steady = find_steady(t_ns, 0.1 * drift, accel + drift)
    assert steady.stretches == 2
    assert steady.duration.sum() > 15.0


def test_rounding_is_no_noise_to_allan(tmp_path, capsys):
    """The resting readings of a turned perfect sensor differ in the last digit, at most."""
    bag = str(tmp_path / "rest.mcap")
    options = ["--imu", "perfect", "--trajectory", "static", "--duration", "2min", "--quiet"]
    tilt = "trajectory.roll_pitch_yaw=[0.3, -0.2, 0.1]"
    assert generate.main([*options, "--set", tilt, "-o", bag]) == 0
    assert allan.main([bag, "--no-files"]) == 2
    errors = capsys.readouterr().err
    assert errors.count("no noise at all") == 6
    out = str(tmp_path / "out")
    assert allan.main([bag, "--skip-checks", "--json", "--truth", "perfect", "-o", out]) == 0
    calibration = json.loads(capsys.readouterr().out)
    for triad in ("gyroscope", "accelerometer"):
        assert calibration[triad]["noise_density"]["value"] == [None] * 3


@pytest.mark.parametrize("size", [0.0, 9.81, 1e3])
def test_a_change_in_the_last_digits_is_none(size):
    reading = np.full((2000, 3), size)
    reading[::3] = np.nextafter(size, np.inf) if size else 0.0
    record = Record()
    block = Readings(10**9 + 5_000_000 * np.arange(2000), reading, reading)
    for _ in record.at_rest([[block]]):
        pass
    assert record.constant_axes() == [0, 1, 2, 3, 4, 5]
