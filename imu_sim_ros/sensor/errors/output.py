# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""The end of a triad's chain: low-pass, saturation, quantisation."""

from dataclasses import dataclass
from typing import Final

import numpy as np
from numpy.typing import NDArray

from imu_sim_ros.config import TriadParameters

Array = NDArray[np.float64]


@dataclass
class _Group:
    """Axes with the same cut-off, filtered together."""

    axes: NDArray[np.intp]
    sections: Array
    settled: Array
    """(sections, 2) state of one axis whose input has always been 1."""
    state: Array | None = None
    """(axes, sections, 2)."""

    @property
    def rows(self) -> slice | NDArray[np.intp]:
        """The axes, as a slice where they are neighbours: rows are then filtered in place."""
        first, last = int(self.axes[0]), int(self.axes[-1])
        neighbours = last - first + 1 == len(self.axes)
        return slice(first, last + 1) if neighbours else self.axes


class LowPass:
    """A Butterworth low-pass on each axis that has a cut-off.

    The bilinear transform with the cut-off matched: -3 dB exactly at the cut-off. The filter starts
    settled on the first sample.
    """

    def __init__(self, cutoffs: Array, order: int, rate: float) -> None:
        """Set up the filters.

        :param cutoffs: (3,) [Hz]; 0: none.
        :param rate: [Hz] of what is filtered.
        """
        self._groups: list[_Group] = []
        if cutoffs.any():
            from scipy import signal  # half a second of import that only a low-pass costs

            self._filter = signal.sosfilt
            for cutoff in np.unique(cutoffs[cutoffs > 0.0]):
                sections = signal.butter(order, cutoff, fs=rate, output="sos")
                axes = np.flatnonzero(cutoffs == cutoff)
                self._groups.append(_Group(axes, sections, signal.sosfilt_zi(sections)))

    def apply(self, values: Array) -> None:
        """Filter the next n samples (3, n) in place."""
        if values.shape[1] == 0:
            return
        for group in self._groups:
            rows = group.rows
            x = values[rows]
            if group.state is None:
                group.state = group.settled * x[:, :1, None]
            zi = group.state.transpose(1, 0, 2)
            values[rows], after = self._filter(group.sections, x, zi=zi)
            group.state = after.transpose(1, 0, 2)


_WHOLE: Final = 1.0 + 1e-6
"""A range this close to whole steps counts as whole steps: files round their numbers."""


class Digitiser:
    """Rounding to whole steps, and saturation: at the last whole step within the range."""

    def __init__(self) -> None:
        self._axes: list[tuple[int, float, float]] = []

    def configure(self, parameters: TriadParameters) -> None:
        """Take range and resolution; 0 is none."""
        limits = zip(parameters.range, parameters.resolution, strict=True)
        self._axes = [(k, r, step) for k, (r, step) in enumerate(limits) if r or step]

    def apply(self, values: Array) -> None:
        """Saturate and round values (3, n) in place."""
        for k, limit, step in self._axes:
            row = values[k]
            if step:
                row /= step
                np.rint(row, out=row)
                if limit:
                    _clip(row, float(np.floor(limit / step * _WHOLE)))
                row *= step
            else:
                _clip(row, limit)


def _clip(values: Array, limit: float) -> None:
    """Limit values to +-limit in place."""
    np.minimum(np.maximum(values, -limit, out=values), limit, out=values)


class IncrementRounding:
    """Delta angles or velocities in whole steps, as a counter of pulses gives them.

    The sum of all increments is rounded, and an increment is the difference of two rounded sums:
    the remainder of the rounding is carried over, so that angles do not drift. That is the
    quantisation noise of IEEE Std 952-1997, C.1.5, with ``Q = step / sqrt(12)``.
    """

    def __init__(self, interval: float) -> None:
        """Start with a sum of 0.

        :param interval: nominal time between two samples [s].
        """
        self._interval = interval
        self._step = [0.0] * 3
        self._active = False
        self._sum = [0.0] * 3

    def configure(self, parameters: TriadParameters) -> None:
        """Take the steps; 0 is none."""
        step = np.asarray(parameters.increment_resolution).tolist()
        for k, (old, new) in enumerate(zip(self._step, step, strict=True)):
            if old != new:
                self._sum[k] = 0.0
        self._step, self._active = step, any(step)

    def apply(self, values: Array) -> None:
        """Round the increments of mean readings (3, n) in place."""
        if not self._active:
            return
        for k, (row, step) in enumerate(zip(values, self._step, strict=True)):
            if not (step and len(row)):
                continue
            sums = np.empty(len(row) + 1)
            sums[0] = self._sum[k]
            np.multiply(row, self._interval / step, out=sums[1:])
            np.cumsum(sums, out=sums)  # adds one after the other, whatever the block's size
            self._sum[k] = float(sums[-1])
            row[:] = np.diff(np.rint(sums)) * (step / self._interval)


def noise_gain(cutoff: float, order: int, rate: float) -> float:
    """Return the share of white-noise variance that passes a low-pass, 0 to 1.

    The mean of ``|H|^2 = 1 / (1 + u^(2 n))`` over all frequencies up to half the rate, with
    ``u = tan(pi f / rate) / tan(pi cutoff / rate)``, the bilinear transform's frequency.

    :param cutoff: [Hz]; 0: no low-pass.
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
