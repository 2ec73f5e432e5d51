# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Every layout of the quaternion algebra obeys the same laws and agrees with SciPy.

The laws are those of the unit quaternions and of SO(3) (Sola, "Quaternion kinematics for the
error-state Kalman filter", arXiv:1711.02508, sections 1 and 2). Each layout is given the same rows
and its results are turned back into rows.
"""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from imu_sim_ros import rotation
from imu_sim_ros.rotation import components, scalars

RNG = np.random.default_rng(16)
N = 300
P, Q = (rotation.normalise(RNG.normal(size=(N, 4))) for _ in range(2))
U, V = RNG.normal(size=(2, N, 3))
SIZES = (0.0, 1e-300, 1e-12, 1e-8, 0.99e-4, 1.01e-4, 1.99e-4, 2.01e-4, 1e-2, 1.0, np.pi, 6.0)
TURNS = np.concatenate([size * rotation.normalise(RNG.normal(size=(20, 3))) for size in SIZES])
ANGLES = RNG.uniform([-3.1, -1.5, -3.1], [3.1, 1.5, 3.1], size=(N, 3))
TIGHT = 4e-15
"""A dozen roundings of 1.1e-16 on numbers below 5."""


class Rows:
    """Time first."""

    module = rotation

    @staticmethod
    def call(name, *rows):
        return getattr(rotation, name)(*rows)


class Columns:
    """Components first."""

    module = components

    @staticmethod
    def call(name, *rows):
        return getattr(components, name)(*(np.ascontiguousarray(r.T) for r in rows)).T


class OneByOne:
    """Tuples of floats."""

    module = scalars

    @staticmethod
    def call(name, *rows):
        function = getattr(scalars, name)
        return np.array(
            [
                function(*map(tuple, each))
                for each in zip(*map(np.ndarray.tolist, rows), strict=True)
            ]
        )


LAYOUTS = (Rows, Columns, OneByOne)


def layouts(*names):
    """All layouts that have these functions."""
    chosen = [layout for layout in LAYOUTS if all(hasattr(layout.module, n) for n in names)]
    assert len(chosen) >= 2
    return pytest.mark.parametrize("layout", chosen, ids=lambda layout: layout.__name__)


def scipy_rotation(q):
    return Rotation.from_quat(np.roll(q, -1, axis=-1))


def matrices(q):
    return scipy_rotation(q).as_matrix()


def same(actual, expected, tolerance=TIGHT):
    np.testing.assert_allclose(actual, expected, rtol=0, atol=tolerance)


@layouts("multiply")
def test_a_product_of_quaternions_is_the_product_of_the_matrices(layout):
    product = layout.call("multiply", P, Q)
    same(np.linalg.norm(product, axis=1), 1.0)
    same(matrices(product), matrices(P) @ matrices(Q))


@layouts("multiply", "rotate")
def test_rotating_twice_is_rotating_by_the_product(layout):
    product = layout.call("multiply", P, Q)
    twice = layout.call("rotate", P, layout.call("rotate", Q, V))
    same(layout.call("rotate", product, V), twice)


@layouts("rotate")
def test_rotation_is_the_matrix_product_and_keeps_length_and_handedness(layout):
    turned = layout.call("rotate", Q, V)
    same(turned, scipy_rotation(Q).apply(V))
    same(np.linalg.norm(turned, axis=1), np.linalg.norm(V, axis=1))
    same(
        np.cross(turned, layout.call("rotate", Q, U)),
        layout.call("rotate", Q, np.cross(V, U)),
        2e-14,
    )


@layouts("rotate", "rotate_inverse")
def test_the_inverse_rotation_turns_back(layout):
    same(layout.call("rotate_inverse", Q, layout.call("rotate", Q, V)), V)
    same(layout.call("rotate_inverse", Q, V), scipy_rotation(Q).inv().apply(V))


@layouts("conjugate", "multiply")
def test_the_conjugate_is_the_inverse(layout):
    one = np.tile(rotation.IDENTITY, (N, 1))
    same(layout.call("multiply", Q, layout.call("conjugate", Q)), one)


@layouts("normalise")
@pytest.mark.parametrize("factor", [1e-100, 1.0 - 1e-12, 1.0, 3.0, 1e100])
def test_normalised_quaternions_keep_their_direction(layout, factor):
    same(layout.call("normalise", factor * Q), Q, 1e-15)


@layouts("exp")
def test_exp_is_the_rotation_by_the_vector_at_every_size(layout):
    q = layout.call("exp", TURNS)
    same(np.linalg.norm(q, axis=1), 1.0, 1e-15)
    same(matrices(q), Rotation.from_rotvec(TURNS).as_matrix())
    # The vector part of a small turn is half the vector, to all digits.
    small = np.linalg.norm(TURNS, axis=1) < 1e-7
    np.testing.assert_allclose(q[small, 1:], 0.5 * TURNS[small], rtol=1e-14, atol=0)


@layouts("exp", "multiply")
def test_turns_about_one_axis_add_up(layout):
    parts = layout.call("multiply", layout.call("exp", 0.3 * V), layout.call("exp", 0.7 * V))
    same(parts, layout.call("exp", V))


@layouts("cross")
def test_cross_is_the_vector_product(layout):
    same(layout.call("cross", U, V), np.cross(U, V), 1e-15)


@layouts("from_euler", "to_euler")
def test_euler_angles_are_yaw_pitch_roll_and_come_back(layout):
    q = layout.call("from_euler", ANGLES)
    same(matrices(q), Rotation.from_euler("ZYX", ANGLES[:, ::-1]).as_matrix())
    # Near a pitch of 90 degrees roll and yaw lose digits as 1 / cos(1.5) = 14.
    same(layout.call("to_euler", q), ANGLES, 1e-13)


def test_rates_of_euler_angles_are_the_same_in_both_layouts():
    matrix = rotation.body_rates_to_euler_rates(ANGLES)
    # tan and 1 / cos reach 14 at a pitch of 1.5 rad.
    same(OneByOne.call("euler_rates", ANGLES, V), np.einsum("nij,nj->ni", matrix, V), 1e-13)


def test_a_matrix_is_applied_alike():
    for matrix in (np.eye(3), RNG.normal(size=(3, 3)), np.diag([1.0, 0.0, 2.0])):
        same(components.transform(matrix, V.T).T, V @ matrix.T, 1e-14)
        flat = tuple(matrix.ravel().tolist())
        one = np.array([scalars.transform(flat, tuple(v)) for v in V.tolist()])
        same(one, V @ matrix.T, 1e-14)


def test_components_have_the_same_bits_in_blocks_of_any_size():
    q, v = np.ascontiguousarray(Q.T), np.ascontiguousarray(V.T)
    for name, operands in (
        ("multiply", (q, np.ascontiguousarray(P.T))),
        ("rotate", (q, v)),
        ("rotate_inverse", (q, v)),
        ("cross", (np.ascontiguousarray(U.T), v)),
    ):
        function = getattr(components, name)
        whole = function(*operands)
        parts = [function(*(o[:, k : k + 7].copy() for o in operands)) for k in range(0, N, 7)]
        np.testing.assert_array_equal(whole, np.concatenate(parts, axis=1))


def test_one_rotation_is_applied_to_many():
    many = rotation.multiply(P[0], Q)
    same(many, rotation.multiply(np.tile(P[0], (N, 1)), Q), 0.0)
    same(components.multiply(P[0], np.ascontiguousarray(Q.T)).T, many, 0.0)
    same(rotation.rotate(P[0], V), rotation.rotate(np.tile(P[0], (N, 1)), V), 0.0)
