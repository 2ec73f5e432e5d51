# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""MCAP files, read and written. Imports bags and its messages."""

from imu_sim_ros.bags.mcap.reader import McapBag
from imu_sim_ros.bags.mcap.writer import McapWriter

__all__ = ["McapBag", "McapWriter"]
