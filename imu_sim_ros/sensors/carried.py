# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""What sensors of the body have in common: times, stamps, transport, faults, and their samples."""

from collections.abc import Mapping
from dataclasses import dataclass
from fractions import Fraction

import numpy as np

from imu_sim_ros import rotation
from imu_sim_ros.sensors.block import SensorBlock
from imu_sim_ros.sensors.declaration import SensorReadings
from imu_sim_ros.sensors.environment import EnvironmentParameters
from imu_sim_ros.sensors.faults import Fault
from imu_sim_ros.sensors.own_rate import OwnRate
from imu_sim_ros.sensors.own_rate_parameters import CarriedParameters
from imu_sim_ros.sensors.world import Window, World
from imu_sim_ros.trajectory.motion import Motion
from imu_sim_ros.types import Array, Mask, Times


@dataclass(frozen=True, repr=False)
class CarriedReadings(SensorReadings):
    """The n readings of a sensor of the body that are delivered; fields of one's own follow."""

    t_ns: Times
    """(n,) stamps [ns], with the errors of the sensor's clock."""
    true_t_ns: Times
    """(n,) when the sample was taken [ns]."""


class CarriedSensor:
    """A sensor of the body: a class of one's own derives from it and has :meth:`measure`."""

    def __init__(
        self,
        name: str,
        parameters: CarriedParameters,
        environment: EnvironmentParameters,
        t0_ns: int,
    ) -> None:
        """Start before the first sample.

        :param name: the first part of the names of its random streams.
        :param t0_ns: time of the start [ns].
        """
        self.name, self.parameters = name, parameters
        self.lever_arm_b: Array = np.array(parameters.lever_arm)
        self._own = OwnRate(name, parameters, parameters, environment, t0_ns)
        self._before: Array | None = None

    def place(self, motion: Motion) -> Array:
        """Return the sensor's positions (n, 3) in the world."""
        return motion.position + rotation.rotate(motion.q_wb, self.lever_arm_b[None])

    def measure(self, t: Array, motion: Motion) -> Mapping[str, Array]:
        """Return the readings (n,) or (n, 3), first, and their truth, by name, of the next samples.

        An array ``bias`` of the readings' shape takes the jumps that faults add.

        :param t: (n,) since the start [s].
        :param motion: of the body.
        """
        raise NotImplementedError

    def complete(self, values: Mapping[str, Array]) -> Mapping[str, Array]:
        """Return the values with what follows from the readings, after faults."""
        return values

    def sent(self, values: Mapping[str, Array]) -> Mask | None:
        """Return which samples the sensor sends (n,); None: all."""
        return None

    def configure(self, parameters: CarriedParameters) -> None:
        """Take new values of live parameters, from the next sample on."""
        self.parameters = parameters
        self._own.configure(parameters)

    def inject(self, fault: Fault, begin: Fraction) -> None:
        """Let a fault begin with the first sample not before a time since the start [s]."""
        self._own.inject(fault, begin)

    def read(self, window: Window, world: World) -> SensorBlock:
        """Return the samples in a window, which begins where the last one ended."""
        samples = self._own.within(window)
        motion = world.motion(samples.t)
        values = dict(self.measure(samples.t, motion))
        self._take_faults(samples.first, values)
        values = dict(self.complete(values))
        t_ns, release_t_ns, delivered = self._own.stamp(samples)
        sent = self.sent(values)
        if sent is not None:
            delivered = delivered[sent[delivered]]
        return SensorBlock(samples.true_t_ns, t_ns, release_t_ns, delivered, values)

    def _take_faults(self, first: int, values: dict[str, Array]) -> None:
        """Let faults change the readings."""
        name = next(iter(values))
        reading = values[name]
        count = len(reading)
        if self._own.faults.any and count:
            columns = reading.reshape(count, -1).shape[1]
            rows = np.zeros((3, count))
            rows[:columns] = reading.reshape(count, -1).T
            jump = np.zeros((3, count))
            self._own.faults.add_bias(self.name, first, jump)
            rows += jump
            self._own.faults.saturate(self.name, first, rows)
            self._own.faults.hold(self.name, first, rows, self._before)
            values[name] = np.ascontiguousarray(rows[:columns].T).reshape(reading.shape)
            if "bias" in values:
                added = jump[:columns].T.reshape(reading.shape)
                values["bias"] = values["bias"] + added
        if count:
            last = values[name][-1]
            self._before = np.zeros(3)
            self._before[: np.size(last)] = last
