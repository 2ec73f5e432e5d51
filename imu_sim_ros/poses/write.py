# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Poses as text."""

from pathlib import Path

import numpy as np

from imu_sim_ros.poses.sequence import PoseSequence
from imu_sim_ros.timebase import NANOSECONDS_PER_SECOND


def write_tum(path: str | Path, poses: PoseSequence) -> None:
    """Write poses in TUM format, stamps with nine and values with twelve decimals."""
    with Path(path).open("w", encoding="utf-8") as file:
        file.write("# timestamp tx ty tz qx qy qz qw\n")
        whole, part = np.divmod(np.abs(poses.t_ns), NANOSECONDS_PER_SECOND)
        signs = np.where(poses.t_ns < 0, "-", "")
        values = np.column_stack([poses.position, poses.q_wb[:, [1, 2, 3, 0]]])
        for sign, second, nanosecond, row in zip(
            signs.tolist(), whole.tolist(), part.tolist(), values.tolist(), strict=True
        ):
            words = " ".join(f"{value:.12g}" for value in row)
            file.write(f"{sign}{second}.{nanosecond:09d} {words}\n")
