# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Projection of directions to the plane, before any distortion, and back.

``pinhole``: ``(x, y) / z``. ``unified``: Mei and Rives 2007, ``(x, y) / (z + xi |P|)``.
``double_sphere``: Usenko, Demmel and Cremers 2018, eq. 40 to 45. The pinhole is the unified model
with xi = 0, and the double sphere with xi = 0 and alpha = 0.
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
Mask = NDArray[np.bool_]


class Sphere(NamedTuple):
    """Which model: the unified one has alpha None."""

    xi: float = 0.0
    alpha: float | None = None

    def project(self, p: Array) -> tuple[Array, Mask]:
        """Return the plane's coordinates (n, 2) of points (n, 3), and which have some."""
        denominator = self._denominator(p)
        seen = self._in_front(p) & (denominator > 0.0)
        safe = np.where(seen, denominator, 1.0)
        return p[:, :2] / safe[:, None], seen

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
        """Return the derivative (n, 2, k) by xi, and alpha where the model has it."""
        denominator = self._denominator(p)
        norm = _norm(p)
        if self.alpha is None:
            change = norm[:, None]
        else:
            z1 = self.xi * norm + p[:, 2]
            d2 = np.sqrt(p[:, 0] ** 2 + p[:, 1] ** 2 + z1 * z1)
            by_xi = (self.alpha * z1 / d2 + 1.0 - self.alpha) * norm
            change = np.stack([by_xi, d2 - z1], axis=1)
        result: Array = -p[:, :2, None] * change[:, None, :] / (denominator**2)[:, None, None]
        return result

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
        z, norm = p[:, 2], _norm(p)
        if self.alpha is None:
            result: Array = z + self.xi * norm if self.xi else z
            return result
        z1 = self.xi * norm + z
        d2 = np.sqrt(p[:, 0] ** 2 + p[:, 1] ** 2 + z1 * z1)
        blended: Array = self.alpha * d2 + (1.0 - self.alpha) * z1
        return blended

    def _denominator_gradient(self, p: Array) -> Array:
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
        result: Array = self.alpha * by_d2 / d2[:, None] + (1.0 - self.alpha) * gradient
        return result

    def _in_front(self, p: Array) -> Mask:
        """Tell which points (n, 3) the model can see at all: its domain, an open cone."""
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
    result: Array = np.sqrt(p[:, 0] * p[:, 0] + p[:, 1] * p[:, 1] + p[:, 2] * p[:, 2])
    return result
