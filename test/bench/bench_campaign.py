# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Campaigns: runs per second against a plain loop, memory, the cost of a program, the page.

A run is 20 s of ``mpu6000`` at 200 Hz along the lecture's trajectory, dead-reckoned by midpoint and
compared with the truth, with its NEES.

    .venv/bin/python test/bench/bench_campaign.py [--runs 10000]
"""

import argparse
import math
import os
import resource
import shutil
import statistics
import subprocess
import sys
import tempfile
import time
from collections import Counter
from collections.abc import Callable, Sequence
from functools import partial
from pathlib import Path
from typing import NamedTuple, TypeVar

import numpy as np

import imu_sim_ros as ims
from imu_sim_ros.campaigns import campaign
from imu_sim_ros.campaigns.parameters import DeadReckonEstimator
from imu_sim_ros.campaigns.plan import load_plan
from imu_sim_ros.campaigns.reckoning import DeadReckoning
from imu_sim_ros.campaigns.results import read_log, write_tables
from imu_sim_ros.campaigns.run_files import write_dataset
from imu_sim_ros.campaigns.runs import CellRuns
from imu_sim_ros.jobs.report import write_campaign_page
from imu_sim_ros.navigation.covariance import POSITION, initial_covariance, propagate
from imu_sim_ros.navigation.evaluation import nees
from imu_sim_ros.navigation.state import states_of
from imu_sim_ros.simulation.engine import Body
from imu_sim_ros.simulation.parameters import load_simulation
from imu_sim_ros.terminal.text_tables import print_table

RATE, SECONDS, IMU = 200.0, 20.0, "mpu6000"
LOOP = 100
"""Runs of the plain loop, before and after the campaign."""
NO_OP = 40
BATCH = 20

Given = TypeVar("Given")
Made = TypeVar("Made")


class Cost(NamedTuple):
    """Time and memory of a process and all its workers."""

    wall_s: float
    cpu_s: float
    main_mb: float
    """Largest resident memory of the process itself."""
    worker_mb: float
    """Largest of any worker."""


def measured(command: list[str]) -> Cost:
    """Run a command to its end; memory is the kernel's own peak (VmHWM)."""
    started = time.perf_counter()
    process = subprocess.Popen(command)
    peaks: dict[int, float] = {}
    polls: Counter[int] = Counter()
    while True:
        pid, status, usage = os.wait4(process.pid, os.WNOHANG)
        if pid:
            break
        for process_id in (process.pid, *children(process.pid)):
            polls[process_id] += 1
            # A process that has just been forked still has its parent's memory.
            if polls[process_id] > 5:
                peaks[process_id] = max(peak_mb(process_id), peaks.get(process_id, 0.0))
        time.sleep(0.02)
    if status:
        raise SystemExit(f"{' '.join(command)}: status {os.waitstatus_to_exitcode(status)}")
    main = peaks.pop(process.pid)
    wall = time.perf_counter() - started
    return Cost(wall, usage.ru_utime + usage.ru_stime, main, max(peaks.values(), default=0.0))


def children(pid: int) -> list[int]:
    """Return the processes that a process has started."""
    try:
        return list(map(int, Path(f"/proc/{pid}/task/{pid}/children").read_text().split()))
    except OSError:
        return []


def peak_mb(pid: int) -> float:
    """Return VmHWM [MB]; 0 where the process has ended."""
    try:
        text = Path(f"/proc/{pid}/status").read_text()
    except OSError:
        return 0.0
    peak_lines = [line for line in text.splitlines() if line.startswith("VmHWM")]
    return int(peak_lines[0].split()[1]) / 1024.0 if peak_lines else 0.0


def plain_loop(first_seed: int, count: int, covariance: np.ndarray) -> tuple[float, float]:
    """Return wall time and CPU time of a run [s] in a loop over the public functions."""
    started, cpu = time.perf_counter(), time.process_time()
    for seed in range(first_seed, first_seed + count):
        flight = ims.simulate(imu=IMU, rate=RATE, duration=SECONDS, seed=seed)
        evaluation = ims.evaluate(ims.dead_reckon(flight), flight.truth)
        nees(evaluation.position[-1:], covariance)
    return (time.perf_counter() - started) / count, (time.process_time() - cpu) / count


def final_covariance() -> np.ndarray:
    """Return the covariance of the final position; it is the same for all seeds."""
    parameters = load_simulation({"imu.preset": IMU, "rate": RATE, "duration": SECONDS})
    block = Body(parameters).next(round(RATE * SECONDS))["imu"]
    motion, imu = block.motion, parameters.imu
    truth = states_of(block.true_t_ns, motion.position, motion.velocity, motion.q_wb)
    initial = initial_covariance(
        gyroscope_bias=imu.gyroscope.turn_on_bias_sigma,
        accelerometer_bias=imu.accelerometer.turn_on_bias_sigma,
    )
    covariance: np.ndarray = propagate(truth, block.ideal_accel, imu, initial)[0]
    return covariance[POSITION, POSITION]


def plan_file(folder: Path, seeds: int, estimators: str = "") -> Path:
    """Write the plan of so many runs."""
    path = folder / f"plan_{seeds}.yaml"
    path.write_text(
        f"parameters: {{rate: {RATE}, duration: {SECONDS}, imu: {IMU}}}\nseeds: {seeds}\n"
        + estimators
    )
    return path


def throughput(folder: Path, runs: int) -> None:
    """Print a campaign's time and memory, of a tenth of the runs and of all, and the loop's."""
    covariance = final_covariance()
    plain_loop(0, 3, covariance)
    loops = [plain_loop(0, LOOP, covariance)]
    rows = []
    program = str(Path(sys.executable).with_name("campaign"))
    for count in (runs // 10, runs):
        output = folder / f"out_{count}"
        command = [program, str(plan_file(folder, count)), "-o", str(output), "--quiet"]
        cost = measured(command)
        rows.append(
            [
                f"campaign, {count:,} runs on {os.cpu_count()} cores",
                f"{cost.wall_s:.1f}",
                f"{cost.wall_s / count * 1e3:.2f}",
                f"{cost.cpu_s / count * 1e3:.2f}",
                f"{cost.main_mb:.0f}",
                f"{cost.worker_mb:.0f}",
            ]
        )
    loops.append(plain_loop(LOOP, LOOP, covariance))
    wall, cpu = (statistics.mean(values) for values in zip(*loops, strict=True))
    rows.append(
        [
            "plain loop in one process",
            f"{wall * runs:.1f} ({2 * LOOP} made)",
            f"{wall * 1e3:.2f}",
            f"{cpu * 1e3:.2f}",
            "",
            "",
        ]
    )
    header = ["way", "wall s", "ms a run", "CPU ms a run", "main MB", "worker MB"]
    print_table(header, rows, f"{SECONDS:g} s of {IMU} at {RATE:g} Hz")
    print(f"the campaign is {wall * runs / cost.wall_s:.2f} times as fast as the loop")


def stages(folder: Path) -> None:
    """Print where the processor time of a run goes, in one process: the best of ten batches."""
    plan = load_plan(plan_file(folder, 300))
    runs = CellRuns(plan, next(plan.cells()))
    cell, name = runs.simulated, next(iter(plan.estimators))
    reckoning, estimator = DeadReckoning(cell), plan.estimators[name]
    assert isinstance(estimator, DeadReckonEstimator)
    list(runs.rows(plan.seeds[:5], [name], folder))
    best: dict[str, float] = {}

    def timed(stage: str, work: Callable[[Given], Made], inputs: Sequence[Given]) -> list[Made]:
        started = time.process_time()
        outputs = [work(element) for element in inputs]
        milliseconds = (time.process_time() - started) / len(inputs) * 1e3
        best[stage] = min(best.get(stage, math.inf), milliseconds)
        return outputs

    for batch_start in range(5, 205, BATCH):
        seeds = plan.seeds[batch_start : batch_start + BATCH]
        simulations = timed("random streams and sensor of a seed", cell.simulation, seeds)
        blocks = timed("its readings", lambda element: element.next(cell.total)["imu"], simulations)
        metrics = partial(reckoning.run, name, estimator)
        timed("dead reckoning, metrics, NEES", metrics, blocks)
        timed("a run as a whole", lambda seed: list(runs.rows([seed], [name], folder)), seeds)
    rows = [[stage, f"{milliseconds:.2f}"] for stage, milliseconds in best.items()]
    print_table(["part of a run", "CPU ms"], rows, "Processor time of a run")


def afterwards(folder: Path, runs: int) -> None:
    """Print the processor time of the tables and the page of all runs."""
    output = folder / f"out_{runs}"
    plan, rows = load_plan(output / "plan.yaml"), list(read_log(output / "runs.jsonl"))
    table = []
    previous = time.process_time()
    for step, work in (
        ("tables", lambda: write_tables(output, rows, campaign.columns(plan), plan.metrics)),
        ("summary", lambda: campaign.write_summary(output, plan, rows)),
        ("page", lambda: write_campaign_page(output, "", [], (None, None), "bench")),
    ):
        work()
        current = time.process_time()
        table.append([step, f"{current - previous:.2f}"])
        previous = current
    print_table(["after the runs", "CPU s"], table, f"Of {runs:,} runs")


def spent_so_far() -> tuple[float, float]:
    """Return wall time, and CPU time of this process and those that it has waited for [s]."""
    usages = [resource.getrusage(who) for who in (resource.RUSAGE_SELF, resource.RUSAGE_CHILDREN)]
    return time.perf_counter(), sum(usage.ru_utime + usage.ru_stime for usage in usages)


def no_op(folder: Path) -> None:
    """Print what a program that does nothing costs beyond simulation and dataset."""
    text = "estimators: {nothing: {command: 'true {dataset}'}}\n"
    plan = load_plan(plan_file(folder, NO_OP, text))
    runs = CellRuns(plan, next(plan.cells()))
    spent: dict[str, list[tuple[float, float]]] = {"with": [], "without": []}
    for seed in range(NO_OP):
        for way, times in spent.items():
            start_cost = spent_so_far()
            if way == "with":
                list(runs.rows([seed], ["nothing"], folder / "no_op"))
            else:
                place = folder / "alone"
                place.mkdir()
                cell = runs.simulated
                write_dataset(cell, "euroc", seed, place)
                shutil.rmtree(place)
            end_cost = spent_so_far()
            times.append((end_cost[0] - start_cost[0], end_cost[1] - start_cost[1]))
    rows = []
    for way, times in spent.items():
        wall, cpu = zip(*times, strict=True)
        label = "run of `true {dataset}`" if way == "with" else "simulation and dataset alone"
        rows.append(
            [label, f"{statistics.median(wall) * 1e3:.1f}", f"{statistics.mean(cpu) * 1e3:.1f}"]
        )
    print_table(["work", "wall ms, median", "CPU ms, mean"], rows, "A program that does nothing")


OPENED = """
import sys, time
from pathlib import Path
from selenium import webdriver
from selenium.webdriver.chrome.service import Service
import shutil
options = webdriver.ChromeOptions()
options.binary_location = shutil.which("chromium")
for flag in ("--headless=new", "--no-sandbox", "--disable-gpu", "--disable-dev-shm-usage"):
    options.add_argument(flag)
driver = webdriver.Chrome(options=options, service=Service(shutil.which("chromedriver")))
times = []
for _ in range(3):
    driver.get("about:blank")
    driver.get(Path(sys.argv[1]).resolve().as_uri())
    assert driver.execute_script("return 'ready' in document.documentElement.dataset")
    times.append(driver.execute_script(
        "const n = performance.getEntriesByType('navigation')[0]; return n.loadEventEnd"))
print(f"opens in {sorted(times)[1] / 1e3:.2f} s (median of three)")
driver.quit()
"""


def page(folder: Path, runs: int) -> None:
    """Print the size of the page of all runs, and how long a browser needs to open it."""
    path = folder / f"out_{runs}" / "report.html"
    print(f"report.html of {runs:,} runs: {path.stat().st_size / 1e6:.2f} MB", flush=True)
    if shutil.which("chromium") and shutil.which("chromedriver"):
        subprocess.run([sys.executable, "-c", OPENED, str(path)], check=False)


def main() -> None:
    """Print all tables."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--runs", type=int, default=10_000)
    runs = parser.parse_args().runs
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        stages(folder)
        throughput(folder, runs)
        afterwards(folder, runs)
        no_op(folder)
        page(folder, runs)


if __name__ == "__main__":
    main()
