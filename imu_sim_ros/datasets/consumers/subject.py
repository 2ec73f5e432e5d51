# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""The sensors for which the stacks' configuration files are written."""

from typing import NamedTuple

from imu_sim_ros.datasets.consumers.aiding import Aiding, aiding_of_imu
from imu_sim_ros.datasets.consumers.rig import RigValues
from imu_sim_ros.datasets.consumers.values import ImuValues
from imu_sim_ros.simulation.parameters import SimulationParameters


class Subject(NamedTuple):
    """An IMU, with the cameras and other sensors of its body."""

    imu: ImuValues
    rig: RigValues | None = None
    """Cameras on the same IMU; None: there are none."""
    parameters: SimulationParameters | None = None
    """Parameters of the simulation, with the sensors of the body; None: unknown."""

    @property
    def aiding(self) -> Aiding | None:
        """Aiding sensors of the body; None: neither GNSS nor wheels."""
        return None if self.parameters is None else aiding_of_imu(self.imu, self.parameters)
