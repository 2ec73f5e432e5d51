# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""The spectrum of a record, in which white noise and a random walk are exactly separable.

The cosine transform (DCT-II, orthonormal) of a record diagonalises the covariance of white noise
plus a random walk of unknown start: its coefficients are independent and normal, with the variance
given in :mod:`imu_sim_ros.calibration.noise.terms`. (The inverse covariance of the walk is the
second difference matrix with free ends, whose eigenvectors are the DCT-II's; Strang, "The discrete
cosine transform", SIAM Review 41, 1999.) No window, no differencing and no leakage.
"""

from collections.abc import Iterable
from functools import partial
from typing import Final, NamedTuple

import numpy as np

from imu_sim_ros.calibration.noise.slow_signals import (
    Cleaned,
    LevelShift,
    Line,
    Signal,
    find_signals,
)
from imu_sim_ros.core.types import Array, Integers, Mask

CLUSTER: Final = 16
"""Samples averaged for the low part of the spectrum, which covers the whole record at once."""
_SPLIT: Final = 0.02 / CLUSTER
"""Frequency below which averages are used, above it samples [cycles per sample]."""
_SEGMENT: Final = 1 << 17
"""Number of samples transformed at once for the high part."""
_SHORTEST: Final = 256
"""Smallest number of samples of a piece or of the rest of one."""
_SINGLE: Final = 128
"""Number of coefficients of each piece that are kept one by one."""
_WIDTH: Final = 0.02
"""Relative width of the bins in which the other coefficients are averaged."""
_NEAR: Final = 1.5
"""Largest distance of a coefficient from a line that took its power, in half periods."""


class Spectrum(NamedTuple):
    """Rows of averaged squared coefficients; densities are two-sided, white noise N gives N^2."""

    frequency: Array
    """(m,) frequency [Hz]."""
    power: Array
    """(m, axes) density [unit^2/Hz]."""
    freedom: Array
    """(m,) number of squared coefficients averaged in the row."""
    order: Array
    """(m,) index of a single coefficient, 0 for an average of several."""
    interval: Array
    """(m,) sample interval of the transformed series [s]."""
    duration: Array
    """(m,) length of the transformed series [s]."""
    amplitude: Array
    """(m, axes) single coefficient with its sign, its square is ``power``; 0 for averages."""
    sample_interval: float
    """Interval of the samples [s]."""

    def rows(self, chosen: Mask) -> "Spectrum":
        """Return some of the rows."""
        return Spectrum._make([*(column[chosen] for column in self[:-1]), self.sample_interval])

    def around(self, signals: Iterable[Signal]) -> Mask:
        """Return a mask (m,) of the single coefficients whose power went into removed lines.

        A line has three parameters and coefficients at every half period in the record.
        """
        mask = np.zeros(len(self.order), dtype=np.bool_)
        for line in signals:
            if not isinstance(line, Line):
                continue
            distance = self.frequency - line.frequency / self.sample_interval
            mask |= (self.order > 0) & (np.abs(distance) * 2.0 * self.duration < _NEAR)
        return mask

    def at_rate(self, rate: float) -> "Spectrum":
        """Return the spectrum of the same samples for another sample rate [Hz]."""
        longer = 1.0 / (rate * self.sample_interval)
        return self._replace(
            frequency=self.frequency / longer,
            power=self.power * longer,
            interval=self.interval * longer,
            duration=self.duration * longer,
            amplitude=self.amplitude * longer**0.5,
            sample_interval=self.sample_interval * longer,
        )

    def with_losses(self, share: float) -> "Spectrum":
        """Return the spectrum if a share of the samples are draws, given the others.

        An average of p draws in each n samples has the relative variance
        ``2 / n (1 / (1 - p) + p)``: that of the others, and the draws' own.
        """
        efficiency = 1.0 / (1.0 / (1.0 - share) + share)
        return self._replace(freedom=np.where(self.order > 0, 1.0, self.freedom * efficiency))


class _Bins(NamedTuple):
    """Bins of the coefficients of a segment; the same for all segments of one length."""

    begin: int
    end: int
    """The coefficients from ``begin`` to before ``end`` lie in bins."""
    starts: Integers
    """First coefficient of each bin that has any, counted from ``begin``."""
    used: Integers
    """Indices of these bins."""
    freedom: Array
    """Number of coefficients in every bin."""
    log_frequency: Array
    """Sums of the logarithms of the coefficients' frequencies, by bin [cycles per sample]."""


class SpectrumAccumulator:
    """Accumulator of a record in blocks, in pieces that are treated as independent."""

    def __init__(self, rate: float, axes: int) -> None:
        from scipy.fft import dct  # imported only when a record is analysed

        self._dct = partial(dct, norm="ortho", axis=1, overwrite_x=True)
        self._dt = 1.0 / rate
        self._axes = axes
        count = int(np.ceil(np.log(0.5 / _SPLIT) / _WIDTH))
        self._edges = _SPLIT * (0.5 / _SPLIT) ** (np.arange(count + 1) / count)
        columns = len(self._sums_of_squares(np.zeros((axes, 1)), np.zeros(1, dtype=np.int64)))
        self._sums = np.zeros((count, columns))
        self._freedom = np.zeros(count)
        self._log_frequency = np.zeros(count)
        self._whole = self._bins(_SEGMENT)
        self._low: list[Spectrum] = []
        self._low_without_doubtful: list[Spectrum] = []
        self.signals: list[Signal] = []
        """Slow signals that were taken out; their times in samples, positions from the first."""
        self.doubtful: list[Signal] = []
        """Slow signals that may be there or not; they were left in."""
        self._segment = np.empty((axes, _SEGMENT))
        self._workspace = np.empty((axes, _SEGMENT))
        self._filled = 0
        self._offset: Array | None = None
        """(axes, 1) mean of the piece's first segment."""
        self._clusters: list[Array] = []
        """Averages of the piece so far."""
        self._begin = self._samples = 0
        """Samples before the piece, and in all."""

    def add(self, y: Array) -> None:
        """Add the next readings (n, axes) of the piece."""
        start = 0
        while start < len(y):
            count = min(len(y) - start, _SEGMENT - self._filled)
            self._segment[:, self._filled : self._filled + count] = y[start : start + count].T
            self._filled += count
            start += count
            if self._filled == _SEGMENT:
                self._flush()

    def end_piece(self) -> None:
        """Close the piece: the next readings are not connected to it."""
        self._flush()
        if self._clusters:
            values = np.concatenate(self._clusters, axis=1)
            self._clusters = []
            detected = find_signals(values, _SPLIT * CLUSTER, CLUSTER * self._dt)
            for signals, signals_of_piece in (
                (self.signals, detected.certain),
                (self.doubtful, detected.doubtful),
            ):
                signals += [_in_samples(signal, self._begin) for signal in signals_of_piece]
            for signal in detected.certain:
                if isinstance(signal, LevelShift):
                    self._remove_shift(signal)
            low = self._low_part(detected.without_certain)
            self._low.append(low)
            self._low_without_doubtful.append(
                self._low_part(detected.without_doubtful) if detected.doubtful else low
            )
        self._offset = None
        self._begin = self._samples

    def _flush(self) -> None:
        """Transform the samples of the segment, add them to the bins, and keep their averages."""
        count, self._filled = self._filled, 0
        self._samples += count
        if count < _SHORTEST:
            return
        y = self._segment[:, :count]
        whole = count // CLUSTER * CLUSTER
        self._clusters.append(y[:, :whole].reshape(self._axes, -1, CLUSTER).mean(axis=2))
        if self._offset is None:
            self._offset = y.mean(axis=1, keepdims=True)
        centred = np.subtract(y, self._offset, out=self._workspace[:, :count])
        coefficient = self._dct(centred)
        bins = self._whole if count == _SEGMENT else self._bins(count)
        squares = self._sums_of_squares(coefficient[:, bins.begin : bins.end], bins.starts)
        self._sums[bins.used] += squares.T
        self._freedom += bins.freedom
        self._log_frequency += bins.log_frequency

    def _remove_shift(self, shift: LevelShift) -> None:
        """Remove the power of a shift of level [averages] from the high part of the piece.

        The transform of a step at j among n samples is a geometric series:
        ``sin(pi k j / n) / (sqrt(2 n) sin(pi k / 2 n))``.
        """
        segment, position = divmod(round(shift.position * CLUSTER), _SEGMENT)
        count = min(_SEGMENT, self._samples - self._begin - segment * _SEGMENT)
        if count < _SHORTEST:
            return
        bins = self._bins(count)
        angle = np.pi * np.arange(bins.begin, bins.end) / count
        step = np.sin(angle * position) / (np.sqrt(2.0 * count) * np.sin(0.5 * angle))
        power = self._sums_of_squares(step[None] * shift.size, bins.starts)[0]
        column = self._sums[bins.used, shift.axis]
        self._sums[bins.used, shift.axis] = np.where(power < column, column - power, column)

    @staticmethod
    def _sums_of_squares(coefficients: Array, starts: Integers) -> Array:
        """Return sums (axes, bins) of squares of coefficients (axes, n) from each start on.

        :param coefficients: coefficients, which are overwritten.
        """
        squares = np.square(coefficients, out=coefficients)
        return np.add.reduceat(squares, starts, axis=1)

    def _bins(self, count: int) -> _Bins:
        """Return the bins of the coefficients of a number of samples."""
        order = np.arange(count)
        bins = np.searchsorted(self._edges, order / (2.0 * count), side="right") - 1
        in_bins = np.flatnonzero((bins >= 0) & (bins < len(self._freedom)))
        begin, end = int(in_bins[0]), int(in_bins[-1]) + 1
        bins, size = bins[begin:end], len(self._freedom)
        starts = np.flatnonzero(np.diff(bins, prepend=-1))
        logs = np.log(order[begin:end] / (2.0 * count))
        freedom = np.bincount(bins, minlength=size).astype(np.float64)
        log_frequency: Array = np.bincount(bins, weights=logs, minlength=size).astype(np.float64)
        return _Bins(begin, end, starts, bins[starts], freedom, log_frequency)

    def _low_part(self, cleaned: Cleaned) -> Spectrum:
        """Return the rows of a piece below the split, from its averages.

        The first coefficients are rows of their own, the others are in log-spaced bins.
        """
        clusters, inflation = cleaned
        n = clusters.shape[1]
        interval = CLUSTER * self._dt
        end = int(np.ceil(2.0 * n * _SPLIT * CLUSTER))  # the first coefficient at the split
        order = np.arange(1, end)
        edges = np.arange(min(_SINGLE, len(order)))
        if len(order) > _SINGLE:
            count = int(np.ceil(np.log(len(order) / _SINGLE) / _WIDTH)) + 1
            bins = np.geomspace(_SINGLE, len(order), count).astype(np.int64)
            edges = np.unique(np.concatenate([edges, bins[bins < len(order)]]))
        freedom = np.diff(np.append(edges, len(order))).astype(np.float64)
        amplitude, sums = np.empty((2, len(edges), self._axes))
        for axis in range(self._axes):  # one by one: each needs the memory of its averages again
            values = clusters[axis : axis + 1]
            centred = values - values.mean(axis=1, keepdims=True)
            coefficient = self._dct(centred)[:, 1:end] * np.sqrt(interval)
            shared = min(len(order), inflation.shape[1])
            coefficient[:, :shared] *= inflation[axis, :shared]
            amplitude[:, axis] = coefficient[0, edges]
            sums[:, axis] = self._sums_of_squares(coefficient, edges)[0]
        power = sums / freedom[:, None]
        mean_order = np.exp(np.add.reduceat(np.log(order), edges) / freedom)
        single = freedom == 1
        return Spectrum(
            mean_order / (2.0 * n * interval),
            power,
            freedom,
            np.where(single, mean_order.round(), 0.0),
            np.full(len(edges), interval),
            np.full(len(edges), n * interval),
            np.where(single[:, None], amplitude, 0.0),
            self._dt,
        )

    def result(self, *, doubtful: bool = True) -> Spectrum:
        """Return the rows of all pieces, low frequencies first.

        :param doubtful: include the lines that may exist or not.
        """
        used = self._freedom > 0
        freedom = self._freedom[used]
        frequency = np.exp(self._log_frequency[used] / freedom) / self._dt
        zeros = np.zeros(len(freedom))
        high = Spectrum(
            frequency,
            self._sums[used] * self._dt / freedom[:, None],
            freedom,
            zeros,
            zeros + self._dt,
            zeros + np.inf,
            np.zeros((len(freedom), self._axes)),
            self._dt,
        )
        parts = [*(self._low if doubtful else self._low_without_doubtful), high]
        columns = zip(*(part[:-1] for part in parts), strict=True)
        return Spectrum._make([*map(np.concatenate, columns), self._dt])


def _in_samples(signal: Signal, begin: int) -> Signal:
    """Return a signal in averages of samples as one in samples.

    :param begin: samples before the first average.
    """
    if isinstance(signal, Line):
        return signal._replace(frequency=signal.frequency / CLUSTER)
    if isinstance(signal, LevelShift):
        return signal._replace(position=begin + signal.position * CLUSTER)
    return signal._replace(time_constant=signal.time_constant * CLUSTER)
