# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Shifts of level, warm-ups and Gauss-Markov biases in a record at rest: named, and no walks."""

import numpy as np
import pytest
from scipy.signal import lfilter

from imu_sim_ros.calibration.noise.analysis import AllanResult, analyse
from imu_sim_ros.core.records import Readings

RATE, COUNT, DENSITY, FLICKER = 25.0, 90_000, 3e-4, 1e-4


def analysed(seed: int, signal: np.ndarray | float) -> AllanResult:
    """Return the analysis of an hour of white noise on six axes with a signal."""
    y = DENSITY * np.sqrt(RATE) * np.random.default_rng(seed).standard_normal((COUNT, 6)) + signal
    t_ns = 10**9 + np.round(np.arange(COUNT) * 1e9 / RATE).astype(np.int64)
    return analyse([[Readings(t_ns, y[:, :3], y[:, 3:] + [0.0, 0.0, 9.81])]], force=True)


def false_values(result: AllanResult, key: str) -> int:
    estimates = [result.estimate(axis, key) for axis in range(6)]
    assert all(estimate.low == 0.0 for estimate in estimates if estimate.value is None)
    return sum(estimate.value is not None for estimate in estimates)


def count_warnings(result: AllanResult, text: str) -> int:
    return sum(text in warning for warning in result.warnings)


@pytest.mark.parametrize("size", [3.0, 12.0])
def test_a_shift_of_level_is_taken_out_and_told(size):
    """No axis gets a random walk; of six bounds of 95 %, two fail once in 30 times."""
    step = size * DENSITY * (np.arange(COUNT) > 0.3 * COUNT)[:, None]
    result = analysed(1, step)
    assert count_warnings(result, "a shift of level of") == 6
    assert sum(result.estimate(axis, "random_walk").low > 0.0 for axis in range(6)) <= 1


@pytest.mark.parametrize("minutes", [1, 10, 60])
def test_a_warm_up_is_no_walk_and_no_ramp(minutes):
    """20 B: 59 of 60 axes had a walk, all a ramp. Of six, 5 % is less than one: at most one."""
    t = np.arange(COUNT)[:, None] / RATE
    result = analysed(2, 20.0 * FLICKER * np.exp(-t / (60.0 * minutes)))
    assert false_values(result, "random_walk") <= 1
    assert false_values(result, "rate_ramp") <= 1
    assert count_warnings(result, "a warm-up of") == 6 or minutes == 60


def test_a_warm_up_as_long_as_the_record_is_no_walk():
    """2 B over an hour: a ramp, nearly. Of 18 axes, 5 % is less than one; four are so in 1 %."""
    decay = 2.0 * FLICKER * np.exp(-np.arange(COUNT)[:, None] / RATE / 3600.0)
    results = [analysed(seed, decay) for seed in (11, 13, 15)]
    assert sum(false_values(result, "random_walk") for result in results) <= 3
    assert sum(false_values(result, "rate_ramp") for result in results) <= 3


@pytest.mark.parametrize("sigma", [5e-4, 2e-3])
def test_white_noise_holds_beside_a_gauss_markov_bias(sigma):
    """N was outside its interval in a third; of six of 95 %, fewer than four hold once in 500."""
    phi = np.exp(-1.0 / (20.0 * RATE))
    drive = np.random.default_rng(3).standard_normal((COUNT, 6)) * sigma * np.sqrt(1.0 - phi**2)
    result = analysed(4, lfilter([1.0], [1.0, -phi], drive, axis=0))
    assert sum(result.estimate(axis, "noise_density").covers(DENSITY) for axis in range(6)) >= 4
    assert count_warnings(result, "model='gauss_markov'") == 1
    assert count_warnings(result, "low-pass") == count_warnings(result, "sinusoid") == 0


def test_white_noise_has_no_signals():
    """No axis has a shift or a warm-up, which white noise has in one of 10^4 records."""
    result = analysed(5, 0.0)
    assert result.warnings == ()
