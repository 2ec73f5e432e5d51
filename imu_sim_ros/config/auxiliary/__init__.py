# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Parameters of what a nine-axis board has beside its IMU, and of the world that this measures.

``magnetometer``, ``barometer`` and ``orientation`` are sections of an IMU, ``surroundings`` (the
magnetic field, the atmosphere) of a simulation. Imports the description of parameters.
"""

from imu_sim_ros.config.auxiliary.magnetometer import MagnetometerParameters, OwnRateParameters
from imu_sim_ros.config.auxiliary.surroundings import MagneticFieldParameters

__all__ = [
    "MagneticFieldParameters",
    "MagnetometerParameters",
    "OwnRateParameters",
]
