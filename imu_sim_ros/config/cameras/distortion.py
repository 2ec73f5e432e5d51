# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Radial distortion as a polynomial, and where it folds: farther points come back into the image.

Both models have an odd polynomial with slope 1 in the centre: the distorted radius of the radius
``r = |(x, y)| / z`` (radial-tangential, ``r (1 + k1 r^2 + k2 r^4 + k3 r^6)``), or of the angle from
the axis (equidistant, Kannala and Brandt 2006, eq. 6).
"""

import math
from collections.abc import Sequence
from typing import Final

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

COUNTS: Final[dict[str, tuple[int, ...]]] = {"none": (0,), "radtan": (4, 5), "equidistant": (4,)}
"""How many coefficients each distortion model takes: k1 k2 p1 p2 (k3), k1 k2 k3 k4."""


def radial_coefficients(model: str, distortion: Sequence[float]) -> tuple[float, ...]:
    """Return k1, k2, ... of ``1 + k1 s + k2 s^2 + ...`` with s the radius, or angle, squared."""
    if model == "radtan":
        return (*distortion[:2], *distortion[4:5])
    return tuple(distortion)


def fold(model: str, distortion: Sequence[float]) -> tuple[float, float]:
    """Return the radius (or the angle [rad]) at which the distortion folds, and its image there.

    There the polynomial's slope, ``1 + 3 k1 s + 5 k2 s^2 + ...``, becomes zero for the first time.

    :returns: both infinite where it never folds; for the equidistant model at most pi.
    """
    k = radial_coefficients(model, distortion)
    last = math.pi if model == "equidistant" else math.inf
    slope = [1.0] + [(2 * j + 3) * value for j, value in enumerate(k)]
    roots = np.roots(slope[::-1]) if any(k) else np.zeros(0)
    real = roots[(np.abs(roots.imag) < 1e-9 * np.abs(roots)) & (roots.real > 0.0)].real
    at = min(last, math.sqrt(float(real.min()))) if len(real) else last
    if math.isinf(at):
        return at, at
    return at, float(distorted_radius(np.array([at]), k)[0])


def distorted_radius(r: Array, k: Sequence[float]) -> Array:
    """Return ``r (1 + k1 r^2 + k2 r^4 + ...)`` for r of any shape."""
    s = r * r
    factor = np.zeros_like(r)
    for value in reversed(k):
        factor = (factor + value) * s
    result: Array = r * (1.0 + factor)
    return result
