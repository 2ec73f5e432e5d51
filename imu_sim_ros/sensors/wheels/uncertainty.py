# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Covariances that the odometry of wheels states, of twists and of the pose.

They include encoders, random slip, and the spreads of radii, base and steering offset; not slip in
turns and on patches, nor temperature.
"""

import math
from statistics import NormalDist
from typing import Final

import numpy as np

from imu_sim_ros.core.types import Array
from imu_sim_ros.sensors.wheels.parameters import WheelsParameters

_UPPER: Final = np.triu_indices(3)
"""The six different elements of a covariance: xx, xy, x yaw, yy, y yaw, yaw yaw."""
_ELEMENTS: Final = np.array([[0, 1, 2], [1, 3, 4], [2, 4, 5]])
UNKNOWN: Final = 1e6
"""Stated variance of unmeasured or lost components, as in ros2_controllers."""
_LOST: Final = 0.3
"""Standard deviation of the heading above which the positions of a seed form a bent band, which no
covariance describes: the NEES of a stated one would leave chi-square's band [rad]."""
_PAIRS: Final = 64
"""Number of pairs of vehicles with opposite errors; enough for the NEES of all presets."""
_ROWS: Final = 512
"""Number of readings for which all vehicles move at once: some megabytes."""


def rows_times(matrix: Array, rows: Array) -> Array:
    """Return ``rows @ matrix.T``, with sums in an order that the number of rows does not change."""
    products = rows[:, :1] * matrix[:, 0]
    for k in range(1, matrix.shape[1]):
        products = products + rows[:, k : k + 1] * matrix[:, k]
    return products


def even_normals(pairs: int, count: int) -> Array:
    """Return columns (count, 2 pairs) of evenly spread standard normals, in opposite pairs.

    Their mean is 0, and their covariance is 1. They follow Kronecker's sequence in as many
    dimensions, whose steps are powers of the root g of ``g^(count + 1) = g + 1``.
    """
    root = 2.0
    for _ in range(100):
        root = (1.0 + root) ** (1.0 / (count + 1))
    steps = root ** -np.arange(1.0, count + 1.0)
    shares = (0.5 + np.outer(steps, np.arange(1.0, pairs + 1.0))) % 1.0
    quantile = NormalDist().inv_cdf
    half = np.array([[quantile(share) for share in row] for row in shares.tolist()])
    half = np.linalg.solve(np.linalg.cholesky(half @ half.T / pairs), half)
    return np.concatenate([half, -half], axis=1)


def _constant_errors(parameters: WheelsParameters) -> Array | None:
    """Return the constants of vehicles (m + 1 or m + 2, vehicles) that their spreads describe.

    The rows are relative errors of the m radii and of the base, and, if the vehicle steers, the
    steering offset [rad]. The first vehicle is that of the readings, without errors. None: the
    constants are known exactly.
    """
    is_steered = parameters.model == "ackermann"
    sigmas = np.array(
        [0.01 * parameters.radius_sigma_percent] * parameters.wheels
        + [0.01 * parameters.base_sigma_percent]
        + [parameters.steering_offset_sigma] * is_steered
    )
    if not sigmas.any():
        return None
    return np.insert(sigmas[:, None] * even_normals(_PAIRS, len(sigmas)), 0, 0.0, axis=1)


class StatedCovariance:
    """Covariances of the readings of one odometer, in order from the first."""

    def __init__(self, parameters: WheelsParameters, rims: Array, to_twist: Array) -> None:
        """Start with a pose that is known exactly.

        :param rims: (m, 3) nominal map from a twist (forward, left [m/s], yaw rate [rad/s]) to the
            speeds of the rims [m/s].
        :param to_twist: (3, m) map from the speeds of the rims to the twist.
        """
        self._parameters, self._rims, self._to_twist = parameters, rims, to_twist
        self._dt = 1.0 / parameters.rate
        tick = math.tau / parameters.ticks if parameters.ticks else 0.0
        self._angle_variance = parameters.encoder_noise**2 + tick**2 / 12.0
        """Variance of an encoder's angle [rad^2]: its noise, and its rounding to ticks."""
        self._constants = _constant_errors(parameters)
        self._vehicles = np.zeros((3, 1 + 2 * _PAIRS))
        """Poses x, y [m], yaw [rad] of the vehicles with these errors, at the latest reading."""
        self._pose: Array | None = None
        """(3,) pose of the latest reading; None before the first."""
        self._white = np.zeros(6)
        """Elements of the covariance that white errors have added up to, about the origin."""
        self._count = np.zeros((parameters.wheels, 3))
        """(m, 3) motion about the origin by one standard deviation of the latest angles."""

    def twist_covariance(self, twist: Array, angle: Array) -> Array:
        """Return the covariance (n, 3, 3) of twists (n, 3), at angles (n, m) of the joints."""
        p, m = self._parameters, self._to_twist
        counted = 2.0 * (p.radius / self._dt) ** 2 * self._angle_variance
        rims = np.abs(rows_times(self._rims, twist))
        spread = (0.01 * p.radius_sigma_percent * rims) ** 2
        rim_variances = counted + p.slip_noise**2 * rims / self._dt + spread
        squares = np.einsum("im,jm->ijm", m, m).reshape(9, -1)
        covariances = rows_times(squares, rim_variances).reshape(-1, 3, 3)
        if p.model == "ackermann":
            self._put_steering(covariances, twist[:, 0], angle[:, -1])
        if p.model != "omnidirectional":
            covariances[:, 1, 1] = p.side_slip_sigma**2
        covariances[:, 2, 2] += (0.01 * p.base_sigma_percent * twist[:, 2]) ** 2
        return covariances

    def _put_steering(self, covariances: Array, speed: Array, steered: Array) -> None:
        """Set the yaw rate's variance and its covariance with the forward speed.

        :param covariances: (n, 3, 3) covariances of the twists, changed in place.
        :param speed: (n,) forward speeds [m/s].
        :param steered: (n,) steering angles [rad].
        """
        p, variance = self._parameters, covariances[:, 0, 0]
        curvature = np.tan(steered) / p.wheelbase
        slope = (1.0 + np.tan(steered) ** 2) / p.wheelbase
        of_steering = p.steering_noise**2 + p.steering_offset_sigma**2
        covariances[:, 0, 2] = covariances[:, 2, 0] = curvature * variance
        # The variance of the speed is the remainder for a standing vehicle.
        turning = (speed**2 + variance) * slope**2 * of_steering
        covariances[:, 2, 2] = curvature**2 * variance + turning

    def pose_covariance(self, pose: Array, twist: Array, angle: Array) -> Array:
        """Return the covariance (n, 3, 3) of the poses (n, 3) that the next n twists add up to.

        Radii, base and steering offset are constant and soon turn the heading so far that position
        errors are not linear in them. Their part is the mean square of the errors of many vehicles,
        each with its own constants, whose wheels turn as measured. Once the heading is lost, x and
        y are unknown.

        The rest is of first order. With ``T(p) = [[1, 0, -y], [0, 1, x], [0, 0, 1]]`` errors e of
        pose k are ``T(p_k) sum_j a_j s_j``, a_j (3,) of source s in the interval before reading j:
        the way that it adds, as a motion about the origin. Random slip and steering noise are
        white; the error n of an angle enters as ``n_j - n_(j-1)``, so that it does not add up.
        """
        if not len(pose):
            return np.zeros((0, 3, 3))
        previous_pose = np.concatenate(
            [pose[:1] if self._pose is None else self._pose[None], pose[:-1]]
        )
        # No interval precedes the first pose.
        dt = np.full(len(pose), self._dt)
        dt[0] = 0.0 if self._pose is None else self._dt
        self._pose = pose[-1].copy()
        wheels, steering = self._ways(previous_pose, pose, twist, angle, dt)
        rims = rows_times(self._rims, twist)
        p = self._parameters
        slip = p.slip_noise * np.sqrt(np.abs(rims) / self._dt)
        counts = (p.radius / self._dt) * math.sqrt(self._angle_variance) * wheels
        previous = np.concatenate([self._count[None], counts[:-1]])
        self._count = counts[-1].copy()
        white = [slip[:, :, None] * wheels, counts - previous]
        if p.model == "ackermann":
            white.append(p.steering_noise * steering)
        summed = np.concatenate([self._white[None], _square(np.concatenate(white, axis=1))])
        white_sum = np.cumsum(summed, axis=0)
        self._white = white_sum[-1].copy()
        covariances = _transform(white_sum[1:] + _square(counts), pose)
        if self._constants is not None:
            for k in range(0, len(pose), _ROWS):
                rows = slice(k, k + _ROWS)
                covariances[rows] += self._constants_covariance(rims[rows], angle[rows], dt[rows])
        lost = covariances[:, 2, 2] > _LOST**2
        covariances[lost, :2] = covariances[lost, :, :2] = 0.0
        covariances[lost, [[0], [1]], [[0], [1]]] = UNKNOWN
        return covariances

    def _constants_covariance(self, rims: Array, angle: Array, dt: Array) -> Array:
        """Return the part (n, 3, 3) of the constants, of the next n intervals.

        :param rims: (n, m) measured speeds [m/s].
        :param angle: (n, j) angles of the joints [rad].
        :param dt: (n,) lengths of the intervals [s].
        """
        assert self._constants is not None
        p, m = self._parameters, rims.shape[1]
        shares = 1.0 + self._constants[: m + 1]
        forward, sideways, turning = (
            rows_times((row[:, None] * shares[:m]).T, rims) for row in self._to_twist
        )
        if p.model == "ackermann":
            turning = forward * np.tan(angle[:, -1:] + self._constants[-1]) / p.wheelbase
        turned = dt[:, None] * turning * shares[m]
        start = self._vehicles
        yaw = np.cumsum(np.concatenate([start[None, 2], turned]), axis=0)
        middle = 0.5 * (yaw[1:] + yaw[:-1])
        cosine, sine = dt[:, None] * np.cos(middle), dt[:, None] * np.sin(middle)
        ways = np.stack(
            [cosine * forward - sine * sideways, sine * forward + cosine * sideways], axis=1
        )
        positions = np.cumsum(np.concatenate([start[None, :2], ways]), axis=0)
        poses = np.concatenate([positions, yaw[:, None]], axis=1)[1:]
        self._vehicles = poses[-1].copy()
        error = poses[:, :, 1:] - poses[:, :, :1]
        mean: Array = np.matmul(error, error.transpose(0, 2, 1)) / error.shape[2]
        return mean

    def _ways(
        self, previous: Array, pose: Array, twist: Array, angle: Array, dt: Array
    ) -> tuple[Array, Array]:
        """Return the motions about the origin that errors add in an interval.

        The errors are those of the speed of each rim (n, m, 3) [1 / (m/s)], and of the steering
        angle (n, 1, 3) [1 / rad]. A motion is x, y [m] and yaw [rad].

        :param previous: (n, 3) poses at the starts of the intervals.
        :param pose: (n, 3) poses at their ends.
        :param twist: (n, 3) twists in the intervals.
        :param angle: (n, j) angles of the joints, the steering angle last [rad].
        :param dt: (n,) lengths of the intervals [s].
        """
        x, y, yaw = (0.5 * (previous + pose)).T
        chord = dt * np.sinc((pose[:, 2] - previous[:, 2]) / math.tau)
        cosine, sine = chord * np.cos(yaw), chord * np.sin(yaw)
        forward, sideways, turning = self._to_twist[:, :, None]
        turned = np.broadcast_to(turning.T, (len(pose), len(turning)))
        slope = np.zeros(len(pose))
        if self._parameters.model == "ackermann":
            tangent = np.tan(angle[:, -1])
            turned = (tangent / self._parameters.wheelbase)[:, None] * forward.T
            slope = twist[:, 0] * (1.0 + tangent**2) / self._parameters.wheelbase
        about = np.stack([y * dt, -x * dt, dt], axis=1)
        along = np.stack([cosine, sine, 0.0 * dt], axis=1)
        across = np.stack([-sine, cosine, 0.0 * dt], axis=1)
        wheels = forward * along[:, None] + sideways * across[:, None]
        wheels = wheels + turned[:, :, None] * about[:, None]
        return wheels, (slope[:, None] * about)[:, None]


def _square(rows: Array) -> Array:
    """Return the six elements (n, 6) of the sum of r r^T over rows (n, k, 3)."""
    return np.sum(rows[:, :, _UPPER[0]] * rows[:, :, _UPPER[1]], axis=1)


def _transform(elements: Array, pose: Array) -> Array:
    """Return T C T^T (n, 3, 3) of six elements (n, 6) of C."""
    x, y = pose[:, 0], pose[:, 1]
    xx, xy, xt, yy, yt, tt = elements.T
    moved = [
        xx - 2.0 * y * xt + y * y * tt,
        xy + x * xt - y * yt - x * y * tt,
        xt - y * tt,
        yy + 2.0 * x * yt + x * x * tt,
        yt + x * tt,
        tt,
    ]
    return np.stack(moved, axis=1)[:, _ELEMENTS]
