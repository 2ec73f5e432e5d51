# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Statistics of many runs: intervals, comparisons on the same seeds, sensitivities.

Means have a bias-corrected and accelerated (BCa) bootstrap interval (Efron, "Better bootstrap
confidence intervals", JASA 1987); medians and percentiles the exact interval of the order
statistics (Conover, "Practical nonparametric statistics", 3rd edition, section 3.2), whose end does
not exist where there are too few runs; a share of successes Wilson's (JASA 1927). Two estimators or
sensors are compared by Wilcoxon's signed-rank test on the differences of the same seeds, corrected
for the number of comparisons by Holm (Scand. J. Statistics 1979).
"""

import math
from collections.abc import Sequence
from typing import Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

CONFIDENCE: Final = 0.95
_RESAMPLES: Final = 9999
_FEWEST_RESAMPLES: Final = 1999
_DRAWN: Final = 10_000_000
"""Numbers drawn for an interval: of very many runs there are fewer resamples, whose number then
matters less than the runs'."""
_CHUNK: Final = 1_000_000
"""Numbers drawn at a time, so that memory does not grow with the runs."""
_FEWEST: Final = 6
"""Runs below which no interval is given; two-sided, Wilcoxon's test needs as many for 5 %."""


class Interval(NamedTuple):
    """A value with its 95 % confidence interval; None: the end does not exist."""

    value: float | None
    low: float | None
    high: float | None


def success(done: int, runs: int) -> Interval:
    """Return the share of runs that succeeded with Wilson's interval."""
    from scipy.stats import binomtest

    if not runs:
        return Interval(None, None, None)
    ends = binomtest(done, runs).proportion_ci(CONFIDENCE, method="wilson")
    return Interval(done / runs, float(ends.low), float(ends.high))


def mean(values: Array) -> Interval:
    """Return the mean of values (n,) with its BCa bootstrap interval.

    The resampling has a fixed seed: the same values give the same interval.
    """
    if not len(values):
        return Interval(None, None, None)
    found = float(np.mean(values))
    if len(values) < _FEWEST:
        return Interval(found, None, None)
    if np.ptp(values) == 0.0:
        return Interval(found, found, found)
    low, high = _bca(values)
    return Interval(found, low, high)


def _bca(values: Array) -> tuple[float, float]:
    """Return the BCa interval of a mean.

    With z0 the normal quantile of the share of resampled means below the mean, and the acceleration
    ``a = sum d^3 / (6 (sum d^2)^1.5)`` of the deviations d from the mean, the ends are those
    quantiles of the resampled means whose order is ``Phi(z0 + (z0 + z) / (1 - a (z0 + z)))``.
    """
    from scipy.special import ndtr, ndtri

    rng = np.random.default_rng(20_240_611)
    resamples = min(max(_DRAWN // len(values), _FEWEST_RESAMPLES), _RESAMPLES)
    at_once = max(_CHUNK // len(values), 1)
    means = np.sort(
        np.concatenate(
            [
                values[
                    rng.integers(0, len(values), (min(at_once, resamples - k), len(values)))
                ].mean(axis=1)
                for k in range(0, resamples, at_once)
            ]
        )
    )
    centre = values.mean()
    below = (np.sum(means < centre) + 0.5 * np.sum(means == centre)) / resamples
    z0 = ndtri(np.clip(below, 1 / resamples, 1 - 1 / resamples))
    # The jackknife's deviations are those of the values, up to a factor that cancels out.
    deviation = values - centre
    acceleration = np.sum(deviation**3) / (6.0 * np.sum(deviation**2) ** 1.5)
    z = z0 + ndtri([0.5 * (1.0 - CONFIDENCE), 0.5 * (1.0 + CONFIDENCE)])
    ends = np.quantile(means, ndtr(z0 + z / (1.0 - acceleration * z)))
    return float(ends[0]), float(ends[1])


def quantile(values: Array, p: float) -> Interval:
    """Return a quantile of values (n,), 0 < p < 1, with the interval of the order statistics.

    The ends are the values of ranks r and s with ``P(B < r) <= 0.025`` and ``P(B >= s) <= 0.025``
    for a binomial B of n trials with probability p; an end without such a rank is None.
    """
    from scipy.stats import binom

    if not len(values):
        return Interval(None, None, None)
    n, ordered, tail = len(values), np.sort(values), 0.5 * (1.0 - CONFIDENCE)
    found = float(np.quantile(ordered, p))
    below = binom.cdf(np.arange(n), n, p)  # P(B <= k)
    low_rank = int(np.searchsorted(below, tail, side="right"))  # P(B <= rank - 1) <= tail
    high_rank = int(np.searchsorted(below, 1.0 - tail)) + 1  # P(B <= rank - 1) >= 1 - tail
    return Interval(
        found,
        float(ordered[low_rank - 1]) if low_rank >= 1 else None,
        float(ordered[high_rank - 1]) if high_rank <= n else None,
    )


def statistic(values: Array, name: str) -> Interval:
    """Return ``median``, ``mean``, ``min``, ``max`` or a percentile such as ``p95``."""
    if name == "mean":
        return mean(values)
    if name in ("min", "max"):
        found = float(getattr(np, name)(values)) if len(values) else None
        return Interval(found, None, None)
    return quantile(values, 0.5 if name == "median" else float(name[1:]) / 100.0)


class Comparison(NamedTuple):
    """A against B on the same seeds."""

    pairs: int
    median_difference: Interval
    """Of A less B."""
    ratio: float | None
    """Geometric mean of A / B."""
    p: float | None
    """Of Wilcoxon's signed-rank test, two-sided, not yet corrected; None where there is nothing."""


def compare(a: Array, b: Array) -> Comparison:
    """Compare values (n,) of A and B; row k of both has the same seed."""
    from scipy.stats import wilcoxon

    difference = a - b
    positive = (a > 0) & (b > 0)
    ratio = float(np.exp(np.mean(np.log(a[positive] / b[positive])))) if positive.any() else None
    p: float | None = None
    if len(difference) >= _FEWEST:
        # The ranks of logarithms are fair to errors that differ by a factor.
        logarithms = np.log(a / b) if positive.all() else difference
        p = float(wilcoxon(logarithms).pvalue) if np.any(logarithms != 0.0) else 1.0
    return Comparison(len(difference), quantile(difference, 0.5), ratio, p)


def holm(p_values: Sequence[float | None]) -> list[float | None]:
    """Return p values corrected for their number (Holm's step-down)."""
    known = [(p, k) for k, p in enumerate(p_values) if p is not None]
    result: list[float | None] = [None] * len(p_values)
    largest = 0.0
    for place, (p, k) in enumerate(sorted(known)):
        largest = max(largest, min(1.0, p * (len(known) - place)))
        result[k] = largest
    return result


class Sensitivity(NamedTuple):
    """Slope of the logarithm of an error over the logarithm of a parameter."""

    slope: Interval
    runs: int


def sensitivity(parameter: Array, error: Array, seed: NDArray[np.int64]) -> Sensitivity | None:
    """Return ``d log(error) / d log(parameter)``; None where it cannot be determined.

    The runs of one seed share their random numbers, so that a slope is fitted for each seed, and
    the interval is Student's of their mean.

    :param parameter: (n,) positive values of the parameter.
    :param error: (n,) errors; rows that are not positive are left out.
    :param seed: (n,) seeds.
    """
    from scipy.stats import t as student

    usable = (parameter > 0) & (error > 0)
    x, y, seed = np.log(parameter[usable]), np.log(error[usable]), seed[usable]
    slopes = []
    for one in np.unique(seed):
        rows = seed == one
        spread = x[rows] - x[rows].mean()
        if np.any(spread):
            slopes.append(float(spread @ y[rows] / (spread @ spread)))
    if len(slopes) < 2:
        return None
    centre = float(np.mean(slopes))
    half = float(np.std(slopes, ddof=1)) / math.sqrt(len(slopes))
    half *= float(student.ppf(0.5 * (1.0 + CONFIDENCE), len(slopes) - 1))
    return Sensitivity(Interval(centre, centre - half, centre + half), int(usable.sum()))
