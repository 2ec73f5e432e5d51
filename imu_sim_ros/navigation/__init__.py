# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""What follows from readings: dead reckoning, preintegration, and their comparison with a truth.

``comparison``, ``covariance`` and ``preintegration`` have interfaces of their own. Works on arrays
and knows neither bags nor nodes. Imports the leaves.
"""

from imu_sim_ros.navigation import initialisation
from imu_sim_ros.navigation.correction import Correction, correction_of
from imu_sim_ros.navigation.initialisation import Initial
from imu_sim_ros.navigation.noise import noise_of
from imu_sim_ros.navigation.preintegration import Preintegration
from imu_sim_ros.navigation.state import NavigationState, NavigationStates
from imu_sim_ros.navigation.strapdown import Counts, Stepper, dead_reckon

__all__ = [
    "Correction",
    "Counts",
    "Initial",
    "NavigationState",
    "NavigationStates",
    "Preintegration",
    "Stepper",
    "correction_of",
    "dead_reckon",
    "initialisation",
    "noise_of",
]
