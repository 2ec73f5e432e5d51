# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""1/f noise, Gauss-Markov biases, scales and rounding in the covariance of preintegration."""

import dataclasses

import numpy as np
import pytest

from imu_sim_ros.core import rotation
from imu_sim_ros.navigation import preintegration as deltas
from imu_sim_ros.navigation.evaluation import anees_band, nees
from imu_sim_ros.navigation.preintegration import StepReadings, preintegrate
from imu_sim_ros.parameters import files
from imu_sim_ros.sensors.imu.triads import TriadParameters, TriadsParameters
from imu_sim_ros.simulation.engine import Body
from imu_sim_ros.simulation.parameters import load_simulation

PRESETS = [name for name in files.names("imus") if name != "perfect"]
RATE, BEFORE = 200.0, 400
H, FINE = 1.0 / RATE, 0.1 / RATE


def three(*values):
    return np.array(values)


GAUSS_MARKOV = TriadsParameters(
    TriadParameters(
        gauss_markov_sigma=three(1e-3, 2e-3, 3e-3), correlation_time=three(0.3, 1.0, 20.0)
    ),
    TriadParameters(
        gauss_markov_sigma=three(3e-2, 1e-2, 2e-2), correlation_time=three(5.0, 0.5, 2.0)
    ),
)
SCALES = TriadsParameters(
    TriadParameters(turn_on_scale_sigma=np.full(3, 0.01), g_sensitivity_sigma=np.full(3, 1e-4)),
    TriadParameters(misalignment_sigma=np.full(3, 0.003), quadratic_sigma=three(1e-4, 2e-4, 3e-4)),
)
FLICKER = TriadsParameters(
    TriadParameters(bias_instability=three(1e-4, 2e-4, 3e-4)),
    TriadParameters(bias_instability=three(1e-3, 3e-3, 2e-3)),
)


def lively(duration, h=H):
    t = np.arange(round(duration / h) + 1)[:, None] * h
    gyro = 0.5 * np.sin(t * [1.1, 1.7, 2.3])
    accel = np.sin(t * [3.1, 2.7, 2.3]) + np.array([0.0, 0.0, 9.81])
    return gyro, accel


def considered(gyro, accel, noise):
    """Return the covariance by a filter's time update in steps of 0.5 ms (Schmidt-Kalman).

    ``P' = F P F^T + F C (G H)^T + its transpose + G H (G H)^T, C' = (F C + G H) phi``. The bias at
    the start is known: the state's error is there -H a, and the change of the biases (B a) is
    added to it at the end.
    """
    entries, terms = noise.processes(H), noise.response_terms()
    m = len(entries)
    tau = np.r_[[tau for _, tau, _ in entries], np.full(len(terms), np.inf)]
    effect = np.zeros((15, m + len(terms)))
    for k, (axis, _, sigma) in enumerate(entries):
        effect[9 + (axis + 3) % 6, k] = sigma
    at_start = effect.copy()
    p, cross = at_start @ at_start.T, -at_start
    gamma = rotation.IDENTITY[None]
    for rate, force in zip(
        np.stack([gyro[:-1], gyro[1:]], 1), np.stack([accel[:-1], accel[1:]], 1), strict=True
    ):
        _, f, _ = deltas._midpoint(np.array([[FINE]]), gamma, rate[None], force[None])
        f = f[0]
        inputs = np.concatenate([rate.mean(axis=0), force.mean(axis=0)])
        inputs = np.concatenate([inputs, inputs**2])
        for k, (axis, source, sigma) in enumerate(terms, m):
            effect[:, k] = 0.0
            effect[9 + (axis + 3) % 6, k] = sigma * inputs[source]
        gain = np.zeros_like(effect)
        gain[:9] = f[:9, 9:] @ effect[9:]
        p = f @ p @ f.T + f @ cross @ gain.T + gain @ (f @ cross).T + gain @ gain.T
        cross = (f @ cross + gain) * np.exp(-FINE / tau)
        gamma = rotation.multiply(gamma, rotation.exp(rate.mean(axis=0)[None] * FINE))
    return p + cross @ at_start.T + at_start @ cross.T + at_start @ at_start.T


@pytest.mark.parametrize("noise", [GAUSS_MARKOV, SCALES, FLICKER], ids=["gm", "scales", "1/f"])
def test_pieces_of_eight_steps_are_as_good_as_fine_ones(noise):
    """Correlations agree to 0.5 %: pieces of 40 ms against 0.5 ms, in an interval of 1 s."""
    gyro, accel = lively(1.0)
    covariance = preintegrate(StepReadings(np.full((1, 200), H), gyro[None], accel[None]), noise)
    expected = considered(*lively(1.0, FINE), noise)
    sigma = np.sqrt(np.maximum(np.diag(expected), 1e-300))
    assert sigma[:9].min() > 0.0
    np.testing.assert_allclose(
        covariance.covariance[0] / np.outer(sigma, sigma),
        expected / np.outer(sigma, sigma),
        atol=0.005,
    )


def test_the_bias_block_is_the_change_over_the_interval():
    """``2 sigma^2 (1 - exp(-T / tau))``, on every axis, for long intervals as for short ones."""
    for duration in (0.05, 1.0, 60.0):
        gyro, accel = lively(duration)
        h = np.full((1, len(gyro) - 1), H)
        covariance = preintegrate(
            StepReadings(h, gyro[None], accel[None]), GAUSS_MARKOV
        ).covariance[0]
        triads = (GAUSS_MARKOV.accelerometer, GAUSS_MARKOV.gyroscope)
        sigma = np.concatenate([triad.gauss_markov_sigma for triad in triads])
        tau = np.concatenate([triad.correlation_time for triad in triads])
        expected = -2.0 * sigma**2 * np.expm1(-duration / tau)
        np.testing.assert_allclose(covariance[9:, 9:], np.diag(expected), rtol=1e-9, atol=1e-18)


def test_intervals_of_different_lengths_have_their_own():
    gyro, accel = lively(1.0)
    h = np.full((2, 200), H)
    h[1, 77:] = 0.0
    gyros, accels = np.stack([gyro, gyro]), np.stack([accel, accel])
    gyros[1, 78:], accels[1, 78:] = gyro[77], accel[77]
    gyroscope = dataclasses.replace(
        GAUSS_MARKOV.gyroscope,
        turn_on_scale_sigma=SCALES.gyroscope.turn_on_scale_sigma,
        g_sensitivity_sigma=SCALES.gyroscope.g_sensitivity_sigma,
    )
    accelerometer = dataclasses.replace(
        GAUSS_MARKOV.accelerometer,
        misalignment_sigma=SCALES.accelerometer.misalignment_sigma,
        quadratic_sigma=SCALES.accelerometer.quadratic_sigma,
    )
    noise = TriadsParameters(gyroscope, accelerometer)
    both = preintegrate(StepReadings(h, gyros, accels), noise).covariance
    for k, count in enumerate((200, 77)):
        single = StepReadings(
            h[k : k + 1, :count], gyros[k : k + 1, : count + 1], accels[k : k + 1]
        )
        single = single._replace(accel=single.accel[:, : count + 1])
        alone = preintegrate(single, noise).covariance[0]
        sigma = np.sqrt(np.diag(alone))
        np.testing.assert_allclose(
            both[k] / np.outer(sigma, sigma), alone / np.outer(sigma, sigma), atol=1e-9
        )


def test_rounding_is_white_noise_of_a_twelfth_of_a_step_squared():
    gyro, accel = lively(1.0)
    readings = StepReadings(np.full((1, 200), H), gyro[None], accel[None])
    step = np.array([0.01, 0.02, 0.03])
    rounded = TriadsParameters(
        TriadParameters(resolution=step), TriadParameters(resolution=10.0 * step)
    )
    density = step * np.sqrt(H / 12.0)
    white = TriadsParameters(
        TriadParameters(noise_density=density), TriadParameters(noise_density=10.0 * density)
    )
    covariance, expected = (preintegrate(readings, noise).covariance for noise in (rounded, white))
    np.testing.assert_allclose(covariance, expected, rtol=1e-12, atol=1e-25)


def mean_nees(preset, runs):
    """Return the mean NEES of the nine numbers over an interval of 1 s of figure_eight.

    The biases at the start are the true ones; all else is as the simulator draws it.
    """
    shape = {"trajectory.type": "figure_eight", "rate": RATE, "duration": 4.0}
    parameters = load_simulation({"imu.preset": preset}, shape)
    rows, blocks = slice(BEFORE, BEFORE + 201), []
    for seed in range(runs):
        simulation = Body(dataclasses.replace(parameters, seed=1000 + seed))
        block = simulation.next(BEFORE + 201)["imu"]
        blocks.append((block.gyro, block.accel, block.gyro_bias, block.accel_bias))
    gyro, accel, gyro_bias, accel_bias = (np.stack(x)[:, rows] for x in zip(*blocks, strict=True))
    h, noise = np.full((runs, 200), H), parameters.imu
    covariance = preintegrate(StepReadings(h, gyro, accel), None, gyro_bias[:, 0], accel_bias[:, 0])
    ideal = StepReadings(h[:1], block.ideal_gyro[None, rows], block.ideal_accel[None, rows])
    exact = preintegrate(ideal, noise)
    theta = rotation.log(rotation.multiply(rotation.conjugate(covariance.gamma), exact.gamma))
    errors = [exact.alpha - covariance.alpha, theta, exact.beta - covariance.beta]
    return float(nees(np.concatenate(errors, axis=1), exact.covariance[0, :9, :9]).mean())


def check(preset, runs):
    """Assert a NEES in its band: all presets lie in theirs with 95 % (Bonferroni)."""
    low, high = anees_band(9, runs, 1.0 - 0.05 / len(PRESETS))
    mean = mean_nees(preset, runs)
    print(f"NEES of preintegration {preset:12s} {mean:.2f} in {low:.2f} to {high:.2f}")
    assert low <= mean <= high


@pytest.mark.parametrize("preset", PRESETS)
def test_errors_of_forty_runs_are_as_large_as_predicted(preset):
    """9 is right, 7.1 to 11.2 the band; a sigma wrong by sqrt(2) gives 4.5 or 18."""
    check(preset, 40)


@pytest.mark.slow
@pytest.mark.parametrize("preset", PRESETS)
def test_errors_of_two_hundred_runs_are_as_large_as_predicted(preset):
    """9 is right, 8.11 to 9.94 the band."""
    check(preset, 200)
