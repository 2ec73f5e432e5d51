# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Whether errors have the size that their covariance states.

Bar-Shalom, Li and Kirubarajan, "Estimation with applications to tracking and navigation", 2001,
section 5.4.2: the normalised estimation error squared (NEES) ``e^T P^-1 e`` of a consistent
estimate is chi-square distributed with as many degrees of freedom as e has numbers, and its mean
over independent runs (ANEES) lies in a band that shrinks with their number.

With a covariance of first order it matters which numbers e holds, where the attitude is off by more
than a degree or so. Velocity and position that were integrated along a tilted gravity err along an
arc, not along a straight line; their plain difference has an error of second order. In the
coordinates of the group of attitude, velocity and position, SE_2(3), the arc is straight (Barrau
and Bonnabel, "The invariant extended Kalman filter as a stable observer", TAC 2017; Brossard,
Barrau, Chauchat and Bonnabel, "Associating uncertainty to extended poses for on Lie group IMU
preintegration with rotating Earth", T-RO 2022): :func:`straightened`.
"""

from typing import Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from imu_sim_ros import rotation

Array = NDArray[np.float64]

LARGEST_SIGMA: Final = 0.5
"""[rad] of an attitude, along its worst axis: beyond, no covariance is right, nor any NEES."""


def straightened(attitude: Array, error: Array) -> Array:
    """Return ``Jl(theta)^-1 e`` (n, 3): an error of velocity or position along the arc.

    It belongs to a covariance that was propagated along the estimate. Attitude and error are in one
    frame, that of the covariance.

    :param attitude: (n, 3) the error of the attitude, truth minus estimate, as rotation vector
        theta with ``R_true = Exp(theta) R`` in the world, or ``R_true = R Exp(theta)`` in the body.
    :param error: (n, 3) truth minus estimate.
    """
    # Jl(v) is Jr(-v).
    result: Array = (rotation.right_jacobian_inverse(-attitude) @ error[..., None])[..., 0]
    return result


def attitude_sigma(covariances: Array) -> Array:
    """Return the standard deviation (n,) along the worst axis [rad].

    :param covariances: (n, 3, 3) of attitudes, finite.
    """
    largest = np.linalg.eigvalsh(covariances)[..., -1]
    result: Array = np.sqrt(np.maximum(largest, 0.0))
    return result


class Band(NamedTuple):
    """Where a chi-square mean lies with a given probability."""

    low: float
    high: float


def invertible(covariances: Array) -> NDArray[np.bool_]:
    """Return which covariances (n, k, k) have a NEES: at a true start they are zero."""
    result: NDArray[np.bool_] = np.asarray(np.isfinite(covariances).all(axis=(1, 2)))
    sizes = np.linalg.eigvalsh(covariances[result])
    least = covariances.shape[-1] * np.finfo(float).eps * np.abs(sizes).max(axis=1, initial=0.0)
    result[result] = sizes[:, 0] > least
    return result


def nees(errors: Array, covariances: Array) -> Array:
    """Return ``e^T P^-1 e`` (n,).

    :param errors: (n, k).
    :param covariances: (n, k, k), or one (k, k) for all; each invertible.
    """
    solved = np.linalg.solve(covariances, errors[..., None])[..., 0]
    result: Array = np.sum(errors * solved, axis=-1)
    return result


def anees_band(freedom: int, runs: int, probability: float = 0.95) -> Band:
    """Return the two-sided band of the mean NEES over independent runs.

    :param freedom: numbers in the error.
    :param runs: independent errors in the mean.
    """
    from scipy.stats import chi2  # 0.3 s that only this needs

    tail = 0.5 * (1.0 - probability)
    low, high = chi2.ppf([tail, 1.0 - tail], freedom * runs) / runs
    return Band(float(low), float(high))
