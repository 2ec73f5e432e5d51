# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

import dataclasses

import numpy as np
import pytest

from imu_sim_ros.core import rotation
from imu_sim_ros.core.errors import ConfigurationError, InputError
from imu_sim_ros.navigation.dead_reckoning import dead_reckon
from imu_sim_ros.navigation.preintegration import (
    ACCEL_BIAS,
    GYRO_BIAS,
    METHODS,
    THETA,
    StepReadings,
    between,
    corrected,
    preintegrate,
)
from imu_sim_ros.sensors.imu.triads import TriadParameters, TriadsParameters

from .conftest import AT_REST

ADIS16448 = TriadsParameters(
    TriadParameters(noise_density=np.full(3, 1.6968e-4), random_walk=np.full(3, 1.9393e-5)),
    TriadParameters(noise_density=np.full(3, 2.0e-3), random_walk=np.full(3, 3.0e-3)),
)
ANISOTROPIC = TriadsParameters(
    TriadParameters(
        noise_density=np.array([1.0, 2.0, 3.0]) * 1e-3, random_walk=np.array([3.0, 1.0, 2.0]) * 1e-4
    ),
    TriadParameters(
        noise_density=np.array([2.0, 3.0, 1.0]) * 1e-2, random_walk=np.array([1.0, 3.0, 2.0]) * 1e-3
    ),
)
SECOND = 1_000_000_000


@pytest.fixture(scope="module")
def readings(record):
    motion = record("excitation", 200.0, 3.0)
    edges = motion.t_ns[0] + np.array([0, SECOND, 1.4 * SECOND, 3 * SECOND]).astype(np.int64)
    return between(motion.t_ns, motion.gyro, motion.accel, edges)


@pytest.mark.parametrize("method", METHODS)
def test_it_is_dead_reckoning_without_start_and_gravity(record, method):
    motion = record("lecture", 200.0, 1.0)
    arguments = (motion.t_ns, motion.gyro, motion.accel)
    states = dead_reckon(*arguments, AT_REST, method, gravity=(0.0, 0.0, 0.0))
    pre = preintegrate(between(*arguments, motion.t_ns[[0, -1]]), method=method)
    np.testing.assert_allclose(pre.alpha[0], states.position[-1], atol=1e-12)
    np.testing.assert_allclose(pre.beta[0], states.velocity[-1], atol=1e-12)
    np.testing.assert_allclose(pre.gamma[0], states.q_wb[-1], atol=1e-13)


@pytest.mark.parametrize("method", METHODS)
def test_a_batch_equals_single_intervals(readings, method):
    """Intervals of 200, 80 and 320 steps; the shorter ones are filled up to the longest."""
    together = preintegrate(readings, ANISOTROPIC, 0.01, 0.1, method)
    assert readings.h.shape == (3, 320)
    for k, count in enumerate((200, 80, 320)):
        single = StepReadings(
            readings.h[k : k + 1, :count],
            readings.gyro[k : k + 1, : count + 1],
            readings.accel[k : k + 1, : count + 1],
        )
        alone = preintegrate(single, ANISOTROPIC, 0.01, 0.1, method)
        for single_field, batch_field in zip(alone, together, strict=True):
            np.testing.assert_allclose(batch_field[k], single_field[0], rtol=1e-12, atol=1e-18)


def test_readings_are_interpolated_at_the_edges(record):
    """Edges between the stamps: the parts put together are the whole."""
    motion = record("lecture", 200.0, 1.0)
    arguments = (motion.t_ns, motion.gyro, motion.accel)
    start, end = motion.t_ns[[0, -1]]
    middle = start + 333_333_333
    expected = preintegrate(between(*arguments, [start, end]))
    parts = preintegrate(between(*arguments, [start, middle, end]))
    gamma = rotation.multiply(parts.gamma[0], parts.gamma[1])
    first_rotation = rotation.to_matrix(parts.gamma[0])
    beta = parts.beta[0] + first_rotation @ parts.beta[1]
    alpha = parts.alpha[0] + parts.beta[0] * parts.duration[1] + first_rotation @ parts.alpha[1]
    # One step of 5 ms is split into two: the difference is that of their midpoint rules.
    np.testing.assert_allclose(gamma, expected.gamma[0], atol=1e-8)
    np.testing.assert_allclose(beta, expected.beta[0], atol=1e-6)
    np.testing.assert_allclose(alpha, expected.alpha[0], atol=1e-6)


def perturbed(readings, method, column, step):
    """Return the deltas with one component of a bias moved, as (B, 9)."""
    moved = np.zeros(6)
    moved[column] = step
    pre = preintegrate(readings, None, 0.01 + moved[3:], 0.1 + moved[:3], method)
    return pre.alpha, pre.gamma, pre.beta


@pytest.mark.parametrize("method", METHODS)
def test_bias_jacobians_are_the_derivatives(readings, method):
    base = preintegrate(readings, None, 0.01, 0.1, method)
    step = 1e-4
    numeric = np.zeros((3, 9, 6))
    for column in range(6):
        high, low = (perturbed(readings, method, column, s) for s in (step, -step))
        turn = rotation.multiply(rotation.conjugate(low[1]), high[1])
        # The local error at the middle: Log(low^-1 high) / 2 step, up to third order.
        difference = np.concatenate([high[0] - low[0], rotation.log(turn), high[2] - low[2]], 1)
        numeric[:, :, column] = difference / (2 * step)
    analytic = base.jacobian[:, :9, 9:]
    for rows in (slice(0, 3), slice(3, 6), slice(6, 9)):
        for columns in (slice(0, 3), slice(3, 6)):
            block, expected = analytic[:, rows, columns], numeric[:, rows, columns]
            scale = np.abs(expected).max(axis=(1, 2), keepdims=True)
            assert np.all(np.abs(block - expected) <= 1e-6 * scale + 1e-10)


def state_after(method, h, gyro, accel, start, noise):
    """Return the state after a step from a perturbed state (15,) with perturbed readings (12,)."""
    alpha, theta, beta, b_a, b_g = start.reshape(5, 3)
    rate = gyro[0] - noise[[[3, 4, 5], [9, 10, 11]]] - b_g
    force = accel[0] - noise[[[0, 1, 2], [6, 7, 8]]] - b_a
    r0 = rotation.multiply(BEFORE, rotation.exp(theta))
    turn = (rate[0] if method == "euler" else 0.5 * (rate[0] + rate[1])) * h
    r1 = rotation.multiply(r0, rotation.exp(turn))
    acceleration = rotation.rotate(r0, force[0])
    if method == "midpoint":
        acceleration = 0.5 * (acceleration + rotation.rotate(r1, force[1]))
    return alpha + beta * h + 0.5 * acceleration * h * h, r1, beta + acceleration * h, b_a, b_g


BEFORE = rotation.from_euler([0.3, -0.2, 0.9])


@pytest.mark.parametrize("method", METHODS)
def test_f_and_g_are_the_derivatives_of_a_step(method):
    from imu_sim_ros.navigation import preintegration as deltas

    h = np.array([[0.01]])
    gyro, accel = np.random.default_rng(1).normal(size=(2, 1, 2, 3)) * [[[[2.0]]], [[[10.0]]]]
    step = {"euler": deltas._euler, "midpoint": deltas._midpoint}[method]
    _, f, g = step(h, BEFORE[None], gyro, accel)

    def difference(direction, size):
        sides = []
        for sign in (1.0, -1.0):
            start, noise = np.zeros(15), np.zeros(12)
            (start if direction < 15 else noise)[direction % 15] = sign * size
            sides.append(state_after(method, 0.01, gyro, accel, start, noise))
        high, low = sides
        turn = rotation.log(rotation.multiply(rotation.conjugate(low[1]), high[1]))
        parts = [high[0] - low[0], turn, *(high[k] - low[k] for k in (2, 3, 4))]
        return np.concatenate(parts) / (2.0 * size)

    numeric = np.stack([difference(k, 1e-4) for k in range(27)], axis=1)
    for name, analytic, expected in (("F", f[0], numeric[:, :15]), ("G", g[0], numeric[:, 15:])):
        for row in range(0, 15, 3):
            block, expected_rows = analytic[row : row + 3], expected[row : row + 3]
            error = np.abs(block - expected_rows).max()
            assert error <= 1e-6 * np.abs(expected_rows).max() + 1e-11, (name, row)


def test_the_correction_for_a_bias_is_of_first_order(readings):
    pre = preintegrate(readings, ADIS16448)
    gyro_bias = np.array([[1e-3, -2e-3, 1e-3], [0.02, 0.0, 0.0], [0.0, 0.0, 0.0]])
    accel_bias = np.array([[0.02, 0.01, 0.03], [0.0, 0.0, 0.0], [0.0, 0.2, 0.0]])
    exact = preintegrate(readings, ADIS16448, gyro_bias, accel_bias)
    first_order = corrected(pre, gyro_bias, accel_bias)
    # What first order leaves is of second order: |db T|^2 of the quantity itself.
    assert np.abs(first_order.alpha[0] - exact.alpha[0]).max() < 1e-5 * 10
    assert np.abs(pre.alpha[0] - exact.alpha[0]).max() > 5e-3


def test_noise_of_both_ends_taken_as_new_halves_the_white_noise(readings):
    """The form of VINS; over many steps the shared form has twice its variance."""
    gyroscope = dataclasses.replace(ADIS16448.gyroscope, random_walk=np.zeros(3))
    white = dataclasses.replace(ADIS16448, gyroscope=gyroscope)
    shared = preintegrate(readings, white).covariance[:, THETA, THETA]
    separate = preintegrate(readings, white, shared_noise=False).covariance[:, THETA, THETA]
    # n steps: n - 1/2 readings' worth against n / 2.
    steps = np.array([200, 80, 320])
    ratio = np.trace(shared, axis1=1, axis2=2) / np.trace(separate, axis1=1, axis2=2)
    np.testing.assert_allclose(ratio, (steps - 0.5) / (0.5 * steps), rtol=1e-3)
    euler = [preintegrate(readings, white, method="euler", shared_noise=s) for s in (True, False)]
    np.testing.assert_array_equal(euler[0].covariance, euler[1].covariance)


def test_bad_intervals_and_methods_are_refused(record):
    motion = record("lecture", 100.0, 1.0)
    arguments = (motion.t_ns, motion.gyro, motion.accel)
    with pytest.raises(InputError, match="must increase, two or more"):
        between(*arguments, motion.t_ns[[3, 3]])
    with pytest.raises(InputError, match="needs readings over all of it"):
        between(*arguments, [motion.t_ns[0], motion.t_ns[-1] + 1])
    with pytest.raises(ConfigurationError, match="method = 'rk4': must be one of euler, midpoint"):
        preintegrate(between(*arguments, motion.t_ns[[0, -1]]), method="rk4")


# Oracle: gtsam's PreintegratedImuMeasurements. Its manifold form is the Euler form with the
# exponential: the reading of the step's start, p += v h + a h^2 / 2.


def gtsam_measurements(kind, t_ns, gyro, accel, noise=ADIS16448, biases=(0.1, 0.01)):
    gtsam = pytest.importorskip("gtsam")
    combined = "Combined" in kind
    parameters_class = (
        gtsam.PreintegrationCombinedParams if combined else gtsam.PreintegrationParams
    )
    parameters = parameters_class.MakeSharedU(0.0)
    parameters.setAccelerometerCovariance(np.diag(noise.accelerometer.noise_density**2))
    parameters.setGyroscopeCovariance(np.diag(noise.gyroscope.noise_density**2))
    parameters.setIntegrationCovariance(np.zeros((3, 3)))
    if combined:
        parameters.setBiasAccCovariance(np.diag(noise.accelerometer.random_walk**2))
        parameters.setBiasOmegaCovariance(np.diag(noise.gyroscope.random_walk**2))
    bias = gtsam.imuBias.ConstantBias(np.full(3, biases[0]), np.full(3, biases[1]))
    measured = getattr(gtsam, kind)(parameters, bias)
    for k, h in enumerate(np.diff(t_ns) * 1e-9):
        measured.integrateMeasurement(accel[k], gyro[k], float(h))
    return measured


MANIFOLD = "PreintegratedImuMeasurementsManifold"
COMBINED = "PreintegratedCombinedMeasurementsManifold"


def whole_interval(motion, **options):
    edges = motion.t_ns[[0, -1]]
    readings = between(motion.t_ns, motion.gyro, motion.accel, edges)
    return preintegrate(readings, ADIS16448, 0.01, 0.1, **options)


def test_euler_form_equals_gtsam(record):
    motion = record("excitation", 200.0, 2.0)
    measured = gtsam_measurements(MANIFOLD, motion.t_ns, motion.gyro, motion.accel)
    pre = whole_interval(motion, method="euler")
    np.testing.assert_allclose(pre.alpha[0], measured.deltaPij(), atol=1e-9, rtol=0)
    np.testing.assert_allclose(pre.beta[0], measured.deltaVij(), atol=1e-9, rtol=0)
    expected = measured.deltaRij().matrix()
    np.testing.assert_allclose(rotation.to_matrix(pre.gamma[0]), expected, atol=1e-9, rtol=0)


def test_midpoint_form_differs_from_the_truth_by_second_order(record, motions):
    """gtsam's Euler form is first order, the midpoint form second, on three rates."""
    rates = np.array([100.0, 200.0, 400.0])
    truth = gtsam_like_truth(motions, 1.9)
    differences = []
    for rate in rates:
        motion = record("excitation", rate, 1.9)
        pre = preintegrate(between(motion.t_ns, motion.gyro, motion.accel, motion.t_ns[[0, -1]]))
        measured = gtsam_measurements(
            MANIFOLD, motion.t_ns, motion.gyro, motion.accel, biases=(0.0, 0.0)
        )
        differences.append(
            [np.linalg.norm(pre.alpha[0] - truth), np.linalg.norm(measured.deltaPij() - truth)]
        )
    slopes = -np.polyfit(np.log(rates), np.log(differences), 1)[0]
    assert slopes == pytest.approx([2.0, 1.0], abs=0.1)


def gtsam_like_truth(motions, duration):
    """Return the true alpha of the motion: R_i^T (p_j - p_i - v_i T - g T^2 / 2)."""
    position, velocity, _, q_wb, _ = motions["excitation"](np.array([0.0, duration]))
    gravity = np.array([0.0, 0.0, -9.81])
    moved = position[1] - position[0] - velocity[0] * duration - 0.5 * gravity * duration**2
    return rotation.rotate_inverse(q_wb[0], moved)


def as_gtsam(pre):
    """Return a covariance in gtsam's order (rotation, position, velocity, biases) and axes.

    gtsam's NavState moves position and velocity by R_ij d instead of by d.
    """
    turn = np.eye(15)
    to_body = rotation.to_matrix(pre.gamma[0]).T
    turn[3:6, 3:6] = turn[6:9, 6:9] = to_body
    order = np.r_[3:6, 0:3, 6:9, 9:15]
    return turn @ pre.covariance[0][np.ix_(order, order)] @ turn.T


@pytest.mark.parametrize("method", METHODS)
def test_covariance_equals_gtsam(record, method):
    """Rotation, position, velocity; the walk of the biases is not in this one."""
    motion = record("excitation", 200.0, 2.0)
    measured = gtsam_measurements(MANIFOLD, motion.t_ns, motion.gyro, motion.accel)
    triads = (ADIS16448.gyroscope, ADIS16448.accelerometer)
    no_walk = TriadsParameters(
        *(dataclasses.replace(triad, random_walk=np.zeros(3)) for triad in triads)
    )
    readings = between(motion.t_ns, motion.gyro, motion.accel, motion.t_ns[[0, -1]])
    ours = as_gtsam(preintegrate(readings, no_walk, 0.01, 0.1, method))[:9, :9]
    assert_close_covariance(ours, measured.preintMeasCov(), 1e-9 if method == "euler" else 0.01)


def test_covariance_with_biases_equals_gtsam(record):
    """All 15 rows of gtsam's combined form: rotation, position, velocity, accelerometer, gyro.

    gtsam counts the errors of the biases the other way round: estimate less truth.
    """
    motion = record("excitation", 200.0, 2.0)
    measured = gtsam_measurements(COMBINED, motion.t_ns, motion.gyro, motion.accel)
    sign = np.repeat([1.0, -1.0], [9, 6])
    ours = sign[:, None] * as_gtsam(whole_interval(motion, method="euler")) * sign
    assert_close_covariance(ours, measured.preintMeasCov(), 1e-9)
    midpoint = sign[:, None] * as_gtsam(whole_interval(motion)) * sign
    assert_close_covariance(midpoint, measured.preintMeasCov(), 0.01)


def assert_close_covariance(ours, theirs, tolerance):
    """Compare as correlations: each entry against the sigmas of its row and column."""
    sigma = np.sqrt(np.diag(theirs))
    assert np.abs((ours - theirs) / np.outer(sigma, sigma)).max() < tolerance


def test_bias_jacobians_equal_gtsam(record):
    """gtsam gives no access to its Jacobians: its prediction at moved biases shows them."""
    gtsam = pytest.importorskip("gtsam")
    motion = record("excitation", 200.0, 2.0)
    measured = gtsam_measurements(MANIFOLD, motion.t_ns, motion.gyro, motion.accel)
    pre = whole_interval(motion, method="euler")
    start = gtsam.NavState(gtsam.Pose3(), np.zeros(3))
    step = 1e-5
    for column in range(6):
        moved = np.zeros(6)
        moved[column] = step
        bias = [
            gtsam.imuBias.ConstantBias(0.1 + s * moved[:3], 0.01 + s * moved[3:]) for s in (1, -1)
        ]
        high, low = (measured.predict(start, b) for b in bias)
        turn = low.attitude().between(high.attitude())
        theirs = np.concatenate(
            [
                high.position() - low.position(),
                gtsam.Rot3.Logmap(turn),
                high.velocity() - low.velocity(),
            ]
        ) / (2 * step)
        place = (ACCEL_BIAS if column < 3 else GYRO_BIAS).start + column % 3
        ours = pre.jacobian[0, :9, place]
        for rows in (slice(0, 3), slice(3, 6), slice(6, 9)):
            scale = np.abs(theirs[rows]).max()
            np.testing.assert_allclose(ours[rows], theirs[rows], atol=1e-4 * scale + 1e-9)
