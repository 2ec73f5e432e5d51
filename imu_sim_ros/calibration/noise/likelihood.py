# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Maximum likelihood of variance components on a spectrum, with profile-likelihood intervals.

The rows of a :class:`~imu_sim_ros.calibration.noise.spectrum.Spectrum` are independent means of
squared normal variables, so that minus the log-likelihood of an expectation ``s = A theta`` with
``theta >= 0`` is ``sum nu / 2 (ln s + P / s)`` (Whittle 1953; exact for white noise with a random
walk). Iteratively reweighted non-negative least squares is Fisher's scoring for it.
"""

from collections.abc import Callable
from typing import Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

CONFIDENCE_DROP: Final = 1.9207
"""Drop of the log-likelihood at the ends of a 95 % interval: half of chi-square(1, 0.95)."""
_FLOOR: Final = 1e-15
"""Smallest expectation, relative to the largest row: a model may lack all terms."""
_ITERATIONS: Final = 60
_NEGLIGIBLE: Final = 8.0
"""Drop of the log-likelihood beyond which a value does not count."""
_NODES: Final = 25
_TOLERANCE: Final = 1e-9


class Data(NamedTuple):
    """What a model is compared with, for one axis."""

    power: Array
    """(m,) averaged squared coefficients."""
    freedom: Array
    """(m,) squared coefficients in each average."""
    amplitude: Array
    """(m,) single coefficients with their sign, 0 elsewhere."""
    trend: Array
    """(m,) what a trend of 1 adds to ``amplitude``."""


class Fit(NamedTuple):
    """Variance components and, where asked for, a trend."""

    components: Array
    """(p,) squares of the terms' coefficients."""
    trend: float
    objective: float
    """Minus the log-likelihood, without its constant."""
    expected: Array
    """(m,) fitted rows."""


def fit(data: Data, design: Array, *, trend: bool = False, offset: Array | None = None) -> Fit:
    """Return the non-negative components that make the data most likely.

    :param design: (m, p) expectation of the rows for each component.
    :param trend: whether a trend is estimated as well.
    :param offset: (m,) known part of the expectation.
    """
    known = np.zeros(len(data.power)) if offset is None else offset
    smooth = _smooth(data.power)
    best = _iterate(data, design, known, smooth, trend)
    if trend:  # a walk and a trend explain each other away: each gets the first chance once
        flat = np.full(len(smooth), np.median(smooth))
        other = _iterate(data, design, known, flat, trend)
        best = other if other.objective < best.objective else best
    return best


def _iterate(data: Data, design: Array, known: Array, guess: Array, trend: bool) -> Fit:
    """Improve a first guess of the expectation until the likelihood stands still."""
    floor = _FLOOR * float(np.max(data.power)) + 1e-300
    known, expected = np.maximum(known, floor), np.maximum(guess, floor)
    scale = np.array([1.0 / np.max(column) for column in design.T])
    scaled = design * scale
    power, slope, objective = data.power, 0.0, np.inf
    theta = np.zeros(design.shape[1])
    for _ in range(_ITERATIONS):
        if trend:
            slope = _slope(data, expected)
            power = without_trend(data, slope)
        weight = 0.5 * data.freedom / expected**2
        step = _non_negative(scaled, power - known, weight) - theta
        theta, expected, new = _line_search(data, scaled, known, power, theta, step, objective)
        if objective - new < _TOLERANCE * (1.0 + abs(new) * 1e-6):
            objective = min(new, objective)
            break
        objective = new
    return Fit(theta * scale, slope, objective, expected)


def _smooth(power: Array) -> Array:
    """Return a first guess of the expectation: running medians bridge lucky small rows."""
    width = min(9, len(power))
    padded = np.pad(power, (width // 2, width - 1 - width // 2), mode="edge")
    windows = np.lib.stride_tricks.sliding_window_view(padded, width)
    result: Array = np.median(windows, axis=1)
    return result


def _non_negative(design: Array, target: Array, weight: Array) -> Array:
    from scipy.optimize import nnls

    if design.shape[1] == 0:
        return np.zeros(0)
    root = np.sqrt(weight)
    # The triangle of a QR leaves nnls a p x p problem instead of m x p.
    q, r = np.linalg.qr(design * root[:, None])
    solution, _ = nnls(r, q.T @ (target * root))
    result: Array = solution
    return result


def _objective(data: Data, power: Array, expected: Array) -> float:
    return float(0.5 * np.dot(data.freedom, np.log(expected) + power / expected))


def _line_search(
    data: Data,
    design: Array,
    known: Array,
    power: Array,
    theta: Array,
    step: Array,
    objective: float,
) -> tuple[Array, Array, float]:
    """Halve a step until it improves; the first of all is taken as it is."""
    fraction = 1.0
    for _ in range(30):
        trial = theta + fraction * step
        expected = known + design @ trial
        new = _objective(data, power, expected)
        if new <= objective:
            return trial, expected, new
        fraction *= 0.5
    return theta, known + design @ theta, objective


def _slope(data: Data, expected: Array) -> float:
    weight = data.trend / expected
    norm = float(np.dot(weight, data.trend))
    return float(np.dot(weight, data.amplitude)) / norm if norm > 0.0 else 0.0


def without_trend(data: Data, slope: float) -> Array:
    """Return the rows after a trend of the given slope is taken from the single coefficients."""
    single = data.amplitude != 0.0
    result: Array = np.where(single, (data.amplitude - slope * data.trend) ** 2, data.power)
    return result


def profile_interval(
    profile: Callable[[float], float], best: float, lowest: float, step: float
) -> tuple[float, float]:
    """Return where a profile of minus the log-likelihood has risen by the confidence drop.

    :param profile: objective with the parameter held at a value >= 0, minimised over all others.
    :param best: the estimate, >= 0.
    :param lowest: objective at the estimate.
    :param step: first guess of the distance to either end, > 0.
    :returns: the interval; its lower end is 0 where zero cannot be excluded.
    """
    limit = lowest + CONFIDENCE_DROP

    def excess(value: float) -> float:
        return profile(value) - limit

    below, above = _outside(excess, best, -step), _outside(excess, best, step)
    low = _root(excess, below, best) if below > 0.0 or excess(0.0) > 0.0 else 0.0
    return low, _root(excess, best, above)


def posterior_quantiles(
    profile: Callable[[float], tuple[float, float]],
    best: float,
    lowest: float,
    step: float,
    quantiles: tuple[float, ...] = (0.025, 0.5, 0.975),
) -> list[float]:
    """Return quantiles of a coefficient from its profile likelihood and Jeffreys' prior.

    Where few coefficients of the spectrum carry a term, its likelihood is skewed, the maximum too
    low on average, and the interval of :func:`profile_interval` too. With the prior
    ``sqrt(information)`` the quantiles have the right frequency to second order (Welch and Peers
    1963); for a single variance of few degrees of freedom they are exactly those of chi-square.

    :param profile: returns the objective with the coefficient held at a value >= 0, and the
        information on the coefficient's square there.
    :param best: the maximum of the likelihood, >= 0.
    :param lowest: objective there.
    :param step: first guess of the width, > 0.
    """
    from scipy.interpolate import PchipInterpolator

    def excess(value: float) -> float:
        return profile(value)[0] - lowest - _NEGLIGIBLE

    below, above = _outside(excess, best, -step), _outside(excess, best, step)
    low = _root(excess, below, best, 0.05) if below > 0.0 else 0.0
    high = _root(excess, best, above, 0.05)
    nodes = np.linspace(low, high, _NODES)
    objective, information = np.array([profile(float(value)) for value in nodes]).T
    fine = np.linspace(low, high, 20 * _NODES)
    prior = 2.0 * fine * PchipInterpolator(nodes, np.sqrt(information))(fine)
    density = prior * np.exp(lowest - PchipInterpolator(nodes, objective)(fine))
    steps = 0.5 * (density[1:] + density[:-1])
    cumulative = np.concatenate([[0.0], np.cumsum(steps)])
    result: Array = np.interp(quantiles, cumulative / cumulative[-1], fine)
    return [float(value) for value in result]


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
