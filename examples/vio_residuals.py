# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""The residuals of visual-inertial estimation, with their analytic Jacobians, in batches.

python examples/vio_residuals.py

Qin, Li and Shen, "VINS-Mono", T-RO 2018, eq. 24 and 25; the derivatives here are exact for these
residuals. A pose is perturbed by ``p + dp`` and ``q Exp(dtheta)``, all else by addition.
As a program, it prints the residual between true states, and how far derivatives are from
differences.
"""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

import imu_sim_ros as ims
from imu_sim_ros.core import rotation
from imu_sim_ros.core.types import Array
from imu_sim_ros.navigation.preintegration import (
    ACCEL_BIAS,
    ALPHA,
    BETA,
    GYRO_BIAS,
    SIZE,
    THETA,
    Preintegration,
    corrected,
)

_EYE = np.eye(3)


class States(NamedTuple):
    """B states; their perturbation has 15 numbers in this order: p, theta, v, b_a, b_g."""

    position: Array
    """(B, 3) p_wb [m]."""
    q_wb: Array
    """(B, 4)."""
    velocity: Array
    """(B, 3) in the world [m/s]."""
    accel_bias: Array
    """(B, 3) [m/s^2]."""
    gyro_bias: Array
    """(B, 3) [rad/s]."""


class ImuResidual(NamedTuple):
    """The residual of B pairs of states, and its derivatives."""

    residual: Array
    """(B, 15) alpha, theta, beta, b_a, b_g: prediction from the states less the readings."""
    by_first: Array
    """(B, 15, 15) with respect to the first state."""
    by_second: Array
    """(B, 15, 15) with respect to the second state."""


def imu_residual(
    pre: Preintegration, first: States, second: States, gravity: Sequence[float]
) -> ImuResidual:
    """Return the residual of preintegrated readings between two states (VINS eq. 24).

        R_i^T (p_j - p_i - v_i T - g T^2 / 2) - alpha
        2 vec(gamma^-1 q_i^-1 q_j)
        R_i^T (v_j - v_i - g T) - beta
        b_a,j - b_a,i,   b_g,j - b_g,i

    with alpha, beta, gamma corrected to the biases of state i. Its covariance is that of ``pre``.

    :param gravity: (3,) in the world [m/s^2].
    """
    t = pre.duration[:, None]
    g = np.asarray(gravity, dtype=float)
    deltas = corrected(pre, first.gyro_bias, first.accel_bias)
    moved = second.position - first.position - first.velocity * t - 0.5 * g * t * t
    moved = rotation.rotate_inverse(first.q_wb, moved)
    gained = rotation.rotate_inverse(first.q_wb, second.velocity - first.velocity - g * t)
    between = rotation.multiply(rotation.conjugate(first.q_wb), second.q_wb)
    back = rotation.conjugate(deltas.gamma)
    turn = rotation.multiply(back, between)
    # -q is the same rotation, and its vector part would be a residual of the other sign.
    sign = np.where(turn[:, :1] < 0.0, -1.0, 1.0)
    turn, between = turn * sign, between * sign
    residual = np.concatenate(
        [
            moved - deltas.alpha,
            2.0 * turn[:, 1:],
            gained - deltas.beta,
            second.accel_bias - first.accel_bias,
            second.gyro_bias - first.gyro_bias,
        ],
        axis=1,
    )
    by_first = _by_first(pre, first, moved, gained, back, between, turn)
    by_second = np.tile(np.eye(SIZE), (len(residual), 1, 1))
    to_body = rotation.to_matrix(first.q_wb).swapaxes(1, 2)
    by_second[:, ALPHA, ALPHA] = by_second[:, BETA, BETA] = to_body
    by_second[:, THETA, THETA] = _left_product(turn)
    return ImuResidual(residual, by_first, by_second)


def _by_first(
    pre: Preintegration,
    first: States,
    moved: Array,
    gained: Array,
    back: Array,
    between: Array,
    turn: Array,
) -> Array:
    to_body = rotation.to_matrix(first.q_wb).swapaxes(1, 2)
    jacobian = np.zeros((len(moved), SIZE, SIZE))
    jacobian[:, ALPHA, ALPHA] = -to_body
    jacobian[:, ALPHA, THETA] = rotation.skew(moved)
    jacobian[:, ALPHA, BETA] = -to_body * pre.duration[:, None, None]
    jacobian[:, BETA, THETA] = rotation.skew(gained)
    jacobian[:, BETA, BETA] = -to_body
    for bias in (ACCEL_BIAS, GYRO_BIAS):
        jacobian[:, ALPHA, bias] = -pre.jacobian[:, ALPHA, bias]
        jacobian[:, BETA, bias] = -pre.jacobian[:, BETA, bias]
        jacobian[:, bias, bias] = -_EYE
    jacobian[:, THETA, THETA] = -_product_block(back, between)
    by_bias = pre.jacobian[:, THETA, GYRO_BIAS]
    shift = (by_bias @ (first.gyro_bias - pre.gyro_bias)[..., None])[..., 0]
    jacobian[:, THETA, GYRO_BIAS] = -_right_product(turn) @ rotation.right_jacobian(shift) @ by_bias
    return jacobian


def _left_product(q: Array) -> Array:
    """Vector part of ``q (0, v)`` as a matrix on v."""
    return q[:, :1, None] * _EYE + rotation.skew(q[:, 1:])


def _right_product(q: Array) -> Array:
    """Vector part of ``(0, v) q`` as a matrix on v."""
    return q[:, :1, None] * _EYE - rotation.skew(q[:, 1:])


def _product_block(p: Array, q: Array) -> Array:
    """Vector part of ``p (0, v) q`` as a matrix on v."""
    # (0, v) q = (-v . q_v, right(q) v); p takes the scalar part along its own vector part.
    return _left_product(p) @ _right_product(q) - p[:, 1:, None] * q[:, None, 1:]


class FactorPoses(NamedTuple):
    """B poses; their perturbation has 6 numbers: p, theta."""

    position: Array
    """(B, 3) [m]"""
    q: Array
    """(B, 4)"""


class ReprojectionResidual(NamedTuple):
    """The residual of B sightings of features, and its derivatives."""

    residual: Array
    """(B, 2) in the plane at distance 1; times the focal length it is in pixels."""
    by_first: Array
    """(B, 2, 6) with respect to the pose of the body at the first sighting."""
    by_second: Array
    """(B, 2, 6) with respect to the pose of the body at the second sighting."""
    by_camera: Array
    """(B, 2, 6) with respect to ``T_bc``, the camera in the body."""
    by_inverse_depth: Array
    """(B, 2)"""
    depth: Array
    """(B,) of the feature before the second camera [m]; not positive behind it."""


def reprojection_residual(
    first: FactorPoses,
    second: FactorPoses,
    camera: FactorPoses,
    inverse_depth: Array,
    seen_first: Array,
    seen_second: Array,
) -> ReprojectionResidual:
    """Return predicted minus measured places of features of one image in another.

    ``x_cj = T_bc^-1 T_wbj^-1 T_wbi T_bc x_ci``, projected to the plane at distance 1 (VINS eq. 25,
    which has the sphere in place of the plane).

    :param first: T_wb at the first sighting.
    :param second: T_wb at the second sighting.
    :param camera: T_bc, for all features or each.
    :param inverse_depth: (B,) in the first camera [1/m].
    :param seen_first: (B, 2) x / z and y / z in the first camera.
    :param seen_second: (B, 2) likewise in the second.
    """
    ray = np.concatenate([seen_first, np.ones((len(seen_first), 1))], axis=1)
    in_first = ray / inverse_depth[:, None]
    in_body = rotation.rotate(camera.q, in_first) + camera.position
    in_world = rotation.rotate(first.q, in_body) + first.position
    in_second_body = rotation.rotate_inverse(second.q, in_world - second.position)
    in_second = rotation.rotate_inverse(camera.q, in_second_body - camera.position)
    x, y, z = in_second.T
    residual = np.stack([x / z, y / z], axis=1) - seen_second

    projection = _by_point(x, y, z)
    r_bc = rotation.to_matrix(camera.q)
    r_cb = r_bc.swapaxes(-1, -2)
    from_world = r_cb @ rotation.to_matrix(second.q).swapaxes(1, 2)
    from_first_body = from_world @ rotation.to_matrix(first.q)
    from_first = from_first_body @ r_bc
    by_first = [from_world, -from_first_body @ rotation.skew(in_body)]
    by_second = [-from_world, r_cb @ rotation.skew(in_second_body)]
    by_camera = [
        from_first_body - r_cb,
        rotation.skew(in_second) - from_first @ rotation.skew(in_first),
    ]
    by_depth = -(from_first @ (ray / inverse_depth[:, None] ** 2)[..., None])
    return ReprojectionResidual(
        residual,
        projection @ np.concatenate(by_first, axis=-1),
        projection @ np.concatenate(by_second, axis=-1),
        projection @ np.concatenate(by_camera, axis=-1),
        (projection @ by_depth)[..., 0],
        z,
    )


def _by_point(x: Array, y: Array, z: Array) -> Array:
    """Return the derivatives (B, 2, 3) of x / z and y / z by the point."""
    projection = np.zeros((len(z), 2, 3))
    projection[:, 0, 0] = projection[:, 1, 1] = 1.0 / z
    projection[:, 0, 2], projection[:, 1, 2] = -x / (z * z), -y / (z * z)
    return projection


def perturbed(states: States, column: int, step: float) -> States:
    """Return the states moved in one of their 15 numbers."""
    d = np.zeros(15)
    d[column] = step
    return States(
        states.position + d[:3],
        rotation.multiply(states.q_wb, rotation.exp(d[3:6])),
        states.velocity + d[6:9],
        states.accel_bias + d[9:12],
        states.gyro_bias + d[12:],
    )


def main() -> None:
    """Preintegrate a flight without errors, and compare with its true states."""
    flight = ims.simulate(imu="perfect", trajectory="figure_eight", duration=5, rate=1000)
    truth, rows = flight.truth, np.arange(0, len(flight.truth.t_ns), 500)
    pre = ims.preintegrate(flight, truth.t_ns[rows])
    zero = np.zeros((len(rows), 3))
    states = States(truth.position[rows], truth.q_wb[rows], truth.velocity[rows], zero, zero)
    first, second = (States(*(v[part] for v in states)) for part in (slice(-1), slice(1, None)))
    evaluation = imu_residual(pre, first, second, (0.0, 0.0, -9.81))
    print(f"residual between true states: {np.abs(evaluation.residual).max():.1e}")
    step, worst = 1e-5, 0.0
    for column in range(15):
        ahead, behind = (
            imu_residual(pre, perturbed(first, column, size), second, (0.0, 0.0, -9.81)).residual
            for size in (step, -step)
        )
        numeric = (ahead - behind) / (2.0 * step)
        worst = max(worst, np.abs(evaluation.by_first[:, :, column] - numeric).max())
    print(f"derivatives less differences: {worst:.1e}")


if __name__ == "__main__":
    main()
