# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Trajectory and sensor joined: blocks of samples, the one engine behind node and command.

For one configuration and seed the samples are the same, bit for bit, in blocks of any size. While a
simulation runs it can be changed between two blocks:

``update(parameters)``
    takes new values of the parameters that are marked ``live``. Nothing else changes: random walks
    and slow biases go on from where they are, and every random stream stays as it was.
``inject(fault, delay)``
    lets a :class:`~imu_sim_ros.sensors.faults.Fault` begin after ``delay`` seconds: a bias jump,
    saturation, a stuck output, lost messages or latency, for a given time.
``reset()``
    goes back to the first sample; faults are forgotten, parameters stay.

:class:`SimulatedBody` holds the simulations of several IMUs on one body, and gives their samples in
common windows of time.
"""

import copy
import math
from collections.abc import Collection, Iterator, Mapping
from dataclasses import replace
from fractions import Fraction
from typing import TYPE_CHECKING, Final

from imu_sim_ros import arguments, timebase
from imu_sim_ros.errors import ConfigurationError
from imu_sim_ros.parameters.sections import flatten
from imu_sim_ros.parameters.sections import parameters as described
from imu_sim_ros.poses import read_poses
from imu_sim_ros.sensors import with_faults
from imu_sim_ros.sensors.block import ImuBlock
from imu_sim_ros.sensors.faults import Fault
from imu_sim_ros.sensors.imu.model import Imu
from imu_sim_ros.sensors.registry import board, find_sensor
from imu_sim_ros.sensors.world import Window, World
from imu_sim_ros.simulation.parameters import SimulationParameters, carried
from imu_sim_ros.trajectory.build import build_trajectory
from imu_sim_ros.trajectory.common_parameters import PoseReader
from imu_sim_ros.trajectory.motion import Trajectory
from imu_sim_ros.trajectory.parameters import DriveParameters, PosesParameters

if TYPE_CHECKING:
    from imu_sim_ros.trajectory.recorded import RecordedMotion

BLOCK_SIZE: Final = 8192
"""Large enough that Python's part is small, small enough for a processor's cache."""
_SAME_PLACE: Final = 1e-6
"""[deg]"""
DEFAULT_START_NS: Final = timebase.NANOSECONDS_PER_SECOND


class Simulation:
    """The samples of one simulated IMU, in order, in blocks of any size."""

    def __init__(
        self,
        parameters: SimulationParameters,
        pose_reader: PoseReader = read_poses,
        t0_ns: int | None = None,
        trajectory: Trajectory | None = None,
        sensors: Collection[str] = (),
    ) -> None:
        """Set up trajectory and sensor.

        :param pose_reader: reads the file of a trajectory of recorded poses.
        :param t0_ns: time of sample 0 [ns]; None: ``start_time``, or if that is -1 the stamp
            of recorded poses at the start of the motion, or else 1 s.
        :param trajectory: the one of these parameters, if it already exists.
        :param sensors: sensors next to the IMU: ``magnetic_field``, or the name of a sensor
            of the body; no sample of another sensor depends on it.
        :raises ConfigurationError: for inconsistent parameters.
        :raises InputError: for a file of poses that cannot be used.
        """
        self.parameters, self._sensors = parameters, frozenset(sensors)
        if trajectory is None:
            trajectory = build_trajectory(parameters.trajectory, pose_reader)
        self.trajectory = trajectory
        if t0_ns is None:
            start = parameters.start_time
            t0_ns = timebase.to_nanoseconds(start) if start >= 0.0 else self._usual_start()
        self.t0_ns = t0_ns
        longest = trajectory.duration
        duration = parameters.duration or longest
        if duration > longest:
            raise ConfigurationError(
                f"duration = {duration:g}: must be at most {longest:g} s, the trajectory's length"
            )
        self.total: int | None = None
        """Number of samples; None: endless."""
        self._end: Fraction | None = None
        if not math.isinf(duration):
            self._end = Fraction(repr(float(duration)))
            self.total = timebase.sample_count(duration, parameters.rate)
        self.reset()

    def _usual_start(self) -> int:
        recorded = self._recorded()
        # A header's seconds are unsigned: poses before zero have no stamp there.
        return recorded.t0_ns if recorded and recorded.t0_ns >= 0 else DEFAULT_START_NS

    def warnings(self) -> list[str]:
        """Return warnings on settings that are allowed but may be unintended, a line each.

        The parameters' own warnings, implausible recorded poses, and a motion that the
        sensor's range does not cover.
        """
        from imu_sim_ros.trajectory.build import implausible

        imu, recorded = self.parameters.imu, self._recorded()
        of_poses = recorded.warnings if recorded is not None else []
        duration = self.parameters.duration or self.trajectory.duration
        return (
            self.parameters.warnings()
            + of_poses
            + self._of_place()
            + [
                line
                for name, own in carried(self.parameters).items()
                for line in find_sensor(name).warnings(own, self.trajectory, duration)
            ]
            + implausible(
                self.trajectory,
                imu.gyroscope.range,
                imu.accelerometer.range,
                self.parameters.gravity,
                duration,
            )
        )

    def _of_place(self) -> list[str]:
        """Return a line if the world's origin on the Earth is not that of a route, or not given."""
        p, route = self.parameters, None
        if isinstance(p.trajectory, DriveParameters):
            from imu_sim_ros.trajectory.drive import route_in

            route = route_in(self.trajectory)
        if route is None or route.origin is None:
            if "gnss" not in carried(p) or p.latitude_deg or p.longitude_deg:
                return []
            return [
                "latitude_deg = 0 and longitude_deg = 0: fixes and satellites are those of a place "
                "in the Gulf of Guinea; set both"
            ]
        latitude, longitude = route.origin
        if abs(latitude - p.latitude_deg) + abs(longitude - p.longitude_deg) < _SAME_PLACE:
            return []
        return [
            f"the route's origin is at {latitude:.7f}, {longitude:.7f} deg, the world's at "
            f"{p.latitude_deg:.7f}, {p.longitude_deg:.7f}: fixes are on the route with "
            f"latitude_deg={latitude:.7f} and longitude_deg={longitude:.7f}"
        ]

    def notes(self) -> list[str]:
        """Return the repairs of recorded poses, and how well the spline fits them."""
        recorded = self._recorded()
        return recorded.repairs + recorded.report.lines() if recorded is not None else []

    def _recorded(self) -> "RecordedMotion | None":
        """Return the recorded motion, if there is one; only then the splines are imported."""
        if not isinstance(self.parameters.trajectory, PosesParameters):
            return None
        from imu_sim_ros.trajectory.recorded import recorded_in

        return recorded_in(self.trajectory)

    def reset(self) -> None:
        """Go back to the first sample: the same samples follow again."""
        self.position = 0
        p = self.parameters
        self._world = World(self.trajectory, p, self.t0_ns)
        self._models = board(p.imu, p, self.t0_ns, self._sensors)
        imu = self._models["imu"]
        assert isinstance(imu, Imu)
        imu.prepare(self.trajectory)
        for name, own in carried(p).items():
            if name in self._sensors:
                made = find_sensor(name).model(own, p, self.t0_ns, self._models)
                self._models[name] = made

    def with_seed(self, seed: int) -> "Simulation":
        """Return a simulation of the same motion and sensor with another seed, at its start.

        The trajectory is shared: fitting a spline or checking parameters is not done again.
        """
        other = copy.copy(self)
        other.parameters = replace(self.parameters, seed=seed)
        other.reset()
        return other

    def update(self, parameters: SimulationParameters) -> None:
        """Take new values of live parameters; they apply from the next block on.

        :raises ConfigurationError: with a line for every changed parameter that is not live;
            nothing is changed then.
        """
        old, new = flatten(self.parameters), flatten(parameters)
        known = described(type(parameters), new)
        fixed = [name for name, value in new.items() if old.get(name) != value]
        problems = [
            f"{name}: cannot be changed while the simulation runs"
            for name in fixed
            if not known[name].live
        ]
        if problems:
            raise ConfigurationError(problems)
        self.parameters = parameters
        own = carried(parameters)
        for name, model in self._models.items():
            model.configure(own.get(name, parameters.imu))

    def inject(self, fault: Fault, delay: float = 0.0) -> None:
        """Let a fault begin.

        :param delay: seconds after the next sample, >= 0.
        :raises ConfigurationError: for another delay, and a sensor that is not simulated.
        """
        if not (math.isfinite(delay) and delay >= 0.0):
            raise ConfigurationError(f"fault delay = {delay}: must be at least 0 s")
        hit = with_faults().get(fault.triad, "imu")
        if hit not in self._models:
            raise ConfigurationError(
                f"fault triad = {fault.triad}: this simulation has no {fault.triad}"
            )
        first = self.position + timebase.sample_count(delay, self.parameters.rate)
        self._models[hit].inject(fault, self._time(first))

    def next_block(self, count: int) -> ImuBlock:
        """Return the next samples: ``count``, fewer at the end of the run, none after it."""
        if self.total is not None:
            count = min(count, self.total - self.position)
        end = self.position + count
        stop = self._time(end)
        if self._end is not None:  # the last interval may be longer than what is left of the run
            stop = min(stop, self._end)
        window = Window(min(self._time(self.position), stop), stop)
        read = {name: model.read(window, self._world) for name, model in self._models.items()}
        self.position = end
        block: ImuBlock = read["imu"]
        return block._replace(auxiliary={k: v for k, v in read.items() if k in self._sensors})

    def _time(self, sample: int) -> Fraction:
        """Return when a sample of the IMU is taken, since the first [s]."""
        return sample / timebase.exact_rate(self.parameters.rate)

    def blocks(self, block_size: int = BLOCK_SIZE, count: int | None = None) -> Iterator[ImuBlock]:
        """Yield the samples that are left, in blocks.

        :param count: largest number of samples; otherwise an endless run continues forever.
        :raises ConfigurationError: for a size that is none, before the first block.
        """
        return self._blocks(arguments.block_size("block_size", block_size), count)

    def _blocks(self, block_size: int, count: int | None) -> Iterator[ImuBlock]:
        end = math.inf if count is None else self.position + count
        if self.total is not None:
            end = min(end, self.total)
        while self.position < end:
            yield self.next_block(int(min(block_size, end - self.position)))


class SimulatedBody:
    """The simulations of one body by name: one IMU, or several and the body's own motion.

    Each gives the same samples as on its own; they share the trajectory, which is built
    once, and the windows of time.
    """

    def __init__(
        self,
        parameters: Mapping[str, SimulationParameters],
        pose_reader: PoseReader = read_poses,
        sensors: Mapping[str, Collection[str]] | None = None,
        given: Trajectory | None = None,
    ) -> None:
        """Set up all simulations; arguments and errors as for :class:`Simulation`.

        :param parameters: at least one; all have the same trajectory and duration.
        :param sensors: what is read in addition to each IMU, by the names of the simulations.
        :param given: the bare motion of the type ``given``.
        """
        self.simulations: dict[str, Simulation] = {}
        trajectory = None
        if given is not None:
            first = next(iter(parameters.values()))
            trajectory = build_trajectory(first.trajectory, pose_reader, given)
        for name, own in parameters.items():
            auxiliary = (sensors or {}).get(name, ())
            self.simulations[name] = Simulation(
                own, pose_reader, trajectory=trajectory, sensors=auxiliary
            )
            trajectory = self.simulations[name].trajectory

    @property
    def total(self) -> int | None:
        """Total number of samples; None: endless."""
        totals = [simulation.total for simulation in self.simulations.values()]
        return None if None in totals else sum(total or 0 for total in totals)

    def warnings(self) -> list[str]:
        """Return warnings on settings that are allowed but may be unintended, each line once."""
        every = [line for one in self.simulations.values() for line in one.warnings()]
        return list(dict.fromkeys(every))

    def windows(self, block_size: int = BLOCK_SIZE) -> Iterator[dict[str, ImuBlock]]:
        """Yield all samples, window by window: each simulation's block that lies in it.

        A window has ``block_size`` samples of the fastest simulation; one that has no sample in a
        window is left out of it. This includes blocks of simulations that have ended.

        :raises ConfigurationError: for a size that is none, before the first window.
        """
        return self._windows(arguments.block_size("block_size", block_size))

    def _windows(self, block_size: int) -> Iterator[dict[str, ImuBlock]]:
        rates = {n: timebase.exact_rate(s.parameters.rate) for n, s in self.simulations.items()}
        window = Fraction(block_size) / max(rates.values())
        end = Fraction(0)
        while any(one.position != one.total for one in self.simulations.values()):
            end += window
            blocks = {}
            for name, simulation in self.simulations.items():
                # Samples k / rate < end, as timebase.sample_count has it, in exact numbers.
                block = simulation.next_block(math.ceil(end * rates[name]) - simulation.position)
                if len(block.true_t_ns):
                    blocks[name] = block
            yield blocks
