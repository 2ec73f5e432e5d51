# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Messages as bytes, bytes in files: encode, write, read, convert."""

from pathlib import Path

from imu_sim_ros.poses import PoseSequence


def read_poses(path: str | Path, topic: str | None = None) -> PoseSequence:
    """Return the poses of a text file or a bag; the bags' libraries are loaded when asked only.

    :raises InputError: for a file that cannot be read, a topic that is not there.
    """
    from imu_sim_ros.bags import read

    return read.read_poses(path, topic)
