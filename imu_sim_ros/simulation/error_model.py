# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""The errors of a sensor on ideal readings that somebody else makes.

The chain of errors is the simulator's own, :class:`imu_sim_ros.sensors.imu.model.Imu`: for the
ideal readings of a simulation, the same parameters and the same seed, the samples are the
simulation's, bit for bit, in blocks of any size.
"""

import dataclasses
from collections.abc import Callable, Collection, Iterator
from typing import Any, Final

import numpy as np

from imu_sim_ros import timebase
from imu_sim_ros.errors import ConfigurationError
from imu_sim_ros.parameters.sections import flatten
from imu_sim_ros.parameters.sections import parameters as described
from imu_sim_ros.rotation import rotate
from imu_sim_ros.sensors.block import ImuBlock
from imu_sim_ros.sensors.faults import Fault
from imu_sim_ros.sensors.gravity import gravity_vector
from imu_sim_ros.sensors.imu.declaration import NAME as IMU
from imu_sim_ros.sensors.imu.model import AHEAD, NOWHERE, Imu, unknown_motion
from imu_sim_ros.sensors.pose.declaration import NAME as POSE
from imu_sim_ros.sensors.pose.model import pose_samples
from imu_sim_ros.sensors.world import Window, World
from imu_sim_ros.simulation.error_input import (
    Conventions,
    GivenReadings,
    Order,
    Resampler,
    StartCheck,
)
from imu_sim_ros.simulation.error_parameters import ErrorModelParameters
from imu_sim_ros.simulation.sensors import models, mounted
from imu_sim_ros.trajectory.motion import Motion
from imu_sim_ros.types import Array, Times

_SAMPLES_AT_ONCE: Final = 65536
"""Most samples of a gap that are taken at once."""
_LOOKED_BACK: Final = 4
"""Intervals in which a burst of readings may make up for a long one."""
_REPORTED: Final = 3
"""Irregularities of a kind that are remarked on; all of them are counted."""


@dataclasses.dataclass
class Counts:
    """What happened to the readings so far."""

    readings: int = 0
    """That came in, the refused ones too."""
    samples: int = 0
    """That went out."""
    missing: int = 0
    """Samples that nobody sent, and during which biases went on."""
    pauses: int = 0
    restarts: int = 0
    repeated: int = 0
    """Readings with the stamp of the one before; left out."""
    backward: int = 0
    """Readings with an earlier stamp; left out."""


class ErrorModel:
    """Ideal readings in, a sensor's readings out, with every true error next to them."""

    def __init__(
        self,
        parameters: ErrorModelParameters,
        sensors: Collection[str] = (),
        remark: Callable[[str], object] = lambda line: None,
    ) -> None:
        """Set up the sensor; its first sample is the first reading.

        :param sensors: ``orientation``, if the IMU states it next to the readings.
        :param remark: receives a line for everything that looks like a mistake, and for the first
            irregularities of the stamps of each kind.
        """
        self.parameters = parameters
        self.counts = Counts()
        self._sensors, self._remark = frozenset(sensors) - {IMU}, remark
        self._nominal_ns = 1e9 / parameters.rate
        self._longest_gap_ns = parameters.input.longest_gap * 1e9
        self._resamples = bool(parameters.input.rate) and (
            parameters.input.rate != parameters.rate or parameters.imu.sampling != "instantaneous"
        )
        self._gravity_w = gravity_vector(parameters)
        self._check = StartCheck(parameters)
        self._order = self._new_order()
        self._begin(parameters.seed)
        for line in parameters.warnings():
            remark(line)

    @property
    def uses_orientation(self) -> bool:
        """Whether the orientation of readings matters to the samples."""
        return bool(self._sensors) or self.parameters.input.gravity == "missing"

    def _begin(self, seed: int) -> None:
        self.seed = seed
        """Seed of the errors since the last restart."""
        self.position = 0
        """Samples since the last restart, missing ones too."""
        self._imu: Imu | None = None
        self._last_ns: int | None = None
        self._recent_ns = np.empty(0, np.int64)
        """The last stamps."""
        self._held: GivenReadings | None = None
        """The last reading, which the sensor goes on with during a gap."""
        self._pending: ErrorModelParameters | None = None
        self._faults: list[tuple[Fault, int]] = []
        self._conventions = Conventions(self.parameters)
        self._resampler = Resampler(self.parameters) if self._resamples else None

    def reset(self) -> None:
        """Begin again with the next reading, with the seed that input.restart gives."""
        self._order = self._new_order()
        self._begin(self._seed_of_restart())

    def _new_order(self) -> Order:
        return Order(self._leave_out, self._take_back)

    def _seed_of_restart(self) -> int:
        return self.seed + (self.parameters.input.restart == "next_seed")

    def update(self, parameters: ErrorModelParameters) -> None:
        """Take new values of live parameters, from the next multiple of 64 samples on.

        :raises ConfigurationError: with a line for every changed parameter that is not live;
            nothing is changed then.
        """
        old, new = flatten(self.parameters), flatten(parameters)
        known = described(type(parameters), new)
        problems = [
            f"{name}: cannot be changed while the error model runs"
            for name, value in new.items()
            if old.get(name) != value and not known[name].live
        ]
        if problems:
            raise ConfigurationError(problems)
        self.parameters = parameters
        self._pending = parameters

    def inject(self, fault: Fault, delay: float = 0.0) -> int:
        """Let a fault begin; returns the index of the first sample that it hits.

        :param delay: seconds after the next sample, >= 0.
        :raises ConfigurationError: for another delay, and a sensor that is not there.
        """
        if not 0.0 <= delay < np.inf:
            raise ConfigurationError(f"fault delay = {delay}: must be at least 0 s")
        if fault.triad not in ("", "gyroscope", "accelerometer"):
            raise ConfigurationError(
                f"fault triad = {fault.triad}: an error model has no {fault.triad}"
            )
        first = self.position + timebase.sample_count(delay, self.parameters.rate)
        if self._imu is None:
            self._faults.append((fault, first))
        else:
            self._imu.inject(fault, first / timebase.exact_rate(self.parameters.rate))
        return first

    def time_of(self, index: int) -> int | None:
        """Return about when a sample to come is taken [ns]; None before the first reading."""
        if self._last_ns is None:
            return None
        return self._last_ns + round((index - self.position + 1) * self._nominal_ns)

    def read(self, given: GivenReadings) -> list[dict[str, Any]]:
        """Return the samples that readings give, by sensor, in one window or several.

        If stamps jump back the errors begin again; readings that repeat a stamp, or come late,
        are left out. ``first`` of the IMU's is the index of the first sample since the restart.

        :param given: as they come from the other simulator; they have passed the gate.
        :raises InputError: if gravity is missing and there is no orientation.
        """
        self.counts.readings += len(given.t_ns)
        windows = [
            read for part, back_ns in self._order.parts(given) for read in self._read(part, back_ns)
        ]
        for read in windows:
            self.counts.samples += len(read[IMU].true_t_ns)
        return windows

    def _leave_out(self, step_ns: int) -> None:
        if step_ns:
            self.counts.backward += 1
            line = f"a stamp {-step_ns * 1e-9:.6f} s before the previous one; left out"
            self._report(self.counts.backward, line)
        else:
            self.counts.repeated += 1
            line = "a reading with the stamp of the previous one; left out"
            self._report(self.counts.repeated, line)

    def _take_back(self, count: int) -> None:
        self.counts.backward -= count

    def _report(self, count: int, line: str) -> None:
        """Remark on an irregularity of the stamps, unless there were a few of its kind before.

        :param count: of its kind so far.
        """
        if count < _REPORTED:
            self._remark(line)
        elif count == _REPORTED:
            self._remark(f"{line}; further ones are only counted")

    def _restart(self, back_ns: int) -> None:
        self.counts.restarts += 1
        seed = self._seed_of_restart()
        line = f"stamps jump back by {back_ns * 1e-9:.3f} s: the errors begin again, seed {seed}"
        self._report(self.counts.restarts, line)
        self._begin(seed)

    def _read(self, given: GivenReadings, back_ns: int) -> list[dict[str, Any]]:
        """Return the samples of readings in order, after a jump back of their stamps."""
        if back_ns:
            self._restart(back_ns)
        if not self._check.done:
            self._look(given)
        blocks = []
        for part, missing in self._without_gaps(given):
            if missing:
                self._skip(missing)
            self._last_ns = int(part.t_ns[-1])
            blocks += self._sampled(self._conventions.apply(part))
        return blocks

    def _look(self, given: GivenReadings) -> None:
        for line in self._check.look(given):
            self._remark(line)

    def _without_gaps(self, given: GivenReadings) -> Iterator[tuple[GivenReadings, int]]:
        """Yield readings without a gap, each part with the samples missing before it."""
        before = len(self._recent_ns)
        t_ns = np.concatenate([self._recent_ns, given.t_ns])
        self._recent_ns = t_ns[-_LOOKED_BACK:]
        begin = missing = 0
        since = max(before, 1)
        long = t_ns[since:] - t_ns[since - 1 : -1] > 1.5 * self._nominal_ns
        for k in (np.flatnonzero(long) + since).tolist() if long.any() else ():
            if k > before:
                yield given.at(slice(begin, k - before)), missing
            begin, missing = k - before, self._missing(t_ns[: k + 1])
        yield given.at(slice(begin, None)) if begin else given, missing

    def _missing(self, t_ns: Times) -> int:
        """Return how many samples the last step of stamps leaves out, without a clock of its own.

        Irregular stamps leave out none: over some of the last intervals there are enough of them.
        """
        step_ns = int(t_ns[-1] - t_ns[-2])
        if step_ns > self._longest_gap_ns:
            self.counts.pauses += 1
            line = f"no readings for {step_ns * 1e-9:.3f} s: a pause, the errors stand still"
            self._report(self.counts.pauses, line)
            if self._resampler is not None:
                self._resampler.begin()
            return 0
        if self._resampler is not None:
            return 0
        before = t_ns[-_LOOKED_BACK - 1 : -1][::-1]
        expected = np.rint((t_ns[-1] - before) / self._nominal_ns).astype(np.int64)
        missing = max(int((expected - np.arange(1, len(before) + 1)).min()), 0)
        self.counts.missing += missing
        return missing

    def _skip(self, count: int) -> None:
        """Let the sensor take samples that nobody sees, at rest where it was last."""
        held = self._held
        if held is None:
            return
        while count:
            step = min(count, _SAMPLES_AT_ONCE)
            steps = np.arange(1, step + 1) * self._nominal_ns
            t_ns = held.t_ns + np.rint(steps).astype(np.int64)
            gyro, accel = (np.repeat(one, step, axis=0) for one in (held.gyro, held.accel))
            q_wb = None if held.q_wb is None else np.repeat(held.q_wb, step, axis=0)
            self._sampled(GivenReadings(t_ns, gyro, accel, q_wb))
            count -= step

    def _sampled(self, given: GivenReadings) -> list[dict[str, Any]]:
        """Return the samples of readings in the IMU's place."""
        inside = (given.gyro, given.accel)
        if self._resampler is not None:
            given, inside = self._resampler.apply(given)
        else:
            self._held = given if len(given.t_ns) == 1 else given.at(slice(-1, None))
        count = len(given.t_ns)
        if not count:
            return []
        imu = self._imu or self._start(given)
        if self._pending is None:
            return [self._apply(imu, given, *inside)]
        ratio = len(inside[0]) // count
        blocks, done = [], 0
        while done < count:
            if self._pending is not None and self.position % AHEAD == 0:
                imu.configure(self._pending.imu)
                self._pending = None
            left = count - done
            step = left if self._pending is None else min(left, AHEAD - self.position % AHEAD)
            rows, own = slice(done, done + step), slice(done * ratio, (done + step) * ratio)
            blocks.append(self._apply(imu, given.at(rows), inside[0][own], inside[1][own]))
            done += step
        return blocks

    def _apply(self, imu: Imu, given: GivenReadings, gyro: Array, accel: Array) -> dict[str, Any]:
        """Return the next samples, which are those of readings (n m, 3) inside the sensor."""
        first, self.position = self.position, self.position + len(given.t_ns)
        block = imu.apply(first, given.t_ns, self._motion(given), gyro, accel)
        read = {IMU: block, POSE: pose_samples(block.true_t_ns, block.motion)}
        if self._others:
            rate = timebase.exact_rate(self.parameters.rate)
            window = Window(first / rate, self.position / rate)
            read |= {name: model.read(window, self._world) for name, model in self._others.items()}
        return read

    def _start(self, given: GivenReadings) -> Imu:
        """Make the sensor, whose first sample is the first of the readings."""
        parameters = self.parameters
        environment = dataclasses.replace(parameters, seed=self.seed)
        t0_ns = int(given.t_ns[0])
        self._world = World(NOWHERE, environment, t0_ns)
        self._others = models(mounted(environment), self._sensors, t0_ns)
        imu = self._others.pop("imu")
        assert isinstance(imu, Imu)
        for fault, first in self._faults:
            imu.inject(fault, first / timebase.exact_rate(parameters.rate))
        self._imu, self._faults, self._pending = imu, [], None
        return imu

    def _motion(self, given: GivenReadings) -> Motion:
        """Return what is known of the motion: the attitude, and the acceleration with it."""
        motion = unknown_motion(len(given.t_ns))
        if given.q_wb is None:
            if self._sensors:
                raise ConfigurationError(
                    "orientation: the readings come without one, so there is none to state"
                )
            return motion
        acceleration = rotate(given.q_wb, given.accel) + self._gravity_w
        return motion._replace(q_wb=given.q_wb, acceleration=acceleration)


def joined(blocks: list[ImuBlock]) -> ImuBlock:
    """Return blocks, at least one, as one."""
    if len(blocks) == 1:
        return blocks[0]
    columns: dict[str, Any] = {}
    shift, delivered = 0, []
    for block in blocks:
        delivered.append(block.delivered + shift)
        shift += len(block.true_t_ns)
    for name in ImuBlock._fields:
        if name not in ("first", "delivered", "motion", "sensors"):
            columns[name] = np.concatenate([getattr(block, name) for block in blocks])
    motion = Motion(*(np.concatenate(v) for v in zip(*(b.motion for b in blocks), strict=True)))
    return ImuBlock(
        first=blocks[0].first,
        delivered=np.concatenate(delivered),
        motion=motion,
        **columns,
    )
