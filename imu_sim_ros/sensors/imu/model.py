# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""An IMU on a moving body: both triads, the temperature and the clock."""

import math
from collections.abc import Iterator, Sequence
from fractions import Fraction
from functools import lru_cache, partial
from typing import TYPE_CHECKING, Any, Final, NamedTuple

import numpy as np

from imu_sim_ros.core import rotation, timebase
from imu_sim_ros.core.components import Vector, components_of
from imu_sim_ros.core.conventions import ERRORS, TRIADS
from imu_sim_ros.core.records import LiveReading
from imu_sim_ros.core.types import Array, Times
from imu_sim_ros.sensors.declaration import Mounted
from imu_sim_ros.sensors.deferred import ValuesOnDemand
from imu_sim_ros.sensors.errors.realised import realise_unit
from imu_sim_ros.sensors.errors.terms import Surroundings
from imu_sim_ros.sensors.errors.triad import (
    Additions,
    NumberAdditions,
    Reading,
    Triad,
    assemble_reading,
)
from imu_sim_ros.sensors.faults import Fault
from imu_sim_ros.sensors.imu import vibration
from imu_sim_ros.sensors.imu.ideal import IdealImu, Quadrature, quadrature
from imu_sim_ros.sensors.imu.parameters import ImuParameters
from imu_sim_ros.sensors.samples import Samples, join_samples
from imu_sim_ros.sensors.timing import SampleTiming
from imu_sim_ros.sensors.world import Window, World
from imu_sim_ros.trajectory.motion import Motion

if TYPE_CHECKING:
    from imu_sim_ros.sensors.imu.vibration import BoardVibration


_INTERNAL_READINGS: Final = 16384
"""Generated at a time inside an oversampled sensor."""
_VALUES: Final = (
    *("gyro", *(f"gyro_{error}" for error in ERRORS)),
    *("accel", *(f"accel_{error}" for error in ERRORS)),
    *("temperature", "ideal_gyro", "ideal_accel", "motion"),
)
"""Names of the arrays in a block of samples, in the order of computation."""
AHEAD: Final = 64
"""Samples whose noise is made at once where given readings come one by one."""
_LONGEST_LOOK: Final = 3600.0
"""Longest part of a motion that is compared with the sensor's ranges [s]."""
_ROUNDING: Final = 1e-9
"""Bound on the relative rounding error of the length of a rotated vector."""
_MOST_LOOKS: Final = 100_000
"""Largest number of times at which a motion is compared with the range."""
_LOOKS_AT_ONCE: Final = 8192
"""A run of one block, of as many samples, has its motion sampled once: the world keeps it."""


class _Ahead(NamedTuple):
    """Errors of the samples ``start .. end - 1`` that do not depend on their ideal readings."""

    start: int
    """Index of the first sample."""
    end: int
    """Index of the sample after the last one."""
    temperature: Array
    """(end - start,) temperatures of the sensor [degC]."""
    additions: Sequence[Additions]
    """Additive errors of the gyroscope and of the accelerometer."""
    numbers: Sequence[tuple[NumberAdditions, NumberAdditions]]
    """Additive errors of both triads by sample, as plain numbers."""


class Imu:
    """One IMU; its samples are read in order."""

    latest: Samples
    """Samples of the most recent read."""

    def __init__(self, mounted: Mounted[ImuParameters], t0_ns: int, _: object = None) -> None:
        """Set up all errors at their start.

        :param t0_ns: time of sample 0 [ns].
        """
        imu, environment = mounted.parameters, mounted.environment
        seed, rate = environment.seed, environment.rate
        self._seed, self._rate = seed, rate
        self._averaged = imu.sampling == "averaged"
        self._quadrature: Quadrature | None = None
        self._ratio = int(imu.internal_ratio(rate))
        self._ideal = IdealImu(imu, environment)
        self._triads = [Triad(triad, imu, seed, rate, self._ratio) for triad in TRIADS]
        self._timing = SampleTiming("", rate, imu, seed, t0_ns)
        self._vibration: BoardVibration | None = None
        if imu.vibration.is_present:
            self._vibration = vibration.BoardVibration(seed, imu.vibration, rate)
        self._ahead = _Ahead(start=0, end=0, temperature=np.empty(0), additions=(), numbers=())
        self.configure(imu)

    def configure(self, imu: ImuParameters) -> None:
        """Apply new values of live parameters, from the next sample on.

        For readings from outside (:meth:`apply`), from the next chunk on.
        """
        self._reference_temperature = imu.reference_temperature
        for name, triad in zip(TRIADS, self._triads, strict=True):
            triad.configure(realise_unit(imu.triad(name), name, self._seed))
        follows = any(triad.follows_force for triad in self._triads)
        self._made_ahead = self._ratio == 1 and not follows
        """True if the additive errors can be drawn before the readings exist: one for each
        reading, and none that depends on the force."""
        remembers = any(triad.remembers for triad in self._triads)
        self._plain = self._made_ahead and not remembers and self._vibration is None
        """True if a single reading is computed with numbers instead of arrays."""
        self._timing.configure(imu)

    def inject(self, fault: Fault, begin: Fraction) -> None:
        """Start a fault at the first sample at or after a time since the start [s]."""
        self._timing.inject(fault, begin)

    def read(self, window: Window, world: World) -> Samples:
        """Return the samples in a window, which begins where the last one ended."""
        start, true_t_ns, t = self._timing.times.within(window)
        motion, *ideal = self._ideal_readings(start, t, world)
        temperature = world.temperature.at(t)
        vibration = None if self._vibration is None else self._vibration.read(start, motion)
        if self._ratio == 1:
            additions = self._additions(temperature, ideal[1])
            readings = self._triad_readings(start, ideal, additions, vibration)
        else:
            readings = self._oversample(start, len(t), world, vibration)
        return self._samples(start, true_t_ns, motion, ideal, temperature, readings)

    def apply(
        self, true_t_ns: Times, motion: Motion, gyro: Array, accel: Array, world: World
    ) -> Samples:
        """Return the next n samples of ideal readings from outside the simulation.

        Errors that depend on time follow the samples' indices, so that they are those of
        :meth:`read`; stamps, latency and losses are those of the given times. For short calls the
        additive errors are drawn ahead, for a chunk of ``AHEAD`` samples at once.

        :param true_t_ns: (n,) true times of the samples [ns].
        :param motion: motion of the body at these times, NaN if it is not known.
        :param gyro: (n m, 3) ideal rates [rad/s]; an oversampled sensor has m = ratio readings
            inside for each sample, the last of them at its time; any other has m = 1.
        :param accel: (n m, 3) ideal specific forces [m/s^2].
        """
        start, count, m = self._timing.position, len(true_t_ns), self._ratio
        if self._made_ahead and self._ahead.end <= start and 0 < count < AHEAD:
            self._look_ahead(start, world)
        drawn_ahead = self._ahead.end - start
        if 0 < drawn_ahead < count:
            # First the samples whose errors are drawn; such a sensor has m = 1.
            parts = []
            for rows in (slice(0, drawn_ahead), slice(drawn_ahead, count)):
                part_motion = Motion(*(values[rows] for values in motion))
                parts.append(
                    self.apply(true_t_ns[rows], part_motion, gyro[rows], accel[rows], world)
                )
            self.latest = join_samples(parts)
            return self.latest
        if drawn_ahead > 0:
            rows = slice(start - self._ahead.start, start - self._ahead.start + count)
            temperature = self._ahead.temperature[rows]
            additions = [errors.at(rows) for errors in self._ahead.additions]
        else:
            temperature = world.temperature.at(self._timing.times.at_indices(start, count).t)
            substep_temperature = temperature
            if m > 1:
                substep_temperature = world.temperature.at(self._times_inside(start, start + count))
            additions = self._additions(substep_temperature, accel)
        vibration = None if self._vibration is None else self._vibration.read(start, motion)
        readings = self._triad_readings(start, (gyro, accel), additions, vibration)
        ideal = (gyro[m - 1 :: m], accel[m - 1 :: m])
        return self._samples(start, true_t_ns, motion, ideal, temperature, readings)

    def apply_few(
        self, times: Sequence[int], readings: Sequence[LiveReading], motion: Motion, world: World
    ) -> Samples | None:
        """Return the next samples of a few ideal readings, in numbers: those of :meth:`apply`.

        The formulas are the same functions of components. Arrays of a few rows would cost as many
        calls of NumPy as arrays of thousands, several for each error of the sensor.

        :param times: stamps of the readings [ns].
        :returns: None if faults, a filter or errors that depend on the force need arrays: then
            :meth:`apply` must be called.
        """
        if not self._plain or self._timing.faults.windows:
            return None
        start = self._timing.position
        results, rows = self._numbers(start, readings, world)
        table = np.array([reading for reading, _ in results])
        rates, forces = table[::2], table[1::2]
        truth = partial(_truth, (rates, forces), results, self._ahead, rows, readings, motion)
        values = ValuesOnDemand({"gyro": rates, "accel": forces}, _VALUES, truth)
        self.latest = self._timing.samples(start, np.array(times), values)
        return self.latest

    def read_numbers(
        self, times: Sequence[int], readings: Sequence[LiveReading], world: World
    ) -> list[LiveReading] | None:
        """Return the next samples of a few ideal readings, with their stamps, without their truth.

        The numbers are those of :meth:`apply`, and all of them are delivered at once.

        :param times: stamps of the readings, at least one [ns].
        :returns: None if :meth:`apply_few` or :meth:`apply` must be called instead.
        """
        start = self._timing.position
        stamps = self._timing.steady_stamps(start, times) if self._plain else None
        if stamps is None:
            return None
        results, _ = self._numbers(start, readings, world)
        return [
            LiveReading(t_ns, results[2 * k][0], results[2 * k + 1][0])
            for k, t_ns in enumerate(stamps)
        ]

    def _numbers(
        self, start: int, readings: Sequence[LiveReading], world: World
    ) -> tuple[list[tuple[Vector[float], Vector[float] | None]], slice]:
        """Return the readings of both triads in turn, with their response errors.

        The second result are the rows of these samples in what is made ahead.

        :param start: index of the first sample.
        """
        count = len(readings)
        while self._ahead.end < start + count:
            self._look_ahead(start, world)
        ahead = self._ahead
        rows = slice(start - ahead.start, start - ahead.start + count)
        of_gyro, of_accel = self._triads
        results = []
        for (_, gyro, accel, _), added in zip(readings, ahead.numbers[rows], strict=True):
            results.append(of_gyro.read_numbers(gyro, accel, added[0]))
            results.append(of_accel.read_numbers(accel, accel, added[1]))
        return results, rows

    def _look_ahead(self, start: int, world: World) -> None:
        """Draw the errors of the samples from an index on, up to the next multiple of ``AHEAD``.

        Errors that were drawn before for these samples stay.
        """
        previous, begin = self._ahead, max(start, self._ahead.end)
        end = begin + AHEAD - begin % AHEAD
        temperature = world.temperature.at(self._timing.times.at_indices(begin, end - begin).t)
        additions = self._additions(temperature, None)
        numbers = list(zip(*(values.numbers() for values in additions), strict=True))
        if start < begin:
            rows = slice(start - previous.start, None)
            temperature = np.concatenate([previous.temperature[rows], temperature])
            drawn = [values.at(rows) for values in previous.additions]
            additions = [a.followed_by(b) for a, b in zip(drawn, additions, strict=True)]
            numbers = [*previous.numbers[rows], *numbers]
        self._ahead = _Ahead(
            start=start, end=end, temperature=temperature, additions=additions, numbers=numbers
        )

    def _additions(self, temperature: Array, force: Array | None) -> list[Additions]:
        """Return the additive errors of the next readings at temperatures (n,) [degC]."""
        surroundings = Surroundings(temperature - self._reference_temperature, force)
        return [triad.additions(surroundings) for triad in self._triads]

    def _triad_readings(
        self,
        start: int,
        ideal: Sequence[Array],
        additions: Sequence[Additions],
        vibration: Array | None,
    ) -> list[Reading]:
        """Return n readings of the gyroscope and of the accelerometer.

        :param start: index of the first sample.
        :param ideal: ideal rates [rad/s] and specific forces [m/s^2], (n m, 3) each.
        :param additions: additive errors of both triads.
        :param vibration: (n, 6) vibration at gyroscope and accelerometer; None: there is none.
        """
        shaken = (None, None) if vibration is None else (vibration[:, :3], vibration[:, 3:])
        return [
            triad.read(start, triad_input, ideal[1], added, self._timing.faults, shake)
            for triad, triad_input, added, shake in zip(
                self._triads, ideal, additions, shaken, strict=True
            )
        ]

    def _samples(
        self,
        start: int,
        true_t_ns: Times,
        motion: Motion,
        ideal: Sequence[Array],
        temperature: Array,
        readings: Sequence[Reading],
    ) -> Samples:
        """Return n samples with stamps and transport.

        :param start: index of the first sample.
        :param true_t_ns: (n,) true times [ns].
        :param ideal: ideal rates [rad/s] and specific forces [m/s^2], (n, 3) each.
        :param temperature: (n,) temperature of the sensor [degC].
        :param readings: readings of gyroscope and accelerometer with their errors.
        """
        gyro, accel = readings
        arrays = (*gyro, *accel, temperature, *ideal, motion)
        values = dict(zip(_VALUES, arrays, strict=True))
        self.latest = self._timing.samples(start, true_t_ns, values)
        return self.latest

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

    def _oversample(
        self, start: int, count: int, world: World, vibration: Array | None
    ) -> list[Reading]:
        """Return the triads' samples, each the last of ``ratio`` readings at the internal rate.

        In pieces, so that the readings inside the sensor need no more memory than a block. Before
        the first sample the body is assumed to be where it is at the first.
        """
        pieces = []
        step = max(_INTERNAL_READINGS // self._ratio, 1)
        for begin in range(start, start + max(count, 1), step):
            end = min(begin + step, start + count)
            t = self._times_inside(begin, end)
            ideal = self._ideal.read(world.trajectory.sample(t))
            additions = self._additions(world.temperature.at(t), ideal[1])
            piece_vibration = None if vibration is None else vibration[begin - start : end - start]
            pieces.append(self._triad_readings(begin, ideal, additions, piece_vibration))
        return [
            Reading(*(np.concatenate(parts) for parts in zip(*readings, strict=True)))
            for readings in zip(*pieces, strict=True)
        ]

    def _ideal_readings(self, start: int, t: Array, world: World) -> tuple[Motion, Array, Array]:
        """Return the motion at times t (n,) and the readings of a perfect IMU, (n, 3) twice."""
        if not self._averaged:
            motion = world.motion(t)
            return motion, *self._ideal.read(motion)
        if self._quadrature is None:
            self._quadrature = quadrature(world.trajectory.highest_frequency, 1.0 / self._rate)
        previous = timebase.sample_times_ns(max(start - 1, 0), 1, self._rate)
        ends = np.concatenate([timebase.seconds_since(previous, 0), t])
        motion = world.motion(ends)
        rate, force = self._ideal.read_mean(world.trajectory, ends, motion, self._quadrature)
        motion = Motion(*(values[1:] for values in motion))
        if start == 0:  # nothing lies before the first sample: it is the value at its time
            at_once = self._ideal.read(Motion(*(values[:1] for values in motion)))
            rate[:1], force[:1] = at_once
        return motion, rate, force


def _truth(
    samples: Sequence[Array],
    results: Sequence[tuple[Vector[float], Vector[float] | None]],
    ahead: _Ahead,
    rows: slice,
    readings: Sequence[LiveReading],
    motion: Motion,
) -> Iterator[Any]:
    """Yield all values of a few samples, in the order of ``_VALUES``.

    :param samples: (n, 3) samples of gyroscope and accelerometer.
    :param results: readings and response errors of both triads in turn.
    :param rows: rows of the samples in what was made ahead.
    :param readings: ideal readings.
    """
    for k, (values, added) in enumerate(zip(samples, ahead.additions, strict=True)):
        errors = [error for _, error in results[k::2] if error is not None]
        yield from assemble_reading(values, added.at(rows), np.array(errors) if errors else None)
    yield ahead.temperature[rows]
    yield np.array([reading[1] for reading in readings])
    yield np.array([reading[2] for reading in readings])
    yield motion


def range_warnings(mounted: Mounted[ImuParameters], world: World, duration: float) -> list[str]:
    """Return a line for each triad whose range the motion exceeds when it is read.

    At most the first hour is examined, at 100,000 times or fewer.

    :param duration: length of the run [s]; may be infinite.
    :raises ConfigurationError: for averaged readings of a motion that is too quick to be averaged.
    """
    imu, environment, trajectory = mounted.parameters, mounted.environment, world.trajectory
    if imu.sampling == "averaged":
        quadrature(trajectory.highest_frequency, 1.0 / environment.rate)
    if not (any(imu.gyroscope.range) or any(imu.accelerometer.range)):
        return []
    end = min(duration, trajectory.duration, _LONGEST_LOOK)
    samples = max(1, min(_MOST_LOOKS, math.ceil(end * environment.rate)))
    limits = np.array([imu.triad(name).range for name in TRIADS])
    limits = np.where(limits > 0.0, limits, np.inf)
    smallest_limits = (1.0 - _ROUNDING) * limits.min(axis=1)
    # Rows are the triads, columns the axes.
    peaks, times = np.zeros((2, 3)), np.zeros((2, 3))
    for start in range(0, samples, _LOOKS_AT_ONCE):
        count = min(_LOOKS_AT_ONCE, samples - start)
        t_ns = timebase.sample_times_ns(start, count, min(environment.rate, samples / end))
        t = timebase.seconds_since(t_ns, 0)
        motion = world.motion(t)
        rate, force = motion.angular_velocity, motion.acceleration - np.asarray(environment.gravity)
        if _longest(rate) < smallest_limits[0] and _longest(force) < smallest_limits[1]:
            continue  # no axis can read more, however the body is turned
        force = rotation.rotate_inverse(motion.q_wb, force)
        for triad, values in enumerate((rate, force)):
            sizes = np.abs(values)
            rows = np.argmax(sizes, axis=0)
            largest = sizes[rows, np.arange(3)]
            higher = largest > peaks[triad]
            peaks[triad, higher], times[triad, higher] = largest[higher], t[rows][higher]
    lines = []
    for triad, (name, quantity, unit) in enumerate(
        (("gyroscope", "rate", "rad/s"), ("accelerometer", "specific force", "m/s^2"))
    ):
        k = int(np.argmax(peaks[triad] / limits[triad]))
        if peaks[triad, k] > limits[triad, k]:
            lines.append(
                f"the motion exceeds the {name}'s range: {quantity} {peaks[triad, k]:.4g} {unit} "
                f"on {'xyz'[k]} at {times[triad, k]:.3f} s, range {limits[triad, k]:.4g} {unit}"
            )
    return lines


def _longest(vectors: Array) -> float:
    """Return the length of the longest vector (n, 3)."""
    x, y, z = components_of(vectors)
    return math.sqrt(np.max(x * x + y * y + z * z))


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
    return Motion(
        position=vector,
        velocity=vector,
        acceleration=vector,
        q_wb=q_wb,
        angular_velocity=vector,
        angular_acceleration=vector,
    )
