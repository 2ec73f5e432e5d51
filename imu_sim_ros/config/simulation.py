# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Parameters of a simulation: what the simulator node and the command generate have in common."""

import math
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass

from imu_sim_ros.config.auxiliary import AtmosphereParameters, MagneticFieldParameters
from imu_sim_ros.config.files import build_layered, layer
from imu_sim_ros.config.imu import ImuParameters
from imu_sim_ros.config.parameter import (
    Vector,
    choice,
    flag,
    integer,
    number,
    section,
    text,
    variant,
    vector,
)
from imu_sim_ros.config.temperature import TemperatureParameters
from imu_sim_ros.config.trajectory import TrajectoryParameters, find_trajectory
from imu_sim_ros.conventions import BODY_FRAME, GRAVITY, IMU_FRAME, TRIADS, WORLD_FRAME
from imu_sim_ros.timebase import exact_rate

DEFAULT_IMU = "lecture"
DEFAULT_TRAJECTORY = "lecture"
LONGEST_DURATION = 2.0**31
"""[s] The seconds that the stamps of ROS 2 can count."""
LARGEST_JITTER = 0.25
"""The largest standard deviation of the stamps, in intervals between two samples."""

_LOWEST_CUTOFF = 1e-6
"""Of half the rate; a low-pass far below it has no digits left."""

LARGEST_LATITUDE = 85.0
"""[deg] of the origin of a curved world; at the pole longitudes meet."""


@dataclass(frozen=True)
class SimulationParameters:
    """Everything that decides the samples."""

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
    trajectory: TrajectoryParameters = variant("type", "static", find_trajectory)
    imu: ImuParameters = section(ImuParameters)

    def problems(self, prefix: str) -> Iterator[str]:
        """Say which parameters do not fit the rate or each other, a line each."""
        ratio = self.imu.internal_ratio(self.rate)
        if ratio.denominator != 1 or (self.imu.sampling == "oversampled" and ratio < 2):
            yield (
                f"{prefix}imu.internal_rate = {self.imu.internal_rate:g}: must be an integer "
                f"multiple of the rate, {self.rate:g} Hz, at least twice the rate"
            )
        nyquist = 0.5 * self.rate * float(ratio)
        for triad in TRIADS:
            cutoff = max(self.imu.triad(triad).bandwidth)
            least = min((one for one in self.imu.triad(triad).bandwidth if one), default=nyquist)
            if least < _LOWEST_CUTOFF * nyquist:
                yield (
                    f"{prefix}imu.{triad}_bandwidth = {least:g}: must be 0 or at least "
                    f"{_LOWEST_CUTOFF * nyquist:g} Hz at this rate"
                )
            if cutoff >= nyquist:
                yield (
                    f"{prefix}imu.{triad}_bandwidth = {cutoff:g}: must be below half the "
                    f"{'rate' if ratio == 1 else 'internal rate'}, {nyquist:g} Hz"
                )
        if self.imu.jitter * self.rate > LARGEST_JITTER:
            yield (
                f"{prefix}imu.jitter = {self.imu.jitter:g}: must be at most a quarter of the "
                f"interval, {LARGEST_JITTER / self.rate:g} s"
            )
        if self.curved_earth:
            yield from self._curved_earth_problems(prefix)
        of_orientation = self.imu.orientation.rate
        if of_orientation and (exact_rate(self.rate) / exact_rate(of_orientation)).denominator != 1:
            yield (
                f"{prefix}imu.orientation_rate = {of_orientation:g}: must divide the rate, "
                f"{self.rate:g} Hz"
            )
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

    def warnings(self) -> list[str]:
        """Return a line for each allowed value that looks like a mistake."""
        return list(self.imu.warnings("imu.", math.hypot(*self.gravity)))


def load_simulation(*layers: Mapping[str, object], node: str = "simulator") -> SimulationParameters:
    """Return the simulation that layers of parameters describe, later ones above earlier ones.

    :raises ConfigurationError: with a line for each problem.
    """
    given: dict[str, object] = {}
    for values in layers:
        given.update(values)
    return build_layered(
        SimulationParameters, lambda values: layer_simulation([values], node), given
    )


def layer_simulation(layers: Iterable[Mapping[str, object]], node: str) -> dict[str, object]:
    """Return the layers as one, above the IMU preset and the trajectory file that they name."""
    return layer(layers, DEFAULT_IMU, DEFAULT_TRAJECTORY, node)
