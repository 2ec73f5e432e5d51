# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""White noise with a first-order Gauss-Markov process, for users who request that model."""

from collections.abc import Callable
from functools import cache
from typing import Final

import numpy as np

from imu_sim_ros.calibration.noise.estimate import AxisNoise, Estimate, data_and_design
from imu_sim_ros.calibration.noise.likelihood import (
    CONFIDENCE_DROP,
    Data,
    Fits,
    fit,
    intervals,
    minimum,
)
from imu_sim_ros.calibration.noise.spectrum import Spectrum
from imu_sim_ros.calibration.noise.terms import TERMS, WHITE, gauss_markov_expectation
from imu_sim_ros.core.types import Array

SIGMA: Final = "gauss_markov_sigma"
CORRELATION_TIME: Final = "correlation_time"
GAUSS_MARKOV_KEYS: Final = (*(term.key for term in TERMS), SIGMA, CORRELATION_TIME)
"""Keys of the parameters of this model."""
_EVIDENCE: Final = 4.6
"""Log-likelihood that the process must gain with its two parameters: 1 % of chi-square(2)."""
_ROOT_TOLERANCE: Final = 1e-4
"""Tolerance of a root, as a share of the interval that contains it."""
_GRID: Final = 30
"""Number of correlation times on the first grid."""


def estimate_gauss_markov(spectrum: Spectrum, axis: int) -> AxisNoise:
    """Return white noise, and the standard deviation and correlation time of the process.

    The correlation time is searched from ten samples to the length of the record, which is where a
    process can be distinguished from white noise and from a constant.

    :param axis: column of ``spectrum.power``.
    """
    data, standard = data_and_design(spectrum, axis)
    white = WHITE.expectation(spectrum)
    duration = float(np.max(spectrum.duration[np.isfinite(spectrum.duration)]))
    low, high = np.log(10.0 * spectrum.sample_interval), np.log(duration)

    @cache  # searches revisit earlier points
    def fit_at(log_time: float, sigma: float) -> Fits:
        """Fit the noise at one correlation time with a given sigma; NaN: the best one."""
        process = gauss_markov_expectation(spectrum, float(np.exp(log_time)))
        return fit(data, np.column_stack([white, process]), fixed=np.array([np.nan, sigma**2]))

    def lowest_at(log_times: Array, sigma: float) -> Array:
        return np.array([fit_at(log_time, sigma).lowest for log_time in log_times.tolist()])

    log_time = minimum(lambda x: lowest_at(x, np.nan), low, high, _GRID)
    best = fit_at(log_time, np.nan)
    process = gauss_markov_expectation(spectrum, float(np.exp(log_time)))
    estimates = _standard_terms(data, standard, white, process)
    sigma = float(np.sqrt(best.components[0, 1]))
    visible = fit(data, white[:, None]).lowest - best.lowest > _EVIDENCE

    @cache
    def over_time(value: float) -> float:
        centre = minimum(lambda x: lowest_at(x, value), low, high, _GRID // 3)
        return fit_at(centre, value).lowest

    sigma_low, sigma_high = _profile_interval(over_time, sigma, best.lowest, 0.2 * sigma)
    estimates[SIGMA] = Estimate(
        sigma if visible else None, sigma_low if visible else 0.0, sigma_high
    )
    estimates[CORRELATION_TIME] = _time_interval(
        lambda x: fit_at(x, np.nan).lowest, log_time, best.lowest, low, high, visible
    )
    return AxisNoise(estimates, (WHITE.key, SIGMA, CORRELATION_TIME), best.expected[0])


def _standard_terms(
    data: Data, standard: Array, white: Array, process: Array
) -> dict[str, Estimate]:
    """Return the white noise, and bounds for the terms that the model lacks."""
    (white_noise, _), _ = intervals(data, np.column_stack([white, process]), trend=False)
    intervals_of_terms, _ = intervals(data, np.column_stack([standard, process]), trend=False)
    bounds = zip(TERMS, intervals_of_terms, strict=False)
    estimates = {term.key: Estimate(None, 0.0, interval.high) for term, interval in bounds}
    value = white_noise.value if white_noise.low > 0.0 else None
    estimates[WHITE.key] = Estimate(value, white_noise.low, white_noise.high)
    return estimates


def _time_interval(
    profile: Callable[[float], float],
    best: float,
    lowest: float,
    low: float,
    high: float,
    visible: bool,
) -> Estimate:
    """Return the correlation time [s] with the interval of its profile likelihood.

    :param profile: objective with the logarithm of the correlation time held at a value.
    :param best: logarithm of the estimate.
    :param lowest: objective at the estimate.
    :param low, high: smallest and largest logarithm that is searched.
    :param visible: True if the record shows the process.
    """
    if not visible:
        return Estimate(None, 0.0, float(np.exp(high)))

    def shifted_profile(x: float) -> float:
        return profile(low + x) if low + x < high else np.inf

    start, end = _profile_interval(shifted_profile, best - low, lowest, 0.2)
    end = min(low + end, high)
    return Estimate(float(np.exp(best)), float(np.exp(low + start)), float(np.exp(end)))


def _profile_interval(
    profile: Callable[[float], float], best: float, lowest: float, step: float
) -> tuple[float, float]:
    """Return the ends at which a profile of minus the log-likelihood has risen by the drop.

    :param profile: objective with the parameter held at a value >= 0, minimised over all others.
    :param best: the estimate, >= 0.
    :param lowest: objective at the estimate.
    :param step: first guess of the distance to either end, > 0.
    :returns: the interval; its lower end is 0 if zero cannot be excluded.
    """
    limit = lowest + CONFIDENCE_DROP

    def excess(value: float) -> float:
        """Return the objective at a value minus the limit; 0 at the ends of the interval."""
        return profile(value) - limit

    lower, upper = _bracket(excess, best, -step), _bracket(excess, best, step)
    low = _root(excess, lower, best) if lower > 0.0 or excess(0.0) > 0.0 else 0.0
    return low, _root(excess, best, upper)


def _bracket(excess: Callable[[float], float], best: float, step: float) -> float:
    """Return a value on one side of the best at which the excess is positive; 0 if none is above 0.

    :param excess: objective at a value above its limit; negative at the best.
    :param best: value of the smallest objective, >= 0.
    :param step: first distance from it, doubled each time; below 0 to search smaller values.
    """
    for _ in range(60):
        value = best + step
        if value <= 0.0 or excess(value) > 0.0:
            break
        step *= 2.0
    return max(value, 0.0)


def _root(excess: Callable[[float], float], low: float, high: float) -> float:
    """Return the zero of a function between two points; the nearer end if none is bracketed."""
    from scipy.optimize import brentq

    if excess(low) * excess(high) >= 0.0:  # a plateau within rounding
        return low if abs(excess(low)) < abs(excess(high)) else high
    return float(brentq(excess, low, high, xtol=_ROOT_TOLERANCE * (high - low), rtol=1e-8))
