# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Which terms a record shows, how large they are, and how certain that is.

First the band is found in which the model describes the sensor: no vibration, no filter of its own.
Intervals are those of the full model, in which every term may stand for another
(:mod:`imu_sim_ros.calibration.noise.likelihood`). A term whose interval excludes zero has a value.
If none of the slow terms (flicker, walk, ramp) is distinguishable from zero by itself and yet
one of them is there, the one that explains the record at the lowest price gets a value, for white
noise and a walk are the model that estimators use (kalibr, VINS); its interval says that others may
stand for it. Values are those of the model that has just the terms with values.
"""

from typing import Final, NamedTuple

import numpy as np

from imu_sim_ros.calibration.noise.likelihood import Data, Fits, Interval, fit, intervals
from imu_sim_ros.calibration.noise.spectrum import Spectrum
from imu_sim_ros.calibration.noise.terms import (
    FLICKER,
    QUANTISATION,
    TERMS,
    WALK,
    WHITE,
    ramp_amplitude,
)
from imu_sim_ros.types import Array, Mask

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
_KEPT: Final = 0.02
"""Share of an interval that a value keeps from its ends."""
_NEIGHBOURS: Final = 21
_FALSE_ALARM: Final = 1e-10
"""Probability (of chi-square) that a row of noise is taken for a peak."""
_MIN_CLUSTERS: Final = 8
"""Coefficients in a row below which it is not judged: the median of such rows is not a level."""
_CHANCE: Final = 6.0
"""Standard deviations by which a misfit may exceed its expectation."""
_GROUP: Final = 20
"""Rows that are judged together as well: a filter's slope is small in each and alike in all."""
_STEPS: Final = 14
_STEP: Final = float(np.sqrt(0.5))
_MARGIN: Final = 0.5
"""Share of the band that is used if the model fails above it.

What the model's failure can hide in the statistical error falls with the square of the frequency at
least (a first-order filter), the statistical error itself grows with the root only.
"""
_IMPROBABLE: Final = 1e-9
"""Probability of a row below which it is not noise of the fitted model."""


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


def data_and_design(spectrum: Spectrum, axis: int) -> tuple[Data, Array]:
    """Return one axis of a spectrum as the data of a fit, and the standard model.

    :returns: the model as the expected rows (m, 4) of Q, N, B and K with coefficients of 1.
    """
    data = Data(
        spectrum.power[:, axis],
        spectrum.freedom,
        spectrum.amplitude[:, axis],
        np.where(spectrum.order > 0, ramp_amplitude(spectrum), 0.0),
    )
    return data, np.stack([term.expectation(spectrum) for term in TERMS], axis=1)


class UsableBand(NamedTuple):
    """Rows of a spectrum that are used for one axis."""

    used: Mask
    """(m,)"""
    limit: float
    """Highest frequency used [Hz]; the Nyquist frequency if nothing is wrong."""
    lines: tuple[float, ...]
    """Frequencies of narrow peaks that were left out [Hz]: vibration, mains, fans."""


def usable_band(spectrum: Spectrum, axis: int) -> UsableBand:
    """Find narrow peaks, and the frequency above which the sensor's own filter shapes the noise.

    A real sensor's low-pass filter ends the white noise below the Nyquist frequency, where most of
    the samples' information seems to be. From the Nyquist frequency down, half an octave at a time,
    the first limit is taken below which quantisation, white noise, flicker and walk describe the
    data to their statistical error; and if it is not the Nyquist frequency, half of it.
    """
    nyquist = 0.5 / spectrum.sample_interval
    high = np.isinf(spectrum.duration)
    peaks = high & _peaks(spectrum.power[:, axis], spectrum.freedom, high)
    limit = nyquist
    for _ in range(_STEPS):
        used = ~peaks & (spectrum.frequency <= limit)
        if _describes(spectrum.rows(used), axis):
            break
        limit *= _STEP
    if limit < nyquist:
        limit *= _MARGIN
    frequencies = tuple(float(f) for f in spectrum.frequency[peaks & (spectrum.frequency <= limit)])
    return UsableBand(~peaks & (spectrum.frequency <= limit), limit, frequencies)


def _peaks(power: Array, freedom: Array, high: Mask) -> Mask:
    """Return the rows that stand far above the median of their neighbours."""
    from scipy.special import gammainccinv

    result = np.zeros(len(power), dtype=bool)
    if np.count_nonzero(high) < _NEIGHBOURS:
        return result
    half = _NEIGHBOURS // 2
    padded = np.pad(power[high], half, mode="reflect")
    middle = np.median(np.lib.stride_tricks.sliding_window_view(padded, _NEIGHBOURS), axis=1)
    half_freedom = 0.5 * freedom[high]
    unlikely = gammainccinv(half_freedom, _FALSE_ALARM) / half_freedom
    result[high] = (power[high] > middle * (0.1 + unlikely)) & (freedom[high] >= _MIN_CLUSTERS)
    return result


def _describes(spectrum: Spectrum, axis: int) -> bool:
    """Return whether the full model fits the high part within chance, by rows and by groups."""
    expected = fit(*data_and_design(spectrum, axis)).expected[0]
    high = np.isinf(spectrum.duration)
    if not high.any():
        return True
    ratio = spectrum.power[high, axis] / expected[high] - 1.0
    freedom = spectrum.freedom[high]
    starts = np.arange(0, len(ratio), _GROUP)
    total = np.add.reduceat(freedom, starts)
    grouped = np.add.reduceat(ratio * freedom, starts) / total
    return _by_chance(ratio, freedom) and _by_chance(grouped, total)


def _by_chance(ratio: Array, freedom: Array) -> bool:
    """Return whether relative misfits are no larger than those of means of so many squares."""
    if len(ratio) == 0:
        return True
    # The variance of the square of a mean of nu squares, 8 / nu^2 for many, is larger for few.
    spread = np.sqrt(np.sum(2.0 + 12.0 / freedom) / len(ratio) ** 2)
    return bool(np.mean(ratio**2 * 0.5 * freedom) - 1.0 < _CHANCE * spread)


def explains_wander(spectrum: Spectrum, axis: int) -> bool:
    """Return whether an axis' behaviour below 1 Hz is the noise of the fitted model.

    Every row then is a mean of squares around its expectation: a body that moves makes lines, or
    a hump that no sum of white noise, flicker, walk and ramp follows.
    """
    from scipy.special import gammaincc

    data, design = data_and_design(spectrum, axis)
    best = fit(data, design, slope=np.nan)
    ratio = data.without_trend(best.slope)[0] / best.expected[0]
    slow = spectrum.frequency < 1.0
    ratio, freedom = ratio[slow], data.freedom[slow]
    improbable = gammaincc(0.5 * freedom, 0.5 * freedom * ratio) < _IMPROBABLE
    return bool(not improbable.any() and _by_chance(ratio - 1.0, freedom))


def estimate(spectrum: Spectrum, axis: int) -> AxisNoise:
    """Return the terms of one axis.

    :param axis: column of ``spectrum.power``.
    """
    data, design = data_and_design(spectrum, axis)
    components, ramp = intervals(data, design, trend=True)
    ends = dict(zip(KEYS, [*components, ramp or Interval(0.0, 0.0, 0.0)], strict=True))
    ends = _with_flicker(ends, spectrum, design)
    shown = {key for key in KEYS if ends[key].low > 0.0}
    if not shown & set(PRICES):
        # The slow term that is worth its cost in addition to those shown, or none.
        added: list[set[str]] = [set(), *({key} for key in PRICES)]
        fits = _fit_terms(data, design, [{WHITE.key, *shown} | extra for extra in added])
        prices = [sum(PRICES[key] for key in extra) for extra in added]
        shown |= added[int(np.argmin(fits.objective + np.array(prices)))]
    best = _fit_terms(data, design, [shown])
    sizes = dict(zip(KEYS, [*np.sqrt(best.components[0]), abs(float(best.slope[0]))], strict=True))
    chosen = tuple(key for key in KEYS if key in shown and sizes[key] > 0.0)
    estimates = {}
    for key, (_, low, high) in ends.items():
        value = None
        if key in chosen:  # of a simpler model, kept in the interval of the full one
            margin = _KEPT * (high - low)
            value = min(max(float(sizes[key]), low + margin), high - margin)
        estimates[key] = Estimate(value, low, high)
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


def _fit_terms(data: Data, design: Array, models: list[set[str]]) -> Fits:
    """Return the best fit of each of some models, which are given by the keys of their terms."""
    keys = [term.key for term in TERMS]
    return fit(
        data,
        design,
        held=np.array([[np.nan if key in model else 0.0 for key in keys] for model in models]),
        slope=np.array([np.nan if RAMP in model else 0.0 for model in models]),
    )
