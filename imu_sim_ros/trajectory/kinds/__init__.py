# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""One file per kind of trajectory, each with its exact derivatives.

Imports the leaves and what the kinds share in the package above.
"""

from imu_sim_ros.trajectory.kinds.calibration_motion import six_position, turntable
from imu_sim_ros.trajectory.kinds.free_fall import FreeFall
from imu_sim_ros.trajectory.kinds.harmonic import Harmonic
from imu_sim_ros.trajectory.kinds.polar import Polar
from imu_sim_ros.trajectory.kinds.static import Static
from imu_sim_ros.trajectory.kinds.vibration import Vibrating, Vibration
from imu_sim_ros.trajectory.kinds.waypoints import Waypoints

__all__ = [
    "FreeFall",
    "Harmonic",
    "Polar",
    "Static",
    "Vibrating",
    "Vibration",
    "Waypoints",
    "six_position",
    "turntable",
]
