# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""The ellipsoid fit of a magnetometer: its standard errors hold, and another method agrees."""

from typing import Any

import numpy as np
import pytest
from scipy.optimize import least_squares
from scipy.stats import binom, chi2

import imu_sim_ros as ims
from imu_sim_ros.calibration.deterministic.ellipsoid import calibrate_magnetometer, symmetric_root
from imu_sim_ros.core.errors import ConfigurationError, InputError
from imu_sim_ros.sensors.magnetometer.model import realise_magnetometer
from imu_sim_ros.simulation.engine import Body
from imu_sim_ros.simulation.parameters import load_simulation

FIELD = 5e-5
UNIT = np.array([[1.1, 0.05, -0.03], [0.05, 0.9, 0.02], [-0.03, 0.02, 1.0]])
OFFSET = np.array([2e-5, -3e-5, 1e-5])


def readings(seed: int, count: int = 600, noise: float = 1e-6) -> np.ndarray:
    rng = np.random.default_rng(seed)
    directions = rng.standard_normal((count, 3))
    directions /= np.linalg.norm(directions, axis=1)[:, None]
    result: np.ndarray = FIELD * directions @ UNIT.T + OFFSET
    return result + noise * rng.standard_normal((count, 3))


def test_without_noise_the_fit_is_exact() -> None:
    calibration = calibrate_magnetometer(readings(1, noise=0.0), FIELD)
    assert np.allclose(calibration.soft_iron, UNIT, rtol=0.0, atol=1e-9)
    assert np.allclose(calibration.hard_iron, OFFSET, rtol=0.0, atol=1e-9 * FIELD)


def test_standard_errors_hold_in_100_runs() -> None:
    """The squares over the variances are chi-squared, and 95 % intervals hold as often as said."""
    runs, squares, covered = 100, np.zeros(9), np.zeros(9)
    entries = np.triu_indices(3)
    for seed in range(runs):
        calibration = calibrate_magnetometer(readings(seed), FIELD)
        off = np.concatenate(
            [(calibration.soft_iron - UNIT)[entries], calibration.hard_iron - OFFSET]
        )
        sigma = np.concatenate([calibration.soft_iron_sigma[entries], calibration.hard_iron_sigma])
        squares += (off / sigma) ** 2
        covered += np.abs(off) < 1.96 * sigma
    # Nine parameters: 1e-4 for each bound.
    assert (squares > chi2.ppf(1e-4, runs)).all()
    assert (squares < chi2.ppf(1.0 - 1e-4, runs)).all()
    assert (covered >= binom.ppf(1e-4, runs, 0.95)).all()


def test_an_independent_fit_finds_the_same() -> None:
    """SciPy's least squares of the same norms, its derivatives by differences."""
    y = readings(5) / FIELD

    def residuals(p: np.ndarray) -> np.ndarray:
        t = np.array([[p[0], p[1], p[2]], [p[1], p[3], p[4]], [p[2], p[4], p[5]]])
        force = (y - p[6:]) @ t
        norms = np.linalg.norm(force, axis=1)
        slope = np.linalg.norm(force @ t, axis=1) / norms
        result: np.ndarray = (norms - 1.0) / slope
        return result

    solved = least_squares(residuals, [1.0, 0, 0, 1.0, 0, 1.0, 0, 0, 0], xtol=1e-14, ftol=1e-14)
    p = solved.x
    soft_iron = np.linalg.inv([[p[0], p[1], p[2]], [p[1], p[3], p[4]], [p[2], p[4], p[5]]])
    calibration = calibrate_magnetometer(y * FIELD, FIELD)
    # It knows nothing of the lengthening by noise, 2e-4 of the field, nor of the weights' slope.
    assert np.allclose(calibration.soft_iron, soft_iron, rtol=0.0, atol=6e-4)
    assert np.allclose(calibration.hard_iron / FIELD, p[6:], rtol=0.0, atol=1e-4)


def test_without_the_field_s_strength_the_shape_is_found() -> None:
    calibration = calibrate_magnetometer(readings(3))
    shape = UNIT / np.cbrt(np.linalg.det(UNIT))
    assert np.linalg.det(calibration.soft_iron) == pytest.approx(1.0, abs=1e-12)
    # Six entries, as the matrix is symmetric: one lies beyond 5 sigma in 3e-6 of all runs.
    assert (np.abs(calibration.soft_iron - shape) < 5.0 * calibration.soft_iron_sigma).all()
    assert calibration.field == pytest.approx(FIELD * np.cbrt(np.linalg.det(UNIT)), rel=1e-3)
    # 600 readings know their deviation to 1 / sqrt(1200) = 2.9 %; 3.5 of these.
    assert calibration.noise == pytest.approx(1e-6, rel=0.1)


def test_a_tumbling_board_gives_its_iron_back() -> None:
    values: dict[str, Any] = {
        "imu.preset": "perfect",
        "trajectory.type": "tumble",
        "rate": 100.0,
        "seed": 8,
        "imu.magnetometer_hard_iron_sigma": 2e-5,
        "imu.magnetometer_soft_iron_sigma": 0.03,
        "imu.magnetometer_misalignment_sigma": 0.02,
        "imu.magnetometer_turn_on_scale_sigma": 0.02,
        "imu.magnetometer_turn_on_bias_sigma": 1e-5,
        "imu.magnetometer_noise_density": 3e-8,
        "imu.magnetometer_resolution": 1.5e-7,
    }
    parameters = load_simulation(values)
    block = Body(parameters, sensors=("magnetic_field",)).next(6000)["magnetic_field"]
    assert block is not None
    field = float(np.linalg.norm(parameters.magnetic_field.value))
    calibration = calibrate_magnetometer(block.field, field)
    m, b = realise_magnetometer(parameters.imu.magnetometer, parameters.seed).response_and_bias()
    # Nine parameters: one lies beyond 4 standard errors in 6e-4 of all runs.
    off = (calibration.soft_iron - symmetric_root(m)) / calibration.soft_iron_sigma
    assert np.abs(off).max() < 4.0
    assert (np.abs(calibration.hard_iron - b) < 4.0 * calibration.hard_iron_sigma).all()
    assert calibration.hard_iron_sigma.max() < 2e-8


@pytest.mark.parametrize(
    ("field", "text"),
    [
        (np.ones((5, 3)), "5 readings"),
        (np.ones((50, 3)), "all the same"),
        (np.full((50, 3), np.nan), "number 9: a value that is not finite"),
        (
            np.column_stack([np.cos(np.arange(50)), np.sin(np.arange(50)), np.zeros(50)]),
            "all around",
        ),
        (np.outer(np.arange(50.0), [1.0, 2.0, 3.0]), "all around"),
    ],
)
def test_readings_that_do_not_determine_it_are_refused(field: np.ndarray, text: str) -> None:
    with pytest.raises(InputError, match=text):
        calibrate_magnetometer(field * 1e-5)


@pytest.mark.parametrize(
    ("field", "strength", "text"),
    [
        (np.ones((20, 2)), None, r"must be finite numbers of the shape \(n, 3\), not \(20, 2\)"),
        (np.ones(20), None, r"the shape \(n, 3\), not \(20,\)"),
        (np.ones((20, 3)), -1.0, "strength = -1.0: must be above 0"),
        (np.ones((20, 3)), np.nan, "strength = nan: must be above 0"),
    ],
)
def test_the_front_door_says_what_cannot_be_a_record(field, strength, text):
    with pytest.raises(ConfigurationError, match=text):
        ims.calibrate_magnetometer(field, strength=strength)
