# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Coverage of Allan's 95 % intervals where samples are lost.

``python test/bench/bench_losses.py --seeds 100 --results FILE``

Records of an hour at 50 Hz with six different sums of terms go through the whole of ``allan``,
each with no sample lost, and with single ones and bursts lost; FILE is appended seed by seed.
"""

import argparse
import json
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Final, TypedDict

import numpy as np
from bench_coverage import exact_flicker
from numpy.typing import NDArray

from imu_sim_ros.calibration.noise.analysis import analyse
from imu_sim_ros.calibration.noise.estimate import KEYS, Estimate
from imu_sim_ros.core.records import Readings
from imu_sim_ros.terminal.text_tables import print_table

Array = NDArray[np.float64]

RATE: Final = 50.0
SECONDS: Final = 3600.0
LOSSES: Final = {
    "none": (0.0, 1),
    "2 %, single": (0.02, 1),
    "10 %, single": (0.1, 1),
    "10 %, bursts of 8": (0.1, 8),
    "10 %, bursts of 40": (0.1, 40),
}
AXES: Final = (
    {"noise_density": 1e-3, "bias_instability": 2e-4, "random_walk": 2e-5},
    {"noise_density": 1e-3, "random_walk": 5e-5},
    {"bias_instability": 5e-4},
    {"noise_density": 1e-2},
    {"noise_density": 1e-2, "quantisation": 1e-3},
    {"noise_density": 1e-2, "random_walk": 1e-4},
)
"""Truths; the last axis is behind a low-pass of a fifth of the rate."""


def readings(rng: np.random.Generator, n: int) -> Array:
    """Return (n, 6) readings of ``AXES``."""
    from scipy.signal import butter, sosfilt

    columns = []
    for terms in AXES:
        y = terms.get("noise_density", 0.0) * RATE**0.5 * rng.standard_normal(n)
        y += terms.get("random_walk", 0.0) / RATE**0.5 * np.cumsum(rng.standard_normal(n))
        y += terms.get("bias_instability", 0.0) * exact_flicker(n, rng, RATE)
        angle = rng.standard_normal(n + 1)
        columns.append(y + terms.get("quantisation", 0.0) * RATE * np.diff(angle))
    columns[5] = sosfilt(butter(2, 0.2 * RATE, fs=RATE, output="sos"), columns[5])
    return np.stack(columns, axis=1)


def delivered_rows(rng: np.random.Generator, n: int, share: float, burst: int) -> NDArray[np.bool_]:
    """Return (n,) which samples are there: each is lost with the same probability."""
    starts = np.flatnonzero(rng.random(n) < 1.0 - (1.0 - share) ** (1.0 / burst))
    lost = np.zeros(n, dtype=bool)
    for k in range(burst):
        lost[starts[starts + k < n] + k] = True
    lost[[0, -1]] = False
    return ~lost


class Coverage(TypedDict):
    """Coverage of the truth by the intervals of one axis."""

    losses: str
    axis: int
    seed: int
    covered: list[bool]
    estimates: list[Estimate]


def coverage(seed: int) -> Iterator[Coverage]:
    """Yield for each kind of loss and axis which intervals hold the truth."""
    n = int(SECONDS * RATE)
    y = readings(np.random.default_rng([seed, 1]), n)
    t_ns = np.round(np.arange(n) * 1e9 / RATE).astype(np.int64)
    for name, (share, burst) in LOSSES.items():
        keep = delivered_rows(np.random.default_rng([seed, 2]), n, share, burst)
        result = analyse([[Readings(t_ns[keep], y[keep, :3], y[keep, 3:])]])
        for axis, terms in enumerate(AXES):
            estimates = [result.estimate(axis, key) for key in KEYS]
            yield {
                "losses": name,
                "axis": axis,
                "seed": seed,
                "covered": [
                    bool(interval.covers(terms.get(key, 0.0)))
                    for interval, key in zip(estimates, KEYS, strict=True)
                ],
                "estimates": estimates,
            }


def table(rows: Sequence[Coverage]) -> None:
    """Print the shares that hold the truth, and the band that 95 % stays in by chance."""
    from scipy.stats import binom

    lines = []
    for name in LOSSES:
        for axis in [*range(len(AXES)), None]:
            some = [r["covered"] for r in rows if r["losses"] == name and axis in (r["axis"], None)]
            if not some:
                continue
            shares = [f"{100 * share:.1f}" for share in np.mean(some, axis=0)]
            low, high = binom.ppf([0.025, 0.975], len(some), 0.95) / len(some) * 100
            axis_label = "all" if axis is None else ", ".join(AXES[axis])
            lines.append([name, axis_label, str(len(some)), *shares, f"{low:.1f} .. {high:.1f}"])
    print_table(["lost", "terms", "intervals", *"QNBKR", "95 % by chance"], lines)


def main(argv: Sequence[str] | None = None) -> None:
    """Run what is missing, and print the table."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--seeds", type=int, default=2)
    parser.add_argument("--results", type=Path, help="is appended to, and continued from")
    arguments = parser.parse_args(argv)
    rows: list[Coverage] = []
    if arguments.results and arguments.results.exists():
        rows = [json.loads(line) for line in arguments.results.read_text().splitlines()]
    done = {row["seed"] for row in rows}
    for seed in sorted(set(range(arguments.seeds)) - done):
        new_rows = list(coverage(seed))
        rows += new_rows
        if arguments.results:
            with arguments.results.open("a", encoding="utf-8") as file:
                file.writelines(json.dumps(row) + "\n" for row in new_rows)
    table(rows)


if __name__ == "__main__":
    main()
