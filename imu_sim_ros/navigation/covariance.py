# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""The covariance of a dead-reckoned state, propagated from the noise of the IMU.

The error state has 15 numbers, here truth less estimate (no covariance depends on the sign), in
this order: attitude (3, a rotation vector about the **world's** axes, ``R_true = Exp(dtheta) R``),
velocity and position (3 each, in the world), bias of the gyroscope and of the accelerometer (3
each, in the body). With ``f`` the specific force that is integrated and ``n`` the white noise, the
errors grow as

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

import struct
from collections.abc import Sequence
from functools import lru_cache
from typing import Final

import numpy as np
from numpy.typing import ArrayLike

from imu_sim_ros.core import rotation
from imu_sim_ros.core.components import Matrix, Vector, float_matrix, float_vector
from imu_sim_ros.core.records import States
from imu_sim_ros.core.types import Array, Integers
from imu_sim_ros.navigation.covariance_terms import SecondOrder, SlowErrors
from imu_sim_ros.navigation.mount import ALIGNED, ImuMount
from imu_sim_ros.parameters.kinds import ZERO_VECTOR
from imu_sim_ros.sensors.imu.triads import TriadsParameters, WhiteTerms

SIZE: Final = 15
"""Number of error states."""
ATTITUDE, VELOCITY, POSITION = slice(0, 3), slice(3, 6), slice(6, 9)
GYRO_BIAS, ACCEL_BIAS = slice(9, 12), slice(12, 15)

_POSE: Final = np.eye(SIZE)[np.r_[POSITION, ATTITUDE]]
"""(6, 15) derivative of the pose's error by the state's."""


def _row_format(size: int, *filled: tuple[int, int]) -> str:
    """Return the format (of ``struct``) of a row of doubles that is zero outside some runs.

    Packing takes the entries of the runs, and writes zeros elsewhere.

    :param size: length of the row.
    :param filled: first column and length of each run.
    """
    codes, offset = [], 0
    for column, length in filled:
        codes.append(f"{8 * (column - offset)}x{length}d")
        offset = column + length
    return "".join([*codes, f"{8 * (size - offset)}x"])


@lru_cache(maxsize=16)
def _transition_layout(size: int) -> struct.Struct:
    """Return the layout of the entries of a step's transition matrix that are not always zero.

    They are in the rows of attitude, velocity and position; the rows of the biases are constant.

    :param size: width of the matrix: the error states, then the slow errors.
    """
    axes = range(3)
    theta, gyro_bias, accel_bias = (
        (states.start, 3) for states in (ATTITUDE, GYRO_BIAS, ACCEL_BIAS)
    )
    attitude, velocity, position = [], [], []
    for axis in axes:
        v, p = (VELOCITY.start + axis, 1), (POSITION.start + axis, 1)
        attitude.append(_row_format(size, (ATTITUDE.start + axis, 1), gyro_bias))
        velocity.append(_row_format(size, theta, v, accel_bias))
        position.append(_row_format(size, theta, v, p, accel_bias))
    return struct.Struct("".join(["=", *attitude, *velocity, *position]))


_TWIST_ROWS: Final = struct.Struct(
    "="
    + 3 * _row_format(SIZE, (0, 6))
    + "".join(_row_format(SIZE, (9 + axis, 1)) for axis in range(3))
)
"""Layout of the (6, 15) derivative of the twist's error by the state's."""
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


class _WhiteNoise:
    """White noise, rounding and walks of the biases: additions of a step to the covariance."""

    def __init__(self, noise: TriadsParameters) -> None:
        """Initialise with the IMU's errors."""
        triads = (noise.gyroscope, noise.accelerometer)
        self.gyro = noise.gyroscope.white_terms()
        self._linear, self._squared = np.zeros(SIZE), np.zeros(SIZE)
        """(15,) additions to the diagonal by the length of a step and by its square."""
        walks = [triad.random_walk for triad in triads]
        self._linear[GYRO_BIAS.start :] = np.square(np.concatenate(walks))
        self._turned: list[tuple[WhiteTerms, int]] = []
        """Noise of triads with unequal axes, and the row of the error that it adds to."""
        for triad, rows in zip(triads, (ATTITUDE, VELOCITY), strict=True):
            terms = triad.white_terms()
            sizes = (triad.noise_density, triad.resolution)
            if all(size == axes[0] for axes in sizes for size in axes):
                # That of equal axes turns with the body and stays as it is: R w I R^T = w I.
                self._linear[rows], self._squared[rows] = terms
            else:
                self._turned.append((terms, rows.start))
        self._h, self._on_diagonal = 0.0, np.zeros(SIZE)
        """Length of the latest step [s], and its additions (15,) to the diagonal."""
        self._variances = [np.zeros(3) for _ in self._turned]
        """Variances (3,) of a reading by the noise of each triad with unequal axes."""

    def add_to(self, p: Array, diagonal: Array, h: float, by_bias: Array) -> None:
        """Add the noise of a reading of length h [s] to a covariance.

        :param p: (15, 15) covariance, changed in place.
        :param diagonal: (15,) view of its diagonal.
        :param by_bias: (9, 6) derivatives of the errors by those of the reading.
        """
        if h != self._h:
            self._h = h
            self._on_diagonal = self._linear * h + self._squared * (h * h)
            self._variances = [terms.variance(1.0 / h) for terms, _ in self._turned]
        diagonal += self._on_diagonal
        for (_, row), variance in zip(self._turned, self._variances, strict=True):
            turned = by_bias[:3, :3]
            p[row : row + 3, row : row + 3] += (turned * variance).dot(turned.T)


class _Transition:
    """The transition [F G H] of a step (15, 15 + m): from the errors, and from m slow errors.

    All attributes are views of one matrix, so that :meth:`set` changes them together.
    """

    def __init__(self, width: int) -> None:
        """Start with the identity, and without effect of the slow errors.

        :param width: 15 + m, the number of columns.
        """
        matrix = np.eye(SIZE, width)
        self._layout, self._memory = _transition_layout(width), matrix.data
        self.from_errors = matrix[:, :SIZE]
        """(15, 15) F, from the errors to the errors."""
        self.from_bias = matrix[:9, GYRO_BIAS.start : SIZE]
        """(9, 6) G, from the biases to attitude, velocity and position."""
        self.from_slow = matrix[:9, SIZE:]
        """(9, m) G H, from the slow errors to attitude, velocity and position."""
        self.transposed = matrix.T
        """(15 + m, 15) the whole matrix, transposed."""
        self.of_attitude_and_velocity = matrix[:6]
        """(6, 15 + m) rows of attitude and velocity."""

    def set(self, h: float, r_wb: Matrix[float], force_b: Vector[float]) -> None:
        """Set F; G H becomes zero. The rows of the biases are constant.

        :param h: length of the step [s].
        :param r_wb: attitude in the step, row by row.
        :param force_b: specific force in the step, in the body [m/s^2].
        """
        self._layout.pack_into(self._memory, 0, *_transition_entries(h, r_wb, force_b))


class _JointProduct:
    """Memory of the product F [P C] (15, 15 + m) of a step, and views of its parts."""

    def __init__(self, width: int) -> None:
        """Reserve the memory.

        :param width: 15 + m, the number of columns.
        """
        self.matrix = np.empty((SIZE, width))
        """(15, 15 + m) F [P C]."""
        self.errors = self.matrix[:, :SIZE]
        """(15, 15) F P."""
        self.slow = self.matrix[:, SIZE:]
        """(15, m) F C."""
        self.slow_of_motion = self.slow[:9]
        """(9, m) F C in the rows of attitude, velocity and position, which G H is added to."""


def _attitude_and_rate_places(rate_errors: Integers, width: int) -> Integers:
    """Return the places (6, n) in [P C], row by row, of covariances for the second order.

    They are those of attitude and gyroscope bias with these and the slow errors of the rate.

    :param rate_errors: (n - 6,) indices of the gyroscope's errors among the slow errors.
    :param width: 15 + m, the number of columns of [P C].
    """
    errors = np.r_[ATTITUDE, GYRO_BIAS, SIZE + rate_errors]
    rows, columns = np.meshgrid(errors[:6], errors, indexing="ij")
    # P of a bias with the attitude is taken from above the diagonal.
    lower = (rows >= GYRO_BIAS.start) & (columns < ATTITUDE.stop)
    rows, columns = np.where(lower, columns, rows), np.where(lower, rows, columns)
    return np.asarray(rows * width + columns)


class Covariance:
    """The covariance of the error state, step by step."""

    def __init__(
        self, noise: TriadsParameters, initial: Array | None = None, cross: Array | None = None
    ) -> None:
        """Start with the covariance of the initial state's error (15, 15); None is no error.

        :param noise: the IMU's errors.
        :param cross: (15, m) covariance of that error with the slow errors; None: there is none.
        """
        self.slow = SlowErrors(noise, SIZE)
        width = SIZE + self.slow.count
        self._joint = np.zeros((SIZE, width))
        """[P C], the covariances of the error with itself and with the slow errors."""
        self.matrix = self._joint[:, :SIZE]
        """(15, 15) P, to first order."""
        self._diagonal = np.einsum("ii->i", self.matrix)
        self.slow.cross = self._joint[:, SIZE:]
        if initial is not None:
            self.matrix[:] = initial
        if cross is not None:
            self.slow.cross[:] = cross
        self._transition, self._product = _Transition(width), _JointProduct(width)
        self._half = np.empty((SIZE, SIZE))
        """Memory of half the propagated P, before its transpose is added."""
        self._white = _WhiteNoise(noise)
        self._jacobian = np.concatenate([_POSE, np.empty((6, SIZE))])
        """(12, 15) derivative of the errors of pose and twist by the state's."""
        self._twist_rate, self._twist_white = -1.0, np.zeros((6, 6))
        self._angular_white = np.einsum("ii->i", self._twist_white)[3:]
        rates = 3 + len(self.slow.of_rate)
        self._second_order = SecondOrder(rates)
        self._second = np.zeros((SIZE, SIZE))
        """(15, 15) mean square of the second order, zero for the biases."""
        self._by_rates = np.empty((3, rates))
        self._factors = (0.0, np.empty(0), np.empty(0))
        """An interval's length [s], and for the r slow errors of the rate over it: (r,) share of
        their mean, and (r,) share that remains at the end."""
        self._passed = np.empty((6, width))
        """The sum of the steps' transitions, its rows of attitude and velocity."""
        self._places = _attitude_and_rate_places(self.slow.of_rate, width)
        self._ends = [np.eye(3 + rates), np.eye(3 + rates)]
        """Two (n, n) covariances of the attitude and all errors of the gyroscope: at the start of
        the interval of second order, and at its end."""
        self._begin_interval(self._attitude_and_rates())

    def variances(self) -> list[float]:
        """Return the (15,) diagonal of P; the covariance is finite if these are."""
        return self._diagonal.tolist()

    def _begin_interval(self, start: Array) -> None:
        """Start the next interval of the second order.

        :param start: covariance at its start, as of :meth:`_attitude_and_rates`.
        """
        self._start = start
        self._length = 0.0
        self._passed.fill(0.0)

    def _attitude_and_rates(self) -> Array:
        """Return the (n, n) covariance of the attitude with all errors of the gyroscope.

        It is valid until the next call but one.
        """
        self._ends.reverse()
        covariance = self._ends[0]
        self._joint.take(self._places, out=covariance[:6], mode="clip")
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
        """Propagate as :meth:`step` does, over components.

        All products are written into memory that exists already: this runs once per reading.
        """
        transition, product = self._transition, self._product
        p, slow = self.matrix, self.slow
        transition.set(h, r_wb, force_b)
        joint = transition.from_errors.dot(self._joint, product.matrix)  # F [P C]
        if slow:
            # With G H the transition of the slow errors, whose covariance is I, P becomes
            # F P F^T + F C (G H)^T + G H (F C)^T + G H (G H)^T. That is B + B^T with
            # B = [F P / 2, F C + G H / 2] [F, G H]^T, and C becomes F C + G H, decayed.
            half_gain = slow.act(transition.from_bias, rate_b, force_b)
            np.add(half_gain, half_gain, transition.from_slow)
            product.errors *= 0.5
            product.slow_of_motion += half_gain
            half = joint.dot(transition.transposed, self._half)
            np.add(half, half.T, p)
            product.slow_of_motion += half_gain
            slow.decay_over(h, product.slow)
        else:
            joint.dot(transition.transposed, p)
        self._white.add_to(p, self._diagonal, h, transition.from_bias)
        self._length += h
        self._passed += transition.of_attitude_and_velocity
        if self._length >= _SECOND_ORDER_INTERVAL:
            self._update_second_order()

    def gyro_white(self, rate_hz: float) -> Array:
        """Return the variance (3,) of white noise and rounding of a gyroscope's reading."""
        return self._white.gyro.variance(rate_hz)

    def _update_second_order(self) -> None:
        """Propagate the second order over the steps since its latest update.

        Only sums over these steps are needed: how the attitude depends on the rate's errors, and
        the mean specific force, which the transition contains as the turn of the gained velocity.
        """
        slow, length, by_rates = self.slow, self._length, self._by_rates
        if length != self._factors[0]:
            remaining = np.concatenate([np.ones(3), slow.decay(length).take(slow.of_rate)])
            self._factors = (length, slow.over(length)[1].take(slow.of_rate), remaining)
        _, acting, remaining = self._factors
        by_rates[:, :3] = self._passed[ATTITUDE, GYRO_BIAS]
        by_slow = self._passed[ATTITUDE, SIZE:].take(slow.of_rate, axis=1)
        np.multiply(by_slow, acting, by_rates[:, 3:])
        # The velocity's derivatives by a tilt are ((0, z, -y), (-z, 0, x), (y, -x, 0)).
        tilt = self._passed[VELOCITY, ATTITUDE]
        x, y, z = tilt.item(1, 2) / length, tilt.item(2, 0) / length, tilt.item(0, 1) / length
        end = self._attitude_and_rates()
        self._second_order.step(length, (x, y, z), self._start, end, by_rates, remaining)
        self._second[:9, :9] = self._second_order.mean_square
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
        covariance: Array = self.matrix + self._second
        if self.slow:
            self.slow.add_bias(covariance)
        return covariance

    def pose(self) -> Array:
        """Return the (6, 6) covariance of a message's pose.

        The order is that of geometry_msgs/PoseWithCovariance: x, y, z, and the rotations about the
        fixed axes X, Y, Z; all in the frame of the header, the world.
        """
        pose: Array = _POSE.dot(self.mean_square()).dot(_POSE.T)
        return pose

    def twist(self, r_wb: ArrayLike, velocity: ArrayLike, rate_hz: float) -> Array:
        """Return the (6, 6) covariance of a message's twist: linear, then angular, in the body.

        :param r_wb: (3, 3) attitude.
        :param velocity: (3,) velocity of the body in the world [m/s].
        :param rate_hz: readings per second; it decides the white noise of one of them.
        """
        return self.message(float_matrix(r_wb), float_vector(velocity), rate_hz)[1]

    def message(
        self, r_wb: Matrix[float], velocity: Vector[float], rate_hz: float
    ) -> tuple[Array, Array]:
        """Return :meth:`pose` and :meth:`twist` from one computation.

        :param r_wb, velocity: components of what :meth:`twist` takes.
        """
        # v_b = R^T v: turning the attitude turns the velocity the other way: each row of
        # R^T [v]x is a column of R times v.
        a, b, c, d, e, g, i, j, k = r_wb
        x, y, z = velocity
        jacobian = self._jacobian
        _TWIST_ROWS.pack_into(
            jacobian.data, _POSE.nbytes,
            d * z - i * y, i * x - a * z, a * y - d * x, a, d, i,
            e * z - j * y, j * x - b * z, b * y - e * x, b, e, j,
            g * z - k * y, k * x - c * z, c * y - g * x, c, g, k,
            -1.0, -1.0, -1.0,
        )  # fmt: skip
        covariance: Array = jacobian.dot(self.mean_square()).dot(jacobian.T)
        if rate_hz != self._twist_rate:
            self._twist_rate = rate_hz
            self._angular_white[:] = self.gyro_white(rate_hz)
        twist = covariance[6:, 6:]
        twist += self._twist_white
        return covariance[:6, :6], twist


def _transition_entries(h: float, r_wb: Matrix[float], force_b: Vector[float]) -> tuple[float, ...]:
    """Return the entries of a transition that depend on the step, row by row.

    Their places are those of :func:`_transition_layout`. Arguments as for :meth:`_Transition.set`.
    """
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
    :param initial: (15, 15) covariance at the first row, or that of
        :func:`~imu_sim_ros.navigation.initialisation.covariance_after_rest`; None is no error.
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
    turn_rates: list[Vector[float]] = list(zip(*rates.T.tolist(), strict=True))
    matrices = rotation.to_matrix(q_wi)
    turned: list[Matrix[float]] = list(zip(*matrices.reshape(-1, 9).T.tolist(), strict=True))
    forces: list[Vector[float]] = list(zip(*accel.T.tolist(), strict=True))
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
            covariance.advance(steps[k], turned[k], forces[k], turn_rates[k])
    return covariances
