# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""First-order Gauss-Markov processes, exactly discretised, in chunks of a fixed size.

The recurrence ``x_k = phi x_(k-1) + sqrt(1 - phi^2) w_k`` with ``phi = exp(-dt / tau)`` has unit
variance at any rate. It is solved by a scan in two levels: a chunk is R rows of C samples; all rows
advance together, one column at a time, from 0; then the rows' start values follow from the rows'
ends, and what they add decays along each row. Chunks start at fixed sample indices and are
generated whole, so the result does not depend on how many samples are asked for at a time.
"""

import itertools

import numpy as np
from numpy.random import Generator
from numpy.typing import NDArray

from imu_sim_ros.sensor.errors.chunked import ChunkedProcess

Array = NDArray[np.float64]

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
        # Axes are (axis, process, chunk, row), behind columns where there are any.
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
        result: Array = total.transpose(1, 2, 3, 0).reshape(axes, count * CHUNK)
        return result

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
