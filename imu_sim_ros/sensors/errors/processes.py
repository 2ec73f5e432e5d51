# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Random processes: Gauss-Markov, exactly discretised in chunks of a fixed size, and events."""

import itertools
import math
from abc import ABC, abstractmethod
from collections.abc import Sequence
from typing import Final

import numpy as np
from numpy.random import Generator

from imu_sim_ros.random_streams import generator
from imu_sim_ros.types import Array, Times

_AT_ONCE: Final = 8192
"""Values of a column generated at once, as far as whole chunks allow: they stay in the cache."""


class ChunkedProcess(ABC):
    """One process for each random stream; a value does not depend on the blocks it is read in."""

    def __init__(self, streams: Sequence[Generator], length: int, columns: int = 0) -> None:
        """Start with nothing generated.

        :param length: values in a chunk.
        :param columns: of a chunk; 0: one for each stream.
        """
        self._streams = streams
        self._length = length
        self._left = np.empty((0, columns or len(streams)))
        """Generated and not yet read."""

    @abstractmethod
    def _make_chunks(self, count: int) -> Array:
        """Return the next values (count * length, columns), those of ``count`` chunks."""

    def next_block(self, count: int) -> Array:
        """Return the next values (count, columns of a chunk), a new array."""
        left = self._left
        if count <= len(left):
            self._left = left[count:]
            return np.copy(left[:count])
        parts, done = [left], len(left)
        while done < count:
            chunks = min(-((done - count) // self._length), max(1, _AT_ONCE // self._length))
            parts.append(self._make_chunks(chunks))
            done += chunks * self._length
        last = parts[-1]
        used = len(last) - (done - count)
        self._left, parts[-1] = last[used:], last[:used]
        return np.concatenate(parts)


_ROWS = 32
_COLUMNS = 32
CHUNK = _ROWS * _COLUMNS


class GaussMarkovBank(ChunkedProcess):
    """Sums of stationary unit-variance Gauss-Markov processes, one sum for each axis."""

    def __init__(self, streams: list[Generator], correlation_times: Array, dt: float) -> None:
        """Draw the initial states from the stationary distribution.

        :param streams: one for each of the a axes.
        :param correlation_times: (a, p) of the p processes that are summed on each axis [s], > 0.
        :param dt: time between two samples [s].
        """
        super().__init__(streams, CHUNK)
        # Axes are (axis, process, chunk, row), behind columns if there are any.
        exponent = (-dt / correlation_times)[:, :, None, None]
        self._drive = np.sqrt(-np.expm1(2.0 * exponent))
        self._phi = np.exp(exponent)
        columns = np.arange(1, _COLUMNS + 1).reshape(-1, 1, 1, 1, 1)
        self._column_decay = np.exp(exponent * columns)
        self._row_decay = np.exp(exponent * _COLUMNS * np.arange(_ROWS))
        self._state = np.stack([s.standard_normal(correlation_times.shape[1]) for s in streams])

    def _make_chunks(self, count: int) -> Array:
        axes, processes = self._state.shape
        numbers = np.empty((axes, count, _COLUMNS, processes, _ROWS))
        for stream, own in zip(self._streams, numbers, strict=True):
            stream.standard_normal(out=own)
        # One column after the other, so each is contiguous: (column, axis, process, chunk, row).
        table = np.empty((_COLUMNS, axes, processes, count, _ROWS))
        np.multiply(numbers.transpose(2, 0, 3, 1, 4), self._drive, out=table)
        carried = np.empty(table.shape[1:])
        for before, column in itertools.pairwise(table):
            column += np.multiply(self._phi, before, out=carried)
        starts = self._row_starts(table[-1])
        np.multiply(self._column_decay, starts, out=(added := numbers.reshape(table.shape)))
        table += added
        total = table[:, :, 0] if processes == 1 else table.sum(axis=2)
        return total.transpose(1, 2, 3, 0).reshape(axes, count * CHUNK).T

    def _row_starts(self, ends: Array) -> Array:
        """Return the value before each row from the ends of rows that start at 0.

        Both are (axis, process, chunk, row); the state goes on to the end of the last chunk.
        """
        reached, carried, step = ends.copy(), np.empty_like(ends), 1
        while step < _ROWS:  # a scan by doubling: five passes instead of 32 steps
            decay = self._row_decay[..., step, None]
            np.multiply(decay, reached[..., :-step], out=carried[..., step:])
            after = reached[..., step:]
            np.add(after, carried[..., step:], out=after)
            step *= 2
        # The states between the chunks, one after the other: a few numbers each.
        over_row, over_rows = self._column_decay[-1, ..., 0, 0], self._row_decay[..., 0, :]
        states = np.empty(ends.shape[:3])
        for chunk in range(ends.shape[2]):
            states[..., chunk] = self._state
            last = over_rows[..., -1] * self._state
            last += reached[:, :, chunk, -2]
            self._state = ends[:, :, chunk, -1] + over_row * last
        starts: Array = self._row_decay * states[..., None]
        starts[..., 1:] += reached[..., :-1]
        return starts


class Events:
    """A Poisson process: jumps, outages, slipping wheels.

    Events last for exponentially distributed times; none overlap.
    """

    def __init__(self, seed: int, source: str, rate: float, duration: float, dt: float) -> None:
        """Start before the first event.

        :param source: the first part of the names of its random streams.
        """
        self._begins, self._lengths = (generator(seed, f"{source}{part}") for part in ("", "_end"))
        self._probability = -math.expm1(-rate * dt)
        self._duration = duration / dt
        self._done = self._end = self.count = 0

    def next(self, count: int) -> Times:
        """Return the number of the event (count,), from 1, that each sample lies in; 0: none."""
        found = np.zeros(count, np.int64)
        if not self._probability:
            return found
        first = self._done
        if self._end > first:
            found[: self._end - first] = self.count
        for k in np.flatnonzero(self._begins.random(count) < self._probability):
            if first + k >= self._end:
                self.count += 1
                length = max(1, math.ceil(self._lengths.exponential() * self._duration))
                self._end = first + int(k) + length
                found[k : k + length] = self.count
        self._done = first + count
        return found
