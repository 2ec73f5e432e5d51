"""Do the errors have the size that their covariance says?

Bar-Shalom, Li and Kirubarajan, "Estimation with applications to tracking and navigation", 2001,
section 5.4.2: the normalised estimation error squared (NEES) ``e^T P^-1 e`` of a consistent
estimate is chi-square distributed with as many degrees of freedom as e has numbers, and its mean
over independent runs (ANEES) lies in a band that shrinks with their number.
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]


class Band(NamedTuple):
    """Where a chi-square mean lies with a given probability."""

    low: float
    high: float


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
