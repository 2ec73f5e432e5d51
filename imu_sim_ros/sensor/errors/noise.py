# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""The random errors of one triad, each with its own streams and state.

A term takes its strength from the parameters by ``configure`` at any time and continues from its
current value. ``add_to`` adds the next n samples to an array (3, n).
"""

import math
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from imu_sim_ros.config import TriadParameters, Vector
from imu_sim_ros.random_streams import axis_generators
from imu_sim_ros.rotation.components import transform
from imu_sim_ros.sensor.errors.autoregressive import GaussMarkovBank
from imu_sim_ros.sensor.errors.flicker import FlickerNoise

Array = NDArray[np.float64]


class Term(Protocol):
    """One error of a triad."""

    def configure(self, parameters: TriadParameters) -> None:
        """Take the strength that the parameters give, from the next sample on."""

    def add_to(self, values: Array) -> None:
        """Add the next n samples to values (3, n)."""


class WhiteNoise:
    """White noise: ``n_d = sigma / sqrt(dt) w`` (lecture eq. 16).

    Where the axes are correlated, w is ``L w'`` of independent w' with ``L L^T`` their correlation;
    where the noise depends on temperature, sigma is ``sigma (1 + k (T - T0))``, at least 0.
    """

    def __init__(self, seed: int, triad: str, dt: float) -> None:
        self._dt = dt
        self._streams = axis_generators(seed, f"{triad}.white_noise")
        self._sigma = [0.0] * 3
        self._mixing: Array | None = None
        self._thermal = np.zeros(3)

    def configure(self, parameters: TriadParameters) -> None:
        """Take the density, the correlation and the dependence on temperature."""
        sigma = np.asarray(parameters.noise_density) / np.sqrt(self._dt)
        self._sigma = sigma.tolist()
        self._thermal = np.asarray(parameters.noise_temperature_coefficient)
        correlated = any(parameters.noise_correlation)
        self._mixing = _square_root(parameters.noise_correlation) if correlated else None

    def add_to(self, values: Array, temperature_offset: Array | float = 0.0) -> None:
        """Add n samples to values (3, n).

        :param temperature_offset: (n,) temperature above the reference [K], or one for all.
        """
        if self._mixing is not None or self._thermal.any():
            self._add_dependent(values, temperature_offset)
            return
        noise = np.empty(values.shape[1])
        for row, stream, sigma in zip(values, self._streams, self._sigma, strict=True):
            if sigma:
                stream.standard_normal(out=noise)
                noise *= sigma
                row += noise

    def _add_dependent(self, values: Array, temperature_offset: Array | float) -> None:
        noise = np.zeros_like(values)
        for row, stream, sigma in zip(noise, self._streams, self._sigma, strict=True):
            if sigma or self._mixing is not None:
                stream.standard_normal(out=row)
        if self._mixing is not None:
            noise = transform(self._mixing, noise)
        noise *= np.asarray(self._sigma)[:, None]
        if self._thermal.any():
            noise *= np.maximum(1.0 + self._thermal[:, None] * temperature_offset, 0.0)
        values += noise


def _square_root(correlation: Vector) -> Array:
    """Return L (3, 3), lower triangular, with ``L L^T`` the matrix of correlations xy, xz, yz.

    Cholesky's, for matrices without full rank too.
    """
    xy, xz, yz = correlation
    yy = math.sqrt(max(1.0 - xy * xy, 0.0))
    zy = (yz - xy * xz) / yy if yy else 0.0
    zz = math.sqrt(max(1.0 - xz * xz - zy * zy, 0.0))
    return np.array([[1.0, 0.0, 0.0], [xy, yy, 0.0], [xz, zy, zz]])


class RandomWalk:
    """Random walk: ``b_k = b_(k-1) + sigma_b sqrt(dt) w`` (lecture eq. 20 and 21), ``b_0 = 0``."""

    def __init__(self, seed: int, triad: str, dt: float) -> None:
        self._dt = dt
        self._streams = axis_generators(seed, f"{triad}.random_walk")
        self._sigma = [0.0] * 3
        self._state = [0.0] * 3

    def configure(self, parameters: TriadParameters) -> None:
        """Take the density; the walk continues from its current value."""
        sigma = np.asarray(parameters.random_walk) * np.sqrt(self._dt)
        self._sigma = sigma.tolist()

    def add_to(self, values: Array) -> None:
        """Add n samples to values (3, n)."""
        walk = np.empty(values.shape[1] + 1)
        for k, (stream, sigma) in enumerate(zip(self._streams, self._sigma, strict=True)):
            if sigma:
                stream.standard_normal(out=walk[1:])
                walk[1:] *= sigma
                walk[0] = self._state[k]
                np.cumsum(walk, out=walk)  # adds one after the other, whatever the block's size
                self._state[k] = float(walk[-1])
                values[k] += walk[:-1]
            elif self._state[k]:
                values[k] += self._state[k]


class GaussMarkov:
    """First-order Gauss-Markov bias: ``db = -b / tau dt + sigma_b dW``.

    Exactly discretised: ``phi = exp(-dt / tau)``, step variance ``sigma_b^2 tau / 2 (1 - phi^2)``
    (Crassidis 2006; RotorS). Its strength is given by the driving density sigma_b or the
    stationary standard deviation ``sigma_b sqrt(tau / 2)``. It starts in the stationary
    distribution.
    """

    def __init__(self, seed: int, triad: str, dt: float, parameters: TriadParameters) -> None:
        tau = np.asarray(parameters.correlation_time)
        # An axis without correlation time has no such bias (that is checked); any time will do.
        tau = np.where(tau > 0.0, tau, 1.0)
        self._root_half_tau = np.sqrt(0.5 * tau)
        self._bank = GaussMarkovBank(
            axis_generators(seed, f"{triad}.gauss_markov"), tau[:, None], dt
        )
        self._sigma = np.zeros(3)

    def configure(self, parameters: TriadParameters) -> None:
        """Take the strength, in whichever of the two forms it is given."""
        density = np.asarray(parameters.gauss_markov_density)
        sigma = np.asarray(parameters.gauss_markov_sigma)
        self._sigma = sigma + density * self._root_half_tau

    def add_to(self, values: Array) -> None:
        """Add n samples to values (3, n)."""
        if self._sigma.any():
            values += self._sigma[:, None] * self._bank.next_block(values.shape[1])


class BiasInstability:
    """Flicker noise with the power spectral density ``B^2 / (2 pi f)`` (IEEE Std 952-1997, C.1.3).

    White noise through a filter (:mod:`imu_sim_ros.sensor.errors.flicker`): the density is within
    3.2 % of 1/f from 1e-4 Hz to the Nyquist frequency and within 6 % from 3.5e-5 Hz, at any rate
    from 50 Hz to 8 kHz, and the Allan deviation that of exact 1/f noise, ``B sqrt(2 ln 2 / pi)``.
    Below that band the density is flat. The noise is stationary from the first sample on.
    """

    def __init__(self, seed: int, triad: str, dt: float) -> None:
        self._noise = FlickerNoise(axis_generators(seed, f"{triad}.bias_instability"), dt)
        self._scale = np.zeros(3)

    def configure(self, parameters: TriadParameters) -> None:
        """Take B."""
        self._scale = np.asarray(parameters.bias_instability)

    def add_to(self, values: Array) -> None:
        """Add n samples to values (3, n)."""
        if self._scale.any():
            values += self._scale[:, None] * self._noise.next_block(values.shape[1])


class RateRamp:
    """Steady drift: ``b = R t``; a new R takes over without a jump."""

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

    def add_to(self, values: Array) -> None:
        """Add n samples to values (3, n)."""
        n = values.shape[1]
        if self._slope.any() or self._reached.any():
            t = np.arange(self._samples, self._samples + n) * self._dt
            values += self._reached[:, None] + self._slope[:, None] * t
        self._samples += n
