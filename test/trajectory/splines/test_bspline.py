# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

import numpy as np
import pytest
from numpy.polynomial import Polynomial
from scipy.interpolate import BSpline

from imu_sim_ros.core import rotation
from imu_sim_ros.trajectory.bspline import BASIS, CUMULATIVE, ORDER, PoseSpline, UniformKnots

RNG = np.random.default_rng(2)


def random_spline(duration=3.0, spacing=0.1, turn=0.3):
    random = np.random.default_rng(2)  # of its own: the same spline whichever tests are run
    knots = UniformKnots(duration, spacing)
    c = knots.control_points
    steps = rotation.exp(turn * random.standard_normal((c, 3)))
    points = random.standard_normal((c, 3))
    return knots, PoseSpline(knots, points, rotation.cumulative_product(steps))


def test_basis_is_a_partition_of_unity():
    np.testing.assert_allclose(BASIS.sum(axis=0), [1, 0, 0, 0, 0, 0], atol=1e-15)
    np.testing.assert_allclose(CUMULATIVE[0], [1, 0, 0, 0, 0, 0], atol=1e-15)


def test_position_equals_scipy_s_spline():
    knots = UniformKnots(2.0, 0.1)
    points = RNG.standard_normal((knots.control_points, 3))
    still = np.tile(rotation.IDENTITY, (knots.control_points, 1))
    h = knots.spacing
    oracle = BSpline((np.arange(knots.control_points + ORDER) - 5) * h, points, 5)
    t = RNG.uniform(0.0, 2.0, 500)
    m = PoseSpline(knots, points, still).sample(t)
    for order, actual in enumerate(m[:3]):
        expected = oracle.derivative(order)(t) if order else oracle(t)
        np.testing.assert_allclose(actual, expected, rtol=0, atol=1e-11 / h**order)
    np.testing.assert_array_equal(m.q_wb, [rotation.IDENTITY] * 500)
    np.testing.assert_array_equal(m.angular_velocity, 0.0)


def test_derivatives_are_exact(assert_exact_derivatives):
    _, spline = random_spline()
    assert_exact_derivatives(spline, RNG.uniform(0.01, 2.99, 2000))


def test_evenly_turned_control_points_give_a_constant_rate():
    knots = UniformKnots(2.0, 0.1)
    axis = np.array([1.0, -2.0, 0.5]) / np.sqrt(5.25)
    angles = 0.2 * np.arange(knots.control_points)
    spline = PoseSpline(
        knots, np.zeros((knots.control_points, 3)), rotation.exp(angles[:, None] * axis)
    )
    t = np.linspace(0.0, 2.0, 101)
    m = spline.sample(t)
    np.testing.assert_allclose(m.angular_velocity, [2.0 * axis] * 101, rtol=0, atol=1e-13)
    np.testing.assert_allclose(m.angular_acceleration, 0.0, atol=1e-11)


@pytest.mark.parametrize("order", [0, 1, 2, 3, 4])
def test_all_derivatives_up_to_the_fourth_are_continuous(order):
    """On each side of a knot a polynomial through 9 near samples gives the one-sided derivative.

    omega_b (first derivative of the attitude) and alpha_b (second) are sampled directly; their own
    derivatives, up to the third of omega_b, stand for the third and fourth of the attitude.
    """
    knots, spline = random_spline()
    h = knots.spacing
    x = np.linspace(0.0, 1.0, 9)
    for k in (5, 12, 20):
        sides = []
        for sign in (-1.0, 1.0):
            width = 0.2 * h
            m = spline.sample(k * h + sign * (1e-9 + width * x))
            rows = []
            for values, derivative in ((m.position, 0), (m.angular_velocity, 1)):
                if order < derivative:
                    continue
                n = order - derivative
                fits = [Polynomial.fit(x, column, 8).convert() for column in values.T]
                rows += [fit.deriv(n)(0.0) / (sign * width) ** n for fit in fits]
            sides.append(np.array(rows))
        scale = np.max(np.abs(np.concatenate(sides)))
        # The fifth derivative jumps; 1e-9 s from the knot and the fits' rounding do not show.
        np.testing.assert_allclose(sides[0], sides[1], rtol=0, atol=2e-4 * scale)


def test_the_fifth_derivative_jumps():
    """The test of continuity above would notice a jump."""
    knots, spline = random_spline()
    h = knots.spacing
    x = np.linspace(0.0, 1.0, 9)
    slope_left, slope_right = (
        Polynomial.fit(x, spline.sample(12 * h + s * (1e-9 + 0.2 * h * x)).position[:, 0], 8)
        .convert()
        .deriv(5)(0.0)
        / s
        for s in (-1.0, 1.0)
    )
    assert abs(slope_left - slope_right) > 0.1 * max(abs(slope_left), abs(slope_right))


def test_knots_reach_exactly_to_the_end():
    knots = UniformKnots(1.0, 0.3)
    assert knots.segments == 3
    segment, u = knots.locate(np.array([0.0, 1.0]))
    assert segment.tolist() == [0, 2]
    np.testing.assert_allclose(u, [0.0, 1.0], rtol=0, atol=1e-15)
