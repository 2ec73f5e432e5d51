# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Estimators are compared over the time that both cover: leaving out time never helps."""

import json

import numpy as np
import pytest

from imu_sim_ros.campaigns.common_time import common_spans, pose_spans, span_mask
from imu_sim_ros.campaigns.metrics import parse_tolerance
from imu_sim_ros.campaigns.plan import load_plan
from imu_sim_ros.campaigns.results import read_results
from imu_sim_ros.campaigns.verdict import judge
from imu_sim_ros.reports.campaign import campaign_sections

ESTIMATOR = """import sys
mode, data, out, seed = sys.argv[1:]
rows = [row.split(",") for row in open(data + "/mav0/state_groundtruth_estimate0/data.csv")][1:]
n, first = len(rows), int(rows[0][0])
early = slice(int(0.905 * n))
late = slice(int(0.2 * n), None)
kept = {"early": early, "worse_early": early, "late": late}.get(mode, slice(None))
with open(out, "w") as file:
    for row in rows[kept]:
        if mode == "pause" and 0.6 * n < rows.index(row) < 0.68 * n:
            continue
        s = (int(row[0]) - first) * 1e-9
        drift = 0.01 * (1 + int(seed) % 7 / 7) * s * s
        drift *= {"worse": 1.1, "worse_early": 1.1, "turned": 0.0}.get(mode, 1.0)
        x, y, z, qw, qx, qy, qz = map(float, row[1:8])
        if mode == "turned":
            qw, qx, qy, qz = -qx, qw, qz, -qy
        print(f"{int(row[0]) * 1e-9:.9f}", x + drift, y, z, qx, qy, qz, qw, file=file)
"""


def command(mode):
    # Without site-packages Python starts in a fifth of the time.
    program = "{python} -S {plan}/estimator.py"
    return {"command": f"{program} {mode} {{dataset}} {{estimate}} {{seed}}", "max_gap": 0.3}


@pytest.fixture
def compare(plan_file, campaign, tmp_path):
    """Return a function that compares estimators by their modes."""
    (tmp_path / "estimator.py").write_text(ESTIMATOR)

    def run(*modes, **content):
        parameters = {"rate": 20.0, "duration": 10.0, "imu": "perfect"}
        parameters["trajectory"] = "figure_eight"
        estimators = {mode: command(mode) for mode in modes}
        path = plan_file(parameters=parameters, estimators=estimators, **content)
        status, result, lines = campaign(path, "-o", tmp_path / "out")
        assert (status, lines) == (0, [])
        return result["judgement"]

    return run


def test_spans_of_stamps_and_their_intersection():
    t_ns = np.array([0, 1, 2, 5, 6, 9]) * 10**9
    spans = pose_spans(t_ns, 1.5)
    assert (spans // 10**9).tolist() == [[0, 2], [5, 6], [9, 9]]
    other_spans = np.array([[1, 5], [6, 20]]) * 10**9
    common = common_spans(spans, other_spans)
    assert (common // 10**9).tolist() == [[1, 2]]
    assert span_mask(t_ns, common).tolist() == [False, True, True, False, False, False]
    assert not span_mask(t_ns, common_spans(spans, spans + 100 * 10**9)).any()


@pytest.mark.parametrize(
    ("mode", "share", "align"),
    [("early", 0.9, "none"), ("late", 0.8, "yaw"), ("pause", 0.92, "yaw")],
)
def test_the_same_estimate_of_less_time_is_equal(compare, tmp_path, mode, share, align):
    """``late`` leaves out an allowed start, so that its coverage is 100 %."""
    judged = compare("full", mode, seeds=6, align=align, rpe=["1s"])
    (contest,) = judged["contests"]
    lead = contest["lead"]
    assert (contest["best"], lead["verdict"]) == (None, "equal")
    assert lead["effect"]["value"] == pytest.approx(1.0, abs=1e-9)
    own_time = {lead["a"]: lead["time"]["a"], lead["b"]: lead["time"]["b"]}
    assert own_time["full"] == pytest.approx(1.0)
    assert own_time[mode] == pytest.approx(share, abs=0.02)
    assert lead["time"]["both"] == pytest.approx(own_time[mode], abs=1e-9)
    (verdict, *_), *_ = [section.items for section in campaign_sections(tmp_path / "out")[1]]
    (drawn,) = verdict["judged"][0]["contests"]
    assert f"of the time that both cover ({lead['a']} " in drawn["line"]
    plan, rows = load_plan(tmp_path / "plan.yaml"), read_results(tmp_path / "out")
    for metric in ("final_position_error_m", "drift_percent", "rpe_1s_m", "ate_rmse_rad"):
        for effect in judge(plan, rows, metric).contests[0].effects:
            assert effect.verdict in ("equal", "undecided")
            assert (
                effect.effect.value == pytest.approx(1.0, abs=1e-6) or effect.kind == "difference"
            )


def test_a_worse_estimate_that_stops_early_is_worse(compare):
    """Errors of worse_early are 10 % smaller over its own, 10 % larger over the common time."""
    judged = compare("full", "worse_early", seeds=8, align="none")
    medians = {
        standing["estimator"]: standing["median"]["value"] for standing in judged["standings"]
    }
    assert medians["worse_early"] < 0.95 * medians["full"]
    (contest,) = judged["contests"]
    assert (contest["best"], contest["ranking"]) == ("full", ["full", "worse_early"])
    assert contest["lead"]["effect"]["value"] == pytest.approx(1.0 / 1.1, abs=1e-6)


def test_three_estimators_are_ranked_by_their_common_time(compare):
    judged = compare("early", "worse", "full", seeds=8, align="none")
    (contest,) = judged["contests"]
    assert contest["ranking"][-1] == "worse"
    assert {contest["lead"]["a"], contest["lead"]["b"]} == {"early", "full"}
    assert contest["best"] is None
    verdicts = {
        frozenset((effect["a"], effect["b"])): effect["verdict"] for effect in contest["effects"]
    }
    assert verdicts[frozenset(("early", "full"))] == "equal"


def rows_of(estimator, error, share, seeds=12):
    return [
        {
            "cell": "all",
            "seed": seed,
            "estimator": estimator,
            "status": "done",
            "ate_rmse_m": error * (1.0 + 0.01 * seed),
            "estimated_share": share,
        }
        for seed in range(seeds)
    ]


@pytest.mark.parametrize(
    ("value_now", "share", "verdict", "non_inferior"),
    [
        (0.8, 0.92, "undecided", False),  # smaller errors of less time
        (1.0, 0.92, "undecided", False),
        (1.3, 0.92, "worse", False),  # larger ones, even so
        (0.8, 1.0, "better", True),
        (0.8, 0.997, "better", True),
    ],
)
def test_less_time_than_the_baseline_proves_nothing(
    plan_file, value_now, share, verdict, non_inferior
):
    """There the common time is not known: only what is worse in less time is told."""
    plan = load_plan(plan_file(seeds=12))
    rows, baseline = rows_of("dead_reckon", value_now, share), rows_of("dead_reckon", 1.0, 1.0)
    margin = parse_tolerance("5 %")
    judged = judge(plan, rows, "ate_rmse_m", baseline, non_inferiority=margin)
    (effect,) = judged.baseline
    assert (effect.verdict, effect.non_inferior) == (verdict, non_inferior)
    if verdict == "undecided":
        line = effect.line("ate_rmse_m")
        assert "not over the same time (all; dead_reckon 92 %, the baseline 100 %)" in line


def test_runs_of_other_tasks_have_no_common_time(compare, campaign, tmp_path):
    """An estimator that is added later: who covers less is not called better."""
    compare("full", seeds=6, align="none")
    path = tmp_path / "plan.yaml"
    text = path.read_text().replace(
        "estimators:", f"estimators:\n  early: {json.dumps(command('early'))}", 1
    )
    path.write_text(text)
    status, result, _ = campaign(path, "-o", tmp_path / "out", "--resume")
    assert status == 0
    (contest,) = result["judgement"]["contests"]
    assert (contest["best"], contest["lead"]["verdict"]) == (None, "undecided")
    assert "not over the same time" in contest["lead"]["note"]


def test_findings_are_named_with_their_runs(compare, tmp_path):
    """JSON, table and page name the finding, which the metric of the position does not show."""
    judged = compare("turned", seeds=3, align="none")
    (finding,) = judged["findings"]
    assert (finding["estimator"], finding["runs"], finding["seeds"]) == ("turned", 3, [0, 1, 2])
    assert finding["finding"].startswith("the attitude is off by a constant 180 deg about (")
    (verdict, *_), *_ = [section.items for section in campaign_sections(tmp_path / "out")[1]]
    assert [entry["finding"] for entry in verdict["findings"]] == [finding["finding"]]
    assert all(row["findings"] == finding["finding"] for row in read_results(tmp_path / "out"))
