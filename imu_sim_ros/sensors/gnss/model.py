# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Model of the receiver: motion of its antenna, errors, and outages."""

import math
from collections.abc import Mapping
from typing import Final

import numpy as np

from imu_sim_ros.core import rotation
from imu_sim_ros.core.random_streams import Streams
from imu_sim_ros.core.types import AnyArray, Array, Integers, Mask
from imu_sim_ros.sensors.declaration import Mounted
from imu_sim_ros.sensors.errors.processes import Events, GaussMarkovBank
from imu_sim_ros.sensors.gnss.observations import Observer
from imu_sim_ros.sensors.gnss.parameters import MODES, GnssParameters
from imu_sim_ros.sensors.gnss.sky import UNUSABLE, Geometry, Sky, constant
from imu_sim_ros.sensors.gravity import CurvedEarth, geodetic
from imu_sim_ros.sensors.model import SensorModel
from imu_sim_ros.sensors.world import World
from imu_sim_ros.trajectory.motion import Motion

NO_FIX: Final = -1
"""``NavSatStatus.STATUS_NO_FIX``."""
STATUS: Final = (0, 1, 2, 2)
"""Status of sensor_msgs/NavSatStatus for each mode: FIX, SBAS_FIX, GBAS_FIX."""


class Receiver(SensorModel[GnssParameters]):
    """Fixes and velocities of one antenna."""

    parameters: GnssParameters

    def __init__(self, mounted: Mounted[GnssParameters], t0_ns: int, _: object) -> None:
        """Set up all errors at their start."""
        super().__init__(mounted, t0_ns)
        name, environment, p = mounted.name, mounted.environment, self.parameters
        seed, dt = environment.seed, 1.0 / p.rate
        self._environment = environment
        self._earth = CurvedEarth(environment) if environment.curved_earth else None
        self._white = Streams(seed, f"{name}.white_noise")
        self._slow = GaussMarkovBank(seed, f"{name}.gauss_markov", p.correlation_time, dt)
        self._steps = Streams(seed, f"{name}.random_walk")
        self._walked = np.zeros((1, 3))
        self._of_velocity = Streams(seed, f"{name}.velocity")
        self._jumps = Events(seed, f"{name}.multipath", p.multipath_rate, p.multipath_duration, dt)
        self._sizes = Streams(seed, f"{name}.multipath_size")
        self._random = Events(seed, f"{name}.outage", p.outage_rate, p.outage_duration, dt)
        self._last_fix = np.full(6, np.nan)
        self._dt = dt
        self._sky = Sky(p, environment, t0_ns) if p.sky == "satellites" else None
        self._observer: Observer | None = None
        if p.raw.rinex and self._sky is not None:
            sky, raw = self._sky, p.raw
            self._observer = Observer(raw, environment, sky.broadcast, sky.start, name, dt)

    def measure(self, t: Array, world: World) -> Mapping[str, AnyArray]:
        """Return measured position and velocity of the antenna, and their truth."""
        p, motion = self.parameters, world.motion(t)
        ideal = self.position(motion)
        changes = np.reshape(p.mode_changes, (-1, 2))
        modes = np.concatenate([[MODES.index(p.mode)], changes[:, 1] - 1.0]).astype(np.int64)
        mode = modes[np.searchsorted(changes[:, 0], t, side="right")]
        geometry = self._sky.over(t, ideal) if self._sky else constant(p, len(t))
        sigma = self._sigma(mode, geometry)
        error = self._error(sigma)
        velocity = self._velocity(motion)
        noise = p.velocity_sigma * self._of_velocity.next(len(t))
        mode = np.where(self._is_out(t, ideal) | ~geometry.usable, -1, mode).astype(np.int64)
        measured = geometry.used * (mode >= 0)
        if self._observer is not None:
            raw = self._observer.measure(t, ideal, velocity, measured)
        else:
            raw = _empty_raw(len(t))
        return {
            "position": ideal + error,
            "ideal_position": ideal,
            "velocity": velocity + noise,
            "ideal_velocity": velocity,
            "variance": p.covariance_factor * np.square(sigma),
            "mode": mode,
            "satellites": geometry.satellites,
            "used": geometry.used,
            "dilution": geometry.dilution,
            **raw,
        }

    def complete(self, values: Mapping[str, Array]) -> Mapping[str, Array]:
        """Return latitudes and so on of the measured positions."""
        mode = values["mode"]
        measured, true = (
            np.stack(geodetic(self._environment, values[name]), axis=1)
            for name in ("position", "ideal_position")
        )
        count = len(mode)
        fixed = mode >= 0
        # Without a fix the position is that of the last one.
        positions = np.column_stack([values["position"], measured])
        rows = np.maximum.accumulate(np.where(fixed, np.arange(1, count + 1), 0))
        positions_with_fix: Array = np.concatenate([self._last_fix[None], positions])[rows]
        if count:
            self._last_fix = positions_with_fix[-1]
        diluted = np.where(fixed[:, None], values["dilution"], UNUSABLE)
        speed = self.parameters.covariance_factor * self.parameters.velocity_sigma**2
        return {
            **values,
            "error": values["position"] - values["ideal_position"],
            "position": positions_with_fix[:, :3],
            "geodetic": positions_with_fix[:, 3:],
            "ideal_geodetic": true,
            "variance": np.where(fixed[:, None], values["variance"], np.nan),
            "velocity": np.where(fixed[:, None], values["velocity"], np.nan),
            "velocity_variance": np.where(fixed[:, None], np.full((count, 3), speed), np.nan),
            "status": np.append(STATUS, NO_FIX)[mode],
            "satellites": values["satellites"] * fixed,
            "used": values["used"] * fixed,
            "dilution": diluted,
            "hdop": np.minimum(np.hypot(diluted[:, 0], diluted[:, 1]), UNUSABLE),
            "vdop": diluted[:, 2],
            "pdop": np.minimum(np.linalg.norm(diluted[:, :3], axis=1), UNUSABLE),
        }

    def sent(self, values: Mapping[str, Array]) -> Mask | None:
        """Return a mask of the samples that become messages."""
        return values["mode"] >= 0 if self.parameters.silent else None

    def _sigma(self, mode: Integers, geometry: Geometry) -> Array:
        """Return the standard deviations (n, 3) of the error that the geometry explains."""
        p = self.parameters
        horizontal = math.sqrt(2.0) / p.hdop * np.array(p.horizontal_sigma)[mode]
        ranges = np.stack(
            [horizontal, horizontal, np.array(p.vertical_sigma)[mode] / p.vdop], axis=1
        )
        diluted = np.where(geometry.usable[:, None], geometry.dilution[:, :3], 1.0)
        return ranges * diluted

    def _error(self, sigma: Array) -> Array:
        """Return the error (n, 3) east, north, up of the next samples."""
        p, count = self.parameters, len(sigma)
        white = self._white.next(count)
        slow = self._slow.next_block(count)
        error = sigma * (math.sqrt(p.white_share) * white + math.sqrt(1.0 - p.white_share) * slow)
        if p.random_walk:
            steps = p.random_walk * math.sqrt(self._dt) * self._steps.next(count)
            # Summed in one order, so that blocks of any size give the same bits.
            walked = np.cumsum(np.concatenate([self._walked, steps]), axis=0)[1:]
            self._walked = walked[-1:] if count else self._walked
            error += walked
        for rows, jump in self._jumps.values(count, self._jump):
            error[rows] += jump
        return error

    def _jump(self) -> Array:
        """Return the error (3,) of the current multipath, east, north, up."""
        return self.parameters.multipath_sigma * self._sizes.next(1)[0]

    def _velocity(self, motion: Motion) -> Array:
        """Return the antenna's velocity (n, 3), east, north, up."""
        v = motion.velocity
        if self._earth is not None:
            v = self._earth.over_ground(motion).velocity
        return v + rotation.rotate(motion.q_wb, np.cross(motion.angular_velocity, self.lever_arm_b))

    def _is_out(self, t: Array, position: Array) -> Mask:
        """Return a mask of the samples without a fix, by time, by position, or by chance."""
        p = self.parameters
        out = self._random.next(len(t)) > 0
        for start, length in np.reshape(p.outages, (-1, 2)):
            out |= (t >= start) & (t < start + length)
        for box in np.reshape(p.outage_boxes, (-1, 6)):
            out |= ((position >= box[:3]) & (position <= box[3:])).all(axis=1)
        return out


def _empty_raw(count: int) -> Mapping[str, AnyArray]:
    """Return empty raw measurements, and their truth, for n times."""
    return {
        "tag_ns": np.zeros(count, np.int64),
        **{name: np.empty((count, 0, 0)) for name in ("pseudorange", "carrier_phase", "doppler")},
        "lock": np.empty((count, 0), np.int64),
        **{name: np.empty((count, 0)) for name in ("elevation", "ideal_range", "satellite_clock")},
        "receiver_clock": np.zeros(count),
        **{name: np.empty((count, 0)) for name in ("ionosphere", "troposphere")},
    }


def location_warnings(mounted: Mounted[GnssParameters], world: World, _: float) -> list[str]:
    """Return a line if the location of the world on the Earth is not stated."""
    origin = mounted.environment
    if origin.latitude_deg or origin.longitude_deg:
        return []
    from imu_sim_ros.trajectory.drive import route_in  # few motions are drives

    route = route_in(world.trajectory)
    if route is not None and route.origin is not None:
        return []
    return [
        "latitude_deg = 0 and longitude_deg = 0: fixes and satellites are those of a place "
        "in the Gulf of Guinea; set both"
    ]
