# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Allan analysis: noise parameters with confidence intervals from a record at rest.

Imports the leaves and the package above.
"""

from imu_sim_ros.calibration.noise import noise_files, truth
from imu_sim_ros.calibration.noise.analysis import MODELS, AllanResult, analyse
from imu_sim_ros.calibration.noise.deviation import Deviation, DeviationAccumulator
from imu_sim_ros.calibration.noise.estimate import RAMP, Estimate
from imu_sim_ros.calibration.noise.gauss_markov import CORRELATION_TIME, SIGMA
from imu_sim_ros.calibration.noise.terms import TERMS, gauss_markov_deviation, ramp_deviation
from imu_sim_ros.calibration.noise.truth import load_truth
from imu_sim_ros.calibration.noise.units import quantity

__all__ = [
    "CORRELATION_TIME",
    "MODELS",
    "RAMP",
    "SIGMA",
    "TERMS",
    "AllanResult",
    "Deviation",
    "DeviationAccumulator",
    "Estimate",
    "analyse",
    "gauss_markov_deviation",
    "load_truth",
    "noise_files",
    "quantity",
    "ramp_deviation",
    "truth",
]
