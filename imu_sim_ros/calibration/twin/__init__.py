# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""The digital twin of a sensor on its vehicle, from a recording in motion with a true trajectory.

``fit`` finds the constant errors and their uncertainty, ``analysis`` what is left: lines, bands and
a white floor, and how they follow the motion. Works on arrays and on a function that gives the
body's motion at any time, so it knows neither splines nor simulations. Imports the leaves.
"""

from imu_sim_ros.calibration.twin import comparison, intensity, model, pose_noise, truth
from imu_sim_ros.calibration.twin.alignment import coarse_offset, mounting
from imu_sim_ros.calibration.twin.analysis import (
    Analysis,
    analyse,
    constant_errors,
    foreseen,
    noise_residuals,
)
from imu_sim_ros.calibration.twin.fit import PRIOR, Fit, Recording
from imu_sim_ros.calibration.twin.model import BodyMotion, Errors, Truth, perfect, readings
from imu_sim_ros.calibration.twin.parameters import (
    MOTION_FLOOR,
    MOTION_TIME,
    clock_offset,
    clock_skew,
    simulator_parameters,
)

__all__ = [
    "MOTION_FLOOR",
    "MOTION_TIME",
    "PRIOR",
    "Analysis",
    "BodyMotion",
    "Errors",
    "Fit",
    "Recording",
    "Truth",
    "analyse",
    "clock_offset",
    "clock_skew",
    "coarse_offset",
    "comparison",
    "constant_errors",
    "foreseen",
    "intensity",
    "model",
    "mounting",
    "noise_residuals",
    "perfect",
    "pose_noise",
    "readings",
    "simulator_parameters",
    "truth",
]
