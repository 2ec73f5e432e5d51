# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Terms of the noise that a record shows, with their sizes and intervals.

First the band is found in which the model describes the sensor: no vibration, no filter of its own.
Intervals are those of the full model, in which every term may stand for another
(:mod:`imu_sim_ros.calibration.noise.likelihood`). A term whose interval excludes zero has a value.
If none of the slow terms (flicker, walk, ramp) is distinguishable from zero by itself and yet
one of them is there, the one that explains the record at the lowest price gets a value, for white
noise and a walk are the model that estimators use (kalibr, VINS); its interval says that others may
stand for it. Values are those of the model that has just the terms with values.

A bias that is a Gauss-Markov process is none of these terms, and sums of them that come near to it
put white noise wrong. If the record asks for such a process next to them, it is fitted with them,
and flicker, walk and ramp are bounded by what they would be without it.
"""

from typing import Final, NamedTuple

import numpy as np

from imu_sim_ros.calibration.noise.likelihood import (
    Data,
    Fits,
    Interval,
    fit,
    intervals,
    merge_averages,
    minimum,
)
from imu_sim_ros.calibration.noise.spectrum import Spectrum
from imu_sim_ros.calibration.noise.terms import (
    FLICKER,
    QUANTISATION,
    TERMS,
    WALK,
    WHITE,
    gauss_markov_expectation,
    ramp_amplitude,
)
from imu_sim_ros.core.types import Array, Mask

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
"""Part of flicker that these terms may absorb, over its density at the highest frequency."""
_FLICKER_ITSELF: Final = 0.003
"""Relative error of B because flicker is not exactly 1/f: half of the 0.6 % by which the
simulator's density deviates up to a tenth of the rate."""
_END_MARGIN: Final = 0.02
"""Smallest distance of a value from the ends of its interval, as a share of the interval."""
_NEIGHBOURS: Final = 21
"""Number of rows, the middle one included, whose median a peak stands above."""
_FALSE_ALARM: Final = 1e-10
"""Probability of taking a row of noise for a peak (chi-square)."""
_MIN_CLUSTERS: Final = 8
"""Smallest number of coefficients in a row for the search of peaks."""
_CHANCE: Final = 6.0
"""Largest misfit over its expectation, in standard deviations."""
_GROUP: Final = 20
"""Number of rows that are also tested together: a filter's slope is small in each of them."""
_STEPS: Final = 14
"""Number of limits of the band that are tried."""
_STEP: Final = float(np.sqrt(0.5))
_MARGIN: Final = 0.5
"""Share of the band that is used if the model fails above it.

The bias that the failure can hide in the statistical error falls at least with the square of the
frequency (a first-order filter); the statistical error itself grows only with the root.
"""
_PROCESS: Final = 6.0
"""Log-likelihood that a Gauss-Markov process must gain next to the other terms, with its two
parameters: chi-square(2) exceeds twice of it once in 400 times, and a process whose time is
searched over the decades of a record in one of 100."""
_PROMISING: Final = 0.5
"""Share of ``_PROCESS`` that a process of the best tried time gains if another time may gain all: a
process whose time is wrong by the root of the grid's ratio keeps two thirds of its gain."""
_FASTEST_PROCESS: Final = 1.0
"""Smallest correlation time of a bias process [s]; filters of sensors are faster."""
_SLOW: Final = 1.0
"""Frequency below which no filter shapes the noise [Hz]."""
_TIMES: Final = 8
"""Number of correlation times on the first grid."""
_MERGED: Final = 5
"""Number of rows of averages merged into one for the search of the correlation time."""
_IMPROBABLE: Final = 1e-9
"""Probability of a row below which it is not noise of the fitted model."""


class Estimate(NamedTuple):
    """One parameter of one axis, in its unit."""

    value: float | None
    """Estimate; None if the data do not show the parameter."""
    low: float
    """Lower end of the 95 % interval; 0 if zero cannot be excluded, or if another term can stand
    for this one."""
    high: float
    """Upper end of the 95 % interval."""

    def covers(self, truth: float) -> bool:
        """Return whether the 95 % interval holds a value."""
        return self.low <= truth <= self.high


class ProcessFit(NamedTuple):
    """A Gauss-Markov process that the record asks for next to the standard model's terms."""

    correlation_time: float
    """Correlation time [s]."""
    gain_within_model: float
    """Log-likelihood that it gains next to the standard model's terms."""
    gain_over_model: float
    """Log-likelihood that white noise and a process gain over the standard model."""


class AxisNoise(NamedTuple):
    """The random error of one axis."""

    estimates: dict[str, Estimate]
    """Estimates by key of the term, with the ramp and the terms of a special model."""
    chosen: tuple[str, ...]
    """Keys of the terms that have values."""
    expected: Array
    """(m,) fitted rows of the spectrum."""
    trend: float = 0.0
    """Signed ramp, if it has a value."""
    withheld: tuple[str, ...] = ()
    """Keys of the terms that have a value only without a slow signal that may be there."""
    process: ProcessFit | None = None
    """A process that the standard model lacks; None: it describes the record."""


def data_and_design(spectrum: Spectrum, axis: int) -> tuple[Data, Array]:
    """Return one axis of a spectrum as the data of a fit, and the design of the standard model.

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
    """(m,) True for rows that are used."""
    limit: float
    """Highest frequency used [Hz]; the Nyquist frequency if nothing is wrong."""
    lines: tuple[float, ...]
    """Frequencies of narrow peaks that were left out [Hz]: vibration, mains, fans."""


def usable_band(spectrum: Spectrum, axis: int) -> UsableBand:
    """Return the usable rows: without narrow peaks, and below the sensor's own filter.

    Where the slow part asks for a Gauss-Markov process, it is one of the terms.
    A real sensor's low-pass filter ends the white noise below the Nyquist frequency, where most of
    the samples' information seems to be. From the Nyquist frequency down, half an octave at a time,
    the first limit is taken below which quantisation, white noise, flicker and walk describe the
    data to their statistical error; and if it is not the Nyquist frequency, half of it.
    """
    nyquist = 0.5 / spectrum.sample_interval
    high = np.isinf(spectrum.duration)
    peaks = high & _peaks(spectrum.power[:, axis], spectrum.freedom, high)
    limit = nyquist
    process: float | None = None
    for k in range(_STEPS):
        used = ~peaks & (spectrum.frequency <= limit)
        if _fits_within_chance(spectrum.rows(used), axis, process):
            break
        if k == 0:
            process = correlation_time(spectrum.rows(~peaks & (spectrum.frequency < _SLOW)), axis)
            if process is not None and _fits_within_chance(spectrum.rows(used), axis, process):
                break
        limit *= _STEP
    if limit < nyquist:
        limit *= _MARGIN
    frequencies = tuple(float(f) for f in spectrum.frequency[peaks & (spectrum.frequency <= limit)])
    return UsableBand(~peaks & (spectrum.frequency <= limit), limit, frequencies)


def _peaks(power: Array, freedom: Array, high: Mask) -> Mask:
    """Return a mask (m,) of the rows that stand far above the median of their neighbours.

    :param power: (m,) densities.
    :param freedom: (m,) numbers of averaged coefficients.
    :param high: (m,) True for the rows that are examined.
    """
    from scipy.special import gammainccinv

    peaks = np.zeros(len(power), dtype=bool)
    if np.count_nonzero(high) < _NEIGHBOURS:
        return peaks
    half = _NEIGHBOURS // 2
    padded = np.pad(power[high], half, mode="reflect")
    middle = np.median(np.lib.stride_tricks.sliding_window_view(padded, _NEIGHBOURS), axis=1)
    half_freedom = 0.5 * freedom[high]
    unlikely = gammainccinv(half_freedom, _FALSE_ALARM) / half_freedom
    peaks[high] = (power[high] > middle * (0.1 + unlikely)) & (freedom[high] >= _MIN_CLUSTERS)
    return peaks


def correlation_time(spectrum: Spectrum, axis: int) -> float | None:
    """Return the time [s] of the Gauss-Markov process that an axis asks for next to the terms.

    :returns: None if no process gains enough.
    """
    finite = spectrum.duration[np.isfinite(spectrum.duration)]
    fastest = max(_FASTEST_PROCESS, 10.0 * spectrum.sample_interval)
    if not len(finite) or np.max(finite) < 30.0 * fastest:
        return None
    data, design = data_and_design(spectrum, axis)
    small, terms = merge_averages(data, design, _MERGED)

    def objective(log_times: Array) -> Array:
        _, columns = merge_averages(data, _processes(spectrum, log_times), _MERGED)
        return fit(small, _designs(terms, columns), slope=np.nan).objective

    without = fit(small, terms, slope=np.nan).lowest
    bounds = float(np.log(fastest)), float(np.log(np.max(finite) / 3.0))
    log_time = minimum(objective, *bounds, _TIMES, below=without - _PROMISING * _PROCESS)
    gain = without - float(objective(np.array([log_time]))[0])
    return float(np.exp(log_time)) if gain > _PROCESS else None


def _processes(spectrum: Spectrum, log_times: Array) -> Array:
    """Return the expectations (m, k) of Gauss-Markov processes with some logarithms of times."""
    times = np.exp(log_times).tolist()
    return np.stack([gauss_markov_expectation(spectrum, time) for time in times], axis=1)


def _designs(terms: Array, columns: Array) -> Array:
    """Return designs (k, m, p + 1) of terms (m, p), each with a column of (m, k)."""
    shared = np.broadcast_to(terms, (columns.shape[1], *terms.shape))
    return np.concatenate([shared, columns.T[:, :, None]], axis=2)


def _add_process_column(spectrum: Spectrum, design: Array, time: float | None) -> Array:
    """Return the design (m, p) with the column of a Gauss-Markov process; time [s], None: none."""
    if time is None:
        return design
    return np.column_stack([design, gauss_markov_expectation(spectrum, time)])


def _fits_within_chance(spectrum: Spectrum, axis: int, process: float | None) -> bool:
    """Return whether the full model fits the high part within chance, by rows and by groups.

    :param process: correlation time [s] of a process that is a term, too.
    """
    data, design = data_and_design(spectrum, axis)
    expected = fit(data, _add_process_column(spectrum, design, process)).expected[0]
    high = np.isinf(spectrum.duration)
    if not high.any():
        return True
    ratio = spectrum.power[high, axis] / expected[high] - 1.0
    freedom = spectrum.freedom[high]
    starts = np.arange(0, len(ratio), _GROUP)
    total = np.add.reduceat(freedom, starts)
    grouped = np.add.reduceat(ratio * freedom, starts) / total
    return _is_chance(ratio, freedom) and _is_chance(grouped, total)


def _is_chance(ratio: Array, freedom: Array) -> bool:
    """Return whether relative misfits are no larger than chance makes means of squares."""
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
    process = correlation_time(spectrum, axis)
    best = fit(data, _add_process_column(spectrum, design, process), slope=np.nan)
    ratio = data.without_trend(best.slope)[0] / best.expected[0]
    slow = spectrum.frequency < 1.0
    ratio, freedom = ratio[slow], data.freedom[slow]
    improbable = gammaincc(0.5 * freedom, 0.5 * freedom * ratio) < _IMPROBABLE
    return bool(not improbable.any() and _is_chance(ratio - 1.0, freedom))


def estimate(spectrum: Spectrum, axis: int) -> AxisNoise:
    """Return the size and the interval of each noise term of one axis, by the standard model.

    :param axis: column of ``spectrum.power``.
    """
    data, standard = data_and_design(spectrum, axis)
    time = correlation_time(spectrum, axis)
    design = _add_process_column(spectrum, standard, time)
    components, ramp = intervals(data, design, trend=True)
    ends = _term_intervals(components, ramp)
    if time is not None:
        ends = _widen_intervals(ends, _term_intervals(*intervals(data, standard, trend=True)))
    ends = _widen_for_flicker(ends, spectrum, design)
    process = None if time is None else _process_fit(spectrum, data, standard, time)
    visible = {key for key in KEYS if ends[key].low > 0.0}
    if process is not None and process.gain_over_model > 0.0:
        visible -= set(PRICES)
    if not visible & set(PRICES) and time is None:
        # The slow term that is worth its cost in addition to those shown, or none.
        candidates: list[set[str]] = [set(), *({key} for key in PRICES)]
        fits = _fit_terms(data, design, [{WHITE.key, *visible} | extra for extra in candidates])
        prices = [sum(PRICES[key] for key in extra) for extra in candidates]
        visible |= candidates[int(np.argmin(fits.objective + np.array(prices)))]
    best = _fit_terms(data, design, [visible])
    fitted = zip(KEYS, [*np.sqrt(best.components[0, : len(TERMS)]), best.slope[0]], strict=True)
    sizes = {key: abs(float(size)) for key, size in fitted}
    chosen = tuple(key for key in KEYS if key in visible and sizes[key] > 0.0)
    estimates = {}
    for key, (_, low, high) in ends.items():
        if key in chosen:  # the value of the simpler model, within the interval of the full one
            margin = _END_MARGIN * (high - low)
            value = min(max(sizes[key], low + margin), high - margin)
            estimates[key] = Estimate(value, low, high)
        else:
            estimates[key] = Estimate(None, 0.0, high)
    slope = float(best.slope[0])
    return AxisNoise(estimates, chosen, best.expected[0], slope, process=process)


def _term_intervals(components: list[Interval], ramp: Interval | None) -> dict[str, Interval]:
    """Return the intervals of the standard model's parameters by key; a process has none."""
    return dict(
        zip(KEYS, [*components[: len(TERMS)], ramp or Interval(0.0, 0.0, 0.0)], strict=True)
    )


def _widen_intervals(
    ends: dict[str, Interval], without: dict[str, Interval]
) -> dict[str, Interval]:
    """Return intervals of which those of slow terms reach as far as without a process.

    :param ends: intervals of a fit with the process.
    :param without: intervals of a fit without it.
    """
    return {
        key: end._replace(high=max(end.high, without[key].high)) if key in PRICES else end
        for key, end in ends.items()
    }


def _process_fit(spectrum: Spectrum, data: Data, standard: Array, time: float) -> ProcessFit:
    """Return the gains in likelihood of a process with the terms, and with white noise alone.

    :param standard: (m, 4) expected rows of the terms.
    :param time: correlation time [s] beside the terms.
    """
    white = WHITE.expectation(spectrum)

    def process_objective(log_times: Array) -> Array:
        return fit(data, _designs(white[:, None], _processes(spectrum, log_times))).objective

    without = fit(data, standard, slope=np.nan).lowest
    additional = fit(data, _add_process_column(spectrum, standard, time), slope=np.nan).lowest
    bracket = np.log(time) + np.array([-1.5, 1.5])
    log_time = minimum(process_objective, float(bracket[0]), float(bracket[1]), _TIMES)
    instead = float(process_objective(np.array([log_time]))[0])
    return ProcessFit(time, without - additional, without - instead)


def common_estimates(first: AxisNoise, second: AxisNoise, *, strict: bool) -> AxisNoise:
    """Return the estimates that hold both with and without a doubtful slow signal.

    Values are those of the first case, except terms that are certain in it and invisible in the
    second. Intervals cover both.

    :param strict: True: terms that are invisible in the second case have no value, certain or not.
    """
    estimates = {}
    for key, estimate_first in first.estimates.items():
        partner = second.estimates[key]
        value = (
            None
            if partner.value is None and (strict or estimate_first.low > 0.0)
            else estimate_first.value
        )
        low, high = min(estimate_first.low, partner.low), max(estimate_first.high, partner.high)
        estimates[key] = Estimate(value, 0.0 if value is None else low, high)
    visible = {key for key, estimate_both in estimates.items() if estimate_both.value is not None}
    chosen = tuple(key for key in first.chosen if key in visible)
    withheld = tuple(key for key in first.chosen if key not in visible)
    return first._replace(estimates=estimates, chosen=chosen, withheld=withheld)


def _widen_for_flicker(
    ends: dict[str, Interval], spectrum: Spectrum, design: Array
) -> dict[str, Interval]:
    """Return the intervals with those of Q, N and B widened for flicker that is not exactly 1/f.

    The simulator's is 1/f within 3.2 %, and no sensor's is exact: what it departs by at a third of
    the highest frequency may pass for white noise. Behind a low-pass that rounding hides there is
    no flicker, and quantisation takes its place. That matters if flicker prevails up to there
    alone; below white noise it is nothing.
    """
    top = int(np.argmax(spectrum.frequency))
    flicker = np.square(ends[FLICKER.key].value) * design[top, TERMS.index(FLICKER)]
    widened = dict(ends)
    for term in (QUANTISATION, WHITE):
        end = ends[term.key]
        deviation = _NOT_FLICKER[term.key] * flicker / design[top, TERMS.index(term)]
        low = float(np.sqrt(max(end.low**2 - deviation, 0.0)))
        widened[term.key] = end._replace(low=low, high=float(np.sqrt(end.high**2 + deviation)))
    end = ends[FLICKER.key]
    doubt = _FLICKER_ITSELF * end.value
    low = end.value - float(np.hypot(end.value - end.low, doubt)) if end.low > 0.0 else 0.0
    high = end.value + float(np.hypot(end.high - end.value, doubt))
    widened[FLICKER.key] = end._replace(low=max(low, 0.0), high=high)
    return widened


def _fit_terms(data: Data, design: Array, models: list[set[str]]) -> Fits:
    """Return the best fit of each of some models, which are given by the keys of their terms.

    Columns of the design that are not the standard model's are in each.
    """
    keys = [term.key for term in TERMS]
    extra = [np.nan] * (design.shape[1] - len(keys))
    fixed = [[np.nan if key in model else 0.0 for key in keys] + extra for model in models]
    return fit(
        data,
        design,
        fixed=np.array(fixed),
        slope=np.array([np.nan if RAMP in model else 0.0 for model in models]),
    )
