# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""One cell of a campaign as its estimators see it: samples of any seed, and the truth."""

from collections.abc import Collection
from typing import TYPE_CHECKING

import numpy as np

from imu_sim_ros.campaigns.cells import Cell
from imu_sim_ros.campaigns.plan import Plan
from imu_sim_ros.core.errors import ConfigurationError
from imu_sim_ros.core.records import Readings, States
from imu_sim_ros.formats.poses import poses_of_any_file
from imu_sim_ros.sensors.imu.declaration import NAME as IMU
from imu_sim_ros.sensors.pose.declaration import NAME as POSE
from imu_sim_ros.sensors.samples import Samples
from imu_sim_ros.simulation.engine import Body
from imu_sim_ros.simulation.sensors import mount_sensors
from imu_sim_ros.simulation.topics import delivered_readings
from imu_sim_ros.trajectory.motion import RememberedTrajectory

if TYPE_CHECKING:
    from concurrent.futures import Executor


class SimulatedCell:
    """The simulation of a cell; parts common to all its seeds are computed once."""

    def __init__(self, plan: Plan, cell: Cell) -> None:
        """Initialise with trajectory and sensor.

        :raises ImuSimError: for a cell that cannot be simulated.
        """
        self.plan, self.cell = plan, cell
        self.parameters = plan.simulation(cell)
        self._base = Body(self.parameters, pose_reader=poses_of_any_file)
        if self._base.total is None:
            raise ConfigurationError(
                f"cell {cell.name}: duration = 0: this trajectory has no end; give a duration in "
                "parameters"
            )
        self.total = self._base.total
        # It is sampled at the same times whatever the seed.
        self._base.trajectory = RememberedTrajectory(self._base.trajectory)
        self._truth: States | None = None

    def block(self, seed: int) -> Samples:
        """Return all samples of the IMU of a seed; no other sensor is read."""
        block: Samples = self._start(seed).next(self.total)[IMU]
        return block

    def simulation(self, seed: int, threads: "Executor | None" = None) -> Body:
        """Return the body of this cell at its first sample, with the plan's faults.

        :param threads: threads for the cameras, which are read as well; None: cameras are not read.
        """
        dataset_sensors = [
            n for n, mount in mount_sensors(self.parameters).items() if mount.sensor.datasets
        ]
        sensors = (POSE, *self.parameters.sensors, *(dataset_sensors if threads else ()))
        return self._start(seed, sensors, threads)

    def _start(
        self, seed: int, sensors: Collection[str] = (), threads: "Executor | None" = None
    ) -> Body:
        """Return the body at its first sample; sensors are read in addition to the IMU."""
        body = self._base.with_seed(seed, sensors, threads)
        for timed in self.plan.faults:
            body.inject(timed.fault, timed.start)
        return body

    def truth(self, block: Samples) -> States:
        """Return the true states at the true times, which are the same for all seeds.

        :param block: all samples of any seed.
        """
        if self._truth is None:
            t_ns, motion = block.true_t_ns, block.motion
            self._truth = States(
                t_ns, motion.position, motion.q_wb, motion.velocity, source="truth"
            )
        return self._truth

    def readings(self, block: Samples) -> Readings:
        """Return the delivered readings, each stamp once and in order."""
        readings = Readings(*delivered_readings(block))
        if len(readings) and bool(np.all(readings.t_ns[1:] > readings.t_ns[:-1])):
            return readings
        return readings.rows(np.unique(readings.t_ns, return_index=True)[1])
