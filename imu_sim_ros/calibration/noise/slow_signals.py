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

from collections.abc import Iterator, Sequence
from functools import partial
from typing import Final, NamedTuple, Protocol

import numpy as np

from imu_sim_ros.calibration.noise.likelihood import Data, fit_many
from imu_sim_ros.types import Array, Integers

_MAX_SIGNALS: Final = 8
_MIN_POINTS: Final = 400
"""Values with which there are coefficients enough for a signal and the noise around it."""
_SLOWEST: Final = 0.6
"""Periods in the record; fewer are a ramp and a constant."""
_EVIDENCE: Final = 20.0
"""Log-likelihood that a line or a shift must gain with its parameters, at any of 10^5 frequencies
or times: noise does in fewer than one record in 10^4."""
_TRANSIENT: Final = 10.0
"""Log-likelihood that a transient must gain: it begins with the record, so that few are tried, and
few coefficients see it. By chi-square(2) noise does in one record in 10^4, for each of them."""
_DOUBT: Final = (3.5, 1.5)
"""Log-likelihood from which on a sinusoid is possible, and the increase for each factor e of its
periods in the record: the more frequencies, the better is the best of noise, and the less do they
matter to a walk. Noise has such a line in one record in six, most often of a few periods."""
_DOUBTFUL_SHIFT: Final = 8.0
"""Log-likelihood from which on a shift is possible."""
_DOUBTFUL_TRANSIENT: Final = 3.0
"""Log-likelihood from which on a transient is possible."""
_AS_WELL: Final = 2.0
"""Log-likelihood by which a transient may be worse than a ramp that it can stand for: half of
chi-square(1, 0.95)."""
_RAMP: Final = 3.5
"""Log-likelihood that a ramp is worth where it is compared with a transient."""
_WARM_UP: Final = (20.0, 7200.0)
"""Shortest and longest time constant of a warm-up [s]."""
_SINGLE: Final = 192
"""Coefficients that are looked at one by one, and that are searched for slow signals exactly."""
_WIDTH: Final = 0.05
"""Relative width of the rows in which the others are averaged."""
_APART: Final = 1.0
"""Periods in the record by which two lines differ; nearer ones cannot be told from one that is no
sinusoid."""
_SPACING: Final = 0.125
"""Periods in the record between the frequencies that are tried."""
_TIMES: Final = 1.25
"""Ratio of the time constants that are tried."""
_TIME_STEP: Final = 0.3
"""Largest change of a time constant's logarithm in one iteration."""
_MARGIN: Final = 8
"""Values on each side of a shift; fewer are single values."""
_ALTERNATIONS: Final = 12
"""At most, of fits of the signals and of the noise; each leaves a few percent of the difference."""
_TOLERANCE: Final = 0.02
"""Log-likelihood whose gain is not worth another."""
_OFF: Final = 1e-4
"""Change of a parameter over which a signal is differentiated."""

_PEAK: Final = 14.0
"""Power over its surroundings that makes a candidate of a faster line: noise has one in 300 long
records."""
_STEP: Final = 1.05
"""Ratio of the frequencies at which the surroundings are looked at."""
_AROUND: Final = 1.5
"""Ratio of frequencies that are surroundings, with four more on each side."""

_PROCESS: Final = 6.0
"""Log-likelihood that a Gauss-Markov process must gain next to white noise, flicker and a walk."""
_PROCESS_TIMES: Final = 2.0
"""Ratio of the correlation times that are tried."""
_ALL: Final = slice(None)
_LEAST: Final = 1e-100
"""Least variance: products of two weights, its inverses, must be numbers."""
_DETERMINED: Final = 0.75
"""Largest share of a coefficient that is restored after signals took it."""


class Line(NamedTuple):
    """A sinusoid on one axis."""

    axis: int
    frequency: float
    """Cycles per value."""
    amplitude: float


class LevelShift(NamedTuple):
    """A shift of level on one axis."""

    axis: int
    position: float
    """Values before it."""
    size: float


class Transient(NamedTuple):
    """An exponential decay on one axis from the begin of the values."""

    axis: int
    time_constant: float
    """Values."""
    size: float


Signal = Line | LevelShift | Transient


class Cleaned(NamedTuple):
    """Values (axes, n) without some signals."""

    values: Array
    inflation: Array
    """(axes, m) factor of the cosine transform's coefficients from the second on, which restores
    the variance that fitted shifts and transients took."""


class SlowSignals(NamedTuple):
    """Signals in the values (axes, n) of a piece."""

    certain: list[Signal]
    doubtful: list[Signal]
    """Signals that may be there or not."""
    without_certain: Cleaned
    without_doubtful: Cleaned
    """Values without certain and doubtful signals."""


def find_signals(values: Array, highest: float, interval: float = 1.0) -> SlowSignals:
    """Return the signals of values (axes, n).

    :param highest: frequency up to which lines are searched, cycles per value.
    :param interval: time between two values [s].
    """
    axes, n = values.shape
    certain: list[Signal] = []
    doubtful: list[Signal] = []
    search = _Search(n, highest, interval) if n >= _MIN_POINTS else None
    unit = np.ones((axes, 0 if search is None else search.count))
    cleaned, smoother = Cleaned(values, unit), Cleaned(values, unit)
    for axis, column in enumerate(values):
        if search is None or not (column != column[0]).any():
            continue
        found = search.signals(column - column.mean())
        if not found.components:
            continue
        if cleaned.values is values:
            cleaned = Cleaned(values.copy(), unit.copy())
            smoother = Cleaned(values.copy(), unit.copy())
        for component, is_certain in zip(found.components, found.certain, strict=True):
            curve = component.kind.values(component)
            smoother.values[axis] -= curve
            if is_certain:
                cleaned.values[axis] -= curve
            (certain if is_certain else doubtful).append(component.kind.signal(axis, component))
        cleaned.inflation[axis], smoother.inflation[axis] = found.inflation
    return SlowSignals(certain, doubtful, cleaned, smoother if doubtful else cleaned)


class _Component(NamedTuple):
    """A signal of some kind with its parameters, of which one enters nonlinearly."""

    kind: "_Kind"
    parameter: float
    sizes: Array
    """(c,) factors of the kind's columns."""


class _Kind(Protocol):
    """A kind of signal in records of n values."""

    step: float
    """Largest change of the parameter in one iteration; 0: it does not move."""

    def columns(self, parameter: float, rows: slice = _ALL) -> Array:
        """Return (m, c) the coefficients of a signal with sizes of 1."""

    evidence: float
    """Log-likelihood with which a signal is certain."""

    def limits(self, parameter: float) -> tuple[float, float]:
        """Return between which values a parameter may move."""

    def doubt(self, parameter: float) -> float:
        """Return the log-likelihood that makes a signal possible."""

    def values(self, component: _Component) -> Array:
        """Return (n,) the values of a signal."""

    def signal(self, axis: int, component: _Component) -> Signal:
        """Return a signal as it is reported."""


class _LineKind:
    """Sinusoids ``Re(part exp(2 pi i periods (j + 1/2) / n))``; the parameter is the periods."""

    step, evidence = _SPACING, _EVIDENCE

    def __init__(self, n: int, order: Integers) -> None:
        self._n, self._order = n, order

    def columns(self, parameter: float, rows: slice = _ALL) -> Array:
        """Return (m, 2) the coefficients of the wave's real and minus its imaginary part.

        Sums over j of ``cos(pi k (j + 1/2) / n)`` times it are two geometric series.
        """
        waves = self.waves(np.array([parameter]), rows)
        return np.concatenate([waves.real, -waves.imag], axis=1)

    def waves(self, periods: Array, rows: slice) -> Array:
        """Return (m, lines) the complex coefficients of ``exp(2 pi i periods (j + 1/2) / n)``."""
        w = 2.0 * np.pi * periods / self._n
        k = np.pi * self._order[rows, None] / self._n
        half = 0.5 * np.stack([w + k, w - k])
        # sum_j exp(2 i half (j + 1/2)) for j from 0 to n - 1
        flat = np.abs(half) < 1e-12
        kernel = np.where(flat, self._n, np.sin(self._n * half) / np.sin(np.where(flat, 1.0, half)))
        above, below = kernel * np.exp(1j * self._n * half)
        return np.asarray((above + below) / np.sqrt(2.0 * self._n))

    def limits(self, parameter: float) -> tuple[float, float]:
        """Return half a period in the record on each side."""
        return max(parameter - 0.5 * _APART, _SLOWEST), max(parameter + 0.5 * _APART, _SLOWEST)

    def doubt(self, parameter: float) -> float:
        """Return the log-likelihood that makes a line of so many periods possible."""
        return float(_line_doubt(np.array(parameter)))

    def values(self, component: _Component) -> Array:
        """Return (n,) the wave."""
        angle = 2.0 * np.pi * component.parameter / self._n * (np.arange(self._n) + 0.5)
        cosine, sine = component.sizes
        return np.asarray(cosine * np.cos(angle) - sine * np.sin(angle))

    def signal(self, axis: int, component: _Component) -> Line:
        """Return the line."""
        return Line(axis, component.parameter / self._n, float(np.hypot(*component.sizes)))


class _ShiftKind:
    """Steps from 0 to 1; the parameter is the number of values before it."""

    step, evidence = 0.0, _EVIDENCE

    def __init__(self, n: int, order: Integers) -> None:
        self._n, self._order = n, order
        self.factors = -np.sqrt(0.5 / n) / np.sin(0.5 * np.pi * order / n)
        """(m,) coefficients over ``sin(pi k position / n)``: a geometric series."""

    def columns(self, parameter: float, rows: slice = _ALL) -> Array:
        """Return (m, 1) the coefficients of a step."""
        angle = np.pi * self._order[rows] * parameter / self._n
        return np.asarray((self.factors[rows] * np.sin(angle))[:, None])

    def limits(self, parameter: float) -> tuple[float, float]:
        """Return the position itself, which is exact."""
        return parameter, parameter

    def doubt(self, parameter: float) -> float:
        """Return the log-likelihood that makes a shift possible."""
        return _DOUBTFUL_SHIFT

    def values(self, component: _Component) -> Array:
        """Return (n,) the step, around its mean."""
        step = np.where(np.arange(self._n) < component.parameter, 0.0, component.sizes[0])
        return np.asarray(step - step.mean())

    def signal(self, axis: int, component: _Component) -> LevelShift:
        """Return the shift."""
        return LevelShift(axis, component.parameter, float(component.sizes[0]))


class _TransientKind:
    """Decays ``exp(-(j + 1/2) / T)``; the parameter is ln T, T in values."""

    step, evidence = _TIME_STEP, _TRANSIENT

    def __init__(self, n: int, order: Integers, shortest: float, longest: float) -> None:
        """Set up.

        :param shortest: least time constant [values].
        :param longest: largest time constant [values].
        """
        self._n, self._order = n, order
        self._limits = float(np.log(shortest)), float(np.log(longest))
        count = max(int(np.ceil((self._limits[1] - self._limits[0]) / np.log(_TIMES))), 1) + 1
        self.tried = np.linspace(*self._limits, count)
        """Parameters at which a transient is looked for."""

    def columns(self, parameter: float, rows: slice = _ALL) -> Array:
        """Return (m, 1) the coefficients of a decay: a geometric series."""
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
        """Return (n,) the decay, around its mean."""
        decay = np.exp(-(np.arange(self._n) + 0.5) * np.exp(-component.parameter))
        return np.asarray(component.sizes[0] * (decay - decay.mean()))

    def signal(self, axis: int, component: _Component) -> Transient:
        """Return the transient."""
        return Transient(axis, float(np.exp(component.parameter)), float(component.sizes[0]))


class _Fit(NamedTuple):
    """Ramp, signals and noise that fit together."""

    objective: float
    """Minus the log-likelihood."""
    rows: Array
    """Expected rows."""
    variance: Array
    """(m,) of each coefficient."""
    components: tuple[_Component, ...]
    ramp: bool
    """True if a ramp was fitted with the signals."""
    left: Array
    """(m,) the coefficients without ramp and signals."""


class _Signals(NamedTuple):
    """Signals of one axis."""

    components: Sequence[_Component]
    certain: Sequence[bool]
    inflation: tuple[Array, Array]
    """(m,) factors of the coefficients without the certain signals, and without all."""


class _Search:
    """The search in records of n values, with what is the same for all axes."""

    def __init__(self, n: int, highest: float, interval: float) -> None:
        """Set up.

        :param highest: frequency up to which lines are searched, cycles per value.
        :param interval: time between two values [s].
        """
        from scipy.fft import dct, dst

        self._transform, self._sine_transform = partial(dct, norm="ortho"), partial(dst, type=1)
        self._n, self._last = n, highest * n  # periods
        self._order = np.arange(1, min(int(2.0 * self._last) + 2, n))
        self.count = len(self._order)
        """Coefficients that are compared."""
        self._ramp = self._transform(np.arange(n) / n)[self._order]
        single = min(_SINGLE, self.count)
        bins = single * np.exp(_WIDTH * np.arange(np.log(self.count / single) / _WIDTH))
        self._starts = np.unique(np.concatenate([np.arange(single), bins]).astype(np.int64))
        self._starts = self._starts[self._starts < self.count]
        self._sizes = np.diff(np.append(self._starts, self.count))
        mean_order = np.exp(np.add.reduceat(np.log(self._order), self._starts) / self._sizes)
        f = mean_order / (2.0 * n)
        self._standard = np.stack([f**0, 1.0 / f, f**-2.0], axis=1)
        # A sensor's filter is faster than a second, and its bias process slower.
        fastest, slowest = max(4.0, 1.0 / interval), 0.25 * n
        count = max(int(np.log(slowest / fastest) / np.log(_PROCESS_TIMES)), 0) + 1
        corner = 1.0 - np.exp(-1.0 / (fastest * _PROCESS_TIMES ** np.arange(count)))
        sine = 4.0 * (1.0 - corner) * np.sin(np.pi * f[:, None]) ** 2
        self._processes = corner**2 / (corner**2 + sine)
        """(rows, times) Gauss-Markov processes of 1 at zero frequency."""
        self._design = self._standard
        self._single = slice(0, single)
        self._line = _LineKind(n, self._order)
        self._shift = _ShiftKind(n, self._order)
        shortest, longest = (seconds / interval for seconds in _WARM_UP)
        shortest = max(shortest, 4.0)
        self._transient = _TransientKind(n, self._order, shortest, max(longest, 2.0 * shortest))
        self._decays = np.concatenate(
            [self._transient.columns(float(p), self._single) for p in self._transient.tried], axis=1
        )
        self._tried = np.arange(_SLOWEST, min(0.5 * single, self._last), _SPACING)
        waves = self._line.waves(self._tried, self._single)
        c, s = waves.real, waves.imag
        # (m, 2 f) cosines and sines of the lines that are tried, and (m, 3 f) their products.
        self._columns = np.concatenate([c, s], axis=1)
        self._products = np.concatenate([c * c, s * s, c * s], axis=1)

    def signals(self, x: Array) -> _Signals:
        """Return the signals that may be in x (n,)."""
        y = self._transform(x)[self._order]
        self._design = self._standard
        best = self._with_process(y, self._fit(y, (), self._noise(y)))
        for _ in range(_MAX_SIGNALS):
            lead, choice = 0.0, None
            for component in self._candidates(x, y, best):
                ramp = best.ramp and component.kind is not self._transient
                found = self._fit(y, (*best.components, component), best, ramp=ramp)
                price = component.kind.doubt(found.components[-1].parameter)
                if best.objective - found.objective - price > lead:
                    lead, choice = best.objective - found.objective - price, found
            if choice is None:
                break
            best = self._with_process(y, self._relocated(y, choice))
        components, certain = self._judged(y, best)
        everything = self._inflation(components, best)
        only = [c for c, is_certain in zip(components, certain, strict=True) if is_certain]
        return _Signals(components, certain, (self._inflation(only, best), everything))

    def _judged(self, y: Array, best: _Fit) -> tuple[list[_Component], list[bool]]:
        """Return the signals of a fit to coefficients y that are possible, and the certain ones."""
        gains = self._gains(y, best)
        evidence = np.array([c.kind.evidence for c in best.components])
        # Several signals that take the place of a walk gain much next to each other, little alone.
        evident = gains > evidence
        while evident.any():
            chosen = [
                c for c, is_evident in zip(best.components, evident, strict=True) if is_evident
            ]
            alone = self._gains(y, self._fit(y, chosen, best, ramp=best.ramp))
            if (alone > evidence[evident]).all():
                break
            gains[evident] = np.minimum(gains[evident], alone)
            evident = gains > evidence
        judged = list(zip(best.components, gains, evident.tolist(), strict=True))
        sure = [component for component, _, is_evident in judged if is_evident]
        maybe = [
            c
            for c, gain, is_evident in judged
            if not is_evident and gain > c.kind.doubt(c.parameter)
        ]
        if not any(component.kind is self._transient for component in sure + maybe):
            maybe = self._with_transient(y, best, sure, maybe)
        return sure + maybe, [True] * len(sure) + [False] * len(maybe)

    def _with_transient(
        self, y: Array, best: _Fit, sure: list[_Component], maybe: list[_Component]
    ) -> list[_Component]:
        """Return the doubtful signals, with or without a transient in place of a ramp.

        A transient that explains the record as well as a ramp does is possible. If it does so as
        well as the doubtful signals do, too, it stands for them.

        :param sure: signals that are certain.
        :param maybe: signals that may be there.
        """
        with_ramp = self._fit(y, sure, best)
        decay = self._best_transient(y, with_ramp)
        with_decay = self._fit(y, (*sure, decay), best, ramp=False)
        if with_decay.objective > with_ramp.objective + _AS_WELL:
            return maybe
        without = self._fit(y, sure, best, ramp=False)
        if without.objective - with_decay.objective < _DOUBTFUL_TRANSIENT:
            return maybe
        price = _RAMP + sum(c.kind.doubt(c.parameter) for c in maybe)
        if with_decay.objective + _DOUBTFUL_TRANSIENT <= best.objective + price:
            return [with_decay.components[-1]]
        together = self._fit(y, (*sure, *maybe, decay), best, ramp=False)
        return list(together.components[len(sure) :])

    def _candidates(self, x: Array, y: Array, best: _Fit) -> Iterator[_Component]:
        """Yield the signals of each kind that explain most of what is left of coefficients y."""
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
            others = (*best.components[:k], *best.components[k + 1 :])
            ramp = best.ramp or component.kind is self._transient
            objectives.append(self._fit(y, others, best, ramp=ramp).objective)
        return np.array(objectives) - best.objective

    def _with_process(self, y: Array, best: _Fit) -> _Fit:
        """Return a fit with the Gauss-Markov process that what is left asks for, if any."""
        data, level = self._rows(best.left), np.zeros(1)
        self._design, lowest, guess = self._standard, np.inf, best.rows[None]
        base = float(
            fit_many(data, self._standard, _free(3), slope=level, guess=guess).objective[0]
        )
        choice = self._standard
        for process in self._processes.T:
            design = np.column_stack([self._standard, process])
            found = fit_many(data, design, _free(4), slope=level, guess=guess)
            if found.objective[0] < lowest:
                lowest, choice = float(found.objective[0]), design
        if base - lowest < _PROCESS:
            choice = self._standard
        self._design = choice
        return self._fit(y, best.components, best, ramp=best.ramp)

    def _rows(self, left: Array) -> Data:
        """Return the mean squares of coefficients (m,)."""
        power = np.add.reduceat(left**2, self._starts) / self._sizes
        zeros = np.zeros(len(power))
        return Data(power, self._sizes.astype(np.float64), zeros, zeros)

    def _noise(self, left: Array, guess: Array | None = None) -> _Fit:
        """Return the noise of coefficients (m,) in which nothing else is.

        :param guess: expected rows; None: a smooth spectrum.
        """
        data = self._rows(left)
        start = data.first_guesses[0] if guess is None else guess
        free = _free(self._design.shape[1])
        found = fit_many(data, self._design, free, slope=np.zeros(1), guess=start[None])
        rows = found.expected[0]
        variance = np.repeat(rows, self._sizes)
        return _Fit(float(found.objective[0]), rows, variance, (), False, left)

    def _fit(
        self, y: Array, components: Sequence[_Component], start: _Fit, *, ramp: bool = True
    ) -> _Fit:
        """Return the fit to coefficients y with signals near some parameters and noise, in turns.

        The parameters follow by Gauss's and Newton's steps, each within its limits.

        :param start: its noise is that of the coefficients at first.
        :param ramp: fit a ramp, too.
        """
        limits = [c.kind.limits(c.parameter) for c in components]
        best, lowest = start._replace(components=tuple(components)), np.inf
        for turn in range(1 + _ALTERNATIONS):
            root = np.sqrt(best.variance)
            parameters = [c.parameter for c in best.components]
            if turn and any(c.kind.step for c in components):
                # By how much the parameters are off, to first order.
                columns = self._tangent(best.components, ramp, _ALL) / root[:, None]
                steps = list(_solved(columns, best.left / root)[::-1])
                for k in reversed(range(len(components))):
                    if largest := components[k].kind.step:
                        size = float(np.clip(steps.pop(0), -largest, largest))
                        parameters[k] = float(np.clip(parameters[k] + size, *limits[k]))
            # Ramp and signals by least squares, and the noise of what they leave.
            parts = [c.kind.columns(p) for c, p in zip(components, parameters, strict=True)]
            base = [self._ramp[:, None]] if ramp else []
            if not parts and not base:
                return self._noise(y, best.rows)
            columns = np.concatenate([*base, *parts], axis=1)
            sizes = _solved(columns / root[:, None], y / root)
            noise = self._noise(y - columns @ sizes, best.rows)
            gain = lowest - noise.objective
            if gain > 0.0:
                splits = np.cumsum([len(base), *(part.shape[1] for part in parts)])
                factors = np.split(sizes, splits)[1:-1]
                found = zip(components, parameters, factors, strict=True)
                fitted = tuple(_Component(c.kind, p, size) for c, p, size in found)
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
            (c.kind.columns(c.parameter + _OFF, rows) - part) @ c.sizes[:, None] / _OFF
            for c, part in zip(components, parts, strict=True)
            if c.kind.step
        ]
        empty = np.empty((len(self._order[rows]), 0))
        return np.concatenate([empty, *base, *parts, *slopes], axis=1)

    def _known(self, best: _Fit, rows: slice, weight: Array) -> tuple[Array, Array]:
        """Return an orthonormal base (m, p) of what is fitted, and what it leaves, both weighted.

        :param weight: (m,) inverse variance of each coefficient.
        """
        root = np.sqrt(weight)
        base = self._tangent(best.components, best.ramp, rows) * root[:, None]
        q = np.linalg.qr(base)[0]
        y = best.left[rows] * root
        return q, y - q @ (q.T @ y)

    def _slow_candidates(self, best: _Fit) -> list[float]:
        """Return the frequencies that fit best to the noise, and to a smooth spectrum."""
        rows, price = self._single, _line_doubt(self._tried)
        smooth = np.repeat(self._rows(best.left).first_guesses[0], self._sizes)
        periods = np.array([c.parameter for c in best.components if c.kind is self._line])
        result = []
        for variance in (best.variance, np.maximum(smooth, _LEAST)):
            weight = 1.0 / variance[rows]
            root = np.sqrt(weight)
            q, rest = self._known(best, rows, weight)
            gain = 0.5 * self._explained(weight, q * root[:, None], rest * root)
            gain[(np.abs(self._tried[:, None] - periods) < _APART).any(axis=1)] = 0.0
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
        rest = x - sum(c.kind.values(c) for c in best.components)
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

    def _best_shift(self, best: _Fit) -> tuple[float, float]:
        """Return the position of the shift that explains most, of all positions, and its gain.

        Products of the coefficients with those of every shift are a sine transform; the squares of
        those of every shift, ``sin^2 = (1 - cos) / 2``, a cosine series.
        """
        n, weight = self._n, 1.0 / best.variance
        scaled = np.sqrt(weight) * self._shift.factors
        q, rest = self._known(best, _ALL, weight)
        series = np.zeros((1 + q.shape[1], n - 1))
        series[:, : self.count] = np.vstack([rest, q.T]) * scaled
        products = 0.5 * self._sine_transform(series, axis=1)
        squares = np.zeros(n)
        squares[1 : 1 + self.count] = scaled**2
        cosines = np.fft.fft(squares).real[1:]
        size = 0.5 * (squares.sum() - cosines)
        free = size - np.square(products[1:]).sum(axis=0)
        sound = free > 1e-6 * size
        sound[: _MARGIN - 1] = sound[len(sound) - _MARGIN + 1 :] = False
        for component in best.components:
            if component.kind is self._shift:
                near = int(component.parameter) - 1
                sound[max(near - _MARGIN, 0) : near + _MARGIN + 1] = False
        gain = np.where(sound, 0.5 * products[0] ** 2 / np.where(sound, free, 1.0), 0.0)
        k = int(np.argmax(gain))
        return float(k + 1), float(gain[k])

    def _relocated(self, y: Array, best: _Fit) -> _Fit:
        """Return a fit whose last signal, if it is a shift, is where the fitted noise puts it."""
        *others, last = best.components
        if last.kind is not self._shift:
            return best
        left = best.left + last.kind.columns(last.parameter) @ last.sizes
        position, _ = self._best_shift(best._replace(components=tuple(others), left=left))
        if position == last.parameter:
            return best
        moved = (*others, last._replace(parameter=position))
        found = self._fit(y, moved, best, ramp=best.ramp)
        return found if found.objective < best.objective else best

    def _best_transient(self, y: Array, best: _Fit) -> _Component:
        """Return the transient that explains most of coefficients y in place of a ramp."""
        rows, root = self._single, 1.0 / np.sqrt(best.variance[self._single])
        others = [c for c in best.components if c.kind is not self._transient]
        left = y - sum(c.kind.columns(c.parameter) @ c.sizes for c in others)
        q = np.linalg.qr(self._tangent(others, False, rows) * root[:, None])[0]
        decays = self._decays * root[:, None]
        decays = decays - q @ (q.T @ decays)
        rest = left[rows] * root
        rest = rest - q @ (q.T @ rest)
        explained = (rest @ decays) ** 2 / np.maximum(np.sum(decays**2, axis=0), 1e-300)
        parameter = float(self._transient.tried[int(np.argmax(explained))])
        return _Component(self._transient, parameter, np.zeros(1))

    def _inflation(self, components: Sequence[_Component], best: _Fit) -> Array:
        """Return (m,) the factors that restore the variance that shifts and transients took.

        A coefficient of variance s has ``s (1 - h)`` after a fit, h the leverage of the signals.
        """
        shapes = [c for c in components if c.kind is not self._line]
        if not shapes:
            return np.ones(self.count)
        root = np.sqrt(best.variance)
        q = np.linalg.qr(self._tangent(shapes, False, _ALL) / root[:, None])[0]
        leverage = np.minimum(np.sum(q**2, axis=1), _DETERMINED)
        return np.asarray(1.0 / np.sqrt(1.0 - leverage))


def _free(count: int) -> Array:
    """Return (1, count) components that are all free."""
    return np.full((1, count), np.nan)


def _line_doubt(periods: Array) -> Array:
    """Return the log-likelihood that makes a line of so many periods possible."""
    return np.asarray(_DOUBT[0] + _DOUBT[1] * np.log(np.maximum(periods, 1.0)))


def _solved(columns: Array, y: Array) -> Array:
    """Return the least-squares solution with columns of any size."""
    size = np.maximum(np.linalg.norm(columns, axis=0), 1e-300)
    solution: Array = np.linalg.lstsq(columns / size, y, rcond=1e-10)[0]
    return solution / size
