# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Basalt: the calibration JSON (basalt-headers, calibration.hpp, calib_bias.hpp)."""

import math
from collections.abc import Sequence
from typing import Final

import numpy as np

from imu_sim_ros.core import rotation
from imu_sim_ros.core.types import Array
from imu_sim_ros.datasets.consumers.rig import RigValues, four_coefficients, lens_kind
from imu_sim_ros.datasets.consumers.subject import Subject
from imu_sim_ros.datasets.consumers.values import SMALLEST, ImuValues, number_notes
from imu_sim_ros.sensors.camera.parameters import CameraParameters
from imu_sim_ros.terminal.json_text import json_text

_EXPRESSED: Final = (
    "gyroscope_bias",
    "accelerometer_bias",
    "gyroscope_scale_misalignment",
    "accelerometer_scale_misalignment",
)
_KNOT_DISTANCE: Final = 50.0
"""Distance between the knots of a vignette [px]."""
_LOWER: Final = ([0, 1, 2, 1, 2, 2], [0, 0, 0, 1, 1, 2])
"""Rows and columns of the accelerometer's six entries: the lower triangle, column by column."""
_ALL: Final = ([0, 1, 2, 0, 1, 2, 0, 1, 2], [0, 0, 0, 1, 1, 1, 2, 2, 2])
"""Rows and columns of the gyroscope's nine entries, column by column."""


def files(subject: Subject) -> dict[str, str]:
    """Return the calibration, with cameras if there are some."""
    return {"basalt_calibration.json": calibration(subject.imu, subject.rig)}


def calibration(values: ImuValues, rig: RigValues | None = None) -> str:
    """Return the calibration: whole with the cameras of a rig, else with the IMU's part alone.

    Basalt corrects a reading as ``x = (I + M) reading - b``, with a full M for the gyroscope and
    the lower triangle for the accelerometer; ``reading = S x + bias`` gives ``I + M = S^-1`` and
    ``b = S^-1 bias``. Densities are continuous, per axis; their inverses are the weights.
    """
    expressed = list(_EXPRESSED)
    accel = np.linalg.inv(values.response("accelerometer"))
    if np.triu(accel, 1).any():
        expressed.remove("accelerometer_scale_misalignment")
    cameras = rig.cameras if rig is not None else {}
    if cameras:
        expressed.append("stamp_offset")
    notes = [
        "Basalt calibration, whole: cameras and IMU as they are simulated."
        if cameras
        else "Basalt calibration, fragment: T_imu_cam, intrinsics, resolution come with cameras.",
        "Continuous-time densities, as the simulation has them; the biases are those of this run.",
        *number_notes(values, expressed, per_axis=True, above_zero=True),
    ]
    if rig is not None:
        notes += rig.remarks(("time_offset", "k3", "vignetting"), one_shift="Basalt")
    lenses = [_lens(camera) for camera in cameras.values()]
    if any(lens["camera_type"] == "pinhole-radtan8" for lens in lenses):
        notes.append("pinhole-radtan8 needs a Basalt that supports it; versions of 2021 do not.")
    content: dict[str, object] = {
        "T_imu_cam": [_pose(rig.imu_camera(name)) for name in cameras] if rig else [],
        "intrinsics": lenses,
        "resolution": [[camera.width, camera.height] for camera in cameras.values()],
        "vignette": [_vignette(camera) for camera in cameras.values()]
        if any(camera.vignetting for camera in cameras.values())
        else [],
        "calib_accel_bias": _static(values, "accelerometer", _LOWER),
        "calib_gyro_bias": _static(values, "gyroscope", _ALL),
        "imu_update_rate": values.rate,
        "accel_noise_std": _above_zero(values, "accelerometer_noise_density"),
        "gyro_noise_std": _above_zero(values, "gyroscope_noise_density"),
        "accel_bias_std": _above_zero(values, "accelerometer_random_walk"),
        "gyro_bias_std": _above_zero(values, "gyroscope_random_walk"),
        # Basalt has one time offset for the stamps of all images.
        "cam_time_offset_ns": next(
            (round(rig.time_shift(name) * 1e9) for name in cameras) if rig else iter(()), 0
        ),
        # Basalt ignores unknown members.
        "comment": notes,
    }
    return json_text({"value0": content}, indent=2) + "\n"


def _pose(matrix: Array) -> dict[str, float]:
    """Return a rigid motion (4, 4) in Basalt's terms."""
    w, x, y, z = rotation.from_matrix(matrix[:3, :3]).tolist()
    position = zip(("px", "py", "pz"), matrix[:3, 3].tolist(), strict=True)
    return {**dict(position), "qx": x, "qy": y, "qz": z, "qw": w}


def _lens(camera: CameraParameters) -> dict[str, object]:
    """Return a camera's model in Basalt's terms (basalt/camera/*.hpp).

    Mei's sphere without distortion is its ``ucm`` with ``alpha = xi / (1 + xi)`` and focal lengths
    divided by ``1 + xi``; with distortion Basalt has none, and the model is written without it.
    """
    fx, fy, cx, cy = camera.intrinsics
    center: dict[str, float] = {"fx": fx, "fy": fy, "cx": cx, "cy": cy}
    k = four_coefficients(camera)
    match lens_kind(camera):
        case "equidistant":
            return _model("kb4", {**center, "k1": k[0], "k2": k[1], "k3": k[2], "k4": k[3]})
        case "double_sphere":
            return _model("ds", {**center, "xi": camera.xi, "alpha": camera.alpha})
        case "unified":
            divisor = 1.0 + camera.xi
            scaled = {"fx": fx / divisor, "fy": fy / divisor, "alpha": camera.xi / divisor}
            return _model("ucm", {**center, **scaled})
    if not any(camera.distortion):
        return _model("pinhole", center)
    k3 = camera.distortion[4] if len(camera.distortion) == 5 else 0.0
    radtan = {"k1": k[0], "k2": k[1], "p1": k[2], "p2": k[3], "k3": k3}
    rest = {"k4": 0.0, "k5": 0.0, "k6": 0.0, "rpmax": 0.0}
    return _model("pinhole-radtan8", {**center, **radtan, **rest})


def _vignette(camera: CameraParameters) -> dict[str, object]:
    """Return the share of light over the distance from the principal point, as Basalt's spline.

    Its argument is the distance in pixels times 1e9 (calibration.hpp). A uniform cubic B-spline
    with the coefficients ``1 - a (x^2 - d^2 / 3)``, d apart from -d on, is ``1 - a x^2``.
    """
    _, _, cx, cy = camera.intrinsics
    corner = math.hypot(max(cx, camera.width - 1 - cx), max(cy, camera.height - 1 - cy))
    places = _KNOT_DISTANCE * np.arange(-1.0, math.floor(corner / _KNOT_DISTANCE) + 3.0)
    squares = places**2 - _KNOT_DISTANCE**2 / 3.0
    shares = 1.0 - camera.vignetting * squares / corner**2
    return {
        "value0": 0,
        "value1": round(_KNOT_DISTANCE * 1e9),
        "value2": [[share] for share in shares.tolist()],
    }


def _model(name: str, intrinsics: dict[str, float]) -> dict[str, object]:
    """Return a camera model as Basalt's calibration has it."""
    return {"camera_type": name, "intrinsics": intrinsics}


def _static(
    values: ImuValues, triad: str, indices: tuple[Sequence[int], Sequence[int]]
) -> list[float]:
    """Return the static calibration of a triad: the bias b, and entries of M at indices."""
    inverse = np.linalg.inv(values.response(triad))
    bias = inverse @ values.axes(f"{triad}_bias")
    correction = (inverse - np.eye(3))[indices]
    return [*bias.tolist(), *correction.tolist()]


def _above_zero(values: ImuValues, name: str) -> list[float]:
    """Return a density per axis (3,), at least the smallest that the estimator accepts."""
    return np.maximum(values.filter_axes(name), SMALLEST).tolist()
