# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Definitions of the message types that this package writes, as the files of ROS: ``NAME.msg``.

``ros1/`` has the texts verbatim, comments and trailing blanks included, because tools of ROS 1
compare the text in a bag with their own: std_msgs 0.5.13, common_msgs 1.13.1, rosgraph_msgs 1.11.3
and geometry2 0.7.5, Copyright 2008-2010 Willow Garage, Inc., BSD-3-Clause. ``ros2/`` has fields and
constants of Jazzy. Of both there are fields and constants of gps_umd (2.0.5 for Jazzy, 0.3.4 for
Noetic, where gps_msgs is called gps_common) and of livox_ros_driver2 1.2.4.

``digests.txt`` has the digest of each type that is written as a message, with all that it contains.
"""

from functools import cache
from pathlib import Path
from typing import Final

ROS1_NAME_OF_GPS_MSGS: Final = "gps_common"
_FOLDER: Final = Path(__file__).parent


@cache
def texts(generation: str) -> dict[str, str]:
    """Return the text of each type by name (sensor_msgs/Imu), without the types that it contains.

    :param generation: ``ros1`` or ``ros2``.
    """
    return {
        f"{package.name}/{file.stem}": file.read_bytes().decode()
        for package in (_FOLDER / generation).iterdir()
        if package.is_dir()
        for file in package.iterdir()
    }


@cache
def digests(generation: str) -> dict[str, str]:
    """Return the MD5 sum (``ros1``) or the hash RIHS01 of REP-2016 (``ros2``) of types by name."""
    file = _FOLDER / generation / "digests.txt"
    return dict(line.split() for line in file.read_text(encoding="utf-8").splitlines())
