# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Twins of real flights against the part of each that they have not seen.

Readings and true poses as EuRoC's ``imu0/data.csv`` and ``state_groundtruth_estimate0/data.csv``
hold them, or any file that ``twin`` reads, and the seconds to fit:

``python test/bench/bench_real_twin.py IMU TRUTH SECONDS [IMU TRUTH SECONDS ...]``
"""

import sys

import numpy as np

import imu_sim_ros as ims
from imu_sim_ros.calibration.twin.comparison import BANDS, features, told_apart
from imu_sim_ros.text_tables import print_table

SHUFFLES = 5
FROM = (1.0, 5.0, 20.0)
"""[Hz] lowest frequency that a classifier sees."""


def shares(twin: ims.Twin) -> list[str]:
    """Return how a classifier tells twin and real sensor, and real parts, apart: by frequencies."""
    rate, fit = twin.source.recording.rate, twin.analysis.fit
    (_, held), (_, flown) = twin.flown()
    known = features(fit.residuals, twin.analysis.parts, rate)
    seen, simulated = (features(x, [slice(0, len(x))], rate) for x in (held, flown))
    result = []
    for low in FROM:
        first = 6 * sum(1 for band in BANDS[1:] if band[0] < low)
        pairs = [(simulated, seen), (known, seen)]
        mean = [
            100.0 * np.mean([told_apart(a[:, first:], b[:, first:], k) for k in range(SHUFFLES)])
            for a, b in pairs
        ]
        result.append(f"{mean[0]:.0f} % / {mean[1]:.0f} %")
    return result


def main(arguments: list[str]) -> None:
    """Run all and print."""
    if not arguments or len(arguments) % 3:
        raise SystemExit(__doc__)
    rows = []
    for imu, truth, seconds in zip(*[iter(arguments)] * 3, strict=True):
        twin = ims.twin(imu, truth, fit=float(seconds))
        check = twin.check
        within = int(np.count_nonzero(np.abs(check.decibels) < 2.0))
        drift = 100.0 * (check.simulated_drift / check.real_drift - 1.0)
        rows.append(
            [
                f"{seconds} + {check.seconds:.0f} s",
                *(f"{np.nanmax(np.abs(row)):.1f}" for row in check.decibels),
                f"{within}",
                ", ".join(f"{value:+.0f}" for value in drift),
                f"{100.0 * check.told_apart:.0f} % / {100.0 * check.real_told_apart:.0f} %",
                *shares(twin),
            ]
        )
        print(" | ".join(rows[-1]), flush=True)
        for line in twin.warnings:
            print(f"  {line}")
    bands = [f"{low:g}-{high:g} Hz" for low, high in BANDS]
    apart = [f"from {low:g} Hz" for low in FROM]
    head = ["", *bands, "within 2 dB", "drift [%]", "apart, 5 twins", *apart]
    print_table(head, rows, "Largest difference in dB; told apart: twin / real parts")


if __name__ == "__main__":
    main(sys.argv[1:])
