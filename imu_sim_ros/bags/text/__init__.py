# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Text forms: EuRoC, CSV, TUM. Imports bags and its messages."""

from typing import TYPE_CHECKING

from imu_sim_ros.lazy import exported

if TYPE_CHECKING:
    from imu_sim_ros.bags.text import decimals as decimals
    from imu_sim_ros.bags.text import reader as reader
    from imu_sim_ros.bags.text import writer as writer
    from imu_sim_ros.bags.text.decimals import decimal as decimal
    from imu_sim_ros.bags.text.reader import has_states as has_states
    from imu_sim_ros.bags.text.reader import imu_names as imu_names
    from imu_sim_ros.bags.text.reader import is_text as is_text
    from imu_sim_ros.bags.text.writer import BESIDE as BESIDE
    from imu_sim_ros.bags.text.writer import Dataset as Dataset
    from imu_sim_ros.bags.text.writer import States as States
else:
    __getattr__, __dir__, __all__ = exported(
        __name__,
        {
            "": ["decimals", "reader", "writer"],
            "decimals": ["decimal"],
            "reader": ["has_states", "imu_names", "is_text"],
            "writer": ["BESIDE", "Dataset", "States"],
        },
    )
