# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""The body's motion as samples, without any error."""

from typing import Any

import numpy as np

from imu_sim_ros.sensors.declaration import Mounted
from imu_sim_ros.sensors.model import FixedModel
from imu_sim_ros.sensors.samples import Samples
from imu_sim_ros.sensors.world import SampleTimes, Window, World
from imu_sim_ros.trajectory.motion import Motion
from imu_sim_ros.types import Times


def pose_samples(true_t_ns: Times, motion: Motion) -> Samples:
    """Return a known motion at times (n,) [ns] as samples."""
    every = np.arange(len(true_t_ns))
    return Samples(true_t_ns, true_t_ns, true_t_ns, every, motion._asdict())


class Pose(FixedModel):
    """The body's motion at the rate of the simulation."""

    def __init__(self, mounted: Mounted, t0_ns: int, _: Any) -> None:
        self._times = SampleTimes(mounted.environment.rate, t0_ns)

    def read(self, window: Window, world: World) -> Samples:
        """Return the samples in a window."""
        samples = self._times.within(window)
        return pose_samples(samples.true_t_ns, world.motion(samples.t))
