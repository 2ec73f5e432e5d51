# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Uniform B-splines of degree 5 (C4): a position, and a rotation as a cumulative spline on SO(3).

Lovegrove, Patron-Perez, Sibley, "Spline Fusion", BMVC 2013 (the cumulative form); Sommer et al.,
"Efficient derivative computation for cumulative B-splines on Lie groups", CVPR 2020 (the
recurrences of rate and acceleration).
"""

from math import comb, factorial
from typing import Final

import numpy as np

from imu_sim_ros.core import rotation
from imu_sim_ros.core.types import Array, Integers
from imu_sim_ros.trajectory.motion import Motion

DEGREE: Final = 5
"""Degree of the splines: their fourth derivative is continuous."""
ORDER: Final = DEGREE + 1


def _basis_matrix() -> Array:
    """Return M with ``B_s(u) = sum_n M[s, n] u^n`` for control point i + s (Qin 2000, eq. 7)."""
    k = ORDER
    matrix = np.empty((k, k))
    for s in range(k):
        for n in range(k):
            terms = (
                (-1) ** (m - s) * comb(k, m - s) * (k - 1 - m) ** (k - 1 - n) for m in range(s, k)
            )
            matrix[s, n] = comb(k - 1, n) * sum(terms) / factorial(k - 1)
    return matrix


BASIS: Final[Array] = _basis_matrix()
CUMULATIVE: Final[Array] = np.cumsum(BASIS[::-1], axis=0)[::-1]
"""Row j: sum of the basis functions j, j + 1, ...; row 0 is 1."""


class UniformKnots:
    """Segments of equal length over [0, duration]; control points k .. k + 5 act in segment k."""

    def __init__(self, duration: float, spacing: float) -> None:
        self.segments = max(1, round(duration / spacing))
        self.spacing = duration / self.segments
        self.control_points = self.segments + DEGREE

    def locate(self, t: Array) -> tuple[Integers, Array]:
        """Return the segment of times t (n,) [s], and the position u in [0, 1] within it."""
        scaled = t / self.spacing
        segment = np.clip(np.floor(scaled), 0, self.segments - 1).astype(np.int64)
        return segment, scaled - segment


class PoseSpline:
    """A position and a rotation spline on common knots, with closed-form derivatives."""

    def __init__(self, knots: UniformKnots, position: Array, q_wb: Array) -> None:
        """Set up from control points.

        :param position: (c, 3) control points [m], c = knots.control_points.
        :param q_wb: (c, 4) control rotations.
        """
        self._knots = knots
        windows = np.lib.stride_tricks.sliding_window_view(position, ORDER, axis=0)
        # (power, axis, segment): one contiguous row for each coefficient of the polynomials.
        self._coefficients = np.einsum("sn,kas->nak", BASIS, windows)
        self._rotation = RotationSpline(knots, q_wb)

    @property
    def duration(self) -> float:
        """Length [s]."""
        return self._knots.segments * self._knots.spacing

    def sample(self, t: Array) -> Motion:
        """Return the motion at times t (n,) [s], in any order."""
        segment, u = self._knots.locate(t)
        q_wb, omega, alpha = self._rotation.motion(segment, u)
        return Motion(*self._translation(segment, u), q_wb, omega, alpha)

    def _translation(self, segment: Integers, u: Array) -> tuple[Array, Array, Array]:
        """Return position, velocity and acceleration (n, 3) at parts u of segments."""
        h = self._knots.spacing
        p, v, a = np.empty((3, len(u), 3))
        for axis in range(3):
            value, first_derivative, second_derivative = _polynomial(
                self._coefficients[:, axis, segment], u
            )
            p[:, axis], v[:, axis], a[:, axis] = (
                value,
                first_derivative / h,
                second_derivative / h**2,
            )
        return p, v, a


class RotationSpline:
    """The rotation of a :class:`PoseSpline`."""

    def __init__(self, knots: UniformKnots, q_wb: Array) -> None:
        """Set up from control rotations (c, 4), c = knots.control_points."""
        self._spacing = knots.spacing
        self._first_q = np.ascontiguousarray(q_wb.T)
        steps = rotation.log(rotation.multiply(rotation.conjugate(q_wb[:-1]), q_wb[1:]))
        self._angles = np.linalg.norm(steps, axis=-1)
        safe = np.where(self._angles > 0, self._angles, 1.0)
        self._axes = np.ascontiguousarray((steps / safe[:, None]).T)

    def attitude(self, segment: Integers, u: Array) -> Array:
        """Return q_wb (n, 4) at places u in segments: the bits of :meth:`motion`, but faster."""
        q = self._first_q[:, segment]
        for j in range(1, ORDER):
            share = np.zeros(len(u))
            for coefficient in CUMULATIVE[j, ::-1]:
                share *= u
                share += coefficient
            turn = share * self._angles[segment + (j - 1)]
            q = _turn(q, self._axes[:, segment + (j - 1)], 0.5 * turn)
        return _unit(q)

    def motion(self, segment: Integers, u: Array) -> tuple[Array, Array, Array]:
        """Return q_wb, omega_b, alpha_b: the factors are applied from left to right.

        With ``A_j = Exp(lambda_j d_j)``: ``omega <- A_j^T omega + lambda_j' d_j`` and
        ``alpha <- A_j^T alpha + lambda_j' omega x d_j + lambda_j'' d_j`` (Sommer et al., eq. 33).
        """
        h = self._spacing
        q = self._first_q[:, segment]
        omega, alpha = np.zeros((2, 3, len(u)))
        for j in range(1, ORDER):
            share = _polynomial(CUMULATIVE[j], u)
            angle = self._angles[segment + (j - 1)]
            axis = self._axes[:, segment + (j - 1)]
            turn, rate, acceleration = share * (angle * np.array([1.0, 1 / h, 1 / h**2])[:, None])
            sine, cosine = np.sin(turn), np.cos(turn)
            omega = _turn_back(omega, axis, sine, cosine) + rate * axis
            alpha = _turn_back(alpha, axis, sine, cosine) + rate * _cross(omega, axis)
            alpha += acceleration * axis
            q = _turn(q, axis, 0.5 * turn)
        return _unit(q), np.ascontiguousarray(omega.T), np.ascontiguousarray(alpha.T)


def _polynomial(c: Array, u: Array) -> Array:
    """Return a polynomial of degree 5 and its first two derivatives (3, n) by Horner's rule.

    :param c: (6,) or (6, n) coefficients of ascending powers.
    """
    derivatives = np.zeros((3, len(u)))
    value, first_derivative, second_derivative = derivatives
    for coefficient in c[::-1]:
        second_derivative *= u
        second_derivative += first_derivative
        first_derivative *= u
        first_derivative += value
        value *= u
        value += coefficient
    second_derivative *= 2.0
    return derivatives


def _cross(a: Array, b: Array) -> Array:
    """Return the cross product of vectors whose components are on the first axis."""
    return np.stack(
        [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]]
    )


def _turn_back(v: Array, axis: Array, sine: Array, cosine: Array) -> Array:
    """Return ``Exp(angle axis)^T v`` (Rodrigues), components first."""
    along = (axis[0] * v[0] + axis[1] * v[1] + axis[2] * v[2]) * (1.0 - cosine)
    return cosine * v - sine * _cross(axis, v) + along * axis


def _turn(q: Array, axis: Array, half: Array) -> Array:
    """Return ``q * exp(2 half axis)``, components first."""
    c, s = np.cos(half), np.sin(half)
    x, y, z = s * axis
    return np.stack(
        [
            q[0] * c - q[1] * x - q[2] * y - q[3] * z,
            q[0] * x + q[1] * c + q[2] * z - q[3] * y,
            q[0] * y - q[1] * z + q[2] * c + q[3] * x,
            q[0] * z + q[1] * y - q[2] * x + q[3] * c,
        ]
    )


def _unit(q: Array) -> Array:
    """Return quaternions (n, 4) of length 1 from (4, n)."""
    q_wb = q / np.sqrt(q[0] * q[0] + q[1] * q[1] + q[2] * q[2] + q[3] * q[3])
    return np.ascontiguousarray(q_wb.T)
