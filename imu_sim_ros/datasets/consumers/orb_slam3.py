# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""ORB_SLAM3: settings files, form 1.0 (src/Settings.cc): whole ones, or the IMU's part alone."""

from typing import Final

import numpy as np

from imu_sim_ros.datasets.consumers.rig import (
    RigValues,
    four_coefficients,
    lens_kind,
    opencv_matrix,
)
from imu_sim_ros.datasets.consumers.subject import Subject
from imu_sim_ros.datasets.consumers.values import ImuValues, comment, number_notes, yaml_float
from imu_sim_ros.sensors.camera.parameters import CameraParameters

KINDS: Final = ("radtan", "equidistant")
"""Supported lens models."""
_FIXED: Final = """ORBextractor.nFeatures: 1000
ORBextractor.scaleFactor: 1.2
ORBextractor.nLevels: 8
ORBextractor.iniThFAST: 20
ORBextractor.minThFAST: 7
Viewer.KeyFrameSize: 0.05
Viewer.KeyFrameLineWidth: 1.0
Viewer.GraphLineWidth: 0.9
Viewer.PointSize: 2.0
Viewer.CameraSize: 0.08
Viewer.CameraLineWidth: 3.0
Viewer.ViewpointX: 0.0
Viewer.ViewpointY: -0.7
Viewer.ViewpointZ: -3.5
Viewer.ViewpointF: 500.0
"""
"""Settings of ORB_SLAM3's EuRoC.yaml that the simulation does not determine."""
_CLOSE: Final = 60.0
"""Stereo.ThDepth of ORB_SLAM3's EuRoC.yaml, in baselines."""


def files(subject: Subject) -> dict[str, str]:
    """Return the settings of the IMU, and complete files for one camera and for a pair."""
    rig, texts = subject.rig, {"orb_slam3.yaml": settings(subject.imu)}
    if rig is not None and rig.fits(*KINDS):
        texts["orb_slam3_mono_inertial.yaml"] = complete_settings(rig, 1)
        pair = list(rig.cameras.values())[:2]
        if len(pair) == 2 and len({(lens_kind(c), c.width, c.height) for c in pair}) == 1:
            texts["orb_slam3_stereo_inertial.yaml"] = complete_settings(rig, 2)
    return texts


def settings(values: ImuValues) -> str:
    """Return the IMU's keys of a settings file, without ``IMU.T_b_c1``, which needs a camera."""
    head = comment(
        [
            "ORB_SLAM3, fragment: the IMU's keys, to be pasted into a settings file with cameras; "
            "IMU.T_b_c1 comes with them.",
            "Continuous-time densities, as the simulation has them; it multiplies the noise by the "
            "square root of the frequency itself.",
            *number_notes(values),
        ]
    )
    return f"%YAML:1.0\n{head}{_imu(values)}"


def _imu(values: ImuValues) -> str:
    """Return the lines ``IMU.NoiseGyro`` ... of a settings file."""
    return (
        f"IMU.NoiseGyro: {yaml_float(values.rms_density('gyroscope_noise_density'))}\n"
        f"IMU.NoiseAcc: {yaml_float(values.rms_density('accelerometer_noise_density'))}\n"
        f"IMU.GyroWalk: {yaml_float(values.rms_density('gyroscope_random_walk'))}\n"
        f"IMU.AccWalk: {yaml_float(values.rms_density('accelerometer_random_walk'))}\n"
        f"IMU.Frequency: {yaml_float(values.rate)}\n"
    )


def complete_settings(rig: RigValues, cameras: int) -> str:
    """Return a settings file, mono- or stereo-inertial; all lenses are of one of KINDS.

    ``IMU.T_b_c1`` maps from the first camera to the IMU, ``Stereo.T_c1_c2`` from the second to the
    first.

    :param cameras: number of cameras, 1 or 2.
    """
    names = list(rig.cameras)[:cameras]
    camera = rig.cameras[names[0]]
    head = comment(
        [
            f"ORB_SLAM3, whole, {'mono' if cameras == 1 else 'stereo'}-inertial: lenses, IMU and "
            "their mounts as they are simulated; continuous-time densities.",
            *_lens_remarks(rig, names),
            *rig.remarks(("k3",), cameras),
            *number_notes(rig.imu),
        ]
    )
    text = f'%YAML:1.0\n{head}File.version: "1.0"\n'
    text += f'Camera.type: "{"PinHole" if lens_kind(camera) == "radtan" else "KannalaBrandt8"}"\n'
    for number, name in enumerate(names, 1):
        text += _camera(f"Camera{number}", rig.cameras[name], cameras > 1)
    if cameras > 1:
        text += f"Stereo.ThDepth: {_CLOSE}\n"
        text += f"Stereo.T_c1_c2: {opencv_matrix(rig.between(*names), 'f')}"
    text += (
        f"Camera.width: {camera.width}\nCamera.height: {camera.height}\n"
        f"Camera.fps: {max(1, round(camera.rate))}\nCamera.RGB: 1\n"
        f"IMU.T_b_c1: {opencv_matrix(np.asarray(rig.imu_camera(names[0])), 'f')}"
    )
    return text + _imu(rig.imu) + _FIXED


def _lens_remarks(rig: RigValues, names: list[str]) -> list[str]:
    """Return a remark on the distortion of a second fisheye (Settings.cc, readCamera2)."""
    lenses = [rig.cameras[name] for name in names]
    if (
        lens_kind(lenses[0]) != "equidistant"
        or len({tuple(four_coefficients(lens)) for lens in lenses}) == 1
    ):
        return []
    return [
        "ORB_SLAM3 (1464d8fe5c) reads a second fisheye's distortion from Camera1.k1 to k4, too: "
        "give both cameras the same one, or mend its readCamera2."
    ]


def _camera(prefix: str, camera: CameraParameters, stereo: bool) -> str:
    """Return the lines of one camera in a settings file: intrinsics, distortion, overlap.

    :param prefix: beginning of the keys: Camera1, Camera2.
    :param stereo: True for one of two cameras.
    """
    numbers = dict(zip(("fx", "fy", "cx", "cy"), camera.intrinsics, strict=True))
    if lens_kind(camera) == "equidistant":
        numbers.update(zip(("k1", "k2", "k3", "k4"), four_coefficients(camera), strict=True))
    else:
        numbers.update(zip(("k1", "k2", "p1", "p2"), four_coefficients(camera), strict=True))
        if len(camera.distortion) == 5:
            numbers["k3"] = camera.distortion[4]
    text = "".join(f"{prefix}.{key}: {yaml_float(value)}\n" for key, value in numbers.items())
    if stereo and lens_kind(camera) == "equidistant":
        text += f"{prefix}.overlappingBegin: 0\n{prefix}.overlappingEnd: {camera.width - 1}\n"
    return text
