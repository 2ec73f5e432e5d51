# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""MCAP files, read and written. Imports bags and its messages."""

from typing import TYPE_CHECKING

from imu_sim_ros.lazy import exported

if TYPE_CHECKING:
    from imu_sim_ros.bags.mcap.reader import McapBag as McapBag
    from imu_sim_ros.bags.mcap.writer import McapWriter as McapWriter
else:
    __getattr__, __dir__, __all__ = exported(
        __name__,
        {
            "reader": ["McapBag"],
            "writer": ["McapWriter"],
        },
    )
