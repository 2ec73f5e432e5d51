# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Campaigns in real processes: the same numbers however they are made, whatever dies."""

import csv
import json
import math
import os
import re
import resource
import signal
import subprocess
import sys
import threading
import time
from contextlib import closing
from pathlib import Path
from xml.etree import ElementTree

import numpy as np
import pytest
from programs import PATIENCE, until

from imu_sim_ros.campaigns import campaign as driver
from imu_sim_ros.campaigns import engine
from imu_sim_ros.campaigns.plan import load_plan
from imu_sim_ros.campaigns.results import Store, read_log, read_results
from imu_sim_ros.campaigns.runs import CellRuns
from imu_sim_ros.campaigns.verdict import counts
from imu_sim_ros.commands import dead_reckon, evaluate, generate
from imu_sim_ros.commands.campaign import main as command
from imu_sim_ros.commands.report import main as report_command
from imu_sim_ros.core.errors import ConfigurationError, InputError
from imu_sim_ros.jobs import campaign as job
from imu_sim_ros.jobs.report import report
from imu_sim_ros.navigation.evaluation import anees_band
from imu_sim_ros.reports.campaign import campaign_sections
from imu_sim_ros.terminal import signals

GRID = {"imu": ["adis16448", "perfect"], "trajectory": ["lecture", "circle"]}


def table(folder):
    with (folder / "results.csv").open(encoding="utf-8") as file:
        return list(csv.DictReader(file))


def test_results_are_the_same_for_any_number_of_workers(plan_file, campaign, tmp_path):
    path = plan_file(grid=GRID, seeds=4, rpe=["1s", "1m"])
    contents = []
    for workers, batch in ((1, 50), (2, 3)):
        folder = tmp_path / f"with_{workers}"
        status, result, lines = campaign(path, "-o", folder, "--workers", workers, "--batch", batch)
        assert (status, lines) == (0, [])
        assert (result["runs"], result["done"], result["failed"]) == (16, 16, 0)
        contents.append((folder / "results.csv").read_bytes())
    assert contents[0] == contents[1]


def test_a_run_has_the_numbers_of_the_commands(plan_file, tmp_path, capsys):
    """generate, dead_reckon and evaluate by hand, with the same parameters and seed."""
    plan = load_plan(plan_file(rpe=["1s"], seeds=[5]))
    (row,) = CellRuns(plan, next(plan.cells())).rows([5], ["dead_reckon"], tmp_path)
    bag, track = str(tmp_path / "run.mcap"), str(tmp_path / "track.txt")
    common = ["--rate", "100", "--duration", "2s", "--imu", "adis16448", "--seed", "5", "--json"]
    assert generate.main(["-o", bag, *common]) == 0
    capsys.readouterr()
    assert dead_reckon.main([bag, "-o", track, "--json"]) == 0
    drift = json.loads(capsys.readouterr().out)
    assert evaluate.main([track, bag, "--rpe", "1s", "--json"]) == 0
    evaluation = json.loads(capsys.readouterr().out)
    assert row["final_position_error_m"] == pytest.approx(drift["final_position_error_m"])
    assert row["final_attitude_error_rad"] == pytest.approx(drift["final_attitude_error_rad"])
    assert row["final_velocity_error_m_s"] == pytest.approx(drift["final_velocity_error_m_s"])
    assert row["ate_rmse_m"] == pytest.approx(evaluation["ate_m"]["rmse"], rel=1e-6)
    assert row["rpe_1s_m"] == pytest.approx(evaluation["rpe"][0]["translation_m"]["rmse"], rel=1e-6)


def test_seeds_that_share_a_cell_have_the_numbers_of_seeds_alone(plan_file):
    """Seeds of a cell share the samples of the motion, also those for averages and a lever arm."""
    parameters = {
        "rate": 100.0,
        "duration": 2.0,
        "imu": "mpu6000",
        "imu.sampling": "averaged",
        "imu.lever_arm": [0.1, 0.2, 0.3],
    }
    plan = load_plan(plan_file(parameters=parameters))

    def rows(*seeds):
        return list(CellRuns(plan, next(plan.cells())).rows(seeds, ["dead_reckon"], None))

    assert rows(0, 1, 2) == [*rows(0), *rows(1), *rows(2)]


def test_the_nees_of_many_seeds_lies_in_its_band(plan_file):
    """White noise and walks alone, for which the covariance is complete: 300 seeds."""
    parameters = {
        "rate": 100.0,
        "duration": 2.0,
        "imu": "perfect",
        "imu.gyroscope_noise_density": 1e-3,
        "imu.accelerometer_noise_density": 1e-2,
        "imu.gyroscope_random_walk": 1e-4,
    }
    plan = load_plan(plan_file(parameters=parameters, seeds=300))
    rows = list(CellRuns(plan, next(plan.cells())).rows(plan.seeds, ["dead_reckon"], None))
    band = anees_band(3, 300, 0.99)
    for name in ("nees_position", "nees_attitude", "nees_velocity"):
        assert band.low < np.mean([row[name] for row in rows]) < band.high, name


def test_faults_and_lost_messages_are_part_of_a_run(plan_file):
    parameters = {"rate": 100.0, "duration": 2.0, "imu": "perfect"}
    plan = load_plan(
        plan_file(
            parameters=parameters,
            faults=[
                {"at": 1.0, "kind": "bias_jump", "triad": "accelerometer", "value": [1.0, 0, 0]},
                {"at": 0.5, "kind": "dropout", "value": 0.5, "duration": 0.5},
            ],
        )
    )
    clean = load_plan(plan_file(parameters=parameters))
    (row,) = CellRuns(plan, next(plan.cells())).rows([0], ["dead_reckon"], None)
    (without,) = CellRuns(clean, next(clean.cells())).rows([0], ["dead_reckon"], None)
    assert row["status"] == "done"
    # 1 m/s^2 for one second is half a metre.
    assert row["final_position_error_m"] - without["final_position_error_m"] == pytest.approx(
        0.5, abs=0.02
    )


def test_what_failed_says_why_and_is_counted(plan_file, campaign, tmp_path):
    path = plan_file(diverged_above=1e-9, require=["success >= 0.5"])
    status, result, lines = campaign(path, "-o", tmp_path / "out")
    assert status == 1
    assert result["failed"] == 3
    assert all(row["status"].startswith("failed: diverged: ") for row in table(tmp_path / "out"))
    required, reason = lines
    assert required == "campaign: require success >= 0.5: success is 0 (all; dead_reckon)"
    assert reason == "campaign: no run is done: 3 x diverged: ... m at the end"


def test_results_are_not_overwritten_and_a_folder_is_used_once(plan_file, campaign, tmp_path):
    path, folder = plan_file(), tmp_path / "out"
    assert campaign(path, "-o", folder)[0] == 0
    log_before = (folder / "runs.jsonl").read_bytes()
    status, _, lines = campaign(path, "-o", folder)
    assert status == 2
    assert lines == [
        f"campaign: {folder}: contains results; continue with --resume, start over with --force, "
        "or name another one"
    ]
    with Store(folder, resume=True), pytest.raises(InputError, match="another campaign is running"):
        Store(folder, resume=True)
    assert campaign(path, "-o", folder, "--resume")[1]["runs"] == 3
    assert (folder / "runs.jsonl").read_bytes() == log_before


def test_more_seeds_and_cells_add_what_is_missing(plan_file, campaign, tmp_path):
    folder = tmp_path / "out"
    assert campaign(plan_file(seeds=2), "-o", folder)[1]["runs"] == 2
    assert campaign(plan_file(seeds=5), "-o", folder, "--resume")[1]["runs"] == 5
    assert len((folder / "runs.jsonl").read_text().splitlines()) == 5
    # Other parameters: nothing of before is mixed in.
    other_plan = plan_file(seeds=2, parameters={"rate": 50.0, "duration": 2.0})
    assert campaign(other_plan, "-o", folder, "--resume")[1]["runs"] == 2
    assert len(table(folder)) == 2
    assert len((folder / "runs.jsonl").read_text().splitlines()) == 7


def test_kill_9_costs_the_runs_in_flight_only(plan_file, start, campaign, tmp_path):
    """A long campaign is killed early; resumed is a shorter one, which has all that is done."""
    grid = {"trajectory": ["lecture", "circle", "figure_eight"]}
    path = plan_file(grid=grid, seeds=5000)
    folder = tmp_path / "killed"
    process = start(path, "-o", folder, "--workers", 2, start_new_session=True)
    log = folder / "runs.jsonl"
    until(lambda: log.exists() and log.stat().st_size)
    os.killpg(process.pid, signal.SIGKILL)
    process.communicate()
    with log.open("ab") as file:
        file.write(b'{"cell": "torn')
    logged_seeds = [row["seed"] for row in read_log(log)]
    seeds = max(logged_seeds) + 4
    path = plan_file(grid=grid, seeds=seeds)
    status, result, _ = campaign(path, "-o", folder, "--resume")
    assert (status, result["runs"], result["done"]) == (0, 3 * seeds, 3 * seeds)
    assert sum(1 for _ in read_log(log)) == 3 * seeds
    whole = tmp_path / "whole"
    campaign(path, "-o", whole)
    assert (whole / "results.csv").read_bytes() == (folder / "results.csv").read_bytes()


def test_ctrl_c_ends_cleanly(plan_file, start, tmp_path):
    path = plan_file(seeds=5000)
    process = start(path, "-o", tmp_path / "out", "--workers", 2, start_new_session=True)
    log = tmp_path / "out" / "runs.jsonl"
    until(lambda: log.exists() and log.stat().st_size)
    process.send_signal(signal.SIGINT)
    _, stderr = process.communicate(timeout=PATIENCE)
    assert process.returncode == 130
    assert "continue with --resume" in stderr
    assert "Traceback" not in stderr
    assert 0 < len(table(tmp_path / "out")) < 5000
    for name in ("summary.csv", "results.parquet"):  # they come with a campaign's last run
        assert not (tmp_path / "out" / name).exists()
    until(lambda: process_group_is_empty(process.pid))


def test_a_signal_interrupts_the_wait_for_a_run(plan_file, tmp_path, monkeypatch):
    # A lock of Python's may be held on to until the run is over: none is waited for.
    monkeypatch.setattr(signals, "_LONGEST_DELAY", math.inf)
    slow = {"command": "sleep 20", "dataset": "euroc", "estimate": "tum"}
    plan = load_plan(plan_file(seeds=1, estimators={"slow": slow}))

    def interrupt():
        while not any(tmp_path.glob("out/*")):  # the run's own folder
            time.sleep(0.01)
        os.kill(os.getpid(), signal.SIGINT)

    (tmp_path / "out").mkdir()
    signal_thread = threading.Thread(target=interrupt)
    rows = []
    todo = driver.tasks(plan, set(), 1)
    with closing(engine.local(1)(plan, todo, tmp_path / "out")) as batches:
        signal_thread.start()
        with pytest.raises(signals.Interrupted), signals.raise_signals():
            rows.extend(batches)
    signal_thread.join()
    assert rows == []


def process_group_is_empty(group):
    """Return whether no process of a group runs; one that has ended and waits for init does not."""
    states = subprocess.run(
        ["ps", "-o", "stat=", "-g", str(group)], capture_output=True, text=True, check=False
    ).stdout.split()
    return all(state.startswith("Z") for state in states)


def test_a_campaign_that_was_interrupted_before_its_first_run_resumes(
    plan_file, campaign, tmp_path, monkeypatch
):
    """The folder of the campaign holds the plan, and no empty tables."""
    path, folder = plan_file(), tmp_path / "out"

    def interrupted(*_):
        raise KeyboardInterrupt

    with monkeypatch.context() as patched:
        patched.setattr(engine, "work", interrupted)
        status, _, (line,) = campaign(path, "-o", folder)
    assert status == 130
    assert line.endswith(f"{folder} has the runs made so far; continue with --resume")
    assert sorted(entry.name for entry in folder.iterdir()) == [".lock", "plan.yaml"]
    status, result, lines = campaign(path, "-o", folder, "--resume")
    assert (status, result["done"], lines) == (0, 3, [])


@pytest.mark.parametrize(
    "line",
    [
        "[" * 100_000,
        '{"a":' * 100_000,
        "[1, 2]",
        "null",
        '{"cell": "all", "seed": "0", "estimator": "a", "status": "done", "digest": ""}',
        '{"cell": "all", "seed": 0, "estimator": "a", "digest": "x", "version": "0"}',
        '{"cell": {}, "seed": 0, "estimator": "a", "status": "done", "digest": "x", "version": ""}',
        "\x00\xff",
    ],
)
def test_a_line_of_the_log_that_is_no_run_is_made_again(plan_file, campaign, tmp_path, line):
    path, folder = plan_file(), tmp_path / "out"
    assert campaign(path, "-o", folder)[0] == 0
    whole = (folder / "results.csv").read_bytes()
    log = folder / "runs.jsonl"
    first_line, *later_lines = log.read_text().splitlines()
    log.write_text("\n".join([line, *later_lines, ""]), encoding="latin-1")
    status, result, lines = campaign(path, "-o", folder, "--resume")
    assert (status, result["done"], lines) == (0, 3, [])
    assert (folder / "results.csv").read_bytes() == whole
    for number in ("NaN", "Infinity", "1e999", "[1]"):
        log.write_text(
            "\n".join(
                [first_line.replace('"seed": 0', f'"seed": 0, "x": {number}'), *later_lines, ""]
            )
        )
        assert len(list(read_log(log))) == 2


def test_a_campaign_without_one_run_done_ends_with_status_1(plan_file, campaign, tmp_path):
    path = plan_file(estimators={"a": {"command": "false"}})
    junit = tmp_path / "ci" / "junit.xml"
    status, result, lines = campaign(path, "-o", tmp_path / "out", "--workers", 1, "--junit", junit)
    assert (status, result["done"], result["failed"]) == (1, 0, 3)
    assert lines == ["campaign: no run is done: 3 x exit status 1"]
    (runs,) = ElementTree.parse(junit).findall("testsuite[@name='runs']")
    assert runs.attrib == {"name": "runs", "tests": "1", "failures": "0", "errors": "1"}
    assert runs.findtext("testcase/system-out") == "3 x exit status 1 (seeds 0, 1, 2)"


def test_json_and_junit_hold_what_fails_the_gate(plan_file, campaign, tmp_path):
    path = plan_file(seeds=8, require=["ate_rmse_m.max < 1e-9", "success >= 0.5"])
    assert campaign(plan_file("b.yaml", seeds=8), "-o", tmp_path / "before")[0] == 0
    junit = tmp_path / "junit.xml"
    gate_options = ("--baseline", tmp_path / "before", "--junit", junit)
    status, result, (line,) = campaign(path, "-o", tmp_path / "out", *gate_options)
    assert status == 3
    judgement = result["judgement"]
    assert line == f"campaign: {judgement['problems'][0]}"
    assert [requirement["met"] for requirement in judgement["requirements"]] == [False, True]
    assert judgement["baseline"][0]["verdict"] == "equal"
    suites = {suite.get("name"): suite for suite in ElementTree.parse(junit).getroot()}
    assert suites["requirements"].get("failures") == "1"
    assert "ate_rmse_m.max < 1e-9: is " in suites["requirements"].find(".//failure").get("message")
    assert suites["baseline"].findtext("testcase/system-out").startswith("equal: all; dead_reckon")


FAULT = {"kind": "stuck", "at": 0.5, "triad": "gyroscope"}
CRASHES = """import sys
data, out, seed = sys.argv[1:]
if int(seed):
    sys.exit("tracking lost")
rows = [row.split(",") for row in open(data + "/mav0/state_groundtruth_estimate0/data.csv")][1:]
with open(out, "w") as file:
    for row in rows:
        w, x, y, z = row[4:8]
        print(int(row[0]) * 1e-9, float(row[1]) + SHIFT, *row[2:4], x, y, z, w, file=file)
"""


def test_runs_that_crash_fail_the_gate_in_status_json_junit_and_page(plan_file, campaign, tmp_path):
    (tmp_path / "crashes.py").write_text(CRASHES.replace("SHIFT", "0.01"))
    statistics = ("mean", "median", "min", "p95", "max")
    require = [f"ate_rmse_m.{name} < 5" for name in statistics]
    require += ["ate_rmse_m.max of done < 5", "coverage.min >= 0", "success >= 0.5"]
    command = "{python} {plan}/crashes.py {dataset} {estimate} {seed}"
    path = plan_file(require=require, estimators={"mine": {"command": command}})
    junit, folder = tmp_path / "junit.xml", tmp_path / "out"
    status, result, lines = campaign(path, "-o", folder, "--junit", junit)
    assert (status, result["done"], result["failed"]) == (3, 1, 2)
    judged = result["judgement"]["requirements"]
    assert [requirement["met"] for requirement in judged] == [False] * 5 + [True, True, False]
    assert len(lines) == 6
    (suite,) = ElementTree.parse(junit).findall("testsuite[@name='requirements']")
    assert (suite.get("tests"), suite.get("failures")) == ("8", "6")
    (verdict, *_), *_ = [section.items for section in campaign_sections(folder)[1]]
    missed = verdict["requirements"]["missed"]
    messages = [failure.get("message") for failure in suite.iter("failure")]
    for requirement, line, message in zip(missed, lines, messages, strict=True):
        assert message == f"{requirement['requirement']}: {requirement['comment']}"
        assert line.startswith(f"campaign: require {requirement['requirement']}: ")
        assert line.endswith(f" {requirement['comment']} (all; mine)")
    assert all(
        requirement["comment"].endswith("over 1 of 3 runs; 2 runs have no value")
        for requirement in missed[:5]
    )


@pytest.mark.parametrize("require", [["ate_rmse_m.mean < 5"], []])
def test_a_gate_refuses_an_estimate_that_is_its_truth(plan_file, campaign, tmp_path, require):
    """Without a gate it is told."""
    (tmp_path / "copies.py").write_text(CRASHES.replace("SHIFT", "0.0"))
    command = "{python} {plan}/copies.py {dataset} {estimate} {seed}"
    path = plan_file(require=require, estimators={"mine": {"command": command}}, seeds=[0])
    junit = tmp_path / "junit.xml"
    status, result, lines = campaign(path, "-o", tmp_path / "out", "--junit", junit)
    (mistake,) = result["judgement"]["findings"]
    assert mistake["finding"].endswith("[estimate_equals_truth]")
    assert (status, len(lines)) == ((3, 1) if require else (0, 0))
    assert all("say nothing about the estimator" in line for line in lines)
    assert ("say nothing about the estimator" in junit.read_text()) == bool(require)


def test_power_says_how_many_seeds_it_takes(plan_file, capsys):
    """30 seeds find 10 % at 20 % of scatter in 48 % of campaigns, as the manual says."""
    path = str(plan_file(seeds=30))
    assert command([path, "--power", "10%", "--json"]) == 0
    power_result = json.loads(capsys.readouterr().out)
    assert power_result["power"] == pytest.approx(0.48, abs=0.03)
    assert power_result["seeds_needed"]["0.5"] == pytest.approx(32, abs=3)
    assert power_result["seeds_needed"]["0.8"] > 55
    assert command([path, "--power", "1 %"]) == 2
    assert command([path, "--power", "much"]) == 2
    assert command([path, "--power", "0.1", "--tolerance", "0.01"]) == 2
    assert command([path]) == 2
    lines = capsys.readouterr().err.splitlines()
    assert lines[0] == "campaign: --power 1 %: must be above the tolerance, 2 %"
    assert lines[-1] == "campaign: -o DIR: is needed, the folder of the results"


KILLER = """sh -c '
if [ {seed} = 7 ]; then kill -KILL $PPID; fi
for t in 1 2 3; do echo "$t 0 0 0 0 0 0 1"; done > estimate.txt
'"""


def test_a_worker_loads_numpy_and_yaml_and_no_other_library(plan_file):
    """Each costs every worker of a cluster its start: SciPy's statistics alone take 0.5 s."""
    estimators = {"plain": {}, "aligned": {"align": "se3"}}
    plan = load_plan(plan_file(rpe=["1s", "1m"], estimators=estimators))
    task = engine.Task(next(plan.cells()), (1, 2), tuple(estimators))
    with closing(engine.Processes()) as executor:
        rows = executor.submit(engine.work, plan, task, Path()).result()
        loaded = executor.submit(eval, "set(__import__('sys').modules)").result()
        environment = executor.submit(eval, "dict(__import__('os').environ)").result()
    assert [row["status"] for row in rows] == ["done"] * 4
    packages = {name.partition(".")[0] for name in loaded}
    assert {"numpy", "yaml"} <= packages
    assert (
        not {"scipy", "matplotlib", "pyarrow", "distributed", "cv2", "numba", "rosbags", "rclpy"}
        & packages
    )
    assert environment["OMP_NUM_THREADS"] == "1"


def test_workers_that_are_ended_leave_no_thread_to_the_end_of_the_interpreter():
    """Such a thread closes its pipe while the interpreter's end writes into it: OSError."""
    threads_before = set(threading.enumerate())
    executor = engine.Processes()
    futures = [executor.submit(time.sleep, 600) for _ in range(4)]
    executor.close()
    assert set(threading.enumerate()) == threads_before
    assert all(future.done() for future in futures)


def test_a_worker_that_dies_is_blamed_on_the_run_that_killed_it(plan_file, campaign, tmp_path):
    """The program of one seed kills its worker: that run fails, all others are done."""
    killer = {"command": KILLER, "align": "none", "coverage": 0.0}
    path = plan_file(seeds=12, retries=1, estimators={"killer": killer})
    status, result, _ = campaign(path, "-o", tmp_path / "out", "--workers", 2)
    statuses = {row["seed"]: row["status"] for row in table(tmp_path / "out")}
    assert (status, result["runs"], result["failed"]) == (0, 12, 1)
    assert statuses.pop("7") == "failed: the worker process died"
    assert set(statuses.values()) == {"done"}


def test_an_estimator_that_kills_its_worker_costs_no_other_one(plan_file, campaign, tmp_path):
    """Both run in the same task; the second never began while the first one killed the worker."""
    killer = KILLER.replace("{seed}", "7")
    estimators = {"killer": {"command": killer}, "good": {"type": "dead_reckon"}}
    path = plan_file(seeds=1, retries=1, estimators=estimators)
    assert campaign(path, "-o", tmp_path / "out", "--workers", 1)[0] == 0
    statuses = {row["estimator"]: row["status"] for row in table(tmp_path / "out")}
    assert statuses == {"killer": "failed: the worker process died", "good": "done"}


def test_the_baseline_finds_what_became_worse(plan_file, campaign, tmp_path):
    """Euler against midpoint on a perfect sensor: worse on every seed; the same is not."""
    parameters = {"rate": 100.0, "duration": 2.0, "imu": "perfect"}
    good = plan_file("good.yaml", seeds=12, parameters=parameters)
    baseline_folder = tmp_path / "before"
    assert campaign(good, "-o", baseline_folder)[0] == 0
    assert (
        campaign(good, "-o", tmp_path / "same", "--baseline", baseline_folder / "results.csv")[0]
        == 0
    )
    worse = plan_file(
        "worse.yaml",
        seeds=12,
        parameters=parameters,
        estimators={"dead_reckon": {"type": "dead_reckon", "method": "euler"}},
    )
    status, _, lines = campaign(worse, "-o", tmp_path / "worse", "--baseline", baseline_folder)
    assert status == 3
    assert len(lines) == 1
    assert lines[0].startswith("campaign: worse than the baseline: all; dead_reckon: ate_rmse_m ")
    assert lines[0].endswith(
        "larger (95 %: 54.96 to 54.96) than in the baseline, better on 0 of 12 seeds, p = 0.00049"
    )


def test_a_baseline_of_another_plan_is_refused(plan_file, campaign, tmp_path, capsys):
    """The message names the difference; other estimators, seeds and cells are no difference."""
    baseline_folder = tmp_path / "last"
    estimators = {"a": {}, "b": {"method": "euler"}}
    base = {"parameters": {"rate": 100.0, "duration": 2.0}, "grid": {"imu": ["bmi088", "perfect"]}}
    campaign(plan_file("last.yaml", estimators=estimators, **base), "-o", baseline_folder)
    alike = {
        "seeds": 2,
        "rpe": ["1s"],
        "tolerance": "5 %",
        "estimators": {"a": {"method": "euler"}},
    }
    path = plan_file("alike.yaml", **{**base, **alike})
    assert campaign(path, "-o", tmp_path / "alike", "--baseline", baseline_folder)[0] in (0, 3)
    base["estimators"] = {"a": {}}
    changed_plans = {
        "duration = 2.0 there and 1.5 here": {"parameters": {"rate": 100.0, "duration": 1.5}},
        "align = 'none' there and 'yaw' here": {"align": "yaw"},
        "diverged_above = 0.0 there and 9.0 here": {"diverged_above": 9.0},
        "estimators.a.coverage = 0.9 there and 0.5 here": {"estimators": {"a": {"coverage": 0.5}}},
        "faults = [] there and [(0.5, ": {"faults": [FAULT]},
    }
    for k, (difference, change) in enumerate(changed_plans.items()):
        path, folder = plan_file(f"{k}.yaml", **{**base, **change}), tmp_path / f"out_{k}"
        status, _, lines = campaign(
            path, "-o", folder, "--baseline", baseline_folder / "results.csv"
        )
        assert status == 2
        start = (
            f"campaign: --baseline {baseline_folder / 'results.csv'}: is of another plan: "
            "imu=bmi088; a: "
        )
        assert lines[0].startswith(start + difference)
        assert lines[0].endswith("--baseline-anyway compares with it all the same")
        assert not folder.exists()
    anyway = ("--baseline", baseline_folder, "--baseline-anyway")
    status, result, _ = campaign(path, "-o", folder, *anyway)
    assert status in (0, 3)
    (note,) = result["notes"]
    assert note.startswith(f"the baseline is of another plan: imu=bmi088; a: {difference}")
    page = [str(folder), "--baseline", str(baseline_folder), "-o", str(tmp_path / "page.html")]
    assert report_command(page) == 2
    assert "is of another plan: imu=bmi088; a: faults" in capsys.readouterr().err
    assert report_command([*page, "--baseline-anyway"]) == 0
    assert (
        f"The baseline {baseline_folder} is of another plan" in (tmp_path / "page.html").read_text()
    )


def test_a_table_without_its_plan_says_that_it_is_of_another_one(plan_file, campaign, tmp_path):
    campaign(plan_file("last.yaml"), "-o", tmp_path / "last")
    moved = tmp_path / "tables" / "moved.csv"
    moved.parent.mkdir()
    rows = (tmp_path / "last" / "results.csv").read_text()
    moved.write_text(rows)
    assert campaign(plan_file(), "-o", tmp_path / "same", "--baseline", moved)[0] == 0
    other_plan = plan_file("other.yaml", diverged_above=5.0)
    status, _, (line,) = campaign(other_plan, "-o", tmp_path / "other", "--baseline", moved)
    assert status == 2
    assert "its digests differ, and no plan.yaml next to it says by what" in line
    moved.write_text(rows.replace("scenario", "remark"))  # of an earlier version
    assert campaign(plan_file(), "-o", tmp_path / "again", "--baseline", moved)[0] == 0
    assert campaign(other_plan, "-o", tmp_path / "other", "--baseline", moved)[0] == 2


def test_the_terminal_says_how_runs_compare_with_the_baseline(plan_file, tmp_path, capsys):
    """Equal comparisons are printed, too: status 0 alone does not tell what was compared."""
    path = plan_file(seeds=6)
    common = [str(path), "--workers", "1", "--no-report"]
    assert command([*common, "-o", str(tmp_path / "last")]) == 0
    assert "baseline" not in capsys.readouterr().out
    again = ["-o", str(tmp_path / "now"), "--baseline", str(tmp_path / "last")]
    assert command([*common, *again]) == 0
    out = capsys.readouterr().out
    assert "Against the baseline: ate_rmse_m" in out
    assert re.search(r"all; dead_reckon +0 % larger \(95 %: 0 % to 0 %\) +1 +equal", out)


def test_a_campaign_in_python_is_that_of_the_command(plan_file, campaign, tmp_path):
    """The same rows and judgement; every wrong argument has a line."""
    plan = plan_file(seeds=3, parameters={"rate": 100.0, "duration": 2.0})
    assert campaign(plan, "-o", tmp_path / "command")[0] == 0
    outcome = job.campaign(
        plan,
        tmp_path / "python",
        metric="final_position_error_m",
        baseline=tmp_path / "command",
    )
    assert outcome.runs == list(read_log(tmp_path / "command" / "runs.jsonl"))
    assert (outcome.done, outcome.new, outcome.problems) == (3, 3, [])
    assert outcome.judgement.metric == "final_position_error_m"
    written = (tmp_path / "python" / "report.html").read_text(encoding="utf-8")
    assert '"compared with command"' in written
    assert '"metric":"final_position_error_m"' in written
    page = report(tmp_path / "python", tmp_path / "page.html")
    assert page.output.read_text(encoding="utf-8").startswith("<!DOCTYPE html>")
    with pytest.raises(InputError) as error:
        job.campaign(plan, tmp_path / "no", metric="x", resume=True, force=True)
    assert len(error.value.problems) == 2
    with pytest.raises(ConfigurationError, match="workers = 0: must be a number of processes"):
        job.campaign(plan, tmp_path / "no", workers=0)
    assert not (tmp_path / "no").exists()


def test_the_terminal_shows_bands_differences_and_sensitivities(plan_file, tmp_path, capsys):
    """A bias of the accelerometer alone: the error grows with its first power."""
    path = plan_file(
        parameters={
            "rate": 100.0,
            "duration": 2.0,
            "imu": "perfect",
            "imu.accelerometer_noise_density": 1e-3,
        },
        grid={"imu.accelerometer_bias": {"log_range": [0.1, 10.0, 3]}},
        seeds=8,
    )
    out = tmp_path / "out"
    assert command([str(path), "-o", str(out), "--workers", "1", "--no-report"]) == 0
    lines = [" ".join(line.split()) for line in capsys.readouterr().out.splitlines()]
    (sensitivity,) = (line for line in lines if line.startswith("imu.accelerometer_bias dead"))
    assert float(sensitivity.split()[2]) == pytest.approx(1.0, abs=0.01)
    band = anees_band(3, 8)
    assert sum(line.endswith(f"({band.low:.2f} - {band.high:.2f})") for line in lines) == 3
    assert any("Significant differences (3;" in line for line in lines)


def test_parquet_holds_what_csv_holds(plan_file, campaign, tmp_path):
    parquet = pytest.importorskip("pyarrow.parquet")
    path = plan_file(grid={"rate": [50, 100.0]}, parameters={"duration": 1.0})
    assert campaign(path, "-o", tmp_path)[0] == 0
    rows = parquet.read_table(tmp_path / "results.parquet").to_pylist()
    assert rows == read_results(tmp_path / "results.csv")
    assert rows == read_results(tmp_path / "results.parquet")
    assert len(rows) == 6
    # The types are the plan's, not the runs': tables of several campaigns can be joined.
    types = {
        field.name: str(field.type) for field in parquet.read_schema(tmp_path / "results.parquet")
    }
    assert types["seed"] == "int64"
    assert types["status"] == "string"
    assert types["ate_rmse_m"] == types["scale_error"] == types["rate"] == "double"


def test_parquet_has_all_kinds_of_values_without_pandas(tmp_path):
    """``pyarrow.array`` would load pandas, which takes as long as the import of all the rest."""
    parquet = pytest.importorskip("pyarrow.parquet")
    code = f"""
import sys
from pathlib import Path
from imu_sim_ros.campaigns.results import write_tables
rows = [
    {{"n": 2**62, "x": 1, "b": True, "s": "ä", "m": None, "mixed": 1}},
    {{"n": None, "x": 0.1, "b": None, "s": None, "m": None, "mixed": "a"}},
    {{"n": -1, "x": None, "b": False, "s": "", "m": None, "mixed": None}},
]
write_tables(Path({str(tmp_path)!r}), rows, list(rows[0]), {{"m"}})
assert "pandas" not in sys.modules
"""
    subprocess.run([sys.executable, "-c", code], check=True)
    table = parquet.read_table(tmp_path / "results.parquet")
    table.validate(full=True)
    kinds = ["int64", "double", "bool", "string", "double", "string"]
    assert [str(field.type) for field in table.schema] == kinds
    assert table.to_pylist() == [
        {"n": 2**62, "x": 1.0, "b": True, "s": "ä", "m": None, "mixed": "1"},
        {"n": None, "x": 0.1, "b": None, "s": None, "m": None, "mixed": "a"},
        {"n": -1, "x": None, "b": False, "s": "", "m": None, "mixed": None},
    ]


def test_the_folder_holds_plan_versions_and_page(plan_file, tmp_path, capsys):
    path = plan_file(name="two words.yaml")
    folder = tmp_path / "out"
    assert command([str(path), "-o", str(folder), "--workers", "1", "--quiet"]) == 0
    assert (folder / "plan.yaml").read_bytes() == path.read_bytes()
    versions = json.loads((folder / "versions.json").read_text())
    assert versions["numpy"] == np.__version__
    assert "two words.yaml&#x27; -o" in (folder / "report.html").read_text(encoding="utf-8")
    assert capsys.readouterr() == ("", "")


def test_a_disk_that_takes_no_more_is_told_in_a_line_and_costs_no_run(
    plan_file, start, campaign, tmp_path
):
    """A limit of 3000 bytes a file is hit by the table or the log, whatever is whole is kept."""
    path, folder = plan_file(seeds=3), tmp_path / "out"

    def limit():
        resource.setrlimit(resource.RLIMIT_FSIZE, (3000, 3000))

    process = start(path, "-o", folder, "--workers", 1, "--quiet", preexec_fn=limit)
    _, stderr = process.communicate(timeout=PATIENCE)
    assert process.returncode == 1
    assert stderr.startswith(f"campaign: {folder}: ")
    assert stderr.endswith("File too large\n")
    assert stderr.count("\n") == 1
    status, _, lines = campaign(path, "-o", folder, "--resume")
    assert (status, lines) == (0, [])
    assert len(table(folder)) == 3


def test_statuses_that_differ_in_numbers_are_counted_together():
    status_texts = [
        "diverged: 12.5 m at the end",
        "diverged: 1e+03 m at the end",
        "no estimate",
        "x 1",
    ]
    status_counts = counts([{"status": f"failed: {word}"} for word in status_texts])
    assert list(status_counts.items()) == [
        ("failed: diverged: ... m at the end", 2),
        ("failed: no estimate", 1),
        ("failed: x 1", 1),
    ]
    # Numbers that all have in common stay.
    status_texts = ["line 8: at most 1e+10 m is possible", "line 9: at most 1e+10 m is possible"]
    status_counts = counts([{"status": f"failed: {word}"} for word in status_texts])
    assert status_counts == {"failed: line ...: at most 1e+10 m is possible": 2}


def test_the_largest_plan_asks_first(plan_file, campaign, tmp_path):
    path = plan_file(
        grid={
            "imu.gyroscope_noise_density": {"log_range": [1e-4, 1e-2, 1000]},
            "imu.accelerometer_noise_density": {"log_range": [1e-4, 1e-2, 1000]},
        }
    )
    status, _, lines = campaign(path, "-o", tmp_path / "out")
    assert status == 2
    assert len(lines) == 1
    size_pattern = (
        r"the plan has 3,000,000 runs: at [\d.]+ ms each about [\d.]+ hours on 1 process; start it "
    )
    assert re.search(size_pattern + "with --yes$", lines[0])
    assert not (tmp_path / "out").exists()


def test_the_programs_limit_tells_how_long_a_large_plan_takes(plan_file, campaign, tmp_path):
    path = plan_file(seeds=200_000, estimators={"a": {"command": "true", "timeout": 90.0}})
    status, _, (line,) = campaign(path, "-o", tmp_path / "out", "--workers", 2)
    assert status == 2
    assert "at up to 90 s each about 2,500.0 hours on 2 processes" in line


def test_runs_are_made_in_the_order_of_the_plan(plan_file):
    plan = load_plan(plan_file(grid=GRID, seeds=3))
    todo = list(driver.tasks(plan, set(), 2))
    assert [task.seeds for task in todo] == [(0, 1), (2,)] * 4
    assert len({task.cell.name for task in todo}) == 4
    # The first tasks are small: they tell soon how long all of them take.
    growing = [len(task.seeds) for task in driver.tasks(plan, set(), 3, first_batch=1)]
    assert growing == [1, 2, 3, 3, 3]


def test_a_worker_needs_no_reader_of_bags():
    """The readers are most of the time that a worker takes to start."""
    code = (
        "import sys, imu_sim_ros.campaigns.runs\n"
        "readers = {'imu_sim_ros.formats.door', 'imu_sim_ros.bags.read'}\n"
        "sys.exit(bool(readers & set(sys.modules)))"
    )
    assert subprocess.run([sys.executable, "-c", code], check=False).returncode == 0
