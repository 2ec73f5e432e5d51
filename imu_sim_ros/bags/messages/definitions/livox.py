# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""livox_ros_driver2/CustomMsg: fields as in that package, 1.2.4, for ROS 1 and ROS 2."""

from typing import Final

_POINT: Final = (
    "uint32 offset_time\n"
    "float32 x\n"
    "float32 y\n"
    "float32 z\n"
    "uint8 reflectivity\n"
    "uint8 tag\n"
    "uint8 line\n"
)
_FIELDS: Final = "uint64 timebase\nuint32 point_num\nuint8 lidar_id\nuint8[3] rsvd\n"

ROS2: Final = {
    "livox_ros_driver2/CustomMsg": (
        f"std_msgs/Header header\n{_FIELDS}livox_ros_driver2/CustomPoint[] points\n"
    ),
    "livox_ros_driver2/CustomPoint": _POINT,
}
"""Definition of each type by name, without the types that it contains."""
RIHS01: Final = {
    "livox_ros_driver2/CustomMsg": (
        "RIHS01_2eb17e5e35bf5a2d6cd079f3c57f33abf95e5bf7d71b42cddc05daace73d815a"
    )
}
ROS1: Final = {
    "livox_ros_driver2/CustomMsg": f"Header header\n{_FIELDS}CustomPoint[] points\n",
    "livox_ros_driver2/CustomPoint": _POINT,
}
MD5_SUMS: Final = {"livox_ros_driver2/CustomMsg": "e4d6829bdfe657cb6c21a746c86b21a6"}
