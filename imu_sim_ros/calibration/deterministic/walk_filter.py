# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Readings with white noise and a random walk, whitened by a filter instead of by a matrix.

The covariance ``q min(t_i, t_j) + diag(sigma^2)`` has a Cholesky factor whose inverse turns columns
into the normalised innovations of a Kalman filter with one state, the walk (Anderson and Moore,
"Optimal Filtering", 1979, section 9.4). That takes n steps where the factor takes n^3 / 3, and many
sizes of the walk go through it side by side.
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]


class Whitened(NamedTuple):
    """Columns whitened for each of g sizes of the walk."""

    columns: Array
    """(g, n, p)."""
    log_determinant: Array
    """(g,) of the covariance."""


def whitened(columns: Array, time: Array, sigma: Array, walk: Array) -> Whitened:
    """Return ``L^-1 columns`` and ``ln det(L L^T)`` with ``L L^T = walk min(t, t) + sigma^2``.

    :param columns: (n, p) rows in the order of time.
    :param time: (n,) ascending, the first not below 0; the walk is 0 at 0.
    :param sigma: (n,) standard deviations of the white noise, above 0.
    :param walk: (g,) squares of the walk's density.
    """
    steps = np.diff(time, prepend=0.0)
    white = np.square(sigma)
    variance = np.zeros(len(walk))
    state = np.zeros((len(walk), columns.shape[1]))
    result = np.empty((len(time), len(walk), columns.shape[1]))
    log_determinant = np.zeros(len(walk))
    for k, row in enumerate(columns):
        variance = variance + walk * steps[k]
        total = variance + white[k]
        innovation = row - state
        np.divide(innovation, np.sqrt(total)[:, None], out=result[k])
        log_determinant += np.log(total)
        gain = variance / total
        state += gain[:, None] * innovation
        variance = gain * white[k]
    return Whitened(result.transpose(1, 0, 2), log_determinant)
