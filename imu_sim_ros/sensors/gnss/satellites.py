# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Satellites of GPS: broadcast ephemerides, positions and clocks.

Equations and constants are those of IS-GPS-200, 20.3.3.3.3 and 20.3.3.4.3, and table 20-IV.
Positions are Earth-fixed (WGS84) at their times.
"""

from functools import lru_cache
from typing import Final, NamedTuple

import numpy as np

from imu_sim_ros.core.gps_time import WEEK
from imu_sim_ros.core.types import Array, Integers

LIGHT: Final = 299792458.0
"""Speed of light [m/s]."""
EARTH_RATE: Final = 7.2921151467e-5
"""Earth's rate of rotation in GPS [rad/s]; that of WGS84 ends in 15."""
_GRAVITATION: Final = 3.9860050e14
"""Gravitational parameter of the Earth in GPS [m^3/s^2]."""
_KEPLER_STEPS: Final = 4
"""Newton steps; an eccentricity of 0.03 needs three for all digits."""


class Ephemerides(NamedTuple):
    """Broadcast parameters of k satellites, all (k,); names as in RINEX, angles in rad."""

    prn: Integers
    week: Integers
    """Week of the reference time, not rolled over."""
    toe: Array
    """Reference time of the orbit, second of that week [s]."""
    toc: Array
    """Reference time of the clock, second of that week [s]."""
    af0: Array
    """Clock offset [s]."""
    af1: Array
    """Clock drift [s/s]."""
    af2: Array
    """Clock drift rate [s/s^2]."""
    sqrt_a: Array
    """Root of the semi-major axis [sqrt(m)]."""
    eccentricity: Array
    """Eccentricity of the orbit."""
    m0: Array
    """Mean anomaly at the reference time [rad]."""
    delta_n: Array
    """Correction of the mean motion [rad/s]."""
    omega0: Array
    """Longitude of the ascending node at the start of the week [rad]."""
    omega_dot: Array
    """Rate of the ascending node [rad/s]."""
    omega: Array
    """Argument of the perigee [rad]."""
    i0: Array
    """Inclination at the reference time [rad]."""
    idot: Array
    """Rate of the inclination [rad/s]."""
    cuc: Array
    """Cosine correction of the argument of latitude [rad]."""
    cus: Array
    """Sine correction of the argument of latitude [rad]."""
    crc: Array
    """Cosine correction of the orbit's radius [m]."""
    crs: Array
    """Sine correction of the orbit's radius [m]."""
    cic: Array
    """Cosine correction of the inclination [rad]."""
    cis: Array
    """Sine correction of the inclination [rad]."""
    tgd: Array
    """Group delay [s]."""
    iode: Integers

    def take(self, rows: Integers) -> "Ephemerides":
        """Return some of the satellites, in this order."""
        return self._replace(**{name: values[rows] for name, values in self._asdict().items()})


class Orbits(NamedTuple):
    """Positions and clocks of k satellites at times (..., k)."""

    position: Array
    """(..., k, 3) Earth-fixed position at that time [m]."""
    clock: Array
    """(..., k) clock of the satellite minus GPS time, with relativity, without TGD [s]."""


def orbits(satellites: Ephemerides, week: int, second: Array) -> Orbits:
    """Return positions and clock errors of satellites (IS-GPS-200, table 20-IV).

    :param second: GPS times (..., k) since the beginning of the week [s].
    """
    s = satellites
    tk = second - (s.toe + WEEK * (s.week - week).astype(np.float64))
    a = s.sqrt_a * s.sqrt_a
    mean = s.m0 + (np.sqrt(_GRAVITATION / a**3) + s.delta_n) * tk
    anomaly = mean
    for _ in range(_KEPLER_STEPS):
        wrong = anomaly - s.eccentricity * np.sin(anomaly) - mean
        anomaly = anomaly - wrong / (1.0 - s.eccentricity * np.cos(anomaly))
    sine, cosine = np.sin(anomaly), np.cos(anomaly)
    true = np.arctan2(np.sqrt(1.0 - s.eccentricity**2) * sine, cosine - s.eccentricity)
    latitude = true + s.omega
    sine2, cosine2 = np.sin(2.0 * latitude), np.cos(2.0 * latitude)
    u = latitude + s.cus * sine2 + s.cuc * cosine2
    r = a * (1.0 - s.eccentricity * cosine) + s.crs * sine2 + s.crc * cosine2
    i = s.i0 + s.idot * tk + s.cis * sine2 + s.cic * cosine2
    node = s.omega0 + (s.omega_dot - EARTH_RATE) * tk - EARTH_RATE * s.toe
    x, y = r * np.cos(u), r * np.sin(u)
    across = y * np.cos(i)
    position = np.stack(
        [
            x * np.cos(node) - across * np.sin(node),
            x * np.sin(node) + across * np.cos(node),
            y * np.sin(i),
        ],
        axis=-1,
    )
    dt = tk + (s.toe - s.toc)
    relativity = -2.0 * np.sqrt(_GRAVITATION * a) * s.eccentricity * sine / LIGHT**2
    return Orbits(position, s.af0 + s.af1 * dt + s.af2 * dt * dt + relativity)


PLANES: Final = 6
"""Number of orbital planes."""
IN_A_PLANE: Final = 5
"""Number of satellites in a plane."""
_RADIUS: Final = 26559.7e3
"""Radius of the orbits of GPS [m] (GPS SPS performance standard, 5th ed., table 3.2-1)."""
_INCLINATION: Final = np.radians(55.0)
_ECCENTRICITY: Final = 0.005
"""Eccentricity of the orbits."""
_PRECESSION: Final = -8.0e-9
"""Rate of the nodes, as broadcast [rad/s]."""
VALIDITY: Final = 7200.0
"""Interval of reference times [s]."""


@lru_cache(maxsize=32)
def almanac(week: int, toe: float) -> Ephemerides:
    """Return 30 satellites in place of GPS: a Walker constellation, 55 deg: 30/6/1.

    For each reference time the numbers differ, and the satellites stay on their orbits. All numbers
    are as a RINEX file holds them, with 13 digits.

    :param week: week of the reference time.
    :param toe: reference time, second of the week [s].
    """
    k = np.arange(PLANES * IN_A_PLANE)
    plane, slot = np.divmod(k, IN_A_PLANE)
    full = 2.0 * np.pi
    # Spread perigees; the phase of a slot is counted from the node, so they do not change it.
    omega = full * ((k * 7) % len(k)) / len(k)
    since = week * float(WEEK) + toe
    sqrt_a = np.sqrt(_RADIUS)
    phase = full * (slot / IN_A_PLANE + plane / len(k)) - omega
    mean = phase + np.sqrt(_GRAVITATION / _RADIUS**3) * since
    turned = (_PRECESSION - EARTH_RATE) * since + EARTH_RATE * toe
    zero = np.zeros(len(k))
    values = {
        # Any clocks of the size of real ones, different for each satellite.
        "af0": 3e-4 * np.sin(2.4 * k),
        "af1": 5e-12 * np.cos(1.7 * k),
        "sqrt_a": zero + sqrt_a,
        "eccentricity": zero + _ECCENTRICITY,
        "m0": np.remainder(mean + np.pi, full) - np.pi,
        "omega0": np.remainder(full * plane / PLANES + turned + np.pi, full) - np.pi,
        "omega_dot": zero + _PRECESSION,
        "omega": np.remainder(omega + np.pi, full) - np.pi,
        "i0": zero + _INCLINATION,
    }
    # The clocks drift on from one reference time to the next, from zero at the start of the week.
    values["af0"] = values["af0"] + values["af1"] * toe
    rounded = {name: round_to_rinex(value) for name, value in values.items()}
    zeros = {name: zero for name in Ephemerides._fields if name not in rounded}
    whole = {
        "prn": k + 1,
        "week": np.full(len(k), week),
        "iode": np.full(len(k), int(toe // VALIDITY) + 1),
    }
    return Ephemerides(**{**zeros, **rounded, **whole, "toe": zero + toe, "toc": zero + toe})


def round_to_rinex(values: Array) -> Array:
    """Return numbers as RINEX holds them, with 13 digits."""
    return np.array([float(f"{value:.12e}") for value in values])
