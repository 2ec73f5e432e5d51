# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Overlapping Allan deviation of records of any length, in bounded memory."""

from typing import Final, NamedTuple

import numpy as np

from imu_sim_ros.calibration.noise.estimate import axis_data, standard_design
from imu_sim_ros.calibration.noise.likelihood import fit
from imu_sim_ros.calibration.noise.spectrum import Spectrum
from imu_sim_ros.types import Array, Integers, Mask

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
    expected = fit(axis_data(spectrum, axis), standard_design(spectrum)).expected[0]
    high = np.isinf(spectrum.duration)
    ratio = spectrum.power[high, axis] / expected[high] - 1.0
    freedom = spectrum.freedom[high]
    return _by_chance(ratio, freedom) and _by_chance(*_grouped(ratio, freedom))


def _grouped(ratio: Array, freedom: Array) -> tuple[Array, Array]:
    starts = np.arange(0, len(ratio), _GROUP)
    total = np.add.reduceat(freedom, starts) if len(ratio) else freedom
    sums = np.add.reduceat(ratio * freedom, starts) if len(ratio) else ratio
    return sums / total, total


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

    data, design = axis_data(spectrum, axis), standard_design(spectrum)
    best = fit(data, design, trend=True)
    single = data.amplitude != 0.0
    left = (data.amplitude - best.slope[0] * data.trend) ** 2
    ratio = np.where(single, left, data.power) / best.expected[0]
    slow = spectrum.frequency < 1.0
    ratio, freedom = ratio[slow], data.freedom[slow]
    improbable = gammaincc(0.5 * freedom, 0.5 * freedom * ratio) < _IMPROBABLE
    return bool(not improbable.any() and _by_chance(ratio - 1.0, freedom))


_CHUNK: Final = 1 << 13
"""Terms handled at once: they stay in the processor's cache, and BLAS starts no threads."""
_SHORT: Final = 1024
"""Clusters up to this size see every sample as it comes; longer ones the stored phase."""
_PHASES: Final = 1 << 21
"""Phases stored per axis; of longer records every second, fourth, ... one is kept."""
_PADDING: Final = 520
"""Axes a power of two apart would share the same lines of the cache."""


class Deviation(NamedTuple):
    """Allan deviation of some axes at m cluster times."""

    size: Integers
    """(m,) samples per cluster."""
    tau: Array
    """(m,) cluster times [s]."""
    deviation: Array
    """(m, axes) in the data's unit."""
    low: Array
    """(m, axes) lower end of the 95 % band."""
    high: Array
    """(m, axes) upper end of the 95 % band."""
    terms: Integers
    """(m,) second differences that were averaged."""


def cluster_sizes(samples: int, per_decade: int = 17) -> Integers:
    """Return log-spaced cluster sizes up to a third of a record.

    Sizes from 128 on are rounded to seven significant bits: a record of which only every
    2^p-th phase is kept then still meets all sizes above 64 * 2^p exactly.

    :param samples: length of the longest piece.
    """
    largest = samples // 3
    if largest < 1:
        return np.empty(0, dtype=np.int64)
    count = int(np.log10(largest) * per_decade) + 1
    size = np.round(10.0 ** (np.arange(count) / per_decade)).astype(np.int64)
    step = 1 << np.maximum(np.log2(size).astype(np.int64) - 6, 0)
    size = (size + step // 2) // step * step
    return np.unique(size[size <= largest])


def _deviation(total: Array, tau: float, terms: int) -> Array:
    return np.sqrt(total / (2.0 * tau**2 * terms))


def _second_differences(x: Array, m: int, first: int = 0) -> tuple[Array, int]:
    """Return the sums (axes,) of squared second differences at lag m and their number.

    :param x: (axes, n) phases.
    :param first: index in x of the first end point ``j + 2m`` that counts.
    """
    begin = max(first - 2 * m, 0)
    end = x.shape[1] - 2 * m
    total = np.zeros(len(x))
    _add_squares(total, x, m, begin, end)
    return total, max(end - begin, 0)


def _add_squares(total: Array, x: Array, m: int, begin: int, end: int) -> None:
    """Add the squares of the second differences with ``begin <= j < end`` to total (axes,)."""
    buffer = np.empty((len(x), min(_CHUNK, max(end - begin, 0))))
    for j in range(begin, end, _CHUNK):
        stop = min(j + _CHUNK, end)
        d = buffer[:, : stop - j]
        middle = x[:, j + m : stop + m]
        np.subtract(x[:, j + 2 * m : stop + 2 * m], middle, out=d)
        np.subtract(d, middle, out=d)
        np.add(d, x[:, j:stop], out=d)
        total += [np.dot(row, row) for row in d]


class DeviationAccumulator:
    """Takes a record block by block, in pieces that are treated as independent.

    Clusters of up to 1024 samples are exact in any case. Longer ones are exact while a piece has
    no more than 2 million samples; beyond, their second differences start at every second, fourth,
    ... sample only, which costs no precision: neighbours at such lags are nearly equal.
    """

    def __init__(self, rate: float, axes: int) -> None:
        """Set up for a record of some axes at a rate [Hz]."""
        self._rate = rate
        self._axes = axes
        self._totals: dict[int, Array] = {}
        self._terms: dict[int, int] = {}
        self._longest = 0
        self._short = [int(m) for m in cluster_sizes(3 * _SHORT)]
        self._stored = np.empty((axes, _PHASES + _CHUNK + _PADDING))
        self._begin()

    def _begin(self) -> None:
        self._count = 0
        self._offset: Array | None = None
        self._stride = 1
        self._tail = np.zeros((self._axes, 1))
        self._stored[:, 0] = 0.0
        self._stored_count = 1

    def add(self, y: Array) -> None:
        """Take the next readings (n, axes) of the piece."""
        for first in range(0, len(y), _CHUNK):
            self._add(np.ascontiguousarray(y[first : first + _CHUNK].T))

    def _add(self, y: Array) -> None:
        if self._offset is None:  # the phase must not grow with a constant such as gravity
            self._offset = y.mean(axis=1, keepdims=True)
        phase = np.cumsum(y - self._offset, axis=1) / self._rate + self._tail[:, -1:]
        window = np.concatenate([self._tail, phase], axis=1)
        for m in self._short:
            self._note(m, *_second_differences(window, m, self._tail.shape[1]))
        self._tail = window[:, -2 * _SHORT :].copy()
        self._store(phase)
        self._count += y.shape[1]

    def _note(self, m: int, total: Array, terms: int) -> None:
        if terms > 0:
            self._totals[m] = self._totals.get(m, np.zeros(self._axes)) + total
            self._terms[m] = self._terms.get(m, 0) + terms

    def _store(self, phase: Array) -> None:
        skip = -(self._count + 1) % self._stride
        kept = phase[:, skip :: self._stride]
        end = self._stored_count + kept.shape[1]
        self._stored[:, self._stored_count : end] = kept
        if end > _PHASES:
            thinned = self._stored[:, :end:2].copy()
            end = thinned.shape[1]
            self._stored[:, :end] = thinned
            self._stride *= 2
        self._stored_count = end

    def end_piece(self) -> None:
        """Close the piece: what follows is not connected to it."""
        for size in cluster_sizes(self._count).tolist():
            if size > self._short[-1]:
                m, total = size // self._stride, np.zeros(self._axes)
                terms = max(self._stored_count - 2 * m, 0)
                _add_squares(total, self._stored, m, 0, terms)
                self._note(size, total, terms)
        self._longest = max(self._longest, self._count)
        self._begin()

    def result(self) -> Deviation:
        """Return the deviation at all sizes up to a third of the longest piece."""
        size = cluster_sizes(self._longest)
        size = size[[int(m) in self._terms for m in size]]
        tau = size / self._rate
        terms = np.array([self._terms[int(m)] for m in size], dtype=np.int64)
        total = np.array([self._totals[int(m)] for m in size]).reshape(len(size), self._axes)
        deviation = np.sqrt(total / (2.0 * tau**2 * terms)[:, None])
        low, high = confidence_factors(self._longest, size)
        return Deviation(size, tau, deviation, deviation * low, deviation * high, terms)


def degrees_of_freedom(samples: int, size: Integers) -> Array:
    """Return the equivalent degrees of freedom of the overlapping estimate.

    The smaller of the values for white noise and for a random walk (Howe, Allan and Barnes 1981,
    table 2; in IEEE 952's terms the readings are frequencies): if both are present the truth
    lies between them.
    """
    n = float(samples + 1)
    m = size.astype(np.float64)
    white = (3.0 * (n - 1.0) / (2.0 * m) - 2.0 * (n - 2.0) / n) * 4.0 * m**2 / (4.0 * m**2 + 5.0)
    walk = (n - 2.0) / m * ((n - 1.0) ** 2 - 3.0 * m * (n - 1.0) + 4.0 * m**2) / (n - 3.0) ** 2
    return np.maximum(np.minimum(white, walk), 1.0)


def confidence_factors(samples: int, size: Integers) -> tuple[Array, Array]:
    """Return the (m, 1) factors from the deviation to the ends of its 95 % band (chi-square)."""
    from scipy.special import gammaincinv  # scipy.stats has chi2.ppf and takes 0.7 s to import

    half = 0.5 * degrees_of_freedom(samples, size)
    low = np.sqrt(half / gammaincinv(half, 0.975))
    high = np.sqrt(half / gammaincinv(half, 0.025))
    return low[:, None], high[:, None]
