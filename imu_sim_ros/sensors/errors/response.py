# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""The chain of a triad: scale, misalignment, temperature, low-pass, range, resolution."""

from dataclasses import dataclass
from typing import Final

import numpy as np
from numpy.typing import ArrayLike, NDArray

from imu_sim_ros.random_streams import Seed, Streams, Units
from imu_sim_ros.rotation import transform
from imu_sim_ros.sensors.environment import TemperatureParameters
from imu_sim_ros.sensors.errors.processes import series
from imu_sim_ros.sensors.imu.triads import TriadParameters
from imu_sim_ros.types import Array, Mask


class Response:
    """The response of a triad to its input x: ``S x + q x^2 + G f + H f^2`` (lecture eq. 7 and 25).

    G, the g-sensitivity, and H, that to the square of each axis, are the gyroscope's only; f is the
    ideal specific force.
    """

    def __init__(self, parameters: TriadParameters) -> None:
        """Take the coefficients; those of a batch are (count, ...)."""
        self._s = _laid_out(parameters.response())
        quadratic = np.asfortranarray(parameters.quadratic)
        self._quadratic = quadratic if quadratic.any() else None
        self._g = _matrix(parameters.g_sensitivity)
        self._h = _matrix(parameters.g_squared_sensitivity)
        linear = self._quadratic is None and self._g is None and self._h is None
        self.is_perfect = linear and bool((self._s == np.eye(3)).all())
        """Whether it returns its input."""

    def apply(self, ideal: Array, force: Array) -> Array:
        """Return the response (n, ..., 3), a new array.

        :param ideal: (n, ..., 3) input of the triad.
        :param force: (n, ..., 3) specific force [m/s^2].
        """
        result = transform(self._s, ideal)
        if self._quadratic is not None:
            square = self._quadratic * ideal
            square *= ideal
            result += square
        if self._g is not None:
            result += transform(self._g, force)
        if self._h is not None:
            result += transform(self._h, force * force)
        return result


def _matrix(values: ArrayLike) -> Array | None:
    """Return nine numbers (..., 9) as a matrix (..., 3, 3); None if all are zero."""
    numbers = np.asarray(values)
    if not numbers.any():
        return None
    return _laid_out(numbers.reshape(*numbers.shape[:-1], 3, 3))


def _laid_out(matrices: Array) -> Array:
    """Return matrices (..., 3, 3), each entry of all of them contiguous."""
    if matrices.ndim == 2:
        return matrices
    return np.moveaxis(np.ascontiguousarray(np.moveaxis(matrices, 0, -1)), -1, 0)


def turn_on(seed: Seed, source: str, sigma: ArrayLike) -> Array:
    """Return what differs from run to run (..., 3), drawn from the seed.

    :param source: of a triad, ``gyroscope.turn_on_bias`` or ``gyroscope.turn_on_scale``.
    :param sigma: (..., 3) its standard deviation.
    """
    if not np.any(sigma):
        return np.zeros((*np.shape(seed), 3))
    return Streams(seed, source).next(1)[0] * np.asarray(sigma)


class TemperatureProfile:
    """Piecewise linear ambient temperature, followed by the sensor with a first-order lag.

    On a piece ``T_a = A + B (t - t_j)`` the lag ``tau dT/dt = T_a - T`` has the solution
    ``T = T_a - B tau + (T_j - A + B tau) exp(-(t - t_j) / tau)``: closed form, so times can be
    asked for in any order. The sensor starts at the ambient temperature. Power P from the start on
    warms it further, by ``P sum_i R_i (1 - exp(-t / tau_i))`` of package and board.
    """

    def __init__(self, parameters: TemperatureParameters) -> None:
        times = list(parameters.profile[::2])
        values = list(parameters.profile[1::2])
        if not times or times[0] > 0.0:
            times.insert(0, 0.0)
            values.insert(0, parameters.value)
        self._times = np.array(times)
        self._ambient = np.array(values)
        self._slope = np.zeros(len(times))
        if parameters.interpolation == "linear":
            self._slope[:-1] = np.diff(self._ambient) / np.diff(self._times)
        self._tau = parameters.time_constant
        self._excess = self._start_excess()
        rises = parameters.power * np.array(parameters.thermal_resistance)
        self._warm_up = [
            (float(rise), tau)
            for rise, tau in zip(rises, parameters.warm_up_time, strict=True)
            if rise
        ]

    def _start_excess(self) -> Array:
        """Return the decaying part at the start of each piece: ``T_j - A + B tau``."""
        excess = np.zeros(len(self._times))
        sensor = self._ambient[0]
        for j, (ambient, slope) in enumerate(zip(self._ambient, self._slope, strict=True)):
            excess[j] = sensor - ambient + slope * self._tau
            if j + 1 < len(self._times) and self._tau:
                length = self._times[j + 1] - self._times[j]
                sensor = ambient + slope * (length - self._tau)
                sensor += excess[j] * np.exp(-length / self._tau)
        return excess

    @property
    def constant(self) -> bool:
        """Whether the temperature never changes."""
        return len(self._times) == 1 and not self._warm_up

    def at(self, t: Array) -> Array:
        """Return the sensor's temperature (n,) [degC] at times t (n,) [s] since the start."""
        if self.constant:
            return np.full(t.shape, self._ambient[0])
        temperature = self._following(t)
        for rise, tau in self._warm_up:
            temperature += rise if tau == 0.0 else -rise * np.expm1(-t / tau)
        return temperature

    def _following(self, t: Array) -> Array:
        """Return the temperature of a sensor that only follows the ambient one."""
        piece = np.searchsorted(self._times, t, side="right") - 1
        since = t - self._times[piece]
        temperature: Array = self._ambient[piece] + self._slope[piece] * (since - self._tau)
        if self._tau:
            temperature += self._excess[piece] * np.exp(-since / self._tau)
        return temperature


def is_constant(values: Array) -> bool:
    """Return whether values (n, ...) are one that stands for all times."""
    return len(values) > 1 and values.strides[0] == 0


def polynomial(coefficients: Array, difference: Array) -> Array:
    """Return ``sum_k c_k dT^(k+1)`` per axis, (n, ..., 3).

    :param coefficients: (..., 3 k): x y z of k = 0, then of k = 1, and so on.
    :param difference: (n, ...) temperature above the reference [K].
    """
    result = series(difference.shape)
    for k in range(coefficients.shape[-1] - 3, -1, -3):
        result += coefficients[..., k : k + 3]
        result *= difference[..., None]
    return result


@dataclass
class _Group:
    """Axes with the same cut-off, filtered together."""

    axes: NDArray[np.intp]
    sections: Array
    settled: Array
    """(sections, 2) state of one axis whose input has always been 1."""
    state: Array | None = None
    """(sections, 2, ..., axes)."""

    @property
    def columns(self) -> slice | NDArray[np.intp]:
        """The axes, as a slice if they are neighbours: they are then filtered in place."""
        first, last = int(self.axes[0]), int(self.axes[-1])
        neighbours = last - first + 1 == len(self.axes)
        return slice(first, last + 1) if neighbours else self.axes

    def settled_on(self, values: Array) -> Array:
        """Return the state of filters whose input has always been values (..., axes)."""
        state: Array = self.settled.reshape(*self.settled.shape, *(1,) * values.ndim) * values
        return state


class LowPass:
    """A Butterworth low-pass on each axis that has a cut-off.

    The bilinear transform with the cut-off matched: -3 dB exactly at the cut-off. The filter starts
    settled on the first sample.
    """

    def __init__(self, cutoffs: Array, order: int, rate: float, shape: tuple[int, ...]) -> None:
        """Set up the filters.

        :param cutoffs: (3,) below half the rate [Hz], the same for all units; 0: none.
        :param rate: [Hz] of what is filtered.
        :param shape: () or the (count,) of a batch.
        """
        self._groups: list[_Group] = []
        self._fresh = np.zeros(shape, np.bool_)
        if cutoffs.any():
            from scipy import signal  # half a second of import that only a low-pass costs

            self._filter = signal.sosfilt
            for cutoff in np.unique(cutoffs[cutoffs > 0.0]):
                sections = signal.butter(order, cutoff, fs=rate, output="sos")
                axes = np.flatnonzero(cutoffs == cutoff)
                self._groups.append(_Group(axes, sections, signal.sosfilt_zi(sections)))

    def begin(self, units: Units) -> None:
        """Let the filters of some units of a batch start with their next samples."""
        self._fresh[units] = True

    def apply(self, values: Array) -> Array | None:
        """Filter the next n samples (n, ..., 3) in place; return what that adds; None: nothing."""
        if not self._groups:
            return None
        before = np.copy(values)
        if len(values) == 0:
            return before
        for group in self._groups:
            x = values[..., group.columns]
            if group.state is None:
                group.state = group.settled_on(x[0])
            elif self._fresh.any():
                group.state[:, :, self._fresh] = group.settled_on(x[0, self._fresh])
            values[..., group.columns], group.state = self._filter(
                group.sections, x, axis=0, zi=group.state
            )
        self._fresh[...] = False
        return np.subtract(values, before, out=before)


_WHOLE: Final = 1.0 + 1e-6
"""A range this close to whole steps counts as whole steps: files round their numbers."""


class Digitiser:
    """Rounding to whole steps, and saturation: at the last whole step within the range."""

    def __init__(self, parameters: TriadParameters) -> None:
        """Take range and resolution, (..., 3); 0 is none."""
        limit, step = _shared(parameters.range), _shared(parameters.resolution)
        rounded = step > 0.0
        self._rounded: Mask | bool = rounded
        if rounded.all() or not rounded.any():
            self._rounded = bool(rounded.any())
        self._step = np.where(rounded, step, 1.0)
        self._limited = bool(limit.any())
        steps = np.where(rounded, np.floor(limit / self._step * _WHOLE), limit)
        self._most = np.where(limit > 0.0, steps, np.inf)
        self._least = -self._most

    def apply(self, values: Array) -> None:
        """Saturate and round values (n, ..., 3) in place."""
        rounded = self._rounded
        if rounded is not False:
            values /= self._step
            if rounded is True:
                np.rint(values, out=values)
            else:
                np.rint(values, out=values, where=rounded)
        if self._limited:
            np.maximum(values, self._least, out=values)
            np.minimum(values, self._most, out=values)
        if rounded is not False:
            values *= self._step


def _shared(values: ArrayLike) -> Array:
    """Return values (..., 3) of units as (3,) if they are the same for all."""
    found = np.asarray(values)
    return found[0] if found.ndim > 1 and found.strides[0] == 0 else np.asfortranarray(found)


class IncrementRounding:
    """Delta angles or velocities in whole steps, as a counter of pulses gives them.

    The sum of all increments is rounded, and an increment is the difference of two rounded sums:
    the remainder of the rounding is carried over, so that angles do not drift. That is the
    quantisation noise of IEEE Std 952-1997, C.1.5, with ``Q = step / sqrt(12)``.
    """

    def __init__(self, interval: float, shape: tuple[int, ...]) -> None:
        """Start with a sum of 0.

        :param interval: nominal time between two samples [s].
        :param shape: () or the (count,) of a batch.
        """
        self._interval = interval
        self._step = np.zeros(3)
        self._sum = np.zeros((*shape, 3))
        self._active = False

    def configure(self, parameters: TriadParameters) -> None:
        """Take the steps (..., 3); 0 is none."""
        step = np.asarray(parameters.increment_resolution)
        self._sum[np.broadcast_to(step != self._step, self._sum.shape)] = 0.0
        self._step, self._active = step, bool(step.any())

    def begin(self, units: Units) -> None:
        """Let some units of a batch begin again."""
        self._sum[units] = 0.0

    def apply(self, values: Array) -> None:
        """Round the increments of mean readings (n, ..., 3) in place."""
        if not self._active:
            return
        counted = self._step > 0.0
        step = np.where(counted, self._step, 1.0)
        sums = np.empty((len(values) + 1, *values.shape[1:]))
        sums[0] = self._sum
        np.multiply(values, self._interval / step, out=sums[1:])
        np.cumsum(sums, axis=0, out=sums)  # adds one after the other, whatever the block's size
        self._sum = np.where(counted, sums[-1], 0.0)
        rounded = np.diff(np.rint(sums), axis=0) * (step / self._interval)
        values[...] = np.where(counted, rounded, values)


def noise_gain(cutoff: float, order: int, rate: float) -> float:
    """Return the share of white-noise variance that passes a low-pass, 0 to 1.

    The mean of ``|H|^2 = 1 / (1 + u^(2 n))`` over all frequencies up to half the rate, with
    ``u = tan(pi f / rate) / tan(pi cutoff / rate)``, the bilinear transform's frequency.

    :param cutoff: below half the rate [Hz]; 0: no low-pass.
    """
    if not cutoff:
        return 1.0
    t = np.tan(np.pi * cutoff / rate)
    # In s = ln u the integrand is smooth and dies out at both ends: the trapezoid rule is exact to
    # rounding.
    s, step = np.linspace(-30.0, 30.0, 1201, retstep=True)
    u = np.exp(s)
    density = 2.0 / np.pi * t * u / ((1.0 + (t * u) ** 2) * (1.0 + u ** (2 * order)))
    return float(density.sum() * step)
