# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""A folder with the files of all stacks."""

from pathlib import Path

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
from imu_sim_ros.datasets.consumers import (
    imu_utils as allan_variance_ros,
)
from imu_sim_ros.datasets.consumers.aiding import aiding
from imu_sim_ros.datasets.consumers.rig import RigValues, kind
from imu_sim_ros.datasets.consumers.values import ImuValues
from imu_sim_ros.simulation.parameters import SimulationParameters


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


def rig_texts(rig: RigValues) -> dict[str, str]:
    """Return the text of each file that describes cameras, by the file's name.

    A stack that does not support a lens keeps the file of the IMU alone, which says so.
    """
    values, names = rig.imu, list(rig.cameras)
    found = {
        "camchain.yaml": kalibr.camchain(rig),
        "basalt_calibration.json": basalt.calibration(values, rig),
    }
    target = kalibr.target(rig.scene)
    if target is not None:
        found["target.yaml"] = target
    if rig.fits("radtan", "equidistant"):
        found["kalibr_imucam_chain.yaml"] = openvins.imucam_chain(rig)
        found["estimator_config.yaml"] = openvins.estimator_config(rig)
    if rig.fits(*vins.KINDS):
        found["vins_mono.yaml"] = vins.mono(rig)
        found["vins_fusion.yaml"] = vins.fusion(rig, "vins_fusion")
        for k, name in enumerate(names[:2]):
            found[f"vins_fusion_cam{k}.yaml"] = vins.camera_file(rig.cameras[name])
    if rig.fits(*orb_slam3.KINDS):
        found["orb_slam3_mono_inertial.yaml"] = orb_slam3.whole(rig, 1)
        alike = len({(kind(c), c.width, c.height) for c in list(rig.cameras.values())[:2]}) == 1
        if len(names) > 1 and alike:
            found["orb_slam3_stereo_inertial.yaml"] = orb_slam3.whole(rig, 2)
    return found


def body_texts(values: ImuValues, parameters: SimulationParameters) -> dict[str, str]:
    """Return the text of each file for the other sensors of a body, by the file's name."""
    found = lidar_odometry.texts(values, parameters)
    body = aiding(values, parameters)
    if body is None:
        return found
    return {
        **found,
        **robot_localization.texts(values, parameters),
        "fusioncore.yaml": fusioncore.config(body),
        **mins.texts(body),
    }


def write_all(
    folder: Path,
    values: ImuValues,
    rig: RigValues | None = None,
    parameters: SimulationParameters | None = None,
) -> None:
    """Write the files of all stacks into a new folder.

    :param rig: of the same IMU; with it the files hold the cameras as well.
    :param parameters: of the simulation; with them there are files for the sensors of the body.
    """
    make_folder(folder)
    cameras = rig_texts(rig) if rig else {}
    body = body_texts(values, parameters) if parameters else {}
    for name, text in {**texts(values), **cameras, **body}.items():
        (folder / name).parent.mkdir(exist_ok=True)
        (folder / name).write_text(text, encoding="utf-8")
