# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Conversion of another simulator's output to the ideal readings of an IMU where it is mounted.

Everything is carried from one call to the next, so that the result does not depend on how many
readings come at a time.
"""

import math
import re
from collections.abc import Iterator, Sequence
from contextlib import suppress
from dataclasses import dataclass, field
from typing import Any, Final, NamedTuple

import numpy as np

from imu_sim_ros.core import rotation, timebase
from imu_sim_ros.core.components import Vector
from imu_sim_ros.core.conventions import TRIADS
from imu_sim_ros.core.errors import InputError
from imu_sim_ros.core.records import (
    Readings,
    States,
    TimeSeries,
    column,
    concatenate,
    replace_fields,
)
from imu_sim_ros.core.rotation import cross, normalise, rotate_inverse, transform
from imu_sim_ros.core.types import Array, Integers, Mask, Times
from imu_sim_ros.recordings.clock import estimate_clock, repeated_value_rows
from imu_sim_ros.recordings.findings.catalogue import stamp_findings, unit_findings
from imu_sim_ros.recordings.findings.finding import Finding
from imu_sim_ros.recordings.findings.policy import ERROR_MODEL
from imu_sim_ros.recordings.live_order import Order
from imu_sim_ros.sensors.gravity import gravity_vector
from imu_sim_ros.sensors.imu.ideal import size_effect
from imu_sim_ros.simulation.error_parameters import (
    AXES_TO_FLU,
    ErrorModelParameters,
    has_mount,
    sensor_rotation,
)


@dataclass(frozen=True, repr=False, eq=False)
class IdealValues(TimeSeries):
    """n ideal values of another sensor than the gyroscope and the accelerometer."""

    values: Array = field(metadata=column((), None))
    """(n,) or (n, 3)."""
    source: str = "values"
    """Name of the sensor."""
    lines: None = None
    """Values have no lines of a text file."""


class Conventions:
    """Conversion of readings from the declared axes, gravity and place to the mounted IMU."""

    def __init__(self, parameters: ErrorModelParameters) -> None:
        """Initialise with the declaration of the input, before the first reading."""
        declared, imu = parameters.input, parameters.imu
        self._turn = sensor_rotation(declared)
        self._adds_gravity = declared.gravity == "missing"
        self._to_flu = AXES_TO_FLU[declared.axes]
        self._gravity_w = gravity_vector(parameters)
        self._q_input = None if declared.axes == "flu" else _flu_in(declared.axes)
        self._world = _ned_to_enu() if declared.axes == "frd" else None
        self._mount = _Mount(parameters) if declared.place == "body" and has_mount(imu) else None
        turned = np.eye(3) if self._turn is None else self._turn
        if declared.place == "body":
            turned = np.reshape(imu.mounting, (3, 3)).T @ turned
        self._turn_only = None if np.array_equal(turned, np.eye(3)) else turned
        self.nothing = self._turn is None and self._mount is None and not self._adds_gravity
        """True if readings stay as they are."""

    def rotate(self, values: Array) -> Array:
        """Return vectors (n, 3) in the IMU's axes."""
        return values if self._turn_only is None else transform(self._turn_only, values)

    def apply(self, readings: Readings) -> Readings:
        """Return readings of the IMU where it is mounted.

        :raises InputError: if gravity is missing, and the orientation too.
        """
        q_wb = readings.q_wb
        if self.nothing and q_wb is None:
            return readings
        if q_wb is not None and self._q_input is not None:
            q_wb = rotation.multiply(q_wb, self._q_input)
            if self._world is not None:
                q_wb = rotation.multiply(self._world, q_wb)
        if self.nothing:
            return replace_fields(readings, q_wb=q_wb)
        gyro, accel = readings.triads()
        if self._adds_gravity:
            if q_wb is None:
                raise InputError(
                    "input.gravity = missing: needs the orientation of every reading, and there "
                    "is none"
                )
            accel = transform(self._to_flu, accel) - rotate_inverse(q_wb, self._gravity_w)
            accel = transform(self._to_flu.T, accel)
        if self._turn is not None:
            gyro, accel = transform(self._turn, gyro), transform(self._turn, accel)
        if self._mount is not None:
            gyro, accel = self._mount.apply(readings.t_ns, gyro, accel)
        return Readings.unchecked(t_ns=readings.t_ns, gyro=gyro, accel=accel, q_wb=q_wb)


def _flu_in(axes: str) -> Array:
    """Return q (4,) of ``R_input_flu``: from forward left up into the input's axes."""
    return rotation.from_matrix(AXES_TO_FLU[axes].T)


def _ned_to_enu() -> Array:
    """Return q (4,) that maps north east down to east north up."""
    return rotation.from_matrix([[0.0, 1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, -1.0]])


class _Mount:
    """Lever arm, mounting and size of an IMU, from the readings in the body's origin.

    ``f_i = R_ib (f_b + alpha x r + omega x (omega x r))`` with alpha the derivative of the parabola
    through the last three rates: without delay, and for a rate that changes with its third
    derivative omega''' off by ``h^2 omega''' / 3``.
    """

    def __init__(self, parameters: ErrorModelParameters) -> None:
        imu = parameters.imu
        self._arm = np.array(imu.lever_arm)
        self._r_ib = np.reshape(imu.mounting, (3, 3)).T
        self._elements = np.reshape(imu.accelerometer_positions, (3, 3))
        self._t_ns, self._rates = np.empty(0, np.int64), np.empty((0, 3))

    def apply(self, t_ns: Times, gyro: Array, accel: Array) -> tuple[Array, Array]:
        """Return rate and specific force where the IMU is mounted, in its axes."""
        alpha = self._derivative(t_ns, gyro)
        force = accel + cross(alpha, self._arm)
        force += cross(gyro, cross(gyro, self._arm))
        force, rate = transform(self._r_ib, force), transform(self._r_ib, gyro)
        if self._elements.any():
            force += size_effect(self._elements, rate, transform(self._r_ib, alpha))
        return rate, force

    def _derivative(self, t_ns: Times, gyro: Array) -> Array:
        """Return the angular acceleration (n, 3); 0 at the first reading."""
        history = len(self._t_ns)
        times = np.concatenate([self._t_ns, t_ns])
        rates = np.concatenate([self._rates, gyro])
        self._t_ns, self._rates = times[-2:], rates[-2:]
        alpha = np.zeros_like(rates)
        h = np.diff(times)[:, None] * 1e-9
        slope = np.diff(rates, axis=0) / h
        alpha[1:] = slope
        if len(h) > 1:  # the parabola's own slope at its end
            alpha[2:] += (slope[1:] - slope[:-1]) * (h[1:] / (h[1:] + h[:-1]))
        return alpha[history:]


def _means_between(t_ns: Times, values: Array, ends: Times) -> Array:
    """Return the means (k, c) of straight lines through values (n, c), between k + 1 times.

    Trapezoids between all corners of the lines and all ends are exact.

    :param t_ns: (n,) times of the values [ns].
    :param ends: (k + 1,) or no times [ns].
    """
    if len(ends) < 2:
        return np.empty((0, values.shape[1]))
    corners = np.union1d(t_ns, ends)
    first_pieces = np.searchsorted(corners, ends)
    seconds = np.diff(corners) * 1e-9
    line = _lines(t_ns, values, corners)
    pieces = 0.5 * (line[1:] + line[:-1]) * seconds[:, None]
    integrals = np.add.reduceat(pieces[: first_pieces[-1]], first_pieces[:-1])
    return np.asarray(integrals / (np.diff(ends)[:, None] * 1e-9))


class Grid(NamedTuple):
    """Samples of a sensor with a clock of its own."""

    readings: Readings
    """Readings at the samples' times."""
    inner_readings: tuple[Array, Array]
    """(n m, 3) twice: the readings inside an oversampled sensor; else those of ``readings``."""


class Resampler:
    """Readings at the times of a sensor that samples slower than they come.

    Between readings they are straight lines. ``instantaneous``: the value at a sample's time;
    ``averaged``: the mean since the sample before; ``oversampled``: the values at the times inside.
    """

    def __init__(self, parameters: ErrorModelParameters) -> None:
        """Initialise without readings."""
        imu, self._rate = parameters.imu, parameters.rate
        self._averaged = imu.sampling == "averaged"
        self._ratio = int(imu.internal_ratio(parameters.rate))
        self._begin_ns: int | None = None
        self._next = 0
        self._kept: Readings | None = None

    def begin(self) -> None:
        """Let the next reading be the first sample of a new grid, after a pause."""
        self._begin_ns, self._next, self._kept = None, 0, None

    def apply(self, readings: Readings) -> Grid:
        """Add n readings; return the samples up to the last one."""
        if self._begin_ns is None:
            self._begin_ns = int(readings.t_ns[0])
        stretch = readings if self._kept is None else concatenate([self._kept, readings])
        end_ns = int(stretch.t_ns[-1])
        count = self._count_until(end_ns)
        times = timebase.sample_times_ns(self._next, count, self._rate, self._begin_ns)
        samples = _interpolate(stretch, times)
        internal = samples
        if self._averaged and count:
            samples = internal = self._means(stretch, samples)
        elif self._ratio > 1:
            internal = _interpolate(stretch, self._times_inside(count))
        self._next += count
        self._keep(stretch)
        return Grid(samples, internal.triads())

    def _count_until(self, end_ns: int) -> int:
        """Return the number of samples, from the next on, at or before a time [ns]."""
        assert self._begin_ns is not None
        elapsed = timebase.exact_rate(self._rate) * (end_ns - self._begin_ns)
        limit = math.floor(elapsed / timebase.NANOSECONDS_PER_SECOND) + 2
        times = timebase.sample_times_ns(
            self._next, max(limit - self._next, 0) + 1, self._rate, self._begin_ns
        )
        return int(np.searchsorted(times, end_ns, side="right"))

    def _times_inside(self, count: int) -> Times:
        """Return the times (k,) of the next samples between readings."""
        assert self._begin_ns is not None
        begin, end = self._next, self._next + count
        j = np.arange((begin - 1) * self._ratio + 1, (end - 1) * self._ratio + 1)
        begin = int(max(j[0], 0)) if len(j) else 0
        later = timebase.sample_times_ns(
            begin, int(np.count_nonzero(j >= 0)), self._rate * self._ratio, self._begin_ns
        )
        clamped = np.full(len(j) - len(later), self._begin_ns)
        return np.concatenate([clamped, later])

    def _means(self, stretch: Readings, samples: Readings) -> Readings:
        """Return the samples with the mean of the readings since the sample before.

        The first sample of the grid has none before it, and stays the reading at its time.

        :param stretch: readings that reach back to the latest sample of the previous call.
        :param samples: n samples, with the readings at their times.
        """
        assert self._begin_ns is not None
        ends = samples.t_ns
        if self._next:
            previous_ns = timebase.sample_times_ns(self._next - 1, 1, self._rate, self._begin_ns)
            ends = np.concatenate([previous_ns, ends])
        means = _means_between(stretch.t_ns, np.hstack(stretch.triads()), ends)
        gyro, accel = means[:, :3], means[:, 3:]
        if not self._next:
            sampled_gyro, sampled_accel = samples.triads()
            gyro = np.concatenate([sampled_gyro[:1], gyro])
            accel = np.concatenate([sampled_accel[:1], accel])
        return replace_fields(samples, gyro=gyro, accel=accel)

    def _keep(self, stretch: Readings) -> None:
        """Keep the readings that the next samples need, from the one before the last sample on."""
        assert self._begin_ns is not None
        reached = self._begin_ns
        if self._next:
            times = timebase.sample_times_ns(self._next - 1, 1, self._rate, self._begin_ns)
            reached = int(times[0])
        begin = max(int(np.searchsorted(stretch.t_ns, reached, side="right")) - 1, 0)
        self._kept = stretch.rows(slice(begin, None))


def _line(t_ns: Times, values: Array, at_ns: Times) -> Array:
    """Return values (n,) interpolated linearly to times (m,); exact at their own times."""
    if len(t_ns) == 1:
        return np.full(len(at_ns), values[0])
    k = np.clip(np.searchsorted(t_ns, at_ns, side="right") - 1, 0, len(t_ns) - 2)
    step = (t_ns[k + 1] - t_ns[k]).astype(np.float64)
    share = (at_ns - t_ns[k]) / step
    result: Array = values[k] + share * (values[k + 1] - values[k])
    result[share == 1.0] = values[k + 1][share == 1.0]
    return result


def _lines(t_ns: Times, values: Array, at_ns: Times) -> Array:
    """Return columns (n, k) interpolated linearly to times (m,)."""
    result = np.empty((len(at_ns), values.shape[1]), order="F")
    for line, component in zip(result.T, values.T, strict=True):
        line[:] = _line(t_ns, component, at_ns)
    return result


def _interpolate(readings: Readings, at_ns: Times) -> Readings:
    """Return readings at other times, linear between given ones."""
    gyro, accel = (_lines(readings.t_ns, values, at_ns) for values in readings.triads())
    q_wb = None
    if readings.q_wb is not None:
        signs = np.cumprod(np.sign(_products(readings.q_wb)))  # q and -q are one rotation
        q_wb = normalise(_lines(readings.t_ns, readings.q_wb * signs[:, None], at_ns))
    return Readings.unchecked(t_ns=at_ns, gyro=gyro, accel=accel, q_wb=q_wb)


def _products(q: Array) -> Array:
    """Return the sign (n,) of each quaternion's product with the one before; 1 for the first."""
    dots = np.einsum("ni,ni->n", q[1:], q[:-1])
    return np.concatenate([[1.0], np.where(dots < 0.0, -1.0, 1.0)])


class Differentiator:
    """Rate and specific force of odometry: a velocity's change over 2 s + 1 messages.

    The acceleration at a message is ``(v(t + s h) - v(t - s h)) / (2 s h)`` in the world, off by
    ``(s h)^2 / 6`` times the third derivative of the velocity; it is known s messages later.
    """

    def __init__(self, parameters: ErrorModelParameters) -> None:
        """Initialise without messages."""
        self.span = parameters.input.odometry_span
        self._in_world = parameters.input.twist_frame != "body"
        self._gravity_w = gravity_vector(parameters)
        self.begin()

    def begin(self) -> None:
        """Begin again without earlier messages, after a pause."""
        self._order: Order[States] = Order()
        self._forget()

    def _forget(self) -> None:
        """Drop the messages before a reset of the simulator."""
        self._t_ns, self._rows = np.empty(0, np.int64), np.empty((0, 10))

    def apply(self, t_ns: Times, q_wb: Array, velocity: Array, rate: Array) -> Readings:
        """Add n messages; return the readings that are now known, s messages late.

        :param q_wb: (n, 4).
        :param velocity: (n, 3) velocities in the axes of ``input.twist_frame`` [m/s].
        :param rate: (n, 3) angular rates in the same axes [rad/s].
        """
        if self._in_world:
            rate = rotate_inverse(q_wb, rate)
        else:
            velocity = rotation.rotate(q_wb, velocity)
        states = States.unchecked(
            t_ns=t_ns,
            position=np.full((len(t_ns), 3), np.nan),  # acceleration does not depend on it
            q_wb=q_wb,
            velocity=velocity,
            angular_velocity=rate,
        )
        blocks = [_none()]
        for part, back in self._order.parts(states):
            if back:
                self._forget()
            blocks.append(self._differences(part))
        return concatenate(blocks)

    def _differences(self, states: States) -> Readings:
        """Return the readings that are known after n states whose stamps increase."""
        times = np.concatenate([self._t_ns, states.t_ns])
        quantities = np.concatenate([states.q_wb, states.velocities(), states.body_rates()], axis=1)
        rows = np.concatenate([self._rows, quantities])
        span = self.span
        self._t_ns, self._rows = times[-2 * span :], rows[-2 * span :]
        if len(times) <= 2 * span:
            return _none()
        middle = slice(span, -span)
        change = rows[2 * span :, 4:7] - rows[: -2 * span, 4:7]
        acceleration = change / ((times[2 * span :] - times[: -2 * span])[:, None] * 1e-9)
        q = rows[middle, :4]
        force = rotate_inverse(q, acceleration - self._gravity_w)
        return Readings.unchecked(t_ns=times[middle], gyro=rows[middle, 7:], accel=force, q_wb=q)


def _none() -> Readings:
    """Return readings without rows."""
    vectors = np.empty((0, 3))
    times = np.empty(0, np.int64)
    return Readings.unchecked(t_ns=times, gyro=vectors, accel=vectors, q_wb=np.empty((0, 4)))


_LOOK_NS: Final = 2_000_000_000
"""Length of input that is judged [ns]."""
_MOST_ARRIVED: Final = 1 << 16
"""Largest number of blocks that are noted: a clock that stands still never ends the look."""
_FEWEST_AT_START: Final = 5
"""Readings from which on they are judged: fewer do not tell rest from motion."""
_REST_RATE: Final = 0.02
"""Deviation of each axis below which a body may be at rest [rad/s]; any smooth start is."""
_REST_FORCE: Final = 0.1
"""Deviation of each axis below which a body may be at rest [m/s^2]."""
_TOLERANCE: Final = 0.05
"""Share by which rate and gravity may miss what is declared."""
_MOVING: Final = 0.8
"""Least mean length of the specific force in g over some seconds, whatever a vehicle does."""
_NOISY: Final = 1.0 / 3.0
"""White noise of the input over the sensor's from which on it is reported.

The samples have ``sqrt(1 + share^2)`` times the noise of the sensor, here 5 % too much. In 98 of
100 stretches of ``_FEWEST`` readings, the estimate is 0.7 to 1.3 times the true noise, and closer
in longer ones: half of the sensor's noise is reported, a quarter is not. Rounding, if motion
crosses several steps between readings, is white noise of ``step / sqrt(12)``: it is reported if
steps are longer than 1.15 standard deviations of the sensor's noise.
"""
_FEWEST: Final = 100
"""Smallest number of readings in which noise is looked for."""
_HELD: Final = 0.05
"""Share of repeated readings up to which they are chance; more are values that a source holds."""
_ORDER: Final = 4
"""Order of the differences: a higher one leaves less of the motion, but spreads jumps further."""
_QUARTILE: Final = 0.3186
"""Lower quartile of the size of a Gaussian variable, in standard deviations."""
_JUMP: Final = 5.0
"""Size of a difference that is not noise, in standard deviations."""
_BANDS: Final = 3
"""Number of bands of the spectrum in which noise must be white."""
_UNITS_CHECKED: Final = 32
"""Units of a batch whose first readings are looked at."""
_NUMBER: Final = re.compile(r"-?\d+(\.\d+)?(e[-+]?\d+)?")
"""Numbers in remarks, in which units differ that have the same problem."""
_LOWEST: Final = 0.1
"""Frequency from which on noise is looked for, in 1 / reading: below that there is motion."""


class StartCheck:
    """A comparison of the first 2 s of readings with the declaration of the input."""

    def __init__(self, parameters: ErrorModelParameters) -> None:
        """Initialise without readings."""
        self._parameters = parameters
        self._g = math.hypot(*gravity_vector(parameters).tolist())
        self._rotate_axes = Conventions(parameters).rotate
        self._seen: list[tuple[Any, Any, Any]] = []
        """Stamps, rates and forces: (n,) and (n, 3) of n readings, or numbers of one."""
        self._arrived: list[tuple[Any, Any, Any]] = []
        """The same as they came, before stamps that they share are spread."""
        self._begin_ns: int | None = None
        self._span = ""
        """Time of the readings that are judged, in words."""
        self.done = not parameters.input.check

    def arrive(
        self, t_ns: Times | int, gyro: Array | Vector[float], accel: Array | Vector[float]
    ) -> None:
        """Note readings with their stamps as they came; arguments as for :meth:`look`."""
        if len(self._arrived) < _MOST_ARRIVED:
            self._arrived.append((t_ns, gyro, accel))

    def look(
        self, t_ns: Times | int, gyro: Array | Vector[float], accel: Array | Vector[float]
    ) -> list[str]:
        """Add readings in the order of their stamps; return the remarks after 2 s, none before.

        :param t_ns: (n,) or that of one reading [ns].
        :param gyro: (n, 3), or the components of one [rad/s].
        :param accel: (n, 3), or the components of one [m/s^2].
        """
        self._seen.append((t_ns, gyro, accel))
        begin_ns, end_ns = (t_ns, t_ns) if isinstance(t_ns, int) else t_ns[[0, -1]].tolist()
        if self._begin_ns is None:
            self._begin_ns = begin_ns
        return self.finish() if end_ns - self._begin_ns >= _LOOK_NS else []

    def finish(self) -> list[str]:
        """Return the remarks on the readings so far, after which no more are needed."""
        blocks, self._seen = self._seen, []
        arrived, self._arrived = self._arrived, []
        if self.done or not blocks:
            return []
        self.done = True
        t_ns, gyro, accel = _join(blocks)
        rows = t_ns <= t_ns[0] + _LOOK_NS
        lines: list[str] = []
        if arrived:
            ERROR_MODEL.judge(_arrival_findings(*_join(arrived)), lines.append)
        return [*lines, *self.remarks(t_ns[rows], gyro[rows], accel[rows])]

    def units(self, t_ns: Times, gyro: Array, accel: Array) -> list[Finding]:
        """Return the findings about the units of readings; arguments as for :meth:`remarks`."""
        readings = Readings.unchecked(t_ns=t_ns, gyro=gyro, accel=accel, source="input")
        return unit_findings(readings)

    def remarks(
        self, t_ns: Times, gyro: Array, accel: Array, units: Sequence[Finding] | None = None
    ) -> list[str]:
        """Return a line for each contradiction between readings and declaration.

        :param t_ns: (n,) stamps [ns], increasing.
        :param gyro: (n, 3) angular rates in the axes of the input [rad/s].
        :param accel: (n, 3) specific forces in the axes of the input [m/s^2].
        :param units: known findings about their units; None: the units are checked here.
        """
        if len(t_ns) < _FEWEST_AT_START:
            return []
        self._span = f"{1e-9 * float(t_ns[-1] - t_ns[0]):.2g} s"
        lines: list[str] = []
        ERROR_MODEL.judge(self.units(t_ns, gyro, accel) if units is None else units, lines.append)
        return [
            *self._of_stamps(t_ns),
            *lines,
            *([] if lines else self._of_forces(gyro, accel)),
            *([] if lines else self._of_noise(t_ns, gyro, accel)),
        ]

    def _of_stamps(self, t_ns: Times) -> Iterator[str]:
        """Yield a line if the stamps have another rate than declared."""
        declared = self._parameters.input.rate or self._parameters.rate
        name = "input.rate" if self._parameters.input.rate else "rate"
        if len(t_ns) < 2:
            return
        rate = estimate_clock(t_ns).rate
        if abs(rate - declared) > _TOLERANCE * declared:
            yield f"{name} = {declared:g}: the readings come {rate:.4g} times a second"

    def _of_forces(self, gyro: Array, accel: Array) -> Iterator[str]:
        """Yield lines about units and gravity that readings at rest contradict.

        :param gyro: (n, 3) readings that are declared as rates [rad/s].
        :param accel: (n, 3) readings that are declared as specific forces [m/s^2].
        """
        turning = np.abs(gyro).max() > 10.0 * _REST_RATE or gyro.std(axis=0).max() > _REST_RATE
        rests = not turning and accel.std(axis=0).max() <= _REST_FORCE
        mean = accel.mean(axis=0)
        # A body in motion turns; the length of its readings does not.
        upwards = float(np.linalg.norm(mean))
        size = upwards if rests else float(np.linalg.norm(accel, axis=1).mean())
        when = "at rest" if rests else f"on average over {self._span}"
        declared, g = self._parameters.input, self._g
        included = declared.gravity == "included"
        # Accelerations change their direction, gravity does not.
        steady = rests or upwards > 0.7 * size
        long = f"{when} the readings are {size:.3g} m/s^2 long"
        if not included:
            if steady and size > (0.5 if rests else _MOVING) * g:
                yield f"input.gravity = missing: {long}, so gravity is included"
            return
        if size < 0.5 * g:
            yield (f"input.gravity = included: {long}, instead of {g:.4g}: gravity is missing")
            return
        if rests and abs(size - g) > _TOLERANCE * g:
            yield f"gravity: at rest the readings are {size:.4g} m/s^2 long, instead of {g:.4g}"
        if upwards > 0.5 * g:
            yield from self._of_axes(mean / upwards, rests)
        else:
            yield (
                f"input.axes: not checked, the body turns over in the first {self._span}; "
                "input.check = false if that is as it should be"
            )

    def _of_axes(self, up: Array, rests: bool) -> Iterator[str]:
        """Yield lines where the input's own axes contradict the declared ones.

        In motion this is said only if other axes fit.
        """
        declared = self._parameters.input
        turned = sensor_rotation(declared)
        z = (up if turned is None else turned @ up)[2]
        if declared.place == "imu":
            z = (
                np.reshape(self._parameters.imu.mounting, (3, 3))
                @ (up if turned is None else turned @ up)
            )[2]
        if z > 0.5:
            return
        fits = [
            axes
            for axes, matrix in AXES_TO_FLU.items()
            if axes != declared.axes and (matrix @ up)[2] > 0.9
        ]
        if not rests and not fits:
            return
        would = f"; {fits[0]} would fit" if fits else ""
        when = "at rest" if rests else f"on average over {self._span}"
        shown = ", ".join(f"{value:.2f}" for value in up)
        yield (
            f"input.axes = {declared.axes}: {when} upwards is [{shown}] of the input, which is "
            f"not upwards of the body{would}"
        )

    def _of_noise(self, t_ns: Times, gyro: Array, accel: Array) -> Iterator[str]:
        """Yield lines about white noise of the input that adds to the sensor's.

        :param t_ns: (n,) stamps [ns].
        :param gyro: (n, 3) rates in the axes of the input [rad/s].
        :param accel: (n, 3) specific forces in the axes of the input [m/s^2].
        """
        imu, rate = self._parameters.imu, self._parameters.rate
        rows = _longest_stretch(t_ns, (gyro, accel))
        if len(rows) < _FEWEST:
            return
        steps = np.diff(t_ns[rows])
        # A mean has the density of the readings; a reading that is a sample, that of the samples,
        # unless several of them are the same one.
        readings_rate = estimate_clock(t_ns[rows]).rate
        readings_rate = (
            min(readings_rate, rate) if imu.sampling == "instantaneous" else readings_rate
        )
        for triad, unit, values in zip(TRIADS, ("rad/s", "m/s^2"), (gyro, accel), strict=True):
            parameters = imu.triad(triad)
            density = _white_noise(steps, self._rotate_axes(values[rows])) / math.sqrt(
                readings_rate
            )
            # Without noise of the sensor none is added twice: who adds other errors to a recording
            # wants to keep its noise, and nothing tells how much matters; rounding is noise, too.
            share = np.zeros(3)
            has = np.array(parameters.noise_density) > 0.0
            np.divide(
                density, np.sqrt(parameters.white_variance(rate) / rate), out=share, where=has
            )
            worst = int(share.argmax())
            if share[worst] > _NOISY:
                name = f"imu.{triad}_noise_density"
                yield (
                    f"input: the {triad} has white noise of {density[worst]:.2g} {unit}/sqrt(Hz) "
                    f"already, and {name} adds {parameters.noise_density[worst]:.2g}; switch off "
                    f"the noise of the source, or set {name} = 0 (shaking and coarse rounding look "
                    "the same)"
                )


class BatchStartCheck:
    """The check of the first readings of a batch: that of one sensor for some of its units.

    The declaration is common to all units, whose readings come from one simulator: as many as
    ``_UNITS_CHECKED`` of them, spread over the batch, speak for all.
    """

    def __init__(self, parameters: Sequence[ErrorModelParameters], count: int) -> None:
        """Initialise without samples.

        :param parameters: m sets; unit k has set k modulo m.
        :param count: number of units.
        """
        spread = np.linspace(0, count - 1, min(count, _UNITS_CHECKED)).round().astype(np.int64)
        self._units: Integers = np.unique(spread)
        self._parameters = parameters
        self._step_ns = 1e9 / parameters[0].rate
        self._samples = round(_LOOK_NS / self._step_ns) + 1
        self._seen: list[tuple[int, Array, Array, Mask]] = []
        self.done = not parameters[0].input.check

    def look(self, t_ns: int, gyro: Array, accel: Array, held: Mask) -> list[str]:
        """Add a sample of all units as it came; return the remarks after 2 s.

        :param t_ns: as given [ns].
        :param gyro: (count, 3) angular rates in the axes of the input [rad/s].
        :param accel: (count, 3) specific forces in the axes of the input [m/s^2].
        :param held: (count,) units whose reading is impossible.
        """
        units = self._units
        self._seen.append((t_ns, gyro[units], accel[units], held[units]))
        return self.finish() if len(self._seen) >= self._samples else []

    def finish(self) -> list[str]:
        """Return the remarks on the samples so far, after which no more are needed.

        A line that several units have is there once, with the first of them.
        """
        samples, self._seen = self._seen, []
        if self.done or not samples:
            return []
        self.done = True
        t_ns, gyro, accel, invalid = (np.array(column) for column in zip(*samples, strict=True))
        if not (np.diff(t_ns) > 0).all():  # passed on, without a meaning for the samples
            t_ns = np.rint(np.arange(len(t_ns)) * self._step_ns).astype(np.int64)
        lines: dict[str, list[tuple[int, str]]] = {}
        units: list[Finding] | None = None  # one simulator has the same units for all
        for k, unit in enumerate(self._units.tolist()):
            rows = ~invalid[:, k]
            check = StartCheck(self._parameters[unit % len(self._parameters)])
            valid = t_ns[rows], gyro[rows, k], accel[rows, k]
            units = check.units(*valid) if units is None else units
            for line in check.remarks(*valid, units):
                lines.setdefault(_NUMBER.sub("", line), []).append((unit, line))
        return [self._line(alike) for alike in lines.values()]

    def _line(self, alike: Sequence[tuple[int, str]]) -> str:
        """Return a remark with the first of the units that have it, and the number of the others.

        :param alike: unit and remark of each unit that has it.
        """
        (unit, line), checked = alike[0], len(self._units)
        if len(alike) == checked:
            return line
        share = f", and {len(alike) - 1} more of {checked} checked" if len(alike) > 1 else ""
        return f"environment {unit}{share}: {line}"


def _join(blocks: Sequence[tuple[Any, Any, Any]]) -> tuple[Times, Array, Array]:
    """Return stamps (n,), rates and forces (n, 3) of blocks of readings, or of single ones."""
    times, rates, forces = zip(*blocks, strict=True)
    t_ns = np.concatenate([np.atleast_1d(values) for values in times])
    gyro, accel = (
        np.concatenate([np.atleast_2d(values) for values in parts]) for parts in (rates, forces)
    )
    return t_ns, gyro, accel


def _arrival_findings(t_ns: Times, gyro: Array, accel: Array) -> list[Finding]:
    """Return the findings about readings that share a stamp, or come in bunches.

    :param t_ns: (n,) stamps in the order of arrival [ns].
    """
    with suppress(InputError):  # fewer than two different stamps
        clock = estimate_clock(t_ns, repeated_value_rows(gyro, accel))
        findings = stamp_findings(clock, "input")
        return [f for f in findings if f.kind in ("stamps_shared", "stamps_bunched")]
    return []


def _longest_stretch(t_ns: Times, readings: Sequence[Array]) -> Integers:
    """Return the rows of the longest stretch of readings without a gap.

    If many readings repeat the one before, their source holds each value for several readings, and
    the stretch has the first reading of each value.
    """
    changes = [(np.diff(values, axis=0) != 0.0).any(axis=1) for values in readings]
    onsets = np.concatenate([[True], np.any(changes, axis=0)])
    rows = np.arange(len(t_ns)) if onsets.mean() > 1.0 - _HELD else np.flatnonzero(onsets)
    try:
        clock = estimate_clock(t_ns[rows])
    except InputError:  # fewer than two different stamps
        return rows[:0]
    edges = np.union1d(np.flatnonzero(clock.missing), [piece.start for piece in clock.pieces])
    return rows[max(np.split(clock.rows, edges), key=len)]


def _white_noise(steps: Times, values: Array) -> Array:
    """Return the standard deviation (3,) of white noise in readings (n, 3); 0: it is not known.

    White noise is the floor of the spectrum: the least of the medians of some bands. Vibration,
    lines between coarser steps, and noise behind a low-pass are in some bands or lines, and leave
    the floor low elsewhere. Differences of high order remove motion first; jumps, of which there
    are few, stand out in them. Where many are 0, as those of coarse rounding, nothing is known.

    :param steps: (n - 1,) between their stamps [ns].
    """
    change = np.diff(values, _ORDER, axis=0)
    size = np.abs(change)
    usual = np.quantile(size, 0.25, axis=0) / _QUARTILE
    change[size > _JUMP * usual] = 0.0
    change *= np.hanning(len(change) + 2)[1:-1, None]
    frequency = np.fft.rfftfreq(len(change))
    high = frequency >= _LOWEST
    power = np.square(np.abs(np.fft.rfft(change, axis=0)[high]))
    power /= (2.0 * np.sin(np.pi * frequency[high, None])) ** (2 * _ORDER)
    bands = [np.median(band, axis=0) for band in np.array_split(power, _BANDS)]
    # The window's power is 3/8; a median is ln 2 of the mean of an exponential distribution.
    noise = np.sqrt(np.min(bands, axis=0) / (0.375 * len(change) * math.log(2.0)))
    # Motion at stamps that are not those of its readings looks like noise, too.
    moved = np.median(np.abs(np.diff(values, axis=0)), axis=0) * (steps.std() / steps.mean())
    return np.where(noise > 2.0 * moved, noise, 0.0)
