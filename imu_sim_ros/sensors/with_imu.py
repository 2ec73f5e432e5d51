# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""What models of sensors with an IMU share: its clock, transport, mount, and errors of a triad."""

from collections.abc import Mapping
from fractions import Fraction

import numpy as np

from imu_sim_ros.sensors.declaration import Mounted
from imu_sim_ros.sensors.errors.realised import unit_of_seed
from imu_sim_ros.sensors.errors.terms import Surroundings
from imu_sim_ros.sensors.errors.triad import Additions, Triad
from imu_sim_ros.sensors.faults import Fault
from imu_sim_ros.sensors.imu.parameters import ImuParameters
from imu_sim_ros.sensors.samples import Samples
from imu_sim_ros.sensors.timing import SampleTiming
from imu_sim_ros.sensors.world import Sampled, Window, World
from imu_sim_ros.types import Array, Times


class SensorWithImu:
    """A sensor of an IMU, whose errors are a triad's: a class has :meth:`ideal`, :meth:`measure`.

    Its samples are read in order.
    """

    latest: Samples | None = None
    """What was read last."""

    def __init__(self, mounted: Mounted, t0_ns: int, _: object = None) -> None:
        """Set up all errors at their start.

        :param t0_ns: time of the start [ns].
        """
        self.name: str = mounted.sensor.name
        self.seed: int = mounted.environment.seed
        imu, own = mounted.own, mounted.own.sensors[self.name]
        self.lever_arm_b: Array = np.array(imu.lever_arm)
        """(3,) position of the IMU in the body [m]."""
        self.triad = Triad(self.name, imu, self.seed, own.rate)
        self.timing = SampleTiming(
            self.name, own.rate, imu, self.seed, t0_ns, own.time_offset, own.span
        )
        self.configure(imu)

    def configure(self, imu: ImuParameters) -> None:
        """Take new values of live parameters, from the next sample on."""
        self._reference_temperature = imu.reference_temperature
        self.timing.configure(imu)
        self.triad.configure(unit_of_seed(imu.triad(self.name), self.name, self.seed))

    def inject(self, fault: Fault, begin: Fraction) -> None:
        """Let a fault begin with the first sample not before a time since the start [s]."""
        self.timing.inject(fault, begin)

    def ideal(self, t: Array, world: World) -> Array:
        """Return what a sensor without errors reads (n,) or (n, 3).

        :param t: (n,) since the start [s].
        """
        raise NotImplementedError

    def measure(self, samples: Sampled, ideal: Array, additions: Additions) -> Mapping[str, Array]:
        """Return the readings of the next n samples and their truth, by name.

        :param ideal: (n,) or (n, 3).
        :param additions: as for :meth:`Triad.read`.
        """
        raise NotImplementedError

    def read(self, window: Window, world: World) -> Samples:
        """Return the samples in a window, which begins where the last one ended."""
        samples = self.timing.times.within(window)
        return self._read(samples, self.ideal(samples.t, world), world)

    def apply(self, true_t_ns: Times, ideal: Array, world: World) -> Samples:
        """Return the next n samples of ideal values that somebody gives.

        :param true_t_ns: (n,) of the samples [ns].
        :param ideal: (n,) or (n, 3), as :meth:`ideal` returns them.
        """
        return self._read(self.timing.given(true_t_ns), ideal, world)

    def _read(self, samples: Sampled, ideal: Array, world: World) -> Samples:
        offset = world.temperature.at(samples.t) - self._reference_temperature
        values = self.measure(samples, ideal, self.triad.additions(Surroundings(offset)))
        self.latest = self.timing.samples(samples.first, samples.true_t_ns, values)
        return self.latest
