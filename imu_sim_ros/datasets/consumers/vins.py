# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""VINS-Mono and VINS-Fusion: their configurations (parameters.cpp).

Lenses are camodocal's: PINHOLE (radial-tangential), KANNALA_BRANDT (its k2 to k5 are the
equidistant model's k1 to k4), MEI (unified sphere).
"""

import math
from collections.abc import Iterator
from typing import Final

from imu_sim_ros.bags.text.decimals import decimal
from imu_sim_ros.datasets.consumers.rig import (
    RigValues,
    four_coefficients,
    lens_kind,
    opencv_matrix,
)
from imu_sim_ros.datasets.consumers.subject import Subject
from imu_sim_ros.datasets.consumers.values import ImuValues, comment, number_notes, yaml_float
from imu_sim_ros.sensors.camera.parameters import CameraParameters


def files(subject: Subject) -> dict[str, str]:
    """Return the files of VINS-Mono and VINS-Fusion, complete for cameras that both support."""
    rig = subject.rig
    if rig is None or not rig.fits(*KINDS):
        return {
            "vins_mono.yaml": config(subject.imu, fusion=False),
            "vins_fusion.yaml": config(subject.imu, fusion=True),
        }
    cameras = {
        f"vins_fusion_cam{k}.yaml": camera_file(rig.cameras[name])
        for k, name in enumerate(list(rig.cameras)[:2])
    }
    return {
        "vins_mono.yaml": mono(rig),
        "vins_fusion.yaml": fusion(rig, "vins_fusion"),
        **cameras,
    }


def config(values: ImuValues, *, fusion: bool) -> str:
    """Return the IMU's keys of a configuration of VINS-Mono, or of VINS-Fusion.

    Its covariance is ``F P F^T + V Q V^T`` with ``Q = diag(acc_n^2, ...)`` and V proportional to dt
    (integration_base.h): a sample's standard deviation, density * sqrt(rate). VINS-Fusion reads
    topic and noise of the IMU only if ``imu`` is 1.
    """
    name = "VINS-Fusion" if fusion else "VINS-Mono"
    head = comment(
        [
            f"{name}, fragment: the IMU's keys, to be pasted into a configuration with cameras.",
            "Values per sample at this rate, not densities: noise and walk are multiplied by the "
            f"square root of the rate, sqrt({values.rate:g} Hz) (integration_base.h).",
            *number_notes(values),
        ]
    )
    switch = "imu: 1\n" if fusion else ""
    return f'%YAML:1.0\n{head}{switch}imu_topic: "{values.topic}"\n{_numbers(values)}'


def _numbers(values: ImuValues) -> str:
    """Return the keys of the noise, per sample as VINS takes it."""
    root = math.sqrt(values.rate)
    numbers = "".join(
        f"{key}: {decimal(values.rms_density(f'{triad}_{term}') * root)}\n"
        for key, triad, term in (
            ("acc_n", "accelerometer", "noise_density"),
            ("gyr_n", "gyroscope", "noise_density"),
            ("acc_w", "accelerometer", "random_walk"),
            ("gyr_w", "gyroscope", "random_walk"),
        )
    )
    return f"{numbers}g_norm: {decimal(values.gravity)}\n"


KINDS: Final = ("radtan", "equidistant", "unified")
"""Lens models of camodocal; it has no double sphere."""
_EXPRESSED: Final = ("time_offset", "unified.distortion")
"""Errors of a camera that the configuration has keys for, other than a rolling shutter."""
_TRACKER: Final = """max_cnt: 150
min_dist: 30
freq: 10
F_threshold: 1.0
show_track: 0
"""
_OPTIMISER: Final = """max_solver_time: 0.04
max_num_iterations: 8
keyframe_parallax: 10.0
"""


def lens(camera: CameraParameters) -> str:
    """Return a camera in camodocal's terms."""
    fx, fy, cx, cy = camera.intrinsics
    k = four_coefficients(camera)
    name = {"radtan": "PINHOLE", "equidistant": "KANNALA_BRANDT", "unified": "MEI"}[
        lens_kind(camera)
    ]
    text = (
        f"model_type: {name}\ncamera_name: camera\nimage_width: {camera.width}\n"
        f"image_height: {camera.height}\n"
    )
    if lens_kind(camera) == "unified":
        text += _map("mirror_parameters", xi=camera.xi)
    if lens_kind(camera) != "equidistant":
        text += _map("distortion_parameters", k1=k[0], k2=k[1], p1=k[2], p2=k[3])
    match lens_kind(camera):
        case "radtan":
            projection = {"fx": fx, "fy": fy, "cx": cx, "cy": cy}
        case "unified":
            projection = {"gamma1": fx, "gamma2": fy, "u0": cx, "v0": cy}
        case _:
            projection = {f"k{j}": value for j, value in enumerate(k, 2)}
            projection.update({"mu": fx, "mv": fy, "u0": cx, "v0": cy})
    return text + _map("projection_parameters", **projection)


def _map(name: str, **numbers: float) -> str:
    """Return a mapping of numbers in YAML."""
    rows = "".join(f"   {key}: {yaml_float(value)}\n" for key, value in numbers.items())
    return f"{name}:\n{rows}"


def camera_file(camera: CameraParameters) -> str:
    """Return a camera's file of VINS-Fusion."""
    return f"%YAML:1.0\n---\n{lens(camera)}"


def mono(rig: RigValues) -> str:
    """Return VINS-Mono's configuration with the first camera."""
    name, camera = next(iter(rig.cameras.items()))
    t_ic = rig.imu_camera(name)
    head = _head("VINS-Mono", rig, rig.remarks((*_EXPRESSED, "row_time"), 1))
    return (
        f'%YAML:1.0\n{head}imu_topic: "{rig.imu.topic}"\nimage_topic: "{rig.topics[name]}"\n'
        f'output_path: "/tmp"\n{lens(camera)}'
        "# The extrinsics are exact: 0; 1 refines, 2 estimates them.\nestimate_extrinsic: 0\n"
        f"extrinsicRotation: {opencv_matrix(t_ic[:3, :3])}"
        f"extrinsicTranslation: {opencv_matrix(t_ic[:3, 3:])}"
        f"{_TRACKER}equalize: 1\nfisheye: 0\n{_OPTIMISER}{_numbers(rig.imu)}"
        "loop_closure: 0\nload_previous_pose_graph: 0\nfast_relocalization: 0\n"
        f'pose_graph_save_path: "/tmp/"\nestimate_td: 1\ntd: {yaml_float(rig.time_shift(name))}\n'
        f"rolling_shutter: {int(camera.row_time > 0.0)}\n"
        f"rolling_shutter_tr: {yaml_float(camera.row_time * camera.height)}\n"
        "save_image: 0\nvisualize_imu_forward: 0\nvisualize_camera_size: 0.4\n"
    )


def fusion(rig: RigValues, prefix: str) -> str:
    """Return VINS-Fusion's configuration with the first two cameras.

    :param prefix: prefix of the names of the cameras' files, ``PREFIX_cam0.yaml``.
    """
    names = list(rig.cameras)[:2]
    camera = rig.cameras[names[0]]
    head = _head("VINS-Fusion", rig, rig.remarks(_EXPRESSED, 2, one_shift="VINS-Fusion"))
    topics = "".join(f'image{k}_topic: "{rig.topics[name]}"\n' for k, name in enumerate(names))
    files = "".join(f'cam{k}_calib: "{prefix}_cam{k}.yaml"\n' for k in range(len(names)))
    mounts = "".join(
        f"body_T_cam{k}: {opencv_matrix(rig.imu_camera(name))}" for k, name in enumerate(names)
    )
    return (
        f"%YAML:1.0\n{head}imu: 1\nnum_of_cam: {len(names)}\n"
        f'imu_topic: "{rig.imu.topic}"\n{topics}output_path: "/tmp/"\n{files}'
        f"image_width: {camera.width}\nimage_height: {camera.height}\n"
        f"estimate_extrinsic: 0\n{mounts}multiple_thread: 1\n{_TRACKER}flow_back: 1\n"
        f"{_OPTIMISER}{_numbers(rig.imu)}estimate_td: 1\ntd: "
        f"{yaml_float(rig.time_shift(names[0]))}\n"
        'load_previous_pose_graph: 0\npose_graph_save_path: "/tmp/"\nsave_image: 0\n'
    )


def _head(name: str, rig: RigValues, missing: Iterator[str]) -> str:
    """Return the comment at the head of a configuration.

    :param name: name of the stack.
    :param missing: sentences about what the format cannot express of the cameras.
    """
    return comment(
        [
            f"{name}, whole: lenses and their mounts as they are simulated, the rest as for EuRoC. "
            "The motion must start with parallax: it initialises from it.",
            "Values per sample at this rate, not densities: noise and walk are multiplied by the "
            f"square root of the rate, sqrt({rig.imu.rate:g} Hz) (integration_base.h).",
            *rig.start_remarks(name),
            *missing,
            *number_notes(rig.imu, ("stamp_offset",)),
        ]
    )
