# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Where the body is: position, velocity, attitude, rates and their derivatives at any time.

One file per kind of trajectory; :func:`build_trajectory` builds the one the parameters name.
Imports the leaves: conventions, errors, rotation, timebase, config, poses. What it
exports is imported when first used.
"""

from typing import TYPE_CHECKING

from imu_sim_ros.lazy import exported

if TYPE_CHECKING:
    from imu_sim_ros.trajectory.build import PoseReader as PoseReader
    from imu_sim_ros.trajectory.build import build_trajectory as build_trajectory
    from imu_sim_ros.trajectory.motion import Felt as Felt
    from imu_sim_ros.trajectory.motion import Later as Later
    from imu_sim_ros.trajectory.motion import Motion as Motion
    from imu_sim_ros.trajectory.motion import Trajectory as Trajectory
    from imu_sim_ros.trajectory.motion import delayed as delayed
    from imu_sim_ros.trajectory.motion import felt as felt
    from imu_sim_ros.trajectory.motion import highest_frequency as highest_frequency
    from imu_sim_ros.trajectory.plausible import implausible as implausible
    from imu_sim_ros.trajectory.remembered import RememberedTrajectory as RememberedTrajectory
    from imu_sim_ros.trajectory.splines import Recorded as Recorded
    from imu_sim_ros.trajectory.splines import fit_report as fit_report
    from imu_sim_ros.trajectory.splines import recorded_in as recorded_in
else:
    __getattr__, __dir__, __all__ = exported(
        __name__,
        {
            "build": ["PoseReader", "build_trajectory"],
            "motion": [
                "Felt",
                "Later",
                "Motion",
                "Trajectory",
                "delayed",
                "felt",
                "highest_frequency",
            ],
            "plausible": ["implausible"],
            "remembered": ["RememberedTrajectory"],
            "splines": ["Recorded", "fit_report", "recorded_in"],
        },
    )
