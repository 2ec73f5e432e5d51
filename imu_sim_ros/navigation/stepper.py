# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Dead reckoning one reading at a time, for a node: the formulas of records, over floats."""

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from imu_sim_ros.core import gate
from imu_sim_ros.core.components import float_quaternion, float_vector, normalise, to_euler
from imu_sim_ros.core.conventions import GRAVITY
from imu_sim_ros.core.errors import ConfigurationError, InputError
from imu_sim_ros.core.names import suggestion
from imu_sim_ros.core.spelling import argument_prefix
from imu_sim_ros.core.types import Array, Integers
from imu_sim_ros.navigation import angles, increments
from imu_sim_ros.navigation.increments import Ends, Increment
from imu_sim_ros.navigation.parameters import ATTITUDE_UPDATES, METHODS
from imu_sim_ros.navigation.state import NO_CORRECTION, Correction, NavigationState
from imu_sim_ros.parameters.kinds import ZERO_VECTOR, Vector
from imu_sim_ros.recordings.order import longest_step_ns


def check_readings(t_ns: Integers, gyro: Array, accel: Array, max_gap: float = math.inf) -> None:
    """Make sure that readings can be integrated.

    :param t_ns: (n,) stamps [ns].
    :param gyro: (n, 3) angular rates [rad/s].
    :param accel: (n, 3) specific forces [m/s^2].
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
    """Return a line about stamps that repeat or go back."""
    problems: list[str] = []
    if steps.min() > 0:
        return problems
    for what, bad in (("repeated", steps == 0), ("earlier than the one before them", steps < 0)):
        if bad.any():
            row = int(np.argmax(bad)) + 1
            problems.append(
                f"{np.count_nonzero(bad)} stamps are {what}, "
                f"the first is number {row} ({t_ns[row]} ns)"
            )
    return problems


def _gap_problems(t_ns: Integers, steps_ns: Integers, max_gap: float) -> list[str]:
    """Return a line about intervals that are longer than those that are integrated."""
    gaps = steps_ns > longest_step_ns(max_gap)
    if not gaps.any():
        return []
    steps = steps_ns * 1e-9
    row = int(np.argmax(gaps))
    return [
        f"{np.count_nonzero(gaps)} gaps are longer than max_gap = {max_gap:g} s, the first is "
        f"{steps[row]:.6g} s after number {row} ({t_ns[row]} ns)"
    ]


@dataclass
class StepperCounts:
    """Counts of gaps and other events in a stepper."""

    repeated: int = 0
    """Readings with the stamp of the reading before."""
    backward: int = 0
    """Readings with a stamp before that of the reading before."""
    gaps: int = 0
    """Intervals longer than max_gap."""
    gimbal_lock: int = 0
    """Steps near the gimbal lock, taken with the so3 update in place of Euler angles."""


def check_method(method: str, attitude: str) -> None:
    """Make sure that method and attitude update exist.

    :raises ConfigurationError: with what is allowed.
    """
    problems = [
        f"{argument_prefix(name, repr(value))}: {suggestion(value, choices)}"
        for name, value, choices in (
            ("method", method, METHODS),
            ("attitude_update", attitude, ATTITUDE_UPDATES),
        )
        if value not in choices
    ]
    if problems:
        raise ConfigurationError(problems)
    if attitude == "euler_angles" and method not in angles.METHODS:
        methods = ", ".join(angles.METHODS)
        raise ConfigurationError(
            f"{argument_prefix('method', repr(method))}: euler_angles goes with {methods}"
        )


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
        :param gravity: (3,) gravity in the world frame [m/s^2].
        :param correction: the known errors of the readings.
        :param max_gap: length above which an interval is a gap and not integrated over [s].
        :param earth_rate: (3,) rate of the world, in the world frame [rad/s].
        :raises ConfigurationError: for an unknown method or attitude update.
        """
        check_method(method, attitude)
        self.counts = StepperCounts()
        self.correction = correction
        """The known errors of the readings; a new one applies from the next reading on."""
        self.longest_step_ns = longest_step_ns(max_gap)
        """Longest step that is no gap [ns]."""
        self._world = increments.world_vectors(gravity, earth_rate)
        self._method, self._attitude = method, attitude
        self._between = increments.METHODS[method]
        self.reset(initial)

    def reset(self, initial: NavigationState) -> None:
        """Restart at a state; the next reading starts the clock. The counts continue."""
        self.position = float_vector(initial.position)
        """(3,) p_wb at the latest reading [m]."""
        self.velocity = float_vector(initial.velocity)
        """Velocity of the body in the world frame at the last reading [m/s]."""
        self.q_wb = normalise(float_quaternion(initial.q_wb))
        """Attitude at the last reading, a unit quaternion."""
        self.t_ns: int | None = None
        """Stamp of the last reading [ns], None before the first."""
        self.angular_velocity = self.specific_force = ZERO_VECTOR
        """The corrected last reading, in the body [rad/s], [m/s^2]."""

    @property
    def state(self) -> NavigationState:
        """The state at the last reading."""
        arrays = (np.array(part) for part in (self.position, self.velocity, self.q_wb))
        return NavigationState._make(arrays)

    def add(self, t_ns: int, gyro: Vector, accel: Vector) -> bool:
        """Add a reading that the gate of ``inputs`` passes; return whether it was a step.

        :param t_ns: stamp of the reading [ns].
        :param gyro: angular rate as read [rad/s].
        :param accel: specific force as read [m/s^2].
        """
        # Copies: readings are the start of the next step, and a caller may reuse its arrays.
        rate, force = (*gyro,), (*accel,)
        if self.correction is not NO_CORRECTION:
            rate, force = self.correction.correct(gyro, accel)
        stepped = False
        if self.t_ns is not None:
            step_ns = t_ns - self.t_ns
            stepped = 0 < step_ns <= self.longest_step_ns
            if stepped:
                h = step_ns * 1e-9
                rates, forces = (self.angular_velocity, rate), (self.specific_force, force)
                if self._attitude == "euler_angles":
                    increment = self._angle_increment(h, rates, forces)
                else:
                    increment = self._between(self._attitude, h, rates, forces)
                start = (self.position, self.velocity, self.q_wb)
                end = increments.states(start, h, increment, self._world)
                self.position, self.velocity, self.q_wb = end
            else:
                self._count(step_ns)
        self.t_ns, self.angular_velocity, self.specific_force = t_ns, rate, force
        return stepped

    def _count(self, step_ns: int) -> None:
        """Count a reading that cannot be integrated, by its reason."""
        if step_ns == 0:
            self.counts.repeated += 1
        elif step_ns < 0:
            self.counts.backward += 1
        else:
            self.counts.gaps += 1

    def _angle_increment(self, h: float, rate: Ends[float], force: Ends[float]) -> Increment[float]:
        """Return the increment of a step of h [s] in Euler angles."""
        roll_pitch_yaw = to_euler(self.q_wb)
        if angles.is_near_gimbal_lock(roll_pitch_yaw[1], h, rate[0]):
            self.counts.gimbal_lock += 1
            return self._between("so3", h, rate, force)
        return angles.increment_of(self._method, roll_pitch_yaw, h, rate, force)
