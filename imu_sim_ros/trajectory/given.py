# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""A motion that comes from Python: an object with ``sample(t)``, or a function of time."""

import math
from collections.abc import Callable
from typing import Final, TypeVar

import numpy as np

from imu_sim_ros.core import gate, rotation
from imu_sim_ros.core.arguments import number, refuse
from imu_sim_ros.core.errors import ConfigurationError, ImuSimError
from imu_sim_ros.core.gate import Quantity
from imu_sim_ros.core.types import Array
from imu_sim_ros.recordings.repair import impossible_motion_lines
from imu_sim_ros.trajectory.motion import Motion, Trajectory

_T = TypeVar("_T")
STEP: Final = 2.0**-9
"""Step between the nine poses for the derivatives of a function [s]."""
_NODES: Final = np.arange(-4.0, 5.0)
_FASTEST: Final = 3.0 / (8.0 * STEP)
"""Rate at which eight steps turn by less than pi; a larger turn is ambiguous [rad/s]."""
_ACCELERATION: Final = Quantity("acceleration", 1e7, "m/s^2")
_ANGULAR_ACCELERATION: Final = Quantity("angular acceleration", 1e10, "rad/s^2")
_OF_MOTION: Final = (
    gate.POSITION,
    gate.VELOCITY,
    _ACCELERATION,
    gate.ORIENTATION,
    gate.RATE,
    _ANGULAR_ACCELERATION,
)
_OF_POSES: Final = (gate.POSITION, gate.ORIENTATION)
_UNIT: Final = 1e-6
"""Largest deviation of a quaternion's length from 1, in single precision."""
_LOOKS: Final = 10_000
"""Largest number of times at which a motion is checked."""
_LONGEST_LOOK: Final = 3600.0  # s
_NEIGHBOUR: Final = 2.0**-12  # s
_OF_PERIOD: Final = 0.04
"""A neighbour's part of the shortest period: by trapezia, the change is worked out to 0.5 %."""
_DISAGREES: Final = 0.02
"""Relative difference between a derivative and the change of its quantity that is reported."""
_OFTEN: Final = 0.01
"""Share of the times; an acceleration may jump at some."""
_LEAP: Final = 2.0
"""Change between two times that is a jump, over the change by the largest derivative."""
_ROUNDING: Final = 1e-3
"""Differences far above rounding [m/s, m/s^2, rad/s, rad/s^2]."""


def user_trajectory(motion: object) -> Trajectory | None:
    """Return a user's motion as a trajectory that checks each sample.

    :param motion: an object with ``sample(t)``, which returns a :class:`Motion`, or a function that
        returns positions and attitudes at times t (n,); either may have a ``duration`` [s].
    :returns: None for anything else.
    :raises ConfigurationError: for an invalid duration.
    """
    if isinstance(motion, type):
        return None
    sample = getattr(motion, "sample", None)
    if callable(sample):
        return CheckedMotion(sample, *_limits(motion))
    return Differentiated(motion, *_limits(motion)) if callable(motion) else None


def _limits(motion: object) -> tuple[float, float]:
    """Return duration [s] and highest frequency [Hz]."""
    duration = _call(lambda: getattr(motion, "duration", math.inf), "trajectory.duration")
    highest = _call(lambda: getattr(motion, "highest_frequency", 0.0), "highest_frequency")
    allowed = "seconds, more than 0; omitted or infinite if the motion has no end"
    return (
        number("trajectory.duration", duration, allowed, 0.0, math.inf, exclusive=True),
        number("trajectory.highest_frequency", highest, "Hz, from 0 to 1e6", 0.0, 1e6),
    )


class CheckedMotion:
    """Motion of a user's object; its samples are checked."""

    def __init__(
        self, sample: Callable[[Array], object], duration: float, highest_frequency: float
    ) -> None:
        self._sample = sample
        self.duration = duration
        self.highest_frequency = highest_frequency

    def sample(self, t: Array) -> Motion:
        """Return the motion at times t (n,) [s].

        :raises ConfigurationError: for what is no motion, and whatever the object raises.
        """
        samples = _call(lambda: self._sample(t), "trajectory.sample(t)")
        return Motion(*_check(samples, _OF_MOTION, t, "trajectory.sample(t)", "a Motion: "))


def suspicions(trajectory: Trajectory, duration: float, rate: float) -> list[str]:
    """Return a line for each thing that looks wrong with a motion from Python, if there is one.

    No body carries an IMU through it, or a part of it does not change as its derivative says: at up
    to 10,000 times of the first hour, the change to the next time may be at most twice what the
    largest derivative allows, and in a very short time it must be the mean of the derivative's
    values at its ends, at 99 % of the times: derivatives may jump.

    :param duration: time to examine [s]; may be infinite.
    :param rate: rate of the readings [Hz], which bounds the number of times.
    """
    motion: object = trajectory
    while not isinstance(motion, CheckedMotion | Differentiated):
        if motion is None:
            return []
        motion = getattr(motion, "inner", None)
    step = min(_NEIGHBOUR, _OF_PERIOD / max(motion.highest_frequency, 1e-9))
    end = min(duration, motion.duration, _LONGEST_LOOK) - step
    count = min(_LOOKS, math.ceil(end * rate))
    if count < 2:
        return []
    t: Array = np.linspace(0.0, end, count)
    motions = motion.sample(t)
    acceleration = np.linalg.norm(motions.acceleration, axis=1)
    turning = np.linalg.norm(motions.angular_velocity, axis=1)
    j, k = int(np.argmax(acceleration)), int(np.argmax(turning))
    lines = impossible_motion_lines("trajectory", acceleration[j], t[j], turning[k], t[k])
    if isinstance(motion, CheckedMotion):
        lines += _contradictions(t, step, motions, motion.sample(t + step))
    return lines


def _contradictions(t: Array, step: float, motions: Motion, next_to: Motion) -> list[str]:
    """Return a line for each quantity that is not the derivative of another one.

    :param t: (n,) times [s].
    :param step: short time between ``motions`` and ``next_to`` [s].
    :param motions: motion at these times; ``next_to``: motion the short time later.
    """
    m, n = motions, next_to
    lines: list[str] = []
    for name, derivative, unit, (long, short), start_rate, end_rate in (
        ("position", "velocity", "m", _changes(m.position, n.position), m.velocity, n.velocity),
        (
            "velocity",
            "acceleration",
            "m/s",
            _changes(m.velocity, n.velocity),
            m.acceleration,
            n.acceleration,
        ),
        (
            "attitude",
            "angular velocity",
            "rad",
            _rotations(m, n),
            m.angular_velocity,
            n.angular_velocity,
        ),
        (
            "angular velocity",
            "angular acceleration",
            "rad/s",
            _changes(m.angular_velocity, n.angular_velocity),
            m.angular_acceleration,
            n.angular_acceleration,
        ),
    ):
        mean_rate = 0.5 * (start_rate + end_rate)
        lines += _contradiction(name, derivative, unit, t, long, short / step, mean_rate)
    return lines


def _changes(vectors: Array, next_to: Array) -> tuple[Array, Array]:
    """Return the changes of vectors (n, 3) to the next time (n - 1, 3), and in a short one (n, 3).

    :param next_to: (n, 3) the vectors a short time later.
    """
    return np.diff(vectors, axis=0), next_to - vectors


def _rotations(motions: Motion, next_to: Motion) -> tuple[Array, Array]:
    """Return the rotations to the next time (n - 1, 3), and in a short one (n, 3) [rad]."""
    back = rotation.conjugate(motions.q_wb)
    return (
        rotation.log(rotation.multiply(back[:-1], motions.q_wb[1:])),
        rotation.log(rotation.multiply(back, next_to.q_wb)),
    )


def _contradiction(
    name: str, derivative: str, unit: str, t: Array, long: Array, measured: Array, stated: Array
) -> list[str]:
    """Return a line if a quantity does not change as its derivative says.

    :param t: (n,) times [s].
    :param long: (n - 1, 3) changes of the quantity from each time to the next.
    :param measured: (n, 3) rates of change of the quantity in a very short time.
    :param stated: (n, 3) mean of the stated derivative in that time.
    """
    off = np.linalg.norm(measured - stated, axis=1)
    size = max(np.linalg.norm(stated, axis=1).max(), np.median(np.linalg.norm(measured, axis=1)))
    bad = off > _DISAGREES * size + _ROUNDING
    if bad.mean() > _OFTEN:
        k = int(np.argmax(off))
        texts = (" ".join(f"{value:.4g}" for value in row) for row in (stated[k], measured[k]))
        return [
            "trajectory.sample(t): {0} contradicts {1}: at t = {2:.4g} s it is [{4}] {3}/s, but "
            "the {1} changes by [{5}] {3}/s".format(derivative, name, t[k], unit, *texts)
        ]
    step = float(t[1] - t[0])
    leaps = np.linalg.norm(long, axis=1)
    k = int(np.argmax(leaps))
    if leaps[k] <= _LEAP * size * step + _ROUNDING:
        return []
    return [
        f"trajectory.sample(t): the {name} jumps by {leaps[k]:.4g} {unit} between t = {t[k]:.6g} "
        f"and {t[k + 1]:.6g} s; its {derivative} is at most {size:.4g} {unit}/s"
    ]


class Differentiated:
    """Poses of a function, with derivatives from nine of them around each time.

    Position and rotation vector from the attitude at t are followed by the polynomials of degree 8
    through the poses at t - 4 h ... t + 4 h (Fornberg, Math. Comp. 51, 1988): order 8 in h for
    velocity, acceleration, angular rate and acceleration. At the ends the nine poses are the first
    or the last ones, and the order is 8 and 7.
    """

    def __init__(
        self, poses: Callable[[Array], object], duration: float, highest_frequency: float
    ) -> None:
        """Initialise with a function of poses.

        :param poses: returns the poses at times t (n,) [s].
        :param duration: length of the motion [s].
        :param highest_frequency: highest frequency of the motion [Hz].
        :raises ConfigurationError: for a motion that is shorter than eight steps.
        """
        if duration < 8.0 * STEP:
            raise ConfigurationError(
                f"trajectory.duration = {duration:g}: must be at least {8.0 * STEP:g} s"
            )
        self._poses = poses
        self.duration = duration
        self.highest_frequency = highest_frequency

    def sample(self, t: Array) -> Motion:
        """Return the motion at times t (n,) [s].

        :raises ConfigurationError: for what are no poses, and whatever the function raises.
        """
        middle = np.clip(t, 4.0 * STEP, self.duration - 4.0 * STEP)
        times = np.concatenate([t[None], middle + STEP * _NODES[:, None]])
        poses = _call(lambda: self._poses(times.ravel()), "trajectory(t)")
        position, q_wb = _check(poses, _OF_POSES, times.ravel(), "trajectory(t)", "")
        p = position.reshape(10, -1, 3)
        q = q_wb.reshape(10, -1, 4)
        step = rotation.log(rotation.multiply(rotation.conjugate(q[1:-1]), q[2:]))
        fastest = np.linalg.norm(step, axis=-1).max(initial=0.0) / STEP
        if fastest > _FASTEST:
            raise ConfigurationError(
                f"trajectory(t): turns at {fastest:.4g} rad/s; a function may turn at {_FASTEST:g} "
                "rad/s: give an object with sample(t)"
            )
        turn = rotation.log(rotation.multiply(rotation.conjugate(q[0]), q[1:]))
        d1, d2 = _weights((t - middle) / STEP)
        return Motion(
            position=p[0],
            velocity=np.einsum("kn,kni->ni", d1, p[1:] - p[0]),
            acceleration=np.einsum("kn,kni->ni", d2, p[1:] - p[0]),
            q_wb=q[0],
            # The turn is 0 at t itself, so that its right Jacobian is the identity there, and the
            # Jacobian's derivative falls out of the angular acceleration: phi' x phi' = 0.
            angular_velocity=np.einsum("kn,kni->ni", d1, turn),
            angular_acceleration=np.einsum("kn,kni->ni", d2, turn),
        )


_INVERSE: Final = np.linalg.inv(np.vander(_NODES, increasing=True))
"""(9, 9) coefficients of the polynomial through values at the nodes."""


def _weights(s: Array) -> tuple[Array, Array]:
    """Return the weights (9, n) of nine values in the first and second derivative [1/s, 1/s^2].

    :param s: (n,) where the derivative is taken, in steps from the middle.
    """
    powers = s[None] ** np.arange(9)[:, None]
    k = np.arange(1, 9)[:, None]
    d1 = _INVERSE[1:].T @ (k * powers[:-1]) / STEP
    d2 = _INVERSE[2:].T @ (k[1:] * k[:-1] * powers[:-2]) / STEP**2
    return d1, d2


def _call(function: Callable[[], _T], name: str) -> _T:
    """Return the result of a user's function.

    :raises ConfigurationError: for whatever it raises, with the line where.
    """
    try:
        return function()
    except ImuSimError:
        raise
    except Exception as error:
        import traceback

        where = traceback.extract_tb(error.__traceback__)[-1]
        raise ConfigurationError(
            f"{name}: raised {type(error).__name__}: {error} (line {where.lineno} of "
            f"{where.filename})"
        ) from error


def _check(
    values_found: object, quantities: tuple[Quantity, ...], t: Array, name: str, kind: str
) -> list[Array]:
    """Return checked arrays of a user's motion, one for each quantity.

    :param values_found: what the user's function returned: an array (n, 3) or (n, 4) of each.
    :param t: (n,) times for which it was called [s].
    :param name: name of the function, and ``kind`` of the values that it should return, for
        messages.
    :raises ConfigurationError: for another number of them, other shapes, and values that no body
        has, with the time of the first one.
    """
    widths = [4 if quantity is gate.ORIENTATION else 3 for quantity in quantities]
    content = ", ".join(f"{q.name} (n, {w})" for q, w in zip(quantities, widths, strict=True))
    allowed = f"{kind}{content}, for the {len(t)} times"
    if not isinstance(values_found, tuple | list) or len(values_found) != len(quantities):
        refuse(name, values_found, allowed, wrong_type=True)
    arrays = []
    for quantity, width, values in zip(quantities, widths, values_found, strict=True):
        try:
            array = np.array(values, dtype=np.float64)
            if isinstance(values, np.ma.MaskedArray):
                array[np.broadcast_to(values.mask, array.shape)] = math.nan
        except (TypeError, ValueError):
            refuse(f"{name}: {quantity.name}", values, allowed, wrong_type=True)
        if array.shape != (len(t), width):
            raise ConfigurationError(
                f"{name}: {quantity.name} of the shape {array.shape}: must be {allowed}"
            )
        arrays.append(array)
    verdict = gate.Verdict(None, list(zip(quantities, arrays, strict=True)))
    for row in verdict.bad[:1]:
        raise ConfigurationError(f"{name}: at t = {t[row]:g} s {verdict.why(int(row))}")
    index = quantities.index(gate.ORIENTATION)
    lengths = np.linalg.norm(arrays[index], axis=1)
    for row in np.flatnonzero(np.abs(lengths - 1.0) > _UNIT)[:1]:
        raise ConfigurationError(
            f"{name}: at t = {t[row]:g} s a quaternion of length {lengths[row]:.7g}: must be 1 "
            f"within {_UNIT:g}"
        )
    arrays[index] = gate.normalise_quaternions(arrays[index])
    return arrays
