# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Plots of results; the only room that imports matplotlib.

It sees the results of navigation and calibration. Its modules are imported when first used.
"""

from typing import TYPE_CHECKING

from imu_sim_ros.lazy import exported

if TYPE_CHECKING:
    from imu_sim_ros.plots import allan as allan
    from imu_sim_ros.plots import calibration as calibration
    from imu_sim_ros.plots import navigation as navigation
    from imu_sim_ros.plots import readings as readings
    from imu_sim_ros.plots import sensors as sensors
    from imu_sim_ros.plots import style as style
    from imu_sim_ros.plots import twin as twin
    from imu_sim_ros.plots.style import Figure as Figure
else:
    __getattr__, __dir__, __all__ = exported(
        __name__,
        {
            "style": ["Figure"],
            "": ["allan", "calibration", "navigation", "readings", "sensors", "style", "twin"],
        },
    )
