# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Small jobs: programs that are done within seconds, and single calls in a program of one's own.

``python test/bench/small/bench_small.py [--repeats 3]``; lowest, median and highest of the runs.
"""

import argparse
import statistics
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable, Sequence
from functools import partial
from pathlib import Path
from resource import RUSAGE_CHILDREN, getrusage

import numpy as np

import imu_sim_ros as ims
from imu_sim_ros.navigation.covariance import Covariance
from imu_sim_ros.navigation.dead_reckoning import dead_reckon
from imu_sim_ros.navigation.preintegration import StepReadings, preintegrate
from imu_sim_ros.navigation.state import NavigationState
from imu_sim_ros.sensors.imu.triads import TriadParameters, TriadsParameters
from imu_sim_ros.simulation.parameters import load_simulation
from imu_sim_ros.terminal.text_tables import print_table

FLIGHT = Path(__file__).parents[3].parent / "shared/data/euroc_V1_02_medium_groundtruth.csv"
STATIC = ["--trajectory", "static", "--imu", "lecture", "--rate", "200", "--imu-only"]
AT_REST = NavigationState(np.zeros(3), np.zeros(3), [1.0, 0.0, 0.0, 0.0])
NOISE = TriadsParameters(
    TriadParameters(noise_density=(1.7e-4,) * 3, random_walk=(1.9e-5,) * 3),
    TriadParameters(noise_density=(2e-3,) * 3, random_walk=(3e-3,) * 3),
)
SECOND = ["--duration", "1s", "-o"]


def programs(bag: str) -> dict[str, list[str]]:
    """Return command lines; ``{}`` is a new folder.

    :param bag: 2 h at 200 Hz.
    """
    command_lines = {
        "generate --help": ["generate", "--help"],
        "generate, 1 s, .mcap": ["generate", *SECOND, "{}/x.mcap"],
        "generate, 1 s, .bag": ["generate", *SECOND, "{}/x.bag"],
        "generate, 1 s, sqlite3": ["generate", *SECOND, "{}/x", "--storage", "sqlite3"],
        "generate, 1 s, EuRoC": ["generate", *SECOND, "{}/x", "--format", "euroc"],
    }
    if FLIGHT.is_file():
        along = [*SECOND, "{}/x.mcap", "--trajectory", str(FLIGHT)]
        command_lines["generate, 1 s along EuRoC V1_02"] = ["generate", *along]
    else:
        print(f"{FLIGHT}: missing, no row for it", file=sys.stderr)
    command_lines["allan, 2 h at 200 Hz, with files and picture"] = ["allan", bag, "-o", "{}/allan"]
    return command_lines


def run(command: Sequence[str], folder: str) -> tuple[float, float]:
    """Return wall and processor seconds of a program."""
    arguments = [word.replace("{}", folder) for word in command]
    usage_start, started = getrusage(RUSAGE_CHILDREN), time.perf_counter()
    subprocess.run(
        [str(Path(sys.executable).with_name(arguments[0])), *arguments[1:]],
        check=True,
        stdout=subprocess.DEVNULL,
    )
    wall, usage_end = time.perf_counter() - started, getrusage(RUSAGE_CHILDREN)
    return (
        wall,
        usage_end.ru_utime + usage_end.ru_stime - usage_start.ru_utime - usage_start.ru_stime,
    )


def of_programs(repeats: int) -> None:
    """Print the table of whole processes."""
    rows: list[list[str]] = []
    with tempfile.TemporaryDirectory() as top:
        bag = f"{top}/2h.mcap"
        run(["generate", *STATIC, "--duration", "2h", "--quiet", "-o", bag], top)
        for name, command in programs(bag).items():
            timings = []
            for k in range(repeats):
                folder = Path(top, f"{len(rows)}-{k}")
                folder.mkdir()
                timings.append(run(command, str(folder)))
            walls, used = zip(*timings, strict=True)
            rows.append([name, *cells(walls, 1.0, 2), f"{min(used):.2f}"])
    header = ["whole process, s", "lowest", "median", "highest", "CPU, least"]
    print_table(header, rows, f"Programs, {repeats} runs each")


def cells(values: Sequence[float], unit: float, digits: int) -> list[str]:
    """Return the lowest, the median and the highest."""
    chosen = (min(values), statistics.median(values), max(values))
    return [f"{value / unit:.{digits}f}" for value in chosen]


def timed(work: Callable[[], object], calls: int, repeats: int) -> list[float]:
    """Return the time of a call [s], as the mean of several, some times."""
    work()
    timings = []
    for _ in range(repeats):
        started = time.perf_counter()
        for _ in range(calls):
            work()
        timings.append((time.perf_counter() - started) / calls)
    return timings


def of_calls(repeats: int) -> None:
    """Print the table of calls in one process."""
    flight = partial(ims.simulate, imu="mpu6000", rate=200.0, duration=20.0, seed=1)
    simulated = flight()
    t = np.arange(201)[:, None] * 0.005
    gyro = 0.5 * np.sin(t * [1.1, 1.7, 2.3])
    accel = np.sin(t * [3.1, 2.7, 2.3]) + np.array([0.0, 0.0, 9.81])
    interval = StepReadings(np.full((1, 200), 0.005), gyro[None], accel[None])
    many = np.arange(40_000)
    long = (many * 5_000_000, np.resize(gyro, (40_000, 3)), np.resize(accel, (40_000, 3)))
    force, rate = np.array([0.1, 0.2, 9.81]), np.array([0.1, 0.2, 0.3])
    level = np.eye(3)
    simple = Covariance(NOISE)
    full_covariance = Covariance(load_simulation({"imu.preset": "mpu6000"}).imu)
    work: dict[str, tuple[Callable[[], object], int, float]] = {
        "20 s at 200 Hz of mpu6000: parameters and samples, ms": (
            flight,
            20,
            1e-3,
        ),
        "the same: dead reckoning, ms": (lambda: ims.dead_reckon(simulated), 20, 1e-3),
        "covariance, a step of 5 ms, us": (lambda: simple.step(0.005, level, force), 2000, 1e-6),
        "with every error of mpu6000, us": (
            lambda: full_covariance.step(0.005, level, force, rate),
            2000,
            1e-6,
        ),
        "preintegration, one interval, per reading, us": (
            lambda: preintegrate(interval, NOISE),
            10,
            200e-6,
        ),
        "dead reckoning by Euler angles, per reading, us": (
            lambda: dead_reckon(*long, AT_REST, "midpoint", "euler_angles"),
            1,
            40_000e-6,
        ),
    }
    rows = [
        [name, *cells(timed(call, calls, repeats), unit, 2)]
        for name, (call, calls, unit) in work.items()
    ]
    print_table(["call", "lowest", "median", "highest"], rows, f"Calls, {repeats} times each")


def main(argv: Sequence[str] | None = None) -> None:
    """Print both tables."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--repeats", type=int, default=3)
    repeats = parser.parse_args(argv).repeats
    of_calls(repeats)
    of_programs(repeats)


if __name__ == "__main__":
    main()
