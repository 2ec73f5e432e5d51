# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""One file per kind of trajectory, each with its exact derivatives.

Imports the leaves and what the kinds share in the package above. What it
exports is imported when first used.
"""

from typing import TYPE_CHECKING

from imu_sim_ros.lazy import exported

if TYPE_CHECKING:
    from imu_sim_ros.trajectory.kinds.calibration_motion import six_position as six_position
    from imu_sim_ros.trajectory.kinds.calibration_motion import turntable as turntable
    from imu_sim_ros.trajectory.kinds.free_fall import FreeFall as FreeFall
    from imu_sim_ros.trajectory.kinds.harmonic import Harmonic as Harmonic
    from imu_sim_ros.trajectory.kinds.polar import Polar as Polar
    from imu_sim_ros.trajectory.kinds.static import Static as Static
    from imu_sim_ros.trajectory.kinds.vibration import Vibrating as Vibrating
    from imu_sim_ros.trajectory.kinds.vibration import Vibration as Vibration
    from imu_sim_ros.trajectory.kinds.waypoints import Waypoints as Waypoints
else:
    __getattr__, __dir__, __all__ = exported(
        __name__,
        {
            "calibration_motion": ["six_position", "turntable"],
            "free_fall": ["FreeFall"],
            "harmonic": ["Harmonic"],
            "polar": ["Polar"],
            "static": ["Static"],
            "vibration": ["Vibrating", "Vibration"],
            "waypoints": ["Waypoints"],
        },
    )
