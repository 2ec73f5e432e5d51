# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Quantities of recorded readings that several findings share, each computed once."""

import math
from functools import cached_property
from statistics import NormalDist
from typing import Final, NamedTuple

import numpy as np

from imu_sim_ros.core import rotation
from imu_sim_ros.core.blocks import blocks, vector_lengths
from imu_sim_ros.core.conventions import STANDARD_GRAVITY
from imu_sim_ros.core.errors import InputError
from imu_sim_ros.core.records import Readings
from imu_sim_ros.core.types import Array, Integers, Mask
from imu_sim_ros.recordings.clock import Clock, estimate_clock, repeated_value_rows

_FEWEST: Final = 32
"""Readings below which values are not judged."""
_PARTS: Final = 8
"""Parts of a window, whose means tell motion from noise."""
_MEANS: Final = 4.0
"""Spread of the means of a window's parts at rest, over that of white noise: with eight parts it
exceeds 2.0 once in 10^4 windows; a bias that wanders adds to it."""
_REST_RATE: Final = 2e-3
"""Spread of the means of a fraction of a second that a gyroscope's bias reaches [rad/s]."""
_REST_FORCE: Final = 2e-2
"""Spread of the means of a fraction of a second that an accelerometer's bias reaches [m/s^2]."""
_PIECES: Final = 24
"""Pieces of a record over which gravity is averaged."""
_STEP: Final = 0.01
"""Interval over which readings are averaged before attitude is integrated [s]."""
_ALTERNATION: Final = 0.6
"""Share of fourth differences that change sign, from which on they are noise."""
_LOWEST_G: Final = 0.8
_HIGHEST_G: Final = 1.25
"""Gravity in g, with the errors of a cheap accelerometer and of accelerations that remain."""
COHERENT: Final = 0.7
"""Coherence from which on an average is gravity."""
SHORTEST: Final = 2.0
"""Shortest record in motion that is judged [s]."""
SLOW: Final = 10.0
"""Time in which the accelerations of a body cancel [s]."""
_FASTEST: Final = 35.0
"""Mean angular rate that gyroscopes of 2000 deg/s cannot measure [rad/s]."""
_DEGREES: Final = math.pi / 180.0
_NOISE_RATIO: Final = 1.0
"""White noise of a gyroscope over that of an accelerometer [rad/s / (m/s^2)] that no sensor has:
data sheets have 0.01 to 0.8."""
_NOISIEST: Final = 2e-3
"""White noise that gyroscopes stay below, 0.11 deg/s/sqrt(Hz) [rad/s/sqrt(Hz)]."""
_SI: Final = (0.3, 3.0)
"""Mean specific force over gravity, within which it is in m/s^2."""
_SPREAD: Final = 0.2
"""Smallest standard deviation of the directions of gravity, along any axis, from which on rests
tell its size apart from a bias: over all directions it is 0.58."""
_TURNING: Final = 0.2
"""Mean angular rate above which a steady stretch is a turn, not rest [rad/s]."""
ROUNDING: Final = 1e-12
"""Relative change of a reading that is due to computing, not to the sensor."""
_TURNS: Final = 0.3
"""Change of the sign of successive differences, as a share, from which on an axis has noise: two
thirds in white noise (Kendall and Stuart, turning points), next to none in smooth motion."""


class Gravity(NamedTuple):
    """Specific force averaged in axes that do not turn."""

    size: float
    """Median length of the average: gravity, in the unit of the readings."""
    coherence: float
    """This length over the mean length of the readings: near 1 if it is gravity."""


class RateUnit(NamedTuple):
    """Unit of a gyroscope's readings."""

    name: str
    """Name of the unit: rad/s, deg/s or counts."""
    scale: float
    """Factor that makes rad/s; for counts, that of deg/s."""
    text: str
    """Evidence, if it is not rad/s."""


def is_gravity_in_g(size: float) -> bool:
    """Return True for a mean specific force that is gravity if its unit is g."""
    return _LOWEST_G <= size <= _HIGHEST_G


class RestSphere(NamedTuple):
    """Sphere on which the specific forces at rest in different attitudes lie."""

    radius: float
    """Gravity times the scale of the accelerometer [unit of the readings]."""
    bias: float
    """Distance of the centre from zero: size of the bias [unit of the readings]."""


class ReadingMeasures:
    """Readings of one IMU with the clock behind them and the means of their windows."""

    def __init__(
        self,
        readings: Readings,
        gravity: float = STANDARD_GRAVITY,
    ) -> None:
        """Initialise with readings.

        :param gravity: size of gravity at the place of the recording [m/s^2].
        """
        self.readings = readings
        self.local_gravity = gravity
        """Size of gravity at the place of the recording [m/s^2]."""
        self.no_clock = ""
        """Reason for which the stamps have no rate; empty: they have one."""
        self.clock: Clock | None = None
        """Clock of the readings; None: their stamps have no rate."""
        try:
            unchanged = repeated_value_rows(readings.gyro, readings.accel)
            self.clock = estimate_clock(readings.t_ns, unchanged)
        except InputError as error:  # findings that need no rate are still possible
            self.no_clock = str(error)

    @property
    def interval(self) -> float:
        """Time between two readings [s]; 0 without a clock."""
        return 0.0 if self.clock is None else self.clock.interval_ns * 1e-9

    @cached_property
    def values(self) -> tuple[Array, Array] | None:
        """Both triads (n, 3) of the longest piece; None: too few readings, or a triad is absent."""
        readings, clock = self.readings, self.clock
        if clock is None or readings.gyro is None or readings.accel is None:
            return None
        piece = max(clock.pieces, key=lambda rows: rows.stop - rows.start)
        rows = clock.rows[piece]
        if len(rows) < _FEWEST:
            return None
        triads = (readings.gyro, readings.accel)
        if all(values.flags.c_contiguous for values in triads) and np.all(np.diff(rows) == 1):
            neighbours = slice(int(rows[0]), int(rows[-1]) + 1)  # a view: it needs no memory
            return triads[0][neighbours], triads[1][neighbours]
        return triads[0][rows], triads[1][rows]

    @cached_property
    def rest(self) -> Mask:
        """(windows,) True for each window, of about a second, in which nothing moves."""
        if self.values is None:
            return np.zeros(0, dtype=bool)
        spreads = [self._spread(values) for values in self.values]
        limits = (_REST_RATE, _REST_FORCE)
        quiet = [
            np.all(means <= _MEANS * noise + limit, axis=1)
            for (means, noise), limit in zip(spreads, limits, strict=True)
        ]
        return quiet[0] & quiet[1]

    @property
    def window(self) -> int:
        """Readings of a window: about a second, or all if they are fewer, four in each part."""
        part = round(1.0 / self.interval / _PARTS)
        if self.values is not None:
            part = min(part, len(self.values[0]) // _PARTS)
        return _PARTS * max(part, _FEWEST // _PARTS)

    def _windows(self, values: Array) -> Array:
        """Return readings (windows, parts, k, 3)."""
        count = len(values) // self.window
        return values[: count * self.window].reshape(count, _PARTS, self.window // _PARTS, 3)

    def _spread(self, values: Array) -> tuple[Array, Array]:
        """Return the standard deviation (windows, 3) of the parts' means, and that by noise."""
        windows = self._windows(values)
        spread, deviation = np.empty((2, len(windows), 3))
        size = self.window
        for rows in blocks(size * len(windows), size):
            part = slice(rows.start // size, rows.stop // size)
            parts = windows[part]
            deviation[part] = np.sqrt(np.mean(parts.var(axis=2, ddof=1), axis=1))
            spread[part] = parts.mean(axis=2).std(axis=1, ddof=1)
        return spread, deviation / math.sqrt(windows.shape[2])

    @property
    def moves(self) -> bool:
        """True if the longest piece has windows that are not at rest."""
        return bool(len(self.rest)) and not self.rest.all()

    @property
    def rest_time(self) -> float:
        """Time at rest [s], of the longest piece without a pause."""
        return float(self.rest.mean()) * self.duration if len(self.rest) else 0.0

    @cached_property
    def rest_means(self) -> tuple[Array, Array] | None:
        """Means (windows, 3) of both triads over the windows at rest; None: there are none."""
        if self.values is None or not self.rest.any():
            return None
        gyro, accel = (self._windows(values).mean(axis=(1, 2))[self.rest] for values in self.values)
        return gyro, accel

    @cached_property
    def rest_force(self) -> float | None:
        """Median length of the specific force at rest, in the unit of the readings.

        None: nothing is at rest, or all that is steady is a turn.
        """
        if self.rest_means is None:
            return None
        turning = float(np.median(np.linalg.norm(self.rest_means[0], axis=1)))
        if turning * self.rate_unit.scale > _TURNING:
            return None
        return float(np.median(np.linalg.norm(self.rest_means[1], axis=1)))

    @cached_property
    def rest_sphere(self) -> RestSphere | None:
        """Sphere on which the specific forces at rest lie; None: too few directions are at rest."""
        if self.rest_means is None:
            return None
        gyro, force = self.rest_means
        turn = np.linalg.norm(gyro - np.median(gyro, axis=0), axis=1)  # without the bias
        force = force[turn * self.rate_unit.scale < _TURNING]
        size = float(np.linalg.norm(force, axis=1).mean()) if len(force) > 3 else 0.0
        if not size:
            return None
        directions = force / size
        spread = np.linalg.svd(directions - directions.mean(axis=0), compute_uv=False)
        if spread[-1] < _SPREAD * math.sqrt(len(force)):
            return None
        # |f|^2 = 2 f.b + (r^2 - |b|^2), linear in b and the rest.
        columns = np.column_stack([2.0 * directions, np.ones(len(force))])
        *centre, rest = np.linalg.lstsq(columns, np.sum(directions**2, axis=1), rcond=None)[0]
        offset = float(np.linalg.norm(centre))
        return RestSphere(size * math.sqrt(max(rest + offset**2, 0.0)), size * offset)

    @cached_property
    def swapped(self) -> Gravity | None:
        """Gravity in the gyroscope's readings, if triads are swapped; else None."""
        if self.values is None or self.duration < SHORTEST:
            return None
        size = self.mean_force
        if size > 0.5 * STANDARD_GRAVITY or is_gravity_in_g(size):
            return None
        gravity = self.gravity(SLOW, exchange=True)
        is_gravity = abs(gravity.size / STANDARD_GRAVITY - 1.0) < 0.25
        return gravity if gravity.coherence > COHERENT and is_gravity else None

    @cached_property
    def rate_unit(self) -> RateUnit:
        """Unit of the gyroscope, as far as noise, size and gravity tell it."""
        radians = RateUnit("rad/s", 1.0, "")
        if self.values is None or self.swapped is not None:
            return radians
        gyro = self.values[0]
        mean = float(vector_lengths(gyro).mean())
        if mean * _DEGREES > _FASTEST:
            text = f"the angular rate is {mean:.4g} on average: no rad/s and no deg/s"
            return RateUnit("counts", _DEGREES, text)
        if _are_whole(gyro) and any(self.noisy(column) for column in gyro.T):
            text = f"all angular rates are whole numbers, up to {np.abs(gyro).max():.4g}"
            return RateUnit("counts", _DEGREES, text)
        if mean > _FASTEST:
            text = f"the angular rate is {mean:.4g} on average: as rad/s, no sensor measures it"
            return RateUnit("deg/s", _DEGREES, text)
        text = self._degrees_by_noise() or self._degrees_by_gravity()
        return RateUnit("deg/s", _DEGREES, text) if text else radians

    def _degrees_by_noise(self) -> str:
        """Return the evidence of deg/s that the noise of both triads gives; empty: none."""
        if self.noise_density is None or not self.mean_force:
            return ""
        gyro, accel = (_typical(density) for density in self.noise_density)
        size = self.mean_force / STANDARD_GRAVITY
        if not _SI[0] < size < _SI[1]:
            accel /= size  # whatever the accelerometer's unit is
        if not accel or gyro < max(_NOISE_RATIO * accel, _NOISIEST):
            return ""
        return (
            f"the gyroscope's white noise is {gyro:.3g} rad/s/sqrt(Hz), {gyro / accel:.3g} times "
            f"that of the accelerometer ({accel:.2g} m/s^2/sqrt(Hz)): no sensor has this ratio, in "
            "deg/s it is usual"
        )

    def _degrees_by_gravity(self) -> str:
        """Return the evidence of deg/s that the direction of gravity gives; empty: none."""
        if not self.moves or self.duration < SHORTEST or not self.mean_force:
            return ""
        radians, degrees = (self.gravity(2.0, scale) for scale in (1.0, _DEGREES))
        if degrees.coherence < 0.9 or radians.coherence > 0.6:
            return ""
        return (
            "gravity keeps its direction if the angular rates are deg/s (coherence "
            f"{degrees.coherence:.2f}), not if they are rad/s ({radians.coherence:.2f})"
        )

    def gravity(
        self, duration: float, rate_scale: float | None = None, exchange: bool = False
    ) -> Gravity:
        """Return the specific force averaged in axes that do not turn.

        Over a time T it is gravity, but for the change of velocity divided by T.

        :param duration: length T of the pieces, shorter if the record is [s].
        :param rate_scale: factor that makes rad/s of the angular rates; None: by their unit.
        :param exchange: take the gyroscope as the accelerometer, and the other way.
        """
        assert self.values is not None
        gyro, accel = reversed(self.values) if exchange else self.values
        if rate_scale is None:
            rate_scale = 1.0 if exchange else self.rate_unit.scale
        size = max(round(_STEP / self.interval), 1)
        count = len(gyro) // size
        dt = size * self.interval
        length = min(max(round(duration / dt), 2), count)
        starts = np.unique(np.linspace(0, count - length, _PIECES).round().astype(np.int64))
        if self.moves and self.rest.any():
            starts = self._starts_in_motion(size, count - length)
        rates, forces = (
            np.array(
                [
                    values[size * start : size * (start + length)]
                    .reshape(length, size, 3)
                    .mean(axis=1)
                    for start in starts.tolist()
                ]
            )
            for values in (gyro, accel)
        )
        # Neighbours are joined, as long as there are two: steps that turn nothing fill the pieces.
        steps = 1 << (length - 1).bit_length()
        turns = np.tile(rotation.IDENTITY, (len(starts), steps, 1))
        turns[:, :length] = rotation.exp(np.clip(rates * rate_scale * dt, -1e3, 1e3))
        sums = np.zeros((len(starts), steps, 3))
        sums[:, :length] = forces
        while sums.shape[1] > 1:
            earlier, later = turns[:, ::2], turns[:, 1::2]
            sums = sums[:, ::2] + rotation.rotate(earlier, sums[:, 1::2])
            turns = rotation.multiply(earlier, later)
        lengths = np.linalg.norm(sums[:, 0] / length, axis=1)
        usual = np.linalg.norm(forces, axis=-1).mean(axis=1)
        ratio = np.divide(lengths, usual, out=np.zeros_like(lengths), where=usual > 0.0)
        return Gravity(float(np.median(lengths)), float(np.median(ratio)))

    def _starts_in_motion(self, size: int, latest: int) -> Integers:
        """Return the first steps of pieces that begin where a window is in motion.

        :param size: readings of a step.
        :param latest: last step at which a piece fits into the record.
        """
        moving = np.flatnonzero(~self.rest) * self.window // size
        chosen = np.linspace(0, len(moving) - 1, min(_PIECES, len(moving))).round()
        return np.unique(np.minimum(moving[chosen.astype(np.int64)], latest))

    @cached_property
    def slow_gravity(self) -> Gravity:
        """Gravity over ten seconds, in which accelerations of a body cancel."""
        return self.gravity(SLOW)

    @cached_property
    def duration(self) -> float:
        """Length of the longest piece [s]."""
        return 0.0 if self.values is None else len(self.values[0]) * self.interval

    @cached_property
    def mean_force(self) -> float:
        """Mean length of the specific force, in the unit of the readings."""
        assert self.values is not None
        return float(vector_lengths(self.values[1]).mean())

    @cached_property
    def noise_density(self) -> tuple[Array, Array] | None:
        """White noise (3,) of both triads [unit/sqrt(Hz)]; None: too few readings.

        Differences of fourth order leave noise, and hardly any motion: their variance is 70 times
        that of white noise. The median over windows leaves out shocks.
        """
        if self.values is None or self.duration < 1.0:
            return None
        gyro, accel = (self._white(values) for values in self.values)
        return gyro, accel

    def _white(self, values: Array) -> Array:
        """Return the noise densities (3,) of one triad (n, 3), by its fourth differences."""
        squares, alternations = [], np.zeros(3)
        number = len(values) - 4
        for rows in blocks(number, self.window):
            change = np.diff(values[rows.start : rows.stop + 5], 4, axis=0)
            # Successive differences of noise have a correlation of -0.8: 80 % change sign.
            alternations += np.count_nonzero(change[1:] * change[:-1] < 0.0, axis=0)
            parts = self._windows(change[: rows.stop - rows.start])
            squares.append(np.square(parts).mean(axis=(1, 2)))
        noise = alternations / (number - 1) > _ALTERNATION
        windows = np.concatenate(squares)
        if not len(windows):
            return np.zeros(3)
        # The lower quartile of the windows: those with the least motion. In white noise it is z
        # deviations below the mean (Blom 1958); a window's variance deviates by sqrt(2 s / n) of
        # itself, s = 2.627 the sum of the squared correlations of fourth differences.
        count, size = len(windows), self.window
        z = NormalDist().inv_cdf((0.25 * (count - 1) + 0.625) / (count + 0.25))
        variance = np.quantile(windows, 0.25, axis=0) / 70.0
        variance /= 1.0 + z * math.sqrt(2.0 * 2.627 / size)
        return np.where(noise, np.sqrt(variance * self.interval), 0.0)

    def noisy(self, column: Array) -> bool:
        """Return True if the readings (n,) of an axis have noise, not only motion or steps."""
        column = column[:65536]
        change = np.diff(column)
        change = change[np.abs(change) > ROUNDING * np.abs(column).max()]
        return len(change) > _FEWEST and float(np.mean(change[1:] * change[:-1] < 0.0)) > _TURNS


def _are_whole(values: Array) -> bool:
    """Return True if all values (n, k) are whole numbers."""
    return all(bool(np.all(values[rows] == np.rint(values[rows]))) for rows in blocks(len(values)))


def _typical(density: Array) -> float:
    """Return the median density of the axes (3,) whose noise exceeds the motion; 0: none."""
    clear = density[density > 0.0]
    return float(np.median(clear)) if len(clear) else 0.0
