# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Allowed values that are probably not meant: each is told in a line, and usual values are not."""

import contextlib

import pytest

import imu_sim_ros as ims
from imu_sim_ros.commands.generate import main
from imu_sim_ros.core.errors import ConfigurationError
from imu_sim_ros.parameters import files
from imu_sim_ros.simulation.parameters import load_simulation

STATIC = {"trajectory.type": "static", "duration": 1.0}
LINES = {"imu.vibration.line_frequency": [50.0, 100.0], "imu.vibration.line_amplitude": [0.1] * 12}
BAND = {
    "imu.vibration.band_low": [150.0],
    "imu.vibration.band_high": [200.0],
    "imu.vibration.band_density": [0.1] * 6,
}
FINE = {"imu.gyroscope_resolution": [0.0, 5.0, 0.0], "imu.gyroscope_range": 4.0}
COARSE = {"imu.accelerometer_resolution": 200.0, "imu.accelerometer_range": 160.0}


def warnings_of(**values):
    return load_simulation({**STATIC, **values}).warnings()


@pytest.mark.parametrize(
    ("values", "line"),
    [
        ({"gravity": 981.0}, "gravity: 981 m/s^2 is more than on any planet"),
        ({"gravity": [0.0, 0.0, -981.0]}, "gravity: 981 m/s^2 is more than on any planet"),
        ({"imu.internal_rate": 1600.0}, "imu.internal_rate = 1600: without effect, since imu.sa"),
        ({"imu.dropout_probability": 1.0}, "imu.dropout_probability = 1: every message"),
        ({"imu.dropout_probability": 0.999}, "imu.dropout_probability = 0.999: 99.9 % of the mes"),
        (LINES, "imu.vibration.line_frequency = 100: left out, since it is not below half the"),
        (BAND, "imu.vibration.band_low = 150: left out"),
        ({"imu.accelerometer_resolution": 20.0}, "imu.accelerometer_resolution = 20: more than tw"),
        (FINE, "imu.gyroscope_resolution = 5: larger than imu.gyroscope_range = 4, so that every"),
        (COARSE, "imu.accelerometer_resolution = 200: larger than imu.accelerometer_range = 160"),
        ({"imu.gyroscope_resolution": 16.4}, "imu.gyroscope_resolution = 16.4: larger than the ra"),
    ],
)
def test_what_is_probably_not_meant_is_told(values, line):
    (warning,) = warnings_of(**values)
    assert warning.startswith(line)


@pytest.mark.parametrize("name", files.names("imus"))
def test_presets_are_sound(name):
    assert warnings_of(**{"imu.preset": name}) == []


@pytest.mark.parametrize(
    ("frame", "name"), [("base_link", "body_frame"), ("imu_link", "imu_frame")]
)
def test_the_frame_of_the_world_is_none_that_moves(frame, name):
    with pytest.raises(ConfigurationError, match=f"world_frame = {frame}: must not be {name}"):
        load_simulation({**STATIC, "world_frame": frame})


@pytest.mark.parametrize(
    ("arguments", "line"),
    [
        (["--topics", ""], "must be at least one name"),
        (["--topics", " , "], "must be at least one name"),
        (["--topics", "all,imu/data_raw"], "all stands for every topic, alone"),
        (["--set", "duration=2"], "duration = 1 and parameter duration = 2: two values; give one"),
        (["--rate", "100", "--set", "rate=200"], "rate = 100 and parameter rate = 200: two values"),
        (["--seed", "1", "--set", "seed=2"], "seed = 1 and parameter seed = 2: two values"),
    ],
)
def test_arguments_that_contradict_each_other_are_refused(tmp_path, capsys, arguments, line):
    with contextlib.suppress(SystemExit):
        assert main(["-o", str(tmp_path / "out"), "--duration", "1s", *arguments]) == 2
    assert line in capsys.readouterr().err
    assert not (tmp_path / "out").exists()


def test_the_same_value_twice_is_no_contradiction(tmp_path):
    assert main(["-o", str(tmp_path / "out"), "--duration", "1s", "--set", "duration=1.0"]) == 0


def test_all_topics_are_those_that_help_lists(tmp_path):
    summary = ims.generate(tmp_path / "all.mcap", trajectory="static", duration=1, topics="all")
    assert {"/imu/data_raw", "/ground_truth/gyroscope_noise", "/imu/mag"} <= set(summary.messages)
