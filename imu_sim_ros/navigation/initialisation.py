# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""The initial state of integration: given values, the truth, or levelled at rest."""

import dataclasses
import itertools
import math
from collections.abc import Sequence
from typing import Final, NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from imu_sim_ros.core import rotation
from imu_sim_ros.core.components import float_vector
from imu_sim_ros.core.errors import InputError
from imu_sim_ros.core.spelling import argument_prefix
from imu_sim_ros.core.types import Array, Times
from imu_sim_ros.navigation.covariance import (
    ACCEL_BIAS,
    ATTITUDE,
    GYRO_BIAS,
    POSITION,
    Covariance,
    initial_covariance,
)
from imu_sim_ros.navigation.mount import ALIGNED, ImuMount, mount_of
from imu_sim_ros.navigation.parameters import IntegratorParameters
from imu_sim_ros.navigation.state import Correction, NavigationState, correction_of
from imu_sim_ros.parameters.kinds import ZERO_VECTOR
from imu_sim_ros.recordings.order import READINGS_GAP, gap_length, longest_step_ns
from imu_sim_ros.sensors.imu.triads import TriadsParameters

_GRAVITY_TOLERANCE: Final = 0.05
"""Smallest allowed difference of the mean force from gravity, as a fraction of gravity."""
_SIGMAS: Final = 4.0
"""Standard deviations within which a bias is plausible."""
_LARGEST_BIAS: Final = 0.5
"""Mean rate [rad/s] that no gyroscope reads at rest: data sheets state up to 20 deg/s."""
_WINDOWS: Final = 10
"""Windows of a rest whose means are compared."""
_MIN_READINGS: Final = 4
"""Readings in a window with which its mean is judged."""
_UNNOTICED: Final = (2e-3, 2e-2)
"""Scatter of the means [rad/s, m/s^2] that a sensor at rest may have, and that tilts by 2 mrad."""
_WALKED: Final = 40.0
"""Length of a rest [s] from which on that scatter grows as a random walk does."""
_LARGEST_RATIO: Final = 25.0
"""Variance of the windows' means, at most, over that of white noise: a low-pass filter makes it ten
times, and chance doubles that of ten means once in 50 times, triples it once in 1000."""
_TRUTH_MOVES: Final = 0.05
"""Distance [m] over which a true pose scatters at rest, at most."""
_TRUTH_TURNS: Final = 0.02
"""Angle [rad] over which a true pose scatters at rest, at most."""


class Level(NamedTuple):
    """Attitude and biases of a body, from a rest."""

    q_wb: Array
    """(4,) attitude with the given yaw."""
    gyroscope_bias: Array
    """(3,) bias of the gyroscope [rad/s]."""


def check_true_rest(position: Array, q_wb: Array) -> None:
    """Refuse true poses of a body that moves while it should rest.

    :param position: (n, 3) positions in the world [m].
    :param q_wb: (n, 4) attitudes.
    :raises InputError: for a body that moves.
    """
    distance = float(np.max(np.linalg.norm(position - position[0], axis=1)))
    turns = rotation.log(rotation.multiply(rotation.conjugate(q_wb[0]), q_wb))
    angle = float(np.max(np.linalg.norm(turns, axis=-1)))
    if distance > _TRUTH_MOVES or angle > _TRUTH_TURNS:
        raise InputError(
            f"by the truth the body moves by {distance:.3g} m and turns by {angle:.3g} rad within "
            "the time that is averaged: it is not at rest and cannot be levelled"
        )


def check_rest(gyro: Array, accel: Array, noise: TriadsParameters, time: float) -> None:
    """Refuse readings of a body that moves: means that change, or a rate that is no bias.

    Vibration, which averages out, is no motion; nor is a constant velocity, which readings cannot
    tell from rest.

    :param gyro: (n, 3) readings [rad/s], known errors removed.
    :param accel: (n, 3) readings [m/s^2], known errors removed.
    :param noise: errors of the sensor, as far as they are known.
    :param time: length of the rest [s].
    :raises InputError: for a body that moves.
    """
    if not len(gyro):
        return
    rate = float(np.max(np.abs(gyro.mean(axis=0))))
    limit = max(_LARGEST_BIAS, _SIGMAS * max(noise.gyroscope.turn_on_bias_sigma))
    if rate > limit:
        raise InputError(
            f"the mean rate is {rate:.3g} rad/s, and a gyroscope's bias at most {limit:.3g}: the "
            "body turns and cannot be levelled"
        )
    size = len(gyro) // _WINDOWS
    if size < _MIN_READINGS:
        return
    for values, triad, unnoticed, unit in (
        (gyro, noise.gyroscope, _UNNOTICED[0], "rad/s"),
        (accel, noise.accelerometer, _UNNOTICED[1], "m/s^2"),
    ):
        windows = values[: _WINDOWS * size].reshape(_WINDOWS, size, 3)
        scatter = windows.mean(axis=1).std(axis=0, ddof=1)
        white = np.sqrt(windows.var(axis=1, ddof=1).mean(axis=0) / size)
        slow = np.square(triad.random_walk) * time + np.square(triad.bias_instability)
        slow = np.sqrt(slow + np.square(triad.gauss_markov))
        usual = max(1.0, time / _WALKED) ** 0.5 * unnoticed + _SIGMAS * slow
        moving = (scatter > usual) & (scatter > np.sqrt(_LARGEST_RATIO) * white)
        if moving.any():
            axis = int(np.argmax(np.where(moving, scatter, 0.0)))
            raise InputError(
                f"the readings change by {scatter[axis]:.3g} {unit} on the axis {'xyz'[axis]} "
                "within the time that is averaged: the body moves and cannot be levelled"
            )


def level(
    gyro: Array,
    accel: Array,
    gravity: Sequence[float],
    yaw: float = 0.0,
    uncertainty: float = 0.0,
) -> Level:
    """Return the attitude of a body at rest, and its gyroscope's bias.

    The mean specific force points against gravity: ``f = -R^T g`` (Groves, section 5.6.2), which
    gives roll and pitch but no yaw; the mean rate of a body at rest is the bias.

    :param gyro: (n, 3) readings at rest [rad/s].
    :param accel: (n, 3) readings at rest [m/s^2].
    :param gravity: (3,) gravity, along the world's z axis [m/s^2].
    :param yaw: heading, which rest does not reveal [rad].
    :param uncertainty: standard deviation of the mean force's length by the sensor's own errors
        [m/s^2]; gravity may be missed by four of it, or by 5 %, whichever is more.
    :raises InputError: if the readings cannot be those of a body at rest, or gravity is not
        along z.
    """
    if not len(accel):
        raise InputError("no readings to level with")
    if gravity[0] != 0.0 or gravity[1] != 0.0:
        raise InputError(f"gravity {list(gravity)}: to level a body it must be along z")
    force = accel.mean(axis=0)
    strength = float(np.linalg.norm(gravity))
    measured = float(np.linalg.norm(force))
    tolerance = max(_GRAVITY_TOLERANCE * strength, _SIGMAS * uncertainty)
    if strength == 0.0 or abs(measured - strength) > tolerance:
        raise InputError(
            f"the mean specific force is {measured:.4g} m/s^2 and gravity {strength:.4g} m/s^2: "
            "the body is not at rest and cannot be levelled"
        )
    x, y, z = force * -np.sign(gravity[2])
    roll = np.arctan2(y, z)
    pitch = np.arctan2(-x, np.hypot(y, z))
    return Level(rotation.from_euler([roll, pitch, yaw]), gyro.mean(axis=0))


class Initial(NamedTuple):
    """The initial condition of integration."""

    state: NavigationState
    """State of the body."""
    correction: Correction
    covariance: Covariance
    """Covariance of the error of the IMU's state."""
    rate: Array | None = None
    """(3,) rate of the body relative to the world [rad/s]; None: that of the readings."""


def from_parameters(parameters: IntegratorParameters) -> Initial:
    """Return the start at :func:`parameter_state`."""
    return from_state(parameters, parameter_state(parameters))


def parameter_state(parameters: IntegratorParameters) -> NavigationState:
    """Return ``initial_position``, ``initial_velocity`` and ``initial_orientation``."""
    return NavigationState(
        np.array(parameters.initial_position),
        np.array(parameters.initial_velocity),
        rotation.from_euler(parameters.initial_orientation),
    )


def from_state(
    parameters: IntegratorParameters, state: NavigationState, rate: Array | None = None
) -> Initial:
    """Return the start at a known state, such as the truth's; the sensor's biases are not known.

    :param rate: (3,) of the body relative to the world [rad/s]. None: as the gyroscope reads it;
        the covariance leaves out what its error does to the velocity at a lever arm.
    """
    covariance = initial_covariance(
        gyroscope_bias=parameters.imu.gyroscope.turn_on_bias_sigma,
        accelerometer_bias=parameters.imu.accelerometer.turn_on_bias_sigma,
    )
    return Initial(state, correction_of(parameters), Covariance(parameters.imu, covariance), rate)


def is_long_enough(parameters: IntegratorParameters, first_ns: int, t_ns: int) -> bool:
    """Return whether the readings from one time to another are the rest that ``level`` averages."""
    return t_ns - first_ns >= round(parameters.level_time * 1e9)


def rest_rows(parameters: IntegratorParameters, t_ns: Times) -> slice:
    """Return which of a record's readings ``level`` averages: the first ``level_time`` without gap.

    The last of them is the reading that integration starts at.

    :param t_ns: (n,) stamps.
    :raises InputError: if no stretch is long enough.
    """
    step = np.diff(t_ns)
    max_gap = gap_length(parameters.max_gap, READINGS_GAP, t_ns)
    gaps = np.flatnonzero((step <= 0) | (step > longest_step_ns(max_gap))) + 1
    longest, length = 0, round(parameters.level_time * 1e9)
    for begin, end in itertools.pairwise([0, *gaps.tolist(), len(t_ns)]):
        piece = t_ns[begin:end]
        if not len(piece):
            continue
        rest = int(np.searchsorted(piece, piece[0] + length))
        if rest < len(piece):
            return slice(begin, begin + rest + 1)
        longest = max(longest, int(piece[-1] - piece[0]))
    raise InputError(
        f"{argument_prefix('level_time', f'{parameters.level_time:g}')}: the readings without a "
        f"gap last only {longest * 1e-9:.6g} s"
    )


def from_rest(
    parameters: IntegratorParameters,
    gyro: ArrayLike,
    accel: ArrayLike,
    *,
    position: Sequence[float] | Array | None = None,
    yaw: float | None = None,
    noise: TriadsParameters | None = None,
) -> Initial:
    """Return the start of a body at rest: roll, pitch and the gyroscope's bias from its readings.

    The known errors are removed first, so that what is left of the gyroscope's mean is the part of
    its bias that was not known. The bias is wanted in the readings themselves, ahead of scale and
    misalignment: ``reading = S (omega + delta) + G f + b`` is ``S omega + G f + (b + S delta)``.
    If the world rotates, the gyroscope reads its rate as well (Groves, section 5.6.1).

    :param gyro: (n, 3) readings [rad/s]; those that are not finite are skipped.
    :param accel: (n, 3) readings [m/s^2].
    :param position: (3,) position in the world [m]; None: ``initial_position``.
    :param yaw: heading [rad]; None: that of ``initial_orientation``.
    :param noise: errors of the sensor, which decide what rest may look like and the covariance;
        None: those of ``imu``.
    :raises InputError: if the readings cannot be those of a body at rest.
    """
    rates, forces = np.asarray(gyro, dtype=np.float64), np.asarray(accel, dtype=np.float64)
    finite = np.isfinite(rates).all(axis=1) & np.isfinite(forces).all(axis=1)
    known_errors = correction_of(parameters)
    rates, forces = known_errors.apply(rates[finite], forces[finite])
    mount = mount_of(parameters.imu)
    heading = parameters.initial_orientation[2] if yaw is None else yaw
    errors = parameters.imu if noise is None else noise
    response = math.hypot(
        max(errors.accelerometer.turn_on_scale_sigma), max(errors.accelerometer.misalignment_sigma)
    )
    by_scale = response * np.linalg.norm(parameters.gravity)
    uncertainty = math.hypot(max(errors.accelerometer.turn_on_bias_sigma), by_scale)
    check_rest(rates, forces, errors, parameters.level_time)
    forces_b = rotation.rotate(mount.q_bi, forces)
    levelled = level(rates, forces_b, parameters.gravity, heading, uncertainty)
    q_wi = rotation.multiply(levelled.q_wb, mount.q_bi)
    turning = rotation.rotate_inverse(q_wi, np.asarray(parameters.earth_rate))
    scale = np.reshape(parameters.gyroscope_scale_misalignment, (3, 3))
    bias = np.asarray(parameters.gyroscope_bias) + scale @ (levelled.gyroscope_bias - turning)
    x, y, z = bias.tolist()
    start = parameters.initial_position if position is None else position
    state = NavigationState(np.array(start), np.zeros(3), levelled.q_wb)
    correction = dataclasses.replace(known_errors, gyroscope_bias=(x, y, z))
    covariance = covariance_after_rest(
        errors,
        parameters.level_time,
        errors.accelerometer.turn_on_bias_sigma,
        rotation.to_matrix(levelled.q_wb),
        parameters.gravity,
        len(rates) / parameters.level_time,
        mount,
    )
    return Initial(state, correction, covariance, np.zeros(3))


def covariance_after_rest(
    noise: TriadsParameters,
    time: float,
    accelerometer_bias: ArrayLike,
    r_wb: Array,
    gravity: Sequence[float],
    rate_hz: float,
    mount: ImuMount = ALIGNED,
) -> Covariance:
    """Return the covariance at the end of a rest, which gives roll and pitch as well.

    The mean force of the rest is assumed to point up. With e the accelerometer's mean error in
    world axes and g the strength of gravity, the attitude is then wrong by ``theta = A e``,
    ``theta_x = -e_y / g`` and ``theta_y = e_x / g`` (Groves, "Principles of GNSS, inertial, and
    multisensor integrated navigation systems", 2nd edition, section 5.6.2), and the two go
    together: what the bias does to the velocity, the tilt undoes. The remaining gyroscope bias is
    its change since the rest. A body that is tilted about its origin moves the IMU.

    :param noise: the IMU's errors.
    :param time: length of the rest [s].
    :param accelerometer_bias: (3,) standard deviation of the constant bias, or one number [m/s^2].
    :param r_wb: (3, 3) attitude of the body.
    :param gravity: (3,) gravity in the world, along z [m/s^2].
    :param rate_hz: readings per second; it decides how far rounding averages out.
    :param mount: mount of the IMU in the body.
    :returns: covariance of the errors of the IMU's pose, velocity and biases.
    """
    covariance = Covariance(noise)
    p, slow = covariance.matrix, covariance.slow
    r_wi = r_wb if mount == ALIGNED else r_wb @ rotation.to_matrix(mount.q_bi)
    slow.act_on(ZERO_VECTOR, float_vector(-r_wi.T @ np.asarray(gravity)))
    # Each slow error has unit variance: the variance of its mean over the rest, and the covariance
    # of that mean with its value at the end, both (m,); their effects on the readings (3, m).
    mean, end = slow.over(time)
    gyro, accel = slow.effect[:3], slow.effect[3:]
    # A walk w of density K is off its mean over the rest by K^2 T / 3; E[mean(w) w] = K^2 T / 2.
    walk = np.square(noise.gyroscope.random_walk) * time
    white = noise.gyroscope.white_variance(rate_hz) / (time * rate_hz)
    p[GYRO_BIAS, GYRO_BIAS] = np.diag(white + walk / 3.0) + (gyro * mean) @ gyro.T
    slow.cross[GYRO_BIAS] = -gyro * end
    walk = np.square(noise.accelerometer.random_walk) * time
    constant = np.diag(np.broadcast_to(np.square(accelerometer_bias), 3))
    p[ACCEL_BIAS, ACCEL_BIAS] = constant + np.diag(walk)
    tilt = _turn_by_bias(r_wb) @ r_wi / -gravity[2]
    white = noise.accelerometer.white_variance(rate_hz) / (time * rate_hz)
    force_covariance = constant + np.diag(white + walk / 3.0) + (accel * mean) @ accel.T
    p[ATTITUDE, ATTITUDE] = tilt @ force_covariance @ tilt.T
    p[ATTITUDE, ATTITUDE][2, 2] += _vertical_variance(p[ATTITUDE, ATTITUDE][:2, :2], r_wb)
    p[ATTITUDE, ACCEL_BIAS] = tilt @ (constant + np.diag(0.5 * walk))
    p[ACCEL_BIAS, ATTITUDE] = p[ATTITUDE, ACCEL_BIAS].T
    slow.cross[ATTITUDE] = tilt @ accel * end
    # The gyroscope's slow errors share no axis with the accelerometer's; scales may.
    shared = -tilt @ (accel * mean) @ gyro.T
    p[ATTITUDE, GYRO_BIAS] = shared
    p[GYRO_BIAS, ATTITUDE] = shared.T
    to_imu = np.eye(len(p))
    to_imu[POSITION, ATTITUDE] = -rotation.skew(r_wb @ mount.lever_arm)
    return Covariance(noise, to_imu @ p @ to_imu.T, to_imu @ slow.cross)


def _turn_by_bias(r_wb: Array) -> Array:
    """Return (3, 3) the turn of a levelled attitude by a bias in the world's axes, times gravity.

    A bias b along the world's axes turns by ``(-b_y, b_x) / g`` about x and y. The heading that is
    kept is Euler's: at a pitch theta, a turn t about the horizontal axis ahead turns by
    ``-t tan(theta)`` about the vertical as well.
    """
    turn = np.array([[0.0, -1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, 0.0]])
    ahead = r_wb[:2, 0]  # cos(theta) (cos psi, sin psi); r_wb[2, 0] is -sin(theta)
    turn[2] = r_wb[2, 0] / max(float(ahead @ ahead), 1e-12) * (ahead @ turn[:2])
    return turn


def _vertical_variance(tilt: Array, r_wb: Array) -> float:
    """Return the mean square turn about the vertical, to second order in a level body's tilt.

    Roll and pitch that are wrong by a and b are the rotation ``exp(a x) exp(b y)``, whose vector
    has ``a b / 2`` about z; of normal a and b the mean of ``(a b)^2`` is ``A B + 2 C^2``.

    :param tilt: (2, 2) covariance about the world's x and y.
    """
    heading = np.arctan2(r_wb[1, 0], r_wb[0, 0])
    cosine, sine = np.cos(heading), np.sin(heading)
    axes = np.array([[cosine, sine], [-sine, cosine]])
    (a, c), (_, b) = axes @ tilt @ axes.T
    return float(0.25 * (a * b + 2.0 * c * c))
