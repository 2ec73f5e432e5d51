# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Ends of 95 % intervals by the profile likelihood over all non-negative terms.

For each end the term is held at a value and all the others are free to stand for it; the end is
where the log-likelihood has dropped by half of chi-square's quantile. So a term that others can
stand for gets a wide interval, or only a bound, and nothing hangs on a choice of terms. All ends
are searched at once, in batches of fits.
"""

from typing import Final, NamedTuple

import numpy as np

from imu_sim_ros.calibration.noise.likelihood import (
    CONFIDENCE_DROP,
    Data,
    Fits,
    covariance,
    fit,
    fit_many,
    merged,
)
from imu_sim_ros.types import Array, Integers

_MERGED: Final = 5
"""Rows of averages that become one: a tenth of the frequency, which no term's slope can feel."""
_DOUBLINGS: Final = 40
_REFINEMENTS: Final = 9
_CLOSE: Final = 0.004
"""Relative error of the drop's root at which an end is found."""


class Interval(NamedTuple):
    """A coefficient with its 95 % interval; ``low`` is 0 if zero cannot be excluded."""

    value: float
    low: float
    high: float


class _Problem(NamedTuple):
    """The full model and its best fits."""

    data: Data
    design: Array
    best: Fits
    """Slope integrated out: for the components."""
    trended: Fits
    """Slope estimated: for the slope."""


class _Ends(NamedTuple):
    """The b ends that are searched, as coefficients: root of a component, or the slope."""

    term: Integers
    """(b,) component, or -1 for the slope."""
    best: Array
    """(b,) the estimate."""
    step: Array
    """(b,) signed first guess of the way to the end."""
    drop: Array
    """(b,)"""


def intervals(data: Data, design: Array, *, trend: bool) -> tuple[list[Interval], Interval | None]:
    """Return the intervals of all components' coefficients, and of the slope's size.

    :param design: (m, p) expectation of the rows for each component.
    :param trend: whether there may be a trend.
    """
    data, design = merged(data, design, _MERGED)
    best = fit(data, design, trend=trend, restricted=True)
    trended = fit(data, design, trend=True) if trend else best
    problem = _Problem(data, design, best, trended)
    ends = _component_ends(problem)
    if trend:
        both = zip(ends, _slope_ends(problem), strict=True)
        ends = _Ends(*(np.concatenate(pair) for pair in both))
    found = _search(problem, ends)
    count = design.shape[1]
    values = np.sqrt(best.components[0])
    components = [
        Interval(float(v), float(low), float(high))
        for v, low, high in zip(values, found[:count], found[count : 2 * count], strict=True)
    ]
    if not trend:
        return components, None
    return components, _size(float(trended.slope[0]), float(found[-2]), float(found[-1]))


def _size(slope: float, one: float, other: float) -> Interval:
    """Return the interval of a slope's size from the two ends of the slope."""
    crosses = one <= 0.0 <= other
    low = 0.0 if crosses else min(abs(one), abs(other))
    return Interval(abs(slope), low, max(abs(one), abs(other)))


def _component_ends(problem: _Problem) -> _Ends:
    components, expected = problem.best.components[0], problem.best.expected[0]
    root = np.sqrt(components)
    spread = np.sqrt(np.diag(covariance(problem.data, problem.design, expected)))
    above = np.sqrt(components + 2.0 * spread) - root
    below = root - np.sqrt(np.maximum(components - 2.0 * spread, 0.0))
    # If the estimate is zero its low end is zero, too: any step will do.
    below = np.where(below > 0.0, below, above)
    count = len(components)
    return _Ends(
        np.tile(np.arange(count), 2),
        np.tile(root, 2),
        np.concatenate([-below, above]),
        np.full(2 * count, CONFIDENCE_DROP),
    )


def _slope_ends(problem: _Problem) -> _Ends:
    """Return the ends of the slope.

    What the slope is measured against is known from few coefficients if a walk prevails, so that
    it has Student's distribution: with nu degrees of freedom the drop at the quantile t is
    ``(nu + 1) / 2 ln(1 + t^2 / nu)``.
    """
    from scipy.special import stdtrit  # scipy.stats has t.ppf and takes 0.5 s to import

    data, expected = problem.data, problem.trended.expected[0]
    information = data.trend**2 / expected
    spread = 1.0 / np.sqrt(max(float(np.sum(information)), 1e-300))
    row = (information / expected / np.sum(information)) @ problem.design
    relative = float(row @ covariance(data, problem.design, expected) @ row)
    freedom = max(2.0 / relative, 1.0)
    quantile = float(stdtrit(freedom, 0.975))
    drop = 0.5 * (freedom + 1.0) * np.log1p(quantile**2 / freedom)
    slope = float(problem.trended.slope[0])
    return _Ends(
        np.array([-1, -1]),
        np.array([slope, slope]),
        2.0 * spread * np.array([-1.0, 1.0]),
        np.array([drop, drop]),
    )


def _root_of_drop(problem: _Problem, ends: _Ends, x: Array) -> Array:
    """Return (b,) the root of the drop at coefficients x over that at the end, minus 1."""
    data, design, best, trended = problem
    rows = np.arange(len(x))
    is_slope = ends.term < 0
    held = np.full((len(x), design.shape[1]), np.nan)
    held[rows[~is_slope], ends.term[~is_slope]] = x[~is_slope] ** 2
    slope = np.where(is_slope, x, np.nan if trended is not best else 0.0)
    own = np.where(is_slope, 0, ends.term)
    change = np.where(is_slope, 0.0, x**2 - best.components[0, own])
    guess = np.maximum(best.expected + change[:, None] * design[:, own].T, 1e-3 * best.expected)
    restricted = trended is not best
    found = fit_many(data, design, held, slope=slope, guess=guess, restricted=restricted)
    lowest = np.where(is_slope, trended.objective[0], best.objective[0])
    drop = np.maximum(found.objective - lowest, 0.0)
    return np.sqrt(drop / ends.drop) - 1.0


def _search(problem: _Problem, ends: _Ends) -> Array:
    """Return (b,) the coefficients where the drop is reached, by bracketed secants.

    The root of the drop is nearly linear in the coefficient, so that few steps suffice.
    """
    bounded = (ends.term >= 0) & (ends.step < 0.0)  # a coefficient's low end is at least 0
    inside, inside_value = ends.best.copy(), np.full(len(ends.best), -1.0)
    outside = ends.best + ends.step
    outside = np.where(bounded, np.maximum(outside, 0.0), outside)
    outside_value = _root_of_drop(problem, ends, outside)
    for _ in range(_DOUBLINGS):
        go = (outside_value < 0.0) & ~(bounded & (outside <= 0.0))
        if not go.any():
            break
        inside = np.where(go, outside, inside)
        inside_value = np.where(go, outside_value, inside_value)
        further = ends.best + 2.0 * (outside - ends.best)
        further = np.where(bounded, np.maximum(further, 0.0), further)
        outside = np.where(go, further, outside)
        outside_value = np.where(go, _root_of_drop(problem, ends, outside), outside_value)
    at_zero = bounded & (outside_value < 0.0)
    open_ends = np.flatnonzero(~at_zero)
    for _ in range(_REFINEMENTS):
        if not len(open_ends):
            break
        k, low, high = open_ends, inside_value[open_ends], outside_value[open_ends]
        share = np.clip(low / np.minimum(low - high, -1e-9), 0.02, 0.98)
        x = inside[k] + share * (outside[k] - inside[k])
        some = _Ends(ends.term[k], ends.best[k], ends.step[k], ends.drop[k])
        value = _root_of_drop(problem, some, x)
        within = value < 0.0
        inside[k], inside_value[k] = np.where(within, (x, value), (inside[k], low))
        outside[k], outside_value[k] = np.where(within, (outside[k], high), (x, value))
        open_ends = k[np.abs(value) >= _CLOSE]
    nearer = np.where(np.abs(inside_value) < np.abs(outside_value), inside, outside)
    return np.where(at_zero, 0.0, nearer)
