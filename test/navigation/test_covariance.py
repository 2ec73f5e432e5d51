# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

import numpy as np
import pytest

from imu_sim_ros.core import rotation
from imu_sim_ros.core.conventions import TRIADS
from imu_sim_ros.navigation.covariance import (
    ACCEL_BIAS,
    ATTITUDE,
    GYRO_BIAS,
    POSITION,
    VELOCITY,
    Covariance,
    initial_covariance,
    propagate,
)
from imu_sim_ros.navigation.dead_reckoning import dead_reckon
from imu_sim_ros.navigation.initialisation import covariance_after_rest
from imu_sim_ros.navigation.state import NavigationState
from imu_sim_ros.sensors.imu.triads import TriadParameters, TriadsParameters

from .conftest import AT_REST

SILENT = TriadsParameters()
AXES = np.array([1.0, 2.0, 3.0])


def of_sizes(**sizes: np.ndarray) -> TriadsParameters:
    """Return triads with errors of these sizes alone, by the parameters' names."""
    triads = ({n.partition("_")[2]: v for n, v in sizes.items() if n.startswith(t)} for t in TRIADS)
    return TriadsParameters(*(TriadParameters(**triad) for triad in triads))


def at_rest(noise, duration, rate, initial=None):
    """Return the covariance after a time of rest, level."""
    result = Covariance(noise, initial)
    for _ in range(round(duration * rate)):
        result.step(1.0 / rate, np.eye(3), np.array([0.0, 0.0, 9.81]))
    return result.matrix


def diagonal(matrix, block):
    return np.diag(matrix)[block]


# Growth from the lecture's error model, over t: white noise of density N gives a velocity variance
# of N^2 t and a position variance of N^2 t^3 / 3; a walk of density K gives K^2 t^3 / 3 and
# K^2 t^5 / 20; a constant bias b gives b t and b t^2 / 2. Steps of h to first order leave O(h/t).
T, RATE = 10.0, 200.0


def test_growth_of_accelerometer_noise():
    noise = of_sizes(accelerometer_noise_density=0.01 * AXES)
    covariance = at_rest(noise, T, RATE)
    expected = np.square(0.01 * AXES) * T
    np.testing.assert_allclose(diagonal(covariance, VELOCITY), expected, rtol=1e-9)
    np.testing.assert_allclose(diagonal(covariance, POSITION), expected * T**2 / 3, rtol=2e-3)


def test_growth_of_accelerometer_walk():
    noise = of_sizes(accelerometer_random_walk=1e-3 * AXES)
    covariance = at_rest(noise, T, RATE)
    expected = np.square(1e-3 * AXES) * T
    np.testing.assert_allclose(diagonal(covariance, ACCEL_BIAS), expected, rtol=1e-9)
    np.testing.assert_allclose(diagonal(covariance, VELOCITY), expected * T**2 / 3, rtol=2e-3)
    np.testing.assert_allclose(diagonal(covariance, POSITION), expected * T**4 / 20, rtol=3e-3)


def test_growth_of_gyroscope_noise_and_walk():
    """Tilt times gravity is an acceleration: one more power of t^2 each; none along gravity."""
    white = at_rest(of_sizes(gyroscope_noise_density=1e-3 * AXES), T, RATE)
    expected = np.square(1e-3 * AXES) * T
    np.testing.assert_allclose(diagonal(white, ATTITUDE), expected, rtol=1e-9)
    sideways = np.array([expected[1], expected[0], 0.0]) * 9.81**2
    np.testing.assert_allclose(diagonal(white, POSITION), sideways * T**4 / 20, rtol=5e-3)
    walk = at_rest(of_sizes(gyroscope_random_walk=1e-5 * AXES), T, RATE)
    expected = np.square(1e-5 * AXES) * T
    np.testing.assert_allclose(diagonal(walk, ATTITUDE), expected * T**2 / 3, rtol=3e-3)
    sideways = np.array([expected[1], expected[0], 0.0]) * 9.81**2
    # Four integrals of white noise: t^7 / (7 (3!)^2) = t^7 / 252.
    np.testing.assert_allclose(diagonal(walk, POSITION), sideways * T**6 / 252, rtol=6e-3)


def test_growth_of_uncertain_biases():
    initial = initial_covariance(accelerometer_bias=0.02 * AXES, gyroscope_bias=1e-3)
    covariance = at_rest(SILENT, T, RATE, initial)
    bias = np.square(0.02 * AXES)
    tilted = np.array([1e-6, 1e-6, 0.0]) * 9.81**2 * T**2
    np.testing.assert_allclose(
        diagonal(covariance, VELOCITY), bias * T**2 + tilted * T**2 / 4, rtol=2e-3
    )
    np.testing.assert_allclose(
        diagonal(covariance, POSITION), bias * T**4 / 4 + tilted * T**4 / 36, rtol=2e-3
    )


def test_a_constant_bias_grows_as_the_lecture_says():
    """Section 3: v_err = b t, p_err = b t^2 / 2, exactly, for every method."""
    t_ns = np.arange(2001) * 5_000_000
    accel = np.tile([0.1, -0.2, 9.81 + 0.3], (2001, 1))
    for method in ("euler", "midpoint", "rk4"):
        states = dead_reckon(t_ns, np.zeros((2001, 3)), accel, AT_REST, method)
        np.testing.assert_allclose(states.velocity[-1], [1.0, -2.0, 3.0], rtol=1e-11)
        np.testing.assert_allclose(states.position[-1], [5.0, -10.0, 15.0], rtol=1e-11)


def test_covariance_is_that_of_perturbed_starts(record):
    """Each column of the transition: a start moved by a little, integrated, moved by F of it."""
    motion = record("excitation", 400.0, 2.0)
    arguments = (motion.t_ns, motion.gyro, motion.accel)
    base = dead_reckon(*arguments, motion.initial)
    initial = motion.initial
    step = 1e-5
    columns = []
    for k in range(15):
        d = np.zeros(15)
        d[k] = step
        start = NavigationState(
            initial.position + d[6:9],
            initial.velocity + d[3:6],
            rotation.multiply(rotation.exp(d[:3]), initial.q_wb),
        )
        states = dead_reckon(motion.t_ns, motion.gyro - d[9:12], motion.accel - d[12:], start)
        turn = rotation.multiply(states.q_wb[-1], rotation.conjugate(base.q_wb[-1]))
        difference = [
            rotation.log(turn),
            states.velocity[-1] - base.velocity[-1],
            states.position[-1] - base.position[-1],
            d[9:],
        ]
        columns.append(np.concatenate(difference) / step)
    transition = np.stack(columns, axis=1)
    sigmas = (0.01, 0.1, 0.2, 0.003, 0.05)
    start = initial_covariance(*sigmas)
    covariance = propagate(base, motion.accel, SILENT, start)[0]
    expected = transition @ start @ transition.T
    scale = np.sqrt(np.diag(expected))
    assert np.abs((covariance - expected) / np.outer(scale, scale)).max() < 5e-3


def test_growth_of_a_gauss_markov_bias():
    """Integrated from its stationary state: Var v = 2 s^2 tau^2 (T / tau - 1 + exp(-T / tau))."""
    sigma, tau = 0.02 * AXES, 3.0
    settings = {"accelerometer_correlation_time": tau * np.ones(3)}
    by_sigma = of_sizes(accelerometer_gauss_markov_sigma=sigma, **settings)
    by_density = of_sizes(accelerometer_gauss_markov_density=sigma * np.sqrt(2.0 / tau), **settings)
    expected = 2 * sigma**2 * tau**2 * (T / tau - 1 + np.exp(-T / tau))
    for noise in (by_sigma, by_density):
        covariance = at_rest(noise, T, RATE)
        np.testing.assert_allclose(diagonal(covariance, VELOCITY), expected, rtol=2e-3)


def test_growth_of_bias_instability():
    """1/f noise of density B^2 / (2 pi f) over a decade of times grows as a bias does, nearly.

    The sum of Gauss-Markov biases, each by the closed form; with variances B^2 ln 10 / pi.
    """
    b = 1e-3
    noise = of_sizes(accelerometer_bias_instability=b * AXES)
    covariance = diagonal(at_rest(noise, T, RATE), VELOCITY)
    tau = 10.0 ** np.arange(-1, 5)
    entry = 2 * tau**2 * (T / tau - 1 + np.exp(-T / tau))
    expected = b**2 * np.log(10) / np.pi * entry.sum()
    np.testing.assert_allclose(covariance, expected * AXES**2, rtol=2e-3)


def test_growth_of_an_unknown_scale():
    """Gravity at rest is off by s g, up only; turning, the attitude is off by s times the angle."""
    noise = of_sizes(
        accelerometer_turn_on_scale_sigma=1e-3 * AXES, gyroscope_turn_on_scale_sigma=1e-2 * AXES
    )
    covariance = diagonal(at_rest(noise, T, RATE), VELOCITY)
    np.testing.assert_allclose(covariance, [0.0, 0.0, (3e-3 * 9.81 * T) ** 2], rtol=1e-9)
    result = Covariance(noise)
    for _ in range(100):
        result.step(0.01, np.eye(3), np.zeros(3), np.array([0.5, -0.4, 0.1]))
    angle = np.array([0.5, -0.4, 0.1]) * 1e-2 * AXES
    np.testing.assert_allclose(diagonal(result.matrix, ATTITUDE), angle**2, rtol=1e-9)
    # The latest reading's own error, which the twist of a message has: scale times rate.
    np.testing.assert_allclose(np.diag(result.twist(np.eye(3), np.zeros(3), 100.0))[3:], angle**2)


def test_growth_of_unknown_cross_axis_terms():
    """Gravity at rest leaks into x and y by m g, by q g^2 into z, and by G g into the gyroscope."""
    noise = of_sizes(
        accelerometer_misalignment_sigma=1e-3 * AXES, accelerometer_quadratic_sigma=1e-5 * AXES
    )
    covariance = diagonal(at_rest(noise, T, RATE), VELOCITY)
    expected = [1e-3 * 9.81 * T, 2e-3 * 9.81 * T, 3e-5 * 9.81**2 * T]
    np.testing.assert_allclose(covariance, np.square(expected), rtol=1e-9)
    noise = of_sizes(gyroscope_g_sensitivity_sigma=1e-5 * AXES)
    covariance = diagonal(at_rest(noise, T, RATE), ATTITUDE)
    np.testing.assert_allclose(covariance, np.square(1e-5 * AXES * 9.81 * T), rtol=1e-9)


def test_rounding_is_noise_of_a_twelfth_of_a_step():
    noise = of_sizes(accelerometer_resolution=0.1 * AXES)
    covariance = diagonal(at_rest(noise, T, RATE), VELOCITY)
    np.testing.assert_allclose(covariance, np.square(0.1 * AXES) / 12 / RATE * T, rtol=1e-9)


@pytest.mark.parametrize("angles", [(0.0, 0.0, 1.0), (0.2, 0.0, -2.0), (0.2, 0.6, 1.0)])
def test_the_turn_of_a_levelled_attitude_is_that_of_many_levelled_bodies(angles):
    """20,000 biases: a variance has a standard error of 1 %, that of a product of normals 2 %.

    Level bodies are turned about the vertical by the second order alone, pitched ones by the first.
    """
    rng, sigma, count = np.random.default_rng(1), 0.4, 20000
    q_wb = rotation.from_euler(angles)
    force = rotation.rotate_inverse(q_wb, np.array([0.0, 0.0, 9.81]))
    x, y, z = (force + sigma * rng.standard_normal((count, 3))).T
    roll, pitch = np.arctan2(y, z), np.arctan2(-x, np.hypot(y, z))
    levelled = rotation.from_euler(np.stack([roll, pitch, np.full(count, angles[2])], axis=1))
    turn = rotation.log(rotation.multiply(q_wb, rotation.conjugate(levelled)))
    covariance = turn.T @ turn / count
    r_wb = rotation.to_matrix(q_wb)
    result = covariance_after_rest(SILENT, 2.0, sigma, r_wb, (0.0, 0.0, -9.81), 200.0)
    predicted = result.matrix[ATTITUDE, ATTITUDE]
    size = np.sqrt(np.outer(np.diag(predicted), np.diag(predicted)))
    np.testing.assert_allclose(covariance / size, predicted / size, atol=0.1 if angles[1] else 0.06)


def test_a_levelled_body_does_not_feel_the_bias_it_was_levelled_with():
    """The tilt undoes the accelerometer's bias across gravity, as long as the body does not turn.

    Turned by 180 degrees about the vertical, both act the same way: 2 b t of velocity.
    """
    gravity, b, time = (0.0, 0.0, -9.81), 0.3, 4.0
    result = covariance_after_rest(SILENT, 2.0, b, np.eye(3), gravity, 200.0)
    tilt = result.matrix[ATTITUDE, ATTITUDE]
    angle = b / 9.81  # two of them turn by half their product about the vertical
    np.testing.assert_allclose(np.diag(tilt), [angle**2, angle**2, angle**4 / 4.0])
    for _ in range(400):
        result.step(0.01, np.eye(3), np.array([0.0, 0.0, 9.81]))
    covariance = diagonal(result.matrix, VELOCITY)
    np.testing.assert_allclose(covariance, [0.0, 0.0, (b * time) ** 2], atol=1e-12)
    turned = covariance_after_rest(SILENT, 2.0, b, np.eye(3), gravity, 200.0)
    for _ in range(400):
        turned.step(0.01, np.diag([-1.0, -1.0, 1.0]), np.array([0.0, 0.0, 9.81]))
    covariance = diagonal(turned.matrix, VELOCITY)
    np.testing.assert_allclose(
        covariance, np.square([2 * b * time, 2 * b * time, b * time]), rtol=1e-9
    )


def test_an_averaged_gyroscope_is_as_uncertain_as_what_changed_since():
    """White noise N^2 / T, a walk K^2 T / 3; a Gauss-Markov bias by its own closed forms.

    Against 20,000 simulated rests: variances are good to 1 %, four of these.
    """
    n, k, sigma, tau, time, rate = 1e-3, 2e-4, 1e-3, 3.0, 5.0, 20.0
    noise = of_sizes(
        gyroscope_noise_density=np.full(3, n),
        gyroscope_random_walk=np.full(3, k),
        gyroscope_gauss_markov_sigma=np.full(3, sigma),
        gyroscope_correlation_time=np.full(3, tau),
    )
    covariance = covariance_after_rest(
        noise, time, 0.0, np.eye(3), (0.0, 0.0, -9.81), rate
    ).mean_square()
    rng, h, steps, runs = np.random.default_rng(4), 1 / rate, round(time * rate), 20_000
    white = n / np.sqrt(h) * rng.normal(size=(runs, steps))
    walk = np.cumsum(k * np.sqrt(h) * rng.normal(size=(runs, steps)), axis=1)
    process = np.empty((runs, steps))
    process[:, 0] = sigma * rng.normal(size=runs)
    phi = np.exp(-h / tau)
    for j in range(1, steps):
        driven = sigma * np.sqrt(1 - phi * phi) * rng.normal(size=runs)
        process[:, j] = phi * process[:, j - 1] + driven
    remaining = walk[:, -1] + process[:, -1] - (white + walk + process).mean(axis=1)
    assert covariance[GYRO_BIAS, GYRO_BIAS][0, 0] == pytest.approx(remaining.var(), rel=0.04)


def second_order_of_a_bias(sigma, duration):
    """Give the closed form at rest: theta = -b t turns g; it is off by (bb^T - |b|^2) g t^2 / 2.

    The vertical loses (b_x^2 + b_y^2) g t^3 / 6 of velocity and t^4 / 24 of position; with two
    independent normal numbers of one sigma, E[(b_x^2 + b_y^2)^2] = 8 sigma^4.
    """
    factor = 8.0 * sigma**4 * 9.81**2
    return factor * (duration**3 / 6) ** 2, factor * (duration**4 / 24) ** 2


def test_second_order_of_an_uncertain_gyroscope_bias():
    result = Covariance(SILENT, initial_covariance(gyroscope_bias=2e-3))
    for _ in range(2000):
        result.step(0.005, np.eye(3), np.array([0.0, 0.0, 9.81]))
    velocity, position = second_order_of_a_bias(2e-3, 10.0)
    covariance = np.diag(result.mean_square())
    # To first order a vertical force does not act along itself at all.
    assert result.matrix[5, 5] == 0.0
    assert covariance[5] == pytest.approx(velocity, rel=0.03)
    assert covariance[8] == pytest.approx(position, rel=0.03)


def test_second_order_of_gyroscope_noise():
    """A tilt by white noise N: the mean of theta_x^2 + theta_y^2 is 2 N^2 t, its covariance known.

    The vertical velocity loses V = g/2 times the integral of q = theta_x^2 + theta_y^2. With
    Cov(q(t), q(u)) = 4 N^4 min(t, u)^2, E[V^2] = g^2/4 (N^4 T^4 + 4 N^4 T^4 / 6).
    """
    density, duration = 0.015, 10.0
    noise = of_sizes(gyroscope_noise_density=np.full(3, density))
    result = Covariance(noise)
    for _ in range(2000):
        result.step(0.005, np.eye(3), np.array([0.0, 0.0, 9.81]))
    expected = 9.81**2 / 4 * density**4 * duration**4 * (1 + 4 / 6)
    assert result.mean_square()[5, 5] == pytest.approx(expected, rel=0.03)


def test_pose_and_twist_blocks():
    matrix = np.diag(np.arange(1.0, 16.0))
    covariance = Covariance(of_sizes(gyroscope_noise_density=0.1 * AXES), matrix)
    np.testing.assert_array_equal(np.diag(covariance.pose()), [7, 8, 9, 1, 2, 3])
    r_wb = rotation.to_matrix(rotation.from_euler([0.1, 0.2, 1.5]))
    velocity = np.array([1.0, 2.0, 3.0])
    twist = covariance.twist(r_wb, velocity, 200.0)
    # By samples: v_b of a state moved by the error.
    rng = np.random.default_rng(2)
    small = 1e-4
    errors = small * rng.normal(size=(200_000, 15)) * np.sqrt(np.diag(matrix))
    q_wb = rotation.multiply(rotation.exp(errors[:, :3]), rotation.from_matrix(r_wb))
    v_b = rotation.rotate_inverse(q_wb, velocity + errors[:, 3:6]) - r_wb.T @ velocity
    sampled = np.cov(v_b.T) / small**2
    scale = np.sqrt(np.diag(sampled))
    # Correlations of 200,000 samples are good to 1 / sqrt(200,000) = 0.0022; four of these.
    assert np.abs((twist[:3, :3] - sampled) / np.outer(scale, scale)).max() < 0.013
    np.testing.assert_allclose(np.diag(twist)[3:], [10, 11, 12] + np.square(0.1 * AXES) * 200)


@pytest.mark.parametrize("row_numbers", [(0,), (0, 100, -1), (400,)])
def test_propagate_gives_the_rows_that_are_asked_for(record, row_numbers):
    motion = record("lecture", 200.0, 2.0)
    noise = TriadsParameters(
        *[TriadParameters(noise_density=np.full(3, 1e-3), random_walk=np.full(3, 1e-3))] * 2
    )
    states = dead_reckon(motion.t_ns, motion.gyro, motion.accel, motion.initial)
    covariance = propagate(states, motion.accel, noise, row_numbers=row_numbers)
    whole = propagate(states, motion.accel, noise, row_numbers=range(401))
    np.testing.assert_array_equal(covariance, whole[list(row_numbers)])


def areas(sigma, turn_rate, duration, runs=4000):
    """Return the exact attitude errors (runs, 3) of a body that turns about z, by its biases."""
    rng, rate = np.random.default_rng(7), np.array([0.0, 0.0, turn_rate])
    bias = sigma * rng.standard_normal((runs, 3))
    turn = rotation.exp(rate * duration)
    estimate = rotation.exp((rate + bias) * duration)
    return rotation.log(rotation.multiply(turn, rotation.conjugate(estimate)))


@pytest.mark.parametrize("turns", [0.5, 1.0, 2.0])
def test_second_order_of_the_attitude_of_a_turning_body(turns):
    """A bias leads the attitude's error round a circle; after whole turns its area is left.

    Turned by an angle phi about z at the rate w, a bias (b_x, b_y) sweeps (b_x^2 + b_y^2) / (2 w^2)
    (phi - sin phi) about z. The exact errors of 4000 constant biases: a mean of e^2 of products of
    normal numbers has a relative standard error of sqrt(20 / 4000), 7 %; three of these.
    """
    sigma, rate = 5e-3, np.pi / 5
    duration = turns * 2.0 * np.pi / rate
    result = Covariance(SILENT, initial_covariance(gyroscope_bias=[sigma, sigma, 0.0]))
    for k in range(round(duration / 0.005)):
        middle = rotation.to_matrix(rotation.exp([0.0, 0.0, rate * (k + 0.5) * 0.005]))
        result.step(0.005, middle, np.zeros(3))
    swept = (duration * rate - np.sin(duration * rate)) / (2.0 * rate**2)
    predicted = result.mean_square()[2, 2]
    # E[(b_x^2 + b_y^2)^2] = 8 sigma^4; intervals of 0.1 s are chords of the circle.
    assert predicted == pytest.approx(8.0 * sigma**4 * swept**2, rel=0.02)
    exact = areas(np.array([sigma, sigma, 0.0]), rate, duration)
    assert np.mean(exact[:, 2] ** 2) == pytest.approx(predicted, rel=0.21)


def test_an_attitude_known_too_badly_is_said():
    """Above 0.5 rad, along the worst axis, at any time so far: errors are no longer linear."""
    result = Covariance(SILENT, initial_covariance(gyroscope_bias=[0.06, 0.0, 0.0]))
    for _ in range(1600):
        result.step(0.005, np.eye(3), np.array([0.0, 0.0, 9.81]))
    assert result.largest_attitude_sigma == pytest.approx(0.06 * 8.0, rel=1e-6)
