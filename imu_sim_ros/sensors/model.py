# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Base of the sensors' models: times, stamps, transport, mount, faults; errors of a triad."""

from collections.abc import Mapping
from fractions import Fraction
from typing import Generic, TypeVar

import numpy as np
from numpy.random import Generator

from imu_sim_ros.core import rotation
from imu_sim_ros.core.random_streams import generator
from imu_sim_ros.core.types import Array, Mask, Times
from imu_sim_ros.sensors.declaration import Mounted
from imu_sim_ros.sensors.errors.realised import realise_unit
from imu_sim_ros.sensors.errors.terms import Surroundings
from imu_sim_ros.sensors.errors.triad import Additions, Triad
from imu_sim_ros.sensors.faults import Fault
from imu_sim_ros.sensors.imu.parameters import ImuParameters
from imu_sim_ros.sensors.parameters import MountedParameters, OwnRateParameters, SensorParameters
from imu_sim_ros.sensors.samples import Samples
from imu_sim_ros.sensors.timing import Sampled, SampleTiming
from imu_sim_ros.sensors.world import Window, World
from imu_sim_ros.trajectory.motion import Motion

SectionT = TypeVar("SectionT", bound=SensorParameters)


class FixedModel:
    """A sensor without faults, of whose parameters none is live."""

    def configure(self, parameters: MountedParameters) -> None:
        """Do nothing."""

    def inject(self, fault: Fault, begin: Fraction) -> None:
        """Do nothing."""


class SensorModel(Generic[SectionT]):
    """Base class of sensors with a mount of their own; subclasses define :meth:`measure`."""

    def __init__(self, mounted: Mounted[SectionT], t0_ns: int) -> None:
        """Initialise before the first sample.

        :param t0_ns: time of the start [ns].
        """
        self.name, self.parameters = mounted.name, mounted.parameters
        """The name is the first part of the names of its random streams."""
        self.lever_arm_b: Array = np.array(self.parameters.lever_arm)
        """(3,) position in the body [m]."""
        self.q_bs: Array = rotation.from_matrix(np.reshape(self.parameters.mounting, (3, 3)))
        """(4,) orientation in the body."""
        self._seed = mounted.environment.seed
        p = self.parameters
        self._timing = SampleTiming(self.name, p.rate, p, self._seed, t0_ns, p.time_offset, p.span)
        self._before: Array | None = None

    def stream(self, source: str) -> Generator:
        """Return the random stream of one of its sources of noise."""
        return generator(self._seed, f"{self.name}.{source}")

    def position(self, motion: Motion) -> Array:
        """Return the sensor's positions (n, 3) in the world."""
        return motion.position + rotation.rotate(motion.q_wb, self.lever_arm_b[None])

    def attitude(self, motion: Motion) -> Array:
        """Return the sensor's attitudes q_ws (n, 4) in the world."""
        return rotation.multiply(motion.q_wb, self.q_bs[None])

    def measure(self, t: Array, world: World) -> Mapping[str, Array]:
        """Return the readings (n,) or (n, 3), first, and their truth, by name, of the next samples.

        An array ``bias`` of the readings' shape takes the jumps that faults add.

        :param t: (n,) times since the start [s].
        :param world: ``world.motion(t)`` is the body's motion, ``world.scene`` what surrounds it.
        """
        raise NotImplementedError

    def complete(self, values: Mapping[str, Array]) -> Mapping[str, Array]:
        """Return the values with those derived from the readings, after faults."""
        return values

    def sent(self, values: Mapping[str, Array]) -> Mask | None:
        """Return which samples the sensor sends (n,); None: all."""
        return None

    def configure(self, parameters: SectionT) -> None:
        """Apply new values of live parameters, from the next sample on."""
        self.parameters = parameters
        self._timing.configure(parameters)

    def inject(self, fault: Fault, begin: Fraction) -> None:
        """Start a fault at the first sample at or after a time since the start [s]."""
        self._timing.inject(fault, begin)

    def read(self, window: Window, world: World) -> Samples:
        """Return the samples in a window, which begins where the last one ended."""
        samples = self._timing.times.within(window)
        values = dict(self.measure(samples.t, world))
        self._take_faults(samples.first, values)
        values = dict(self.complete(values))
        block = self._timing.samples(samples.first, samples.true_t_ns, values)
        sent = self.sent(values)
        if sent is None:
            return block
        return block._replace(delivered=block.delivered[sent[block.delivered]])

    def _take_faults(self, first: int, values: dict[str, Array]) -> None:
        """Apply faults to the readings."""
        name = next(iter(values))
        reading = values[name]
        count = len(reading)
        if self._timing.faults.windows and count:
            columns = reading.reshape(count, -1).shape[1]
            rows = np.zeros((count, 3))
            rows[:, :columns] = reading.reshape(count, -1)
            jump = np.zeros((count, 3))
            self._timing.faults.add_bias(self.name, first, jump)
            rows += jump
            self._timing.faults.saturate(self.name, first, rows)
            self._timing.faults.hold(self.name, first, rows, self._before)
            values[name] = rows[:, :columns].reshape(reading.shape)
            if "bias" in values:
                added = jump[:, :columns].reshape(reading.shape)
                values["bias"] = values["bias"] + added
        if count and np.size(values[name][-1]) <= 3:
            latest = values[name][-1]
            self._before = np.zeros(3)
            self._before[: np.size(latest)] = latest


class SensorWithImu:
    """A sensor of an IMU, with its clock, transport and mount, whose errors are a triad's.

    A class derives from it and has :meth:`ideal` and :meth:`measure`.

    Its samples are read in order.
    """

    latest: Samples
    """Samples of the last call of ``read``."""

    def __init__(self, mounted: Mounted[ImuParameters], t0_ns: int, _: object = None) -> None:
        """Set up all errors at their start.

        :param t0_ns: time of the start [ns].
        """
        self.name: str = mounted.sensor.name
        self.seed: int = mounted.environment.seed
        imu, section = mounted.parameters, mounted.parameters.sensors[self.name]
        assert isinstance(section, OwnRateParameters)
        self.lever_arm_b: Array = np.array(imu.lever_arm)
        """(3,) position of the IMU in the body [m]."""
        self.triad = Triad(self.name, imu, self.seed, section.rate)
        self.timing = SampleTiming(
            self.name, section.rate, imu, self.seed, t0_ns, section.time_offset, section.span
        )
        self.configure(imu)

    def configure(self, imu: ImuParameters) -> None:
        """Apply new values of live parameters, from the next sample on."""
        self.parameters = imu.sensors[self.name]
        self._reference_temperature = imu.reference_temperature
        self.timing.configure(imu)
        self.triad.configure(realise_unit(imu.triad(self.name), self.name, self.seed))

    def inject(self, fault: Fault, begin: Fraction) -> None:
        """Start a fault at the first sample at or after a time since the start [s]."""
        self.timing.inject(fault, begin)

    def ideal(self, t: Array, world: World) -> Array:
        """Return the readings of a sensor without errors (n,) or (n, 3).

        :param t: (n,) times since the start [s].
        """
        raise NotImplementedError

    def measure(self, samples: Sampled, ideal: Array, additions: Additions) -> Mapping[str, Array]:
        """Return the readings of the next n samples and their truth, by name.

        :param ideal: (n,) or (n, 3) ideal values.
        :param additions: as for :meth:`Triad.read`.
        """
        raise NotImplementedError

    def read(self, window: Window, world: World) -> Samples:
        """Return the samples in a window, which begins where the last one ended."""
        samples = self.timing.times.within(window)
        return self._read(samples, self.ideal(samples.t, world), world)

    def apply(self, true_t_ns: Times, ideal: Array, world: World) -> Samples:
        """Return the next n samples of ideal values from outside the simulation.

        :param true_t_ns: (n,) true times of the samples [ns].
        :param ideal: (n,) or (n, 3) ideal values, as :meth:`ideal` returns them.
        """
        return self._read(self.timing.external_samples(true_t_ns), ideal, world)

    def _read(self, samples: Sampled, ideal: Array, world: World) -> Samples:
        """Return the samples of a block, with the errors of the triad."""
        offset = world.temperature.at(samples.t) - self._reference_temperature
        values = self.measure(samples, ideal, self.triad.additions(Surroundings(offset)))
        self.latest = self.timing.samples(samples.first, samples.true_t_ns, values)
        return self.latest
