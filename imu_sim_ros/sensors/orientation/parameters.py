# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Parameters of the orientation that an IMU states: ``imu.orientation_...``."""

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Final

from imu_sim_ros.core.types import field_values
from imu_sim_ros.parameters.kinds import Vector, choice, flag, number, vector
from imu_sim_ros.sensors.parameters import RatedParameters

MODEL_ERRORS: Final = ("turn_on_sigma", "drift_sigma", "noise", "acceleration_sensitivity")
"""Parameters of the source ``model`` alone."""
_AXES = "about the world's east, north and up"


@dataclass(frozen=True)
class OrientationParameters(RatedParameters):
    """Orientation in imu/data: the truth with an error model, or a filter's."""

    source: str = choice(
        "model",
        ("model", "filter"),
        "model: the truth and the errors below; filter: a complementary filter over the readings "
        "of gyroscope, accelerometer and magnetic field",
    )
    rate: float = number(
        0.0, "rate of imu/data, which must divide the IMU's; 0: the IMU's", unit="Hz", minimum=0.0
    )
    turn_on_sigma: Vector = vector(
        0.0,
        f"model: standard deviation of the constant error {_AXES}, drawn from the seed",
        unit="rad",
        minimum=0.0,
        maximum=1.0,
    )
    drift_sigma: Vector = vector(
        0.0,
        f"model: standard deviation of a slow error {_AXES} (first-order Gauss-Markov)",
        unit="rad",
        minimum=0.0,
        maximum=1.0,
    )
    drift_time: float = number(
        100.0,
        "model: correlation time of the slow error",
        unit="s",
        minimum=0.0,
        above_minimum=True,
    )
    noise: Vector = vector(
        0.0,
        f"model: standard deviation of white noise {_AXES}",
        unit="rad",
        minimum=0.0,
        maximum=1.0,
    )
    acceleration_sensitivity: Vector = vector(
        0.0,
        f"model: standard deviation of an error {_AXES} for each m/s^2 of the body's acceleration",
        unit="rad/(m/s^2)",
        minimum=0.0,
        maximum=1.0,
    )
    acceleration_time: float = number(
        1.0,
        "model: correlation time of the error by acceleration",
        unit="s",
        minimum=0.0,
        above_minimum=True,
    )
    time_constant: float = number(
        20.0,
        "filter: time constant above which it follows accelerometer and magnetic field, and "
        "below which it follows the gyroscope",
        unit="s",
        minimum=0.0,
        above_minimum=True,
        maximum=1e4,
    )
    calibrated: bool = flag(
        True,
        "filter: the constant biases, scales, misalignments and iron of this unit are known, as "
        "after a calibration; false: the readings are taken as they are",
    )
    stated_sigma: Vector = vector(
        0.0,
        f"filter: standard deviation {_AXES} that its messages state; 0: unknown",
        unit="rad",
        minimum=0.0,
    )

    def problems(self, prefix: str) -> Iterator[str]:
        """Yield the errors that belong to the other source."""
        if self.source == "filter":
            values = field_values(self)
            for name in MODEL_ERRORS:
                if any(values[name]):
                    yield f"{prefix}{name} = {values[name]}: must be 0 if {prefix}source is filter"


@dataclass(frozen=True)
class OrientationSwitches:
    """Switches of the published topics."""

    orientation: bool = flag(
        False, "publish imu/data, the readings of imu/data_raw with an orientation"
    )
