# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Steps of the covariance against the same steps as matrices, written as in the modules' texts."""

import numpy as np
import pytest

from imu_sim_ros.core import components, rotation
from imu_sim_ros.core.conventions import TRIADS
from imu_sim_ros.navigation.covariance import Covariance, initial_covariance
from imu_sim_ros.navigation.initialisation import covariance_after_rest
from imu_sim_ros.sensors.imu.triads import TriadParameters, TriadsParameters

AXES = np.array([1.0, 2.0, 3.0])


def of_sizes(**sizes: np.ndarray) -> TriadsParameters:
    """Return triads with errors of these sizes alone, by the parameters' names."""
    triads = ({n.partition("_")[2]: v for n, v in sizes.items() if n.startswith(t)} for t in TRIADS)
    return TriadsParameters(*(TriadParameters(**triad) for triad in triads))


@pytest.mark.parametrize("axes", [(1.0, 1.0, 1.0), (1.0, 2.0, 0.5)], ids=["equal", "different"])
def test_the_fast_step_is_the_plain_one(axes: tuple[float, float, float]) -> None:
    """The step as matrices, written as in the module's text, gives the same numbers."""
    term_axes = np.array(axes)
    noise = of_sizes(
        gyroscope_noise_density=0.01 * term_axes,
        gyroscope_random_walk=1e-4 * term_axes,
        accelerometer_noise_density=0.02 * term_axes,
        accelerometer_random_walk=1e-3 * term_axes,
        gyroscope_resolution=1e-3 * term_axes,
        accelerometer_resolution=1e-2 * term_axes,
    )
    generator = np.random.default_rng(5)
    start = initial_covariance(1e-3, 0.1, 0.2, 1e-3, 1e-2)
    fast, plain = Covariance(noise, start), start
    for _ in range(50):
        h = generator.uniform(0.001, 0.0015)
        r_wb = rotation.exp(generator.standard_normal(3))
        r_wb = rotation.to_matrix(r_wb)
        force = generator.standard_normal(3) + np.array([0.0, 0.0, 9.81])
        fast.step(h, r_wb, force)
        tilt = -rotation.skew(r_wb @ force * h)
        f = np.eye(15)
        f[0:3, 9:12] = f[3:6, 12:15] = -r_wb * h
        f[6:9, 12:15] = -r_wb * h * h / 2
        f[3:6, 0:3], f[6:9, 0:3] = tilt, tilt * h / 2
        f[6:9, 3:6] = h * np.eye(3)
        plain = f @ plain @ f.T
        for rows, triad in ((slice(0, 3), noise.gyroscope), (slice(3, 6), noise.accelerometer)):
            rounding = triad.resolution**2 / 12
            white = np.diag(triad.noise_density**2 * h + rounding * h**2)
            plain[rows, rows] += r_wb @ white @ r_wb.T
        walks = [noise.gyroscope.random_walk, noise.accelerometer.random_walk]
        plain[9:, 9:] += np.diag(np.concatenate(walks) ** 2 * h)
    sigma = np.sqrt(np.diag(plain))
    np.testing.assert_allclose(
        fast.matrix / np.outer(sigma, sigma), plain / np.outer(sigma, sigma), rtol=0, atol=1e-12
    )
    velocity, rate = np.array([1.0, -2.0, 3.0]), 500.0
    pose, twist = fast.message(
        components.float_matrix(r_wb), components.float_vector(velocity), rate
    )
    np.testing.assert_array_equal(pose, fast.pose())
    np.testing.assert_array_equal(twist, fast.twist(r_wb, velocity, rate))
    jacobian = np.zeros((6, 15))
    jacobian[:3, 0:3], jacobian[:3, 3:6] = r_wb.T @ rotation.skew(velocity), r_wb.T
    jacobian[3:, 9:12] = -np.eye(3)
    expected = jacobian @ fast.mean_square() @ jacobian.T
    expected[3:, 3:] += np.diag(
        noise.gyroscope.noise_density**2 * rate + noise.gyroscope.resolution**2 / 12
    )
    np.testing.assert_allclose(twist, expected, rtol=1e-12, atol=1e-18)


def test_slow_errors_are_those_of_a_larger_state() -> None:
    """State and slow errors as one vector, propagated by matrices, from the end of a rest on."""
    noise = of_sizes(
        gyroscope_gauss_markov_sigma=1e-3 * AXES,
        gyroscope_correlation_time=np.array([3.0, 10.0, 30.0]),
        gyroscope_turn_on_scale_sigma=1e-2 * AXES,
        accelerometer_gauss_markov_sigma=1e-2 * AXES,
        accelerometer_correlation_time=np.array([5.0, 10.0, 20.0]),
        accelerometer_misalignment_sigma=1e-3 * AXES,
        accelerometer_quadratic_sigma=1e-4 * AXES,
    )
    generator = np.random.default_rng(6)
    covariance = covariance_after_rest(noise, 10.0, 1e-2, np.eye(3), (0.0, 0.0, -9.81), 200.0)
    slow = covariance.slow
    count, biases = slow.cross.shape[1], slice(9, 15)
    whole = np.block([[covariance.matrix, slow.cross], [slow.cross.T, np.eye(count)]])
    for _ in range(50):
        h = generator.uniform(0.001, 0.02)
        r_wb = rotation.to_matrix(rotation.exp(generator.standard_normal(3)))
        force, rate = generator.standard_normal((2, 3)) + np.array([[0.0, 0.0, 9.81], [0, 0, 0]])
        covariance.step(h, r_wb, force, rate)
        tilt = -rotation.skew(r_wb @ force * h)
        f = np.eye(15 + count)
        f[0:3, 9:12] = f[3:6, 12:15] = -r_wb * h
        f[6:9, 12:15] = -r_wb * h * h / 2
        f[3:6, 0:3], f[6:9, 0:3] = tilt, tilt * h / 2
        f[6:9, 3:6] = h * np.eye(3)
        f[:9, 15:] = f[:9, biases] @ slow.effect
        phi = np.exp(-h / np.array([3.0, 10.0, 30.0, 5.0, 10.0, 20.0]))
        f[range(15, 21), range(15, 21)] = phi
        whole = f @ whole @ f.T
        whole[range(15, 21), range(15, 21)] += 1.0 - phi**2
    sigma = np.sqrt(np.diag(whole))
    scaled = whole / np.outer(sigma, sigma)
    both = np.hstack([covariance.matrix, slow.cross]) / np.outer(sigma[:15], sigma)
    np.testing.assert_allclose(both, scaled[:15], rtol=0, atol=1e-12)
    total = np.hstack([np.eye(6), slow.effect])
    rows = np.r_[9:15, 15 : 15 + count]
    expected = total @ whole[np.ix_(rows, rows)] @ total.T
    np.testing.assert_allclose(
        covariance.mean_square()[biases, biases], expected, rtol=1e-9, atol=1e-15
    )
