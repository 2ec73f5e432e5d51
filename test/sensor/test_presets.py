# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Every preset loads and runs, and each of its numbers is computed from a source in its comment."""

import math
import re
from pathlib import Path

import numpy as np
import pytest

from imu_sim_ros.config import files
from imu_sim_ros.config.parameter import flatten
from imu_sim_ros.config.simulation import load_simulation
from imu_sim_ros.sensor import accel_variance_discrete, gyro_variance_discrete
from imu_sim_ros.simulation import Simulation

PRESETS = files.names("imus")
UNITS = {"deg": math.pi / 180.0, "g": 9.80665, "hour": 3600.0, "sqrt": math.sqrt}
ENTRY = re.compile(r"^ {6}# (\[\d\]) (.+) = ([^=]+)\n {6}(\w+): (.+)$", re.MULTILINE)


def test_the_presets_that_are_promised_exist() -> None:
    assert set(PRESETS) >= {
        "perfect",
        "lecture",
        "adis16448",
        "mpu6000",
        "mpu9250",
        "icm42688p",
        "bmi088",
        "bmi270",
        "vn100",
        "tactical",
        "navigation",
    }


@pytest.mark.parametrize("preset", [name for name in PRESETS if name != "perfect"])
def test_every_number_has_a_source_and_follows_from_it(preset: str) -> None:
    path = files.find("imus", preset)
    text = path.read_text(encoding="utf-8")
    header = text.partition("/**:")[0]
    entries = ENTRY.findall(text)
    assert {f"imu.{name}" for *_, name, _ in entries} == set(files.load(path))
    for source, _, expression, _, value in entries:
        assert f"# {source} " in header
        computed = eval(expression, {"__builtins__": {}}, dict(UNITS))
        # Five digits are written.
        assert np.allclose(files.parse_yaml(value), computed, rtol=5e-5, atol=0.0)


@pytest.mark.parametrize("preset", PRESETS)
@pytest.mark.parametrize("rate", [100.0, 1000.0])
def test_every_preset_runs(preset: str, rate: float) -> None:
    parameters = load_simulation({"imu.preset": preset, "trajectory.type": "lecture", "rate": rate})
    assert parameters.warnings() == []
    block = Simulation(parameters).next_block(1000)
    assert np.isfinite(block.gyro).all()
    assert np.isfinite(block.accel).all()
    gyro = gyro_variance_discrete(parameters.imu, rate)
    accel = accel_variance_discrete(parameters.imu, rate)
    if preset == "perfect":
        assert gyro == accel == (0.0, 0.0, 0.0)
    else:
        assert min(gyro) > 0.0
        assert min(accel) > 0.0 or preset == "navigation"


def test_grades_are_in_order() -> None:
    """White noise of the gyroscope: consumer, industrial, tactical, navigation."""
    order = ["mpu9250", "mpu6000", "icm42688p", "tactical", "navigation"]
    noise = [load_simulation({"imu.preset": name}).imu.gyroscope_noise_density[0] for name in order]
    assert noise == sorted(noise, reverse=True)


def test_a_kalibr_file_is_a_preset(tmp_path: Path) -> None:
    path = tmp_path / "imu.yaml"
    path.write_text(
        "accelerometer_noise_density: 0.01\naccelerometer_random_walk: 2e-4\n"
        "gyroscope_noise_density: 1e-3\ngyroscope_random_walk: 1.0e-05\n"
        "rostopic: /imu0\nupdate_rate: 250.0\n"
    )
    parameters = load_simulation({"imu.preset": str(path)})
    assert parameters.rate == 250.0
    assert parameters.imu.gyroscope_noise_density == (1e-3, 1e-3, 1e-3)
    assert flatten(parameters)["imu.accelerometer_random_walk"] == (2e-4, 2e-4, 2e-4)
