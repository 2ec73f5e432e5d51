# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""The constant errors of an IMU from its readings on a known motion: weighted least squares.

What errors leave unexplained, vibration above all, is far from white. So readings and Jacobian go
through the orthonormal cosine transform (DCT-II), whose coefficients of a stationary process are
nearly independent with the process' spectral density as variance, and each coefficient is weighted
with that density. The density is that of the residuals of the step before, in bins, corrected for
the parameters that were taken from them. Gauss-Newton steps and densities alternate until both
stay: feasible generalised least squares, Whittle's likelihood at its maximum.

Standard errors are those of the "sandwich" ``A^-1 B A^-1`` (White 1980): A the weighted normal
matrix, B the sum of the outer products of each sample's part of the gradient, all six axes
together. They hold where the noise grows with the motion, and where its axes belong together.

Each parameter has a weak normal prior (``PRIOR``), so that a motion that does not determine one
leaves it at the perfect IMU's value with the prior's standard deviation, and none is undefined.
"""

from itertools import pairwise
from typing import Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from imu_sim_ros.calibration.twin import model
from imu_sim_ros.calibration.twin.model import COUNT, Errors, MotionAt

Array = NDArray[np.float64]

_SEGMENT: Final = 1 << 14
"""Samples transformed together at most."""
_HIGHEST: Final = 2.0
"""Times the cut-off: coefficients above it know nothing of the motion."""
_STEPS: Final = 8
_CLOSE: Final = 1e-3
"""Step over standard error at which the fit stands."""
_BIN: Final = 40
"""Coefficients in the first bins of the density; later ones are relative."""
_WIDTH: Final = 0.5
_PRIOR_OF: Final = (
    (model.OFFSET, 1.0),
    (model.SKEW, 1e-2),
    (model.MOUNTING, 10.0),
    (model.GYROSCOPE, 0.03),
    (model.ACCELEROMETER, 0.03),
    (model.G_SENSITIVITY, 5e-4),
    (model.LEVER_ARM, 0.5),
    (model.BIAS, 10.0),
)
PRIOR: Final = np.concatenate([np.full(part.stop - part.start, s) for part, s in _PRIOR_OF])
"""(38,) standard deviations of the priors around a perfect IMU, in each parameter's unit."""


class Recording(NamedTuple):
    """Readings of an IMU; what is to be explained."""

    stamps: Array
    """(n,) after the truth's first pose [s]."""
    readings: Array
    """(n, 6) gyroscope [rad/s], accelerometer [m/s^2]."""
    pieces: tuple[slice, ...]
    """Rows without a gap in between."""
    rate: float
    """[Hz]"""

    def part(self, first: float, last: float) -> "Recording":
        """Return the readings with stamps from first to before last [s]."""
        begin, end = np.searchsorted(self.stamps, [first, last])
        pieces = []
        for piece in self.pieces:
            low, high = max(piece.start, begin), min(piece.stop, end)
            if high > low:
                pieces.append(slice(low - begin, high - begin))
        rows = slice(begin, end)
        return Recording(self.stamps[rows], self.readings[rows], tuple(pieces), self.rate)


class Fit(NamedTuple):
    """The errors found, with their uncertainty."""

    errors: Errors
    covariance: Array
    """(38, 38)"""
    residuals: Array
    """(n, 6) reading minus model."""
    reference: float
    """Stamp to which the offset refers [s]."""
    wander: Array
    """(n,) of the truth's clock beside offset and skew [s]."""
    slope: Array
    """(n, 6) rate of change of the readings that the model gives [1/s]."""

    @property
    def sigma(self) -> Array:
        """(38,) standard errors."""
        result: Array = np.sqrt(np.diag(self.covariance))
        return result


class _Weights:
    """Densities of the residuals' coefficients, piece by piece, axis by axis."""

    def __init__(self, segments: list[slice], rate: float, highest: float) -> None:
        self.segments = segments
        frequencies = []
        for s in segments:
            f = np.arange(s.stop - s.start) * rate / (2 * (s.stop - s.start))
            frequencies.append(f[: max(np.searchsorted(f, highest), 2 * _BIN)])
        shortest = max(s.stop - s.start for s in segments)
        edges = [0.5]
        while edges[-1] < shortest:
            edges.append(edges[-1] + max(_BIN, round(_WIDTH * edges[-1])))
        self._edges = np.array(edges) * rate / (2 * shortest)
        self.bins = [
            np.clip(np.searchsorted(self._edges, f, side="right") - 1, 0, len(edges) - 1)
            for f in frequencies
        ]
        self.frequencies = frequencies
        self._count = len(edges)
        self.density: list[Array] = []

    def flat(self, size: Array, cutoff: float) -> None:
        """Weight alike below a cut-off, and hardly above it."""
        self.density = [
            np.where(f[:, None] < cutoff, 1.0, 100.0) * size**2 for f in self.frequencies
        ]

    def take(self, coefficients: list[Array], leverage: list[Array]) -> None:
        """Take the densities of residuals' coefficients (m, 6) of each segment."""
        power, freedom = np.zeros((self._count, 6)), np.zeros((self._count, 6))
        for c, h, bins in zip(coefficients, leverage, self.bins, strict=True):
            used = np.arange(len(c)) > 0  # the first one is the bias'
            for axis in range(6):
                power[:, axis] += np.bincount(bins[used], c[used, axis] ** 2, minlength=self._count)
                free = 1.0 - np.minimum(h[used, axis], 0.9)
                freedom[:, axis] += np.bincount(bins[used], free, minlength=self._count)
        floor = 1e-12 * np.maximum(power.sum(axis=0) / freedom.sum(axis=0), 1e-30)
        density = np.maximum(power / np.maximum(freedom, 1e-9), floor)
        empty = freedom[:, 0] <= 0
        if empty.any():
            known = np.flatnonzero(~empty)
            nearest = known[np.argmin(np.abs(np.arange(self._count)[:, None] - known), axis=1)]
            density = density[nearest]
        self.density = [density[bins] for bins in self.bins]


def fit(
    recording: Recording,
    motion_at: MotionAt,
    start: Errors,
    cutoff: float,
    wander: Array | None = None,
    prior: Array = PRIOR,
) -> Fit:
    """Return the errors of an IMU.

    :param motion_at: the truth.
    :param start: a first guess: mounting and offset.
    :param cutoff: highest frequency of the truth [Hz]; only the first step needs it.
    :param wander: (n,) of the truth's clock [s]; None: 0.
    :param prior: (38,) standard deviations.
    """
    stamps, errors = recording.stamps, start
    wander = np.zeros(len(stamps)) if wander is None else wander
    reference = float(stamps[0] + stamps[-1]) / 2.0
    weights = _Weights(_segments(recording.pieces), recording.rate, _HIGHEST * cutoff)
    weights.flat(np.std(recording.readings, axis=0) + 1e-9, cutoff)
    step = np.full(COUNT, np.inf)
    for count in range(_STEPS):
        predicted, jacobian, slope = model.linearised(errors, motion_at, stamps, reference, wander)
        residuals = recording.readings - predicted
        normal, gradient, coefficients, leverage = _solve(
            residuals, jacobian, weights, errors, prior
        )
        step = np.linalg.solve(normal, gradient).astype(np.float64)
        sigma = np.sqrt(np.diag(np.linalg.inv(normal)))
        errors = errors.moved(step)
        if count > 1 and np.max(np.abs(step) / sigma) < _CLOSE:
            break
        after = [c - j @ step for c, j in coefficients]
        weights.take(after, leverage)
    predicted, jacobian, slope = model.linearised(errors, motion_at, stamps, reference, wander)
    residuals = recording.readings - predicted
    covariance = _sandwich(residuals, jacobian, weights, prior)
    return Fit(errors, covariance, residuals, reference, wander, slope)


def _segments(pieces: tuple[slice, ...]) -> list[slice]:
    result = []
    for piece in pieces:
        count = -(-(piece.stop - piece.start) // _SEGMENT)
        edges = np.linspace(piece.start, piece.stop, count + 1).astype(int).tolist()
        result += [slice(a, b) for a, b in pairwise(edges)]
    return result


def _transformed(values: Array, count: int) -> Array:
    from scipy.fft import dct

    result: Array = dct(values, norm="ortho", axis=0)[:count]
    return result


def _solve(
    residuals: Array, jacobian: Array, weights: _Weights, errors: Errors, prior: Array
) -> tuple[Array, Array, list[tuple[Array, Array]], list[Array]]:
    """Return normal matrix, gradient, transformed residuals and Jacobians, and leverages."""
    normal = np.diag(prior**-2)
    gradient = -errors.deviation() / prior**2
    coefficients = []
    for segment, density in zip(weights.segments, weights.density, strict=True):
        c = _transformed(residuals[segment], len(density))
        j = _transformed(jacobian[segment], len(density))
        rows, weighted = j.reshape(-1, COUNT), (j / density[:, :, None]).reshape(-1, COUNT)
        normal += weighted.T @ rows
        gradient += weighted.T @ c.ravel()
        coefficients.append((c, j))
    inverse = np.linalg.inv(normal)
    leverage = []
    for (_, j), density in zip(coefficients, weights.density, strict=True):
        leverage.append(np.einsum("nai,nai->na", j @ inverse, j) / density)
    return normal, gradient, coefficients, leverage


def _sandwich(residuals: Array, jacobian: Array, weights: _Weights, prior: Array) -> Array:
    """Return the covariance of the parameters (38, 38)."""
    from scipy.fft import idct

    normal, middle = np.diag(prior**-2), np.diag(prior**-2)
    for segment, density in zip(weights.segments, weights.density, strict=True):
        root = 1.0 / np.sqrt(density)
        c = _transformed(residuals[segment], len(density)) * root
        j = _transformed(jacobian[segment], len(density)) * root[:, :, None]
        rows = j.reshape(-1, COUNT)
        normal += rows.T @ rows
        white = idct(c, norm="ortho", axis=0)
        columns = idct(j, norm="ortho", axis=0)
        parts = np.einsum("nai,na->ni", columns, white, optimize=True)
        middle += parts.T @ parts
    inverse = np.linalg.inv(normal)
    result: Array = inverse @ middle @ inverse
    return result
