# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Bias, scale, misalignment, g-sensitivity and temperature from calibration runs.

Imports the leaves and the package above.
"""

from imu_sim_ros.calibration.deterministic import correction
from imu_sim_ros.calibration.deterministic.ellipsoid import (
    Ellipsoid,
    calibrate_magnetometer,
    symmetric_root,
)
from imu_sim_ros.calibration.deterministic.positions import (
    FACES,
    FIXTURES,
    NORM,
    SixPosition,
    calibrate_six_position,
)
from imu_sim_ros.calibration.deterministic.response import AxisResponse
from imu_sim_ros.calibration.deterministic.steady import Steady, find_steady
from imu_sim_ros.calibration.deterministic.temperature import (
    Temperature,
    TriadTemperature,
    calibrate_temperature,
    polynomial_sigma,
    temperatures_at,
)
from imu_sim_ros.calibration.deterministic.turntable import (
    Turntable,
    calibrate_turntable,
    known_rates,
    specific_force,
    true_rates,
)

__all__ = [
    "FACES",
    "FIXTURES",
    "NORM",
    "AxisResponse",
    "Ellipsoid",
    "SixPosition",
    "Steady",
    "Temperature",
    "TriadTemperature",
    "Turntable",
    "calibrate_magnetometer",
    "calibrate_six_position",
    "calibrate_temperature",
    "calibrate_turntable",
    "correction",
    "find_steady",
    "known_rates",
    "polynomial_sigma",
    "specific_force",
    "symmetric_root",
    "temperatures_at",
    "true_rates",
]
