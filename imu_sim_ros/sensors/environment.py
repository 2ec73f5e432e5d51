# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Parameters common to all sensors of a simulation: time, frames, the Earth, the surroundings."""

from collections.abc import Iterator
from dataclasses import dataclass
from itertools import pairwise

from imu_sim_ros.core.conventions import ABSOLUTE_ZERO, BODY_FRAME, GRAVITY, IMU_FRAME, WORLD_FRAME
from imu_sim_ros.parameters import kinds
from imu_sim_ros.parameters.kinds import (
    Vector,
    choice,
    flag,
    integer,
    number,
    numbers,
    text,
    vector,
)
from imu_sim_ros.parameters.sections import section
from imu_sim_ros.sensors.parameters import MountedParameters


@dataclass(frozen=True)
class TemperatureParameters:
    """Ambient temperature over time, and how the sensor follows it."""

    value: float = number(
        25.0, "ambient temperature at the start", unit="degC", minimum=ABSOLUTE_ZERO
    )
    profile: tuple[float, ...] = numbers(
        (),
        "time [s] and ambient temperature [degC] alternating, times increasing; the last "
        "one is held",
        unit="s, degC",
        minimum=ABSOLUTE_ZERO,
        group=2,
    )
    interpolation: str = choice(
        "linear",
        ("linear", "steps"),
        "linear: ramps between the entries of the profile; steps: jumps (soak) at their times",
    )
    time_constant: float = number(
        0.0,
        "thermal lag: the sensor follows the ambient temperature with this time constant",
        unit="s",
        minimum=0.0,
    )

    power: float = number(
        0.0,
        "power that the board dissipates from the start on, which warms it up",
        unit="W",
        minimum=0.0,
        maximum=1000.0,
    )
    thermal_resistance: tuple[float, ...] = numbers(
        (60.0, 30.0),
        "thermal resistances of package and board: each warms up by power times resistance",
        unit="K/W",
        minimum=0.0,
        group=2,
    )
    warm_up_time: tuple[float, ...] = numbers(
        (20.0, 300.0),
        "time constants of the warm-up of package and board",
        unit="s",
        minimum=0.0,
        group=2,
    )

    def problems(self, prefix: str) -> Iterator[str]:
        """Say whether the profile and the warm-up can be used."""
        for name, entries in (
            ("thermal_resistance", self.thermal_resistance),
            ("warm_up_time", self.warm_up_time),
        ):
            if len(entries) != 2:
                yield f"{prefix}{name}: must be two numbers, of the package and of the board"
        times = self.profile[::2]
        if times and times[0] < 0.0:
            yield f"{prefix}profile: time {times[0]:g} s: must be at least 0"
        for previous, following in pairwise(times):
            if following <= previous:
                yield (
                    f"{prefix}profile: time {following:g} s after {previous:g} s: "
                    "times must increase"
                )


FIELD: Vector = (0.0, 2.0e-5, -4.5e-5)
"""Magnetic field of mid northern latitudes without declination: 20 uT north, 45 uT down [T]."""


@dataclass(frozen=True)
class AtmosphereParameters:
    """The air of the standard atmosphere, as warm and heavy as the day is."""

    sea_level_pressure: float = number(
        101325.0, "pressure at height 0", unit="Pa", minimum=10000.0, maximum=200000.0
    )
    sea_level_temperature: float = number(
        15.0, "temperature at height 0", unit="degC", minimum=-100.0, maximum=100.0
    )


@dataclass(frozen=True)
class MagneticFieldParameters:
    """The magnetic field of the world: the Earth's, and disturbances in space and time."""

    model: str = choice(
        "constant",
        ("constant", "wmm"),
        "constant: the vector `magnetic_field.value`; wmm: the World Magnetic Model at "
        "`latitude_deg`, `longitude_deg`, `height` and `magnetic_field.date` (needs pygeomag)",
    )
    value: Vector = vector(FIELD, "the Earth's field in the world frame", unit="T")
    date: float = number(
        2026.0,
        "decimal year of the World Magnetic Model",
        unit="year",
        minimum=2010.0,
        maximum=2030.0,
    )
    dipoles: tuple[float, ...] = numbers(
        (),
        "magnetic dipoles at rest in the world: position x, y, z [m] and moment x, y, z [A m^2] "
        "of each",
        unit="m, A m^2",
        group=6,
    )
    dipole_radius: float = number(
        0.05,
        "radius of each dipole, a uniformly magnetised sphere: the field inside is constant",
        unit="m",
        minimum=0.0,
        above_minimum=True,
        maximum=1000.0,
    )
    alternating: Vector = vector(
        0.0, "amplitude of an alternating field in the world, such as that of power lines", unit="T"
    )
    alternating_frequency: float = number(
        50.0,
        "frequency of the alternating field",
        unit="Hz",
        minimum=0.0,
        above_minimum=True,
        maximum=1e6,
    )

    def problems(self, prefix: str) -> Iterator[str]:
        """Say whether two fields are given."""
        if self.model != "constant" and self.value != FIELD:
            yield (
                f"{prefix}value = {self.value}: must be omitted where {prefix}model is {self.model}"
            )


LONGEST_DURATION = 2.0**31
"""Seconds that the stamps of ROS 2 can count [s]."""
LARGEST_LATITUDE = 85.0
"""Largest latitude of the origin of a curved world; at the pole longitudes meet [deg]."""


@dataclass(frozen=True)
class EnvironmentParameters(MountedParameters):
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
        "stamp of the first sample; -1: in a node the wall clock, in a file the stamp of the "
        "first pose of a recorded trajectory, or else 1 s",
        unit="s",
        minimum=-1.0,
        maximum=4294967295.0,
    )
    world_frame: str = text(WORLD_FRAME, "frame of the truth's pose")
    body_frame: str = text(BODY_FRAME, "frame of the body, child of the world frame")
    imu_frame: str = text(IMU_FRAME, "frame of the readings")
    gravity: Vector = kinds.gravity("gravity in the world frame")
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
        "the trajectory follows the ellipsoid: x and y are lengths along it, z is height, and "
        "the attitude is relative to the local level; the readings include the transport rate, "
        "and gravity varies with the position",
    )
    temperature: TemperatureParameters = section(TemperatureParameters)
    magnetic_field: MagneticFieldParameters = section(MagneticFieldParameters)
    atmosphere: AtmosphereParameters = section(AtmosphereParameters)

    def problems(self, prefix: str) -> Iterator[str]:
        """Yield a line for each parameter that does not fit another one."""
        if self.curved_earth:
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
        if self.gravity_model != "constant" and self.gravity != GRAVITY:
            yield (
                f"{prefix}gravity = {self.gravity}: must be omitted "
                f"where gravity_model is {self.gravity_model}"
            )
