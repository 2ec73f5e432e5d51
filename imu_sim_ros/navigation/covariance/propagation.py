# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""The covariance of a dead-reckoned state, propagated from the noise of the IMU.

The error state has 15 numbers, each the truth less the estimate, in this order: attitude (3, a
rotation vector about the **world's** axes, ``R_true = Exp(dtheta) R``), velocity and position (3
each, in the world), bias of the gyroscope and of the accelerometer (3 each, in the body). With
``f`` the specific force that is integrated and ``n`` the white noise, the errors grow as

    dtheta' = -R (db_g + n_g)
    dv'     = dtheta x (R f) - R (db_a + n_a)
    dp'     = dv
    db_g'   = n_bg,  db_a' = n_ba

(Groves, "Principles of GNSS, inertial, and multisensor integrated navigation systems", 2nd edition,
section 14.2, for a world that does not turn), integrated to first order over each step. The white
noise of a reading counts once, for one step: midpoint's halves of it in two neighbouring steps add
up to the same; rounding to steps of LSB is white noise of ``LSB^2 / 12`` per reading (Widrow 1956).
What a tilt adds to second order, :mod:`imu_sim_ros.navigation.covariance.second_order` says, what
1/f noise, Gauss-Markov biases and unknown scales add, :mod:`~.slow_errors`.

Not in it: temperature, range, bandwidth and losses, and what steps of the integration leave out.
"""

from collections.abc import Sequence
from typing import Final

import numpy as np
from numpy.typing import ArrayLike, NDArray

from imu_sim_ros import rotation
from imu_sim_ros.navigation.covariance.second_order import SecondOrder
from imu_sim_ros.navigation.covariance.slow_errors import SlowErrors
from imu_sim_ros.navigation.noise import Noise
from imu_sim_ros.navigation.state import NavigationStates

Array = NDArray[np.float64]

SIZE: Final = 15
ATTITUDE, VELOCITY, POSITION = slice(0, 3), slice(3, 6), slice(6, 9)
GYRO_BIAS, ACCEL_BIAS = slice(9, 12), slice(12, 15)

_POSE = np.r_[POSITION, ATTITUDE]
_SECOND_ORDER_INTERVAL: Final = 0.1
"""[s] at which the second order is brought up to date; it grows slowly and costs 0.1 ms."""


def initial_covariance(
    attitude: ArrayLike = 0.0,
    velocity: ArrayLike = 0.0,
    position: ArrayLike = 0.0,
    gyroscope_bias: ArrayLike = 0.0,
    accelerometer_bias: ArrayLike = 0.0,
) -> Array:
    """Return the (15, 15) covariance of independent errors from their standard deviations.

    Each is one number or (3,), in rad, m/s, m, rad/s and m/s^2.
    """
    sigmas = (attitude, velocity, position, gyroscope_bias, accelerometer_bias)
    return np.diag(np.concatenate([np.broadcast_to(np.square(sigma), 3) for sigma in sigmas]))


class Covariance:
    """The covariance of the error state, step by step."""

    def __init__(
        self, noise: Noise, initial: Array | None = None, cross: Array | None = None
    ) -> None:
        """Start with the covariance of the initial state's error (15, 15); None is no error.

        :param cross: (15, m) its covariance with the slow errors; None: there is none.
        """
        self.matrix = np.zeros((SIZE, SIZE)) if initial is None else np.array(initial)
        """(15, 15), to first order."""
        self._gyro_white = np.square(noise.gyroscope_noise_density)
        self._accel_white = np.square(noise.accelerometer_noise_density)
        walks = (noise.gyroscope_random_walk, noise.accelerometer_random_walk)
        self._walk = np.square(np.concatenate(walks))
        self._gyro_rounding = np.square(noise.gyroscope_resolution) / 12.0
        self._accel_rounding = np.square(noise.accelerometer_resolution) / 12.0
        self._walk_diagonal = np.arange(GYRO_BIAS.start, SIZE)
        self._transition = np.eye(SIZE)
        self._by_bias = np.zeros((SIZE, 6))
        self.slow = SlowErrors(noise, SIZE)
        if cross is not None:
            self.slow.cross = np.array(cross)
        self._second_order = SecondOrder()
        self._begin_interval()

    def _begin_interval(self) -> None:
        """Begin to collect what the second order needs."""
        self._before = self.matrix
        """(15, 15)"""
        self._slow_before = self.slow.bias()[1][ATTITUDE, :3].T
        """(3, 3) covariance of the gyroscope's slow errors with the attitude's"""
        self._length = 0.0
        self._gained = np.zeros(3)
        self._turned = np.zeros((3, 3))

    def step(
        self,
        h: float,
        r_wb: Array,
        force_b: Array | Sequence[float],
        rate_b: Array | Sequence[float] = (0.0, 0.0, 0.0),
    ) -> None:
        """Propagate over an interval.

        :param h: its length [s].
        :param r_wb: (3, 3) attitude in the interval, its start's or its middle's.
        :param force_b: (3,) corrected specific force in the interval, in the body [m/s^2].
        :param rate_b: (3,) corrected rate in the interval [rad/s]; an unknown scale acts on it.
        """
        gained = (r_wb @ np.asarray(force_b)) * h
        x, y, z = gained
        turned = r_wb * -h
        tilt = np.array([[0.0, z, -y], [-z, 0.0, x], [y, -x, 0.0]])
        f = self._transition
        f[ATTITUDE, GYRO_BIAS] = turned
        f[VELOCITY, ATTITUDE] = tilt
        f[VELOCITY, ACCEL_BIAS] = turned
        f[POSITION, ATTITUDE] = tilt * (0.5 * h)
        f[POSITION, ACCEL_BIAS] = turned * (0.5 * h)
        f[6, 3] = f[7, 4] = f[8, 5] = h
        p = f @ self.matrix @ f.T
        # (R h) diag(density^2 / h) (R h)^T: white noise of one sample of length h.
        white = self._gyro_white / h + self._gyro_rounding
        p[ATTITUDE, ATTITUDE] += (turned * white) @ turned.T
        white = self._accel_white / h + self._accel_rounding
        p[VELOCITY, VELOCITY] += (turned * white) @ turned.T
        p[self._walk_diagonal, self._walk_diagonal] += self._walk * h
        if self.slow:
            self._by_bias[: GYRO_BIAS.start] = f[: GYRO_BIAS.start, GYRO_BIAS.start :]
            p += self.slow.step(h, f, self._by_bias, rate_b, force_b)
        self.matrix = p
        self._length += h
        self._gained += gained
        self._turned += turned
        if self._length >= _SECOND_ORDER_INTERVAL:
            self._update_second_order()

    def _update_second_order(self) -> None:
        before = self._before[ATTITUDE, ATTITUDE]
        # The error of the attitude at the end, as far as that at the start tells it.
        by_bias = self._turned @ (self._before[GYRO_BIAS, ATTITUDE] + self._slow_before)
        kept = np.eye(3) + by_bias @ np.linalg.pinv(before, hermitian=True)
        after = self.matrix[ATTITUDE, ATTITUDE]
        acceleration = self._gained / self._length
        self._second_order.step(self._length, acceleration, before, after, kept)
        self._begin_interval()

    def mean_square(self) -> Array:
        """Return the (15, 15) mean square of the error, with the second order of a tilt.

        The biases are here all that the latest reading is off by, white noise apart.
        """
        result: Array = self.matrix.copy()
        if self.slow:
            own, with_state = self.slow.bias()
            biases = slice(GYRO_BIAS.start, SIZE)
            result[:, biases] += with_state
            result[biases, :] += with_state.T
            result[biases, biases] += own
        result[VELOCITY.start : POSITION.stop, VELOCITY.start : POSITION.stop] += (
            self._second_order.mean_square()
        )
        return result

    def pose(self) -> Array:
        """Return the (6, 6) covariance of a message's pose.

        The order is that of geometry_msgs/PoseWithCovariance: x, y, z, and the rotations about the
        fixed axes X, Y, Z; all in the frame of the header, the world.
        """
        result: Array = self.mean_square()[np.ix_(_POSE, _POSE)]
        return result

    def twist(self, r_wb: Array, velocity: ArrayLike, rate_hz: float) -> Array:
        """Return the (6, 6) covariance of a message's twist: linear, then angular, in the body.

        :param r_wb: (3, 3) attitude.
        :param velocity: (3,) of the body in the world [m/s].
        :param rate_hz: readings per second; it decides the white noise of one of them.
        """
        jacobian = np.zeros((6, SIZE))
        # v_b = R^T v: turning the attitude turns the velocity the other way.
        jacobian[:3, ATTITUDE] = r_wb.T @ rotation.skew(velocity)
        jacobian[:3, VELOCITY] = r_wb.T
        jacobian[3:, GYRO_BIAS] = -np.eye(3)
        result: Array = jacobian @ self.mean_square() @ jacobian.T
        result[3:, 3:] += np.diag(self._gyro_white * rate_hz + self._gyro_rounding)
        return result


def propagate(
    states: NavigationStates,
    accel: Array,
    noise: Noise,
    initial: Array | Covariance | None = None,
    at: Sequence[int] = (-1,),
) -> Array:
    """Return the covariance of a dead-reckoned record at some of its rows.

    :param states: what :func:`~imu_sim_ros.navigation.dead_reckon` returned, n rows.
    :param accel: (n, 3) corrected specific forces [m/s^2].
    :param noise: the IMU's errors.
    :param initial: (15, 15) covariance at the first row, or one such as
        :func:`~imu_sim_ros.navigation.covariance.after_rest` gives; None is no error.
    :param at: the m rows that are wanted, increasing; -1 is the last.
    :returns: (m, 15, 15) mean squares of the error, the second order of a tilt included.
    """
    covariance = initial if isinstance(initial, Covariance) else Covariance(noise, initial)
    steps = (np.diff(states.t_ns) * 1e-9).tolist()
    turns = rotation.log(rotation.multiply(rotation.conjugate(states.q_wb[:-1]), states.q_wb[1:]))
    rates = turns / np.reshape(steps, (-1, 1))
    matrices = rotation.to_matrix(states.q_wb)
    wanted = [row % len(states.t_ns) for row in at]
    result = np.empty((len(wanted), SIZE, SIZE))
    for k in range(wanted[-1] + 1):
        for place in (place for place, row in enumerate(wanted) if row == k):
            result[place] = covariance.mean_square()
        if k < len(steps):
            covariance.step(steps[k], matrices[k], accel[k], rates[k])
    return result
