# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""A trajectory against a truth: association, alignment, errors, drift, consistency.

Imports the leaves and the package above.
"""

from imu_sim_ros.navigation.comparison.alignment import ALIGNMENTS, Alignment, align
from imu_sim_ros.navigation.comparison.association import (
    common_rows,
    interpolate_poses,
    interpolate_vectors,
)
from imu_sim_ros.navigation.comparison.consistency import (
    LARGEST_SIGMA,
    Band,
    anees_band,
    attitude_sigma,
    invertible,
    nees,
)
from imu_sim_ros.navigation.comparison.drift import Drift, Truth, drift_from
from imu_sim_ros.navigation.comparison.evaluation import (
    DELTA_UNITS,
    AbsoluteErrors,
    RelativeErrors,
    absolute_errors,
    attitude_errors,
    distances,
    pairs,
    relative_errors,
    statistics,
    tilt_and_heading,
)
from imu_sim_ros.navigation.comparison.gauge import gauge_at_first, without_gauge
from imu_sim_ros.navigation.comparison.stated import stated_nees, why_no_nees
from imu_sim_ros.navigation.comparison.timing import time_offset

__all__ = [
    "ALIGNMENTS",
    "DELTA_UNITS",
    "LARGEST_SIGMA",
    "AbsoluteErrors",
    "Alignment",
    "Band",
    "Drift",
    "RelativeErrors",
    "Truth",
    "absolute_errors",
    "align",
    "anees_band",
    "attitude_errors",
    "attitude_sigma",
    "common_rows",
    "distances",
    "drift_from",
    "gauge_at_first",
    "interpolate_poses",
    "interpolate_vectors",
    "invertible",
    "nees",
    "pairs",
    "relative_errors",
    "stated_nees",
    "statistics",
    "tilt_and_heading",
    "time_offset",
    "why_no_nees",
    "without_gauge",
]
