# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Comparison of a twin with another part of a recording."""

from collections.abc import Sequence
from typing import Final, NamedTuple

import numpy as np

from imu_sim_ros.calibration.twin import alignment as clock
from imu_sim_ros.calibration.twin.fit import Fit, Recording, fit
from imu_sim_ros.calibration.twin.model import CURVATURE, OFFSET, SKEW, KnownMotion
from imu_sim_ros.calibration.twin.spectrum import cross_spectra
from imu_sim_ros.core.types import Array

BANDS: Final = ((0.2, 1.0), (1.0, 5.0), (5.0, 20.0), (20.0, 50.0), (50.0, 100.0))
"""Bands in which densities are compared [Hz]."""
_WINDOW: Final = 0.5
"""Length of a window for the classifier [s]."""
_SEGMENT: Final = 4.0
"""Length of the segments of a plotted spectrum [s]."""
_FOLDS: Final = 5
"""Number of parts of the windows, each of which is judged by a classifier trained on the others."""
_SHRINKAGE: Final = 0.3
"""Shrinkage of the covariance towards its diagonal, since windows are few."""
_DRAWS: Final = 8
"""Number of draws of a classifier's windows, for each twin."""


def levels(values: Array, parts: Sequence[slice], rate: float) -> Array:
    """Return the root mean density (5, 6) of values in the bands; NaN above half the rate."""
    densities = np.full((len(BANDS), 6), np.nan)
    for k, (low, high) in enumerate(BANDS):
        if high <= 0.5 * rate + 1e-9:
            edges = np.array([low, high])
            band = cross_spectra(values, parts, rate, edges)
            if len(band.low):
                densities[k] = band.density[0]
    return densities


def decibels(simulated: Array, real: Array) -> Array:
    """Return the ratio of root densities in decibels; above 0: the simulated one is larger."""
    return 20.0 * np.log10(simulated / real)


def spectrum_of(values: Array, rate: float) -> tuple[Array, Array]:
    """Return frequencies (m,) [Hz] and two-sided densities (m, 6): Welch's method, for pictures.

    Half-overlapping segments of four seconds, or a quarter of a short record.

    :param values: (n, 6) readings or residuals.
    :param rate: samples per second [Hz].
    """
    size = max(min(round(_SEGMENT * rate), len(values) // 4), 8)
    window = np.hanning(size + 2)[1:-1, None]
    starts = range(0, max(len(values) - size, 0) + 1, max(size // 2, 1))
    total = np.zeros((size // 2 + 1, values.shape[1]))
    for start in starts:
        part = values[start : start + size]
        total += np.abs(np.fft.rfft(window * (part - part.mean(axis=0)), axis=0)) ** 2
    total /= len(starts) * rate * float(np.sum(window**2))
    return np.arange(len(total)) * rate / size, np.sqrt(total)


def features(values: Array, parts: Sequence[slice], rate: float) -> Array:
    """Return log densities (windows, bands * 6) of windows of half a second.

    :param values: (n, 6) residuals.
    :param parts: rows of the parts without a gap, which are cut into windows.
    :param rate: samples per second [Hz].
    """
    size = round(_WINDOW * rate)
    rows = [s for p in parts for s in range(p.start, p.stop - size + 1, size)]
    if not rows:
        return np.zeros((0, 6))
    windows = values[np.array(rows)[:, None] + np.arange(size)]
    taper = np.hanning(size + 2)[1:-1, None]
    power = np.abs(np.fft.rfft(taper * (windows - windows.mean(axis=1, keepdims=True)), axis=1))
    frequency = np.arange(power.shape[1]) * rate / size
    columns = [
        np.log(np.mean(power[:, in_band] ** 2, axis=1) + 1e-300)
        for low, high in BANDS
        if (in_band := (frequency >= max(low, 1.0)) & (frequency < high)).any()
    ]
    return np.concatenate(columns, axis=1)


def classification_rate(real: Array, simulated: Array, count: int, seed: int = 0) -> float:
    """Return the share of windows that a classifier assigns correctly; 0.5 is chance.

    Fisher's linear discriminant with a shrunken covariance, on the logarithms of densities, each
    window judged by a classifier that was not trained on it (five folds; Lopez-Paz and Oquab,
    "Revisiting classifier two-sample tests", 2017).

    :param real: (m, p) features of windows of the real residual.
    :param simulated: (n, p) features of windows of the simulated residual.
    :param count: number of windows of each that are drawn. A classifier improves with its training
        data, and consecutive windows are alike: rates are comparable for equal numbers of windows,
        drawn from a whole part each.
    """
    rng = np.random.default_rng(seed)
    real, simulated = (rng.permutation(x)[:count] for x in (real, simulated))
    correct = 0
    for fold in range(_FOLDS):
        test_rows = np.arange(fold, count, _FOLDS)
        training_rows = np.setdiff1d(np.arange(count), test_rows)
        a, b = real[training_rows], simulated[training_rows]
        centred = np.concatenate([a - a.mean(axis=0), b - b.mean(axis=0)])
        covariance = centred.T @ centred / max(len(centred) - 2, 1)
        diagonal = np.diag(np.diag(covariance)) + 1e-12 * np.eye(len(covariance))
        covariance = (1.0 - _SHRINKAGE) * covariance + _SHRINKAGE * diagonal
        normal = np.linalg.solve(covariance, a.mean(axis=0) - b.mean(axis=0))
        middle = 0.5 * float(normal @ (a.mean(axis=0) + b.mean(axis=0)))
        correct += int(np.count_nonzero(real[test_rows] @ normal > middle))
        correct += int(np.count_nonzero(simulated[test_rows] @ normal <= middle))
    return correct / (2 * count)


class Windows(NamedTuple):
    """Logarithms of densities in windows of half a second, band by band, for a classifier."""

    fitted: Array
    """(k, p) real residual on the part to which the twin was fitted."""
    held_out: Array
    """(m, p) real residual on the other part."""
    twins: tuple[Array, ...]
    """(n, p) residual of each twin on the other part."""

    def classification_rates(self, columns: slice = slice(None)) -> tuple[float, float]:
        """Return the shares of windows that a classifier assigns correctly.

        Twin against real sensor, mean over the twins; and the real sensor on one part against the
        other.

        :param columns: densities that the classifier uses.
        """
        fitted, real, *twins = (x[:, columns] for x in (self.fitted, self.held_out, *self.twins))
        count = min(map(len, (fitted, real, *twins)))
        draws = range(_DRAWS * len(twins))
        pairs = [(real, twins[k // _DRAWS]) for k in draws], [(real, fitted)] * len(draws)
        simulated, real_rate = (
            float(np.mean([classification_rate(*pair[k], count, k) for k in draws]))
            for pair in pairs
        )
        return simulated, real_rate


TRUTH_PARAMETERS: Final = np.r_[OFFSET, SKEW, CURVATURE]
"""Parameters that may differ from one part of a recording to the next."""
_ALIGNMENTS: Final = 2
"""Number of fits of the truth's wander, each from the one before."""


def align_truth(recording: Recording, truth: KnownMotion, estimate: Fit) -> Fit:
    """Return a fit of the truth's clock and smoothing on a recording; other errors stay fixed.

    :param estimate: fit of another recording, or of this one.
    """
    middle = float(recording.stamps[0] + recording.stamps[-1]) / 2.0
    start = estimate.errors.shift_reference(middle - estimate.reference)
    fitted = fit(recording, truth, start, free=TRUTH_PARAMETERS)
    for _ in range(_ALIGNMENTS):
        stamps, residuals = recording.stamps, fitted.residuals
        course = clock.wander(stamps, residuals, fitted.slope, recording.rate, steady=False)
        wander = fitted.wander + course
        fitted = fit(recording, truth, fitted.errors, wander=wander, free=TRUTH_PARAMETERS)
    return fitted
