# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""What moves the body during one interval, seen from its attitude at the interval's start.

An increment depends on the readings alone, not on the state, which is what makes whole records
fast: attitudes are running products, velocities and positions running sums.
"""

from collections.abc import Callable, Sequence
from typing import Final, NamedTuple

import numpy as np

from imu_sim_ros.rotation import (
    IDENTITY,
    cross,
    cumulative_product,
    exp,
    multiply,
    normalise,
    rotate,
)
from imu_sim_ros.types import Array


class Increments(NamedTuple):
    """The increments of n intervals of lengths h.

    With ``a(s)`` the specific force in the frame of the interval's start, the state moves by
    ``q <- q dq``, ``v <- v + g h + R dv`` and ``p <- p + (v_before + v_after) h / 2 + R dp``.
    """

    dq: Array
    """(n, 4) unit quaternions, attitude of the end in the frame of the start."""
    dv: Array
    """(n, 3) integral of a(s) [m/s]."""
    dp: Array | None
    """(n, 3) double integral of a(s) less ``dv h / 2`` [m]; None if it is zero."""


def first_order(v: Array) -> Array:
    """Return the normalised ``(1, v / 2)`` (n, 4) of rotation vectors (n, 3) (lecture eq. 34)."""
    q = np.empty((len(v), 4), order="F")
    q[:, 0] = 1.0
    np.multiply(v, 0.5, out=q[:, 1:])
    return normalise(q)


_TURNS = {"quaternion": first_order, "so3": exp}


def between(method: str, attitude: str, h: Array, rate: Array, force: Array) -> Increments:
    """Return the increments between readings.

    :param method: one of ``METHODS``.
    :param attitude: quaternion or so3; Euler angles depend on the state and have no increments.
    :param h: (n,) lengths of the intervals [s].
    :param rate: (n + 1, 3) angular rates at the intervals' ends [rad/s].
    :param force: (n + 1, 3) specific forces at the intervals' ends [m/s^2].
    """
    return METHODS[method](attitude, h[:, None], rate, force)


def _euler(attitude: str, h: Array, rate: Array, force: Array) -> Increments:
    return euler_step(_TURNS[attitude](rate[:-1] * h), h, force)


def _midpoint(attitude: str, h: Array, rate: Array, force: Array) -> Increments:
    mean = 0.5 * (rate[:-1] + rate[1:])
    return midpoint_step(_TURNS[attitude](mean * h), h, force)


def _rk4(attitude: str, h: Array, rate: Array, force: Array) -> Increments:
    stages = {"quaternion": _quaternion_stages, "so3": _so3_stages}[attitude]
    mean = 0.5 * (rate[:-1] + rate[1:])
    return rk4_step(stages(h, rate[:-1], mean, rate[1:]), h, force)


METHODS: Final[dict[str, Callable[[str, Array, Array, Array], Increments]]] = {
    "euler": _euler,
    "midpoint": _midpoint,
    "rk4": _rk4,
}
"""(attitude update, h (n, 1), rate, force) -> increments, by name: the list of all methods."""


def euler_step(dq: Array, h: Array, force: Array) -> Increments:
    """Return increments of the Euler method whose attitudes turn by dq (n, 4) in h (n, 1)."""
    return Increments(dq, force[:-1] * h, None)


def midpoint_step(dq: Array, h: Array, force: Array) -> Increments:
    """Return increments of the midpoint method whose attitudes turn by dq (n, 4) in h (n, 1)."""
    return Increments(dq, (force[:-1] + rotate(dq, force[1:])) * (0.5 * h), None)


def rk4_step(stages: tuple[Array, Array, Array, Array], h: Array, force: Array) -> Increments:
    """Return increments of rk4 from the attitudes (n, 4) of stages 2, 3, 4 and of the end."""
    q2, q3, q4, dq = stages
    a1 = force[:-1]
    a_middle = 0.5 * (a1 + force[1:])
    a2, a3, a4 = rotate(q2, a_middle), rotate(q3, a_middle), rotate(q4, force[1:])
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
        pure = np.empty((len(w), 4), order="F")
        pure[:, 0], pure[:, 1:] = 0.0, w
        return 0.5 * multiply(q, pure)

    start = np.empty((len(h), 4), order="F")
    start[:] = IDENTITY
    k1 = slope(start, w0)
    q2 = start + k1 * (0.5 * h)
    k2 = slope(q2, wm)
    q3 = start + k2 * (0.5 * h)
    k3 = slope(q3, wm)
    q4 = start + k3 * h
    k4 = slope(q4, w1)
    end = start + (k1 + 2.0 * (k2 + k3) + k4) * (h / 6.0)
    return normalise(q2), normalise(q3), normalise(q4), normalise(end)


class WorldVectors(NamedTuple):
    """What acts on a body besides its readings; both (3,), in the world frame."""

    gravity: Array
    """[m/s^2]"""
    earth_rate: Array
    """Rate at which the world turns [rad/s]."""


def world_vectors(gravity: Sequence[float], earth_rate: Sequence[float]) -> WorldVectors:
    """Return a world of its vectors."""
    return WorldVectors(np.array(gravity, dtype=np.float64), np.array(earth_rate, dtype=np.float64))


class StateSequence(NamedTuple):
    """The states at the start and at the ends of n intervals."""

    position: Array
    """(n + 1, 3) [m]."""
    velocity: Array
    """(n + 1, 3) in the world [m/s]."""
    q_wb: Array
    """(n + 1, 4)."""


def states(
    position: Array,
    velocity: Array,
    q_wb: Array,
    h: Array,
    increment: Increments,
    world: WorldVectors,
) -> StateSequence:
    """Return the states from that at the start on.

    In a world that turns the sums are taken in frames that do not: ``q_wb(t) = Exp(-E t) q(t)``,
    and ``u(t) = Exp(2 E t) v(t)`` is free of Coriolis' acceleration.

    :param position: (3,) [m], as the next two at the start.
    :param h: (n,) lengths of the intervals [s].
    """
    length, moved = h[:, None], world.gravity * h[:, None]
    chain = np.empty((len(h) + 1, 4), order="F")
    chain[0], chain[1:] = q_wb, increment.dq
    q = normalise(cumulative_product(chain))
    velocities = np.empty((len(h) + 1, 3), order="F")
    velocities[0] = velocity
    if np.count_nonzero(world.earth_rate):
        t = np.concatenate([np.zeros(1), np.cumsum(h)])[:, None]
        back = exp(-world.earth_rate * t)
        q = multiply(back, q)
        half = exp(-world.earth_rate * (0.5 * length))
        force = rotate(multiply(half, q[:-1]), increment.dv)
        velocities[1:] = rotate(exp(world.earth_rate * (t[:-1] + t[1:])), force + moved)
        np.add.accumulate(velocities, axis=0, out=velocities)
        velocities = rotate(multiply(back, back), velocities)
    else:
        np.add(rotate(q[:-1], increment.dv), moved, out=velocities[1:])
        np.add.accumulate(velocities, axis=0, out=velocities)
    positions = np.empty((len(h) + 1, 3), order="F")
    positions[0] = position
    np.multiply(velocities[:-1] + velocities[1:], 0.5 * length, out=positions[1:])
    if increment.dp is not None:
        positions[1:] += rotate(q[:-1], increment.dp)
    np.add.accumulate(positions, axis=0, out=positions)
    return StateSequence(positions, velocities, q)
