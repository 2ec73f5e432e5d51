# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""What moves the body during one interval, seen from its attitude at the interval's start.

An increment depends on the readings alone, not on the state, which is what makes whole records
fast: attitudes are running products, velocities and positions running sums. Arrays here have the
vector's components on the first axis, ``(3, n)`` and ``(4, n)``: every operand is then contiguous.
"""

from typing import NamedTuple

import numpy as np

from imu_sim_ros.rotation.components import cross, exp, multiply, normalise, rotate
from imu_sim_ros.types import Array


class Increments(NamedTuple):
    """The increments of n intervals of lengths h.

    With ``a(s)`` the specific force in the frame of the interval's start, the state moves by
    ``q <- q dq``, ``v <- v + g h + R dv`` and ``p <- p + (v_before + v_after) h / 2 + R dp``.
    """

    dq: Array
    """(4, n) unit quaternions, attitude of the end in the frame of the start."""
    dv: Array
    """(3, n) integral of a(s) [m/s]."""
    dp: Array | None
    """(3, n) double integral of a(s) less ``dv h / 2`` [m]; None if it is zero."""


def first_order(v: Array) -> Array:
    """Return the normalised ``(1, v / 2)`` (4, n) of rotation vectors (3, n) (lecture eq. 34)."""
    q = np.empty((4, *v.shape[1:]))
    q[0] = 1.0
    np.multiply(v, 0.5, out=q[1:])
    return normalise(q)


_TURNS = {"quaternion": first_order, "so3": exp}


def of_readings(method: str, attitude: str, h: Array, rate: Array, force: Array) -> Increments:
    """Return the increments between readings.

    :param method: euler, midpoint or rk4.
    :param attitude: quaternion or so3; Euler angles depend on the state and have no increments.
    :param h: (n,) lengths of the intervals [s].
    :param rate: (3, n + 1) angular rates at the intervals' ends [rad/s].
    :param force: (3, n + 1) specific forces at the intervals' ends [m/s^2].
    """
    if method == "euler":
        return euler_step(_TURNS[attitude](rate[:, :-1] * h), h, force)
    mean_rate = 0.5 * (rate[:, :-1] + rate[:, 1:])
    if method == "midpoint":
        return midpoint_step(_TURNS[attitude](mean_rate * h), h, force)
    stages = _quaternion_stages if attitude == "quaternion" else _so3_stages
    return rk4_step(stages(h, rate[:, :-1], mean_rate, rate[:, 1:]), h, force)


def euler_step(dq: Array, h: Array, force: Array) -> Increments:
    """Return increments of the Euler method whose attitudes turn by dq (4, n)."""
    return Increments(dq, force[:, :-1] * h, None)


def midpoint_step(dq: Array, h: Array, force: Array) -> Increments:
    """Return increments of the midpoint method whose attitudes turn by dq (4, n)."""
    return Increments(dq, (force[:, :-1] + rotate(dq, force[:, 1:])) * (0.5 * h), None)


def rk4_step(stages: tuple[Array, Array, Array, Array], h: Array, force: Array) -> Increments:
    """Return increments of rk4 from the attitudes (4, n) of stages 2, 3, 4 and of the end."""
    q2, q3, q4, dq = stages
    a1 = force[:, :-1]
    a_middle = 0.5 * (a1 + force[:, 1:])
    a2, a3, a4 = rotate(q2, a_middle), rotate(q3, a_middle), rotate(q4, force[:, 1:])
    dv = (a1 + 2.0 * (a2 + a3) + a4) * (h / 6.0)
    return Increments(dq, dv, (a1 - a4) * (h * h / 12.0))


def _so3_stages(h: Array, w0: Array, wm: Array, w1: Array) -> tuple[Array, Array, Array, Array]:
    phi2 = w0 * (0.5 * h)
    k2 = _vector_rate(phi2, wm)
    phi3 = k2 * (0.5 * h)
    k3 = _vector_rate(phi3, wm)
    phi4 = k3 * h
    k4 = _vector_rate(phi4, w1)
    end = (w0 + 2.0 * (k2 + k3) + k4) * (h / 6.0)
    return exp(phi2), exp(phi3), exp(phi4), exp(end)


def _vector_rate(phi: Array, w: Array) -> Array:
    """Jr(phi)^-1 w; the next term of the series is of fourth order in phi."""
    a = cross(phi, w)
    return w + 0.5 * a + cross(phi, a) / 12.0


def _quaternion_stages(
    h: Array, w0: Array, wm: Array, w1: Array
) -> tuple[Array, Array, Array, Array]:
    def slope(q: Array, w: Array) -> Array:
        return 0.5 * multiply(q, np.concatenate([np.zeros((1, *w.shape[1:])), w]))

    start = np.zeros((4, *h.shape))
    start[0] = 1.0
    k1 = slope(start, w0)
    q2 = start + k1 * (0.5 * h)
    k2 = slope(q2, wm)
    q3 = start + k2 * (0.5 * h)
    k3 = slope(q3, wm)
    q4 = start + k3 * h
    k4 = slope(q4, w1)
    end = start + (k1 + 2.0 * (k2 + k3) + k4) * (h / 6.0)
    return normalise(q2), normalise(q3), normalise(q4), normalise(end)
