# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Signals among the slow changes of a record: sinusoids, shifts of level, a warm-up.

A room's heating makes a sinusoid, a shock or a driver a shift of level, power-on a transient that
decays exponentially. Each leaks over all of the slow coefficients and looks like a random walk.
Signals, a ramp, and noise (white noise, flicker, a walk, a Gauss-Markov process) are fitted
together to the coefficients of the cosine transform, in which each signal has a closed form and the
noise is independent. A signal that gains enough likelihood is taken from the readings. One that
gains less may be there or not: what rests on the slow coefficients is then to hold with it and
without it.
"""

from collections.abc import Iterable, Iterator, Sequence
from functools import partial
from itertools import compress, count
from typing import Final, NamedTuple, Protocol

import numpy as np

from imu_sim_ros.calibration.noise.likelihood import Data, fit_many
from imu_sim_ros.core.types import Array, Integers

_MAX_SIGNALS: Final = 8
"""Largest number of signals of an axis."""
_MIN_POINTS: Final = 400
"""Smallest number of values for the search of signals."""
_SLOWEST: Final = 0.6
"""Fewest periods of a line in the record; fewer are a ramp and a constant."""
_EVIDENCE: Final = 20.0
"""Log-likelihood that a line or a shift must gain with its parameters, at any of 10^5 frequencies
or times: noise gains as much in fewer than one record in 10^4."""
_TRANSIENT: Final = 10.0
"""Log-likelihood that a transient must gain. It begins with the record, so that few are tried, and
few coefficients contain it: chi-square(2), noise gains as much in one record in 10^4."""
_DOUBT: Final = (3.5, 1.5)
"""Log-likelihood from which a sinusoid is possible, and its increase per factor e of the periods in
the record: the more frequencies are tried, the larger is the largest peak of noise, and the less
a line resembles a walk. Noise has such a line in one record in six."""
_DOUBTFUL_SHIFT: Final = 8.0
"""Log-likelihood from which a shift is possible."""
_DOUBTFUL_TRANSIENT: Final = 3.0
"""Log-likelihood from which a transient is possible."""
_SLOW_TRANSIENT: Final = 1.0
"""Log-likelihood from which a transient is possible that explains the record as well as a ramp:
it has a parameter more than the walk that would explain it (Akaike's criterion)."""
_EQUIVALENT: Final = 2.0
"""Largest loss of log-likelihood of a transient that can replace a ramp: half of
chi-square(1, 0.95)."""
_RAMP: Final = 3.5
"""Log-likelihood that a ramp must gain over a transient."""
_WARM_UP: Final = (20.0, 7200.0)
"""Shortest and longest time constant of a warm-up [s]."""
_SINGLE: Final = 192
"""Number of coefficients that are used one by one, and searched exactly for slow signals."""
_WIDTH: Final = 0.05
"""Relative width of the rows in which the other coefficients are averaged."""
_MIN_DISTANCE: Final = 1.0
"""Smallest difference of two lines, in periods in the record; closer lines look like one that is
not a sinusoid."""
_SPACING: Final = 0.125
"""Step of the frequencies that are tried, in periods in the record."""
_TIMES: Final = 1.25
"""Ratio of consecutive time constants that are tried."""
_TIME_STEP: Final = 0.3
"""Largest change of a time constant's logarithm in one iteration."""
_MARGIN: Final = 8
"""Smallest number of values on each side of a shift."""
_ALTERNATIONS: Final = 12
"""Largest number of alternating fits of the signals and of the noise."""
_TOLERANCE: Final = 0.02
"""Gain of the log-likelihood below which the alternation stops."""
_DIFFERENCE: Final = 1e-4
"""Change of a parameter for numerical derivatives of a signal."""

_PEAK: Final = 14.0
"""Power over its surroundings of a candidate for a faster line: noise has one in 300 long
records."""
_STEP: Final = 1.05
"""Ratio of the frequencies at which the surroundings are computed."""
_SURROUNDINGS: Final = 1.5
"""Ratio of frequencies of the surroundings, with four more on each side."""

_PROCESS: Final = 6.0
"""Log-likelihood that a Gauss-Markov process must gain next to white noise, flicker and a walk."""
_PROCESS_TIMES: Final = 2.0
"""Ratio of consecutive correlation times that are tried."""
_ALL: Final = slice(None)
_LEAST: Final = 1e-100
"""Smallest variance, so that products of two inverse variances are finite."""
_DETERMINED: Final = 0.75
"""Largest leverage of signals on a coefficient that is corrected."""


class Line(NamedTuple):
    """A sinusoid on one axis."""

    axis: int
    frequency: float
    """Frequency [cycles per value]."""
    amplitude: float
    """Amplitude, in the unit of the values."""


class LevelShift(NamedTuple):
    """A step of the mean of one axis."""

    axis: int
    position: float
    """Number of values before the shift."""
    size: float
    """Mean after the shift minus that before it, in the unit of the values."""


class Transient(NamedTuple):
    """An exponential decay on one axis, from the first value."""

    axis: int
    time_constant: float
    """Time constant [values]."""
    size: float
    """Deviation at the start, in the unit of the values."""


Signal = Line | LevelShift | Transient


class Cleaned(NamedTuple):
    """Values (n,) without some signals."""

    values: Array
    """(n,) values without the signals."""
    inflation: Array
    """(m,) factors of the cosine transform's coefficients from the second on, which restore the
    variance that the fit of shifts and transients removed."""


class SlowSignals(NamedTuple):
    """Signals in the values (n,) of an axis in a piece."""

    certain: list[Signal]
    doubtful: list[Signal]
    """Signals that may exist or not."""
    without_certain: Cleaned
    without_doubtful: Cleaned
    """Values without certain and doubtful signals."""


def find_signals(
    columns: Iterable[Array], highest: float, interval: float = 1.0
) -> Iterator[SlowSignals]:
    """Yield the signals of each axis, which is in memory only until the next one.

    :param columns: values (n,) of each axis.
    :param highest: frequency up to which lines are searched, cycles per value.
    :param interval: time between two values [s].
    """
    search: _Search | None = None
    axes = count()
    for column in columns:  # enumerate would hold an axis until it has the next one
        axis, n = next(axes), len(column)
        if search is None and n >= _MIN_POINTS:
            search = _Search(n, highest, interval)
        signals = SlowSignals(
            [], [], *[Cleaned(column, np.ones(search.count if search else 0))] * 2
        )
        if search is not None and (column != column[0]).any():
            detection = search.signals(column)
            if detection.components:
                signals = _remove_signals(column, axis, detection)
        del column
        yield signals
        del signals


def _remove_signals(column: Array, axis: int, detection: "_Signals") -> SlowSignals:
    """Return the signals of an axis, and its values (n,) without them."""
    certain: list[Signal] = []
    doubtful: list[Signal] = []
    cleaned = smoother = Cleaned(column.copy(), detection.inflation[0])
    for component, is_certain in zip(detection.components, detection.certain, strict=True):
        if not is_certain and not doubtful:  # the certain ones come first
            smoother = Cleaned(cleaned.values.copy(), detection.inflation[1])
        curve = component.kind.values(component)
        (cleaned if is_certain else smoother).values[:] -= curve
        (certain if is_certain else doubtful).append(component.kind.signal(axis, component))
    return SlowSignals(certain, doubtful, cleaned, smoother)


class _Component(NamedTuple):
    """A signal of some kind, with its parameters; one of them enters nonlinearly."""

    kind: "_Kind"
    parameter: float
    """Periods of a line, position of a shift, or logarithm of a transient's time constant."""
    sizes: Array
    """(c,) factors of the kind's columns."""


class _Kind(Protocol):
    """A kind of signal in records of n values."""

    step: float
    """Largest change of the parameter in one iteration; 0: it does not move."""

    def columns(self, parameter: float, rows: slice = _ALL) -> Array:
        """Return the cosine transform's coefficients (m, c) of a signal with sizes of 1."""

    evidence: float
    """Log-likelihood with which a signal is certain."""

    def limits(self, parameter: float) -> tuple[float, float]:
        """Return the limits of a parameter during the fit."""

    def doubt(self, parameter: float) -> float:
        """Return the log-likelihood that makes a signal possible."""

    def values(self, component: _Component) -> Array:
        """Return the values (n,) of a signal, without their mean."""

    def signal(self, axis: int, component: _Component) -> Signal:
        """Return a signal in its public form."""


class _LineKind:
    """Sinusoids ``Re(part exp(2 pi i periods (j + 1/2) / n))``; the parameter is the periods."""

    step, evidence = _SPACING, _EVIDENCE

    def __init__(self, n: int, order: Integers) -> None:
        self._n, self._order = n, order

    def columns(self, parameter: float, rows: slice = _ALL) -> Array:
        """Return the coefficients (m, 2) of the wave's real and minus its imaginary part.

        Sums over j of ``cos(pi k (j + 1/2) / n)`` times it are two geometric series.
        """
        waves = self.waves(np.array([parameter]), rows)
        return np.concatenate([waves.real, -waves.imag], axis=1)

    def waves(self, periods: Array, rows: slice) -> Array:
        """Return the complex coefficients (m, lines) of ``exp(2 pi i periods (j + 1/2) / n)``."""
        w = 2.0 * np.pi * periods / self._n
        k = np.pi * self._order[rows, None] / self._n
        half = 0.5 * np.stack([w + k, w - k])
        # sum_j exp(2 i half (j + 1/2)) for j from 0 to n - 1
        flat = np.abs(half) < 1e-12
        kernel = np.where(flat, self._n, np.sin(self._n * half) / np.sin(np.where(flat, 1.0, half)))
        upper, lower = kernel * np.exp(1j * self._n * half)
        return np.asarray((upper + lower) / np.sqrt(2.0 * self._n))

    def limits(self, parameter: float) -> tuple[float, float]:
        """Return half a period in the record on each side."""
        return max(parameter - 0.5 * _MIN_DISTANCE, _SLOWEST), max(
            parameter + 0.5 * _MIN_DISTANCE, _SLOWEST
        )

    def doubt(self, parameter: float) -> float:
        """Return the log-likelihood from which a line with a number of periods is possible."""
        return float(_line_doubt(np.array(parameter)))

    def values(self, component: _Component) -> Array:
        """Return the sinusoid (n,)."""
        angle = np.arange(0.5, self._n)
        angle *= 2.0 * np.pi * component.parameter / self._n
        cosine, sine = component.sizes
        values = np.cos(angle)
        values *= cosine
        np.sin(angle, out=angle)
        angle *= sine
        values -= angle
        return values

    def signal(self, axis: int, component: _Component) -> Line:
        """Return a component as a sinusoid with its frequency and amplitude."""
        return Line(axis, component.parameter / self._n, float(np.hypot(*component.sizes)))


class _ShiftKind:
    """Steps from 0 to 1; the parameter is the number of values before it."""

    step, evidence = 0.0, _EVIDENCE

    def __init__(self, n: int, order: Integers) -> None:
        self._n, self._order = n, order
        self.factors = -np.sqrt(0.5 / n) / np.sin(0.5 * np.pi * order / n)
        """(m,) coefficients over ``sin(pi k position / n)``: a geometric series."""

    def columns(self, parameter: float, rows: slice = _ALL) -> Array:
        """Return the cosine transform's coefficients (m, 1) of a step at a position."""
        angle = np.pi * self._order[rows] * parameter / self._n
        return np.asarray((self.factors[rows] * np.sin(angle))[:, None])

    def limits(self, parameter: float) -> tuple[float, float]:
        """Return the position itself, which is exact."""
        return parameter, parameter

    def doubt(self, parameter: float) -> float:
        """Return the log-likelihood that makes a shift possible."""
        return _DOUBTFUL_SHIFT

    def values(self, component: _Component) -> Array:
        """Return the step (n,), around its mean."""
        step = np.zeros(self._n)
        step[int(np.ceil(component.parameter)) :] = component.sizes[0]
        step -= step.mean()
        return step

    def signal(self, axis: int, component: _Component) -> LevelShift:
        """Return a component as a step with its position and size."""
        return LevelShift(axis, component.parameter, float(component.sizes[0]))


class _TransientKind:
    """Decays ``exp(-(j + 1/2) / T)``; the parameter is ln T, T in values."""

    step, evidence = _TIME_STEP, _TRANSIENT

    def __init__(self, n: int, order: Integers, shortest: float, longest: float) -> None:
        """Initialise for records of n values.

        :param order: (m,) indices of the cosine transform's coefficients.
        :param shortest: smallest time constant [values].
        :param longest: largest time constant [values].
        """
        self._n, self._order = n, order
        self._limits = float(np.log(shortest)), float(np.log(longest))
        count = max(int(np.ceil((self._limits[1] - self._limits[0]) / np.log(_TIMES))), 1) + 1
        self.tried = np.linspace(*self._limits, count)
        """Parameters at which a transient is looked for."""

    def columns(self, parameter: float, rows: slice = _ALL) -> Array:
        """Return the cosine transform's coefficients (m, 1) of a decay: a geometric series."""
        order = self._order[rows]
        rate = np.exp(-parameter) - 1j * np.pi * order / self._n
        end = np.where(order % 2 == 0, 1.0, -1.0) * np.exp(-self._n * np.exp(-parameter))
        series = (1.0 - end) / (2.0 * np.sinh(0.5 * rate))
        return np.asarray(series.real[:, None] * np.sqrt(2.0 / self._n))

    def limits(self, parameter: float) -> tuple[float, float]:
        """Return the shortest and the longest time constant."""
        return self._limits

    def doubt(self, parameter: float) -> float:
        """Return the log-likelihood that makes a transient possible."""
        return _DOUBTFUL_TRANSIENT

    def values(self, component: _Component) -> Array:
        """Return the decay (n,), around its mean."""
        decay = np.arange(0.5, self._n)
        decay *= -np.exp(-component.parameter)
        np.exp(decay, out=decay)
        decay -= decay.mean()
        decay *= component.sizes[0]
        return decay

    def signal(self, axis: int, component: _Component) -> Transient:
        """Return a component as a decay with its time constant and size."""
        return Transient(axis, float(np.exp(component.parameter)), float(component.sizes[0]))


class _Fit(NamedTuple):
    """Ramp, signals and noise fitted together."""

    objective: float
    """Minus the log-likelihood."""
    rows: Array
    """Expected rows."""
    variance: Array
    """(m,) variance of each coefficient."""
    components: tuple[_Component, ...]
    ramp: bool
    """True if a ramp was fitted with the signals."""
    remainder: Array
    """(m,) the coefficients without ramp and signals."""


class _Signals(NamedTuple):
    """Signals that a search has found on one axis."""

    components: Sequence[_Component]
    certain: Sequence[bool]
    """True for each component that is certain; the others, which follow, are doubtful."""
    inflation: tuple[Array, Array]
    """(m,) factors of the coefficients without the certain signals, and without all."""


class _Search:
    """Search in records of n values, with the quantities common to all axes."""

    def __init__(self, n: int, highest: float, interval: float) -> None:
        """Initialise for records of n values.

        :param highest: frequency up to which lines are searched, cycles per value.
        :param interval: time between two values [s].
        """
        from scipy.fft import dct, dst

        # Into the memory of their argument, since each array is as long as the record.
        self._transform = partial(dct, norm="ortho", overwrite_x=True)
        self._sine_transform = partial(dst, type=1, overwrite_x=True)
        self._n, self._last = n, highest * n
        """Number of values, and number of periods of the fastest line in the record."""
        self._order = np.arange(1, min(int(2.0 * self._last) + 2, n))
        """(m,) indices of the coefficients; index k has k / 2 periods in the record."""
        self.count = len(self._order)
        """Number m of coefficients that are compared."""
        self._ramp = self._transform(np.arange(n) / n)[self._order]
        """(m,) coefficients of a ramp from 0 to 1."""
        single_count = min(_SINGLE, self.count)
        self._starts = _row_starts(single_count, self.count)
        """(rows,) first coefficient of each row of the spectrum."""
        self._sizes = np.diff(np.append(self._starts, self.count))
        """(rows,) number of coefficients of each row."""
        mean_order = np.exp(np.add.reduceat(np.log(self._order), self._starts) / self._sizes)
        f = mean_order / (2.0 * n)
        self._standard = np.stack([f**0, 1.0 / f, f**-2.0], axis=1)
        """(rows, 3) white noise, flicker and random walk of unit size."""
        processes = _gauss_markov_spectra(f, n, interval)
        self._extended = np.stack(
            [np.column_stack([self._standard, process]) for process in processes.T]
        )
        """(times, rows, 4) standard design with Gauss-Markov processes of 1 at zero frequency."""
        self._design = self._standard
        """Expectation of the rows for each noise of unit size, of the axis that is searched."""
        self._single = slice(0, single_count)
        """Coefficients that are searched exactly for slow signals."""
        self._line = _LineKind(n, self._order)
        self._shift = _ShiftKind(n, self._order)
        shortest, longest = (seconds / interval for seconds in _WARM_UP)
        shortest = max(shortest, 4.0)
        self._transient = _TransientKind(n, self._order, shortest, max(longest, 2.0 * shortest))
        self._decays = np.concatenate(
            [self._transient.columns(float(p), self._single) for p in self._transient.tried], axis=1
        )
        """(m, t) single coefficients of the transients that are tried."""
        self._tried = np.arange(_SLOWEST, min(0.5 * single_count, self._last), _SPACING)
        """(f,) periods in the record of the slow lines that are tried."""
        waves = self._line.waves(self._tried, self._single)
        c, s = waves.real, waves.imag
        self._columns = np.concatenate([c, s], axis=1)
        """(m, 2 f) single coefficients of cosines and sines of the lines that are tried."""
        self._products = np.concatenate([c * c, s * s, c * s], axis=1)
        """(m, 3 f) products of these columns."""

    def signals(self, x: Array) -> _Signals:
        """Return the signals of values x (n,) of an axis, certain and doubtful.

        Signals are added one by one, each time the one that explains most, as long as it gains more
        than a possible signal must.
        """
        y = self._transform(x - x.mean())[self._order]
        self._design = self._standard
        best = self._with_process(y, self._fit(y, (), self._noise(y)))
        for _ in range(_MAX_SIGNALS):
            extended = self._add_best_signal(x, y, best)
            if extended is None:
                break
            best = self._with_process(y, self._relocate_shift(y, extended))
        components, certain = self._classify(y, best)
        certain_components = list(compress(components, certain))
        inflation = self._inflation(certain_components, best), self._inflation(components, best)
        return _Signals(components, certain, inflation)

    def _add_best_signal(self, x: Array, y: Array, best: _Fit) -> _Fit | None:
        """Return the best fit with one more signal; None if no signal gains enough likelihood.

        :param x: (n,) values.
        :param y: (m,) their coefficients.
        """
        largest_gain, extended = 0.0, None
        for component in self._candidates(x, y, best):
            ramp = best.ramp and component.kind is not self._transient
            fitted = self._fit(y, (*best.components, component), best, ramp=ramp)
            required = component.kind.doubt(fitted.components[-1].parameter)
            gain = best.objective - fitted.objective - required
            if gain > largest_gain:
                largest_gain, extended = gain, fitted
        return extended

    def _classify(self, y: Array, best: _Fit) -> tuple[list[_Component], list[bool]]:
        """Return the signals of a fit to coefficients y that are possible, and the certain ones."""
        gains = self._gains(y, best)
        evidence = np.array([c.kind.evidence for c in best.components])
        # Signals that together replace a walk gain much jointly, but little one by one.
        evident = gains > evidence
        while evident.any():
            chosen = list(compress(best.components, evident))
            alone = self._gains(y, self._fit(y, chosen, best, ramp=best.ramp))
            if (alone > evidence[evident]).all():
                break
            gains[evident] = np.minimum(gains[evident], alone)
            evident = gains > evidence
        certain = list(compress(best.components, evident))
        doubtful = [
            component
            for component, gain, is_evident in zip(best.components, gains, evident, strict=True)
            if not is_evident and gain > component.kind.doubt(component.parameter)
        ]
        if not any(component.kind is self._transient for component in certain + doubtful):
            doubtful = self._with_transient(y, best, certain, doubtful)
        return certain + doubtful, [True] * len(certain) + [False] * len(doubtful)

    def _with_transient(
        self, y: Array, best: _Fit, certain: list[_Component], doubtful: list[_Component]
    ) -> list[_Component]:
        """Return the doubtful signals, with or without a transient in place of a ramp.

        A transient that explains the record as well as a ramp does is possible. If it also explains
        it as well as the doubtful signals do, it replaces them.

        :param certain: signals that are certain.
        :param doubtful: signals that may exist.
        """
        with_ramp = self._fit(y, certain, best)
        decay = self._best_transient(y, with_ramp)
        with_decay = self._fit(y, (*certain, decay), best, ramp=False)
        if with_decay.objective > with_ramp.objective + _EQUIVALENT:
            return doubtful
        without = self._fit(y, certain, best, ramp=False)
        if without.objective - with_decay.objective < _SLOW_TRANSIENT:
            return doubtful
        price = _RAMP + sum(c.kind.doubt(c.parameter) for c in doubtful)
        if with_decay.objective + _DOUBTFUL_TRANSIENT <= best.objective + price:
            return [with_decay.components[-1]]
        with_all = self._fit(y, (*certain, *doubtful, decay), best, ramp=False)
        return list(with_all.components[len(certain) :])

    def _candidates(self, x: Array, y: Array, best: _Fit) -> Iterator[_Component]:
        """Yield the signals of each kind that explain most of the remainder of coefficients y."""
        for periods in {*self._slow_candidates(best), *self._fast_candidates(x, best)}:
            yield _Component(self._line, periods, np.zeros(2))
        position, gain = self._best_shift(best)
        if gain > 0.5 * _DOUBTFUL_SHIFT:
            yield _Component(self._shift, position, np.zeros(1))
        if not any(c.kind is self._transient for c in best.components):
            yield self._best_transient(y, best)

    def _gains(self, y: Array, best: _Fit) -> Array:
        """Return the log-likelihood that each signal of coefficients y gains next to the others.

        Without a transient there may be a ramp.
        """
        objectives = []
        for k, component in enumerate(best.components):
            remaining = (*best.components[:k], *best.components[k + 1 :])
            ramp = best.ramp or component.kind is self._transient
            objectives.append(self._fit(y, remaining, best, ramp=ramp).objective)
        return np.array(objectives) - best.objective

    def _with_process(self, y: Array, best: _Fit) -> _Fit:
        """Return a fit with the Gauss-Markov process that the remainder requires, if any."""
        data, level = self._rows(best.remainder), np.zeros(1)
        guess, free = best.rows[None], _free_components(3)
        base = fit_many(data, self._standard, free, slope=level, guess=guess).lowest
        count = len(self._extended)
        fits = fit_many(
            data,
            self._extended,
            np.tile(_free_components(4), (count, 1)),
            slope=np.zeros(count),
            guess=np.tile(guess, (count, 1)),
        )
        improved = base - fits.lowest >= _PROCESS
        self._design = self._extended[np.argmin(fits.objective)] if improved else self._standard
        return self._fit(y, best.components, best, ramp=best.ramp)

    def _rows(self, remainder: Array) -> Data:
        """Return the mean squares of coefficients (m,)."""
        power = np.add.reduceat(remainder**2, self._starts) / self._sizes
        zeros = np.zeros(len(power))
        return Data(power, self._sizes.astype(np.float64), zeros, zeros)

    def _noise(self, remainder: Array, guess: Array | None = None) -> _Fit:
        """Return the noise of coefficients (m,) without signals.

        :param guess: expected rows; None: a smooth spectrum.
        """
        data = self._rows(remainder)
        start = data.first_guesses[0] if guess is None else guess
        free = _free_components(self._design.shape[1])
        fits = fit_many(data, self._design, free, slope=np.zeros(1), guess=start[None])
        rows = fits.expected[0]
        variance = np.repeat(rows, self._sizes)
        return _Fit(
            objective=float(fits.objective[0]),
            rows=rows,
            variance=variance,
            components=(),
            ramp=False,
            remainder=remainder,
        )

    def _fit(
        self, y: Array, components: Sequence[_Component], start: _Fit, *, ramp: bool = True
    ) -> _Fit:
        """Return the fit to coefficients y with signals near some parameters and noise, in turns.

        The parameters follow by Gauss's and Newton's steps, each within its limits.

        :param start: fit with the noise to start from.
        :param ramp: fit a ramp, too.
        """
        limits = [c.kind.limits(c.parameter) for c in components]
        best, lowest = start._replace(components=tuple(components)), np.inf
        for turn in range(1 + _ALTERNATIONS):
            root = np.sqrt(best.variance)
            parameters = [c.parameter for c in best.components]
            if turn and any(c.kind.step for c in components):
                # First-order corrections of the parameters.
                columns = self._tangent(best.components, ramp, _ALL) / root[:, None]
                steps = list(_least_squares(columns, best.remainder / root)[::-1])
                for k in reversed(range(len(components))):
                    if largest := components[k].kind.step:
                        size = float(np.clip(steps.pop(0), -largest, largest))
                        parameters[k] = float(np.clip(parameters[k] + size, *limits[k]))
            # Ramp and signals by least squares, and the noise of the remainder.
            parts = [c.kind.columns(p) for c, p in zip(components, parameters, strict=True)]
            base = [self._ramp[:, None]] if ramp else []
            if not parts and not base:
                return self._noise(y, best.rows)
            columns = np.concatenate([*base, *parts], axis=1)
            sizes = _least_squares(columns / root[:, None], y / root)
            noise = self._noise(y - columns @ sizes, best.rows)
            gain = lowest - noise.objective
            if gain > 0.0:
                splits = np.cumsum([len(base), *(part.shape[1] for part in parts)])
                factors = np.split(sizes, splits)[1:-1]
                fitted_parts = zip(components, parameters, factors, strict=True)
                fitted = tuple(_Component(c.kind, p, size) for c, p, size in fitted_parts)
                best = noise._replace(components=fitted, ramp=ramp)
                lowest = best.objective
            if gain < _TOLERANCE:
                break
        return best

    def _tangent(self, components: Sequence[_Component], ramp: bool, rows: slice) -> Array:
        """Return the derivatives (m, p) by the sizes of ramp and signals, and by the parameters."""
        base = [self._ramp[rows, None]] if ramp else []
        parts = [c.kind.columns(c.parameter, rows) for c in components]
        slopes = [
            (c.kind.columns(c.parameter + _DIFFERENCE, rows) - part)
            @ c.sizes[:, None]
            / _DIFFERENCE
            for c, part in zip(components, parts, strict=True)
            if c.kind.step
        ]
        empty = np.empty((len(self._order[rows]), 0))
        return np.concatenate([empty, *base, *parts, *slopes], axis=1)

    def _fitted_base(self, best: _Fit, rows: slice, weight: Array) -> tuple[Array, Array]:
        """Return an orthonormal base (m, p) of the fitted model, and the remainder, both weighted.

        :param weight: (m,) inverse variance of each coefficient.
        """
        root = np.sqrt(weight)
        base = self._tangent(best.components, best.ramp, rows) * root[:, None]
        q = np.linalg.qr(base)[0]
        y = best.remainder[rows] * root
        return q, y - q @ (q.T @ y)

    def _slow_candidates(self, best: _Fit) -> list[float]:
        """Return the best frequencies with the fitted noise, and with a smooth spectrum."""
        rows, price = self._single, _line_doubt(self._tried)
        smooth = np.repeat(self._rows(best.remainder).first_guesses[0], self._sizes)
        periods = np.array([c.parameter for c in best.components if c.kind is self._line])
        frequencies = []
        for variance in (best.variance, np.maximum(smooth, _LEAST)):
            weight = 1.0 / variance[rows]
            root = np.sqrt(weight)
            q, residual = self._fitted_base(best, rows, weight)
            gain = 0.5 * self._explained_squares(weight, q * root[:, None], residual * root)
            gain[(np.abs(self._tried[:, None] - periods) < _MIN_DISTANCE).any(axis=1)] = 0.0
            k = int(np.argmax(gain - price))
            if gain[k] > 0.5 * price[k]:  # the gain grows once the noise is fitted with the line
                frequencies.append(float(self._tried[k]))
        return frequencies

    def _explained_squares(self, weight: Array, base: Array, residual: Array) -> Array:
        """Return the squares (f,) of a residual that each line on the grid explains beside others.

        :param weight: (m,) weights of the squared coefficients.
        :param base: (m, p) orthonormal base of the fitted model, times the roots of the weights.
        :param residual: (m,) remainder of the coefficients, times the weights.
        """
        c, s = np.split(base.T @ self._columns, 2, axis=1)
        explained_by_base = np.concatenate([c * c, s * s, c * s], axis=1).sum(axis=0)
        cc, ss, cs = np.split(weight @ self._products - explained_by_base, 3)
        yc, ys = np.split(residual @ self._columns, 2)
        determinant = cc * ss - cs * cs
        sound = determinant > 1e-9 * cc * ss
        safe = np.where(sound, determinant, 1.0)
        return np.where(sound, (ss * yc * yc - 2.0 * cs * yc * ys + cc * ys * ys) / safe, 0.0)

    def _fast_candidates(self, x: Array, best: _Fit) -> list[float]:
        """Return the highest peak of x over its surroundings among the averaged coefficients."""
        slowest, end = int(0.45 * _SINGLE), int(self._last) + 1
        if end <= slowest + 1:
            return []
        # In place, since each array is as long as the record.
        level = x - x.mean()
        level -= sum(c.kind.values(c) for c in best.components)
        line = np.linspace(-1.0, 1.0, self._n)
        product, norm = line @ level, line @ line
        line *= product
        line /= norm
        level -= line
        del line
        level *= np.hanning(self._n)
        power = np.abs(np.fft.rfft(level)[:end]) ** 2
        count = int(np.log(end / slowest) / np.log(_STEP)) + 2
        centres = np.unique((slowest * _STEP ** np.arange(count)).astype(np.int64))
        # The median of exponentially distributed powers is ln 2 of their mean.
        medians = [
            np.median(power[int(k / _SURROUNDINGS) - 4 : int(k * _SURROUNDINGS) + 5]) / np.log(2.0)
            for k in centres[centres < end]
        ]
        orders = np.arange(slowest, end)
        levels = np.log(np.maximum(medians, 1e-300))
        surroundings = np.exp(np.interp(np.log(orders), np.log(centres[centres < end]), levels))
        ratio = power[slowest:] / surroundings
        k = int(np.argmax(ratio))
        return [float(k + slowest)] if ratio[k] > _PEAK else []

    def _best_shift(self, best: _Fit) -> tuple[float, float]:
        """Return the position of the shift that explains most, of all positions, and its gain.

        A shift's gain is half the square of its product with the weighted residual, over the sum of
        squares of the part of it that the fitted model does not explain already.

        Products of the coefficients with those of every shift are a sine transform; the squares of
        those of every shift, ``sin^2 = (1 - cos) / 2``, a cosine series. All is computed in place,
        since each array is as long as the record.
        """
        n, weight = self._n, 1.0 / best.variance
        scaled = np.sqrt(weight) * self._shift.factors
        q, residual = self._fitted_base(best, _ALL, weight)
        explained = np.zeros(n - 1)
        for column in q.T:
            product = self._sines(column * scaled)
            explained += np.square(product, out=product)
            del product
        size = self._shift_sizes(scaled)
        unexplained = np.subtract(size, explained, out=explained)
        # Positions at which rounding, the ends, or a shift that is fitted already decide are out.
        size *= 1e-6
        sound = unexplained > size
        del size
        sound[: _MARGIN - 1] = sound[len(sound) - _MARGIN + 1 :] = False
        for component in best.components:
            if component.kind is self._shift:
                centre = int(component.parameter) - 1
                sound[max(centre - _MARGIN, 0) : centre + _MARGIN + 1] = False
        gain = self._sines(residual * scaled)
        np.square(gain, out=gain)
        gain *= 0.5
        unexplained[~sound] = 1.0
        gain /= unexplained
        gain[~sound] = 0.0
        k = int(np.argmax(gain))
        return float(k + 1), float(gain[k])

    def _sines(self, coefficients: Array) -> Array:
        """Return the sine series (n - 1,) of coefficients (m,) at the positions from 1 on."""
        series = np.zeros(self._n - 1)
        series[: self.count] = coefficients
        series = self._sine_transform(series)
        series *= 0.5
        return series

    def _shift_sizes(self, factors: Array) -> Array:
        """Return the sums (n - 1,) of squares of a shift at each position from 1 on.

        :param factors: (m,) factors of the sines that are squared and added.
        """
        n = self._n
        squares = np.zeros(n)
        squares[1 : 1 + self.count] = factors**2
        total = squares.sum()
        cosines = np.fft.rfft(squares).real
        del squares
        size = np.empty(n - 1)
        ahead = len(cosines) - 1
        size[:ahead] = cosines[1:]
        size[ahead:] = cosines[(n - 1) // 2 : 0 : -1]
        np.subtract(total, size, out=size)
        size *= 0.5
        return size

    def _relocate_shift(self, y: Array, best: _Fit) -> _Fit:
        """Return a fit whose last signal, if it is a shift, is at its best position."""
        *remaining, shift = best.components
        if shift.kind is not self._shift:
            return best
        remainder = best.remainder + shift.kind.columns(shift.parameter) @ shift.sizes
        position, _ = self._best_shift(
            best._replace(components=tuple(remaining), remainder=remainder)
        )
        if position == shift.parameter:
            return best
        moved = (*remaining, shift._replace(parameter=position))
        fitted = self._fit(y, moved, best, ramp=best.ramp)
        return fitted if fitted.objective < best.objective else best

    def _best_transient(self, y: Array, best: _Fit) -> _Component:
        """Return the transient that explains most of coefficients y in place of a ramp."""
        rows, root = self._single, 1.0 / np.sqrt(best.variance[self._single])
        remaining = [c for c in best.components if c.kind is not self._transient]
        remainder = y - sum(c.kind.columns(c.parameter) @ c.sizes for c in remaining)
        q = np.linalg.qr(self._tangent(remaining, False, rows) * root[:, None])[0]
        decays = self._decays * root[:, None]
        decays = decays - q @ (q.T @ decays)
        residual = remainder[rows] * root
        residual = residual - q @ (q.T @ residual)
        explained = (residual @ decays) ** 2 / np.maximum(np.sum(decays**2, axis=0), 1e-300)
        parameter = float(self._transient.tried[int(np.argmax(explained))])
        return _Component(self._transient, parameter, np.zeros(1))

    def _inflation(self, components: Sequence[_Component], best: _Fit) -> Array:
        """Return the factors (m,) that restore the variance that shifts and transients removed.

        A coefficient of variance s has ``s (1 - h)`` after a fit, h the leverage of the signals.
        """
        shapes = [c for c in components if c.kind is not self._line]
        if not shapes:
            return np.ones(self.count)
        root = np.sqrt(best.variance)
        q = np.linalg.qr(self._tangent(shapes, False, _ALL) / root[:, None])[0]
        leverage = np.minimum(np.sum(q**2, axis=1), _DETERMINED)
        return np.asarray(1.0 / np.sqrt(1.0 - leverage))


def _row_starts(single: int, count: int) -> Integers:
    """Return the first coefficient of each row of a spectrum of some coefficients.

    The first rows are single coefficients, all others the means of log-spaced bins.

    :param single: number of single coefficients.
    """
    bins = single * np.exp(_WIDTH * np.arange(np.log(count / single) / _WIDTH))
    starts = np.unique(np.concatenate([np.arange(single), bins]).astype(np.int64))
    return np.asarray(starts[starts < count])


def _gauss_markov_spectra(f: Array, n: int, interval: float) -> Array:
    """Return the spectra (rows, times) of Gauss-Markov processes, 1 at zero frequency.

    Their correlation times are from a second, since a sensor's filter is faster and its bias
    process slower, to a quarter of the record.

    :param f: (rows,) frequencies [cycles per value].
    :param n: number of values of the record.
    :param interval: time between two values [s].
    """
    fastest, slowest = max(4.0, 1.0 / interval), 0.25 * n
    count = max(int(np.log(slowest / fastest) / np.log(_PROCESS_TIMES)), 0) + 1
    corner = 1.0 - np.exp(-1.0 / (fastest * _PROCESS_TIMES ** np.arange(count)))
    sine = 4.0 * (1.0 - corner) * np.sin(np.pi * f[:, None]) ** 2
    return np.asarray(corner**2 / (corner**2 + sine))


def _free_components(count: int) -> Array:
    """Return NaNs (1, count): components of one fit, all of them estimated."""
    return np.full((1, count), np.nan)


def _line_doubt(periods: Array) -> Array:
    """Return the log-likelihood from which a line with a number of periods is possible."""
    return np.asarray(_DOUBT[0] + _DOUBT[1] * np.log(np.maximum(periods, 1.0)))


def _least_squares(columns: Array, y: Array) -> Array:
    """Return the least-squares solution with columns of any size."""
    size = np.maximum(np.linalg.norm(columns, axis=0), 1e-300)
    solution: Array = np.linalg.lstsq(columns / size, y, rcond=1e-10)[0]
    return solution / size
