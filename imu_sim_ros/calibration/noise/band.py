# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Which part of a spectrum the model may be compared with."""

from typing import Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from imu_sim_ros.calibration.noise.estimate import axis_data, standard_design
from imu_sim_ros.calibration.noise.likelihood import fit
from imu_sim_ros.calibration.noise.spectrum import Spectrum

_NEIGHBOURS: Final = 21
_FALSE_ALARM: Final = 1e-10
"""Probability (of chi-square) that a row of noise is taken for a peak."""
_FEWEST: Final = 8
"""Coefficients in a row below which it is not judged: the median of such rows is not a level."""
_CHANCE: Final = 6.0
"""Standard deviations by which a misfit may exceed its expectation."""
_GROUP: Final = 20
"""Rows that are judged together as well: a filter's slope is small in each and alike in all."""
_STEPS: Final = 14
_STEP: Final = float(np.sqrt(0.5))
_MARGIN: Final = 0.5
"""Share of the band that is used where the model fails above it.

What the model's failure can hide in the statistical error falls with the square of the frequency at
least (a first-order filter), the statistical error itself grows with the root only.
"""
_IMPROBABLE: Final = 1e-9
"""Probability of a row below which it is not noise of the fitted model."""


class Band(NamedTuple):
    """Rows of a spectrum that are used for one axis."""

    used: NDArray[np.bool_]
    """(m,)"""
    limit: float
    """Highest frequency used [Hz]; the Nyquist frequency where nothing is wrong."""
    lines: tuple[float, ...]
    """Frequencies of narrow peaks that were left out [Hz]: vibration, mains, fans."""


def usable_band(spectrum: Spectrum, axis: int) -> Band:
    """Find narrow peaks, and the frequency above which the sensor's own filter shapes the noise.

    A real sensor's low-pass filter ends the white noise below the Nyquist frequency, where most of
    the samples' information seems to be. From the Nyquist frequency down, half an octave at a time,
    the first limit is taken below which quantisation, white noise, flicker and walk describe the
    data to their statistical error; and where it is not the Nyquist frequency, half of it.
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
    return Band(~peaks & (spectrum.frequency <= limit), limit, frequencies)


def _peaks(
    power: NDArray[np.float64], freedom: NDArray[np.float64], high: NDArray[np.bool_]
) -> NDArray[np.bool_]:
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
    result[high] = (power[high] > middle * (0.1 + unlikely)) & (freedom[high] >= _FEWEST)
    return result


def _describes(spectrum: Spectrum, axis: int) -> bool:
    """Return whether the full model fits the high part within chance, by rows and by groups."""
    expected = fit(axis_data(spectrum, axis), standard_design(spectrum)).expected[0]
    high = np.isinf(spectrum.duration)
    ratio = spectrum.power[high, axis] / expected[high] - 1.0
    freedom = spectrum.freedom[high]
    return _by_chance(ratio, freedom) and _by_chance(*_grouped(ratio, freedom))


def _grouped(
    ratio: NDArray[np.float64], freedom: NDArray[np.float64]
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    starts = np.arange(0, len(ratio), _GROUP)
    total = np.add.reduceat(freedom, starts) if len(ratio) else freedom
    sums = np.add.reduceat(ratio * freedom, starts) if len(ratio) else ratio
    return sums / total, total


def _by_chance(ratio: NDArray[np.float64], freedom: NDArray[np.float64]) -> bool:
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
