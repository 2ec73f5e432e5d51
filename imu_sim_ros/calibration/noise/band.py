# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Which part of a spectrum the model may be held against."""

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
"""Coefficients in a row below which it is not judged: the median of such rows is no level."""
_DEVIATION: Final = 0.01
"""Relative misfit that is let pass however many samples prove it."""
_OCTAVES: Final = 7


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
    the samples' information seems to be. From the Nyquist frequency down, octave by octave, the
    first limit is taken below which quantisation, white noise, flicker and walk describe the data
    to one per cent or to their statistical error.
    """
    nyquist = 0.5 / spectrum.sample_interval
    high = np.isinf(spectrum.duration)
    peaks = high & _peaks(spectrum.power[:, axis], spectrum.freedom, high)
    limit = nyquist
    for _ in range(_OCTAVES):
        used = ~peaks & (spectrum.frequency <= limit)
        if _describes(spectrum.rows(used), axis):
            break
        limit *= 0.5
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
    """Tell whether the full model fits the high part within chance or one per cent."""
    expected = fit(axis_data(spectrum, axis), standard_design(spectrum)).expected[0]
    high = np.isinf(spectrum.duration)
    count = int(np.count_nonzero(high))
    if count == 0:
        return True
    misfit = (spectrum.power[high, axis] / expected[high] - 1.0) ** 2
    chance_misfit = 2.0 / spectrum.freedom[high]
    chance = float(np.mean(misfit / chance_misfit)) - 1.0 < 6.0 * np.sqrt(2.0 / count)
    small = float(np.mean(np.maximum(misfit - chance_misfit, 0.0))) < _DEVIATION**2
    return chance or small
