# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Dead reckoning of whole records: readings in, positions, velocities and attitudes out.

Between two readings the attitude turns by an increment that depends on the readings alone, so the
attitudes are the running product of the increments, and velocity and position are running sums of
the specific force turned into the world: nothing is done per sample in Python. The steps, with
``h`` the interval, ``w`` and ``f`` the corrected readings and ``a = R f + g``:

``euler``  (lecture eq. 30, 31)  the reading at the interval's start holds throughout;
           ``v += a h``, ``p += v h + a h^2 / 2``.
``midpoint``  (lecture eq. 32, 33)  the mean of the rates at both ends turns the attitude, the mean
           of both ends' accelerations, each turned by its own attitude, moves the body.
``rk4``    the classical Runge-Kutta scheme on attitude, velocity and position together, with
           readings that are linear between both ends.

Attitude updates:

``quaternion``  (lecture eq. 34)  ``q (1, w h / 2)``, normalised; under rk4 the four slopes are
           those of ``dq/dt = q (0, w) / 2``.
``so3``    (lecture eq. 35)  ``R Exp(w h)``; under rk4 the slopes are those of the rotation vector,
           ``dphi/dt = Jr(phi)^-1 w`` (Munthe-Kaas 1998).
``euler_angles``  (lecture eq. 36, 38)  roll, pitch and yaw; under midpoint the matrix of eq. 38 is
           that of the interval's middle, else the order would stay 1. The slope depends on the
           attitude, so roll and pitch go step by step, which takes several times as long; in a
           world that turns all of it does, through :class:`Stepper`.

If the world rotates (``earth_rate``, in the world frame), the gyroscope reads that rate too, the
world turns under the attitude, and the velocity is subject to Coriolis' acceleration; the
centrifugal one is part of gravity.
"""

import math
from collections.abc import Callable, Sequence
from functools import partial
from typing import Final

import numpy as np

from imu_sim_ros.core import rotation
from imu_sim_ros.core.components import Vector, quaternion, vector
from imu_sim_ros.core.conventions import GRAVITY
from imu_sim_ros.core.records import States
from imu_sim_ros.core.types import Array, Integers
from imu_sim_ros.navigation import angles, increments
from imu_sim_ros.navigation.increments import Ends, Increment
from imu_sim_ros.navigation.mount import ALIGNED, ImuMount
from imu_sim_ros.navigation.state import (
    NO_CORRECTION,
    Correction,
    NavigationState,
    states_of,
)
from imu_sim_ros.navigation.stepper import Stepper, check_method, check_readings

__all__ = ["Stepper", "dead_reckon"]

_Vector = tuple[float, float, float]

_STILL: Final[_Vector] = (0.0, 0.0, 0.0)
"""Rate of a world that does not turn [rad/s]."""
_BLOCK: Final = 16384
"""Intervals processed at a time: their arrays stay in the processor's cache."""


def dead_reckon(
    t_ns: Integers,
    gyro: Array,
    accel: Array,
    initial: NavigationState,
    method: str = "midpoint",
    attitude: str = "so3",
    gravity: Sequence[float] = GRAVITY,
    correction: Correction = NO_CORRECTION,
    max_gap: float = math.inf,
    earth_rate: Sequence[float] = _STILL,
    mount: ImuMount = ALIGNED,
    initial_rate: Array | None = None,
) -> States:
    """Integrate readings.

    :param t_ns: (n,) stamps [ns], increasing.
    :param gyro: (n, 3) angular rates as read [rad/s].
    :param accel: (n, 3) specific forces as read [m/s^2].
    :param initial: the state of the body at the first stamp.
    :param method: euler, midpoint or rk4.
    :param attitude: quaternion, so3 or euler_angles.
    :param gravity: (3,) gravity in the world frame [m/s^2].
    :param correction: the known errors of the readings.
    :param max_gap: longest interval that is integrated over [s].
    :param earth_rate: (3,) rate of the world, in the world frame [rad/s].
    :param mount: mount of the IMU in the body.
    :param initial_rate: (3,) angular rate of the body at the first stamp, relative to the world and
        in the body [rad/s]; with a lever arm it decides the IMU's velocity. None: as it is read.
    :returns: the states of the body at all stamps, the initial one first.
    :raises ConfigurationError: for an unknown method or attitude update.
    :raises InputError: for readings that cannot be integrated, and for Euler angles that come
        near their gimbal lock.
    """
    check_method(method, attitude)
    check_readings(t_ns, gyro, accel, max_gap)
    ways = (method, attitude, gravity, correction, earth_rate)
    if mount == ALIGNED:
        return _integrate(t_ns, gyro, accel, initial, *ways)

    def rate(rows: slice, q_wi: Array) -> Array:
        """Return the rate relative to the world (m, 3), in the IMU's axes."""
        corrected_rate = correction.apply(gyro[rows], accel[rows])[0]
        return corrected_rate - rotation.rotate_inverse(q_wi, earth_rate)

    if initial_rate is None:
        q_wi = rotation.multiply(initial.q_wb, mount.q_bi)
        initial_rate = rotation.rotate(mount.q_bi, rate(slice(1), q_wi)[0])
    imu = _integrate(t_ns, gyro, accel, mount.imu_state(initial, initial_rate), *ways)
    return mount.body_states(imu, rate(slice(None), imu.q_wb))


def _integrate(
    t_ns: Integers,
    gyro: Array,
    accel: Array,
    initial: NavigationState,
    method: str,
    attitude: str,
    gravity: Sequence[float],
    correction: Correction,
    earth_rate: Sequence[float],
) -> States:
    """Return the states of the IMU itself; arguments as for :func:`dead_reckon`, already checked.

    In blocks of arrays; Euler angles on a rotating Earth are integrated step by step.

    :param initial: state of the IMU at the first reading.
    :param correction: correction of the readings by the sensor's known errors.
    """
    if attitude == "euler_angles" and any(earth_rate):
        stepper = Stepper(
            initial, method, attitude, gravity, correction, math.inf, earth_rate=earth_rate
        )
        return _step_through(stepper, t_ns, gyro, accel)
    states = _States(t_ns, initial, gravity, earth_rate)
    between: Callable[[Array, Ends[Array], Ends[Array]], Increment[Array]] = partial(
        increments.increment_between, method, attitude
    )
    if attitude == "euler_angles":
        between = angles.AngleIncrements(method, states.attitude)
    for start in range(0, len(t_ns) - 1, _BLOCK):
        rows = slice(start, start + _BLOCK + 1)
        h = np.diff(t_ns[rows]) * 1e-9
        readings = (vector(np.asfortranarray(values[rows])) for values in (gyro, accel))
        rate, force = correction.correct(*readings)
        states.extend(h, between(h, _ends(rate), _ends(force)))
    return states.result()


def _ends(values: Vector[Array]) -> Ends[Array]:
    """Return n + 1 vectors as those at the starts and at the ends of n intervals."""
    x, y, z = values
    return (x[:-1], y[:-1], z[:-1]), (x[1:], y[1:], z[1:])


class _States:
    """States of a record, filled in block by block."""

    def __init__(
        self,
        t_ns: Integers,
        initial: NavigationState,
        gravity: Sequence[float],
        earth_rate: Sequence[float],
    ) -> None:
        """Reserve n rows, of which the first is the initial state.

        :param t_ns: (n,) stamps of the states [ns].
        :param gravity: (3,) gravity in the world [m/s^2].
        :param earth_rate: (3,) rate of the world, in the world [rad/s].
        """
        n = len(t_ns)
        self._t_ns = t_ns
        self._position, self._velocity = np.empty((n, 3)), np.empty((n, 3))
        self._q = np.empty((n, 4))
        self._position[0], self._velocity[0] = initial.position, initial.velocity
        self._q[0] = rotation.normalise(initial.q_wb)
        self._world = increments.world_vectors(gravity, earth_rate)
        self._row = 0
        """Number of the last row that is filled."""

    @property
    def attitude(self) -> Array:
        """The last attitude so far (4,)."""
        return self._q[self._row]

    def extend(self, h: Array, increment: Increment[Array]) -> None:
        """Append the states at the ends of intervals of lengths h (n,)."""
        begin, self._row = self._row, self._row + len(h)
        start = (
            vector(self._position[begin]),
            vector(self._velocity[begin]),
            quaternion(self._q[begin]),
        )
        end = increments.states(start, h, increment, self._world)
        for rows, columns in zip((self._position, self._velocity, self._q), end, strict=True):
            for k, column in enumerate(columns):
                rows[begin + 1 : self._row + 1, k] = column

    def result(self) -> States:
        return states_of(self._t_ns, self._position, self._velocity, self._q)


def _step_through(stepper: Stepper, t_ns: Integers, gyro: Array, accel: Array) -> States:
    """Integrate n readings step by step, for attitude updates that have no increments.

    :param t_ns: (n,) stamps [ns].
    :param gyro: (n, 3) rates [rad/s].
    :param accel: (n, 3) specific forces [m/s^2].
    """
    position, velocity, q_wb = [], [], []
    readings = zip(t_ns.tolist(), gyro.tolist(), accel.tolist(), strict=True)
    for t, rate, force in readings:
        stepper.add(t, rate, force)
        if stepper.counts.gimbal_lock:
            raise angles.gimbal_lock((t - int(t_ns[0])) * 1e-9)
        position.append(stepper.position)
        velocity.append(stepper.velocity)
        q_wb.append(stepper.q_wb)
    return states_of(t_ns, np.array(position), np.array(velocity), np.array(q_wb))
