# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""The spectrum of a record, in which white noise and a random walk are exactly separable.

The cosine transform (DCT-II, orthonormal) of a record diagonalises the covariance of white noise
plus a random walk of unknown start: its coefficients are independent and normal, with the variance
given in :mod:`imu_sim_ros.calibration.noise.terms`. (The inverse covariance of the walk is the
second difference matrix with free ends, whose eigenvectors are the DCT-II's; Strang, "The discrete
cosine transform", SIAM Review 41, 1999.) No window, no differencing and no leakage.
"""

import io
import tempfile
import weakref
from collections.abc import Iterable
from functools import partial
from typing import BinaryIO, Final, NamedTuple

import numpy as np

from imu_sim_ros.calibration.noise.slow_signals import (
    Cleaned,
    LevelShift,
    Line,
    Signal,
    find_signals,
)
from imu_sim_ros.core.memory import release_memory
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
        """Return the rows of which a mask or indices are chosen."""
        return Spectrum._make([*(column[chosen] for column in self[:-1]), self.sample_interval])

    def rows_of_lines(self, signals: Iterable[Signal]) -> Mask:
        """Return a mask (m,) of the single coefficients from which removed lines took the power.

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


class _LowBins(NamedTuple):
    """Bins of the coefficients below the split."""

    order: Integers
    """Indices of the coefficients, from 1."""
    edges: Integers
    """(m,) first coefficient of each bin, counted from the first one."""
    freedom: Array
    """(m,) number of coefficients in each bin."""


class _Averages:
    """Averages (axes, n) of a piece, which grow with the record, in a temporary file.

    They stay in memory if there is no place for such a file.
    """

    def __init__(self, axes: int) -> None:
        """Initialise without averages, with a temporary file that ends with this object."""
        self._axes = axes
        self._sizes: list[int] = []
        """Number of averages of each block in the file."""
        self._file: BinaryIO | io.BytesIO
        try:
            self._file = tempfile.TemporaryFile(buffering=0)  # noqa: SIM115
            weakref.finalize(self, self._file.close)
        except OSError:
            self._file = io.BytesIO()

    def __len__(self) -> int:
        return sum(self._sizes)

    def add(self, averages: Array) -> None:
        """Append a block (axes, m)."""
        content = averages.tobytes()
        start = self._axes * len(self) * averages.itemsize
        try:
            self._file.seek(start)
            if self._file.write(content) < len(content):
                raise OSError
        except OSError:  # the disk is full: the averages stay in memory, and free their place
            with self._file as file:
                file.seek(0)
                self._file = io.BytesIO(file.read(start))
            self._file.seek(start)
            self._file.write(content)
        self._sizes.append(averages.shape[1])

    def axis(self, axis: int) -> Array:
        """Return the averages (n,) of an axis."""
        column, end, begin = np.empty(len(self)), 0, 0
        for size in self._sizes:
            part = column[end : end + size]
            self._file.seek(begin + axis * part.nbytes)
            part[:] = np.frombuffer(self._file.read(part.nbytes))
            begin += self._axes * part.nbytes
            end += size
        return column


class SpectrumAccumulator:
    """Accumulator of a record in blocks, in pieces that are treated as independent."""

    def __init__(self, rate: float, axes: int) -> None:
        """Initialise for a record of some axes at a rate [Hz]."""
        from scipy.fft import dct  # imported only when a record is analysed

        self._dct = partial(dct, norm="ortho", axis=1, overwrite_x=True)
        self._dt = 1.0 / rate
        self._axes = axes
        count = int(np.ceil(np.log(0.5 / _SPLIT) / _WIDTH))
        self._edges = _SPLIT * (0.5 / _SPLIT) ** (np.arange(count + 1) / count)
        """(count + 1,) edges of the log-spaced bins of high frequencies [cycles per sample]."""
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
        self._segment = self._workspace = np.empty((axes, 0))
        """(axes, n) samples of the piece, and memory for their transform."""
        self._filled = 0
        self._offset: Array | None = None
        """(axes, 1) mean of the piece's first segment."""
        self._clusters: _Averages | None = None
        """Averages of the piece so far; None: there are none."""
        self._begin = self._samples = 0
        """Samples before the piece, and in all."""

    def add(self, y: Array) -> None:
        """Add the next readings (n, axes) of the piece."""
        if not self._segment.size:
            self._segment = np.empty((self._axes, _SEGMENT))
            self._workspace = np.empty((self._axes, _SEGMENT))
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
        self._segment = self._workspace = np.empty((self._axes, 0))
        if self._clusters is not None:
            self._add_low_part(self._clusters)
            self._clusters = None
        self._offset = None
        self._begin = self._samples

    def _add_low_part(self, averages: _Averages) -> None:
        """Take signals out of the averages of the piece, and add the rows below the split.

        One axis after the other: each needs several times the memory of its averages.
        """
        columns = (averages.axis(axis) for axis in range(self._axes))
        n = len(averages)
        bins = self._low_bins(n)
        sums: list[tuple[Array, Array]] = []
        without_doubtful: list[tuple[Array, Array]] = []
        shifts: list[LevelShift] = []
        for detected in find_signals(columns, _SPLIT * CLUSTER, CLUSTER * self._dt):
            self.signals += [_signal_in_samples(signal, self._begin) for signal in detected.certain]
            self.doubtful += [
                _signal_in_samples(signal, self._begin) for signal in detected.doubtful
            ]
            shifts += [signal for signal in detected.certain if isinstance(signal, LevelShift)]
            sums.append(self._low_sums(detected.without_certain, bins))
            without_doubtful.append(
                self._low_sums(detected.without_doubtful, bins) if detected.doubtful else sums[-1]
            )
            del detected
            release_memory()
        for shift in shifts:
            self._remove_shift(shift)
        self._low.append(self._low_part(sums, bins, n))
        self._low_without_doubtful.append(self._low_part(without_doubtful, bins, n))

    def _flush(self) -> None:
        """Transform the samples of the segment, add them to the bins, and keep their averages."""
        count, self._filled = self._filled, 0
        self._samples += count
        if count < _SHORTEST:
            return
        y = self._segment[:, :count]
        whole = count // CLUSTER * CLUSTER
        if self._clusters is None:
            self._clusters = _Averages(self._axes)
        self._clusters.add(y[:, :whole].reshape(self._axes, -1, CLUSTER).mean(axis=2))
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
        return _Bins(
            begin=begin,
            end=end,
            starts=starts,
            used=bins[starts],
            freedom=freedom,
            log_frequency=log_frequency,
        )

    def _low_bins(self, n: int) -> _LowBins:
        """Return the bins of the coefficients of n averages.

        The first coefficients are rows of their own, the others are in log-spaced bins.
        """
        end = int(np.ceil(2.0 * n * _SPLIT * CLUSTER))  # the first coefficient at the split
        order = np.arange(1, end)
        edges = np.arange(min(_SINGLE, len(order)))
        if len(order) > _SINGLE:
            count = int(np.ceil(np.log(len(order) / _SINGLE) / _WIDTH)) + 1
            bins = np.geomspace(_SINGLE, len(order), count).astype(np.int64)
            edges = np.unique(np.concatenate([edges, bins[bins < len(order)]]))
        return _LowBins(order, edges, np.diff(np.append(edges, len(order))).astype(np.float64))

    def _low_sums(self, cleaned: Cleaned, bins: _LowBins) -> tuple[Array, Array]:
        """Return the first coefficient (m,) of each bin of an axis, and the sum (m,) of squares."""
        values, inflation = cleaned
        order, edges, _ = bins
        centred = (values - values.mean())[None]
        interval = CLUSTER * self._dt
        coefficient = self._dct(centred)[:, 1 : len(order) + 1] * np.sqrt(interval)
        shared = min(len(order), len(inflation))
        coefficient[:, :shared] *= inflation[:shared]
        amplitude = coefficient[0, edges]
        return amplitude, self._sums_of_squares(coefficient, edges)[0]

    def _low_part(self, sums: Iterable[tuple[Array, Array]], bins: _LowBins, n: int) -> Spectrum:
        """Return the rows of a piece of n averages below the split.

        :param sums: the results of :meth:`_low_sums` of each axis.
        """
        order, edges, freedom = bins
        amplitude, squares = (np.stack(columns, axis=1) for columns in zip(*sums, strict=True))
        interval = CLUSTER * self._dt
        mean_order = np.exp(np.add.reduceat(np.log(order), edges) / freedom)
        single = freedom == 1
        return Spectrum(
            frequency=mean_order / (2.0 * n * interval),
            power=squares / freedom[:, None],
            freedom=freedom,
            order=np.where(single, mean_order.round(), 0.0),
            interval=np.full(len(edges), interval),
            duration=np.full(len(edges), n * interval),
            amplitude=np.where(single[:, None], amplitude, 0.0),
            sample_interval=self._dt,
        )

    def result(self, *, doubtful: bool = True) -> Spectrum:
        """Return the rows of all pieces, low frequencies first.

        :param doubtful: include the lines that may exist or not.
        """
        used = self._freedom > 0
        freedom = self._freedom[used]
        frequency = np.exp(self._log_frequency[used] / freedom) / self._dt
        high = Spectrum(
            frequency=frequency,
            power=self._sums[used] * self._dt / freedom[:, None],
            freedom=freedom,
            order=np.zeros(len(freedom)),
            interval=np.full(len(freedom), self._dt),
            duration=np.full(len(freedom), np.inf),
            amplitude=np.zeros((len(freedom), self._axes)),
            sample_interval=self._dt,
        )
        parts = [*(self._low if doubtful else self._low_without_doubtful), high]
        # All fields but the last, the sample interval, are arrays.
        columns = zip(*(part[:-1] for part in parts), strict=True)
        return Spectrum._make([*map(np.concatenate, columns), self._dt])


def _signal_in_samples(signal: Signal, begin: int) -> Signal:
    """Return a signal in averages of samples as one in samples.

    :param begin: samples before the first average.
    """
    if isinstance(signal, Line):
        return signal._replace(frequency=signal.frequency / CLUSTER)
    if isinstance(signal, LevelShift):
        return signal._replace(position=begin + signal.position * CLUSTER)
    return signal._replace(time_constant=signal.time_constant * CLUSTER)
