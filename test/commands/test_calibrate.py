# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""The command calibrate on simulated bags, end to end."""

import json
import math
from pathlib import Path

import numpy as np
import pytest

from imu_sim_ros.bags.sensor_tables import read_measured
from imu_sim_ros.commands import calibrate, generate
from imu_sim_ros.parameters import files
from imu_sim_ros.sensors.magnetometer.declaration import SENSOR

FLAWS = """
/**:
  ros__parameters:
    imu:
      preset: perfect
      gyroscope_noise_density: 1.7e-4
      accelerometer_noise_density: 2.0e-3
      gyroscope_bias: [0.01, -0.02, 0.03]
      accelerometer_bias: [0.1, -0.2, 0.05]
      accelerometer_scale_error_percent: [2.0, -1.5, 1.0]
      gyroscope_scale_error_percent: [1.0, -1.0, 0.5]
      gyroscope_temperature_bias: [2.0e-4, -1.0e-4, 3.0e-4]
"""


@pytest.fixture(scope="module")
def folder(tmp_path_factory) -> Path:
    """Return a folder with the flaws and a bag of each run, 50 Hz; 25 for the soak.

    A mean over some seconds is known as well at any rate: its variance is that of the density.
    """
    result = tmp_path_factory.mktemp("calibrate")
    (result / "flaws.yaml").write_text(FLAWS)
    for run in ("six_position", "turntable", "temperature_soak"):
        topics = "imu/data_raw,ground_truth/odom"
        topics += ",imu/temperature" if run == "temperature_soak" else ""
        arguments = ["--imu", str(result / "flaws.yaml"), "--trajectory", run]
        arguments += ["--rate", "25" if run == "temperature_soak" else "50"]
        arguments += ["--topics", topics, "--quiet", "-o", str(result / f"{run}.mcap")]
        assert generate.main(arguments) == 0
    return result


def calibrated(capsys, folder: Path, *arguments: str) -> dict:
    argv = [*arguments, "--json", "--no-files", "--truth", str(folder / "flaws.yaml")]
    assert calibrate.main(argv) == 0
    return json.loads(capsys.readouterr().out)


def refusal(capsys, *arguments: str, lines: int = 1) -> str:
    assert calibrate.main([*arguments, "--no-files"]) == 2
    message = capsys.readouterr().err
    assert message.count("\n") == lines
    return message


def close(result: dict, names: set[str]) -> None:
    """Assert that every value lies within four standard errors of its truth.

    Of n values, one lies beyond in 6.3e-5 n of all runs.
    """
    assert names <= set(result["parameters"])
    for values in result["parameters"].values():
        value, sigma, truth = (np.array(values[k]) for k in ("value", "sigma", "truth"))
        assert np.all(np.abs(value - truth) <= 4.0 * sigma)


def test_six_position_recovers_bias_and_scale_of_the_accelerometer(folder, capsys):
    result = calibrated(capsys, folder, "six_position", str(folder / "six_position.mcap"))
    close(result, {"accelerometer_bias", "accelerometer_scale_misalignment", "gyroscope_bias"})
    assert result["positions"] == 6
    simple = calibrated(
        capsys, folder, "six_position", "--simple", str(folder / "six_position.mcap")
    )
    assert simple["parameters"]["accelerometer_scale_misalignment"]["sigma"][1] == 0.0


@pytest.mark.parametrize(
    "rates", [(), ("--rates", "0.5,1,2"), ("--rates-deg", "28.6479,57.2958,114.592")]
)
def test_turntable_with_rates_or_with_the_truth_in_the_bag(folder, capsys, rates):
    result = calibrated(capsys, folder, "turntable", *rates, str(folder / "turntable.mcap"))
    close(result, {"gyroscope_bias", "gyroscope_scale_misalignment", "gyroscope_g_sensitivity"})
    assert result["rates"] == pytest.approx([0.0, 0.5, 1.0, 2.0], abs=1e-4)


def test_tilted_table_takes_the_force_from_a_calibrated_accelerometer(folder, tmp_path, capsys):
    """Tilted, gravity turns in the body: its mean along the axis separates G from the bias."""
    assert calibrate.main(["six_position", str(folder / "six_position.mcap"), "--quiet", "-o",
                           str(tmp_path)]) == 0  # fmt: skip
    tilted = tmp_path / "tilted.mcap"
    generate.main(["--imu", str(folder / "flaws.yaml"), "--trajectory", "turntable", "--rate",
                   "50", "--set", "trajectory.tilt=0.5", "--set", "trajectory.upside_down=false",
                   "--set", "trajectory.dwell=12.5664", "--quiet", "-o", str(tilted)])  # fmt: skip
    result = calibrated(
        capsys, folder, "turntable", str(tilted), "--rates", "0.5,1,2",
        "--accelerometer", str(tmp_path / "correction.yaml"),
    )  # fmt: skip
    close(result, {"gyroscope_scale_misalignment", "gyroscope_g_sensitivity"})


def test_temperature_recovers_the_gyroscopes_bias_over_temperature(folder, capsys):
    result = calibrated(capsys, folder, "temperature", str(folder / "temperature_soak.mcap"))
    close(result, {"gyroscope_temperature_bias", "reference_temperature"})
    assert result["gyroscope_bias_order"] == [1, 1, 1]
    assert result["temperature_degC"] == pytest.approx([-20.0, 60.0], abs=0.5)


def test_each_calibration_writes_a_picture_and_parameters_that_generate_takes(
    folder, tmp_path, capsys
):
    for run, bag in (
        ("six_position", "six_position"),
        ("turntable", "turntable"),
        ("temperature", "temperature_soak"),
    ):
        output = tmp_path / run
        assert calibrate.main([run, str(folder / f"{bag}.mcap"), "-o", str(output)]) == 0
        printed = capsys.readouterr().out
        assert "standard error" in printed
        assert (output / f"{run}.png").read_bytes()[:4] == b"\x89PNG"
        assert "accelerometer_bias" in (output / "imu.yaml").read_text() or run == "turntable"
        assert "gyroscope_bias" in (output / "correction.yaml").read_text()
    # The parameters go back into the simulator, above a sensor's noise.
    arguments = ["--imu", "mpu6000", "--params-file", str(tmp_path / "temperature" / "imu.yaml")]
    arguments += ["--trajectory", "static", "--duration", "1s", "--quiet"]
    assert generate.main([*arguments, "-o", str(tmp_path / "twin.mcap")]) == 0


def test_bad_input_is_one_clear_line(folder, tmp_path, capsys):
    six, table = (str(folder / f"{run}.mcap") for run in ("six_position", "turntable"))
    assert "of 6 positions" in _half(folder, tmp_path, capsys)
    message = refusal(capsys, "turntable", six, "--rates", "1", lines=2)
    assert "rates: nothing turns at 1 rad/s" in message
    assert f"{six}: no steady rotation" in message
    assert "Temperature" in refusal(capsys, "temperature", table)
    assert "--gravity 0" in refusal(capsys, "six_position", six, "--gravity", "0")
    assert "missing.bag" in refusal(capsys, "six_position", str(tmp_path / "missing.bag"))
    imu_only = tmp_path / "imu_only.mcap"
    generate.main(["--trajectory", "turntable", "--imu-only", "--duration", "60s", "--quiet", "-o",
                   str(imu_only)])  # fmt: skip
    assert "rates the table was set to are not known" in refusal(capsys, "turntable", str(imu_only))


def _half(folder: Path, tmp_path: Path, capsys) -> str:
    """Return the refusal of a recording with five of the six positions."""
    path = tmp_path / "five.mcap"
    generate.main(["--imu", str(folder / "flaws.yaml"), "--trajectory", "six_position", "--rate",
                   "100", "--duration", "170s", "--quiet", "-o", str(path)])  # fmt: skip
    return refusal(capsys, "six_position", str(path))


def test_rates_that_are_no_numbers_are_refused(capsys):
    with pytest.raises(SystemExit) as status:
        calibrate.main(["turntable", "x.bag", "--rates", "1,two"])
    assert status.value.code == 2
    assert "numbers separated by commas" in capsys.readouterr().err


def test_a_tumbling_magnetometer_gives_its_iron_back(tmp_path, capsys):
    bag, truth = tmp_path / "tumble.mcap", tmp_path / "tumble_truth.yaml"
    options = {
        "imu.preset": "mpu9250",
        "trajectory.type": "tumble",
        "duration": 60.0,
        "seed": 4,
        "imu.magnetometer_hard_iron_sigma": 2e-5,
        "imu.magnetometer_soft_iron_sigma": 0.03,
        "imu.magnetometer_noise_density": 3e-8,
    }
    settings = [word for name, value in options.items() for word in ("--set", f"{name}={value}")]
    topics = "imu/mag,ground_truth/mag"
    status = generate.main(["-o", str(bag), "--quiet", "--topics", topics, *settings])
    assert status == 0
    strength = math.hypot(2e-5, 4.5e-5)
    options = [str(bag), "--field", repr(strength), "--truth", str(truth)]
    assert calibrate.main(["magnetometer", *options, "-o", str(tmp_path / "run"), "--json"]) == 0
    result = json.loads(capsys.readouterr().out)
    for parameter in result["parameters"].values():
        # Of twelve values one lies beyond 4 standard errors in 8e-4 of all runs.
        off = np.subtract(parameter["value"], parameter["truth"]) / parameter["sigma"]
        assert np.abs(off).max() < 4.0
    assert sorted(path.name for path in (tmp_path / "run").iterdir()) == [
        "correction.yaml",
        "imu.yaml",
        "magnetometer.png",
    ]
    fitted = files.load(tmp_path / "run/imu.yaml")
    assert set(fitted) == {"imu.magnetometer_hard_iron", "imu.magnetometer_soft_iron"}
    correction = files.load(tmp_path / "run/correction.yaml", "magnetometer")
    matrix = np.reshape(correction["matrix"], (3, 3))
    assert np.allclose(matrix @ np.reshape(fitted["imu.magnetometer_soft_iron"], (3, 3)), np.eye(3))
    _, readings = read_measured(bag, SENSOR.table)
    corrected = np.linalg.norm((readings - correction["bias"]) @ matrix.T, axis=1)
    assert np.std(corrected) < 4e-7 < 5e-6 < np.std(np.linalg.norm(readings, axis=1))
    assert calibrate.main(["magnetometer", *options, "--no-files"]) == 0
    assert "hard_iron x" in capsys.readouterr().out
    assert calibrate.main(["magnetometer", str(bag), "--no-files", "--field", "50"]) == 2
    assert "--field 50.0: must be above 0 and below 1 T" in capsys.readouterr().err
