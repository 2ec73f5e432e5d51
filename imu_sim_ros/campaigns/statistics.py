# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Statistics of many runs: intervals, comparisons on the same seeds, sensitivities.

Means have a bias-corrected and accelerated (BCa) bootstrap interval (Efron, "Better bootstrap
confidence intervals", JASA 1987); medians and percentiles the exact interval of the order
statistics (Conover, "Practical nonparametric statistics", 3rd edition, section 3.2), whose end does
not exist if there are too few runs; a share of successes Wilson's (JASA 1927). Two estimators or
sensors are compared by Wilcoxon's signed-rank test on the differences of the same seeds, corrected
for the number of comparisons by Holm (Scand. J. Statistics 1979).
"""

import functools
import math
from collections.abc import Sequence
from typing import Final, NamedTuple

import numpy as np

from imu_sim_ros.core.types import Array, Integers, Mask

CONFIDENCE: Final = 0.95
"""Confidence of all intervals."""
_Z: Final = 1.959963984540054
"""Quantile of the normal distribution for :data:`CONFIDENCE`."""
_RESAMPLES: Final = 4999
"""Number of bootstrap samples."""
_MAX_RESAMPLED: Final = 1000
"""Runs above which a mean has the normal interval, which the bootstrap's approaches."""
_CHUNK: Final = 1_000_000
"""Numbers drawn at a time, so that memory does not grow with the number of runs."""
_INFINITE: Final = 1e9
"""Finite stand-in for the infinite difference to a failed run."""
_MAX_PAIRS: Final = 1000
"""Pairs above which a million of their averages are drawn instead of all."""
_MAX_EXACT: Final = 50
"""Largest number of pairs for which the signed-rank distribution is exact."""
_CAMPAIGNS: Final = 4000
"""Number of simulated campaigns for the power of a test."""
_MAX_SEEDS: Final = 100_000
"""Largest number of seeds that is proposed."""
_MIN_PAIRS: Final = 6
"""Runs below which no interval is given; two-sided, Wilcoxon's test needs as many for 5 %."""


class ConfidenceInterval(NamedTuple):
    """A value with its 95 % confidence interval, in the unit of the value."""

    value: float | None
    """Estimate; None: there is none."""
    low: float | None
    """Lower end; None: it does not exist."""
    high: float | None
    """Upper end; None: it does not exist."""


def success(done: int, runs: int) -> ConfidenceInterval:
    """Return the share of runs that succeeded with Wilson's interval."""
    if not runs:
        return ConfidenceInterval(None, None, None)
    share, width = done / runs, 2.0 * (runs + _Z**2)
    centre = (2.0 * done + _Z**2) / width
    half = _Z * math.sqrt(4.0 * done * (1.0 - share) + _Z**2) / width
    low, high = centre - half if done else 0.0, centre + half if done < runs else 1.0
    return ConfidenceInterval(share, low, high)


def mean(values: Array) -> ConfidenceInterval:
    """Return the mean of values (n,) with its BCa bootstrap interval."""
    return means([values])[0]


def means(samples: Sequence[Array]) -> list[ConfidenceInterval]:
    """Return the mean of each sample (n,) with its interval: :func:`mean` of many.

    The resampling has a fixed seed: the same values give the same interval, and samples of one
    size are resampled together.
    """
    intervals = []
    by_size: dict[int, list[int]] = {}
    for k, values in enumerate(samples):
        n = len(values)
        average = float(np.mean(values)) if n else None
        ends: tuple[float | None, float | None] = None, None
        if average is not None and n >= _MIN_PAIRS:
            if np.ptp(values) == 0.0:
                ends = average, average
            elif n > _MAX_RESAMPLED:
                half = _Z * float(np.std(values, ddof=1)) / math.sqrt(n)
                ends = average - half, average + half
            else:
                by_size.setdefault(n, []).append(k)
        intervals.append(ConfidenceInterval(average, *ends))
    for numbers in by_size.values():
        bounds = _bootstrap(np.stack([samples[k] for k in numbers]))
        for k, low, high in zip(numbers, *bounds, strict=True):
            intervals[k] = ConfidenceInterval(intervals[k].value, float(low), float(high))
    return intervals


def _bootstrap(values: Array) -> tuple[Array, Array]:
    """Return the ends of the intervals of the means of rows (k, n).

    Efron and Tibshirani, "An introduction to the bootstrap", 1993, equations 14.9 to 14.15, as
    ``scipy.stats.bootstrap``, which has the same numbers and is slow to import.
    """
    from scipy.special import ndtr, ndtri

    n, average = values.shape[1], values.mean(axis=1)
    rng, at_once = np.random.RandomState(20_240_611), max(_CHUNK // values.size, 1)
    drawn = np.concatenate(
        [
            values[:, rng.randint(0, n, (min(at_once, _RESAMPLES - start), n))].mean(axis=-1)
            for start in range(0, _RESAMPLES, at_once)
        ],
        axis=-1,
    )
    ranks = np.sum(drawn < average[:, None], axis=1) + np.sum(drawn <= average[:, None], axis=1)
    # Values that differ by rounding alone: their average may lie beyond all means that are drawn.
    bias = ndtri(np.clip(ranks, 1, 2 * _RESAMPLES - 1) / (2.0 * _RESAMPLES))
    deviation = values - average[:, None]  # those of the jackknife are in proportion to them
    deviation /= np.max(np.abs(deviation), axis=1, keepdims=True)  # small ones have squares of 0
    acceleration = np.sum(deviation**3, axis=1) / (6.0 * np.sum(deviation**2, axis=1) ** 1.5)

    def end(quantile: float) -> Array:
        shifted = bias + quantile
        share = ndtr(bias + shifted / (1.0 - acceleration * shifted))
        return np.array([np.quantile(row, p) for row, p in zip(drawn, share, strict=True)])

    return end(-_Z), end(_Z)


@functools.cache  # a summary asks for few pairs, thousands of times
def _ranks(n: int, p: float) -> tuple[int, int]:
    """Return the ranks, from 1, of the ends of the interval of the p quantile of n values.

    ``P(B < low) <= 0.025`` and ``P(B >= high) <= 0.025`` for a binomial B of n trials with
    probability p; 0 or n + 1 if there is none.
    """
    from scipy.special import bdtr

    tail = 0.5 * (1.0 - CONFIDENCE)
    cdf = bdtr(np.arange(n), n, p)  # P(B <= k)
    low = int(np.searchsorted(cdf, tail, side="right"))  # P(B <= rank - 1) <= tail
    return low, int(np.searchsorted(cdf, 1.0 - tail)) + 1  # P(B <= rank - 1) >= 1 - tail


def quantile(values: Array, p: float) -> ConfidenceInterval:
    """Return a quantile of values (n,), 0 < p < 1, with the interval of the order statistics.

    An end without a rank (:func:`_ranks`) is None.
    """
    if not len(values):
        return ConfidenceInterval(None, None, None)
    n, ordered = len(values), np.sort(values)
    value = float(np.quantile(ordered, p))
    low_rank, high_rank = _ranks(n, p)
    return ConfidenceInterval(
        value,
        float(ordered[low_rank - 1]) if low_rank >= 1 else None,
        float(ordered[high_rank - 1]) if high_rank <= n else None,
    )


def statistic(values: Array, name: str) -> ConfidenceInterval:
    """Return ``median``, ``mean``, ``min``, ``max`` or a percentile such as ``p95``."""
    if name == "mean":
        return mean(values)
    if name in ("min", "max"):
        extreme = np.min if name == "min" else np.max
        value = float(extreme(values)) if len(values) else None
        return ConfidenceInterval(value, None, None)
    return quantile(values, 0.5 if name == "median" else float(name[1:]) / 100.0)


def wins(a: Array, b: Array) -> tuple[int, int, int]:
    """Return the numbers of pairs in which a is smaller, larger, and equal."""
    smaller, larger = int(np.sum(a < b)), int(np.sum(a > b))
    return smaller, larger, len(a) - smaller - larger


def share_difference(
    a: Mask, b: Mask, comparisons: int = 1
) -> tuple[ConfidenceInterval, float | None]:
    """Return by how much the share of successes of A exceeds that of B on the same seeds.

    The interval is Bonett and Price's (British J. Math. Stat. Psychology 65, 2012, 479-488), p is
    McNemar's exact one, two-sided; None if so few pairs differ that it cannot fall below 5 %.

    :param a: (n,) success of A.
    :param b: (n,) success of B on the same seeds.
    :param comparisons: number of simultaneous comparisons, by which 5 % are divided.
    """
    from scipy.special import bdtr, ndtri

    n, only_a, only_b = len(a), int(np.sum(a & ~b)), int(np.sum(b & ~a))
    if not n:
        return ConfidenceInterval(None, None, None), None
    gain, loss = (only_a + 1) / (n + 2), (only_b + 1) / (n + 2)
    z = -float(ndtri(0.5 * (1.0 - CONFIDENCE) / comparisons))
    half = z * math.sqrt((gain + loss - (gain - loss) ** 2) / (n + 2))
    low, high = max(gain - loss - half, -1.0), min(gain - loss + half, 1.0)
    p, unequal = None, only_a + only_b
    if unequal >= _MIN_PAIRS:
        p = min(2.0 * float(bdtr(min(only_a, only_b), unequal, 0.5)), 1.0)
    return ConfidenceInterval((only_a - only_b) / n, low, high), p


class Shift(NamedTuple):
    """Distance of paired differences from zero."""

    centre: ConfidenceInterval
    """Hodges-Lehmann estimate with its 95 % interval; an end is None if it is infinite or if
    too few pairs support it."""
    sign: int
    """Sign of the centre, which may be infinite."""
    p: float | None
    """p-value of Wilcoxon's signed-rank test, two-sided; None for fewer than six pairs."""
    p_beyond: float | None
    """p-value of the hypothesis that the centre lies within the margin, by the same test."""
    simultaneous: ConfidenceInterval
    """The centre with the interval that has 95 % for all comparisons at once (Bonferroni)."""


NO_SHIFT: Final = Shift(
    centre=ConfidenceInterval(None, None, None),
    sign=0,
    p=None,
    p_beyond=None,
    simultaneous=ConfidenceInterval(None, None, None),
)
"""Shift of an empty set of differences."""


def shift(differences: Array, margin: float = 0.0, comparisons: int = 1) -> Shift:
    """Return how far paired differences (n,) lie from zero, and whether beyond a margin.

    The centre is the median of the Walsh averages ``(d_i + d_j) / 2``, i <= j, and its interval
    ends with those averages that the signed-rank test does not refuse (Hollander, Wolfe and
    Chicken, "Nonparametric statistical methods", 3rd edition, sections 3.1 to 3.3): it excludes
    zero if the test finds a difference. Infinite differences are larger than any other.

    :param comparisons: number of comparisons; ``simultaneous`` has the level 1 - 5 % / number.
    """
    n = len(differences)
    if not n:
        return NO_SHIFT
    d = np.clip(differences, -_INFINITE, _INFINITE)
    if n <= _MAX_PAIRS:
        i, j = np.triu_indices(n)
    else:
        i, j = np.random.default_rng(20_240_611).integers(0, n, (2, _CHUNK))
    averages = np.sort(0.5 * (d[i] + d[j]))
    middle = float(np.median(averages))

    def interval(level: float) -> ConfidenceInterval:
        rank = signed_rank_limit(n, 0.5 * level)
        if rank is None:
            return ConfidenceInterval(_finite(middle), None, None)
        # The average of rank + 1; a drawn part has a proportional position.
        position = rank if n <= _MAX_PAIRS else rank * len(averages) // (n * (n + 1) // 2)
        ends = averages[position], averages[-1 - position]
        return ConfidenceInterval(_finite(middle), *(_finite(float(end)) for end in ends))

    centre = interval(1.0 - CONFIDENCE)
    together = interval((1.0 - CONFIDENCE) / comparisons)
    if n < _MIN_PAIRS:
        return Shift(
            centre=centre, sign=int(np.sign(middle)), p=None, p_beyond=None, simultaneous=together
        )
    beyond = min(_tails(d - margin)[1], _tails(d + margin)[0])
    return Shift(
        centre=centre,
        sign=int(np.sign(middle)),
        p=min(2.0 * min(_tails(d)), 1.0),
        p_beyond=min(2.0 * beyond, 1.0),
        simultaneous=together,
    )


def non_inferior(differences: Array, margin: float) -> bool:
    """Return whether paired differences (n,) are proven to lie below a margin.

    By the signed-rank test, one-sided at 2.5 %: the upper end of the 95 % interval of
    :func:`shift` lies below the margin.
    """
    d = np.clip(differences, -_INFINITE, _INFINITE)
    return len(d) > 0 and _tails(d - margin)[0] < 0.5 * (1.0 - CONFIDENCE)


def _finite(value: float) -> float | None:
    """Return None for an average that contains an infinite difference."""
    return value if abs(value) < 0.1 * _INFINITE else None


def _tails(d: Array) -> tuple[float, float]:
    """Return the probabilities of at most, and at least, the observed sum of positive ranks.

    Up to 50 differences, the distribution is exact, also for tied ranks: twice a mean rank is
    whole.
    """
    from scipy.special import ndtr

    d = d[d != 0.0]
    if not len(d):
        return 1.0, 1.0
    ranks = _mean_ranks(np.abs(d))
    positive_sum = ranks[d > 0.0].sum()
    if len(d) > _MAX_EXACT:
        z = (positive_sum - 0.5 * ranks.sum()) / math.sqrt(0.25 * np.sum(ranks**2))
        return float(ndtr(z)), float(ndtr(-z))
    chance = _rank_sums(tuple((2.0 * np.sort(ranks)).astype(int)))
    count = round(2.0 * positive_sum)
    return float(chance[: count + 1].sum()), float(chance[count:].sum())


def _mean_ranks(values: Array) -> Array:
    """Return the ranks of values (n,) from 1; equal values share the mean of theirs."""
    _, value_index, counts = np.unique(values, return_inverse=True, return_counts=True)
    ranks: Array = (np.cumsum(counts) - 0.5 * (counts - 1))[value_index]
    return ranks


@functools.lru_cache(maxsize=256)
def _rank_sums(ranks: tuple[int, ...]) -> Array:
    """Return the distribution of the sum of ranks, each included with probability 1/2."""
    chance = np.zeros(sum(ranks) + 1)
    chance[0] = 1.0
    for rank in ranks:
        chance[rank:] = 0.5 * (chance[rank:] + chance[: len(chance) - rank])
        chance[:rank] *= 0.5
    return chance


def signed_rank_limit(n: int, tail: float) -> int | None:
    """Return the largest sum of positive ranks of n pairs that has a chance of at most ``tail``.

    None: there is none; smaller sums are as unlikely.
    """
    if n <= _MAX_EXACT:
        count = int(np.searchsorted(np.cumsum(_rank_sums(tuple(range(1, n + 1)))), tail, "right"))
    else:
        from scipy.special import ndtri

        deviation = math.sqrt(n * (n + 1) * (2 * n + 1) / 24.0)
        count = math.floor(n * (n + 1) / 4.0 + ndtri(tail) * deviation) + 1
    return count - 1 if count else None


def power(pairs: int, difference: float, scatter: float, margin: float, comparisons: int) -> float:
    """Return the chance to find a relative difference on n seeds, from 4000 campaigns.

    :param difference: 0.1 for 10 %.
    :param scatter: standard deviation of the logarithm of the ratio on a seed; common
            variations cancel.
    :param margin: smallest relative difference that counts, 0.02 for 2 %.
    :param comparisons: number of simultaneous comparisons, by which the level of 5 % is divided.
    """
    limit = signed_rank_limit(pairs, 0.5 * (1.0 - CONFIDENCE) / comparisons)
    if limit is None:
        return 0.0
    distance = math.log1p(difference) - math.log1p(margin)
    rng, detections = np.random.default_rng(20_240_611), 0
    at_once = max(_CHUNK // pairs, 1)
    for start in range(0, _CAMPAIGNS, at_once):
        d = rng.standard_normal((min(at_once, _CAMPAIGNS - start), pairs))
        d = distance + scatter * d
        ranks = np.argsort(np.argsort(np.abs(d), axis=1), axis=1) + 1
        detections += int(np.sum(np.sum(ranks * (d < 0.0), axis=1) <= limit))
    return detections / _CAMPAIGNS


def seeds_for_power(
    target: float, difference: float, scatter: float, margin: float, comparisons: int
) -> int | None:
    """Return the smallest number of seeds with a target :func:`power`; None: more than 100,000.

    :param target: chance to find the difference, 0 to 1. Other arguments as for :func:`power`.
    """
    low, high = 0, 8
    while power(high, difference, scatter, margin, comparisons) < target:
        low, high = high, 2 * high
        if high > _MAX_SEEDS:
            return None
    while high - low > max(high // 100, 1):
        middle = (low + high) // 2
        if power(middle, difference, scatter, margin, comparisons) < target:
            low = middle
        else:
            high = middle
    return high


def holm(p_values: Sequence[float | None]) -> list[float | None]:
    """Return p values corrected for their number (Holm's step-down)."""
    tested = [(p, k) for k, p in enumerate(p_values) if p is not None]
    corrected: list[float | None] = [None] * len(p_values)
    largest = 0.0
    for rank, (p, k) in enumerate(sorted(tested)):
        largest = max(largest, min(1.0, p * (len(tested) - rank)))
        corrected[k] = largest
    return corrected


class Sensitivity(NamedTuple):
    """Slope of the logarithm of an error over the logarithm of a parameter."""

    slope: ConfidenceInterval
    runs: int


def sensitivity(parameter: Array, error: Array, seed: Integers) -> Sensitivity | None:
    """Return ``d log(error) / d log(parameter)``; None if it cannot be determined.

    The runs of one seed share their random numbers, so that a slope is fitted for each seed, and
    the interval is Student's of their mean.

    :param parameter: (n,) positive values of the parameter.
    :param error: (n,) errors; rows that are not positive are left out.
    :param seed: (n,) seeds.
    """
    from scipy.special import stdtrit

    usable = (parameter > 0) & (error > 0)
    x, y, seed = np.log(parameter[usable]), np.log(error[usable]), seed[usable]
    slopes = []
    for seed_value in np.unique(seed):
        rows = seed == seed_value
        spread = x[rows] - x[rows].mean()
        if np.any(spread):
            slopes.append(float(spread @ y[rows] / (spread @ spread)))
    if len(slopes) < 2:
        return None
    centre = float(np.mean(slopes))
    half = float(np.std(slopes, ddof=1)) / math.sqrt(len(slopes))
    half *= float(stdtrit(len(slopes) - 1, 0.5 * (1.0 + CONFIDENCE)))
    return Sensitivity(ConfidenceInterval(centre, centre - half, centre + half), int(usable.sum()))
