# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""The contribution of a tilt that is no longer small to the errors of velocity and position.

To first order a tilt theta turns the specific force a by ``theta x a``, across it; along it nothing
changes, and the first-order covariance knows there but the accelerometer's own noise. To second
order the force is shortened by ``theta x (theta x a) / 2``: with 2.7 degrees of tilt per axis, as
the lecture's gyroscope has after 10 s, by 2 cm/s^2, and integrated this is more than the first
order's sigma of the vertical. Mean and covariance of it follow from the covariance of the tilt.

With ``Z = theta theta^T`` and its mean ``S``, the covariance of theta, the second-order
acceleration is ``(Z - tr(Z) I) a / 2``. The six entries of ``Z - S`` are kept as a state z of their
own. For a Gaussian theta, ``Cov(Z_ij, Z_kl) = S_ik S_jl + S_il S_jk`` (Isserlis 1918), and z passes
on as theta does, ``theta' = G theta + noise``.
"""

from typing import Final

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

_ROWS: Final = np.array([0, 0, 0, 1, 1, 2])
_COLUMNS: Final = np.array([0, 1, 2, 1, 2, 2])
_Z, _VELOCITY, _POSITION = slice(0, 6), slice(6, 9), slice(9, 12)
_MOVED: Final = slice(6, 12)
_IN_STATE: Final = slice(3, 9)
"""Velocity and position in the error of the state."""
_POSITION_ROWS, _VELOCITY_COLUMNS = np.arange(9, 12), np.arange(6, 9)


def _place(first: NDArray[np.int64], second: NDArray[np.int64]) -> NDArray[np.intp]:
    """Return the places (6, 6) of entries (first, second) in a flat (3, 3) matrix."""
    return (3 * first[:, None] + second).astype(np.intp)


_IK, _JM = _place(_ROWS, _ROWS), _place(_COLUMNS, _COLUMNS)
_IM, _JK = _place(_ROWS, _COLUMNS), _place(_COLUMNS, _ROWS)
"""Places for entries ij and km of a symmetric matrix."""
_COUNTED: Final = np.where(_ROWS == _COLUMNS, 0.5, 1.0)
"""On the diagonal ij and ji are the same entry."""
_SMALLEST: Final = 1e-15
"""Eigenvalues below this share of the largest are rounding."""
_BY_Z: Final = 0.5 * np.array(
    [
        [[0, 0, 0], [0, 1, 0], [0, 0, 1], [-1, 0, 0], [0, 0, 0], [-1, 0, 0]],
        [[0, -1, 0], [1, 0, 0], [0, 0, 0], [0, 0, 0], [0, 0, 1], [0, -1, 0]],
        [[0, 0, -1], [0, 0, 0], [1, 0, 0], [0, 0, -1], [0, 1, 0], [0, 0, 0]],
    ]
)
"""(3, 6, 3): ``(Z - tr(Z) I) a / 2`` is ``_BY_Z @ a`` on Z's xx, xy, xz, yy, yz and zz."""


class SecondOrder:
    """Mean and covariance of the second-order errors of velocity and position, in the world."""

    def __init__(self, size: int) -> None:
        """Start with no tilt.

        :param size: n, how many numbers the error of the state has: attitude, velocity, position,
            and more.
        """
        self._velocity, self._position = np.zeros(3), np.zeros(3)
        # z, velocity, position, each less its mean
        self._covariance = np.zeros((12, 12))
        self._mean_square = np.zeros((size, size))
        self._f, self._g = np.eye(12), np.eye(12, 6)

    def step(self, h: float, acceleration: Array, before: Array, after: Array, kept: Array) -> None:
        """Propagate over an interval.

        :param h: its length [s].
        :param acceleration: (3,) mean specific force, in the world [m/s^2].
        :param before: (3, 3) covariance of the attitude's error at the start, S.
        :param after: (3, 3) at the end.
        :param kept: (3, 3) G, the regression of the error at the end on that at the start.
        """
        mean = 0.25 * (before + after)
        gained = (mean.dot(acceleration) - mean.trace() * acceleration) * h
        self._position += (self._velocity + 0.5 * gained) * h
        self._velocity += gained
        passed = _pairs(kept)
        f, g = self._f, self._g
        g[_VELOCITY] = by_z = _BY_Z.dot(0.5 * h * acceleration)
        f[_Z, _Z] = passed
        f[_VELOCITY, _Z] = gain = by_z + by_z.dot(passed)
        f[_POSITION, _Z] = 0.5 * h * gain
        f[_POSITION_ROWS, _VELOCITY_COLUMNS] = h
        new = _products(after) - passed.dot(_products(before)).dot(passed.T)
        self._covariance = f.dot(self._covariance).dot(f.T) + g.dot(new).dot(g.T)
        average = np.concatenate([self._velocity, self._position])
        self._mean_square[_IN_STATE, _IN_STATE] = self._covariance[_MOVED, _MOVED] + (
            average[:, None] * average
        )

    def mean_square(self) -> Array:
        """Return (n, n): the mean square of the errors of velocity and position, zero elsewhere."""
        return self._mean_square


def regression(cross: Array, covariance: Array) -> Array:
    """Return ``cross covariance^+``: the mean of what is correlated, for each unit of the other.

    :param cross: (n, 3) covariance with it.
    :param covariance: (3, 3) of the other; what is known without error explains nothing.
    """
    size, axes = np.linalg.eigh(covariance)
    sizes = size.tolist()
    least = _SMALLEST * max(map(abs, sizes))
    inverse = np.array([1.0 / value if abs(value) > least else 0.0 for value in sizes])
    result: Array = (cross.dot(axes) * inverse).dot(axes.T)
    return result


def _products(s: Array) -> Array:
    """Covariance (6, 6) of the entries of Z."""
    s = s.ravel()
    result: Array = s.take(_IK) * s.take(_JM) + s.take(_IM) * s.take(_JK)
    return result


def _pairs(g: Array) -> Array:
    """Return the matrix (6, 6) of ``Z -> G Z G^T`` on the entries of a symmetric Z."""
    return _products(g) * _COUNTED
