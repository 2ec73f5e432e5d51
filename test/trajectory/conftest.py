# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Derivatives by finite differences, for all tests of trajectories."""

from collections.abc import Callable

import numpy as np
import pytest
from numpy.typing import NDArray

from imu_sim_ros.core import rotation
from imu_sim_ros.simulation.parameters import load_simulation
from imu_sim_ros.trajectory.build import build_trajectory
from imu_sim_ros.trajectory.motion import Motion, Trajectory

Array = NDArray[np.float64]
# Central difference of order 6: f' = sum w_k (f(t + k h) - f(t - k h)) / h.
STENCIL = ((1, 45 / 60), (2, -9 / 60), (3, 1 / 60))


def assert_exact_derivatives(
    trajectory: Trajectory, t: Array, h: float = 1e-4, tolerance: float = 1e-8
) -> Motion:
    """Compare every derivative of a motion with the finite difference of what it derives."""
    m = trajectory.sample(t)
    neighbours = [
        (w, trajectory.sample(t + k * h), trajectory.sample(t - k * h)) for k, w in STENCIL
    ]

    def derivative(f: Callable[[Motion], Array]) -> Array:
        return (
            sum((w * (f(later) - f(earlier)) for w, later, earlier in neighbours), np.zeros(3)) / h
        )

    def turned(motion: Motion) -> Array:
        """Return the rotation vector from the attitude at t; its slope at t is omega_b."""
        return rotation.log(rotation.multiply(rotation.conjugate(m.q_wb), motion.q_wb))

    def close(actual: Array, expected: Array) -> None:
        scale = max(1.0, float(np.max(np.abs(expected))))
        np.testing.assert_allclose(actual, expected, rtol=0, atol=tolerance * scale)

    close(m.velocity, derivative(lambda motion: motion.position))
    close(m.acceleration, derivative(lambda motion: motion.velocity))
    close(m.angular_velocity, derivative(turned))
    close(m.angular_acceleration, derivative(lambda motion: motion.angular_velocity))
    np.testing.assert_allclose(np.linalg.norm(m.q_wb, axis=-1), 1.0, rtol=0, atol=1e-14)
    return m


def build(**values: object) -> Trajectory:
    """Build a trajectory from parameters without the prefix; ``__`` stands for a dot."""
    layer = {f"trajectory.{name.replace('__', '.')}": v for name, v in values.items()}
    return build_trajectory(load_simulation(layer).trajectory)


@pytest.fixture(name="build")
def build_fixture() -> Callable[..., Trajectory]:
    return build


@pytest.fixture(name="assert_exact_derivatives")
def derivatives_fixture() -> Callable[..., Motion]:
    return assert_exact_derivatives
