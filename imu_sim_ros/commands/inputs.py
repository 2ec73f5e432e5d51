# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""``--skip-bad-rows``, for every command that reads poses or readings."""

import argparse
import sys
from pathlib import Path
from typing import Any

from imu_sim_ros.inputs.rows import BadRows, Skipped, Warned
from imu_sim_ros.poses import PoseSequence


def add_skip_bad_rows(parser: Any) -> None:
    """Add the argument to a parser or a group of it."""
    parser.add_argument(
        "--skip-bad-rows",
        action="store_true",
        help="skip and count bad rows of text and bad messages of bags (poses, readings)",
    )


def skipped_rows(arguments: argparse.Namespace, program: str, path: str | Path) -> Skipped | None:
    """Return what reports how many rows or messages were skipped; None: they are errors."""

    def say(count: int) -> None:
        print(f"{program}: {path}: {count} bad rows skipped", file=sys.stderr)

    return say if arguments.skip_bad_rows else None


def refused_messages(
    arguments: argparse.Namespace, program: str, path: str | Path
) -> tuple[Skipped | None, Warned | None]:
    """Return what becomes of a bag's readings and poses that the gate refuses, in a conversion.

    They are skipped on request; otherwise they are passed on with a warning, for a conversion is
    the way to look at them.
    """

    def warn(bad: BadRows) -> None:
        print(
            f"{program}: warning: {bad.source}: {bad.rows} of {bad.rows + bad.good} messages "
            f"are not finite or not possible, the first is {bad.first}; they are passed on, "
            "--skip-bad-rows leaves them out",
            file=sys.stderr,
        )

    skipped = skipped_rows(arguments, program, path)
    return skipped, None if skipped else warn


class PoseReader:
    """Reads poses as the arguments say, and reports how many rows were skipped."""

    def __init__(self, arguments: argparse.Namespace, program: str) -> None:
        self._skip, self._program = arguments.skip_bad_rows, program

    def __call__(
        self, path: str | Path, topic: str | None = None, covariance: bool = False
    ) -> PoseSequence:
        """Return the poses of a text file or a topic, on request with the file's covariances."""
        from imu_sim_ros.bags.read import read_poses  # readers of every container

        poses = read_poses(path, topic, self._skip, covariance)
        if poses.skipped:
            print(f"{self._program}: {path}: {poses.skipped} bad rows skipped", file=sys.stderr)
        return poses
