# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Parameters of the trajectories, one section for each ``trajectory.type``."""

import os
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

from imu_sim_ros.errors import ConfigurationError
from imu_sim_ros.names import suggestion
from imu_sim_ros.parameters import files, kinds
from imu_sim_ros.parameters.included import names
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
from imu_sim_ros.trajectory.common_parameters import (
    GIVEN,
    TYPE_TEXT,
    LeadInParameters,
    PoseReader,
    TrajectoryParameters,
    VibrationParameters,
)
from imu_sim_ros.trajectory.drive_parameters import DriveParameters

if TYPE_CHECKING:
    from imu_sim_ros.trajectory.motion import Trajectory


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


__all__ = [
    "ENTRY_POINTS",
    "TYPES",
    "DriveParameters",
    "FreeFallParameters",
    "HarmonicParameters",
    "LeadInParameters",
    "PolarParameters",
    "PosesParameters",
    "SeriesParameters",
    "SixPositionParameters",
    "StaticParameters",
    "TourParameters",
    "TrajectoryParameters",
    "TurntableParameters",
    "VibrationParameters",
    "WaypointsParameters",
    "find_trajectory",
]

ENTRY_POINTS = "imu_sim_ros.trajectories"
"""Group of entry points under which other packages offer trajectories of their own."""
LEAST_KNOTS = 0.02
"""Least product of knot spacing and cut-off; below it the fit of a spline loses digits."""


@dataclass(frozen=True)
class StaticParameters(TrajectoryParameters):
    """A body at rest."""

    type: str = text("static", TYPE_TEXT)
    position: Vector = vector(ZERO_VECTOR, "position in the world", unit="m")
    roll_pitch_yaw: Vector = vector(ZERO_VECTOR, "attitude", unit="rad")

    def motion(self, pose_reader: PoseReader) -> "Trajectory":
        """Return the motion that these parameters describe."""
        from imu_sim_ros.trajectory.kinds import Static

        return Static(self)


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

    def motion(self, pose_reader: PoseReader) -> "Trajectory":
        """Return the motion that these parameters describe."""
        from imu_sim_ros.trajectory.kinds import Harmonic

        return Harmonic(self)


@dataclass(frozen=True)
class PolarParameters(TrajectoryParameters):
    """A motion along a radius that turns about z; the body turns with it."""

    type: str = text("polar", TYPE_TEXT)
    radius: SeriesParameters = section(SeriesParameters)
    angle: SeriesParameters = section(SeriesParameters)
    height: float = number(0.0, "height of the plane in the world", unit="m")

    def motion(self, pose_reader: PoseReader) -> "Trajectory":
        """Return the motion that these parameters describe."""
        from imu_sim_ros.trajectory.kinds import Polar

        return Polar(self)


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

    def motion(self, pose_reader: PoseReader) -> "Trajectory":
        """Return the motion that these parameters describe."""
        from imu_sim_ros.trajectory.kinds import FreeFall

        return FreeFall(self)


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
        """Yield which lists do not match and which waypoints collide."""
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
            yield from self._time_problems(prefix)
        else:
            headings = self.headings or (0.0,) * count
            poses = list(zip(places, headings, strict=False))
            for k in range(1, len(poses)):
                if poses[k] == poses[k - 1]:
                    yield (
                        f"{prefix}positions: waypoints {k} and {k + 1} are the same; "
                        f"leave one out or give {prefix}times"
                    )

    def _time_problems(self, prefix: str) -> Iterator[str]:
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

    def motion(self, pose_reader: PoseReader) -> "Trajectory":
        """Return the motion that these parameters describe."""
        from imu_sim_ros.trajectory.kinds import Waypoints

        return Waypoints(self)


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
        """Yield whether the place is too small."""
        yield from size_problems(self.place, self.place_size, f"{prefix}place_size")

    def motion(self, pose_reader: PoseReader) -> "Trajectory":
        """Return the motion that these parameters describe."""
        from imu_sim_ros.trajectory.tour import tour

        return tour(self)


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

    def motion(self, pose_reader: PoseReader) -> "Trajectory":
        """Return the motion that these parameters describe."""
        from imu_sim_ros.trajectory.calibration_motion import six_position

        return six_position(self)


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
        """Yield whether there is nothing to do."""
        if not self.rates:
            yield f"{prefix}rates = []: must have at least one entry [rad/s]"

    def motion(self, pose_reader: PoseReader) -> "Trajectory":
        """Return the motion that these parameters describe."""
        from imu_sim_ros.trajectory.calibration_motion import turntable

        return turntable(self)


@dataclass(frozen=True)
class PosesParameters(TrajectoryParameters):
    """Recorded poses, followed by a B-spline."""

    type: str = text("poses", TYPE_TEXT)
    file: str = text("", "poses in TUM or EuRoC format, or a bag")
    topic: str = text("", "Odometry or PoseStamped topic of a bag; empty: the only one")
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
        """Yield whether the file is missing, and whether the knots are too dense."""
        if not self.file:
            yield f"{prefix}file = '': must name a file of poses"
        least = LEAST_KNOTS / self.cutoff
        if 0.0 < self.knot_spacing < least:
            yield (
                f"{prefix}knot_spacing = {self.knot_spacing:g}: must be 0 or at least "
                f"{LEAST_KNOTS} / {prefix}cutoff, {least:.3g} s"
            )

    def motion(self, pose_reader: PoseReader) -> "Trajectory":
        """Return splines through the poses of the file.

        :raises InputError: for a file of poses that cannot be used.
        """
        from imu_sim_ros.trajectory.recorded import RecordedMotion  # SciPy

        topic = (self.topic,) if self.topic else ()
        return RecordedMotion(pose_reader(Path(self.file), *topic), self)


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

    offered = {point.name: point for point in entry_points(group=ENTRY_POINTS)}
    if name not in offered:
        known = [*TYPES, *sorted(offered)]
        otherwise = f"must be one of {', '.join(known)}, a name in config/trajectories, or a file"
        hint = suggestion(name, [*known, *names("trajectories")], otherwise)
        raise ConfigurationError(f"trajectory.type = {name!r}: {hint}")
    point = offered[name]
    try:
        found = point.load()
    except Exception as error:  # code of other people: whatever it raises
        raise ConfigurationError(
            f"trajectory.type = {name!r}: {point.value} cannot be loaded: {error}"
        ) from error
    if not (isinstance(found, type) and issubclass(found, TrajectoryParameters)):
        raise ConfigurationError(
            f"trajectory.type = {name!r}: {point.value} is not a class derived from "
            "TrajectoryParameters"
        )
    return found


def names_a_file(trajectory: str) -> bool:
    """Return whether a trajectory is a file, in config/trajectories or anywhere, and no kind."""
    return trajectory in files.names("trajectories") or (
        trajectory not in (*TYPES, GIVEN) and os.path.exists(trajectory)
    )


def trajectory_layer(name_or_file: str, node: str = "simulator") -> dict[str, object]:
    """Return what ``--trajectory``, in a node ``trajectory.type``, stands for.

    :param name_or_file: a name in config/trajectories, a kind of trajectory, a parameter file, a
        route to drive (GPX or KML), or recorded poses: a text file, or a bag.
    """
    path = Path(name_or_file)
    if not names_a_file(name_or_file) and _is_kind(name_or_file):
        return {"trajectory.type": name_or_file}
    if name_or_file not in files.names("trajectories") and path.is_dir():
        return {"trajectory.type": "poses", "trajectory.file": str(path)}
    path = files.find("trajectories", name_or_file)
    if path.suffix.lower() in (".yaml", ".yml"):
        return files.load(path, node)
    kind = "drive" if path.suffix.lower() in (".gpx", ".kml") else "poses"
    return {"trajectory.type": kind, "trajectory.file": str(path)}


def _is_kind(name: str) -> bool:
    try:
        find_trajectory(name)
    except ConfigurationError:
        return False
    return True
