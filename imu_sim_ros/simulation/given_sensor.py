# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""A sensor with ideal readings from another simulator: order of their stamps, gaps, restarts."""

import dataclasses
from abc import ABC, abstractmethod
from collections.abc import Callable
from fractions import Fraction
from typing import Final, Generic, TypeVar

import numpy as np

from imu_sim_ros.core import timebase
from imu_sim_ros.core.errors import ConfigurationError
from imu_sim_ros.core.records import SeriesT, replace_fields
from imu_sim_ros.recordings.live_order import Gaps, Order, Spreading
from imu_sim_ros.sensors import sensors_of_imus
from imu_sim_ros.sensors.declaration import Sensor, takes_ideal_values
from imu_sim_ros.sensors.faults import Fault
from imu_sim_ros.sensors.imu.model import NOWHERE
from imu_sim_ros.sensors.model import SensorWithImu
from imu_sim_ros.sensors.parameters import MountedParameters
from imu_sim_ros.sensors.samples import Samples
from imu_sim_ros.sensors.world import World
from imu_sim_ros.simulation.error_input import Conventions, IdealValues
from imu_sim_ros.simulation.error_parameters import ErrorModelParameters
from imu_sim_ros.simulation.sensors import models, mount_sensors

OTHERS: Final = {
    sensor.quantity: sensor for sensor in sensors_of_imus() if takes_ideal_values(sensor)
}
"""The other sensors of an IMU that take ideal values, by what they measure."""
_SAMPLES_AT_ONCE: Final = 65536
"""Most samples of a gap that are taken at once."""
_REPORTED: Final = 3
"""Irregularities of a kind that are remarked on; all of them are counted."""
Made = TypeVar("Made")


@dataclasses.dataclass
class Counts:
    """Counts of the readings so far, and of their irregularities."""

    readings: int = 0
    """Readings received, the refused ones too."""
    samples: int = 0
    """Samples delivered."""
    missing: int = 0
    """Samples in gaps of the input, during which biases went on."""
    pauses: int = 0
    """Gaps during which the errors stood still."""
    restarts: int = 0
    """Jumps of the stamps back to an earlier time, after which the errors begin again."""
    repeated: int = 0
    """Readings with the stamp of the one before; left out."""
    backward: int = 0
    """Readings with an earlier stamp; left out."""


class GivenSensor(ABC, Generic[SeriesT, Made]):
    """A sensor that turns ideal readings into samples; the first sample is the first reading."""

    def __init__(
        self,
        parameters: ErrorModelParameters,
        rate: float,
        remark: Callable[[str], object],
        what: str = "",
    ) -> None:
        """Initialise before the first reading.

        :param rate: samples per second [Hz].
        :param remark: receives a line for the first irregularities of the stamps of each kind.
        :param what: name of the readings, in front of each line; empty: none.
        """
        self.parameters = parameters
        self.counts = Counts()
        self._rate, self._remark = rate, remark
        self._what = f"{what}: " if what else ""
        self._nominal_ns = 1e9 / rate
        self._order: Order[SeriesT] = Order()
        self._spreading: Spreading[SeriesT] = Spreading(self._nominal_ns)
        self._begin(parameters.seed)

    def _begin(self, seed: int) -> None:
        """Initialise without readings."""
        self.seed = seed
        """Seed of the errors since the last restart."""
        self.position = 0
        """Samples since the last restart, missing ones too."""
        self._last_ns: int | None = None
        self._held: SeriesT | None = None
        """The last readings; with the last of them the sensor goes on during a gap."""
        self._gaps = Gaps(self._nominal_ns, self.parameters.input.longest_gap * 1e9)
        self._faults: list[tuple[Fault, int]] = []
        """Faults that wait for the first reading, with the first sample that they hit."""

    def _place(self, readings: SeriesT) -> SeriesT:
        """Return readings where the sensor is mounted, in its axes."""
        return readings

    @abstractmethod
    def _sample(self, readings: SeriesT) -> list[Made]:
        """Return the samples of readings of the mounted sensor; ``position`` counts on."""

    @abstractmethod
    def _count(self, window: Made) -> int:
        """Return how many samples there are in a window."""

    def _look(self, readings: SeriesT) -> None:
        """Check the first readings, in order and in the conventions of the input."""

    def _missing(self, count: int) -> int:
        """Return the number of missing samples in a gap of some readings."""
        return count

    def _resume(self) -> None:
        """Prepare for the first reading after a pause; the errors go on."""

    def reset(self) -> None:
        """Restart with the next reading, with the seed that input.restart states."""
        self._order = Order()
        self._begin(self._seed_of_restart())

    def _seed_of_restart(self) -> int:
        """Return the seed of the unit after a restart of the stamps."""
        return self.seed + (self.parameters.input.restart == "next_seed")

    def begin_of(self, index: int) -> Fraction:
        """Return the nominal time of a sample since the first one [s]."""
        return index / timebase.exact_rate(self._rate)

    def first_hit(self, delay: float) -> int:
        """Return the index of the first sample that a fault hits after a delay [s].

        :raises ConfigurationError: for a delay that is none.
        """
        if not 0.0 <= delay < np.inf:
            raise ConfigurationError(f"fault delay = {delay}: must be at least 0 s")
        return self.position + timebase.sample_count(delay, self._rate)

    def time_of(self, index: int) -> int | None:
        """Return the estimated stamp of a future sample [ns]; None before the first reading."""
        if self._last_ns is None:
            return None
        return self._last_ns + round((index - self.position + 1) * self._nominal_ns)

    def read(self, readings: SeriesT) -> list[Made]:
        """Return the samples that readings give, in one window or several.

        If stamps jump back the errors begin again; readings that repeat a stamp, or come late,
        are left out.

        :param readings: as they come from the other simulator; they have passed the gate.
        """
        self.counts.readings += len(readings.t_ns)
        windows: list[Made] = []
        spread = self._spreading.apply(readings)
        for part, back_ns in self._order.parts(spread, self._leave_out, self._take_back):
            windows += self._in_order(part, back_ns)
        for window in windows:
            self.counts.samples += self._count(window)
        return windows

    def _in_order(self, readings: SeriesT, back_ns: int) -> list[Made]:
        """Return the samples of readings in order, after a jump back of their stamps."""
        if back_ns:
            self._restart(back_ns)
        self._look(readings)
        windows: list[Made] = []
        for rows, left_out, pause_ns in self._gaps.parts(readings.t_ns):
            if pause_ns:
                self.counts.pauses += 1
                line = f"no readings for {pause_ns * 1e-9:.3f} s: a pause, the errors stand still"
                self._report(self.counts.pauses, line)
                self._resume()
            elif left_out and (missing := self._missing(left_out)):
                self.counts.missing += missing
                self._skip(missing)
            part = readings if rows is None else readings.rows(rows)
            self._last_ns = int(part.t_ns[-1])
            windows += self._sample(self._place(part))
        return windows

    def _skip(self, count: int) -> None:
        """Advance the sensor by samples of a gap, at its latest values."""
        if self._held is None:
            return
        latest = self._held.rows(slice(-1, None))
        while count:
            step = min(count, _SAMPLES_AT_ONCE)
            steps = np.arange(1, step + 1) * self._nominal_ns
            repeated = latest.rows(np.zeros(step, dtype=np.intp))
            t_ns = latest.t_ns + np.rint(steps).astype(np.int64)
            self._sample(replace_fields(repeated, t_ns=t_ns))
            count -= step

    def _leave_out(self, step_ns: int) -> None:
        """Count and report a reading that is left out for its stamp.

        :param step_ns: its stamp minus the last one [ns], 0 or less.
        """
        if step_ns:
            self.counts.backward += 1
            line = f"a stamp {-step_ns * 1e-9:.6f} s before the previous one; left out"
            self._report(self.counts.backward, line)
        else:
            self.counts.repeated += 1
            line = "a reading with the stamp of the previous one; left out"
            self._report(self.counts.repeated, line)

    def _take_back(self, count: int) -> None:
        """Take readings that have turned out to begin a restart off the count ``backward``."""
        self.counts.backward -= count

    def _report(self, count: int, line: str) -> None:
        """Report an irregularity of the stamps; of each kind, only the first few.

        :param count: number of its kind so far.
        """
        if count < _REPORTED:
            self._remark(f"{self._what}{line}")
        elif count == _REPORTED:
            self._remark(f"{self._what}{line}; further ones are only counted")

    def _restart(self, back_ns: int) -> None:
        """Begin the errors again after a jump of the stamps back to an earlier time."""
        self.counts.restarts += 1
        seed = self._seed_of_restart()
        line = f"stamps jump back by {back_ns * 1e-9:.3f} s: the errors begin again, seed {seed}"
        self._report(self.counts.restarts, line)
        self._begin(seed)


class GivenOther(GivenSensor[IdealValues, Samples]):
    """A sensor with an IMU, one of ``OTHERS``: each ideal value becomes one sample."""

    def __init__(
        self,
        sensor: Sensor[MountedParameters],
        parameters: ErrorModelParameters,
        remark: Callable[[str], object],
    ) -> None:
        """Initialise before the first value.

        :param sensor: declaration; ideal values are (n,), or (n, 3) in the axes of the input.
        """
        self.declared = sensor
        self._conventions = Conventions(parameters)
        self._looked = False
        rate = parameters.imu.sensors[sensor.name].rate
        super().__init__(parameters, rate, remark, sensor.quantity.replace("_", " "))

    def _begin(self, seed: int) -> None:
        """Start the errors of a unit with a seed."""
        super()._begin(seed)
        self._model: SensorWithImu | None = None

    def _look(self, ideal: IdealValues) -> None:
        """Report if the first value is likely in another unit."""
        if self._looked or not self.parameters.input.check:
            return
        self._looked = True
        declared = self.declared.with_imu
        assert declared
        assert declared.unit_hint is not None
        line = declared.unit_hint(ideal.values[0])
        if line:
            self._remark(f"{self._what}{line}")

    def configure(self, parameters: ErrorModelParameters) -> None:
        """Apply new values of live parameters, from the next sample on."""
        self.parameters = parameters
        if self._model is not None:
            self._model.configure(parameters.imu)

    def inject(self, fault: Fault, delay: float) -> int:
        """Start a fault; return the index of the first sample that it hits.

        :raises ConfigurationError: for a delay that is none.
        """
        first_sample = self.first_hit(delay)
        if self._model is None:
            self._faults.append((fault, first_sample))
        else:
            self._model.inject(fault, self.begin_of(first_sample))
        return first_sample

    def _place(self, ideal: IdealValues) -> IdealValues:
        """Return values in the axes of the simulation."""
        if ideal.values.ndim == 1:
            return ideal
        return replace_fields(ideal, values=self._conventions.rotate(ideal.values))

    def _sample(self, ideal: IdealValues) -> list[Samples]:
        """Return the samples of ideal values."""
        self._held = ideal
        if self._model is None:
            environment = dataclasses.replace(self.parameters, seed=self.seed)
            t0_ns = int(ideal.t_ns[0])
            self._world = World(NOWHERE, environment, t0_ns)
            quantity = self.declared.quantity
            model = models(mount_sensors(environment), [quantity], t0_ns)[quantity]
            assert isinstance(model, SensorWithImu), "OTHERS are sensors of IMUs"
            self._model = model
            for fault, first_sample in self._faults:
                self._model.inject(fault, self.begin_of(first_sample))
        self.position += len(ideal.t_ns)
        return [self._model.apply(ideal.t_ns, ideal.values, self._world)]

    def _count(self, window: Samples) -> int:
        """Return the number of samples in a window."""
        return len(window.true_t_ns)
