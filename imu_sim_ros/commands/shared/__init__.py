# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""What several commands share: their outputs and their files of poses, with the arguments.

``side_files`` are what ``generate`` puts beside its output. What is exported is imported when it is
first used.
"""

from typing import TYPE_CHECKING

from imu_sim_ros.lazy import exported

if TYPE_CHECKING:
    from imu_sim_ros.commands.shared.output_arguments import PICTURES as PICTURES
    from imu_sim_ros.commands.shared.output_arguments import add_force as add_force
    from imu_sim_ros.commands.shared.output_arguments import outputs as outputs
    from imu_sim_ros.commands.shared.pose_arguments import PoseReader as PoseReader
    from imu_sim_ros.commands.shared.pose_arguments import add_skip_bad_rows as add_skip_bad_rows
    from imu_sim_ros.commands.shared.side_files import configs as configs
    from imu_sim_ros.commands.shared.side_files import describe as describe
    from imu_sim_ros.commands.shared.side_files import new_truths as new_truths
    from imu_sim_ros.commands.shared.side_files import write_configs as write_configs
else:
    __getattr__, __dir__, __all__ = exported(
        __name__,
        {
            "output_arguments": ["PICTURES", "add_force", "outputs"],
            "pose_arguments": ["PoseReader", "add_skip_bad_rows"],
            "side_files": ["configs", "describe", "new_truths", "write_configs"],
        },
    )
