# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""The errors of a sensor on the ideal readings of another simulator.

The chain of errors is the simulator's own, :class:`imu_sim_ros.sensors.imu.model.Imu`: for the
ideal readings of a simulation, the same parameters and the same seed, the samples are the
simulation's, bit for bit, in blocks of any size.
"""

import dataclasses
from collections.abc import Callable, Collection, Sequence
from typing import Any

import numpy as np

from imu_sim_ros.core import timebase
from imu_sim_ros.core.conventions import TRIADS
from imu_sim_ros.core.errors import ConfigurationError
from imu_sim_ros.core.records import LiveReading, Readings
from imu_sim_ros.core.rotation import rotate
from imu_sim_ros.core.types import Array
from imu_sim_ros.parameters.sections import flatten
from imu_sim_ros.parameters.sections import parameters as described
from imu_sim_ros.sensors.faults import Fault
from imu_sim_ros.sensors.gravity import gravity_vector
from imu_sim_ros.sensors.imu.declaration import NAME as IMU
from imu_sim_ros.sensors.imu.model import AHEAD, NOWHERE, Imu, unknown_motion
from imu_sim_ros.sensors.samples import Samples
from imu_sim_ros.sensors.world import Window, World
from imu_sim_ros.simulation.error_input import Conventions, Resampler, StartCheck
from imu_sim_ros.simulation.error_parameters import ErrorModelParameters
from imu_sim_ros.simulation.given_sensor import OTHERS, GivenOther, GivenSensor
from imu_sim_ros.simulation.sensors import models, mount_sensors
from imu_sim_ros.trajectory.motion import Motion


class GivenImu(GivenSensor[Readings, dict[str, Samples]]):
    """An IMU whose ideal readings come from another simulator, and its samples with true errors."""

    def __init__(
        self,
        parameters: ErrorModelParameters,
        sensors: Collection[str] = (),
        remark: Callable[[str], object] = lambda line: None,
    ) -> None:
        """Initialise the sensor; its first sample is the first reading.

        :param sensors: ``orientation`` is one of them if the IMU states it next to the readings,
            those of :data:`OTHERS` that it measures.
        :param remark: receives a line for everything that looks like a mistake, and for the first
            irregularities of the stamps of each kind.
        """
        self._sensors = frozenset(sensors) - {IMU, *OTHERS}
        self._measured = frozenset(sensors)
        self._resamples = bool(parameters.input.rate) and (
            parameters.input.rate != parameters.rate or parameters.imu.sampling != "instantaneous"
        )
        self._gravity_w = gravity_vector(parameters)
        self._check = StartCheck(parameters)
        self._given_others: dict[str, GivenOther] = {}
        super().__init__(parameters, parameters.rate, remark)
        for line in parameters.warnings():
            remark(line)

    def other(self, quantity: str) -> GivenOther:
        """Return another sensor of the IMU, which has ideal readings of its own.

        :param quantity: one of :data:`OTHERS`.
        """
        if quantity not in self._given_others:
            self._given_others[quantity] = GivenOther(
                OTHERS[quantity], self.parameters, self._remark
            )
        return self._given_others[quantity]

    @property
    def uses_orientation(self) -> bool:
        """True if the orientation of readings matters to the samples."""
        return bool(self._sensors) or self.parameters.input.gravity == "missing"

    def _begin(self, seed: int) -> None:
        """Start the errors of a unit with a seed."""
        super()._begin(seed)
        self._imu: Imu | None = None
        self._pending: ErrorModelParameters | None = None
        self._conventions = Conventions(self.parameters)
        self._resampler = Resampler(self.parameters) if self._resamples else None
        self._as_it_is = self._conventions.nothing and self._resampler is None and not self._sensors
        """True if readings are those of the mounted sensor, and no other sensor needs them."""
        self._latest: LiveReading | None = None
        """The last reading, if its sample was made in numbers."""

    def read_few(self, readings: Sequence[LiveReading]) -> Samples | None:
        """Return the samples of a few readings, at least one; None: :meth:`read` must be called.

        It must be called if more is to be done than to add errors: at the start, after a gap or a
        jump of the stamps, and for input from another place of the body.
        """
        imu, times = self._imu, [reading.t_ns for reading in readings]
        if imu is None or not self._follow(times):
            return None
        samples = imu.apply_few(times, readings, unknown_motion(len(times)), self._world)
        if samples is not None:
            self._pass(times, readings)
        return samples

    def read_numbers(self, readings: Sequence[LiveReading]) -> list[LiveReading] | None:
        """Return the samples of a few readings, at least one, as delivered and without truth.

        They are computed with plain numbers, which is faster than arrays of a few rows. The result
        is None, and no state has changed, if :meth:`read_few` or :meth:`read` must be called.
        """
        imu, times = self._imu, [reading.t_ns for reading in readings]
        if imu is None or not self._follow(times):
            return None
        samples = imu.read_numbers(times, readings, self._world)
        if samples is not None:
            self._pass(times, readings)
        return samples

    def _follow(self, times: Sequence[int]) -> bool:
        """Return whether stamps [ns] are those of the next samples, with no more to be done."""
        as_it_is = self._as_it_is and self._pending is None
        return as_it_is and self._order.follow(times) and self._gaps.none_in(times)

    def _pass(self, times: Sequence[int], readings: Sequence[LiveReading]) -> None:
        """Take note of readings whose samples have been made in numbers."""
        if not self._check.done:
            for reading in readings:
                self._check.arrive(*reading[:3])
                for line in self._check.look(*reading[:3]):
                    self._remark(line)
        self._order.last_ns = self._last_ns = times[-1]
        self._gaps.take(times)
        self._latest = readings[-1]
        self.position += len(times)
        self.counts.readings += len(times)
        self.counts.samples += len(times)

    def read(self, readings: Readings) -> list[dict[str, Samples]]:
        """Return the samples that readings give; see :class:`GivenSensor`."""
        if self._latest is not None:
            t_ns, gyro, accel, _ = self._latest
            self._held = Readings.unchecked(
                t_ns=np.array([t_ns]), gyro=np.array([gyro]), accel=np.array([accel])
            )
            self._spreading.take(self._held)
            self._latest = None
        if not self._check.done:
            self._check.arrive(readings.t_ns, *readings.triads())
        return super().read(readings)

    def reset(self) -> None:
        """Restart with the next reading, with the seed that input.restart states."""
        self.finish()
        super().reset()
        for sensor in self._given_others.values():
            sensor.reset()

    def update(self, parameters: ErrorModelParameters) -> None:
        """Apply new values of live parameters, from the next multiple of 64 samples on.

        :raises ConfigurationError: with a line for every changed parameter that is not live;
            nothing is changed then.
        """
        old_values, new_values = flatten(self.parameters), flatten(parameters)
        declarations = described(type(parameters), new_values)
        problems = [
            f"{name}: cannot be changed while the error model runs"
            for name, value in new_values.items()
            if old_values.get(name) != value and not declarations[name].live
        ]
        if problems:
            raise ConfigurationError(problems)
        self.parameters = parameters
        self._pending = parameters
        for sensor in self._given_others.values():
            sensor.configure(parameters)

    def find_sensor(self, fault: Fault) -> "GivenSensor[Any, Any]":
        """Return the sensor that a fault hits.

        :raises ConfigurationError: for one that is not there.
        """
        for quantity in self._measured.intersection(OTHERS):
            if OTHERS[quantity].name == fault.triad:
                return self.other(quantity)
        if fault.triad not in ("", *TRIADS):
            raise ConfigurationError(
                f"fault triad = {fault.triad}: an error model has no {fault.triad}"
            )
        return self

    def inject(self, fault: Fault, delay: float = 0.0) -> int:
        """Start a fault; return the index of the first sample that it hits.

        :param delay: seconds after the sensor's next sample, >= 0.
        :raises ConfigurationError: for another delay, and a sensor that is not there.
        """
        hit = self.find_sensor(fault)
        if isinstance(hit, GivenOther):
            return hit.inject(fault, delay)
        first_sample = self.first_hit(delay)
        if self._imu is None:
            self._faults.append((fault, first_sample))
        else:
            self._imu.inject(fault, self.begin_of(first_sample))
        return first_sample

    def _count(self, window: dict[str, Samples]) -> int:
        """Return the number of samples in a window."""
        return len(window[IMU].true_t_ns)

    def _look(self, readings: Readings) -> None:
        """Check units and gravity of the first readings."""
        if not self._check.done:
            for line in self._check.look(readings.t_ns, *readings.triads()):
                self._remark(line)

    def finish(self) -> None:
        """Report remarks on the readings so far, if the check of the start has not had enough."""
        for line in self._check.finish():
            self._remark(line)

    def _missing(self, count: int) -> int:
        """Return the number of samples that a gap of some readings leaves out."""
        return count if self._resampler is None else 0

    def _resume(self) -> None:
        """Begin the resampling again after a pause."""
        if self._resampler is not None:
            self._resampler.begin()

    def _place(self, readings: Readings) -> Readings:
        """Return readings in the conventions of the simulation."""
        return self._conventions.apply(readings)

    def _sample(self, readings: Readings) -> list[dict[str, Samples]]:
        """Return the samples, in blocks, of readings where the IMU is mounted.

        New parameters take effect from a sample whose number is a multiple of ``AHEAD``, since the
        errors up to there are drawn already: while some wait, a block ends at the next one.
        """
        internal = readings.triads()
        if self._resampler is not None:
            readings, internal = self._resampler.apply(readings)
        else:
            self._held = readings
        count = len(readings.t_ns)
        if not count:
            return []
        imu = self._imu or self._start(readings)
        if self._pending is None:
            return [self._apply(imu, readings, *internal)]
        ratio = len(internal[0]) // count
        blocks, done = [], 0
        while done < count:
            if self._pending is not None and self.position % AHEAD == 0:
                imu.configure(self._pending.imu)
                self._pending = None
            remaining = count - done
            to_boundary = AHEAD - self.position % AHEAD
            step = remaining if self._pending is None else min(remaining, to_boundary)
            block = readings.rows(slice(done, done + step))
            internal_rows = slice(done * ratio, (done + step) * ratio)
            gyro, accel = (triad[internal_rows] for triad in internal)
            blocks.append(self._apply(imu, block, gyro, accel))
            done += step
        return blocks

    def _apply(self, imu: Imu, readings: Readings, gyro: Array, accel: Array) -> dict[str, Samples]:
        """Return the next n samples of the IMU and of its other sensors.

        :param readings: n readings at the times of the samples.
        :param gyro: (n m, 3) ideal rates inside the sensor [rad/s].
        :param accel: (n m, 3) ideal specific forces inside the sensor [m/s^2].
        """
        begin, self.position = self.position, self.position + len(readings.t_ns)
        samples = {IMU: imu.apply(readings.t_ns, self._motion(readings), gyro, accel, self._world)}
        if self._others:
            rate = timebase.exact_rate(self.parameters.rate)
            window = Window(begin / rate, self.position / rate)
            samples |= {
                name: model.read(window, self._world) for name, model in self._others.items()
            }
        return samples

    def _start(self, readings: Readings) -> Imu:
        """Create and return the sensor, whose first sample is the first of the readings."""
        parameters = self.parameters
        environment = dataclasses.replace(parameters, seed=self.seed)
        t0_ns = int(readings.t_ns[0])
        self._world = World(NOWHERE, environment, t0_ns)
        self._others = models(mount_sensors(environment), self._sensors, t0_ns)
        imu = self._others.pop("imu")
        assert isinstance(imu, Imu)
        for fault, first_sample in self._faults:
            imu.inject(fault, self.begin_of(first_sample))
        self._imu, self._faults, self._pending = imu, [], None
        return imu

    def _motion(self, readings: Readings) -> Motion:
        """Return the motion as far as readings tell it: attitude and acceleration."""
        motion = unknown_motion(len(readings.t_ns))
        if readings.q_wb is None:
            if self._sensors:
                raise ConfigurationError(
                    "orientation: the readings come without one, so there is none to state"
                )
            return motion
        acceleration = rotate(readings.q_wb, readings.triads()[1]) + self._gravity_w
        return motion._replace(q_wb=readings.q_wb, acceleration=acceleration)
