# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""The errors of one triad, in the order given in the docstring of the package above.

Imports the leaves, and faults and random streams from the package above.
"""

from imu_sim_ros.sensor.errors.autoregressive import GaussMarkovBank
from imu_sim_ros.sensor.errors.chunked import ChunkedProcess
from imu_sim_ros.sensor.errors.deterministic import TurnOn
from imu_sim_ros.sensor.errors.drawn import (
    as_matrix,
    unit_of_seed,
    with_constants,
    with_turn_on,
)
from imu_sim_ros.sensor.errors.temperature import TemperatureProfile
from imu_sim_ros.sensor.errors.triad import Reading, Triad
from imu_sim_ros.sensor.errors.variance import (
    accel_variance_discrete,
    field_variance_discrete,
    gyro_variance_discrete,
    pressure_variance_discrete,
)

__all__ = [
    "ChunkedProcess",
    "GaussMarkovBank",
    "Reading",
    "TemperatureProfile",
    "Triad",
    "TurnOn",
    "accel_variance_discrete",
    "as_matrix",
    "field_variance_discrete",
    "gyro_variance_discrete",
    "pressure_variance_discrete",
    "unit_of_seed",
    "with_constants",
    "with_turn_on",
]
