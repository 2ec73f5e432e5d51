# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""What is recovered about a sensor from its readings: noise and deterministic errors."""

from imu_sim_ros.calibration.resolution import StepFinder
from imu_sim_ros.calibration.second_process import SecondProcess

__all__ = ["SecondProcess", "StepFinder"]
