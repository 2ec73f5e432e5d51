# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""The errors that are added in a triad: white noise, and what its bias and its scale consist of."""

import math
from abc import ABC, abstractmethod
from collections.abc import Iterator
from functools import cached_property
from typing import Final, NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from imu_sim_ros.core.random_streams import Seed, Streams, Units, generator
from imu_sim_ros.core.rotation import transform
from imu_sim_ros.core.types import Array
from imu_sim_ros.sensors.errors.processes import FlickerNoise, GaussMarkovBank
from imu_sim_ros.sensors.imu.parameters import ImuParameters
from imu_sim_ros.sensors.imu.triads import TriadParameters

_DAY: Final = 86400.0
"""One day [s]."""
_TEMPERATURE_DIGITS: Final = 6
"""Temperatures are compared in microkelvin, so that rounding does not look like cooling."""


class Surroundings(NamedTuple):
    """Environment of a triad during n readings."""

    temperature_offset: Array
    """(n, ...) temperature above the reference [K]."""
    force: Array | None = None
    """(n, ..., 3) ideal specific force [m/s^2]; None: it is not known yet."""


def is_set(values: ArrayLike) -> bool:
    """Return whether a parameter, of one unit or of the units of a batch, is not 0 throughout."""
    return any(values) if isinstance(values, tuple) else bool(np.any(values))


class TriadEffect:
    """An effect in a triad, of one unit or of the units of a batch: a parameter and a formula.

    The triad makes it when the parameter is first not zero.
    """

    parameter: str
    """Name of the field or property of the triad's parameters that holds the strength."""
    source = ""
    """Name of the random streams, ``gyroscope.SOURCE.x``; empty: the term has none."""

    def __init__(
        self, triad: str, imu: ImuParameters, seed: Seed, rate: float, parameters: TriadParameters
    ) -> None:
        """Initialise before the first reading.

        :param triad: name of the triad.
        :param imu: has what is not of a single triad, such as the age.
        :param seed: seed of a batch, an array that changes before units :meth:`begin` again.
        :param rate: readings per second [Hz].
        :param parameters: parameters of the triad, of a batch arrays (count, k).
        """
        self.triad, self.imu, self.seed = triad, imu, seed
        self.rate, self.dt = rate, 1.0 / rate
        self.state = np.zeros((*np.shape(seed), 3))
        """(..., 3) what the formula carries from one reading to the next."""
        self.done = np.zeros(np.shape(seed), np.int64)
        """(...) readings that a unit has had."""
        self.strength = np.zeros(3)
        """(..., 3), the parameter."""
        self.configure(parameters)
        self.begin(...)

    @cached_property
    def streams(self) -> Streams:
        """Random streams of the term, created on first use."""
        return Streams(self.seed, f"{self.triad}.{self.source}")

    def configure(self, parameters: TriadParameters) -> None:
        """Set new values of parameters, from the next reading on."""
        self.parameters = parameters
        self.strength = np.asarray(getattr(parameters, self.parameter))
        self.axes = np.flatnonzero(self.strength.reshape(-1, 3).any(axis=0))
        """Indices of the axes with a strength other than zero."""
        self.active = len(self.axes) > 0
        """True if the strength is not zero on any axis."""

    def begin(self, units: Units) -> None:
        """Start or restart some units of a batch from their current seeds."""
        if "streams" in vars(self):
            self.streams.begin(units)
        self.state[units], self.done[units] = 0.0, 0


class ErrorTerm(TriadEffect, ABC):
    """An effect that is added to others."""

    follows_force = False
    """True if the term depends on the specific force and cannot be computed before it."""

    @abstractmethod
    def next(self, surroundings: Surroundings, units: Units = ...) -> Array:
        """Return the error of the next n readings of some units (n, ..., 3).

        One that stays the same may be (1, ..., 3) or (..., 3).
        """

    def next_times(self, surroundings: Surroundings, units: Units) -> Array:
        """Return when the next n readings of some units are (n, ...) [s], since they began."""
        count, begin = len(surroundings.temperature_offset), self.done[units]
        numbers = np.arange(count).reshape(-1, *(1,) * begin.ndim) + begin
        self.done[units] += count
        return numbers.astype(np.float64) * self.dt

    def next_numbers(self, surroundings: Surroundings, units: Units) -> Array:
        """Return standard normal numbers for the next n readings of some units (n, ..., 3).

        Axes without a strength draw none: theirs are 0.
        """
        drawn = self.streams.next(len(surroundings.temperature_offset), units, self.axes)
        if len(self.axes) == 3:
            return drawn
        numbers = np.zeros((*drawn.shape[:-1], 3), order="F")
        numbers[..., self.axes] = drawn
        return numbers


class WhiteNoise(ErrorTerm):
    """White noise: ``n_d = sigma / sqrt(dt) w`` (lecture eq. 16).

    If the axes are correlated, w is ``L w'`` of independent w' with ``L L^T`` their correlation;
    if the noise depends on temperature, sigma is ``sigma (1 + k (T - T0))``, at least 0.
    """

    parameter, source = "noise_density", "white_noise"

    def configure(self, parameters: TriadParameters) -> None:
        """Set the density, the correlation and the dependence on temperature."""
        super().configure(parameters)
        self._sigma = self.strength / np.sqrt(self.dt)
        self._mixing: Array | None = None
        if is_set(parameters.noise_correlation):
            self._mixing = _square_root(np.asarray(parameters.noise_correlation))
            self.axes = np.arange(3)  # the numbers of all axes are mixed

    def next(self, surroundings: Surroundings, units: Units = ...) -> Array:
        """Return the noise of the next n readings of some units (n, ..., 3), a new array."""
        noise = self.next_numbers(surroundings, units)
        if self._mixing is not None:
            noise = transform(self._mixing[units], noise)
        noise *= self._sigma[units]
        if is_set(self.parameters.noise_temperature_coefficient):
            thermal = np.asarray(self.parameters.noise_temperature_coefficient)
            noise *= np.maximum(
                1.0 + thermal[units] * surroundings.temperature_offset[..., None], 0.0
            )
        return noise


def _square_root(correlation: Array) -> Array:
    """Return L (..., 3, 3), lower triangular, ``L L^T`` the matrix of correlations xy, xz, yz.

    Cholesky's, for matrices without full rank too.
    """
    xy, xz, yz = (correlation[..., k] for k in range(3))
    yy = np.sqrt(np.maximum(1.0 - xy * xy, 0.0))
    zy = np.divide(yz - xy * xz, yy, out=np.zeros(np.shape(yy)), where=yy != 0.0)
    zz = np.sqrt(np.maximum(1.0 - xz * xz - zy * zy, 0.0))
    result = np.zeros((*np.shape(xy), 3, 3))
    result[..., 0, 0] = 1.0
    for (i, j), value in {(1, 0): xy, (1, 1): yy, (2, 0): xz, (2, 1): zy, (2, 2): zz}.items():
        result[..., i, j] = value
    return result


class ThermalBias(ErrorTerm):
    """The bias by temperature: ``sum_k c_k (T - T0)^(k+1)``.

    The parameter is (..., 3 k): x y z of k = 0, then of k = 1, and so on.
    """

    parameter = "temperature_bias"

    def next(self, surroundings: Surroundings, units: Units = ...) -> Array:
        """Return the bias of n readings of some units (n, ..., 3) in the triad's unit.

        At a constant temperature there is one row (1, ..., 3), for all readings.
        """
        offset, coefficients = surroundings.temperature_offset, self.strength[units]
        if is_constant(offset):
            offset = offset[:1]
        result = np.zeros((*offset.shape, 3), order="F")
        for k in range(coefficients.shape[-1] - 3, -1, -3):
            result += coefficients[..., k : k + 3]
            result *= offset[..., None]
        return result


class ThermalScale(ThermalBias):
    """The scale by temperature, the same polynomial."""

    parameter = "temperature_scale"


class TurnOnBias(ErrorTerm):
    """The bias that differs from run to run."""

    parameter, source = "turn_on_bias_sigma", "turn_on_bias"

    def begin(self, units: Units) -> None:
        """Draw the bias of some units."""
        seeds, sigma = np.asarray(self.seed)[units], self.strength[units]
        self.state[units] = turn_on(seeds, f"{self.triad}.{self.source}", sigma)

    def next(self, surroundings: Surroundings, units: Units = ...) -> Array:
        """Return the bias of some units (..., 3)."""
        return self.state[units]


class TurnOnScale(TurnOnBias):
    """The scale that differs from run to run."""

    parameter, source = "turn_on_scale_sigma", "turn_on_scale"


def turn_on(seed: Seed, source: str, sigma: ArrayLike) -> Array:
    """Return a constant of one run (..., 3), drawn from the seed.

    :param source: random stream, such as ``gyroscope.turn_on_bias``, ``gyroscope.turn_on_scale``.
    :param sigma: (..., 3) standard deviation of the constant.
    """
    if not is_set(sigma):
        return np.zeros((*np.shape(seed), 3))
    return Streams(seed, source).next(1)[0] * np.asarray(sigma)


class ConstantBias(ErrorTerm):
    """The constant bias."""

    parameter = "bias"

    def next(self, surroundings: Surroundings, units: Units = ...) -> Array:
        """Return the bias of some units (..., 3)."""
        return self.strength[units]


class RandomWalk(ErrorTerm):
    """Random walk: ``b_k = b_(k-1) + sigma_b sqrt(dt) w`` (lecture eq. 20 and 21), ``b_0 = 0``."""

    parameter = source = "random_walk"

    def configure(self, parameters: TriadParameters) -> None:
        """Set the density; the walk goes on, or stays, where it is."""
        super().configure(parameters)
        self._sigma = self.strength * np.sqrt(self.dt)
        self.active = self.active or bool(self.state.any())

    def next(self, surroundings: Surroundings, units: Units = ...) -> Array:
        """Return the bias of the next n readings of some units (n, ..., 3)."""
        steps, start = self.next_numbers(surroundings, units), self.state[units]
        steps *= self._sigma[units]
        walk = np.empty((len(steps) + 1, *start.shape), order="F")
        walk[0], walk[1:] = start, steps
        # Adds one after the other, whatever the block's size.
        np.add.accumulate(walk, axis=0, out=walk)
        self.state[units] = walk[-1]
        return walk[:-1]


class _Process(ErrorTerm):
    """A process of unit strength on all axes, times the strength of each."""

    @cached_property
    def process(self) -> GaussMarkovBank | FlickerNoise:
        """The process, which begins when it is first needed."""
        raise NotImplementedError

    def begin(self, units: Units) -> None:
        """Restart some units of a batch from their current seeds."""
        if "process" in vars(self):
            self.process.begin(units)

    def next(self, surroundings: Surroundings, units: Units = ...) -> Array:
        """Return the bias of the next n readings of some units (n, ..., 3)."""
        values = self.process.next_block(len(surroundings.temperature_offset), units)
        values *= self.strength[units]
        return values


class GaussMarkov(_Process):
    """First-order Gauss-Markov bias: ``db = -b / tau dt + sigma_b dW``.

    Exactly discretised: ``phi = exp(-dt / tau)``, step variance ``sigma_b^2 tau / 2 (1 - phi^2)``
    (Crassidis 2006; RotorS). Its strength is given by the driving density sigma_b or the
    stationary standard deviation ``sigma_b sqrt(tau / 2)``. It starts in the stationary
    distribution.
    """

    parameter = source = "gauss_markov"

    @cached_property
    def process(self) -> GaussMarkovBank:
        """The process of unit variance."""
        tau = np.asarray(self.parameters.correlation_time)
        # An axis without correlation time has no such bias (that is checked); any time will do.
        tau = np.where(tau > 0.0, tau, 1.0)
        return GaussMarkovBank(self.seed, f"{self.triad}.{self.source}", tau, self.dt)


class BiasInstability(_Process):
    """Flicker noise with the power spectral density ``B^2 / (2 pi f)`` (IEEE Std 952-1997, C.1.3).

    The density of the filtered white noise (:class:`FlickerNoise`) is within 3.2 % of 1/f from
    1e-4 Hz to the Nyquist frequency and within 6 % from 3.5e-5 Hz, at any rate from 50 Hz to 8 kHz,
    and the Allan deviation that of exact 1/f noise, ``B sqrt(2 ln 2 / pi)``. Below that band the
    density is flat. The noise is stationary from the first sample on.
    """

    parameter = source = "bias_instability"

    @cached_property
    def process(self) -> FlickerNoise:
        """The noise of unit strength."""
        return FlickerNoise(self.seed, f"{self.triad}.{self.source}", self.dt)


class RateRamp(ErrorTerm):
    """Steady drift: ``b = R t``; a new R takes over without a jump."""

    parameter = "rate_ramp"

    def configure(self, parameters: TriadParameters) -> None:
        """Set the slope; the ramp goes on from where it is."""
        previous = self.strength
        super().configure(parameters)
        changed = np.any(self.strength != previous, axis=-1)
        reached = self.state + previous * (self.done * self.dt)[..., None]
        self.state = np.where(changed[..., None], reached, self.state)
        self.done[changed] = 0
        self.active = self.active or bool(self.state.any())

    def next(self, surroundings: Surroundings, units: Units = ...) -> Array:
        """Return the bias of the next n readings of some units (n, ..., 3)."""
        t = self.next_times(surroundings, units)
        return self.state[units] + self.strength[units] * t[..., None]


class TemperatureHysteresis(ErrorTerm):
    """Bias that depends on whether the sensor is heating or cooling.

    ``b = (W / 2) s`` with ``ds = (+1 - s) dT / D`` while heating and ``ds = (-1 - s) |dT| / D``
    while cooling (Duhem's model in the form of Coleman and Hodgdon, Int. J. Engng Sci. 24 (1986)
    897). A temperature cycle much wider than D is a loop of width W; s starts at 0. Not for
    batches.
    """

    parameter = "temperature_hysteresis"

    def begin(self, units: Units) -> None:
        """Start between the branches."""
        self._direction, self._last = 0.0, math.nan
        self._turned_at = self._s_there = 0.0

    def next(self, surroundings: Surroundings, units: Units = ...) -> Array:
        """Return the bias of the next n readings (n, 3)."""
        temperature = np.round(surroundings.temperature_offset, _TEMPERATURE_DIGITS)
        if len(temperature) and math.isnan(self._last):
            self._last = self._turned_at = float(temperature[0])
        s = np.empty_like(temperature)
        for rows, direction in self._monotone(temperature) if len(temperature) else ():
            if direction != self._direction:
                self._s_there = float(self._s(self._last))
                self._turned_at, self._direction = self._last, direction
            s[rows] = self._s(temperature[rows])
            self._last = float(temperature[rows][-1])
        return 0.5 * self.strength * s[:, None]

    def _s(self, temperature: Array | float) -> Array | float:
        """Return s since the last change of direction, the equation's solution."""
        gone = np.abs(temperature - self._turned_at) / self.imu.hysteresis_temperature
        return self._direction + (self._s_there - self._direction) * np.exp(-gone)

    def _monotone(self, temperature: Array) -> Iterator[tuple[slice, float]]:
        """Yield stretches without a change of direction: rows, +1 heating, -1 cooling."""
        sign = np.sign(np.diff(temperature, prepend=self._last))
        moving = np.flatnonzero(sign)
        direction = np.full(len(sign), self._direction)
        if len(moving):  # while it stands still it keeps its direction
            latest = np.searchsorted(moving, np.arange(len(sign)), side="right") - 1
            direction = np.where(latest < 0, self._direction, sign[moving[latest]])
        turns = np.flatnonzero(np.diff(direction)) + 1
        for begin, end in zip([0, *turns], [*turns, len(sign)], strict=True):
            yield slice(begin, end), float(direction[begin])


class AgeingBias(ErrorTerm):
    """Drift with age: ``b = A log10(1 + days)``.

    Stress in package and die relaxes ever more slowly; data sheets give its drift over 1000 h or a
    year. The same drift follows for each tenfold of the time.
    """

    parameter = "ageing_bias"

    def next(self, surroundings: Surroundings, units: Units = ...) -> Array:
        """Return the drift at the next n readings of some units (n, ..., 3)."""
        days = self.next_times(surroundings, units) / _DAY
        return self.strength[units] * np.log10(1.0 + self.imu.age_days + days)[..., None]


class AgeingScale(AgeingBias):
    """The same drift of the scale."""

    parameter = "ageing_scale"


class StressSteps(ErrorTerm):
    """Jumps of the bias at random times, when stress in the board is relieved.

    A Poisson process for the whole board, so that both triads jump at the same times; each axis by
    a normal amount of its own. Not for batches.
    """

    parameter = "stress_step_sigma"

    def begin(self, units: Units) -> None:
        """Draw the time of the first jump."""
        self._times = generator(int(self.seed), "board.stress_steps")
        self._sizes = Streams(self.seed, f"{self.triad}.stress_steps")
        self._reached = 0.0
        self._next = self._draw()

    def _draw(self) -> int:
        """Return the number of the sample with the next step."""
        mean = self.imu.stress_step_rate * self.dt
        self._reached += self._times.exponential() / mean
        return math.ceil(self._reached)

    def next(self, surroundings: Surroundings, units: Units = ...) -> Array:
        """Return the bias of the next n readings (n, 3)."""
        values = np.empty((len(surroundings.temperature_offset), 3))
        begin, end = int(self.done), int(self.done) + len(values)
        while begin < end:
            while self._next <= begin:
                self.state += self.strength * self._sizes.next(1)[0]
                self._next = self._draw()
            until = min(self._next, end)
            values[begin - self.done : until - self.done] = self.state
            begin = until
        self.done[...] = end
        return values


class ShockBias(ErrorTerm):
    """A bias that each shock leaves, and that decays: ``b_k = exp(-dt / tau) b_(k-1) + jump``.

    A shock begins where the specific force rises above the threshold. Not for batches.
    """

    parameter = "shock_bias_sigma"
    follows_force = True

    def begin(self, units: Units) -> None:
        """Start without a bias."""
        from scipy import signal  # half a second of import that only this costs

        self._filter = signal.lfilter
        self._sizes = Streams(self.seed, f"{self.triad}.shock_bias")
        self._carried = np.zeros((1, 3))
        self._above = False

    def next(self, surroundings: Surroundings, units: Units = ...) -> Array:
        """Return the bias of the next n readings (n, 3)."""
        force, tau = surroundings.force, self.imu.shock_recovery_time
        assert force is not None
        jumps = np.zeros_like(force)
        if len(force) == 0:
            return jumps
        x, y, z = force.T
        shaken = x * x + y * y + z * z > self.imu.shock_threshold**2
        begins = shaken & ~np.concatenate([[self._above], shaken[:-1]])
        self._above = bool(shaken[-1])
        rows = np.flatnonzero(begins)
        jumps[rows] = self.strength * self._sizes.next(len(rows))
        phi = math.exp(-self.dt / tau) if tau else 1.0
        bias, self._carried = self._filter([1.0], [1.0, -phi], jumps, axis=0, zi=self._carried)
        return bias


BIAS: Final[tuple[type[ErrorTerm], ...]] = (
    ThermalBias,
    TurnOnBias,
    ConstantBias,
    RandomWalk,
    GaussMarkov,
    BiasInstability,
    RateRamp,
    TemperatureHysteresis,
    AgeingBias,
    StressSteps,
    ShockBias,
)
"""Terms of the bias of a triad, in the order in which they are added."""
DRIFT_OF_SCALE: Final[tuple[type[ErrorTerm], ...]] = (ThermalScale, AgeingScale)
"""Terms of the drift c of a triad's scale ``1 + s + c``, with s of :class:`TurnOnScale`."""


def is_constant(values: Array) -> bool:
    """Return whether values (n, ...) are a single one, broadcast over all times."""
    return len(values) > 1 and values.strides[0] == 0
