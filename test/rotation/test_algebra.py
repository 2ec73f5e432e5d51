# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""The quaternion algebra obeys its laws and agrees with SciPy.

The laws are those of the unit quaternions and of SO(3) (Sola, "Quaternion kinematics for the
error-state Kalman filter", arXiv:1711.02508, sections 1 and 2).
"""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from imu_sim_ros.core import rotation

RNG = np.random.default_rng(16)
N = 300
P, Q = (rotation.normalise(RNG.normal(size=(N, 4))) for _ in range(2))
U, V = RNG.normal(size=(2, N, 3))
SIZES = (0.0, 1e-300, 1e-12, 1e-8, 0.99e-4, 1.01e-4, 1.99e-4, 2.01e-4, 1e-2, 1.0, np.pi, 6.0)
TURNS = np.concatenate([size * rotation.normalise(RNG.normal(size=(20, 3))) for size in SIZES])
ANGLES = RNG.uniform([-3.1, -1.5, -3.1], [3.1, 1.5, 3.1], size=(N, 3))
TIGHT = 4e-15
"""A dozen roundings of 1.1e-16 on numbers below 5."""


def call(name, *rows):
    """Return what a function of the module gives; in either order of memory it is the same."""
    function = getattr(rotation, name)
    rotated = function(*rows)
    by_columns = function(*(np.asfortranarray(row) for row in rows))
    np.testing.assert_array_equal(rotated, by_columns)
    return rotated


def scipy_rotation(q):
    return Rotation.from_quat(np.roll(q, -1, axis=-1))


def matrices(q):
    return scipy_rotation(q).as_matrix()


def assert_close(actual, expected, tolerance=TIGHT):
    np.testing.assert_allclose(actual, expected, rtol=0, atol=tolerance)


def test_a_product_of_quaternions_is_the_product_of_the_matrices():
    product = call("multiply", P, Q)
    assert_close(np.linalg.norm(product, axis=1), 1.0)
    assert_close(matrices(product), matrices(P) @ matrices(Q))


def test_rotating_twice_is_rotating_by_the_product():
    product = call("multiply", P, Q)
    twice = call("rotate", P, call("rotate", Q, V))
    assert_close(call("rotate", product, V), twice)


def test_rotation_is_the_matrix_product_and_keeps_length_and_handedness():
    turned = call("rotate", Q, V)
    assert_close(turned, scipy_rotation(Q).apply(V))
    assert_close(np.linalg.norm(turned, axis=1), np.linalg.norm(V, axis=1))
    assert_close(
        np.cross(turned, call("rotate", Q, U)),
        call("rotate", Q, np.cross(V, U)),
        2e-14,
    )


def test_the_inverse_rotation_turns_back():
    assert_close(call("rotate_inverse", Q, call("rotate", Q, V)), V)
    assert_close(call("rotate_inverse", Q, V), scipy_rotation(Q).inv().apply(V))


def test_the_conjugate_is_the_inverse():
    identity = np.tile(rotation.IDENTITY, (N, 1))
    assert_close(call("multiply", Q, call("conjugate", Q)), identity)


@pytest.mark.parametrize("factor", [1e-100, 1.0 - 1e-12, 1.0, 3.0, 1e100])
def test_normalised_quaternions_keep_their_direction(factor):
    assert_close(call("normalise", factor * Q), Q, 1e-15)


def test_exp_is_the_rotation_by_the_vector_at_every_size():
    q = call("exp", TURNS)
    assert_close(np.linalg.norm(q, axis=1), 1.0, 1e-15)
    assert_close(matrices(q), Rotation.from_rotvec(TURNS).as_matrix())
    # The vector part of a small turn is half the vector, to all digits.
    small = np.linalg.norm(TURNS, axis=1) < 1e-7
    np.testing.assert_allclose(q[small, 1:], 0.5 * TURNS[small], rtol=1e-14, atol=0)


def test_turns_about_one_axis_add_up():
    parts = call("multiply", call("exp", 0.3 * V), call("exp", 0.7 * V))
    assert_close(parts, call("exp", V))


def test_cross_is_the_vector_product():
    assert_close(call("cross", U, V), np.cross(U, V), 1e-15)


def test_euler_angles_are_yaw_pitch_roll_and_come_back():
    q = call("from_euler", ANGLES)
    assert_close(matrices(q), Rotation.from_euler("ZYX", ANGLES[:, ::-1]).as_matrix())
    # Near a pitch of 90 degrees roll and yaw lose digits as 1 / cos(1.5) = 14.
    assert_close(call("to_euler", q), ANGLES, 1e-13)


def test_a_matrix_is_applied_alike_to_few_and_to_many():
    for matrix in (np.eye(3), RNG.normal(size=(3, 3)), np.diag([1.0, 0.0, 2.0])):
        many = rotation.transform(matrix, V)
        assert_close(many, V @ matrix.T, 1e-14)
        few = [rotation.transform(matrix, V[k : k + 7]) for k in range(0, N, 7)]
        np.testing.assert_array_equal(many, np.concatenate(few))
        # A matrix for each of the second axis's places, the same bits.
        batch = np.broadcast_to(V[:, None], (N, 4, 3))
        transformed_batch = rotation.transform(np.tile(matrix, (4, 1, 1)), batch)
        np.testing.assert_array_equal(transformed_batch, np.broadcast_to(many[:, None], (N, 4, 3)))


def test_results_have_the_same_bits_in_blocks_of_any_size():
    for name, operands in (
        ("multiply", (Q, P)),
        ("rotate", (Q, V)),
        ("rotate_inverse", (Q, V)),
        ("cross", (U, V)),
        ("exp", (V,)),
        ("log", (Q,)),
    ):
        function = getattr(rotation, name)
        parts = [function(*(o[k : k + 7].copy() for o in operands)) for k in range(0, N, 7)]
        np.testing.assert_array_equal(function(*operands), np.concatenate(parts))


def test_each_component_of_a_result_is_contiguous():
    for name, operands in (("multiply", (Q, P)), ("rotate", (Q, V)), ("exp", (V,))):
        assert all(component.flags.c_contiguous for component in call(name, *operands).T), name


def test_one_rotation_is_applied_to_many():
    many = rotation.multiply(P[0], Q)
    assert_close(many, rotation.multiply(np.tile(P[0], (N, 1)), Q), 0.0)
    assert_close(rotation.rotate(P[0], V), rotation.rotate(np.tile(P[0], (N, 1)), V), 0.0)
    assert_close(
        rotation.rotate_inverse(Q, V[0]), rotation.rotate_inverse(Q, np.tile(V[0], (N, 1))), 0.0
    )
