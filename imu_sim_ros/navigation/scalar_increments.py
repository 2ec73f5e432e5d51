# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""The increment of one interval in plain floats, for the stepper.

The formulas are those of :mod:`imu_sim_ros.navigation.increments`, if they are
written for arrays.
"""

from collections.abc import Callable
from typing import TypeAlias

from imu_sim_ros.rotation.scalars import (
    Q4,
    V3,
    ZERO,
    conjugate,
    cross,
    euler_rates,
    exp,
    from_euler,
    mean,
    multiply,
    normalise,
    rotate,
    scaled,
    to_euler,
)

Increment: TypeAlias = tuple[Q4, V3, V3]
"""(dq, dv, dp) of an interval, see ``Increments`` of the arrays."""
IncrementOf: TypeAlias = Callable[[Q4, float, V3, V3, V3, V3], Increment]
"""(attitude at the start, length, rate at start and end, force at start and end) -> increment."""


def _moved(angles: V3, rates: V3, h: float) -> V3:
    return (angles[0] + rates[0] * h, angles[1] + rates[1] * h, angles[2] + rates[2] * h)


def turn_quaternion(_: Q4, rate: V3, h: float) -> Q4:
    """Return the increment of attitude to first order, normalised (lecture eq. 34)."""
    s = 0.5 * h
    return normalise((1.0, rate[0] * s, rate[1] * s, rate[2] * s))


def turn_so3(_: Q4, rate: V3, h: float) -> Q4:
    """Return the increment of attitude of a constant rate (lecture eq. 35)."""
    return exp(scaled(rate, h))


def turn_angles(q: Q4, rate: V3, h: float) -> Q4:
    """Return the increment of attitude by Euler angles (lecture eq. 36)."""
    angles = to_euler(q)
    moved = _moved(angles, euler_rates(angles, rate), h)
    return multiply(conjugate(q), from_euler(moved))


def turn_angles_midpoint(q: Q4, rate: V3, h: float) -> Q4:
    """Return the same with the matrix of eq. 38 at the interval's middle: second order."""
    angles = to_euler(q)
    middle = _moved(angles, euler_rates(angles, rate), 0.5 * h)
    moved = _moved(angles, euler_rates(middle, rate), h)
    return multiply(conjugate(q), from_euler(moved))


Turn: TypeAlias = Callable[[Q4, V3, float], Q4]


def euler(turn: Turn) -> IncrementOf:
    """Return the increment of the Euler method with an attitude update."""

    def increment(q: Q4, h: float, w0: V3, _w1: V3, f0: V3, _f1: V3) -> Increment:
        return turn(q, w0, h), scaled(f0, h), ZERO

    return increment


def midpoint(turn: Turn) -> IncrementOf:
    """Return the increment of the midpoint method with an attitude update."""

    def increment(q: Q4, h: float, w0: V3, w1: V3, f0: V3, f1: V3) -> Increment:
        dq = turn(q, mean(w0, w1), h)
        return dq, scaled(mean(f0, rotate(dq, f1)), h), ZERO

    return increment


Stages: TypeAlias = Callable[[Q4, float, V3, V3, V3], tuple[Q4, Q4, Q4, Q4]]
"""(attitude, length, rate at start, middle, end) -> attitudes of stages 2, 3, 4 and of the end."""


def rk4(stages: Stages) -> IncrementOf:
    """Return the increment of the classical Runge-Kutta method with an attitude's stages."""

    def increment(q: Q4, h: float, w0: V3, w1: V3, f0: V3, f1: V3) -> Increment:
        force = mean(f0, f1)
        q2, q3, q4, dq = stages(q, h, w0, mean(w0, w1), w1)
        a2, a3, a4 = rotate(q2, force), rotate(q3, force), rotate(q4, f1)
        s, t = h / 6.0, h * h / 12.0
        dv = (
            s * (f0[0] + 2.0 * (a2[0] + a3[0]) + a4[0]),
            s * (f0[1] + 2.0 * (a2[1] + a3[1]) + a4[1]),
            s * (f0[2] + 2.0 * (a2[2] + a3[2]) + a4[2]),
        )
        dp = (t * (f0[0] - a4[0]), t * (f0[1] - a4[1]), t * (f0[2] - a4[2]))
        return dq, dv, dp

    return increment


def _weighted(k1: V3, k2: V3, k3: V3, k4: V3, h: float) -> V3:
    s = h / 6.0
    return (
        s * (k1[0] + 2.0 * (k2[0] + k3[0]) + k4[0]),
        s * (k1[1] + 2.0 * (k2[1] + k3[1]) + k4[1]),
        s * (k1[2] + 2.0 * (k2[2] + k3[2]) + k4[2]),
    )


def _vector_rate(phi: V3, w: V3) -> V3:
    """Return the rate of a rotation vector, Jr(phi)^-1 w up to the order that rk4 needs."""
    ax, ay, az = a = cross(phi, w)
    bx, by, bz = cross(phi, a)
    s = 1.0 / 12.0
    return (w[0] + 0.5 * ax + s * bx, w[1] + 0.5 * ay + s * by, w[2] + 0.5 * az + s * bz)


def so3_stages(_: Q4, h: float, w0: V3, wm: V3, w1: V3) -> tuple[Q4, Q4, Q4, Q4]:
    """Return the stages of the rotation vector (Munthe-Kaas 1998)."""
    phi2 = scaled(w0, 0.5 * h)
    k2 = _vector_rate(phi2, wm)
    phi3 = scaled(k2, 0.5 * h)
    k3 = _vector_rate(phi3, wm)
    phi4 = scaled(k3, h)
    k4 = _vector_rate(phi4, w1)
    return exp(phi2), exp(phi3), exp(phi4), exp(_weighted(w0, k2, k3, k4, h))


def quaternion_stages(_: Q4, h: float, w0: V3, wm: V3, w1: V3) -> tuple[Q4, Q4, Q4, Q4]:
    """Return the stages of ``dq/dt = q (0, w) / 2`` from identity."""

    def slope(q: Q4, w: V3) -> Q4:
        return multiply(q, (0.0, 0.5 * w[0], 0.5 * w[1], 0.5 * w[2]))

    def moved(k: Q4, s: float) -> Q4:
        return (1.0 + s * k[0], s * k[1], s * k[2], s * k[3])

    k1: Q4 = (0.0, 0.5 * w0[0], 0.5 * w0[1], 0.5 * w0[2])
    q2 = moved(k1, 0.5 * h)
    k2 = slope(q2, wm)
    q3 = moved(k2, 0.5 * h)
    k3 = slope(q3, wm)
    q4 = moved(k3, h)
    k4 = slope(q4, w1)
    total = (
        k1[0] + 2.0 * (k2[0] + k3[0]) + k4[0],
        k1[1] + 2.0 * (k2[1] + k3[1]) + k4[1],
        k1[2] + 2.0 * (k2[2] + k3[2]) + k4[2],
        k1[3] + 2.0 * (k2[3] + k3[3]) + k4[3],
    )
    return normalise(q2), normalise(q3), normalise(q4), normalise(moved(total, h / 6.0))


def angles_stages(q: Q4, h: float, w0: V3, wm: V3, w1: V3) -> tuple[Q4, Q4, Q4, Q4]:
    """Return the stages of roll, pitch and yaw, as attitudes relative to the start."""
    angles = to_euler(q)
    back = conjugate(q)

    def attitude(stage: V3) -> Q4:
        return multiply(back, from_euler(stage))

    k1 = euler_rates(angles, w0)
    s2 = _moved(angles, k1, 0.5 * h)
    k2 = euler_rates(s2, wm)
    s3 = _moved(angles, k2, 0.5 * h)
    k3 = euler_rates(s3, wm)
    s4 = _moved(angles, k3, h)
    k4 = euler_rates(s4, w1)
    end = _moved(angles, _weighted(k1, k2, k3, k4, h), 1.0)
    return attitude(s2), attitude(s3), attitude(s4), attitude(end)


INCREMENTS: dict[tuple[str, str], IncrementOf] = {
    ("euler", "quaternion"): euler(turn_quaternion),
    ("euler", "so3"): euler(turn_so3),
    ("euler", "euler_angles"): euler(turn_angles),
    ("midpoint", "quaternion"): midpoint(turn_quaternion),
    ("midpoint", "so3"): midpoint(turn_so3),
    ("midpoint", "euler_angles"): midpoint(turn_angles_midpoint),
    ("rk4", "quaternion"): rk4(quaternion_stages),
    ("rk4", "so3"): rk4(so3_stages),
    ("rk4", "euler_angles"): rk4(angles_stages),
}
"""The increment of every method (first) with every attitude update (second)."""
