# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Speed of the samples by the error terms switched on, and memory of a long run."""

import resource
import statistics
import sys
import time
from pathlib import Path

from imu_sim_ros.simulation.engine import BLOCK_SIZE, Body
from imu_sim_ros.simulation.parameters import load_simulation
from imu_sim_ros.terminal.text_tables import print_table

sys.path.insert(0, str(Path(__file__).parents[1] / "simulation"))

from simulation_runs import EVERY_TERM, first_windows  # those of the tests of bit-identity

GNSS_INS_SIM = 447e3
"""samples/s of gnss-ins-sim, facts.md"""
CPP_PEER = 54e3
"""samples/s of vio_data_simulation (C++), facts.md"""
SAMPLES = 500_000
REPEATS = 5
MEBIBYTE = 2**20

CASES: dict[str, tuple[float, dict[str, object]]] = {
    "at rest, no errors": (0, {"imu.preset": "perfect", "trajectory.type": "static"}),
    "at rest, white + walk": (2e6, {"trajectory.type": "static"}),
    "lecture, no errors": (0, {"imu.preset": "perfect"}),
    "lecture, white + walk": (2e6, {}),
    "lecture, white + walk, averaged": (0, {"imu.sampling": "averaged"}),
    "lecture, mpu6000": (0, {"imu.preset": "mpu6000"}),
    "at rest, every term": (4e5, {**EVERY_TERM, "trajectory.type": "static"}),
    "lecture, every term": (4e5, EVERY_TERM),
    "lecture, every term, averaged": (0, {**EVERY_TERM, "imu.sampling": "averaged"}),
}


def samples_per_second(values: dict[str, object], size: int = BLOCK_SIZE) -> list[float]:
    """Return the speeds of a few runs, the lowest first; all six axes and the truth are made."""
    simulation = Body(load_simulation(values))
    simulation.next(2000)["imu"]  # imports, first chunks
    count = SAMPLES if size >= 1000 else SAMPLES // 20
    speeds = []
    for _ in range(REPEATS):
        start = time.process_time()
        for _ in first_windows(simulation, size, count):
            pass
        speeds.append(count / (time.process_time() - start))
    return sorted(speeds)


def cells(speeds: list[float]) -> list[str]:
    """Return the lowest, the median and the highest speed [k/s]."""
    return [f"{speed / 1e3:,.0f}" for speed in (speeds[0], statistics.median(speeds), speeds[-1])]


def growth() -> float:
    """Return by how many MiB ten million samples with every term raise the highest memory."""
    simulation = Body(load_simulation(EVERY_TERM))
    for _ in first_windows(simulation, BLOCK_SIZE, 200_000):
        pass
    baseline = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    for _ in first_windows(simulation, BLOCK_SIZE, 10_000_000):
        pass
    return (resource.getrusage(resource.RUSAGE_SELF).ru_maxrss - baseline) * 1024 / MEBIBYTE


def main() -> None:
    """Print the tables."""
    rows = []
    for name, (goal, values) in CASES.items():
        speeds = samples_per_second(values)
        speed = statistics.median(speeds)
        rows.append(
            [
                name,
                *cells(speeds),
                f"{goal / 1e3:,.0f}" if goal else "",
                f"{speed / GNSS_INS_SIM:.1f} x",
                f"{speed / CPP_PEER:.0f} x",
            ]
        )
    header = ["samples of 6 axes, one core", "lowest k/s", "median", "highest", "target"]
    header += ["gnss-ins-sim", "C++ peer"]
    print_table(header, rows, f"blocks of {BLOCK_SIZE}, {REPEATS} runs, processor time")
    rows = [
        [
            str(size),
            *cells(samples_per_second({}, size)),
            *cells(samples_per_second(EVERY_TERM, size)),
        ]
        for size in (10, 100, 1000, 8192, 65536)
    ]
    header = ["block size", "white + walk k/s", "median", "highest"]
    header += ["every term k/s", "median", "highest"]
    print_table(header, rows, "lecture's trajectory, lowest, median and highest")
    print(f"highest memory after 10 million samples with every term: {growth():+.1f} MiB")


if __name__ == "__main__":
    main()
