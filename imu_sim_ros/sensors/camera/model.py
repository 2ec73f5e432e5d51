# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""The camera model: points in the camera's frame to pixels and back, with all derivatives."""

import math
from collections.abc import Sequence
from typing import Final, NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from imu_sim_ros.core import rotation
from imu_sim_ros.core.types import Array, Mask
from imu_sim_ros.sensors.camera.parameters import (
    CameraModelParameters,
    CameraParameters,
    distorted_radius,
    fold,
    radial_coefficients,
)

_TABLE: Final = 2049
"""Number of points of the table of distorted radii."""
_STEPS: Final = 6
"""Newton steps, always all of them: a result must not depend on the rest of the array."""


def radtan(m: Array, k: Sequence[float]) -> Array:
    """Return the distorted coordinates of undistorted ones.

    ``d = m (1 + k1 s + k2 s^2 + k3 s^3) + (2 p1 x y + p2 (s + 2 x^2), p1 (s + 2 y^2) + 2 p2 x y)``
    with ``s = x^2 + y^2``.

    :param m: (n, 2) x / z and y / z.
    :param k: k1, k2, p1, p2 and optionally k3.
    """
    k1, k2, p1, p2, k3 = (*k, 0.0)[:5]
    x, y = m[:, 0], m[:, 1]
    s = x * x + y * y
    radial = 1.0 + s * (k1 + s * (k2 + s * k3))
    result = np.empty_like(m)
    result[:, 0] = x * radial + 2.0 * p1 * x * y + p2 * (s + 2.0 * x * x)
    result[:, 1] = y * radial + p1 * (s + 2.0 * y * y) + 2.0 * p2 * x * y
    return result


def radtan_by_point(m: Array, k: Sequence[float]) -> Array:
    """Return the derivative (n, 2, 2) of :func:`radtan` by m (n, 2)."""
    k1, k2, p1, p2, k3 = (*k, 0.0)[:5]
    x, y = m[:, 0], m[:, 1]
    s = x * x + y * y
    radial = 1.0 + s * (k1 + s * (k2 + s * k3))
    slope = 2.0 * (k1 + s * (2.0 * k2 + 3.0 * s * k3))  # d radial / d x = slope x
    result = np.empty((len(m), 2, 2))
    result[:, 0, 0] = radial + slope * x * x + 2.0 * p1 * y + 6.0 * p2 * x
    result[:, 0, 1] = slope * x * y + 2.0 * p1 * x + 2.0 * p2 * y
    result[:, 1, 0] = result[:, 0, 1]
    result[:, 1, 1] = radial + slope * y * y + 6.0 * p1 * y + 2.0 * p2 * x
    return result


def radtan_by_coefficients(m: Array, count: int) -> Array:
    """Return the derivative (n, 2, count) of :func:`radtan` by k1, k2, p1, p2 and optionally k3."""
    x, y = m[:, 0], m[:, 1]
    s = x * x + y * y
    result = np.empty((len(m), 2, 5))
    for column, power in ((0, s), (1, s * s), (4, s * s * s)):
        result[:, :, column] = m * power[:, None]
    result[:, 0, 2], result[:, 1, 2] = 2.0 * x * y, s + 2.0 * y * y
    result[:, 0, 3], result[:, 1, 3] = s + 2.0 * x * x, 2.0 * x * y
    return result[:, :, :count]


class RadialInverse:
    """The inverse of ``r (1 + k1 r^2 + ...)`` up to where it folds.

    A table gives the start, Newton's method the digits. The derivative is above zero everywhere
    below the fold, and the start is near, so the iteration converges quadratically.
    """

    def __init__(self, model: str, distortion: Sequence[float], largest: float) -> None:
        """Set up the inverse of one distortion.

        :param largest: distorted radius up to which it is needed; beyond the fold there is none.
        """
        self._k = radial_coefficients(model, distortion)
        self.last, image = fold(model, distortion)
        end = self.last
        if image > largest:
            end = self._end(largest)
        self._r = np.linspace(0.0, end, _TABLE)
        self._image = distorted_radius(self._r, self._k)

    def _end(self, largest: float) -> float:
        """Return a radius whose image is at least ``largest``."""
        end = min(largest, self.last)
        while distorted_radius(np.array([end]), self._k)[0] < largest and end < self.last:
            end = min(1.2 * end, self.last)
        return end

    def __call__(self, distorted: Array) -> Array:
        """Return the radii (n,) whose images (n,) are given; beyond the table, its end."""
        r: Array = np.interp(distorted, self._image, self._r)
        for _ in range(_STEPS):
            s = r * r
            slope, factor = np.zeros_like(r), np.zeros_like(r)
            for j in reversed(range(len(self._k))):
                slope = (slope + (2 * j + 3) * self._k[j]) * s
                factor = (factor + self._k[j]) * s
            step = (r * (1.0 + factor) - distorted) / np.maximum(1.0 + slope, 1e-9)
            r = np.clip(r - step, 0.0, self._r[-1])
        return r


def undistort_radtan(d: Array, k: Sequence[float], inverse: RadialInverse) -> Array:
    """Return the undistorted coordinates (n, 2) of distorted ones (n, 2).

    The radial part is inverted first; Newton's method in the plane adds the tangential one.
    """
    radius = np.sqrt(d[:, 0] * d[:, 0] + d[:, 1] * d[:, 1])
    safe = np.where(radius > 0.0, radius, 1.0)
    m = d * np.where(radius > 0.0, inverse(radius) / safe, 1.0)[:, None]
    for _ in range(_STEPS):
        error = radtan(m, k) - d
        j = radtan_by_point(m, k)
        determinant = j[:, 0, 0] * j[:, 1, 1] - j[:, 0, 1] * j[:, 1, 0]
        step = np.empty_like(m)
        step[:, 0] = (j[:, 1, 1] * error[:, 0] - j[:, 0, 1] * error[:, 1]) / determinant
        step[:, 1] = (j[:, 0, 0] * error[:, 1] - j[:, 1, 0] * error[:, 0]) / determinant
        m = m - step
    return m


class Sphere(NamedTuple):
    """Unified (alpha None) or extended unified camera model."""

    xi: float = 0.0
    alpha: float | None = None

    def project(self, p: Array) -> tuple[Array, Mask]:
        """Return the plane's coordinates (n, 2) of points (n, 3), and which have some."""
        denominator = self._denominator(p)
        valid = self._in_front(p) & (denominator > 0.0)
        safe = np.where(valid, denominator, 1.0)
        return p[:, :2] / safe[:, None], valid

    def project_by_point(self, p: Array) -> Array:
        """Return the derivative (n, 2, 3) of :meth:`project` by points (n, 3)."""
        denominator = self._denominator(p)
        gradient = self._denominator_gradient(p)
        result = -p[:, :2, None] * gradient[:, None, :]
        result /= (denominator * denominator)[:, None, None]
        result[:, 0, 0] += 1.0 / denominator
        result[:, 1, 1] += 1.0 / denominator
        return result

    def project_by_shape(self, p: Array) -> Array:
        """Return the derivative (n, 2, k) by xi, and alpha if the model has it."""
        denominator = self._denominator(p)
        norm = _norm(p)
        if self.alpha is None:
            change = norm[:, None]
        else:
            z1 = self.xi * norm + p[:, 2]
            d2 = np.sqrt(p[:, 0] ** 2 + p[:, 1] ** 2 + z1 * z1)
            by_xi = (self.alpha * z1 / d2 + 1.0 - self.alpha) * norm
            change = np.stack([by_xi, d2 - z1], axis=1)
        return -p[:, :2, None] * change[:, None, :] / (denominator**2)[:, None, None]

    def unproject(self, m: Array) -> tuple[Array, Mask]:
        """Return unit directions (n, 3) of the plane's coordinates (n, 2), and which have one."""
        s = m[:, 0] * m[:, 0] + m[:, 1] * m[:, 1]
        if self.alpha is None:
            forward, valid = np.ones_like(s), np.ones(len(s), dtype=bool)
        else:
            root = 1.0 - (2.0 * self.alpha - 1.0) * s
            valid = root >= 0.0
            forward = (1.0 - self.alpha**2 * s) / (
                self.alpha * np.sqrt(np.maximum(root, 0.0)) + 1.0 - self.alpha
            )
        inner = forward * forward + (1.0 - self.xi * self.xi) * s
        valid &= inner >= 0.0
        factor = (forward * self.xi + np.sqrt(np.maximum(inner, 0.0))) / (forward * forward + s)
        result = np.empty((len(m), 3))
        result[:, :2] = factor[:, None] * m
        result[:, 2] = factor * forward - self.xi
        return result / _norm(result)[:, None], valid & self._in_front(result)

    def _denominator(self, p: Array) -> Array:
        """Return the denominator (n,) of the projection of points (n, 3)."""
        z, norm = p[:, 2], _norm(p)
        if self.alpha is None:
            return z + self.xi * norm if self.xi else z
        z1 = self.xi * norm + z
        d2 = np.sqrt(p[:, 0] ** 2 + p[:, 1] ** 2 + z1 * z1)
        blended: Array = self.alpha * d2 + (1.0 - self.alpha) * z1
        return blended

    def _denominator_gradient(self, p: Array) -> Array:
        """Return the gradient (n, 3) of the denominator."""
        unit = p / _norm(p)[:, None]
        gradient = self.xi * unit
        gradient[:, 2] += 1.0
        if self.alpha is None:
            return gradient
        z1 = self.xi * _norm(p) + p[:, 2]
        d2 = np.sqrt(p[:, 0] ** 2 + p[:, 1] ** 2 + z1 * z1)
        # d2^2 = x^2 + y^2 + z1^2, and z1 has the gradient above.
        by_d2 = z1[:, None] * gradient
        by_d2[:, :2] += p[:, :2]
        return self.alpha * by_d2 / d2[:, None] + (1.0 - self.alpha) * gradient

    def _in_front(self, p: Array) -> Mask:
        """Return True for points (n, 3) in the domain of the model, an open cone."""
        norm = _norm(p)
        if self.alpha is None:
            w = self.xi if self.xi <= 1.0 else 1.0 / self.xi
        else:
            a = self.alpha
            w1 = a / (1.0 - a) if a <= 0.5 else (1.0 - a) / a
            w = (w1 + self.xi) / np.sqrt(2.0 * w1 * self.xi + self.xi**2 + 1.0)
        result: Mask = p[:, 2] > -w * norm
        return result


def _norm(p: Array) -> Array:
    """Return the lengths (n,) of vectors (n, 3)."""
    return np.sqrt(p[:, 0] * p[:, 0] + p[:, 1] * p[:, 1] + p[:, 2] * p[:, 2])


class Projection(NamedTuple):
    """Pixels of n points."""

    uv: Array
    """(n, 2) column and row [px]; meaningless where ``valid`` is false."""
    valid: Mask
    """(n,) True if the model has a pixel for the point, perhaps outside the image."""


class Rays(NamedTuple):
    """Directions of n pixels."""

    direction: Array
    """(n, 3) unit vectors in the camera's frame."""
    valid: Mask
    """(n,) True if the model has a direction for the pixel."""


class CameraModel:
    """One camera's projection; all arrays have the points first."""

    def __init__(self, parameters: CameraModelParameters) -> None:
        """Initialise with intrinsics [px], model and distortion."""
        self.parameters = parameters
        self.width, self.height = parameters.width, parameters.height
        self.fx, self.fy, self.cx, self.cy = parameters.intrinsics
        self.kind = parameters.distortion_model
        self.k = parameters.distortion
        spheres = {
            "pinhole": Sphere(),
            "unified": Sphere(parameters.xi),
            "double_sphere": Sphere(parameters.xi, parameters.alpha),
        }
        self.sphere = spheres[parameters.model]
        self._fold = fold(self.kind, self.k)[0]
        if self.kind != "none":
            x = max(self.cx + 0.5, self.width - 0.5 - self.cx) / self.fx
            y = max(self.cy + 0.5, self.height - 0.5 - self.cy) / self.fy
            self._inverse = RadialInverse(self.kind, self.k, 1.5 * math.hypot(x, y))

    def project(self, points: ArrayLike) -> Projection:
        """Return the pixels of points (n, 3) in the camera's frame."""
        p = np.asarray(points, dtype=np.float64)
        if self.kind == "equidistant":
            d, valid = self._equidistant(p)
        else:
            d, valid = self.sphere.project(p)
            if self.kind == "radtan":
                valid &= d[:, 0] * d[:, 0] + d[:, 1] * d[:, 1] < self._fold**2
                d = radtan(np.where(valid[:, None], d, 0.0), self.k)
        return Projection(self._pixels(d), valid)

    def unproject(self, uv: ArrayLike) -> Rays:
        """Return the directions of pixels (n, 2)."""
        pixels = np.asarray(uv, dtype=np.float64)
        d = np.empty_like(pixels)
        d[:, 0] = (pixels[:, 0] - self.cx) / self.fx
        d[:, 1] = (pixels[:, 1] - self.cy) / self.fy
        if self.kind == "equidistant":
            return self._from_equidistant(d)
        if self.kind == "radtan":
            d = undistort_radtan(d, self.k, self._inverse)
        return Rays(*self.sphere.unproject(d))

    def by_point(self, points: ArrayLike) -> Array:
        """Return the derivative (n, 2, 3) of the pixels by visible points (n, 3)."""
        p = np.asarray(points, dtype=np.float64)
        if self.kind == "equidistant":
            result = self._equidistant_by_point(p)
        else:
            result = self.sphere.project_by_point(p)
            if self.kind == "radtan":
                m, _ = self.sphere.project(p)
                result = np.einsum("nij,njk->nik", radtan_by_point(m, self.k), result)
        scaled: Array = result * np.array([self.fx, self.fy])[:, None]
        return scaled

    def by_parameters(self, points: ArrayLike) -> Array:
        """Return the derivative (n, 2, k) of the pixels by the parameters.

        Their order: fx, fy, cx, cy; xi of the unified model, xi and alpha of the double sphere; the
        coefficients of the distortion.
        """
        p = np.asarray(points, dtype=np.float64)
        uv, _ = self.project(p)
        columns = np.zeros((len(p), 2, 4))
        columns[:, 0, 0] = (uv[:, 0] - self.cx) / self.fx
        columns[:, 1, 1] = (uv[:, 1] - self.cy) / self.fy
        columns[:, 0, 2] = columns[:, 1, 3] = 1.0
        focal = np.array([self.fx, self.fy])[:, None]
        parts = [columns]
        if self.parameters.model != "pinhole":
            shape = self.sphere.project_by_shape(p)
            if self.kind == "radtan":
                m, _ = self.sphere.project(p)
                shape = np.einsum("nij,njk->nik", radtan_by_point(m, self.k), shape)
            parts.append(shape * focal)
        if self.kind == "radtan":
            m, _ = self.sphere.project(p)
            parts.append(radtan_by_coefficients(m, len(self.k)) * focal)
        elif self.kind == "equidistant":
            rho, theta = _polar(p)
            powers = theta[:, None] ** np.array([3, 5, 7, 9])
            unit = p[:, :2] / np.where(rho > 0.0, rho, 1.0)[:, None]
            parts.append(unit[:, :, None] * powers[:, None, :] * focal)
        return np.concatenate(parts, axis=2)

    def inside(self, uv: Array, border: float = 0.0) -> Mask:
        """Return True for pixels (n, 2) in the image, at least ``border`` [px] from its edge."""
        u, v = uv[:, 0], uv[:, 1]
        low = border - 0.5
        result: Mask = (
            (u >= low)
            & (v >= low)
            & (u < self.width - 0.5 - border)
            & (v < self.height - 0.5 - border)
        )
        return result

    def _pixels(self, d: Array) -> Array:
        """Return pixels (n, 2) of distorted coordinates (n, 2)."""
        result = np.empty_like(d)
        result[:, 0] = self.fx * d[:, 0] + self.cx
        result[:, 1] = self.fy * d[:, 1] + self.cy
        return result

    def _equidistant(self, p: Array) -> tuple[Array, Mask]:
        """Return ``theta (1 + k1 theta^2 + ...) (x, y) / rho``, theta the angle from the axis."""
        rho, theta = _polar(p)
        valid = theta < self._fold
        distorted = distorted_radius(np.where(valid, theta, 0.0), self.k)
        # On the axis theta / rho is 1 / z.
        on_axis = rho == 0.0
        ratio = distorted / np.where(on_axis, 1.0, rho)
        return p[:, :2] * ratio[:, None], valid & ~(on_axis & (p[:, 2] <= 0.0))

    def _from_equidistant(self, d: Array) -> Rays:
        """Return the rays of distorted coordinates (n, 2) of the equidistant model."""
        radius = np.sqrt(d[:, 0] * d[:, 0] + d[:, 1] * d[:, 1])
        theta = self._inverse(radius)
        valid = np.abs(distorted_radius(theta, self.k) - radius) < 1e-9
        result = np.empty((len(d), 3))
        safe = np.where(radius > 0.0, radius, 1.0)
        result[:, :2] = d * (np.where(radius > 0.0, np.sin(theta), 0.0) / safe)[:, None]
        result[:, 2] = np.cos(theta)
        return Rays(result, valid)

    def _equidistant_by_point(self, p: Array) -> Array:
        """Return the derivatives (n, 2, 3) of the equidistant projection by the point."""
        rho, theta = _polar(p)
        square = rho * rho + p[:, 2] * p[:, 2]
        safe = np.where(rho > 0.0, rho, 1.0)
        f = distorted_radius(theta, self.k)
        powers = theta[:, None] ** np.array([2, 4, 6, 8])
        slope = 1.0 + powers @ (np.array([3.0, 5.0, 7.0, 9.0]) * np.asarray(self.k))
        unit = p[:, :2] / safe[:, None]
        # theta = atan2(rho, z): d theta = (z d rho - rho dz) / (rho^2 + z^2).
        d_theta = np.stack([unit[:, 0] * p[:, 2], unit[:, 1] * p[:, 2], -rho], axis=1)
        d_theta /= square[:, None]
        result = unit[:, :, None] * (slope[:, None] * d_theta)[:, None, :]
        ratio = np.where(rho > 0.0, f / safe, 1.0 / p[:, 2])
        across = np.eye(2) - unit[:, :, None] * unit[:, None, :]
        result[:, :, :2] += ratio[:, None, None] * across
        return np.asarray(result)


def _polar(p: Array) -> tuple[Array, Array]:
    """Return the distance of points (n, 3) from the axis, and the angle from it [rad]."""
    rho = np.sqrt(p[:, 0] * p[:, 0] + p[:, 1] * p[:, 1])
    return rho, np.arctan2(rho, p[:, 2])


def reprojection_errors(
    camera: CameraParameters, position: Array, q_wb: Array, landmarks: Array, uv: Array
) -> Array:
    """Return ``uv - project(T_bc^-1 T_wb^-1 p_w)`` (n, 2) [px].

    Not a number if a landmark would be behind the camera or outside its model.

    :param position: (n, 3) p_wb [m] of the body when each feature was seen.
    :param q_wb: (n, 4) attitudes of the body.
    :param landmarks: (n, 3) p_w [m] of the landmarks that were seen.
    :param uv: (n, 2) pixels at which they were seen.
    """
    r_bc, p_bc = camera.pose()
    in_body = rotation.rotate_inverse(q_wb, landmarks - position)
    pixels, valid = CameraModel(camera).project((in_body - p_bc) @ r_bc)
    errors: Array = np.where(valid[:, None], uv - pixels, np.nan)
    return errors
