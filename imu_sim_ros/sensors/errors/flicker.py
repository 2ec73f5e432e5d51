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

from imu_sim_ros.random_streams import Seed, Streams, Units
from imu_sim_ros.sensors.errors.processes import ChunkedProcess
from imu_sim_ros.types import Array

LONGEST_TIME: Final = 1e4
"""[s]; below 1 / (2 pi LONGEST_TIME) the density is flat."""
_RATIO: Final = float(np.sqrt(10.0))
_HIGHEST_CORNER: Final = 2.0 * float(np.sqrt(_RATIO))
_GAIN, _ZERO, _POLE = 0.9328682, -0.36991621, -0.27052661
_ROWS: Final = 4
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
    """(C, C + p): noise of a row -> its values, and the states at its end."""
    from_state: Array
    """(p, C)."""
    decay: Array
    """(R + 1, p) of the states over k rows."""
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
    return _Rows(
        np.concatenate([own.T, powers[:-1][::-1]], axis=1),
        np.ascontiguousarray((powers[1:] * gains).T),
        poles ** (_COLUMNS * np.arange(_ROWS + 1.0))[:, None],
        np.asarray(np.linalg.cholesky(covariance), dtype=np.float64),
    )


class FlickerNoise(ChunkedProcess):
    """1/f noise of density ``1 / (2 pi f)``, stationary from the first sample on."""

    def __init__(self, seed: Seed, source: str, dt: float) -> None:
        """Draw the initial states from the stationary distribution.

        :param dt: time between two samples [s].
        """
        super().__init__(CHUNK, (*np.shape(seed), 3))
        self._streams = Streams(seed, source)
        self._rows = _rows(dt)
        self._state = self._drawn(...)

    def begin(self, units: Units) -> None:
        """Let some units of a batch begin again, from their present seeds."""
        self._streams.begin(units)
        self._state[units] = self._drawn(units)

    def _drawn(self, units: Units) -> Array:
        """Return initial states (..., 3, p)."""
        root = self._rows.root
        numbers = np.moveaxis(self._streams.next(len(root), units), 0, -1)
        # A vector at a time: the sums are the same for one unit and for many.
        return np.matmul(root, numbers[..., None])[..., 0]

    def _make_chunks(self, count: int, units: Units) -> Array:
        rows, state = self._rows, self._state[units]
        several, poles = state.shape[:-2], state.shape[-1]
        numbers = np.moveaxis(self._streams.next(count * CHUNK, units), 0, -1)
        # All rows of a unit's chunk in a product: its size, and so its sums, never differ.
        noise = numbers.reshape(*several, 3, count, _ROWS, _COLUMNS).swapaxes(-4, -3)
        made = noise.reshape(*several, count, 3 * _ROWS, _COLUMNS) @ rows.from_noise
        values, ends = made[..., :_COLUMNS], made[..., _COLUMNS:]
        ends = ends.reshape(*several, count, 3, _ROWS, poles)  # of rows that start at 0
        step = 1
        while step < _ROWS:  # of chunks that start at 0, by doubling
            ends[..., step:, :] += rows.decay[step] * ends[..., :-step, :]
            step *= 2
        states = np.empty((*several, count, 3, poles))
        for chunk in range(count):
            states[..., chunk, :, :] = state
            state = rows.decay[_ROWS] * state
            state += ends[..., chunk, :, -1, :]
        self._state[units] = state
        starts = rows.decay[:_ROWS] * states[..., None, :]
        starts[..., 1:, :] += ends[..., :-1, :]
        values += starts.reshape(*several, count, 3 * _ROWS, poles) @ rows.from_state
        found = values.reshape(*several, count, 3, CHUNK).swapaxes(-3, -2)
        return np.moveaxis(found.reshape(*several, 3, count * CHUNK), -1, 0)
