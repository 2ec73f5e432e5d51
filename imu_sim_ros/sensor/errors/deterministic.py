# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Deterministic errors of one triad: response to the input, constant and turn-on terms."""

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from imu_sim_ros.config import TriadParameters, Vector
from imu_sim_ros.random_streams import axis_generators
from imu_sim_ros.rotation.components import transform

Array = NDArray[np.float64]


class Response:
    """The response of a triad to its input x: ``S x + q x^2 + G f + H f^2`` (lecture eq. 7 and 25).

    G, the g-sensitivity, and H, that to the square of each axis, are the gyroscope's only; f is the
    ideal specific force.
    """

    def __init__(self) -> None:
        self._s = np.eye(3)
        self._quadratic: list[tuple[int, float]] = []
        self._g: Array | None = None
        self._h: Array | None = None

    def configure(self, parameters: TriadParameters) -> None:
        """Take the coefficients."""
        self._s = parameters.response()
        self._quadratic = [(k, q) for k, q in enumerate(parameters.quadratic) if q]
        self._g = _matrix(parameters.g_sensitivity)
        self._h = _matrix(parameters.g_squared_sensitivity)

    def apply(self, ideal: Array, force: Array) -> Array:
        """Return the response (3, n), a new array.

        :param ideal: (3, n) input of the triad.
        :param force: (3, n) specific force [m/s^2].
        """
        result = transform(self._s, ideal)
        for k, quadratic in self._quadratic:
            square = quadratic * ideal[k]
            square *= ideal[k]
            result[k] += square
        if self._g is not None:
            result += transform(self._g, force)
        if self._h is not None:
            result += transform(self._h, force * force)
        return result


def _matrix(values: Sequence[float]) -> Array | None:
    """Return nine numbers as a matrix (3, 3); None where all are zero."""
    return np.reshape(values, (3, 3)) if any(values) else None


class ConstantBias:
    """The constant bias."""

    active = False

    def __init__(self) -> None:
        self._bias = np.zeros((3, 1))

    def configure(self, parameters: TriadParameters) -> None:
        """Take the bias."""
        self._bias = np.asarray(parameters.bias)[:, None]
        self.active = any(parameters.bias)

    def add_to(self, values: Array) -> None:
        """Add n samples to values (3, n)."""
        if self.active:
            values += self._bias


class TurnOn:
    """Bias and scale that differ from run to run, drawn from the seed."""

    def __init__(self, seed: int, triad: str, parameters: TriadParameters) -> None:
        self.bias = _drawn(seed, f"{triad}.turn_on_bias", parameters.turn_on_bias_sigma)
        """(3,)"""
        self.scale = _drawn(seed, f"{triad}.turn_on_scale", parameters.turn_on_scale_sigma)
        """(3,) relative."""


def _drawn(seed: int, name: str, sigma: Vector) -> Array:
    if not any(sigma):
        return np.zeros(3)
    numbers = [stream.standard_normal() for stream in axis_generators(seed, name)]
    return np.array(numbers) * sigma
