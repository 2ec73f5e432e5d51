# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Constants that differ from unit to unit: their spread, their streams, what becomes of them."""

import dataclasses

import numpy as np
import pytest

from imu_sim_ros.core.conventions import TRIADS
from imu_sim_ros.parameters.sections import build, flatten
from imu_sim_ros.sensors.errors.realised import realise_imu, realise_unit
from imu_sim_ros.sensors.imu.parameters import ImuParameters
from imu_sim_ros.simulation.engine import Body
from imu_sim_ros.simulation.parameters import load_simulation

SEEDS = 200
SIGMAS = {
    "temperature_bias": 1e-3,
    "temperature_scale": 2e-4,
    "misalignment": 5e-3,
    "quadratic": 1e-4,
    "g_sensitivity": 2e-4,
}


def drawn(kind: str, seed: int) -> np.ndarray:
    """Return the numbers that a seed adds to a constant of the gyroscope."""
    imu = build(ImuParameters, {f"gyroscope_{kind}_sigma": SIGMAS[kind]})
    unit = realise_unit(imu.gyroscope, "gyroscope", seed)
    assert not any(getattr(unit, f"{kind}_sigma"))
    if kind == "misalignment":
        matrix = np.reshape(unit.scale_misalignment, (3, 3))
        assert np.diag(matrix) == pytest.approx(1.0)
        return matrix[~np.eye(3, dtype=bool)]
    return np.array(getattr(unit, kind))


@pytest.mark.parametrize("kind", SIGMAS)
def test_size_and_sign_differ_from_unit_to_unit(kind: str) -> None:
    """The variance of n numbers is known to sqrt(2 / n), the mean to 1 / sqrt(n); five of both."""
    values = np.array([drawn(kind, seed) for seed in range(SEEDS)]) / SIGMAS[kind]
    assert values.var() == pytest.approx(1.0, abs=5.0 * np.sqrt(2.0 / values.size))
    assert abs(values.mean()) < 5.0 / np.sqrt(values.size)
    correlation = np.corrcoef(values.T)
    correlation = correlation[~np.eye(len(correlation), dtype=bool)]
    assert np.abs(correlation).max() < 5.0 / np.sqrt(SEEDS)


def test_one_constant_more_changes_no_other() -> None:
    sigmas = {f"accelerometer_{k}_sigma": v for k, v in SIGMAS.items() if k != "g_sensitivity"}
    all_drawn = realise_unit(build(ImuParameters, sigmas).accelerometer, "accelerometer", 3)
    alone = {k: v for k, v in sigmas.items() if "quadratic" in k}
    alone_drawn = realise_unit(build(ImuParameters, alone).accelerometer, "accelerometer", 3)
    assert all_drawn.quadratic == alone_drawn.quadratic


def test_the_realised_sensor_has_the_same_readings() -> None:
    values: dict[str, object] = {
        f"imu.{triad}_{kind}_sigma": sigma
        for triad in TRIADS
        for kind, sigma in SIGMAS.items()
        if (triad, kind) != ("accelerometer", "g_sensitivity")
    }
    values |= {"imu.gyroscope_turn_on_scale_sigma": 0.01, "temperature.value": 45.0}
    values |= {"imu.accelerometer_scale_error_percent": [1.0, -1.0, 0.5]}
    parameters = load_simulation(
        {"imu.preset": "perfect", "trajectory.type": "lecture", "seed": 5, **values}
    )
    fixed = dataclasses.replace(parameters, imu=realise_imu(parameters.imu, parameters.seed))
    assert not any(any(flatten(fixed)[name]) for name in values if name.endswith("_sigma"))
    drawn, two = (Body(p).next(500)["imu"] for p in (parameters, fixed))
    assert drawn.gyro == pytest.approx(two.gyro, abs=1e-12)
    assert drawn.accel == pytest.approx(two.accel, abs=1e-11)
    assert np.abs(drawn.gyro - drawn.ideal_gyro).max() > 1e-3


@pytest.mark.parametrize(("limit", "step", "largest"), [(3.0, 0.02, 3.0), (3.0, 0.7, 2.8)])
def test_no_reading_exceeds_the_range(limit: float, step: float, largest: float) -> None:
    """3.0 in steps of 0.07 is 3.01 where it is clipped first and rounded then."""
    values = {"imu.gyroscope_range": limit, "imu.gyroscope_resolution": step}
    values |= {"imu.gyroscope_noise_density": 1.0}
    shape = {"imu.preset": "perfect", "trajectory.type": "static"}
    block = Body(load_simulation(shape, values)).next(2000)["imu"]
    assert np.abs(block.gyro).max() == pytest.approx(largest)
    assert np.abs(block.gyro).max() <= limit * (1.0 + 1e-12)
