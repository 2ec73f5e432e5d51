# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Deterministic errors of one triad: response to the input, constant and turn-on terms."""

import numpy as np
from numpy.typing import NDArray

from imu_sim_ros.config import ImuParameters
from imu_sim_ros.random_streams import axis_generators
from imu_sim_ros.rotation.components import transform
from imu_sim_ros.sensor.errors.noise import axis_values

Array = NDArray[np.float64]


def scale_misalignment(imu: ImuParameters, triad: str) -> Array:
    """Return S (3, 3) of a triad, given as a matrix or in percent (lecture eq. 7)."""
    xy, xz, yx, yz, zx, zy = getattr(imu, f"{triad}_misalignment_percent")
    percent = np.array([[0.0, xy, xz], [yx, 0.0, yz], [zx, zy, 0.0]])
    percent += np.diag(axis_values(imu, triad, "scale_error_percent"))
    matrix = axis_values(imu, triad, "scale_misalignment").reshape(3, 3)
    result: Array = matrix + 0.01 * percent
    return result


class Response:
    """What a triad makes of its input x: ``S x + q x^2 + G f`` (lecture eq. 7 and 25).

    G, the g-sensitivity, is the gyroscope's only; f is the ideal specific force.
    """

    def __init__(self, triad: str) -> None:
        self._triad = triad
        self._s = np.eye(3)
        self._quadratic = np.zeros(3)
        self._g = np.zeros((3, 3))

    def configure(self, imu: ImuParameters) -> None:
        """Take the coefficients."""
        self._s = scale_misalignment(imu, self._triad)
        self._quadratic = axis_values(imu, self._triad, "quadratic")
        if self._triad == "gyroscope":
            self._g = axis_values(imu, self._triad, "g_sensitivity").reshape(3, 3)

    def apply(self, ideal: Array, force: Array) -> Array:
        """Return the response (3, n), a new array.

        :param ideal: (3, n) input of the triad.
        :param force: (3, n) specific force [m/s^2].
        """
        result = transform(self._s, ideal)
        for row, x, quadratic in zip(result, ideal, self._quadratic, strict=True):
            if quadratic:
                row += quadratic * x * x
        if self._g.any():
            result += transform(self._g, force)
        return result


class ConstantBias:
    """The constant bias."""

    def __init__(self, triad: str) -> None:
        self._triad = triad
        self._bias = np.zeros(3)

    def configure(self, imu: ImuParameters) -> None:
        """Take the bias."""
        self._bias = axis_values(imu, self._triad, "bias")

    def add_to(self, values: Array) -> None:
        """Add n samples to values (3, n)."""
        if self._bias.any():
            values += self._bias[:, None]


class TurnOn:
    """Bias and scale that differ from run to run, drawn from the seed."""

    def __init__(self, seed: int, triad: str, imu: ImuParameters) -> None:
        self.bias = _drawn(seed, triad, imu, "turn_on_bias")
        """(3,)"""
        self.scale = _drawn(seed, triad, imu, "turn_on_scale")
        """(3,) relative."""


def _drawn(seed: int, triad: str, imu: ImuParameters, name: str) -> Array:
    numbers = [s.standard_normal() for s in axis_generators(seed, f"{triad}.{name}")]
    return np.array(numbers) * axis_values(imu, triad, f"{name}_sigma")
