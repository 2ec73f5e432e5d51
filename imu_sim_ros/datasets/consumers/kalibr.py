# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""kalibr: ``imu.yaml``, ``camchain.yaml`` and ``target.yaml`` (kalibr_common/ConfigReader.py)."""

from imu_sim_ros.bags.text.decimals import decimal
from imu_sim_ros.datasets.consumers.rig import RigValues, four_coefficients, lens_kind, yaml_list
from imu_sim_ros.datasets.consumers.subject import Subject
from imu_sim_ros.datasets.consumers.values import ImuValues, comment, number_notes, rows, yaml_float
from imu_sim_ros.sensors.camera.parameters import CameraParameters
from imu_sim_ros.sensors.camera.scene_parameters import (
    AprilgridParameters,
    CheckerboardParameters,
    SceneParameters,
)


def files(subject: Subject) -> dict[str, str]:
    """Return ``imu.yaml``, and with cameras ``camchain.yaml`` and ``target.yaml``."""
    texts = {"imu.yaml": imu_yaml(subject.imu, subject.rig is not None)}
    if subject.rig is not None:
        texts["camchain.yaml"] = camchain(subject.rig)
        if (board := target_file(subject.rig.scene)) is not None:
            texts["target.yaml"] = board
    return texts


def imu_yaml(values: ImuValues, has_rig: bool = False) -> str:
    """Return kalibr's imu.yaml; zero densities, which kalibr refuses, become small numbers.

    :param has_rig: True if the camera chain, which has the time shift, is written next to it.
    """
    shift = ("stamp_offset",) if has_rig else ()
    numbers = values.positive_densities().items()
    head = comment(
        [
            "kalibr imu.yaml, whole: continuous-time densities, as the simulation has them.",
            "rad/s/sqrt(Hz), rad/s^2/sqrt(Hz), m/s^2/sqrt(Hz), m/s^3/sqrt(Hz)",
            *number_notes(values, shift, above_zero=True),
        ]
    )
    lines = "".join(f"{name}: {decimal(value)}\n" for name, value in numbers)
    return f"{head}{lines}rostopic: {values.topic}\nupdate_rate: {decimal(values.rate)}\n"


def camchain(rig: RigValues) -> str:
    """Return camchain.yaml with the values that a calibration against the IMU should find.

    ``T_cam_imu`` maps the IMU to the camera, ``T_cn_cnm1`` the camera before to this one, and
    ``t_imu = t_cam + timeshift_cam_imu``.
    """
    text = comment(
        [
            "kalibr camchain.yaml, whole: the cameras as they are simulated. T_cam_imu and "
            "timeshift_cam_imu are what kalibr_calibrate_imu_camera is to find.",
            *rig.remarks(("time_offset", "unified.distortion", "row_time")),
            *(
                ["line_delay [s] is what kalibr_calibrate_rs_cameras is to find."]
                if any(camera.row_time for camera in rig.cameras.values())
                else []
            ),
        ]
    )
    previous: str | None = None
    for number, (name, camera) in enumerate(rig.cameras.items()):
        overlaps = [k for k in range(len(rig.cameras)) if k != number]
        text += f"cam{number}:\n  cam_overlaps: {overlaps}\n"
        if previous is not None:
            text += f"  T_cn_cnm1:\n{rows(rig.between(name, previous), '  ')}"
        text += f"  T_cam_imu:\n{rows(rig.camera_imu(name), '  ')}"
        text += lens(camera)
        text += f"  resolution: [{camera.width}, {camera.height}]\n"
        text += f"  rostopic: {rig.topics[name]}\n"
        text += f"  timeshift_cam_imu: {yaml_float(rig.time_shift(name))}\n"
        if camera.row_time:
            text += f"  line_delay: {yaml_float(camera.row_time)}\n"
        previous = name
    return text


def lens(camera: CameraParameters) -> str:
    """Return model, intrinsics and distortion in kalibr's keys."""
    shape = {"unified": (camera.xi,), "double_sphere": (camera.xi, camera.alpha)}
    model = {"unified": "omni", "double_sphere": "ds"}.get(lens_kind(camera), "pinhole")
    distortion = "equidistant" if lens_kind(camera) == "equidistant" else "radtan"
    coefficients = four_coefficients(camera)
    if lens_kind(camera) == "double_sphere":
        distortion, coefficients = "none", []
    return (
        f"  camera_model: {model}\n"
        f"  intrinsics: {yaml_list([*shape.get(lens_kind(camera), ()), *camera.intrinsics])}\n"
        f"  distortion_model: {distortion}\n"
        f"  distortion_coeffs: {yaml_list(coefficients)}\n"
    )


def target_file(scene: SceneParameters) -> str | None:
    """Return target.yaml; None if the scene is no calibration target."""
    match scene:
        case AprilgridParameters():
            return (
                f"target_type: 'aprilgrid'\ntagCols: {scene.columns}\ntagRows: {scene.rows}\n"
                f"tagSize: {yaml_float(scene.tag_size)} # m\n"
                f"tagSpacing: {yaml_float(scene.tag_spacing)} # of a tag's size\n"
            )
        case CheckerboardParameters():
            return (
                f"target_type: 'checkerboard'\ntargetCols: {scene.columns} # inner corners\n"
                f"targetRows: {scene.rows}\nrowSpacingMeters: {yaml_float(scene.square)}\n"
                f"colSpacingMeters: {yaml_float(scene.square)}\n"
            )
    return None
