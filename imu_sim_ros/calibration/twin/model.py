# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Readings of an IMU with constant errors on a known motion, and their Jacobian.

With x the ideal reading in the IMU's axes, ``x_g = R omega`` and ``x_a = R f(l)``, ``R = R_ib``::

    f(l) = R_wb.T (a - g) + alpha x l + omega x (omega x l)
    gyroscope      = S_g x_g + G x_a + b_g
    accelerometer  = S_a x_a + b_a        response = [[S_g, G], [0, S_a]]
    true time      = stamp + tau_0 + tau_1 (stamp - reference) + wander(stamp)

Mounting and misalignment cannot be told apart by any motion: a turn of all of the accelerometer's
axes is a mounting. So S_a is upper triangular, the convention of ``calibrate six_position
--fixture norm``, and R is where it is; S_g is a full matrix.
"""

from collections.abc import Callable
from typing import Final, NamedTuple

import numpy as np

from imu_sim_ros.core import rotation
from imu_sim_ros.core.types import Array

COUNT: Final = 42
"""Number of parameters; the slices below are their places in a vector (42,)."""
OFFSET, SKEW = slice(0, 1), slice(1, 2)
MOUNTING: Final = slice(2, 5)
GYROSCOPE: Final = slice(5, 14)
ACCELEROMETER: Final = slice(14, 20)
G_SENSITIVITY: Final = slice(20, 29)
LEVER_ARM: Final = slice(29, 32)
BIAS: Final = slice(32, 38)
CURVATURE: Final = slice(38, 39)
WORLD: Final = slice(39, 42)
UPPER: Final = np.triu_indices(3)
RESPONSE: Final = slice(GYROSCOPE.start, G_SENSITIVITY.stop)
_ELEMENTS: Final = np.transpose(
    [
        *((i, j) for i in range(3) for j in range(3)),
        *((i, j) for i in range(3, 6) for j in range(i, 6)),
        *((i, j) for i in range(3) for j in range(3, 6)),
    ]
)
"""Row and column (2, 24) of each of the parameters ``RESPONSE`` in the response."""

# Signals of which the Jacobian consists.
_SLOPE, _SLOPE_OVER_TIME = slice(0, 6), slice(6, 12)
_IDEAL, _BENT = slice(12, 18), slice(18, 24)
_BY_ARM, _BY_WORLD, _ONE = slice(24, 33), slice(33, 42), 42
_STEP: Final = 5e-4
"""Step of the numerical derivatives in time [s]."""


class BodyMotion(NamedTuple):
    """Motion of an IMU's body in the body's axes, at n times.

    It has no position, unlike :class:`imu_sim_ros.trajectory.motion.Motion`, but the specific force
    that follows from motion and gravity.
    """

    rate: Array
    """(n, 3) omega_b [rad/s]."""
    force: Array
    """(n, 3) specific force at the body's origin [m/s^2]."""
    angular_acceleration: Array
    """(n, 3) alpha_b [rad/s^2]."""
    r_bw: Array | None = None
    """(n, 3, 3) R_wb.T of the truth; None: unknown."""


MotionAt = Callable[[Array], BodyMotion]
"""Function of times (n,) [s] after the truth's first pose that returns the motion."""


class KnownMotion(NamedTuple):
    """A motion that is known up to the noise of its poses."""

    motion_at: MotionAt
    cutoff: float
    """Highest frequency of the motion [Hz]."""
    noisy: tuple[MotionAt, ...] = ()
    """Motions along the same poses with further draws of their noise added."""


class Errors(NamedTuple):
    """The constant errors of an IMU on a body."""

    r_ib: Array
    """(3, 3) mounting."""
    response: Array
    """(6, 6) response of the readings to the ideal ones: S_g, G [(rad/s)/(m/s^2)] over 0, S_a."""
    lever_arm: Array
    """(3,) p_bi [m]."""
    bias: Array
    """(6,) biases of gyroscope [rad/s] and accelerometer [m/s^2]."""
    offset: float
    """Offset tau_0 of the clock: true time minus stamp at the reference [s]."""
    skew: float
    """Relative rate tau_1 of the true time against the stamps."""
    curvature: float
    """Curvature of the truth's attitude [s^2]; below 0: it is smoother than the motion."""
    world: Array
    """(3,) rotation vector from the world frame of the truth's attitudes to that of its positions
    and of gravity [rad]."""

    def step(self, step: Array) -> "Errors":
        """Return the errors after a step (42,) of the parameters.

        The order of the step is that of the slices of this module, from OFFSET to WORLD; the
        mounting takes a rotation vector in the IMU's axes [rad].
        """
        response = self.response.copy()
        response[tuple(_ELEMENTS)] += step[RESPONSE]
        turn = rotation.to_matrix(rotation.exp(step[MOUNTING]))
        return Errors(
            r_ib=turn @ self.r_ib,
            response=response,
            lever_arm=self.lever_arm + step[LEVER_ARM],
            bias=self.bias + step[BIAS],
            offset=self.offset + float(step[OFFSET.start]),
            skew=self.skew + float(step[SKEW.start]),
            curvature=self.curvature + float(step[CURVATURE.start]),
            world=self.world + step[WORLD],
        )

    def shift_reference(self, shift: float) -> "Errors":
        """Return the same errors with the offset at a reference later by a shift [s]."""
        return self._replace(offset=self.offset + self.skew * shift)

    def away_from(self, reference: "Errors") -> Array:
        """Return the step (42,) from reference errors to these."""
        step = self.deviation() - reference.deviation()
        step[MOUNTING] = rotation.log(rotation.from_matrix(self.r_ib @ reference.r_ib.T))
        return step

    def deviation(self) -> Array:
        """Return the parameters minus those of a perfect IMU (42,); 0 for the mounting."""
        deviation = np.zeros(COUNT)
        deviation[OFFSET], deviation[SKEW] = self.offset, self.skew
        deviation[RESPONSE] = (self.response - np.eye(6))[tuple(_ELEMENTS)]
        deviation[LEVER_ARM] = self.lever_arm
        deviation[BIAS] = self.bias
        deviation[CURVATURE], deviation[WORLD] = self.curvature, self.world
        return deviation


def perfect(r_ib: Array, offset: float = 0.0) -> Errors:
    """Return the errors of a perfect IMU with a mounting (3, 3) and a clock offset [s]."""
    none = np.zeros(3)
    return Errors(
        r_ib=r_ib,
        response=np.eye(6),
        lever_arm=none,
        bias=np.zeros(6),
        offset=offset,
        skew=0.0,
        curvature=0.0,
        world=none,
    )


def readings(errors: Errors, motion: BodyMotion) -> Array:
    """Return the readings (n, 6) of the IMU on a motion [rad/s, m/s^2]."""
    ideal = np.concatenate(_ideal(errors, motion), axis=1)
    return ideal @ errors.response.T + errors.bias


def _ideal(errors: Errors, motion: BodyMotion) -> tuple[Array, Array]:
    """Return ideal angular rate and specific force (n, 3) at the IMU, in its axes."""
    arm, rate = errors.lever_arm, motion.rate
    force = motion.force + np.cross(motion.angular_acceleration, arm)
    force = force + np.cross(rate, np.cross(rate, arm))
    return rate @ errors.r_ib.T, force @ errors.r_ib.T


def _add_lever_arm(change: BodyMotion, rate: Array, arm: Array) -> tuple[Array, Array]:
    """Return small changes (n, 3) of rate and of the force at the lever arm.

    :param rate: (n, 3) rate without the change.
    """
    force = change.force + np.cross(change.angular_acceleration, arm)
    force += np.cross(change.rate, np.cross(rate, arm)) + np.cross(rate, np.cross(change.rate, arm))
    return change.rate, force


def true_times(errors: Errors, stamps: Array, reference: float, wander: Array) -> Array:
    """Return the true times (n,) [s] of stamps (n,) [s].

    :param reference: stamp to which the offset refers [s].
    :param wander: (n,) correction of offset and skew [s].
    """
    return stamps + errors.offset + errors.skew * (stamps - reference) + wander


class Linear(NamedTuple):
    """Readings, linear in small changes of the errors.

    The Jacobian (n, 42) of axis a is ``signals @ coefficients[a]``.
    """

    readings: Array
    """(n, 6) readings."""
    signals: Array
    """(n, 43) functions of time."""
    coefficients: Array
    """(6, 43, 42) coefficients of the signals in the Jacobian."""

    @property
    def slope(self) -> Array:
        """(n, 6) rate of change of the readings [1/s]."""
        return self.signals[:, _SLOPE]


class _Linearised(NamedTuple):
    """Motion of an IMU according to a truth without the truth's own errors."""

    motion: BodyMotion
    slope: Array
    """(n, 6) rate of change of the readings [1/s]."""
    by_curvature: BodyMotion
    """Changes of rate, force and angular acceleration with the curvature."""
    by_world: Array
    """(n, 3, 3) change of the force with the world's turn."""


def _linearise(errors: Errors, motion_at: MotionAt, t: Array) -> _Linearised:
    """Return the motion at true times (n,) [s].

    A symmetric filter turns attitudes that vary slowly by ``-c alpha``, c < 0, so that rate and
    force lack (to first order in c) the terms below; and if the attitudes' world is turned
    by E = exp(psi) against that of positions and gravity, ``R_wb`` is ``E R_wb``::

        omega + c (alpha' + omega x alpha)     R_wb.T E.T R_wb f + c f x alpha     alpha + c alpha''
    """
    earlier, present, later = (motion_at(t + h) for h in (-_STEP, 0.0, _STEP))
    slope = (readings(errors, later) - readings(errors, earlier)) / (2.0 * _STEP)
    omega, f, alpha, r_bw = present
    alpha_earlier, alpha_later = earlier.angular_acceleration, later.angular_acceleration
    bend = BodyMotion(
        (alpha_later - alpha_earlier) / (2.0 * _STEP) + np.cross(omega, alpha),
        np.cross(f, alpha),
        (alpha_later - 2.0 * alpha + alpha_earlier) / _STEP**2,
    )
    by_world = np.zeros((len(t), 3, 3))
    if r_bw is not None:
        turn = rotation.to_matrix(rotation.exp(errors.world))
        f_w = np.einsum("nji,nj->ni", r_bw, f)
        f = np.einsum("nij,nj->ni", r_bw, f_w @ turn)
        by_world = r_bw @ (turn.T @ rotation.skew(f_w))
    c = errors.curvature
    omega, f, alpha = (
        x + c * change for x, change in zip((omega, f, alpha), bend[:3], strict=True)
    )
    return _Linearised(BodyMotion(omega, f, alpha, r_bw), slope, bend, by_world)


def predict_readings(errors: Errors, motion_at: MotionAt, t: Array) -> tuple[Array, Array]:
    """Return readings (n, 6) at true times (n,) [s] and their slope, without the truth's errors."""
    linearised_motion = _linearise(errors, motion_at, t)
    return readings(errors, linearised_motion.motion), linearised_motion.slope


def linearise_readings(
    errors: Errors, motion_at: MotionAt, stamps: Array, reference: float, wander: Array
) -> Linear:
    """Return the readings at stamps (n,) [s], linear in small changes of the errors.

    :param motion_at: motion of the truth.
    :param reference: stamp to which the clock's offset belongs [s].
    :param wander: (n,) deviation of the truth's clock from offset and skew [s].
    """
    t = true_times(errors, stamps, reference, wander)
    motion, slope, by_curvature, by_world = _linearise(errors, motion_at, t)
    turning = rotation.skew(motion.rate)
    by_arm = rotation.skew(motion.angular_acceleration) + turning @ turning
    bent = _add_lever_arm(by_curvature, motion.rate, errors.lever_arm)
    signals = [
        slope,
        slope * (stamps - reference)[:, None],
        *_ideal(errors, motion),
        *(change @ errors.r_ib.T for change in bent),
        by_arm.reshape(-1, 9),
        by_world.reshape(-1, 9),
        np.ones((len(stamps), 1)),
    ]
    return Linear(readings(errors, motion), np.concatenate(signals, axis=1), _coefficients(errors))


def _coefficients(errors: Errors) -> Array:
    """Return the change (6, 43, 42) of each reading per signal and change of an error."""
    coefficients, axes, eye = np.zeros((6, _ONE + 1, COUNT)), np.arange(6), np.eye(3)
    coefficients[axes, axes + _SLOPE.start, OFFSET.start] = 1.0
    coefficients[axes, axes + _SLOPE_OVER_TIME.start, SKEW.start] = 1.0
    coefficients[axes, _ONE, axes + BIAS.start] = 1.0
    for k, (row, column) in enumerate(_ELEMENTS.T):
        coefficients[row, _IDEAL.start + column, RESPONSE.start + k] = 1.0
    # Derivatives of the readings by the ideal ones, which a small turn changes by a cross product.
    gains = errors.response.reshape(6, 2, 3)
    by_turn = np.einsum("asi,kij->askj", gains, -rotation.skew(eye))
    coefficients[:, _IDEAL, MOUNTING] = by_turn.reshape(6, 6, 3)
    coefficients[:, _BENT, CURVATURE.start] = errors.response
    by_matrix = np.einsum("ai,jk->aijk", gains[:, 1] @ errors.r_ib, eye).reshape(6, 9, 3)
    coefficients[:, _BY_ARM, LEVER_ARM] = coefficients[:, _BY_WORLD, WORLD] = by_matrix
    return coefficients
