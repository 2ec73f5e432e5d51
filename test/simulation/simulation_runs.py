# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Simulations with every term of the error model, for the tests of the engine."""

import hashlib
from collections.abc import Iterator

import numpy as np

from imu_sim_ros.sensors.samples import Samples, join_samples
from imu_sim_ros.simulation.engine import Body
from imu_sim_ros.simulation.parameters import load_simulation

TRIAD_TERMS = {
    "noise_density": 0.01,
    "random_walk": 1e-3,
    "gauss_markov_sigma": 0.01,
    "correlation_time": 10.0,
    "bias_instability": 1e-3,
    "rate_ramp": 1e-5,
    "bias": [0.01, -0.02, 0.03],
    "turn_on_bias_sigma": 0.01,
    "turn_on_scale_sigma": 0.01,
    "scale_error_percent": [1.0, -1.0, 0.5],
    "misalignment_percent": [0.1, 0.2, 0.3, 0.4, 0.5, 0.6],
    "quadratic": 1e-3,
    "temperature_bias": [1e-3, 2e-3, 3e-3, 1e-5, 2e-5, 3e-5],
    "temperature_scale": [1e-4, 2e-4, 3e-4],
    "bandwidth": [60.0, 40.0, 20.0],
    "range": 30.0,
    "resolution": 1e-3,
}
EVERY_TERM: dict[str, object] = {
    **{
        f"imu.{triad}_{name}": value
        for triad in ("gyroscope", "accelerometer")
        for name, value in TRIAD_TERMS.items()
    },
    "imu.gyroscope_g_sensitivity": [1e-4, 0, 0, 0, 2e-4, 0, 0, 1e-5, 3e-4],
    "imu.lever_arm": [0.1, 0.2, -0.3],
    "imu.mounting": [0, -1, 0, 1, 0, 0, 0, 0, 1],
    "imu.stamp_offset": 0.01,
    "imu.clock_skew_ppm": 50.0,
    "imu.clock_drift_ppm_per_hour": 5.0,
    "imu.jitter": 5e-4,
    "imu.latency": 2e-3,
    "imu.latency_jitter": 4e-3,
    "imu.dropout_probability": 0.02,
    "imu.dropout_burst_rate": 0.5,
    "imu.dropout_burst_duration": 0.1,
    "imu.duplicate_probability": 0.05,
    "temperature.profile": [0.0, 20.0, 5.0, 40.0, 15.0, 30.0],
    "temperature.time_constant": 3.0,
    "earth_rotation": True,
    "gravity_model": "wgs84",
    "latitude_deg": 48.0,
}
SAMPLES = 3000


def simulation(**values: object) -> Body:
    """Return a body at rest with the default IMU and these parameters."""
    return Body(load_simulation({"trajectory.type": "static", **values}))


def perfect(values: dict[str, object]) -> Body:
    """Return a body at rest with an IMU that has these errors alone."""
    return Body(load_simulation({"imu.preset": "perfect", "trajectory.type": "static", **values}))


def arrays(block: Samples) -> list[np.ndarray]:
    """Return all fields of the IMU in order, with ``delivered`` as indices of samples."""
    times = [block.true_t_ns, block.t_ns, block.release_t_ns, block.delivered + block.first]
    values = [value for name, value in block.values.items() if name != "motion"]
    return [*times, *values, *block.motion]


def first_windows(run: Body, size: int, count: int) -> Iterator[dict[str, Samples]]:
    """Yield the next ``count`` intervals of the IMU, ``size`` in a window."""
    for begin in range(0, count, size):
        yield run.next(min(size, count - begin))


def joined(run: Body, size: int, count: int = SAMPLES) -> list[np.ndarray]:
    """Return the fields of ``count`` samples as :func:`arrays` does, read in blocks of a size."""
    blocks = [arrays(window["imu"]) for window in first_windows(run, size, count)]
    return [np.concatenate(parts) for parts in zip(*blocks, strict=True)]


def fingerprint(run: Body, size: int) -> str:
    """Return a digest of all bytes of the samples, read in blocks of a size."""
    digest = hashlib.sha256()
    for values in joined(run, size):
        digest.update(np.ascontiguousarray(values).tobytes())
    return digest.hexdigest()


RANDOM_TERMS = {
    "white": {"imu.gyroscope_noise_density": 0.01},
    "walk": {"imu.gyroscope_random_walk": 0.01},
    "markov": {"imu.gyroscope_gauss_markov_sigma": 0.01, "imu.gyroscope_correlation_time": 5.0},
    "flicker": {"imu.gyroscope_bias_instability": 0.01},
    "turn-on": {"imu.gyroscope_turn_on_bias_sigma": 0.01},
}


def read_all(run: Body, size: int, count: int, quantity: str) -> Samples:
    """Return ``count`` samples of a sensor, read in windows of ``size``."""
    return join_samples([block[quantity] for block in first_windows(run, size, count)])


def same_bytes(a: Samples, b: Samples) -> bool:
    """Return whether two blocks hold the same samples."""
    columns = ([*samples[:4], *(samples.values[name] for name in a.values)] for samples in (a, b))
    return all(x.tobytes() == y.tobytes() for x, y in zip(*columns, strict=True))
