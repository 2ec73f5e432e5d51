# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""The error chain of one triad, from the ideal reading to the digital output."""

from functools import lru_cache
from typing import NamedTuple, TypeVar

import numpy as np

from imu_sim_ros.random_streams import Seed, Units
from imu_sim_ros.sensors.errors.response import Digitiser, IncrementRounding, LowPass, Response
from imu_sim_ros.sensors.errors.terms import (
    BIAS,
    DRIFT_OF_SCALE,
    Surroundings,
    TriadEffect,
    TurnOnScale,
    WhiteNoise,
)
from imu_sim_ros.sensors.faults import FaultSchedule
from imu_sim_ros.sensors.imu.parameters import ImuParameters
from imu_sim_ros.sensors.imu.triads import TriadParameters
from imu_sim_ros.types import Array

_Kind = TypeVar("_Kind", bound=TriadEffect)


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
        scale = None if self.scale is None else self.scale[rows]
        noise = None if self.noise is None else self.noise[rows]
        return Additions(scale, self.bias[rows], noise)


class Triad:
    """One triad; see the package's docstring for the order of the errors."""

    def __init__(self, name: str, imu: ImuParameters, seed: Seed, rate: float) -> None:
        """Start; :meth:`configure` gives the errors their strength.

        :param seed: of a batch, an array that changes before units :meth:`begin` again.
        :param rate: samples per second [Hz].
        """
        self._name, self._imu, self._seed = name, imu, seed
        self._ratio = int(imu.internal_ratio(rate))
        self._rate = rate * self._ratio
        """Readings per second [Hz]."""
        cutoffs = np.asarray(imu.low_pass(name, rate))
        self._low_pass: LowPass | None = None
        if cutoffs.any():
            self._low_pass = LowPass(cutoffs, imu.bandwidth_order, self._rate, np.shape(seed))
        self._made: dict[type[TriadEffect], TriadEffect] = {}
        self._last: Array | None = None
        """The last reading, which a sensor that is stuck repeats."""

    def configure(self, own: TriadParameters) -> None:
        """Take new values of live parameters, from the next sample on.

        :param own: the constants of the unit, or of the units of a batch, are drawn
            (:func:`unit_of_seed`).
        """
        self._parameters = own
        self._response, self._digitiser = Response(own), Digitiser(own)
        self._bias = [term for kind in BIAS if (term := self._active(kind))]
        self._drift = [term for kind in DRIFT_OF_SCALE if (term := self._active(kind))]
        self._turn_on_scale = self._active(TurnOnScale)
        self._white = self._active(WhiteNoise)
        self._increments = self._active(IncrementRounding)
        self.follows_force = any(term.follows_force for term in self._bias)
        """Whether a bias depends on the readings, so that nothing can be computed before them."""

    def _active(self, kind: type[_Kind]) -> _Kind | None:
        """Return an effect with the present parameters; None if it changes nothing."""
        effect = self._made.get(kind)
        if effect is not None:
            effect.configure(self._parameters)
        elif np.any(getattr(self._parameters, kind.parameter)):
            effect = kind(self._name, self._imu, self._seed, self._rate, self._parameters)
            self._made[kind] = effect
        return effect if isinstance(effect, kind) and effect.active else None

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
            self.configure(self._parameters)
        for effect in self._made.values():
            effect.begin(units)
        if self._low_pass is not None:
            self._low_pass.begin(units)

    def additions(self, around: Surroundings, units: Units = ...) -> Additions:
        """Return what the next n readings get, whatever they are.

        :param units: those of a batch whose readings these are.
        """
        shape = (*around.temperature_offset.shape, 3)
        scale: Array | None = None
        if self._drift or self._turn_on_scale is not None:
            run = 0.0 if self._turn_on_scale is None else self._turn_on_scale.next(around, units)
            drift = sum(term.next(around, units) for term in self._drift)
            scale = np.asarray(drift + (1.0 + run))
            if scale.shape != shape:  # it stands for all times, which its strides then say
                scale = np.broadcast_to(scale, shape)
        bias = np.zeros(shape, order="F")
        for term in self._bias:
            bias += term.next(around, units)
        noise = None if self._white is None else self._white.next(around, units)
        return Additions(scale, bias, noise)

    def read(
        self,
        first: int,
        ideal: Array,
        force: Array,
        additions: Additions,
        faults: FaultSchedule | None = None,
        vibration: Array | None = None,
    ) -> Reading:
        """Return the next n samples.

        Inside an oversampled sensor there are m = ratio readings for each, 1 elsewhere.

        :param first: index of the first of them.
        :param ideal: (n m, 3) ideal reading of this triad.
        :param force: (n m, 3) ideal specific force [m/s^2].
        :param additions: what :meth:`additions` has returned for these n m readings.
        :param faults: None: there never are any.
        :param vibration: (n, 3) what the vehicle adds to the filtered readings.
        """
        scale, bias, noise = additions
        faulty = faults is not None and bool(faults.windows)
        reading = self._response.apply(ideal, force)
        if scale is not None:
            reading *= scale
        perfect = scale is None and self._response.is_perfect
        response_error = None if perfect else reading - ideal
        if faults is not None and faulty:
            inside = self._ratio > 1
            jumped = np.zeros((len(bias) // self._ratio, 3)) if inside else np.copy(bias)
            faults.add_bias(self._name, first, jumped)
            bias = bias + np.repeat(jumped, self._ratio, axis=0) if inside else jumped
        reading += bias
        if noise is not None:
            reading += noise
        low_pass = None if self._low_pass is None else self._low_pass.apply(reading)
        if self._ratio > 1:
            last = slice(self._ratio - 1, None, self._ratio)
            reading, bias = np.copy(reading[last]), np.copy(bias[last])
            scale, noise, response_error, low_pass = (
                None if values is None else np.copy(values[last])
                for values in (scale, noise, response_error, low_pass)
            )
        if vibration is not None:
            reading += vibration
        if faults is not None and faulty:
            faults.saturate(self._name, first, reading)
        self._digitiser.apply(reading)
        if self._increments is not None:
            self._increments.apply(reading)
        if faults is not None:
            if faulty:
                faults.hold(self._name, first, reading, self._last)
            if len(reading):
                self._last = reading[-1].copy()
        shape = reading.shape
        return Reading(
            reading,
            bias,
            _constant(1.0, shape) if scale is None else scale,
            _constant(0.0, shape) if noise is None else noise,
            _constant(0.0, shape) if response_error is None else response_error,
            _constant(0.0, shape) if low_pass is None else low_pass,
            _constant(0.0, shape) if vibration is None else vibration,
        )


@lru_cache(maxsize=8)
def _constant(value: float, shape: tuple[int, ...]) -> Array:
    """Return an error (n, ..., 3) that a triad does not have; read-only, and without memory."""
    return np.broadcast_to(value, shape)
