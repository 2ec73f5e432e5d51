# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""The public Python interface, exported by ``imu_sim_ros`` itself: ``import imu_sim_ros as ims``.

Thin: arguments in, the rooms' functions, results with names by triad and axis. It sees everything
but nodes and commands. Its modules are imported when first used.
"""

from typing import TYPE_CHECKING

from imu_sim_ros.lazy import exported

if TYPE_CHECKING:
    from imu_sim_ros.api import beside as beside
    from imu_sim_ros.api import calibration as calibration
    from imu_sim_ros.api import flight as flight
    from imu_sim_ros.api import navigation as navigation
    from imu_sim_ros.api import noise as noise
    from imu_sim_ros.api import preintegration as preintegration
    from imu_sim_ros.api import readings as readings
    from imu_sim_ros.api import simulation as simulation
    from imu_sim_ros.api import twin as twin
else:
    __getattr__, __dir__, __all__ = exported(
        __name__,
        {
            "": [
                "beside",
                "calibration",
                "flight",
                "navigation",
                "noise",
                "preintegration",
                "readings",
                "simulation",
                "twin",
            ],
        },
    )
