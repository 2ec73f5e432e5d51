# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Dead reckoning, of whole records and one reading at a time.

The equations of motion are here; the initial state and its uncertainty are in the package above.
Imports the leaves and the package above.
"""

from imu_sim_ros.navigation.strapdown.dead_reckoning import dead_reckon
from imu_sim_ros.navigation.strapdown.stepper import Counts, Stepper

__all__ = ["Counts", "Stepper", "dead_reckon"]
