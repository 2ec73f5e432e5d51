# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""The state of dead reckoning, and readings corrected by known errors."""

from __future__ import annotations

from dataclasses import dataclass, fields
from functools import cached_property
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from imu_sim_ros.arguments import array, refuse
from imu_sim_ros.inputs import gate
from imu_sim_ros.parameters.kinds import IDENTITY_MATRIX, ZERO_MATRIX, ZERO_VECTOR, Matrix, Vector
from imu_sim_ros.records import States
from imu_sim_ros.types import Array, Integers

if TYPE_CHECKING:
    from typing_extensions import Self

    from imu_sim_ros.navigation.parameters import IntegratorParameters


class _State(NamedTuple):
    position: Array
    """(3,) p_wb [m]."""
    velocity: Array
    """(3,) of the body in the world frame [m/s]."""
    q_wb: Array
    """(4,) unit quaternion (w, x, y, z)."""


class NavigationState(_State):
    """The position, velocity and attitude of a body at one time; checked on creation."""

    __slots__ = ()

    def __new__(cls, position: ArrayLike, velocity: ArrayLike, q_wb: ArrayLike) -> Self:
        """Check the state.

        :raises ConfigurationError: for values not finite, wrong shapes and non-unit quaternions.
        """
        q = array("q_wb", q_wb, (4,))
        if abs(float(np.linalg.norm(q)) - 1.0) > gate.UNIT_TOLERANCE:
            refuse("q_wb", q_wb, "a unit quaternion (w, x, y, z)")
        return super().__new__(
            cls, array("position", position, (3,)), array("velocity", velocity, (3,)), q
        )


def state_of_row(states: States, row: int) -> NavigationState:
    """Return the state of one row of states that have velocities."""
    assert states.velocity is not None
    return NavigationState._make((states.position[row], states.velocity[row], states.q_wb[row]))


def states_of(t_ns: Integers, position: Array, velocity: Array, q_wb: Array) -> States:
    """Return integrated states, which may lie beyond what a body can reach.

    :param t_ns: (n,) stamps [ns].
    :param position: (n, 3) p_wb [m].
    :param velocity: (n, 3) velocity in the world [m/s].
    :param q_wb: (n, 4) unit quaternions (w, x, y, z).
    """
    return States.unchecked(t_ns=t_ns, position=position, velocity=velocity, q_wb=q_wb)


@dataclass(frozen=True)
class Correction:
    """Known errors of an IMU; the defaults correct nothing."""

    gyroscope_bias: Vector = ZERO_VECTOR
    accelerometer_bias: Vector = ZERO_VECTOR
    gyroscope_scale_misalignment: Matrix = IDENTITY_MATRIX
    accelerometer_scale_misalignment: Matrix = IDENTITY_MATRIX
    gyroscope_g_sensitivity: Matrix = ZERO_MATRIX

    @cached_property
    def gyroscope_inverse(self) -> Array:
        """(3, 3) the inverse of S of the gyroscope."""
        return np.linalg.inv(np.reshape(self.gyroscope_scale_misalignment, (3, 3)))

    @cached_property
    def accelerometer_inverse(self) -> Array:
        """(3, 3) the inverse of S of the accelerometer."""
        return np.linalg.inv(np.reshape(self.accelerometer_scale_misalignment, (3, 3)))

    def apply(self, gyro: Array, accel: Array, dt: Array | float = 1.0) -> tuple[Array, Array]:
        """Return angular rate and specific force, without the known errors.

        :param gyro: (n, 3) readings [rad/s], or their integrals over dt [rad].
        :param accel: (n, 3) readings [m/s^2], or their integrals over dt [m/s].
        :param dt: (n, 1) lengths of the intervals [s] if the readings are integrals.
        """
        force = accel
        if self.accelerometer_bias != ZERO_VECTOR:
            force = force - np.asarray(self.accelerometer_bias) * dt
        if self.accelerometer_scale_misalignment != IDENTITY_MATRIX:
            force = force @ self.accelerometer_inverse.T
        rate = gyro
        if self.gyroscope_bias != ZERO_VECTOR:
            rate = rate - np.asarray(self.gyroscope_bias) * dt
        if self.gyroscope_g_sensitivity != ZERO_MATRIX:
            rate = rate - force @ np.reshape(self.gyroscope_g_sensitivity, (3, 3)).T
        if self.gyroscope_scale_misalignment != IDENTITY_MATRIX:
            rate = rate @ self.gyroscope_inverse.T
        return rate, force


NO_CORRECTION = Correction()
_NAMES = tuple(field.name for field in fields(Correction))


def correction_of(parameters: IntegratorParameters) -> Correction:
    """Return the correction that the parameters of an integrator describe."""
    values: dict[str, Any] = {name: getattr(parameters, name) for name in _NAMES}
    return Correction(**values)
