# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Where a motion is sampled for the mean of a reading, and with which weights."""

from functools import lru_cache
from typing import Final

import numpy as np
from numpy.typing import NDArray

from imu_sim_ros.errors import ConfigurationError

Array = NDArray[np.float64]

_MOST_PERIODS: Final = 50.0
"""Of the highest frequency in the interval; they take 187 nodes."""
_NEWTON_STEPS: Final = 8
"""Enough for any number of nodes; from cosines 4 reach the last digit."""
_ACCURACY: Final = 1e-7
"""Error of the mean of a sinusoid, over its amplitude."""
_ROUNDING: Final = 1e-12
"""An error that is lost in the rounding of a motion's numbers."""


Quadrature = tuple[Array, Array]
"""Nodes and weights (m,) on [0, 1]; the first and the last node are the ends."""


@lru_cache(maxsize=16)
def quadrature(frequency: float, interval: float) -> Quadrature:
    """Return Gauss-Lobatto nodes that average motions up to a frequency to 1e-7 of their size.

    Twice the frequency is assumed: turning and shaking at once gives products of both. Between
    the ends, which neighbouring intervals share, there are three nodes up to 0.14 of a period in
    the interval, 6 for half a period, 13 for two; and two where they are exact to rounding, up to
    0.0085 of a period.

    :param frequency: highest frequency of the motion [Hz]; 0: not known.
    :param interval: averaged over [s].
    :raises ConfigurationError: where there are more than 50 periods in the interval.
    """
    # In terms of the half interval, sin and cos of up to c x, x in [-1, 1]; the mean of cos(c x)
    # is sin(c) / c, and its error grows with c until the nodes are too few for it.
    periods = frequency * interval
    if periods > _MOST_PERIODS:
        raise ConfigurationError(
            f"imu.sampling = averaged: the motion has frequencies up to {frequency:g} Hz, "
            f"{periods:.3g} times the rate; at most {_MOST_PERIODS:g} times can be averaged"
        )
    c = 2.0 * np.pi * periods
    fewest = lobatto(4)
    if c and _error(fewest, c) < _ROUNDING:
        return fewest
    count = max(5, int(0.5 * c))
    while _error(found := lobatto(count), c) >= _ACCURACY:
        count += max(1, count // 16)
    return found


def lobatto(count: int) -> Quadrature:
    """Return the Gauss-Lobatto nodes and weights on [0, 1], exact for powers up to 2 count - 3.

    On [-1, 1] the nodes are the ends and the zeros of ``P'_N``, N = count - 1, with the weights
    ``2 / (N (N + 1) P_N(x)^2)`` (Abramowitz and Stegun, eq. 25.4.32); by Newton's method on
    ``(1 - x^2) P'_N(x) = N (P_(N-1) - x P_N)``, whose derivative is ``-N (N + 1) P_N``.

    :param count: of nodes, at least 2.
    """
    x = -np.cos(np.pi * np.arange(count) / (count - 1))
    for _ in range(_NEWTON_STEPS):
        before, value = np.ones(count), x
        for k in range(2, count):
            before, value = value, ((2 * k - 1) * x * value - (k - 1) * before) / k
        x = x - (x * value - before) / (count * value)
    return 0.5 + 0.5 * x, 1.0 / (count * (count - 1) * value**2)


def _error(rule: Quadrature, c: float) -> float:
    """Return the largest error of the mean of ``cos(b x)`` over [-1, 1] for b up to c."""
    nodes, weights = rule
    trials = np.append(np.arange(1.0, 9.0) / 8.0 * c, 1e-12)
    means = weights @ np.cos(np.outer(2.0 * nodes - 1.0, trials))
    return float(np.max(np.abs(means - np.sinc(trials / np.pi))))
