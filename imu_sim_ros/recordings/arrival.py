# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Stamps of arrival: the even times at which the poses may have been taken."""

from typing import Final

import numpy as np

from imu_sim_ros.core.types import Array, Integers, Mask
from imu_sim_ros.recordings.residuals import residuals

_WINDOW: Final = 200
"""Number of poses on each side that a running median includes."""
_SHORT: Final = 10
"""Number of poses over which the interval is first searched: so few are seldom incomplete."""
_LATE: Final = 0.02
"""Scatter of stamps, over their interval, above which they are examined."""
_LATEST: Final = 5.0
"""Largest scatter of poses taken at an even rate, in intervals."""
_MOSTLY_EVEN: Final = 0.9
"""Share of steps as long as the interval that stamps of arrival do not have."""
_ROUNDED: Final = 1.2
"""Range of the delays of held poses, in steps of the log, within which they are due to it."""
_BETTER: Final = 0.5
"""Largest ratio of the residuals of even times to those of the stamps."""
_REACH: Final = 0.01
"""Largest relative error of the first guess of the interval."""
_FIRST: Final = 2000
"""Number of poses in which the interval is searched first, and factor of its growth."""
_PHASES: Final = 40
"""Number of bins of the phase of the stamps in the grid."""


def even_times(
    t: Array, position: Array, q_wb: Array, log_step: float = 0.0
) -> tuple[Array, float, float]:
    """Return the even times at which poses were taken whose stamps are those of their arrival.

    Poses are taken at an even rate, some are lost. Stamps of arrival scatter about the grid, and
    the motion over the grid's times is smoother than over the stamps'; else they stay as they are,
    and the scatter is 0. A constant delay of all stamps cannot be detected; a pose next to a loss
    that is later than an interval is placed one interval off.

    :param t: (n,) stamps [s], increasing from 0.
    :param position: (n, 3) positions [m].
    :param q_wb: (n, 4) attitudes without jumps of sign.
    :param log_step: step of the log in which they stood several times, whose first stamps are late
        by up to this step [s]; 0: they stood once.
    :returns: times (n,) of the poses [s], standard deviation of the stamps about them [s], and the
        interval of the poses [s]; the stamps, 0 and 0 if nothing shows that they are of arrival.
    """
    interval = float(np.median(t[_SHORT:] - t[:-_SHORT])) / _SHORT
    is_uneven = np.abs(np.diff(t) - interval) >= _LATE * interval
    if not is_uneven.any() or (not log_step and is_uneven.mean() < 1.0 - _MOSTLY_EVEN):
        return t, 0.0, 0.0
    if log_step:  # the time between two first stamps is a whole number of its steps
        least_span = int(np.ceil(_ROUNDED * 0.5 * log_step / (_REACH * interval)))
        span = min(max(_SHORT, least_span), len(t) // 2)
        interval = float(np.median(t[span:] - t[:-span])) / span
    index = _grid_index(t / _even_interval(t, interval))
    interval = float(np.polyfit(index, t, 1)[0])
    even = index * interval
    even = even + _smooth_delay(t - even, _WINDOW)
    even = even - even[0]
    scatter = float(np.std(t - even))
    if log_step and np.ptp(t - even) < _ROUNDED * log_step and np.all(np.diff(even) > 0.0):
        return even, scatter, interval
    is_arrival = _LATE * interval < scatter < _LATEST * interval
    if not is_arrival or np.any(np.diff(even) <= 0.0):
        return t, 0.0, 0.0
    stamp_residuals, even_residuals = residuals(t, position, q_wb), residuals(even, position, q_wb)
    if even_residuals.median < _BETTER * stamp_residuals.median:
        return even, scatter, interval
    return t, 0.0, 0.0


def _even_interval(t: Array, guess: float) -> float:
    """Return the interval at whose multiples the stamps cluster, with or without losses.

    The sum of ``exp(2 pi i t f)`` peaks at the rate f (Rayleigh's test; a loss is a whole turn). It
    is searched in the first poses, within a hundredth of the guess, then in more and more of them
    within the uncertainty left by the fewer.
    """
    rate, reach, count = 1.0 / guess, _REACH / guess, min(_FIRST, len(t))
    while True:
        some = t[:count]
        step = 0.25 / max(float(some[-1] - some[0]), guess)
        tried = rate + step * np.arange(-np.ceil(reach / step), np.ceil(reach / step) + 1.0)
        thin = some[:: max(1, count // _FIRST)]
        power = [abs(np.exp(2j * np.pi * f * thin).sum()) for f in tried]
        rate, reach = float(tried[int(np.argmax(power))]), step
        if count == len(t):
            return 1.0 / rate
        count = min(4 * count, len(t))


def _grid_index(intervals: Array) -> Integers:
    """Return the index (n,) of each pose on the grid, from its stamp in intervals.

    The stamps' phase, a running mean, may drift. An index is the whole number below a stamp,
    counted from the phase that the fewest have, so that late poses stay with their own. What is
    left of it over the row rises by one with each loss and is an interval off if a pose is later
    still: a median of five takes those out and leaves the rise where it is.
    """
    from scipy.ndimage import median_filter, uniform_filter1d

    turn = np.exp(2j * np.pi * intervals)
    width = min(2 * _WINDOW + 1, len(intervals))
    mean = [uniform_filter1d(part, width, mode="nearest") for part in (turn.real, turn.imag)]
    over = intervals - np.unwrap(np.arctan2(mean[1], mean[0])) / (2.0 * np.pi)
    counts = np.histogram(over % 1.0, bins=_PHASES, range=(0.0, 1.0))[0]
    neighbourhood = counts + np.roll(counts, 1) + np.roll(counts, -1)
    phase = _centre(neighbourhood == neighbourhood.min())
    rows = np.arange(len(intervals))
    lost = median_filter(np.floor(over - phase).astype(np.int64) - rows, 5, mode="nearest")
    return np.asarray(rows + np.maximum.accumulate(lost) - lost[0], dtype=np.int64)


def _centre(rare: Mask) -> float:
    """Return the centre of the longest run of phases (k,) that are True, as a part of a turn.

    The phases of stamps that are rounded to a part of the interval leave a wide run empty.
    """
    count = len(rare)
    if rare.all():
        return 0.5
    start = int(np.argmin(rare))
    edges = np.flatnonzero(np.diff(np.roll(rare, -start).astype(np.int8), append=0)) + 1
    runs = edges.reshape(-1, 2)
    begin, end = runs[np.argmax(runs[:, 1] - runs[:, 0])]
    return float((start + 0.5 * (begin + end)) % count / count)


def _smooth_delay(values: Array, reach: int) -> Array:
    """Return the running median (n,) over ``reach`` values on either side, then its mean.

    The median leaves out late stamps. Of rounded delays, such as those of held poses, which are 0
    or a step of the log, it alternates between two; the mean makes a slow drift of that.
    """
    from scipy.ndimage import median_filter, uniform_filter1d

    width = 2 * reach + 1
    median = median_filter(values, width, mode="reflect")
    return np.asarray(uniform_filter1d(median, width, mode="reflect"))
