# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Preintegrated readings between two frames, and the residuals that a smoother forms from them.

Imports the leaves and the package above.
"""

from imu_sim_ros.navigation.preintegration.deltas import (
    METHODS,
    Deltas,
    Preintegration,
    corrected,
    preintegrate,
    repropagated,
)
from imu_sim_ros.navigation.preintegration.intervals import Readings, between
from imu_sim_ros.navigation.preintegration.residuals import (
    ImuResidual,
    Poses,
    ReprojectionResidual,
    States,
    imu_residual,
    reprojection_residual,
)

__all__ = [
    "METHODS",
    "Deltas",
    "ImuResidual",
    "Poses",
    "Preintegration",
    "Readings",
    "ReprojectionResidual",
    "States",
    "between",
    "corrected",
    "imu_residual",
    "preintegrate",
    "reprojection_residual",
    "repropagated",
]
