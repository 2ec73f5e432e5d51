# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Trajectories from wherever the commands find them: text, folders, topics of bags."""

from pathlib import Path

import numpy as np

from imu_sim_ros.bags.messages.encode import ODOMETRY
from imu_sim_ros.core.conventions import TRUTH_TOPIC
from imu_sim_ros.core.errors import Remark, warn
from imu_sim_ros.core.records import States
from imu_sim_ros.formats.door import format_of, has_topics, truth_file
from imu_sim_ros.inputs.poses import write_tum


def odometry_topics(path: Path) -> list[str]:
    """Return the names of the Odometry topics of a file; none of a format without topics."""
    return format_of(path).odometry_topics(path)


def truth_topic(path: Path, topic: str | None) -> str | None:
    """Return the topic of the truth: the given one, or else the one with the usual name, if any."""
    if topic is not None or not has_topics(path):
        return topic
    candidates = [name for name in odometry_topics(path) if name.strip("/").endswith(TRUTH_TOPIC)]
    return candidates[0] if len(candidates) == 1 else None


def assume_truth_topic(path: Path, topic: str | None) -> str | None:
    """Return the topic of the truth: as :func:`truth_topic`, else the only one of Odometry.

    That may be an estimate, such as ``wheel/odom``; a remark names it.
    """
    truth_name = truth_topic(path, topic)
    if truth_name is not None or not has_topics(path):
        return truth_name
    names = odometry_topics(path)
    if len(names) != 1:
        return None
    remark = f"{path}: taken as the truth: {names[0]}, the only topic of {ODOMETRY}"
    warn(remark, Remark)
    return names[0]


def has_truth(path: Path) -> bool:
    """Return True if a file has states next to its readings, which may be the truth."""
    return truth_file(path) is not None


def write_states(path: Path, states: States) -> None:
    """Write a dead-reckoned trajectory: ``.csv`` with velocity, anything else in TUM format.

    :raises OSError: if the file cannot be written.
    """
    if path.suffix.lower() == ".csv":
        _write_csv(path, states)
    else:
        write_tum(path, states)


def _write_csv(path: Path, states: States) -> None:
    """Return the columns of EuRoC's states, without the biases, so that everything reads it."""
    names = ["#timestamp", *(f"p_RS_R_{axis} [m]" for axis in "xyz")]
    names += [f"q_RS_{axis} []" for axis in "wxyz"]
    names += [f"v_RS_R_{axis} [m s^-1]" for axis in "xyz"]
    table = np.column_stack([states.position, states.q_wb, states.velocities()])
    with path.open("w", encoding="utf-8") as file:
        file.write(",".join(names) + "\n")
        for t_ns, row in zip(states.t_ns.tolist(), table.tolist(), strict=True):
            file.write(f"{t_ns}," + ",".join(f"{value:.12g}" for value in row) + "\n")
