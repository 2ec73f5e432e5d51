# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Files that grow: their names before they are complete, and the way of their bytes to the disk.

Imports the leaves.
"""

from imu_sim_ros.bags.files.atomic_file import (
    ACTIVE_SUFFIX,
    OutputFile,
    active_path,
    make_folder,
    refuse_existing,
    unfinished,
)
from imu_sim_ros.bags.files.direct import Pace

__all__ = [
    "ACTIVE_SUFFIX",
    "OutputFile",
    "Pace",
    "active_path",
    "make_folder",
    "refuse_existing",
    "unfinished",
]
