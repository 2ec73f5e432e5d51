# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""What is made of readings: dead reckoning, preintegration, and their comparison with a truth.

Works on arrays and knows neither bags nor nodes. Imports the leaves.
"""

from imu_sim_ros.navigation import initialisation
from imu_sim_ros.navigation.comparison import (
    ALIGNMENTS,
    AbsoluteErrors,
    Alignment,
    Band,
    Drift,
    RelativeErrors,
    Truth,
    absolute_errors,
    align,
    anees_band,
    attitude_errors,
    common_rows,
    distances,
    drift_from,
    interpolate_poses,
    interpolate_vectors,
    nees,
    pairs,
    relative_errors,
    statistics,
    time_offset,
)
from imu_sim_ros.navigation.correction import correction_of
from imu_sim_ros.navigation.initialisation import Initial
from imu_sim_ros.navigation.noise import noise_of
from imu_sim_ros.navigation.preintegration import Preintegration
from imu_sim_ros.navigation.state import NavigationState, NavigationStates
from imu_sim_ros.navigation.strapdown import Counts, Stepper, dead_reckon

__all__ = [
    "ALIGNMENTS",
    "AbsoluteErrors",
    "Alignment",
    "Band",
    "Counts",
    "Drift",
    "Initial",
    "NavigationState",
    "NavigationStates",
    "Preintegration",
    "RelativeErrors",
    "Stepper",
    "Truth",
    "absolute_errors",
    "align",
    "anees_band",
    "attitude_errors",
    "common_rows",
    "correction_of",
    "dead_reckon",
    "distances",
    "drift_from",
    "initialisation",
    "interpolate_poses",
    "interpolate_vectors",
    "nees",
    "noise_of",
    "pairs",
    "relative_errors",
    "statistics",
    "time_offset",
]
