# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Units of a batch: their parameters, and the errors of their next samples, drawn in advance."""

import dataclasses
from collections.abc import Callable, Iterator, Mapping, Sequence
from functools import cache
from typing import Final, NamedTuple

import numpy as np

from imu_sim_ros.core.conventions import TRIADS
from imu_sim_ros.core.errors import ConfigurationError
from imu_sim_ros.core.names import suggestion
from imu_sim_ros.core.random_streams import Streams, Units
from imu_sim_ros.core.types import Array, Integers, Keywords, field_values
from imu_sim_ros.parameters.kinds import Parameter
from imu_sim_ros.parameters.sections import parameters as declared
from imu_sim_ros.sensors.environment import EnvironmentParameters
from imu_sim_ros.sensors.errors.processes import FLICKER_CHUNK
from imu_sim_ros.sensors.errors.realised import broadcast_to_units, realise_unit
from imu_sim_ros.sensors.errors.terms import Surroundings, is_constant
from imu_sim_ros.sensors.errors.triad import Additions, Triad
from imu_sim_ros.sensors.imu.parameters import ImuParameters
from imu_sim_ros.sensors.imu.triads import TriadParameters, names_as_in_triads
from imu_sim_ros.sensors.magnetometer.parameters import MagnetometerParameters
from imu_sim_ros.sensors.parameters import MountedParameters, OwnRateParameters
from imu_sim_ros.sensors.timing import SampleTimes
from imu_sim_ros.sensors.world import TemperatureProfile

AHEAD: Final = FLICKER_CHUNK
"""Number of samples of a unit whose noise is drawn in one call."""
_AT_ONCE: Final = 48
"""Number of units that are drawn together: their arrays stay in the processor's cache, and are
small enough for memory that the system does not map anew each time."""
_COMMON: Final = ("bandwidth",)
"""Parameters of a triad that all units share."""
_NOT_IN_BATCHES: Final = ("temperature_hysteresis", "stress_step_sigma", "shock_bias_sigma")
_OF_MESSAGES: Final = (
    *("clock_skew_ppm", "clock_drift_ppm_per_hour", "stamp_offset", "jitter", "latency"),
    *("latency_jitter", "dropout_probability", "dropout_burst_rate", "duplicate_probability"),
)
_MAGNETOMETER: Final = "magnetometer"


class Spread(NamedTuple):
    """Distribution of a parameter over the units."""

    kind: str
    """``uniform``, from low to high, or ``gaussian``, about the parameter's own value."""
    low: Array
    """(3,) lower limits of a uniform distribution; standard deviations of a gaussian one."""
    high: Array
    """(3,) upper limits of a uniform distribution."""


class UnitsOfBatch:
    """Parameters and seeds of the units; unit k has the seed of the environment plus k."""

    def __init__(
        self,
        imus: Sequence[ImuParameters],
        environment: EnvironmentParameters,
        count: int,
        spread: Mapping[str, Spread],
    ) -> None:
        """Set the parameters of the units.

        :param imus: unit k has parameters k modulo their number.
        :param spread: parameters that differ from unit to unit, by name.
        :raises ConfigurationError: for what a batch does not have.
        """
        _check(imus, spread)
        self.imus, self.environment, self.count = list(imus), environment, count
        self._spread = spread
        self.unit_seeds: Integers = environment.seed + np.arange(count)
        """(count,) seeds of the constants that differ from unit to unit."""
        self.seeds = self.unit_seeds.copy()
        """(count,) seeds of noise and turn-on errors, which differ from run to run."""

    def which(self, units: Units) -> Integers:
        """Return which IMU's parameters each of some units has."""
        return np.arange(self.count)[units] % len(self.imus)

    def triad(self, name: str, units: Units) -> TriadParameters:
        """Return the parameters of a triad, arrays (m, k), before constants are drawn.

        :param name: name of the triad, or of another sensor as if it were one.
        """
        sections = [imu.triad(name) for imu in self.imus]
        tables = [field_values(section) for section in sections]
        values: Keywords = {}
        for field in dataclasses.fields(sections[0]):
            if field.name not in _COMMON:
                rows = [np.asarray(table[field.name], np.float64) for table in tables]
                spread = name in TRIADS or field.name in names_as_in_triads(MagnetometerParameters)
                full = f"{name}_{field.name}" if spread else ""
                values[field.name] = self._of_units(rows, full, units)
        return dataclasses.replace(sections[0], **values)

    def _of_units(self, rows: list[Array], name: str, units: Units) -> Array:
        """Return a parameter of some units (m, k).

        :param rows: (k,) values of each of the IMUs.
        """
        which = self.which(units)
        width = max(len(row) for row in rows)
        table = np.stack([np.pad(row, (0, width - len(row))) for row in rows])
        alike = bool((table == table[0]).all())
        values = broadcast_to_units(table[0], which.shape) if alike else table[which]
        spread = self._spread.get(name)
        if spread is None:
            return values
        limits = _spreadable()[name]
        values = _draw(spread, values, self.unit_seeds[units], f"spread.{name}")
        return np.clip(values, limits.minimum, limits.maximum)

    def magnetometers(self, units: Units) -> Iterator[MagnetometerParameters]:
        """Yield the parameters of magnetometers, before constants are drawn."""
        sections = [imu.magnetometer for imu in self.imus]
        tables = [field_values(section) for section in sections]
        changed = {
            field.name: self._of_units(
                [np.asarray(table[field.name]) for table in tables],
                f"{_MAGNETOMETER}_{field.name}",
                units,
            )
            for field in dataclasses.fields(sections[0])
            if f"{_MAGNETOMETER}_{field.name}" in self._spread
        }
        for k, number in enumerate(self.which(units).tolist()):
            values = {name: tuple(rows[k].tolist()) for name, rows in changed.items()}
            yield dataclasses.replace(sections[number], **values) if values else sections[number]

    def unit(self, k: int) -> Keywords:
        """Return the parameters of unit k, by name: those of one IMU that reads the same."""
        imu, units = self.imus[k % len(self.imus)], slice(k, k + 1)
        sections: dict[str, TriadParameters | MagnetometerParameters] = {
            **{name: self.triad(name, units) for name in TRIADS},
            _MAGNETOMETER: next(self.magnetometers(units)),
        }
        values: Keywords = {}
        for name, section in sections.items():
            of_imu = field_values(imu.triad(name) if name in TRIADS else imu.magnetometer)
            for parameter, of_unit in field_values(section).items():
                value = np.asarray(of_unit).ravel().tolist()
                usual = np.ravel(of_imu[parameter]).tolist()
                if value[: len(usual)] != usual:
                    values[f"{name}_{parameter}"] = value
        return values

    def begin(self, units: Integers, restart: str) -> bool:
        """Set the seeds with which some units restart; return whether they are new units.

        :param restart: one of ``RESTARTS``.
        """
        if restart != "same_seed":
            self.seeds[units] += self.count
        if restart == "next_seed":
            self.unit_seeds[units] += self.count
        return restart == "next_seed"


class Next(NamedTuple):
    """Errors and environment of the next sample of each unit; all arrays are copies."""

    additions: dict[str, Additions]
    """Additive errors (1, count, 3) by name of the triad."""
    temperature: Array
    """(count,) temperatures [degC]."""
    sensors: dict[str, Array]
    """Values (1, count) of further sensors by name."""


Make = Callable[[Units, Integers], Array]
"""Function that returns the next values (AHEAD, m) of m units, from the indices of their next
samples (m,)."""


class Triads:
    """Triads of all units that are sampled together, with errors drawn in advance."""

    def __init__(
        self,
        units: UnitsOfBatch,
        names: Sequence[str],
        section: OwnRateParameters | EnvironmentParameters,
        sources: Mapping[str, Make] | None = None,
    ) -> None:
        """Initialise before the first sample.

        :param section: parameters with the sample rate.
        :param sources: functions that draw the values of further sensors in advance, by name.
        """
        self._units, count = units, units.count
        offset = section.time_offset if isinstance(section, OwnRateParameters) else 0.0
        self._times = SampleTimes(section.rate, 0, offset)
        self._index = np.zeros(count, np.int64)
        """(count,) index of the next sample of each unit since it began."""
        self._in_phase = True
        self._temperature = TemperatureProfile(units.environment.temperature)
        self._reference = units.imus[0].reference_temperature
        self._triads: dict[str, Triad] = {}
        for name in names:
            parameters = units.triad(name, slice(None))
            self._triads[name] = Triad(name, units.imus[0], units.seeds, section.rate)
            self._triads[name].configure(realise_unit(parameters, name, units.unit_seeds))
        self._ahead = {name: Additions(None, _room(count), None) for name in names}
        self._make_others = dict(sources or {})
        self._others = {name: np.empty((AHEAD, count)) for name in self._make_others}
        self._degrees = np.empty((1 if self._temperature.constant else AHEAD, count))
        self._offset: float | None = None
        """Constant temperature relative to the reference [K]; None: the temperature changes."""
        if self._temperature.constant:
            self._degrees[...] = degrees = self._temperature.at(np.zeros(1))
            self._offset = float(degrees[0]) - self._reference

    def __getitem__(self, name: str) -> Triad:
        return self._triads[name]

    def at_times(self, begins: Integers, values: Callable[[Array], Array]) -> Array:
        """Return time-dependent values of the next samples (AHEAD, m) of units.

        :param begins: (m,) indices of the next samples.
        :param values: returns the values at times (n,) [s].
        """
        columns = np.empty((AHEAD, len(begins)))
        for begin in np.unique(begins).tolist():
            columns[:, begins == begin] = values(self._times.at_indices(begin, AHEAD).t)[:, None]
        return columns

    def begin(self, units: Integers, renewed: bool) -> None:
        """Restart some units with their next sample.

        :param renewed: they are new units.
        """
        seeds = self._units.unit_seeds[units]
        for name, triad in self._triads.items():
            renewed_parameters = (
                realise_unit(self._units.triad(name, units), name, seeds) if renewed else None
            )
            triad.begin(units, renewed_parameters)
        self._index[units] = 0
        within = self._index % AHEAD
        self._in_phase = bool((within == within[0]).all())

    def next(self) -> Next:
        """Return errors and environment of the next sample of each unit.

        The errors of a unit are drawn for ``AHEAD`` samples at once, at every such multiple of its
        own index: units that restarted at different times are due at different samples.
        """
        rows: int | tuple[Integers, Integers]
        due: range | Integers
        if self._in_phase:
            rows = int(self._index[0]) % AHEAD
            due = range(0 if rows else self._units.count)
        else:
            within = self._index % AHEAD
            rows = (within, np.arange(self._units.count))
            due = np.flatnonzero(within == 0)
        for begin in range(0, len(due), _AT_ONCE):
            units = due[begin : begin + _AT_ONCE]
            is_contiguous = units[-1] - units[0] + 1 == len(units)  # a slice needs no copies
            self._make_ahead(slice(units[0], units[-1] + 1) if is_contiguous else units)
        self._index += 1
        additions = {
            name: Additions(
                None if scale is None else _rows_at(rows, scale),
                _rows_at(rows, bias),
                None if noise is None else _rows_at(rows, noise),
            )
            for name, (scale, bias, noise) in self._ahead.items()
        }
        temperature = np.copy(self._degrees[0 if len(self._degrees) == 1 else rows])
        sensors = {name: np.copy(values[rows])[None] for name, values in self._others.items()}
        return Next(additions, temperature, sensors)

    def _make_ahead(self, units: Units) -> None:
        """Draw the errors of the next samples of some units that do not depend on the motion."""
        begins = self._index[units]
        if self._offset is not None:
            offset = np.broadcast_to(self._offset, (AHEAD, len(begins)))
        else:
            temperature = self.at_times(begins, self._temperature.at)
            self._degrees[:, units] = temperature
            offset = temperature - self._reference
        for name, triad in self._triads.items():
            additions, ahead = triad.additions(Surroundings(offset), units), self._ahead[name]
            ahead.bias[:, units] = additions.bias
            scale = self._redraw_some(ahead.scale, additions.scale, 1.0, units)
            noise = self._redraw_some(ahead.noise, additions.noise, 0.0, units)
            self._ahead[name] = Additions(scale, ahead.bias, noise)
        for name, make in self._make_others.items():
            self._others[name][:, units] = make(units, begins)

    def _redraw_some(
        self, stored: Array | None, drawn: Array | None, neutral: float, units: Units
    ) -> Array | None:
        """Return the stored values of all units with those of some units drawn anew.

        None stands for the neutral value at all times.

        :param stored: (AHEAD or 1, count, 3) values of all units, changed in place.
        :param drawn: (AHEAD, k, 3) new values of the k units.
        :param neutral: value of the units without this error: 1 for a scale, 0 for noise.
        """
        if drawn is None:
            return stored
        rows = drawn[:1] if is_constant(drawn) else drawn  # one row stands for all times
        if stored is None:
            stored = _room(self._units.count, len(rows))
            stored[...] = neutral
        stored[:, units] = rows
        return stored


def _room(count: int, rows: int = AHEAD) -> Array:
    """Return memory (rows, count, 3), each component of a row contiguous."""
    return np.empty((rows, 3, count)).swapaxes(1, 2)


def _rows_at(rows: int | tuple[Integers, Integers], values: Array) -> Array:
    """Return the values (1, count, 3) of each unit's next sample, a copy.

    :param rows: row of ``values`` of all units, or rows (count,) and units (count,).
    :param values: (AHEAD, count, 3) values of the next samples; (1, count, 3): constant ones.
    """
    if len(values) == 1:
        return np.copy(values)
    if isinstance(rows, int):
        return np.copy(values[rows : rows + 1])
    row, unit = rows
    # ``values[row, unit]``, by places in the memory, in which the units of an axis are contiguous.
    memory = values.swapaxes(1, 2).reshape(-1)
    count = len(unit)
    begin = row * (3 * count) + unit
    components = memory.take(begin + count * np.arange(3)[:, None])
    return components.T[None]


def _draw(spread: Spread, nominal: Array, seeds: Integers, source: str) -> Array:
    """Return the values (m, 3) of a parameter that varies from unit to unit.

    :param spread: distribution; Gaussian ones are around the nominal value (3,), others uniform.
    :param seeds: (m,) seeds of the units.
    :param source: name of the random stream.
    """
    if spread.kind == "gaussian":
        return nominal + spread.low * Streams(seeds, source).next(1)[0]
    share = Streams(seeds, source, numbers="random").next(1)[0]
    return spread.low + (spread.high - spread.low) * share


@cache
def _spreadable() -> Mapping[str, Parameter]:
    """Return the parameters that may differ from unit to unit, by name: those per axis."""
    return {
        f"{sensor}_{name}": parameter
        for sensors, section in (
            (TRIADS, TriadParameters),
            ((_MAGNETOMETER,), MagnetometerParameters),
        )
        for sensor in sensors
        for name, parameter in declared(section).items()
        if parameter.kind == "vector" and name not in (*_COMMON, *_NOT_IN_BATCHES)
    }


def _check(imus: Sequence[ImuParameters], spread: Mapping[str, Spread]) -> None:
    """Refuse units and spreads that a batch cannot have.

    :raises ConfigurationError: with a line for each thing.
    """
    problems = list(dict.fromkeys(_problems(imus)))
    names = _spreadable()
    problems += [
        f"spread {name}: {suggestion(name, sorted(names))}" for name in spread if name not in names
    ]
    if problems:
        raise ConfigurationError(problems)


def _problems(imus: Sequence[ImuParameters]) -> Iterator[str]:
    """Yield problems of units that one batch cannot hold."""
    reference = imus[0]
    for imu in imus:
        if imu.sampling != "instantaneous":
            yield f"imu.sampling = {imu.sampling!r}: must be instantaneous in a batch"
        if imu.vibration.is_present:
            yield "imu.vibration: not in a batch"
        imu_values = field_values(imu)
        for name in _OF_MESSAGES:
            if imu_values.get(name):
                yield f"imu.{name}: not in a batch, whose samples have no stamps or messages"
        for triad in TRIADS:
            triad_values = field_values(imu.triad(triad))
            for name in _NOT_IN_BATCHES:
                if any(triad_values[name]):
                    yield f"imu.{triad}_{name}: not in a batch"
            if imu.triad(triad).bandwidth != reference.triad(triad).bandwidth:
                yield f"imu.{triad}_bandwidth: must be the same for all units of a batch"
        yield from _unlike(
            reference, imu, "imu.", ("bandwidth_order", "reference_temperature", "age_days")
        )


def check_alike(sections: Sequence[MountedParameters], prefix: str, names: Sequence[str]) -> None:
    """Refuse sections that differ in parameters which all units of a batch share.

    :raises ConfigurationError: with a line for each parameter that is not.
    """
    lines = (
        line for section in sections for line in _unlike(sections[0], section, f"{prefix}_", names)
    )
    if problems := list(dict.fromkeys(lines)):
        raise ConfigurationError(problems)


def _unlike(
    reference: MountedParameters, section: MountedParameters, prefix: str, names: Sequence[str]
) -> Iterator[str]:
    """Yield a problem for each parameter that differs from the first unit's."""
    for name in names:
        if getattr(reference, name) != getattr(section, name):
            yield f"{prefix}{name}: must be the same for all units of a batch"
