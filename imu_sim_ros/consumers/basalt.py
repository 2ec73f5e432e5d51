# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Basalt: the calibration JSON (basalt-headers, calibration.hpp, calib_bias.hpp)."""

import json
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from imu_sim_ros.consumers.values import SMALLEST, ImuValues, remarks

Array = NDArray[np.float64]

_EXPRESSED: Final = (
    "gyroscope_bias",
    "accelerometer_bias",
    "gyroscope_scale_misalignment",
    "accelerometer_scale_misalignment",
)
_LOWER: Final = ([0, 1, 2, 1, 2, 2], [0, 0, 0, 1, 1, 2])
"""Rows and columns of the accelerometer's six entries: the lower triangle, column by column."""


def calibration(values: ImuValues) -> str:
    """Return the calibration with the IMU's part filled in, and no camera.

    Basalt corrects a reading as ``x = (I + M) reading - b``, with a full M for the gyroscope and
    the lower triangle for the accelerometer; ``reading = S x + bias`` gives ``I + M = S^-1`` and
    ``b = S^-1 bias``. Densities are continuous, per axis; their inverses are the weights.
    """
    expressed = list(_EXPRESSED)
    accel = np.linalg.inv(values.response("accelerometer"))
    if np.triu(accel, 1).any():
        expressed.remove("accelerometer_scale_misalignment")
    notes = [
        "Basalt calibration, fragment: T_imu_cam, intrinsics and resolution come with cameras.",
        "Continuous-time densities, as the simulation has them; the biases are those of this run.",
        *remarks(values, expressed, per_axis=True, above_zero=True),
    ]
    content: dict[str, Any] = {
        "T_imu_cam": [],
        "intrinsics": [],
        "resolution": [],
        "vignette": [],
        "calib_accel_bias": _static(values, "accelerometer", _LOWER),
        "calib_gyro_bias": _static(values, "gyroscope", np.unravel_index(range(9), (3, 3), "F")),
        "imu_update_rate": values.rate,
        "accel_noise_std": _above_zero(values, "accelerometer_noise_density"),
        "gyro_noise_std": _above_zero(values, "gyroscope_noise_density"),
        "accel_bias_std": _above_zero(values, "accelerometer_random_walk"),
        "gyro_bias_std": _above_zero(values, "gyroscope_random_walk"),
        "cam_time_offset_ns": 0,
        # Members that Basalt does not know are passed over, as those of its own files are.
        "comment": notes,
    }
    return json.dumps({"value0": content}, indent=2) + "\n"


def _static(values: ImuValues, triad: str, places: Any) -> list[float]:
    """Return the static calibration of a triad: b, and the entries of M at the places."""
    inverse = np.linalg.inv(values.response(triad))
    bias = inverse @ values.axes(f"{triad}_bias")
    correction = (inverse - np.eye(3))[places[0], places[1]]
    result: list[float] = [*bias.tolist(), *correction.tolist()]
    return result


def _above_zero(values: ImuValues, name: str) -> list[float]:
    result: list[float] = np.maximum(values.axes(name), SMALLEST).tolist()
    return result
