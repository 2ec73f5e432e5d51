# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""The camera model: points in the camera's frame to pixels and back, with all derivatives.

Pixel coordinates are those of OpenCV and kalibr: the centre of the first pixel is (0, 0), so an
image of w x h pixels covers -0.5 to w - 0.5 and -0.5 to h - 0.5.
"""

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from imu_sim_ros.camera.distortion import (
    RadialInverse,
    radtan,
    radtan_by_coefficients,
    radtan_by_point,
    undistort_radtan,
)
from imu_sim_ros.camera.sphere import Sphere
from imu_sim_ros.config.cameras import CameraModelParameters, distorted_radius, fold

Array = NDArray[np.float64]
Mask = NDArray[np.bool_]


class Projection(NamedTuple):
    """Pixels of n points."""

    uv: Array
    """(n, 2) [px]; meaningless where ``valid`` is false."""
    valid: Mask
    """(n,) the model has a pixel for the point, perhaps outside the image."""


class Rays(NamedTuple):
    """Directions of n pixels."""

    direction: Array
    """(n, 3) unit vectors in the camera's frame."""
    valid: Mask
    """(n,) the model has a direction for the pixel."""


class CameraModel:
    """One camera's projection; all arrays have the points first."""

    def __init__(self, parameters: CameraModelParameters) -> None:
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
        """Return the derivative (n, 2, 3) of the pixels by the points (n, 3), all of them seen."""
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
        """Tell which pixels (n, 2) lie in the image, at least ``border`` [px] from its edge."""
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
        radius = np.sqrt(d[:, 0] * d[:, 0] + d[:, 1] * d[:, 1])
        theta = self._inverse(radius)
        valid = np.abs(distorted_radius(theta, self.k) - radius) < 1e-9
        result = np.empty((len(d), 3))
        safe = np.where(radius > 0.0, radius, 1.0)
        result[:, :2] = d * (np.where(radius > 0.0, np.sin(theta), 0.0) / safe)[:, None]
        result[:, 2] = np.cos(theta)
        return Rays(result, valid)

    def _equidistant_by_point(self, p: Array) -> Array:
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
