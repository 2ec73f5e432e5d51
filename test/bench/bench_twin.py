# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Digital twins of sensors that are known in every parameter, over many seeds and four motions.

``python test/bench/bench_twin.py [--runs 20]``
"""

import argparse
import time

import numpy as np

import imu_sim_ros as ims
from imu_sim_ros.calibration.twin import model
from imu_sim_ros.commands.common import print_table
from imu_sim_ros.rotation import exp, from_matrix, log, to_matrix

MOTIONS = ("lecture", "figure_eight", "excitation", "target")
BANDS = {
    "band_low": [25.0],
    "band_high": [40.0],
    "band_density": [0.002, 0.001, 0.002, 0.04, 0.02, 0.05],
}
GROUPS = {
    "offset, skew": slice(0, 2),
    "mounting": model.MOUNTING,
    "gyroscope": model.GYROSCOPE,
    "accelerometer": model.ACCELEROMETER,
    "g-sensitivity": model.G_SENSITIVITY,
    "lever arm": model.LEVER_ARM,
    "bias": model.BIAS,
    "truth": slice(model.CURVATURE.start, model.WORLD.stop),
}
NOISE = np.repeat([1.7e-4, 2e-3], 3)


def sensor(seed: int) -> model.Errors:
    """Return the constant errors of one sensor."""
    rng = np.random.default_rng(seed)
    accelerometer = np.eye(3)
    accelerometer[model.UPPER] += 0.01 * rng.standard_normal(6)
    return model.Errors(
        to_matrix(exp(0.5 * rng.standard_normal(3))),
        np.eye(3) + 0.01 * rng.standard_normal((3, 3)),
        accelerometer,
        1e-4 * rng.standard_normal((3, 3)),
        0.1 * rng.standard_normal(3),
        np.concatenate([0.02 * rng.standard_normal(3), 0.1 * rng.standard_normal(3)]),
        0.005 * rng.standard_normal(),
        5e-5 * rng.standard_normal(),
        0.0,
        np.zeros(3),
    )


def run(motion: str, seed: int, duration: float) -> tuple[np.ndarray, np.ndarray, int, bool]:
    """Return errors in standard errors (42,), of white floors (6,), and what else was found."""
    true = sensor(seed)
    imu = {
        "preset": "perfect",
        "mounting": true.r_ib.T.ravel(),
        "lever_arm": true.lever_arm,
        "stamp_offset": true.offset,
        "clock_skew_ppm": 1e6 * true.skew,
        "gyroscope_bias": true.bias[:3],
        "gyroscope_scale_misalignment": true.gyroscope.ravel(),
        "gyroscope_g_sensitivity": true.g_sensitivity.ravel(),
        "gyroscope_noise_density": NOISE[0],
        "accelerometer_bias": true.bias[3:],
        "accelerometer_scale_misalignment": true.accelerometer.ravel(),
        "accelerometer_noise_density": NOISE[3],
        "vibration": {**BANDS, "line_frequency": [44.2], "line_amplitude": [0, 0.01, 0, 0.3, 0, 0]},
    }
    flight = ims.simulate(imu=imu, trajectory=motion, duration=duration, rate=100.0, seed=seed)
    twin = ims.twin(flight.readings, flight.truth)
    found, sigma = twin.analysis.fit.errors, twin.analysis.fit.sigma
    off = found.deviation() - true.deviation()
    off[model.MOUNTING] = log(from_matrix(found.r_ib @ true.r_ib.T))
    off[0] = twin.errors["stamp_offset"].value[0] - true.offset
    off[1] = 1e-6 * twin.errors["clock_skew_ppm"].value[0] - true.skew
    sigma = sigma.copy()
    sigma[0] = twin.errors["stamp_offset"].sigma[0]
    white = twin.analysis.white
    inside = (white.low <= NOISE) & (white.high >= NOISE)
    return off / sigma, inside, len(twin.analysis.lines.frequency), twin.clock_wander > 0.0


def main() -> None:
    """Run all and print."""
    parser = argparse.ArgumentParser()
    parser.add_argument("--runs", type=int, default=20)
    parser.add_argument("--duration", type=float, default=40.0)
    arguments = parser.parse_args()
    rows, header = [], ["", *GROUPS, "beyond 3", "largest", "floors held", "lines", "wander", "CPU"]
    for k, motion in enumerate(MOTIONS):
        start = time.process_time()
        # Each motion has noise of its own: rows of the table are independent.
        seeds = range(k * arguments.runs, (k + 1) * arguments.runs)
        runs = [run(motion, seed, arguments.duration) for seed in seeds]
        z = np.array([r[0] for r in runs])
        row = [motion]
        for part in GROUPS.values():
            share = 100.0 * np.mean(np.abs(z[:, part]) < 1.96)
            row.append(f"{share:.0f} % {np.sqrt(np.mean(z[:, part] ** 2)):.2f}")
        row += [f"{np.count_nonzero(np.abs(z) > 3.0)} of {z.size}", f"{np.abs(z).max():.1f}"]
        row.append(f"{100.0 * np.mean([r[1] for r in runs]):.0f} %")
        row += [f"{np.mean([r[2] for r in runs]):.2f}", f"{sum(r[3] for r in runs)}"]
        rows.append([*row, f"{(time.process_time() - start) / arguments.runs:.1f} s"])
        print(" | ".join(rows[-1]), flush=True)
    print_table(header, rows, "95 % intervals that hold the truth, and RMS in standard errors")


if __name__ == "__main__":
    main()
