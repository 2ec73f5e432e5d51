# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Increments of records whose attitude is integrated as roll, pitch and yaw (lecture eq. 36, 38).

The rates of the three angles depend on roll and pitch alone. Of a record, these two go step by
step, in floats; all that follows from them, yaw included, is computed for many intervals at once.
"""

import math
from collections.abc import Callable, Sequence
from typing import Final, Protocol, TypeAlias, overload

import numpy as np

from imu_sim_ros.core import rotation
from imu_sim_ros.core.components import (
    Component,
    Vector,
    conjugate,
    cos,
    from_euler,
    multiply,
    sin,
    sqrt,
    tan,
    where,
)
from imu_sim_ros.core.errors import InputError
from imu_sim_ros.core.spelling import argument_prefix
from imu_sim_ros.core.types import Array, Mask
from imu_sim_ros.navigation.increments import (
    Ends,
    Increment,
    IntegrationStep,
    euler_step,
    mean,
    midpoint_step,
    rk4_step,
    simpson,
)

GIMBAL_LOCK_MARGIN: Final = math.radians(1.0)
"""Smallest distance of the pitch from +-90 degrees [rad], together with that of two steps, at which
Euler angles are integrated."""
_LAST_PITCH: Final = 0.5 * math.pi - GIMBAL_LOCK_MARGIN
_Start: TypeAlias = tuple[float, float]
"""Roll and pitch at an interval's start [rad]."""
_Row: TypeAlias = Sequence[float]
"""The angular rate of an interval, at its start, in its middle and at its end: x, y, z of each."""
_Rates: TypeAlias = tuple[Vector[Component], Vector[Component], Vector[Component]]
"""The angular rates of intervals at their starts, in their middles and at their ends [rad/s]."""
_Angles: TypeAlias = tuple[Vector[Component], ...]
"""Roll, pitch, yaw [rad] at a method's stages and, last, at the interval's end."""


def gimbal_lock(seconds: float) -> InputError:
    """Return the error of Euler angles that cannot be integrated.

    :param seconds: from the first reading to the end of the interval.
    """
    return InputError(
        f"{argument_prefix('euler_angles')}: the pitch is near gimbal lock at 90 degrees, "
        f"{seconds:.6g} s after the first reading; use so3 or quaternion"
    )


def _slope(roll: float, pitch: float, x: float, y: float, z: float) -> _Start:
    """Return the rates of roll and pitch for a body rate (lecture eq. 38)."""
    s, c = math.sin(roll), math.cos(roll)
    return x + math.tan(pitch) * (s * y + c * z), c * y - s * z


def _roll_pitch_euler(roll: float, pitch: float, h: float, w: _Row) -> _Start:
    """Return roll and pitch after a step of Euler's method."""
    a, b = _slope(roll, pitch, w[0], w[1], w[2])
    return roll + a * h, pitch + b * h


def _roll_pitch_midpoint(roll: float, pitch: float, h: float, w: _Row) -> _Start:
    """Return roll and pitch after a step of the midpoint method."""
    _, _, _, x, y, z, _, _, _ = w
    a, b = _slope(roll, pitch, x, y, z)
    a, b = _slope(roll + 0.5 * h * a, pitch + 0.5 * h * b, x, y, z)
    return roll + a * h, pitch + b * h


def _roll_pitch_rk4(roll: float, pitch: float, h: float, w: _Row) -> _Start:
    """Return roll and pitch after a step of the Runge-Kutta method of order 4."""
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


class StageAngles(Protocol):
    """The angles of a method's stages."""

    def __call__(
        self, angles: Vector[Component], h: Component, rates: _Rates[Component], /
    ) -> _Angles[Component]:
        """Return the angles of the stages from those at the interval's start."""


def _slopes(angles: Vector[Component], rate: Vector[Component]) -> Vector[Component]:
    """Return the rates of roll, pitch and yaw for a body rate (lecture eq. 38)."""
    roll, pitch, _ = angles
    x, y, z = rate
    s, c = sin(roll), cos(roll)
    across = s * y + c * z
    return x + tan(pitch) * across, c * y - s * z, across / cos(pitch)


def _ahead(angles: Vector[Component], slopes: Vector[Component], h: Component) -> Vector[Component]:
    """Return ``angles + slopes h``."""
    x, y, z = angles
    a, b, c = slopes
    return x + a * h, y + b * h, z + c * h


def _euler(angles: Vector[Component], h: Component, rates: _Rates[Component]) -> _Angles[Component]:
    """Return the angles at the end of a step of Euler's method."""
    return (_ahead(angles, _slopes(angles, rates[0]), h),)


def _midpoint(
    angles: Vector[Component], h: Component, rates: _Rates[Component]
) -> _Angles[Component]:
    """Return the angles at the end of a step of the midpoint method."""
    middle = _ahead(angles, _slopes(angles, rates[1]), 0.5 * h)
    return (_ahead(angles, _slopes(middle, rates[1]), h),)


def _rk4(angles: Vector[Component], h: Component, rates: _Rates[Component]) -> _Angles[Component]:
    """Return the angles at the stages of a Runge-Kutta step of order 4, the last at its end."""
    w0, wm, w1 = rates
    half = 0.5 * h
    k1 = _slopes(angles, w0)
    s2 = _ahead(angles, k1, half)
    k2 = _slopes(s2, wm)
    s3 = _ahead(angles, k2, half)
    k3 = _slopes(s3, wm)
    s4 = _ahead(angles, k3, h)
    a, b, c = simpson(k1, k2, k3, _slopes(s4, w1), h / 6.0)
    return s2, s3, s4, (angles[0] + a, angles[1] + b, angles[2] + c)


METHODS: Final[
    dict[str, tuple[Callable[[float, float, float, _Row], _Start], StageAngles, IntegrationStep]]
] = {
    "euler": (_roll_pitch_euler, _euler, euler_step),
    "midpoint": (_roll_pitch_midpoint, _midpoint, midpoint_step),
    "rk4": (_roll_pitch_rk4, _rk4, rk4_step),
}
"""Roll and pitch after one interval, angles of its stages, and increment from the attitudes of
the stages, by method."""


class AngleIncrements:
    """The increments of a record, piece by piece."""

    def __init__(self, method: str, q_wb: Array) -> None:
        """Start at an attitude (4,).

        :param method: one of ``METHODS``.
        """
        self._method = method
        self._roll, self._pitch, _ = rotation.to_euler(q_wb).tolist()
        self._seconds = 0.0

    def __call__(self, h: Array, rate: Ends[Array], force: Ends[Array]) -> Increment[Array]:
        """Return the increments between the next readings.

        :param h: (n,) lengths of the intervals [s].
        :param rate: (n,) angular rates at the intervals' ends [rad/s].
        :param force: (n,) specific forces at the intervals' ends [m/s^2].
        :raises InputError: near gimbal lock.
        """
        middle = mean(*rate)
        angles_after = METHODS[self._method][0]
        roll, pitch = self._roll, self._pitch
        starts = []
        rows = np.array([*rate[0], *middle, *rate[1]]).T.tolist()
        for length, rates in zip(h.tolist(), rows, strict=True):
            starts.append((roll, pitch))
            if not -_LAST_PITCH <= pitch <= _LAST_PITCH:
                break
            roll, pitch = angles_after(roll, pitch, length, rates)
        n = len(starts)
        x, y, z = rate[0]
        rolls, pitches = np.array(starts).T.copy()
        near_gimbal_lock = is_near_gimbal_lock(pitches, h[:n], (x[:n], y[:n], z[:n]))
        if near_gimbal_lock.any():
            raise gimbal_lock(
                self._seconds + float(h[: int(np.argmax(near_gimbal_lock)) + 1].sum())
            )
        self._roll, self._pitch = roll, pitch
        self._seconds += float(h.sum())
        return increment_of(self._method, (rolls, pitches, np.zeros(n)), h, rate, force)


@overload
def is_near_gimbal_lock(pitch: float, h: float, rate: Vector[float]) -> bool: ...
@overload
def is_near_gimbal_lock(pitch: Array, h: Array, rate: Vector[Array]) -> Mask: ...
def is_near_gimbal_lock(pitch: Component, h: Component, rate: Vector[Component]) -> bool | Mask:
    """Return where a pitch is within 1 degree, or two steps, of +-90 degrees.

    :param h: length of the step [s].
    :param rate: angular rate [rad/s].
    """
    x, y, z = rate
    turned = 2.0 * sqrt(x * x + y * y + z * z) * h
    margin = where(turned > GIMBAL_LOCK_MARGIN, turned, GIMBAL_LOCK_MARGIN)
    return (margin > 1.0) | (abs(sin(pitch)) > cos(margin)) | (abs(pitch) > _LAST_PITCH)


def increment_of(
    method: str,
    angles: Vector[Component],
    h: Component,
    rate: Ends[Component],
    force: Ends[Component],
) -> Increment[Component]:
    """Return the increment from the angles at the start.

    The yaw of the start does not matter; the other arguments are those of
    :func:`~imu_sim_ros.navigation.increments.increment_between`.
    """
    _, stages, step = METHODS[method]
    back = conjugate(from_euler(angles))
    turns = stages(angles, h, (rate[0], mean(*rate), rate[1]))
    return step(tuple(multiply(back, from_euler(turn)) for turn in turns), h, force)
