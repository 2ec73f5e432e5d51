# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Distortion of normalised image coordinates, its derivatives and its inverse by Newton's method.

Brown 1966 as OpenCV's calib3d writes it ("radtan"), and Kannala and Brandt 2006 ("equidistant").
"""

from collections.abc import Sequence
from typing import Final

import numpy as np
from numpy.typing import NDArray

from imu_sim_ros.config.cameras import distorted_radius, fold, radial_coefficients

Array = NDArray[np.float64]

_TABLE: Final = 2049
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
    for place, power in ((0, s), (1, s * s), (4, s * s * s)):
        result[:, :, place] = m * power[:, None]
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
