# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""The sensors beside an IMU that a run asks for, read block by block with it."""

from collections.abc import Collection

from imu_sim_ros.sensors.barometer.model import Barometer
from imu_sim_ros.sensors.block import ImuBlock
from imu_sim_ros.sensors.environment import EnvironmentParameters
from imu_sim_ros.sensors.errors.response import TemperatureProfile
from imu_sim_ros.sensors.faults import Fault
from imu_sim_ros.sensors.imu.parameters import ImuParameters
from imu_sim_ros.sensors.magnetometer.model import Magnetometer
from imu_sim_ros.sensors.orientation.model import Orientation
from imu_sim_ros.trajectory.motion import Trajectory


class Auxiliary:
    """The sensors beside one IMU."""

    def __init__(
        self,
        imu: ImuParameters,
        environment: EnvironmentParameters,
        t0_ns: int,
        wanted: Collection[str],
    ) -> None:
        """Set up the sensors that are wanted.

        :param t0_ns: time of the IMU's sample 0 [ns].
        :param wanted: names of ``conventions.BESIDE``.
        """
        filtered = "orientation" in wanted and imu.orientation.source == "filter"
        self._wanted = wanted
        self._magnetometer = self._barometer = self._orientation = None
        if "magnetic_field" in wanted or filtered:
            self._magnetometer = Magnetometer(imu, environment, t0_ns)
        if "orientation" in wanted:
            self._orientation = Orientation(
                imu, environment, self._magnetometer if filtered else None
            )
        if "pressure" in wanted:
            self._barometer = Barometer(imu, environment, t0_ns)

    def configure(self, imu: ImuParameters) -> None:
        """Take new values of live parameters, from the next sample on."""
        if self._magnetometer is not None:
            self._magnetometer.configure(imu)
        if self._barometer is not None:
            self._barometer.configure(imu)

    def inject(self, fault: Fault, first: int) -> None:
        """Let a fault of one of these sensors begin at the time of the IMU's sample ``first``."""
        if self._magnetometer is not None and fault.triad == "magnetometer":
            self._magnetometer.inject(fault, first)
        if self._barometer is not None and fault.triad == "barometer":
            self._barometer.inject(fault, first)

    def beside(
        self, block: ImuBlock, trajectory: Trajectory, temperature: TemperatureProfile
    ) -> ImuBlock:
        """Return a block of the IMU with the samples of the others in its window of time."""
        field = None
        if self._magnetometer is not None:
            field = self._magnetometer.read(block, trajectory, temperature)
            if "magnetic_field" in self._wanted:
                block = block._replace(magnetic_field=field)
        if self._orientation is not None:
            block = block._replace(orientation=self._orientation.read(block, field))
        if self._barometer is not None:
            pressure = self._barometer.read(block, trajectory, temperature)
            block = block._replace(pressure=pressure)
        return block
