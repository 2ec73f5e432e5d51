# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""The ROS 2 nodes and what they share; the only room that imports rclpy and message classes.

Its modules are imported when first used: an executable handles signals before rclpy is loaded.
"""

from typing import TYPE_CHECKING

from imu_sim_ros.lazy import exported

if TYPE_CHECKING:
    from imu_sim_ros.nodes.control import Control as Control
    from imu_sim_ros.nodes.control import InjectedFault as InjectedFault
    from imu_sim_ros.nodes.control import Status as Status
else:
    __getattr__, __dir__, __all__ = exported(
        __name__,
        {
            "control": ["Control", "InjectedFault", "Status"],
        },
    )
