# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Replacement of lost samples by draws from the noise of the record, given all other samples.

The cosine transform D takes a stretch of n readings to coefficients of variances S, nearly
independent (:mod:`imu_sim_ros.calibration.noise.spectrum`). With the precision
``P = D' S^-1 D``, the lost samples m given the observed ones o are normal with the mean
``-P_mm^-1 P_mo x_o`` and the covariance ``P_mm^-1``; both at once are the solution of

    P_mm x_m = R D' (S^-1/2 e - S^-1 D x_o),

R picking the lost samples, e independent and of unit variance, which conjugate gradients find with
nothing but cosine transforms. So filled, a stretch has the spectrum S, whatever the losses: no
sample counts twice and none is missing. S is that of all stretches filled before, the first of
which is filled several times ("data augmentation", Tanner and Wong, JASA 82, 1987); what is wrong
with S shrinks by the share of lost samples each time.
"""

from collections.abc import Callable
from typing import Final, NamedTuple

import numpy as np

from imu_sim_ros.calibration.noise.likelihood import Data, fit
from imu_sim_ros.core.types import Array, Integers

_WIDTH: Final = 0.1
"""Relative width of the bins in which squared coefficients are averaged."""
_LOWEST: Final = 1e-8
"""Cycles per sample at the first bin."""
_ENOUGH: Final = 64
"""Number of coefficients in a bin above which their average is used instead of a fitted model."""
_DEEPEST: Final = 0.003
"""Least share of the model's power that a filter is taken to leave: the gradients need steps as
many as the root of its inverse, and what lies above the filter is not used."""
_NEAR: Final = 4.0
"""Ratio of frequencies up to which the model is fitted above the border."""
_ROUNDS: Final = 4
"""Number of fillings of the first stretch."""
_ITERATIONS: Final = 200
"""Largest number of steps of conjugate gradients."""
_TOLERANCE: Final = 1e-3
"""Residual over the right side at which conjugate gradients stop."""
_SEED: Final = 20261122
"""Seed of the draws: an analysis repeats itself."""


class LossFiller:
    """Replaces the lost samples of one record, stretch by stretch."""

    def __init__(self, axes: int) -> None:
        """Initialise for readings of some axes."""
        count = int(np.ceil(np.log(0.5 / _LOWEST) / _WIDTH))
        self._spectrum = _Spectrum(np.zeros((count, axes)), np.zeros(count), np.zeros(count))
        """Spectrum of the stretches filled so far."""
        self._level: Array | None = None
        self._random = np.random.default_rng(_SEED)
        self.samples = 0
        """Number of samples filled so far."""
        self.total = 0
        """Number of samples so far, filled ones included."""

    def fill(self, y: Array) -> Array:
        """Return readings (n, axes), some of them not NaN, with draws in place of NaN."""
        lost = np.isnan(y[:, 0])
        self.total += len(y)
        mean = y[~lost].mean(axis=0)
        level = mean if self._level is None else self._level
        self._level = level + (mean - level) * len(y) / self.total
        if not lost.any():
            return y
        self.samples += int(np.count_nonzero(lost))
        missing = np.flatnonzero(lost)
        rows, observed = np.arange(len(y)), np.flatnonzero(~lost)
        filled = np.stack([np.interp(rows, observed, column[observed]) for column in y.T], axis=1)
        moving = np.ptp(filled, axis=0) > 0.0
        has_spectrum = self._spectrum.counts.any()
        for _ in range(1 if has_spectrum else _ROUNDS):
            power = self._spectrum if has_spectrum else self._spectrum.add_stretch(filled)
            draws = self._draw(filled, missing, power.variances(len(y)))
            filled[missing] = np.where(moving, draws, filled[missing])
        self._spectrum = self._spectrum.add_stretch(filled)
        return filled

    def _draw(self, y: Array, missing: Integers, variance: Array) -> Array:
        """Return draws (m, axes) for the lost samples.

        :param variance: (axes, n) variances of the coefficients.
        """
        from scipy.fft import dct, idct

        assert self._level is not None
        observed = (y - self._level).T.copy()
        observed[:, missing] = 0.0

        def precision(x: Array) -> Array:
            spread = np.zeros_like(observed)
            spread[:, missing] = x
            weighted = dct(spread, norm="ortho", axis=1, overwrite_x=True) / variance
            return idct(weighted, norm="ortho", axis=1, overwrite_x=True)[:, missing]

        unit = self._random.standard_normal(observed.shape)
        target = unit / np.sqrt(variance) - dct(observed, norm="ortho", axis=1) / variance
        target = idct(target, norm="ortho", axis=1, overwrite_x=True)[:, missing]
        return self._level + _solution(precision, target).T


class _Spectrum(NamedTuple):
    """Sums of squared coefficients in m bins of frequency."""

    squares: Array
    """(m, axes) sums of squared coefficients."""
    counts: Array
    """(m,) numbers of coefficients."""
    logs: Array
    """(m,) sums of the logarithms of the coefficients' frequencies [cycles per sample]."""

    def add_stretch(self, y: Array) -> "_Spectrum":
        """Return the sums with those of one more stretch (n, axes)."""
        from scipy.fft import dct

        squares = dct(y, norm="ortho", axis=0)[1:] ** 2
        frequency = np.arange(1, len(y)) / (2.0 * len(y))
        bins = (np.log(frequency / _LOWEST) / _WIDTH).astype(np.int64)
        starts = np.flatnonzero(np.diff(bins, prepend=-1))
        updated = _Spectrum(self.squares.copy(), self.counts.copy(), self.logs.copy())
        updated.squares[bins[starts]] += np.add.reduceat(squares, starts, axis=0)
        updated.counts[bins[starts]] += np.diff(np.append(starts, len(bins)))
        updated.logs[bins[starts]] += np.add.reduceat(np.log(frequency), starts)
        return updated

    def variances(self, n: int) -> Array:
        """Return the variances (axes, n) of the coefficients of a stretch of n samples.

        Their averages; if those are of few coefficients, white noise, flicker and walk fitted
        there and up to ``_NEAR`` times as far. The mean has the variance of the slowest cosine.
        """
        used = self.counts > 0
        counts = self.counts[used]
        power = np.maximum(self.squares[used] / counts[:, None], 1e-60)
        logs = self.logs[used] / counts
        log_frequency = np.log(np.maximum(np.arange(n), 1.0) / (2.0 * n))
        many = counts >= _ENOUGH
        border = logs[many][0] if many.any() else 0.0
        fitted_rows = logs < border + np.log(_NEAR)
        few = log_frequency < border
        zeros = np.zeros(np.count_nonzero(fitted_rows))
        variances = np.empty((power.shape[1], n))
        for axis, row in enumerate(power.T):
            best = fit(
                Data(row[fitted_rows], counts[fitted_rows], zeros, zeros), _terms(logs[fitted_rows])
            )
            floor = _DEEPEST * _terms(logs[many]) @ best.components[0]
            level = np.log(np.maximum(row[many], floor))
            variances[axis, few] = _terms(log_frequency[few]) @ best.components[0]
            if many.any():
                variances[axis, ~few] = np.exp(np.interp(log_frequency[~few], logs[many], level))
        return variances


def _terms(log_frequency: Array) -> Array:
    """Return the spectra (m, 3) of white noise, flicker and walk, 1 at frequency 1."""
    return np.exp(-np.outer(log_frequency, [0.0, 1.0, 2.0]))


def _solution(matrix: Callable[[Array], Array], target: Array) -> Array:
    """Return x with ``matrix(x) = target``, each row (m,) by conjugate gradients."""
    x = np.zeros_like(target)
    residual, direction = target.copy(), target.copy()
    size = np.sum(residual**2, axis=1)
    enough = _TOLERANCE**2 * size
    for _ in range(_ITERATIONS):
        if np.all(size <= enough):
            break
        product = matrix(direction)
        step = size / np.maximum(np.sum(direction * product, axis=1), 1e-300)
        x += step[:, None] * direction
        residual -= step[:, None] * product
        new_size = np.sum(residual**2, axis=1)
        direction = residual + (new_size / np.maximum(size, 1e-300))[:, None] * direction
        size = new_size
    return x
