# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""What an IMU with constant errors reads on a known motion, and how that depends on each error.

With x the ideal reading in the IMU's axes, ``x_g = R omega`` and ``x_a = R f(l)``, ``R = R_ib``::

    f(l) = R_wb.T (a - g) + alpha x l + omega x (omega x l)
    gyroscope      = S_g x_g + G x_a + b_g
    accelerometer  = S_a x_a + b_a
    true time      = stamp + tau_0 + tau_1 (stamp - reference) + wander(stamp)

Mounting and misalignment cannot be told apart by any motion: a turn of all of the accelerometer's
axes is a mounting. So S_a is upper triangular, the convention of ``calibrate six_position
--fixture norm``, and R is where it is; S_g is a full matrix.
"""

from collections.abc import Callable
from typing import Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from imu_sim_ros import rotation

Array = NDArray[np.float64]

COUNT: Final = 38
OFFSET, SKEW = slice(0, 1), slice(1, 2)
MOUNTING: Final = slice(2, 5)
GYROSCOPE: Final = slice(5, 14)
ACCELEROMETER: Final = slice(14, 20)
G_SENSITIVITY: Final = slice(20, 29)
LEVER_ARM: Final = slice(29, 32)
BIAS: Final = slice(32, 38)
UPPER: Final = np.triu_indices(3)
_STEP: Final = 5e-4
"""[s] for the derivative in time."""


class BodyMotion(NamedTuple):
    """What moves an IMU, in the body's axes at n times."""

    rate: Array
    """(n, 3) omega_b [rad/s]."""
    force: Array
    """(n, 3) specific force at the body's origin [m/s^2]."""
    angular_acceleration: Array
    """(n, 3) alpha_b [rad/s^2]."""


MotionAt = Callable[[Array], BodyMotion]
"""Returns the motion at times (n,) [s] after the truth's first pose."""


class Errors(NamedTuple):
    """The constant errors of an IMU on a body."""

    r_ib: Array
    """(3, 3) mounting."""
    gyroscope: Array
    """(3, 3) S_g."""
    accelerometer: Array
    """(3, 3) S_a, upper triangular."""
    g_sensitivity: Array
    """(3, 3) G [(rad/s)/(m/s^2)]."""
    lever_arm: Array
    """(3,) p_bi [m]."""
    bias: Array
    """(6,) gyroscope, accelerometer."""
    offset: float
    """tau_0: true time minus stamp at the reference [s]."""
    skew: float
    """tau_1."""

    def moved(self, step: Array) -> "Errors":
        """Return the errors after a step (38,) of the parameters."""
        accelerometer = self.accelerometer.copy()
        accelerometer[UPPER] += step[ACCELEROMETER]
        turn = rotation.to_matrix(rotation.exp(step[MOUNTING]))
        return Errors(
            turn @ self.r_ib,
            self.gyroscope + step[GYROSCOPE].reshape(3, 3),
            accelerometer,
            self.g_sensitivity + step[G_SENSITIVITY].reshape(3, 3),
            self.lever_arm + step[LEVER_ARM],
            self.bias + step[BIAS],
            self.offset + float(step[0]),
            self.skew + float(step[1]),
        )

    def deviation(self) -> Array:
        """Return the parameters' distance from a perfect IMU (38,); 0 for the mounting."""
        result = np.zeros(COUNT)
        result[0], result[1] = self.offset, self.skew
        result[GYROSCOPE] = (self.gyroscope - np.eye(3)).ravel()
        result[ACCELEROMETER] = (self.accelerometer - np.eye(3))[UPPER]
        result[G_SENSITIVITY] = self.g_sensitivity.ravel()
        result[LEVER_ARM] = self.lever_arm
        result[BIAS] = self.bias
        return result


def perfect(r_ib: Array, offset: float = 0.0) -> Errors:
    """Return an IMU without errors at a mounting."""
    zero = np.zeros((3, 3))
    return Errors(r_ib, np.eye(3), np.eye(3), zero, np.zeros(3), np.zeros(6), offset, 0.0)


def readings(errors: Errors, motion: BodyMotion) -> Array:
    """Return what the IMU reads (n, 6) on a motion."""
    rate, force = _ideal(errors, motion)
    gyro = rate @ errors.gyroscope.T + force @ errors.g_sensitivity.T
    return np.concatenate([gyro, force @ errors.accelerometer.T], axis=1) + errors.bias


def _ideal(errors: Errors, motion: BodyMotion) -> tuple[Array, Array]:
    """Return the ideal readings (n, 3) in the IMU's axes."""
    arm, rate = errors.lever_arm, motion.rate
    force = motion.force + np.cross(motion.angular_acceleration, arm)
    force = force + np.cross(rate, np.cross(rate, arm))
    return rate @ errors.r_ib.T, force @ errors.r_ib.T


def true_times(errors: Errors, stamps: Array, reference: float, wander: Array) -> Array:
    """Return the true times (n,) [s] of stamps (n,) [s].

    :param reference: stamp to which the offset refers [s].
    :param wander: (n,) [s] what is added beside offset and skew.
    """
    result: Array = stamps + errors.offset + errors.skew * (stamps - reference) + wander
    return result


def slope_at(errors: Errors, motion_at: MotionAt, t: Array) -> Array:
    """Return the rate of change (n, 6) of the readings at true times (n,) [s]."""
    ahead, behind = (readings(errors, motion_at(t + h)) for h in (_STEP, -_STEP))
    result: Array = (ahead - behind) / (2.0 * _STEP)
    return result


def linearised(
    errors: Errors, motion_at: MotionAt, stamps: Array, reference: float, wander: Array
) -> tuple[Array, Array, Array]:
    """Return readings (n, 6), their Jacobian (n, 6, 38), and their rate of change (n, 6)."""
    t = true_times(errors, stamps, reference, wander)
    motion = motion_at(t)
    rate, force = _ideal(errors, motion)
    slope = slope_at(errors, motion_at, t)
    jacobian = np.zeros((len(stamps), 6, COUNT))
    jacobian[:, :, 0] = slope
    jacobian[:, :, 1] = slope * (stamps - reference)[:, None]
    turned_rate, turned_force = -rotation.skew(rate), -rotation.skew(force)
    s_g, s_a, g = errors.gyroscope, errors.accelerometer, errors.g_sensitivity
    jacobian[:, :3, MOUNTING] = s_g @ turned_rate + g @ turned_force
    jacobian[:, 3:, MOUNTING] = s_a @ turned_force
    across = rotation.skew(motion.angular_acceleration)
    turning = rotation.skew(motion.rate)
    arm = errors.r_ib @ (across + turning @ turning)
    jacobian[:, :3, LEVER_ARM] = g @ arm
    jacobian[:, 3:, LEVER_ARM] = s_a @ arm
    for row in range(3):
        first = GYROSCOPE.start + 3 * row
        jacobian[:, row, first : first + 3] = rate
        first = G_SENSITIVITY.start + 3 * row
        jacobian[:, row, first : first + 3] = force
    for k, (i, j) in enumerate(zip(*UPPER, strict=True)):
        jacobian[:, 3 + i, ACCELEROMETER.start + k] = force[:, j]
    jacobian[:, np.arange(6), BIAS.start + np.arange(6)] = 1.0
    return readings(errors, motion), jacobian, slope
