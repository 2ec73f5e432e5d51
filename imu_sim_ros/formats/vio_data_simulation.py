# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Folders and text files of vio_data_simulation: readings with noise, true states."""

from collections.abc import Iterator, Sequence
from pathlib import Path

from imu_sim_ros.bags.text import vio_data_simulation as files
from imu_sim_ros.core.errors import InputError
from imu_sim_ros.core.records import Readings, States
from imu_sim_ros.formats.handling import Handling


def holds(path: Path) -> bool:
    """Return True for a folder with both files of readings, and for a file in it."""
    return files.is_source(path)


def reading_blocks(
    path: Path, topic: str | None, frame: str | None, handling: Handling
) -> Iterator[Readings]:
    """Yield the readings in one block.

    :raises InputError: for a topic or a frame, which this text does not have.
    """
    for kind, name in (("topic", topic), ("frame", frame)):
        if name is not None:
            raise InputError(f"{path}: text has no {kind} {name}")
    yield files.read_readings(path, handling.skipped)


def imu_topics(path: Path) -> Sequence[str | None]:
    """Return the only IMU, which has no name."""
    return [None]


def odometry_topics(path: Path) -> list[str]:
    """Return nothing: text has no topics."""
    return []


def pose_topics(path: Path) -> list[str]:
    """Return nothing: the folder has no topics."""
    return []


def truth_file(path: Path) -> Path | None:
    """Return the file of true readings and poses, also of the readings with noise beside it."""
    return files.truth_file(path) if files.has_states(path) else None


def stated_units(path: Path, topic: str | None) -> dict[str, str]:
    """Return nothing: the form has SI units."""
    return {}


def states(path: Path, topic: str | None, covariance: bool, handling: Handling) -> States:
    """Return the true states of a folder, or the poses of a file; arguments as for the door.

    :raises InputError: for a topic, which this text does not have.
    """
    if topic is not None:
        raise InputError(f"{path}: text has no topic {topic}")
    return files.read_states(path, handling.skipped)
