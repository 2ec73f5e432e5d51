# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Estimators that give up: their errors are small, and their runs are failed."""

import csv
import json

import pytest

from imu_sim_ros.campaigns.plan import load_plan
from imu_sim_ros.campaigns.runs import CellRuns
from imu_sim_ros.commands.report import main as report

# Writes the truth between two shares of the time, every 5th row, with an error at its end.
PARTLY = """
import csv, sys
dataset, estimate, first, last = sys.argv[1:5]
rows = list(csv.reader(open(dataset + "/mav0/state_groundtruth_estimate0/data.csv")))[1:]
rows = rows[int(float(first) * len(rows)):int(float(last) * len(rows)) + 1:5]
with open(estimate, "w") as file:
    for row in rows:
        x, y, z, w, i, j, k = row[1:8]
        print(f"{int(row[0]) * 1e-9:.9f} {x} {y} {z} {i} {j} {k} {w}", file=file)
"""


@pytest.fixture
def partly(tmp_path):
    """Return a function that returns an estimator that estimates a part of the time."""
    script = tmp_path / "partly.py"
    script.write_text(PARTLY, encoding="utf-8")

    def estimator_entry(begin_share, end_share, suffix="", **options):
        shares = f"{begin_share} {end_share}"
        estimator_line = f"{{python}} -S {script} {{dataset}} {{estimate}} {shares}"
        if suffix:
            options["shell"] = True
        return {"command": f"{estimator_line}{suffix}", "align": "none", **options}

    return estimator_entry


def test_an_estimator_that_stops_after_a_fifth_of_a_flight_wins_nothing(
    plan_file, campaign, partly, tmp_path, capsys
):
    """The ATE of the estimator is 0, and its programs end with status 0 in 8 of 8 runs."""
    plan = plan_file(
        seeds=8,
        parameters={"rate": 100.0, "duration": 4.0, "imu": "mpu6000"},
        estimators={"quitter": partly(0.0, 0.2), "dead_reckon": {"align": "none"}},
        require=["success >= 0.99 @ estimator=quitter", "coverage.min >= 0.9"],
    )
    folder = tmp_path / "out"
    status, result, lines = campaign(plan, "-o", folder, "--workers", "1")
    assert (status, result["done"], result["failed"]) == (3, 8, 8)
    assert any("success >= 0.99" in line and "success is 0" in line for line in lines)
    assert any("coverage.min >= 0.9" in line and "is 0.2" in line for line in lines)
    with (folder / "results.csv").open(encoding="utf-8") as file:
        rows = [row for row in csv.DictReader(file) if row["estimator"] == "quitter"]
    assert {row["status"] for row in rows} == {
        "failed: covers 20.1 % of the truth's time, less than coverage = 0.9; gaps are longer than "
        "max_gap = 0.5 s"
    }
    for row in rows:
        assert float(row["coverage"]) == pytest.approx(0.8 / 3.99)
        assert float(row["time_to_failure_s"]) == pytest.approx(0.8)
        assert row["ate_rmse_m"] == ""
    (contest,) = result["judgement"]["contests"]
    assert contest["best"] == "dead_reckon"
    assert [standing["coverage"] for standing in result["judgement"]["standings"]] == pytest.approx(
        [1.0, 0.8 / 3.99]
    )
    # How long they last is compared, too, although no run of one of them is done.
    status, result, _ = campaign(plan, "-o", folder, "--resume", "--metric", "time_to_failure_s")
    (effect,) = result["judgement"]["contests"][0]["effects"]
    assert (effect["a"], effect["kind"]) == ("dead_reckon", "ratio")
    assert effect["effect"]["value"] == pytest.approx(3.99 / 0.8)
    capsys.readouterr()
    assert report([str(folder), "--force", "--quiet", "--metric", "coverage"]) == 0
    page = (folder / "report.html").read_text(encoding="utf-8")
    content = json.loads(page.partition('id="content">')[2].partition("</script>")[0])
    (runs,) = [i for s in content["sections"] for i in s["items"] if i["kind"] == "campaign"]
    assert "coverage" in runs["shown"]
    assert [group["metrics"]["coverage"][0] for group in runs["groups"]] == [1, 0.200501]


def test_which_part_is_enough_is_the_estimators_own(plan_file, partly, tmp_path):
    """Estimates of a flight of 4 s end at 3 s or begin at 1 s or 2 s; 1 s is allowed to start."""
    estimators = {
        "until": partly(0.0, 0.75),
        "lenient": partly(0.0, 0.75, coverage=0.7),
        "late": partly(0.25, 1.0),
        "strict": partly(0.25, 1.0, initialisation_allowance=0.5),
        "too_late": partly(0.5, 1.0),
    }
    parameters = {"rate": 100.0, "duration": 4.0, "imu": "adis16448"}
    plan = load_plan(plan_file(parameters=parameters, estimators=estimators, keep="failed"))
    rows = CellRuns(plan, next(plan.cells())).rows([0], list(estimators), tmp_path / "out")
    rows = {row["estimator"]: row for row in rows}
    assert [row["status"][:6] for row in rows.values()] == [
        *("failed", "done", "done", "failed", "failed")
    ]
    run_folders = {place.name for place in (tmp_path / "out").glob("runs/000000/0/*")}
    assert run_folders == {"until", "strict", "too_late"}
    shares = [rows[name]["coverage"] for name in estimators]
    expected = [3.0 / 3.99, 3.0 / 3.99, 1.0, 2.95 / 3.49, 1.95 / (0.75 * 3.99)]
    assert shares == pytest.approx(expected, abs=0.02)


def test_a_program_that_crashes_leaves_how_far_it_came(plan_file, partly, tmp_path):
    """Half a path, and then half a line; or nothing at all, which covers nothing."""
    estimators = {
        "half": partly(0.0, 0.5, suffix="; printf '1.7 0 0' >> {estimate}; exit 5"),
        "nothing": {"command": "false"},
    }
    plan = load_plan(plan_file(estimators=estimators))
    rows = CellRuns(plan, next(plan.cells())).rows([0], list(estimators), tmp_path / "out")
    half, nothing = rows
    assert (half["status"], nothing["status"]) == (
        "failed: exit status 5",
        "failed: exit status 1",
    )
    assert half["time_to_failure_s"] == pytest.approx(1.0)
    assert half["coverage"] == pytest.approx(1.0 / 1.99)
    assert (nothing["coverage"], nothing["time_to_failure_s"]) == (0.0, 0.0)


def test_readings_that_are_lost_are_a_gap_of_dead_reckoning(plan_file, tmp_path):
    """No reading arrives between 2 and 3 s of 10 s."""
    plan = load_plan(
        plan_file(
            parameters={"rate": 100.0, "duration": 10.0, "imu": "adis16448"},
            faults=[{"at": 2.0, "kind": "dropout", "value": 1.0, "duration": 1.0}],
            estimators={"dead_reckon": {}, "lenient": {"type": "dead_reckon", "max_gap": 1.5}},
        )
    )
    rows = CellRuns(plan, next(plan.cells())).rows([0], list(plan.estimators), tmp_path)
    strict, lenient = rows
    assert strict["coverage"] == pytest.approx((9.99 - 1.01) / 9.99)
    assert strict["time_to_failure_s"] == pytest.approx(1.99)
    assert strict["status"].startswith("failed: covers 89.9 % of the truth's time")
    assert (lenient["status"], lenient["coverage"]) == ("done", 1.0)


def test_a_run_has_failed_from_the_first_large_error_on(plan_file, tmp_path):
    """A bias of 1 m/s^2 from 2 s on is 0.5 m/s^2 (t - 2 s)^2 off: 2 m after 4 s."""
    plan = load_plan(
        plan_file(
            parameters={"rate": 100.0, "duration": 6.0, "imu": "perfect", "trajectory": "static"},
            faults=[
                {"at": 2.0, "kind": "bias_jump", "triad": "accelerometer", "value": [1.0, 0.0, 0.0]}
            ],
            diverged_above=2.0,
        )
    )
    (row,) = CellRuns(plan, next(plan.cells())).rows([0], ["dead_reckon"], tmp_path)
    assert row["status"].startswith("failed: diverged: ")
    assert row["time_to_failure_s"] == pytest.approx(4.0, abs=0.02)
    assert row["coverage"] == 1.0


@pytest.mark.parametrize("name", ["coverage", "max_gap", "initialisation_allowance"])
def test_limits_are_checked_with_the_plan(plan_file, campaign, tmp_path, name):
    plan = plan_file(estimators={"mine": {"type": "dead_reckon", name: -0.1}})
    status, _, lines = campaign(plan, "-o", tmp_path / "out")
    assert (status, len(lines)) == (2, 1)
    assert f"estimators.mine: {name} = -0.1: must be" in lines[0]
