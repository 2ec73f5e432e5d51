# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Stamps that say when a pose arrived: the even times at which the poses may have been taken."""

from typing import Final

import numpy as np
from numpy.typing import NDArray

from imu_sim_ros.trajectory.motion import Array
from imu_sim_ros.trajectory.splines.residuals import residuals

_WINDOW: Final = 200
"""Poses on each side that a running median takes in."""
_SHORT: Final = 10
"""Poses over which the interval is first looked for: seldom is one of so few lost."""
_LATE: Final = 0.02
"""Scatter of stamps, over their interval, from which on they are looked at."""
_LATEST: Final = 5.0
"""In intervals; poses that scatter farther were not taken at an even rate."""
_MOSTLY_EVEN: Final = 0.9
"""Share of steps as long as the interval that stamps of arrival do not have."""
_BETTER: Final = 0.5
_NEAR: Final = 40
"""Poses on each side that tell whether one was lost."""
_RISE: Final = 0.6


def even_times(t: Array, position: Array, q_wb: Array) -> tuple[Array, float, float]:
    """Return times at which the poses may have been taken, the stamps' scatter, and the interval.

    Poses are taken at an even rate, some are lost. Stamps of arrival scatter about the grid, and
    the motion over the grid's times is smoother than over the stamps'; else they stay as they are,
    and the scatter is 0. A constant delay of all stamps cannot be told, and where poses are lost as
    well, those near a loss may be an interval off.

    :param t: (n,) stamps [s], increasing from 0.
    :param position: (n, 3) [m].
    :param q_wb: (n, 4) without jumps of sign.
    """
    interval = float(np.median(t[_SHORT:] - t[:-_SHORT])) / _SHORT
    if np.mean(np.abs(np.diff(t) - interval) < _LATE * interval) > _MOSTLY_EVEN:
        return t, 0.0, 0.0
    index = _grid_index(t / interval)
    interval = float(np.polyfit(index, t, 1)[0])
    even = index * interval
    even = even + _running_median(t - even, _WINDOW)
    even = even - even[0]
    scatter = float(np.std(t - even))
    likely = _LATE * interval < scatter < _LATEST * interval
    if not likely or np.any(np.diff(even) <= 0.0):
        return t, 0.0, 0.0
    given, tried = residuals(t, position, q_wb), residuals(even, position, q_wb)
    if tried.median < _BETTER * given.median:
        return even, scatter, interval
    return t, 0.0, 0.0


def _grid_index(place: Array) -> NDArray[np.int64]:
    """Return the place (n,) of each pose on the grid, from its stamp in intervals.

    Stamp less row scatters about a level that rises by one with each pose that is lost. Medians
    ahead of and behind a row tell a rise; it is put where least is left of the stamps around.
    """
    n = len(place)
    over = place - np.arange(n)
    median = _running_median(over, _NEAR)
    rows = np.arange(n)
    rise = median[np.minimum(rows + _NEAR, n - 1)] - median[np.maximum(rows - _NEAR, 0)]
    result = rows.copy()
    for part in _runs(np.flatnonzero(rise > _RISE)):
        lost = max(round(float(rise[part].max())), 1)
        row = int(np.mean(part))
        low, high = max(row - _NEAR, 0), min(row + _NEAR, n)
        level = float(median[max(row - _NEAR, 0)])
        gain = np.abs(over[low:high] - level - lost) - np.abs(over[low:high] - level)
        result[low + int(np.argmax(np.concatenate([[0.0], np.cumsum(gain)]))) :] += lost
    return np.asarray(result, dtype=np.int64)


def _runs(rows: NDArray[np.int64]) -> list[NDArray[np.int64]]:
    """Return groups of rows that follow each other."""
    parts = np.split(rows, np.flatnonzero(np.diff(rows) > 1) + 1)
    return [np.asarray(part, dtype=np.int64) for part in parts if len(part)]


def _running_median(values: Array, reach: int) -> Array:
    """Return the median (n,) of each value and of ``reach`` ones on either side."""
    from scipy.ndimage import median_filter

    result: Array = median_filter(values, 2 * reach + 1, mode="nearest")
    return result
