# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Overlapping Allan deviation of records of any length, in bounded memory."""

from collections import defaultdict
from typing import Final, NamedTuple

import numpy as np

from imu_sim_ros.core.types import Array, Integers

_PER_DECADE: Final = 17
"""Cluster sizes in a decade."""
_CHUNK: Final = 1 << 13
"""Number of terms handled at once: they fit the processor's cache, and BLAS stays in one thread."""
_SHORT: Final = 1024
"""Largest cluster for which every sample is used; longer ones use the stored phase."""
_PHASES: Final = 1 << 19
"""Number of stored phases per axis; of longer records every second, fourth, ... one."""


class Deviation(NamedTuple):
    """Allan deviation of some axes at m cluster times."""

    size: Integers
    """(m,) number of samples per cluster."""
    tau: Array
    """(m,) cluster times [s]."""
    deviation: Array
    """(m, axes) in the data's unit."""
    low: Array
    """(m, axes) lower end of the 95 % band."""
    high: Array
    """(m, axes) upper end of the 95 % band."""
    terms: Integers
    """(m,) number of averaged second differences."""


def cluster_sizes(samples: int) -> Integers:
    """Return log-spaced cluster sizes up to a third of a record.

    Sizes from 128 on are rounded to seven significant bits: a record of which only every
    2^p-th phase is kept then still meets all sizes above 64 * 2^p exactly.

    :param samples: length of the longest piece.
    """
    largest = samples // 3
    if largest < 1:
        return np.empty(0, dtype=np.int64)
    count = int(np.log10(largest) * _PER_DECADE) + 1
    size = np.round(10.0 ** (np.arange(count) / _PER_DECADE)).astype(np.int64)
    step = 1 << np.maximum(np.log2(size).astype(np.int64) - 6, 0)
    size = (size + step // 2) // step * step
    return np.unique(size[size <= largest])


def _sum_of_squares(x: Array, m: int, begin: int, end: int) -> Array:
    """Return the sums (axes,) of squared second differences ``x[j] - 2 x[j + m] + x[j + 2 m]``.

    :param x: (axes, n) phases.
    :param begin: first j.
    """
    total = np.zeros(len(x))
    buffer = np.empty((len(x), min(_CHUNK, end - begin)))
    for j in range(begin, end, _CHUNK):
        stop = min(j + _CHUNK, end)
        d = buffer[:, : stop - j]
        middle = x[:, j + m : stop + m]
        np.subtract(x[:, j + 2 * m : stop + 2 * m], middle, out=d)
        np.subtract(d, middle, out=d)
        np.add(d, x[:, j:stop], out=d)
        total += [np.dot(row, row) for row in d]
    return total


class DeviationAccumulator:
    """Accumulator of a record in blocks, in pieces that are treated as independent.

    Clusters of up to 1024 samples are exact in any case. Longer ones are exact while a piece has
    no more than half a million samples; beyond, their second differences start at every second,
    fourth, ... sample only, with no loss of precision: neighbours at such lags are nearly equal.
    """

    def __init__(self, rate: float, axes: int) -> None:
        """Set up for a record of some axes at a rate [Hz]."""
        self._rate = rate
        self._axes = axes
        self._totals: defaultdict[int, Array] = defaultdict(lambda: np.zeros(axes))
        """Sums (axes,) of squared second differences by size of the cluster."""
        self._terms: defaultdict[int, int] = defaultdict(int)
        """Number of these differences by size of the cluster."""
        self._longest = 0
        """Samples of the longest piece so far."""
        self._short = [int(m) for m in cluster_sizes(3 * _SHORT)]
        """Sizes of the short clusters, ascending."""
        self._stored: list[Array] = []
        """Phases (n,) of the piece by axis."""
        self._count = 0
        """Samples of the piece so far."""

    def add(self, y: Array) -> None:
        """Add the next readings (n, axes) of the piece.

        Second differences over short clusters are summed at once; for longer ones the phases, the
        running sums of the readings, are stored until the piece ends.
        """
        for start in range(0, len(y), _CHUNK):
            part = np.ascontiguousarray(y[start : start + _CHUNK].T)
            if not self._count:
                # The phase must not grow with a constant such as gravity.
                self._offset = part.mean(axis=1, keepdims=True)
                self._tail = np.zeros((self._axes, 1))
                self._stride = self._stored_count = 1
                self._stored = [np.empty(_PHASES + _CHUNK) for _ in range(self._axes)]
                for stored in self._stored:
                    stored[0] = 0.0
            phase = np.cumsum(part - self._offset, axis=1) / self._rate + self._tail[:, -1:]
            window = np.concatenate([self._tail, phase], axis=1)
            for m in self._short:
                begin = max(self._tail.shape[1] - 2 * m, 0)
                terms = window.shape[1] - 2 * m - begin
                if terms > 0:
                    self._totals[m] += _sum_of_squares(window, m, begin, begin + terms)
                    self._terms[m] += terms
            self._tail = window[:, -2 * _SHORT :].copy()
            self._store(phase)
            self._count += part.shape[1]

    def _store(self, phase: Array) -> None:
        """Store every ``_stride``-th of the next phases (axes, n) of the piece.

        If that makes too many, every second one is dropped, and the stride doubles.
        """
        skip = -(self._count + 1) % self._stride
        kept = phase[:, skip :: self._stride]
        end = self._stored_count + kept.shape[1]
        for stored, phases in zip(self._stored, kept, strict=True):
            stored[self._stored_count : end] = phases
        if end > _PHASES:
            for stored in self._stored:
                stored[: (end + 1) // 2] = stored[:end:2].copy()
            end = (end + 1) // 2
            self._stride *= 2
        self._stored_count = end

    def end_piece(self) -> None:
        """Close the piece: the next readings are not connected to it.

        Second differences over short clusters are summed already by :meth:`add`; those over longer
        ones are summed here, from every ``_stride``-th phase, which was stored.
        """
        longest_short = self._short[-1]
        for size in cluster_sizes(self._count).tolist():
            if size > longest_short:
                m = size // self._stride  # length of the cluster in stored phases
                terms = self._stored_count - 2 * m
                sums = [_sum_of_squares(stored[None], m, 0, terms) for stored in self._stored]
                self._totals[size] += np.concatenate(sums)
                self._terms[size] += terms
        self._stored = []  # frees the memory before the next piece
        self._longest = max(self._longest, self._count)
        self._count = 0

    def result(self) -> Deviation:
        """Return the deviation at all sizes up to a third of the longest piece."""
        size = cluster_sizes(self._longest)
        size = size[[int(m) in self._terms for m in size]]
        tau = size / self._rate
        terms = np.array([self._terms[int(m)] for m in size], dtype=np.int64)
        total = np.array([self._totals[int(m)] for m in size]).reshape(len(size), self._axes)
        deviation = np.sqrt(total / (2.0 * tau**2 * terms)[:, None])
        low, high = confidence_factors(self._longest, size)
        return Deviation(
            size=size,
            tau=tau,
            deviation=deviation,
            low=deviation * low,
            high=deviation * high,
            terms=terms,
        )


def degrees_of_freedom(samples: int, size: Integers) -> Array:
    """Return the equivalent degrees of freedom of the overlapping estimate.

    The smaller of the values for white noise and for a random walk (Howe, Allan and Barnes 1981,
    table 2; in IEEE 952's terms the readings are frequencies): if both are present the truth
    lies between them.
    """
    n = float(samples + 1)
    m = size.astype(np.float64)
    white = (3.0 * (n - 1.0) / (2.0 * m) - 2.0 * (n - 2.0) / n) * 4.0 * m**2 / (4.0 * m**2 + 5.0)
    walk = (n - 2.0) / m * ((n - 1.0) ** 2 - 3.0 * m * (n - 1.0) + 4.0 * m**2) / (n - 3.0) ** 2
    return np.maximum(np.minimum(white, walk), 1.0)


def confidence_factors(samples: int, size: Integers) -> tuple[Array, Array]:
    """Return the factors (m, 1) from the deviation to the ends of its 95 % band (chi-square).

    :param samples: number of samples of the record.
    :param size: (m,) numbers of samples per cluster.
    """
    from scipy.special import gammaincinv  # scipy.stats has chi2.ppf, but takes long to import

    half = 0.5 * degrees_of_freedom(samples, size)
    low = np.sqrt(half / gammaincinv(half, 0.975))
    high = np.sqrt(half / gammaincinv(half, 0.025))
    return low[:, None], high[:, None]
