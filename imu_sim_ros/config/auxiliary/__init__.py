# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Parameters of what a nine-axis board has beside its IMU, and of the world that this measures.

``magnetometer``, ``barometer`` and ``orientation`` are sections of an IMU, ``surroundings`` (the
magnetic field, the atmosphere) of a simulation. Imports the description of parameters.
"""

from imu_sim_ros.config.auxiliary.barometer import BarometerParameters
from imu_sim_ros.config.auxiliary.magnetometer import MagnetometerParameters
from imu_sim_ros.config.auxiliary.orientation import MODEL_ERRORS, OrientationParameters
from imu_sim_ros.config.auxiliary.own_rate import OwnRateParameters
from imu_sim_ros.config.auxiliary.surroundings import AtmosphereParameters, MagneticFieldParameters

__all__ = [
    "MODEL_ERRORS",
    "AtmosphereParameters",
    "BarometerParameters",
    "MagneticFieldParameters",
    "MagnetometerParameters",
    "OrientationParameters",
    "OwnRateParameters",
]
