# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Increments of records whose attitude is integrated as roll, pitch and yaw (lecture eq. 36, 38).

The rates of the three angles depend on roll and pitch alone. These two go step by step, in plain
floats; all that follows from them, yaw included, is computed for many intervals at once.
"""

import math
from collections.abc import Callable, Sequence
from typing import Final, TypeAlias

import numpy as np

from imu_sim_ros import rotation
from imu_sim_ros.errors import InputError
from imu_sim_ros.navigation.increments import Increments, euler_step, midpoint_step, rk4_step
from imu_sim_ros.types import Array, Mask

GIMBAL_LOCK_MARGIN: Final = math.radians(1.0)
"""[rad] Nearer than this, or than two steps, to a pitch of +-90 degrees Euler angles are not
integrated."""
_LAST_PITCH: Final = 0.5 * math.pi - GIMBAL_LOCK_MARGIN
_Start: TypeAlias = tuple[float, float]
"""Roll and pitch at an interval's start [rad]."""
_Rates: TypeAlias = Sequence[float]
"""The angular rate of an interval, at its start, in its middle and at its end: x, y, z of each."""


def gimbal_lock(seconds: float) -> InputError:
    """Return the error of Euler angles that cannot be integrated.

    :param seconds: from the first reading to the end of the interval.
    """
    return InputError(
        f"euler_angles: the pitch is near gimbal lock at 90 degrees, {seconds:.6g} s after the "
        "first reading; use so3 or quaternion"
    )


def _slope(roll: float, pitch: float, x: float, y: float, z: float) -> _Start:
    """Return the rates of roll and pitch for a body rate (lecture eq. 38)."""
    s, c = math.sin(roll), math.cos(roll)
    return x + math.tan(pitch) * (s * y + c * z), c * y - s * z


def _euler(roll: float, pitch: float, h: float, w: _Rates) -> _Start:
    a, b = _slope(roll, pitch, w[0], w[1], w[2])
    return roll + a * h, pitch + b * h


def _midpoint(roll: float, pitch: float, h: float, w: _Rates) -> _Start:
    _, _, _, x, y, z, _, _, _ = w
    a, b = _slope(roll, pitch, x, y, z)
    a, b = _slope(roll + 0.5 * h * a, pitch + 0.5 * h * b, x, y, z)
    return roll + a * h, pitch + b * h


def _rk4(roll: float, pitch: float, h: float, w: _Rates) -> _Start:
    x0, y0, z0, x, y, z, x1, y1, z1 = w
    half = 0.5 * h
    a1, b1 = _slope(roll, pitch, x0, y0, z0)
    a2, b2 = _slope(roll + half * a1, pitch + half * b1, x, y, z)
    a3, b3 = _slope(roll + half * a2, pitch + half * b2, x, y, z)
    a4, b4 = _slope(roll + h * a3, pitch + h * b3, x1, y1, z1)
    sixth = h / 6.0
    return (
        roll + sixth * (a1 + 2.0 * (a2 + a3) + a4),
        pitch + sixth * (b1 + 2.0 * (b2 + b3) + b4),
    )


class AngleIncrements:
    """The increments of a record, piece by piece."""

    def __init__(self, method: str, q_wb: Array) -> None:
        """Start at an attitude (4,).

        :param method: one of ``METHODS``.
        """
        self._method = method
        self._roll, self._pitch, _ = rotation.to_euler(q_wb).tolist()
        self._seconds = 0.0

    def __call__(self, h: Array, rate: Array, force: Array) -> Increments:
        """Return the increments between the next readings.

        :param h: (n,) lengths of the intervals [s].
        :param rate: (n + 1, 3) angular rates at the intervals' ends [rad/s].
        :param force: (n + 1, 3) specific forces at the intervals' ends [m/s^2].
        :raises InputError: near gimbal lock.
        """
        first, last = rate[:-1], rate[1:]
        mean = 0.5 * (first + last)
        after = METHODS[self._method][0]
        roll, pitch = self._roll, self._pitch
        found = []
        rows = np.concatenate([first, mean, last], axis=1).tolist()
        for length, rates in zip(h.tolist(), rows, strict=True):
            found.append((roll, pitch))
            if not -_LAST_PITCH <= pitch <= _LAST_PITCH:
                break
            roll, pitch = after(roll, pitch, length, rates)
        angles = np.empty((len(found), 3), order="F")
        angles[:, :2], angles[:, 2] = found, 0.0
        near = near_lock(angles[:, 1], h[: len(found)], first[: len(found)])
        if near.any():
            raise gimbal_lock(self._seconds + float(h[: int(np.argmax(near)) + 1].sum()))
        self._roll, self._pitch = roll, pitch
        self._seconds += float(h.sum())
        return increments_of(self._method, angles, h, rate, force)


def near_lock(pitch: Array, h: Array, rate: Array) -> Mask:
    """Return which pitches (n,) are within 1 degree, or two steps, of +-90 degrees.

    :param h: (n,) lengths of the steps [s].
    :param rate: (n, 3) [rad/s].
    """
    turned = 2.0 * np.sqrt(np.sum(rate * rate, axis=1)) * h
    margin = np.maximum(GIMBAL_LOCK_MARGIN, turned)
    near = (margin > 1.0) | (np.abs(np.sin(pitch)) > np.cos(margin))
    return near | (np.abs(pitch) > _LAST_PITCH)


def increments_of(method: str, angles: Array, h: Array, rate: Array, force: Array) -> Increments:
    """Return the increments from the angles (n, 3) at the starts.

    What they are seen from, the yaw, does not matter; the other arguments are those of
    :func:`~imu_sim_ros.navigation.increments.between`.
    """
    first, last = rate[:-1], rate[1:]
    mean = 0.5 * (first + last)
    back = rotation.conjugate(rotation.from_euler(angles))

    def relative(stage: Array) -> Array:
        return rotation.multiply(back, rotation.from_euler(stage))

    return METHODS[method][1](angles, h[:, None], (first, mean, last), force, relative)


_Rows: TypeAlias = tuple[Array, Array, Array]
"""Angular rates (n, 3) at the start, in the middle and at the end of each interval."""
_Relative: TypeAlias = Callable[[Array], Array]
"""Attitudes, seen from those at the start, by their angles."""


def _euler_steps(
    angles: Array, h: Array, rates: _Rows, force: Array, relative: _Relative
) -> Increments:
    return euler_step(relative(angles + _slopes(angles, rates[0]) * h), h, force)


def _midpoint_steps(
    angles: Array, h: Array, rates: _Rows, force: Array, relative: _Relative
) -> Increments:
    middle = angles + _slopes(angles, rates[1]) * (0.5 * h)
    return midpoint_step(relative(angles + _slopes(middle, rates[1]) * h), h, force)


def _rk4_steps(
    angles: Array, h: Array, rates: _Rows, force: Array, relative: _Relative
) -> Increments:
    first, mean, last = rates
    k1 = _slopes(angles, first)
    s2 = angles + k1 * (0.5 * h)
    k2 = _slopes(s2, mean)
    s3 = angles + k2 * (0.5 * h)
    k3 = _slopes(s3, mean)
    s4 = angles + k3 * h
    end = angles + (k1 + 2.0 * (k2 + k3) + _slopes(s4, last)) * (h / 6.0)
    return rk4_step((relative(s2), relative(s3), relative(s4), relative(end)), h, force)


METHODS: Final = {
    "euler": (_euler, _euler_steps),
    "midpoint": (_midpoint, _midpoint_steps),
    "rk4": (_rk4, _rk4_steps),
}
"""By method: roll and pitch after one interval, and the increments of many."""


def _slopes(angles: Array, rate: Array) -> Array:
    """Return the rates of roll, pitch and yaw (n, 3) for body rates (n, 3) (lecture eq. 38)."""
    roll, pitch, _ = angles.T
    x, y, z = rate.T
    s, c = np.sin(roll), np.cos(roll)
    across = s * y + c * z
    return np.stack([x + np.tan(pitch) * across, c * y - s * z, across / np.cos(pitch)]).T
