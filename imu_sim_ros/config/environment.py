# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""What all sensors of a simulation have in common: time, frames, the Earth and the surroundings."""

from collections.abc import Iterator
from dataclasses import dataclass

from imu_sim_ros.config.auxiliary import AtmosphereParameters, MagneticFieldParameters
from imu_sim_ros.config.parameter import (
    Vector,
    choice,
    flag,
    integer,
    number,
    section,
    text,
    vector,
)
from imu_sim_ros.config.temperature import TemperatureParameters
from imu_sim_ros.conventions import BODY_FRAME, GRAVITY, IMU_FRAME, WORLD_FRAME

LONGEST_DURATION = 2.0**31
"""[s] The seconds that the stamps of ROS 2 can count."""
LARGEST_LATITUDE = 85.0
"""[deg] of the origin of a curved world; at the pole longitudes meet."""


@dataclass(frozen=True)
class EnvironmentParameters:
    """Everything that decides the samples but the motion and the sensors themselves."""

    rate: float = number(
        200.0, "samples per second", unit="Hz", minimum=0.0, above_minimum=True, maximum=20000.0
    )
    seed: int = integer(0, "seed of all random streams", minimum=0, maximum=2**63 - 1)
    duration: float = number(
        0.0,
        "length of the run; 0: endless, or the trajectory's own length",
        unit="s",
        minimum=0.0,
        maximum=LONGEST_DURATION,
    )
    start_time: float = number(
        -1.0,
        "stamp of the first sample; -1: the wall clock in a node; in a file the first pose's of a "
        "recorded trajectory, else 1 s",
        unit="s",
        minimum=-1.0,
        maximum=4294967295.0,
    )
    world_frame: str = text(WORLD_FRAME, "frame of the truth's pose")
    body_frame: str = text(BODY_FRAME, "frame of the body, child of the world frame")
    imu_frame: str = text(IMU_FRAME, "frame of the readings")
    gravity: Vector = vector(GRAVITY, "gravity in the world frame", unit="m/s^2")
    gravity_model: str = choice(
        "constant",
        ("constant", "wgs84"),
        "constant: the vector `gravity`; wgs84: normal gravity at `latitude_deg` and `height`",
    )
    latitude_deg: float = number(
        0.0, "geodetic latitude of the world's origin", unit="deg", minimum=-90.0, maximum=90.0
    )
    longitude_deg: float = number(
        0.0, "longitude of the world's origin", unit="deg", minimum=-180.0, maximum=180.0
    )
    height: float = number(
        0.0,
        "height of the world's origin above the ellipsoid",
        unit="m",
        minimum=-12000.0,
        maximum=100000.0,
    )
    earth_rotation: bool = flag(
        False,
        "the world rotates with the Earth: the readings include Earth rate and Coriolis force",
    )
    curved_earth: bool = flag(
        False,
        "the trajectory follows the ellipsoid: x and y are lengths along it, z is height, the "
        "attitude that relative to the local level; the readings include the transport rate, and "
        "gravity varies with the place",
    )
    temperature: TemperatureParameters = section(TemperatureParameters)
    magnetic_field: MagneticFieldParameters = section(MagneticFieldParameters)
    atmosphere: AtmosphereParameters = section(AtmosphereParameters)

    def problems(self, prefix: str) -> Iterator[str]:
        """Say which parameters do not fit each other, a line each."""
        if self.curved_earth:
            yield from self._curved_earth_problems(prefix)
        if self.gravity_model != "constant" and self.gravity != GRAVITY:
            yield (
                f"{prefix}gravity = {self.gravity}: must be omitted "
                f"where gravity_model is {self.gravity_model}"
            )

    def _curved_earth_problems(self, prefix: str) -> Iterator[str]:
        if self.gravity_model != "wgs84":
            yield (
                f"{prefix}gravity_model = {self.gravity_model!r}: must be wgs84 where "
                f"{prefix}curved_earth is true"
            )
        if abs(self.latitude_deg) > LARGEST_LATITUDE:
            yield (
                f"{prefix}latitude_deg = {self.latitude_deg:g}: must be within "
                f"{LARGEST_LATITUDE:g} deg of the equator where {prefix}curved_earth is true"
            )
