# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""What several commands share: their outputs and their files of poses, with the arguments."""

from imu_sim_ros.commands.shared.output_arguments import PICTURES, add_force, outputs
from imu_sim_ros.commands.shared.pose_arguments import PoseReader, add_skip_bad_rows

__all__ = ["PICTURES", "PoseReader", "add_force", "add_skip_bad_rows", "outputs"]
