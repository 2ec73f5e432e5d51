# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Random processes: Gauss-Markov, exactly discretised in chunks of a fixed size, and events."""

import itertools
import math
from abc import ABC, abstractmethod
from typing import Final

import numpy as np
from numpy.typing import ArrayLike

from imu_sim_ros.random_streams import Seed, Streams, Units, generator
from imu_sim_ros.types import Array, Times

_AT_ONCE: Final = 8192
"""Values of a column generated at once, as far as whole chunks allow: they stay in the cache."""


class ChunkedProcess(ABC):
    """Processes of one unit or of the units of a batch; values do not depend on blocks."""

    def __init__(self, length: int, shape: tuple[int, ...]) -> None:
        """Start with nothing generated.

        :param length: values in a chunk.
        :param shape: (columns,) of one unit, (count, columns) of a batch.
        """
        self._length = length
        self._left = np.empty((0, *shape))
        """Generated and not yet read; of a batch a whole chunk, if a block is shorter than that."""
        self._read = np.zeros(shape[:-1], np.int64)
        """Of each unit of a batch, how many values of its chunk."""

    @abstractmethod
    def _make_chunks(self, count: int, units: Units) -> Array:
        """Return the next values (count * length, ..., columns), those of ``count`` chunks."""

    def next_block(self, count: int, units: Units = ...) -> Array:
        """Return the next values (count, ..., columns), a new array.

        :param count: for a batch, a divisor of the chunk's length.
        """
        if self._read.ndim:
            return self._next_of(units, count)
        left = self._left
        if count <= len(left):
            self._left = left[count:]
            return np.copy(left[:count])
        parts, done = [left], len(left)
        while done < count:
            chunks = min(-((done - count) // self._length), max(1, _AT_ONCE // self._length))
            parts.append(self._make_chunks(chunks, units))
            done += chunks * self._length
        last = parts[-1]
        used = len(last) - (done - count)
        self._left, parts[-1] = last[used:], last[:used]
        return np.concatenate(parts)

    def _next_of(self, units: Units, count: int) -> Array:
        """Return the next values of units of a batch, each of which is somewhere in its chunk."""
        if count == self._length:
            return self._make_chunks(1, units)
        if not len(self._left):
            self._left = np.empty((self._length, *self._left.shape[1:]))
        units = np.arange(len(self._read))[units]
        new = units[self._read[units] == 0]
        if len(new):
            self._left[:, new] = self._make_chunks(1, new)
        first = self._read[units]
        self._read[units] = (first + count) % self._length
        taken: Array = self._left[first + np.arange(count)[:, None], units]
        return taken


_ROWS = 32
_COLUMNS = 32
CHUNK = _ROWS * _COLUMNS


class GaussMarkovBank(ChunkedProcess):
    """Stationary Gauss-Markov processes of unit variance, one for each axis."""

    def __init__(self, seed: Seed, source: str, correlation_times: ArrayLike, dt: float) -> None:
        """Draw the initial states from the stationary distribution.

        :param correlation_times: (..., 3) [s], > 0.
        :param dt: time between two samples [s].
        """
        shape = (*np.shape(seed), 3)
        super().__init__(CHUNK, shape)
        self._streams = Streams(seed, source)
        self._exponent = -dt / np.broadcast_to(np.asarray(correlation_times, np.float64), shape)
        self._state = self._streams.next(1)[0]

    def begin(self, units: Units) -> None:
        """Let some units of a batch begin again, from their present seeds."""
        self._streams.begin(units)
        self._state[units] = self._streams.next(1, units)[0]
        self._read[units] = 0

    def _make_chunks(self, count: int, units: Units) -> Array:
        exponent = self._exponent[units][..., None, None]  # axes are (..., axis, chunk, row)
        drive, phi = np.sqrt(-np.expm1(2.0 * exponent)), np.exp(exponent)
        numbers = np.moveaxis(self._streams.next(count * CHUNK, units), 0, -1)
        numbers = numbers.reshape(*exponent.shape[:-2], count, _COLUMNS, _ROWS)
        # One column after the other, so each is contiguous: (column, ..., axis, chunk, row).
        table = np.empty((_COLUMNS, *exponent.shape[:-2], count, _ROWS))
        np.multiply(np.moveaxis(numbers, -2, 0), drive, out=table)
        carried = np.empty(table.shape[1:])
        for before, column in itertools.pairwise(table):
            column += np.multiply(phi, before, out=carried)
        starts = self._row_starts(table[-1], exponent, units)
        columns = np.arange(1, _COLUMNS + 1).reshape(-1, *(1,) * exponent.ndim)
        decay = np.exp(exponent * columns)
        np.multiply(decay, starts, out=(added := numbers.reshape(table.shape)))
        table += added
        made = np.moveaxis(table, 0, -1).reshape(*exponent.shape[:-2], count * CHUNK)
        return np.moveaxis(made, -1, 0)

    def _row_starts(self, ends: Array, exponent: Array, units: Units) -> Array:
        """Return the value before each row from the ends of rows that start at 0.

        Both are (..., axis, chunk, row); the state goes on to the end of the last chunk.
        """
        row_decay = np.exp(exponent * _COLUMNS * np.arange(_ROWS))
        reached, carried, step = ends.copy(), np.empty_like(ends), 1
        while step < _ROWS:  # a scan by doubling: five passes instead of 32 steps
            decay = row_decay[..., step, None]
            np.multiply(decay, reached[..., :-step], out=carried[..., step:])
            after = reached[..., step:]
            np.add(after, carried[..., step:], out=after)
            step *= 2
        # The states between the chunks, one after the other: a few numbers each.
        over_row, over_rows = np.exp(exponent * _COLUMNS)[..., 0, 0], row_decay[..., 0, :]
        states, state = np.empty(ends.shape[:-1]), self._state[units]
        for chunk in range(ends.shape[-2]):
            states[..., chunk] = state
            last = over_rows[..., -1] * state
            last += reached[..., chunk, -2]
            state = ends[..., chunk, -1] + over_row * last
        self._state[units] = state
        starts: Array = row_decay * states[..., None]
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
