# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Functions of time made of polynomials and sinusoids, with their exact derivatives."""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from imu_sim_ros.config import SeriesParameters
from imu_sim_ros.trajectory.motion import Array
from imu_sim_ros.trajectory.profile import Derivatives


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
        self._polynomials = [_derived(one.polynomial) for one in series]
        self._waves = [self._waves_of(one) for one in series]

    @property
    def highest_frequency(self) -> float:
        """Of the sinusoids [Hz]."""
        return max(self._frequencies, default=0.0) / (2.0 * np.pi)

    def _waves_of(self, series: SeriesParameters) -> list[_Wave]:
        phases = series.phase or (0.0,) * len(series.amplitude)
        return [
            _Wave(self._frequencies.index(w), w, a * np.cos(phase), a * np.sin(phase))
            for a, w, phase in zip(series.amplitude, series.angular_frequency, phases, strict=True)
        ]

    def sample(self, t: Array) -> list[Derivatives]:
        """Return every function and its derivatives at times t (n,)."""
        angles = [w * t for w in self._frequencies]
        sines = [np.sin(angle) for angle in angles]
        cosines = [np.cos(angle) for angle in angles]
        return [
            _sum(polynomials, waves, t, sines, cosines)
            for polynomials, waves in zip(self._polynomials, self._waves, strict=True)
        ]


def _derived(coefficients: Sequence[float]) -> list[tuple[float, ...]]:
    """Return the coefficients of a polynomial and of its first and second derivative."""
    result = [tuple(coefficients) or (0.0,)]
    for _ in range(2):
        result.append(tuple(k * c for k, c in enumerate(result[-1]))[1:] or (0.0,))
    return result


def _sum(
    polynomials: Sequence[Sequence[float]],
    waves: Sequence[_Wave],
    t: Array,
    sines: Sequence[Array],
    cosines: Sequence[Array],
) -> Derivatives:
    value, first, second = (_horner(coefficients, t) for coefficients in polynomials)
    for k, w, a, b in waves:
        # In place from the first product on: fewer arrays stay in the processor's cache.
        wave, slope = a * sines[k], (w * a) * cosines[k]
        if b:
            wave += b * cosines[k]
            slope -= (w * b) * sines[k]
        bend = (w * w) * wave
        second = np.subtract(second, bend, out=bend)
        slope += first
        wave += value
        value, first = wave, slope
    return Derivatives(value, first, second)


def _horner(coefficients: Sequence[float], t: Array) -> Array | float:
    """Return a polynomial's values (n,), or its value if it is constant."""
    result: Array | float = coefficients[-1]
    for coefficient in reversed(coefficients[:-1]):
        result = result * t + coefficient
    return result
