# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""1/f noise from white noise by one filter, from the lowest frequency that matters to Nyquist.

In ``S = 2 sin(w / 2)``, w = 2 pi f dt, a real pole or zero phi of a discrete filter is an exact
first-order corner: ``|1 - phi e^(-i w)|^2 = phi (S^2 + (1 - phi)^2 / phi)``. Poles at corners S_p
that are half a decade apart, with zeros midway (on the logarithmic axis) above them, therefore give
``|H|^2 = 1 / S`` with a ripple below 0.1 % (Keshner, "1/f noise", Proc. IEEE 70, 1982). One more
pole and zero turn 1/S into 1/w: within 3.2 % up to the Nyquist frequency (minimax; tested).

The filter is run as a sum of first-order recursions that all see the same white noise, so that it
costs one random number a sample. A chunk is R rows of C samples: within a row the response to the
row's own noise and to the state before it are two products with constant matrices; the states
before the rows follow by a scan. Chunks start at fixed sample indices and are generated whole, so
the result does not depend on how many samples are asked for at a time.
"""

from functools import lru_cache
from typing import Final, NamedTuple

import numpy as np
from numpy.random import Generator

from imu_sim_ros.sensors.errors.processes import ChunkedProcess
from imu_sim_ros.types import Array

LONGEST_TIME: Final = 1e4
"""[s]; below 1 / (2 pi LONGEST_TIME) the density is flat."""
_RATIO: Final = float(np.sqrt(10.0))
_HIGHEST_CORNER: Final = 2.0 * float(np.sqrt(_RATIO))
_GAIN, _ZERO, _POLE = 0.9328682, -0.36991621, -0.27052661
_ROWS: Final = 64
_COLUMNS: Final = 32
CHUNK: Final = _ROWS * _COLUMNS


class FlickerFilter(NamedTuple):
    """``H = direct + sum_p gains_p / (1 - poles_p z^-1)`` with ``|H|^2 = 1 / (2 pi f dt)``."""

    poles: Array
    """(p,)"""
    gains: Array
    """(p,)"""
    direct: float

    @classmethod
    def design(cls, dt: float) -> "FlickerFilter":
        """Return the filter for a sample interval [s]."""
        count = max(int(np.ceil(np.log(_HIGHEST_CORNER * LONGEST_TIME / dt) / np.log(_RATIO))), 1)
        corners = _HIGHEST_CORNER * _RATIO ** -np.arange(count + 1.0)
        # 1 - phi, which at the low end has the digits that phi has not.
        below = np.append(_below_one(corners), 1.0 - _POLE)
        below_zeros = np.append(_below_one(corners * np.sqrt(_RATIO)), 1.0 - _ZERO)
        poles, zeros = 1.0 - below, 1.0 - below_zeros
        own = np.eye(len(poles), dtype=bool)
        ratio = (below_zeros[None, :] - below[:, None]) / poles[:, None]
        distance = np.where(own, 1.0, (below[None, :] - below[:, None]) / poles[:, None])
        gains = _GAIN * np.prod(ratio / distance, axis=1)
        return cls(poles, gains, float(_GAIN * np.prod(zeros / poles)))

    def density(self, angle: Array) -> Array:
        """Return ``|H|^2`` at angular frequencies per sample ``2 pi f dt``."""
        delay = np.exp(-1j * np.atleast_1d(angle))[:, None]
        response = self.direct + np.sum(self.gains / (1.0 - self.poles * delay), axis=1)
        return np.abs(response) ** 2


def _below_one(corner: Array) -> Array:
    """Return ``1 - phi`` of a pole at a corner: ``(1 - phi)^2 / phi = S^2``."""
    return corner * (np.sqrt(1.0 + 0.25 * corner**2) - 0.5 * corner)


class _Rows(NamedTuple):
    """The filter's recursion in rows of C samples; no seed is in it."""

    from_noise: Array
    """(C, C): noise of a row -> its values."""
    from_state: Array
    """(p, C)."""
    to_state: Array
    """(C, p)."""
    decay: Array
    """(p,) of the states over a row."""
    decays: list[Array]
    """(R - k, p) of the states over k = 1, 2, 4, ... rows, the same in every row."""
    root: Array
    """(p, p) root of the stationary covariance of the states."""


@lru_cache(maxsize=8)
def _rows(dt: float) -> _Rows:
    design = FlickerFilter.design(dt)
    poles, gains = design.poles, design.gains
    powers = poles ** np.arange(_COLUMNS + 1)[:, None]  # (C + 1, p)
    impulse = powers[:-1] @ gains
    impulse[0] += design.direct
    lag = np.subtract.outer(np.arange(_COLUMNS), np.arange(_COLUMNS))
    own = np.where(lag >= 0, impulse[np.abs(lag)], 0.0)
    # Covariance of recursions that see the same unit noise: 1 / (1 - phi_i phi_j).
    covariance = 1.0 / (1.0 - np.outer(poles, poles))
    decay, step, decays = poles**_COLUMNS, 1, []
    while step < _ROWS:
        decays.append(np.tile(decay, (_ROWS - step, 1)))
        decay, step = decay * decay, 2 * step
    return _Rows(
        np.ascontiguousarray(own.T),
        np.ascontiguousarray((powers[1:] * gains).T),
        np.ascontiguousarray(powers[:-1][::-1]),
        poles**_COLUMNS,
        decays,
        np.asarray(np.linalg.cholesky(covariance), dtype=np.float64),
    )


class FlickerNoise(ChunkedProcess):
    """1/f noise of density ``1 / (2 pi f)``, stationary from the first sample on."""

    def __init__(self, streams: list[Generator], dt: float) -> None:
        """Draw the initial states from the stationary distribution.

        :param streams: one for each axis.
        :param dt: time between two samples [s].
        """
        super().__init__(streams, CHUNK)
        self._rows = rows = _rows(dt)
        self._state = np.stack([rows.root @ s.standard_normal(len(rows.root)) for s in streams])

    def _make_chunks(self, count: int) -> Array:
        rows = self._rows
        noise = np.empty((len(self._streams), count, _ROWS, _COLUMNS))
        for stream, numbers in zip(self._streams, noise, strict=True):
            stream.standard_normal(out=numbers)
        ends = noise @ rows.to_state  # (axes, chunk, R, p), of rows that start at 0
        starts = np.empty_like(ends)
        for chunk in range(count):
            starts[:, chunk, 0] = self._state
            self._state = self._scan(ends[:, chunk])
        starts[:, :, 1:] = ends[:, :, :-1]
        values = noise @ rows.from_noise
        values += starts @ rows.from_state
        return values.reshape(len(self._streams), count * CHUNK).T

    def _scan(self, ends: Array) -> Array:
        """Add to the ends of a chunk's rows (axes, R, p) what came before; return the last."""
        ends[:, 0] += self._rows.decay * self._state
        carried = np.empty_like(ends)
        for decay in self._rows.decays:  # by doubling
            after, before = ends[:, -len(decay) :], carried[:, -len(decay) :]
            np.multiply(decay, ends[:, : len(decay)], out=before)
            np.add(after, before, out=after)
        return ends[:, -1].copy()
