# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""White noise, and what adds up to the bias of a triad; their variances a sample."""

from collections.abc import Callable
from functools import cached_property, partial

import numpy as np
from numpy.typing import NDArray

from imu_sim_ros.parameters.kinds import Vector
from imu_sim_ros.random_streams import Seed, Streams, Units
from imu_sim_ros.rotation import transform
from imu_sim_ros.sensors.errors.flicker import FlickerNoise
from imu_sim_ros.sensors.errors.processes import GaussMarkovBank, next_numbers
from imu_sim_ros.sensors.errors.response import is_constant, noise_gain, polynomial, turn_on
from imu_sim_ros.sensors.errors.terms import ErrorTerm, Surroundings
from imu_sim_ros.sensors.imu.board import board_terms
from imu_sim_ros.sensors.imu.parameters import ImuParameters
from imu_sim_ros.sensors.imu.triads import TriadParameters
from imu_sim_ros.types import Array


class ThermalBias(ErrorTerm):
    """The bias by temperature: ``sum_k c_k (T - T0)^(k+1)``."""

    def configure(self, parameters: TriadParameters) -> None:
        """Take the coefficients (..., 3 k)."""
        self._coefficients = np.asarray(parameters.temperature_bias)
        self.active = bool(self._coefficients.any())

    def add_to(self, values: Array, around: Surroundings, units: Units = ...) -> None:
        """Add the bias of n samples of some units to values (n, ..., 3)."""
        offset = around.temperature_offset
        once = offset[:1] if is_constant(offset) else offset
        values += polynomial(self._coefficients[units], once)


class TurnOnBias(ErrorTerm):
    """The bias that differs from run to run."""

    def __init__(self, seed: Seed, triad: str, parameters: TriadParameters) -> None:
        self._seed, self._source = seed, f"{triad}.turn_on_bias"
        self.configure(parameters)
        self._bias = turn_on(seed, self._source, self._sigma)

    def configure(self, parameters: TriadParameters) -> None:
        """Take the deviation for what is drawn from now on."""
        self._sigma = np.asarray(parameters.turn_on_bias_sigma)
        self.active = bool(self._sigma.any())

    def begin(self, units: Units) -> None:
        """Let some units of a batch begin again, from their present seeds."""
        seeds = np.asarray(self._seed)[units]
        self._bias[units] = turn_on(seeds, self._source, self._sigma[units])

    def add_to(self, values: Array, around: Surroundings, units: Units = ...) -> None:
        """Add the bias of some units to values (n, ..., 3)."""
        values += self._bias[units]


class ConstantBias(ErrorTerm):
    """The constant bias."""

    def configure(self, parameters: TriadParameters) -> None:
        """Take the bias."""
        self._bias = np.asarray(parameters.bias)
        self.active = bool(self._bias.any())

    def add_to(self, values: Array, around: Surroundings, units: Units = ...) -> None:
        """Add the bias of some units to values (n, ..., 3)."""
        values += self._bias[units]


class _RandomStream:
    """A stream for each axis, and a strength for each."""

    active = False

    def __init__(self, seed: Seed, source: str) -> None:
        self._seed, self._source = seed, source
        self._axes: slice | NDArray[np.intp] = slice(0)
        self._sigma = np.zeros(0)

    @cached_property
    def _streams(self) -> Streams:
        return Streams(self._seed, self._source)

    def begin(self, units: Units) -> None:
        """Let some units of a batch begin again, from their present seeds."""
        if "_streams" in self.__dict__:
            self._streams.begin(units)

    def _take(self, sigma: Array) -> None:
        """Take the strengths (..., 3); axes without one draw nothing."""
        axes = np.flatnonzero(sigma.reshape(-1, 3).any(axis=0))
        self.active = len(axes) > 0
        self._axes = slice(None) if len(axes) == 3 else axes
        self._sigma = sigma[..., self._axes]


class WhiteNoise(_RandomStream):
    """White noise: ``n_d = sigma / sqrt(dt) w`` (lecture eq. 16).

    If the axes are correlated, w is ``L w'`` of independent w' with ``L L^T`` their correlation;
    if the noise depends on temperature, sigma is ``sigma (1 + k (T - T0))``, at least 0.
    """

    def __init__(self, seed: Seed, triad: str, dt: float) -> None:
        super().__init__(seed, f"{triad}.white_noise")
        self._dt = dt
        self._mixing: Array | None = None
        self._thermal: Array | None = None

    def configure(self, parameters: TriadParameters) -> None:
        """Take the density, the correlation and the dependence on temperature."""
        sigma = np.asarray(parameters.noise_density) / np.sqrt(self._dt)
        correlated = np.any(parameters.noise_correlation)
        self._mixing = (
            _square_root(np.asarray(parameters.noise_correlation)) if correlated else None
        )
        thermal = np.asarray(parameters.noise_temperature_coefficient)
        self._thermal = thermal if thermal.any() else None
        # If they are correlated, the numbers of all axes are mixed.
        self._take(np.ones(3) if correlated else sigma)
        self._sigma = sigma

    def next(
        self, count: int, temperature_offset: Array | float = 0.0, units: Units = ...
    ) -> Array | None:
        """Return the next samples (count, ..., 3); None if there is no noise.

        :param temperature_offset: (count, ...) temperature above the reference [K], or one for all.
        """
        if not self.active:
            return None
        noise = self._streams.next(count, units, self._axes)
        if not isinstance(self._axes, slice):
            numbers, noise = noise, np.zeros((*noise.shape[:-1], 3), order="F")
            noise[..., self._axes] = numbers
        if self._mixing is not None:
            noise = transform(self._mixing[units], noise)
        noise *= self._sigma[units]
        if self._thermal is not None:
            offset = np.asarray(temperature_offset)[..., None]
            noise *= np.maximum(1.0 + self._thermal[units] * offset, 0.0)
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


class RandomWalk(_RandomStream, ErrorTerm):
    """Random walk: ``b_k = b_(k-1) + sigma_b sqrt(dt) w`` (lecture eq. 20 and 21), ``b_0 = 0``."""

    def __init__(self, seed: Seed, triad: str, dt: float) -> None:
        super().__init__(seed, f"{triad}.random_walk")
        self._dt = dt
        self._state = np.zeros((*np.shape(seed), 3))
        self._still = np.zeros(0, dtype=np.intp)

    def configure(self, parameters: TriadParameters) -> None:
        """Take the density; the walk continues from its current value."""
        sigma = np.asarray(parameters.random_walk) * np.sqrt(self._dt)
        self._take(sigma)
        # An axis that walks no more stays where it is.
        still = (sigma.reshape(-1, 3) == 0.0).all(axis=0) & self._state.reshape(-1, 3).any(axis=0)
        self._still = np.flatnonzero(still)
        self.active = self.active or len(self._still) > 0

    def begin(self, units: Units) -> None:
        """Let some units of a batch begin again, from their present seeds."""
        super().begin(units)
        self._state[units] = 0.0

    def add_to(self, values: Array, around: Surroundings, units: Units = ...) -> None:
        """Add the next n samples of some units to values (n, ..., 3)."""
        state = self._state[units]
        if self._sigma.size:
            steps = self._streams.next(len(values), units, self._axes)
            steps *= self._sigma[units]
            start = state[..., self._axes]
            walk = np.empty((len(values) + 1, *start.shape), order="F")
            walk[0], walk[1:] = start, steps
            # Adds one after the other, whatever the block's size.
            np.add.accumulate(walk, axis=0, out=walk)
            state[..., self._axes] = walk[-1]
            if isinstance(self._axes, slice):
                values += walk[:-1]
            else:
                values[..., self._axes] += walk[:-1]
            self._state[units] = state
        if len(self._still):
            values[..., self._still] += state[..., self._still]


class _Process(ErrorTerm):
    """A process of unit strength, begun when it is first needed, and a strength for each axis."""

    active = False

    def __init__(self, begun: Callable[[], GaussMarkovBank | FlickerNoise]) -> None:
        """Take what begins the process."""
        self._begun = begun
        self._strength = np.zeros(3)

    @cached_property
    def _process(self) -> GaussMarkovBank | FlickerNoise:
        return self._begun()

    def _take(self, strength: Array) -> None:
        """Take the strengths (..., 3)."""
        self._strength, self.active = strength, bool(strength.any())

    def begin(self, units: Units) -> None:
        """Let some units of a batch begin again, from their present seeds."""
        if "_process" in self.__dict__:
            self._process.begin(units)

    def add_to(self, values: Array, around: Surroundings, units: Units = ...) -> None:
        """Add the next n samples of some units to values (n, ..., 3)."""
        own = self._process.next_block(len(values), units)
        own *= self._strength[units]
        values += own


class GaussMarkov(_Process):
    """First-order Gauss-Markov bias: ``db = -b / tau dt + sigma_b dW``.

    Exactly discretised: ``phi = exp(-dt / tau)``, step variance ``sigma_b^2 tau / 2 (1 - phi^2)``
    (Crassidis 2006; RotorS). Its strength is given by the driving density sigma_b or the
    stationary standard deviation ``sigma_b sqrt(tau / 2)``. It starts in the stationary
    distribution.
    """

    def __init__(self, seed: Seed, triad: str, dt: float, parameters: TriadParameters) -> None:
        tau = np.asarray(parameters.correlation_time)
        # An axis without correlation time has no such bias (that is checked); any time will do.
        tau = np.where(tau > 0.0, tau, 1.0)
        super().__init__(partial(GaussMarkovBank, seed, f"{triad}.gauss_markov", tau, dt))

    def configure(self, parameters: TriadParameters) -> None:
        """Take the strength, in whichever of the two forms it is given."""
        self._take(parameters.gauss_markov())


class BiasInstability(_Process):
    """Flicker noise with the power spectral density ``B^2 / (2 pi f)`` (IEEE Std 952-1997, C.1.3).

    White noise through a filter (:mod:`imu_sim_ros.sensors.errors.flicker`): the density is within
    3.2 % of 1/f from 1e-4 Hz to the Nyquist frequency and within 6 % from 3.5e-5 Hz, at any rate
    from 50 Hz to 8 kHz, and the Allan deviation that of exact 1/f noise, ``B sqrt(2 ln 2 / pi)``.
    Below that band the density is flat. The noise is stationary from the first sample on.
    """

    def __init__(self, seed: Seed, triad: str, dt: float) -> None:
        super().__init__(partial(FlickerNoise, seed, f"{triad}.bias_instability", dt))

    def configure(self, parameters: TriadParameters) -> None:
        """Take B."""
        self._take(np.asarray(parameters.bias_instability))


class RateRamp(ErrorTerm):
    """Steady drift: ``b = R t``; a new R takes over without a jump."""

    active = False

    def __init__(self, shape: tuple[int, ...], dt: float) -> None:
        self._dt = dt
        self._slope = np.zeros(3)
        self._reached = np.zeros((*shape, 3))
        self._samples = np.zeros(shape, np.int64)

    def configure(self, parameters: TriadParameters) -> None:
        """Take the slope; the ramp continues from its current value."""
        slope = np.asarray(parameters.rate_ramp)
        changed = np.any(slope != self._slope, axis=-1)
        reached = self._reached + self._slope * (self._samples * self._dt)[..., None]
        self._reached = np.where(changed[..., None], reached, self._reached)
        self._samples[changed] = 0
        self._slope = slope
        self.active = bool(slope.any() or self._reached.any())

    def begin(self, units: Units) -> None:
        """Let some units of a batch begin again, from their present seeds."""
        self._reached[units], self._samples[units] = 0.0, 0

    def add_to(self, values: Array, around: Surroundings, units: Units = ...) -> None:
        """Add the next n samples of some units to values (n, ..., 3)."""
        t = next_numbers(self._samples, len(values), units) * self._dt
        values += self._reached[units] + self._slope[units] * t[..., None]


def bias_terms(
    seed: Seed, triad: str, imu: ImuParameters, own: TriadParameters, dt: float
) -> list[ErrorTerm]:
    """Return what adds up to a triad's bias, in this order; a new term is one line more.

    :param triad: the first part of the names of their random streams.
    :param own: parameters of the triad; what the board does to it is there only if it is on.
    :param dt: time between two readings [s].
    """
    return [
        ThermalBias(),
        TurnOnBias(seed, triad, own),
        ConstantBias(),
        RandomWalk(seed, triad, dt),
        GaussMarkov(seed, triad, dt, own),
        BiasInstability(seed, triad, dt),
        RateRamp(np.shape(seed), dt),
        *board_terms(seed, triad, imu, own, dt),
    ]


def variance_discrete(imu: ImuParameters, name: str, rate: float) -> Vector:
    """Return the variance of one sample of a triad per axis, in its unit squared.

    :param name: of the triad.
    :param rate: samples per second [Hz].
    """
    triad, internal = imu.triad(name), rate * float(imu.internal_ratio(rate))
    white = [
        d * d * internal * noise_gain(f, imu.bandwidth_order, internal)
        for d, f in zip(triad.noise_density, imu.low_pass(name, rate), strict=True)
    ]
    step, increment = np.asarray(triad.resolution), np.asarray(triad.increment_resolution)
    rounding = step * step / 12.0 + np.square(increment * rate) / 6.0
    x, y, z = (float(w + r) for w, r in zip(white, rounding, strict=True))
    return (x, y, z)
