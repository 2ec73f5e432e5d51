# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""What the vehicle does to the readings of its board: vibration that follows the motion.

Imports the leaves, the trajectory's motion, and the chunked processes of the errors' room.
"""

from imu_sim_ros.sensor.vehicle.vibration import BoardVibration, MotionSize

__all__ = ["BoardVibration", "MotionSize"]
