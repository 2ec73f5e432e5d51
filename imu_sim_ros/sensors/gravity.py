# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Gravity and the rotation of the Earth, flat and with the Earth's curvature for long flights."""

import math
from typing import Final, NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from imu_sim_ros.core.conventions import ECCENTRICITY_SQUARED, FLATTENING, SEMI_MAJOR_AXIS
from imu_sim_ros.core.geodesy import radii_of_curvature
from imu_sim_ros.core.rotation import cross, rotate_inverse
from imu_sim_ros.core.types import Array
from imu_sim_ros.sensors.environment import EnvironmentParameters
from imu_sim_ros.trajectory.motion import Motion

EARTH_RATE: Final = 7.292115e-5
"""Rotation rate of the Earth (WGS84) [rad/s]."""
_GEODETIC_STEPS: Final = 5
"""Number of iterations from Cartesian to geodetic coordinates."""
_EQUATOR_GRAVITY: Final = 9.7803253359
"""Normal gravity at the equator of WGS 84 [m/s^2]."""
_SOMIGLIANA_CONSTANT: Final = 0.00193185265241
"""Somigliana's constant k of WGS 84."""
_CENTRIFUGAL_RATIO: Final = 0.00344978650684
"""Ratio m of centrifugal acceleration and gravity at the equator of WGS 84."""


def normal_gravity(latitude: float, height: float) -> float:
    """Return the magnitude of gravity, the centrifugal part included [m/s^2].

    :param latitude: geodetic latitude [rad].
    :param height: height above the ellipsoid [m]; the series is of second order, good to
        1e-6 m/s^2 below 10 km.
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
    return surface * (1.0 - linear * h + 3.0 / a**2 * h**2)


def gravity_vector(environment: EnvironmentParameters) -> Array:
    """Return g_w (3,) [m/s^2] as set by the parameters; one vector for the whole world."""
    if environment.gravity_model == "constant":
        return np.array(environment.gravity)
    latitude = math.radians(environment.latitude_deg)
    return np.array([0.0, 0.0, -normal_gravity(latitude, environment.height)])


def earth_rate_vector(environment: EnvironmentParameters) -> Array:
    """Return the Earth's rotation omega_ie in the world frame, ENU (3,) [rad/s]; 0 if off."""
    if not environment.earth_rotation:
        return np.zeros(3)
    latitude = math.radians(environment.latitude_deg)
    return EARTH_RATE * np.array([0.0, math.cos(latitude), math.sin(latitude)])


class GeodeticPosition(NamedTuple):
    """Position of a body on the Earth; all (n,)."""

    latitude: Array
    """Geodetic latitude [rad]."""
    longitude: Array
    """Longitude, not wrapped to +-pi [rad]."""
    height: Array
    """Height above the ellipsoid [m]."""


class OverGround(NamedTuple):
    """Motion over ground, resolved in east, north, up at the place; all (n, 3)."""

    velocity: Array
    """Velocity [m/s]."""
    acceleration: Array
    """Derivative of the velocity's components [m/s^2]."""
    transport_rate: Array
    """Rotation of east, north, up relative to the Earth, omega_en [rad/s]."""
    transport_acceleration: Array
    """Derivative of the transport rate's components [rad/s^2]."""
    earth_rate: Array
    """Rotation of the Earth, omega_ie; 0 if the world does not rotate [rad/s]."""
    gravity: Array
    """Gravity [m/s^2]."""


class CurvedEarth:
    """WGS84 along a trajectory: positions, gravity, and rotation for an IMU."""

    def __init__(self, environment: EnvironmentParameters) -> None:
        """Initialise with the origin of the world."""
        latitude, height = math.radians(environment.latitude_deg), environment.height
        meridian, vertical = radii_of_curvature(np.array([latitude]))
        self._latitude, self._height = latitude, height
        self._longitude = math.radians(environment.longitude_deg)
        self._north = float(meridian[0]) + height
        self._east = (float(vertical[0]) + height) * math.cos(latitude)
        self._earth_rate = EARTH_RATE if environment.earth_rotation else 0.0

    def geodetic(self, position: Array) -> GeodeticPosition:
        """Return latitude, longitude and height of positions (n, 3) in the world."""
        x, y, z = position.T
        return GeodeticPosition(
            self._latitude + y / self._north, self._longitude + x / self._east, self._height + z
        )

    def over_ground(self, motion: Motion) -> OverGround:
        """Return a motion of the world's coordinates as motion over ground.

        With the radii M, N and latitude phi, longitude lambda, height h (Groves, 2nd ed., eq. 2.111
        and 5.44)::

            v_n = ((N + h) cos phi lambda', (M + h) phi', h')
            omega_en = (-phi', lambda' cos phi, lambda' sin phi)

        and their derivatives, with ``d((N + h) cos phi) / dphi = -(M + h) sin phi``.
        """
        phi, _, h = self.geodetic(motion.position)
        sine, cosine = np.sin(phi), np.cos(phi)
        meridian, vertical = radii_of_curvature(phi)
        north, east = meridian + h, (vertical + h) * cosine
        v, a = motion.velocity.T, motion.acceleration.T
        lon_1, lat_1, h_1 = v[0] / self._east, v[1] / self._north, v[2]
        lon_2, lat_2, h_2 = a[0] / self._east, a[1] / self._north, a[2]
        curving = 3.0 * meridian * ECCENTRICITY_SQUARED * sine * cosine  # dM/dphi, with the next
        curving /= 1.0 - ECCENTRICITY_SQUARED * sine * sine
        zero = np.zeros_like(phi)
        return OverGround(
            velocity=_vectors(east * lon_1, north * lat_1, h_1),
            acceleration=_vectors(
                east * lon_2 + (h_1 * cosine - north * sine * lat_1) * lon_1,
                north * lat_2 + (h_1 + curving * lat_1) * lat_1,
                h_2,
            ),
            transport_rate=_vectors(-lat_1, lon_1 * cosine, lon_1 * sine),
            transport_acceleration=_vectors(
                -lat_2,
                lon_2 * cosine - lon_1 * lat_1 * sine,
                lon_2 * sine + lon_1 * lat_1 * cosine,
            ),
            earth_rate=self._earth_rate * _vectors(zero, cosine, sine),
            gravity=_vectors(zero, zero, -gravity_on_ellipsoid(sine * sine, h)),
        )

    def read(self, motion: Motion, arm_b: Array) -> tuple[Array, Array]:
        """Return angular rate and specific force in the body frame, both (n, 3).

        ``omega_ib = omega_nb + omega_en + omega_ie`` and
        ``f = v_n' + (2 omega_ie + omega_en) x v_n - g_n`` (Groves, 2nd ed., eq. 5.53), at a lever
        arm r with ``alpha x r + omega x (omega x r)`` and Coriolis' ``2 omega_ie x (omega x r)`` of
        the body's rotation relative to the Earth, omega = omega_nb + omega_en.

        :param arm_b: (3,) lever arm [m].
        """
        ground = self.over_ground(motion)
        q_wb = motion.q_wb
        turning = ground.transport_rate + 2.0 * ground.earth_rate
        force_n = ground.acceleration + cross(turning, ground.velocity) - ground.gravity
        force = rotate_inverse(q_wb, force_n)
        body_rate = motion.angular_velocity
        transport = rotate_inverse(q_wb, ground.transport_rate)
        earth_rate = rotate_inverse(q_wb, ground.earth_rate)
        rate = body_rate + transport
        if arm_b.any():
            change = motion.angular_acceleration - cross(body_rate, transport)
            change += rotate_inverse(q_wb, ground.transport_acceleration)
            swing = cross(rate, arm_b)
            force += cross(change, arm_b) + cross(rate, swing) + 2.0 * cross(earth_rate, swing)
        return rate + earth_rate, force


def _vectors(x: Array, y: Array, z: Array) -> Array:
    """Return vectors (n, 3) of components (n,)."""
    result = np.empty((*x.shape, 3), order="F")
    for k, component in enumerate((x, y, z)):
        result[:, k] = component
    return result


def geodetic(environment: EnvironmentParameters, position: Array) -> tuple[Array, Array, Array]:
    """Return latitudes [deg], longitudes [deg, -180 to 180] and heights [m] of places (n, 3).

    On a curved Earth the world's coordinates follow the ellipsoid (:class:`CurvedEarth`). A flat
    world is Cartesian, with east, north and up of its origin; the ellipsoid curves below it.
    """
    if environment.curved_earth:
        latitude, longitude, height = CurvedEarth(environment).geodetic(position)
    else:
        latitude, longitude, height = _tangent_plane_to_geodetic(environment, position)
    turned = np.remainder(np.degrees(longitude) + 180.0, 360.0) - 180.0
    return np.degrees(latitude), turned, height


def _tangent_plane_to_geodetic(
    environment: EnvironmentParameters, position: Array
) -> GeodeticPosition:
    """Return places on WGS84 of Cartesian coordinates east, north, up (n, 3)."""
    phi, lam = math.radians(environment.latitude_deg), math.radians(environment.longitude_deg)
    sine, cosine = math.sin(phi), math.cos(phi)
    vertical = SEMI_MAJOR_AXIS / math.sqrt(1.0 - ECCENTRICITY_SQUARED * sine * sine)
    east, north, up = position.T
    out = (vertical + environment.height) * cosine - sine * north + cosine * up
    z = (vertical * (1.0 - ECCENTRICITY_SQUARED) + environment.height) * sine
    z = z + cosine * north + sine * up
    longitude = lam + np.arctan2(east, out)
    across = np.hypot(out, east)
    # Fixed point of tan(phi) = (z + e^2 N sin(phi)) / p: each step is 150 times better.
    latitude = np.arctan2(z, across * (1.0 - ECCENTRICITY_SQUARED))
    for _ in range(_GEODETIC_STEPS):
        s = np.sin(latitude)
        n = SEMI_MAJOR_AXIS / np.sqrt(1.0 - ECCENTRICITY_SQUARED * s * s)
        latitude = np.arctan2(z + ECCENTRICITY_SQUARED * n * s, across)
    s, c = np.sin(latitude), np.cos(latitude)
    w = np.sqrt(1.0 - ECCENTRICITY_SQUARED * s * s)
    return GeodeticPosition(latitude, longitude, across * c + z * s - SEMI_MAJOR_AXIS * w)
