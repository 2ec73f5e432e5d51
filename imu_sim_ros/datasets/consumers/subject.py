# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""What the files of the stacks describe."""

from typing import NamedTuple

from imu_sim_ros.datasets.consumers.aiding import Aiding, aiding
from imu_sim_ros.datasets.consumers.rig import RigValues
from imu_sim_ros.datasets.consumers.values import ImuValues
from imu_sim_ros.simulation.parameters import SimulationParameters


class Subject(NamedTuple):
    """An IMU, and with it cameras and the sensors of its body."""

    imu: ImuValues
    rig: RigValues | None = None
    """Cameras on the same IMU; None: there are none."""
    parameters: SimulationParameters | None = None
    """Of the simulation, which has the sensors of the body; None: there are none."""

    @property
    def aiding(self) -> Aiding | None:
        """What the body carries for the IMU; None: neither GNSS nor wheels."""
        return None if self.parameters is None else aiding(self.imu, self.parameters)
