# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Vectors with the components first, (3, n): every operand of the arithmetic is then contiguous.

Only additions and multiplications element by element, so that a sample has the same value, bit for
bit, in whatever block it is computed.
"""

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]


def cross(a: Array, b: Array) -> Array:
    """Return ``a x b`` (3, n) of (3, n) or (3, 1)."""
    result = np.empty((3, b.shape[1] if a.shape[1] == 1 else a.shape[1]))
    for row, (i, j) in zip(result, ((1, 2), (2, 0), (0, 1)), strict=True):
        np.multiply(a[i], b[j], out=row)
        row -= a[j] * b[i]
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


def transform(matrix: Array, v: Array) -> Array:
    """Return ``M @ v`` (3, n) of M (3, 3) and v (3, n); zeros and ones of M cost nothing."""
    result = np.zeros(v.shape)
    for row, coefficients in zip(result, matrix.tolist(), strict=True):
        for component, coefficient in zip(v, coefficients, strict=True):
            if coefficient == 1.0:
                row += component
            elif coefficient != 0.0:
                row += coefficient * component
    return result
