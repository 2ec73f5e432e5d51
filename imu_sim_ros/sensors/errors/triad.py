# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""The error chain of one triad, from the ideal reading to the digital output."""

from functools import lru_cache
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from imu_sim_ros.random_streams import Seed, Units
from imu_sim_ros.sensors.errors.noise import WhiteNoise, bias_terms
from imu_sim_ros.sensors.errors.processes import next_numbers, series
from imu_sim_ros.sensors.errors.realised import unit_of_seed
from imu_sim_ros.sensors.errors.response import (
    Digitiser,
    IncrementRounding,
    LowPass,
    Response,
    is_constant,
    polynomial,
    turn_on,
)
from imu_sim_ros.sensors.errors.terms import Surroundings
from imu_sim_ros.sensors.faults import FaultSchedule
from imu_sim_ros.sensors.imu.board import aged
from imu_sim_ros.sensors.imu.parameters import ImuParameters
from imu_sim_ros.sensors.imu.triads import TriadParameters
from imu_sim_ros.types import Array


class Reading(NamedTuple):
    """What a triad reads and why; all (n, ..., 3), errors in the order of conventions.ERRORS."""

    reading: Array
    bias: Array
    scale: Array
    noise: Array
    response_error: Array
    low_pass: Array
    vibration: Array


class Additions(NamedTuple):
    """What n readings of a triad get, whatever they are; made before they are known."""

    scale: Array | None
    """(n, ..., 3); None: 1."""
    bias: Array
    """(n, ..., 3) without faults."""
    noise: Array | None
    """(n, ..., 3) white noise; None: none."""

    def at(self, rows: slice) -> "Additions":
        """Return some consecutive ones."""
        scale, noise = (None if one is None else one[rows] for one in (self.scale, self.noise))
        return Additions(scale, self.bias[rows], noise)


class Triad:
    """One triad; see the package's docstring for the order of the errors."""

    def __init__(
        self,
        triad: str,
        imu: ImuParameters,
        seed: Seed,
        rate: float,
        own: TriadParameters | None = None,
    ) -> None:
        """Set up the errors at their start; :meth:`configure` gives them their strength.

        :param seed: of a batch, an array that changes before units :meth:`begin` again.
        :param rate: samples per second [Hz].
        :param own: of a batch, the triad's parameters, arrays (count, k); None: the IMU's.
        """
        self._ratio = int(imu.internal_ratio(rate))
        internal = rate * self._ratio
        dt, shape = 1.0 / internal, np.shape(seed)
        self._triad, self._seed = triad, seed
        own = imu.triad(triad) if own is None else own
        self._turn_on_scale: Array | None = None
        if np.any(own.turn_on_scale_sigma):
            self._turn_on_scale = self._drawn_scale(seed, own.turn_on_scale_sigma)
        self._terms = bias_terms(seed, triad, imu, own, dt)
        self._ageing_scale = _unless_zero(own.ageing_scale)
        self._age_days, self._dt = imu.age_days, dt
        self._done = np.zeros(shape, np.int64)
        self._white = WhiteNoise(seed, triad, dt)
        cutoffs = np.asarray(imu.low_pass(triad, rate))
        self._low_pass = LowPass(cutoffs, imu.bandwidth_order, internal, shape)
        self._increments = IncrementRounding(1.0 / rate, shape)
        self._last: Array | None = None
        """The last reading, which a sensor that is stuck repeats."""

    def configure(self, imu: ImuParameters) -> None:
        """Take new values of live parameters, from the next sample on."""
        self.take(unit_of_seed(imu.triad(self._triad), self._triad, self._seed))

    def take(self, own: TriadParameters) -> None:
        """Take the parameters of units, whose constants are drawn."""
        self._parameters = own
        self._response, self._digitiser = Response(own), Digitiser(own)
        for term in self._terms:
            term.configure(own)
        self._active_terms = [term for term in self._terms if term.active]
        self._white.configure(own)
        self._increments.configure(own)
        self._thermal_scale = _unless_zero(own.temperature_scale)

    def begin(self, units: Units, unit: TriadParameters | None) -> None:
        """Let some units of a batch begin again, from their present seeds.

        :param unit: parameters of new units with their constants; None: they are those they were.
        """
        if unit is not None:
            for name, value in vars(self._parameters).items():
                if isinstance(value, np.ndarray) and value.flags.writeable:
                    own_value = np.asarray(getattr(unit, name))
                    value[units] = 0.0  # powers of the temperature that these units do not have
                    value[units, : own_value.shape[-1]] = own_value
            self.take(self._parameters)
        if self._turn_on_scale is not None:
            sigma = np.asarray(self._parameters.turn_on_scale_sigma)[units]
            self._turn_on_scale[units] = self._drawn_scale(np.asarray(self._seed)[units], sigma)
        for term in self._terms:
            term.begin(units)
        self._white.begin(units)
        self._low_pass.begin(units)
        self._increments.begin(units)
        self._done[units] = 0

    def _drawn_scale(self, seed: Seed, sigma: ArrayLike) -> Array:
        """Return the scale of this run (..., 3)."""
        return 1.0 + turn_on(seed, f"{self._triad}.turn_on_scale", sigma)

    def read(
        self,
        first: int,
        ideal: Array,
        force: Array,
        temperature_offset: Array,
        faults: FaultSchedule | None,
        vibration: Array | None = None,
        additions: Additions | None = None,
    ) -> Reading:
        """Return the next n samples.

        Inside an oversampled sensor there are m = ratio readings for each, 1 elsewhere.

        :param first: index of the first of them.
        :param ideal: (n m, 3) ideal reading of this triad.
        :param force: (n m, 3) ideal specific force [m/s^2].
        :param temperature_offset: (n m,) temperature above the reference [K].
        :param faults: None: there never are any.
        :param vibration: (n, 3) what the vehicle adds to the filtered readings.
        :param additions: those that :meth:`precompute` has made for these samples.
        """
        if additions is None:
            additions = self.precompute(Surroundings(temperature_offset, force))
        scale, bias, noise = additions
        reading = self._response.apply(ideal, force)
        if scale is not None:
            reading *= scale
        perfect = scale is None and self._response.is_perfect
        response_error = None if perfect else reading - ideal
        if faults is not None and faults.any:
            bias = self._with_jumps(first, bias, faults)
        reading += bias
        if noise is not None:
            reading += noise
        low_pass = self._low_pass.apply(reading)
        if self._ratio > 1:
            last = slice(self._ratio - 1, None, self._ratio)
            reading, bias = np.copy(reading[last]), np.copy(bias[last])
            scale, noise, response_error, low_pass = (
                None if values is None else np.copy(values[last])
                for values in (scale, noise, response_error, low_pass)
            )
        if vibration is not None:
            reading += vibration
        if faults is not None and faults.any:
            faults.saturate(self._triad, first, reading)
        self._digitiser.apply(reading)
        self._increments.apply(reading)
        if faults is not None:
            if faults.any:
                faults.hold(self._triad, first, reading, self._last)
            if len(reading):
                self._last = reading[-1].copy()
        scale = _constant(1.0, reading.shape) if scale is None else scale
        others = (
            _constant(0.0, reading.shape) if values is None else values
            for values in (noise, response_error, low_pass, vibration)
        )
        return Reading(reading, bias, scale, *others)

    @property
    def follows_force(self) -> bool:
        """Whether a bias depends on the readings, so that nothing can be computed before them."""
        return any(term.follows_force for term in self._terms)

    def precompute(self, around: Surroundings, units: Units = ...) -> Additions:
        """Return what the next n readings get, whatever they are.

        :param units: those of a batch whose readings these are.
        """
        offset = around.temperature_offset
        scale = self._scale(offset, units)
        bias = series(offset.shape)
        for term in self._active_terms:
            term.add_to(bias, around, units)
        return Additions(scale, bias, self._white.next(len(bias), offset, units))

    def _scale(self, temperature_offset: Array, units: Units = ...) -> Array | None:
        """Return the scale by temperature, turn-on and age (n, ..., 3); None if it is 1."""
        if is_constant(temperature_offset) and self._ageing_scale is None:
            once = self._scale(temperature_offset[:1], units)
            return None if once is None else np.broadcast_to(once, (*temperature_offset.shape, 3))
        thermal = None
        if self._thermal_scale is not None:
            thermal = polynomial(self._thermal_scale[units], temperature_offset)
        if self._ageing_scale is not None:
            seconds = next_numbers(self._done, len(temperature_offset), units) * self._dt
            drift = self._ageing_scale[units] * aged(self._age_days, seconds)[..., None]
            thermal = drift if thermal is None else thermal + drift
        drawn = None if self._turn_on_scale is None else self._turn_on_scale[units]
        if thermal is None:
            shape = (*temperature_offset.shape, 3)
            return None if drawn is None else np.broadcast_to(drawn, shape)
        thermal += 1.0 if drawn is None else drawn
        return thermal

    def _with_jumps(self, first: int, bias: Array, faults: FaultSchedule) -> Array:
        """Return a bias (n, 3) with the jumps of faults in it."""
        if self._ratio == 1:
            jumped = np.copy(bias)
            faults.add_bias(self._triad, first, jumped)
            return jumped
        jumps = np.zeros((len(bias) // self._ratio, 3))
        faults.add_bias(self._triad, first, jumps)
        return bias + np.repeat(jumps, self._ratio, axis=0)


def _unless_zero(values: ArrayLike) -> Array | None:
    """Return numbers as an array; None if all are zero."""
    found = np.asarray(values)
    return found if found.any() else None


@lru_cache(maxsize=8)
def _constant(value: float, shape: tuple[int, ...]) -> Array:
    """Return an error (n, ..., 3) that a triad does not have; read-only, and without memory."""
    return np.broadcast_to(value, shape)
