# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Deterministic calibrations over many seeds: errors in standard errors, and the drift they save.

``python test/bench/bench_calibration.py [--runs 10]``
"""

import argparse
import time
from collections.abc import Callable, Sequence

import numpy as np

from imu_sim_ros.calibration.deterministic import correction as names
from imu_sim_ros.calibration.deterministic.positions import calibrate_six_position
from imu_sim_ros.calibration.deterministic.steady import find_steady
from imu_sim_ros.calibration.deterministic.temperature import calibrate_temperature, temperatures_at
from imu_sim_ros.calibration.deterministic.turntable import (
    calibrate_turntable,
    match_table_rates,
    specific_force,
)
from imu_sim_ros.navigation.dead_reckoning import dead_reckon
from imu_sim_ros.navigation.state import NO_CORRECTION, Correction, NavigationState
from imu_sim_ros.simulation.engine import Body
from imu_sim_ros.simulation.parameters import SimulationParameters, load_simulation
from imu_sim_ros.terminal.text_tables import print_table
from imu_sim_ros.trajectory.parameters import trajectory_layer

G = 9.81
SENSOR: dict[str, object] = {
    "imu.preset": "perfect",
    "imu.gyroscope_noise_density": 1.6968e-4,
    "imu.gyroscope_random_walk": 1.9393e-5,
    "imu.accelerometer_noise_density": 2.0e-3,
    "imu.accelerometer_random_walk": 3.0e-4,
    "imu.gyroscope_bias": [0.01, -0.02, 0.03],
    "imu.accelerometer_bias": [0.1, -0.2, 0.05],
    "imu.gyroscope_scale_error_percent": [1.0, -1.0, 0.5],
    "imu.gyroscope_misalignment_percent": [0.2, -0.3, 0.6, 0.1, -0.2, 0.4],
    "imu.accelerometer_scale_error_percent": [2.0, -1.5, 1.0],
    "imu.accelerometer_misalignment_percent": [0.4, -0.6, 0.3, 0.2, -0.5, 0.1],
    "imu.gyroscope_g_sensitivity": [1e-4, 2e-5, -3e-5, 1e-5, -2e-4, 4e-5, 0.0, 5e-5, 1.5e-4],
}
THERMAL: dict[str, object] = {
    "imu.gyroscope_temperature_bias": [2e-4, -1e-4, 3e-4, 1e-6, 0.0, -2e-6],
    "imu.accelerometer_temperature_bias": [1e-3, -2e-3, 5e-4],
    "imu.gyroscope_temperature_scale": [1e-4, 2e-4, -1e-4],
    "imu.accelerometer_temperature_scale": [-1e-4, 1e-4, 2e-4],
}


class Run:
    """The arrays of one simulated run."""

    def __init__(self, trajectory: str, seed: int, *layers: dict[str, object]) -> None:
        self.parameters: SimulationParameters = load_simulation(
            trajectory_layer(trajectory), SENSOR, *layers, {"seed": seed}
        )
        blocks = [window["imu"] for window in Body(self.parameters).windows()]
        self.t_ns = np.concatenate([b.t_ns for b in blocks])
        self.gyro = np.concatenate([b.gyro for b in blocks])
        self.accel = np.concatenate([b.accel for b in blocks])
        self.temperature = np.concatenate([b.temperature for b in blocks])
        self.motion = [b.motion for b in blocks]


def six_position(run: Run) -> names.Parameters:
    steady = find_steady(run.t_ns, run.gyro, run.accel)
    return names.six_position_parameters(calibrate_six_position(steady, G))


def turntable(run: Run) -> names.Parameters:
    steady = find_steady(run.t_ns, run.gyro, run.accel, rotating=True)
    table = match_table_rates(steady, np.array([0.5, 1.0, 2.0]))
    return names.turntable_parameters(calibrate_turntable(table.steady, table.rate, G))


def temperature(run: Run) -> names.Parameters:
    steady = find_steady(run.t_ns, run.gyro, run.accel)
    temperatures = temperatures_at(steady, run.t_ns, run.temperature)
    table = match_table_rates(steady, np.array([1.0]), temperatures)
    temperatures = temperatures_at(table.steady, run.t_ns, run.temperature)
    force = specific_force(table.steady, G)
    calibration = calibrate_temperature(table.steady, temperatures, table.rate, force, 25.0)
    return names.temperature_parameters(calibration)


RUNS: dict[str, tuple[Callable[[Run], names.Parameters], tuple[dict[str, object], ...]]] = {
    "six_position": (six_position, ()),
    "turntable": (turntable, ()),
    "temperature_soak": (temperature, (THERMAL,)),
    "temperature_ramp": (temperature, (THERMAL,)),
}


def recovery(runs: int) -> None:
    """Print the errors of each kind of parameter in its own standard errors."""
    rows = []
    for trajectory, (calibrate, layers) in RUNS.items():
        deviations: dict[str, list[float]] = {}
        seconds = []
        for seed in range(runs):
            run = Run(trajectory, seed, *layers)
            begin = time.perf_counter()
            values = calibrate(run)
            seconds.append(time.perf_counter() - begin)
            truth = names.true_parameters(run.parameters.imu, values)
            for name, estimate in values.items():
                sure = estimate.sigma > 0.0
                z = (estimate.value - truth[name])[sure] / estimate.sigma[sure]
                deviations.setdefault(name, []).extend(z.tolist())
        for name, scores in deviations.items():
            if scores:
                absolute = np.abs(scores)
                rows.append(
                    [
                        f"{trajectory}: {name}",
                        f"{len(scores)}",
                        f"{np.sqrt(np.mean(absolute**2)):.2f}",
                        f"{100 * np.mean(absolute < 3.0):.1f} %",
                        f"{absolute.max():.1f}",
                        f"{np.median(seconds):.2f}",
                    ]
                )
    header = ["recovered", "values", "rms error / s.e.", "within 3", "largest", "s per run"]
    print_table(header, rows, f"Closed loop, seeds 0..{runs - 1}")


def drift(runs: int) -> None:
    """Print the dead-reckoned drift on the lecture's trajectory before and after."""
    errors = []
    for seed in range(runs):
        values = six_position(Run("six_position", seed))
        values.update(turntable(Run("turntable", seed)))
        correction = Correction(**{name: tuple(v.value) for name, v in values.items()})
        run = Run("lecture", seed + 1000, {"duration": 20.0})
        m = run.motion[0]
        start = NavigationState(m.position[0], m.velocity[0], m.q_wb[0])
        final_position = run.motion[-1].position[-1]
        errors.append(
            [
                np.linalg.norm(
                    dead_reckon(
                        run.t_ns, run.gyro, run.accel, start, correction=parameters
                    ).position[-1]
                    - final_position
                )
                for parameters in (NO_CORRECTION, correction)
            ]
        )
    raw, calibrated = np.median(errors, axis=0)
    rows = [["median over seeds", f"{raw:.2f} m", f"{calibrated:.3f} m", f"{raw / calibrated:.0f}"]]
    header = ["final position error, 20 s", "uncorrected", "corrected", "ratio"]
    print_table(header, rows, "Drift that six_position and turntable take out")


def main(argv: Sequence[str] | None = None) -> None:
    """Print both tables."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--runs", type=int, default=10)
    arguments = parser.parse_args(argv)
    recovery(arguments.runs)
    drift(arguments.runs)


if __name__ == "__main__":
    main()
