# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Places on the ellipsoid WGS84: radii, Earth-fixed coordinates, tangent planes."""

import numpy as np

from imu_sim_ros.core.conventions import ECCENTRICITY_SQUARED, SEMI_MAJOR_AXIS
from imu_sim_ros.core.types import Array


def radii_of_curvature(latitude: Array) -> tuple[Array, Array]:
    """Return the radii of the meridian M and of the prime vertical N [m] at latitudes [rad].

    ``M = a (1 - e^2) / (1 - e^2 sin^2)^(3/2)``, ``N = a / sqrt(1 - e^2 sin^2)`` (Groves, 2nd ed.,
    eq. 2.105 and 2.106).
    """
    sine = np.sin(latitude)
    w = 1.0 - ECCENTRICITY_SQUARED * sine * sine
    vertical = SEMI_MAJOR_AXIS / np.sqrt(w)
    return vertical * (1.0 - ECCENTRICITY_SQUARED) / w, vertical


def ecef_of_geodetic(latitude_deg: Array, longitude_deg: Array, height: Array) -> Array:
    """Return Earth-fixed coordinates (n, 3) [m] of places on WGS84 (Groves, 2nd ed., eq. 2.112).

    :param latitude_deg: (n,) geodetic latitudes [deg].
    :param longitude_deg: (n,) longitudes [deg].
    :param height: (n,) heights above the ellipsoid [m].
    """
    phi, lam = np.radians(latitude_deg), np.radians(longitude_deg)
    vertical = radii_of_curvature(phi)[1]
    across = (vertical + height) * np.cos(phi)
    z = ((1.0 - ECCENTRICITY_SQUARED) * vertical + height) * np.sin(phi)
    return np.stack([across * np.cos(lam), across * np.sin(lam), z], axis=-1)


def east_north_up(latitude_deg: Array, longitude_deg: Array) -> Array:
    """Return the Earth-fixed directions of east, north and up (n, 3, 3), a row each."""
    phi, lam = np.radians(latitude_deg), np.radians(longitude_deg)
    zero = np.zeros_like(phi)
    rows = [
        [-np.sin(lam), np.cos(lam), zero],
        [-np.sin(phi) * np.cos(lam), -np.sin(phi) * np.sin(lam), np.cos(phi)],
        [np.cos(phi) * np.cos(lam), np.cos(phi) * np.sin(lam), np.sin(phi)],
    ]
    return np.moveaxis(np.array(rows), -1, 0)


def tangent_plane(geodetic: Array, origin: Array) -> Array:
    """Return places (n, 3) east, north and up of an origin [m].

    :param geodetic: (n, 3) latitudes and longitudes [deg], heights above the ellipsoid [m].
    :param origin: (3,) latitude and longitude [deg], and height [m] of the origin.
    """
    latitude, longitude, height = (np.array([coordinate]) for coordinate in origin)
    difference = ecef_of_geodetic(*geodetic.T) - ecef_of_geodetic(latitude, longitude, height)
    return np.einsum("ij,nj->ni", east_north_up(latitude, longitude)[0], difference)
