# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Speed of errors on given readings: a sample at a time, in blocks, from MCAP to MCAP.

python test/bench/bench_error_model.py [--json]
"""

import argparse
import json
import tempfile
import time
from collections.abc import Callable
from pathlib import Path

import numpy as np

import imu_sim_ros as ims
from imu_sim_ros.commands import add_errors, generate

SAMPLES = 20_000
READINGS = 1_000_000


def best(work: Callable[[], object], clock: Callable[[], float], times: int = 3) -> float:
    """Return the shortest of several runs [s]."""
    timings = []
    for _ in range(times):
        begin = clock()
        work()
        timings.append(clock() - begin)
    return min(timings)


def single(imu: str) -> float:
    """Return the processor time of one sample at a time [us]."""
    gyro, accel = np.zeros(3), np.array([0.1, 0.2, 9.81])

    def work() -> None:
        model: ims.ErrorModel = ims.ErrorModel(imu=imu, rate=1000, seed=1)
        for k in range(SAMPLES):
            model.read(k * 1_000_000, gyro, accel)

    return best(work, time.process_time) / SAMPLES * 1e6


def arrays(imu: str) -> float:
    """Return readings a second of add_errors on arrays."""
    t_ns = np.arange(READINGS) * 1_000_000
    gyro, accel = np.zeros((READINGS, 3)), np.tile([0.1, 0.2, 9.81], (READINGS, 1))
    return READINGS / best(lambda: ims.add_errors(t_ns, gyro, accel, imu=imu), time.perf_counter)


def files(imu: str, *options: str) -> float:
    """Return readings a second from MCAP to MCAP."""
    with tempfile.TemporaryDirectory() as folder:
        source, target = Path(folder) / "ideal.mcap", Path(folder) / "noisy.mcap"
        arguments = ["--imu", "perfect", "--rate", "1000", "--duration", f"{READINGS / 1000}s"]
        generate.main(["-o", str(source), *arguments, "--imu-only", "--quiet"])
        run = [str(source), "-o", str(target), "--imu", imu, "--quiet", *options]
        # Not the time in which the system frees the gigabyte of the file before.
        timings = []
        for _ in range(3):
            target.unlink(missing_ok=True)
            timings.append(best(lambda: add_errors.main(run), time.perf_counter, 1))
        return READINGS / min(timings)


def main() -> None:
    """Measure and print."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--json", action="store_true")
    options = parser.parse_args()
    alone = ("--topics", "imu/data_raw", "--without", "imu/data_raw")
    single_us = {imu: single(imu) for imu in ("lecture", "bmi088", "mpu6000")}
    timings = {
        "arrays_per_s": arrays("bmi088"),
        "mcap_per_s": files("bmi088"),
        "mcap_readings_only_per_s": files("bmi088", *alone),
    }
    if options.json:
        print(json.dumps({"single_us": single_us, **timings}))
        return
    for imu, cost in single_us.items():
        print(f"ErrorModel.read, one sample, {imu}: {cost:.1f} us of processor time")
    print(f"add_errors, arrays: {timings['arrays_per_s'] / 1e6:.2f} M readings/s")
    print(f"MCAP to MCAP, with biases and ideal: {timings['mcap_per_s'] / 1e6:.2f} M readings/s")
    alone_per_s = timings["mcap_readings_only_per_s"]
    print(f"MCAP to MCAP, the readings alone: {alone_per_s / 1e6:.2f} M readings/s")


if __name__ == "__main__":
    main()
