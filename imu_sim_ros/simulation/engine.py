# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""A moving body and the samples of its sensors: the one engine behind node and command.

For one configuration and seed the samples are the same, bit for bit, in windows of any size. While
a simulation runs it can be changed between two windows:

``update(parameters)`` takes new values of the parameters that are marked ``live``. Nothing else
changes: random walks and slow biases go on from where they are, and every random stream stays as it
was. ``inject(fault, delay)`` lets a :class:`~imu_sim_ros.sensors.faults.Fault` begin after
``delay`` seconds: a bias jump, saturation, a stuck output, lost messages or latency, for a given
time. ``reset()`` goes back to the first sample; faults are forgotten, parameters stay.
"""

import copy
import math
from collections.abc import Collection, Iterator
from dataclasses import replace
from fractions import Fraction
from typing import TYPE_CHECKING, Final

from imu_sim_ros.core import timebase
from imu_sim_ros.core.errors import ConfigurationError
from imu_sim_ros.core.names import suggestion
from imu_sim_ros.inputs.poses import read_poses
from imu_sim_ros.parameters.sections import flatten
from imu_sim_ros.parameters.sections import parameters as described
from imu_sim_ros.sensors.faults import Fault
from imu_sim_ros.sensors.samples import Samples
from imu_sim_ros.sensors.world import Window, World
from imu_sim_ros.simulation.parameters import SimulationParameters, imus, segments
from imu_sim_ros.simulation.sensors import imus_in, models, mount_sensors, sensor_warnings
from imu_sim_ros.trajectory.build import build_segments, build_trajectory
from imu_sim_ros.trajectory.motion import Trajectory
from imu_sim_ros.trajectory.parameters import GIVEN, DriveParameters, PoseReader, PosesParameters

if TYPE_CHECKING:
    from concurrent.futures import Executor

    from imu_sim_ros.sensors.camera.scene import Scene
    from imu_sim_ros.trajectory.recorded import RecordedMotion

BLOCK_SIZE: Final = 8192
"""Samples computed at once: Python's part is small, and the arrays fit into a processor's cache."""
DEFAULT_START_NS: Final = timebase.NANOSECONDS_PER_SECOND


class _SceneOfRuns:
    """The scene around the sensors that see, made when it is first asked for.

    It is the same for all seeds. Worlds refer to it instead of to their body: without a cycle, the
    arrays of a run are released at once, not by the garbage collector.
    """

    def __init__(self) -> None:
        self._scene: Scene | None = None

    def __call__(self, world: World) -> "Scene":
        """Return the scene, which the first call makes around the path of its world."""
        if self._scene is None:
            from imu_sim_ros.simulation.cameras import scene_around  # most runs have none

            self._scene = scene_around(world)
        return self._scene


class Body:
    """A world and the sensors of a body in it, by name, with their samples in order."""

    def __init__(
        self,
        parameters: SimulationParameters,
        pose_reader: PoseReader = read_poses,
        t0_ns: int | None = None,
        trajectory: Trajectory | None = None,
        sensors: Collection[str] = (),
        threads: "Executor | None" = None,
    ) -> None:
        """Initialise trajectory and sensors, before the first sample.

        :param pose_reader: reads the file of a trajectory of recorded poses.
        :param t0_ns: time of the first sample [ns]; None: ``start_time``, or if that is -1 the
            stamp of recorded poses at the start of the motion, or else 1 s.
        :param trajectory: the one of these parameters, if it already exists; not used if IMUs are
            on segments, whose motions are read together.
        :param sensors: names of :func:`~imu_sim_ros.simulation.sensors.mount_sensors` that are read
            in addition to all IMUs; no sample of another sensor depends on them.
        :param threads: compute large values such as images in the background; None: they are
            computed by the thread that asks for them.
        :raises ConfigurationError: for inconsistent parameters.
        :raises InputError: for a file of poses that cannot be used.
        """
        self.parameters, self._wanted, self._threads = parameters, frozenset(sensors), threads
        self.segments: dict[str, Trajectory] = {}
        """Motions of the segments that carry IMUs, by the name of the IMU."""
        topics = segments(parameters)
        if topics and isinstance(parameters.trajectory, PosesParameters):
            body_topic = parameters.trajectory.topic or next(iter(topics.values()))
            names = dict.fromkeys([body_topic, *topics.values()])
            motions = build_segments(parameters.trajectory, pose_reader, names)
            self.segments = {name: motions[topic] for name, topic in topics.items()}
            trajectory = motions[body_topic]
        if trajectory is None:
            trajectory = build_trajectory(parameters.trajectory, pose_reader)
        self.trajectory = trajectory
        self._recorded: RecordedMotion | None = None
        if isinstance(parameters.trajectory, PosesParameters):
            # Only recorded poses need splines.
            from imu_sim_ros.trajectory.recorded import find_recorded_motion

            self._recorded = find_recorded_motion(trajectory)
        if t0_ns is None:
            t0_ns = DEFAULT_START_NS
            if parameters.start_time >= 0.0:
                t0_ns = timebase.to_nanoseconds(parameters.start_time)
            elif self._recorded is not None and self._recorded.t0_ns >= 0:
                t0_ns = self._recorded.t0_ns  # a header's seconds are unsigned
        self.t0_ns = t0_ns
        longest = trajectory.duration
        duration = parameters.duration or longest
        if duration > longest:
            raise ConfigurationError(
                f"duration = {duration:g}: must be at most {longest:g} s, the trajectory's length"
            )
        self._scene = _SceneOfRuns()
        self.rate = max(imu_parameters.rate for imu_parameters in imus(parameters).values())
        """Sample rate of the fastest IMU [Hz]."""
        self.total: int | None = None
        """Number of samples of the fastest IMU; None: the run has no end."""
        self._end: Fraction | None = None
        if not math.isinf(duration):
            self._end = timebase.exact_fraction(duration)
            self.total = timebase.sample_count(duration, self.rate)
        self.reset()

    def warnings(self, elsewhere: bool = False) -> list[str]:
        """Return warnings on settings that are allowed but may be unintended, a line each.

        The parameters' own warnings, implausible recorded poses, a world or a motion that is not
        for a sensor, and a motion that contradicts itself.

        :param elsewhere: without those of sensors that a node reads in processes of their own.
        :raises ConfigurationError: for a motion that a sensor cannot read.
        """
        from imu_sim_ros.trajectory.given import suspicions

        p = self.parameters
        duration = p.duration or self.trajectory.duration
        lines = [line for imu_parameters in imus(p).values() for line in imu_parameters.warnings()]
        for label, recorded in self._recordings():
            lines += [f"{label}{line}" for line in recorded.warnings]
        if isinstance(p.trajectory, DriveParameters):
            from imu_sim_ros.trajectory.drive import elsewhere_on_earth  # most motions are none

            lines += elsewhere_on_earth(self.trajectory, p.latitude_deg, p.longitude_deg)
        for name, sensor in self.sensors.items():
            if name in self._models and not (elsewhere and sensor.sensor.apart):
                lines += sensor_warnings(sensor, self._worlds[name], duration)
        if p.trajectory.type == GIVEN:
            lines += suspicions(self.trajectory, duration, self.rate)
        return list(dict.fromkeys(lines))

    def notes(self, elsewhere: bool = False) -> list[str]:
        """Return notes about recorded poses, sensors and the size of a place.

        :param elsewhere: as in :meth:`warnings`.
        """
        lines = list[str]()
        for label, recorded in self._recordings():
            span, fit, peaks = recorded.report.lines()
            texts = [*recorded.repairs, fit] if lines else [*recorded.repairs, span, fit]
            lines += [f"{label}{line}" for line in (texts if label else [*texts, peaks])]
        for sensor in self.sensors.values():
            if sensor.sensor.rendering is not None:
                lines += sensor.sensor.rendering.notes(sensor)
        note = self.note_of_scene(elsewhere)
        return [*lines, note] if note else lines

    def _recordings(self) -> "Iterator[tuple[str, RecordedMotion]]":
        """Yield the recorded motions, each with the beginning of lines about it."""
        if not self.segments:
            if self._recorded is not None:
                yield "", self._recorded
            return
        # Only recorded poses need splines.
        from imu_sim_ros.trajectory.recorded import find_recorded_motion

        for name, topic in segments(self.parameters).items():
            recorded = find_recorded_motion(self.segments[name])
            if recorded is not None:
                yield f"{topic}: ", recorded

    def note_of_scene(self, elsewhere: bool = False) -> str:
        """Return a line about the size of the place around the path; empty: no sensor sees it.

        :param elsewhere: as in :meth:`warnings`.
        """
        sensors = [self.sensors[name].sensor for name in self._models]
        has_views = any(sensor.sees and not (elsewhere and sensor.apart) for sensor in sensors)
        return self.world.scene.note if has_views else ""

    def reset(self) -> None:
        """Restart at the first sample: the same samples follow again."""
        self._now = Fraction(0)
        p = self.parameters
        self.world = World(self.trajectory, p, self.t0_ns, self._scene, self._threads)
        worlds = {
            name: World(motion, p, self.t0_ns, self._scene, self._threads)
            for name, motion in self.segments.items()
        }
        self.sensors = mount_sensors(p)
        self._worlds = {
            name: worlds.get(sensor.space.rstrip("/"), self.world)
            for name, sensor in self.sensors.items()
        }
        """Worlds of the sensors: those on a segment move with it."""
        self._models = models(self.sensors, self._wanted, self.t0_ns)
        shown = self._wanted.union(imus_in(self.sensors))
        self._shown = [name for name in self._models if name in shown]
        self._longest = min(self.sensors[name].parameters.longest_window for name in self._shown)

    def with_seed(
        self, seed: int, further_sensors: Collection[str] = (), threads: "Executor | None" = None
    ) -> "Body":
        """Return the same body and sensors with another seed, at the start.

        The trajectory is shared: fitting a spline or checking parameters is not done again.

        :param further_sensors: further sensors that are read.
        :param threads: as of the body.
        """
        copied = copy.copy(self)
        copied._wanted, copied._threads = self._wanted.union(further_sensors), threads
        copied.parameters = replace(self.parameters, seed=seed)
        copied.reset()
        return copied

    def update(self, parameters: SimulationParameters) -> None:
        """Apply new values of live parameters; they apply from the next window on.

        :raises ConfigurationError: with a line for every changed parameter that is not live;
            nothing is changed then.
        """
        previous, values = flatten(self.parameters), flatten(parameters)
        declared = described(type(parameters), values)
        fixed = [name for name, value in values.items() if previous.get(name) != value]
        problems = [
            f"{name}: cannot be changed while the simulation runs"
            for name in fixed
            if not declared[name].live
        ]
        if problems:
            raise ConfigurationError(problems)
        self.parameters, self.sensors = parameters, mount_sensors(parameters)
        for name, model in self._models.items():
            model.configure(self.sensors[name].parameters)

    def inject(self, fault: Fault, delay: float = 0.0, imu: str = "") -> dict[str, int]:
        """Start a fault.

        :param delay: seconds after the next sample, >= 0.
        :param imu: name of the one IMU that it hits, with the sensors of this IMU; empty: all.
        :returns: about when it begins [ns], by the name of the IMU.
        :raises ConfigurationError: for another delay, and a sensor that is not simulated.
        """
        if not (math.isfinite(delay) and delay >= 0.0):
            raise ConfigurationError(f"fault delay = {delay}: must be at least 0 s")
        hit = [name for name, sensor in self.sensors.items() if sensor.takes(fault)]
        if not hit:
            faulty_parts = dict.fromkeys(
                part for sensor in self.sensors.values() for part in sensor.faulty
            )
            raise ConfigurationError(
                f"fault triad = {fault.triad!r}: {suggestion(fault.triad, list(faulty_parts))}"
            )
        imu_parameters, times = imus(self.parameters), dict[str, int]()
        for name in hit:
            if name not in self._models:
                raise ConfigurationError(
                    f"fault triad = {fault.triad}: this simulation has no {fault.triad}"
                )
            # A sensor that belongs to no IMU is hit whatever IMU is named.
            target = self.sensors[name]
            of_imu = (
                target.space.rstrip("/")
                if target.sensor.with_imu
                else imu or next(iter(imu_parameters))
            )
            if imu in ("", of_imu):
                sampled = target.environment.rate
                begin = self.taken(sampled) + timebase.sample_count(delay, sampled)
                self._models[name].inject(fault, begin / timebase.exact_rate(sampled))
                t_ns = timebase.sample_times_ns(begin, 1, sampled, self.t0_ns)
                times[of_imu] = int(t_ns[0])
        return times

    def taken(self, rate: float) -> int:
        """Return the number of samples at a rate [Hz] that have been read."""
        return math.ceil(self._now * timebase.exact_rate(rate))

    def until(self, end: Fraction) -> dict[str, Samples]:
        """Return the samples of each sensor that were not read yet and lie before a time.

        There are none after the end of the run.

        :param end: since the start [s].
        """
        stop = end if self._end is None else min(end, self._end)
        window = Window(self._now, max(stop, self._now))
        self._now = window.end
        samples = {
            name: model.read(window, self._worlds[name]) for name, model in self._models.items()
        }
        return {name: samples[name] for name in self._shown}

    def next(self, count: int) -> dict[str, Samples]:
        """Return the samples of each sensor in the next ``count`` intervals of the fastest IMU.

        There are fewer at the end of the run, and none after it.
        """
        return self.until((self.taken(self.rate) + count) / timebase.exact_rate(self.rate))

    def windows(self, block_size: int = BLOCK_SIZE) -> Iterator[dict[str, Samples]]:
        """Yield the samples that are left, window by window; those of an endless run never end.

        :param block_size: intervals of the fastest IMU in a window, at most; windows are shorter if
            the samples of a sensor are large.
        """
        position, rate = self.taken(self.rate), timebase.exact_rate(self.rate)
        end = math.inf if self.total is None else self.total
        limit = min(block_size, max(self._longest * self.rate, 1.0))
        while position < end:
            position += int(min(limit, end - position))
            yield self.until(position / rate)
