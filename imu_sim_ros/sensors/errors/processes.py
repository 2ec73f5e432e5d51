# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Random processes: Gauss-Markov, 1/f noise, and events.

The first two are made in chunks that start at fixed sample indices and are generated whole, so that
values do not depend on how many are asked for at a time. A chunk is some rows of 32 values: what
happens within a row is the same for all rows, and the states before the rows follow by a scan.
"""

import itertools
import math
from abc import ABC, abstractmethod
from collections.abc import Callable, Iterator
from functools import lru_cache
from typing import Final, NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from imu_sim_ros.core.random_streams import Seed, Streams, Units, axes_first, generator
from imu_sim_ros.core.types import Array, Mask, Times

_AT_LEAST: Final = 1024
"""Values of a column generated at once for blocks that are shorter."""
_AT_ONCE: Final = 8192
"""Values of a column generated at once, as far as whole chunks allow: they stay in the cache."""


class ChunkedProcess(ABC):
    """Processes of one unit or of the units of a batch; values do not depend on blocks."""

    def __init__(self, length: int, shape: tuple[int, ...]) -> None:
        """Initialise without generated values.

        :param length: values in a chunk.
        :param shape: shape of a value: (columns,) for one unit, (count, columns) for a batch.
        """
        self._length = length
        self._left = np.empty((0, *shape))
        """Generated and not yet read; of a batch a whole chunk, if a block is shorter than that."""
        self._read = np.zeros(shape[:-1], np.int64)
        """Number of values already read from the chunk of each unit of a batch."""

    @abstractmethod
    def _make_chunks(self, count: int, units: Units) -> Array:
        """Return the next values (count * length, ..., columns), those of ``count`` chunks."""

    def next_block(self, count: int, units: Units = ...) -> Array:
        """Return the next values (count, ..., columns), a new array.

        :param count: for a batch, a divisor of the chunk's length.
        """
        if self._read.ndim:
            return self._next_of(units, count)
        remaining = self._left
        if count <= len(remaining):
            self._left = remaining[count:]
            return np.copy(remaining[:count])
        parts, done = [remaining], len(remaining)
        while done < count:
            chunks = -((done - count) // self._length)
            chunks = max(min(chunks, _AT_ONCE // self._length), _AT_LEAST // self._length, 1)
            parts.append(self._make_chunks(chunks, units))
            done += chunks * self._length
        last_part = parts[-1]
        used = len(last_part) - (done - count)
        self._left, parts[-1] = last_part[used:], last_part[:used]
        return parts[-1] if used == count else np.concatenate(parts)

    def _next_of(self, units: Units, count: int) -> Array:
        """Return the next values of units of a batch, each of which is somewhere in its chunk."""
        if count == self._length:
            return self._make_chunks(1, units)
        if not len(self._left):
            self._left = np.empty((self._length, *self._left.shape[1:]))
        units = np.arange(len(self._read))[units]
        exhausted = units[self._read[units] == 0]
        if len(exhausted):
            self._left[:, exhausted] = self._make_chunks(1, exhausted)
        begin = self._read[units]
        self._read[units] = (begin + count) % self._length
        values: Array = self._left[begin + np.arange(count)[:, None], units]
        return values


_COLUMNS: Final = 32
"""Values in a row."""
_MARKOV_ROWS: Final = 32
"""Rows of a chunk of a Gauss-Markov process."""
MARKOV_CHUNK: Final = _MARKOV_ROWS * _COLUMNS


class GaussMarkovBank(ChunkedProcess):
    """Stationary Gauss-Markov processes of unit variance, one for each axis."""

    def __init__(self, seed: Seed, source: str, correlation_times: ArrayLike, dt: float) -> None:
        """Draw the initial states from the stationary distribution.

        :param correlation_times: (..., 3) [s], > 0.
        :param dt: time between two samples [s].
        """
        shape = (*np.shape(seed), 3)
        super().__init__(MARKOV_CHUNK, shape)
        self._streams = Streams(seed, source)
        self._exponent = -dt / np.broadcast_to(np.asarray(correlation_times, np.float64), shape)
        self._state = self._streams.next(1)[0]

    def begin(self, units: Units) -> None:
        """Restart some units of a batch from their current seeds."""
        self._streams.begin(units)
        self._state[units] = self._streams.next(1, units)[0]
        self._read[units] = 0

    def _make_chunks(self, count: int, units: Units) -> Array:
        """Return the next chunks of the processes of some units."""
        exponent = self._exponent[units][..., None, None]  # axes are (..., axis, chunk, row)
        drive, phi = np.sqrt(-np.expm1(2.0 * exponent)), np.exp(exponent)
        numbers = axes_first(self._streams.next(count * MARKOV_CHUNK, units))
        numbers = numbers.reshape(*exponent.shape[:-2], count, _COLUMNS, _MARKOV_ROWS)
        # One column after the other, so each is contiguous: (column, ..., axis, chunk, row).
        table = np.empty((_COLUMNS, *exponent.shape[:-2], count, _MARKOV_ROWS))
        np.multiply(np.moveaxis(numbers, -2, 0), drive, out=table)
        carried = np.empty(table.shape[1:])
        for previous, column in itertools.pairwise(table):
            column += np.multiply(phi, previous, out=carried)
        starts = self._row_starts(table[-1], exponent, units)
        columns = np.arange(1, _COLUMNS + 1).reshape(-1, *(1,) * exponent.ndim)
        decay = np.exp(exponent * columns)
        np.multiply(decay, starts, out=(added := numbers.reshape(table.shape)))
        table += added
        chunks = np.moveaxis(table, 0, -1).reshape(*exponent.shape[:-2], count * MARKOV_CHUNK)
        return np.moveaxis(chunks, -1, 0)

    def _row_starts(self, ends: Array, exponent: Array, units: Units) -> Array:
        """Return the value before each row from the ends of rows that start at 0.

        Both are (..., axis, chunk, row); the state goes on to the end of the last chunk.
        """
        row_decay = np.exp(exponent * _COLUMNS * np.arange(_MARKOV_ROWS))
        reached, carried, step = ends.copy(), np.empty_like(ends), 1
        while step < _MARKOV_ROWS:  # a scan by doubling: five passes instead of 32 steps
            decay = row_decay[..., step, None]
            np.multiply(decay, reached[..., :-step], out=carried[..., step:])
            final = reached[..., step:]
            np.add(final, carried[..., step:], out=final)
            step *= 2
        # The states between the chunks, one after the other: a few numbers each.
        over_row, over_rows = np.exp(exponent * _COLUMNS)[..., 0, 0], row_decay[..., 0, :]
        states, state = np.empty(ends.shape[:-1]), self._state[units]
        for chunk in range(ends.shape[-2]):
            states[..., chunk] = state
            last_row = over_rows[..., -1] * state
            last_row += reached[..., chunk, -2]
            state = ends[..., chunk, -1] + over_row * last_row
        self._state[units] = state
        starts: Array = row_decay * states[..., None]
        starts[..., 1:] += reached[..., :-1]
        return starts


LONGEST_TIME: Final = 1e4
"""[s]; below 1 / (2 pi LONGEST_TIME) the density is flat."""
_RATIO: Final = float(np.sqrt(10.0))
_HIGHEST_CORNER: Final = 2.0 * float(np.sqrt(_RATIO))
_GAIN, _ZERO, _POLE = 0.9328682, -0.36991621, -0.27052661
_FLICKER_ROWS: Final = 4
"""Rows of a chunk of flicker noise."""
FLICKER_CHUNK: Final = _FLICKER_ROWS * _COLUMNS


class FlickerFilter(NamedTuple):
    """``H = direct + sum_p gains_p / (1 - poles_p z^-1)`` with ``|H|^2 = 1 / (2 pi f dt)``.

    In ``S = 2 sin(w / 2)``, w = 2 pi f dt, a real pole or zero phi of a discrete filter is an exact
    first-order corner: ``|1 - phi e^(-i w)|^2 = phi (S^2 + (1 - phi)^2 / phi)``. Poles at corners
    S_p that are half a decade apart, with zeros midway (on the logarithmic axis) above them,
    therefore give ``|H|^2 = 1 / S`` with a ripple below 0.1 % (Keshner, "1/f noise", Proc. IEEE 70,
    1982). One more pole and zero turn 1/S into 1/w: within 3.2 % up to the Nyquist frequency
    (minimax; tested).
    """

    poles: Array
    """(p,) poles phi."""
    gains: Array
    """(p,) gains of the poles."""
    direct: float

    @classmethod
    def design(cls, dt: float) -> "FlickerFilter":
        """Return the filter for a sample interval [s]."""
        count = max(int(np.ceil(np.log(_HIGHEST_CORNER * LONGEST_TIME / dt) / np.log(_RATIO))), 1)
        corners = _HIGHEST_CORNER * _RATIO ** -np.arange(count + 1.0)
        # 1 - phi, which at the low end has the digits that phi has not.
        distances = np.append(_pole_complement(corners), 1.0 - _POLE)
        below_zeros = np.append(_pole_complement(corners * np.sqrt(_RATIO)), 1.0 - _ZERO)
        poles, zeros = 1.0 - distances, 1.0 - below_zeros
        diagonal = np.eye(len(poles), dtype=bool)
        ratio = (below_zeros[None, :] - distances[:, None]) / poles[:, None]
        distance = np.where(
            diagonal, 1.0, (distances[None, :] - distances[:, None]) / poles[:, None]
        )
        gains = _GAIN * np.prod(ratio / distance, axis=1)
        return cls(poles, gains, float(_GAIN * np.prod(zeros / poles)))

    def density(self, angle: Array) -> Array:
        """Return ``|H|^2`` at angular frequencies per sample ``2 pi f dt``."""
        delay = np.exp(-1j * np.atleast_1d(angle))[:, None]
        response = self.direct + np.sum(self.gains / (1.0 - self.poles * delay), axis=1)
        return np.abs(response) ** 2


def _pole_complement(corner: Array) -> Array:
    """Return ``1 - phi`` of a pole at a corner: ``(1 - phi)^2 / phi = S^2``."""
    return corner * (np.sqrt(1.0 + 0.25 * corner**2) - 0.5 * corner)


class _Rows(NamedTuple):
    """The filter's recursion in rows of C samples; no seed is in it."""

    from_noise: Array
    """(C, C + p) map from a row's noise to its values, and to the states at its end."""
    from_state: Array
    """(p, C) map from the states to a row's values."""
    decay: Array
    """(R + 1, 3 p) decay of the states of three axes over k rows."""
    root: Array
    """(p, p) root of the stationary covariance of the states."""


@lru_cache(maxsize=8)
def _rows(dt: float) -> _Rows:
    """Return the filter of flicker noise for whole chunks."""
    design = FlickerFilter.design(dt)
    poles, gains = design.poles, design.gains
    powers = poles ** np.arange(_COLUMNS + 1)[:, None]  # (C + 1, p)
    impulse = powers[:-1] @ gains
    impulse[0] += design.direct
    lag = np.subtract.outer(np.arange(_COLUMNS), np.arange(_COLUMNS))
    lower_triangle = np.where(lag >= 0, impulse[np.abs(lag)], 0.0)
    # Covariance of recursions that see the same unit noise: 1 / (1 - phi_i phi_j).
    covariance = 1.0 / (1.0 - np.outer(poles, poles))
    return _Rows(
        np.concatenate([lower_triangle.T, powers[:-1][::-1]], axis=1),
        np.ascontiguousarray((powers[1:] * gains).T),
        np.tile(poles ** (_COLUMNS * np.arange(_FLICKER_ROWS + 1.0))[:, None], 3),
        np.asarray(np.linalg.cholesky(covariance), dtype=np.float64),
    )


class FlickerNoise(ChunkedProcess):
    """1/f noise of density ``1 / (2 pi f)``, stationary from the first sample on.

    White noise through a filter from the lowest frequency that matters to Nyquist. It is run as a
    sum of first-order recursions that all see the same white noise, so that it costs one random
    number a sample. Within a row the response to the row's own noise and to the state before it
    are two products with constant matrices.
    """

    def __init__(self, seed: Seed, source: str, dt: float) -> None:
        """Draw the initial states from the stationary distribution.

        :param dt: time between two samples [s].
        """
        super().__init__(FLICKER_CHUNK, (*np.shape(seed), 3))
        self._streams = Streams(seed, source)
        self._rows = _rows(dt)
        self._state = self._draw_states(...)

    def begin(self, units: Units) -> None:
        """Restart some units of a batch from their current seeds."""
        self._streams.begin(units)
        self._state[units] = self._draw_states(units)

    def _draw_states(self, units: Units) -> Array:
        """Return initial states (..., 3, p)."""
        root = self._rows.root
        numbers = axes_first(self._streams.next(len(root), units))
        # A vector at a time: the sums are the same for one unit and for many.
        return np.matmul(root, numbers[..., None])[..., 0]

    def _make_chunks(self, count: int, units: Units) -> Array:
        """Return the next chunks of flicker noise of some units.

        A chunk is R rows of C samples. First each row is filtered as if its state were zero at its
        start; then the states at the starts follow from those at the ends, decayed over the rows
        between; last their responses are added.
        """
        rows, state = self._rows, self._state[units]
        *several, _, poles = state.shape
        numbers = axes_first(self._streams.next(count * FLICKER_CHUNK, units))
        # All rows of a unit's chunk in a product: its size, and so its sums, never differ.
        noise = numbers.reshape(*several, 3, count, _FLICKER_ROWS, _COLUMNS).swapaxes(-4, -3)
        filtered = noise.reshape(*several, count, 3 * _FLICKER_ROWS, _COLUMNS) @ rows.from_noise
        by_row = filtered[..., _COLUMNS:].reshape(*several, count, 3, _FLICKER_ROWS, poles)
        # States at the ends of rows that start at 0: (row, ..., chunk, states of three axes).
        ends = np.ascontiguousarray(np.moveaxis(by_row, -2, 0))
        ends = ends.reshape(_FLICKER_ROWS, *several, count, 3 * poles)
        step = 1
        while step < _FLICKER_ROWS:  # of chunks that start at 0, by doubling
            ends[step:] += rows.decay[step] * ends[:-step]
            step *= 2
        over_chunk = rows.decay[_FLICKER_ROWS]
        # The states between the chunks, one after the other: (chunk, ..., states of three axes).
        states = np.empty((count + 1, *several, 3 * poles))
        states[0] = state.reshape(states.shape[1:])
        of_chunks = np.moveaxis(ends[-1], -2, 0)
        for previous, following, end in zip(states[:-1], states[1:], of_chunks, strict=True):
            np.multiply(over_chunk, previous, following)
            np.add(following, end, following)
        self._state[units] = states[-1].reshape(state.shape)
        decay = rows.decay[:_FLICKER_ROWS].reshape(-1, *(1,) * (ends.ndim - 2), 3 * poles)
        starts = decay * np.moveaxis(states[:-1], 0, -2)
        starts[1:] += ends[:-1]
        starts = starts.reshape(_FLICKER_ROWS, *several, count, 3, poles)
        by_chunk = np.moveaxis(starts, 0, -2).reshape(*filtered.shape[:-1], poles)
        values = by_chunk @ rows.from_state
        values += filtered[..., :_COLUMNS]
        chunks = values.reshape(*several, count, 3, FLICKER_CHUNK).swapaxes(-3, -2)
        return np.moveaxis(chunks.reshape(*several, 3, count * FLICKER_CHUNK), -1, 0)


class Events:
    """A Poisson process: jumps, outages, slipping wheels.

    Events last for exponentially distributed times; none overlap.
    """

    def __init__(self, seed: int, source: str, rate: float, duration: float, dt: float) -> None:
        """Initialise before the first event.

        :param source: the first part of the names of its random streams.
        """
        self._begins, self._lengths = (generator(seed, f"{source}{part}") for part in ("", "_end"))
        self._probability = -math.expm1(-rate * dt)
        self._duration = duration / dt
        self._done = self._end = self.count = 0
        self._drawn, self._value = 0, np.zeros(0)
        """Number and value of the last event for which a value was drawn."""

    def next(self, count: int) -> Times:
        """Return the number of the event (count,), from 1, that each sample lies in; 0: none."""
        counts = np.zeros(count, np.int64)
        if not self._probability:
            return counts
        begin = self._done
        if self._end > begin:
            counts[: self._end - begin] = self.count
        for k in np.flatnonzero(self._begins.random(count) < self._probability):
            if begin + k >= self._end:
                self.count += 1
                length = max(1, math.ceil(self._lengths.exponential() * self._duration))
                self._end = begin + int(k) + length
                counts[k : k + length] = self.count
        self._done = begin + count
        return counts

    def values(self, count: int, draw: Callable[[], Array]) -> Iterator[tuple[Mask, Array]]:
        """Yield which of the next samples (count,) lie in an event, and its value, for each event.

        :param draw: returns the value of an event, which holds until its end.
        """
        numbers = self.next(count)
        for k in np.unique(numbers[numbers > 0]).tolist():
            if k > self._drawn:
                self._drawn, self._value = k, draw()
            yield numbers == k, self._value
