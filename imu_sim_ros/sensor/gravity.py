# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""The Earth: normal gravity of WGS84 and the Earth's rotation.

Numbers and formulae: NIMA TR8350.2, "Department of Defense World Geodetic System 1984", third
edition, amendment 1 (2000), tables 3.1, 3.3 and 3.4 and equations 4-1 and 4-3.
"""

import math
from typing import Final

import numpy as np
from numpy.typing import ArrayLike, NDArray

from imu_sim_ros.config import EnvironmentParameters

Array = NDArray[np.float64]

EARTH_RATE: Final = 7.292115e-5
"""[rad/s]"""
SEMI_MAJOR_AXIS: Final = 6378137.0
"""[m]"""
FLATTENING: Final = 1.0 / 298.257223563
ECCENTRICITY_SQUARED: Final = 6.69437999014e-3
_EQUATOR_GRAVITY: Final = 9.7803253359
_SOMIGLIANA_CONSTANT: Final = 0.00193185265241
_CENTRIFUGAL_RATIO: Final = 0.00344978650684


def normal_gravity(latitude: float, height: float) -> float:
    """Return the magnitude of gravity, the centrifugal part included [m/s^2].

    :param latitude: geodetic [rad].
    :param height: above the ellipsoid [m]; the series is of second order, good to 1e-6 m/s^2 below
        10 km.
    """
    return float(gravity_on_ellipsoid(math.sin(latitude) ** 2, height))


def gravity_on_ellipsoid(sine_squared: ArrayLike, height: ArrayLike) -> Array:
    """Return normal gravity (...) [m/s^2] for the squared sine of latitudes, and heights [m]."""
    s, h = np.asarray(sine_squared), np.asarray(height)
    # Somigliana, eq. 4-1
    surface = (
        _EQUATOR_GRAVITY
        * (1.0 + _SOMIGLIANA_CONSTANT * s)
        / np.sqrt(1.0 - ECCENTRICITY_SQUARED * s)
    )
    # eq. 4-3
    a, f, m = SEMI_MAJOR_AXIS, FLATTENING, _CENTRIFUGAL_RATIO
    linear = 2.0 / a * (1.0 + f + m - 2.0 * f * s)
    result: Array = surface * (1.0 - linear * h + 3.0 / a**2 * h**2)
    return result


def gravity_vector(environment: EnvironmentParameters) -> Array:
    """Return g_w (3,) [m/s^2] as set by the parameters; one vector for the whole world."""
    if environment.gravity_model == "constant":
        return np.array(environment.gravity)
    latitude = math.radians(environment.latitude_deg)
    return np.array([0.0, 0.0, -normal_gravity(latitude, environment.height)])


def earth_rate_vector(environment: EnvironmentParameters) -> Array:
    """Return the Earth's rotation omega_ie in the world frame, ENU (3,) [rad/s]; 0 where off."""
    if not environment.earth_rotation:
        return np.zeros(3)
    latitude = math.radians(environment.latitude_deg)
    return EARTH_RATE * np.array([0.0, math.cos(latitude), math.sin(latitude)])
