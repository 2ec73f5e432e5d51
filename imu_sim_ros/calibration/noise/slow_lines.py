# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Sinusoids among the slow changes of a record: a room's heating, the course of a day.

Such a line leaks over all of the slow coefficients and looks like a random walk. Lines, a ramp, and
white noise, flicker and a walk are fitted together to the coefficients of the cosine transform, in
which a line has a closed form and the noise is independent. A line that gains enough likelihood is
taken from the readings. One that gains less may be there or not: what rests on the slow
coefficients is then to hold with it and without it.
"""

from functools import partial
from typing import Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from imu_sim_ros.calibration.noise.likelihood import Data, fit_many
from imu_sim_ros.types import Array

_MAX_LINES: Final = 5
_MIN_POINTS: Final = 400
"""Values with which there are coefficients enough for a line and the noise around it."""
_SLOWEST: Final = 0.6
"""Periods in the record; fewer are a ramp and a constant."""
_EVIDENCE: Final = 20.0
"""Log-likelihood that a line must gain with its three parameters at any of 10^4 frequencies: noise
does in fewer than one record in 10^4."""
_DOUBT: Final = (3.5, 1.5)
"""Log-likelihood from which on it may be a line, and what is added for each factor e of its periods
in the record: the more frequencies, the better is the best of noise, and the less do they matter to
a walk. Noise has such a line in one record in six, most often of a few periods."""
_SINGLE: Final = 192
"""Coefficients that are looked at one by one, and that are searched for lines exactly."""
_WIDTH: Final = 0.05
"""Relative width of the rows in which the others are averaged."""
_APART: Final = 1.0
"""Periods in the record by which two lines differ; nearer ones cannot be told from one that is no
sinusoid."""
_SPACING: Final = 0.125
"""Periods in the record between the frequencies that are tried."""
_ALTERNATIONS: Final = 12
"""At most, of fits of the lines and of the noise; each leaves a few percent of the difference."""
_TOLERANCE: Final = 0.02
"""Log-likelihood whose gain is not worth another."""
_OFF: Final = 1e-4
"""Periods in the record over which a line is differentiated by its frequency."""

_PEAK: Final = 14.0
"""Power over its surroundings that makes a candidate of a faster line: noise has one in 300 long
records."""
_STEP: Final = 1.05
"""Ratio of the frequencies at which the surroundings are looked at."""
_AROUND: Final = 1.5
"""Ratio of frequencies that are surroundings, with four more on each side."""

_ALL: Final = slice(None)
_LEAST: Final = 1e-100
"""Of a variance: products of two weights, its inverses, must be numbers."""
Waves = NDArray[np.complex128]


class Line(NamedTuple):
    """A sinusoid on one axis."""

    axis: int
    frequency: float
    """Cycles per value."""
    amplitude: float


class SlowLines(NamedTuple):
    """What was found in the values (axes, n) of a piece."""

    values: Array
    """Without the lines."""
    lines: list[Line]
    doubtful: list[Line]
    """That may be there or not."""
    without_doubtful: Array
    """The values without these as well."""


def find_lines(values: Array, highest: float) -> SlowLines:
    """Return the lines of values (axes, n).

    :param highest: frequency up to which lines are searched, cycles per value.
    """
    lines: list[Line] = []
    doubtful: list[Line] = []
    without, either = values, values
    if values.shape[1] >= _MIN_POINTS:
        search = _Search(values.shape[1], highest)
        for axis, column in enumerate(values):
            if not (column != column[0]).any():
                continue
            for line, curve, gain in search.lines(column - column.mean()):
                if gain > _EVIDENCE:
                    if without is values:
                        without = values.copy()
                    without[axis] -= curve
                    lines.append(line._replace(axis=axis))
                else:
                    if either is values:
                        either = np.zeros_like(values)
                    either[axis] += curve
                    doubtful.append(line._replace(axis=axis))
    return SlowLines(without, lines, doubtful, without - either if doubtful else without)


class _Fit(NamedTuple):
    """Ramp, lines and noise that fit together."""

    objective: float
    """Minus the log-likelihood."""
    rows: Array
    """Expected rows."""
    variance: Array
    """(m,) of each coefficient."""
    periods: Array
    """(lines,) in the record."""
    parts: Array
    """(lines,) factors of ``exp(2 pi i periods (j + 1/2) / n)``, of which the real part counts."""
    left: Array
    """(m,) the coefficients without them."""


class _Search:
    """The search in records of n values, with what is the same for all of them."""

    def __init__(self, n: int, highest: float) -> None:
        from scipy.fft import dct

        self._transform = partial(dct, norm="ortho")
        self._n, self._last = n, highest * n  # periods
        self._order = np.arange(1, min(int(2.0 * self._last) + 2, n))
        count = len(self._order)
        self._ramp = self._transform(np.arange(n) / n)[self._order]
        single = min(_SINGLE, count)
        bins = single * np.exp(_WIDTH * np.arange(np.log(count / single) / _WIDTH))
        self._starts = np.unique(np.concatenate([np.arange(single), bins]).astype(np.int64))
        self._starts = self._starts[self._starts < count]
        self._sizes = np.diff(np.append(self._starts, count))
        mean_order = np.exp(np.add.reduceat(np.log(self._order), self._starts) / self._sizes)
        f = mean_order / (2.0 * self._n)
        self._design = np.stack([f**0, 1.0 / f, f**-2.0], axis=1)
        self._single = slice(0, single)
        self._tried = np.arange(_SLOWEST, min(0.5 * single, self._last), _SPACING)
        waves = self._of_lines(self._tried, self._single)
        c, s = waves.real, waves.imag
        # (m, 2 f) cosines and sines of the lines that are tried, and (m, 3 f) their products.
        self._columns = np.concatenate([c, s], axis=1)
        self._products = np.concatenate([c * c, s * s, c * s], axis=1)

    def lines(self, x: Array) -> list[tuple[Line, Array, float]]:
        """Return the lines that may be in x (n,), with their values (n,), and what each gains."""
        y = self._transform(x)[self._order]
        best = self._fit(y, np.empty(0), self._noise(y))
        while len(best.periods) < _MAX_LINES:
            more = [
                self._fit(y, np.append(best.periods, one), best)
                for one in {*self._slow_candidates(best), *self._fast_candidates(x, best)}
            ]
            found = min(more, key=lambda one: one.objective, default=best)
            if best.objective - found.objective <= _doubt(found.periods[-1:]).sum():
                break
            best = found
        gains = self._gains(y, best)
        # Several lines that take the place of a walk gain much next to each other, little alone.
        evident = gains > _EVIDENCE
        while evident.any():
            alone = self._gains(y, self._fit(y, best.periods[evident], best))
            if (alone > _EVIDENCE).all():
                break
            gains[evident] = np.minimum(gains[evident], alone)
            evident = gains > _EVIDENCE
        result = []
        angle = 2.0j * np.pi / self._n * (np.arange(self._n) + 0.5)
        for periods, part, gain in zip(best.periods, best.parts, gains, strict=True):
            if gain > _doubt(periods):
                line = Line(0, float(periods) / self._n, float(abs(part)))
                result.append((line, (part * np.exp(angle * periods)).real, float(gain)))
        return result

    def _gains(self, y: Array, best: _Fit) -> Array:
        """Return the log-likelihood that each line of coefficients y gains next to the others."""
        without = (self._fit(y, np.delete(best.periods, k), best) for k in range(len(best.periods)))
        return np.array([one.objective for one in without]) - best.objective

    def _of_lines(self, periods: Array, rows: slice = _ALL) -> Waves:
        """Return the coefficients (m, lines) of ``exp(2 pi i periods (j + 1/2) / n)``.

        Sums over j of ``cos(pi k (j + 1/2) / n)`` times it are two geometric series.
        """
        w = 2.0 * np.pi * periods / self._n
        k = np.pi * self._order[rows, None] / self._n
        half = 0.5 * np.stack([w + k, w - k])
        # sum_j exp(2 i half (j + 1/2)) for j from 0 to n - 1
        flat = np.abs(half) < 1e-12
        kernel = np.where(flat, self._n, np.sin(self._n * half) / np.sin(np.where(flat, 1.0, half)))
        one, other = kernel * np.exp(1j * self._n * half)
        return np.asarray((one + other) / np.sqrt(2.0 * self._n))

    def _rows(self, left: Array) -> Data:
        """Return the mean squares of coefficients (m,)."""
        power = np.add.reduceat(left**2, self._starts) / self._sizes
        zeros = np.zeros(len(power))
        return Data(power, self._sizes.astype(np.float64), zeros, zeros)

    def _noise(self, left: Array, guess: Array | None = None) -> _Fit:
        """Return the noise of coefficients (m,) in which nothing else is.

        :param guess: of the expected rows; None: a smooth spectrum.
        """
        data = self._rows(left)
        free, level = np.full((1, self._design.shape[1]), np.nan), np.zeros(1)
        start = data.first_guesses[0] if guess is None else guess
        found = fit_many(data, self._design, free, slope=level, guess=start[None])
        rows, nothing = found.expected[0], np.empty(0)
        variance = np.repeat(rows, self._sizes)
        return _Fit(float(found.objective[0]), rows, variance, nothing, nothing, left)

    def _fit(self, y: Array, periods: Array, start: _Fit) -> _Fit:
        """Return the fit to coefficients y with lines near some frequencies and noise, in turns.

        The frequencies follow by Gauss's and Newton's steps, none as far as to another line.

        :param start: its noise is that of the coefficients at first.
        """
        nearest, furthest = periods - 0.5 * _APART, periods + 0.5 * _APART
        best, lowest = start, np.inf
        for turn in range(1 + _ALTERNATIONS):
            root = np.sqrt(best.variance)
            if turn and len(periods):
                # By how much the frequencies are off, to first order.
                columns = self._tangent(best, _ALL) / root[:, None]
                step = _solved(columns, best.left / root)[-len(periods) :]
                step = np.clip(step, -_SPACING, _SPACING)
                periods = np.clip(best.periods + step, nearest, furthest)
                periods = np.maximum(periods, _SLOWEST)
            # Ramp and lines by least squares, and the noise of what they leave.
            waves = self._of_lines(periods)
            columns = np.column_stack([self._ramp, waves.real, -waves.imag])
            sizes = _solved(columns / root[:, None], y / root)
            _, cosines, sines = np.split(sizes, [1, 1 + len(periods)])
            noise = self._noise(y - columns @ sizes, best.rows)
            gain = lowest - noise.objective
            if gain > 0.0:
                best = noise._replace(periods=periods, parts=cosines + 1j * sines)
                lowest = best.objective
            if gain < _TOLERANCE:
                break
        return best

    def _tangent(self, found: _Fit, rows: slice) -> Array:
        """Return the derivatives (m, p) by the sizes of ramp and lines, and by the frequencies."""
        waves = self._of_lines(found.periods, rows)
        slopes = (self._of_lines(found.periods + _OFF, rows) - waves) / _OFF * found.parts
        return np.column_stack([self._ramp[rows], waves.real, waves.imag, slopes.real])

    def _slow_candidates(self, best: _Fit) -> list[float]:
        """Return the frequencies that fit best to the noise, and to a smooth spectrum."""
        rows = self._single
        known, price = self._tangent(best, rows), _doubt(self._tried)
        smooth = np.repeat(self._rows(best.left).first_guesses[0], self._sizes)
        result = []
        for variance in (best.variance, np.maximum(smooth, _LEAST)):
            weight = 1.0 / variance[rows]
            root = np.sqrt(weight)
            q = np.linalg.qr(known * root[:, None])[0]
            y = best.left[rows] * root
            rest = (y - q @ (q.T @ y)) * root
            gain = 0.5 * self._explained(weight, q * root[:, None], rest)
            gain[(np.abs(self._tried[:, None] - best.periods) < _APART).any(axis=1)] = 0.0
            k = int(np.argmax(gain - price))
            if gain[k] > 0.5 * price[k]:  # more of it is found with the noise that fits to it
                result.append(float(self._tried[k]))
        return result

    def _explained(self, weight: Array, known: Array, rest: Array) -> Array:
        """Return how much of a rest's square each line that is tried explains (f,), next to others.

        :param weight: (m,) of each coefficient's square.
        :param known: (m, p) times the roots of the weights: an orthonormal base of what is known.
        :param rest: (m,) times the weights: what that leaves of the coefficients.
        """
        c, s = np.split(known.T @ self._columns, 2, axis=1)
        taken = np.concatenate([c * c, s * s, c * s], axis=1).sum(axis=0)
        cc, ss, cs = np.split(weight @ self._products - taken, 3)
        yc, ys = np.split(rest @ self._columns, 2)
        determinant = cc * ss - cs * cs
        sound = determinant > 1e-9 * cc * ss
        safe = np.where(sound, determinant, 1.0)
        return np.where(sound, (ss * yc * yc - 2.0 * cs * yc * ys + cc * ys * ys) / safe, 0.0)

    def _fast_candidates(self, x: Array, best: _Fit) -> list[float]:
        """Return the highest peak of x over its surroundings among the averaged coefficients."""
        slowest, last = int(0.45 * _SINGLE), int(self._last) + 1
        if last <= slowest + 1:
            return []
        angle = 2.0j * np.pi / self._n * (np.arange(self._n) + 0.5)
        waves = [one * np.exp(angle * p) for one, p in zip(best.parts, best.periods, strict=True)]
        rest = x - np.sum(np.real(waves), axis=0) if waves else x
        line = np.linspace(-1.0, 1.0, self._n)
        level = rest - line * (line @ rest) / (line @ line)
        power = np.abs(np.fft.rfft(np.hanning(self._n) * level))[:last] ** 2
        count = int(np.log(last / slowest) / np.log(_STEP)) + 2
        centres = np.unique((slowest * _STEP ** np.arange(count)).astype(np.int64))
        # The median of exponentially distributed powers is ln 2 of their mean.
        usual = [
            np.median(power[int(k / _AROUND) - 4 : int(k * _AROUND) + 5]) / np.log(2.0)
            for k in centres[centres < last]
        ]
        orders = np.arange(slowest, last)
        levels = np.log(np.maximum(usual, 1e-300))
        surroundings = np.exp(np.interp(np.log(orders), np.log(centres[centres < last]), levels))
        ratio = power[slowest:] / surroundings
        k = int(np.argmax(ratio))
        return [float(k + slowest)] if ratio[k] > _PEAK else []


def _doubt(periods: Array) -> Array:
    """Return the log-likelihood that makes a line of so many periods possible."""
    return _DOUBT[0] + _DOUBT[1] * np.log(np.maximum(periods, 1.0))


def _solved(columns: Array, y: Array) -> Array:
    """Return the least-squares solution with columns of any size."""
    size = np.maximum(np.linalg.norm(columns, axis=0), 1e-300)
    found: Array = np.linalg.lstsq(columns / size, y, rcond=1e-10)[0]
    return found / size
