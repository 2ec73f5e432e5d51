# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""The NEES of an estimate whose yaw and position are free."""

import numpy as np
import pytest

from imu_sim_ros.core import rotation
from imu_sim_ros.core.records import States
from imu_sim_ros.navigation.evaluation import (
    absolute_errors,
    anees_band,
    fix_gauge,
    gauge_at,
    nees,
)

COUNT, RUNS = 20, 300


def path(rng):
    """Return a true path of 20 poses."""
    t = np.linspace(0.0, 6.0, COUNT)
    position = np.stack([4.0 * np.cos(t), 3.0 * np.sin(t), 0.5 * np.sin(3.0 * t)], axis=1)
    q_wb = rotation.from_euler(np.stack([0.2 * np.sin(t), 0.1 * np.cos(t), t], axis=1))
    return States((t * 1e9).astype(np.int64), position, q_wb)


def odometry(truth, rng, prior):
    """Return an estimate with drift, moved by a gauge of its prior, and its covariances (n, 6, 6).

    Position and attitude walk, a turn carrying all that follows: J of relative errors of 2 mm and
    1 mrad, tilts of 2 mrad at the start. The gauge is drawn with the prior's deviations (4,), and
    any yaw and translation is added, which the covariance does not know.
    """
    n = len(truth.t_ns)
    start = np.array([*prior[:3], 2e-3, 2e-3, prior[3]])
    steps = np.vstack([start, np.tile([2e-3] * 3 + [1e-3] * 3, (n - 1, 1))])
    error, covariance = np.empty((n, 6)), np.empty((n, 6, 6))
    drawn = steps * rng.standard_normal((n, 6))
    e, p = drawn[0], np.diag(steps[0] ** 2)
    error[0], covariance[0] = e, p
    for k in range(1, n):
        f = np.eye(6)
        f[:3, 3:] = -rotation.skew(truth.position[k] - truth.position[k - 1])
        e, p = f @ e + drawn[k], f @ p @ f.T + np.diag(steps[k] ** 2)
        error[k], covariance[k] = e, p
    position = truth.position - error[:, :3]
    q_wb = rotation.multiply(rotation.exp(-error[:, 3:]), truth.q_wb)
    yaw = rotation.exp(np.array([0.0, 0.0, rng.uniform(-3.0, 3.0)]))
    turn = np.kron(np.eye(2), rotation.to_matrix(yaw))
    moved = States(
        truth.t_ns,
        rotation.rotate(yaw, position) + rng.uniform(-9.0, 9.0, 3),
        rotation.multiply(yaw, q_wb),
    )
    return moved, turn @ covariance @ turn.T


@pytest.mark.parametrize("prior", [(0.0,) * 4, (0.05, 0.05, 0.05, 0.01)], ids=["exact", "loose"])
def test_an_odometry_of_any_gauge_is_consistent(prior):
    """Mean NEES of the last pose's 6 numbers, of position, of attitude: 300 runs, 99.9 % bands.

    The same is found whether the estimator's prior of the gauge is exact or loose.
    """
    rng = np.random.default_rng(3)
    truth = path(rng)
    errors, covariances = np.empty((RUNS, 6)), np.empty((RUNS, 6, 6))
    for run in range(RUNS):
        estimate, stated = odometry(truth, rng, prior)
        gauge = gauge_at(estimate, truth)
        aligned = gauge.apply(estimate)
        position, attitude = absolute_errors(aligned, truth)
        errors[run] = np.concatenate([position[-1], attitude[-1]])
        turn = np.kron(np.eye(2), gauge.r)
        covariances[run] = fix_gauge(turn @ stated @ turn.T, aligned.position)[-1]
    for rows in (slice(0, 6), slice(0, 3), slice(3, 6)):
        part = errors[:, rows]
        low, high = anees_band(part.shape[1], RUNS, 0.999)
        assert low < nees(part, covariances[:, rows, rows]).mean() < high
    sigma = np.sqrt(np.diagonal(covariances.mean(axis=0)))
    assert errors.std(axis=0) / sigma == pytest.approx(1.0, abs=4.0 / np.sqrt(2.0 * RUNS))


def test_the_covariance_is_that_of_gtsams_joint_marginals():
    """A chain of poses with a loose prior of position and yaw: Q Sigma Q^T of the joint one."""
    gtsam = pytest.importorskip("gtsam")
    truth = path(np.random.default_rng(1))
    poses = [
        gtsam.Pose3(gtsam.Rot3(rotation.to_matrix(q)), p)
        for q, p in zip(truth.q_wb, truth.position, strict=True)
    ]
    graph, values = gtsam.NonlinearFactorGraph(), gtsam.Values()
    world = np.diag([2e-3, 2e-3, 0.02, 0.05, 0.05, 0.05]) ** 2  # attitude, position, world's axes
    to_body = np.kron(np.eye(2), poses[0].rotation().matrix().T)
    prior = gtsam.noiseModel.Gaussian.Covariance(to_body @ world @ to_body.T)
    graph.add(gtsam.PriorFactorPose3(0, poses[0], prior))
    step = gtsam.noiseModel.Diagonal.Sigmas(np.array([1e-3] * 3 + [2e-3] * 3))
    for k in range(1, COUNT):
        between = poses[k - 1].between(poses[k])
        graph.add(gtsam.BetweenFactorPose3(k - 1, k, between, step))
    for k, pose in enumerate(poses):
        values.insert(k, pose)
    marginals = gtsam.Marginals(graph, values)
    order = np.r_[3:6, 0:3]

    def in_world(k):
        turn = np.kron(np.eye(2), poses[k].rotation().matrix())
        return turn[order]  # attitude, position in the body -> position, attitude in the world

    stated = np.stack([in_world(k) @ marginals.marginalCovariance(k) @ in_world(k).T
                       for k in range(COUNT)])  # fmt: skip
    covariance = fix_gauge(stated, truth.position)
    keys = gtsam.KeyVector([0, COUNT - 1])
    joint = marginals.jointMarginalCovariance(keys)
    last_pose = COUNT - 1
    cross = in_world(0) @ joint.at(0, last_pose) @ in_world(last_pose).T
    n = np.zeros((6, 4))
    n[:3, :3], n[5, 3] = np.eye(3), 1.0
    x, y, _ = truth.position[last_pose] - truth.position[0]
    n[0, 3], n[1, 3] = -y, x
    fixed = n @ np.eye(6)[[0, 1, 2, 5]]
    expected = stated[last_pose] + fixed @ stated[0] @ fixed.T - fixed @ cross - (fixed @ cross).T
    sigma = np.sqrt(np.diag(expected))
    assert np.abs((covariance[last_pose] - expected) / np.outer(sigma, sigma)).max() < 1e-6
    assert np.diag(stated[last_pose])[5] > 5.0 * np.diag(expected)[5]
