# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Stretches of a record in which an IMU rests or turns at a constant rate."""

from itertools import pairwise
from typing import Final, NamedTuple

import numpy as np

from imu_sim_ros.core import gate
from imu_sim_ros.core.errors import InputError
from imu_sim_ros.core.types import Array, Integers, Mask, Times
from imu_sim_ros.recordings.clock import estimate_clock


class Whitened(NamedTuple):
    """Columns whitened for each of g sizes of the walk."""

    columns: Array
    """(g, n, p) whitened columns."""
    log_determinant: Array
    """(g,) log-determinants of the covariance."""


def whiten(columns: Array, time: Array, sigma: Array, walk: Array) -> Whitened:
    """Return ``L^-1 columns`` and ``ln det(L L^T)`` with ``L L^T = walk min(t, t) + sigma^2``.

    :param columns: (n, p) rows in the order of time.
    :param time: (n,) ascending, the first not below 0; the walk is 0 at 0.
    :param sigma: (n,) standard deviations of the white noise, above 0.
    :param walk: (g,) squares of the walk's density.
    """
    steps = np.diff(time, prepend=0.0)
    white = np.square(sigma)
    variance = np.zeros(len(walk))
    state = np.zeros((len(walk), columns.shape[1]))
    columns_out = np.empty((len(time), len(walk), columns.shape[1]))
    log_determinant = np.zeros(len(walk))
    for k, row in enumerate(columns):
        variance = variance + walk * steps[k]
        total = variance + white[k]
        innovation = row - state
        np.divide(innovation, np.sqrt(total)[:, None], out=columns_out[k])
        log_determinant += np.log(total)
        gain = variance / total
        state += gain[:, None] * innovation
        variance = gain * white[k]
    return Whitened(columns_out.transpose(1, 0, 2), log_determinant)


WINDOW: Final = 0.5
"""Length of the windows that are compared [s]."""
_MIN_READINGS: Final = 25
"""Smallest number of readings in a window: the variance of fewer scatters too much."""
_QUIET: Final = 0.2
"""Share of the windows that count as the quietest: they define the noise floor."""
_LOUDER: Final = 3.0
"""Largest variance of a steady window over the floor, unless chance allows a larger one."""
_CHANCE: Final = 1e-9
"""Probability that the variance of a steady window is above the limit."""
_PIECE: Final = 5.0
"""Length of the pieces into which long stretches are cut [s]."""
_PIECES: Final = 400
"""Approximate maximum number of pieces, as long as there are fewer stretches."""
_UNNOTICED: Final = np.array([1e-5] * 3 + [1e-4] * 3)
"""Change of a steady reading within a window [rad/s, m/s^2]: the noise of a navigation-grade
sensor. Without noise, the drift with temperature alone would count as motion."""
_JUMP: Final = 6.0
"""Largest difference of neighbouring means within one stretch, in standard deviations."""


class Steady(NamedTuple):
    """m pieces of steady stretches, without the stretches' margins.

    A result: means over pieces with their standard errors, not readings.
    """

    stretch: Integers
    """(m,) number of the stretch that a piece belongs to."""

    begin_ns: Times
    """(m,) first stamps [ns]."""
    end_ns: Times
    """(m,) last stamps [ns]."""
    gyro: Array
    """(m, 3) mean readings [rad/s]."""
    accel: Array
    """(m, 3) mean readings [m/s^2]."""
    gyro_sigma: Array
    """(m, 3) standard errors of the means, from the differences of neighbouring windows."""
    accel_sigma: Array
    """(m, 3) standard errors of the means."""
    shortest: float = 2.0
    """Shortest length of a stretch [s]."""

    def rows(self, chosen: Mask) -> "Steady":
        """Return some of the pieces."""
        return Steady._make([*(column[chosen] for column in self[:-1]), self.shortest])

    @property
    def stretches(self) -> int:
        """Number of stretches."""
        return len(np.unique(self.stretch))

    @property
    def time(self) -> Array:
        """(m,) middle of each piece, after the beginning of the first [s]."""
        middle = 0.5 * (self.begin_ns - self.begin_ns[0]) + 0.5 * (self.end_ns - self.begin_ns[0])
        return np.asarray(middle * 1e-9, dtype=np.float64)

    @property
    def duration(self) -> Array:
        """(m,) lengths [s]."""
        return (self.end_ns - self.begin_ns).astype(np.float64) * 1e-9


def find_steady(
    t_ns: Times, gyro: Array, accel: Array, *, shortest: float = 2.0, rotating: bool = False
) -> Steady:
    """Return the stretches in which the readings are as quiet as they get.

    Windows of half a second, or of 25 readings, whose variance is near the record's floor on every
    axis are joined if their means agree; the first and the last window of a stretch are dropped.

    :param shortest: shortest length of a stretch, with its margins [s].
    :param rotating: use the gyroscope alone: on a tilted table gravity turns in the body.
    :raises InputError: for readings that the gate refuses, or a record without steady stretches.
    """
    gate.readings(t_ns, gyro, accel).complain("readings")
    y = np.concatenate([gyro, accel], axis=1)
    interval = estimate_clock(t_ns).interval_ns * 1e-9
    size = max(round(WINDOW / interval), _MIN_READINGS)
    count = len(y) // size
    if count < 10:
        raise InputError(f"{len(y)} readings: at least {10 * size} are needed")
    windows = y[: count * size].reshape(count, size, 6)
    mean, variance = windows.mean(axis=1), windows.var(axis=1)
    # Rounding hides the noise of windows in which all readings are the same.
    floor = np.maximum(np.quantile(variance, _QUIET, axis=0), _steps(y) ** 2 / 12.0)
    judged = np.arange(6) < (3 if rotating else 6)
    limit = _louder(size) * floor[judged] + _UNNOTICED[judged] ** 2
    calm = np.all(variance[:, judged] <= limit, axis=1)
    sigma = np.sqrt(2.0 * floor / size) + _UNNOTICED
    continues = np.all(np.abs(np.diff(mean, axis=0)) <= _JUMP * sigma, axis=1, where=judged)
    label = np.cumsum(np.concatenate([[True], ~(continues & calm[1:] & calm[:-1])]))
    min_windows = max(round(shortest / (size * interval)), 4)
    runs = [run for run in _runs(label, calm) if run[1] - run[0] >= min_windows]
    if not runs:
        raise InputError(
            f"no {min_windows * size * interval:.3g} s at rest or at a constant rate found "
            f"({min_windows * size} readings at {1.0 / interval:.4g} Hz): the readings never settle"
        )
    inner = [(begin + 1, end - 1) for begin, end in runs]
    steady = _summarise(t_ns, mean, size, size * interval, inner)
    return steady._replace(shortest=min_windows * size * interval)


def _louder(size: int) -> float:
    """Return the largest variance of a steady window of some readings, over the floor."""
    from scipy.special import gammainccinv, gammaincinv

    half = 0.5 * (size - 1)
    return max(_LOUDER, float(gammainccinv(half, _CHANCE) / gammaincinv(half, _QUIET)))


def _steps(y: Array) -> Array:
    """Return (k,) the smallest changes of readings (n, k): their rounding steps, if any.

    For readings that are not rounded the result is close to 0.
    """
    change = np.abs(np.diff(y, axis=0))
    smallest: Array = np.where(change > 0.0, change, np.inf).min(axis=0)
    return np.where(np.isfinite(smallest), smallest, 0.0)


def _runs(label: Integers, calm: Mask) -> list[tuple[int, int]]:
    """Return the first and one-past-last window of each calm run of equal labels."""
    starts = np.flatnonzero(np.diff(label, prepend=label[0] - 1))
    ends = np.append(starts[1:], len(label))
    return [(int(a), int(b)) for a, b in zip(starts, ends, strict=True) if calm[a:b].all()]


def _summarise(
    t_ns: Times, mean: Array, size: int, seconds: float, runs: list[tuple[int, int]]
) -> Steady:
    """Cut the stretches into pieces of some seconds, which show the walk of the bias.

    :param size: readings in a window, which lasts so many seconds.
    """
    windows = sum(b - a for a, b in runs)
    length = max(_PIECE / seconds, windows / _PIECES)
    pieces: list[tuple[int, int, int]] = []
    for number, (a, b) in enumerate(runs):
        edges = np.linspace(a, b, max(round((b - a) / length), 1) + 1).astype(int)
        pieces += [(number, int(c), int(d)) for c, d in pairwise(edges)]
    parts = [mean[a:b] for _, a, b in pieces]
    means = np.array([part.mean(axis=0) for part in parts])
    # Differences of neighbours contain the noise, not slow walks (von Neumann 1941).
    squares = np.sum([np.sum(np.diff(p, axis=0) ** 2, axis=0) for p in parts], axis=0)
    freedom = 2.0 * max(sum(len(part) - 1 for part in parts), 1)
    lengths = np.array([len(part) for part in parts], dtype=np.float64)
    sigma = np.sqrt(squares / freedom / lengths[:, None])
    last_index = len(t_ns) - 1
    begin = t_ns[[a * size for _, a, _ in pieces]]
    end = t_ns[[min(b * size, last_index) for _, _, b in pieces]]
    stretch = np.array([number for number, _, _ in pieces], dtype=np.int64)
    return Steady(
        stretch=stretch,
        begin_ns=begin,
        end_ns=end,
        gyro=means[:, :3],
        accel=means[:, 3:],
        gyro_sigma=sigma[:, :3],
        accel_sigma=sigma[:, 3:],
    )
