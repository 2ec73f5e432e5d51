# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Parameters of the world around the body that magnetometer and barometer measure."""

from collections.abc import Iterator
from dataclasses import dataclass

from imu_sim_ros.config.parameter import Vector, choice, number, numbers, vector

FIELD: Vector = (0.0, 2.0e-5, -4.5e-5)
"""[T] Of mid northern latitudes, without declination: 20 uT to the north, 45 uT down."""


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
    """The magnetic field of the world: the Earth's, and what disturbs it in place and time."""

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
