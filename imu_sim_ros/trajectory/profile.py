# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Euler angles over time, and quantities whose rate changes smoothly from one value to the next."""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from imu_sim_ros.types import Array, Integers


class Derivatives(NamedTuple):
    """A function of time and its first two derivatives; floats if they are constant."""

    value: Array | float
    first: Array | float
    second: Array | float


class Phase(NamedTuple):
    """A time span over which a rate changes from one value to another."""

    length: float
    """[s]; infinite for a last one that never ends."""
    first_rate: float
    last_rate: float

    @property
    def change(self) -> float:
        """By how much the quantity changes over the whole phase."""
        if self.first_rate == self.last_rate == 0.0:
            return 0.0
        return 0.5 * (self.first_rate + self.last_rate) * self.length


class RateProfile:
    """Phases one after another: constant rates, and ramps between them.

    A ramp follows ``10 x^3 - 15 x^4 + 6 x^5`` of the position x in its phase, whose first two
    derivatives vanish at both ends: the quantity is C3 where neighbouring rates agree.
    """

    def __init__(self, phases: Sequence[Phase], start: float = 0.0) -> None:
        """Join the phases.

        :param start: value at time 0.
        """
        lengths = np.array([phase.length for phase in phases])
        changes = np.array([phase.change for phase in phases])
        self._times = np.concatenate([[0.0], np.cumsum(lengths[:-1])])
        self._values = start + np.concatenate([[0.0], np.cumsum(changes[:-1])])
        self._first_rates = np.array([phase.first_rate for phase in phases])
        self._changes = np.array([phase.last_rate - phase.first_rate for phase in phases])
        # A phase of one rate has no ramp to place a time in; it may be endless.
        self._lengths = np.where(self._changes != 0.0, lengths, 1.0)
        self.duration = float(self._times[-1] + lengths[-1])
        self.fastest = max(max(abs(p.first_rate), abs(p.last_rate)) for p in phases)
        self.end = float(self._values[-1] + changes[-1])

    def locate(self, t: Array) -> Integers:
        """Return the phase (n,) of each time (n,) [s]."""
        found = np.searchsorted(self._times, t, side="right") - 1
        return np.clip(found, 0, len(self._times) - 1)

    def sample(self, t: Array) -> Derivatives:
        """Return value, rate and acceleration (n,) at times t (n,) [s]."""
        phase = self.locate(t)
        length, change = self._lengths[phase], self._changes[phase]
        first_rate = self._first_rates[phase]
        elapsed = t - self._times[phase]
        # Outside a ramp x is of no meaning and its factor is 0.
        x = np.clip(elapsed / length, 0.0, 1.0)
        ramp = smooth_step(x)
        return Derivatives(
            self._values[phase] + first_rate * elapsed + change * length * ramp.integral,
            first_rate + change * ramp.value,
            change / length * ramp.slope,
        )


class Step(NamedTuple):
    """The smooth step from 0 to 1, its derivative, and its integral from 0."""

    value: Array
    slope: Array
    integral: Array


def smooth_step(x: Array) -> Step:
    """Return ``10 x^3 - 15 x^4 + 6 x^5`` for x in [0, 1], with derivative and integral."""
    cube = x * x * x
    return Step(
        cube * (10.0 + x * (6.0 * x - 15.0)),
        30.0 * (x * (1.0 - x)) * (x * (1.0 - x)),
        cube * x * (2.5 + x * (x - 3.0)),
    )


def attitude(
    roll: Derivatives, pitch: Derivatives, yaw: Derivatives, n: int
) -> tuple[Array, Array, Array]:
    """Return q_wb (n, 4), omega_b (n, 3) and its time derivative alpha_b (n, 3).

    ``omega_b = E(roll, pitch) d/dt (roll, pitch, yaw)`` is the lecture's eq. 37; alpha_b is that
    equation differentiated once more in closed form.

    :param roll: angle [rad] and its first and second time derivatives, arrays (n,) or floats.
    :param pitch: likewise.
    :param yaw: likewise.
    :param n: number of times.
    """
    # Components first and in place, for the processor's cache.
    half = [0.5 * angle.value for angle in (roll, pitch, yaw)]
    sines, cosines = [np.sin(angle) for angle in half], [np.cos(angle) for angle in half]
    q_wb = _quaternion(sines, cosines, n)
    # Full angles from half angles: four products instead of four more sines.
    (sr, cr), (sp, cp) = (_doubled(s, c) for s, c in zip(sines[:2], cosines[:2], strict=True))
    sr_cp, cr_cp = sr * cp, cr * cp
    omega, alpha, product = np.empty((3, n)), np.empty((3, n)), np.empty(n)
    np.subtract(roll.first, np.multiply(yaw.first, sp, out=product), out=omega[0])
    np.multiply(pitch.first, cr, out=omega[1])
    omega[1] += np.multiply(yaw.first, sr_cp, out=product)
    np.multiply(yaw.first, cr_cp, out=omega[2])
    omega[2] -= np.multiply(pitch.first, sr, out=product)
    turn = yaw.first * pitch.first
    np.subtract(roll.second, np.multiply(yaw.second, sp, out=product), out=alpha[0])
    alpha[0] -= np.multiply(turn, cp, out=product)
    turn = turn * sp
    np.multiply(pitch.second, cr, out=alpha[1])
    alpha[1] += np.multiply(yaw.second, sr_cp, out=product)
    alpha[1] += np.multiply(roll.first, omega[2], out=product)
    alpha[1] -= np.multiply(turn, sr, out=product)
    np.multiply(yaw.second, cr_cp, out=alpha[2])
    alpha[2] -= np.multiply(pitch.second, sr, out=product)
    alpha[2] -= np.multiply(roll.first, omega[1], out=product)
    alpha[2] -= np.multiply(turn, cr, out=product)
    return q_wb.T, omega.T, alpha.T


def _doubled(sine: Array | float, cosine: Array | float) -> tuple[Array | float, Array | float]:
    """Return sine and cosine of twice an angle."""
    twice = 2.0 * sine
    return twice * cosine, 1.0 - twice * sine


def _quaternion(sines: Sequence[Array | float], cosines: Sequence[Array | float], n: int) -> Array:
    """Return q_wb (4, n) from the sines and cosines of half the roll, pitch and yaw."""
    (sr, sp, sy), (cr, cp, cy) = sines, cosines
    cc, ss, sc, cs = cr * cp, sr * sp, sr * cp, cr * sp
    q_wb, product = np.empty((4, n)), np.empty(n)
    np.multiply(cc, cy, out=q_wb[0])
    q_wb[0] += np.multiply(ss, sy, out=product)
    np.multiply(sc, cy, out=q_wb[1])
    q_wb[1] -= np.multiply(cs, sy, out=product)
    np.multiply(cs, cy, out=q_wb[2])
    q_wb[2] += np.multiply(sc, sy, out=product)
    np.multiply(cc, sy, out=q_wb[3])
    q_wb[3] -= np.multiply(ss, cy, out=product)
    return q_wb
