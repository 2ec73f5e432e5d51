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
from imu_sim_ros.navigation.covariance.second_order import SecondOrder, regression
from imu_sim_ros.navigation.covariance.slow_errors import SlowErrors
from imu_sim_ros.navigation.noise import ImuErrors
from imu_sim_ros.navigation.state import NavigationStates

Array = NDArray[np.float64]

SIZE: Final = 15
ATTITUDE, VELOCITY, POSITION = slice(0, 3), slice(3, 6), slice(6, 9)
GYRO_BIAS, ACCEL_BIAS = slice(9, 12), slice(12, 15)

_POSE = np.r_[POSITION, ATTITUDE]
_POSE_ENTRIES: Final = np.ravel_multi_index(np.ix_(_POSE, _POSE), (SIZE, SIZE))


def _places(rows: slice, columns: slice) -> NDArray[np.intp]:
    """Return the nine places of a block of a flat (15, 15) matrix."""
    return np.arange(SIZE * SIZE, dtype=np.intp).reshape(SIZE, SIZE)[rows, columns].ravel()


_ACROSS: Final = [1, 2, 3, 5, 6, 7]
"""Places off the diagonal of a (3, 3) block: a tilt has no others."""
_TRANSITION_ENTRIES: Final = np.concatenate(
    [
        _places(ATTITUDE, GYRO_BIAS),
        _places(VELOCITY, ACCEL_BIAS),
        _places(POSITION, ACCEL_BIAS),
        _places(VELOCITY, ATTITUDE)[_ACROSS],
        _places(POSITION, ATTITUDE)[_ACROSS],
        _places(POSITION, VELOCITY)[[0, 4, 8]],
    ]
)
"""(42,) places of a flat transition that a step changes, in the order of `_transition_values`."""
_BIAS_ENTRIES: Final = 27
"""The first of them are what a bias does."""
_UNCHANGED: Final = np.eye(3)
_SECOND_ORDER_INTERVAL: Final = 0.1
"""[s] at which the second order is brought up to date; it grows slowly and costs 50 us."""


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
        self, noise: ImuErrors, initial: Array | None = None, cross: Array | None = None
    ) -> None:
        """Start with the covariance of the initial state's error (15, 15); None is no error.

        :param cross: (15, m) its covariance with the slow errors; None: there is none.
        """
        self.matrix = np.zeros((SIZE, SIZE)) if initial is None else np.array(initial)
        """(15, 15), to first order."""
        self._gyro_white = np.square(noise.gyroscope.noise_density)
        self._accel_white = np.square(noise.accelerometer.noise_density)
        walks = (noise.gyroscope.random_walk, noise.accelerometer.random_walk)
        self._walk = np.square(np.concatenate(walks))
        self._gyro_rounding = np.square(noise.gyroscope.resolution) / 12.0
        self._accel_rounding = np.square(noise.accelerometer.resolution) / 12.0
        # White noise of equal axes turns with the body and stays what it is: R w I R^T = w I.
        self._equal_axes = all(
            np.all(white == white[0])
            for white in (
                *(self._gyro_white, self._gyro_rounding),
                *(self._accel_white, self._accel_rounding),
            )
        )
        self._added_h, self._added = 0.0, np.zeros((SIZE, SIZE))
        self._transition = np.eye(SIZE)
        # views
        self._entries, self._transposed = self._transition.ravel(), self._transition.T
        self._turned = self._transition[ATTITUDE, GYRO_BIAS]
        self._by_bias = np.zeros((SIZE, SIZE))
        self._bias_entries = self._by_bias.ravel()
        self._jacobian = np.zeros((6, SIZE))
        self._jacobian[3:, GYRO_BIAS] = -np.eye(3)
        self.slow = SlowErrors(noise, SIZE)
        if cross is not None:
            self.slow.cross = np.array(cross)
        self._second_order = SecondOrder(SIZE)
        self._begin_interval()

    def _begin_interval(self) -> None:
        """Begin to collect what the second order needs."""
        self._before = self.matrix[ATTITUDE, ATTITUDE]
        """(3, 3) covariance of the attitude's error"""
        self._gyro_before = self.matrix[GYRO_BIAS, ATTITUDE]
        """(3, 3) covariance of the gyroscope's bias and slow errors with the attitude's error"""
        if self.slow:
            self._gyro_before = self._gyro_before + self.slow.bias()[ATTITUDE, GYRO_BIAS].T
        self._length = 0.0
        self._passed = np.zeros(len(_TRANSITION_ENTRIES))
        """The sum of the entries of the steps' transitions."""

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
        values = np.array(_transition_values(h, r_wb.tolist(), force_b))
        self._entries[_TRANSITION_ENTRIES] = values
        # half the call of the operator @
        p: Array = self._transition.dot(self.matrix).dot(self._transposed)
        if h != self._added_h:
            self._added_h, self._added = h, np.diag(self._diagonal(h))
        p += self._added
        if not self._equal_axes:
            self._add_white(p, h, self._turned)
        if self.slow:
            self._bias_entries[_TRANSITION_ENTRIES[:_BIAS_ENTRIES]] = values[:_BIAS_ENTRIES]
            half = self.slow.step(h, self._transition, self._by_bias, rate_b, force_b)
            p += half
            p += half.T
        self.matrix = p
        self._length += h
        self._passed += values
        if self._length >= _SECOND_ORDER_INTERVAL:
            self._update_second_order()

    def _diagonal(self, h: float) -> Array:
        """Return what a step adds to the diagonal: the walks, and white noise of equal axes."""
        result = np.zeros(SIZE)
        result[GYRO_BIAS.start :] = self._walk * h
        if self._equal_axes:
            result[ATTITUDE] = self._gyro_white * h + self._gyro_rounding * (h * h)
            result[VELOCITY] = self._accel_white * h + self._accel_rounding * (h * h)
        return result

    def _add_white(self, p: Array, h: float, turned: Array) -> None:
        """Add (R h) diag(density^2 / h) (R h)^T: white noise of one sample of length h."""
        white = self._gyro_white / h + self._gyro_rounding
        p[ATTITUDE, ATTITUDE] += (turned * white) @ turned.T
        white = self._accel_white / h + self._accel_rounding
        p[VELOCITY, VELOCITY] += (turned * white) @ turned.T

    def _update_second_order(self) -> None:
        before = self._before
        turned = self._passed[:9].reshape(3, 3)
        # The velocity's entries of a tilt are 0 z -y, -z 0 x, y -x 0.
        acceleration = self._passed[[30, 31, 27]] / self._length
        # The error of the attitude at the end, as far as that at the start predicts it.
        by_bias = turned @ self._gyro_before
        kept = _UNCHANGED + regression(by_bias, before)
        after = self.matrix[ATTITUDE, ATTITUDE]
        self._second_order.step(self._length, acceleration, before, after, kept)
        self._begin_interval()

    def mean_square(self) -> Array:
        """Return the (15, 15) mean square of the error, with the second order of a tilt.

        The biases are here all that the latest reading is off by, white noise apart.
        """
        result = self.matrix + self._second_order.mean_square()
        if self.slow:
            half = self.slow.bias()
            result += half
            result += half.T
        return result

    def pose(self) -> Array:
        """Return the (6, 6) covariance of a message's pose.

        The order is that of geometry_msgs/PoseWithCovariance: x, y, z, and the rotations about the
        fixed axes X, Y, Z; all in the frame of the header, the world.
        """
        result: Array = self.mean_square().take(_POSE_ENTRIES)
        return result

    def twist(self, r_wb: Array, velocity: Array | Sequence[float], rate_hz: float) -> Array:
        """Return the (6, 6) covariance of a message's twist: linear, then angular, in the body.

        :param r_wb: (3, 3) attitude.
        :param velocity: (3,) of the body in the world [m/s].
        :param rate_hz: readings per second; it decides the white noise of one of them.
        """
        return self._twist(self.mean_square(), r_wb, velocity, rate_hz)

    def message(
        self, r_wb: Array, velocity: Array | Sequence[float], rate_hz: float
    ) -> tuple[Array, Array]:
        """Return :meth:`pose` and :meth:`twist`, in less time than one after the other."""
        mean_square = self.mean_square()
        pose: Array = mean_square.take(_POSE_ENTRIES)
        return pose, self._twist(mean_square, r_wb, velocity, rate_hz)

    def _twist(
        self, mean_square: Array, r_wb: Array, velocity: Array | Sequence[float], rate_hz: float
    ) -> Array:
        # v_b = R^T v: turning the attitude turns the velocity the other way. R^T [v]x = [v_b]x R^T
        jacobian, r_bw = self._jacobian, r_wb.T
        vx, vy, vz = velocity
        cross = np.array([0.0, -vz, vy, vz, 0.0, -vx, -vy, vx, 0.0])
        jacobian[:3, :3] = r_bw.dot(cross.reshape(3, 3))
        jacobian[:3, 3:6] = r_bw
        result: Array = jacobian.dot(mean_square).dot(jacobian.T)
        result.ravel()[21::7] += self._gyro_white * rate_hz + self._gyro_rounding
        return result


def _transition_values(
    h: float, r_wb: list[list[float]], force_b: Array | Sequence[float]
) -> list[float]:
    """Return the entries of a transition that depend on the step, see `_TRANSITION_ENTRIES`."""
    (a, b, c), (d, e, g), (i, j, k) = r_wb
    fx, fy, fz = force_b.tolist() if isinstance(force_b, np.ndarray) else force_b
    fx, fy, fz = fx * h, fy * h, fz * h
    # The velocity that the step gains, in the world; a tilt turns it by its cross product.
    x, y, z = a * fx + b * fy + c * fz, d * fx + e * fy + g * fz, i * fx + j * fy + k * fz
    turned = [-h * a, -h * b, -h * c, -h * d, -h * e, -h * g, -h * i, -h * j, -h * k]
    half = 0.5 * h
    tilt = [z, -y, -z, x, y, -x]
    return [
        *turned,
        *turned,
        *(half * entry for entry in turned),
        *tilt,
        *(half * entry for entry in tilt),
        h,
        h,
        h,
    ]


def propagate(
    states: NavigationStates,
    accel: Array,
    noise: ImuErrors,
    initial: Array | Covariance | None = None,
    at: Sequence[int] = (-1,),
) -> Array:
    """Return the covariance of a dead-reckoned record at some of its rows.

    :param states: what :func:`~imu_sim_ros.navigation.dead_reckon` returned, n rows.
    :param accel: (n, 3) corrected specific forces [m/s^2].
    :param noise: the IMU's errors.
    :param initial: (15, 15) covariance at the first row, or one such as
        :func:`~imu_sim_ros.navigation.covariance.after_rest` gives; None is no error.
    :param at: the m rows to return, increasing; -1 is the last.
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
