# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""What time, heat and blows do to a board: biases that a data sheet leaves out.

Each is off at zero and then costs nothing: it is not even made. Their parameters are not live.
"""

import math
from collections.abc import Iterator
from typing import Any

import numpy as np
from numpy.typing import NDArray

from imu_sim_ros.random_streams import (
    Seed,
    Units,
    axis_generators,
    generator,
)
from imu_sim_ros.sensors.errors.processes import next_numbers
from imu_sim_ros.sensors.errors.terms import ErrorTerm, Surroundings
from imu_sim_ros.sensors.imu.parameters import ImuParameters
from imu_sim_ros.sensors.imu.triads import TriadParameters
from imu_sim_ros.types import Array

_DAY = 86400.0
"""[s]"""
_TEMPERATURE_DIGITS = 6
"""Temperatures are compared in microkelvin, so that rounding does not look like cooling."""


def board_terms(
    seed: Seed, triad: str, imu: ImuParameters, own: TriadParameters, dt: float
) -> list[ErrorTerm]:
    """Return those of a triad's terms that are not off.

    :param own: parameters of the triad.
    :param dt: time between two readings [s].
    """
    terms: list[ErrorTerm] = []
    if np.any(own.temperature_hysteresis):
        width = np.asarray(own.temperature_hysteresis)
        terms.append(TemperatureHysteresis(width, imu.hysteresis_temperature))
    if np.any(own.ageing_bias):
        strength = np.asarray(own.ageing_bias)
        terms.append(Ageing(strength, imu.age_days, dt, np.shape(seed)))
    if np.any(own.stress_step_sigma):
        sigma = np.asarray(own.stress_step_sigma)
        terms.append(StressSteps(int(seed), triad, sigma, imu.stress_step_rate * dt))
    if np.any(own.shock_bias_sigma):
        terms.append(ShockBias(int(seed), triad, imu, dt))
    return terms


def aged(age_days: float, seconds: NDArray[np.floating[Any]]) -> Array:
    """Return the progress of ageing, ``log10(1 + days)``, after a time.

    Stress in package and die relaxes ever more slowly; data sheets give its drift over 1000 h or a
    year. The same drift follows for each tenfold of the time.

    :param age_days: at the start [day].
    :param seconds: since the start [s].
    """
    return np.log10(1.0 + age_days + np.divide(seconds, _DAY))


class Ageing(ErrorTerm):
    """Drift with age: ``b = A log10(1 + days)``."""

    def __init__(self, strength: Array, age_days: float, dt: float, shape: tuple[int, ...]) -> None:
        """Start at an age.

        :param strength: (..., 3) A.
        :param shape: () or the (count,) of a batch.
        """
        self._strength, self._age_days, self._dt = strength, age_days, dt
        self._done = np.zeros(shape, np.int64)

    def begin(self, units: Units) -> None:
        """Let some units of a batch begin again."""
        self._done[units] = 0

    def add_to(self, values: Array, around: Surroundings, units: Units = ...) -> None:
        """Add the bias of the next n readings of some units to values (n, ..., 3)."""
        seconds = next_numbers(self._done, len(values), units) * self._dt
        values += self._strength[units] * aged(self._age_days, seconds)[..., None]


class TemperatureHysteresis(ErrorTerm):
    """Bias that depends on whether the sensor is heating or cooling.

    ``b = (W / 2) s`` with ``ds = (+1 - s) dT / D`` while heating and ``ds = (-1 - s) |dT| / D``
    while cooling (Duhem's model in the form of Coleman and Hodgdon, Int. J. Engng Sci. 24 (1986)
    897). A temperature cycle much wider than D is a loop of width W; s starts at 0.
    """

    def __init__(self, width: Array, span: float) -> None:
        """Start between the branches.

        :param width: (3,) W.
        :param span: D [K].
        """
        self._half_width, self._span = 0.5 * width, span
        self._direction = 0.0
        self._last = math.nan
        self._turned_at = self._s_there = 0.0

    def add_to(self, values: Array, around: Surroundings, units: Units = ...) -> None:
        """Add the next n readings' bias to values (n, 3)."""
        temperature = np.round(around.temperature_offset, _TEMPERATURE_DIGITS)
        if len(temperature) == 0:
            return
        if math.isnan(self._last):
            self._last = self._turned_at = float(temperature[0])
        s = np.empty_like(temperature)
        for rows, direction in self._monotone(temperature):
            if direction != self._direction:
                self._s_there = float(self._s(self._last))
                self._turned_at, self._direction = self._last, direction
            s[rows] = self._s(temperature[rows])
            self._last = float(temperature[rows][-1])
        values += self._half_width * s[:, None]

    def _s(self, temperature: Array | float) -> Array | float:
        """Return s since the last change of direction, the equation's solution."""
        gone = np.abs(temperature - self._turned_at) / self._span
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


class StressSteps(ErrorTerm):
    """Jumps of the bias at random times, when stress in the board is relieved.

    A Poisson process for the whole board, so that both triads jump at the same times; each axis by
    a normal amount of its own.
    """

    def __init__(self, seed: int, triad: str, sigma: Array, mean: float) -> None:
        """Draw the first jump's time.

        :param sigma: (3,) of a jump.
        :param mean: jumps per reading.
        """
        self._times = generator(seed, "board.stress_steps")
        self._sizes = axis_generators(seed, f"{triad}.stress_steps")
        self._sigma, self._mean = sigma, mean
        self._bias = np.zeros(3)
        self._done, self._reached = 0, 0.0
        self._next = self._draw()

    def _draw(self) -> int:
        self._reached += self._times.exponential() / self._mean
        return math.ceil(self._reached)

    def add_to(self, values: Array, around: Surroundings, units: Units = ...) -> None:
        """Add the next n readings' bias to values (n, 3)."""
        first, end = self._done, self._done + len(values)
        while first < end:
            while self._next <= first:
                self._bias += self._sigma * [stream.standard_normal() for stream in self._sizes]
                self._next = self._draw()
            until = min(self._next, end)
            values[first - self._done : until - self._done] += self._bias
            first = until
        self._done = end


class ShockBias(ErrorTerm):
    """A bias that each shock leaves, and that decays: ``b_k = exp(-dt / tau) b_(k-1) + jump``.

    A shock begins where the specific force rises above the threshold.
    """

    follows_force = True

    def __init__(self, seed: int, triad: str, imu: ImuParameters, dt: float) -> None:
        from scipy import signal  # half a second of import that only this costs

        self._filter = signal.lfilter
        self._sizes = axis_generators(seed, f"{triad}.shock_bias")
        self._sigma = imu.triad(triad).shock_bias_sigma
        self._limit = imu.shock_threshold**2
        tau = imu.shock_recovery_time
        self._phi = math.exp(-dt / tau) if tau else 1.0
        self._state = np.zeros((1, 3))
        self._above = False

    def add_to(self, values: Array, around: Surroundings, units: Units = ...) -> None:
        """Add the next n readings' bias to values (n, 3)."""
        if len(values) == 0:
            return
        assert around.force is not None
        x, y, z = around.force.T
        above = x * x + y * y + z * z > self._limit
        begins = above & ~np.concatenate([[self._above], above[:-1]])
        self._above = bool(above[-1])
        jumps = np.zeros_like(values)
        rows = np.flatnonzero(begins)
        for row, stream, sigma in zip(jumps.T, self._sizes, self._sigma, strict=True):
            row[rows] = sigma * stream.standard_normal(len(rows))
        bias, self._state = self._filter([1.0], [1.0, -self._phi], jumps, axis=0, zi=self._state)
        values += bias
