# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""How the intensity of the residual follows the motion, range by range of frequencies."""

from collections.abc import Sequence
from itertools import pairwise
from typing import Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

EDGES: Final = (1.0, 5.0, 20.0, 50.0)
"""[Hz] between the ranges."""
_WINDOW: Final = 1.0
"""[s] at least, over which an intensity is taken."""
_SLOWEST: Final = 0.2
"""[Hz] what is slower has too few periods in a window."""
_PRIOR: Final = 0.5
"""Standard deviation of an exponent before the data: in proportion at most, as a rule."""
_DISTURBED: Final = 4.0
"""Energy over the usual one of a window that is disturbed."""
_FEWEST: Final = 8
"""Windows below which nothing is said."""
_LARGEST: Final = 3.0


class Exponents(NamedTuple):
    """Powers to which a triad's residual follows rate, acceleration and speed."""

    value: Array
    """(ranges, 2, 3); 0 where a record is too short for any."""
    sigma: Array
    """(ranges, 2, 3) standard errors; 0 where there is none."""


def range_edges(rate: float) -> Array:
    """Return the edges (r + 1,) [Hz] of the ranges that a rate can show."""
    inside = [edge for edge in EDGES if edge < 0.4 * rate]
    return np.array([0.0, *inside, 0.5 * rate])


def in_range(values: Array, parts: Sequence[slice], rate: float, low: float, high: float) -> Array:
    """Return what values (n, 6) have in a range of frequencies; 0 outside the parts."""
    result = np.zeros_like(values)
    for part in parts:
        count = part.stop - part.start
        spectrum = np.fft.rfft(values[part] - values[part].mean(axis=0), axis=0)
        frequency = np.arange(len(spectrum)) * rate / count
        spectrum[(frequency < low) | (frequency >= high)] = 0.0
        result[part] = np.fft.irfft(spectrum, count, axis=0)
    return result


def follow(values: Array, parts: Sequence[slice], rate: float, logs: Array) -> Exponents:
    """Return the exponents of a residual (n, 6).

    In windows the logarithm of each triad's energy, axes weighted alike, against the mean
    logarithms of the motion's size: least squares with a prior around 0, as far as a record shows
    more. None is negative: nothing gets quieter by moving.

    :param parts: rows that belong together.
    :param logs: (3, n) of rate, acceleration, speed, relative to a reference.
    """
    edges = range_edges(rate)
    found, sigma = np.zeros((2, len(edges) - 1, 2, 3))
    for k, (low, high) in enumerate(pairwise(edges)):
        size = max(round(_WINDOW * rate), 2)
        band = in_range(values, parts, rate, max(low, _SLOWEST), high)
        starts = [s for p in parts for s in range(p.start, p.stop - size + 1, size)]
        if len(starts) < _FEWEST:
            continue
        rows = np.array(starts)[:, None] + np.arange(size)
        energy = np.mean(band[rows] ** 2, axis=1)
        mean = energy.mean(axis=0)
        sizes = np.moveaxis(logs[:, rows], 0, -1).mean(axis=1)
        for triad in range(2):
            axes = slice(3 * triad, 3 * triad + 3)
            if np.all(mean[axes] > 0.0):
                log = 0.5 * np.log(np.mean(energy[:, axes] / mean[axes], axis=1))
                found[k, triad], sigma[k, triad] = _regressed(log, sizes)
    return Exponents(found, sigma)


def _regressed(log: Array, sizes: Array) -> tuple[Array, Array]:
    """Return exponents (3,), none below 0, and their standard errors; 0 for those that are 0."""
    from scipy.optimize import nnls

    columns = np.column_stack([np.ones(len(log)), sizes])
    rest = log - columns @ np.linalg.lstsq(columns, log, rcond=None)[0]
    deviation = np.sqrt(float(rest @ rest) / (len(log) - columns.shape[1]))
    if deviation == 0.0:
        return np.zeros(3), np.zeros(3)
    # The prior is one more observation of each exponent: 0 with its deviation.
    ridge = np.eye(3) * deviation / _PRIOR
    centred = np.concatenate([sizes - sizes.mean(axis=0), ridge])
    value = nnls(centred, np.append(log - log.mean(), np.zeros(3)))[0]
    used = value > 0.0
    sigma = np.zeros(3)
    own = centred[:, used]
    sigma[used] = deviation * np.sqrt(np.diag(np.linalg.inv(own.T @ own)))
    return np.minimum(value, _LARGEST), sigma


def calmed(
    values: Array, parts: Sequence[slice], rate: float, low: float, high: float
) -> tuple[Array, int]:
    """Return a residual (n, 6) without its disturbances in a range, and how many there were.

    A jump of the truth or a touch of the ground is no vibration: in windows of a second in which an
    axis has more than four times its usual energy, what it has in this range is scaled down to
    these four times.
    """
    band = in_range(values, parts, rate, low, high)
    size = max(round(_WINDOW * rate), 2)
    result, count = values.copy(), 0
    energies = [
        np.mean(band[s : s + size] ** 2, axis=0)
        for p in parts
        for s in range(p.start, p.stop - size + 1, size)
    ]
    if len(energies) < _FEWEST:
        return result, 0
    usual = np.median(energies, axis=0)
    half = size // 2
    for p in parts:
        for start in range(p.start, p.stop - half + 1, half):
            rows = slice(start, start + half)
            energy = np.mean(band[rows] ** 2, axis=0)
            loud = energy > _DISTURBED * usual
            if loud.any():
                count += 1
                allowed = np.sqrt(_DISTURBED * usual / np.maximum(energy, 1e-300))
                share = np.where(loud, 1.0 - allowed, 0.0)
                result[rows] -= share * band[rows]
    return result, count


def factors(exponents: Array, logs: Array) -> Array:
    """Return the intensities (n, 6) of one range with exponents (2, 3)."""
    triads = np.exp(exponents @ logs)
    return np.repeat(triads.T, 3, axis=1)
