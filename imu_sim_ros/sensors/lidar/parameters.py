# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Parameters of a LiDAR: ``lidar.*``."""

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Final

from imu_sim_ros.parameters.kinds import NumberLimits, choice, flag, integer, number, numbers, text
from imu_sim_ros.sensors.lidar.layouts import LAYOUTS
from imu_sim_ros.sensors.parameters import SensorParameters

PATTERNS: Final = ("spinning", "rosette", "nodding", "table")
FORMS: Final = ("kitti", "ply", "pcd")
MOST_RAYS: Final = 2_000_000
"""Largest number of rays in a scan."""
_SHARE: Final[NumberLimits] = {"minimum": 0.0, "maximum": 1.0}
_LENGTH: Final[NumberLimits] = {"minimum": 0.0, "maximum": 1e4}


@dataclass(frozen=True)
class LidarParameters(SensorParameters):
    """A LiDAR: x ahead, y to the left, z up, azimuths counterclockwise from x."""

    rate: float = number(
        10.0, "scans per second; of a spinning one its turns", unit="Hz", minimum=0.1, maximum=1e3
    )
    frame: str = text("lidar", "frame of its messages")
    preset: str = text("none", "file in config/lidar, or a path, to start from")
    layout: str = choice(
        "velodyne", tuple(LAYOUTS), "fields of each point, as the drivers of makers write them"
    )
    files: str = choice(
        "none",
        ("none", *FORMS),
        "a file for each scan in OUTPUT_scans: kitti (x, y, z, reflectance; no times), ply or pcd",
    )
    pattern: str = choice(
        "spinning",
        PATTERNS,
        "spinning: channels at fixed elevations turn about z; rosette: prisms deflect the beams, "
        "around x; nodding: beams turn about z while their elevation goes up and down; table: "
        "directions from a file",
    )
    elevations_deg: tuple[float, ...] = numbers(
        (-15.0, -5.0, 5.0, 15.0),
        "spinning: elevation of each channel, in the order in which they fire",
        unit="deg",
        minimum=-90.0,
        maximum=90.0,
    )
    azimuth_offsets_deg: tuple[float, ...] = numbers(
        (), "spinning: azimuth of each channel relative to the turn; empty: 0", unit="deg"
    )
    firing_period: float = number(
        1e-4,
        "spinning: time from one firing of all channels to the next",
        unit="s",
        minimum=1e-7,
        maximum=1.0,
    )
    channel_interval: float = number(
        0.0,
        "spinning: time from one channel to the next within a firing; 0: all at once",
        unit="s",
        minimum=0.0,
        maximum=0.1,
    )
    clockwise: bool = flag(True, "spinning, nodding: direction of the turn, seen from above")
    start_azimuth_deg: float = number(
        180.0, "spinning, nodding: azimuth at the start of a scan", unit="deg", minimum=-360.0,
        maximum=360.0,
    )  # fmt: skip
    top_ring_first: bool = flag(False, "ring 0 is the highest channel, not the lowest")
    point_rate: float = number(
        1e5, "rosette, nodding: points per second of all lines", unit="1/s", minimum=1.0,
        maximum=1e7,
    )  # fmt: skip
    lines: int = integer(
        1, "rosette, nodding: beams that fire in turn, one above the other", minimum=1, maximum=128
    )
    line_spacing_deg: float = number(
        0.0, "rosette, nodding: elevation between two lines", unit="deg", minimum=0.0, maximum=90.0
    )
    prism_rates: tuple[float, ...] = numbers(
        (120.0, -77.0), "rosette: turns per second of each prism", unit="1/s"
    )
    prism_deflections_deg: tuple[float, ...] = numbers(
        (10.0, 9.0), "rosette: angle by which each prism deflects", unit="deg", minimum=0.0,
        maximum=60.0,
    )  # fmt: skip
    turn_rate: float = number(
        10.0, "nodding: turns per second about z", unit="1/s", minimum=0.0, maximum=1e4
    )
    nod_rate: float = number(
        100.0, "nodding: how often per second the elevation goes up and down", unit="1/s",
        minimum=0.0, maximum=1e5,
    )  # fmt: skip
    elevation_limits_deg: tuple[float, ...] = numbers(
        (-10.0, 10.0), "nodding: lowest and highest elevation", unit="deg", minimum=-90.0,
        maximum=90.0, group=2,
    )  # fmt: skip
    table: str = text(
        "",
        "table: CSV with time [s], azimuth [deg], elevation [deg] of one scan, and a ring if any",
    )

    minimum_range: float = number(0.0, "nearer surfaces are not seen", unit="m", **_LENGTH)
    maximum_range: float = number(
        200.0, "largest range that is reported", unit="m", minimum=1e-3, maximum=1e4
    )
    detection_range: float = number(
        0.0,
        "range at which a surface of detection_reflectivity is just seen square on; others to "
        "sqrt(reflectivity cos(incidence) / detection_reflectivity) of it (0: all)",
        unit="m",
        **_LENGTH,
    )
    detection_reflectivity: float = number(
        0.1, "diffuse reflectivity for which detection_range holds", unit="1",
        minimum=0.0, above_minimum=True, maximum=1.0,
    )  # fmt: skip
    detection_spread: float = number(
        0.0,
        "standard deviation of the logarithm of that range, from ray to ray",
        unit="1",
        **_SHARE,
    )
    reflectivity: float = number(
        0.5, "diffuse reflectivity of surfaces whose material is not known", unit="1",
        minimum=0.0, above_minimum=True, maximum=1.0,
    )  # fmt: skip
    range_noise: float = number(
        0.02, "standard deviation of a range, near", unit="m", live=True, **_LENGTH
    )
    range_noise_at_limit: float = number(
        0.0,
        "standard deviation that is added at the limit of detection; it grows with the square of "
        "the share of that range (0 without detection_range)",
        unit="m",
        live=True,
        **_LENGTH,
    )
    range_bias: float = number(
        0.0, "constant error of all ranges", unit="m", minimum=-100.0, maximum=100.0, live=True
    )
    ring_bias: tuple[float, ...] = numbers(
        (), "constant error of the ranges of each ring; empty: drawn with ring_bias_sigma", unit="m"
    )
    ring_bias_sigma: float = number(0.0, "standard deviation of that error", unit="m", **_LENGTH)
    ring_elevation_error_deg: tuple[float, ...] = numbers(
        (),
        "true minus nominal elevation of each ring; empty: drawn with ring_elevation_sigma_deg",
        unit="deg",
        minimum=-10.0,
        maximum=10.0,
    )
    ring_elevation_sigma_deg: float = number(
        0.0, "standard deviation of that error", unit="deg", minimum=0.0, maximum=10.0
    )
    angular_noise_deg: float = number(
        0.0, "standard deviation of the direction, on both axes", unit="deg", minimum=0.0,
        maximum=10.0, live=True,
    )  # fmt: skip
    range_resolution: float = number(0.0, "step of the ranges; 0: none", unit="m", **_LENGTH)
    beam_divergence_deg: float = number(
        0.0,
        "full angle of the beam: at an edge ranges lie between both surfaces; 0: a thin ray",
        unit="deg",
        minimum=0.0,
        maximum=10.0,
    )
    pulse_length: float = number(
        0.5, "surfaces within a beam nearer to each other than this give one return", unit="m",
        **_LENGTH,
    )  # fmt: skip
    glass_transmission: float = number(
        0.0, "share of rays that glass returns nothing of", unit="1", live=True, **_SHARE
    )
    dropout_share: float = number(
        0.0, "share of rays of which nothing returns", unit="1", live=True, **_SHARE
    )
    false_return_share: float = number(
        0.0, "share of rays that meet rain or dust, if nothing is nearer", unit="1", live=True,
        **_SHARE,
    )  # fmt: skip
    false_return_range: float = number(
        3.0, "mean range of rain and dust, exponentially distributed", unit="m", minimum=1e-3,
        maximum=1e4,
    )  # fmt: skip
    intensity_range: float = number(
        0.0,
        "intensities are 100 reflectivity cos(incidence), and fall with the square of the range "
        "beyond this one; 0: the sensor makes up for the range",
        unit="m",
        **_LENGTH,
    )
    intensity_noise: float = number(
        0.0, "standard deviation of an intensity, relative to it", unit="1", live=True, **_SHARE
    )

    @property
    def span(self) -> float:
        """Duration of a scan [s]."""
        return 1.0 / self.rate

    @property
    def rings(self) -> int:
        """Number of rings; 0: the table has them."""
        if self.pattern == "spinning":
            return len(self.elevations_deg)
        return 0 if self.pattern == "table" else self.lines

    @property
    def longest_window(self) -> float:
        """Longest time that is read at once [s]: one scan."""
        return self.span

    def problems(self, prefix: str) -> Iterator[str]:
        """Yield a line for each contradiction between parameters."""
        yield from super().problems(prefix)
        if self.minimum_range >= self.maximum_range:
            yield (
                f"{prefix}minimum_range = {self.minimum_range:g}: must be below "
                f"{prefix}maximum_range, {self.maximum_range:g} m"
            )
        for name, numbers_of_rings in (
            ("ring_bias", self.ring_bias),
            ("ring_elevation_error_deg", self.ring_elevation_error_deg),
        ):
            count = len(numbers_of_rings)
            if self.rings and count not in (0, self.rings):
                yield f"{prefix}{name}: has {count} numbers; must be empty or have {self.rings}"
        if self.rings > LAYOUTS[self.layout].most_rings:
            yield (
                f"{prefix}layout = {self.layout!r}: has at most {LAYOUTS[self.layout].most_rings} "
                f"rings, of {self.rings}"
            )
        problems_of_patterns = {
            "spinning": self._problems_of_spinning,
            "rosette": self._problems_of_rosette,
            "nodding": self._problems_of_nodding,
            "table": self._problems_of_table,
        }
        yield from problems_of_patterns[self.pattern](prefix)

    def _problems_of_spinning(self, prefix: str) -> Iterator[str]:
        """Yield problems of a spinning lidar."""
        channels = len(self.elevations_deg)
        if not channels:
            yield f"{prefix}elevations_deg = []: must hold the elevation of one channel at least"
        if len(self.azimuth_offsets_deg) not in (0, channels):
            yield (
                f"{prefix}azimuth_offsets_deg: has {len(self.azimuth_offsets_deg)} numbers; must "
                f"be empty or have {channels}, as {prefix}elevations_deg"
            )
        if self.firing_period > self.span:
            yield f"{prefix}firing_period = {self.firing_period:g}: must be at most {self.span:g} s"
        if self.channel_interval * (channels - 1) >= self.firing_period:
            yield (
                f"{prefix}channel_interval = {self.channel_interval:g}: {channels} channels do not "
                f"fit into {prefix}firing_period, {self.firing_period:g} s"
            )
        if channels:
            yield from self._ray_count_problems(prefix, channels * self.span / self.firing_period)

    def _problems_of_rosette(self, prefix: str) -> Iterator[str]:
        """Yield problems of a lidar with rotating prisms."""
        if len(self.prism_rates) != len(self.prism_deflections_deg) or not self.prism_rates:
            yield (
                f"{prefix}prism_rates: has {len(self.prism_rates)} numbers; must have one or more, "
                f"as many as {prefix}prism_deflections_deg, {len(self.prism_deflections_deg)}"
            )
        if sum(self.prism_deflections_deg) + self._above() > 89.0:
            yield f"{prefix}prism_deflections_deg: beams must stay within 89 deg of x"
        yield from self._ray_count_problems(prefix, self.point_rate * self.span)

    def _problems_of_nodding(self, prefix: str) -> Iterator[str]:
        """Yield problems of a nodding lidar."""
        limits = self.elevation_limits_deg
        if len(limits) != 2 or limits[0] > limits[1]:
            yield f"{prefix}elevation_limits_deg = {list(limits)}: must be two numbers in order"
        elif max(-limits[0], limits[1]) + self._above() > 90.0:
            yield f"{prefix}line_spacing_deg: lines must stay within 90 deg of the horizon"
        yield from self._ray_count_problems(prefix, self.point_rate * self.span)

    def _problems_of_table(self, prefix: str) -> Iterator[str]:
        """Yield problems of a pattern in a table."""
        if not self.table:
            yield f"{prefix}table = '': must name a file"

    def _above(self) -> float:
        """Return how far the outer lines are from the middle [deg]."""
        return 0.5 * (self.lines - 1) * self.line_spacing_deg

    def _ray_count_problems(self, prefix: str, rays: float) -> Iterator[str]:
        """Yield a problem if a scan has too many rays, or none."""
        if not 1.0 <= rays <= MOST_RAYS:
            yield f"{prefix}rate = {self.rate:g}: a scan has {rays:.0f} rays; 1 to {MOST_RAYS:,}"
