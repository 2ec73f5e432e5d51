# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Poses in the order of time, as every job takes them."""

from collections.abc import Callable

import numpy as np

from imu_sim_ros.core.errors import warn
from imu_sim_ros.core.records import States, replace_fields
from imu_sim_ros.recordings.findings.catalogue import contradictions, order_poses
from imu_sim_ros.recordings.findings.policy import READ_STATES


def sort_poses(
    states: States, skip_bad_rows: bool = False, tell: Callable[[str], object] = warn
) -> States:
    """Return poses whose stamps increase: late ones in their places, without strays and repeats.

    A line tells each correction.

    :param states: poses in the order of arrival.
    :param skip_bad_rows: leave out poses that contradict another one of their time, and count them.
    :param tell: receives a line for each correction.
    :raises InputError: for a clock that goes back or changes, and for contradictory poses.
    """
    order = order_poses(states)
    READ_STATES.judge(order.findings, tell)
    poses = order.poses
    if skip_bad_rows and len(poses):
        keep = np.append(True, np.diff(poses.t_ns) > 0)
        skipped = poses.skipped + int(np.count_nonzero(~keep))
        poses = replace_fields(poses.rows(keep), skipped=skipped)
    READ_STATES.judge(contradictions(poses), tell)
    return poses.in_order()
