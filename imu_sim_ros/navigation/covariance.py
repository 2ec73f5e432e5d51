# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""The covariance of a dead-reckoned state, propagated from the noise of the IMU.

The error state has 15 numbers, here truth less estimate (no covariance depends on the sign), in
this order: attitude (3, a rotation vector about the **world's** axes, ``R_true = Exp(dtheta) R``),
velocity and position (3 each, in the world), bias of the gyroscope and of the accelerometer (3
each, in the body). With
``f`` the specific force that is integrated and ``n`` the white noise, the errors grow as

    dtheta' = -R (db_g + n_g)
    dv'     = dtheta x (R f) - R (db_a + n_a)
    dp'     = dv
    db_g'   = n_bg,  db_a' = n_ba

(Groves, "Principles of GNSS, inertial, and multisensor integrated navigation systems", 2nd edition,
section 14.2, for a world that does not turn), integrated to first order over each step. The white
noise of a reading counts once, for one step: midpoint's halves of it in two neighbouring steps add
up to the same; rounding to steps of LSB is white noise of ``LSB^2 / 12`` per reading (Widrow 1956).
The second order of the first three is in :mod:`imu_sim_ros.navigation.covariance_terms`, 1/f
noise, Gauss-Markov biases and unknown scales are there, too, as :class:`SlowErrors`.

Not in it: temperature, range, bandwidth and losses, and what steps of the integration leave out.
"""

import math
import struct
from collections.abc import Sequence
from typing import Final

import numpy as np
from numpy.typing import ArrayLike

from imu_sim_ros.core import rotation
from imu_sim_ros.core.components import Matrix, Vector, float_matrix, float_vector
from imu_sim_ros.core.records import States
from imu_sim_ros.core.types import Array
from imu_sim_ros.navigation.covariance_terms import SecondOrder, SlowErrors
from imu_sim_ros.navigation.mount import ALIGNED, ImuMount
from imu_sim_ros.parameters.kinds import ZERO_VECTOR
from imu_sim_ros.sensors.imu.triads import TriadsParameters

SIZE: Final = 15
ATTITUDE, VELOCITY, POSITION = slice(0, 3), slice(3, 6), slice(6, 9)
GYRO_BIAS, ACCEL_BIAS = slice(9, 12), slice(12, 15)

_POSE = np.r_[POSITION, ATTITUDE]
_POSE_ENTRIES: Final = np.ravel_multi_index(np.ix_(_POSE, _POSE), (SIZE, SIZE))


def _row_format(*filled: tuple[int, int]) -> str:
    """Return how a row of a (15, 15) matrix is packed, zero but for runs (column, length)."""
    codes, offset = [], 0
    for column, length in filled:
        codes.append(f"{8 * (column - offset)}x{length}d")
        offset = column + length
    return "".join([*codes, f"{8 * (SIZE - offset)}x"])


_ROWS: Final = struct.Struct(
    "".join(
        [
            "=",
            *(_row_format((axis, 1), (9, 3)) for axis in range(3)),
            *(_row_format((0, 3), (3 + axis, 1), (12, 3)) for axis in range(3)),
            *(_row_format((0, 3), (3 + axis, 1), (6 + axis, 1), (12, 3)) for axis in range(3)),
        ]
    )
)
"""The rows of attitude, velocity and position of a transition; those of the biases are constant."""
_ANGULAR: Final = ([3, 4, 5], [3, 4, 5])
"""The angular half of a twist's diagonal."""
_JACOBIAN: Final = struct.Struct(
    "=" + 3 * _row_format((0, 6)) + "".join(_row_format((9 + axis, 1)) for axis in range(3))
)
"""The (6, 15) derivative of the twist's error by the state's."""
_SECOND_ORDER_INTERVAL: Final = 0.1
"""Interval of updates of the second-order terms, which grow slowly [s]."""


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
        self, noise: TriadsParameters, initial: Array | None = None, cross: Array | None = None
    ) -> None:
        """Start with the covariance of the initial state's error (15, 15); None is no error.

        :param noise: the IMU's errors.
        :param cross: (15, m) its covariance with the slow errors; None: there is none.
        """
        self.matrix = np.zeros((SIZE, SIZE)) if initial is None else np.array(initial)
        """(15, 15), to first order."""
        self._triads = triads = (noise.gyroscope, noise.accelerometer)
        self._walk = np.square(np.concatenate([triad.random_walk for triad in triads]))
        # White noise of equal axes turns with the body and stays what it is: R w I R^T = w I.
        white = [white for triad in triads for white in (triad.noise_density, triad.resolution)]
        self._equal_axes = all(size == sizes[0] for sizes in white for size in sizes)
        self._gyro_white, self._accel_white = np.zeros(3), np.zeros(3)
        """(3,) variance of a reading, of white noise and rounding."""
        self._added_h, self._added = 0.0, np.zeros((SIZE, SIZE))
        self._transition, self._half = np.eye(SIZE), np.empty((SIZE, SIZE))
        self._by_bias, self._jacobian = np.zeros((SIZE, SIZE)), np.empty((6, SIZE))
        self._white_rate, self._white = -1.0, np.zeros((6, 6))
        self.slow = SlowErrors(noise, SIZE)
        if cross is not None:
            self.slow.cross = np.array(cross)
        self._second_order = SecondOrder(3 + len(self.slow.of_rate))
        self._begin_interval(self._attitude_and_rates())

    @property
    def is_finite(self) -> bool:
        """True if the covariance is valid; no entry is larger than those of the diagonal allow."""
        return math.isfinite(self.matrix.trace())

    def _begin_interval(self, start: Array) -> None:
        """Begin to collect the terms of the second order.

        :param start: :meth:`_attitude_and_rates` of now.
        """
        self._start = start
        self._length = 0.0
        self._passed = np.zeros((SIZE, SIZE))
        """The sum of the steps' transitions."""
        self._passed_slow = np.zeros((3, self.slow.count))
        """(3, m) attitude errors from slow errors of unit size."""

    def _attitude_and_rates(self) -> Array:
        """Return the (n, n) covariance of the attitude with all errors of the gyroscope."""
        p, cross = self.matrix, self.slow.cross.take(self.slow.of_rate, axis=1)
        covariance = np.eye(6 + cross.shape[1])
        covariance[:3, :3], covariance[:3, 3:6] = p[ATTITUDE, ATTITUDE], p[ATTITUDE, GYRO_BIAS]
        covariance[3:6, :3], covariance[3:6, 3:6] = (
            p[ATTITUDE, GYRO_BIAS].T,
            p[GYRO_BIAS, GYRO_BIAS],
        )
        covariance[:3, 6:], covariance[3:6, 6:] = cross[ATTITUDE], cross[GYRO_BIAS]
        covariance[6:, :6] = covariance[:6, 6:].T
        return covariance

    def step(
        self, h: float, r_wb: ArrayLike, force_b: ArrayLike, rate_b: ArrayLike = ZERO_VECTOR
    ) -> None:
        """Propagate over an interval.

        :param h: length of the interval [s].
        :param r_wb: (3, 3) attitude in the interval, its start's or its middle's.
        :param force_b: (3,) corrected specific force in the interval, in the body [m/s^2].
        :param rate_b: (3,) corrected rate in the interval [rad/s]; an unknown scale acts on it.
        """
        self.advance(h, float_matrix(r_wb), float_vector(force_b), float_vector(rate_b))

    def advance(
        self, h: float, r_wb: Matrix[float], force_b: Vector[float], rate_b: Vector[float]
    ) -> None:
        """Propagate as :meth:`step` does, over components."""
        transition, p = self._transition, self.matrix
        _ROWS.pack_into(transition.data, 0, *_rows(h, r_wb, force_b))
        # F P F^T in the array of P; half the call of the operator @
        transition.dot(p, self._half).dot(transition.T, p)
        if h != self._added_h:
            self._gyro_white, self._accel_white = (t.white_variance(1.0 / h) for t in self._triads)
            self._added_h, self._added = h, np.diag(self._diagonal(h))
        p += self._added
        if not self._equal_axes:
            self._add_white(p, transition[ATTITUDE, GYRO_BIAS])
        if self.slow:
            self._by_bias[:9, 9:] = transition[:9, 9:]
            half = self.slow.step(h, transition, self._by_bias, rate_b, force_b)
            p += half
            p += half.T
            self._passed_slow += self.slow.gain[ATTITUDE]
        self._length += h
        self._passed += transition
        if self._length >= _SECOND_ORDER_INTERVAL:
            self._update_second_order()

    def _diagonal(self, h: float) -> Array:
        """Return the addition of a step to the diagonal: walks, and white noise of equal axes."""
        variances = np.zeros(SIZE)
        variances[GYRO_BIAS.start :] = self._walk * h
        if self._equal_axes:
            variances[ATTITUDE] = self._gyro_white * (h * h)
            variances[VELOCITY] = self._accel_white * (h * h)
        return variances

    def gyro_white(self, rate_hz: float) -> Array:
        """Return the variance (3,) of white noise and rounding of a gyroscope's reading."""
        return self._triads[0].white_variance(rate_hz)

    def _add_white(self, p: Array, turned: Array) -> None:
        """Add (R h) diag(density^2 / h) (R h)^T: white noise of one sample of length h."""
        p[ATTITUDE, ATTITUDE] += (turned * self._gyro_white) @ turned.T
        p[VELOCITY, VELOCITY] += (turned * self._accel_white) @ turned.T

    def _update_second_order(self) -> None:
        slow, rates = self.slow, self.slow.of_rate
        turned, tilt = self._passed[ATTITUDE, GYRO_BIAS], self._passed[VELOCITY, ATTITUDE]
        # The velocity's entries of a tilt are 0 z -y, -z 0 x, y -x 0.
        acceleration = tilt[[1, 2, 0], [2, 0, 1]] / self._length
        by_slow = self._passed_slow * slow.over(self._length)[1]
        by_rates = np.concatenate([turned, by_slow.take(rates, axis=1)], axis=1)
        decay = np.concatenate([np.ones(3), slow.decay(self._length).take(rates)])
        end = self._attitude_and_rates()
        self._second_order.step(self._length, acceleration, self._start, end, by_rates, decay)
        self._begin_interval(end)

    @property
    def largest_attitude_sigma(self) -> float:
        """The largest standard deviation of the attitude so far, along its worst axis [rad].

        Above 0.5 rad the orders that are left out matter: what is stated is too small or too large.
        """
        return self._second_order.largest_sigma

    def mean_square(self) -> Array:
        """Return the (15, 15) mean square of the error, the second order included.

        The biases are here all that the latest reading is off by, white noise apart.
        """
        covariance: Array = self.matrix.copy()
        covariance[:9, :9] += self._second_order.mean_square
        if self.slow:
            half = self.slow.bias()
            covariance += half
            covariance += half.T
        return covariance

    def pose(self) -> Array:
        """Return the (6, 6) covariance of a message's pose.

        The order is that of geometry_msgs/PoseWithCovariance: x, y, z, and the rotations about the
        fixed axes X, Y, Z; all in the frame of the header, the world.
        """
        return self.mean_square().take(_POSE_ENTRIES)

    def twist(self, r_wb: ArrayLike, velocity: ArrayLike, rate_hz: float) -> Array:
        """Return the (6, 6) covariance of a message's twist: linear, then angular, in the body.

        :param r_wb: (3, 3) attitude.
        :param velocity: (3,) of the body in the world [m/s].
        :param rate_hz: readings per second; it decides the white noise of one of them.
        """
        attitude, moving = float_matrix(r_wb), float_vector(velocity)
        return self._twist(self.mean_square(), attitude, moving, rate_hz)

    def message(
        self, r_wb: Matrix[float], velocity: Vector[float], rate_hz: float
    ) -> tuple[Array, Array]:
        """Return :meth:`pose` and :meth:`twist`, in less time than one after the other.

        :param r_wb, velocity: components of what :meth:`twist` takes.
        """
        mean_square = self.mean_square()
        pose: Array = mean_square.take(_POSE_ENTRIES)
        return pose, self._twist(mean_square, r_wb, velocity, rate_hz)

    def _twist(
        self,
        mean_square: Array,
        r_wb: Matrix[float],
        velocity: Vector[float],
        rate_hz: float,
    ) -> Array:
        # v_b = R^T v: turning the attitude turns the velocity the other way: each row of
        # R^T [v]x is a column of R times v.
        a, b, c, d, e, g, i, j, k = r_wb
        x, y, z = velocity
        jacobian = self._jacobian
        _JACOBIAN.pack_into(
            jacobian.data, 0,
            d * z - i * y, i * x - a * z, a * y - d * x, a, d, i,
            e * z - j * y, j * x - b * z, b * y - e * x, b, e, j,
            g * z - k * y, k * x - c * z, c * y - g * x, c, g, k,
            -1.0, -1.0, -1.0,
        )  # fmt: skip
        covariance: Array = jacobian.dot(mean_square).dot(jacobian.T)
        if rate_hz != self._white_rate:
            self._white_rate = rate_hz
            self._white[_ANGULAR] = self.gyro_white(rate_hz)
        covariance += self._white
        return covariance


def _rows(h: float, r_wb: Matrix[float], force_b: Vector[float]) -> tuple[float, ...]:
    """Return what `_ROWS` packs: the rows of a transition that depend on the step."""
    a, b, c, d, e, g, i, j, k = r_wb
    fx, fy, fz = force_b
    fx, fy, fz = fx * h, fy * h, fz * h
    # The velocity that the step gains, in the world; a tilt turns it by its cross product.
    x, y, z = a * fx + b * fy + c * fz, d * fx + e * fy + g * fz, i * fx + j * fy + k * fz
    # -R h, which a bias passes through, and for the position half of all times h
    a, b, c = -h * a, -h * b, -h * c
    d, e, g = -h * d, -h * e, -h * g
    i, j, k = -h * i, -h * j, -h * k
    s = 0.5 * h
    sx, sy, sz = s * x, s * y, s * z
    return (
        1.0, a, b, c,
        1.0, d, e, g,
        1.0, i, j, k,
        0.0, z, -y, 1.0, a, b, c,
        -z, 0.0, x, 1.0, d, e, g,
        y, -x, 0.0, 1.0, i, j, k,
        0.0, sz, -sy, h, 1.0, s * a, s * b, s * c,
        -sz, 0.0, sx, h, 1.0, s * d, s * e, s * g,
        sy, -sx, 0.0, h, 1.0, s * i, s * j, s * k,
    )  # fmt: skip


def propagate(
    states: States,
    accel: Array,
    noise: TriadsParameters,
    initial: Array | Covariance | None = None,
    row_numbers: Sequence[int] = (-1,),
    mount: ImuMount = ALIGNED,
) -> Array:
    """Return the covariance of a dead-reckoned record at some of its rows.

    :param states: result of :func:`~imu_sim_ros.navigation.dead_reckoning.dead_reckon`, n rows.
    :param accel: (n, 3) corrected specific forces [m/s^2].
    :param noise: the IMU's errors.
    :param initial: (15, 15) covariance at the first row, or one such as
        :func:`~imu_sim_ros.navigation.initialisation.after_rest` gives; None is no error.
    :param row_numbers: the m rows to return, increasing; -1 is the last.
    :param mount: mount of the IMU in the body, whose states are given and whose covariance is
        returned, the biases in the IMU's axes; ``initial`` is that of the IMU's state.
    :returns: (m, 15, 15) mean squares of the error, the second order included.
    """
    covariance = initial if isinstance(initial, Covariance) else Covariance(noise, initial)
    steps = (np.diff(states.t_ns) * 1e-9).tolist()
    q_wi = states.q_wb if mount == ALIGNED else rotation.multiply(states.q_wb, mount.q_bi)
    turns = rotation.log(rotation.multiply(rotation.conjugate(q_wi[:-1]), q_wi[1:]))
    rates = turns / np.reshape(steps, (-1, 1))
    matrices = rotation.to_matrix(q_wi)
    rows = [row % len(states.t_ns) for row in row_numbers]
    covariances, count = np.empty((len(rows), SIZE, SIZE)), 0
    for k in range(rows[-1] + 1):
        while count < len(rows) and rows[count] == k:
            covariances[count] = covariance.mean_square()
            if any(mount.lever_arm):
                last_step = min(k, len(steps) - 1)
                conversion = (
                    matrices[k],
                    rates[last_step],
                    covariance.gyro_white(1.0 / steps[last_step]),
                )
                covariances[count] = mount.state_covariance(covariances[count], *conversion)
            count += 1
        if k < rows[-1]:
            r_wi, force, rate = (
                float_matrix(matrices[k]),
                float_vector(accel[k]),
                float_vector(rates[k]),
            )
            covariance.step(steps[k], r_wi, force, rate)
    return covariances
