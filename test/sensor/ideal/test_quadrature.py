# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Means of rate and specific force over a sample against a much finer quadrature."""

from typing import NamedTuple

import numpy as np
import pytest

from imu_sim_ros.core import rotation
from imu_sim_ros.sensors.imu.ideal import IdealImu, Quadrature, lobatto, quadrature
from imu_sim_ros.simulation.engine import Body
from imu_sim_ros.simulation.parameters import load_simulation
from imu_sim_ros.trajectory.bspline import PoseSpline, UniformKnots
from imu_sim_ros.trajectory.given import CheckedMotion
from imu_sim_ros.trajectory.motion import Trajectory

Array = np.ndarray
BOARD = {"imu.lever_arm": [0.1, 0.2, -0.3], "earth_rotation": True, "latitude_deg": 48.0}


class Case(NamedTuple):
    trajectory: Trajectory
    imu: IdealImu
    t: Array
    """(n + 1,) ends of the intervals."""

    def finely(self, rule: Quadrature) -> Array:
        """Return means of rate and force (n, 6) by a rule without shared nodes."""
        total = np.zeros((len(self.t) - 1, 6))
        length = np.diff(self.t)
        for node, weight in zip(*rule, strict=True):
            motion = self.trajectory.sample(self.t[:-1] + node * length)
            total += weight * np.hstack(self.imu.read(motion))
        return total

    def exact(self) -> Array:
        """Integrate with eight Gauss nodes in each quarter of an interval."""
        nodes, weights = gauss(8)
        quarters = np.add.outer(np.arange(4.0), nodes) / 4.0
        return self.finely((quarters.ravel(), np.tile(weights / 4.0, 4)))

    def error(self, rule: Quadrature) -> Array:
        """Return the largest errors of rate and force (2,)."""
        motion = self.trajectory.sample(self.t)
        means = self.imu.read_mean(self.trajectory, self.t, motion, rule)
        return largest(np.hstack(means) - self.exact())


def largest(difference: Array) -> Array:
    """Return the largest sizes (2,) among those of rate and of force (n, 6)."""
    return np.abs(difference).reshape(-1, 2, 3).max(axis=(0, 2))


def gauss(count: int) -> Quadrature:
    nodes, weights = np.polynomial.legendre.leggauss(count)
    return 0.5 + 0.5 * nodes, 0.5 * weights


def case(name: str, rate: float, board: dict[str, object] | None = None) -> Case:
    values = {"trajectory.type": name, "imu.preset": "perfect", "rate": rate, **(board or {})}
    parameters = load_simulation(values)
    return Case(
        Body(parameters).trajectory,
        IdealImu(parameters.imu, parameters),
        np.arange(2001) / rate + 1.0,
    )


def spline(rate: float) -> Case:
    """Return one as of a recording, knots every 50 ms: only C4 where they lie in an interval."""
    random = np.random.default_rng(3)
    knots = UniformKnots(10.0, 0.05)
    walk = np.cumsum(random.normal(size=(2, knots.control_points, 3)), axis=1)
    control = PoseSpline(knots, 0.02 * walk[0], rotation.exp(0.03 * walk[1]))
    parameters = load_simulation({"imu.preset": "perfect"})
    trajectory = CheckedMotion(control.sample, control.duration, 0.0)
    return Case(trajectory, IdealImu(parameters.imu, parameters), np.arange(801) / rate + 1.0)


@pytest.mark.parametrize("count", [4, 5, 9, 50, 188])
def test_powers_of_time_are_averaged_exactly(count: int) -> None:
    """Up to 2 count - 3; the next even power is not."""
    nodes, weights = lobatto(count)
    assert (nodes[0], nodes[-1]) == (0.0, 1.0)
    assert (np.diff(nodes) > 0.0).all()
    highest = 2 * count - 3
    for power in {0, 1, 2, highest - 1, highest}:
        # Of Legendre polynomials, which do not vanish as high powers do.
        legendre = np.polynomial.legendre.Legendre.basis(power)(2.0 * nodes - 1.0)
        assert weights @ legendre == pytest.approx(float(power == 0), abs=1e-13)
    beyond = np.polynomial.legendre.Legendre.basis(highest + 1)(2.0 * nodes - 1.0)
    assert abs(weights @ beyond) > 1e-3


def test_as_many_nodes_as_a_motion_needs() -> None:
    """Between the ends; two where they leave no error, never fewer than three elsewhere."""
    frequencies = (0.0, 0.5, 1.6, 1.8, 15.0, 28.0, 100.0, 390.0)
    assert [len(quadrature(f, 0.005)[0]) - 2 for f in frequencies] == [3, 2, 2, 3, 3, 3, 6, 13]


@pytest.mark.parametrize(("count", "order"), [(4, 6.0), (5, 8.0)])
def test_the_error_falls_with_the_order_of_the_rule(count: int, order: float) -> None:
    errors = [case("coning", rate, BOARD).error(lobatto(count)) for rate in (60.0, 120.0)]
    orders = np.log2(errors[0] / errors[1])
    # Which phases of the motion an interval begins at differs with the rate.
    assert (np.abs(orders - order) < 0.7).all(), errors


@pytest.mark.parametrize("name", ["lecture", "circle", "figure_eight", "excitation"])
@pytest.mark.parametrize("board", [{}, BOARD], ids=["", "board"])
def test_slow_motions_are_averaged_to_rounding(name: str, board: dict[str, object]) -> None:
    """Rates are some rad/s and forces 10 to 20 m/s^2; the rounding of w t is in both."""
    motion_case = case(name, 200.0, board)
    rule = quadrature(motion_case.trajectory.highest_frequency, 0.005)
    assert len(rule[0]) == 4
    rate, force = motion_case.error(rule)
    assert rate < 1e-13
    assert force < 5e-13


@pytest.mark.parametrize(
    ("build", "rate"),
    [("coning", 200.0), ("sculling", 100.0), ("spline", 100.0), ("spline", 200.0)],
)
def test_no_mean_is_worse_than_that_of_three_gauss_nodes(build: str, rate: float) -> None:
    """Three Gauss nodes cost as much, as the ends of the interval are sampled in any case."""
    motion_case = spline(rate) if build == "spline" else case(build, rate, BOARD)
    rule = quadrature(motion_case.trajectory.highest_frequency, 1.0 / rate)
    assert len(rule[0]) == 5
    gauss_error = largest(motion_case.finely(gauss(3)) - motion_case.exact())
    assert (motion_case.error(rule) < 0.5 * gauss_error).all()


def test_averaged_readings_are_these_means() -> None:
    """Readings are means over the intervals before them, the first is the value at the start."""
    values = {"trajectory.type": "lecture", "imu.preset": "perfect", "rate": 200.0}
    block = Body(load_simulation({**values, "imu.sampling": "averaged"})).next(400)["imu"]
    at_once = Body(load_simulation(values)).next(400)["imu"]
    motion_case = case("lecture", 200.0)._replace(t=np.arange(400) * 0.005)
    expected = motion_case.exact()
    np.testing.assert_allclose(block.gyro[1:], expected[:, :3], atol=1e-13)
    np.testing.assert_allclose(block.accel[1:], expected[:, 3:], atol=5e-13)
    np.testing.assert_allclose(block.gyro[0], at_once.gyro[0], rtol=1e-15)
    np.testing.assert_allclose(block.accel[0], at_once.accel[0], rtol=1e-15)
