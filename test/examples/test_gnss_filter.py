# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Filters of others with IMU, GNSS and wheels: their errors are as large as they say themselves.

Over n independent seeds the sum of a NEES of d degrees of freedom is chi-square of n d; bands hold
99.9 % of it. gtsam takes the lever arm, preintegrated readings and an outage of 30 s.
"""

import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from scipy.stats import chi2
from scripts import load_script

EXAMPLE = Path(__file__).parents[2] / "examples/gnss_filter.py"
SEEDS = 30
LOW, HIGH = chi2.ppf([0.0005, 0.9995], 3 * SEEDS) / SEEDS


@pytest.fixture(scope="module", name="example")
def load_example():
    pytest.importorskip("gtsam")
    return load_script(EXAMPLE)


@pytest.fixture(scope="module", name="drives")
def run_drives(example):
    """Return the estimates and the truth of every seed, of shorter drives at 50 Hz."""
    begin, length = 15.0, 30.0
    shorter = {"rate": 50.0, "duration": 55.0, "gnss.outages": [begin, length]}
    return [example.simulated(seed, **shorter) for seed in range(SEEDS)]


def mean_nees(drives, second):
    """Return the mean NEES of all drives at a key frame."""
    normalised_errors = []
    for result, truth in drives:
        row = int(np.searchsorted(result.t_ns - result.t_ns[0], second * 1e9 - 1e6))
        normalised_errors.append(result.position_nees(truth)[row])
    return float(np.mean(normalised_errors))


@pytest.mark.parametrize("second", [10.0, 14.0, 44.0, 50.0])
def test_gtsam_is_consistent_before_in_and_after_an_outage(drives, second):
    assert LOW < mean_nees(drives, second) < HIGH


def test_errors_in_an_outage_grow_as_the_covariance_says(drives):
    """The ratio of mean squares at the end has at least the scatter of 30 numbers, not of 90."""
    stated, mean_squares = [], []
    for result, truth in drives:
        t = (result.t_ns - result.t_ns[0]) * 1e-9
        begin, end = np.searchsorted(t, [13.9, 43.9])
        variance = np.trace(result.position_covariance(), axis1=1, axis2=2)
        stated.append(variance[[begin, end]])
        mean_squares.append((result.errors(truth)[[begin, end]] ** 2).sum(axis=1))
    stated, mean_squares = np.mean(stated, axis=0), np.mean(mean_squares, axis=0)
    assert stated[1] > 2.0 * stated[0]
    low, high = chi2.ppf([0.0005, 0.9995], SEEDS) / SEEDS
    assert low < mean_squares[1] / stated[1] < high


def test_a_covariance_four_times_too_small_shows(example):
    """Fixes dominate: the NEES is up to four times 3. Twelve seeds: above 3 by 99.9 % at 6.1."""
    seeds = 12
    values = {"rate": 50.0, "duration": 15.0, "gnss.outages": [], "gnss.covariance_factor": 0.25}
    drives = [example.simulated(seed, **values) for seed in range(seeds)]
    high = chi2.ppf(0.9995, 3 * seeds) / seeds
    assert mean_nees(drives, 14.0) > high


def test_the_program_of_a_campaign_reads_the_folder(tmp_path):
    """The run of the estimator template, against the same drive in memory to a millimetre."""
    pytest.importorskip("gtsam")
    from imu_sim_ros.campaigns.plan import load_plan
    from imu_sim_ros.campaigns.runs import CellRuns

    (tmp_path / "plan.yaml").write_text(
        "parameters: {rate: 50.0, duration: 20.0, imu: bmi088, trajectory: town, gnss: zed_f9p, "
        "latitude_deg: 48.0, longitude_deg: 11.0, trajectory.rest_before: 2.0}\n"
        "estimators: {filter: {template: gnss_filter}}\nseeds: 1\n"
    )
    plan = load_plan(tmp_path / "plan.yaml")
    (row,) = CellRuns(plan, next(plan.cells())).rows([1], ["filter"], tmp_path / "out")
    assert row["status"] == "done"
    assert row["ate_rmse_m"] < 0.1  # fixes of 6 mm on each axis, ten a second
    assert 0.0 < row["nees_position"] < 30.0


@pytest.mark.slow
def test_the_picture_and_the_numbers(tmp_path):
    done = subprocess.run(
        [sys.executable, str(EXAMPLE), str(tmp_path)], capture_output=True, text=True
    )
    assert done.returncode == 0, done.stderr
    assert (tmp_path / "gnss_filter.png").is_file()
    assert done.stdout.count("at the end of the outage") == 2
