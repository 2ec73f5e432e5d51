# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Errors on MuJoCo's accelerometer and gyroscope: what goes in is recovered from what comes out."""

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from scipy import stats
from scripts import load_script

import imu_sim_ros as ims

mujoco = pytest.importorskip("mujoco")
EXAMPLE = Path(__file__).parents[2] / "examples/mujoco_imu.py"
RATE = 1000.0
RESTING = """
<mujoco>
  <option timestep="0.001" gravity="0 0 -9.81"/>
  <worldbody>
    <body quat="{q}" gravcomp="1"><joint type="slide"/><geom size="0.1"/><site name="imu"/></body>
  </worldbody>
  <sensor><gyro site="imu"/><accelerometer site="imu"/></sensor>
</mujoco>
"""
SIX = [  # +x, -x, +y, -y, +z, -z upwards
    *("0.7071067811865476 0 -0.7071067811865476 0", "0.7071067811865476 0 0.7071067811865476 0"),
    *("0.7071067811865476 0.7071067811865476 0 0", "0.7071067811865476 -0.7071067811865476 0 0"),
    *("1 0 0 0", "0 1 0 0"),
]


@pytest.fixture(scope="module")
def example() -> Any:
    return load_script(EXAMPLE)


def resting(q: str, seconds: float) -> np.ndarray:
    """Return MuJoCo's readings (n, 6) of a body at rest, held against gravity.

    A body without a joint reads 0: for MuJoCo it is part of the world.
    """
    model = mujoco.MjModel.from_xml_string(RESTING.format(q=q))
    data = mujoco.MjData(model)
    rows = np.empty((round(seconds * RATE), 6))
    for row in rows:
        mujoco.mj_step(model, data)
        row[:] = data.sensordata
    return rows


def stamps(count: int) -> np.ndarray:
    return np.arange(count, dtype=np.int64) * 1_000_000


def test_one_step_at_a_time_is_all_at_once(example: Any) -> None:
    """Over 6000 steps, more than a block of any kind has."""
    ideal, blocks = example.simulate(6.0, "mpu6000", 7)
    gyro, bias = np.concatenate([block.gyro for block in blocks]), blocks[-1].gyro_bias[0]
    t_ns = stamps(len(ideal))
    flight = ims.add_errors(t_ns, ideal[:, :3], ideal[:, 3:6], imu="mpu6000", seed=7)
    assert np.array_equal(flight.gyro, gyro)
    assert np.array_equal(flight.truth.gyro_bias[-1], bias)


def test_allan_recovers_the_noise_on_a_body_at_rest() -> None:
    ideal = resting("1 0 0 0", 60.0)
    sensor = {
        "preset": "perfect",
        "gyroscope_noise_density": [1e-3, 2e-3, 3e-3],
        "accelerometer_noise_density": [1e-2, 2e-2, 3e-2],
    }
    flight = ims.add_errors(stamps(len(ideal)), ideal[:, :3], ideal[:, 3:], imu=sensor, seed=2)
    recovered = ims.allan(flight)
    for triad, density in (("gyroscope", 1e-3), ("accelerometer", 1e-2)):
        value = getattr(recovered, triad).noise_density.value
        # 60,000 samples know the deviation to 1 / sqrt(120,000) = 0.3 %; three axes, 4 of them.
        assert np.abs(value / (density * np.array([1.0, 2.0, 3.0])) - 1.0).max() < 0.012


def test_calibrate_recovers_bias_scale_and_misalignment_of_six_positions() -> None:
    ideal = np.concatenate([resting(q, 5.0) for q in SIX])
    matrix = [1.02, 0.003, -0.002, 0.001, 0.98, 0.004, -0.005, 0.002, 1.01]
    sensor = {
        "preset": "perfect",
        "accelerometer_bias": [0.1, -0.2, 0.3],
        "accelerometer_scale_misalignment": matrix,
        "accelerometer_noise_density": 1e-3,
        "gyroscope_bias": [0.01, -0.02, 0.03],
    }
    t_ns = stamps(len(ideal))
    with pytest.warns(UserWarning, match="at rest upwards is .1.00, 0.00, 0.00. of the input"):
        flight = ims.add_errors(t_ns, ideal[:, :3], ideal[:, 3:], imu=sensor, seed=2)
    recovered = ims.calibrate_six_position(flight)
    # Each position's mean is known to 1e-3 / sqrt(5 s) = 4.5e-4 m/s^2; over 9.81 for the matrix.
    assert np.abs(recovered.accelerometer.bias.value - [0.1, -0.2, 0.3]).max() < 4 * 4.5e-4
    response = recovered.accelerometer.scale_misalignment.value
    assert np.abs(np.ravel(response) - matrix).max() < 4 * 4.5e-4 / 9.81
    assert np.allclose(recovered.gyroscope.bias.value, [0.01, -0.02, 0.03], atol=1e-9)


@pytest.mark.parametrize("seconds", [2, pytest.param(60, marks=pytest.mark.slow)])
def test_the_errors_of_dead_reckoning_are_as_large_as_stated(example: Any, seconds: int) -> None:
    """NEES at the end, of many seeds: chi squared of 3 runs in its 99.9 % band.

    Within a run it is correlated over time, so that only the seeds count. After 60 s the attitude
    is known to 0.1 rad, about as far as a covariance of first order holds.
    """
    ideal, _ = example.simulate(float(seconds), "mpu6000", 7)
    t_ns = stamps(len(ideal))
    truth = example.truth_of(ideal, t_ns)
    start = ims.NavigationState(truth.position[0], truth.velocity[0], truth.q_wb[0])
    perfect = ims.Readings(t_ns, ideal[:, :3], ideal[:, 3:6], "ideal")
    # What MuJoCo's steps and those of dead reckoning differ by grows with the square of the time;
    # the sensor's errors make 200 m in 60 s.
    off = ims.evaluate(ims.dead_reckon(perfect, initial=start), truth).rms_position
    assert off < 1e-4 * (seconds / 5.0) ** 2
    sensor = {
        "preset": "perfect",
        "gyroscope_noise_density": 1e-3,
        "accelerometer_noise_density": 1e-2,
        "gyroscope_random_walk": 1e-4,
        "gyroscope_turn_on_bias_sigma": 2e-3,
        "accelerometer_turn_on_bias_sigma": 2e-2,
    }
    runs = 40
    largest_errors = {"position": 0.0, "attitude": 0.0}
    for seed in range(runs):
        flight = ims.add_errors(t_ns, ideal[:, :3], ideal[:, 3:6], imu=sensor, seed=seed)
        track = ims.dead_reckon(flight, initial=start, covariance=True)
        nees = ims.evaluate(track, truth).nees
        for name in largest_errors:
            largest_errors[name] += nees[name]["final"]
    low, high = stats.chi2.ppf([0.0005, 0.9995], 3 * runs)
    for name, total in largest_errors.items():
        assert low < total < high, name
