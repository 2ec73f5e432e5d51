# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""The chain of a triad: scale, misalignment, low-pass, range, resolution; noise behind it."""

from dataclasses import dataclass
from typing import Final

import numpy as np
from numpy.typing import NDArray

from imu_sim_ros.parameters.kinds import Vector
from imu_sim_ros.random_streams import Units
from imu_sim_ros.rotation import transform
from imu_sim_ros.sensors.errors.terms import TriadEffect
from imu_sim_ros.sensors.imu.parameters import ImuParameters
from imu_sim_ros.sensors.imu.triads import TriadParameters
from imu_sim_ros.types import Array, Mask


class Response:
    """The response of a triad to its input x: ``S x + q x^2 + G f + H f^2`` (lecture eq. 7 and 25).

    G, the g-sensitivity, and H, that to the square of each axis, are the gyroscope's only; f is the
    ideal specific force.
    """

    def __init__(self, parameters: TriadParameters) -> None:
        """Take the coefficients; those of a batch are (count, ...)."""
        # Of a batch, each entry of all units is contiguous: 1.3 times as fast.
        self._s = np.asfortranarray(parameters.response())
        self._quadratic, self._g, self._h = (
            np.asfortranarray(np.reshape(values, (*np.shape(values)[:-1], *shape)))
            if np.any(values)
            else None
            for values, shape in (
                (parameters.quadratic, (3,)),
                (parameters.g_sensitivity, (3, 3)),
                (parameters.g_squared_sensitivity, (3, 3)),
            )
        )
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
        from scipy import signal  # half a second of import that only a low-pass costs

        self._filter = signal.sosfilt
        self._fresh = np.zeros(shape, np.bool_)
        self._groups: list[_Group] = []
        for cutoff in np.unique(cutoffs[cutoffs > 0.0]):
            sections = signal.butter(order, cutoff, fs=rate, output="sos")
            axes = np.flatnonzero(cutoffs == cutoff)
            self._groups.append(_Group(axes, sections, signal.sosfilt_zi(sections)))

    def begin(self, units: Units) -> None:
        """Let the filters of some units of a batch start with their next samples."""
        self._fresh[units] = True

    def apply(self, values: Array) -> Array:
        """Filter the next n samples (n, ..., 3) in place; return what that adds."""
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
        limit, step = np.asfortranarray(parameters.range), np.asfortranarray(parameters.resolution)
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


class IncrementRounding(TriadEffect):
    """Delta angles or velocities in whole steps, as a counter of pulses gives them.

    The sum of all increments is rounded, and an increment is the difference of two rounded sums:
    the remainder of the rounding is carried over, so that angles do not drift. That is the
    quantisation noise of IEEE Std 952-1997, C.1.5, with ``Q = step / sqrt(12)``.
    """

    parameter = "increment_resolution"

    def configure(self, own: TriadParameters) -> None:
        """Take the steps (..., 3); 0 is none. The sum of an axis with another step begins at 0."""
        before = self.strength
        super().configure(own)
        self.state[np.broadcast_to(self.strength != before, self.state.shape)] = 0.0

    def apply(self, values: Array) -> None:
        """Round the increments of mean readings (n, ..., 3) in place."""
        counted = self.strength > 0.0
        step = np.where(counted, self.strength, 1.0)
        sums = np.empty((len(values) + 1, *values.shape[1:]))
        sums[0] = self.state
        np.multiply(values, self.dt / step, out=sums[1:])
        np.cumsum(sums, axis=0, out=sums)  # adds one after the other, whatever the block's size
        self.state = np.where(counted, sums[-1], 0.0)
        rounded = np.diff(np.rint(sums), axis=0) * (step / self.dt)
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


def variance_discrete(imu: ImuParameters, name: str, rate: float) -> Vector:
    """Return the variance of one sample of a triad per axis, in its unit squared.

    :param name: of the triad.
    :param rate: samples per second [Hz].
    """
    triad, internal = imu.triad(name), rate * float(imu.internal_ratio(rate))
    white = [
        d * d * internal * noise_gain(f, imu.bandwidth_order, internal)
        for d, f in zip(triad.noise_density, imu.low_pass(name, rate), strict=True)
    ]
    step, increment = np.asarray(triad.resolution), np.asarray(triad.increment_resolution)
    rounding = step * step / 12.0 + np.square(increment * rate) / 6.0
    x, y, z = (float(w + r) for w, r in zip(white, rounding, strict=True))
    return (x, y, z)
