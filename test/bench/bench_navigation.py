# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Dead reckoning and preintegration: throughput, orders of convergence, consistency."""

import statistics
import sys
import time
from collections.abc import Callable
from functools import partial
from pathlib import Path

import numpy as np

from imu_sim_ros.core import rotation
from imu_sim_ros.core.records import States
from imu_sim_ros.navigation.covariance import Covariance
from imu_sim_ros.navigation.dead_reckoning import dead_reckon
from imu_sim_ros.navigation.parameters import ATTITUDE_UPDATES, METHODS
from imu_sim_ros.navigation.preintegration import StepReadings, preintegrate
from imu_sim_ros.navigation.state import NavigationState, state_of_row, states_of
from imu_sim_ros.navigation.stepper import Stepper
from imu_sim_ros.sensors.imu.triads import TriadParameters, TriadsParameters
from imu_sim_ros.simulation.engine import Body
from imu_sim_ros.simulation.parameters import load_simulation
from imu_sim_ros.terminal.text_tables import print_table

SAMPLES = 2_000_000
STEPS = 40_000
AT_REST = NavigationState(np.zeros(3), np.zeros(3), [1.0, 0.0, 0.0, 0.0])
NOISE = TriadsParameters(
    TriadParameters(noise_density=(1.7e-4,) * 3, random_walk=(1.9e-5,) * 3),
    TriadParameters(noise_density=(2e-3,) * 3, random_walk=(3e-3,) * 3),
)


def readings(count: int) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return stamps and readings of a lively motion at 200 Hz."""
    t = np.arange(count)[:, None] * 0.005
    gyro = 0.5 * np.sin(t * [1.1, 1.7, 2.3])
    accel = np.sin(t * [3.1, 2.7, 2.3]) + np.array([0.0, 0.0, 9.81])
    return np.arange(count) * 5_000_000, gyro, accel


def median_time(work: Callable[[], object], repeat: int = 5) -> float:
    """Return the median duration of a call [s]."""
    times = []
    for _ in range(repeat):
        started = time.perf_counter()
        work()
        times.append(time.perf_counter() - started)
    return statistics.median(times)


def numpy_per_step(t_ns: np.ndarray, gyro: np.ndarray, accel: np.ndarray) -> np.ndarray:
    """Integrate by the midpoint method as one writes it down: the yardstick."""
    position, velocity, r = np.zeros(3), np.zeros(3), np.eye(3)
    gravity = np.array([0.0, 0.0, -9.81])
    for k, h in enumerate(np.diff(t_ns) * 1e-9):
        turn = 0.5 * (gyro[k] + gyro[k + 1]) * h
        angle = np.linalg.norm(turn)
        s = rotation.skew(turn)
        exponential = (
            np.eye(3)
            + np.sinc(angle / np.pi) * s
            + 0.5 * np.sinc(0.5 * angle / np.pi) ** 2 * (s @ s)
        )
        next_rotation = r @ exponential
        a = 0.5 * (r @ accel[k] + next_rotation @ accel[k + 1]) + gravity
        position = position + velocity * h + 0.5 * a * h * h
        velocity = velocity + a * h
        r = next_rotation
    return position


def throughput() -> None:
    """Print samples per second of every way, against NumPy per step."""
    few = readings(4000)
    base = 4000 / median_time(lambda: numpy_per_step(*few), 3)
    rows = [["NumPy per step, midpoint", "so3", f"{base / 1e3:,.0f}", "1"]]
    many, some = readings(SAMPLES), readings(STEPS)
    for method in METHODS:
        for attitude in ATTITUDE_UPDATES:
            record = some if attitude == "euler_angles" else many
            work = partial(dead_reckon, *record, AT_REST, method, attitude)
            rate = len(record[0]) / median_time(work)
            rows.append([f"arrays, {method}", attitude, f"{rate / 1e3:,.0f}", f"{rate / base:.0f}"])
    for method in METHODS:
        for attitude in ATTITUDE_UPDATES:
            rate = STEPS / median_time(partial(step_through, some, method, attitude), 3)
            rows.append(
                [f"stepper, {method}", attitude, f"{rate / 1e3:,.0f}", f"{rate / base:.0f}"]
            )
    print_table(["way", "attitude", "k samples/s", "ratio"], rows, "Dead reckoning")


def step_through(record: tuple[np.ndarray, ...], method: str, attitude: str) -> Stepper:
    """Feed a stepper, conversion to plain numbers included, as a node does."""
    stepper = Stepper(AT_REST, method, attitude)
    for t_ns, rate, force in zip(*(values.tolist() for values in record), strict=True):
        stepper.add(t_ns, rate, force)
    return stepper


def covariance_and_preintegration() -> None:
    """Print the time of a covariance step, and of preintegration per step."""
    covariance = Covariance(NOISE)
    force = np.array([0.0, 0.0, 9.81])

    def covariance_steps() -> None:
        for _ in range(2000):
            covariance.step(0.005, np.eye(3), force)

    rows = [["covariance, one step", f"{median_time(covariance_steps) / 2000 * 1e6:.1f}"]]
    for batch in (1, 100):
        _, gyro, accel = readings(201)
        repeated = StepReadings(
            np.full((batch, 200), 0.005),
            np.tile(gyro, (batch, 1, 1)),
            np.tile(accel, (batch, 1, 1)),
        )
        for noise, label in ((None, "Jacobians"), (NOISE, "Jacobians and covariance")):
            duration = median_time(partial(preintegrate, repeated, noise), 3)
            rows.append(
                [
                    f"preintegration of {batch} x 200 readings, {label}, per reading",
                    f"{duration / batch / 200 * 1e6:.1f}",
                ]
            )
    print_table(["work", "us"], rows, "Covariance and preintegration")


RATES = (100.0, 200.0, 400.0, 800.0, 1600.0)


def errors_of(trajectory: str, rate: float, method: str, attitude: str) -> tuple[float, float]:
    """Return final errors of position and attitude of ideal readings over 9.3 s."""
    values = {"imu.preset": "perfect", "trajectory.type": trajectory, "rate": rate}
    simulation = Body(load_simulation({**values, "duration": 9.3 + 1.0 / rate}))
    block = simulation.next(round(9.3 * rate) + 1)["imu"]
    motion = block.motion
    truth = states_of(block.t_ns, motion.position, motion.velocity, motion.q_wb)
    states = dead_reckon(
        block.t_ns, block.gyro, block.accel, state_of_row(truth, 0), method, attitude
    )
    turn = rotation.multiply(rotation.conjugate(states.q_wb[-1]), truth.q_wb[-1])
    return (
        float(np.linalg.norm(states.position[-1] - truth.position[-1])),
        float(np.linalg.norm(rotation.log(turn))),
    )


def order(rates: tuple[float, ...], errors: list[float]) -> str:
    """Return the order that errors over step sizes show; below rounding there is none."""
    if min(errors) < 1e-11:
        return "exact"
    return f"{-np.polyfit(np.log(rates), np.log(errors), 1)[0]:.2f}"


def orders() -> None:
    """Print the orders of convergence over five step sizes."""
    rows = []
    for method in METHODS:
        for attitude in ATTITUDE_UPDATES:
            row = [method, attitude]
            for trajectory in ("lecture", "coning", "excitation"):
                errors = [errors_of(trajectory, rate, method, attitude) for rate in RATES]
                row += [order(RATES, [error[k] for error in errors]) for k in (0, 1)]
                row.append(f"{errors[1][0]:.2g}")
            rows.append(row)
    row = ["rk4, linear readings", "so3", *linear_orders()]
    header = ["method", "attitude"]
    for trajectory in ("lecture", "coning", "excitation"):
        header += [f"{trajectory} p", "q", "m at 200 Hz"]
    print_table(header, rows, "Orders of convergence of position and attitude, 100 to 1600 Hz")
    print(f"rk4 on readings that are linear in time: {row[2]} (position), {row[3]} (attitude)")


def linear_orders() -> list[str]:
    """Return the orders of rk4 on readings that are what it takes them for."""
    start = NavigationState(np.zeros(3), np.array([1.0, 2.0, 3.0]), np.array([1.0, 0, 0, 0]))

    def run(rate: float) -> States:
        t_ns = np.round(np.arange(round(2 * rate) + 1) * 1e9 / rate).astype(np.int64)
        t = (t_ns * 1e-9)[:, None]
        gyro = np.array([0.5, -0.8, 0.3]) + t * np.array([0.9, 0.4, -1.1])
        accel = np.array([1.0, -2.0, 9.0]) + t * np.array([-3.0, 2.0, 1.5])
        return dead_reckon(t_ns, gyro, accel, start, "rk4", "so3")

    rates = (10.0, 20.0, 40.0, 80.0, 160.0)
    exact = state_of_row(run(4000.0), -1)
    ends = [state_of_row(run(rate), -1) for rate in rates]
    position = [float(np.linalg.norm(end.position - exact.position)) for end in ends]
    attitude = [
        float(
            np.linalg.norm(rotation.log(rotation.multiply(rotation.conjugate(e.q_wb), exact.q_wb)))
        )
        for e in ends
    ]
    return [order(rates, position), order(rates, attitude)]


def main() -> None:
    """Print all tables."""
    throughput()
    covariance_and_preintegration()
    orders()


if __name__ == "__main__":
    sys.path.insert(0, str(Path(__file__).parents[2]))
    main()
