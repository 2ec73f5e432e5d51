# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""An IMU on a moving body: both triads, the temperature and the clock."""

import math
from collections.abc import Iterable, Iterator, Sequence
from fractions import Fraction
from functools import lru_cache
from typing import TYPE_CHECKING, Any, Final, NamedTuple

import numpy as np

from imu_sim_ros import timebase
from imu_sim_ros.conventions import ERRORS, TRIADS
from imu_sim_ros.sensors.environment import EnvironmentParameters
from imu_sim_ros.sensors.errors.response import TemperatureProfile
from imu_sim_ros.sensors.errors.terms import Surroundings
from imu_sim_ros.sensors.errors.triad import Additions, Reading, Triad
from imu_sim_ros.sensors.faults import Fault
from imu_sim_ros.sensors.imu.ideal import IdealImu, Quadrature, quadrature
from imu_sim_ros.sensors.imu.parameters import ImuParameters
from imu_sim_ros.sensors.samples import Samples
from imu_sim_ros.sensors.timing import SampleTiming
from imu_sim_ros.sensors.world import Window, World
from imu_sim_ros.trajectory.motion import Motion, Trajectory
from imu_sim_ros.types import Array, Times

if TYPE_CHECKING:
    from imu_sim_ros.sensors.imu.vibration import BoardVibration


_INTERNAL_READINGS: Final = 16384
"""Generated at a time inside an oversampled sensor."""
AHEAD: Final = 64
"""Samples whose noise is made at once where given readings come one by one."""


class Imu:
    """One IMU; its samples are read in order."""

    latest: Samples
    """What was read last."""

    def __init__(self, imu: ImuParameters, environment: EnvironmentParameters, t0_ns: int) -> None:
        """Set up all errors at their start.

        :param t0_ns: time of sample 0 [ns].
        """
        seed, rate = environment.seed, environment.rate
        self._rate = rate
        self._averaged = imu.sampling == "averaged"
        self._quadrature: Quadrature | None = None
        self._ratio = int(imu.internal_ratio(rate))
        self._ideal = IdealImu(imu, environment)
        self._temperature = TemperatureProfile(environment.temperature)
        self._triads = [Triad(triad, imu, seed, rate) for triad in TRIADS]
        self._follows_force = any(triad.follows_force for triad in self._triads)
        self._timing = SampleTiming("", rate, imu, seed, t0_ns)
        self._vibration = _vibration(imu, environment)
        self._ahead: _Ahead | None = None
        self.configure(imu)

    def configure(self, imu: ImuParameters) -> None:
        """Take new values of live parameters, from the next sample on.

        Of given readings, see :meth:`apply`, with the next chunk.
        """
        self._reference_temperature = imu.reference_temperature
        for triad in self._triads:
            triad.configure(imu)
        self._timing.configure(imu)

    def prepare(self, trajectory: Trajectory) -> None:
        """Determine how finely a motion has to be sampled, before the first reading.

        :raises ConfigurationError: if its frequencies are too high for averaging.
        """
        if self._averaged:
            self._quadrature = quadrature(trajectory.highest_frequency, 1.0 / self._rate)

    def inject(self, fault: Fault, begin: Fraction) -> None:
        """Let a fault begin with the first sample not before a time since the start [s]."""
        self._timing.inject(fault, begin)

    def read(self, window: Window, world: World) -> Samples:
        """Return the samples in a window, which begins where the last one ended."""
        first, true_t_ns, t = self._timing.times.within(window)
        motion, ideal_gyro, ideal_accel = self._ideal_readings(first, t, world)
        ideal = (ideal_gyro, ideal_accel)
        temperature = self._temperature.at(t)
        vibration = self._vibration.read(first, motion) if self._vibration else None
        if self._ratio == 1:
            gyro, accel = self._triad_readings(first, *ideal, temperature, vibration)
        else:
            gyro, accel = self._oversampled(first, len(t), world.trajectory, vibration)
        return self._block(first, true_t_ns, motion, ideal, temperature, gyro, accel)

    def apply(
        self, first: int, true_t_ns: Times, motion: Motion, ideal_gyro: Array, ideal_accel: Array
    ) -> Samples:
        """Return samples ``first .. first + n - 1`` of ideal readings that somebody gives.

        Errors that depend on time follow the samples' indices, so that they are those of
        :meth:`read`; stamps, latency and losses are those of the given times.

        :param true_t_ns: (n,) of the samples [ns].
        :param motion: of the body at these times, NaN if it is not known.
        :param ideal_gyro: (n m, 3) [rad/s]; an oversampled sensor has m = ratio readings inside
            for each sample, the last of them at its time, others 1.
        :param ideal_accel: (n m, 3) [m/s^2].
        """
        m, count = self._ratio, len(true_t_ns)
        ideal = (ideal_gyro, ideal_accel)
        if m > 1:
            last = slice(m - 1, None, m)
            ideal = (ideal_gyro[last], ideal_accel[last])
        vibration = self._vibration.read(first, motion) if self._vibration else None
        if m > 1 or self._follows_force:
            temperature = self._temperature_of(first, count)
            inside = temperature if m == 1 else self._temperature_inside(first, count)
            gyro, accel = self._triad_readings(first, ideal_gyro, ideal_accel, inside, vibration)
            return self._block(first, true_t_ns, motion, ideal, temperature, gyro, accel)
        parts: list[tuple[Array, Reading, Reading]] = []
        for rows, own, additions in self._pieces(first, count):
            shaken = None if vibration is None else vibration[rows]
            pair = self._triad_readings(
                first + rows.start, ideal_gyro[rows], ideal_accel[rows], own, shaken, additions
            )
            parts.append((own, *pair))
        if len(parts) == 1:
            return self._block(first, true_t_ns, motion, ideal, *parts[0])
        temperatures, gyros, accels = zip(*parts, strict=True)
        made = (np.concatenate(temperatures), _joined(gyros), _joined(accels))
        return self._block(first, true_t_ns, motion, ideal, *made)

    def _block(
        self,
        first: int,
        true_t_ns: Times,
        motion: Motion,
        ideal: tuple[Array, Array],
        temperature: Array,
        gyro: Reading,
        accel: Reading,
    ) -> Samples:
        """Return n samples with stamps and transport."""
        values: dict[str, Any] = {
            "gyro": gyro.reading,
            "accel": accel.reading,
            "temperature": temperature,
            "ideal_gyro": ideal[0],
            "ideal_accel": ideal[1],
            "motion": motion,
        }
        for k, error in enumerate(ERRORS):
            values[f"gyro_{error}"], values[f"accel_{error}"] = gyro[1 + k], accel[1 + k]
        self.latest = self._timing.samples(first, true_t_ns, values)
        return self.latest

    def _pieces(
        self, first: int, count: int
    ) -> Iterator[tuple[slice, Array, Sequence[Additions | None]]]:
        """Yield consecutive rows of samples with their temperature and what the triads add.

        Few samples at a time get what is made for the rest of a chunk, many get their own.
        """
        done = 0
        while True:
            at, left = first + done, count - done
            ahead = self._ahead
            if ahead is not None and at == ahead.end:
                ahead = None
            if ahead is None and 0 < left < AHEAD:
                ahead = self._make_ahead(at)
            self._ahead = ahead
            if ahead is None:
                yield slice(done, count), self._temperature_of(at, left), (None, None)
                return
            step = min(left, ahead.end - at)
            own = slice(at - ahead.first, at - ahead.first + step)
            additions = [one.at(own) for one in ahead.additions]
            yield slice(done, done + step), ahead.temperature[own], additions
            done += step
            if done == count:
                return

    def _make_ahead(self, first: int) -> "_Ahead":
        """Return what the samples up to the next multiple of a chunk get."""
        end = first + AHEAD - first % AHEAD
        temperature = self._temperature_of(first, end - first)
        around = Surroundings(temperature - self._reference_temperature)
        return _Ahead(first, end, temperature, [t.precompute(around) for t in self._triads])

    def _temperature_of(self, first: int, count: int) -> Array:
        """Return the temperature of samples by their index (count,) [degC]."""
        t_ns = timebase.sample_times_ns(first, count, self._rate)
        return self._temperature.at(timebase.seconds_since(t_ns, 0))

    def _temperature_inside(self, first: int, count: int) -> Array:
        """Return the temperature of the readings inside an oversampled sensor (count m,)."""
        return self._temperature.at(self._times_inside(first, first + count))

    def _times_inside(self, begin: int, end: int) -> Array:
        """Return the times [s] of the readings inside for samples begin .. end - 1.

        Those before the first sample are at it.
        """
        since = max((begin - 1) * self._ratio + 1, 0)
        t_ns = timebase.sample_times_ns(
            since, max((end - 1) * self._ratio + 1 - since, 0), self._rate * self._ratio
        )
        missing = (end - begin) * self._ratio - len(t_ns)
        return timebase.seconds_since(np.concatenate([np.zeros(missing, np.int64), t_ns]), 0)

    def _triad_readings(
        self,
        first: int,
        ideal_gyro: Array,
        ideal_accel: Array,
        temperature: Array,
        vibration: Array | None,
        additions: Sequence[Additions | None] = (None, None),
    ) -> tuple[Reading, Reading]:
        offset = temperature - self._reference_temperature
        shaken = (None, None) if vibration is None else (vibration[:, :3], vibration[:, 3:])
        gyro, accel = (
            triad.read(first, ideal, ideal_accel, offset, self._timing.faults, own, added)
            for triad, ideal, own, added in zip(
                self._triads,
                (ideal_gyro, ideal_accel),
                shaken,
                additions,
                strict=True,
            )
        )
        return gyro, accel

    def _oversampled(
        self, first: int, count: int, trajectory: Trajectory, vibration: Array | None
    ) -> tuple[Reading, Reading]:
        """Return the triads' samples, each the last of ``ratio`` readings at the internal rate.

        In pieces, so that the readings inside the sensor need no more memory than a block. Before
        the first sample the body is assumed to be where it is at the first.
        """
        made = []
        step = max(_INTERNAL_READINGS // self._ratio, 1)
        for begin in range(first, first + max(count, 1), step):
            end = min(begin + step, first + count)
            t = self._times_inside(begin, end)
            ideal = self._ideal.read(trajectory.sample(t))
            own = None if vibration is None else vibration[begin - first : end - first]
            made.append(self._triad_readings(begin, *ideal, self._temperature.at(t), own))
        gyro, accel = (_joined(readings) for readings in zip(*made, strict=True))
        return gyro, accel

    def _ideal_readings(self, first: int, t: Array, world: World) -> tuple[Motion, Array, Array]:
        """Return the motion at times t (n,) and what a perfect IMU reads, (n, 3) twice."""
        if not self._averaged:
            motion = world.motion(t)
            return motion, *self._ideal.read(motion)
        if self._quadrature is None:
            self.prepare(world.trajectory)
            assert self._quadrature is not None
        before = timebase.sample_times_ns(max(first - 1, 0), 1, self._rate)
        ends = np.concatenate([timebase.seconds_since(before, 0), t])
        motion = world.motion(ends)
        rate, force = self._ideal.read_mean(world.trajectory, ends, motion, self._quadrature)
        motion = Motion(*(values[1:] for values in motion))
        if first == 0:  # nothing lies before the first sample: it is the value at its time
            at_once = self._ideal.read(Motion(*(values[:1] for values in motion)))
            rate[:1], force[:1] = at_once
        return motion, rate, force


class _Ahead(NamedTuple):
    """What samples ``first .. end - 1`` get whatever their ideal readings are."""

    first: int
    end: int
    temperature: Array
    """(end - first,) [degC]."""
    additions: list[Additions]
    """Those of the gyroscope and of the accelerometer."""


class _Nowhere:
    """The trajectory of a body whose motion is unknown."""

    duration = math.inf
    highest_frequency = 0.0

    def sample(self, t: Array) -> Motion:
        """Return n unknown states."""
        return unknown_motion(len(t))


NOWHERE: Final = _Nowhere()


@lru_cache(maxsize=8)
def unknown_motion(count: int) -> Motion:
    """Return a motion of n states of which nothing is known: NaN."""
    vector, q_wb = np.broadcast_to(np.nan, (count, 3)), np.broadcast_to(np.nan, (count, 4))
    return Motion(vector, vector, vector, q_wb, vector, vector)


def _joined(readings: Iterable[Reading]) -> Reading:
    return Reading(*(np.concatenate(parts) for parts in zip(*readings, strict=True)))


def _vibration(imu: ImuParameters, environment: EnvironmentParameters) -> "BoardVibration | None":
    """Return the vehicle's vibration in the readings, if there is any."""
    if not imu.vibration.there:
        return None
    from imu_sim_ros.sensors.imu.vibration import BoardVibration  # most sensors have no vehicle

    return BoardVibration(environment.seed, imu.vibration, environment.rate)
