# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""The error chain of one triad, from the ideal reading to the digital output."""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from imu_sim_ros.config import ImuParameters
from imu_sim_ros.sensor.errors.deterministic import ConstantBias, Response, TurnOn
from imu_sim_ros.sensor.errors.noise import (
    BiasInstability,
    GaussMarkov,
    RandomWalk,
    RateRamp,
    Term,
    WhiteNoise,
)
from imu_sim_ros.sensor.errors.output import Digitiser, LowPass
from imu_sim_ros.sensor.errors.temperature import polynomial
from imu_sim_ros.sensor.faults import FaultSchedule

Array = NDArray[np.float64]


class Reading(NamedTuple):
    """What a triad says and why; all (3, n)."""

    reading: Array
    bias: Array
    scale: Array


class Triad:
    """One triad; see the package's docstring for the order of the errors."""

    def __init__(self, triad: str, imu: ImuParameters, seed: int, rate: float) -> None:
        dt = 1.0 / rate
        self._triad = triad
        self._turn_on = TurnOn(seed, triad, imu)
        self._response = Response(triad)
        self._bias_terms: tuple[Term, ...] = (
            ConstantBias(triad),
            RandomWalk(seed, triad, dt),
            GaussMarkov(seed, triad, dt, imu),
            BiasInstability(seed, triad, dt),
            RateRamp(triad, dt),
        )
        self._white = WhiteNoise(seed, triad, dt)
        self._low_pass = LowPass(triad, imu, rate)
        self._digitiser = Digitiser(triad)
        self._last: Array | None = None
        self.configure(imu)

    def configure(self, imu: ImuParameters) -> None:
        """Take new values of live parameters, from the next sample on."""
        self._imu = imu
        self._response.configure(imu)
        for term in self._bias_terms:
            term.configure(imu)
        self._white.configure(imu)
        self._digitiser.configure(imu)

    def read(
        self,
        first: int,
        ideal: Array,
        force: Array,
        temperature_offset: Array,
        faults: FaultSchedule,
    ) -> Reading:
        """Return the next n samples.

        :param first: index of the first of them.
        :param ideal: (3, n) ideal reading of this triad.
        :param force: (3, n) ideal specific force [m/s^2].
        :param temperature_offset: (n,) temperature above the reference [K].
        """
        reading = self._response.apply(ideal, force)
        scale = self._scale(temperature_offset)
        if scale is None:
            scale = np.broadcast_to(1.0, reading.shape)
        else:
            reading *= scale
        bias = self._bias(first, temperature_offset, faults)
        reading += bias
        self._white.add_to(reading)
        self._low_pass.apply(reading)
        faults.saturate(self._triad, first, reading)
        self._digitiser.apply(reading)
        faults.hold(self._triad, first, reading, self._last)
        if reading.shape[1]:
            self._last = reading[:, -1].copy()
        return Reading(reading, bias, scale)

    def _scale(self, temperature_offset: Array) -> Array | None:
        """Return the scale by temperature and turn-on (3, n); None where it is 1."""
        thermal = polynomial(
            getattr(self._imu, f"{self._triad}_temperature_scale"), temperature_offset
        )
        if thermal is None and not self._turn_on.scale.any():
            return None
        drawn = (1.0 + self._turn_on.scale)[:, None]
        if thermal is None:
            return np.broadcast_to(drawn, (3, len(temperature_offset)))
        thermal += drawn
        return thermal

    def _bias(self, first: int, temperature_offset: Array, faults: FaultSchedule) -> Array:
        """Return the sum of all biases (3, n)."""
        bias = polynomial(getattr(self._imu, f"{self._triad}_temperature_bias"), temperature_offset)
        if bias is None:
            bias = np.zeros((3, len(temperature_offset)))
        if self._turn_on.bias.any():
            bias += self._turn_on.bias[:, None]
        for term in self._bias_terms:
            term.add_to(bias)
        faults.add_bias(self._triad, first, bias)
        return bias
