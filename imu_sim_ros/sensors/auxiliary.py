# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""The auxiliary sensors that a run asks for, read block by block with it."""

from collections.abc import Collection, Mapping
from typing import Any

from imu_sim_ros.sensors import auxiliary_sensors
from imu_sim_ros.sensors.block import ImuBlock
from imu_sim_ros.sensors.declaration import Model
from imu_sim_ros.sensors.environment import EnvironmentParameters
from imu_sim_ros.sensors.errors.response import TemperatureProfile
from imu_sim_ros.sensors.faults import Fault
from imu_sim_ros.sensors.imu.parameters import ImuParameters
from imu_sim_ros.sensors.registry import find_sensor
from imu_sim_ros.trajectory.motion import Trajectory


class Auxiliary:
    """The auxiliary sensors of one board, and the sensors of the body."""

    def __init__(
        self,
        imu: ImuParameters,
        environment: EnvironmentParameters,
        t0_ns: int,
        wanted: Collection[str],
        carried: Mapping[str, Any],
    ) -> None:
        """Set up the sensors that are wanted, and those that they need.

        :param t0_ns: time of the IMU's sample 0 [ns].
        :param wanted: what they measure.
        :param carried: the parameters of sensors of the body, by name.
        """
        known = auxiliary_sensors()
        needed = {name for one in known if one.quantity in wanted for name in one.needs(imu)}
        self._wanted, self._models = wanted, dict[str, Model]()
        for one in known:
            if one.quantity in wanted or one.quantity in needed:
                self._models[one.quantity] = one.model(imu, environment, t0_ns, self._models)
        for name, own in carried.items():
            if name in wanted:
                made = find_sensor(name).model(own, environment, t0_ns, self._models)
                self._models[name] = made

    def configure(self, imu: ImuParameters, carried: Mapping[str, Any]) -> None:
        """Take new values of live parameters, from the next sample on."""
        for name, model in self._models.items():
            model.configure(carried.get(name, imu))

    def inject(self, fault: Fault, quantity: str, first: int) -> None:
        """Let a fault of one of them begin at the time of the IMU's sample ``first``."""
        if quantity in self._models:
            self._models[quantity].inject(fault, first)

    def add_to(
        self, block: ImuBlock, trajectory: Trajectory, temperature: TemperatureProfile
    ) -> ImuBlock:
        """Return a block of the IMU with the samples of the others in its window of time."""
        read = {
            name: model.read(block, trajectory, temperature) for name, model in self._models.items()
        }
        return block._replace(auxiliary={k: v for k, v in read.items() if k in self._wanted})
