# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Vectors and quaternions with the components first, (3, n) and (4, n).

Every operand of the arithmetic is then contiguous. But for :func:`cumulative_product`, only
operations element by element, so that a sample has the same value, bit for bit, in whatever block
it is computed.
"""

import math

import numpy as np

from imu_sim_ros.types import Array

_SMALL_ANGLE = 1e-4
_IDENTITY = np.eye(3).tolist()
_FACTORS = np.array([[0, 1, 2, 3], [1, 0, 3, 2], [2, 3, 0, 1], [3, 2, 1, 0]])
_SIGNS = np.array([[1, -1, -1, -1], [1, 1, 1, -1], [1, -1, 1, 1], [1, 1, -1, 1]], dtype=np.float64)
"""``(p q)_i = sum_k p_k sign_ik q_factor_ik``, in the order of :func:`multiply`."""
_FEW = 16
"""Vectors for which the calls take longer than the numbers."""
_AHEAD = 8
"""Columns whose factors are laid out at once: they stay in the processor's first cache."""


def multiply(p: Array, q: Array) -> Array:
    """Return the Hamilton products (4, ...) of quaternions (Sola eq. 12)."""
    pw, px, py, pz = p
    qw, qx, qy, qz = q
    result = np.empty((4, *np.broadcast_shapes(pw.shape, qw.shape)))
    result[0] = pw * qw - px * qx - py * qy - pz * qz
    result[1] = pw * qx + px * qw + py * qz - pz * qy
    result[2] = pw * qy - px * qz + py * qw + pz * qx
    result[3] = pw * qz + px * qy - py * qx + pz * qw
    return result


def normalise(q: Array) -> Array:
    """Return quaternions (4, n) at unit length."""
    w, x, y, z = q
    return q * (1.0 / np.sqrt(w * w + x * x + y * y + z * z))


def rotate(q_ab: Array, v_b: Array) -> Array:
    """Return ``v_a = R_ab v_b`` (3, ...) of unit quaternions (4, ...) and vectors (3, ...)."""
    w, x, y, z = q_ab
    a, b, c = v_b
    cx, cy, cz = 2.0 * (y * c - z * b), 2.0 * (z * a - x * c), 2.0 * (x * b - y * a)
    result = np.empty((3, *np.broadcast_shapes(w.shape, a.shape)))
    result[0] = a + w * cx + y * cz - z * cy
    result[1] = b + w * cy + z * cx - x * cz
    result[2] = c + w * cz + x * cy - y * cx
    return result


def rotate_inverse(q_ab: Array, v_a: Array) -> Array:
    """Return ``v_b = R_ab.T @ v_a`` (3, n) of q (4, n) and v (3, n) or (3, 1).

    ``v - 2 w (u x v) + 2 u x (u x v)`` with ``q = (w, u)``.
    """
    w, u = q_ab[0], q_ab[1:]
    twice = cross(u, v_a)
    twice *= 2.0
    result = cross(u, twice)
    result += v_a
    twice *= w
    result -= twice
    return result


def exp(v: Array) -> Array:
    """Return the quaternions (4, n) of rotation vectors (3, n) [rad] (Sola eq. 101)."""
    half = 0.5 * np.sqrt(v[0] * v[0] + v[1] * v[1] + v[2] * v[2])
    result = np.empty((4, *half.shape))
    np.cos(half, out=result[0])
    # sin(x) / x; for small x its series, exact to the last digit there.
    small = half < _SMALL_ANGLE
    factor = np.sin(half)
    np.divide(0.5 * factor, half, out=factor, where=~small)
    if small.any():
        factor[small] = 0.5 - half[small] ** 2 / 12.0
    np.multiply(v, factor, out=result[1:])
    return result


def log(q: Array) -> Array:
    """Return the rotation vectors (3, ...) [rad], at most pi long, of unit quaternions (4, ...)."""
    w, x, y, z = q
    cosine, sine = np.abs(w), np.sqrt(x * x + y * y + z * z)
    small = sine < _SMALL_ANGLE
    # 2 atan2(s, w) / s; near zero its series 2 / w - 2 s^2 / (3 w^3) (Sola eq. 105).
    factor = 2.0 * np.arctan2(sine, cosine) / np.where(small, 1.0, sine)
    if small.any():
        safe = np.where(small, cosine, 1.0)
        factor = np.where(small, 2.0 / safe - 2.0 / 3.0 * sine**2 / safe**3, factor)
    return q[1:] * np.where(w < 0.0, -factor, factor)  # q and -q are one rotation


def cross(a: Array, b: Array) -> Array:
    """Return ``a x b`` (3, n) of (3, n) or (3, 1)."""
    result = np.empty((3, b.shape[1] if a.shape[1] == 1 else a.shape[1]))
    for row, (i, j) in zip(result, ((1, 2), (2, 0), (0, 1)), strict=True):
        np.multiply(a[i], b[j], out=row)
        row -= a[j] * b[i]
    return result


def transform(matrix: Array, v: Array) -> Array:
    """Return ``M @ v`` (3, n) of M (3, 3) and v (3, n); zeros and ones of M cost nothing."""
    if v.ndim == 2 and v.shape[1] <= _FEW:  # the same sums in two calls instead of twenty
        return np.add.reduce(matrix[:, :, None] * v, 1, initial=0.0)
    rows = matrix.tolist()
    if rows == _IDENTITY:
        return np.add(v, 0.0, out=np.empty(v.shape))  # as the sums below: no negative zeros
    result = np.zeros(v.shape)
    product = np.empty(v.shape[1:])
    for row, coefficients in zip(result, rows, strict=True):
        for component, coefficient in zip(v, coefficients, strict=True):
            if coefficient == 1.0:
                row += component
            elif coefficient != 0.0:
                row += np.multiply(component, coefficient, out=product)
    return result


def cumulative_product(q: Array) -> Array:
    """Return the running products ``q_0, q_0 q_1, q_0 q_1 q_2, ...`` of a sequence (4, n).

    A blocked scan: the sequence is laid out as about sqrt(n) rows; all rows advance together, one
    column at a time, then each row is multiplied by the product of the rows before it. Some
    2 sqrt(n) vectorised products instead of n small ones, and rounding that grows with sqrt(n).
    """
    n = q.shape[1]
    if n == 0:
        return np.empty((4, 0))
    columns = math.ceil(math.sqrt(n))
    rows = -(-n // columns)
    table = np.zeros((columns, 4, rows))
    table[n % columns :, 0, -1] = 1.0  # what is missing of the last row; the rest is filled next
    whole = n // columns
    in_rows = table.transpose(1, 2, 0)
    in_rows[:, :whole] = q[:, : whole * columns].reshape(4, whole, columns)
    in_rows[:, whole:, : n % columns] = q[:, None, whole * columns :]
    right, terms = np.empty((_AHEAD, 4, 4, rows)), np.empty((4, 4, rows))
    before = table[0]
    for first in range(1, columns, _AHEAD):
        some = table[first : first + _AHEAD]
        ahead = np.take(some, _FACTORS, axis=1, out=right[: len(some)], mode="clip")
        ahead *= _SIGNS[:, :, None]
        for factors, product in zip(ahead, some, strict=True):
            # Two calls a column, and the same rounding as multiply has.
            np.multiply(before, factors, terms)
            before = np.add.reduce(terms, 1, None, product)
    starts = np.empty((4, columns, rows))
    starts[:] = _running(table[-1].T.tolist())[:, None]
    ends = np.ascontiguousarray(table.transpose(1, 0, 2))
    product = multiply(starts.reshape(4, -1), ends.reshape(4, -1)).reshape(ends.shape)
    result: Array = starts.reshape(4, -1)  # its memory serves once more
    result.reshape(4, rows, columns)[:] = product.transpose(0, 2, 1)
    return result[:, :n]


def _running(products: list[list[float]]) -> Array:
    """Return the product of the rows before each (4, m): m is small, plain numbers are fast."""
    pw, px, py, pz = 1.0, 0.0, 0.0, 0.0
    starts = []
    for qw, qx, qy, qz in products:
        starts.append((pw, px, py, pz))
        pw, px, py, pz = (
            pw * qw - px * qx - py * qy - pz * qz,
            pw * qx + px * qw + py * qz - pz * qy,
            pw * qy - px * qz + py * qw + pz * qx,
            pw * qz + px * qy - py * qx + pz * qw,
        )
    return np.array(starts).T
