# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Poses at many times against the trajectory itself."""

import numpy as np
import pytest

from imu_sim_ros.core import rotation
from imu_sim_ros.parameters import files
from imu_sim_ros.simulation.parameters import load_simulation
from imu_sim_ros.trajectory.build import build_trajectory
from imu_sim_ros.trajectory.dense import dense_poses
from imu_sim_ros.trajectory.motion import Motion


@pytest.mark.parametrize("name", ["figure_eight", "tumble", "tour", "coning", "sculling", "drive"])
def test_they_are_those_of_the_trajectory(name):
    """Hermite's error is below h^4 / 384 of the fourth derivative; coning at 20 Hz has the most."""
    trajectory = build_trajectory(
        load_simulation(files.load(files.find("trajectories", name))).trajectory
    )
    t = np.sort(np.random.default_rng(1).uniform(1.0, 1.1, 5000))
    position, q_wb = dense_poses(trajectory.sample, 1.0, 1.1, t)
    motion = trajectory.sample(t)
    assert np.abs(position - motion.position).max() < 1e-9
    turn = rotation.log(rotation.multiply(rotation.conjugate(q_wb), motion.q_wb))
    assert np.abs(turn).max() < 2e-9


def test_the_error_is_that_of_the_formula():
    """1 g at 100 Hz along x, at the middle of a knot's interval where the wave is highest."""
    omega = 2.0 * np.pi * 100.0
    amplitude = 9.81 / omega**2

    def sample(t):
        zeros = np.zeros((len(t), 3))
        position, velocity = zeros.copy(), zeros.copy()
        position[:, 0] = amplitude * np.sin(omega * t)
        velocity[:, 0] = amplitude * omega * np.cos(omega * t)
        q = np.tile(rotation.IDENTITY, (len(t), 1))
        return Motion(position, velocity, zeros, q, zeros, zeros)

    t = np.linspace(0.0, 0.1, 20_001)
    position, q_wb = dense_poses(sample, 0.0, 0.1, t)
    error = np.abs(position[:, 0] - sample(t).position[:, 0]).max()
    bound = 1e-12 / 384.0 * amplitude * omega**4
    assert 0.9 * bound < error <= bound
    assert np.array_equal(q_wb, np.tile(rotation.IDENTITY, (len(t), 1)))


def test_they_do_not_depend_on_the_times_asked_for():
    trajectory = build_trajectory(load_simulation({"trajectory.type": "figure_eight"}).trajectory)
    t = np.linspace(2.0, 2.05, 1001)
    whole = dense_poses(trajectory.sample, 2.0, 2.05, t)
    part = dense_poses(trajectory.sample, 2.0, 2.05, t[::7])
    for column, expected in zip(whole, part, strict=True):
        assert np.array_equal(column[::7], expected)
