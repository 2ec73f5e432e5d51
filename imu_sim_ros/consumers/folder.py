# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""A folder with the files of all stacks."""

from pathlib import Path

from imu_sim_ros.bags import make_folder
from imu_sim_ros.consumers import (
    allan_variance_ros,
    basalt,
    imu_utils,
    kalibr,
    openvins,
    orb_slam3,
    vins,
)
from imu_sim_ros.consumers.values import ImuValues


def texts(values: ImuValues) -> dict[str, str]:
    """Return the text of each stack's file by the file's name."""
    return {
        "imu.yaml": kalibr.imu_yaml(values),
        "vins_mono.yaml": vins.config(values, fusion=False),
        "vins_fusion.yaml": vins.config(values, fusion=True),
        "kalibr_imu_chain.yaml": openvins.imu_chain(values),
        "orb_slam3.yaml": orb_slam3.settings(values),
        "basalt_calibration.json": basalt.calibration(values),
        "imu_utils.yaml": imu_utils.result(values),
        "allan_variance_ros.yaml": allan_variance_ros.config(values),
    }


def write_all(folder: Path, values: ImuValues) -> None:
    """Write the files of all stacks into a new folder."""
    make_folder(folder)
    for name, text in texts(values).items():
        (folder / name).write_text(text, encoding="utf-8")
