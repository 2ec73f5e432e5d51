# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Estimators that are more than a function: programs with their datasets, and calibrations.

Used by :mod:`imu_sim_ros.campaign.runs`; exports are imported when they are first used.
"""

from typing import TYPE_CHECKING

from imu_sim_ros.lazy import exported

if TYPE_CHECKING:
    from imu_sim_ros.campaign.estimators.calibrations import run_calibration as run_calibration
    from imu_sim_ros.campaign.estimators.command import run_command as run_command
    from imu_sim_ros.campaign.estimators.estimate import Estimate as Estimate
    from imu_sim_ros.campaign.estimators.estimate import estimate_metrics as estimate_metrics
    from imu_sim_ros.campaign.estimators.estimate import read_estimate as read_estimate
else:
    __getattr__, __dir__, __all__ = exported(
        __name__,
        {
            "calibrations": ["run_calibration"],
            "command": ["run_command"],
            "estimate": ["read_estimate", "Estimate", "estimate_metrics"],
        },
    )
