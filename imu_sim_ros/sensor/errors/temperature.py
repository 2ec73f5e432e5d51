# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""The sensor's temperature over time, and the polynomials that depend on it."""

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from imu_sim_ros.config import TemperatureParameters

Array = NDArray[np.float64]


class TemperatureProfile:
    """Piecewise linear ambient temperature, followed by the sensor with a first-order lag.

    On a piece ``T_a = A + B (t - t_j)`` the lag ``tau dT/dt = T_a - T`` has the solution
    ``T = T_a - B tau + (T_j - A + B tau) exp(-(t - t_j) / tau)``: closed form, so times can be
    asked for in any order. The sensor starts at the ambient temperature. Power P from the start on
    warms it further, by ``P sum_i R_i (1 - exp(-t / tau_i))`` of package and board.
    """

    def __init__(self, parameters: TemperatureParameters) -> None:
        times = list(parameters.profile[::2])
        values = list(parameters.profile[1::2])
        if not times or times[0] > 0.0:
            times.insert(0, 0.0)
            values.insert(0, parameters.value)
        self._times = np.array(times)
        self._ambient = np.array(values)
        self._slope = np.zeros(len(times))
        if parameters.interpolation == "linear":
            self._slope[:-1] = np.diff(self._ambient) / np.diff(self._times)
        self._tau = parameters.time_constant
        self._excess = self._start_excess()
        rises = parameters.power * np.array(parameters.thermal_resistance)
        self._warm_up = [
            (float(rise), tau)
            for rise, tau in zip(rises, parameters.warm_up_time, strict=True)
            if rise
        ]

    def _start_excess(self) -> Array:
        """Return the decaying part at the start of each piece: ``T_j - A + B tau``."""
        excess = np.zeros(len(self._times))
        sensor = self._ambient[0]
        for j, (ambient, slope) in enumerate(zip(self._ambient, self._slope, strict=True)):
            excess[j] = sensor - ambient + slope * self._tau
            if j + 1 < len(self._times) and self._tau:
                length = self._times[j + 1] - self._times[j]
                sensor = ambient + slope * (length - self._tau)
                sensor += excess[j] * np.exp(-length / self._tau)
        return excess

    @property
    def constant(self) -> bool:
        """Whether the temperature never changes."""
        return len(self._times) == 1 and not self._warm_up

    def at(self, t: Array) -> Array:
        """Return the sensor's temperature (n,) [degC] at times t (n,) [s] since the start."""
        if self.constant:
            return np.full(t.shape, self._ambient[0])
        temperature = self._following(t)
        for rise, tau in self._warm_up:
            temperature += rise if tau == 0.0 else -rise * np.expm1(-t / tau)
        return temperature

    def _following(self, t: Array) -> Array:
        """Return the temperature of a sensor that only follows the ambient one."""
        piece = np.searchsorted(self._times, t, side="right") - 1
        since = t - self._times[piece]
        temperature: Array = self._ambient[piece] + self._slope[piece] * (since - self._tau)
        if self._tau:
            temperature += self._excess[piece] * np.exp(-since / self._tau)
        return temperature


def polynomial(coefficients: Sequence[float], difference: Array) -> Array | None:
    """Return ``sum_k c_k dT^(k+1)`` per axis, (3, n); None without coefficients.

    :param coefficients: x y z of k = 0, then of k = 1, and so on.
    :param difference: (n,) temperature above the reference [K].
    """
    if not any(coefficients):
        return None
    rows = np.reshape(coefficients, (-1, 3))
    result = np.zeros((3, len(difference)))
    for row in rows[::-1]:
        result += row[:, None]
        result *= difference
    return result
