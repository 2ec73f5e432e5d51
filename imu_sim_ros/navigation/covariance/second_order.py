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


class SecondOrder:
    """Mean and covariance of the second-order errors of velocity and position, in the world."""

    def __init__(self) -> None:
        self._velocity, self._position = np.zeros(3), np.zeros(3)
        # z, velocity, position, each less its mean
        self._covariance = np.zeros((12, 12))
        self._mean_square: Array = np.zeros((6, 6))

    def step(self, h: float, acceleration: Array, before: Array, after: Array, kept: Array) -> None:
        """Propagate over an interval.

        :param h: its length [s].
        :param acceleration: (3,) mean specific force, in the world [m/s^2].
        :param before: (3, 3) covariance of the attitude's error at the start, S.
        :param after: (3, 3) at the end.
        :param kept: (3, 3) G, the regression of the error at the end on that at the start.
        """
        by_z = _acceleration(acceleration)
        mean = 0.25 * (before + after)
        gained = (mean - np.trace(mean) * np.eye(3)) @ acceleration * h
        self._position += (self._velocity + 0.5 * gained) * h
        self._velocity += gained
        passed = _pairs(kept)
        f = np.eye(12)
        f[_Z, _Z] = passed
        f[_VELOCITY, _Z] = 0.5 * h * by_z @ (np.eye(6) + passed)
        f[_POSITION, _VELOCITY] = h * np.eye(3)
        f[_POSITION, _Z] = 0.5 * h * f[_VELOCITY, _Z]
        g = np.zeros((12, 6))
        g[_Z] = np.eye(6)
        g[_VELOCITY] = 0.5 * h * by_z
        new = _products(after) - passed @ _products(before) @ passed.T
        self._covariance = f @ self._covariance @ f.T + g @ new @ g.T
        average = np.concatenate([self._velocity, self._position])
        self._mean_square = self._covariance[_VELOCITY.start :, _VELOCITY.start :] + np.outer(
            average, average
        )

    def mean_square(self) -> Array:
        """Return the (6, 6) mean square of the errors of velocity and position."""
        return self._mean_square


def _acceleration(a: Array) -> Array:
    """Return ``(Z - tr(Z) I) a / 2`` as a matrix (3, 6) on Z's xx, xy, xz, yy, yz and zz."""
    x, y, z = 0.5 * a
    return np.array(
        [
            [0.0, y, z, -x, 0.0, -x],
            [-y, x, 0.0, 0.0, z, -y],
            [-z, 0.0, x, -z, y, 0.0],
        ]
    )


def _products(s: Array) -> Array:
    """Covariance (6, 6) of the entries of Z."""
    i, j = _ROWS[:, None], _COLUMNS[:, None]
    k, m = _ROWS, _COLUMNS
    result: Array = s[i, k] * s[j, m] + s[i, m] * s[j, k]
    return result


def _pairs(g: Array) -> Array:
    """Return the matrix (6, 6) of ``Z -> G Z G^T`` on the entries of a symmetric Z."""
    i, j = _ROWS[:, None], _COLUMNS[:, None]
    k, m = _ROWS, _COLUMNS
    both = g[i, k] * g[j, m] + g[i, m] * g[j, k]
    result: Array = np.where(k == m, 0.5 * both, both)
    return result
