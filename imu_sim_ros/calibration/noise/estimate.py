# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Which terms a record shows, how large they are, and how sure that is.

White noise and a random walk are the model that estimators use (kalibr, VINS), so they are the
model to beat: another term is taken in only where the likelihood asks for it clearly. Every subset
of the terms is fitted; the best by log-likelihood minus :data:`PRICES` is chosen. Values and
intervals come from the profile likelihood in the chosen model; a term that is not chosen gets its
upper bound from the chosen model with that term added.
"""

from collections.abc import Iterator, Mapping, Sequence
from itertools import chain, combinations
from typing import Final, NamedTuple, TypeAlias

import numpy as np
from numpy.typing import NDArray

from imu_sim_ros.calibration.noise.likelihood import (
    Data,
    Fit,
    fit,
    posterior_quantiles,
    profile_interval,
    without_trend,
)
from imu_sim_ros.calibration.noise.spectrum import Spectrum
from imu_sim_ros.calibration.noise.terms import (
    FLICKER,
    QUANTISATION,
    TERMS,
    WALK,
    WHITE,
    ramp_amplitude,
)

Array = NDArray[np.float64]
Columns: TypeAlias = Mapping[str, Array]
"""(m,) expectation of each random term by its key."""

RAMP: Final = "rate_ramp"
PRICES: Final = {WALK.key: 2.71, FLICKER.key: 4.6, QUANTISATION.key: 4.6, RAMP: 10.0}
"""Log-likelihood that a term must gain to be taken in.

2.71 is the likelihood-ratio test of a walk against none at 1 % (the boundary at zero halves
chi-square(1); Self and Liang 1987). Flicker and quantisation must convince twice as strongly as a
walk would. A trend and the walk's first coefficient are nearly the same thing, so a trend is
believed only where it leaves no doubt.
"""


_SHARP: Final = 0.04
"""Relative standard deviation of a component below which its likelihood is as good as normal."""


class Estimate(NamedTuple):
    """One parameter of one axis; ``value`` is None where the data cannot tell it from zero."""

    value: float | None
    low: float
    high: float

    def covers(self, truth: float) -> bool:
        """Tell whether the 95 % interval holds a value."""
        return self.low <= truth <= self.high


class AxisNoise(NamedTuple):
    """The random error of one axis."""

    estimates: dict[str, Estimate]
    """By the terms' keys, the ramp and what a special model adds."""
    chosen: tuple[str, ...]
    """Keys of the terms that the model has."""
    expected: Array
    """(m,) fitted rows of the spectrum."""
    trend: float = 0.0
    """The ramp with its sign, where it is in the model."""


def axis_data(spectrum: Spectrum, axis: int) -> Data:
    """Return one axis of a spectrum as the data of a fit."""
    return Data(
        spectrum.power[:, axis],
        spectrum.freedom,
        spectrum.amplitude[:, axis],
        ramp_amplitude(spectrum),
    )


def estimate(spectrum: Spectrum, axis: int) -> AxisNoise:
    """Return the terms of one axis.

    :param axis: column of ``spectrum.power``.
    """
    data = axis_data(spectrum, axis)
    columns = {term.key: term.expectation(spectrum) for term in TERMS}
    chosen, best = _select(data, columns)
    estimates = {key: component_estimate(data, columns, chosen, best, key) for key in columns}
    estimates[RAMP] = _ramp(data, columns, chosen)
    return AxisNoise(estimates, chosen, best.expected, best.trend)


def _subsets() -> Iterator[tuple[str, ...]]:
    keys = list(PRICES)
    subsets = chain.from_iterable(combinations(keys, count) for count in range(len(keys) + 1))
    for subset in subsets:
        yield (WHITE.key, *subset)


def _design(columns: Columns, keys: Sequence[str]) -> Array:
    """Return (m, p) the expectations of the random terms among the keys; p may be 0."""
    rows = len(columns[WHITE.key])
    chosen = [columns[key] for key in keys if key in columns]
    result: Array = np.array(chosen).reshape(-1, rows).T
    return result


def _fit(data: Data, columns: Columns, keys: Sequence[str]) -> Fit:
    return fit(data, _design(columns, keys), trend=RAMP in keys)


def _select(data: Data, columns: Columns) -> tuple[tuple[str, ...], Fit]:
    fits = {keys: _fit(data, columns, keys) for keys in _subsets()}
    chosen = min(fits, key=lambda keys: fits[keys].objective + sum(PRICES[k] for k in keys[1:]))
    return chosen, fits[chosen]


def component_estimate(
    data: Data, columns: Columns, chosen: Sequence[str], best: Fit, key: str
) -> Estimate:
    """Return the estimate of one random term, with the others of the chosen model free.

    :param best: fit of the chosen model.
    :param key: in the chosen model or not; then the result is an upper bound.
    """
    keys = [*chosen, *({key} - set(chosen))]
    full = best if key in chosen else _fit(data, columns, keys)
    index = [k for k in keys if k in columns].index(key)
    column, design = columns[key], _design(columns, [k for k in keys if k != key])
    value = float(np.sqrt(full.components[index]))

    def profile(coefficient: float) -> tuple[float, float]:
        held = fit(data, design, trend=RAMP in keys, offset=coefficient**2 * column)
        return held.objective, _information(data, column, design[:, held.components > 0.0], held)

    positive = np.delete(full.components, index) > 0.0
    spread = 1.0 / np.sqrt(_information(data, column, design[:, positive], full))
    step = min(spread / (2.0 * value), value) if value > 0.0 else float(np.sqrt(spread))
    if spread < _SHARP * value**2:
        low, high = profile_interval(lambda v: profile(v)[0], value, full.objective, step)
    else:
        low, value, high = posterior_quantiles(profile, value, full.objective, step)
    if key not in chosen or low <= 0.0:
        return Estimate(None, 0.0, high)
    return Estimate(value, low, high)


def _information(data: Data, column: Array, others: Array, held: Fit) -> float:
    """Return Fisher's information on one component beside unknown others."""
    weight = 0.5 * data.freedom / held.expected**2
    cross = others.T @ (weight * column)
    own = float(np.dot(weight * column, column))
    if others.shape[1] == 0:
        return own
    block = others.T @ (weight[:, None] * others)
    scale = 1.0 / np.sqrt(np.diag(block))
    inner = np.linalg.solve(block * np.outer(scale, scale), cross * scale)
    return max(own - float(np.dot(cross * scale, inner)), 1e-12 * own)


def _ramp(data: Data, columns: Columns, chosen: Sequence[str]) -> Estimate:
    """Return the estimate of the trend's size."""
    design = _design(columns, chosen)
    full = fit(data, design, trend=True)
    spread = 1.0 / float(np.sqrt(np.sum(data.trend**2 / full.expected)))
    size = abs(full.trend)
    sign = 1.0 if full.trend >= 0.0 else -1.0

    def profile(slope: float) -> float:
        detrended = data._replace(power=without_trend(data, sign * slope))
        return fit(detrended, design).objective

    low, high = profile_interval(profile, size, full.objective, spread)
    told = RAMP in chosen and low > 0.0
    return Estimate(size if told else None, low if told else 0.0, high)
