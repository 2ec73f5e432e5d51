# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""The magnetic field of the world at a place and time: the Earth's, and what disturbs it."""

import math
from typing import Final

import numpy as np
from numpy.typing import NDArray

from imu_sim_ros.config import EnvironmentParameters
from imu_sim_ros.errors import ConfigurationError, MissingDependencyError

Array = NDArray[np.float64]

MU0_OVER_4_PI: Final = 1e-7
"""[T m/A]; the value measured in the SI of 2019 agrees to nine digits."""
_FILES: Final = ((2025.0, "WMM_2025"), (2020.0, "WMM_2020"), (2015.0, "WMM_2015v2"))
_OLDEST: Final = "WMM_2010"


class MagneticField:
    """The field in the world frame, ENU; one vector of the Earth for the whole world."""

    def __init__(self, environment: EnvironmentParameters) -> None:
        """Take the field that the parameters describe.

        :raises ConfigurationError: for a place or date beyond the World Magnetic Model.
        :raises MissingDependencyError: where pygeomag is missing.
        """
        p = environment.magnetic_field
        self.earth_w = (
            np.array(p.value) if p.model == "constant" else world_magnetic_model(environment)
        )
        """(3,) [T]."""
        dipoles = np.reshape(p.dipoles, (-1, 6))
        self._dipoles = [(row[:3, None], row[3:, None]) for row in dipoles]
        self._radius = p.dipole_radius
        self._alternating = np.array(p.alternating)[:, None]
        self._angular_frequency = 2.0 * math.pi * p.alternating_frequency

    def at(self, t: Array, position: Array) -> Array:
        """Return the field (3, n) [T] at times t (n,) [s] and places (3, n) [m] in the world.

        A dipole m at a distance r: ``mu_0 / (4 pi r^3) (3 (m r) r / r^2 - m)`` (Jackson, "Classical
        Electrodynamics", 3rd ed., eq. 5.56); inside its sphere of radius R, ``mu_0 m / (2 pi R^3)``
        (eq. 5.105 with the magnetisation ``m / (4 pi R^3 / 3)``).
        """
        field = np.empty((3, len(t)))
        field[:] = self.earth_w[:, None]
        for place, moment in self._dipoles:
            field += self._dipole(position - place, moment)
        if self._alternating.any():
            field += self._alternating * np.sin(self._angular_frequency * t)
        return field

    def _dipole(self, r: Array, moment: Array) -> Array:
        squared = r[0] * r[0] + r[1] * r[1] + r[2] * r[2]
        inside = squared < self._radius**2
        squared = np.where(inside, 1.0, squared)
        along = 3.0 * (moment[0] * r[0] + moment[1] * r[1] + moment[2] * r[2]) / squared
        outside = MU0_OVER_4_PI * (along * r - moment) / (squared * np.sqrt(squared))
        return np.where(inside, 2.0 * MU0_OVER_4_PI * moment / self._radius**3, outside)


def world_magnetic_model(environment: EnvironmentParameters) -> Array:
    """Return the Earth's field at the world's origin, ENU (3,) [T].

    The World Magnetic Model of NOAA and BGS, as pygeomag computes it: north, east and down in nT.

    :raises ConfigurationError: for a place or date beyond the model.
    :raises MissingDependencyError: where pygeomag is missing.
    """
    try:
        from pygeomag import GeoMag
    except ImportError:
        raise MissingDependencyError(
            "magnetic_field.model = wmm needs pygeomag: pip install pygeomag "
            "(there is no apt package)"
        ) from None
    date = environment.magnetic_field.date
    name = next((name for year, name in _FILES if date >= year), _OLDEST)
    try:
        found = GeoMag(coefficients_file=f"wmm/{name}.COF").calculate(
            glat=environment.latitude_deg,
            glon=environment.longitude_deg,
            alt=environment.height * 1e-3,
            time=date,
        )
    except (OSError, ValueError) as error:
        raise ConfigurationError(f"magnetic_field.model = wmm: {error}") from None
    return np.array([found.y, found.x, -found.z]) * 1e-9
