# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Parameters of a drive on the ground: route, speed, ground, suspension, road."""

from collections.abc import Iterator
from dataclasses import dataclass
from typing import TYPE_CHECKING

from imu_sim_ros.parameters.kinds import flag, integer, number, numbers, text
from imu_sim_ros.parameters.sections import section
from imu_sim_ros.trajectory.common_parameters import (
    TYPE_TEXT,
    PoseReader,
    TrajectoryParameters,
    VibrationParameters,
)

if TYPE_CHECKING:
    from imu_sim_ros.trajectory.motion import Trajectory


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
        """Yield which lists do not match."""
        for name in ("origin", "slope"):
            given = getattr(self, name)
            if len(given) != 2 and (given or name == "slope"):
                yield f"{prefix}{name} = {list(given)}: must be two numbers"
        if self.origin[2:] == () and self.origin and abs(self.origin[0]) > 90.0:
            yield f"{prefix}origin: latitude {self.origin[0]:g}: must be within 90 deg"
        if self.use_times and not self.file:
            yield f"{prefix}use_times = true: needs {prefix}file; {prefix}times are for positions"
        if self.file:
            if self.times:
                yield f"{prefix}times: are for {prefix}positions; a file has its own, use_times"
            if self.elevations:
                yield f"{prefix}elevations: are for {prefix}positions; a file: use_elevations"
        else:
            yield from self._list_problems(prefix)
        yield from self._ground_problems(prefix)
        timed = self.times or self.use_times
        for name, given in (("stops", self.stops), ("laps", self.laps), ("speeds", self.speeds)):
            if timed and given:
                yield f"{prefix}{name}: must be left out if times are given"
        if timed and self.deviation:
            yield f"{prefix}deviation = {self.deviation:g}: must be 0 if times are given"

    def _ground_problems(self, prefix: str) -> Iterator[str]:
        name = "elevations" if self.elevations else "use_elevations"
        of_route = bool(self.elevations) or self.use_elevations
        if self.use_elevations and not self.file:
            yield f"{prefix}use_elevations = true: needs {prefix}file"
        if of_route and self.height_map:
            yield f"{prefix}{name}: must be left out with {prefix}height_map, which has its own"
        if of_route and any(self.slope):
            yield f"{prefix}{name}: must be left out with {prefix}slope, which has its own"
        if 0.0 in self.speeds:
            yield f"{prefix}speeds: 0 m/s: must be above 0, or below to back up"
        if any(speed < 0.0 for speed in self.speeds) and (of_route or self.height_map):
            ground = "height_map" if self.height_map else name
            yield f"{prefix}speeds: must be above 0 with {prefix}{ground}; it backs up on a plane"

    def _list_problems(self, prefix: str) -> Iterator[str]:
        count = len(self.positions) // 2
        if count < 2:
            yield f"{prefix}positions = {list(self.positions)}: must be at least two waypoints"
        if self.times and len(self.times) != count:
            yield (
                f"{prefix}times: {len(self.times)} entries; must be empty or one for each of the "
                f"{count} waypoints"
            )
        if self.elevations and len(self.elevations) != count:
            yield (
                f"{prefix}elevations: {len(self.elevations)} entries; must be empty or one for "
                f"each of the {count} waypoints"
            )
        if self.times and self.times[0] != 0.0:
            yield f"{prefix}times: waypoint 1 at {self.times[0]:g} s: must be at 0"
        for k in range(1, len(self.times)):
            if self.times[k] <= self.times[k - 1]:
                yield (
                    f"{prefix}times: waypoint {k + 1} at {self.times[k]:g} s: must be after "
                    f"waypoint {k} at {self.times[k - 1]:g} s"
                )

    def motion(self, pose_reader: PoseReader) -> "Trajectory":
        """Return the motion that these parameters describe."""
        from imu_sim_ros.trajectory.drive import drive

        return drive(self)
