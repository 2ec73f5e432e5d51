# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Campaigns of ``allan`` and ``calibrate``: the numbers of the commands, over many seeds."""

import json

import numpy as np
import pytest

from imu_sim_ros.campaigns.plan import load_plan
from imu_sim_ros.campaigns.runs import CellRuns
from imu_sim_ros.commands import allan, calibrate, generate

AT_REST = {
    "rate": 20.0,
    "duration": 300.0,
    "trajectory": "static",
    "imu": "perfect",
    "imu.gyroscope_noise_density": 1e-3,
    "imu.accelerometer_noise_density": 1e-2,
}


def rows_of(path, seeds=None):
    plan = load_plan(path)
    return list(CellRuns(plan, next(plan.cells())).rows(seeds or plan.seeds, plan.estimators, None))


def test_allan_has_the_numbers_of_the_command(plan_file, tmp_path, capsys):
    (row,) = rows_of(plan_file(parameters=AT_REST, estimators={"a": {"type": "allan"}}), [4])
    assert row["status"] == "done"
    bag = str(tmp_path / "rest.mcap")
    generate_line = (
        f"-o {bag} --rate 20 --duration 300s --trajectory static --imu perfect --seed 4 --quiet "
        "--set imu.gyroscope_noise_density=1e-3 --set imu.accelerometer_noise_density=1e-2"
    )
    assert generate.main(generate_line.split()) == 0
    assert allan.main([bag, "--no-files", "--json"]) == 0
    allan_output = json.loads(capsys.readouterr().out)
    for triad, truth in (("gyroscope", 1e-3), ("accelerometer", 1e-2)):
        density = allan_output[triad]["noise_density"]
        ratio = np.mean(density["value"]) / truth
        assert row[f"{triad}_noise_density_ratio"] == pytest.approx(ratio, rel=1e-6)
        low, high = np.array(density["low"]), np.array(density["high"])
        covered = np.mean((low <= truth) & (truth <= high))
        assert row[f"{triad}_noise_density_covered"] == pytest.approx(covered)


def test_allans_intervals_hold_the_truth_as_often_as_they_say(plan_file):
    """20 seeds x 6 axes: 95 % of 120 is 114 +- 2.4; at least 107 is three of these below.

    Intervals that are too short by a factor of sqrt(2) hold 83 %: 100 +- 4.
    """
    rows = rows_of(plan_file(parameters=AT_REST, seeds=20, estimators={"a": {"type": "allan"}}))
    names = ("gyroscope_noise_density_covered", "accelerometer_noise_density_covered")
    shares = [row[name] for row in rows for name in names]
    assert np.mean(shares) >= 107 / 120
    # 6000 readings an axis: a density scatters by 1/sqrt(12000) = 0.9 %, the mean of 120 by 0.08 %.
    ratios = [row[name.replace("covered", "ratio")] for row in rows for name in names]
    assert np.mean(ratios) == pytest.approx(1.0, abs=0.0025)


@pytest.mark.parametrize(
    ("kind", "trajectory", "rate"),
    [
        ("six_position", "six_position", 10),
        ("turntable", "turntable", 25),
        ("temperature", "temperature_soak", 10),
    ],
)
def test_calibrations_have_the_numbers_of_the_command(
    plan_file, tmp_path, capsys, kind, trajectory, rate
):
    parameters = {"rate": float(rate), "trajectory": trajectory, "imu": "mpu6000"}
    (row,) = rows_of(plan_file(parameters=parameters, estimators={"a": {"type": kind}}), [2])
    assert row["status"] == "done"
    bag = tmp_path / "run.mcap"
    generate_line = (
        f"-o {bag} --rate {rate} --trajectory {trajectory} --imu mpu6000 --seed 2 --quiet "
        "--topics imu/data_raw,ground_truth/odom,imu/temperature"
    )
    assert generate.main(generate_line.split()) == 0
    truth = str(tmp_path / "run_truth.yaml")
    assert calibrate.main([kind, str(bag), "--truth", truth, "--no-files", "--json"]) == 0
    calibrated = json.loads(capsys.readouterr().out)["parameters"]
    checked = 0
    for name, values in calibrated.items():
        value, sigma, true = (np.array(values[k]) for k in ("value", "sigma", "truth"))
        error, is_estimated = value - true, sigma > 0
        if f"{name}_sigmas" not in row:
            assert name == "reference_temperature"
            continue
        if f"{name}_error" in row:
            assert row[f"{name}_error"] == pytest.approx(np.sqrt(np.mean(error**2)), rel=1e-3)
        sigmas = np.sqrt(np.mean((error[is_estimated] / sigma[is_estimated]) ** 2))
        assert row[f"{name}_sigmas"] == pytest.approx(sigmas, rel=1e-3)
        checked += 1
    assert checked >= 2


def test_what_tells_nothing_is_a_result(plan_file):
    """Two seconds for allan: its check says so."""
    short = {**AT_REST, "duration": 2.0}
    (row,) = rows_of(plan_file(parameters=short, estimators={"a": {"type": "allan"}}), [0])
    assert row["status"].startswith("failed: ")
    assert row["gyroscope_noise_density_ratio"] is None
