# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""What several commands share: their outputs and their files of poses, with the arguments.

``bag_output`` and ``camera_output`` are what makes a bag or dataset, ``side_files`` what
``generate`` puts beside it, ``tracks`` trajectories to be compared, ``consistency`` their NEES,
``reprojection`` what cameras saw against them, ``measured`` what else a board states. Sees every
room. What is exported is imported when it is first used.
"""

from typing import TYPE_CHECKING

from imu_sim_ros.lazy import exported

if TYPE_CHECKING:
    from imu_sim_ros.commands.shared import bag_output as bag_output
    from imu_sim_ros.commands.shared import calibration_table as calibration_table
    from imu_sim_ros.commands.shared import camera_output as camera_output
    from imu_sim_ros.commands.shared import consistency as consistency
    from imu_sim_ros.commands.shared import measured as measured
    from imu_sim_ros.commands.shared import reprojection as reprojection
    from imu_sim_ros.commands.shared.output_arguments import PICTURES as PICTURES
    from imu_sim_ros.commands.shared.output_arguments import add_force as add_force
    from imu_sim_ros.commands.shared.output_arguments import named as named
    from imu_sim_ros.commands.shared.output_arguments import output_and_plot as output_and_plot
    from imu_sim_ros.commands.shared.output_arguments import outputs as outputs
    from imu_sim_ros.commands.shared.pose_arguments import PoseReader as PoseReader
    from imu_sim_ros.commands.shared.pose_arguments import add_skip_bad_rows as add_skip_bad_rows
    from imu_sim_ros.commands.shared.pose_arguments import refused_messages as refused_messages
    from imu_sim_ros.commands.shared.pose_arguments import skipped_rows as skipped_rows
    from imu_sim_ros.commands.shared.side_files import bagcreater_topics as bagcreater_topics
    from imu_sim_ros.commands.shared.side_files import configs as configs
    from imu_sim_ros.commands.shared.side_files import describe as describe
    from imu_sim_ros.commands.shared.side_files import new_truths as new_truths
    from imu_sim_ros.commands.shared.side_files import world_of as world_of
    from imu_sim_ros.commands.shared.side_files import write_configs as write_configs
    from imu_sim_ros.commands.shared.side_files import (
        write_tum_vi_calibration as write_tum_vi_calibration,
    )
    from imu_sim_ros.commands.shared.tracks import Track as Track
    from imu_sim_ros.commands.shared.tracks import has_truth as has_truth
    from imu_sim_ros.commands.shared.tracks import odometry_topics as odometry_topics
    from imu_sim_ros.commands.shared.tracks import read_track as read_track
    from imu_sim_ros.commands.shared.tracks import truth_topic as truth_topic
    from imu_sim_ros.commands.shared.tracks import write_states as write_states
else:
    __getattr__, __dir__, __all__ = exported(
        __name__,
        {
            "": [
                "bag_output",
                "calibration_table",
                "camera_output",
                "consistency",
                "measured",
                "reprojection",
            ],
            "output_arguments": ["PICTURES", "add_force", "named", "output_and_plot", "outputs"],
            "pose_arguments": [
                "PoseReader",
                "add_skip_bad_rows",
                "refused_messages",
                "skipped_rows",
            ],
            "side_files": [
                "bagcreater_topics",
                "configs",
                "describe",
                "new_truths",
                "world_of",
                "write_configs",
                "write_tum_vi_calibration",
            ],
            "tracks": [
                "Track",
                "has_truth",
                "odometry_topics",
                "read_track",
                "truth_topic",
                "write_states",
            ],
        },
    )
