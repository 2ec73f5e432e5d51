# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Unit quaternions, vectors and SO(3) over leading axes, time first: (n, 4), (n, 3), (n, ..., 3).

Quaternions are Hamilton, ``(w, x, y, z)`` on the last axis; ``q_wb`` maps body to world. Equation
numbers are those of the lecture "IMU sensors" (He, Gao, Cui, 2019); "Sola" is J. Sola, "Quaternion
kinematics for the error-state Kalman filter", arXiv:1711.02508. Formulas that a live reading passes
through are those of :mod:`imu_sim_ros.core.components`; here they take and return whole arrays.

Results lie in memory one component after the other (order F), so that every operand of the
arithmetic is contiguous; arrays in any other order are taken as well. But for
:func:`cumulative_product`, only operations element by element, so that a sample has the same value,
bit for bit, in whatever block it is computed.
"""

import math
from typing import Final

import numpy as np
from numpy.typing import ArrayLike

from imu_sim_ros.core import components
from imu_sim_ros.core.blocks import ceil_divide
from imu_sim_ros.core.components import from_half_angles, quaternion, stack, vector
from imu_sim_ros.core.types import Array

IDENTITY: Final[Array] = np.array([1.0, 0.0, 0.0, 0.0])
_SMALL_ANGLE: Final = 1e-4
"""Angle below which a series is used [rad]."""
_ROUNDING: Final = 1e-3
"""Largest difference of a matrix of few digits from a rigid motion."""
_FACTORS = np.array([[0, 1, 2, 3], [1, 0, 3, 2], [2, 3, 0, 1], [3, 2, 1, 0]])
_SIGNS = np.array([[1, -1, -1, -1], [1, 1, 1, -1], [1, -1, 1, 1], [1, 1, -1, 1]], dtype=np.float64)
"""``(p q)_i = sum_k p_k sign_ik q_factor_ik``, in the order of :func:`multiply`."""
_AHEAD: Final = 8
"""Columns whose factors are laid out at once: they stay in the processor's first cache."""


def multiply(p: ArrayLike, q: ArrayLike) -> Array:
    """Return the Hamilton product ``p * q`` (Sola eq. 12).

    :param p: (..., 4) quaternions.
    :param q: (..., 4) quaternions, broadcast against p.
    """
    return stack(components.multiply(quaternion(p), quaternion(q)))


def conjugate(q: ArrayLike) -> Array:
    """Return the conjugate, the inverse rotation of a unit quaternion: ``q_bw`` from ``q_wb``."""
    return np.asarray(q, dtype=np.float64) * np.array([1.0, -1.0, -1.0, -1.0])


def normalise(q: ArrayLike) -> Array:
    """Return quaternions scaled to unit length.

    :param q: (..., 4), none of them zero.
    """
    q = np.asarray(q, dtype=np.float64)
    return q / np.linalg.norm(q, axis=-1, keepdims=True)


def rotate(q_ab: ArrayLike, v_b: ArrayLike) -> Array:
    """Return ``v_a = R_ab @ v_b``.

    :param q_ab: (..., 4) unit quaternions.
    :param v_b: (..., 3) vectors, broadcast against q_ab.
    """
    return stack(components.rotate(quaternion(q_ab), vector(v_b)))


def rotate_inverse(q_ab: ArrayLike, v_a: ArrayLike) -> Array:
    """Return ``v_b = R_ab.T @ v_a``; shapes as for :func:`rotate`."""
    return stack(components.rotate_inverse(quaternion(q_ab), vector(v_a)))


def cross(a: ArrayLike, b: ArrayLike) -> Array:
    """Return ``a x b`` of vectors (..., 3), broadcast against each other."""
    return stack(components.cross(vector(a), vector(b)))


def pose_matrix(r_ab: ArrayLike, p_ab: ArrayLike) -> Array:
    """Return T_ab (4, 4), which maps coordinates in b to a: ``p_a = R_ab @ p_b + p_ab``."""
    result = np.eye(4)
    result[:3, :3], result[:3, 3] = r_ab, p_ab
    return result


def rigid_motion(matrix: Array) -> Array | None:
    """Return the pose (4, 4) nearest to a matrix of few digits; None if it is no rigid motion."""
    u, _, vt = np.linalg.svd(matrix[:3, :3])
    pose = pose_matrix(u @ vt, matrix[:3, 3])
    is_rigid = np.abs(matrix - pose).max() <= _ROUNDING and np.linalg.det(pose) > 0.0
    return pose if is_rigid else None


def inverse_pose(t_ab: Array) -> Array:
    """Return T_ba of T_ab (4, 4), exact in its last row."""
    r_ba = t_ab[:3, :3].T
    return pose_matrix(r_ba, -r_ba @ t_ab[:3, 3])


def transform(matrix: Array, v: Array) -> Array:
    """Return ``M @ v`` (..., 3) of vectors (..., 3), with the same sums for any number of them.

    :param matrix: (..., 3, 3), broadcast against the vectors' leading axes.
    """
    products = np.multiply(matrix, v[..., None, :], order="F")
    result: Array = products[..., 0] + products[..., 1]
    result += products[..., 2]
    return result


def to_matrix(q_ab: ArrayLike) -> Array:
    """Return ``R_ab`` (..., 3, 3) of unit quaternions (..., 4) (Sola eq. 115)."""
    entries = components.to_matrix(quaternion(q_ab))
    result = np.empty((*np.shape(entries[0]), 9))
    for k, entry in enumerate(entries):
        result[..., k] = entry
    return result.reshape(*result.shape[:-1], 3, 3)


def from_matrix(r_ab: ArrayLike) -> Array:
    """Return unit quaternions (..., 4), w >= 0, of rotation matrices (..., 3, 3).

    The largest of the four squared components is found first and divided by (Shepperd 1978), so
    that no half turn loses digits.
    """
    r = np.asarray(r_ab, dtype=np.float64)
    xx, yy, zz = r[..., 0, 0], r[..., 1, 1], r[..., 2, 2]
    # Row k of this symmetric matrix is 4 * q_k * (w, x, y, z).
    products = np.empty((*r.shape[:-2], 4, 4))
    products[..., 0, 0] = 1 + xx + yy + zz
    products[..., 1, 1] = 1 + xx - yy - zz
    products[..., 2, 2] = 1 - xx + yy - zz
    products[..., 3, 3] = 1 - xx - yy + zz
    for i, j, value in (
        (0, 1, r[..., 2, 1] - r[..., 1, 2]),
        (0, 2, r[..., 0, 2] - r[..., 2, 0]),
        (0, 3, r[..., 1, 0] - r[..., 0, 1]),
        (1, 2, r[..., 1, 0] + r[..., 0, 1]),
        (1, 3, r[..., 0, 2] + r[..., 2, 0]),
        (2, 3, r[..., 2, 1] + r[..., 1, 2]),
    ):
        products[..., i, j] = products[..., j, i] = value
    largest = np.argmax(np.einsum("...kk->...k", products), axis=-1)
    q = normalise(np.take_along_axis(products, largest[..., None, None], axis=-2)[..., 0, :])
    return canonical(q)


def canonical(q: ArrayLike) -> Array:
    """Return of each pair q, -q, which are one rotation, the one with w >= 0."""
    q = np.asarray(q, dtype=np.float64)
    return np.where(q[..., :1] < 0, -q, q)


def unwrap_signs(q: ArrayLike) -> Array:
    """Return a sequence (n, 4) with signs such that neighbours lie in one hemisphere."""
    q = np.asarray(q, dtype=np.float64)
    products = q[1:] * q[:-1]
    flips = np.where(products.sum(axis=-1) < 0, -1.0, 1.0)
    signs = np.concatenate([np.ones(min(len(q), 1)), np.cumprod(flips)])
    return q * signs[:, None]


def upright(axis: str) -> Array:
    """Return R (3, 3), which maps coordinates with an axis up to those with z up.

    The axes change places in a circle: of coordinates with y up, x, y, z become z, x, y.

    :param axis: x, y or z, after ``-`` if it points down.
    """
    matrix = np.roll(np.eye(3), 2 - "xyz".index(axis[-1]), axis=0)
    return matrix * np.array([[1.0], [-1.0], [-1.0]]) if axis.startswith("-") else matrix


def exp(rotation_vector: ArrayLike) -> Array:
    """Return the quaternions (..., 4) of rotation vectors (..., 3) [rad] (Sola eq. 101)."""
    return stack(components.exp(vector(rotation_vector)))


def log(q: ArrayLike) -> Array:
    """Return the rotation vectors (..., 3) [rad], at most pi long, of unit quaternions (..., 4)."""
    return stack(components.log(quaternion(q)))


def interpolate(start: ArrayLike, end: ArrayLike, share: ArrayLike) -> Array:
    """Return rotations (n, 4) between two, at constant rate about one axis (Shoemake 1985).

    :param start: (n, 4) rotations at the start.
    :param end: (n, 4) rotations at the end.
    :param share: (n,) share of the way from start to end, from 0 to 1.
    """
    turn = log(multiply(conjugate(start), end))
    return multiply(start, exp(np.asarray(share)[:, None] * turn))


def skew(v: ArrayLike) -> Array:
    """Return the matrices (..., 3, 3) with ``skew(a) @ b = a x b`` of vectors (..., 3)."""
    v = np.asarray(v, dtype=np.float64)
    matrix = np.zeros((*v.shape, 3))
    matrix[..., 0, 1], matrix[..., 0, 2], matrix[..., 1, 2] = -v[..., 2], v[..., 1], -v[..., 0]
    matrix[..., 1, 0], matrix[..., 2, 0], matrix[..., 2, 1] = v[..., 2], -v[..., 1], v[..., 0]
    return matrix


def right_jacobian(rotation_vector: ArrayLike) -> Array:
    """Return ``Jr`` (..., 3, 3) with ``Exp(v + d) ~ Exp(v) Exp(Jr(v) d)`` (Sola eq. 183).

    :param rotation_vector: (..., 3) [rad].
    """
    v = np.asarray(rotation_vector, dtype=np.float64)
    angle = np.linalg.norm(v, axis=-1)[..., None, None]
    small = angle < _SMALL_ANGLE
    x = np.where(small, 1.0, angle)
    b = np.where(small, 0.5 - angle**2 / 24.0, (1.0 - np.cos(x)) / x**2)
    c = np.where(small, 1.0 / 6.0 - angle**2 / 120.0, (x - np.sin(x)) / x**3)
    s = skew(v)
    return np.eye(3) - b * s + c * (s @ s)


def from_euler(roll_pitch_yaw: ArrayLike) -> Array:
    """Return ``q_wb`` (..., 4) of Euler angles (..., 3) [rad]: ``Rz(yaw) Ry(pitch) Rx(roll)``."""
    return stack(components.from_euler(vector(roll_pitch_yaw)))


def to_euler(q_wb: ArrayLike) -> Array:
    """Return roll, pitch, yaw (..., 3) [rad]; pitch in [-pi/2, pi/2], the others in [-pi, pi]."""
    return stack(components.to_euler(quaternion(q_wb)))


def euler_rates_to_body_rates(roll_pitch_yaw: ArrayLike) -> Array:
    """Return E (..., 3, 3) with ``omega_b = E @ d/dt (roll, pitch, yaw)`` (lecture eq. 37)."""
    angles = np.asarray(roll_pitch_yaw, dtype=np.float64)
    sr, cr = np.sin(angles[..., 0]), np.cos(angles[..., 0])
    sp, cp = np.sin(angles[..., 1]), np.cos(angles[..., 1])
    ones, zeros = np.ones_like(sr), np.zeros_like(sr)
    rows = [[ones, zeros, -sp], [zeros, cr, sr * cp], [zeros, -sr, cr * cp]]
    return np.stack([np.stack(row, axis=-1) for row in rows], axis=-2)


def body_rates_to_euler_rates(roll_pitch_yaw: ArrayLike) -> Array:
    """Return the inverse (..., 3, 3) (lecture eq. 38); infinite at a pitch of +-90 degrees."""
    angles = np.asarray(roll_pitch_yaw, dtype=np.float64)
    sr, cr = np.sin(angles[..., 0]), np.cos(angles[..., 0])
    tp, cp = np.tan(angles[..., 1]), np.cos(angles[..., 1])
    ones, zeros = np.ones_like(sr), np.zeros_like(sr)
    rows = [[ones, sr * tp, cr * tp], [zeros, cr, -sr], [zeros, sr / cp, cr / cp]]
    return np.stack([np.stack(row, axis=-1) for row in rows], axis=-2)


def euler_motion(angles: Array, rates: Array, accelerations: Array) -> tuple[Array, Array, Array]:
    """Return q_wb (n, 4), omega_b (n, 3) and alpha_b (n, 3) of Euler angles over time.

    ``omega_b = E d/dt (roll, pitch, yaw)`` (lecture eq. 37); alpha_b is its derivative.

    :param angles: (n, 3) roll, pitch, yaw [rad].
    :param rates: (n, 3) first derivatives of the angles [rad/s].
    :param accelerations: (n, 3) second derivatives of the angles [rad/s^2].
    """
    half = 0.5 * angles
    sines, cosines = np.sin(half), np.cos(half)
    twice = 2.0 * sines[:, :2]
    (sr, sp), (cr, cp) = (twice * cosines[:, :2]).T, (1.0 - twice * sines[:, :2]).T
    (roll1, pitch1, yaw1), (roll2, pitch2, yaw2) = rates.T, accelerations.T
    across, down, turn = sr * cp, cr * cp, yaw1 * pitch1
    omega, alpha = (np.empty(angles.shape, order="F") for _ in range(2))
    x, y, z = omega.T
    x[:] = roll1 - yaw1 * sp
    y[:] = pitch1 * cr + yaw1 * across
    z[:] = yaw1 * down - pitch1 * sr
    alpha[:, 0] = roll2 - yaw2 * sp - turn * cp
    alpha[:, 1] = pitch2 * cr + yaw2 * across + roll1 * z - turn * sp * sr
    alpha[:, 2] = yaw2 * down - pitch2 * sr - roll1 * y - turn * sp * cr
    return stack(from_half_angles(vector(sines), vector(cosines))), omega, alpha


def cumulative_product(q: ArrayLike) -> Array:
    """Return the running products ``q_0, q_0 q_1, q_0 q_1 q_2, ...`` of a sequence (n, 4).

    A blocked scan: the sequence is laid out as about sqrt(n) rows; all rows advance together, one
    column at a time, then each row is multiplied by the product of the rows before it. Some
    2 sqrt(n) vectorised products instead of n small ones, and rounding that grows with sqrt(n).
    """
    sequence = np.asarray(q, dtype=np.float64).T
    n = sequence.shape[1]
    if n < 2:
        return sequence.T.copy()
    columns = math.ceil(math.sqrt(n))
    rows = ceil_divide(n, columns)
    table = np.zeros((columns, 4, rows))
    table[n % columns :, 0, -1] = 1.0  # what is missing of the last row; the rest is filled next
    whole_rows = n // columns
    row_view = table.transpose(1, 2, 0)
    row_view[:, :whole_rows] = sequence[:, : whole_rows * columns].reshape(4, whole_rows, columns)
    row_view[:, whole_rows:, : n % columns] = sequence[:, None, whole_rows * columns :]
    scratch, terms = np.empty((_AHEAD, 4, 4, rows)), np.empty((4, 4, rows))
    running = table[0]
    for begin in range(1, columns, _AHEAD):
        some = table[begin : begin + _AHEAD]
        ahead = np.take(some, _FACTORS, axis=1, out=scratch[: len(some)], mode="clip")
        ahead *= _SIGNS[:, :, None]
        for factors, product in zip(ahead, some, strict=True):
            # Two calls a column, and the same rounding as multiply has.
            np.multiply(running, factors, terms)
            running = np.add.reduce(terms, 1, None, product)
    starts = np.empty((4, columns, rows))
    starts[:] = _running(table[-1].T.tolist())[:, None]
    ends = np.ascontiguousarray(table.transpose(1, 0, 2))
    q = components.multiply(quaternion(starts.reshape(4, -1).T), quaternion(ends.reshape(4, -1).T))
    product = stack(q).T.reshape(ends.shape)
    result: Array = starts.reshape(4, -1)  # its memory serves once more
    result.reshape(4, rows, columns)[:] = product.transpose(0, 2, 1)
    return result[:, :n].T


def _running(products: list[list[float]]) -> Array:
    """Return the product of the rows before each (4, m)."""
    running_product: components.Quaternion[float] = (1.0, 0.0, 0.0, 0.0)
    starts = []
    for w, x, y, z in products:
        starts.append(running_product)
        running_product = components.multiply(running_product, (w, x, y, z))
    return np.array(starts).T


_SMALL = 0.1
"""Angle below which the series are used; what they leave out is below 1e-13 [rad]."""


def rate_and_acceleration(
    phi: Array, phi_rate: Array, phi_acceleration: Array
) -> tuple[Array, Array]:
    """Return omega and alpha (n, 3) of ``R = Exp(phi)``, in the axes that are turned.

    ``omega = Jr(phi) phi'`` with ``Jr = I - b [phi] + c [phi]^2``, ``b = (1 - cos t) / t^2``,
    ``c = (t - sin t) / t^3`` and ``t = |phi|`` (Chirikjian, "Stochastic models, information theory,
    and Lie groups", vol. 2, eq. 10.86); alpha is its derivative, term by term.

    :param phi: (n, 3) rotation vectors [rad].
    :param phi_rate: (n, 3) phi', their first derivatives [rad/s].
    :param phi_acceleration: (n, 3) phi'', their second derivatives [rad/s^2].
    """
    angle = np.linalg.norm(phi, axis=-1)
    b, c, b_slope, c_slope = (value[:, None] for value in _coefficients(angle))
    growth = np.sum(phi * phi_rate, axis=-1, keepdims=True)  # t t'
    across = np.cross(phi, phi_rate)
    twice = np.cross(phi, across)
    omega: Array = phi_rate - b * across + c * twice
    turned = np.cross(phi, phi_acceleration)
    alpha: Array = (
        phi_acceleration - b * turned - b_slope * growth * across + c_slope * growth * twice
    )
    alpha += c * (np.cross(phi_rate, across) + np.cross(phi, turned))
    return omega, alpha


def _coefficients(angle: Array) -> tuple[Array, Array, Array, Array]:
    """Return b, c, and their slopes over the angle, db/dt / t and dc/dt / t, each (n,)."""
    square = angle * angle
    series = (
        1 / 2 + square * (-1 / 24 + square * (1 / 720 - square / 40320)),
        1 / 6 + square * (-1 / 120 + square * (1 / 5040 - square / 362880)),
        -1 / 12 + square * (1 / 180 + square * (-1 / 6720 + square / 453600)),
        -1 / 60 + square * (1 / 1260 + square * (-1 / 60480 + square / 4989600)),
    )
    large = angle > _SMALL
    if not large.any():
        return series
    t = np.where(large, angle, 1.0)
    sine, cosine = np.sin(t), np.cos(t)
    closed = (
        (1.0 - cosine) / t**2,
        (t - sine) / t**3,
        (t * sine - 2.0 * (1.0 - cosine)) / t**4,
        (t * (1.0 - cosine) - 3.0 * (t - sine)) / t**5,
    )
    b, c, b_slope, c_slope = (
        np.where(large, whole, short) for whole, short in zip(closed, series, strict=True)
    )
    return b, c, b_slope, c_slope
