# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Rotations of single vectors in plain floats: tuples in, tuples out.

A step of a node handles a dozen numbers; NumPy's cost per call would be ten times that of the
arithmetic. Quaternions are (w, x, y, z) tuples.
"""

import math
from typing import TypeAlias

V3: TypeAlias = tuple[float, float, float]
Q4: TypeAlias = tuple[float, float, float, float]
M9: TypeAlias = tuple[float, float, float, float, float, float, float, float, float]
"""A matrix, row by row."""

ZERO: V3 = (0.0, 0.0, 0.0)

_SMALL_ANGLE = 1e-4


def multiply(p: Q4, q: Q4) -> Q4:
    """Return the Hamilton product."""
    pw, px, py, pz = p
    qw, qx, qy, qz = q
    return (
        pw * qw - px * qx - py * qy - pz * qz,
        pw * qx + px * qw + py * qz - pz * qy,
        pw * qy - px * qz + py * qw + pz * qx,
        pw * qz + px * qy - py * qx + pz * qw,
    )


def normalise(q: Q4) -> Q4:
    """Return the quaternion at unit length."""
    w, x, y, z = q
    s = 1.0 / math.sqrt(w * w + x * x + y * y + z * z)
    return (w * s, x * s, y * s, z * s)


def conjugate(q: Q4) -> Q4:
    """Return the inverse rotation."""
    return (q[0], -q[1], -q[2], -q[3])


def rotate(q: Q4, v: V3) -> V3:
    """Return ``R v``."""
    w, x, y, z = q
    a, b, c = v
    cx, cy, cz = 2.0 * (y * c - z * b), 2.0 * (z * a - x * c), 2.0 * (x * b - y * a)
    return (
        a + w * cx + y * cz - z * cy,
        b + w * cy + z * cx - x * cz,
        c + w * cz + x * cy - y * cx,
    )


def exp(v: V3) -> Q4:
    """Return the quaternion of a rotation vector [rad] (Sola eq. 101)."""
    x, y, z = v
    half = 0.5 * math.sqrt(x * x + y * y + z * z)
    s = 0.5 * math.sin(half) / half if half > _SMALL_ANGLE else 0.5 - half * half / 12.0
    return (math.cos(half), s * x, s * y, s * z)


def scaled(v: V3, s: float) -> V3:
    """Return ``s v``."""
    return (v[0] * s, v[1] * s, v[2] * s)


def mean(a: V3, b: V3) -> V3:
    """Return the mean of two vectors."""
    return (0.5 * (a[0] + b[0]), 0.5 * (a[1] + b[1]), 0.5 * (a[2] + b[2]))


def cross(a: V3, b: V3) -> V3:
    """Return the vector product."""
    return (a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0])


def transform(m: M9, v: V3) -> V3:
    """Return the product of a matrix, row by row, and a vector."""
    x, y, z = v
    return (
        m[0] * x + m[1] * y + m[2] * z,
        m[3] * x + m[4] * y + m[5] * z,
        m[6] * x + m[7] * y + m[8] * z,
    )


def to_matrix(q: Q4) -> M9:
    """Return R, whose columns are the body's axes in the world (Sola eq. 115)."""
    w, x, y, z = q
    return (
        1.0 - 2.0 * (y * y + z * z),
        2.0 * (x * y - w * z),
        2.0 * (x * z + w * y),
        2.0 * (x * y + w * z),
        1.0 - 2.0 * (x * x + z * z),
        2.0 * (y * z - w * x),
        2.0 * (x * z - w * y),
        2.0 * (y * z + w * x),
        1.0 - 2.0 * (x * x + y * y),
    )


def to_euler(q: Q4) -> V3:
    """Return roll, pitch and yaw [rad]."""
    w, x, y, z = q
    return (
        math.atan2(2.0 * (w * x + y * z), 1.0 - 2.0 * (x * x + y * y)),
        math.asin(max(-1.0, min(1.0, 2.0 * (w * y - z * x)))),
        math.atan2(2.0 * (w * z + x * y), 1.0 - 2.0 * (y * y + z * z)),
    )


def from_euler(angles: V3) -> Q4:
    """Return the quaternion of roll, pitch and yaw [rad]."""
    roll, pitch, yaw = (0.5 * angle for angle in angles)
    cr, cp, cy = math.cos(roll), math.cos(pitch), math.cos(yaw)
    sr, sp, sy = math.sin(roll), math.sin(pitch), math.sin(yaw)
    return (
        cr * cp * cy + sr * sp * sy,
        sr * cp * cy - cr * sp * sy,
        cr * sp * cy + sr * cp * sy,
        cr * cp * sy - sr * sp * cy,
    )


def euler_rates(angles: V3, rate: V3) -> V3:
    """Return the rates of roll, pitch and yaw for a body rate (lecture eq. 38)."""
    x, y, z = rate
    sr, cr = math.sin(angles[0]), math.cos(angles[0])
    across = sr * y + cr * z
    return (x + math.tan(angles[1]) * across, cr * y - sr * z, across / math.cos(angles[1]))
