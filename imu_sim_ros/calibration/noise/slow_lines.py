# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Sinusoids among the slow changes of a record: a room's heating, the course of a day.

Such a line leaks over all of the slow coefficients and looks like a random walk. It is searched in
the spectrum under a Hann window, and taken from the readings if the likelihood of what is left
as white noise, flicker and a walk says that it is no noise.
"""

from typing import Final, NamedTuple

import numpy as np

from imu_sim_ros.calibration.noise.likelihood import Data, fit
from imu_sim_ros.types import Array

_MAX_LINES: Final = 5
_MIN_POINTS: Final = 64
_SLOWEST: Final = 3
"""Periods in the record; fewer cannot be told from a walk."""
_PEAK: Final = 14.0
"""Power over its surroundings that makes a candidate: noise has one in 300 long records."""
_EVIDENCE: Final = 20.0
"""Log-likelihood that a line must gain with its three parameters at any of 10^4 frequencies: noise
does in fewer than one record in 10^4."""
_STEP: Final = 1.05
"""Ratio of the frequencies at which the surroundings are looked at."""
_AROUND: Final = 1.5
"""Ratio of frequencies that are surroundings, with four more on each side."""


class Line(NamedTuple):
    """A sinusoid on one axis."""

    axis: int
    frequency: float
    """Cycles per value."""
    amplitude: float


def without_lines(values: Array, highest: float) -> tuple[Array, list[Line]]:
    """Return values (axes, n) without the lines that were found, and these.

    :param highest: frequency up to which lines are searched, cycles per value.
    """
    lines: list[Line] = []
    for axis, column in enumerate(values):
        for line, curve in _lines(column - column.mean(), highest):
            if not lines:
                values = values.copy()
            values[axis] -= curve
            lines.append(line._replace(axis=axis))
    return values, lines


def _lines(rest: Array, highest: float) -> list[tuple[Line, Array]]:
    """Return the lines of one axis with their values.

    All candidates are taken out, and those put back that the rest explains.
    """
    if len(rest) < _MIN_POINTS or not rest.any():
        return []
    found: list[tuple[Line, Array]] = []
    while len(found) < _MAX_LINES and (candidate := _candidate(rest, highest)) is not None:
        frequency = _refined(rest, candidate)
        angle = 2.0 * np.pi * frequency * np.arange(len(rest))
        columns = np.column_stack([np.sin(angle), np.cos(angle), np.ones(len(rest))])
        parts = np.linalg.lstsq(columns, rest, rcond=None)[0]
        found.append((Line(0, frequency, float(np.hypot(parts[0], parts[1]))), columns @ parts))
        rest = rest - found[-1][1]
    if not found:
        return []
    limit = _objective(rest, highest) + _EVIDENCE
    return [one for one in found if _objective(rest + one[1], highest) > limit]


def _candidate(x: Array, highest: float) -> float | None:
    """Return the frequency of the highest peak over its surroundings."""
    line = np.linspace(-1.0, 1.0, len(x))
    level = x - line * (line @ x) / (line @ line)
    power = np.abs(np.fft.rfft(np.hanning(len(x)) * level)) ** 2
    last = min(int(highest * len(x)) + 1, len(power))
    if last <= _SLOWEST + 1:
        return None
    count = int(np.log(last / _SLOWEST) / np.log(_STEP)) + 2
    places = np.unique((_SLOWEST * _STEP ** np.arange(count)).astype(np.int64))
    # The median of exponentially distributed powers is ln 2 of their mean.
    usual = [
        np.median(power[max(int(k / _AROUND) - 4, 1) : int(k * _AROUND) + 5]) / np.log(2.0)
        for k in places
    ]
    orders = np.arange(_SLOWEST, last)
    levels = np.log(np.maximum(usual, 1e-300))
    surroundings = np.exp(np.interp(np.log(orders), np.log(places), levels))
    ratio = power[_SLOWEST:last] / surroundings
    best = int(np.argmax(ratio))
    return (best + _SLOWEST) / len(x) if ratio[best] > _PEAK else None


def _refined(x: Array, frequency: float) -> float:
    """Return the frequency of the most power within one cycle per record of a peak."""
    from scipy.optimize import minimize_scalar

    t = np.arange(len(x))
    weighted = np.hanning(len(x)) * x

    def power(f: float) -> float:
        return -float(np.abs(np.exp(-2j * np.pi * f * t) @ weighted) ** 2)

    width = 1.0 / len(x)
    bounds = (frequency - width, frequency + width)
    options = {"xatol": 1e-3 * width}
    return float(minimize_scalar(power, bounds=bounds, method="bounded", options=options).x)


def _objective(x: Array, highest: float) -> float:
    """Return minus the log-likelihood as white noise, flicker and a walk, up to a frequency."""
    from scipy.fft import dct

    order = np.arange(1, min(int(2.0 * len(x) * highest) + 2, len(x)))
    power = dct(x, norm="ortho")[order] ** 2
    zeros = np.zeros(len(order))
    f = order / (2.0 * len(x))
    design = np.stack([f**0, 1.0 / f, f**-2.0], axis=1)
    return fit(Data(power, zeros + 1.0, zeros, zeros), design).lowest
