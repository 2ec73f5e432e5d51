# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Many IMUs at once, for thousands of environments: each a unit of its own, one sample at a time.

The arithmetic is that of one IMU (:class:`~imu_sim_ros.sensors.errors.triad.Triad`), with an axis
more: unit k reads, bit for bit, what one IMU with its parameters and its seed reads.
"""

from collections.abc import Mapping, Sequence
from functools import cache, cached_property
from typing import Final, NamedTuple

import numpy as np

from imu_sim_ros.core.conventions import ERRORS, TRIADS
from imu_sim_ros.core.random_streams import Units
from imu_sim_ros.core.types import Array, Integers, Mask
from imu_sim_ros.sensors.barometer.model import NAME as BAROMETER
from imu_sim_ros.sensors.barometer.model import Gusts, gusts, read_pressures
from imu_sim_ros.sensors.environment import EnvironmentParameters
from imu_sim_ros.sensors.errors.realised import add_constants
from imu_sim_ros.sensors.imu.parameters import ImuParameters
from imu_sim_ros.sensors.imu.units import AHEAD, Spread, Triads, UnitsOfBatch, check_alike
from imu_sim_ros.sensors.magnetometer.model import NAME as MAGNETOMETER
from imu_sim_ros.sensors.magnetometer.model import Iron, current_at, iron, read_field

RESTARTS: Final = ("same_seed", "same_unit", "next_seed")


class BatchSamples(NamedTuple):
    """A sample of each unit at one time; all arrays have ``count`` rows, one for each unit.

    Its rows are units, not times, so that it is no :class:`imu_sim_ros.core.records.Readings`.
    As of one IMU, a reading is the digital output of the sum ``ideal + response_error + bias +
    noise + low_pass``.
    """

    t_ns: int
    """Stamp, as passed to ``read`` [ns]."""
    gyro: Array
    """(count, 3) readings [rad/s]."""
    accel: Array
    """(count, 3) readings [m/s^2]."""
    temperature: Array
    """(count,) temperature of the units [degC]."""
    gyro_bias: Array
    """(count, 3) sums of all biases [rad/s]."""
    accel_bias: Array
    """(count, 3) sums of all biases [m/s^2]."""
    gyro_scale: Array
    """(count, 3) factors by which the response is multiplied."""
    accel_scale: Array
    """(count, 3) factors by which the response is multiplied."""
    gyro_noise: Array
    """(count, 3) white noise [rad/s]."""
    accel_noise: Array
    """(count, 3) white noise [m/s^2]."""
    gyro_response_error: Array
    """(count, 3) responses minus ideal rates [rad/s]."""
    accel_response_error: Array
    """(count, 3) responses minus ideal specific forces [m/s^2]."""
    gyro_low_pass: Array
    """(count, 3) changes by the low-pass [rad/s]."""
    accel_low_pass: Array
    """(count, 3) changes by the low-pass [m/s^2]."""
    held: Mask
    """(count,) True for units whose ideal reading was impossible: they kept the previous one."""


class BatchField(NamedTuple):
    """A sample of each magnetometer; all arrays have ``count`` rows."""

    t_ns: int
    """Stamp, as passed to ``read`` [ns]."""
    field: Array
    """(count, 3) readings [T]."""
    bias: Array
    """(count, 3) error that is added to the field times the sensor's response [T]."""
    held: Mask
    """(count,) True for units whose ideal field was impossible: they kept the previous one."""


class BatchPressure(NamedTuple):
    """A sample of each barometer; all arrays have ``count`` rows."""

    t_ns: int
    """Stamp, as passed to ``read`` [ns]."""
    pressure: Array
    """(count,) readings [Pa]."""
    bias: Array
    """(count,) error that is added to it, without white noise and rounding [Pa]."""
    held: Mask
    """(count,) True for units whose ideal pressure was impossible: they kept the previous one."""


class ImuBatch:
    """The IMUs; every call of a sensor's ``read`` is the next sample of all of that kind."""

    def __init__(
        self,
        imus: Sequence[ImuParameters],
        environment: EnvironmentParameters,
        count: int,
        spread: Mapping[str, Spread] | None = None,
    ) -> None:
        """Set up all units at their start; arguments as for :class:`UnitsOfBatch`."""
        self.units = UnitsOfBatch(imus, environment, count, spread or {})
        self._triads = Triads(self.units, TRIADS, environment)

    @cached_property
    def magnetometers(self) -> "MagnetometerBatch":
        """Magnetometers of the units, which start when they are first asked for."""
        return MagnetometerBatch(self.units)

    @cached_property
    def barometers(self) -> "BarometerBatch":
        """Barometers of the units, which start when they are first asked for."""
        return BarometerBatch(self.units)

    def begin(self, units: Integers, restart: str) -> None:
        """Restart some units with their next sample.

        :param restart: one of ``RESTARTS``.
        """
        if not len(units):
            return
        renewed = self.units.begin(units, restart)
        self._triads.begin(units, renewed)
        for name in ("magnetometers", "barometers"):
            sensors_so_far = self.__dict__.get(name)
            if sensors_so_far is not None:
                sensors_so_far.begin(units, renewed)

    def read(self, t_ns: int, gyro: Array, accel: Array, held: Mask) -> BatchSamples:
        """Return the next sample of each unit.

        :param gyro: (count, 3) ideal angular rates [rad/s].
        :param accel: (count, 3) ideal specific forces [m/s^2].
        :param held: (count,) True for units whose ideal reading was impossible; it is passed on.
        """
        additions, temperature, _ = self._triads.next()
        outputs = [
            self._triads[name].read(0, ideal[None], accel[None], additions[name])
            for name, ideal in zip(TRIADS, (gyro, accel), strict=True)
        ]
        errors: dict[str, Array] = {
            f"{name}_{error}": values[0]
            for name, reading in zip(("gyro", "accel"), outputs, strict=True)
            for error, values in zip(ERRORS, reading[1:], strict=True)
            if error != "vibration"
        }
        rate, force = (reading.reading[0] for reading in outputs)
        return BatchSamples(t_ns, rate, force, temperature, held=held, **errors)


class MagnetometerBatch:
    """The magnetometers of the units."""

    def __init__(self, units: UnitsOfBatch) -> None:
        """Initialise all units at their start."""
        self._units = units
        sections = [imu.magnetometer for imu in units.imus]
        check_alike(sections, f"imu.{MAGNETOMETER}", ("rate", "time_offset", "current_profile"))
        self._common = sections[0]
        """Whose rate and currents all share."""
        flows = {"current": self._currents} if self._common.current_profile else {}
        self._triads = Triads(units, [MAGNETOMETER], self._common, flows)
        self._near = self._iron(slice(None))

    def begin(self, units: Integers, renewed: bool) -> None:
        """Restart some units; arguments as for :meth:`Triads.begin`."""
        self._triads.begin(units, renewed)
        if renewed:
            for arrays, renewed_arrays in zip(self._near, self._iron(units), strict=True):
                arrays[units] = renewed_arrays

    def read(self, t_ns: int, field: Array, held: Mask) -> BatchField:
        """Return the next sample of each unit.

        :param field: (count, 3) ideal fields in the axes of the IMUs [T].
        :param held: (count,) True for units whose ideal reading was impossible; it is passed on.
        """
        additions, _, inputs = self._triads.next()
        current = inputs.get("current")
        triad, addition = self._triads[MAGNETOMETER], additions[MAGNETOMETER]
        output = read_field(triad, self._near, 0, field[None], current, addition)
        return BatchField(t_ns, output["field"][0], output["bias"][0], held)

    def _iron(self, units: Units) -> Iron:
        """Return the iron around the magnetometers of some units."""
        seeds = self._units.unit_seeds[units].tolist()
        once = cache(iron)  # most presets have nothing near, or the same for all units
        irons = [
            once(add_constants(section, MAGNETOMETER, seed))
            for section, seed in zip(self._units.magnetometers(units), seeds, strict=True)
        ]
        return Iron(*(np.stack(parts) for parts in zip(*irons, strict=True)))

    def _currents(self, units: Units, first: Integers) -> Array:
        """Return the currents of the next samples (AHEAD, m) [A]."""
        return self._triads.at_times(first, lambda t: current_at(self._common, t))


class BarometerBatch:
    """The barometers of the units."""

    def __init__(self, units: UnitsOfBatch) -> None:
        """Initialise all units at their start."""
        self._units = units
        which = units.which(slice(None))
        sections = [imu.barometer for imu in units.imus]
        check_alike(sections, f"imu.{BAROMETER}", ("rate", "time_offset"))
        self._gusts: list[Gusts | None] = [None] * units.count
        self._draw(np.arange(units.count))
        flows = {"gust": self._blow} if any(section.gust_rate for section in sections) else {}
        self._triads = Triads(units, [BAROMETER], sections[0], flows)
        minimum = np.array([section.minimum for section in sections])
        maximum = np.array([section.maximum for section in sections])
        self._limits = minimum[which], maximum[which]

    def _draw(self, units: Integers) -> None:
        """Start the gusts of some units; each has a process of its own."""
        which = self._units.which(units).tolist()
        for unit, number in zip(units.tolist(), which, strict=True):
            section = self._units.imus[number].barometer
            self._gusts[unit] = gusts(section, int(self._units.seeds[unit]))

    def _blow(self, units: Units, _: Integers) -> Array:
        """Return the pressure of gusts at the next samples (AHEAD, m) [Pa]."""
        chosen = np.arange(self._units.count)[units].tolist()
        draws = [
            process.next(AHEAD) if (process := self._gusts[k]) else np.zeros(AHEAD) for k in chosen
        ]
        return np.stack(draws, axis=1)

    def begin(self, units: Integers, renewed: bool) -> None:
        """Restart some units; arguments as for :meth:`Triads.begin`."""
        self._draw(units)
        self._triads.begin(units, renewed)

    def read(self, t_ns: int, pressure: Array, held: Mask) -> BatchPressure:
        """Return the next sample of each unit.

        :param pressure: (count,) pressures of the still air at the IMUs [Pa].
        :param held: (count,) True for units whose ideal reading was impossible; it is passed on.
        """
        additions, _, inputs = self._triads.next()
        gust = inputs.get("gust")
        triad, addition = self._triads[BAROMETER], additions[BAROMETER]
        output = read_pressures(triad, self._limits, 0, pressure[None], gust, addition)
        return BatchPressure(t_ns, output["pressure"][0], output["bias"][0], held)
