# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Preintegrated readings between given times: deltas, Jacobians, covariance."""

from typing import Final, NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from imu_sim_ros.core import rotation
from imu_sim_ros.core.errors import ConfigurationError, InputError
from imu_sim_ros.core.names import suggestion
from imu_sim_ros.core.spelling import argument_prefix
from imu_sim_ros.core.types import Array, Integers, shapes
from imu_sim_ros.navigation.association import interpolate_vectors
from imu_sim_ros.navigation.preintegration_slow_errors import SlowErrorsOfIntervals
from imu_sim_ros.sensors.imu.triads import TriadsParameters


class StepReadings(NamedTuple):
    """The readings of B intervals of at most m steps; shorter ones end in steps of length 0.

    An axis of intervals, which may belong to many runs with the same times, keeps it from being a
    :class:`imu_sim_ros.core.records.Readings`.
    """

    h: Array
    """(B, m) lengths of the steps [s]."""
    gyro: Array
    """(B, m + 1, 3) rates at the ends of the steps [rad/s]."""
    accel: Array
    """(B, m + 1, 3) specific forces at the ends of the steps [m/s^2]."""


def between(t_ns: Integers, gyro: Array, accel: Array, edges_ns: ArrayLike) -> StepReadings:
    """Return the readings between neighbouring times; at these, readings are interpolated.

    :param t_ns: (n,) stamps [ns], increasing.
    :param gyro: (n, 3) angular rates [rad/s].
    :param accel: (n, 3) specific forces [m/s^2].
    :param edges_ns: (B + 1,) times within the stamps, increasing [ns].
    :raises InputError: for times outside of the stamps or out of order.
    """
    edges = np.asarray(edges_ns, dtype=np.int64)
    if len(edges) < 2 or np.any(np.diff(edges) <= 0):
        raise InputError("the times between which to preintegrate must increase, two or more")
    if edges[0] < t_ns[0] or edges[-1] > t_ns[-1]:
        raise InputError(
            f"preintegration from {edges[0]} to {edges[-1]} ns needs readings over all of it: "
            f"they last from {t_ns[0]} to {t_ns[-1]} ns"
        )
    times = np.union1d(t_ns, edges)
    begin, end = np.searchsorted(times, edges[:-1]), np.searchsorted(times, edges[1:])
    longest = int(np.max(end - begin))
    # Behind an interval's end its last row is repeated, which makes steps of length 0.
    rows = np.minimum(begin[:, None] + np.arange(longest + 1), end[:, None])
    return StepReadings(
        np.diff(times[rows], axis=1) * 1e-9,
        interpolate_vectors(t_ns, gyro, times)[rows],
        interpolate_vectors(t_ns, accel, times)[rows],
    )


SIZE: Final = 15
"""Number of error states."""
ALPHA, THETA, BETA = slice(0, 3), slice(3, 6), slice(6, 9)
ACCEL_BIAS, GYRO_BIAS = slice(9, 12), slice(12, 15)

_EYE: Final[Array] = np.eye(3)
_JOINED: Final = 8
"""Steps whose F are multiplied before they are applied: a power of two."""
_BLOCK: Final = 512
"""Steps, of all intervals together, whose F and G are computed at a time."""


class Preintegration(NamedTuple):
    """The result of B intervals, and how it depends on the biases."""

    duration: Array
    """(B,) lengths of the intervals [s]."""
    alpha: Array
    """(B, 3) changes of position [m]."""
    beta: Array
    """(B, 3) changes of velocity [m/s]."""
    gamma: Array
    """(B, 4) attitudes of the ends in the frames of the starts, unit quaternions."""
    jacobian: Array
    """(B, 15, 15) derivative of the error at the end by that at the start, the product of F."""
    covariance: Array
    """(B, 15, 15) covariance of the error at the end; zero at the start."""
    accel_bias: Array
    """(B, 3) accelerometer bias that was subtracted [m/s^2]."""
    gyro_bias: Array
    """(B, 3) gyroscope bias that was subtracted [rad/s]."""

    def __repr__(self) -> str:
        return shapes(self)


def preintegrate(
    readings: StepReadings,
    noise: TriadsParameters | None = None,
    gyro_bias: ArrayLike = 0.0,
    accel_bias: ArrayLike = 0.0,
    method: str = "midpoint",
    shared_noise: bool = True,
) -> Preintegration:
    """Preintegrate B intervals.

    Under midpoint each reading serves two steps, so its noise comes in twice. With ``shared_noise``
    this is accounted for and the covariance is that of many runs. Without it, the noises of both
    ends of a step are taken as new ones each time, as VINS does, and the white noise comes out with
    half its variance. Euler uses each reading once, if both are the same.

    :param readings: B intervals.
    :param noise: the IMU's errors; None leaves the covariance zero.
    :param gyro_bias: (B, 3), (3,) or one number [rad/s].
    :param accel_bias: (B, 3), (3,) or one number [m/s^2].
    :param method: euler or midpoint.
    """
    if method not in METHODS:
        raise ConfigurationError(
            f"{argument_prefix('method', repr(method))}: {suggestion(method, METHODS)}"
        )
    batch = len(readings.h)
    gyro_bias = np.array(np.broadcast_to(np.asarray(gyro_bias, dtype=float), (batch, 3)))
    accel_bias = np.array(np.broadcast_to(np.asarray(accel_bias, dtype=float), (batch, 3)))
    rate = readings.gyro - gyro_bias[:, None]
    force = readings.accel - accel_bias[:, None]
    alpha, beta = np.zeros((batch, 3)), np.zeros((batch, 3))
    gamma = _attitudes(method, readings.h, rate)
    errors = _Errors(batch, noise, _period(readings.h), shared_noise)
    step = METHODS[method]
    block = max(_JOINED, _BLOCK // batch // _JOINED * _JOINED)
    for start in range(0, readings.h.shape[1], block):
        h = np.ascontiguousarray(readings.h[:, start : start + block].T)
        ends = slice(start, start + block + 1)
        rates, forces = _pairs(rate[:, ends]), _pairs(force[:, ends])
        gammas = gamma[start : start + len(h)]
        flat = (values.reshape(-1, *values.shape[2:]) for values in (gammas, rates, forces))
        acceleration, f, g = step(h.reshape(-1, 1), *flat)
        gained = acceleration.reshape(*h.shape, 3) * h[..., None]
        # One after the other from what there is: the same sums whatever the block.
        betas = np.cumsum(np.concatenate([beta[None], gained]), axis=0)
        moved = (betas[:-1] + 0.5 * gained) * h[..., None]
        alpha = np.cumsum(np.concatenate([alpha[None], moved]), axis=0)[-1]
        beta = betas[-1]
        f, g = f.reshape(*h.shape, SIZE, SIZE), g.reshape(*h.shape, SIZE, 12)
        errors.extend(h, f, g, forces, rates)
    return Preintegration(
        duration=readings.h.sum(axis=1),
        alpha=alpha,
        beta=beta,
        gamma=gamma[-1],
        jacobian=errors.jacobian,
        covariance=errors.total(),
        accel_bias=accel_bias,
        gyro_bias=gyro_bias,
    )


def _pairs(values: Array) -> Array:
    """Return readings (B, m + 1, 3) as those of both ends of each step (m, B, 2, 3)."""
    return np.stack([values[:, :-1], values[:, 1:]], axis=2).swapaxes(0, 1)


def _turn(method: str, h: Array, rates: Array) -> Array:
    """Return rotation vectors (..., 3) of steps h (..., 1) with rates (..., 2, 3) at their ends."""
    rate = rates[..., 0, :] if method == "euler" else 0.5 * (rates[..., 0, :] + rates[..., 1, :])
    return rate * h


def _attitudes(method: str, h: Array, rate: Array) -> Array:
    """Return gamma (m + 1, B, 4) before each of m steps, and after the last.

    :param h: (B, m) lengths of the steps [s].
    :param rate: (B, m + 1, 3) rates at the ends of the steps [rad/s].
    """
    turns = _turn(method, h.T[..., None], _pairs(rate))
    attitudes = np.concatenate([np.tile(rotation.IDENTITY, (1, len(h), 1)), rotation.exp(turns)])
    step = 1
    while step < len(attitudes):  # a scan by doubling: each is the product of up to 2 step of them
        attitudes[step:] = rotation.multiply(attitudes[:-step], attitudes[step:])
        step *= 2
    return rotation.normalise(attitudes)


def _period(h: Array) -> float:
    """Return the sensor's sampling interval: partial steps at the edges are shorter, no noisier."""
    return float(np.median(h[h > 0.0])) if np.any(h > 0.0) else 1.0


_Step = tuple[Array, Array, Array]
"""Acceleration (n, 3) [m/s^2], in the frame of the interval's start, and derivatives of the error
after a step of n steps: F (n, 15, 15) by the error before it, and G (n, 15, 12) by the noise of
accelerometer and gyroscope at its start, then at its end."""


def _euler(h: Array, gamma: Array, rate: Array, force: Array) -> _Step:
    """Return n steps of Euler's method, which uses the reading at the start of a step alone.

    In G the columns for the noise of the reading at the end are zero.

    :param h: (n, 1) lengths of the steps [s].
    :param gamma: (n, 4) attitudes at the starts, in the frame of the interval's start.
    :param rate: (n, 2, 3) rates at start and end of each step, without the bias [rad/s].
    :param force: (n, 2, 3) specific forces at start and end, without the bias [m/s^2].
    """
    r = rotation.to_matrix(gamma)
    turn = _turn("euler", h, rate)
    acceleration = (r @ force[:, 0, :, None])[..., 0]
    h3 = h[..., None]
    by_theta = -r @ rotation.skew(force[:, 0])
    f, g = _blank(len(h))
    _turn_rows(f, g, turn, h3, weights=(1.0, 0.0))
    zero = np.zeros_like(r)
    _move_rows(f, g, h3, (by_theta, -r, zero), (-r, zero, zero, zero))
    return acceleration, f, g


def _midpoint(h: Array, gamma: Array, rate: Array, force: Array) -> _Step:
    """Return n steps with the means of both ends' rates and accelerations, as VINS' program does.

    Arguments as for :func:`_euler`.
    """
    turn = _turn("midpoint", h, rate)
    r0 = rotation.to_matrix(gamma)
    r1 = r0 @ rotation.to_matrix(rotation.exp(turn))
    acceleration = 0.5 * (r0 @ force[:, 0, :, None] + r1 @ force[:, 1, :, None])[..., 0]
    h3 = h[..., None]
    f, g = _blank(len(h))
    _turn_rows(f, g, turn, h3, weights=(0.5, 0.5))
    # The acceleration of the end turns with the attitude of the end, which the step has turned.
    tilt0 = -0.5 * r0 @ rotation.skew(force[:, 0])
    tilt1 = -0.5 * r1 @ rotation.skew(force[:, 1])
    by_theta = tilt0 + tilt1 @ f[:, THETA, THETA]
    by_gyro_bias = tilt1 @ f[:, THETA, GYRO_BIAS]
    by_gyro_noise = 0.5 * by_gyro_bias
    f_parts = (by_theta, -0.5 * (r0 + r1), by_gyro_bias)
    _move_rows(f, g, h3, f_parts, (-0.5 * r0, by_gyro_noise, -0.5 * r1, by_gyro_noise))
    return acceleration, f, g


METHODS: Final = {"euler": _euler, "midpoint": _midpoint}
"""A step by the name of its method."""


def _blank(batch: int) -> tuple[Array, Array]:
    """Return transitions (batch, 15, 15) of 1, and zero effects of the noise (batch, 15, 12)."""
    f = np.tile(np.eye(SIZE), (batch, 1, 1))
    # Noise of accelerometer and gyroscope at the start, then at the end of the step.
    return f, np.zeros((batch, SIZE, 12))


def _turn_rows(f: Array, g: Array, turn: Array, h: Array, weights: tuple[float, float]) -> None:
    """Set the rows of theta: ``theta <- Exp(-turn) theta - Jr h (db_g + n_g)``.

    :param turn: (B, 3) rotation vectors of the steps [rad].
    :param h: (B, 1, 1) lengths of the steps [s].
    :param weights: shares of the gyroscope's noise at the start and at the end of a step in n_g.
    """
    by_rate = -rotation.right_jacobian(turn) * h
    f[:, THETA, THETA] = rotation.to_matrix(rotation.exp(-turn))
    f[:, THETA, GYRO_BIAS] = by_rate
    g[:, THETA, 3:6] = weights[0] * by_rate
    g[:, THETA, 9:12] = weights[1] * by_rate


def _move_rows(
    f: Array,
    g: Array,
    h: Array,
    by_state: tuple[Array, Array, Array],
    by_noise: tuple[Array, Array, Array, Array],
) -> None:
    """Set the rows of beta and alpha of a step from the derivatives of the acceleration.

    :param f: (B, 15, 15) transition of the errors over the step, which is changed.
    :param g: (B, 15, 12) effect of the noise of the readings, which is changed.
    :param h: (B, 1, 1) lengths of the steps [s].
    :param by_state: derivatives (B, 3, 3) with respect to theta and the biases of accelerometer and
        gyroscope.
    :param by_noise: derivatives (B, 3, 3) with respect to the noise of accelerometer and gyroscope
        at the start, then at the end.
    """
    f[:, ALPHA, BETA] = h * _EYE
    columns = (THETA, ACCEL_BIAS, GYRO_BIAS)
    for column, derivative in zip(columns, by_state, strict=True):
        f[:, BETA, column] = derivative * h
        f[:, ALPHA, column] = derivative * (0.5 * h * h)
    for k, derivative in enumerate(by_noise):
        g[:, BETA, 3 * k : 3 * k + 3] = derivative * h
        g[:, ALPHA, 3 * k : 3 * k + 3] = derivative * (0.5 * h * h)


class _Errors:
    """Jacobian and covariance of B intervals, step by step."""

    def __init__(
        self, batch: int, noise: TriadsParameters | None, period: float, shared: bool
    ) -> None:
        """Initialise at the start of the intervals, without errors.

        :param batch: number B of intervals.
        :param noise: the IMU's errors; None: only the Jacobian is computed.
        :param period: sampling interval of the sensor [s].
        :param shared: True if consecutive steps share the reading between them, with its noise.
        """
        self.jacobian = np.tile(np.eye(SIZE), (batch, 1, 1))
        """(B, 15, 15) derivatives of the errors at the end by those at the start."""
        self.covariance = np.zeros((batch, SIZE, SIZE))
        """(B, 15, 15) covariance of the errors, without the slow ones."""
        self._has_noise = noise is not None
        if noise is None:
            return
        triads = (noise.accelerometer, noise.gyroscope)
        self._slow = SlowErrorsOfIntervals(noise, batch, period)
        self._white = np.concatenate([t.white_variance(1.0 / period) for t in triads])
        self._walk = np.square(np.concatenate([t.random_walk for t in triads]))
        self._diagonal = np.arange(ACCEL_BIAS.start, SIZE)
        self._shared = shared
        # Covariance of the error with the noise of the reading that the next step begins with.
        self._with_noise = np.zeros((batch, SIZE, 6))

    def total(self) -> Array:
        """Return the covariance (B, 15, 15), the slow errors included."""
        if not (self._has_noise and self._slow):
            return self.covariance
        return self.covariance + self._slow.covariance(self.jacobian)

    def extend(self, h: Array, f: Array, g: Array, force: Array, rate: Array) -> None:
        """Add m steps of lengths h (m, B) with F (m, B, 15, 15) and G (m, B, 15, 12).

        :param force: (m, B, 2, 3) at both ends of the steps.
        :param rate: (m, B, 2, 3) at both ends of the steps.
        """
        if not self._has_noise:
            for transition in _join_steps(f)[0]:
                self.jacobian = transition @ self.jacobian
            return
        start_t = g[..., :6].swapaxes(-1, -2)
        from_end = g[..., 6:] * self._white
        added = (g[..., :6] * self._white) @ start_t + from_end @ g[..., 6:].swapaxes(-1, -2)
        added[..., self._diagonal, self._diagonal] += h[..., None] * self._walk
        if self._shared:
            # A step of length 0, behind the end of a shorter interval, has no noise.
            with_noise = np.concatenate([self._with_noise[None], from_end[:-1]])
            crossed = f @ (with_noise @ start_t)
            added += crossed + crossed.swapaxes(-1, -2)
            self._with_noise = from_end[-1]
        f, added = _join_steps(f, added)
        jacobians = []
        for transition, gained in zip(f, added, strict=True):
            self.jacobian = transition @ self.jacobian
            self.covariance = transition @ self.covariance @ transition.swapaxes(1, 2) + gained
            jacobians.append(self.jacobian)
        if self._slow:
            readings = np.concatenate([force, rate], axis=-1).mean(axis=2)
            self._slow.extend(np.stack(jacobians), h, readings, _JOINED)


def _join_steps(f: Array, q: Array | None = None) -> tuple[Array, Array]:
    """Return steps ``P <- F P F^T + Q`` joined eight by eight, the last ones fewer.

    Neighbours are joined, then pairs, then fours: two steps after one another are ``F = F2 F1`` and
    ``Q = F2 Q1 F2^T + Q2``. Each takes a few calls of NumPy for all of them.

    :param f: (m, B, 15, 15), m > 0.
    :param q: (m, B, 15, 15); None: without noise.
    """
    joined = 1
    while joined < _JOINED:
        even = len(f) // 2 * 2
        later = f[1:even:2]
        if q is not None:
            q2 = later @ q[:even:2] @ later.swapaxes(-1, -2) + q[1:even:2]
            q = np.concatenate([q2, q[even:]])
        f = np.concatenate([later @ f[:even:2], f[even:]])
        joined *= 2
    return f, f if q is None else q


class Deltas(NamedTuple):
    """Preintegrated quantities at other biases than they were integrated with."""

    alpha: Array
    """(B, 3) changes of position [m]."""
    beta: Array
    """(B, 3) changes of velocity [m/s]."""
    gamma: Array
    """(B, 4) attitudes of the ends in the frames of the starts, unit quaternions."""


def corrected(pre: Preintegration, gyro_bias: ArrayLike, accel_bias: ArrayLike) -> Deltas:
    """Return alpha, beta and gamma at other biases, to first order (Forster eq. 44).

    :param gyro_bias: (B, 3) or (3,) [rad/s].
    :param accel_bias: (B, 3) or (3,) [m/s^2].
    """
    moved = np.concatenate(
        [
            np.asarray(accel_bias, dtype=float) - pre.accel_bias,
            np.asarray(gyro_bias, dtype=float) - pre.gyro_bias,
        ],
        axis=1,
    )
    change = (pre.jacobian[:, :9, 9:] @ moved[..., None])[..., 0]
    return Deltas(
        pre.alpha + change[:, ALPHA],
        pre.beta + change[:, BETA],
        rotation.multiply(pre.gamma, rotation.exp(change[:, THETA])),
    )
