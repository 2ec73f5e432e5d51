# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Dead reckoning one reading at a time, for a node: plain floats, no array per step."""

import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass

import numpy as np

from imu_sim_ros.conventions import GRAVITY
from imu_sim_ros.errors import ConfigurationError, InputError
from imu_sim_ros.inputs import gate
from imu_sim_ros.names import suggestion
from imu_sim_ros.navigation.parameters import ATTITUDE_UPDATES, METHODS
from imu_sim_ros.navigation.scalar_increments import INCREMENTS
from imu_sim_ros.navigation.state import NO_CORRECTION, Correction, NavigationState
from imu_sim_ros.parameters.kinds import IDENTITY_MATRIX, ZERO_MATRIX
from imu_sim_ros.rotation.scalars import (
    M9,
    Q4,
    V3,
    ZERO,
    conjugate,
    exp,
    multiply,
    normalise,
    rotate,
    scaled,
    transform,
)
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
    if steps_ns.max() * 1e-9 <= max_gap:
        return []
    steps = steps_ns * 1e-9
    gaps = steps > max_gap
    first = int(np.argmax(gaps))
    return [
        f"{np.count_nonzero(gaps)} gaps are longer than max_gap = {max_gap:g} s, the first is "
        f"{steps[first]:.6g} s after number {first} ({t_ns[first]} ns)"
    ]


GIMBAL_LOCK_MARGIN = math.radians(1.0)
"""[rad] nearer than this, or than two steps, to a pitch of +-90 degrees Euler angles are not
integrated."""


@dataclass
class StepperCounts:
    """Counts of gaps and other events in a stepper."""

    repeated: int = 0
    """readings with the stamp of the reading before"""
    backward: int = 0
    """readings with a stamp before that of the reading before"""
    gaps: int = 0
    """intervals of max_gap or more"""
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


class Stepper:
    """Integrates readings as they come.

    The first reading starts the clock; each later one with ``0 < dt < max_gap`` is a step. Any
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
        earth_rate: Sequence[float] = ZERO,
    ) -> None:
        """Start at a state.

        :param initial: the state at the first reading.
        :param method: euler, midpoint or rk4.
        :param attitude: quaternion, so3 or euler_angles.
        :param gravity: (3,) in the world frame [m/s^2].
        :param correction: the known errors of the readings.
        :param max_gap: length at which an interval is a gap and not integrated over [s].
        :param earth_rate: (3,) rate of the world, in the world frame [rad/s].
        :raises ConfigurationError: for an unknown method or attitude update.
        """
        check_method(method, attitude)
        self.counts = StepperCounts()
        self._max_gap_ns = max_gap * 1e9
        self._gravity = _v3(gravity)
        self._earth_rate = _v3(earth_rate)
        self._increment = INCREMENTS[method, attitude]
        self._near_lock = INCREMENTS[method, "so3"] if attitude == "euler_angles" else None
        self.correction = correction
        self.reset(initial)

    def reset(self, initial: NavigationState) -> None:
        """Start again at a state; the next reading starts the clock. The counts go on."""
        self._position = _v3(initial.position)
        self._velocity = _v3(initial.velocity)
        w, x, y, z = (float(value) for value in initial.q_wb)
        self._q = normalise((w, x, y, z))
        self._t_ns: int | None = None
        self._rate = self._force = ZERO

    @property
    def correction(self) -> Correction:
        """The known errors of the readings; a new one applies from the next reading on."""
        return self._correction

    @correction.setter
    def correction(self, correction: Correction) -> None:
        self._correction = correction
        self._gyro_bias = correction.gyroscope_bias
        self._accel_bias = correction.accelerometer_bias
        self._scaled = not (
            correction.gyroscope_scale_misalignment == IDENTITY_MATRIX
            and correction.accelerometer_scale_misalignment == IDENTITY_MATRIX
            and correction.gyroscope_g_sensitivity == ZERO_MATRIX
        )
        self._gyro_inverse: M9 = tuple(correction.gyroscope_inverse.ravel().tolist())
        self._accel_inverse: M9 = tuple(correction.accelerometer_inverse.ravel().tolist())

    @property
    def t_ns(self) -> int | None:
        """Stamp of the last reading [ns], None before the first."""
        return self._t_ns

    @property
    def position(self) -> V3:
        """p_wb [m]."""
        return self._position

    @property
    def velocity(self) -> V3:
        """Velocity of the body in the world frame [m/s]."""
        return self._velocity

    @property
    def velocity_b(self) -> V3:
        """Velocity resolved in the body frame, the twist of an Odometry message [m/s]."""
        return rotate(conjugate(self._q), self._velocity)

    @property
    def q_wb(self) -> Q4:
        """Unit quaternion (w, x, y, z)."""
        return self._q

    @property
    def angular_velocity(self) -> V3:
        """The corrected rate of the last reading, in the body [rad/s]."""
        return self._rate

    @property
    def specific_force(self) -> V3:
        """The corrected specific force of the last reading, in the body [m/s^2]."""
        return self._force

    @property
    def state(self) -> NavigationState:
        """The state at the last reading, as arrays."""
        parts = (self._position, self._velocity, self._q)
        return NavigationState._make(np.array(part) for part in parts)

    def add(self, t_ns: int, gyro: V3, accel: V3) -> bool:
        """Take a reading that the gate of ``inputs`` passes; return whether it was a step.

        :param t_ns: its stamp [ns].
        :param gyro: angular rate as read [rad/s].
        :param accel: specific force as read [m/s^2].
        """
        rate, force = self._corrected(gyro, accel)
        step_ns = t_ns - self._t_ns if self._t_ns is not None else None
        stepped = step_ns is not None and 0 < step_ns < self._max_gap_ns
        if step_ns is not None:
            if stepped:
                self._advance(step_ns * 1e-9, rate, force)
            else:
                self._count(step_ns)
        self._t_ns, self._rate, self._force = t_ns, rate, force
        return stepped

    def _count(self, step_ns: int) -> None:
        if step_ns == 0:
            self.counts.repeated += 1
        elif step_ns < 0:
            self.counts.backward += 1
        else:
            self.counts.gaps += 1

    def _corrected(self, gyro: V3, accel: V3) -> tuple[V3, V3]:
        bx, by, bz = self._accel_bias
        force = (accel[0] - bx, accel[1] - by, accel[2] - bz)
        bx, by, bz = self._gyro_bias
        rate = (gyro[0] - bx, gyro[1] - by, gyro[2] - bz)
        if self._scaled:
            force = transform(self._accel_inverse, force)
            gx, gy, gz = transform(self._correction.gyroscope_g_sensitivity, force)
            rate = transform(self._gyro_inverse, (rate[0] - gx, rate[1] - gy, rate[2] - gz))
        return rate, force

    def _advance(self, h: float, rate: V3, force: V3) -> None:
        q = self._q
        increment = self._increment
        if self._near_lock and _is_near_lock(q, self._rate, h):
            self.counts.gimbal_lock += 1
            increment = self._near_lock
        dq, dv, dp = increment(q, h, self._rate, rate, self._force, force)
        gx, gy, gz = self._gravity
        vx, vy, vz = velocity = self._velocity
        if self._earth_rate == ZERO:
            ax, ay, az = rotate(q, dv)
            ux, uy, uz = (vx + ax + gx * h, vy + ay + gy * h, vz + az + gz * h)
        else:
            # The world turns by Earth rate * h under the body: half of it in the mean, and twice
            # it under the velocity (Coriolis).
            half = exp(scaled(self._earth_rate, -0.5 * h))
            back = multiply(half, half)
            ax, ay, az = rotate(multiply(half, q), dv)
            bx, by, bz = rotate(back, velocity)
            ux, uy, uz = rotate(back, (bx + ax + gx * h, by + ay + gy * h, bz + az + gz * h))
            dq = multiply(conjugate(q), multiply(back, multiply(q, dq)))
        if dp is not ZERO:
            dp = rotate(q, dp)
        px, py, pz = self._position
        s = 0.5 * h
        self._position = (
            px + s * (vx + ux) + dp[0],
            py + s * (vy + uy) + dp[1],
            pz + s * (vz + uz) + dp[2],
        )
        self._velocity = (ux, uy, uz)
        self._q = normalise(multiply(q, dq))


def _is_near_lock(q: Q4, rate: V3, h: float) -> bool:
    """Return whether the pitch is near +-90 degrees; its sine is 2 (w y - z x)."""
    margin = max(GIMBAL_LOCK_MARGIN, 2.0 * math.hypot(*rate) * h)
    return margin > 1.0 or 2.0 * abs(q[0] * q[2] - q[3] * q[1]) > math.cos(margin)


def _v3(values: Iterable[float]) -> V3:
    x, y, z = (float(value) for value in values)
    return (x, y, z)
