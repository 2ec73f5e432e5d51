# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Raw measurements of a receiver: pseudorange, carrier phase and Doppler of each satellite in view.

A measurement of a satellite s on a frequency f, with the wavelength L (Groves, 2nd ed., eq. 9.1)::

    pseudorange   = rho + c (dt_r - dt_s + (f1/f)^2 TGD) + (f1/f)^2 I + T + noise
    carrier phase = (rho + c (dt_r - dt_s) - (f1/f)^2 I + T + noise) / L + N
    Doppler       = -(rho' + c (dt_r' - dt_s') + noise) / L

rho is the distance between the antenna at reception and the satellite at emission, with the Earth's
rotation on the way; the Doppler has no rates of the atmosphere, at most about 1 cm/s.
"""

from collections.abc import Mapping
from typing import Final, NamedTuple

import numpy as np

from imu_sim_ros.core.geodesy import east_north_up, ecef_of_geodetic
from imu_sim_ros.core.gps_time import WEEK, GpsTime
from imu_sim_ros.core.random_streams import generator, generator_at
from imu_sim_ros.core.timebase import NANOSECONDS_PER_SECOND
from imu_sim_ros.core.types import AnyArray, Array, Integers, Mask
from imu_sim_ros.sensors.environment import EnvironmentParameters
from imu_sim_ros.sensors.gnss.parameters import RawParameters
from imu_sim_ros.sensors.gnss.satellites import (
    EARTH_RATE,
    LIGHT,
    Ephemerides,
    orbits,
)
from imu_sim_ros.sensors.gnss.sky import SATELLITES, Broadcast
from imu_sim_ros.sensors.gravity import geodetic

L1: Final = 1575.42e6
"""Frequency of L1 [Hz]."""
L2: Final = 1227.60e6
"""Carrier frequency L2 of GPS [Hz]."""
_STEP: Final = 1e-3
"""Step of the differences for satellites' velocities [s]."""
_FLIGHT_TIME: Final = 0.075
"""Approximate time of flight of a signal [s]."""
_FLIGHT_STEPS: Final = 3
"""Iterations of the time of flight; each leaves a hundred-thousandth of the error."""
_TICK_NS: Final = 100
"""Resolution of the receiver's time tags [ns]."""
_AMBIGUITY: Final = 1_000_000
"""Upper limit of random ambiguities [cycles]."""


def klobuchar(
    start: GpsTime,
    seconds: Array,
    angles: tuple[Array, Array],
    look: tuple[Array, Array],
    ion: Array,
) -> Array:
    """Return ionospheric delays on L1 (n, k) [m] (IS-GPS-200, 20.3.3.5.2.5).

    :param start: time zero; only the second of the week matters.
    :param seconds: (n,) times since then [s].
    :param angles: latitude and longitude (n,) [rad].
    :param look: azimuth and elevation (n, k) [rad].
    :param ion: (8,) alpha 0 to 3 and beta 0 to 3.
    """
    azimuth, elevation = look[0], look[1] / np.pi
    latitude, longitude = (angle[:, None] / np.pi for angle in angles)
    psi = 0.0137 / (elevation + 0.11) - 0.022
    phi = np.clip(latitude + psi * np.cos(azimuth), -0.416, 0.416)
    lam = longitude + psi * np.sin(azimuth) / np.cos(phi * np.pi)
    phi = phi + 0.064 * np.cos((lam - 1.617) * np.pi)
    local = np.remainder(43200.0 * lam + start.second + seconds[:, None], 86400.0)
    slant = 1.0 + 16.0 * (0.53 - elevation) ** 3
    amplitude = np.maximum(np.polynomial.polynomial.polyval(phi, ion[:4]), 0.0)
    period = np.maximum(np.polynomial.polynomial.polyval(phi, ion[4:]), 72000.0)
    x = 2.0 * np.pi * (local - 50400.0) / period
    day = amplitude * (1.0 + x * x * (-0.5 + x * x / 24.0))
    return LIGHT * slant * (5e-9 + np.where(np.abs(x) < 1.57, day, 0.0))


def saastamoinen_delay(
    latitude: Array, height: Array, elevation: Array, humidity: float = 0.7
) -> Array:
    """Return tropospheric delays (n, k) [m] in the standard atmosphere (Saastamoinen, 1972).

    The form and the constants are those of RTKLIB's manual, E.5 (1); at most 1e4 m high.

    :param latitude: (n,) latitude [rad].
    :param height: (n,) height above the ellipsoid [m].
    :param elevation: (n, k) elevation [rad].
    """
    h = np.clip(height, 0.0, 1e4)
    pressure = 1013.25 * (1.0 - 2.2557e-5 * h) ** 5.2568
    temperature = 15.0 - 6.5e-3 * h + 273.16
    vapour = 6.108 * humidity * np.exp((17.15 * temperature - 4684.0) / (temperature - 38.45))
    dry = 0.0022768 * pressure / (1.0 - 0.00266 * np.cos(2.0 * latitude) - 0.00028 * h / 1e3)
    wet = 0.002277 * (1255.0 / temperature + 0.05) * vapour
    return (dry + wet)[:, None] / np.sin(elevation)


class Antenna(NamedTuple):
    """Earth-fixed motion of an antenna at n times."""

    position: Array
    """(n, 3) position [m]."""
    velocity: Array
    """(n, 3) velocity [m/s]."""
    latitude: Array
    """(n,) latitude [rad]."""
    longitude: Array
    """(n,) longitude [rad]."""
    height: Array
    """(n,) height above the ellipsoid [m]."""
    axes: Array
    """(n, 3, 3) directions of east, north and up."""


def antenna(environment: EnvironmentParameters, position: Array, velocity: Array) -> Antenna:
    """Return positions and velocities (n, 3) in the world as Earth-fixed ones."""
    latitude, longitude, height = geodetic(environment, position)
    axes = east_north_up(latitude, longitude)
    turn = axes
    if not environment.curved_earth:  # there the world's axes are those of its origin everywhere
        origin = np.array([environment.latitude_deg]), np.array([environment.longitude_deg])
        turn = np.broadcast_to(east_north_up(*origin), axes.shape)
    return Antenna(
        position=ecef_of_geodetic(latitude, longitude, height),
        velocity=np.einsum("nij,ni->nj", turn, velocity),
        latitude=np.radians(latitude),
        longitude=np.radians(longitude),
        height=height,
        axes=axes,
    )


class Ranges(NamedTuple):
    """Geometry and clocks of k satellites for an antenna at n times, all (n, k)."""

    distance: Array
    """Distance [m]."""
    rate: Array
    """Rate of the distance [m/s]."""
    clock: Array
    """Error of the satellite's clock [s]."""
    clock_rate: Array
    """Rate of that error [s/s]."""
    azimuth: Array
    """Azimuth [rad]."""
    elevation: Array
    """Elevation [rad]."""


def ranges(ephemerides: Ephemerides, week: int, second: Array, antenna_motion: Antenna) -> Ranges:
    """Return the ranges of satellites at reception times (n,) [s of the week]."""
    flight = np.full((len(second), len(ephemerides.prn)), _FLIGHT_TIME)
    satellite, distance = np.empty(0), np.empty(0)
    for _ in range(_FLIGHT_STEPS):
        satellite = _rotate_to_reception(
            orbits(ephemerides, week, second[:, None] - flight).position, flight
        )
        distance = np.linalg.norm(satellite - antenna_motion.position[:, None], axis=-1)
        flight = distance / LIGHT
    emitted = second[:, None] - flight
    earlier, later = (orbits(ephemerides, week, emitted + s * _STEP) for s in (-0.5, 0.5))
    clock, drift = 0.5 * (earlier.clock + later.clock), (later.clock - earlier.clock) / _STEP
    velocity = _rotate_to_reception((later.position - earlier.position) / _STEP, flight)
    away = (satellite - antenna_motion.position[:, None]) / distance[..., None]
    approach = np.sum(away * velocity, axis=-1)
    # The rotation during the flight depends on it: d(R r)/dt = R v + w x R r, tau' = rho' / c.
    swing = (
        -EARTH_RATE * (away[..., 1] * satellite[..., 0] - away[..., 0] * satellite[..., 1]) / LIGHT
    )
    antenna_rate = np.einsum("nkj,nj->nk", away, antenna_motion.velocity)
    rate = (approach - antenna_rate) / (1.0 + approach / LIGHT - swing)
    local = away @ np.swapaxes(antenna_motion.axes, -1, -2)
    azimuth = np.arctan2(local[..., 0], local[..., 1])
    return Ranges(
        distance=distance,
        rate=rate,
        clock=clock,
        clock_rate=drift,
        azimuth=azimuth,
        elevation=np.arcsin(local[..., 2]),
    )


def _rotate_to_reception(satellite: Array, flight: Array) -> Array:
    """Return positions (..., 3) at emission in the Earth-fixed axes of reception."""
    angle = EARTH_RATE * flight
    sine, cosine = np.sin(angle), np.cos(angle)
    x, y, z = np.moveaxis(satellite, -1, 0)
    return np.stack([cosine * x + sine * y, cosine * y - sine * x, z], axis=-1)


class Observer:
    """The raw measurements of one receiver."""

    def __init__(
        self,
        parameters: RawParameters,
        environment: EnvironmentParameters,
        broadcast: Broadcast,
        start: GpsTime,
        name: str,
        dt: float,
    ) -> None:
        """Set up clock and noise at their start.

        :param start: GPS time of time zero.
        :param name: first part of the names of the random streams.
        :param dt: time between two measurements [s].
        """
        self._parameters, self._environment = parameters, environment
        self._broadcast, self._start, self._dt = broadcast, start, dt
        self._frequencies = np.array([L1, L2][: parameters.frequencies])
        seed, self._seed, self._name = environment.seed, environment.seed, f"{name}.raw"
        self._noise = [
            generator(seed, f"{self._name}.{kind}") for kind in ("code", "phase", "rate")
        ]
        self._steps, self._walked = generator(seed, f"{self._name}.clock"), 0.0
        self._count = 0
        self._locks = np.zeros(SATELLITES, np.int64)
        self._locked = np.zeros(SATELLITES, np.bool_)
        self._cycles = np.zeros((SATELLITES, len(self._frequencies)))
        ion = broadcast.ionosphere
        self._ion = np.array(parameters.klobuchar) if ion is None else ion

    def measure(
        self, t: Array, position: Array, velocity: Array, used: Integers
    ) -> Mapping[str, AnyArray]:
        """Return the measurements of the next n times, and their truth.

        The receiver measures when its clock shows the times, in ticks of RINEX.

        :param t: (n,) times since time zero [s].
        :param position: (n, 3) positions of the antenna in the world [m].
        :param velocity: (n, 3) velocities [m/s].
        :param used: (n,) bits ``prn - 1`` of the measured satellites.
        """
        clock = self._clock(len(t))
        true_ns = round(self._start.second * 1e9) + np.round(t * 1e9).astype(np.int64)
        tag_ns = (true_ns + _TICK_NS // 2) // _TICK_NS * _TICK_NS
        # The true time of a measurement minus the nominal one: the antenna has moved since.
        off = (tag_ns - true_ns) * 1e-9 - clock
        antenna_motion = antenna(self._environment, position + off[:, None] * velocity, velocity)
        shape = (len(t), SATELLITES)
        truth = {name: np.full(shape, np.nan) for name in Ranges._fields}
        delay = np.zeros(SATELLITES)
        for rows, ephemerides in self._broadcast.sets(self._start, t):
            motion_part = Antenna(*(values[rows] for values in antenna_motion))
            visible_ranges = ranges(
                ephemerides, self._start.week, self._start.second + (t + off)[rows], motion_part
            )
            for name, values in visible_ranges._asdict().items():
                truth[name][np.ix_(rows, ephemerides.prn - 1)] = values
            delay[ephemerides.prn - 1] = ephemerides.tgd
        visible = (used[:, None] >> np.arange(SATELLITES) & 1).astype(np.bool_)
        for values in truth.values():
            values[~visible] = np.nan
        all_ranges = Ranges(**truth)
        ionosphere, troposphere = self._atmosphere(t, antenna_motion, all_ranges)
        common = all_ranges.distance + LIGHT * (clock[:, None] - all_ranges.clock) + troposphere
        rate = all_ranges.rate + LIGHT * (self._parameters.clock_drift - all_ranges.clock_rate)
        scale = np.square(L1 / self._frequencies)
        code, phase, speed = self._errors(shape, all_ranges.elevation)
        wavelength = LIGHT / self._frequencies
        later = ionosphere[..., None] * scale  # code is delayed, phase is advanced
        delays = (LIGHT * delay)[:, None] * scale
        lock, cycles = self._lock(visible)
        return {
            "tag_ns": tag_ns + self._start.week * WEEK * NANOSECONDS_PER_SECOND,
            "pseudorange": common[..., None] + delays + later + code,
            "carrier_phase": (common[..., None] - later + phase) / wavelength + cycles,
            "doppler": -(rate[..., None] + speed) / wavelength,
            "lock": lock,
            "elevation": all_ranges.elevation,
            "ideal_range": all_ranges.distance,
            "satellite_clock": all_ranges.clock,
            "receiver_clock": clock,
            "ionosphere": ionosphere,
            "troposphere": troposphere,
        }

    def _clock(self, count: int) -> Array:
        """Return the receiver's clock error (n,) [s] at the next times."""
        p = self._parameters
        k = self._count + np.arange(count)
        self._count += count
        clock = np.asarray(p.clock_offset + p.clock_drift * self._dt * k, np.float64)
        if p.clock_random_walk:
            steps = p.clock_random_walk * np.sqrt(self._dt) * self._steps.standard_normal(count)
            walked = np.cumsum(np.concatenate([[self._walked], steps]))
            self._walked = float(walked[-1])
            clock = clock + walked[1:]
        return clock

    def _atmosphere(
        self, t: Array, antenna_motion: Antenna, visible_ranges: Ranges
    ) -> tuple[Array, Array]:
        """Return the delays (n, k) of ionosphere, on L1, and troposphere [m]."""
        p, look = self._parameters, (visible_ranges.azimuth, visible_ranges.elevation)
        nothing = np.zeros_like(visible_ranges.elevation)
        ionosphere, troposphere = nothing, nothing
        if p.ionosphere:
            angles = (antenna_motion.latitude, antenna_motion.longitude)
            ionosphere = klobuchar(self._start, t, angles, look, self._ion)
        if p.troposphere:
            troposphere = saastamoinen_delay(
                antenna_motion.latitude, antenna_motion.height, visible_ranges.elevation
            )
        return ionosphere, troposphere

    def _errors(self, shape: tuple[int, int], elevation: Array) -> list[Array]:
        """Return the noise (n, k, f) of code, phase and rate; larger at low elevations."""
        p, shape_of_noise = self._parameters, (*shape, len(self._frequencies))
        sigmas = (p.code_sigma, p.phase_sigma, p.rate_sigma)
        return [
            sigma / np.sin(elevation)[..., None] * stream.standard_normal(shape_of_noise)
            for sigma, stream in zip(sigmas, self._noise, strict=True)
        ]

    def _lock(self, visible: Mask) -> tuple[Integers, Array]:
        """Return the acquisitions of each satellite (n, k), and its ambiguities (n, k, f)."""
        previous = np.concatenate([self._locked[None], visible])[:-1]
        acquisitions = np.cumsum(visible & ~previous, axis=0)
        lock = self._locks + acquisitions
        cycles = np.empty((*visible.shape, len(self._frequencies)))
        for k in range(SATELLITES):
            starts = np.flatnonzero(
                acquisitions[:, k] > np.concatenate([[0], acquisitions[:-1, k]])
            )
            begin, current = 0, self._cycles[k].copy()
            for start in starts.tolist():
                cycles[begin:start, k] = current
                number = int(lock[start, k])
                stream = generator_at(self._seed, f"{self._name}.cycles.{k + 1}", number)
                current = stream.integers(-_AMBIGUITY, _AMBIGUITY, len(current)).astype(float)
                begin = start
            cycles[begin:, k] = current
            self._cycles[k] = current
        if len(visible):
            self._locks, self._locked = lock[-1], visible[-1]
        return np.where(visible, lock, 0), cycles
