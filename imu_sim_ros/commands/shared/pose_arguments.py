# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""``--skip-bad-rows``, for every command that reads poses of text."""

import argparse
import sys
from pathlib import Path
from typing import Any

from imu_sim_ros.bags import read_poses
from imu_sim_ros.poses import PoseSequence


def add_skip_bad_rows(parser: Any) -> None:
    """Add the argument to a parser or a group of it."""
    parser.add_argument(
        "--skip-bad-rows",
        action="store_true",
        help="go on without the rows of a text file of poses that are wrong, and count them",
    )


class PoseReader:
    """Reads poses as the arguments say, and says how many rows were left out."""

    def __init__(self, arguments: argparse.Namespace, program: str) -> None:
        self._skip, self._program = arguments.skip_bad_rows, program

    def __call__(
        self, path: str | Path, topic: str | None = None, covariance: bool = False
    ) -> PoseSequence:
        """Return the poses of a text file or a topic, on request with the file's covariances."""
        poses = read_poses(path, topic, self._skip, covariance)
        if poses.skipped:
            print(f"{self._program}: {path}: {poses.skipped} bad rows skipped", file=sys.stderr)
        return poses
