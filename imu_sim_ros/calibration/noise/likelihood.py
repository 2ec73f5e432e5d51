# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Maximum likelihood of variance components on a spectrum, with intervals, many fits at once.

The rows of a :class:`~imu_sim_ros.calibration.noise.spectrum.Spectrum` are independent means of
squared normal variables, so that minus the log-likelihood of an expectation ``s = A theta`` with
``theta >= 0`` is ``sum nu / 2 (ln s + P / s)`` (Whittle 1953; exact for white noise with a random
walk). Iteratively reweighted non-negative least squares is Fisher's scoring for it.

A trend (the rate ramp) moves the mean of the single coefficients. If it is not of interest it is
integrated out ("restricted likelihood", Patterson and Thompson, Biometrika 58, 1971): with
``G = sum t^2 / s`` that adds ``ln(G) / 2``, and to each row what its own slope's error hides,
``t^2 / G``. Without it a walk seen by few coefficients comes out too small.

The ends of 95 % intervals are those of the profile likelihood over all non-negative terms. For each
end the term is held at a value and all the others are free to stand for it; the end is where the
log-likelihood has dropped by half of chi-square's quantile. So a term that others can stand for
gets a wide interval, or only a bound, and nothing hangs on a choice of terms. All ends are searched
at once, in batches of fits.
"""

from collections.abc import Callable
from dataclasses import dataclass
from functools import cache, cached_property
from itertools import product
from typing import Final, NamedTuple

import numpy as np

from imu_sim_ros.core.types import Array, Integers, Mask

CONFIDENCE_DROP: Final = 1.9207
"""Drop of the log-likelihood at the ends of a 95 % interval: half of chi-square(1, 0.95)."""
_FLOOR: Final = 1e-15
"""Smallest expectation, relative to the largest row: a model may lack all terms."""
_ITERATIONS: Final = 60
"""Largest number of steps of Fisher's scoring."""
_HALVINGS: Final = 12
"""Largest number of times that a step is shortened."""
_ROUNDING: Final = 1e-7
"""Loss of the log-likelihood that does not justify halving a step."""
_TOLERANCE: Final = 1e-5
"""Gain of the log-likelihood below which an iteration is the last."""
_NEGATIVE: Final = 1e-12
"""Largest negative scaled component that counts as rounding."""
_MERGED: Final = 5
"""Number of rows of averages merged into one, a tenth of the frequency."""
_DOUBLINGS: Final = 40
"""Largest number of times that a step is doubled to bracket an end."""
_REFINEMENTS: Final = 9
"""Largest number of secant steps to an end."""
_CLOSE: Final = 0.004
"""Relative error of the drop's root at which the search for an end stops."""


@dataclass(frozen=True)
class Data:
    """The data that a model is compared with, for one axis."""

    power: Array
    """(m,) averaged squared coefficients."""
    freedom: Array
    """(m,) squared coefficients in each average."""
    amplitude: Array
    """(m,) single coefficients with their sign, 0 elsewhere."""
    trend: Array
    """(m,) addition to ``amplitude`` of a trend of 1."""

    def without_trend(self, slopes: Array) -> Array:
        """Return the rows (b, m) without trends of some slopes (b,)."""
        detrended = (self.amplitude - slopes[:, None] * self.trend) ** 2
        return np.where(self.amplitude != 0.0, detrended, self.power)

    @cached_property
    def first_guesses(self) -> Array:
        """(2, m) initial expectations: rows smoothed by running medians, and a flat line.

        A walk and a trend explain each other: the first start favours the walk, the second the
        trend.
        """
        width = min(9, len(self.power))
        padded = np.pad(self.power, (width // 2, width - 1 - width // 2), mode="edge")
        smooth = np.median(np.lib.stride_tricks.sliding_window_view(padded, width), axis=1)
        return np.stack([smooth, np.full(len(smooth), np.median(smooth))])


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


def fit_many(
    data: Data,
    design: Array,
    fixed: Array,
    *,
    slope: Array,
    guess: Array,
    restricted: bool = False,
) -> Fits:
    """Return the non-negative components that make the data most likely, b times.

    :param design: (m, p) expectation of the rows for each component, or (b, m, p) that of each fit.
    :param fixed: (b, p) components with a fixed value; NaN if a component is free.
    :param slope: (b,) given slope of the trend; NaN if it is estimated.
    :param guess: (b, m) first guess of the expectation.
    :param restricted: integrate the estimated slopes out instead of maximising over them.
    """
    floor = _FLOOR * float(np.max(data.power)) + 1e-300
    scale = 1.0 / np.max(design, axis=-2)
    scaled = design * scale[..., None, :]
    transposed = scaled.swapaxes(-1, -2)
    free = np.isnan(fixed)
    theta = np.where(free, 0.0, fixed / scale)
    fixed_part = _product(theta, transposed)
    products = (scaled[..., :, None] * scaled[..., None, :]).reshape(*scaled.shape[:-1], -1)
    half_freedom = 0.5 * data.freedom
    objective_of = _Objective(data, slope, restricted)
    expected = np.maximum(guess, floor)
    objective = np.full(len(fixed), np.inf)
    positive = free
    _, power, slopes = objective_of(expected)
    for _ in range(_ITERATIONS):
        weight = half_freedom / expected**2
        curvature = _product(weight, products).reshape(-1, *free.shape[1:], free.shape[1])
        gradient = _product(weight * (power - fixed_part), scaled)
        best = _non_negative(curvature, gradient, free, positive)
        step = np.where(free, best - theta, 0.0)
        previous = objective
        for _ in range(_HALVINGS):  # the very first step is taken in full
            trial = theta + step
            expected = np.maximum(_product(trial, transposed), floor)
            objective, power, slopes = objective_of(expected)
            better = objective <= previous + _ROUNDING
            if better.all():
                break
            step = np.where(better[:, None], step, 0.4 * step)
        theta, positive = trial, free & (trial > 0.0)
        if (previous - objective < _TOLERANCE).all():
            break
    return Fits(theta * scale, slopes, objective, expected)


def _product(rows: Array, matrix: Array) -> Array:
    """Return the product (b, n) of rows (b, k) and a matrix (k, n), or one for each (b, k, n)."""
    product = rows @ matrix if matrix.ndim == 2 else (rows[:, None, :] @ matrix)[:, 0]
    return np.asarray(product)


class _Objective:
    """Minus the log-likelihood of b expectations of the same data.

    What does not depend on the expectation is computed once.
    """

    def __init__(self, data: Data, slope: Array, restricted: bool) -> None:
        """Initialise with arguments of :func:`fit_many`."""
        self._data, self._slope = data, slope
        self._estimated = np.isnan(slope)
        self._any_estimated = bool(self._estimated.any())
        self._restricted = restricted
        if not self._any_estimated:
            self._power = data.without_trend(slope)

    def __call__(self, expected: Array) -> tuple[Array, Array, Array]:
        """Return the objective (b,), the rows that it compares with (b, m), and the slopes (b,).

        :param expected: (b, m) rows.
        """
        data, inverse = self._data, 1.0 / expected
        if not self._any_estimated:
            objective = 0.5 * ((np.log(expected) + self._power * inverse) @ data.freedom)
            return objective, self._power, self._slope
        weighted = data.trend * inverse
        norm = np.maximum(weighted @ data.trend, 1e-300)
        slopes = np.where(self._estimated, (weighted @ data.amplitude) / norm, self._slope)
        power = data.without_trend(slopes)
        objective = 0.5 * ((np.log(expected) + power * inverse) @ data.freedom)
        if self._restricted:
            objective = objective + np.where(self._estimated, 0.5 * np.log(norm), 0.0)
            hidden = np.where(self._estimated, 1.0 / norm, 0.0)
            power = power + hidden[:, None] * data.trend**2
        return objective, power, slopes


def _non_negative(curvature: Array, gradient: Array, free: Mask, positive: Mask) -> Array:
    """Return the minima (b, p) of ``x H x / 2 - g x`` with x >= 0 and x = 0 if not free.

    A minimum over some components is the solution if none of them is below zero, and no other one
    would make it smaller (Karush, Kuhn and Tucker). Elsewhere every subset of the few components
    is solved without the bound; the best feasible one is the solution.

    :param positive: (b, p) free components that are tried first.
    """
    size = gradient.shape[1]
    if size == 0:
        return gradient
    root = np.sqrt(curvature.diagonal(axis1=1, axis2=2))
    scaled = curvature / (root[:, :, None] * root[:, None, :])
    target: Array = free * (gradient / root)
    x: Array = _restricted_minima(scaled, target, positive[:, None, :].astype(np.float64))[:, 0]
    downwards = target - (scaled @ x[:, :, None])[:, :, 0] > _NEGATIVE
    violated = np.where(positive, x < -_NEGATIVE, free & downwards)
    if violated.any():
        bound = np.flatnonzero(violated.any(axis=1))
        subset_masks = _subsets(size) * free[bound, None, :]  # (b, 2^p, p)
        minima = _restricted_minima(scaled[bound], target[bound], subset_masks)
        value = -0.5 * (minima * subset_masks * target[bound, None, :]).sum(axis=2)
        value = np.where((minima >= -_NEGATIVE).all(axis=2), value, np.inf)
        x[bound] = minima[np.arange(len(bound)), np.argmin(value, axis=1)]
    return np.maximum(x, 0.0) / root


@cache
def _subsets(size: int) -> Array:
    """Return 1 for the components (2^p, p) in each subset of p, else 0."""
    return np.array(list(product([0.0, 1.0], repeat=size)))


def _restricted_minima(curvature: Array, gradient: Array, masks: Array) -> Array:
    """Return the minima (b, s, p) over s subsets of components, the others 0.

    :param masks: (b, s, p) 1 for components of the subset.
    """
    blocks = curvature[:, None] * (masks[..., :, None] * masks[..., None, :])
    blocks += np.eye(masks.shape[2]) * (1.0 - masks + 1e-12)[..., None]
    targets: Array = masks * gradient[:, None, :]
    return np.asarray(np.linalg.solve(blocks, targets[..., None])[..., 0], dtype=np.float64)


def fit(
    data: Data,
    design: Array,
    *,
    fixed: Array | None = None,
    slope: Array | float = 0.0,
    restricted: bool = False,
) -> Fits:
    """Return the best fit of each of k models: the better one of two first guesses.

    :param data: m rows of a spectrum.
    :param design: (m, p) expectation of the rows for each component, or (k, m, p) of each model.
    :param fixed: (k, p) components with a fixed value, NaN if free; None: all are free.
    :param slope: (k,) given slope of the trend, NaN if it is estimated; a number: that of all.
    :param restricted: integrate the trend out.
    """
    guesses = data.first_guesses
    has_design_by_model = design.ndim == 3
    shape = (len(design) if has_design_by_model else 1, design.shape[-1])
    fixed_by_model = np.full(shape, np.nan) if fixed is None else np.atleast_2d(fixed)
    count = len(fixed_by_model)
    # One fit for each guess and model: all models with the first guess come first.
    fits = fit_many(
        data,
        np.tile(design, (len(guesses), 1, 1)) if has_design_by_model else design,
        np.tile(fixed_by_model, (len(guesses), 1)),
        slope=np.tile(np.broadcast_to(slope, count), len(guesses)),
        guess=np.repeat(guesses, count, axis=0),
        restricted=restricted,
    )
    better = np.argmin(fits.objective.reshape(-1, count), axis=0)
    return Fits(*(column[better * count + np.arange(count)] for column in fits))


def covariance(data: Data, design: Array, expected: Array) -> Array:
    """Return the inverse (p, p) of Fisher's information on the components.

    :param expected: (m,) rows.
    """
    information = design.T @ ((0.5 * data.freedom / expected**2)[:, None] * design)
    root = np.sqrt(np.diag(information))
    scaled = information / np.outer(root, root) + 1e-9 * np.eye(len(root))
    return np.linalg.inv(scaled) / np.outer(root, root)


def merge_averages(data: Data, design: Array, count: int) -> tuple[Data, Array]:
    """Return data and design with neighbouring rows of averages merged; single coefficients stay.

    :param count: number of rows that become one.
    """
    single = data.amplitude != 0.0
    rows = np.flatnonzero(~single)
    if len(rows) == 0:
        return data, design
    starts = np.arange(0, len(rows), count)
    freedom = np.add.reduceat(data.freedom[rows], starts)
    columns = np.column_stack([data.power, design])
    sums = np.add.reduceat(columns[rows] * data.freedom[rows, None], starts, axis=0)
    columns = np.concatenate([columns[single], sums / freedom[:, None]])
    zeros = np.zeros(len(starts))
    return Data(
        columns[:, 0].copy(),
        np.concatenate([data.freedom[single], freedom]),
        np.concatenate([data.amplitude[single], zeros]),
        np.concatenate([data.trend[single], zeros]),
    ), columns[:, 1:].copy()


class Interval(NamedTuple):
    """A coefficient with its 95 % interval."""

    value: float
    """Estimate."""
    low: float
    """Lower end; 0 if zero cannot be excluded."""
    high: float
    """Upper end."""


def intervals(data: Data, design: Array, *, trend: bool) -> tuple[list[Interval], Interval | None]:
    """Return the intervals of all components' coefficients, and of the slope's size.

    What the slope is measured against is known from few coefficients if a walk prevails, so that
    it has Student's distribution: with nu degrees of freedom the drop at the quantile t is
    ``(nu + 1) / 2 ln(1 + t^2 / nu)``.

    :param design: (m, p) expectation of the rows for each component.
    :param trend: True if there may be a trend.
    """
    data, design = merge_averages(data, design, _MERGED)
    # The ends of each component's root: first all low ones, then all high ones.
    best = fit(data, design, slope=np.nan if trend else 0.0, restricted=True)
    components, expected, count = best.components[0], best.expected[0], design.shape[1]
    values = np.sqrt(components)
    spread = np.sqrt(np.diag(covariance(data, design, expected)))
    upper_step = np.sqrt(components + 2.0 * spread) - values
    lower_step = values - np.sqrt(np.maximum(components - 2.0 * spread, 0.0))
    # If the estimate is zero its low end is zero, too: any step will do.
    lower_step = np.where(lower_step > 0.0, lower_step, upper_step)
    term = np.tile(np.arange(count), 2)
    start, step = np.tile(values, 2), np.concatenate([-lower_step, upper_step])
    drop, lowest = np.full(2 * count, CONFIDENCE_DROP), np.full(2 * count, best.objective[0])
    slope = 0.0
    if trend:
        from scipy.special import stdtrit  # instead of t.ppf of scipy.stats: quick to import

        trended = fit(data, design, slope=np.nan)
        slope = float(trended.slope[0])
        information = data.trend**2 / trended.expected[0]
        spread_of_slope = 1.0 / np.sqrt(max(float(np.sum(information)), 1e-300))
        row = (information / trended.expected[0] / np.sum(information)) @ design
        relative = float(row @ covariance(data, design, trended.expected[0]) @ row)
        freedom = max(2.0 / relative, 1.0)
        quantile = float(stdtrit(freedom, 0.975))
        drop_of_slope = 0.5 * (freedom + 1.0) * np.log1p(quantile**2 / freedom)
        term = np.append(term, [-1, -1])
        start = np.append(start, [slope, slope])
        step = np.append(step, 2.0 * spread_of_slope * np.array([-1.0, 1.0]))
        drop = np.append(drop, [drop_of_slope, drop_of_slope])
        lowest = np.append(lowest, [trended.objective[0], trended.objective[0]])
    is_slope_end = term < 0

    def excess(ends: Integers, x: Array) -> Array:
        """Return ``sqrt(drop / target) - 1`` at coefficients x of the ends with some numbers."""
        is_slope, components_index = is_slope_end[ends], np.where(is_slope_end[ends], 0, term[ends])
        fixed = np.full((len(x), count), np.nan)
        fixed[np.flatnonzero(~is_slope), components_index[~is_slope]] = x[~is_slope] ** 2
        change = np.where(is_slope, 0.0, x**2 - components[components_index])
        guess = np.maximum(
            expected + change[:, None] * design[:, components_index].T, 1e-3 * expected
        )
        slopes = np.where(is_slope, x, np.nan if trend else 0.0)
        fits = fit_many(data, design, fixed, slope=slopes, guess=guess, restricted=trend)
        return np.sqrt(np.maximum(fits.objective - lowest[ends], 0.0) / drop[ends]) - 1.0

    # A coefficient's low end is at least 0.
    end_values = _search(excess, start, step, ~is_slope_end & (step < 0.0))
    component_intervals = [
        Interval(float(v), float(low), float(high))
        for v, low, high in zip(
            values, end_values[:count], end_values[count : 2 * count], strict=True
        )
    ]
    if not trend:
        return component_intervals, None
    slope_low, slope_high = float(end_values[-2]), float(end_values[-1])
    low = 0.0 if slope_low <= 0.0 <= slope_high else min(abs(slope_low), abs(slope_high))
    return component_intervals, Interval(abs(slope), low, max(abs(slope_low), abs(slope_high)))


def _search(
    functions: Callable[[Integers, Array], Array], start: Array, step: Array, bounded: Mask
) -> Array:
    """Return the zeros (b,) of functions that increase from -1, by bracketed secants.

    They are nearly linear, so that few steps suffice.

    :param functions: values at x (k,) of the functions with the given numbers (k,).
    :param start: (b,) points at which each is -1.
    :param step: (b,) signed first guess of the distance to the zero.
    :param bounded: (b,) True if x is at least 0; the result is 0 if there is no zero above.
    """
    all_numbers = np.arange(len(start))
    lower, lower_value = start.copy(), np.full(len(start), -1.0)
    upper = start + step
    upper = np.where(bounded, np.maximum(upper, 0.0), upper)
    upper_value = functions(all_numbers, upper)
    for _ in range(_DOUBLINGS):
        extend = (upper_value < 0.0) & ~(bounded & (upper <= 0.0))
        if not extend.any():
            break
        lower = np.where(extend, upper, lower)
        lower_value = np.where(extend, upper_value, lower_value)
        doubled = start + 2.0 * (upper - start)
        doubled = np.where(bounded, np.maximum(doubled, 0.0), doubled)
        upper = np.where(extend, doubled, upper)
        upper_value = np.where(extend, functions(all_numbers, upper), upper_value)
    at_zero = bounded & (upper_value < 0.0)
    open_ends = np.flatnonzero(~at_zero)
    for _ in range(_REFINEMENTS):
        if not len(open_ends):
            break
        k, low, high = open_ends, lower_value[open_ends], upper_value[open_ends]
        share = np.clip(low / np.minimum(low - high, -1e-9), 0.02, 0.98)
        x = lower[k] + share * (upper[k] - lower[k])
        value = functions(k, x)
        below_zero = value < 0.0
        lower[k], lower_value[k] = np.where(below_zero, (x, value), (lower[k], low))
        upper[k], upper_value[k] = np.where(below_zero, (upper[k], high), (x, value))
        open_ends = k[np.abs(value) >= _CLOSE]
    closest = np.where(np.abs(lower_value) < np.abs(upper_value), lower, upper)
    return np.where(at_zero, 0.0, closest)


def minimum(
    objective: Callable[[Array], Array],
    low: float,
    high: float,
    count: int,
    *,
    below: float = np.inf,
) -> float:
    """Return where a function of one variable is smallest: a grid, then Brent's search.

    :param objective: values at some points (k,); all of a grid are asked for at once.
    :param count: points of the grid.
    :param below: a search begins if the grid has a smaller value; else the grid's best point is
        returned.
    """
    grid = np.linspace(low, high, count)
    values = objective(grid)
    k = int(np.argmin(values))
    if values[k] > below:
        return float(grid[k])
    from scipy.optimize import minimize_scalar

    bounds = (float(grid[max(k - 1, 0)]), float(grid[min(k + 1, count - 1)]))
    solution = minimize_scalar(
        lambda x: float(objective(np.array([x]))[0]),
        bounds=bounds,
        method="bounded",
        options={"xatol": 1e-3},
    )
    return float(solution.x)
