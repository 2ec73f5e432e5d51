# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Splines through poses: recorded trajectories, smooth to the second derivative.

Imports the leaves and the package above.
"""

from imu_sim_ros.trajectory.splines.recorded import Recorded, fit_report, recorded_in

__all__ = ["Recorded", "fit_report", "recorded_in"]
