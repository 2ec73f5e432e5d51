# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""``--skip-bad-rows``, for every command that reads text: poses, and tables of readings."""

import argparse
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any

from imu_sim_ros import bags
from imu_sim_ros.poses import PoseSequence


def add_skip_bad_rows(parser: Any) -> None:
    """Add the argument to a parser or a group of it."""
    parser.add_argument(
        "--skip-bad-rows",
        action="store_true",
        help="skip the bad rows of a text file (poses, readings), and count them",
    )


def skipped_rows(
    arguments: argparse.Namespace, program: str, path: str | Path
) -> Callable[[int], None] | None:
    """Return what reports how many rows of a table were skipped; None: bad rows are errors."""

    def say(count: int) -> None:
        print(f"{program}: {path}: {count} bad rows skipped", file=sys.stderr)

    return say if arguments.skip_bad_rows else None


class PoseReader:
    """Reads poses as the arguments say, and reports how many rows were skipped."""

    def __init__(self, arguments: argparse.Namespace, program: str) -> None:
        self._skip, self._program = arguments.skip_bad_rows, program

    def __call__(
        self, path: str | Path, topic: str | None = None, covariance: bool = False
    ) -> PoseSequence:
        """Return the poses of a text file or a topic, on request with the file's covariances."""
        poses = bags.read_poses(path, topic, self._skip, covariance)
        if poses.skipped:
            print(f"{self._program}: {path}: {poses.skipped} bad rows skipped", file=sys.stderr)
        return poses
