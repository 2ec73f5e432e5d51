# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""White noise, random walks and bias instability of a triad; their variances a sample."""

import math
from functools import cached_property
from typing import Protocol

import numpy as np
from numpy.random import Generator
from numpy.typing import NDArray

from imu_sim_ros.parameters.kinds import Vector
from imu_sim_ros.random_streams import axis_generators
from imu_sim_ros.rotation import empty, transform
from imu_sim_ros.sensors.errors.flicker import FlickerNoise
from imu_sim_ros.sensors.errors.processes import GaussMarkovBank
from imu_sim_ros.sensors.errors.response import ConstantBias, noise_gain
from imu_sim_ros.sensors.imu.parameters import ImuParameters
from imu_sim_ros.sensors.imu.triads import TriadParameters
from imu_sim_ros.types import Array


class ErrorTerm(Protocol):
    """One error of a triad."""

    active: bool
    """Whether it adds anything with its present parameters."""

    def configure(self, parameters: TriadParameters) -> None:
        """Take the strength that the parameters give, from the next sample on."""

    def add_to(self, values: Array) -> None:
        """Add the next n samples to values (n, 3)."""


class _RandomStream:
    """A term with a stream for each axis, and a strength for each."""

    active = False

    def __init__(self, seed: int, source: str) -> None:
        self._seed, self._source = seed, source
        self._axes: slice | NDArray[np.intp] = slice(0)
        self._drawing: list[tuple[int, Generator]] = []
        self._sigma = np.zeros(0)

    @cached_property
    def _streams(self) -> list[Generator]:
        return axis_generators(self._seed, self._source)

    def _take(self, sigma: Array) -> None:
        """Take the strengths (3,); axes without one draw nothing."""
        axes = np.flatnonzero(sigma)
        self.active = len(axes) > 0
        self._axes = slice(None) if len(axes) == len(sigma) else axes
        self._sigma = sigma[axes]
        self._drawing = [(k, self._streams[axis]) for k, axis in enumerate(axes)]

    def _add_axes(self, values: Array, own: Array) -> None:
        """Add the axes that have a strength to values (n, 3)."""
        if isinstance(self._axes, slice):
            values += own
        else:
            values[:, self._axes] += own


class WhiteNoise(_RandomStream):
    """White noise: ``n_d = sigma / sqrt(dt) w`` (lecture eq. 16).

    If the axes are correlated, w is ``L w'`` of independent w' with ``L L^T`` their correlation;
    if the noise depends on temperature, sigma is ``sigma (1 + k (T - T0))``, at least 0.
    """

    def __init__(self, seed: int, triad: str, dt: float) -> None:
        super().__init__(seed, f"{triad}.white_noise")
        self._dt = dt
        self._mixing: Array | None = None
        self._thermal: Array | None = None

    def configure(self, parameters: TriadParameters) -> None:
        """Take the density, the correlation and the dependence on temperature."""
        sigma = np.asarray(parameters.noise_density) / np.sqrt(self._dt)
        correlated = any(parameters.noise_correlation)
        self._mixing = _square_root(parameters.noise_correlation) if correlated else None
        thermal = np.asarray(parameters.noise_temperature_coefficient)
        self._thermal = thermal if thermal.any() else None
        # If they are correlated, the numbers of all axes are mixed.
        axes = range(3) if correlated else np.flatnonzero(sigma).tolist()
        self._drawing = [(axis, self._streams[axis]) for axis in axes]
        self.active = bool(self._drawing)
        self._sigma = sigma

    def next(self, count: int, temperature_offset: Array | float = 0.0) -> Array | None:
        """Return the next samples (count, 3); None if there is no noise.

        :param temperature_offset: (count,) temperature above the reference [K], or one for all.
        """
        if not self.active:
            return None
        noise = empty((count,))
        if len(self._drawing) < 3:
            noise[...] = 0.0
        for axis, stream in self._drawing:
            stream.standard_normal(out=noise[:, axis])
        if self._mixing is not None:
            noise = transform(self._mixing, noise)
        noise *= self._sigma
        if self._thermal is not None:
            offset = np.asarray(temperature_offset)[..., None]
            noise *= np.maximum(1.0 + self._thermal * offset, 0.0)
        return noise


def _square_root(correlation: Vector) -> Array:
    """Return L (3, 3), lower triangular, with ``L L^T`` the matrix of correlations xy, xz, yz.

    Cholesky's, for matrices without full rank too.
    """
    xy, xz, yz = correlation
    yy = math.sqrt(max(1.0 - xy * xy, 0.0))
    zy = (yz - xy * xz) / yy if yy else 0.0
    zz = math.sqrt(max(1.0 - xz * xz - zy * zy, 0.0))
    return np.array([[1.0, 0.0, 0.0], [xy, yy, 0.0], [xz, zy, zz]])


class RandomWalk(_RandomStream):
    """Random walk: ``b_k = b_(k-1) + sigma_b sqrt(dt) w`` (lecture eq. 20 and 21), ``b_0 = 0``."""

    def __init__(self, seed: int, triad: str, dt: float) -> None:
        super().__init__(seed, f"{triad}.random_walk")
        self._dt = dt
        self._state = np.zeros(3)
        self._still = np.zeros(0, dtype=np.intp)

    def configure(self, parameters: TriadParameters) -> None:
        """Take the density; the walk continues from its current value."""
        sigma = np.asarray(parameters.random_walk) * np.sqrt(self._dt)
        self._take(sigma)
        # An axis that walks no more stays where it is.
        self._still = np.flatnonzero((sigma == 0.0) & (self._state != 0.0))
        self.active = self.active or len(self._still) > 0

    def add_to(self, values: Array) -> None:
        """Add the next n samples to values (n, 3)."""
        if self._drawing:
            walk = empty((len(values) + 1,), len(self._drawing))
            steps = walk[1:]
            for k, stream in self._drawing:
                stream.standard_normal(out=steps[:, k])
            steps *= self._sigma
            walk[0] = self._state[self._axes]
            # Adds one after the other, whatever the block's size.
            np.add.accumulate(walk, axis=0, out=walk)
            self._state[self._axes] = walk[-1]
            self._add_axes(values, walk[:-1])
        if len(self._still):
            values[:, self._still] += self._state[self._still]


class GaussMarkov:
    """First-order Gauss-Markov bias: ``db = -b / tau dt + sigma_b dW``.

    Exactly discretised: ``phi = exp(-dt / tau)``, step variance ``sigma_b^2 tau / 2 (1 - phi^2)``
    (Crassidis 2006; RotorS). Its strength is given by the driving density sigma_b or the
    stationary standard deviation ``sigma_b sqrt(tau / 2)``. It starts in the stationary
    distribution.
    """

    active = False

    def __init__(self, seed: int, triad: str, dt: float, parameters: TriadParameters) -> None:
        self._seed, self._source, self._dt = seed, f"{triad}.gauss_markov", dt
        tau = np.asarray(parameters.correlation_time)
        # An axis without correlation time has no such bias (that is checked); any time will do.
        self._tau = np.where(tau > 0.0, tau, 1.0)
        self._sigma = np.zeros(3)

    @cached_property
    def _bank(self) -> GaussMarkovBank:
        return GaussMarkovBank(
            axis_generators(self._seed, self._source), self._tau[:, None], self._dt
        )

    def configure(self, parameters: TriadParameters) -> None:
        """Take the strength, in whichever of the two forms it is given."""
        density = np.asarray(parameters.gauss_markov_density)
        sigma = np.asarray(parameters.gauss_markov_sigma)
        self._sigma = sigma + density * np.sqrt(0.5 * self._tau)
        self.active = bool(self._sigma.any())

    def add_to(self, values: Array) -> None:
        """Add the next n samples to values (n, 3)."""
        if self.active:
            own = self._bank.next_block(len(values))
            own *= self._sigma
            values += own


class BiasInstability:
    """Flicker noise with the power spectral density ``B^2 / (2 pi f)`` (IEEE Std 952-1997, C.1.3).

    White noise through a filter (:mod:`imu_sim_ros.sensors.errors.flicker`): the density is within
    3.2 % of 1/f from 1e-4 Hz to the Nyquist frequency and within 6 % from 3.5e-5 Hz, at any rate
    from 50 Hz to 8 kHz, and the Allan deviation that of exact 1/f noise, ``B sqrt(2 ln 2 / pi)``.
    Below that band the density is flat. The noise is stationary from the first sample on.
    """

    active = False

    def __init__(self, seed: int, triad: str, dt: float) -> None:
        self._seed, self._source, self._dt = seed, f"{triad}.bias_instability", dt
        self._scale = np.zeros(3)

    @cached_property
    def _noise(self) -> FlickerNoise:
        return FlickerNoise(axis_generators(self._seed, self._source), self._dt)

    def configure(self, parameters: TriadParameters) -> None:
        """Take B."""
        self._scale = np.asarray(parameters.bias_instability)
        self.active = bool(self._scale.any())

    def add_to(self, values: Array) -> None:
        """Add the next n samples to values (n, 3)."""
        if self.active:
            own = self._noise.next_block(len(values))
            own *= self._scale
            values += own


class RateRamp:
    """Steady drift: ``b = R t``; a new R takes over without a jump."""

    active = False

    def __init__(self, dt: float) -> None:
        self._dt = dt
        self._slope = np.zeros(3)
        self._reached = np.zeros(3)
        self._samples = 0

    def configure(self, parameters: TriadParameters) -> None:
        """Take the slope; the ramp continues from its current value."""
        slope = np.asarray(parameters.rate_ramp)
        if np.array_equal(slope, self._slope):
            return
        self._reached = self._reached + self._slope * (self._samples * self._dt)
        self._slope, self._samples = slope, 0
        self.active = bool(slope.any() or self._reached.any())

    def add_to(self, values: Array) -> None:
        """Add n samples to values (n, 3)."""
        if self.active:
            n = len(values)
            t = np.arange(self._samples, self._samples + n) * self._dt
            values += self._reached + self._slope * t[:, None]
            self._samples += n


def bias_terms(seed: int, triad: str, own: TriadParameters, dt: float) -> tuple[ErrorTerm, ...]:
    """Return what adds up to a triad's bias, in this order; a new term is one line more.

    :param triad: the first part of the names of their random streams.
    :param dt: time between two readings [s].
    """
    return (
        ConstantBias(),
        RandomWalk(seed, triad, dt),
        GaussMarkov(seed, triad, dt, own),
        BiasInstability(seed, triad, dt),
        RateRamp(dt),
    )


def gyro_variance_discrete(imu: ImuParameters, rate: float) -> Vector:
    """Return the variance of one sample of the gyroscope per axis [rad^2/s^2].

    :param rate: samples per second [Hz].
    """
    return _variance_discrete(imu, "gyroscope", rate)


def accel_variance_discrete(imu: ImuParameters, rate: float) -> Vector:
    """Return the variance of one sample of the accelerometer per axis [m^2/s^4].

    :param rate: samples per second [Hz].
    """
    return _variance_discrete(imu, "accelerometer", rate)


def _variance_discrete(imu: ImuParameters, name: str, rate: float) -> Vector:
    triad, internal = imu.triad(name), rate * float(imu.internal_ratio(rate))
    white = [
        d * d * internal * noise_gain(f, imu.bandwidth_order, internal)
        for d, f in zip(triad.noise_density, imu.low_pass(name, rate), strict=True)
    ]
    step, increment = np.asarray(triad.resolution), np.asarray(triad.increment_resolution)
    rounding = step * step / 12.0 + np.square(increment * rate) / 6.0
    x, y, z = (float(w + r) for w, r in zip(white, rounding, strict=True))
    return (x, y, z)
