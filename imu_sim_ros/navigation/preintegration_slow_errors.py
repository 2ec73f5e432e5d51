# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Share of 1/f noise, Gauss-Markov biases and unknown scales in a preintegration's covariance.

:class:`~imu_sim_ros.sensors.imu.triads.TriadsParameters` says what they are. A preintegration is
given the biases at its start, so that what acts on it is their change since then. The interval is
cut into pieces. With J_k the Jacobian of the nine numbers alpha, theta, beta at the end of piece k
by those at the start, and B_k that by a constant bias, the biases' mean over piece k acts on the
end by

    W_k = J (S_k - S_k-1),   S_k = J_k^-1 B_k,

the last J that of the interval's end, and the change of the biases b(t) by

    x = sum_k W_k (mean_k b - b(0)),   and in the rows of the biases   b(T) - b(0):

a linear function of means over pieces and of the values at both ends. The covariance of a process
of variance s^2 and correlation time tau between the means over two pieces of lengths L and M, a
time g apart, is ``s^2 m(L) m(M) exp(-g / tau)`` with ``m(L) = (1 - exp(-L / tau)) tau / L``, 1 for
a single value (:func:`~imu_sim_ros.navigation.covariance_terms.mean_factors`). In the block of the
biases this makes ``2 s^2 (1 - exp(-T / tau))``, the change of a process over the interval.

An unknown term of the response multiplies the readings r: ``x = sum_k W_k r_k e`` with one number
e for the interval. It is no bias, and the rows of the biases do not have it.
"""

from typing import Final

import numpy as np

from imu_sim_ros.core.blocks import ceil_divide
from imu_sim_ros.core.types import Array
from imu_sim_ros.navigation.covariance_terms import mean_factors
from imu_sim_ros.sensors.imu.triads import TriadsParameters

_MAX_PIECES: Final = 128
"""Most pieces of an interval; in a minute, each is half a second long."""
_AT_ONCE: Final = 1_000_000
"""Pairs of pieces whose covariances are computed at a time."""


class SlowErrorsOfIntervals:
    """The share of the slow errors in the covariances of B intervals."""

    def __init__(self, noise: TriadsParameters, batch: int, period: float) -> None:
        """Start with nothing integrated; axes are in VINS' order, accelerometer first.

        :param period: the sensor's sampling interval [s]. The bias at the start is that of one
            reading, which has all of the 1/f noise up to half the sampling rate.
        """
        self._variances: dict[float, Array] = {}
        """(6,) variances of the processes by correlation time."""
        for axis, tau, sigma in noise.processes(period):
            self._variances.setdefault(tau, np.zeros(6))[(axis + 3) % 6] += sigma**2
        self._terms = np.zeros((6, 12))
        """Variances of the factors of the readings and of their squares, by axis and source."""
        for axis, source, sigma in noise.response_terms():
            column = (source + 3) % 6 + source // 6 * 6
            self._terms[(axis + 3) % 6, column] += sigma**2
        self._ends = [np.zeros((1, batch))]
        self._sums = [np.zeros((1, batch, 9, 6))]
        """S at the ends of the pieces."""
        self._by_terms = np.zeros((batch, 54, 12))
        """S at the end, in the terms of the start, by the factors of each axis."""

    def __bool__(self) -> bool:
        """Return whether there is any such error."""
        return bool(self._variances) or bool(self._terms.any())

    def extend(self, jacobians: Array, h: Array, readings: Array, steps: int) -> None:
        """Add pieces of so many steps each, the last one shorter.

        :param jacobians: (n, B, 15, 15) at the ends of the pieces, from the interval's start.
        :param h: (m, B) lengths of the steps [s].
        :param readings: (m, B, 6) mean readings of the steps, accelerometer first.
        """
        sums: Array = np.asarray(
            np.linalg.solve(jacobians[..., :9, :9], jacobians[..., :9, 9:]), dtype=np.float64
        )
        starts = np.arange(0, len(h), steps)
        lengths = np.add.reduceat(h, starts)
        if self._terms.any():
            both = np.concatenate([readings, readings**2], axis=-1) * h[..., None]
            mean = np.add.reduceat(both, starts) / np.where(lengths > 0.0, lengths, 1.0)[..., None]
            gained = np.diff(sums, axis=0, prepend=self._sums[-1][-1:])
            gained = gained.reshape(*lengths.shape, 54)
            self._by_terms += gained.transpose(1, 2, 0) @ mean.swapaxes(0, 1)
        self._ends.append(np.asarray(self._ends[-1][-1] + np.cumsum(lengths, axis=0)))
        self._sums.append(sums)

    def covariance(self, jacobian: Array) -> Array:
        """Return the additions to the covariances (B, 15, 15).

        :param jacobian: (B, 15, 15) at the ends of the intervals.
        """
        additions = np.zeros_like(jacobian)
        if self._variances:
            ends, sums = np.concatenate(self._ends), np.concatenate(self._sums)
            latest = len(ends) - 1
            chosen = np.r_[0 : latest : ceil_divide(latest, _MAX_PIECES), latest]
            ends, sums = ends[chosen].T, sums[chosen].swapaxes(0, 1)
            size = max(1, _AT_ONCE // len(chosen) ** 2)
            for start in range(0, len(additions), size):
                part = slice(start, start + size)
                additions[part] = self._process_covariance(jacobian[part], ends[part], sums[part])
        by_terms = self._by_terms.reshape(-1, 9, 6, 12) * np.sqrt(self._terms)
        by_terms = jacobian[:, :9, :9] @ by_terms.reshape(-1, 9, 72)
        additions[:, :9, :9] += by_terms @ by_terms.swapaxes(1, 2)
        return additions

    def _process_covariance(self, jacobian: Array, ends: Array, sums: Array) -> Array:
        """Return the processes' covariances (B, 15, 15).

        :param jacobian: (B, 15, 15) at the ends of the intervals.
        :param ends: (B, N + 1) ends of the N pieces [s], the first one 0.
        :param sums: (B, N + 1, 9, 6) S at these ends.
        """
        batch, count = ends.shape
        # What acts is the value at the start, the means over the pieces, and the value at the end:
        # N + 2 pieces, the first and the last of no length.
        weights = np.zeros((batch, count + 1, 15, 6))
        weights[:, 1:-1, :9] = jacobian[:, None, :9, :9] @ np.diff(sums, axis=1)
        weights[:, 0, :9] = -jacobian[:, :9, 9:]
        weights[:, 0, 9:], weights[:, -1, 9:] = -np.eye(6), np.eye(6)
        start = np.concatenate([ends[:, :1], ends], axis=1)
        end = np.concatenate([ends, ends[:, -1:]], axis=1)
        length = end - start
        # (B, N + 2, N + 2) time between the end of one piece and the start of the other.
        gap = np.maximum(start[:, None], start[:, :, None])
        gap -= np.minimum(end[:, None], end[:, :, None])
        np.maximum(gap, 0.0, out=gap)
        diagonal = np.arange(count + 1)
        flat = weights.reshape(batch, count + 1, 90)
        acting = np.zeros_like(flat)
        for tau, variances in self._variances.items():
            of_itself, with_end = mean_factors(length / tau)
            kernel = np.exp(gap * (-1.0 / tau))
            kernel *= with_end[:, None] * with_end[:, :, None]
            kernel[:, diagonal, diagonal] = of_itself
            acting += kernel @ (flat * np.tile(variances, 15))
        rows = weights.swapaxes(1, 2).reshape(batch, 15, -1)
        acting = acting.reshape(weights.shape).swapaxes(1, 2).reshape(batch, 15, -1)
        half: Array = 0.5 * rows @ acting.swapaxes(1, 2)
        return np.asarray(half + half.swapaxes(1, 2))
