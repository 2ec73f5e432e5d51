# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Dead reckoning one reading at a time, for a node: blocks of one interval."""

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from imu_sim_ros import rotation
from imu_sim_ros.conventions import GRAVITY
from imu_sim_ros.errors import ConfigurationError, InputError
from imu_sim_ros.inputs import gate
from imu_sim_ros.names import suggestion
from imu_sim_ros.navigation import angles, increments
from imu_sim_ros.navigation.increments import Increments
from imu_sim_ros.navigation.parameters import ATTITUDE_UPDATES, METHODS
from imu_sim_ros.navigation.state import NO_CORRECTION, Correction, NavigationState
from imu_sim_ros.parameters.kinds import ZERO_VECTOR
from imu_sim_ros.recordings.order import longest_step_ns
from imu_sim_ros.types import Array, Integers


def check_readings(t_ns: Integers, gyro: Array, accel: Array, max_gap: float = math.inf) -> None:
    """Make sure that readings can be integrated.

    :param t_ns: (n,) stamps [ns].
    :param gyro: (n, 3) [rad/s].
    :param accel: (n, 3) [m/s^2].
    :param max_gap: longest interval that is bridged [s].
    :raises InputError: with a line for each thing that is wrong.
    """
    n = len(t_ns)
    if gyro.shape != (n, 3) or accel.shape != (n, 3):
        raise InputError(
            f"{n} stamps need readings of shape ({n}, 3): gyro has {gyro.shape}, "
            f"accel {accel.shape}"
        )
    if n < 2:
        raise InputError(f"{n} reading{'' if n == 1 else 's'}: integration needs at least two")
    steps = np.diff(t_ns)
    problems = [*_order_problems(t_ns, steps), *_gap_problems(t_ns, steps, max_gap)]
    problems += gate.readings(t_ns, gyro, accel).problems("readings")
    if problems:
        raise InputError(problems)


def _order_problems(t_ns: Integers, steps: Integers) -> list[str]:
    problems: list[str] = []
    if steps.min() > 0:
        return problems
    for what, bad in (("repeated", steps == 0), ("earlier than the one before them", steps < 0)):
        if bad.any():
            first = int(np.argmax(bad)) + 1
            problems.append(
                f"{np.count_nonzero(bad)} stamps are {what}, "
                f"the first is number {first} ({t_ns[first]} ns)"
            )
    return problems


def _gap_problems(t_ns: Integers, steps_ns: Integers, max_gap: float) -> list[str]:
    gaps = steps_ns > longest_step_ns(max_gap)
    if not gaps.any():
        return []
    steps = steps_ns * 1e-9
    first = int(np.argmax(gaps))
    return [
        f"{np.count_nonzero(gaps)} gaps are longer than max_gap = {max_gap:g} s, the first is "
        f"{steps[first]:.6g} s after number {first} ({t_ns[first]} ns)"
    ]


@dataclass
class StepperCounts:
    """Counts of gaps and other events in a stepper."""

    repeated: int = 0
    """readings with the stamp of the reading before"""
    backward: int = 0
    """readings with a stamp before that of the reading before"""
    gaps: int = 0
    """intervals longer than max_gap"""
    gimbal_lock: int = 0
    """steps near the gimbal lock, taken with the so3 update in place of Euler angles"""


def check_method(method: str, attitude: str) -> None:
    """Make sure that method and attitude update exist.

    :raises ConfigurationError: with what is allowed.
    """
    problems = [
        f"{name} = {value!r}: {suggestion(value, choices)}"
        for name, value, choices in (
            ("method", method, METHODS),
            ("attitude_update", attitude, ATTITUDE_UPDATES),
        )
        if value not in choices
    ]
    if problems:
        raise ConfigurationError(problems)
    if attitude == "euler_angles" and method not in angles.METHODS:
        known = ", ".join(angles.METHODS)
        raise ConfigurationError(f"method = {method!r}: euler_angles goes with {known}")


class Stepper:
    """Integrates readings as they come.

    The first reading starts the clock; each later one with ``0 < dt <= max_gap`` is a step. Any
    other one is counted, and integration continues from it with the state unchanged.
    """

    def __init__(
        self,
        initial: NavigationState,
        method: str = "midpoint",
        attitude: str = "so3",
        gravity: Sequence[float] = GRAVITY,
        correction: Correction = NO_CORRECTION,
        max_gap: float = 0.1,
        earth_rate: Sequence[float] = ZERO_VECTOR,
    ) -> None:
        """Start at a state.

        :param initial: the state at the first reading.
        :param method: euler, midpoint or rk4.
        :param attitude: quaternion, so3 or euler_angles.
        :param gravity: (3,) in the world frame [m/s^2].
        :param correction: the known errors of the readings.
        :param max_gap: length above which an interval is a gap and not integrated over [s].
        :param earth_rate: (3,) rate of the world, in the world frame [rad/s].
        :raises ConfigurationError: for an unknown method or attitude update.
        """
        check_method(method, attitude)
        self.counts = StepperCounts()
        self.correction = correction
        """The known errors of the readings; a new one applies from the next reading on."""
        self._longest_step_ns = longest_step_ns(max_gap)
        self._world = increments.world_vectors(gravity, earth_rate)
        self._method, self._attitude = method, attitude
        self.reset(initial)

    def reset(self, initial: NavigationState) -> None:
        """Start again at a state; the next reading starts the clock. The counts go on."""
        self.state = initial._replace(q_wb=rotation.normalise(initial.q_wb))
        """The state at the last reading."""
        self.t_ns: int | None = None
        """Stamp of the last reading [ns], None before the first."""
        self._rates, self._forces = np.zeros((2, 3)), np.zeros((2, 3))
        """Corrected readings at the ends of the last interval."""

    @property
    def angular_velocity(self) -> Array:
        """The corrected rate of the last reading, in the body (3,) [rad/s]."""
        rate: Array = self._rates[1]
        return rate

    @property
    def specific_force(self) -> Array:
        """The corrected specific force of the last reading, in the body (3,) [m/s^2]."""
        force: Array = self._forces[1]
        return force

    def add(self, t_ns: int, gyro: ArrayLike, accel: ArrayLike) -> bool:
        """Take a reading that the gate of ``inputs`` passes; return whether it was a step.

        :param t_ns: its stamp [ns].
        :param gyro: (3,) angular rate as read [rad/s].
        :param accel: (3,) specific force as read [m/s^2].
        """
        rates, forces = self.correction.apply(np.array([gyro]), np.array([accel]))
        self._rates = np.concatenate([self._rates[1:], rates])
        self._forces = np.concatenate([self._forces[1:], forces])
        step_ns = t_ns - self.t_ns if self.t_ns is not None else None
        stepped = step_ns is not None and 0 < step_ns <= self._longest_step_ns
        if step_ns is not None:
            if stepped:
                self._advance(np.array([step_ns * 1e-9]))
            else:
                self._count(step_ns)
        self.t_ns = t_ns
        return stepped

    def _count(self, step_ns: int) -> None:
        if step_ns == 0:
            self.counts.repeated += 1
        elif step_ns < 0:
            self.counts.backward += 1
        else:
            self.counts.gaps += 1

    def _advance(self, h: Array) -> None:
        """Take a step of the length h (1,) [s]."""
        readings = (h, self._rates, self._forces)
        ends = increments.states(*self.state, h, self._increment(*readings), self._world)
        position, velocity, q_wb = ends
        self.state = NavigationState._make((position[1], velocity[1], q_wb[1]))

    def _increment(self, h: Array, rates: Array, forces: Array) -> Increments:
        if self._attitude != "euler_angles":
            return increments.between(self._method, self._attitude, h, rates, forces)
        euler = rotation.to_euler(self.state.q_wb)[None]
        if angles.near_lock(euler[:, 1], h, rates[:1]).any():
            self.counts.gimbal_lock += 1
            return increments.between(self._method, "so3", h, rates, forces)
        return angles.increments_of(self._method, euler, h, rates, forces)
