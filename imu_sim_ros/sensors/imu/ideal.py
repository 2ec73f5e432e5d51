# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""The ideal reading: specific force and angular rate, at an instant or averaged."""

from functools import lru_cache
from typing import Final

import numpy as np

from imu_sim_ros.core.errors import ConfigurationError
from imu_sim_ros.core.rotation import cross, rotate_inverse, transform
from imu_sim_ros.core.types import Array
from imu_sim_ros.sensors.environment import EnvironmentParameters
from imu_sim_ros.sensors.gravity import CurvedEarth, earth_rate_vector, gravity_vector
from imu_sim_ros.sensors.imu.parameters import ImuParameters
from imu_sim_ros.trajectory.motion import Motion, Trajectory

_MAX_PERIODS: Final = 50.0
"""Most periods of the highest frequency in the interval; they take 187 nodes."""
_NEWTON_STEPS: Final = 8
"""Enough for any number of nodes; from cosines 4 reach the last digit."""
_ACCURACY: Final = 1e-7
"""Error of the mean of a sinusoid, over its amplitude."""
_ROUNDING: Final = 1e-12
"""An error that is lost in the rounding of a motion's numbers."""


Quadrature = tuple[Array, Array]
"""Nodes and weights (m,) on [0, 1]; the first and the last node are the ends."""


@lru_cache(maxsize=16)
def quadrature(frequency: float, interval: float) -> Quadrature:
    """Return Gauss-Lobatto nodes that average motions up to a frequency to 1e-7 of their size.

    Twice the frequency is assumed: turning and shaking at once gives products of both. Between
    the ends, which neighbouring intervals share, there are three nodes up to 0.14 of a period in
    the interval, 6 for half a period, 13 for two; and two if they are exact to rounding, up to
    0.0085 of a period.

    :param frequency: highest frequency of the motion [Hz]; 0: not known.
    :param interval: interval over which readings are averaged [s].
    :raises ConfigurationError: if there are more than 50 periods in the interval.
    """
    # In terms of the half interval, sin and cos of up to c x, x in [-1, 1]; the mean of cos(c x)
    # is sin(c) / c, and its error grows with c until the nodes are too few for it.
    periods = frequency * interval
    if periods > _MAX_PERIODS:
        raise ConfigurationError(
            f"imu.sampling = averaged: the motion has frequencies up to {frequency:g} Hz, "
            f"{periods:.3g} times the rate; at most {_MAX_PERIODS:g} times can be averaged"
        )
    c = 2.0 * np.pi * periods
    fewest = lobatto(4)
    if c and _error(fewest, c) < _ROUNDING:
        return fewest
    count = max(5, int(0.5 * c))
    while _error(rule := lobatto(count), c) >= _ACCURACY:
        count += max(1, count // 16)
    return rule


def lobatto(count: int) -> Quadrature:
    """Return the Gauss-Lobatto nodes and weights on [0, 1], exact for powers up to 2 count - 3.

    On [-1, 1] the nodes are the ends and the zeros of ``P'_N``, N = count - 1, with the weights
    ``2 / (N (N + 1) P_N(x)^2)`` (Abramowitz and Stegun, eq. 25.4.32); by Newton's method on
    ``(1 - x^2) P'_N(x) = N (P_(N-1) - x P_N)``, whose derivative is ``-N (N + 1) P_N``.

    :param count: number of nodes, at least 2.
    """
    x = -np.cos(np.pi * np.arange(count) / (count - 1))
    for _ in range(_NEWTON_STEPS):
        previous, value = np.ones(count), x
        for k in range(2, count):
            previous, value = value, ((2 * k - 1) * x * value - (k - 1) * previous) / k
        x = x - (x * value - previous) / (count * value)
    return 0.5 + 0.5 * x, 1.0 / (count * (count - 1) * value**2)


def _error(rule: Quadrature, c: float) -> float:
    """Return the largest error of the mean of ``cos(b x)`` over [-1, 1] for b up to c."""
    nodes, weights = rule
    trials = np.append(np.arange(1.0, 9.0) / 8.0 * c, 1e-12)
    means = weights @ np.cos(np.outer(2.0 * nodes - 1.0, trials))
    return float(np.max(np.abs(means - np.sinc(trials / np.pi))))


_SAMPLED_AT_ONCE: Final = 4096
"""Times at which a motion is sampled in one call: the arrays fit into the processor's cache."""


class IdealImu:
    """An IMU without errors at its mounting position on the body."""

    def __init__(self, imu: ImuParameters, environment: EnvironmentParameters) -> None:
        """Initialise with the IMU's mount and elements, and with gravity and the Earth's rate."""
        self._curved_earth = CurvedEarth(environment) if environment.curved_earth else None
        self._gravity_w = gravity_vector(environment)
        self._earth_rate_w = earth_rate_vector(environment)
        self._lever_arm_b = np.array(imu.lever_arm)
        self._has_lever_arm = bool(self._lever_arm_b.any())
        self._earth_turns = bool(self._earth_rate_w.any())
        self._r_ib = np.reshape(imu.mounting, (3, 3)).T
        self._elements_i = np.reshape(imu.accelerometer_positions, (3, 3))
        self._has_size = bool(self._elements_i.any())

    def read(self, motion: Motion) -> tuple[Array, Array]:
        """Return angular rate [rad/s] and specific force [m/s^2], both (n, 3), in the IMU's frame.

        Without Earth rotation ``omega_b`` and ``f_b = R_wb.T (a_w - g_w)`` (lecture eq. 22); at a
        lever arm r the IMU also sees the acceleration ``alpha x r + omega x (omega x r)``, and each
        accelerometer that of its own position in the IMU (:func:`size_effect`).
        With Earth rotation the gyroscope also reads ``R_wb.T omega_ie`` and the accelerometer the
        Coriolis term ``2 omega_ie x v`` of the IMU's velocity (Groves, "Principles of GNSS,
        Inertial, and Multisensor Integrated Navigation Systems", 2nd ed., eq. 5.41); the
        centrifugal term is a part of gravity. The world is flat, unless `curved_earth` is set
        (:class:`imu_sim_ros.sensors.gravity.CurvedEarth`).
        """
        n = len(motion.q_wb)
        if n > 1 and not any(values.strides[0] for values in motion):  # one row for all times
            rate, force = self.read(Motion(*(values[:1] for values in motion)))
            return np.broadcast_to(rate, (n, 3)), np.broadcast_to(force, (n, 3))
        q_wb, arm = motion.q_wb, self._lever_arm_b
        if self._curved_earth is not None:
            rate, force = self._curved_earth.read(motion, arm)
        else:
            rate = motion.angular_velocity
            force = rotate_inverse(q_wb, motion.acceleration - self._gravity_w)
            if self._has_lever_arm:
                force += cross(motion.angular_acceleration, arm)
                force += cross(rate, cross(rate, arm))
            if self._earth_turns:
                earth_rate = rotate_inverse(q_wb, self._earth_rate_w)
                velocity = cross(rate, arm)
                velocity += rotate_inverse(q_wb, motion.velocity)
                coriolis = cross(earth_rate, velocity)
                coriolis *= 2.0
                force += coriolis
                rate = np.add(rate, earth_rate, out=earth_rate)
        rate_i, force_i = transform(self._r_ib, rate), transform(self._r_ib, force)
        if self._has_size:
            turning_i = transform(self._r_ib, motion.angular_velocity)
            change_i = transform(self._r_ib, motion.angular_acceleration)
            force_i += size_effect(self._elements_i, turning_i, change_i)
        return rate_i, force_i

    def read_mean(
        self, trajectory: Trajectory, t: Array, motion: Motion, quadrature: Quadrature
    ) -> tuple[Array, Array]:
        """Return the mean readings between n + 1 times (lecture eq. 11).

        Times the interval's length the means (n, 3) are the delta angle and the delta velocity.
        Gauss-Lobatto quadrature; with two nodes between the ends the error falls with the sixth
        power of the interval, with three with the eighth.

        :param t: (n + 1,) ends of the intervals [s], not decreasing.
        :param motion: motion at these times.
        :param quadrature: nodes and weights on [0, 1], see :func:`quadrature`.
        """
        nodes, weights = (values[1:-1] for values in quadrature)
        of_ends = quadrature[1][0]
        means = [of_ends * (ends[:-1] + ends[1:]) for ends in self.read(motion)]
        n = len(t) - 1
        start, length = t[:-1], np.diff(t)
        rows = max(1, min(n, _SAMPLED_AT_ONCE))
        columns = max(1, _SAMPLED_AT_ONCE // rows)
        for begin in range(0, n, rows):
            row = slice(begin, begin + rows)
            for first in range(0, len(nodes), columns):
                column = slice(first, first + columns)
                times = start[row] + nodes[column, None] * length[row]
                readings = self.read(trajectory.sample(times.ravel()))
                for mean, values in zip(means, readings, strict=True):
                    for weight, columns_of_node in zip(
                        weights[column], values.reshape(*times.shape, 3), strict=True
                    ):
                        mean[row] += weight * columns_of_node
        rate, force = means
        return rate, force


def size_effect(positions: Array, omega: Array, alpha: Array) -> Array:
    """Return the effect (n, 3) of three accelerometers at different places [m/s^2].

    Axis k of ``alpha x r_k + omega x (omega x r_k)``, r_k the position of accelerometer k (Savage,
    "Strapdown Analytics", "size effect").

    :param positions: (3, 3) r_x, r_y, r_z row by row [m].
    :param omega: (n, 3) angular rate [rad/s].
    :param alpha: (n, 3) angular acceleration [rad/s^2].
    """
    result, w, a = np.empty(omega.shape, order="F"), omega.T, alpha.T
    for k, component in enumerate(result.T):
        i, j = (k + 1) % 3, (k + 2) % 3
        r = positions[k]
        component[:] = a[i] * r[j] - a[j] * r[i]
        component += w[k] * (w[i] * r[i] + w[j] * r[j])
        component -= r[k] * (w[i] * w[i] + w[j] * w[j])
    return result
