# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Maximum likelihood of variance components on a spectrum, many fits at once.

The rows of a :class:`~imu_sim_ros.calibration.noise.spectrum.Spectrum` are independent means of
squared normal variables, so that minus the log-likelihood of an expectation ``s = A theta`` with
``theta >= 0`` is ``sum nu / 2 (ln s + P / s)`` (Whittle 1953; exact for white noise with a random
walk). Iteratively reweighted non-negative least squares is Fisher's scoring for it.

A trend (the rate ramp) moves the mean of the single coefficients. If it is not of interest it is
integrated out ("restricted likelihood", Patterson and Thompson, Biometrika 58, 1971): with
``G = sum t^2 / s`` that adds ``ln(G) / 2``, and to each row what its own slope's error hides,
``t^2 / G``. Without it a walk seen by few coefficients comes out too small.
"""

from collections.abc import Callable
from itertools import product
from typing import Final, NamedTuple

import numpy as np

from imu_sim_ros.types import Array, Mask

CONFIDENCE_DROP: Final = 1.9207
"""Drop of the log-likelihood at the ends of a 95 % interval: half of chi-square(1, 0.95)."""
_FLOOR: Final = 1e-15
"""Smallest expectation, relative to the largest row: a model may lack all terms."""
_ITERATIONS: Final = 60
_HALVINGS: Final = 12
_ROUNDING: Final = 1e-7
"""Loss of the log-likelihood that does not justify halving a step."""
_TOLERANCE: Final = 1e-5
"""Gain of the log-likelihood below which an iteration is the last."""
_NEGATIVE: Final = 1e-12
"""Scaled component below zero that is rounding."""


class Data(NamedTuple):
    """The data that a model is compared with, for one axis."""

    power: Array
    """(m,) averaged squared coefficients."""
    freedom: Array
    """(m,) squared coefficients in each average."""
    amplitude: Array
    """(m,) single coefficients with their sign, 0 elsewhere."""
    trend: Array
    """(m,) addition to ``amplitude`` of a trend of 1."""


class Fits(NamedTuple):
    """Results of b fits to the same data."""

    components: Array
    """(b, p) squares of the terms' coefficients."""
    slope: Array
    """(b,) trend."""
    objective: Array
    """(b,) minus the log-likelihood, without its constant."""
    expected: Array
    """(b, m) fitted rows."""

    @property
    def lowest(self) -> float:
        """The smallest objective."""
        return float(np.min(self.objective))

    def best(self) -> "Fits":
        """Return the most likely one alone."""
        k = int(np.argmin(self.objective))
        return Fits(*(column[k : k + 1] for column in self))


class _Trend(NamedTuple):
    """How the trend is treated in each of b fits."""

    held: Array
    """(b,) slope, NaN if it is estimated."""
    restricted: bool
    """Whether an estimated slope is integrated out."""


def fit_many(
    data: Data,
    design: Array,
    held: Array,
    *,
    slope: Array,
    guess: Array,
    restricted: bool = False,
) -> Fits:
    """Return the non-negative components that make the data most likely, b times.

    :param design: (m, p) expectation of the rows for each component.
    :param held: (b, p) components with a given value; NaN if a component is free.
    :param slope: (b,) given slope of the trend; NaN if it is estimated.
    :param guess: (b, m) first guess of the expectation.
    :param restricted: integrate the estimated slopes out instead of maximising over them.
    """
    floor = _FLOOR * float(np.max(data.power)) + 1e-300
    scale = 1.0 / np.max(design, axis=0)
    scaled = design * scale
    free = np.isnan(held)
    theta = np.where(free, 0.0, held / scale)
    known = theta @ scaled.T
    products = (scaled[:, :, None] * scaled[:, None, :]).reshape(len(scaled), -1)
    trend = _Trend(slope, restricted)
    expected = np.maximum(guess, floor)
    objective = np.full(len(held), np.inf)
    _, power, slopes = _objective(data, expected, trend)
    for _ in range(_ITERATIONS):
        weight = 0.5 * data.freedom / expected**2
        curvature = (weight @ products).reshape(-1, *free.shape[1:], free.shape[1])
        gradient = (weight * (power - known)) @ scaled
        step = np.where(free, _non_negative(curvature, gradient, free) - theta, 0.0)
        last = objective
        fraction = np.ones(len(held))
        for _ in range(_HALVINGS):  # the first step of all is taken as it is
            trial = theta + fraction[:, None] * step
            expected = np.maximum(trial @ scaled.T, floor)
            objective, power, slopes = _objective(data, expected, trend)
            worse = ~(objective <= last + _ROUNDING)
            if not worse.any():
                break
            fraction = np.where(worse, 0.4 * fraction, fraction)
        theta = trial
        if np.all(last - objective < _TOLERANCE):
            break
    return Fits(theta * scale, slopes, objective, expected)


def _objective(data: Data, expected: Array, trend: _Trend) -> tuple[Array, Array, Array]:
    """Return the objective (b,), the rows that it compares with (b, m), and the slopes (b,)."""
    inverse = 1.0 / expected
    weighted = data.trend * inverse
    norm = np.maximum(weighted @ data.trend, 1e-300)
    estimated = np.isnan(trend.held)
    slopes = np.where(estimated, (weighted @ data.amplitude) / norm, trend.held)
    power = _without_trend(data, slopes)
    objective = 0.5 * ((np.log(expected) + power * inverse) @ data.freedom)
    if trend.restricted:
        objective = objective + np.where(estimated, 0.5 * np.log(norm), 0.0)
        power = power + np.where(estimated, 1.0 / norm, 0.0)[:, None] * data.trend**2
    return objective, power, slopes


def _without_trend(data: Data, slopes: Array) -> Array:
    """Return the rows (b, m) after trends are taken from the single coefficients."""
    single = data.amplitude != 0.0
    left = (data.amplitude - slopes[:, None] * data.trend) ** 2
    return np.where(single, left, data.power)


def _non_negative(curvature: Array, gradient: Array, free: Mask) -> Array:
    """Return (b, p) the minima of ``x H x / 2 - g x`` with x >= 0 and x = 0 if not free.

    If the minimum without the bound is feasible it is the solution. Elsewhere every subset of
    the few components is solved without the bound; the best feasible one is the solution.
    """
    size = gradient.shape[1]
    if size == 0:
        return gradient
    root = np.sqrt(np.einsum("bii->bi", curvature))
    scaled = curvature / (root[:, :, None] * root[:, None, :])
    right: Array = free * (gradient / root)
    x: Array = _restricted_minima(scaled, right, free[:, None, :].astype(np.float64))[:, 0]
    bound = np.flatnonzero((x < -_NEGATIVE).any(axis=1))
    if len(bound):
        subsets = np.array(list(product([0.0, 1.0], repeat=size)))
        inside = subsets * free[bound, None, :]  # (b, 2^p, p)
        minima = _restricted_minima(scaled[bound], right[bound], inside)
        value = -0.5 * np.sum(minima * inside * right[bound, None, :], axis=2)
        value = np.where((minima >= -_NEGATIVE).all(axis=2), value, np.inf)
        x[bound] = minima[np.arange(len(bound)), np.argmin(value, axis=1)]
    return np.maximum(x, 0.0) / root


def _restricted_minima(curvature: Array, gradient: Array, inside: Array) -> Array:
    """Return (b, s, p) the minima over s subsets of components, the others 0.

    :param inside: (b, s, p) 1 for components of the subset.
    """
    outside = np.eye(inside.shape[2]) * (1.0 - inside + 1e-12)[..., None]
    blocks = curvature[:, None] * (inside[..., :, None] * inside[..., None, :]) + outside
    right: Array = inside * gradient[:, None, :]
    return np.asarray(np.linalg.solve(blocks, right[..., None])[..., 0], dtype=np.float64)


def first_guesses(data: Data) -> Array:
    """Return (2, m) where to start: rows smoothed by running medians, and a flat line.

    A walk and a trend explain each other away: from the first guess the walk has the first chance,
    from the second the trend.
    """
    width = min(9, len(data.power))
    padded = np.pad(data.power, (width // 2, width - 1 - width // 2), mode="edge")
    smooth = np.median(np.lib.stride_tricks.sliding_window_view(padded, width), axis=1)
    return np.stack([smooth, np.full(len(smooth), np.median(smooth))])


def fit(
    data: Data,
    design: Array,
    *,
    trend: bool = False,
    restricted: bool = False,
    held: Array | None = None,
) -> Fits:
    """Return the one best fit.

    :param trend: whether a trend is estimated as well.
    :param restricted: integrate the trend out.
    :param held: (p,) components with a given value, NaN if free; None: all are free.
    """
    guesses = first_guesses(data)
    given = np.full(design.shape[1], np.nan) if held is None else held
    slope = np.full(len(guesses), np.nan if trend else 0.0)
    held_twice = np.tile(given, (len(guesses), 1))
    fits = fit_many(data, design, held_twice, slope=slope, guess=guesses, restricted=restricted)
    return fits.best()


def covariance(data: Data, design: Array, expected: Array) -> Array:
    """Return (p, p) the inverse of Fisher's information on the components.

    :param expected: (m,) rows.
    """
    information = design.T @ ((0.5 * data.freedom / expected**2)[:, None] * design)
    root = np.sqrt(np.diag(information))
    scaled = information / np.outer(root, root) + 1e-9 * np.eye(len(root))
    return np.linalg.inv(scaled) / np.outer(root, root)


def merged(data: Data, design: Array, every: int) -> tuple[Data, Array]:
    """Return the data and the design with each few rows of averages as one.

    :param every: rows that become one.
    """
    single = data.amplitude != 0.0
    rows = np.flatnonzero(~single)
    if len(rows) == 0:
        return data, design
    starts = np.arange(0, len(rows), every)
    freedom = np.add.reduceat(data.freedom[rows], starts)

    def means(values: Array) -> Array:
        weighted = (values[rows].T * data.freedom[rows]).T
        sums = np.add.reduceat(weighted, starts, axis=0)
        return np.concatenate([values[single], (sums.T / freedom).T])

    zeros = np.zeros(len(starts))
    return Data(
        means(data.power),
        np.concatenate([data.freedom[single], freedom]),
        np.concatenate([data.amplitude[single], zeros]),
        np.concatenate([data.trend[single], zeros]),
    ), means(design)


def profile_interval(
    profile: Callable[[float], float], best: float, lowest: float, step: float
) -> tuple[float, float]:
    """Return where a profile of minus the log-likelihood has risen by the confidence drop.

    :param profile: objective with the parameter held at a value >= 0, minimised over all others.
    :param best: the estimate, >= 0.
    :param lowest: objective at the estimate.
    :param step: first guess of the distance to either end, > 0.
    :returns: the interval; its lower end is 0 if zero cannot be excluded.
    """
    limit = lowest + CONFIDENCE_DROP

    def excess(value: float) -> float:
        return profile(value) - limit

    below, above = _outside(excess, best, -step), _outside(excess, best, step)
    low = _root(excess, below, best) if below > 0.0 or excess(0.0) > 0.0 else 0.0
    return low, _root(excess, best, above)


def _outside(excess: Callable[[float], float], best: float, step: float) -> float:
    """Return a value on one side of the best where the excess is positive, or 0."""
    for _ in range(60):
        value = best + step
        if value <= 0.0 or excess(value) > 0.0:
            break
        step *= 2.0
    return max(value, 0.0)


def _root(
    excess: Callable[[float], float], low: float, high: float, tolerance: float = 1e-4
) -> float:
    from scipy.optimize import brentq

    if excess(low) * excess(high) >= 0.0:  # a plateau within rounding
        return low if abs(excess(low)) < abs(excess(high)) else high
    return float(brentq(excess, low, high, xtol=tolerance * (high - low), rtol=1e-8))
