# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

import numpy as np
import pytest

from examples.vio_residuals import (
    FactorPoses,
    States,
    imu_residual,
    perturbed,
    reprojection_residual,
)
from imu_sim_ros.core import rotation
from imu_sim_ros.navigation.preintegration import between, preintegrate

GRAVITY = (0.0, 0.0, -9.81)
SECOND = 1_000_000_000


@pytest.fixture(scope="module")
def pair(record):
    """Return five preintegrated intervals and their states, whose biases are others."""
    motion = record("excitation", 200.0, 2.0)
    edges = motion.t_ns[[0, 60, 140, 250, 330, 400]]
    pre = preintegrate(between(motion.t_ns, motion.gyro, motion.accel, edges), None, 1e-3, 1e-2)
    rows = np.array([0, 60, 140, 250, 330, 400])
    rng = np.random.default_rng(8)

    def states(chosen):
        n = len(chosen)
        return States(
            motion.truth.position[chosen] + 0.01 * rng.normal(size=(n, 3)),
            rotation.multiply(
                motion.truth.q_wb[chosen], rotation.exp(0.01 * rng.normal(size=(n, 3)))
            ),
            motion.truth.velocity[chosen] + 0.01 * rng.normal(size=(n, 3)),
            0.01 + 0.01 * rng.normal(size=(n, 3)),
            0.001 + 0.001 * rng.normal(size=(n, 3)),
        )

    return pre, states(rows[:-1]), states(rows[1:])


def assert_same_blocks(analytic, numeric, rows, columns):
    """Assert equal Jacobians, block by block to 1e-6 of the block's largest entry."""
    for r in range(0, analytic.shape[1], rows):
        for c in range(0, analytic.shape[2], columns):
            block = analytic[:, r : r + rows, c : c + columns]
            expected = numeric[:, r : r + rows, c : c + columns]
            assert np.abs(block - expected).max() <= 1e-6 * np.abs(expected).max() + 1e-10, (r, c)


@pytest.mark.parametrize("side", ["by_first", "by_second"])
def test_imu_jacobians_are_the_derivatives(pair, side):
    pre, earlier, second = pair
    step = 1e-5
    numeric = np.zeros((5, 15, 15))
    for column in range(15):
        ends = []
        for size in (step, -step):
            i = perturbed(earlier, column, size) if side == "by_first" else earlier
            j = perturbed(second, column, size) if side == "by_second" else second
            ends.append(imu_residual(pre, i, j, GRAVITY).residual)
        numeric[:, :, column] = (ends[0] - ends[1]) / (2 * step)
    analytic = getattr(imu_residual(pre, earlier, second, GRAVITY), side)
    assert_same_blocks(analytic, numeric, 3, 3)


def test_true_states_have_no_residual(record):
    motion = record("lecture", 1000.0, 1.0)
    edges = motion.t_ns[[0, 500, 1000]]
    pre = preintegrate(between(motion.t_ns, motion.gyro, motion.accel, edges))
    rows = np.array([0, 500, 1000])
    zero = np.zeros((3, 3))
    truth = motion.truth
    states = States(truth.position[rows], truth.q_wb[rows], truth.velocity[rows], zero, zero)
    first_state, second = (
        States(*(v[part] for v in states)) for part in (slice(0, 2), slice(1, 3))
    )
    assert np.abs(imu_residual(pre, first_state, second, GRAVITY).residual).max() < 5e-6
    flipped = second._replace(q_wb=-second.q_wb)
    assert np.abs(imu_residual(pre, first_state, flipped, GRAVITY).residual).max() < 5e-6


@pytest.fixture(scope="module")
def sightings():
    rng = np.random.default_rng(9)
    n = 7

    def poses(spread):
        return FactorPoses(
            spread * rng.normal(size=(n, 3)), rotation.exp(spread * rng.normal(size=(n, 3)))
        )

    # The lecture's camera: its z axis is the body's x, T_bc of the peer's data set.
    r_bc = np.array([[0.0, 0, -1], [-1, 0, 0], [0, 1, 0]])
    camera = FactorPoses(
        np.tile([0.05, 0.04, 0.03], (n, 1)), np.tile(rotation.from_matrix(r_bc), (n, 1))
    )
    depth = rng.uniform(2.0, 8.0, n)
    sightings_px = rng.uniform(-0.4, 0.4, (2, n, 2))
    return poses(0.1), poses(0.1), camera, 1.0 / depth, sightings_px[0], sightings_px[1]


def test_reprojection_jacobians_are_the_derivatives(sightings):
    step = 1e-6
    residuals = reprojection_residual(*sightings)
    for place, name in enumerate(("by_first", "by_second", "by_camera")):
        numeric = np.zeros((7, 2, 6))
        for column in range(6):
            ends = []
            for size in (step, -step):
                d = np.zeros(6)
                d[column] = size
                poses = sightings[place]
                arguments = list(sightings)
                arguments[place] = FactorPoses(
                    poses.position + d[:3], rotation.multiply(poses.q, rotation.exp(d[3:]))
                )
                ends.append(reprojection_residual(*arguments).residual)
            numeric[:, :, column] = (ends[0] - ends[1]) / (2 * step)
        assert_same_blocks(getattr(residuals, name), numeric, 2, 3)
    ends = []
    for size in (step, -step):
        arguments = list(sightings)
        arguments[3] = sightings[3] + size
        ends.append(reprojection_residual(*arguments).residual)
    numeric = (ends[0] - ends[1]) / (2 * step)
    np.testing.assert_allclose(residuals.by_inverse_depth, numeric, rtol=1e-6, atol=1e-8)


def test_a_landmark_seen_from_two_poses_has_no_residual(sightings):
    first_state, second, camera, inverse_depth, seen_first, _ = sightings
    ray = np.concatenate([seen_first, np.ones((7, 1))], axis=1)
    to_world = rotation.to_matrix(first_state.q) @ rotation.to_matrix(camera.q)
    in_body = rotation.rotate(first_state.q, camera.position) + first_state.position
    landmark = (to_world @ (ray / inverse_depth[:, None])[..., None])[..., 0] + in_body
    in_second = rotation.rotate_inverse(second.q, landmark - second.position)
    x, y, z = rotation.rotate_inverse(camera.q, in_second - camera.position).T
    seen_second = np.stack([x / z, y / z], axis=1)
    residuals = reprojection_residual(
        first_state, second, camera, inverse_depth, seen_first, seen_second
    )
    assert np.abs(residuals.residual).max() < 1e-13
    np.testing.assert_allclose(residuals.depth, z)
