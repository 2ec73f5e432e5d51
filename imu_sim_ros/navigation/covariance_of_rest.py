# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""The uncertainty after a rest in which a body was levelled and its gyroscope's bias averaged.

The mean force of the rest is assumed to point up. With e the accelerometer's mean error in world
axes and g the strength of gravity, the attitude is then wrong by ``theta = A e``, ``theta_x = -e_y
/ g`` and ``theta_y = e_x / g`` (Groves, "Principles of GNSS, inertial, and multisensor integrated
navigation systems", 2nd edition, section 5.6.2), and the two go together: what the bias does to the
velocity, the tilt undoes. The remaining gyroscope bias is its change since the rest.
"""

from collections.abc import Sequence

import numpy as np
from numpy.typing import ArrayLike

from imu_sim_ros.navigation.covariance import ACCEL_BIAS, ATTITUDE, GYRO_BIAS, Covariance
from imu_sim_ros.navigation.noise import ImuErrors
from imu_sim_ros.types import Array


def after_rest(
    noise: ImuErrors,
    time: float,
    accelerometer_bias: ArrayLike,
    r_wb: Array,
    gravity: Sequence[float],
    rate_hz: float,
    *,
    levelled: bool = True,
) -> Covariance:
    """Return the covariance at the end of a rest.

    :param noise: the IMU's errors.
    :param time: length of the rest [s].
    :param accelerometer_bias: (3,) standard deviation of the constant bias, or one number [m/s^2].
    :param r_wb: (3, 3) attitude.
    :param gravity: (3,) in the world, along z [m/s^2].
    :param rate_hz: readings per second; it decides how far rounding averages out.
    :param levelled: roll and pitch are from the rest as well, and not otherwise known.
    """
    result = Covariance(noise)
    p, slow = result.matrix, result.slow
    slow.act_on(np.zeros(3), -r_wb.T @ np.asarray(gravity))
    mean, end = slow.over(time)
    gyro, accel = slow.effect[:3], slow.effect[3:]
    # A walk w of density K is off its mean over the rest by K^2 T / 3; E[mean(w) w] = K^2 T / 2.
    walk = np.square(noise.gyroscope.random_walk) * time
    white = _mean_of_white(noise.gyroscope.noise_density, noise.gyroscope.resolution, time, rate_hz)
    p[GYRO_BIAS, GYRO_BIAS] = np.diag(white + walk / 3.0) + (gyro * mean) @ gyro.T
    slow.cross[GYRO_BIAS] = -gyro * end
    walk = np.square(noise.accelerometer.random_walk) * time
    constant = np.diag(np.broadcast_to(np.square(accelerometer_bias), 3))
    p[ACCEL_BIAS, ACCEL_BIAS] = constant + np.diag(walk)
    if levelled:
        tilt = _turn_by_bias(r_wb) / -gravity[2]
        white = _mean_of_white(
            noise.accelerometer.noise_density, noise.accelerometer.resolution, time, rate_hz
        )
        own = constant + np.diag(white + walk / 3.0) + (accel * mean) @ accel.T
        p[ATTITUDE, ATTITUDE] = tilt @ own @ tilt.T
        p[ATTITUDE, ATTITUDE][2, 2] += _coning(p[ATTITUDE, ATTITUDE][:2, :2], r_wb)
        p[ATTITUDE, ACCEL_BIAS] = tilt @ (constant + np.diag(0.5 * walk))
        p[ACCEL_BIAS, ATTITUDE] = p[ATTITUDE, ACCEL_BIAS].T
        slow.cross[ATTITUDE] = tilt @ accel * end
        # The gyroscope's slow errors share no axis with the accelerometer's; scales may.
        shared = -tilt @ (accel * mean) @ gyro.T
        p[ATTITUDE, GYRO_BIAS] = shared
        p[GYRO_BIAS, ATTITUDE] = shared.T
    return Covariance(noise, p, slow.cross)


def _turn_by_bias(r_wb: Array) -> Array:
    """Return (3, 3) the turn of a levelled attitude by a bias of the force, times gravity.

    A bias b along the world's axes turns by ``(-b_y, b_x) / g`` about x and y. The heading that is
    kept is Euler's: at a pitch theta, a turn t about the horizontal axis ahead turns by
    ``-t tan(theta)`` about the vertical as well.
    """
    turn = np.array([[0.0, -1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, 0.0]])
    ahead = r_wb[:2, 0]  # cos(theta) (cos psi, sin psi); r_wb[2, 0] is -sin(theta)
    turn[2] = r_wb[2, 0] / max(float(ahead @ ahead), 1e-12) * (ahead @ turn[:2])
    return turn @ r_wb


def _coning(tilt: Array, r_wb: Array) -> float:
    """Return the mean square turn about the vertical, to second order in a level body's tilt.

    Roll and pitch that are wrong by a and b are the rotation ``exp(a x) exp(b y)``, whose vector
    has ``a b / 2`` about z; of normal a and b the mean of ``(a b)^2`` is ``A B + 2 C^2``.

    :param tilt: (2, 2) covariance about the world's x and y.
    """
    heading = np.arctan2(r_wb[1, 0], r_wb[0, 0])
    cosine, sine = np.cos(heading), np.sin(heading)
    own = np.array([[cosine, sine], [-sine, cosine]])
    (a, c), (_, b) = own @ tilt @ own.T
    return float(0.25 * (a * b + 2.0 * c * c))


def _mean_of_white(density: Array, step: Array, time: float, rate_hz: float) -> Array:
    """Return the variance (3,) of the mean of white and rounded readings."""
    return np.square(density) / time + np.square(step) / (12.0 * time * rate_hz)
