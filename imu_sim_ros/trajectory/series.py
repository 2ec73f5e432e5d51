# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Functions of time made of polynomials and sinusoids, with their exact derivatives."""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from imu_sim_ros.trajectory.parameters import SeriesParameters
from imu_sim_ros.trajectory.profile import Derivatives
from imu_sim_ros.types import Array


class _Wave(NamedTuple):
    """``sine sin(w t) + cosine cos(w t)`` with the angular frequency of a given column."""

    column: int
    frequency: float
    sine: float
    cosine: float


class SeriesSet:
    """Several functions, each ``sum c_k t^k + sum A_j sin(w_j t + phase_j)``.

    They share the sine and cosine of each distinct frequency: ``A sin(w t + phase)`` is
    ``A cos(phase) sin(w t) + A sin(phase) cos(w t)``, so that the lecture's six coordinates cost
    three sines and three cosines.
    """

    def __init__(self, series: Sequence[SeriesParameters]) -> None:
        self._frequencies = sorted({w for one in series for w in one.angular_frequency})
        self._column = np.array(self._frequencies)[:, None]
        self._polynomials = [_derived(one.polynomial) for one in series]
        self._waves = [self._waves_of(one) for one in series]

    @property
    def highest_frequency(self) -> float:
        """Highest frequency of the sinusoids [Hz]."""
        return max(self._frequencies, default=0.0) / (2.0 * np.pi)

    def _waves_of(self, series: SeriesParameters) -> list[_Wave]:
        phases = series.phase or (0.0,) * len(series.amplitude)
        return [
            _Wave(self._frequencies.index(w), w, float(a * np.cos(phase)), float(a * np.sin(phase)))
            for a, w, phase in zip(series.amplitude, series.angular_frequency, phases, strict=True)
        ]

    def sample(self, t: Array) -> tuple[Array, list[Derivatives]]:
        """Return every function at times t (n,): a table, and the functions one by one.

        The table (3, functions, n) has all values, first and second derivatives; one by one, what
        is constant is a float, and the rest rows of the table.
        """
        angles = self._column * t
        sines, cosines = np.sin(angles), np.cos(angles, out=angles)
        table = np.empty((3, len(self._waves), len(t)))
        every = range(len(self._waves))
        return table, [self._function(k, table[:, k], t, sines, cosines) for k in every]

    def _function(
        self, k: int, table: Array, t: Array, sines: Array, cosines: Array
    ) -> Derivatives:
        """Return a function, and fill its table (3, n)."""
        trend = [_trend(polynomial, t) for polynomial in self._polynomials[k]]
        if self._waves[k]:
            return _add_waves(table, trend, self._waves[k], sines, cosines)
        table[0], table[1], table[2] = trend
        return Derivatives(*trend)


def _derived(coefficients: Sequence[float]) -> list[float | tuple[float, ...]]:
    """Return the coefficients of a polynomial and of its first and second derivative.

    A constant is its value.
    """
    result = [tuple(coefficients) or (0.0,)]
    for _ in range(2):
        result.append(tuple(k * c for k, c in enumerate(result[-1]))[1:] or (0.0,))
    return [float(one[0]) if len(one) == 1 else one for one in result]


def _add_waves(
    table: Array,
    trend: Sequence[Array | float],
    waves: Sequence[_Wave],
    sines: Array,
    cosines: Array,
) -> Derivatives:
    """Fill a table (3, n) with waves on a trend, one after the other, in place."""
    value, first, second = trend
    product = np.empty(table.shape[1])
    out = table
    for k, w, a, b in waves:
        wave, slope, bend = out[0], out[1], out[2]
        sine, cosine = sines[k], cosines[k]
        np.multiply(sine, a, wave)
        np.multiply(cosine, w * a, slope)
        if b:
            wave += np.multiply(cosine, b, product)
            slope -= np.multiply(sine, w * b, product)
        np.subtract(second, np.multiply(wave, w * w, product), bend)
        slope += first
        wave += value
        if out is table:
            value, first, second = wave, slope, bend
            out = table if len(waves) == 1 else np.empty_like(table)
        else:
            table[:] = out
    return Derivatives(table[0], table[1], table[2])


def _trend(coefficients: float | tuple[float, ...], t: Array) -> Array | float:
    """Return a polynomial's values (n,), or its value if it is constant."""
    if isinstance(coefficients, float):
        return coefficients
    result: Array | float = coefficients[-1]
    for coefficient in coefficients[-2::-1]:
        result = result * t + coefficient
    return result
