# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Which terms a record shows, how large they are, and how certain that is.

Intervals are those of the full model, in which every term may stand for another
(:mod:`imu_sim_ros.calibration.noise.intervals`). A term whose interval excludes zero has a value.
If none of the slow terms (flicker, walk, ramp) is distinguishable from zero by itself and yet
one of them is there, the one that explains the record at the lowest price gets a value, for white
noise and a walk are the model that estimators use (kalibr, VINS); its interval says that others may
stand for it. Values are those of the model that has just the terms with values.
"""

from collections.abc import Collection
from typing import Final, NamedTuple

import numpy as np

from imu_sim_ros.calibration.noise.intervals import Interval, intervals
from imu_sim_ros.calibration.noise.likelihood import Data, Fits, first_guesses, fit_many
from imu_sim_ros.calibration.noise.spectrum import Spectrum
from imu_sim_ros.calibration.noise.terms import (
    FLICKER,
    QUANTISATION,
    TERMS,
    WALK,
    WHITE,
    ramp_amplitude,
)
from imu_sim_ros.types import Array

RAMP: Final = "rate_ramp"
PRICES: Final = {WALK.key: 2.71, FLICKER.key: 4.6, RAMP: 10.0}
"""Log-likelihood that the only slow term must gain.

2.71 is the likelihood-ratio test of a walk against none at 1 % (the boundary at zero halves
chi-square(1); Self and Liang 1987). Flicker must convince twice as strongly as a walk would. A
trend and the walk's first coefficient are nearly the same thing, so a trend is believed only if
it leaves no doubt.
"""
KEYS: Final = (*(term.key for term in TERMS), RAMP)
"""Keys of the standard model's parameters."""
_NOT_FLICKER: Final = {WHITE.key: 3.0 * 0.032, QUANTISATION.key: 1.5}
"""What flicker may lack that these terms stand for, over its density at the highest frequency."""
_FLICKER_ITSELF: Final = 0.003
"""Share of B that is in doubt: half of the 0.6 % by which the simulator's density departs from 1/f
up to a tenth of the rate. Only if flicker prevails up to there is B known as well as that."""
_MARGIN: Final = 0.02
"""Share of an interval that a value keeps from its ends."""


class Estimate(NamedTuple):
    """One parameter of one axis; ``value`` is None if the data do not show it.

    ``low`` is 0 if zero cannot be excluded, or if another term can stand for this one.
    """

    value: float | None
    low: float
    high: float

    def covers(self, truth: float) -> bool:
        """Return whether the 95 % interval holds a value."""
        return self.low <= truth <= self.high


class AxisNoise(NamedTuple):
    """The random error of one axis."""

    estimates: dict[str, Estimate]
    """By the keys of the terms, including the ramp and terms of a special model."""
    chosen: tuple[str, ...]
    """Keys of the terms that have values."""
    expected: Array
    """(m,) fitted rows of the spectrum."""
    trend: float = 0.0
    """The ramp with its sign, if it has a value."""
    withheld: tuple[str, ...] = ()
    """Keys of the terms that have a value only if there is no slow sinusoid, which may be there."""


def axis_data(spectrum: Spectrum, axis: int) -> Data:
    """Return one axis of a spectrum as the data of a fit."""
    return Data(
        spectrum.power[:, axis],
        spectrum.freedom,
        spectrum.amplitude[:, axis],
        np.where(spectrum.order > 0, ramp_amplitude(spectrum), 0.0),
    )


def standard_design(spectrum: Spectrum) -> Array:
    """Return (m, 4) the expected rows of Q, N, B and K with coefficients of 1."""
    return np.stack([term.expectation(spectrum) for term in TERMS], axis=1)


def estimate(spectrum: Spectrum, axis: int) -> AxisNoise:
    """Return the terms of one axis.

    :param axis: column of ``spectrum.power``.
    """
    data, design = axis_data(spectrum, axis), standard_design(spectrum)
    components, ramp = intervals(data, design, trend=True)
    ends = dict(zip(KEYS, [*components, ramp or Interval(0.0, 0.0, 0.0)], strict=True))
    ends = _with_flicker(ends, spectrum, design)
    shown = {key for key in KEYS if ends[key].low > 0.0}
    if not shown & set(PRICES):
        shown |= _slow_term(data, design, shown)
    best = _fit_terms(data, design, [shown]).best()
    sizes = dict(zip(KEYS, [*np.sqrt(best.components[0]), abs(float(best.slope[0]))], strict=True))
    chosen = tuple(key for key in KEYS if key in shown and sizes[key] > 0.0)
    estimates = {
        key: Estimate(_inside(float(sizes[key]), end) if key in chosen else None, end.low, end.high)
        for key, end in ends.items()
    }
    return AxisNoise(estimates, chosen, best.expected[0], float(best.slope[0]))


def either(one: AxisNoise, other: AxisNoise) -> AxisNoise:
    """Return what holds in both of two cases.

    Values are those of the first, but for terms that are certain in it and not shown in the other.
    """
    estimates = {}
    for key, found in one.estimates.items():
        second = other.estimates[key]
        value = None if second.value is None and found.low > 0.0 else found.value
        low, high = min(found.low, second.low), max(found.high, second.high)
        estimates[key] = Estimate(value, low, high)
    shown = {key for key, found in estimates.items() if found.value is not None}
    chosen = tuple(key for key in one.chosen if key in shown)
    withheld = tuple(key for key in one.chosen if key not in shown)
    return one._replace(estimates=estimates, chosen=chosen, withheld=withheld)


def _with_flicker(
    ends: dict[str, Interval], spectrum: Spectrum, design: Array
) -> dict[str, Interval]:
    """Return the ends with those of Q, N and B as far apart as flicker that is not quite 1/f asks.

    The simulator's is 1/f within 3.2 %, and no sensor's is exact: what it departs by at a third of
    the highest frequency may pass for white noise. Behind a low-pass that rounding hides there is
    no flicker, and quantisation takes its place. That matters if flicker prevails up to there
    alone; below white noise it is nothing.
    """
    top = int(np.argmax(spectrum.frequency))
    flicker = np.square(ends[FLICKER.key].value) * design[top, TERMS.index(FLICKER)]
    result = dict(ends)
    for term in (QUANTISATION, WHITE):
        end = ends[term.key]
        apart = _NOT_FLICKER[term.key] * flicker / design[top, TERMS.index(term)]
        low = float(np.sqrt(max(end.low**2 - apart, 0.0)))
        result[term.key] = end._replace(low=low, high=float(np.sqrt(end.high**2 + apart)))
    end = ends[FLICKER.key]
    doubt = _FLICKER_ITSELF * end.value
    low = end.value - float(np.hypot(end.value - end.low, doubt)) if end.low > 0.0 else 0.0
    high = end.value + float(np.hypot(end.high - end.value, doubt))
    result[FLICKER.key] = end._replace(low=max(low, 0.0), high=high)
    return result


def _inside(value: float, end: Interval) -> float:
    """Return a value of a simpler model, kept in the interval of the full one."""
    margin = _MARGIN * (end.high - end.low)
    return min(max(value, end.low + margin), end.high - margin)


def _slow_term(data: Data, design: Array, shown: Collection[str]) -> set[str]:
    """Return the slow term that is worth its cost in addition to those shown, or none."""
    added: list[set[str]] = [set(), *({key} for key in PRICES)]
    fits = _fit_terms(data, design, [{WHITE.key, *shown} | extra for extra in added])
    objective = fits.objective.reshape(-1, len(added)).min(axis=0)
    prices = [sum(PRICES[key] for key in extra) for extra in added]
    return added[int(np.argmin(objective + np.array(prices)))]


def _fit_terms(data: Data, design: Array, models: list[set[str]]) -> Fits:
    """Return fits of some models, all from the first guess, then all from the second."""
    guesses = first_guesses(data)
    keys = [term.key for term in TERMS]
    held = np.array([[np.nan if key in model else 0.0 for key in keys] for model in models])
    slope = np.array([np.nan if RAMP in model else 0.0 for model in models])
    return fit_many(
        data,
        design,
        np.tile(held, (len(guesses), 1)),
        slope=np.tile(slope, len(guesses)),
        guess=np.repeat(guesses, len(models), axis=0),
    )
