# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""A NEES whose covariance is not valid: results, table and page."""

import csv

import numpy as np

from imu_sim_ros.commands.campaign import main as command


def table(folder):
    with (folder / "results.csv").open(encoding="utf-8") as file:
        return list(csv.DictReader(file))


def test_a_nees_of_an_attitude_known_too_badly_is_not_valid(plan_file, tmp_path, capsys):
    """mpu6000 turns on with 5 deg/s: after 10 s nothing linear is left; adis16448 is consistent.

    At the end of a whole turn (20 s of lecture) the attitude's error is a product of two normal
    numbers: e^2 of mean 1 has a variance of 8, and the mean of 20 a standard error of 0.63 of it.
    Three of these, of 3 numbers, reach to 8; to first order the mean was 59.
    """
    parameters = {"rate": 100.0, "duration": 20.0, "trajectory": "lecture"}
    path = plan_file(parameters=parameters, grid={"imu": ["adis16448", "mpu6000"]}, seeds=20)
    folder = tmp_path / "out"
    assert command([str(path), "-o", str(folder), "--workers", "1"]) == 0
    lines = [line for line in capsys.readouterr().out.splitlines() if "mpu6000" in line]
    assert sum(line.rstrip().endswith("not valid") for line in lines) == 1
    assert '"not valid"' in (folder / "report.html").read_text(encoding="utf-8")
    rows_by_imu = {name: [row for row in table(folder) if name in row["cell"]] for name in
             ("adis16448", "mpu6000")}  # fmt: skip
    for metric in ("nees_position", "nees_attitude", "nees_velocity"):
        assert {row[metric] for row in rows_by_imu["mpu6000"]} == {""}
        values = [float(row[metric]) for row in rows_by_imu["adis16448"]]
        assert 0.8 < np.mean(values) < 8.0
    assert min(float(row["attitude_sigma_rad"]) for row in rows_by_imu["mpu6000"]) > 0.5
