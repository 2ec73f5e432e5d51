# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""A stream of readings reduced to the few numbers that plots need, whatever its length.

Readings and intervals are kept as the lowest and highest of each of some 500 parts. The spectrum is
Welch's (P. D. Welch, IEEE Trans. Audio and Electroacoustics 15, 1967): Hann windows that overlap by
half. Its root is drawn two-sided, so that white noise of density ``D`` lies at ``D``.
"""

import itertools
from collections.abc import Iterable
from typing import Final, NamedTuple, Protocol

import numpy as np
from numpy.typing import NDArray

from imu_sim_ros.calibration.noise import Deviation, DeviationAccumulator

Array = NDArray[np.float64]
Times = NDArray[np.int64]

PARTS: Final = 500
"""Columns of a picture: a plot of half the page's width has about as many pixels."""
_SEGMENT: Final = 4096
_PER_DECADE: Final = 60
GAP: Final = 1.5
"""Intervals above which a gap is counted, in usual intervals."""
_MOST_GAPS: Final = 1000


class Readings(Protocol):
    """A block of readings."""

    @property
    def t_ns(self) -> Times:
        """(n,) stamps."""

    @property
    def gyro(self) -> Array:
        """(n, 3) rad/s."""

    @property
    def accel(self) -> Array:
        """(n, 3) m/s^2."""


class Gap(NamedTuple):
    """Two neighbouring stamps that are too far apart or out of order."""

    at_s: float
    """Since the first stamp."""
    interval_s: float


class Stream(NamedTuple):
    """What is drawn of a stream; axes are gyroscope x y z, accelerometer x y z."""

    samples: int
    first_ns: int
    duration_s: float
    interval_s: float
    """The median of the intervals of the first block."""
    gaps: list[Gap]
    gap_count: int
    t_s: Array
    """(m,) middles of the parts."""
    low: Array
    """(m, 6)."""
    high: Array
    """(m, 6)."""
    shortest: Array
    """(m,) shortest interval of each part [s]."""
    longest: Array
    """(m,) longest interval of each part [s]."""
    frequency: Array
    """(k,) Hz."""
    density: Array
    """(k, 6) two-sided, unit/sqrt(Hz)."""
    deviation: Deviation


def extremes(values: Array, columns: int = PARTS) -> NDArray[np.intp]:
    """Return the rows that a picture needs: the first, the last, each column's least and largest.

    :param values: (n,) or (n, k), of each of whose k there are extremes.
    :param columns: of the picture.
    """
    table = values.reshape(len(values), -1)
    starts = np.unique(np.linspace(0, len(table), columns + 1).astype(np.intp))
    parts = [table[a:b] for a, b in itertools.pairwise(starts.tolist())]
    found = [
        start + end(part, axis=0)
        for start, part in zip(starts.tolist(), parts, strict=False)
        for end in (np.argmin, np.argmax)
    ]
    return np.unique(np.concatenate([[0, len(table) - 1], *found]))


def analyse(blocks: Iterable[Readings], count: int) -> Stream | None:
    """Return what is drawn of a stream; None where there are fewer than two readings.

    :param count: of the readings, about; it sets how many make a part.
    """
    analysis: _Analysis | None = None
    waiting: list[Readings] = []
    for block in blocks:
        if analysis is None:
            waiting.append(block)
            stamps = np.concatenate([one.t_ns for one in waiting])
            steps = np.diff(stamps)
            if not (steps > 0).any():
                continue
            interval = float(np.median(steps[steps > 0])) * 1e-9
            analysis = _Analysis(int(stamps[0]), interval, max(1, -(-count // PARTS)))
            for one in waiting:
                analysis.add(one)
        else:
            analysis.add(block)
    return None if analysis is None else analysis.result()


class _Analysis:
    """Takes a stream block by block."""

    def __init__(self, first_ns: int, interval: float, part: int) -> None:
        self._first, self._interval, self._part = first_ns, interval, part
        self._samples, self._last = 0, first_ns
        self._rest_t, self._rest = np.empty(0), np.empty((0, 7))
        self._rows: list[tuple[Array, Array, Array]] = []
        self._gaps: list[Gap] = []
        self._gap_count = 0
        self._spectrum = _Spectrum(1.0 / interval)
        self._deviation = DeviationAccumulator(1.0 / interval, 6)

    def add(self, block: Readings) -> None:
        if not len(block.t_ns):
            return
        values = np.column_stack([block.gyro, block.accel])
        before = self._last if self._samples else int(block.t_ns[0])
        steps: Array = np.diff(block.t_ns, prepend=before) * 1e-9
        t_s = (block.t_ns - self._first) * 1e-9
        torn = (steps > GAP * self._interval) | (steps <= 0.0)
        if not self._samples:
            torn[0] = False
            steps[0] = self._interval
        self._gap_count += int(torn.sum())
        for k in np.flatnonzero(torn)[: _MOST_GAPS - len(self._gaps)]:
            self._gaps.append(Gap(float(t_s[k]), float(steps[k])))
        self._pieces(values, torn)
        self._samples += len(values)
        self._last = int(block.t_ns[-1])
        self._parts(np.asarray(t_s, dtype=np.float64), np.column_stack([values, steps]))

    def _pieces(self, values: Array, torn: NDArray[np.bool_]) -> None:
        """Pass the readings between gaps to the spectrum and the Allan deviation."""
        cuts = np.flatnonzero(torn).tolist()
        if len(cuts) > _MOST_GAPS:  # a stream that is nothing but gaps: no piece is worth it
            cuts = cuts[:_MOST_GAPS]
        for number, (first, last) in enumerate(zip([0, *cuts], [*cuts, len(values)], strict=True)):
            if number:
                self._deviation.end_piece()
                self._spectrum.end_piece()
            piece = values[first:last]
            if len(piece) and np.isfinite(piece).all():
                self._deviation.add(piece)
                self._spectrum.add(piece)

    def _parts(self, t_s: Array, table: Array) -> None:
        self._rest_t = np.concatenate([self._rest_t, t_s])
        self._rest = np.concatenate([self._rest, table])
        whole = len(self._rest) // self._part * self._part
        self._reduce(whole)

    def _reduce(self, whole: int) -> None:
        if not whole:
            return
        times = self._rest_t[:whole].reshape(-1, min(self._part, whole))
        parts = self._rest[:whole].reshape(len(times), -1, 7)
        self._rows.append((times.mean(axis=1), parts.min(axis=1), parts.max(axis=1)))
        self._rest_t, self._rest = self._rest_t[whole:], self._rest[whole:]

    def result(self) -> Stream:
        self._reduce_last()
        t_s, low, high = (np.concatenate(column) for column in zip(*self._rows, strict=True))
        self._deviation.end_piece()
        self._spectrum.end_piece()
        frequency, density = self._spectrum.result()
        return Stream(
            self._samples,
            self._first,
            (self._last - self._first) * 1e-9,
            self._interval,
            self._gaps,
            self._gap_count,
            t_s,
            low[:, :6],
            high[:, :6],
            low[:, 6],
            high[:, 6],
            frequency,
            density,
            self._deviation.result(),
        )

    def _reduce_last(self) -> None:
        if len(self._rest):
            self._part = len(self._rest)
            self._reduce(len(self._rest))


class _Spectrum:
    """Welch's estimate over pieces that need not be contiguous."""

    def __init__(self, rate: float) -> None:
        self._rate = rate
        self._window = np.hanning(_SEGMENT + 1)[:-1, None]
        self._rest = np.empty((0, 6))
        self._total = np.zeros((_SEGMENT // 2 + 1, 6))
        self._count = 0
        self._shorter: Array | None = None

    def add(self, values: Array) -> None:
        self._rest = np.concatenate([self._rest, values])
        half = _SEGMENT // 2
        while len(self._rest) >= _SEGMENT:
            segment = self._rest[:_SEGMENT]
            self._total += (
                np.abs(np.fft.rfft(self._window * (segment - segment.mean(axis=0)), axis=0)) ** 2
            )
            self._count += 1
            self._rest = self._rest[half:]

    def end_piece(self) -> None:
        if self._shorter is None or len(self._rest) > len(self._shorter):
            self._shorter = self._rest
        self._rest = np.empty((0, 6))

    def result(self) -> tuple[Array, Array]:
        """Return frequencies (k,) and densities (k, 6), averaged in steps of equal ratio."""
        total, window, count = self._total, self._window, self._count
        if not count:  # a record shorter than a segment: all of it is one
            values = np.empty((0, 6)) if self._shorter is None else self._shorter
            if len(values) < 16:
                return np.empty(0), np.empty((0, 6))
            window, count = np.hanning(len(values) + 1)[:-1, None], 1
            total = np.abs(np.fft.rfft(window * (values - values.mean(axis=0)), axis=0)) ** 2
        # Two-sided density of a periodogram: |X|^2 / (rate * sum of the squared window).
        power = total / (count * self._rate * float(np.sum(window**2)))
        frequency = np.fft.rfftfreq(len(window), 1.0 / self._rate)
        frequency, power = frequency[2:-1], power[2:-1]
        bins = np.unique(np.floor(np.log10(frequency) * _PER_DECADE), return_index=True)[1]
        size = np.diff(bins, append=len(frequency))
        middle = np.add.reduceat(frequency, bins) / size
        return middle, np.sqrt(np.add.reduceat(power, bins, axis=0) / size[:, None])
