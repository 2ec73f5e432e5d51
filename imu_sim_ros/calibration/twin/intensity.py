# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Vibration of the residual: lines and bands, and the dependence of their intensity on motion."""

from collections.abc import Sequence
from itertools import pairwise
from typing import Final, NamedTuple

import numpy as np

from imu_sim_ros.core.types import Array, Mask

_MAX_TERMS: Final = 24
"""Largest number of lines."""
_PEAK: Final = 20.0
"""Power of a line over that of its neighbours: noise has it once in 10^7 frequencies or so."""
_NEIGHBOURS: Final = 40
"""Number of neighbouring frequencies on each side."""
_QUARTERS: Final = 4
"""Number of parts of a record in which a line must keep its phase."""
_STEADY: Final = 0.8
"""Smallest share of a line's energy with one phase from quarter to quarter of the record."""
_ROTOR_FREQUENCY: Final = 20.0
"""Frequency above which readings are vibration [Hz]."""
_FLIGHT_QUANTILE: Final = 0.75
"""Quantile of the powers of seconds that represents a flight."""
_STILL: Final = 0.25
"""Power over that of a flight below which nothing vibrates."""
_LASTING: Final = 3
"""Smallest number of consecutive windows with vibration."""
_LOWEST: Final = 2.0
"""Lowest frequency of lines [Hz]: below it there is motion."""
_REFINEMENTS: Final = 4
"""Number of rounds in which each line is fitted again without the others."""


class Lines(NamedTuple):
    """k sinusoids ``A sin(2 pi f t + phase)`` on six axes."""

    frequency: Array
    """(k,) frequencies [Hz]."""
    frequency_sigma: Array
    """(k,) standard errors [Hz]."""
    amplitude: Array
    """(k, 6) amplitudes [rad/s, m/s^2]."""
    amplitude_sigma: Array
    """(k, 6) standard errors."""
    phase: Array
    """(k, 6) phases at the first sample [rad]."""


def find_lines(values: Array, rate: float, lowest: float = 0.0) -> tuple[Lines, Array]:
    """Return the lines of a gap-free residual (n, 6), and the residual without them.

    :param lowest: lowest frequency [Hz]; it is at least that below which there is motion.
    """
    remainder = values - values.mean(axis=0)
    frequencies: list[float] = []
    for _ in range(_MAX_TERMS):
        peak = _highest_peak(remainder, rate, max(lowest, _LOWEST))
        if peak is None:
            break
        refined = _refine_peak(remainder, peak, rate)
        if not _is_steady(remainder, refined, rate):
            break
        frequencies.append(refined)
        remainder = remainder - _fit_lines(remainder, np.array([refined]), rate)[1]
    for _ in range(_REFINEMENTS if frequencies else 0):
        for k, frequency in enumerate(frequencies):
            further = np.array(frequencies[:k] + frequencies[k + 1 :])
            single = values - _fit_lines(values, further, rate)[1] if len(further) else values
            frequencies[k] = _refine_peak(single - single.mean(axis=0), frequency, rate)
    line_frequencies = np.array(sorted(frequencies))
    parts, fitted = _fit_lines(values, line_frequencies, rate)
    return _lines(line_frequencies, parts, values - fitted, rate), values - fitted


def _spectrum(values: Array) -> Array:
    """Return the squared Fourier coefficients (m, k) of columns (n, k) in a Hann window."""
    window = np.hanning(len(values) + 2)[1:-1, None]
    return np.abs(np.fft.rfft(window * values, axis=0)) ** 2


def _highest_peak(values: Array, rate: float, lowest: float) -> float | None:
    """Return the frequency [Hz] of the highest peak over its neighbours; None without any.

    :param values: (n, k) columns, each with a spectrum.
    :param rate: rows per second [Hz].
    :param lowest: frequency above which a peak is searched [Hz].
    """
    power = _spectrum(values)
    begin = int(np.ceil(lowest * len(values) / rate)) + 1
    if len(power) < begin + 2 * _NEIGHBOURS:
        return None
    size = 2 * _NEIGHBOURS
    count = (len(power) - begin) // size
    blocks = power[begin : begin + count * size].reshape(count, size, -1)
    # The median of exponentially distributed powers is ln 2 of their mean.
    medians = np.repeat(np.median(blocks, axis=1), size, axis=0) / np.log(2.0)
    medians = np.pad(medians, ((0, len(power) - begin - len(medians)), (0, 0)), mode="edge")
    ratio = np.max(power[begin:] / np.maximum(medians, 1e-300), axis=1)
    best = int(np.argmax(ratio))
    return (best + begin) * rate / len(values) if ratio[best] > _PEAK else None


def _refine_peak(values: Array, frequency: float, rate: float) -> float:
    """Return the frequency of the most power near a peak: golden-section search."""
    t = np.arange(len(values)) / rate
    window = np.hanning(len(values) + 2)[1:-1]
    size = values.std(axis=0) + 1e-300
    weighted = window[:, None] * values / size

    def power(f: float) -> float:
        return float(np.sum(np.abs(np.exp(-2j * np.pi * f * t) @ weighted) ** 2))

    ratio = 0.5 * (np.sqrt(5.0) - 1.0)
    low, high = frequency - rate / len(values), frequency + rate / len(values)
    for _ in range(24):
        a, b = high - ratio * (high - low), low + ratio * (high - low)
        if power(a) > power(b):
            high = b
        else:
            low = a
    return 0.5 * (low + high)


def _is_steady(values: Array, frequency: float, rate: float) -> bool:
    """Return whether a peak keeps its phase, unlike rotors that change their speed."""
    size = len(values) // _QUARTERS
    t = np.arange(_QUARTERS * size) / rate
    turned = np.exp(-2j * np.pi * frequency * t)[:, None] * values[: len(t)]
    quarters = turned.reshape(_QUARTERS, size, -1).mean(axis=1)
    loudest = int(np.argmax(np.sum(np.abs(quarters) ** 2, axis=0) / values.var(axis=0)))
    amplitudes = quarters[:, loudest]
    return bool(np.abs(amplitudes.mean()) ** 2 > _STEADY * np.mean(np.abs(amplitudes) ** 2))


def _fit_lines(values: Array, frequencies: Array, rate: float) -> tuple[Array, Array]:
    """Return sine and cosine parts (2k, 6) by least squares, and the lines (n, 6)."""
    angle = 2.0 * np.pi * np.outer(np.arange(len(values)) / rate, frequencies)
    columns = np.concatenate([np.sin(angle), np.cos(angle)], axis=1)
    if not columns.shape[1]:
        return np.zeros((0, values.shape[1])), np.zeros_like(values)
    parts = np.linalg.lstsq(columns, values, rcond=None)[0]
    return parts, columns @ parts


def _lines(frequency: Array, parts: Array, remainder: Array, rate: float) -> Lines:
    """Return lines with the standard errors of a sinusoid in noise (Rife and Boorstyn 1974).

    With the two-sided density S around it and the record's length T:
    ``var A = 2 S / T, var f = 6 S / (pi^2 A^2 T^3)``.

    :param frequency: (l,) frequencies of the lines [Hz].
    :param parts: (2 l, 6) amplitudes of the sines, then of the cosines.
    :param remainder: (n, 6) values without the lines.
    :param rate: rows per second [Hz].
    """
    count, length = len(frequency), len(remainder) / rate
    sine, cosine = parts[:count], parts[count:]
    amplitude = np.hypot(sine, cosine)
    power = _spectrum(remainder)
    power /= np.sum(np.hanning(len(remainder) + 2) ** 2) * rate
    density = np.empty((count, 6))
    for k, f in enumerate(frequency):
        middle = round(f * length)
        surroundings = power[max(middle - _NEIGHBOURS, 1) : middle + _NEIGHBOURS]
        density[k] = surroundings.mean(axis=0)
    sigma = np.sqrt(2.0 * density / length)
    information = np.sum(amplitude**2 / density, axis=1) * np.pi**2 * length**3 / 6.0
    return Lines(
        frequency=frequency,
        frequency_sigma=1.0 / np.sqrt(information),
        amplitude=amplitude,
        amplitude_sigma=sigma,
        phase=np.arctan2(cosine, sine),
    )


EDGES: Final = (1.0, 5.0, 20.0, 50.0)
"""Edges between the ranges of frequencies [Hz]."""
_WINDOW: Final = 1.0
"""Shortest window of an intensity [s]."""
_SLOWEST: Final = 0.2
"""Lowest frequency with enough periods in a window [Hz]."""
_PRIOR: Final = 0.5
"""Prior standard deviation of an exponent, which is rarely above 1."""
_DISTURBED: Final = 4.0
"""Energy of a disturbed window over the usual one."""
_MIN_WINDOWS: Final = 8
"""Smallest number of windows for exponents."""
_LARGEST: Final = 3.0
"""Largest exponent."""


class Exponents(NamedTuple):
    """Powers of rate, acceleration and speed with which a triad's residual grows."""

    value: Array
    """(ranges, 2, 3) exponents; 0 if a record is too short."""
    sigma: Array
    """(ranges, 2, 3) standard errors; 0 if there is no exponent."""


def range_edges(rate: float) -> Array:
    """Return the edges (r + 1,) [Hz] of the ranges below half the rate."""
    inner = [edge for edge in EDGES if edge < 0.4 * rate]
    return np.array([0.0, *inner, 0.5 * rate])


def filter_band(
    values: Array, parts: Sequence[slice], rate: float, low: float, high: float
) -> Array:
    """Return the part of values (n, 6) in a range of frequencies; 0 outside the parts.

    :param parts: rows of the parts, each transformed by itself.
    :param rate: rows per second [Hz].
    :param low, high: the range ``low <= f < high`` [Hz].
    """
    filtered = np.zeros_like(values)
    for part in parts:
        count = part.stop - part.start
        spectrum = np.fft.rfft(values[part] - values[part].mean(axis=0), axis=0)
        frequency = np.arange(len(spectrum)) * rate / count
        spectrum[(frequency < low) | (frequency >= high)] = 0.0
        filtered[part] = np.fft.irfft(spectrum, count, axis=0)
    return filtered


def vibration_mask(readings: Array, pieces: Sequence[slice], rate: float) -> Mask:
    """Return a mask (n,) of readings (n, 6) from the first to the last vibration of each piece.

    Before and after a flight, rotors stand still or idle, and the body may be carried. Vibration
    begins with three consecutive seconds that have a quarter of a flight's power above 20 Hz (mean
    of all axes); the upper quartile of all seconds represents the flight.
    """
    mask = np.ones(len(readings), dtype=np.bool_)
    size = max(round(_WINDOW * rate), 2)
    if 0.5 * rate <= _ROTOR_FREQUENCY:
        return mask
    band = filter_band(readings, pieces, rate, _ROTOR_FREQUENCY, np.inf)
    powers = [
        np.mean(
            band[p.start : p.stop - (p.stop - p.start) % size].reshape(-1, size, 6) ** 2, axis=1
        )
        for p in pieces
    ]
    flight_power = np.quantile(np.concatenate(powers), _FLIGHT_QUANTILE, axis=0) + 1e-300
    for piece, power in zip(pieces, powers, strict=True):
        loud = np.mean(power / flight_power, axis=1) >= _STILL
        lasting = np.convolve(loud, np.ones(_LASTING), mode="valid") == _LASTING
        if len(loud) >= _LASTING and lasting.any():
            begin, end = np.flatnonzero(lasting)[[0, -1]]
            mask[piece.start : piece.start + int(begin) * size] = False
            if end + _LASTING < len(loud):
                mask[piece.start + int(end + _LASTING) * size : piece.stop] = False
    return mask


def fit_exponents(values: Array, parts: Sequence[slice], rate: float, logs: Array) -> Exponents:
    """Return the exponents with which a residual (n, 6) grows with the motion, in each range.

    In windows the logarithm of each triad's energy, axes weighted alike, against the mean
    logarithms of the motion's size: least squares with a prior around 0, which dominates in short
    records. No exponent is negative.

    :param parts: rows that belong together.
    :param logs: (n, 3) logarithms of rate, acceleration and speed over those of a reference motion.
    """
    edges = range_edges(rate)
    exponents, sigma = np.zeros((2, len(edges) - 1, 2, 3))
    for k, (low, high) in enumerate(pairwise(edges)):
        size = max(round(_WINDOW * rate), 2)
        band = filter_band(values, parts, rate, max(low, _SLOWEST), high)
        starts = [s for p in parts for s in range(p.start, p.stop - size + 1, size)]
        if len(starts) < _MIN_WINDOWS:
            continue
        rows = np.array(starts)[:, None] + np.arange(size)
        energy = np.mean(band[rows] ** 2, axis=1)
        mean = energy.mean(axis=0)
        sizes = logs[rows].mean(axis=1)
        for triad in range(2):
            axes = slice(3 * triad, 3 * triad + 3)
            if np.all(mean[axes] > 0.0):
                log = 0.5 * np.log(np.mean(energy[:, axes] / mean[axes], axis=1))
                exponents[k, triad], sigma[k, triad] = _regress(log, sizes)
    return Exponents(exponents, sigma)


def _regress(log: Array, sizes: Array) -> tuple[Array, Array]:
    """Return exponents (3,), none below 0, and their standard errors; 0 for those that are 0."""
    from scipy.optimize import nnls

    columns = np.column_stack([np.ones(len(log)), sizes])
    residuals = log - columns @ np.linalg.lstsq(columns, log, rcond=None)[0]
    deviation = np.sqrt(float(residuals @ residuals) / (len(log) - columns.shape[1]))
    if deviation == 0.0:
        return np.zeros(3), np.zeros(3)
    # The prior is one more observation of each exponent: 0 with its deviation.
    ridge = np.eye(3) * deviation / _PRIOR
    centred = np.concatenate([sizes - sizes.mean(axis=0), ridge])
    value = nnls(centred, np.append(log - log.mean(), np.zeros(3)))[0]
    positive = value > 0.0
    sigma = np.zeros(3)
    columns_used = centred[:, positive]
    sigma[positive] = deviation * np.sqrt(np.diag(np.linalg.inv(columns_used.T @ columns_used)))
    return np.minimum(value, _LARGEST), sigma


def remove_disturbances(
    values: Array, parts: Sequence[slice], rate: float, low: float, high: float
) -> tuple[Array, int]:
    """Return a residual (n, 6) without its disturbances in a range, and their number.

    A jump of the truth or a touch of the ground is no vibration: in windows of a second in which an
    axis has more than four times its usual energy, its part in this range is scaled down to the
    usual energy.

    :param parts: rows of the pieces without a gap.
    :param rate: samples per second [Hz].
    :param low, high: the range ``low <= f < high`` [Hz].
    """
    band = filter_band(values, parts, rate, low, high)
    size = max(round(_WINDOW * rate), 2)
    reduced, count = values.copy(), 0
    energies = [
        np.mean(band[s : s + size] ** 2, axis=0)
        for p in parts
        for s in range(p.start, p.stop - size + 1, size)
    ]
    if len(energies) < _MIN_WINDOWS:
        return reduced, 0
    median_energy = np.median(energies, axis=0)
    half = size // 2
    for p in parts:
        for start in range(p.start, p.stop - half + 1, half):
            rows = slice(start, start + half)
            energy = np.mean(band[rows] ** 2, axis=0)
            loud = energy > _DISTURBED * median_energy
            if loud.any():
                count += 1
                allowed = np.sqrt(median_energy / np.maximum(energy, 1e-300))
                share = np.where(loud, 1.0 - allowed, 0.0)
                reduced[rows] -= share * band[rows]
    return reduced, count


def factors(exponents: Array, logs: Array) -> Array:
    """Return the intensities (n, 6) of one range over those of the reference motion."""
    return np.repeat(np.exp(logs @ exponents.T), 3, axis=1)
