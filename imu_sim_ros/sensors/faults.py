# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Faults injected while a simulation runs, each for a given time.

===========  =======================================================================  ============
kind         what happens                                                             value
===========  =======================================================================  ============
bias_jump    the triad's bias is larger; the true bias includes it                   per axis
saturation   the triad saturates at a lower limit (0: not on this axis)               per axis
stuck        the triad repeats its last reading before the fault                      none
dropout      messages are lost with a probability; a probability of 1 is a burst      probability
latency      messages leave the driver later                                          seconds
===========  =======================================================================  ============
"""

import math
from collections.abc import Iterator
from dataclasses import dataclass, field
from typing import Final

import numpy as np
from numpy.random import Generator

from imu_sim_ros.core.conventions import TRIADS
from imu_sim_ros.core.errors import ConfigurationError
from imu_sim_ros.core.names import suggestion
from imu_sim_ros.core.random_streams import generator
from imu_sim_ros.core.types import Array, Integers, Mask
from imu_sim_ros.parameters.kinds import Vector
from imu_sim_ros.sensors.parameters import LARGEST_LATENCY

KINDS: Final = ("bias_jump", "saturation", "stuck", "dropout", "latency")
_OF_A_TRIAD: Final = ("bias_jump", "saturation", "stuck")


@dataclass(frozen=True)
class Fault:
    """A fault: its kind, size, target and duration.

    :raises ConfigurationError: with a line for each problem.
    """

    kind: str
    """One of :data:`KINDS`."""
    duration: float = math.inf
    """[s], above 0; ``math.inf``: until the end."""
    value: float | Vector = 0.0
    """Strength in the unit of what it changes; one number stands for all axes."""
    triad: str = ""
    """Triad that fails, gyroscope or accelerometer; of another sensor, its name."""

    def __post_init__(self) -> None:
        problems = list(self._problems())
        if problems:
            raise ConfigurationError(problems)

    def _problems(self) -> Iterator[str]:
        """Yield problems of the fault's parameters."""
        if self.kind not in KINDS:
            yield f"fault kind = {self.kind!r}: {suggestion(self.kind, KINDS)}"
        if not self.duration > 0.0:
            yield f"fault duration = {self.duration}: must be above 0 s"
        values = np.atleast_1d(self.value)
        if values.shape not in ((1,), (3,)) or not np.isfinite(values).all():
            yield f"fault value = {self.value}: must be a finite number or three"
        elif self.kind != "bias_jump" and (values < 0.0).any():
            yield f"fault value = {self.value}: must be at least 0"
        elif self.kind == "dropout" and (values > 1.0).any():
            yield f"fault value = {self.value}: must be a probability, at most 1"
        elif self.kind == "latency" and (values > LARGEST_LATENCY).any():
            yield f"fault value = {self.value}: must be a latency of at most {LARGEST_LATENCY:g} s"
        if self.kind in _OF_A_TRIAD and not self.triad:
            yield f"fault triad = '': must be {' or '.join(TRIADS)}, or another sensor"

    def axis_values(self) -> Array:
        """Return the value per axis (3,)."""
        return np.broadcast_to(np.asarray(self.value, dtype=np.float64), (3,))


@dataclass
class _Window:
    """A fault between two sample indices, with its state."""

    fault: Fault
    first: int
    """Index of the first sample of the fault."""
    end: float
    """Index of the first sample after it; infinite for a fault that never ends."""
    stream: Generator
    """Random numbers of the fault."""
    held: Array | None = None
    """(3,) reading that a stuck sensor repeats; None before its first sample."""

    def rows(self, first: int, count: int) -> slice:
        """Return the rows of a block of samples that lie in the window."""
        start = min(max(self.first - first, 0), count)
        stop = int(min(max(self.end - first, 0), count))
        return slice(start, max(start, stop))


@dataclass
class FaultSchedule:
    """All injected faults; every question is about the samples ``first .. first + count - 1``."""

    seed: int
    dt: float
    """Interval of the samples [s]."""
    prefix: str = ""
    """Prefix of the random streams' names; another for each sensor."""
    windows: list[_Window] = field(default_factory=list)
    """Faults that have not ended; empty without any fault."""
    _injected: int = 0

    def add(self, fault: Fault, first_sample: int, current: int) -> None:
        """Start a fault at a sample; drop faults that ended before the sample ``current``."""
        end = first_sample + fault.duration / self.dt
        stream = generator(self.seed, f"{self.prefix}fault.{self._injected}")
        self._injected += 1
        # The last sample that still belongs to the fault lies strictly before its end.
        end = end if math.isinf(end) else math.ceil(round(end, 6))
        self.windows = [w for w in self.windows if w.end > current]
        self.windows.append(_Window(fault, first_sample, end, stream))

    def _active(self, kind: str, first: int, count: int) -> Iterator[tuple[_Window, slice]]:
        """Yield faults of a kind with the rows of a block that they cover."""
        for window in self.windows:
            if window.fault.kind == kind:
                rows = window.rows(first, count)
                if rows.start < rows.stop:
                    yield window, rows

    def _of_triad(
        self, kind: str, triad: str, first: int, count: int
    ) -> Iterator[tuple[_Window, slice]]:
        """Yield faults of a triad with the rows of a block that they cover."""
        for window, rows in self._active(kind, first, count):
            if window.fault.triad == triad:
                yield window, rows

    def add_bias(self, triad: str, first: int, bias: Array) -> None:
        """Add bias jumps to a bias (n, 3)."""
        for window, rows in self._of_triad("bias_jump", triad, first, len(bias)):
            bias[rows] += window.fault.axis_values()

    def saturate(self, triad: str, first: int, reading: Array) -> None:
        """Limit a reading (n, 3)."""
        for window, rows in self._of_triad("saturation", triad, first, len(reading)):
            limit = window.fault.axis_values()
            limit = np.where(limit > 0.0, limit, np.inf)
            reading[rows] = np.clip(reading[rows], -limit, limit)

    def hold(self, triad: str, first: int, reading: Array, previous: Array | None) -> None:
        """Repeat the last good reading (n, 3).

        :param previous: the reading of sample ``first - 1`` (3,); None if there is none.
        """
        for window, rows in self._of_triad("stuck", triad, first, len(reading)):
            if window.held is None:
                if rows.start > 0:
                    window.held = reading[rows.start - 1].copy()
                else:
                    window.held = reading[0].copy() if previous is None else previous
            reading[rows] = window.held

    def lose(self, first: int, lost: Mask) -> None:
        """Set True for messages (n,) that a dropout loses, each with the fault's probability.

        :param first: index of the first sample.
        :param lost: True for messages that are lost already, changed in place.
        """
        for window, rows in self._active("dropout", first, len(lost)):
            numbers = window.stream.random(rows.stop - rows.start)
            lost[rows] |= numbers < window.fault.axis_values()[0]

    def delay(self, first: int, latency_ns: Integers) -> None:
        """Add to the latency (n,) [ns]."""
        for window, rows in self._active("latency", first, len(latency_ns)):
            latency_ns[rows] += round(window.fault.axis_values()[0] * 1e9)
