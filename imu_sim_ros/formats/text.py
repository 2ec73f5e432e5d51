# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Text tables with any header, TUM's text, and folders of EuRoC and kalibr."""

from collections.abc import Iterator, Sequence
from pathlib import Path

from imu_sim_ros.bags.text import reader
from imu_sim_ros.core.errors import InputError
from imu_sim_ros.core.records import Readings, States, concatenate
from imu_sim_ros.formats.handling import Handling
from imu_sim_ros.inputs.poses import read_poses


def holds(path: Path) -> bool:
    """Return True for a text file, and for a folder of EuRoC or kalibr."""
    return reader.is_text(path)


def reading_blocks(
    path: Path, topic: str | None, frame: str | None, handling: Handling
) -> Iterator[Readings]:
    """Yield the readings of a table, or of an IMU of a folder, in blocks.

    :param topic: name of the IMU in a folder, if it has several: imu0, imu1.
    :raises InputError: for a frame, which text does not have.
    """
    if frame is not None:
        raise InputError(f"{path}: text has no frame {frame}")
    return reader.imu_blocks(path, topic, handling.skipped)


def imu_topics(path: Path) -> Sequence[str | None]:
    """Return the names of the IMUs of a folder, imu0 and so on; a file's readings have no name."""
    return reader.imu_names(path) if path.is_dir() else [None]


def odometry_topics(path: Path) -> list[str]:
    """Return nothing: text has no topics."""
    return []


def truth_file(path: Path) -> Path | None:
    """Return the folder if it has EuRoC's states."""
    return path if reader.has_states(path) else None


def pose_topics(path: Path) -> list[str]:
    """Return nothing: text has no topics."""
    return []


def stated_units(path: Path, topic: str | None) -> dict[str, str]:
    """Return the units of the triads that the header of a table states, by triad."""
    return reader.units_of_header(path, topic)


def states(path: Path, topic: str | None, covariance: bool, handling: Handling) -> States:
    """Return the poses of a text file, or the states of a folder; arguments as for the door."""
    skipped = handling.skipped
    if path.is_dir() and reader.has_states(path):
        return concatenate([block for block, _ in reader.state_blocks(path, topic, skipped)])
    file = reader.pose_file(path) or reader.state_file(path)
    poses = read_poses(file, topic, skipped is not None, covariance)
    if skipped is not None and poses.skipped:
        skipped(poses.skipped)
    return poses
