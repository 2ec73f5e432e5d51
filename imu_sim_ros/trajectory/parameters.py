# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Parameters of the trajectories, one section for each ``trajectory.type``.

What every kind has: repetition, rests, vibration, lead-in, stands in the first of them.
"""

import itertools
import os
from collections.abc import Callable, Iterator
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Final, TypeAlias

from imu_sim_ros.core.errors import ConfigurationError
from imu_sim_ros.core.names import suggestion
from imu_sim_ros.parameters import files, kinds
from imu_sim_ros.parameters.kinds import (
    ZERO_VECTOR,
    Vector,
    choice,
    flag,
    integer,
    number,
    numbers,
    text,
    vector,
)
from imu_sim_ros.parameters.sections import section
from imu_sim_ros.places.catalogue import KINDS, size_problems

if TYPE_CHECKING:
    from imu_sim_ros.core.records import States

ENTRY_POINTS = "imu_sim_ros.trajectories"
"""Group of entry points under which other packages offer trajectories of their own."""
LEAST_KNOTS = 0.02
"""Least product of knot spacing and cut-off; below it the fit of a spline loses digits."""
PoseReader: TypeAlias = "Callable[..., States]"
"""Reads the poses of a file; called with the path, and the topic if one is given."""
GIVEN: Final = "given"
"""The type of a motion that Python gives as an object or a function; no file can name it."""
TYPE_TEXT = "kind of trajectory, a name in config/trajectories, or a file as --trajectory takes it"


@dataclass(frozen=True)
class VibrationParameters:
    """Vibration of the body along and about its own axes, on top of any motion or rest."""

    frequency: tuple[float, ...] = numbers(
        (), "frequency of each sinusoid", unit="Hz", minimum=0.0, above_minimum=True
    )
    acceleration: tuple[float, ...] = numbers(
        (), "amplitude of each sinusoid along x, y, z; none: all 0", unit="m/s^2", group=3
    )
    phase: tuple[float, ...] = numbers(
        (), "phase of each sinusoid at t = 0; none: all 0", unit="rad"
    )
    angular_rate: tuple[float, ...] = numbers(
        (),
        "amplitude of each sinusoid's rotation about x, y, z; none: all 0",
        unit="rad/s",
        group=3,
    )
    angular_phase: tuple[float, ...] = numbers(
        (), "phase of each sinusoid's rotation at t = 0; none: same as phase", unit="rad"
    )
    noise_rms: Vector = vector(
        ZERO_VECTOR, "band-limited noise: RMS of its acceleration", unit="m/s^2", minimum=0.0
    )
    angular_noise_rms: Vector = vector(
        ZERO_VECTOR, "rotation in the same band: RMS of its rate", unit="rad/s", minimum=0.0
    )
    noise_low: float = number(
        20.0, "lower end of the noise's band", unit="Hz", minimum=0.0, above_minimum=True
    )
    noise_high: float = number(
        80.0, "upper end of the noise's band", unit="Hz", minimum=0.0, above_minimum=True
    )
    noise_lines: int = integer(
        32, "sinusoids per axis that make up the noise", minimum=8, maximum=4096
    )
    seed: int = integer(0, "seed of the noise", minimum=0, maximum=2**63 - 1)

    def problems(self, prefix: str) -> Iterator[str]:
        """Yield a line for each list of a wrong length, and for a band without width."""
        count = len(self.frequency)
        for name, entries, may_be_empty in (
            ("acceleration", self.acceleration, bool(self.angular_rate)),
            ("angular_rate", self.angular_rate, True),
        ):
            if len(entries) != 3 * count and (entries or not may_be_empty):
                yield (
                    f"{prefix}{name} = {list(entries)}: must have three entries for "
                    f"each of the {count} in {prefix}frequency"
                )
        for name, entries in (("phase", self.phase), ("angular_phase", self.angular_phase)):
            if entries and len(entries) != count:
                yield (
                    f"{prefix}{name} = {list(entries)}: must be empty or have as many entries as "
                    f"{prefix}frequency, {count}"
                )
        if self.noise_high <= self.noise_low:
            yield (
                f"{prefix}noise_high = {self.noise_high:g}: must be above {prefix}noise_low, "
                f"{self.noise_low:g} Hz"
            )


@dataclass(frozen=True)
class LeadInParameters:
    """Rest and a jerk before any motion: what visual-inertial estimators initialise from."""

    rest: float = number(
        0.0, "rest before the jerk; 0: neither rest nor jerk", unit="s", minimum=0.0
    )
    jerk: Vector = vector(
        (0.1, 0.1, 0.2), "displacement of the jerk in the world, there and back", unit="m"
    )
    jerk_time: float = number(1.0, "length of the jerk", unit="s", minimum=0.05, maximum=100.0)


@dataclass(frozen=True)
class TrajectoryParameters:
    """Parameters of every trajectory, applied in the order length, repeat, time scale and rests."""

    type: str = text("static", TYPE_TEXT)
    length: float = number(0.0, "use this much of the motion; 0: all of it", unit="s", minimum=0.0)
    repeat: int = integer(1, "number of times the motion is run; 0: endless", minimum=0)
    repeat_mode: str = choice(
        "loop",
        ("loop", "there_and_back"),
        "loop: from the start again, for closed motions; there_and_back: to the end, back, ...",
    )
    time_scale: float = number(
        1.0,
        "2: twice as fast, with four times the accelerations",
        minimum=0.0,
        above_minimum=True,
        maximum=1000.0,
    )
    rest_before: float = number(0.0, "rest before the motion", unit="s", minimum=0.0)
    rest_after: float = number(0.0, "rest after the motion", unit="s", minimum=0.0)
    rest_transition: float = number(
        2.0,
        "time in which the motion starts from rest, comes to rest, or reverses",
        unit="s",
        minimum=0.0,
        above_minimum=True,
    )
    lead_in: LeadInParameters = section(LeadInParameters)
    vibration: VibrationParameters = section(VibrationParameters)


@dataclass(frozen=True)
class SeriesParameters:
    """One coordinate as a function of time: a polynomial and a sum of sinusoids.

    ``sum_k polynomial[k] t^k + sum_j amplitude[j] sin(angular_frequency[j] t + phase[j])``
    """

    polynomial: tuple[float, ...] = numbers(
        (), "coefficients of t^0, t^1, t^2, ...", unit="m or rad per s^k"
    )
    amplitude: tuple[float, ...] = numbers((), "amplitude of each sinusoid", unit="m or rad")
    angular_frequency: tuple[float, ...] = numbers(
        (), "angular frequency of each sinusoid", unit="rad/s", minimum=0.0, above_minimum=True
    )
    phase: tuple[float, ...] = numbers(
        (), "phase of each sinusoid at t = 0 (pi/2 makes a cosine); none: all 0", unit="rad"
    )

    def problems(self, prefix: str) -> Iterator[str]:
        """Yield what is wrong with the lengths of the lists."""
        count = len(self.amplitude)
        if len(self.angular_frequency) != count:
            yield (
                f"{prefix}angular_frequency = {list(self.angular_frequency)}: must have as many "
                f"entries as {prefix}amplitude, {count}"
            )
        if self.phase and len(self.phase) != count:
            yield (
                f"{prefix}phase = {list(self.phase)}: must be empty or have as many entries as "
                f"{prefix}amplitude, {count}"
            )


@dataclass(frozen=True)
class StaticParameters(TrajectoryParameters):
    """A body at rest."""

    type: str = text("static", TYPE_TEXT)
    position: Vector = vector(ZERO_VECTOR, "position in the world", unit="m")
    roll_pitch_yaw: Vector = vector(ZERO_VECTOR, "attitude", unit="rad")


@dataclass(frozen=True)
class HarmonicParameters(TrajectoryParameters):
    """Position and Euler angles, each a polynomial and a sum of sinusoids."""

    type: str = text("harmonic", TYPE_TEXT)
    x: SeriesParameters = section(SeriesParameters)
    y: SeriesParameters = section(SeriesParameters)
    z: SeriesParameters = section(SeriesParameters)
    roll: SeriesParameters = section(SeriesParameters)
    pitch: SeriesParameters = section(SeriesParameters)
    yaw: SeriesParameters = section(SeriesParameters)


@dataclass(frozen=True)
class PolarParameters(TrajectoryParameters):
    """A motion along a radius that turns about z; the body turns with it."""

    type: str = text("polar", TYPE_TEXT)
    radius: SeriesParameters = section(SeriesParameters)
    angle: SeriesParameters = section(SeriesParameters)
    height: float = number(0.0, "height of the plane in the world", unit="m")


@dataclass(frozen=True)
class FreeFallParameters(TrajectoryParameters):
    """A body thrown and falling, tumbling at a constant rate."""

    type: str = text("free_fall", TYPE_TEXT)
    position: Vector = vector((0.0, 0.0, 1.5), "position at the start", unit="m")
    velocity: Vector = vector((2.0, 0.0, 10.0), "velocity at the start, in the world", unit="m/s")
    roll_pitch_yaw: Vector = vector(ZERO_VECTOR, "attitude at the start", unit="rad")
    angular_velocity: Vector = vector((1.0, 2.0, 0.5), "constant rate in the body", unit="rad/s")
    gravity: Vector = kinds.gravity(
        "acceleration of the fall; equal to the simulation's gravity for true free fall"
    )


@dataclass(frozen=True)
class WaypointsParameters(TrajectoryParameters):
    """A smooth path through given waypoints, at rest at both ends."""

    type: str = text("waypoints", TYPE_TEXT)
    positions: tuple[float, ...] = numbers(
        (0.0, 0.0, 0.0, 1.0, 0.0, 0.0), "x, y, z of each waypoint", unit="m", group=3
    )
    headings: tuple[float, ...] = numbers(
        (), "yaw at each waypoint, not wrapped (2 pi is a full turn); none: all 0", unit="rad"
    )
    times: tuple[float, ...] = numbers(
        (),
        "time of each waypoint, the first 0; none: as fast as the limits allow",
        unit="s",
        minimum=0.0,
    )
    speed_limit: float = number(
        1.0, "largest speed, if no times are given", unit="m/s", minimum=0.0, above_minimum=True
    )
    acceleration_limit: float = number(
        1.0,
        "largest acceleration, if no times are given",
        unit="m/s^2",
        minimum=0.0,
        above_minimum=True,
    )
    heading_rate_limit: float = number(
        1.0,
        "largest heading rate, if no times are given",
        unit="rad/s",
        minimum=0.0,
        above_minimum=True,
    )

    def problems(self, prefix: str) -> Iterator[str]:
        """Yield a line for each list that does not match, and for waypoints that collide."""
        places = [self.positions[k : k + 3] for k in range(0, len(self.positions), 3)]
        count = len(places)
        if count < 2:
            yield f"{prefix}positions = {list(self.positions)}: must be at least two waypoints"
        for name, entries in (("headings", self.headings), ("times", self.times)):
            if entries and len(entries) != count:
                yield (
                    f"{prefix}{name}: {len(entries)} entries; must be empty or one for each of the "
                    f"{count} waypoints"
                )
        if self.times:
            if self.times[0] != 0.0:
                yield (
                    f"{prefix}times: waypoint 1 at {self.times[0]:g} s: must be at 0; "
                    f"{prefix}rest_before adds rest before the motion"
                )
            for k in range(1, len(self.times)):
                if self.times[k] <= self.times[k - 1]:
                    yield (
                        f"{prefix}times: waypoint {k + 1} at {self.times[k]:g} s: must be after "
                        f"waypoint {k} at {self.times[k - 1]:g} s"
                    )
        else:
            headings = self.headings or (0.0,) * count
            poses = list(zip(places, headings, strict=False))
            for k in range(1, len(poses)):
                if poses[k] == poses[k - 1]:
                    yield (
                        f"{prefix}positions: waypoints {k} and {k + 1} are the same; "
                        f"leave one out or give {prefix}times"
                    )


@dataclass(frozen=True)
class TourParameters(TrajectoryParameters):
    """A flight through a place that touches nothing and ends where it began."""

    type: str = text("tour", TYPE_TEXT)
    place: str = choice(
        "office", tuple(KINDS), "place to fly through; if sensors see a place, that place"
    )
    place_seed: int = integer(
        0, "seed of the place; if sensors see a place, scene.seed", minimum=0, maximum=2**63 - 1
    )
    place_size: Vector = vector(
        ZERO_VECTOR,
        "size of the place along x, y, z, around x = y = 0 on z = 0; 0: its usual size",
        unit="m",
        minimum=0.0,
        maximum=500.0,
    )
    speed_limit: float = number(1.0, "largest speed", unit="m/s", minimum=0.0, above_minimum=True)
    acceleration_limit: float = number(
        1.0, "largest acceleration", unit="m/s^2", minimum=0.0, above_minimum=True
    )
    heading_rate_limit: float = number(
        1.0, "largest heading rate", unit="rad/s", minimum=0.0, above_minimum=True
    )

    def problems(self, prefix: str) -> Iterator[str]:
        """Yield a line if the place is too small."""
        yield from size_problems(self.place, self.place_size, f"{prefix}place_size")


@dataclass(frozen=True)
class DriveParameters(TrajectoryParameters):
    """A vehicle that drives along a route on the ground, without side slip."""

    type: str = text("drive", TYPE_TEXT)
    positions: tuple[float, ...] = numbers(
        (0.0, 0.0, 60.0, 0.0, 60.0, 40.0, 0.0, 40.0),
        "x, y of each waypoint, if there is no file",
        unit="m",
        group=2,
    )
    file: str = text(
        "",
        "route to drive: CSV with the columns x, y or latitude, longitude, or GPX, or KML",
    )
    origin: tuple[float, ...] = numbers(
        (),
        "latitude and longitude of the world's origin, for a file with latitudes and longitudes; "
        "empty: its first point",
        unit="deg",
        group=2,
    )
    use_times: bool = flag(False, "keep the times of the file: its column t, or its time stamps")
    times: tuple[float, ...] = numbers(
        (),
        "time of each waypoint of positions, the first 0; the same waypoint twice: stand there; "
        "none: as fast as the limits allow",
        unit="s",
        minimum=0.0,
    )
    elevations: tuple[float, ...] = numbers(
        (), "z of each waypoint in positions; none: the height of the ground", unit="m"
    )
    use_elevations: bool = flag(
        False,
        "take the elevations of the ground from the file: those of GPX or KML, or the column z, "
        "elevation or altitude; with latitudes and longitudes, z is 0 at the first point",
    )
    elevation_smoothing: float = number(
        10.0,
        "distance over which elevations are averaged and a change of grade is spread",
        unit="m",
        minimum=0.01,
        maximum=1e4,
    )
    stops: tuple[float, ...] = numbers(
        (),
        "number of a waypoint, from 1, and how long to stand there, alternating",
        unit="1, s",
        group=2,
        minimum=0.0,
    )
    laps: int = integer(
        0,
        "number of laps, from the last waypoint back to the first; 0: once from first to last",
        minimum=0,
        maximum=10_000,
    )
    deviation: float = number(
        0.0,
        "how far the path may pass from a waypoint; 0: through each",
        unit="m",
        minimum=0.0,
        maximum=1e4,
    )
    turning_radius: float = number(
        4.0, "smallest radius of a turn", unit="m", minimum=1e-2, maximum=1e5
    )
    speed_limit: float = number(
        5.0, "largest speed", unit="m/s", minimum=0.0, above_minimum=True, maximum=1e3
    )
    speeds: tuple[float, ...] = numbers(
        (),
        "largest speed on the way to each waypoint but the first, negative to back up; none: "
        "speed_limit",
        unit="m/s",
    )
    acceleration_limit: float = number(
        1.5,
        "largest acceleration along the path",
        unit="m/s^2",
        minimum=0.0,
        above_minimum=True,
        maximum=1e3,
    )
    braking_limit: float = number(
        2.0, "largest deceleration", unit="m/s^2", minimum=0.0, above_minimum=True, maximum=1e3
    )
    lateral_limit: float = number(
        2.0,
        "largest acceleration across the path",
        unit="m/s^2",
        minimum=0.0,
        above_minimum=True,
        maximum=1e3,
    )
    heading_rate_limit: float = number(
        1.0, "largest turn rate", unit="rad/s", minimum=0.0, above_minimum=True, maximum=1e3
    )
    smoothing_time: float = number(
        0.6,
        "time over which a change of acceleration is spread",
        unit="s",
        minimum=0.01,
        maximum=100.0,
    )
    slope: tuple[float, ...] = numbers(
        (0.0, 0.0), "rise of the plane along the world's x and y", unit="1", group=2
    )
    height_map: str = text(
        "", "heights of the ground in the world, as an ESRI ASCII grid; empty: the plane"
    )
    track: float = number(
        1.5,
        "width over which the cross slope of a height map is taken",
        unit="m",
        minimum=1e-3,
        maximum=100.0,
    )
    suspension_pitch: float = number(
        0.0,
        "the body's nose rises by this much for each m/s^2 along the path",
        unit="rad s^2/m",
        minimum=0.0,
        maximum=0.1,
    )
    suspension_roll: float = number(
        0.0,
        "the body leans out of a turn by this much for each m/s^2 across the path",
        unit="rad s^2/m",
        minimum=0.0,
        maximum=0.1,
    )
    suspension_frequency: float = number(
        1.5, "natural frequency of pitch and roll", unit="Hz", minimum=0.1, maximum=5.0
    )
    suspension_damping: float = number(
        0.3, "damping ratio of both", unit="1", minimum=0.05, maximum=2.0
    )
    road: VibrationParameters = section(VibrationParameters)
    road_speed: float = number(
        10.0,
        "speed at which `road.*` applies as given; frequencies grow with the speed, "
        "accelerations with its square",
        unit="m/s",
        minimum=0.0,
        above_minimum=True,
    )

    def problems(self, prefix: str) -> Iterator[str]:
        """Yield a line for each value that does not fit another one."""
        if len(self.slope) != 2:
            yield f"{prefix}slope = {list(self.slope)}: must be two numbers"
        if self.origin and len(self.origin) != 2:
            yield f"{prefix}origin = {list(self.origin)}: must be two numbers"
        elif self.origin and abs(self.origin[0]) > 90.0:
            yield f"{prefix}origin: latitude {self.origin[0]:g}: must be within 90 deg"
        yield from self._file_problems(prefix) if self.file else self._waypoint_problems(prefix)
        yield from self._ground_problems(prefix)
        if self.times or self.use_times:
            rules = {"stops": self.stops, "laps": self.laps, "speeds": self.speeds}
            for name, rule in rules.items():
                if rule:
                    yield f"{prefix}{name}: must be left out if times are given"
            if self.deviation:
                yield f"{prefix}deviation = {self.deviation:g}: must be 0 if times are given"

    def _file_problems(self, prefix: str) -> Iterator[str]:
        """Yield a line for each value that is for waypoints, not for a file."""
        if self.times:
            yield f"{prefix}times: are for {prefix}positions; a file has its own, use_times"
        if self.elevations:
            yield f"{prefix}elevations: are for {prefix}positions; a file: use_elevations"

    def _waypoint_problems(self, prefix: str) -> Iterator[str]:
        """Yield a line for each value that does not fit the waypoints."""
        if self.use_times:
            yield f"{prefix}use_times = true: needs {prefix}file; {prefix}times are for positions"
        if self.use_elevations:
            yield f"{prefix}use_elevations = true: needs {prefix}file"
        count = len(self.positions) // 2
        if count < 2:
            yield f"{prefix}positions = {list(self.positions)}: must be at least two waypoints"
        for name, entries in (("times", self.times), ("elevations", self.elevations)):
            if entries and len(entries) != count:
                yield (
                    f"{prefix}{name}: {len(entries)} entries; must be empty or one for each of "
                    f"the {count} waypoints"
                )
        if self.times and self.times[0] != 0.0:
            yield f"{prefix}times: waypoint 1 at {self.times[0]:g} s: must be at 0"
        for k, (earlier, time) in enumerate(itertools.pairwise(self.times), 1):
            if time <= earlier:
                yield (
                    f"{prefix}times: waypoint {k + 1} at {time:g} s: must be after waypoint {k} at "
                    f"{earlier:g} s"
                )

    def _ground_problems(self, prefix: str) -> Iterator[str]:
        """Yield a line for each value that does not fit the ground: plane, heights or route."""
        name = "elevations" if self.elevations else "use_elevations"
        has_elevations = bool(self.elevations) or self.use_elevations
        if has_elevations and self.height_map:
            yield f"{prefix}{name}: must be left out with {prefix}height_map, which has its own"
        if has_elevations and any(self.slope):
            yield f"{prefix}{name}: must be left out with {prefix}slope, which has its own"
        if 0.0 in self.speeds:
            yield f"{prefix}speeds: 0 m/s: must be above 0, or below to back up"
        if any(speed < 0.0 for speed in self.speeds) and (has_elevations or self.height_map):
            ground = "height_map" if self.height_map else name
            yield f"{prefix}speeds: must be above 0 with {prefix}{ground}; it backs up on a plane"


@dataclass(frozen=True)
class SixPositionParameters(TrajectoryParameters):
    """Rest with each body axis up and down (z, x, y), turned over in between; closed."""

    type: str = text("six_position", TYPE_TEXT)
    soak: float = number(
        0.0,
        "rest before the first position, until the temperature has settled",
        unit="s",
        minimum=0.0,
    )
    settle: float = number(
        2.0, "rest after each turn, until the body has settled", unit="s", minimum=0.0
    )
    dwell: float = number(
        30.0, "rest in each position, to measure", unit="s", minimum=0.0, above_minimum=True
    )
    transition: float = number(
        3.0, "time of a turn to the next position", unit="s", minimum=0.0, above_minimum=True
    )


@dataclass(frozen=True)
class TurntableParameters(SixPositionParameters):
    """Each body axis up in turn, spun about it at several rates in both directions; closed."""

    type: str = text("turntable", TYPE_TEXT)
    rates: tuple[float, ...] = numbers(
        (0.5, 1.0, 2.0), "constant rates", unit="rad/s", minimum=0.0, above_minimum=True
    )
    ramp: float = number(
        2.0, "time to get up to speed and to stop", unit="s", minimum=0.0, above_minimum=True
    )
    dwell: float = number(
        10.0,
        "time at rest before the rates, and at each rate",
        unit="s",
        minimum=0.0,
        above_minimum=True,
    )
    upside_down: bool = flag(
        True, "also turn with each axis down, to separate g-sensitivity from bias"
    )
    tilt: float = number(
        0.0, "tilt of the table's axis from the vertical, about the world's x", unit="rad"
    )

    def problems(self, prefix: str) -> Iterator[str]:
        """Yield a line if there is nothing to do."""
        if not self.rates:
            yield f"{prefix}rates = []: must have at least one entry [rad/s]"


@dataclass(frozen=True)
class PosesParameters(TrajectoryParameters):
    """Recorded poses, followed by a B-spline."""

    type: str = text("poses", TYPE_TEXT)
    file: str = text("", "recorded poses: a bag, a log, a motion capture, or text")
    topic: str = text("", "topic of a bag, or segment of a motion capture; empty: the only one")
    scale: float = number(
        1.0,
        "factor of the positions, for a file in another unit than its reader takes",
        minimum=0.0,
        above_minimum=True,
    )
    up: str = choice(
        "z",
        ("x", "y", "z", "-x", "-y", "-z"),
        "axis of the poses that points up; others than z change places until z is up",
    )
    knot_spacing: float = number(
        0.0,
        "time between the spline's knots; 0: the longest of 0.02 s, the poses' usual interval and "
        "0.2 / cutoff",
        unit="s",
        minimum=0.0,
    )
    cutoff: float = number(
        12.0,
        "motion at higher frequencies is smoothed out",
        unit="Hz",
        minimum=0.0,
        above_minimum=True,
    )
    outlier_distance: float = number(
        0.0,
        "poses this far from the spline get half the weight, farther ones less; 0: equal weights",
        unit="m",
        minimum=0.0,
    )
    robust: bool = flag(
        False,
        "repair the recording: drop outliers, close jumps, put jittered arrival stamps on an "
        "even grid; otherwise these only cause warnings",
    )
    max_gap: float = number(
        5.0, "longer gaps between poses are an error", unit="s", minimum=0.0, above_minimum=True
    )

    def problems(self, prefix: str) -> Iterator[str]:
        """Yield a line if the file is missing, and if the knots are too dense."""
        if not self.file:
            yield f"{prefix}file = '': must name a file of poses"
        smallest = LEAST_KNOTS / self.cutoff
        if 0.0 < self.knot_spacing < smallest:
            yield (
                f"{prefix}knot_spacing = {self.knot_spacing:g}: must be 0 or at least "
                f"{LEAST_KNOTS} / {prefix}cutoff, {smallest:.3g} s"
            )


TYPES: dict[str, type[TrajectoryParameters]] = {
    "static": StaticParameters,
    "harmonic": HarmonicParameters,
    "polar": PolarParameters,
    "free_fall": FreeFallParameters,
    "waypoints": WaypointsParameters,
    "tour": TourParameters,
    "drive": DriveParameters,
    "six_position": SixPositionParameters,
    "turntable": TurntableParameters,
    "poses": PosesParameters,
}


def find_trajectory(name: str) -> type[TrajectoryParameters]:
    """Return the section of a trajectory type: one of ours, or an entry point's of that name.

    :raises ConfigurationError: for a type that does not exist or cannot be loaded.
    """
    if name == GIVEN:
        return TrajectoryParameters
    if name in TYPES:
        return TYPES[name]
    from importlib.metadata import entry_points  # a search of all packages; seldom needed

    plugins = {point.name: point for point in entry_points(group=ENTRY_POINTS)}
    if name not in plugins:
        names = [*TYPES, *sorted(plugins)]
        otherwise = f"must be one of {', '.join(names)}, a name in config/trajectories, or a file"
        hint = suggestion(name, [*names, *files.names("trajectories")], otherwise)
        raise ConfigurationError(f"trajectory.type = {name!r}: {hint}")
    point = plugins[name]
    try:
        trajectory_class = point.load()
    except Exception as error:  # code of other people: whatever it raises
        raise ConfigurationError(
            f"trajectory.type = {name!r}: {point.value} cannot be loaded: {error}"
        ) from error
    if not (
        isinstance(trajectory_class, type) and issubclass(trajectory_class, TrajectoryParameters)
    ):
        raise ConfigurationError(
            f"trajectory.type = {name!r}: {point.value} is not a class derived from "
            "TrajectoryParameters"
        )
    return trajectory_class


def names_a_file(trajectory: str) -> bool:
    """Return whether a trajectory is a file, in config/trajectories or anywhere, and no kind."""
    return files.is_included("trajectories", trajectory) or (
        trajectory not in (*TYPES, GIVEN) and os.path.exists(trajectory)
    )


def trajectory_layer(name_or_file: str) -> dict[str, object]:
    """Return the parameters of ``--trajectory``, or a node's ``trajectory.type``.

    :param name_or_file: a name in config/trajectories, a kind of trajectory, a parameter file, a
        route to drive (GPX or KML), or recorded poses: a text file, or a bag.
    """
    path = Path(name_or_file)
    if not names_a_file(name_or_file):
        with suppress(ConfigurationError):  # it is no kind either
            find_trajectory(name_or_file)
            return {"trajectory.type": name_or_file}
    if not files.is_included("trajectories", name_or_file) and path.is_dir():
        return {"trajectory.type": "poses", "trajectory.file": str(path)}
    path = files.find("trajectories", name_or_file)
    if path.suffix.lower() in (".yaml", ".yml"):
        return files.load(path)
    kind = "drive" if path.suffix.lower() in (".gpx", ".kml") else "poses"
    return {"trajectory.type": kind, "trajectory.file": str(path)}
