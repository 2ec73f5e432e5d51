# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Many IMUs at once, for thousands of environments: each a unit of its own, one sample at a time.

The arithmetic is that of one IMU (:class:`~imu_sim_ros.sensors.errors.triad.Triad`), with an axis
more: unit k reads, bit for bit, what one IMU with its parameters and its seed reads.
"""

import dataclasses
from collections.abc import Iterator, Mapping, Sequence
from typing import Any, Final, NamedTuple

import numpy as np

from imu_sim_ros import timebase
from imu_sim_ros.conventions import ERRORS, TRIADS
from imu_sim_ros.errors import ConfigurationError
from imu_sim_ros.names import suggestion
from imu_sim_ros.parameters.sections import parameters as declared
from imu_sim_ros.random_streams import Streams, Units
from imu_sim_ros.sensors.environment import EnvironmentParameters
from imu_sim_ros.sensors.errors.flicker import CHUNK
from imu_sim_ros.sensors.errors.realised import unit_of_seed
from imu_sim_ros.sensors.errors.response import TemperatureProfile
from imu_sim_ros.sensors.errors.triad import Additions, Triad, is_constant
from imu_sim_ros.sensors.imu.parameters import ImuParameters
from imu_sim_ros.sensors.imu.triads import TriadParameters
from imu_sim_ros.types import Array, Integers, Mask

RESTARTS: Final = ("same_seed", "same_unit", "next_seed")
AHEAD: Final = CHUNK
"""Samples of a unit whose noise is made at once."""
_AT_ONCE: Final = 48
"""Units for which that is done together: their arrays stay in the processor's cache, and are small
enough for memory that the system need not map anew each time."""
_COMMON: Final = ("bandwidth",)
"""Parameters of a triad that all units share."""
_NOT_IN_BATCHES: Final = ("temperature_hysteresis", "stress_step_sigma", "shock_bias_sigma")
_OF_MESSAGES: Final = (
    *("clock_skew_ppm", "clock_drift_ppm_per_hour", "stamp_offset", "jitter", "latency"),
    *("latency_jitter", "dropout_probability", "dropout_burst_rate", "duplicate_probability"),
)


class Spread(NamedTuple):
    """How a parameter differs from unit to unit."""

    kind: str
    """``uniform``, from low to high, or ``gaussian``, about the parameter's own value."""
    low: Array
    """(3,); of a gaussian, the standard deviation."""
    high: Array
    """(3,)"""


class BatchSamples(NamedTuple):
    """A sample of each unit; all arrays have ``count`` rows.

    As of one IMU, a reading is the digital output of the sum ``ideal + response_error + bias +
    noise + low_pass``.
    """

    t_ns: int
    """As given [ns]."""
    gyro: Array
    """(count, 3) readings [rad/s]."""
    accel: Array
    """(count, 3) readings [m/s^2]."""
    temperature: Array
    """(count,) [degC]"""
    gyro_bias: Array
    """(count, 3) true errors, as those of :class:`~imu_sim_ros.sensors.block.ImuBlock`."""
    accel_bias: Array
    gyro_scale: Array
    accel_scale: Array
    gyro_noise: Array
    accel_noise: Array
    gyro_response_error: Array
    accel_response_error: Array
    gyro_low_pass: Array
    accel_low_pass: Array
    held: Mask
    """(count,) units whose ideal reading was impossible: they kept the one before."""


class ImuBatch:
    """The IMUs; every call of :meth:`read` is the next sample of all of them."""

    def __init__(
        self,
        imus: Sequence[ImuParameters],
        environment: EnvironmentParameters,
        count: int,
        spread: Mapping[str, Spread] | None = None,
    ) -> None:
        """Set up all units at their start; unit k has the seed of the environment plus k.

        :param imus: unit k has parameters k modulo their number.
        :param spread: parameters that differ from unit to unit, by name.
        :raises ConfigurationError: for what a batch does not have.
        """
        self._imus, self._spread = list(imus), dict(spread or {})
        _check(self._imus, self._spread)
        self._rate, self.count = environment.rate, count
        self.unit_seeds: Integers = environment.seed + np.arange(count)
        """(count,) of what differs from unit to unit."""
        self.seeds = self.unit_seeds.copy()
        """(count,) of what differs from run to run: noise, turn-on."""
        self._index = np.zeros(count, np.int64)
        """(count,) of the next sample of each unit since it began."""
        self._in_phase = True
        self._temperature = TemperatureProfile(environment.temperature)
        self._reference = self._imus[0].reference_temperature
        imu = dataclasses.replace(self._imus[0], **self._parameters(slice(None)))
        self._triads = {name: Triad(name, imu, self.seeds, self._rate) for name in TRIADS}
        for name, triad in self._triads.items():
            triad.take(unit_of_seed(imu.triad(name), name, self.unit_seeds))
        self._ahead = {name: Additions(None, _room(count), _room(count)) for name in TRIADS}
        self._degrees = np.empty((1 if self._temperature.constant else AHEAD, count))
        self._offset: Array | None = None
        """(AHEAD, ...) of a temperature that never changes, above the reference [K]."""
        if self._temperature.constant:
            self._degrees[...] = degrees = self._temperature.at(np.zeros(1))
            self._offset = np.broadcast_to(degrees - self._reference, (AHEAD, _AT_ONCE))

    def _parameters(self, units: Units) -> dict[str, Any]:
        """Return the parameters of some units, arrays (m, k), before constants are drawn."""
        seeds = self.unit_seeds[units]
        which = np.arange(self.count)[units] % len(self._imus)
        return {name: self._of_triad(name, seeds, which) for name in TRIADS}

    def _of_triad(self, name: str, seeds: Integers, which: Integers) -> TriadParameters:
        own = [imu.triad(name) for imu in self._imus]
        values: dict[str, Any] = {}
        for field in dataclasses.fields(own[0]):
            if field.name in _COMMON:
                continue
            rows = [np.asarray(getattr(one, field.name), np.float64) for one in own]
            width = max(len(row) for row in rows)
            table = np.stack([np.pad(row, (0, width - len(row))) for row in rows])
            alike = bool((table == table[0]).all())
            each = np.broadcast_to(table[0], (len(seeds), width)) if alike else table[which]
            spread = self._spread.get(f"{name}_{field.name}")
            if spread is not None:
                each = _drawn(spread, each, seeds, f"spread.{name}_{field.name}")
                limits = declared(TriadParameters)[field.name]
                each = np.clip(each, limits.minimum, limits.maximum)
            values[field.name] = each
        return dataclasses.replace(own[0], **values)

    def unit(self, k: int) -> dict[str, Any]:
        """Return the parameters of unit k, by name: those of one IMU that reads the same.

        Its ``seed`` gives the same run as long as the unit has not begun again as ``same_unit``.
        """
        values: dict[str, Any] = {}
        for name, own in self._parameters(slice(k, k + 1)).items():
            for field in dataclasses.fields(own):
                value = np.ravel(getattr(own, field.name)).tolist()
                usual = list(getattr(self._imus[k % len(self._imus)].triad(name), field.name))
                if value[: len(usual)] != usual:
                    values[f"{name}_{field.name}"] = value
        return values

    def begin(self, units: Integers, restart: str) -> None:
        """Let some units begin again with their next sample.

        :param restart: one of ``RESTARTS``.
        """
        if not len(units):
            return
        if restart != "same_seed":
            self.seeds[units] += self.count
        renewed = restart == "next_seed"
        if renewed:
            self.unit_seeds[units] += self.count
        own = self._parameters(units)
        for name, triad in self._triads.items():
            drawn = unit_of_seed(own[name], name, self.unit_seeds[units]) if renewed else None
            triad.begin(units, own[name], drawn)
        self._index[units] = 0
        places = self._index % AHEAD
        self._in_phase = bool((places == places[0]).all())

    def read(self, t_ns: int, gyro: Array, accel: Array, held: Mask) -> BatchSamples:
        """Return the next sample of each unit.

        :param gyro: (count, 3) ideal angular rates [rad/s].
        :param accel: (count, 3) ideal specific forces [m/s^2].
        :param held: (count,) passed on.
        """
        rows: Any
        if self._in_phase:
            rows = int(self._index[0]) % AHEAD
            due = range(0 if rows else self.count)
        else:
            places = self._index % AHEAD
            rows = (places, np.arange(self.count))
            due = np.flatnonzero(places == 0)
        for begin in range(0, len(due), _AT_ONCE):
            units = due[begin : begin + _AT_ONCE]
            together = units[-1] - units[0] + 1 == len(units)  # a slice needs no copies
            self._make_ahead(slice(units[0], units[-1] + 1) if together else units)
        self._index += 1
        made = []
        for (name, triad), ideal in zip(self._triads.items(), (gyro, accel), strict=True):
            scale, bias, noise = self._ahead[name]
            scale = None if scale is None else _at(rows, scale)
            additions = Additions(scale, _at(rows, bias), _at(rows, noise))
            made.append(triad.read(0, ideal[None], accel[None], _NONE, None, None, additions))
        errors: dict[str, Any] = {
            f"{name}_{error}": values[0]
            for name, reading in zip(("gyro", "accel"), made, strict=True)
            for error, values in zip(ERRORS, reading[1:], strict=True)
            if error != "vibration"
        }
        rate, force = (reading.reading[0] for reading in made)
        temperature = np.copy(self._degrees[0 if len(self._degrees) == 1 else rows])
        return BatchSamples(t_ns, rate, force, temperature, held=held, **errors)

    def _make_ahead(self, units: Units) -> None:
        """Make what the next samples of some units get, whatever their ideal readings are."""
        first = self._index[units]
        if self._offset is not None:
            offset = self._offset[:, : len(first)]
        else:
            temperature = np.empty((AHEAD, len(first)))
            for begin in np.unique(first).tolist():
                t_ns = timebase.sample_times_ns(begin, AHEAD, self._rate)
                own = self._temperature.at(timebase.seconds_since(t_ns, 0))
                temperature[:, first == begin] = own[:, None]
            self._degrees[:, units] = temperature
            offset = temperature - self._reference
        for name, triad in self._triads.items():
            made = triad.precompute(offset, units)
            kept = self._ahead[name]
            if made.scale is not None:
                # A scale that never changes is kept once.
                own = made.scale[:1] if is_constant(made.scale) else made.scale
                scale = kept.scale
                if scale is None:
                    scale = _room(self.count, len(own))
                    scale[...] = 1.0
                    self._ahead[name] = kept._replace(scale=scale)
                scale[:, units] = own
            kept.bias[:, units], kept.noise[:, units] = made.bias, made.noise


_NONE: Final = np.zeros(1)
"""A temperature that nothing depends on: what does was made before."""


def _room(count: int, rows: int = AHEAD) -> Array:
    """Return memory (rows, count, 3), each component of a row contiguous."""
    return np.empty((rows, 3, count)).swapaxes(1, 2)


def _at(rows: Any, values: Array) -> Array:
    """Return the values (1, count, 3) of each unit's next sample, a copy."""
    if len(values) == 1:
        return np.copy(values)
    if isinstance(rows, int):
        return np.copy(values[rows : rows + 1])
    place, unit = rows
    memory = values.swapaxes(1, 2).reshape(-1)
    count = len(unit)
    begin = place * (3 * count) + unit
    found = memory.take(begin + count * np.arange(3)[:, None])
    return found.T[None]


def _drawn(spread: Spread, own: Array, seeds: Integers, source: str) -> Array:
    """Return values (m, 3) of units."""
    if spread.kind == "gaussian":
        return own + spread.low * Streams(seeds, source).next(1)[0]
    share = Streams(seeds, source, numbers="random").next(1)[0]
    return spread.low + (spread.high - spread.low) * share


def _check(imus: Sequence[ImuParameters], spread: Mapping[str, Spread]) -> None:
    """Make sure that a batch has what is asked of it.

    :raises ConfigurationError: with a line for each thing.
    """
    problems = list(dict.fromkeys(_problems(imus)))
    known = {
        f"{triad}_{name}"
        for triad in TRIADS
        for name, parameter in declared(TriadParameters).items()
        if parameter.kind == "vector" and name not in (*_COMMON, *_NOT_IN_BATCHES)
    }
    problems += [
        f"spread {name}: {suggestion(name, sorted(known))}" for name in spread if name not in known
    ]
    if problems:
        raise ConfigurationError(problems)


def _problems(imus: Sequence[ImuParameters]) -> Iterator[str]:
    first = imus[0]
    for imu in imus:
        if imu.sampling != "instantaneous":
            yield f"imu.sampling = {imu.sampling!r}: must be instantaneous in a batch"
        if imu.vibration.there:
            yield "imu.vibration: not in a batch"
        for name in _OF_MESSAGES:
            if getattr(imu, name, 0.0):
                yield f"imu.{name}: not in a batch, whose samples have no stamps or messages"
        for triad in TRIADS:
            for name in _NOT_IN_BATCHES:
                if any(getattr(imu.triad(triad), name)):
                    yield f"imu.{triad}_{name}: not in a batch"
            if imu.triad(triad).bandwidth != first.triad(triad).bandwidth:
                yield f"imu.{triad}_bandwidth: must be the same for all units of a batch"
        for name in ("bandwidth_order", "reference_temperature", "age_days"):
            if getattr(imu, name) != getattr(first, name):
                yield f"imu.{name}: must be the same for all units of a batch"
