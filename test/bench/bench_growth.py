# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Growth of time, bytes and memory with duration, rate, sensors, runs and workers.

    .venv/bin/python test/bench/bench_growth.py

Prints the tables of docs/explanation/cost.md. Programs are whole processes; a campaign on more
workers than there are cores is simulated from what its parts take here.
"""

import heapq
import math
import os
import shutil
import subprocess
import sys
import tempfile
import time
from collections.abc import Sequence
from pathlib import Path
from typing import NamedTuple

from imu_sim_ros.terminal.text_tables import print_table

DURATIONS = {"1 min": "1min", "10 min": "10min", "1 h": "1h", "4 h": "4h"}
RATES = (100, 200, 1000, 4000)
MOTION = ("--trajectory", "lecture")
LEVEL_MOTION = (
    *("--trajectory", "circle"),
    *("--set", "latitude_deg=48.0", "--set", "longitude_deg=11.0"),
)
"""Motion that wheels can follow, at a place on land."""
SENSORS = {
    "IMU": ["--topics", "imu/data_raw"],
    "IMU and ground truth": [],
    "and magnetometer, barometer": [
        *("--topics", "imu/data_raw,ground_truth/odom,imu/mag,imu/pressure")
    ],
    "and GNSS 10 Hz": ["--gnss", "ublox_m8"],
    "and wheels 50 Hz": ["--gnss", "ublox_m8", "--wheels", "husky_a200"],
    "every topic of the IMU": ["--topics", "all"],
}
RUNS = (20, 500)
WORKERS = (1, 2)
SIMULATED_RUNS = (1_000, 10_000, 100_000)
SIMULATED_WORKERS = (1, 10, 100)
TASK = 20
"""Runs in a task of a campaign on a cluster."""


class Cost(NamedTuple):
    """Costs of a program."""

    wall_s: float
    cpu_s: float
    """Processor time of the process and of its children [s]."""
    peak_mib: float
    """Largest resident memory of one process."""
    megabytes: float
    """Size of the output."""

    def cells(self) -> list[str]:
        """Return the cells of a table."""
        size = "" if math.isnan(self.megabytes) else f"{self.megabytes:.1f}"
        return [f"{self.wall_s:.2f}", f"{self.cpu_s:.2f}", f"{self.peak_mib:.0f}", size]


HEADER = ("wall s", "CPU s", "MiB", "MB written")


def cost(program: str, arguments: Sequence[str], output: Path) -> Cost:
    """Run a program of the package and return its costs."""
    command = [
        str(Path(sys.executable).with_name(program)),
        *arguments,
        "-o",
        str(output),
        "--force",
    ]
    begin = time.perf_counter()
    process = subprocess.Popen([*command, "--quiet"])
    _, status, usage = os.wait4(process.pid, 0)
    wall = time.perf_counter() - begin
    if status:
        raise SystemExit(f"{' '.join(command)}: status {os.waitstatus_to_exitcode(status)}")
    files = [output] if output.is_file() else output.rglob("*")
    size = sum(file.stat().st_size for file in files if file.is_file()) / 1e6
    if output.is_dir():
        shutil.rmtree(output)
    else:
        output.unlink()
    return Cost(wall, usage.ru_utime + usage.ru_stime, usage.ru_maxrss / 1024.0, size)


def generate(folder: Path, *options: str) -> Cost:
    """Return the costs of generating a flight."""
    return cost("generate", ["--imu", "mpu6000", *options], folder / "x.mcap")


def over_durations(folder: Path) -> None:
    """Print the costs of recordings of several lengths."""
    rows = [
        [label, *generate(folder, *MOTION, "--rate", "200", "--duration", duration).cells()]
        for label, duration in DURATIONS.items()
    ]
    print_table(["duration", *HEADER], rows, "generate, 200 Hz, Imu and ground truth, .mcap")


def over_rates(folder: Path) -> None:
    """Print the costs of 10 minutes at several rates."""
    rows = [
        [
            f"{rate} Hz",
            *generate(folder, *MOTION, "--rate", str(rate), "--duration", "10min").cells(),
        ]
        for rate in RATES
    ]
    print_table(["rate", *HEADER], rows, "generate, 10 min, Imu and ground truth, .mcap")


def over_sensors(folder: Path) -> None:
    """Print the costs of 10 minutes with more and more sensors."""
    run = (*LEVEL_MOTION, "--rate", "200", "--duration", "10min")
    rows = [
        [label, *generate(folder, *run, *options).cells()] for label, options in SENSORS.items()
    ]
    print_table(["sensors", *HEADER], rows, "generate, 10 min at 200 Hz, .mcap")


def over_runs(folder: Path) -> tuple[float, float]:
    """Print the costs of campaigns; return what a start and a run take on one worker [s]."""
    rows, walls = [], dict[tuple[int, int], Cost]()
    for count in RUNS:
        plan = folder / f"plan_{count}.yaml"
        plan.write_text(f"parameters: {{rate: 200, duration: 20, imu: mpu6000}}\nseeds: {count}\n")
        for workers in WORKERS:
            arguments = [str(plan), "--workers", str(workers)]
            walls[count, workers] = campaign_cost = cost("campaign", arguments, folder / "out")
            rows.append([f"{count} runs, {workers} workers", *campaign_cost.cells()])
    print_table(
        ["campaign", *HEADER], rows, "campaign of 20 s of mpu6000 at 200 Hz, dead reckoning"
    )
    few, many = (walls[count, 1].cpu_s for count in RUNS)
    run = (many - few) / (RUNS[1] - RUNS[0])
    return max(few - RUNS[0] * run, 0.0), run


def makespan(runs: int, workers: int, start: float, run: float, dispatch: float) -> float:
    """Return how long a campaign takes on a cluster [s].

    Each worker is ready after its start and takes the next task when it has none; the scheduler
    handles one task or result at a time.

    :param start: of a worker [s].
    :param run: processor time of a run [s].
    :param dispatch: of the scheduler for a task with its result [s].
    """
    free = [(start, k) for k in range(workers)]
    scheduler = end = 0.0
    remaining = runs
    while remaining:
        begin, k = heapq.heappop(free)
        scheduler = max(begin, scheduler) + dispatch
        count = min(TASK, remaining)
        remaining -= count
        done = scheduler + count * run
        end = max(end, done)
        heapq.heappush(free, (done, k))
    return end


def dispatch_time() -> float | None:
    """Return what Dask takes for a task with its result [s]; None if it is not installed."""
    try:
        from distributed import Client, LocalCluster
    except ImportError:
        return None
    count = 400
    with (
        LocalCluster(
            n_workers=1, threads_per_worker=1, processes=False, dashboard_address=None
        ) as cluster,
        Client(cluster) as client,
    ):
        client.gather(client.map(len, [()] * 20, pure=False))
        begin = time.process_time()
        client.gather(client.map(len, [()] * count, pure=False))
        return (time.process_time() - begin) / count


def over_workers(start: float, run: float) -> None:
    """Print how long campaigns take on more workers, and how well these are used."""
    dispatch = dispatch_time()
    if dispatch is None:
        print("Dask is not installed: no table over workers")
        return
    print(
        f"a run takes {run * 1e3:.1f} ms, a worker starts in {start:.2f} s, the scheduler needs "
        f"{dispatch * 1e3:.1f} ms for a task of {TASK} runs and is the limit from "
        f"{TASK * run / dispatch:.0f} workers on"
    )
    rows = []
    for runs in SIMULATED_RUNS:
        row = [f"{runs:,}"]
        for workers in SIMULATED_WORKERS:
            wall = makespan(runs, workers, start, run, dispatch)
            row.append(f"{wall:,.1f} s ({100.0 * runs * run / workers / wall:.0f} %)")
        rows.append(row)
    header = ["runs", *(f"{workers} workers" for workers in SIMULATED_WORKERS)]
    print_table(header, rows, "simulated campaign: time, and the share of it that workers compute")


def main() -> None:
    """Print all tables."""
    with tempfile.TemporaryDirectory(dir=os.environ.get("BENCH_FOLDER")) as name:
        folder = Path(name)
        over_durations(folder)
        over_rates(folder)
        over_sensors(folder)
        over_workers(*over_runs(folder))


if __name__ == "__main__":
    main()
