# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Comparison of what was recovered with what was put in."""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from imu_sim_ros.calibration.noise.analysis import AllanResult
from imu_sim_ros.calibration.noise.estimate import Estimate
from imu_sim_ros.calibration.noise.gauss_markov import CORRELATION_TIME, SIGMA
from imu_sim_ros.config import ImuParameters, load_simulation
from imu_sim_ros.conventions import TRIADS

Array = NDArray[np.float64]


class Comparison(NamedTuple):
    """One parameter of one axis beside its truth."""

    axis: int
    key: str
    truth: float
    estimate: Estimate
    covered: bool


def load_truth(path: str) -> ImuParameters:
    """Return the IMU of a parameter file or of a name in config/imus.

    :raises ConfigurationError: for a file that cannot be read or does not fit.
    """
    return load_simulation({"imu.preset": path}).imu


def true_noise(imu: ImuParameters, rate: float) -> dict[str, Array]:
    """Return the true values by key, each (6,).

    The rounding of the readings to their resolution is white noise of its own: with steps of LSB
    the samples' variance grows by LSB^2 / 12.

    :param rate: samples per second [Hz].
    """

    def both(name: str) -> Array:
        return np.array([getattr(imu, f"{triad}_{name}") for triad in TRIADS]).reshape(6)

    rounding = both("resolution") ** 2 / (12.0 * rate)
    correlation_time = both(CORRELATION_TIME)
    density = both("gauss_markov_density") * np.sqrt(0.5 * correlation_time)
    return {
        "noise_density": np.sqrt(both("noise_density") ** 2 + rounding),
        "random_walk": both("random_walk"),
        "bias_instability": both("bias_instability"),
        "rate_ramp": np.abs(both("rate_ramp")),
        SIGMA: np.maximum(both(SIGMA), density),
        CORRELATION_TIME: correlation_time,
    }


def compare(result: AllanResult, imu: ImuParameters) -> list[Comparison]:
    """Return for each parameter that both the model and the sensor know whether it is covered.

    A Gauss-Markov process is not in the standard model, where it looks like flicker and walk; of
    such a sensor that model is held against the white noise only.
    """
    truth = true_noise(imu, result.timing.rate)
    comparisons = []
    for axis in range(6):
        stranger = SIGMA not in result.keys and truth[SIGMA][axis] > 0.0
        for key in ("noise_density",) if stranger else result.keys:
            if key in truth:
                found, value = result.estimate(axis, key), float(truth[key][axis])
                comparisons.append(Comparison(axis, key, value, found, found.covers(value)))
    return comparisons
