# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""First-order Gauss-Markov processes, exactly discretised, in chunks of a fixed size.

The recurrence ``x_k = phi x_(k-1) + sqrt(1 - phi^2) w_k`` with ``phi = exp(-dt / tau)`` has unit
variance at any rate. It is solved by a scan in two levels: a chunk is R rows of C samples; all rows
advance together, one column at a time, from 0; then the rows' start values follow from the rows'
ends, and what they add decays along each row. Chunks start at fixed sample indices and are
generated whole, so the result does not depend on how many samples are asked for at a time.
"""

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
        exponent = -dt / correlation_times
        self._drive = np.sqrt(-np.expm1(2.0 * exponent))
        # One factor for each row, too: the innermost loop of NumPy is then over rows and processes.
        self._phi = np.repeat(np.exp(exponent)[:, :, None], _ROWS, axis=2)
        columns = np.arange(1, _COLUMNS + 1)
        self._column_decay = np.exp(exponent[:, None, :] * columns[:, None])[..., None]
        rows = np.arange(_ROWS)
        self._row_decay = np.exp(exponent[:, :, None] * _COLUMNS * rows)
        self._state = np.stack([s.standard_normal(correlation_times.shape[1]) for s in streams])

    def _make_chunk(self) -> None:
        axes, processes = self._state.shape
        table = np.empty((axes, _COLUMNS, processes, _ROWS))
        for stream, numbers in zip(self._streams, table, strict=True):
            stream.standard_normal(out=numbers)
        table *= self._drive[:, None, :, None]
        for c in range(1, _COLUMNS):
            table[:, c] += self._phi * table[:, c - 1]
        starts = self._row_starts(table[:, -1])
        table += self._column_decay * starts[:, None]
        self._state = table[:, -1, :, -1].copy()
        self._chunk = table.sum(axis=2).transpose(0, 2, 1).reshape(axes, CHUNK)

    def _row_starts(self, ends: Array) -> Array:
        """Return the value before each row (a, p, R) from the ends of rows that start at 0."""
        reached = ends.copy()
        step = 1
        while step < _ROWS:  # a scan by doubling: five passes instead of 32 steps
            decay = self._row_decay[:, :, step, None]
            reached[:, :, step:] += decay * reached[:, :, :-step].copy()
            step *= 2
        starts = self._row_decay * self._state[:, :, None]
        starts[:, :, 1:] += reached[:, :, :-1]
        result: Array = starts
        return result
