# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""What a nine-axis board measures beside its IMU: magnetic field, orientation and pressure.

Each sensor has its own rate, stamps and random streams, and lies in the windows of time that the
blocks of the IMU span. Nothing here is imported or computed unless it is asked for. Imports the
leaves, and the errors, faults and clocks of the package above.
"""

from imu_sim_ros.sensor.auxiliary.atmosphere import Atmosphere
from imu_sim_ros.sensor.auxiliary.magnetic_field import MagneticField
from imu_sim_ros.sensor.auxiliary.magnetometer import realised_magnetometer
from imu_sim_ros.sensor.auxiliary.suite import Auxiliary

__all__ = [
    "Atmosphere",
    "Auxiliary",
    "MagneticField",
    "realised_magnetometer",
]
