# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""The motion of a body during one interval, as seen from its attitude at the interval's start.

An increment depends on the readings alone, not on the state, which is what makes whole records
fast: attitudes are running products, velocities and positions running sums. All formulas are over
components (:mod:`imu_sim_ros.core.components`): floats for one interval, arrays (n,) for n of them.
"""

from collections.abc import Iterable
from typing import Final, NamedTuple, Protocol, TypeAlias

import numpy as np

from imu_sim_ros.core.components import (
    Component,
    Quaternion,
    Vector,
    cross,
    exp,
    float_vector,
    multiply,
    normalise,
    quaternion,
    rotate,
    sqrt,
)
from imu_sim_ros.core.rotation import cumulative_product

Ends: TypeAlias = tuple[Vector[Component], Vector[Component]]
"""A reading at the start and at the end of an interval."""
Stages: TypeAlias = tuple[Quaternion[Component], ...]
"""Attitudes in the frame of the interval's start, at a method's stages and, last, at its end."""
Increment: TypeAlias = tuple[Quaternion[Component], Vector[Component], Vector[Component] | None]
"""``(dq, dv, dp)`` of an interval of length h.

With ``a(s)`` the specific force in the frame of the interval's start, the state moves by
``q <- q dq``, ``v <- v + g h + R dv`` and ``p <- p + (v_before + v_after) h / 2 + R dp``: dq is the
attitude of the end in the frame of the start, dv the integral of a(s) [m/s], dp its double integral
less ``dv h / 2`` [m], None if that is zero.
"""
State: TypeAlias = tuple[Vector[Component], Vector[Component], Quaternion[Component]]
"""Position [m] and velocity [m/s] in the world, and ``q_wb``."""


class AttitudeUpdate(Protocol):
    """The attitude that a rotation vector [rad] turns to."""

    def __call__(self, v: Vector[Component], /) -> Quaternion[Component]:
        """Return the unit quaternion."""


class TurnStages(Protocol):
    """The attitudes of rk4's stages under an attitude update."""

    def __call__(
        self,
        h: Component,
        w0: Vector[Component],
        wm: Vector[Component],
        w1: Vector[Component],
        /,
    ) -> Stages[Component]:
        """Return the stages from the rates at the start, in the middle and at the end [rad/s]."""


class IntegrationMethod(Protocol):
    """An integration method."""

    def __call__(
        self,
        attitude: str,
        h: Component,
        rate: Ends[Component],
        force: Ends[Component],
        /,
    ) -> Increment[Component]:
        """Return the increment; arguments as for :func:`increment_between`."""


class IntegrationStep(Protocol):
    """The part of a method that moves the body, given how its attitude turns."""

    def __call__(
        self, stages: Stages[Component], h: Component, force: Ends[Component], /
    ) -> Increment[Component]:
        """Return the increment."""


def first_order_rotation(v: Vector[Component]) -> Quaternion[Component]:
    """Return the normalised ``(1, v / 2)`` of a rotation vector (lecture eq. 34)."""
    x, y, z = 0.5 * v[0], 0.5 * v[1], 0.5 * v[2]
    length = sqrt(1.0 + x * x + y * y + z * z)
    return 1.0 / length, x / length, y / length, z / length


_TURNS: Final[dict[str, AttitudeUpdate]] = {"quaternion": first_order_rotation, "so3": exp}


def increment_between(
    method: str, attitude: str, h: Component, rate: Ends[Component], force: Ends[Component]
) -> Increment[Component]:
    """Return the increment between two readings.

    :param method: one of ``METHODS``.
    :param attitude: quaternion or so3; Euler angles depend on the state and have no increments.
    :param h: length of the interval [s].
    :param rate: angular rates at its ends [rad/s].
    :param force: specific forces at its ends [m/s^2].
    """
    return METHODS[method](attitude, h, rate, force)


def _euler(
    attitude: str, h: Component, rate: Ends[Component], force: Ends[Component]
) -> Increment[Component]:
    """Return the increment of Euler's method."""
    return euler_step((_TURNS[attitude](scale(rate[0], h)),), h, force)


def _midpoint(
    attitude: str, h: Component, rate: Ends[Component], force: Ends[Component]
) -> Increment[Component]:
    """Return the increment of the midpoint method."""
    return midpoint_step((_TURNS[attitude](scale(mean(*rate), h)),), h, force)


def _rk4(
    attitude: str, h: Component, rate: Ends[Component], force: Ends[Component]
) -> Increment[Component]:
    """Return the increment of the Runge-Kutta method of order 4."""
    return rk4_step(_STAGES[attitude](h, rate[0], mean(*rate), rate[1]), h, force)


METHODS: Final[dict[str, IntegrationMethod]] = {
    "euler": _euler,
    "midpoint": _midpoint,
    "rk4": _rk4,
}
"""(attitude update, h, rate, force) -> increment, by name: the list of all methods."""


def scale(v: Vector[Component], factor: Component) -> Vector[Component]:
    """Return ``factor v``."""
    return v[0] * factor, v[1] * factor, v[2] * factor


def mean(a: Vector[Component], b: Vector[Component]) -> Vector[Component]:
    """Return ``(a + b) / 2``."""
    return 0.5 * (a[0] + b[0]), 0.5 * (a[1] + b[1]), 0.5 * (a[2] + b[2])


def euler_step(
    stages: Stages[Component], h: Component, force: Ends[Component]
) -> Increment[Component]:
    """Return ``(dq, dv, dp)`` of the Euler method: the force stays that of the start.

    :param stages: attitudes in the frame of the start; the last of them is that of the end, dq.
    :param h: length of the interval [s].
    :param force: specific forces at the start and at the end [m/s^2], each in the body then.
    """
    dq, dv = stages[-1], scale(force[0], h)
    return dq, dv, None


def midpoint_step(
    stages: Stages[Component], h: Component, force: Ends[Component]
) -> Increment[Component]:
    """Return ``(dq, dv, dp)`` of the midpoint method: the mean of the forces at both ends.

    Arguments as for :func:`euler_step`. The force at the end is turned into the frame of the start.
    """
    dq, (x0, y0, z0) = stages[-1], force[0]
    x1, y1, z1 = rotate(dq, force[1])
    half = 0.5 * h
    dv = (x0 + x1) * half, (y0 + y1) * half, (z0 + z1) * half
    return dq, dv, None


def rk4_step(
    stages: Stages[Component], h: Component, force: Ends[Component]
) -> Increment[Component]:
    """Return ``(dq, dv, dp)`` of rk4.

    ``a1 .. a4`` are the forces of its four stages, in the frame of the interval's start.

    :param stages: attitudes of stages 2, 3, 4 and of the end, in the frame of the start.
    :param h: length of the interval [s].
    :param force: specific forces at the start and at the end [m/s^2], each in the body then.
    """
    q2, q3, q4, dq = stages
    a1, middle = force[0], mean(*force)
    a2, a3, a4 = rotate(q2, middle), rotate(q3, middle), rotate(q4, force[1])
    s = h * h / 12.0
    dp = ((a1[0] - a4[0]) * s, (a1[1] - a4[1]) * s, (a1[2] - a4[2]) * s)
    return dq, simpson(a1, a2, a3, a4, h / 6.0), dp


def simpson(
    a: Vector[Component],
    b: Vector[Component],
    c: Vector[Component],
    d: Vector[Component],
    sixth: Component,
) -> Vector[Component]:
    """Return ``(a + 2 (b + c) + d) h / 6`` of rk4's four slopes.

    :param sixth: ``h / 6`` [s].
    """
    return (
        (a[0] + 2.0 * (b[0] + c[0]) + d[0]) * sixth,
        (a[1] + 2.0 * (b[1] + c[1]) + d[1]) * sixth,
        (a[2] + 2.0 * (b[2] + c[2]) + d[2]) * sixth,
    )


def _so3_stages(
    h: Component, w0: Vector[Component], wm: Vector[Component], w1: Vector[Component]
) -> Stages[Component]:
    """Return the attitudes at stages 2, 3, 4 and at the end of a Runge-Kutta step.

    Rotation vectors are integrated, as unit quaternions are returned. They start at the identity,
    with the rates ``w0``, ``wm`` and ``w1`` [rad/s] at the start, in the middle and at the end.
    """
    half = 0.5 * h
    phi2 = scale(w0, half)
    k2 = _vector_rate(phi2, wm)
    phi3 = scale(k2, half)
    k3 = _vector_rate(phi3, wm)
    phi4 = scale(k3, h)
    k4 = _vector_rate(phi4, w1)
    return exp(phi2), exp(phi3), exp(phi4), exp(simpson(w0, k2, k3, k4, h / 6.0))


def _vector_rate(phi: Vector[Component], w: Vector[Component]) -> Vector[Component]:
    """Return ``Jr(phi)^-1 w``; the next term of the series is of fourth order in phi."""
    a = cross(phi, w)
    b = cross(phi, a)
    return (
        w[0] + 0.5 * a[0] + b[0] / 12.0,
        w[1] + 0.5 * a[1] + b[1] / 12.0,
        w[2] + 0.5 * a[2] + b[2] / 12.0,
    )


def _quaternion_stages(
    h: Component, w0: Vector[Component], wm: Vector[Component], w1: Vector[Component]
) -> Stages[Component]:
    """Return the unit quaternions at stages 2, 3, 4 and at the end of a Runge-Kutta step.

    They start at the identity, with the rates ``w0``, ``wm`` and ``w1`` [rad/s] at the start, in
    the middle and at the end of the step.
    """
    half = 0.5 * h
    x, y, z = w0
    k1 = (0.0 * x, 0.5 * x, 0.5 * y, 0.5 * z)
    q2 = _add_to_identity(k1, half)
    k2 = _quaternion_rate(q2, wm)
    q3 = _add_to_identity(k2, half)
    k3 = _quaternion_rate(q3, wm)
    q4 = _add_to_identity(k3, h)
    k4 = _quaternion_rate(q4, w1)
    slope = (
        k1[0] + 2.0 * (k2[0] + k3[0]) + k4[0],
        k1[1] + 2.0 * (k2[1] + k3[1]) + k4[1],
        k1[2] + 2.0 * (k2[2] + k3[2]) + k4[2],
        k1[3] + 2.0 * (k2[3] + k3[3]) + k4[3],
    )
    end = _add_to_identity(slope, h / 6.0)
    return normalise(q2), normalise(q3), normalise(q4), normalise(end)


def _add_to_identity(slope: Quaternion[Component], h: Component) -> Quaternion[Component]:
    """Return the identity plus ``slope h``."""
    w, x, y, z = slope
    return 1.0 + w * h, x * h, y * h, z * h


def _quaternion_rate(q: Quaternion[Component], rate: Vector[Component]) -> Quaternion[Component]:
    """Return ``dq/dt = q (0, rate) / 2`` (Sola eq. 199)."""
    w, i, j, k = q
    x, y, z = rate
    return (
        -0.5 * (i * x + j * y + k * z),
        0.5 * (w * x + j * z - k * y),
        0.5 * (w * y - i * z + k * x),
        0.5 * (w * z + i * y - j * x),
    )


_STAGES: Final[dict[str, TurnStages]] = {"quaternion": _quaternion_stages, "so3": _so3_stages}


class WorldVectors(NamedTuple):
    """The vectors of the world that act on a body besides its readings."""

    gravity: Vector[float]
    """Gravity in the world frame [m/s^2]."""
    earth_rate: Vector[float]
    """Rate at which the world turns [rad/s]."""


def world_vectors(gravity: Iterable[float], earth_rate: Iterable[float]) -> WorldVectors:
    """Return the vectors of a world from gravity [m/s^2] and the world's rate [rad/s]."""
    return WorldVectors(float_vector(tuple(gravity)), float_vector(tuple(earth_rate)))


def running_sum(start: Component | float, gain: Component) -> tuple[Component, Component]:
    """Return the sums before and after each of n gains; a float is a single gain."""
    if not isinstance(gain, np.ndarray):
        return start, start + gain
    sums = np.empty(len(gain) + 1)
    sums[0], sums[1:] = start, gain
    np.add.accumulate(sums, out=sums)
    return sums[:-1], sums[1:]


def running_sums(start: Vector[Component], gain: Vector[Component]) -> Ends[Component]:
    """Return :func:`running_sum` of each component."""
    if type(gain[0]) is float:
        (x, y, z), (a, b, c) = start, gain
        return start, (x + a, y + b, z + c)
    pairs = [running_sum(a, b) for a, b in zip(start, gain, strict=True)]
    (x0, x1), (y0, y1), (z0, z1) = pairs
    return (x0, y0, z0), (x1, y1, z1)


def running_product(
    start: Quaternion[Component], dq: Quaternion[Component]
) -> tuple[Quaternion[Component], Quaternion[Component]]:
    """Return the unit attitudes before and after each of n turns; floats are a single turn."""
    if not isinstance(dq[0], np.ndarray):
        return start, normalise(multiply(start, dq))
    chain = np.empty((4, len(dq[0]) + 1))
    for row, initial, turn in zip(chain, start, dq, strict=True):
        row[0], row[1:] = initial, turn
    w, x, y, z = normalise(quaternion(cumulative_product(chain.T)))
    return (w[:-1], x[:-1], y[:-1], z[:-1]), (w[1:], x[1:], y[1:], z[1:])


def states(
    start: State[Component], h: Component, increment: Increment[Component], world: WorldVectors
) -> State[Component]:
    """Return the states at the ends of n consecutive intervals.

    In a world that turns the sums are taken in frames that do not: ``q_wb(t) = Exp(-E t) q(t)``,
    and ``u(t) = Exp(2 E t) v(t)`` is free of Coriolis' acceleration.

    :param start: the state at the start of the first interval.
    :param h: lengths of the intervals [s].
    """
    position, velocity, q_wb = start
    dq, dv, dp = increment
    gx, gy, gz = world.gravity
    q0, q1 = running_product(q_wb, dq)
    if any(world.earth_rate):
        t0, t1 = running_sum(0.0, h)
        back0, back1 = _turn_back(world, t0), _turn_back(world, t1)
        q0, q1 = multiply(back0, q0), multiply(back1, q1)
        x, y, z = rotate(multiply(_turn_back(world, 0.5 * h), q0), dv)
        gain = rotate(_turn_back(world, -(t0 + t1)), (x + gx * h, y + gy * h, z + gz * h))
        v0, v1 = running_sums(velocity, gain)
        v0, v1 = rotate(multiply(back0, back0), v0), rotate(multiply(back1, back1), v1)
    else:
        x, y, z = rotate(q0, dv)
        v0, v1 = running_sums(velocity, (x + gx * h, y + gy * h, z + gz * h))
    half = 0.5 * h
    x, y, z = (v0[0] + v1[0]) * half, (v0[1] + v1[1]) * half, (v0[2] + v1[2]) * half
    if dp is not None:
        a, b, c = rotate(q0, dp)
        x, y, z = x + a, y + b, z + c
    return running_sums(position, (x, y, z))[1], v1, q1


def _turn_back(world: WorldVectors, time: Component) -> Quaternion[Component]:
    """Return ``Exp(-E t)``."""
    x, y, z = world.earth_rate
    return exp((-x * time, -y * time, -z * time))
