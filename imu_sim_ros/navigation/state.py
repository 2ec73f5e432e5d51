# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""The state of dead reckoning, and readings corrected by known errors."""

from __future__ import annotations

from dataclasses import dataclass, fields
from functools import cached_property
from typing import TYPE_CHECKING, NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from imu_sim_ros.core import components, gate
from imu_sim_ros.core.arguments import array, refuse
from imu_sim_ros.core.components import Component, stack, transform, vector
from imu_sim_ros.core.components import Vector as Components
from imu_sim_ros.core.records import States
from imu_sim_ros.core.types import Array, Integers, field_values
from imu_sim_ros.parameters.kinds import IDENTITY_MATRIX, ZERO_MATRIX, ZERO_VECTOR, Matrix, Vector

if TYPE_CHECKING:
    from typing_extensions import Self

    from imu_sim_ros.navigation.parameters import IntegratorParameters


class _State(NamedTuple):
    """Position, velocity and attitude at one time."""

    position: Array
    """(3,) p_wb [m]."""
    velocity: Array
    """(3,) velocity of the body in the world frame [m/s]."""
    q_wb: Array
    """(4,) unit quaternion (w, x, y, z)."""


class NavigationState(_State):
    """The position, velocity and attitude of a body at one time; checked on creation.

    It is an initial condition, which has no stamp: that of the first reading counts. So it is no
    row of :class:`imu_sim_ros.core.records.States`.
    """

    __slots__ = ()

    def __new__(cls, position: ArrayLike, velocity: ArrayLike, q_wb: ArrayLike) -> Self:
        """Check the state.

        :param position: (3,) in the world [m].
        :param velocity: (3,) in the world [m/s].
        :param q_wb: (4,) attitude of the body.
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
    """Return integrated states, unchecked: they may exceed what a body can reach.

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
    def gyroscope_inverse(self) -> components.Matrix[float]:
        """The inverse of S of the gyroscope."""
        return _inverse(self.gyroscope_scale_misalignment)

    @cached_property
    def accelerometer_inverse(self) -> components.Matrix[float]:
        """The inverse of S of the accelerometer."""
        return _inverse(self.accelerometer_scale_misalignment)

    def apply(self, gyro: Array, accel: Array) -> tuple[Array, Array]:
        """Return angular rate and specific force, without the known errors.

        :param gyro: (n, 3) readings [rad/s].
        :param accel: (n, 3) readings [m/s^2].
        """
        if self == NO_CORRECTION:
            return gyro, accel
        rate, force = self.correct(vector(gyro), vector(accel))
        return stack(rate), stack(force)

    def correct(
        self, gyro: Components[Component], accel: Components[Component]
    ) -> tuple[Components[Component], Components[Component]]:
        """Return :meth:`apply` of the components of readings."""
        x, y, z = accel
        if self.accelerometer_bias != ZERO_VECTOR:
            bx, by, bz = self.accelerometer_bias
            x, y, z = x - bx, y - by, z - bz
        force = (x, y, z)
        if self.accelerometer_scale_misalignment != IDENTITY_MATRIX:
            force = transform(self.accelerometer_inverse, force)
        x, y, z = gyro
        if self.gyroscope_bias != ZERO_VECTOR:
            bx, by, bz = self.gyroscope_bias
            x, y, z = x - bx, y - by, z - bz
        if self.gyroscope_g_sensitivity != ZERO_MATRIX:
            a, b, c = transform(self.gyroscope_g_sensitivity, force)
            x, y, z = x - a, y - b, z - c
        rate = (x, y, z)
        if self.gyroscope_scale_misalignment != IDENTITY_MATRIX:
            rate = transform(self.gyroscope_inverse, rate)
        return rate, force


def _inverse(response: Matrix) -> components.Matrix[float]:
    """Return the inverse of a response (3, 3) as floats."""
    return components.float_matrix(np.linalg.inv(np.reshape(response, (3, 3))))


NO_CORRECTION = Correction()
_NAMES = tuple(field.name for field in fields(Correction))


def correction_of(parameters: IntegratorParameters) -> Correction:
    """Return the correction that the parameters of an integrator describe.

    It is ``NO_CORRECTION`` itself if they state no error.
    """
    values = field_values(parameters)
    correction = Correction(**{name: values[name] for name in _NAMES})
    return NO_CORRECTION if correction == NO_CORRECTION else correction
