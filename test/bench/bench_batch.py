# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Processor time and memory of many sensors at once, next to white noise in NumPy and Gymnasium.

python test/bench/bench_batch.py [--json]
"""

import argparse
import json
import time
from collections.abc import Callable

import numpy as np

import imu_sim_ros as ims
from imu_sim_ros.sensors.imu.units import AHEAD

COUNT = 4096
IMUS = ("perfect", "bmi088", "mpu6000")


def best(work: Callable[[], object], steps: int, times: int = 5) -> float:
    """Return the shortest processor time of an environment and step [us]."""
    timings = []
    for _ in range(times):
        begin = time.process_time()
        work()
        timings.append(time.process_time() - begin)
    return min(timings) / steps / COUNT * 1e6


def resident() -> int:
    """Return the memory of this process [bytes]."""
    with open("/proc/self/statm", encoding="ascii") as file:
        return int(file.read().split()[1]) * 4096


def batch(imu: str) -> tuple[float, float]:
    """Return the time of an environment and step [us], and the memory of an environment [kB]."""
    gyro, accel = np.zeros((COUNT, 3)), np.tile([0.1, 0.2, 9.81], (COUNT, 1))
    baseline = resident()
    model: ims.ErrorModelBatch = ims.ErrorModel(imu=imu, rate=200, seed=1, count=COUNT)

    def steps() -> None:
        for k in range(AHEAD):
            model.read(k, gyro, accel)

    cost = best(steps, AHEAD)
    return cost, (resident() - baseline) / COUNT * 1e-3


def draws() -> float:
    """Return the time of the normal numbers of bmi088 alone [us]: twelve, AHEAD at a time."""
    rng, numbers = np.random.Generator(np.random.SFC64(1)), np.empty(AHEAD)

    def steps() -> None:
        for _ in range(12 * COUNT):
            rng.standard_normal(out=numbers)

    return best(steps, AHEAD)


def white() -> float:
    """Return the time of six normal numbers, scaled and added [us]."""
    rng, readings = np.random.default_rng(1), np.zeros((COUNT, 6))

    def steps() -> None:
        for _ in range(AHEAD):
            readings + 0.01 * rng.standard_normal((COUNT, 6))

    return best(steps, AHEAD)


def cart_poles() -> float | None:
    """Return the time of Gymnasium's vectorised step, a cart and pole [us]; None: not here."""
    try:
        import gymnasium
    except ImportError:
        return None
    environments = gymnasium.make_vec("CartPole-v1", COUNT, vectorization_mode="vector_entry_point")
    environments.reset(seed=1)
    actions = np.zeros(COUNT, dtype=np.int64)

    def steps() -> None:
        for _ in range(10):
            environments.step(actions)

    return best(steps, 10)


def main() -> None:
    """Measure and print."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--json", action="store_true")
    options = parser.parse_args()
    costs = {"draws_us": draws(), "white_us": white(), "cart_pole_us": cart_poles()}
    for imu in IMUS:
        costs[f"{imu}_us"], costs[f"{imu}_kb"] = batch(imu)
    if options.json:
        print(json.dumps(costs))
        return
    print(f"{COUNT} environments, processor time of one and a step")
    print(f"the random numbers of bmi088 alone: {costs['draws_us']:.3f} us")
    print(f"white noise in NumPy: {costs['white_us']:.3f} us")
    if costs["cart_pole_us"] is not None:
        print(f"Gymnasium's vectorised CartPole: {costs['cart_pole_us']:.3f} us")
    for imu in IMUS:
        print(f"{imu}: {costs[f'{imu}_us']:.3f} us, {costs[f'{imu}_kb']:.1f} kB an environment")


if __name__ == "__main__":
    main()
