# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""The command ``twin``: files that ``generate`` takes, numbers as JSON, and bad input."""

import json

import numpy as np
import pytest

import imu_sim_ros as ims
from imu_sim_ros.commands import generate
from imu_sim_ros.commands.twin import main

ARM = [0.1, -0.05, 0.02]


@pytest.fixture(scope="module")
def bag(tmp_path_factory):
    """Return a flight of 20 s with its truth in one MCAP file."""
    sensor = {"preset": "adis16448", "lever_arm": ARM}
    flight = ims.simulate(imu=sensor, trajectory="excitation", duration=20, rate=50, seed=2)
    return flight.save(tmp_path_factory.mktemp("flight") / "flight.mcap")


def test_the_twin_of_a_bag_is_written_printed_and_flown_again(bag, tmp_path, capsys):
    truth = ["--truth", str(bag), "--truth-topic", "/ground_truth/odom"]
    folder = tmp_path / "twin"
    assert main([str(bag), *truth, "-o", str(folder), "--fit", "11s"]) == 0
    out, err = capsys.readouterr()
    assert "not fitted" not in err  # it has neither receiver nor wheels
    for option in (
        "lever_arm x",
        "White floor",
        "after 5 s of dead reckoning",
        "a classifier separates",
    ):
        assert option in out
    assert (folder / "twin.png").read_bytes().startswith(b"\x89PNG")
    again = tmp_path / "again.mcap"
    parameters = ["--params-file", str(folder / "twin.yaml"), "--trajectory", "figure_eight"]
    assert generate.main([*parameters, "--duration", "2s", "-o", str(again), "--quiet"]) == 0
    assert len(ims.read_imu(again)) == 100
    assert main([str(bag), *truth, "-o", str(folder)]) == 2
    assert "already exists" in capsys.readouterr().err


def test_json_is_one_object_with_every_number(bag, capsys):
    truth = ["--truth", str(bag), "--truth-topic", "/ground_truth/odom"]
    assert main([str(bag), *truth, "--no-files", "--json"]) == 0
    twin = json.loads(capsys.readouterr().out)
    arm = twin["errors"]["lever_arm"]
    z = (np.array(arm["value"]) - ARM) / arm["sigma"]
    assert np.abs(z).max() < 4.0  # of three values one lies beyond in 2e-4 of all runs
    assert twin["check"] is None
    assert twin["rate_hz"] == 50.0


def test_what_aids_the_imu_is_named_and_not_fitted(tmp_path, capsys):
    sensors = {"sensors": ["gnss", "wheels"], "gnss": {"preset": "zed_f9p"}}
    flight = ims.simulate(imu="adis16448", trajectory="drive", duration=30, rate=50, **sensors)
    bag = flight.save(tmp_path / "drive.mcap")
    argv = [str(bag), "--truth", str(bag), "--truth-topic", "/ground_truth/odom", "--no-files"]
    assert main(argv) == 0
    error_text = capsys.readouterr().err
    assert (
        "twin: /gps/fix, /wheel/odom, /joint_states: not fitted; the twin is that of" in error_text
    )


@pytest.mark.parametrize(
    ("extra", "message"),
    [
        (["--gravity", "nan"], "--gravity nan: must be between 1 and 30 m/s^2"),
        (["--cutoff", "-1"], "--cutoff -1.0: must be between 0.5 and 1000 Hz"),
        (["--fit", "19s"], "--fit 19: must leave 8 s of the"),
        (["--truth-topic", "/nothing"], "/nothing"),
    ],
)
def test_bad_arguments_end_with_a_line_and_status_2(bag, extra, message, tmp_path, capsys):
    truth = ["--truth", str(bag), "--truth-topic", "/ground_truth/odom"]
    assert main([str(bag), *truth, "-o", str(tmp_path / "twin"), *extra]) == 2
    lines = capsys.readouterr().err.splitlines()
    assert any(message in line for line in lines)
    assert all(line.startswith("twin: ") for line in lines)
    assert not (tmp_path / "twin").exists()


def test_missing_and_empty_files_are_reported(bag, tmp_path, capsys):
    empty = tmp_path / "empty.tum"
    empty.write_text("")
    for truth in (empty, tmp_path / "missing.tum"):
        assert main([str(bag), "--truth", str(truth), "--no-files"]) == 2
        assert truth.name in capsys.readouterr().err
