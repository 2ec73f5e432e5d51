# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""The mount of an IMU in the body: dead reckoning integrates the IMU, and states the body's motion.

With p the lever arm ``p_bi`` and omega the angular rate relative to the world, in body axes,

    p_wi = p_wb + R_wb p,   v_i = v_b + R_wb (omega x p),   R_wi = R_wb R_bi

(Groves, "Principles of GNSS, inertial, and multisensor integrated navigation systems", 2nd edition,
section 2.5.5). This way round no angular acceleration is needed, as it would be to move the
readings to the body's origin.
"""

from functools import lru_cache
from typing import NamedTuple

import numpy as np

from imu_sim_ros.core import components, rotation
from imu_sim_ros.core.components import Component, Quaternion, quaternion, stack, vector
from imu_sim_ros.core.records import States
from imu_sim_ros.core.types import Array
from imu_sim_ros.navigation.increments import State
from imu_sim_ros.navigation.parameters import IntegratorImuParameters
from imu_sim_ros.navigation.state import NavigationState, states_of
from imu_sim_ros.parameters.kinds import ZERO_VECTOR, Vector
from imu_sim_ros.sensors.imu.parameters import ImuParameters


class ImuMount(NamedTuple):
    """Position and axes of an IMU in the body; by default the body's own."""

    lever_arm: Vector = ZERO_VECTOR
    """(3,) position p_bi of the IMU on the body [m]."""
    q_bi: Quaternion[float] = (1.0, 0.0, 0.0, 0.0)

    @property
    def arm_i(self) -> Vector:
        """The lever arm in the axes of the IMU [m]."""
        return components.rotate_inverse(self.q_bi, self.lever_arm)

    def imu_state(self, body: NavigationState, rate_b: Array) -> NavigationState:
        """Return the IMU's state, or its states if the arrays have rows.

        :param rate_b: (3,) angular rate of the body relative to the world [rad/s].
        """
        swing = np.cross(rate_b, self.lever_arm)
        return NavigationState._make(
            (
                body.position + rotation.rotate(body.q_wb, self.lever_arm),
                body.velocity + rotation.rotate(body.q_wb, swing),
                rotation.multiply(body.q_wb, self.q_bi),
            )
        )

    def body_states(self, imu: States, rate_i: Array) -> States:
        """Return the body's states.

        :param imu: n states of the IMU.
        :param rate_i: (n, 3) relative to the world, in the IMU's axes [rad/s].
        """
        arm, q_ib = vector(self.arm_i), quaternion(components.conjugate(self.q_bi))
        state = (vector(imu.position), vector(imu.velocities()), quaternion(imu.q_wb))
        body = _body_state(state, vector(rate_i), arm, q_ib)
        return states_of(imu.t_ns, *(stack(columns) for columns in body))

    def body_state(
        self, imu: State[float], rate_i: Vector
    ) -> tuple[Vector, Quaternion[float], Vector, Vector]:
        """Return pose and twist of the body, as in a :class:`~imu_sim_ros.core.records.LiveState`.

        :param imu: position, velocity and attitude of the IMU.
        :param rate_i: angular rate relative to the world, in the IMU's axes [rad/s].
        """
        position, velocity, q_wb = imu
        if self != ALIGNED:
            q_ib = components.conjugate(self.q_bi)
            position, velocity, q_wb = _body_state(imu, rate_i, self.arm_i, q_ib)
            rate_i = components.rotate(self.q_bi, rate_i)
        return position, q_wb, components.rotate_inverse(q_wb, velocity), rate_i

    def pose_covariance(self, imu: Array, q_wb: Quaternion[float]) -> Array:
        """Return the covariance of the body's pose, position and rotation about the world's axes.

        A tilt theta moves the body about the IMU: ``dp_b = dp_i - theta x (R_wb p)``.

        :param imu: (6, 6) covariance of the IMU's pose.
        """
        if self.lever_arm == ZERO_VECTOR:
            return imu
        x, y, z = components.rotate(q_wb, self.lever_arm)
        to_body = np.eye(6)
        to_body[:3, 3:] = ((0.0, -z, y), (z, 0.0, -x), (-y, x, 0.0))
        return to_body @ imu @ to_body.T

    def twist_covariance(self, imu: Array) -> Array:
        """Return the covariance of the body's twist, linear and angular, in the body.

        :param imu: (6, 6) covariance of the IMU's pose, in its own axes.
        """
        if self == ALIGNED:
            return imu
        to_body = _twist_to_body(self)
        return to_body @ imu @ to_body.T

    def state_covariance(self, imu: Array, r_wi: Array, rate_i: Array, white: Array) -> Array:
        """Return the covariance of the body's state, in the order of :mod:`.covariance`.

        The biases stay in the IMU's axes. The error of the rate turns the lever arm's velocity.

        :param imu: (15, 15) covariance of the IMU's state.
        :param r_wi: (3, 3) attitude of the IMU.
        :param rate_i: (3,) angular rate relative to the world, in the IMU's axes [rad/s].
        :param white: (3,) variance of the white noise of a gyroscope's reading.
        """
        arm = self.arm_i
        by_rate = -r_wi @ rotation.skew(arm)
        to_body = np.eye(15)
        to_body[6:9, 0:3] = rotation.skew(r_wi @ arm)
        to_body[3:6, 0:3] = rotation.skew(r_wi @ np.cross(rate_i, arm))
        to_body[3:6, 9:12] = by_rate
        covariance: Array = to_body @ imu @ to_body.T
        covariance[3:6, 3:6] += (by_rate * white) @ by_rate.T
        return covariance


def _body_state(
    imu: State[Component],
    rate_i: components.Vector[Component],
    arm_i: components.Vector[Component],
    q_ib: Quaternion[Component],
) -> State[Component]:
    """Return the state of the body from the state of the IMU.

    :param imu: position [m] and velocity [m/s] of the IMU in the world, and ``q_wi``.
    :param rate_i: angular rate relative to the world, in the IMU's axes [rad/s].
    :param arm_i: the lever arm, from the body's origin to the IMU, in the IMU's axes [m].
    :param q_ib: attitude of the body in the IMU's axes.
    """
    (px, py, pz), (vx, vy, vz), q_wi = imu
    x, y, z = components.rotate(q_wi, arm_i)
    a, b, c = components.rotate(q_wi, components.cross(rate_i, arm_i))
    position, velocity = (px - x, py - y, pz - z), (vx - a, vy - b, vz - c)
    return position, velocity, components.multiply(q_wi, q_ib)


@lru_cache(maxsize=8)
def _twist_to_body(mount: ImuMount) -> Array:
    """Return (6, 6), which maps a twist of the IMU, in its axes, to the body's."""
    r_bi = rotation.to_matrix(mount.q_bi)
    transform = np.zeros((6, 6))
    transform[:3, :3] = transform[3:, 3:] = r_bi
    transform[:3, 3:] = r_bi @ rotation.skew(mount.arm_i)  # - omega x p = p x omega
    return transform


ALIGNED = ImuMount()
"""Mount in the body's origin, with its axes."""


def mount_of(imu: ImuParameters | IntegratorImuParameters) -> ImuMount:
    """Return the mount that parameters describe, ``ALIGNED`` itself if it is that."""
    return mount_at(np.asarray(imu.lever_arm), np.reshape(imu.mounting, (3, 3)))


def mount_at(lever_arm: Array, r_bi: Array) -> ImuMount:
    """Return the mount with a lever arm (3,) [m] and a rotation (3, 3)."""
    x, y, z = lever_arm.tolist()
    qw, qx, qy, qz = rotation.from_matrix(r_bi).tolist()
    mount = ImuMount((x, y, z), (qw, qx, qy, qz))
    return ALIGNED if mount == ALIGNED else mount
