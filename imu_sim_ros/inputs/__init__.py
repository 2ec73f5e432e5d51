# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""What others wrote, read safely: regular files of bounded size, YAML without traps, a gate.

Imports errors; a leaf to all others.
"""

from imu_sim_ros.inputs import gate
from imu_sim_ros.inputs.regular import is_present, names_in, open_regular, read_text
from imu_sim_ros.inputs.rows import (
    COLUMNS,
    NUMBERS,
    STAMPS,
    VALUES,
    BadRows,
    Row,
    Skipped,
    Warned,
    number_of,
    row_blocks,
    shortened,
)
from imu_sim_ros.inputs.yaml_text import parse_yaml

__all__ = [
    "COLUMNS",
    "NUMBERS",
    "STAMPS",
    "VALUES",
    "BadRows",
    "Row",
    "Skipped",
    "Warned",
    "gate",
    "is_present",
    "names_in",
    "number_of",
    "open_regular",
    "parse_yaml",
    "read_text",
    "row_blocks",
    "shortened",
]
