# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Digital twins of sensors that are known in every parameter, with truths that are noisy.

Four motions, poses with white noise or rounded, many seeds: how often intervals hold the truth.

``python test/bench/bench_twin.py [--runs 20] [--motions lecture,...] [--poses 0,0.1,d4,...]``
"""

import argparse
import sys
import time
from pathlib import Path

import numpy as np

import imu_sim_ros as ims
from imu_sim_ros.calibration.twin import model
from imu_sim_ros.calibration.twin.fit import PRIOR
from imu_sim_ros.core.records import States
from imu_sim_ros.core.rotation import exp, from_matrix, log, multiply, normalise, rotate, to_matrix
from imu_sim_ros.jobs.twin import NAMES
from imu_sim_ros.terminal.text_tables import print_table

FLIGHT = Path(__file__).parents[3] / "shared" / "data" / "euroc_V1_02_medium_groundtruth.csv"
MOTIONS = {
    "figure_eight": "figure_eight",
    "excitation": "excitation",
    "lecture": "lecture",
}
if FLIGHT.is_file():
    MOTIONS["flight"] = str(FLIGHT)
POSES = ("0", "0.01", "0.1", "1", "d5", "d4", "d3")
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
DURATION, RATE = 30.0, 100.0


def sensor(seed: int) -> model.Errors:
    """Return the constant errors of one sensor, with scales as wide as the prior of a twin."""
    rng = np.random.default_rng(seed)
    response = np.eye(6)
    response[3:, 3:][model.UPPER] += PRIOR[model.ACCELEROMETER] * rng.standard_normal(6)
    mounting = to_matrix(exp(0.5 * rng.standard_normal(3)))
    response[:3, :3] += (PRIOR[model.GYROSCOPE] * rng.standard_normal(9)).reshape(3, 3)
    response[:3, 3:] = (PRIOR[model.G_SENSITIVITY] * rng.standard_normal(9)).reshape(3, 3)
    return model.Errors(
        mounting,
        response,
        0.1 * rng.standard_normal(3),
        np.concatenate([0.02 * rng.standard_normal(3), 0.1 * rng.standard_normal(3)]),
        0.005 * rng.standard_normal(),
        5e-5 * rng.standard_normal(),
        0.0,
        np.zeros(3),
    )


def spoiled(poses: ims.Odometry, kind: str, seed: int) -> States:
    """Return poses with noise of so many millimetres and milliradians, or of so many decimals.

    Before rounding, the world gets another origin and heading: each seed has other digits, and so
    another error of rounding.
    """
    position, q_wb = poses.position, poses.q_wb
    if kind.startswith("d"):
        rng = np.random.default_rng([seed, 2])
        heading = exp(np.array([0.0, 0.0, rng.uniform(-np.pi, np.pi)]))
        position = rotate(heading, position) + rng.uniform(-1.0, 1.0, 3)
        q_wb = multiply(heading, q_wb)
        position, q_wb = (np.round(x, int(kind[1:])) for x in (position, q_wb))
    else:
        rng = np.random.default_rng([seed, 1])
        noise = 1e-3 * float(kind) * rng.standard_normal((len(q_wb), 6))
        position, q_wb = position + noise[:, 3:], multiply(q_wb, exp(noise[:, :3]))
    return States(poses.t_ns, position, normalise(q_wb))


def run(motion: str, kind: str, seed: int) -> tuple[np.ndarray, np.ndarray, int, bool]:
    """Return errors in standard errors (42,), whether floors (6,) are held, lines, and wander.

    Errors are NaN where a number is not given, and where the motion does not determine it.
    """
    true = sensor(seed)
    imu = {
        "preset": "perfect",
        "mounting": true.r_ib.T.ravel(),
        "lever_arm": true.lever_arm,
        "stamp_offset": true.offset,
        "clock_skew_ppm": 1e6 * true.skew,
        "gyroscope_bias": true.bias[:3],
        "gyroscope_scale_misalignment": true.response[:3, :3].ravel(),
        "gyroscope_g_sensitivity": true.response[:3, 3:].ravel(),
        "gyroscope_noise_density": NOISE[0],
        "accelerometer_bias": true.bias[3:],
        "accelerometer_scale_misalignment": true.response[3:, 3:].ravel(),
        "accelerometer_noise_density": NOISE[3],
        "vibration": {**BANDS, "line_frequency": [44.2], "line_amplitude": [0, 0.01, 0, 0.3, 0, 0]},
    }
    flight = ims.simulate(imu=imu, trajectory=motion, duration=DURATION, rate=RATE, seed=seed)
    twin = ims.twin(flight.readings, spoiled(flight.truth, kind, seed))
    fit, errors = twin.analysis.fit, twin.errors
    off = fit.errors.deviation() - true.deviation()
    off[model.MOUNTING] = log(from_matrix(fit.errors.r_ib @ true.r_ib.T))
    off[0] = errors["stamp_offset"].value[0] - true.offset
    off[1] = 1e-6 * errors["clock_skew_ppm"].value[0] - true.skew
    sigma = fit.sigma.copy()
    sigma[0] = errors["stamp_offset"].sigma[0]
    missing = [k for k, name in enumerate(NAMES) if name in twin.undetermined]
    off[missing] = np.nan
    off[~twin.given] = np.nan
    white = twin.analysis.white
    covered = (white.low <= NOISE) & (white.high >= NOISE)
    return off / sigma, covered, len(twin.analysis.lines.frequency), twin.clock_wander > 0.0


def row(motion: str, kind: str, seeds: range) -> list[str]:
    """Return a line of the table."""
    start = time.process_time()
    runs, refused = [], 0
    for seed in seeds:
        try:
            runs.append(run(MOTIONS[motion], kind, seed))
        except ims.InputError:
            refused += 1
    z = np.array([r[0] for r in runs])
    result = [motion, kind]
    for part in GROUPS.values():
        group = z[:, part][np.isfinite(z[:, part])]
        coverage, size = (
            (np.mean(np.abs(group) < 1.96), np.sqrt(np.mean(group**2))) if len(group) else (0, 0)
        )
        result.append(f"{100.0 * coverage:.0f} % {size:.2f}" if len(group) else "")
    finite = z[np.isfinite(z)]
    result += [f"{np.count_nonzero(np.abs(finite) > 3.0)} of {finite.size}"]
    result += [f"{np.abs(finite).max():.1f}", f"{100.0 * np.mean([r[1] for r in runs]):.0f} %"]
    result += [f"{np.mean([r[2] for r in runs]):.2f}", f"{sum(r[3] for r in runs)}", str(refused)]
    return [*result, f"{(time.process_time() - start) / len(seeds):.1f} s"]


def main() -> None:
    """Run all and print."""
    parser = argparse.ArgumentParser()
    parser.add_argument("--runs", type=int, default=20)
    parser.add_argument("--motions", default=",".join(MOTIONS))
    parser.add_argument("--poses", default=",".join(POSES))
    arguments = parser.parse_args()
    if "flight" not in MOTIONS:
        print(f"{FLIGHT}: missing, no row for it", file=sys.stderr)
    tail = ["beyond 3", "largest", "floors held", "lines", "wander", "refused", "CPU"]
    rows = []
    for motion in arguments.motions.split(","):
        for kind in arguments.poses.split(","):
            # Each cell has seeds of its own: rows of the table are independent.
            cell = 7 * list(MOTIONS).index(motion) + POSES.index(kind)
            first_seed = 1000 + 100 * cell
            rows.append(row(motion, kind, range(first_seed, first_seed + arguments.runs)))
            print(" | ".join(rows[-1]), flush=True)
    title = "95 % intervals that hold the truth, and RMS in standard errors"
    print_table(["", "poses", *GROUPS, *tail], rows, title)


if __name__ == "__main__":
    main()
