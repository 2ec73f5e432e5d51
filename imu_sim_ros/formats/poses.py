# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""The reader of poses for motions that may be files; most are none and need no format."""

from pathlib import Path

from imu_sim_ros.core.records import States


def poses_of_any_file(
    path: str | Path, topic: str | None = None, skip_bad_rows: bool = False
) -> States:
    """Return the poses of a file of any format, whose readers are loaded on first use.

    :param topic: topic of a recording; None: its only one with poses.
    :param skip_bad_rows: leave out rows that cannot be read.
    :raises ImuSimError: for a file without poses.
    """
    from imu_sim_ros.formats.door import read_states

    return read_states(path, topic, skip_bad_rows)
