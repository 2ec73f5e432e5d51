# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Quantities whose rate changes smoothly from one value to the next."""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from imu_sim_ros.core.types import Array, Integers


class Derivatives(NamedTuple):
    """A quantity and its first two derivatives, by time or by the parameter of a path."""

    value: Array
    """(n,) values."""
    first: Array
    """(n,) first derivatives."""
    second: Array
    """(n,) second derivatives."""


class Phase(NamedTuple):
    """A time span over which the rate of a quantity changes from one value to another.

    The quantity is an angle [rad] or a time of the trajectory [s]; its rate is per second.
    """

    length: float
    """Length [s]; infinite for a last phase that never ends."""
    first_rate: float
    """Rate at the start of the phase [unit of the quantity / s]."""
    last_rate: float
    """Rate at the end of the phase [unit of the quantity / s]."""

    @property
    def change(self) -> float:
        """Change of the quantity over the whole phase [its unit]."""
        if self.first_rate == self.last_rate == 0.0:
            return 0.0
        return 0.5 * (self.first_rate + self.last_rate) * self.length


class RateProfile:
    """A sequence of phases: constant rates, and ramps between them.

    A ramp follows ``10 x^3 - 15 x^4 + 6 x^5`` of the position x in its phase, whose first two
    derivatives vanish at both ends: the quantity is C3 where neighbouring rates agree.
    """

    def __init__(self, phases: Sequence[Phase]) -> None:
        """Join the phases; the value at time 0 is 0."""
        lengths = np.array([phase.length for phase in phases])
        changes = np.array([phase.change for phase in phases])
        self._times = np.concatenate([[0.0], np.cumsum(lengths[:-1])])
        self._values = np.concatenate([[0.0], np.cumsum(changes[:-1])])
        self._first_rates = np.array([phase.first_rate for phase in phases])
        self._changes = np.array([phase.last_rate - phase.first_rate for phase in phases])
        # A phase of one rate has no ramp to place a time in; it may be endless.
        self._lengths = np.where(self._changes != 0.0, lengths, 1.0)
        self.duration = float(self._times[-1] + lengths[-1])
        self.fastest = max(max(abs(p.first_rate), abs(p.last_rate)) for p in phases)
        self.end = float(self._values[-1] + changes[-1])

    def locate(self, t: Array) -> Integers:
        """Return the phase (n,) of each time (n,) [s]."""
        index = np.searchsorted(self._times, t, side="right") - 1
        return np.clip(index, 0, len(self._times) - 1)

    def sample(self, t: Array) -> Derivatives:
        """Return value, rate and acceleration (n,) [unit, unit/s, unit/s^2] at times t (n,) [s]."""
        phase = self.locate(t)
        length, change = self._lengths[phase], self._changes[phase]
        first_rate = self._first_rates[phase]
        elapsed = t - self._times[phase]
        # In a phase of constant rate x has no meaning, and ``change``, its factor, is 0.
        x = np.clip(elapsed / length, 0.0, 1.0)
        ramp = smooth_step(x)
        return Derivatives(
            self._values[phase] + first_rate * elapsed + change * length * ramp.integral,
            first_rate + change * ramp.value,
            change / length * ramp.slope,
        )


class Step(NamedTuple):
    """The smooth step from 0 to 1, of a dimensionless x, at n places."""

    value: Array
    """(n,) step, 0 to 1."""
    slope: Array
    """(n,) its derivative by x."""
    integral: Array
    """(n,) its integral from 0 to x."""


def smooth_step(x: Array) -> Step:
    """Return ``10 x^3 - 15 x^4 + 6 x^5`` for x in [0, 1], with derivative and integral."""
    cube = x * x * x
    return Step(
        cube * (10.0 + x * (6.0 * x - 15.0)),
        30.0 * (x * (1.0 - x)) * (x * (1.0 - x)),
        cube * x * (2.5 + x * (x - 3.0)),
    )
