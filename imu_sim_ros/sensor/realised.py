# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""The sensor of one run: the constants that its seed drew, in the places of the parameters."""

import dataclasses
from typing import Any

import numpy as np

from imu_sim_ros.config import ImuParameters, SimulationParameters
from imu_sim_ros.conventions import TRIADS
from imu_sim_ros.sensor.errors import TurnOn, axis_values, scale_misalignment, unit_of_seed


def realised_imu(parameters: SimulationParameters) -> ImuParameters:
    """Return the IMU of this seed with nothing left to draw but the noise.

    Constants that differ from unit to unit are drawn. A turn-on bias is added to the constant one.
    A turn-on scale s, drawn per axis, multiplies the whole response of its axis,
    ``(1 + s + c) (S x + q x^2 + G f)`` with the temperature's part c: it goes into S, q and G, and
    c becomes ``c / (1 + s)``. Readings of the result differ from those of the seed by rounding
    only.
    """
    imu = parameters.imu
    for triad in TRIADS:
        imu = unit_of_seed(imu, triad, parameters.seed)
    changed: dict[str, Any] = {}
    for triad in TRIADS:
        drawn = TurnOn(parameters.seed, triad, imu)
        gain = 1.0 + drawn.scale
        changed[f"{triad}_bias"] = axis_values(imu, triad, "bias") + drawn.bias
        changed[f"{triad}_scale_misalignment"] = gain[:, None] * scale_misalignment(imu, triad)
        changed[f"{triad}_quadratic"] = gain * axis_values(imu, triad, "quadratic")
        thermal = axis_values(imu, triad, "temperature_scale").reshape(-1, 3)
        changed[f"{triad}_temperature_scale"] = thermal / gain
        changed[f"{triad}_scale_error_percent"] = np.zeros(3)
        changed[f"{triad}_misalignment_percent"] = np.zeros(6)
        changed[f"{triad}_turn_on_bias_sigma"] = np.zeros(3)
        changed[f"{triad}_turn_on_scale_sigma"] = np.zeros(3)
        if triad == "gyroscope":
            sensitivity = axis_values(imu, triad, "g_sensitivity").reshape(3, 3)
            changed[f"{triad}_g_sensitivity"] = gain[:, None] * sensitivity
    values: dict[str, Any] = {n: tuple(np.ravel(v).tolist()) for n, v in changed.items()}
    return dataclasses.replace(imu, **values)
