# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""A LiDAR: its rays through the scene, each from where the sensor is at its own time, and errors.

A scan is a sample: it is stamped with its start, and complete at its end. The range of a ray is

``r = round((d + b + b_ring + n) / q) q``

with the distance d along the true direction, which differs from the nominal one by the error of the
ring's elevation and by jitter; noise n with the variance ``s^2 + (s_limit (d / R)^2)^2``; and the
step q. The power that returns of a diffuse surface that fills the beam goes with
``reflectivity cos(incidence) / d^2`` (Wagner et al., ISPRS Journal of Photogrammetry and Remote
Sensing 60, 2006, eq. 12), so that it is detected up to
``R = R_0 sqrt(reflectivity cos(incidence) / reflectivity_0)``; timing noise goes with the inverse
of the power, as the second part of n. A point is the range times the nominal direction.
"""

import dataclasses
import math
from collections.abc import Callable, Mapping
from typing import Final

import numpy as np
from numpy.random import Generator
from numpy.typing import NDArray

from imu_sim_ros.core import rotation
from imu_sim_ros.core.blocks import ceil_divide
from imu_sim_ros.core.errors import ConfigurationError
from imu_sim_ros.core.random_streams import generator
from imu_sim_ros.core.types import AnyArray, Array, Integers, Mask, Single
from imu_sim_ros.places.rays import Traced
from imu_sim_ros.sensors.camera.rig_parameters import rig_parameters_of
from imu_sim_ros.sensors.camera.scene_parameters import has_surfaces
from imu_sim_ros.sensors.declaration import Model, Mounted
from imu_sim_ros.sensors.lidar.parameters import LidarParameters
from imu_sim_ros.sensors.lidar.pattern import build_pattern
from imu_sim_ros.sensors.lidar.targets import Targets
from imu_sim_ros.sensors.model import SensorModel
from imu_sim_ros.sensors.world import World
from imu_sim_ros.trajectory.dense import dense_poses

SURFACE, MIXED, FALSE, NOTHING, OUT_OF_RANGE, GLASS, LOST = range(7)
"""Outcomes of a ray. The first three give a point: of a surface, of several within the beam, of
rain or dust."""
_FALSE_INTENSITY: Final = 5.0
"""Largest intensity of a return by rain or dust."""
_FAR: Final = 1e9
"""Range of a ray that hits nothing [m]."""
_LOOKS: Final = 256
"""Rays of a scan that are traced to see whether any returns, before all are."""
_ALIKE: Final = 1e-3
"""Difference of a ray's range from that of the beam's middle which makes it one of an edge [m]."""
_UPRIGHT: Final = 1e-12
"""Least square of the horizontal part of a direction for which it has an azimuth."""


def draw_ring_errors(p: LidarParameters, seed: int, name: str, rings: int) -> tuple[Array, Array]:
    """Return the constant errors (rings,) of ranges [m] and of elevations [deg].

    :param name: name of the sensor.
    :raises ConfigurationError: if those that are given are not as many.
    """
    per_ring = []
    for key, numbers, sigma in (
        ("ring_bias", p.ring_bias, p.ring_bias_sigma),
        ("ring_elevation_error_deg", p.ring_elevation_error_deg, p.ring_elevation_sigma_deg),
    ):
        if numbers and len(numbers) != rings:
            raise ConfigurationError(
                f"{name}.{key}: has {len(numbers)} numbers; must be empty or have {rings}"
            )
        drawn = sigma * generator(seed, f"{name}.{key}").standard_normal(rings)
        per_ring.append(np.array(numbers) if numbers else drawn)
    return per_ring[0], per_ring[1]


def realise_lidar(p: LidarParameters, seed: int, name: str) -> LidarParameters:
    """Return the parameters with the constant errors of a seed.

    :param name: name of the sensor.
    """
    rings = p.rings or int(build_pattern(p).ring.max()) + 1
    bias, error_deg = (tuple(column.tolist()) for column in draw_ring_errors(p, seed, name, rings))
    return dataclasses.replace(p, ring_bias=bias, ring_elevation_error_deg=error_deg)


def visibility_mask(mounted: Mounted[LidarParameters], world: World, t: Array) -> Mask:
    """Return at which times (n,) [s] a scan of a LiDAR that starts then has a point.

    A share of the rays is traced first, and all of them where none of these returns.
    """
    p = mounted.parameters
    if not has_surfaces(rig_parameters_of(mounted.environment).scene):
        return np.zeros(len(t), np.bool_)
    lidar, pattern = Lidar(mounted, world.t0_ns, {}), build_pattern(p)
    motion = world.trajectory.sample(t)
    position, q_ws = lidar.position(motion), lidar.attitude(motion)
    targets = Targets(world.scene, p.reflectivity)
    some = np.arange(0, len(pattern.time), ceil_divide(len(pattern.time), _LOOKS))

    def returns(k: int, rays: Integers) -> bool:
        direction = rotation.rotate(q_ws[k : k + 1], pattern.directions(float(t[k]))[rays])
        origin = np.broadcast_to(position[k], direction.shape)
        traced = targets.trace(np.full(len(rays), t[k]), origin, direction)
        power = targets.reflectivity(traced) * np.abs(traced.along)
        limit = lidar.detection_limit(power)
        reach = p.maximum_range if limit is None else np.fmin(limit, p.maximum_range)
        return bool(((traced.distance >= p.minimum_range) & (traced.distance <= reach)).any())

    all_rays = np.arange(len(pattern.time))
    return np.array([returns(k, some) or returns(k, all_rays) for k in range(len(t))])


class Lidar(SensorModel[LidarParameters]):
    """A LiDAR on a body."""

    def __init__(
        self, mounted: Mounted[LidarParameters], t0_ns: int, _: Mapping[str, Model]
    ) -> None:
        """Set up its rays.

        :raises InputError: for a table of directions that cannot be used.
        """
        super().__init__(mounted, t0_ns)
        p = mounted.parameters
        self._pattern = build_pattern(p)
        self._streams: dict[str, Generator] = {}
        self._targets: Targets | None = None
        rings, ring = int(self._pattern.ring.max()) + 1, self._pattern.ring
        bias, error_deg = draw_ring_errors(p, mounted.environment.seed, self.name, rings)
        self._bias, self._tilt = bias[ring], np.radians(error_deg)[ring]

    def measure(self, t: Array, world: World) -> Mapping[str, Array]:
        """Return n scans of m rays; arrays that are equal in all scans are stored once.

        ``range_bias`` (n,) is the reading that faults change.
        """
        if self._targets is None:
            self._targets = Targets(world.scene, self.parameters.reflectivity)
        scans = [self._scan(start, world, self._targets) for start in t.tolist()]
        count, rays = len(t), len(self._pattern.time)
        values: dict[str, AnyArray] = {"range_bias": np.full(count, self.parameters.range_bias)}
        for name, kind, shape in _ARRAYS:
            empty = np.empty((0, rays, *shape), kind)
            values[name] = np.stack([scan[name] for scan in scans]) if scans else empty
        values["time"] = np.broadcast_to(self._pattern.time, (count, rays))
        values["ring"] = np.broadcast_to(self._pattern.ring, (count, rays))
        return values

    def complete(self, values: Mapping[str, Array]) -> Mapping[str, Array]:
        """Return the values with the ranges that a fault has changed."""
        added = values["range_bias"] - self.parameters.range_bias
        if not added.any():
            return values
        moved = {name: values[name] + added[:, None].astype(np.float32) for name in _OF_THE_BIAS}
        return {**values, **moved}

    def _scan(self, start: float, world: World, targets: Targets) -> dict[str, AnyArray]:
        """Return the values of the m rays of one scan by name, each (m,) or (m, 3).

        :param start: time of the scan's start [s].
        """
        p, pattern = self.parameters, self._pattern
        end, t = min(start + p.span, world.trajectory.duration), start + pattern.time
        position, q_wb = dense_poses(world.trajectory.sample, start, end, t)
        nominal = pattern.directions(start)
        origin = position + rotation.rotate(q_wb, self.lever_arm_b)
        q_ws = rotation.multiply(q_wb, self.q_bs)
        beam = self._deflect(nominal)
        towards = rotation.rotate(q_ws, beam)
        # Exact: what each ray meets. All errors follow.
        traced = targets.trace(t, origin, towards)
        reflectivity = targets.reflectivity(traced)
        distance, cosine = traced.distance, np.abs(traced.along)
        range_, outcome = distance.copy(), np.zeros(len(t), np.uint8)
        power = reflectivity * cosine
        if p.beam_divergence_deg > 0.0:
            hits = traced, reflectivity
            aside = rotation.rotate(q_ws, self._aside(beam))
            range_, power = self._within_beam(t, origin, towards, aside, targets, hits)
            outcome[np.abs(range_ - np.minimum(distance, _FAR)) > _ALIKE] = MIXED
        # Errors of the range, then rays of which nothing returns, or rain instead.
        limit = self.detection_limit(power)
        range_ += p.range_bias + self._bias
        noise = self._range_noise(range_, limit)
        if noise is not None:
            range_ += noise
        intensity = 100.0 * power
        self._lose(outcome, range_, limit, lambda: targets.on_glass(traced, origin, towards))
        self._meet_rain(outcome, range_, intensity, distance)
        # Errors of the intensity, then rounding and the limits of the sensor.
        if p.intensity_range > 0.0:
            with np.errstate(invalid="ignore"):
                intensity *= np.minimum(1.0, p.intensity_range / np.maximum(range_, 1e-9)) ** 2
        if p.intensity_noise > 0.0:
            intensity *= 1.0 + p.intensity_noise * self._normal("intensity", len(t))
        if p.range_resolution > 0.0:
            range_ = np.rint(range_ / p.range_resolution) * p.range_resolution
        outcome[(outcome <= FALSE) & ~((range_ >= p.minimum_range) & (range_ > 0.0))] = OUT_OF_RANGE
        outcome[(outcome <= FALSE) & (range_ > p.maximum_range)] = OUT_OF_RANGE
        range_[outcome > FALSE] = np.nan
        surface_range = np.where(traced.surface < 0, np.nan, distance)
        hit = origin + surface_range[:, None] * towards - origin[:1]
        return {
            "range": range_.astype(np.float32),
            "intensity": np.maximum(intensity, 0.0).astype(np.float32),
            "direction": nominal.astype(np.float32),
            "true_range": distance.astype(np.float32),
            "true_point": rotation.rotate_inverse(q_ws[:1], hit).astype(np.float32),
            "range_error": (range_ - surface_range).astype(np.float32),
            "incidence": np.arccos(np.minimum(cosine, 1.0)).astype(np.float32),
            "reflectivity": reflectivity.astype(np.float32),
            "surface": traced.surface.astype(np.int32),
            "body": traced.body,
            "outcome": outcome,
        }

    def _normal(self, source: str, count: int) -> Single:
        """Return the next standard normals (count,) of a source."""
        return self._next(source).standard_normal(count, np.float32)

    def _next(self, source: str) -> Generator:
        """Return the random stream of an error source."""
        if source not in self._streams:
            self._streams[source] = self.stream(source)
        return self._streams[source]

    def _deflect(self, nominal: Array) -> Array:
        """Return the true directions (m, 3) of the beams in the sensor's frame."""
        sigma = math.radians(self.parameters.angular_noise_deg)
        if not (sigma or self._tilt.any()):
            return nominal
        up, side = self._tilt, np.zeros(len(nominal))
        if sigma:
            up = up + sigma * self._normal("elevation", len(nominal))
            side = sigma * self._normal("azimuth", len(nominal)).astype(np.float64)
        moved = nominal + _perpendicular(nominal, up, side)
        # They are square to each other.
        return moved / np.sqrt(1.0 + up * up + side * side)[:, None]

    def _aside(self, beam: Array) -> Array:
        """Return random vectors (m, 3) from the middles of beams at 1 m to points within them."""
        draw = self._next("beam").random((2, len(beam)))
        radius = 0.5 * math.radians(self.parameters.beam_divergence_deg) * np.sqrt(draw[0])
        angle = 2.0 * math.pi * draw[1]
        return _perpendicular(beam, radius * np.sin(angle), radius * np.cos(angle))

    def _within_beam(
        self,
        t: Array,
        origin: Array,
        towards: Array,
        aside: Array,
        targets: Targets,
        middle: tuple[Traced, Array],
    ) -> tuple[Array, Array]:
        """Return ranges and reflectivity times cosine (m,) of beams that have a width.

        The beam is its middle, with half of its energy, and two opposite rays at a random place
        of its disc. Of the surfaces that they meet the one that returns most decides; those that
        are nearer to it than the pulse is long are one return with it, at their weighted mean.

        :param t: (m,) times of the rays [s].
        :param origin: (m, 3) origins in the world [m]; ``towards`` (m, 3) unit vectors.
        :param aside: (m, 3) vectors across the beams to the random places, at a distance of 1.
        :param middle: what the middles of the beams meet, and the reflectivity (m,) there.
        """
        p = self.parameters
        parts = [(*middle, 0.5)]
        length = np.sqrt(1.0 + (aside * aside).sum(axis=1))[:, None]
        for ray in ((towards + aside) / length, (towards - aside) / length):
            traced = targets.trace(t, origin, ray)
            parts.append((traced, targets.reflectivity(traced), 0.25))
        distances = np.stack([traced.distance for traced, _, _ in parts])
        powers = np.stack([share * rho * np.abs(traced.along) for traced, rho, share in parts])
        returned = np.where(np.isfinite(distances), powers / np.maximum(distances, 1e-3) ** 2, 0.0)
        ray_index = np.arange(len(t))
        strongest = distances[np.argmax(returned, axis=0), ray_index]
        with np.errstate(invalid="ignore"):
            together = np.abs(distances - strongest) <= p.pulse_length
        returned *= together
        total = returned.sum(axis=0)
        with np.errstate(invalid="ignore"):
            mean = (np.where(returned > 0.0, distances, 0.0) * returned).sum(axis=0) / total
        alone = ~(total > 0.0)
        return np.where(alone, np.inf, mean), np.where(alone, 0.0, (powers * together).sum(axis=0))

    def detection_limit(self, power: Array) -> Array | None:
        """Return up to which ranges (m,) surfaces are detected; None: all are."""
        p = self.parameters
        if p.detection_range == 0.0:
            return None
        return p.detection_range * np.sqrt(power / p.detection_reflectivity)

    def _range_noise(self, range_: Array, limit: Array | None) -> AnyArray | None:
        """Return the noise of ranges (n,); None: there is none."""
        p = self.parameters
        if limit is None or p.range_noise_at_limit == 0.0:
            return p.range_noise * self._normal("range", len(range_)) if p.range_noise else None
        with np.errstate(divide="ignore", invalid="ignore"):
            distance_noise = p.range_noise_at_limit * np.minimum((range_ / limit) ** 2, 1.0)
        distance_noise[~np.isfinite(distance_noise)] = p.range_noise_at_limit
        return np.hypot(p.range_noise, distance_noise) * self._normal("range", len(range_))

    def _lose(
        self,
        outcome: NDArray[np.uint8],
        range_: Array,
        limit: Array | None,
        on_glass: Callable[[], Mask],
    ) -> None:
        """Set the outcome of the rays without a return.

        :param outcome: (n,) codes of the outcomes, changed in place.
        :param range_: (n,) measured ranges [m].
        :param limit: (n,) largest ranges at which the targets are detected [m]; None: no limit.
        :param on_glass: returns True (n,) for rays that hit glass.
        """
        p, count = self.parameters, len(range_)
        if limit is not None:
            if p.detection_spread > 0.0:
                limit = limit * np.exp(p.detection_spread * self._normal("detection", count))
            outcome[range_ > limit] = OUT_OF_RANGE
        outcome[~np.isfinite(range_)] = NOTHING
        if p.glass_transmission > 0.0:
            through = self._next("glass").random(count) < p.glass_transmission
            outcome[on_glass() & through & (outcome <= MIXED)] = GLASS
        if p.dropout_share > 0.0:
            outcome[self._next("dropout").random(count) < p.dropout_share] = LOST

    def _meet_rain(
        self, outcome: NDArray[np.uint8], range_: Array, intensity: Array, distance: Array
    ) -> None:
        """Replace the returns of rays that hit rain or dust.

        The first three arrays are changed in place.

        :param outcome: (n,) codes of the outcomes.
        :param range_: (n,) measured ranges [m].
        :param intensity: (n,) measured intensities.
        :param distance: (n,) true distances of the targets [m].
        """
        p, count = self.parameters, len(range_)
        if p.false_return_share == 0.0:
            return
        draw = self._next("rain").random((3, count))
        false_range = -p.false_return_range * np.log1p(-draw[1])
        false_returns: Mask = (
            (draw[0] < p.false_return_share) & (false_range < distance) & (outcome != LOST)
        )
        outcome[false_returns], range_[false_returns] = FALSE, false_range[false_returns]
        intensity[false_returns] = _FALSE_INTENSITY * draw[2][false_returns]


_ARRAYS: Final = (
    *((name, np.float32, ()) for name in ("range", "intensity")),
    ("direction", np.float32, (3,)),
    ("true_range", np.float32, ()),
    ("true_point", np.float32, (3,)),
    *((name, np.float32, ()) for name in ("range_error", "incidence", "reflectivity")),
    ("surface", np.int32, ()),
    ("body", np.uint8, ()),
    ("outcome", np.uint8, ()),
)
_OF_THE_BIAS: Final = ("range", "range_error")


def _perpendicular(directions: Array, up: Array, side: Array) -> Array:
    """Return vectors (m, 3) square to unit vectors: so far upwards and counterclockwise."""
    x, y, z = directions.T
    over = 1.0 / np.sqrt(np.maximum(x * x + y * y, _UPRIGHT))
    steep, azimuthal = up * z * over, side * over
    result = np.empty_like(directions)
    result[:, 0] = -x * steep - y * azimuthal
    result[:, 1] = -y * steep + x * azimuthal
    result[:, 2] = up / over
    return result
