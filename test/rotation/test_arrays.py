# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Rotations against SciPy, an implementation that is not ours, and against their definitions."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from imu_sim_ros.core import rotation

RNG = np.random.default_rng(20191018)
VECTORS = RNG.normal(size=(500, 3))
QUATERNIONS = rotation.exp(VECTORS)


def scipy_rotation(q):
    return Rotation.from_quat(np.roll(q, -1, axis=-1))


def test_product_and_matrix_agree_with_scipy():
    p, q = QUATERNIONS[:250], QUATERNIONS[250:]
    expected = (scipy_rotation(p) * scipy_rotation(q)).as_matrix()
    np.testing.assert_allclose(rotation.to_matrix(rotation.multiply(p, q)), expected, atol=1e-14)


def test_exp_and_log_agree_with_scipy():
    np.testing.assert_allclose(
        rotation.to_matrix(QUATERNIONS), Rotation.from_rotvec(VECTORS).as_matrix(), atol=1e-14
    )
    np.testing.assert_allclose(
        rotation.log(QUATERNIONS), scipy_rotation(QUATERNIONS).as_rotvec(), atol=1e-13
    )


@pytest.mark.parametrize("angle", [0.0, 1e-300, 1e-12, 1e-8, 1e-5, 0.99e-4, 1.01e-4, 1.0, 3.1415])
def test_log_inverts_exp_at_every_size(angle):
    v = angle * np.array([0.6, -0.48, 0.64])
    np.testing.assert_allclose(rotation.log(rotation.exp(v)), v, rtol=1e-11, atol=0)


def test_matrix_of_half_turns_is_inverted():
    half_turns = rotation.exp(np.pi * np.vstack([np.eye(3), [[0.6, 0.8, 0.0]]]))
    matrices = rotation.to_matrix(half_turns)
    np.testing.assert_allclose(
        rotation.to_matrix(rotation.from_matrix(matrices)), matrices, atol=1e-15
    )
    np.testing.assert_allclose(
        rotation.from_matrix(rotation.to_matrix(QUATERNIONS)),
        rotation.canonical(QUATERNIONS),
        atol=1e-14,
    )


def test_rotate_is_the_matrix_product():
    v = RNG.normal(size=(500, 3))
    expected = np.einsum("nij,nj->ni", rotation.to_matrix(QUATERNIONS), v)
    np.testing.assert_allclose(rotation.rotate(QUATERNIONS, v), expected, atol=1e-14)
    np.testing.assert_allclose(rotation.rotate_inverse(QUATERNIONS, expected), v, atol=1e-14)


def test_euler_angles_follow_the_convention():
    angles = RNG.uniform([-3.1, -1.5, -3.1], [3.1, 1.5, 3.1], size=(500, 3))
    expected = Rotation.from_euler("ZYX", angles[:, ::-1]).as_matrix()
    q = rotation.from_euler(angles)
    np.testing.assert_allclose(rotation.to_matrix(q), expected, atol=1e-14)
    np.testing.assert_allclose(rotation.to_euler(q), angles, atol=1e-12)


def test_yaw_turns_the_body_left():
    """A quarter turn of yaw points the body's x axis along the world's y axis."""
    q_wb = rotation.from_euler([0.0, 0.0, np.pi / 2])
    np.testing.assert_allclose(rotation.rotate(q_wb, [1.0, 0.0, 0.0]), [0, 1, 0], atol=1e-15)


def test_euler_rates_give_the_body_rate():
    """Lecture eq. 37 against the central difference of the attitude, whose error is h^2."""
    angles, rates, h = np.array([0.3, -0.7, 1.1]), np.array([0.5, -0.2, 0.9]), 1e-5
    q_start, q_end = (rotation.from_euler(angles + s * h * rates) for s in (-1, 1))
    omega = rotation.log(rotation.multiply(rotation.conjugate(q_start), q_end)) / (2 * h)
    np.testing.assert_allclose(rotation.euler_rates_to_body_rates(angles) @ rates, omega, atol=1e-9)
    product = rotation.euler_rates_to_body_rates(angles) @ rotation.body_rates_to_euler_rates(
        angles
    )
    np.testing.assert_allclose(product, np.eye(3), atol=1e-15)


@pytest.mark.parametrize("scale", [1e-6, 0.9e-4, 1.1e-4, 1.0])
def test_right_jacobian_is_the_derivative_of_exp(scale):
    v, h = scale * np.array([0.3, -0.5, 0.8]), 1e-6
    base = rotation.conjugate(rotation.exp(v))
    columns = [
        rotation.log(rotation.multiply(base, rotation.exp(v + h * e)))
        - rotation.log(rotation.multiply(base, rotation.exp(v - h * e)))
        for e in np.eye(3)
    ]
    jacobian = rotation.right_jacobian(v)
    np.testing.assert_allclose(jacobian, np.transpose(columns) / (2 * h), atol=1e-9)


def test_continuous_removes_every_sign_flip():
    smooth = rotation.exp(np.linspace(0, 6, 200)[:, None] * [0.6, 0.0, 0.8])
    flipped = smooth * np.where(RNG.random(200) < 0.5, -1.0, 1.0)[:, None]
    result = rotation.unwrap_signs(flipped)
    np.testing.assert_array_equal(result, smooth * np.sign(flipped[0, 0] * smooth[0, 0]))
    assert rotation.unwrap_signs(np.empty((0, 4))).shape == (0, 4)


@pytest.mark.parametrize("n", [0, 1, 2, 3, 10, 101, 1000])
def test_cumulative_product_is_the_loop(n):
    q = rotation.exp(RNG.normal(scale=0.01, size=(n, 3)))
    expected, product = [], rotation.IDENTITY
    for row in q:
        product = rotation.multiply(product, row)
        expected.append(product)
    np.testing.assert_allclose(
        rotation.cumulative_product(q), np.reshape(expected, (n, 4)), atol=1e-14
    )


def test_cumulative_product_rounds_as_products_do():
    """One after the other within a row, and by the product before it: the same bits."""
    q = rotation.normalise(np.random.default_rng(4).normal(size=(100, 4)))
    rows = [[start] for start in q.reshape(10, 10, 4)[:, 0]]
    start, expected = rotation.IDENTITY, []
    for row, quaternions in zip(rows, q.reshape(10, 10, 4), strict=True):
        for quaternion in quaternions[1:]:
            row.append(rotation.multiply(row[-1], quaternion))
        expected += [rotation.multiply(start, product) for product in row]
        start = rotation.multiply(start, row[-1])
    assert np.array_equal(rotation.cumulative_product(q), np.array(expected))
