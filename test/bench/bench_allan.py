# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Allan analysis: coverage and bias over many runs, barely visible walks, speed and memory.

Where all terms compete: bench_coverage.py.

``python test/bench/bench_allan.py [--runs 100] [--only coverage|walks|lecture|speed]``
"""

import argparse
import resource
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator, Sequence
from pathlib import Path

import numpy as np

from imu_sim_ros.calibration.noise.analysis import AllanResult, analyse
from imu_sim_ros.calibration.noise.estimate import AxisNoise, estimate
from imu_sim_ros.calibration.noise.gauss_markov import estimate_gauss_markov
from imu_sim_ros.calibration.noise.spectrum import SpectrumAccumulator
from imu_sim_ros.calibration.noise.truth import compare
from imu_sim_ros.core.records import Readings
from imu_sim_ros.sensors.samples import Samples
from imu_sim_ros.simulation.engine import Body
from imu_sim_ros.simulation.parameters import load_simulation
from imu_sim_ros.terminal.text_tables import print_table

HOUR = 3600.0
SENSORS: dict[str, dict[str, object]] = {
    "white alone": {
        "imu.gyroscope_noise_density": 1.0e-3,
        "imu.accelerometer_noise_density": 1.0e-2,
    },
    "white + walk": {"imu.preset": "lecture"},
    "white + flicker": {
        "imu.gyroscope_noise_density": 1.7e-4,
        "imu.gyroscope_bias_instability": 5.1e-5,
        "imu.accelerometer_noise_density": 2.0e-3,
        "imu.accelerometer_bias_instability": 6.0e-4,
    },
    "white + Gauss-Markov": {
        "imu.gyroscope_noise_density": 1.0e-3,
        "imu.gyroscope_gauss_markov_sigma": 3.0e-4,
        "imu.gyroscope_correlation_time": 100.0,
        "imu.accelerometer_noise_density": 1.0e-2,
        "imu.accelerometer_gauss_markov_sigma": 3.0e-3,
        "imu.accelerometer_correlation_time": 200.0,
    },
}
KEYS = {
    "white alone": ("noise_density", "bias_instability", "random_walk", "rate_ramp"),
    "white + walk": ("noise_density", "random_walk"),
    "white + flicker": ("noise_density", "bias_instability"),
    "white + Gauss-Markov": ("noise_density", "gauss_markov_sigma", "correlation_time"),
}


def simulation(values: dict[str, object], hours: float, rate: float, seed: int) -> Body:
    fixed = {
        "imu.preset": "perfect",
        "trajectory.type": "static",
        "duration": hours * HOUR,
        "rate": rate,
        "seed": seed,
    }
    return Body(load_simulation(fixed, values))


def estimates(run: Body, model: str) -> list[AxisNoise]:
    accumulator = SpectrumAccumulator(run.parameters.rate, 6)
    for block in (window["imu"] for window in run.windows()):
        accumulator.add(np.concatenate([block.gyro, block.accel], axis=1))
    accumulator.end_piece()
    spectrum = accumulator.result()
    chosen = estimate_gauss_markov if "Markov" in model else estimate
    return [chosen(spectrum, axis) for axis in range(6)]


def coverage(runs: int) -> None:
    """Print how often the 95 % intervals contain the truth, and the mean relative bias."""
    rows = []
    for model, values in SENSORS.items():
        analyses = [estimates(simulation(values, 2.0, 100.0, seed), model) for seed in range(runs)]
        imu = simulation(values, 2.0, 100.0, 0).parameters.imu
        for triad in range(2):
            name = ("gyroscope", "accelerometer")[triad]
            for key in KEYS[model]:
                truth = getattr(imu.triad(name), key)[0]
                cells = [run[3 * triad + k].estimates[key] for run in analyses for k in range(3)]
                coefficients = np.array([c.value for c in cells if c.value is not None])
                rows.append(
                    [
                        f"{model}: {name} {key}",
                        f"{truth:g}",
                        f"{100 * np.mean([c.covers(truth) for c in cells]):.1f} %",
                        f"{100 * (coefficients.mean() / truth - 1):+.2f} %" if truth else "",
                        f"{100 * coefficients.std() / truth:.2f} %" if truth else "",
                        f"{len(cells) - len(coefficients)} of {len(cells)}",
                    ]
                )
    header = ["2 h at 100 Hz", "truth", "covered", "mean bias", "spread", "bounds only"]
    print_table(header, rows, f"Coverage of 95 % intervals: seeds 0..{runs - 1}, three axes each")


def walks(runs: int) -> None:
    """Print what becomes of random walks that are hardly visible in 3 h at 100 Hz."""
    rows = []
    for walk in (2e-5, 2e-6, 2e-7):
        values: dict[str, object] = {
            "imu.gyroscope_noise_density": 1e-3,
            "imu.gyroscope_random_walk": walk,
            "imu.accelerometer_noise_density": 1e-3,
            "imu.accelerometer_random_walk": walk,
        }
        cells = [
            noise.estimates["random_walk"]
            for seed in range(runs)
            for noise in estimates(simulation(values, 3.0, 100.0, seed), "standard")
        ]
        coefficients = np.array([c.value for c in cells if c.value is not None])
        rows.append(
            [
                f"N = 1e-3, K = {walk:g}",
                f"{len(coefficients)} of {len(cells)}",
                f"{np.median(coefficients) / walk:.2f}" if len(coefficients) else "",
                f"{np.median([c.high for c in cells]) / walk:.2f}",
                f"{100 * np.mean([c.covers(walk) for c in cells]):.1f} %",
            ]
        )
    header = ["3 h at 100 Hz", "a value", "its median / K", "median upper end / K", "covered"]
    print_table(header, rows, f"Barely visible walks: seeds 0..{runs - 1}, six axes each")


def lecture() -> None:
    """Print the lecture's verification: 4 h at 200 Hz."""
    rows = []
    for seed in range(3):
        run = simulation({"imu.preset": "lecture"}, 4.0, 200.0, seed)
        result = analyse([_blocks(run)])
        cells = [c for c in compare(result, run.parameters.imu) if c.truth > 0.0]
        worst = max(
            abs(c.estimate.value / c.truth - 1.0)
            for c in cells
            if c.key == "noise_density" and c.estimate.value is not None
        )
        rows.append(
            [f"seed {seed}", f"{sum(c.covered for c in cells)} of {len(cells)}"]
            + [f"{100 * worst:.3f} %"]
            + [_triad(result, triad) for triad in range(2)]
        )
    header = ["4 h at 200 Hz", "covered", "worst N", "gyroscope K", "accelerometer K"]
    print_table(header, rows, "Lecture: N 0.015 / 0.019, K 5e-5 / 5e-4")


def _triad(result: AllanResult, triad: int) -> str:
    random_walks = [result.estimate(3 * triad + k, "random_walk") for k in range(3)]
    return " ".join(f"{e.value:.2e}" if e.value else f"<{e.high:.1e}" for e in random_walks)


def _blocks(run: Body) -> Iterator[Readings]:
    for window in run.windows():
        samples: Samples = window["imu"]
        yield Readings(samples.t_ns, samples.gyro, samples.accel)


def speed() -> None:
    """Print time and memory of the whole command, 2 h and 24 h at 200 Hz."""
    rows = []
    for hours, name in ((2, "x.mcap"), (2, "x.bag"), (24, "day.mcap")):
        with tempfile.TemporaryDirectory() as folder:
            bag = Path(folder) / name
            _run("generate", "--imu", "lecture", "--trajectory", "static", "--rate", "200",
                 "--duration", f"{hours}h", "--imu-only", "--quiet", "-o", str(bag))  # fmt: skip
            times = [
                _run("allan", str(bag), "-o", f"{folder}/allan_{k}", "--quiet")
                for k in range(3 if hours < 10 else 1)
            ]
        memory = resource.getrusage(resource.RUSAGE_CHILDREN).ru_maxrss / 1024.0
        rows.append([f"{hours} h at 200 Hz, {name}", f"{np.median(times):.2f} s", f"{memory:.0f}"])
    header = ["allan: read, deviation, fit, files, picture", "whole process", "peak MB so far"]
    print_table(header, rows, "Speed (allan_variance_ros: 63 s for 2 h, without a picture)")


def _run(command: str, *arguments: str) -> float:
    begin = time.perf_counter()
    subprocess.run([str(Path(sys.executable).with_name(command)), *arguments], check=True)
    return time.perf_counter() - begin


def main(argv: Sequence[str] | None = None) -> None:
    """Print the chosen tables."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--runs", type=int, default=100)
    parser.add_argument("--only", choices=("coverage", "walks", "lecture", "speed"))
    arguments = parser.parse_args(argv)
    if arguments.only in (None, "speed"):
        speed()
    if arguments.only in (None, "lecture"):
        lecture()
    if arguments.only in (None, "walks"):
        walks(max(arguments.runs // 5, 1))
    if arguments.only in (None, "coverage"):
        coverage(arguments.runs)


if __name__ == "__main__":
    main()
