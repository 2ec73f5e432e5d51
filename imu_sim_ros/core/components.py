# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Vectors, unit quaternions and rotation matrices by their components, floats or arrays.

A formula over components is quick for a single reading, whose components are floats, and for a
block, whose components are arrays (n,): the columns of the block are split at its edge
(:func:`vector`, :func:`quaternion`, :func:`matrix`) and stacked at its end (:func:`stack`). Only
operations element by element, so that a reading has the same value in whatever block it is
computed; floats and arrays differ at most in the last digit of a sine, where NumPy's is not that
of the C library. Conventions and sources are those of :mod:`imu_sim_ros.core.rotation`, which has
the same for whole arrays. Imports nothing of the package but its types.
"""

import math
from collections.abc import Sequence
from typing import Any, TypeAlias, TypeVar, overload

import numpy as np
from numpy.typing import ArrayLike

from imu_sim_ros.core.types import Array, Mask

Component = TypeVar("Component", float, Array)
Vector: TypeAlias = tuple[Component, Component, Component]
"""(x, y, z)"""
AnyVector: TypeAlias = tuple[Any, Any, Any]
"""(x, y, z) of floats or arrays in code that serves one reading and blocks alike."""
Quaternion: TypeAlias = tuple[Component, Component, Component, Component]
"""(w, x, y, z)"""
Matrix: TypeAlias = tuple[
    Component, Component, Component,
    Component, Component, Component,
    Component, Component, Component,
]  # fmt: skip
"""(3, 3), row by row."""

_SMALL_SINE = 1e-4
"""Sine of half an angle below which a series is used [rad]."""


# ------------------------------------------------------------------------------ edges of a block
def vector(values: ArrayLike) -> Vector[Array]:
    """Return the components (...) of vectors (..., 3)."""
    array = np.asarray(values, dtype=np.float64)
    return array[..., 0], array[..., 1], array[..., 2]


def quaternion(values: ArrayLike) -> Quaternion[Array]:
    """Return the components (...) of quaternions (..., 4)."""
    array = np.asarray(values, dtype=np.float64)
    return array[..., 0], array[..., 1], array[..., 2], array[..., 3]


def matrix(values: ArrayLike) -> Matrix[Array]:
    """Return the components (...) of matrices (..., 3, 3)."""
    m = np.asarray(values, dtype=np.float64)
    return (
        m[..., 0, 0], m[..., 0, 1], m[..., 0, 2],
        m[..., 1, 0], m[..., 1, 1], m[..., 1, 2],
        m[..., 2, 0], m[..., 2, 1], m[..., 2, 2],
    )  # fmt: skip


def float_vector(values: ArrayLike) -> Vector[float]:
    """Return the components of one vector (3,)."""
    x, y, z = np.asarray(values, dtype=np.float64).tolist()
    return x, y, z


def float_quaternion(values: ArrayLike) -> Quaternion[float]:
    """Return the components of one quaternion (4,)."""
    w, x, y, z = np.asarray(values, dtype=np.float64).tolist()
    return w, x, y, z


def float_matrix(values: ArrayLike) -> Matrix[float]:
    """Return the components of one matrix (3, 3)."""
    a, b, c, d, e, f, g, h, i = np.asarray(values, dtype=np.float64).ravel().tolist()
    return a, b, c, d, e, f, g, h, i


def components_of(vectors: Array) -> AnyVector:
    """Return the components of vectors (n, ..., 3): floats of a single one (1, 3), else arrays."""
    if vectors.shape == (1, 3):
        ((x, y, z),) = vectors.tolist()
        return x, y, z
    return vectors[..., 0], vectors[..., 1], vectors[..., 2]


def combine(components: AnyVector, shape: tuple[int, ...]) -> Array:
    """Return components, floats or arrays, as vectors of a shape (n, ..., 3), a new array."""
    if shape == (1, 3):
        return np.array((components,))
    vectors = np.empty(shape, order="F")
    vectors[..., 0], vectors[..., 1], vectors[..., 2] = components
    return vectors


def stack(components: Sequence[Array]) -> Array:
    """Return k components (...) as an array (..., k); each is contiguous in it (order F)."""
    result = np.empty((*np.shape(components[0]), len(components)), order="F")
    for k, component in enumerate(components):
        result[..., k] = component
    return result


# ----------------------------------------------------- functions by the type of their components
def sqrt(x: Component) -> Component:
    """Return the square root."""
    return math.sqrt(x) if type(x) is float else np.sqrt(x)


def sin(x: Component) -> Component:
    """Return the sine."""
    return math.sin(x) if type(x) is float else np.sin(x)


def cos(x: Component) -> Component:
    """Return the cosine."""
    return math.cos(x) if type(x) is float else np.cos(x)


def tan(x: Component) -> Component:
    """Return the tangent."""
    return math.tan(x) if type(x) is float else np.tan(x)


def sinc(x: Component) -> Component:
    """Return ``sin(pi x) / (pi x)``, 1 at 0."""
    if type(x) is not float:
        return np.sinc(x)
    y = math.pi * x
    return math.sin(y) / y if y else 1.0


def arcsin(x: Component) -> Component:
    """Return the arc sine; arguments beyond -1 and 1 by rounding count as -1 and 1."""
    if type(x) is float:
        return math.asin(max(-1.0, min(1.0, x)))
    return np.arcsin(np.clip(x, -1.0, 1.0))


def arctan2(y: Component, x: Component) -> Component:
    """Return the angle of the point (x, y)."""
    return math.atan2(y, x) if type(y) is float else np.arctan2(y, x)


def rint(x: Component) -> Component:
    """Return the nearest whole number; of two, the even one. The sign of a zero stays."""
    return math.copysign(round(x), x) if type(x) is float else np.rint(x)


def quantise(x: Component, step: Component, lower: Component, upper: Component) -> Component:
    """Return x in whole steps, from ``lower`` to ``upper`` of them. The sign of a zero stays."""
    if type(x) is float:
        x /= step
        count = round(x)
        bounded = lower if count < lower else upper if count > upper else count
        return math.copysign(bounded, x) * step
    return np.minimum(np.maximum(np.rint(x / step), lower), upper) * step


def nearest_integer(x: Any) -> Any:
    """Return the nearest whole number as an integer."""
    return round(x) if type(x) is float else np.rint(x).astype(np.int64)


def clip(x: Component, lower: Component | float, upper: Component | float) -> Component:
    """Return x within limits."""
    if type(x) is float:
        return lower if x < lower else upper if x > upper else x
    return np.minimum(np.maximum(x, lower), upper)


def any_element(condition: bool | Mask) -> bool:
    """Return whether a comparison of components holds for any of their elements."""
    return condition if isinstance(condition, bool) else bool(condition.any())


@overload
def where(condition: bool, x: float, y: float) -> float: ...
@overload
def where(condition: Mask, x: Array | float, y: Array | float) -> Array: ...
def where(condition: bool | Mask, x: Array | float, y: Array | float) -> Array | float:
    """Return x where a comparison of components holds, y elsewhere."""
    if isinstance(condition, bool):
        return x if condition else y
    return np.where(condition, x, y)


# ------------------------------------------------------------------------------------- formulas
def multiply(p: Quaternion[Component], q: Quaternion[Component]) -> Quaternion[Component]:
    """Return the Hamilton product ``p * q`` (Sola eq. 12)."""
    pw, px, py, pz = p
    qw, qx, qy, qz = q
    return (
        pw * qw - px * qx - py * qy - pz * qz,
        pw * qx + px * qw + py * qz - pz * qy,
        pw * qy - px * qz + py * qw + pz * qx,
        pw * qz + px * qy - py * qx + pz * qw,
    )


def conjugate(q: Quaternion[Component]) -> Quaternion[Component]:
    """Return the inverse rotation of a unit quaternion: ``q_bw`` from ``q_wb``."""
    w, x, y, z = q
    return w, -x, -y, -z


def normalise(q: Quaternion[Component]) -> Quaternion[Component]:
    """Return a quaternion, not zero, scaled to unit length."""
    w, x, y, z = q
    length = sqrt(w * w + x * x + y * y + z * z)
    return w / length, x / length, y / length, z / length


def rotate(q_ab: Quaternion[Component], v_b: Vector[Component]) -> Vector[Component]:
    """Return ``v_a = R_ab @ v_b``.

    ``v + 2 w (u x v) + 2 u x (u x v)`` with ``q = (w, u)``: 30 operations instead of the 56 of two
    quaternion products.
    """
    w, i, j, k = q_ab
    x, y, z = v_b
    a = 2.0 * (j * z - k * y)
    b = 2.0 * (k * x - i * z)
    c = 2.0 * (i * y - j * x)
    return (
        x + w * a + (j * c - k * b),
        y + w * b + (k * a - i * c),
        z + w * c + (i * b - j * a),
    )


def rotate_inverse(q_ab: Quaternion[Component], v_a: Vector[Component]) -> Vector[Component]:
    """Return ``v_b = R_ab.T @ v_a``: ``v - 2 w (u x v) + 2 u x (u x v)`` with ``q = (w, u)``."""
    w, i, j, k = q_ab
    x, y, z = v_a
    a = 2.0 * (j * z - k * y)
    b = 2.0 * (k * x - i * z)
    c = 2.0 * (i * y - j * x)
    return (
        j * c - k * b + x - w * a,
        k * a - i * c + y - w * b,
        i * b - j * a + z - w * c,
    )


def cross(a: Vector[Component], b: Vector[Component]) -> Vector[Component]:
    """Return ``a x b``."""
    ax, ay, az = a
    bx, by, bz = b
    return ay * bz - az * by, az * bx - ax * bz, ax * by - ay * bx


def transform(m: Matrix[float] | Matrix[Component], v: Vector[Component]) -> Vector[Component]:
    """Return ``M @ v``."""
    a, b, c, d, e, f, g, h, i = m
    x, y, z = v
    return a * x + b * y + c * z, d * x + e * y + f * z, g * x + h * y + i * z


def to_matrix(q_ab: Quaternion[Component]) -> Matrix[Component]:
    """Return ``R_ab`` (Sola eq. 115)."""
    w, x, y, z = q_ab
    return (
        w * w + x * x - y * y - z * z, 2 * (x * y - w * z), 2 * (x * z + w * y),
        2 * (x * y + w * z), w * w - x * x + y * y - z * z, 2 * (y * z - w * x),
        2 * (x * z - w * y), 2 * (y * z + w * x), w * w - x * x - y * y + z * z,
    )  # fmt: skip


def exp(rotation_vector: Vector[Component]) -> Quaternion[Component]:
    """Return the quaternion of a rotation vector [rad] (Sola eq. 101)."""
    x, y, z = rotation_vector
    half = 0.5 * sqrt(x * x + y * y + z * z)
    factor = 0.5 * sinc(half / math.pi)
    return cos(half), x * factor, y * factor, z * factor


def log(q: Quaternion[Component]) -> Vector[Component]:
    """Return the rotation vector [rad], at most pi long, of a unit quaternion."""
    w, x, y, z = q
    cosine, sine = abs(w), sqrt(x * x + y * y + z * z)
    small = sine < _SMALL_SINE
    # 2 atan2(s, w) / s; near zero its series 2 / w - 2 s^2 / (3 w^3) (Sola eq. 105).
    factor = 2.0 * arctan2(sine, cosine) / where(small, 1.0, sine)
    if any_element(small):
        safe = where(small, cosine, 1.0)
        factor = where(small, 2.0 / safe - 2.0 / 3.0 * sine**2 / safe**3, factor)
    factor = where(w < 0.0, -factor, factor)  # q and -q are one rotation
    return x * factor, y * factor, z * factor


def from_euler(roll_pitch_yaw: Vector[Component]) -> Quaternion[Component]:
    """Return ``q_wb`` of Euler angles [rad]: ``Rz(yaw) Ry(pitch) Rx(roll)``."""
    roll, pitch, yaw = roll_pitch_yaw
    roll, pitch, yaw = 0.5 * roll, 0.5 * pitch, 0.5 * yaw
    return from_half_angles((sin(roll), sin(pitch), sin(yaw)), (cos(roll), cos(pitch), cos(yaw)))


def from_half_angles(sines: Vector[Component], cosines: Vector[Component]) -> Quaternion[Component]:
    """Return ``q_wb`` of the sines and cosines of half the Euler angles."""
    (sr, sp, sy), (cr, cp, cy) = sines, cosines
    return (
        cr * cp * cy + sr * sp * sy,
        sr * cp * cy - cr * sp * sy,
        cr * sp * cy + sr * cp * sy,
        cr * cp * sy - sr * sp * cy,
    )


def to_euler(q_wb: Quaternion[Component]) -> Vector[Component]:
    """Return roll, pitch, yaw [rad]; pitch in [-pi/2, pi/2], the others in [-pi, pi]."""
    w, x, y, z = q_wb
    return (
        arctan2(2 * (w * x + y * z), 1 - 2 * (x * x + y * y)),
        arcsin(2 * (w * y - z * x)),
        arctan2(2 * (w * z + x * y), 1 - 2 * (y * y + z * z)),
    )
