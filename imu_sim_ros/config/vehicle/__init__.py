# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Parameters of what a vehicle does to the readings of the board that it carries."""

from imu_sim_ros.config.vehicle.vibration import BoardVibrationParameters

__all__ = ["BoardVibrationParameters"]
