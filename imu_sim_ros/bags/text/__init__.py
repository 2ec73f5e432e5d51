# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Text forms: EuRoC, CSV, TUM. Imports bags and its messages."""

from imu_sim_ros.bags.text import decimals, reader, writer
from imu_sim_ros.bags.text.decimals import decimal
from imu_sim_ros.bags.text.reader import Skipped, imu_names, is_text, state_file
from imu_sim_ros.bags.text.writer import BESIDE, Dataset, States

__all__ = [
    "BESIDE",
    "Dataset",
    "Skipped",
    "States",
    "decimal",
    "decimals",
    "imu_names",
    "is_text",
    "reader",
    "state_file",
    "writer",
]
