# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Rests in tilted fixtures, and in any positions: the norm of gravity against known sensors."""

import numpy as np
import pytest

from imu_sim_ros.calibration.deterministic.gravity_norm import fit_norm, upper_triangular
from imu_sim_ros.calibration.deterministic.positions import calibrate_six_position
from imu_sim_ros.calibration.deterministic.steady import Steady
from imu_sim_ros.core import rotation
from imu_sim_ros.core.errors import InputError

G = 9.81
S = np.array([[1.02, 0.004, -0.006], [0.003, 0.985, 0.002], [-0.005, 0.001, 1.01]])
BIAS = np.array([0.1, -0.2, 0.05])
NOISE = 1e-3
FACES = np.array([[1, 0, 0], [-1, 0, 0], [0, 1, 0], [0, -1, 0], [0, 0, 1], [0, 0, -1]], float)


def rests(rng, count=24, tilt_deg=3.0, directions=None):
    """Return rests whose directions are tilted at random about every axis."""
    up = np.tile(FACES, (count // 6, 1)) if directions is None else directions
    turns = rotation.exp(np.radians(tilt_deg) * rng.normal(size=(count, 3)))
    readings = G * rotation.rotate(turns, up) @ S.T + BIAS + NOISE * rng.normal(size=(count, 3))
    gyro = 0.01 + 1e-5 * rng.normal(size=(count, 3))
    begin = np.arange(count) * 33_000_000_000
    sigma = np.full((count, 3), 1e-5), np.full((count, 3), NOISE)
    return Steady(np.arange(count), begin, begin + 30_000_000_000, gyro, readings, *sigma)


def deviations(calibration, truth):
    """Return the errors of the nine or twelve parameters, in standard errors."""
    sigma = np.concatenate([calibration.scale_misalignment_sigma.ravel(), calibration.bias_sigma])
    error = np.concatenate(
        [(calibration.scale_misalignment - truth).ravel(), calibration.bias - BIAS]
    )
    return error[sigma > 0.0] / sigma[sigma > 0.0]


@pytest.mark.parametrize("tilt_deg", [1.7, 3.0])
def test_standard_errors_hold_in_a_hundred_tilted_runs(tilt_deg):
    """900 numbers, nine independent ones a run, have a mean square of 1.

    95 % are within 1.96, to three binomial deviations of the 100 runs (if a run's nine went
    together, sqrt(0.95 0.05 / 100) = 2.2 %), and the mean square is 1 to three of
    sqrt(2 / 900) = 4.7 %, twice that for what the chi-square of 15 adds.
    """
    rng = np.random.default_rng(5)
    z = []
    for _ in range(100):
        calibration = fit_norm(rests(rng, tilt_deg=tilt_deg), G)
        z.append(deviations(calibration, upper_triangular(S)))
        assert (
            np.abs(calibration.bias - BIAS).max() < 8e-3
        )  # eq. 7: up to half a metre per second squared
    z = np.concatenate(z)
    assert len(z) == 900
    assert np.mean(np.abs(z) < 1.96) > 0.95 - 3 * 0.022
    assert 1.0 - 0.28 < np.mean(z**2) < 1.0 + 0.28


def test_a_tilted_fixture_is_recognised_and_said():
    calibration = calibrate_six_position(rests(np.random.default_rng(1)), G)
    assert calibration.fixture == "norm"
    assert "times the variance that the norm leaves; more than" in calibration.reason
    assert np.abs(calibration.bias - BIAS).max() < 5e-3


def test_an_exact_fixture_keeps_equation_7():
    """S with all its nine entries; six directions cannot show more."""
    rng = np.random.default_rng(2)
    calibration = calibrate_six_position(rests(rng, tilt_deg=0.0), G)
    assert calibration.fixture == "exact"
    assert np.abs(deviations(calibration, S)).max() < 4.0


def test_six_tilted_positions_say_how_unsure_they_are():
    """Too few to fit the norm: the tilt is seen in the residuals and is in the standard errors.

    It is estimated from six numbers: Student's t of 6, beyond 5.2 one in a thousand; 12 x 30.
    """
    rng = np.random.default_rng(3)
    calibrations = [calibrate_six_position(rests(rng, 6, 1.7), G) for _ in range(30)]
    assert all("tilted by" in calibration.reason for calibration in calibrations)
    z = np.concatenate([deviations(calibration, S) for calibration in calibrations])
    assert np.mean(np.abs(z) < 5.2) > 0.98


def test_positions_with_no_axis_up_are_used():
    """Twenty directions all over the sphere, none near a face (corners of a dodecahedron)."""
    phi = 0.5 * (1 + np.sqrt(5))
    corners = [[x, y, z] for x in (-1, 1) for y in (-1, 1) for z in (-1, 1)]
    for a in (-1 / phi, 1 / phi):
        for b in (-phi, phi):
            corners += [[0, a, b], [a, b, 0], [b, 0, a]]
    up = np.array(corners) / np.sqrt(3.0)
    calibration = calibrate_six_position(rests(np.random.default_rng(4), 20, 1.0, up), G)
    assert calibration.fixture == "norm"
    assert calibration.left_out == 0
    assert len(calibration.positions.stretch) == 20
    assert np.abs(deviations(calibration, upper_triangular(S))).max() < 4.0


def test_nine_directions_are_refused_for_the_norm():
    steady = rests(np.random.default_rng(6), 6, 5.0)
    with pytest.raises(InputError, match="6 directions at rest: the norm of gravity needs 10"):
        calibrate_six_position(steady, G, fixture="norm")


def test_upper_triangular_is_the_same_sensor_in_turned_axes():
    upper = upper_triangular(S)
    np.testing.assert_allclose(upper @ upper.T, S @ S.T, atol=1e-15)
    np.testing.assert_array_equal(np.tril(upper, -1), 0.0)
    assert (np.diag(upper) > 0.0).all()
