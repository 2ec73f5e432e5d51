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
from imu_sim_ros.calibration.twin.comparison import BANDS, Windows
from imu_sim_ros.jobs.twin_check import Check, check
from imu_sim_ros.terminal.text_tables import print_table

SEEDS = 20
"""Twins."""
FROM = (1.0, 5.0, 20.0)
"""[Hz] lowest frequency that a classifier sees."""


def many(twin: ims.Twin, seconds: float) -> Check:
    """Return a check with more twins: shares and drifts scatter from one to the next."""
    whole = twin.source.recording
    part = whole.part(float(whole.stamps[0]) + seconds, np.inf)
    return check(twin.source, part, twin.analysis, twin.parameters, SEEDS)


def drift(check: Check) -> str:
    """Return by how much a twin's dead reckoning errs more than that of the real sensor."""
    excess = 100.0 * (check.simulated_drift / check.real_drift - 1.0)
    return ", ".join(f"{value:+.0f}" for value in excess)


def shares(windows: Windows) -> list[str]:
    """Return how a classifier tells twin and real sensor, and real parts, apart: by frequencies."""
    columns = [6 * sum(1 for band in BANDS[1:] if band[0] < low) for low in FROM]
    rates = [windows.classification_rates(slice(first_column, None)) for first_column in columns]
    return [f"{100.0 * twin:.0f} % / {100.0 * real:.0f} %" for twin, real in rates]


def main(arguments: list[str]) -> None:
    """Run all and print."""
    if not arguments:
        print(__doc__)
        return
    if len(arguments) % 3:
        raise SystemExit(__doc__)
    rows = []
    for imu, truth, seconds in zip(*[iter(arguments)] * 3, strict=True):
        twin = ims.twin(imu, truth, fit=float(seconds))
        check = twin.check
        assert check is not None
        within = int(np.count_nonzero(np.abs(check.decibels) < 2.0))
        twins = many(twin, float(seconds))
        windows = twins.windows
        rows.append(
            [
                f"{seconds} + {check.seconds:.0f} s",
                *(f"{np.nanmax(np.abs(row)):.1f}" for row in check.decibels),
                f"{within}",
                drift(check),
                drift(twins),
                f"{min(map(len, (windows.fitted, windows.held_out, *windows.twins)))}",
                *shares(windows),
            ]
        )
        print(" | ".join(rows[-1]), flush=True)
        for line in twin.warnings:
            print(f"  {line}")
    bands = [f"{low:g}-{high:g} Hz" for low, high in BANDS]
    apart = [f"from {low:g} Hz" for low in FROM]
    head = ["", *bands, "within 2 dB", "drift [%]", f"of {SEEDS} twins", "windows", *apart]
    print_table(head, rows, "Largest difference in dB; told apart: twin / real parts")


if __name__ == "__main__":
    main(sys.argv[1:])
