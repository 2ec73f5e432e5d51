# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""A folder with the files of all stacks."""

from pathlib import Path
from typing import Final

from imu_sim_ros.bags.outputs import make_folder
from imu_sim_ros.datasets.consumers import (
    basalt,
    fusioncore,
    imu_utils,
    kalibr,
    lidar_odometry,
    mins,
    openvins,
    orb_slam3,
    robot_localization,
    vins,
)
from imu_sim_ros.datasets.consumers.rig import RigValues
from imu_sim_ros.datasets.consumers.subject import Subject
from imu_sim_ros.datasets.consumers.values import ImuValues
from imu_sim_ros.simulation.parameters import SimulationParameters

STACKS: Final = (
    *(kalibr, vins, openvins, orb_slam3, basalt, imu_utils),
    *(robot_localization, fusioncore, mins, lidar_odometry),
)
"""Modules with a function ``files``, which returns the texts of a stack's files by name. A stack
that does not support a lens has the file of the IMU alone, with a note."""


def write_all(
    folder: Path,
    values: ImuValues,
    rig: RigValues | None = None,
    parameters: SimulationParameters | None = None,
) -> None:
    """Write the files of all stacks into a new folder.

    :param rig: rig of the same IMU; with it the files hold the cameras as well.
    :param parameters: parameters of the simulation; with them there are files for the sensors of
        the body.
    """
    make_folder(folder)
    subject = Subject(values, rig, parameters)
    for stack in STACKS:
        for name, text in stack.files(subject).items():
            (folder / name).parent.mkdir(exist_ok=True)
            (folder / name).write_text(text, encoding="utf-8")
