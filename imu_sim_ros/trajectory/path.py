# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""A path in the plane: straight between waypoints, rounded at them, C4 all the way.

The path is a uniform B-spline of degree 5 whose control points lie on the polygon of the waypoints.
Such a spline follows its control points without overshoot: it is exactly straight where six of them
are in line, and its derivatives are bounded by their differences.
"""

from typing import Final, NamedTuple

import numpy as np

from imu_sim_ros.errors import ConfigurationError
from imu_sim_ros.trajectory.bspline import BASIS, DEGREE, ORDER
from imu_sim_ros.types import Array

_SAMPLES: Final = 8
"""Per segment, to look at curvature and length."""
_MOST_SEGMENTS: Final = 2_000_000
_WIDTHS: Final = 2.0 ** np.arange(-2.0, 5.1, 0.25)
"""Lengths of a segment that are tried, over the smallest radius."""
_CORRECTIONS: Final = 200
_MISS: Final = 1e-9
"""[m] by which a path passes a waypoint that it goes through."""


class UniformSpline:
    """k functions of one variable as a uniform B-spline of degree 5, constant steps apart."""

    def __init__(self, controls: Array, spacing: float) -> None:
        """Take the control points (c, k); point j acts most at ``(j - 2) spacing``."""
        windows = np.lib.stride_tricks.sliding_window_view(controls, ORDER, axis=0)
        # (power, function, segment)
        self._coefficients = np.einsum("sn,gks->nkg", BASIS, windows)
        self.controls = controls
        self.segments, self.spacing = len(controls) - DEGREE, float(spacing)

    @property
    def length(self) -> float:
        """Length of the interval on which the functions are known, from 0."""
        return self.segments * self.spacing

    def sample(self, u: Array, derivatives: int) -> list[Array]:
        """Return the functions and their derivatives at u (n,), each (k, n)."""
        scaled = u / self.spacing
        segment = np.clip(np.floor(scaled), 0, self.segments - 1).astype(np.int64)
        x = scaled - segment
        c = self._coefficients[:, :, segment]
        results = []
        for order in range(derivatives + 1):
            value = np.zeros(c.shape[1:])
            for power in range(DEGREE, order - 1, -1):
                value *= x
                value += _FALLING[order, power] * c[power]
            results.append(value / self.spacing**order)
        return results


def _falling() -> Array:
    """Return the factor of ``x^(n - k)`` in the k-th derivative of ``x^n``, by k and n."""
    table = np.ones((DEGREE, ORDER))
    for k in range(1, DEGREE):
        table[k] = table[k - 1] * np.maximum(np.arange(ORDER) - (k - 1), 0)
    return table


_FALLING: Final = _falling()


class Bends(NamedTuple):
    """A path at places along it."""

    u: Array
    """(n,) of the path's parameter [m]."""
    speed: Array
    """(n,) way per u."""
    curvature: Array
    """(n,) with sign, left positive [1/m]."""


class Path:
    """A path by its parameter u, the way along the polygon of its waypoints [m].

    ``at`` (n,) are the waypoints' u.
    """

    def __init__(self, spline: UniformSpline, at: Array, length: float) -> None:
        self.spline, self.at, self.length = spline, at, length

    def bends(self, per_segment: int = _SAMPLES) -> Bends:
        """Return speed and curvature everywhere, a few places in each segment."""
        count = self.spline.segments * per_segment
        u: Array = np.arange(count + 1, dtype=np.float64) * (self.length / count)
        _, first, second = self.spline.sample(u, 2)
        speed = np.hypot(*first)
        turning = first[0] * second[1] - first[1] * second[0]
        with np.errstate(divide="ignore", invalid="ignore"):
            curvature = turning / speed**3
        turned_back = np.zeros(len(u), dtype=bool)
        turned_back[1:] = (first[:, 1:] * first[:, :-1]).sum(axis=0) <= 0.0
        return Bends(u, speed, np.where(turned_back, np.inf, curvature))


def find_path(places: Array, radius: float, deviation: float, prefix: str) -> Path:
    """Return a path that turns no tighter than a radius, with corners as short as that allows.

    :param places: (n, 2) waypoints [m]; none twice in a row.
    :param deviation: from a waypoint [m]; 0: the path goes through each.
    :param prefix: of the parameters, for messages.
    :raises ConfigurationError: if there is none, with the waypoint that is in the way.
    """
    steps = np.linalg.norm(np.diff(places, axis=0), axis=1)
    at = np.concatenate([[0.0], np.cumsum(steps)])
    best: tuple[float, str] = (0.0, "")
    for width in _WIDTHS * radius:
        if not deviation and width > 1.5 * steps.min():
            break
        if at[-1] / width > _MOST_SEGMENTS:
            continue
        path, miss = _rounded(places, at, width, deviation)
        if miss.max() > max(deviation, _MISS):
            far = int(np.argmax(miss))
            reason = f"the path would pass {miss[far]:.2f} m from waypoint {far + 1}"
            best = max(best, (0.0, reason)) if not best[1] else best
            if deviation:
                break
            continue
        bends = path.bends()
        sharpest = int(np.argmax(np.abs(bends.curvature)))
        found = 1.0 / max(abs(bends.curvature[sharpest]), 1e-12)
        if found >= radius:
            return path
        near = int(np.argmin(np.abs(at - bends.u[sharpest])))
        if found >= best[0]:
            best = found, f"the path turns with {found:.3g} m near waypoint {near + 1}"
    raise ConfigurationError(
        f"{prefix}turning_radius = {radius:g}: {best[1] or 'the waypoints are too close'}; move "
        f"waypoints apart, allow a larger {prefix}deviation than {deviation:g} m, or reduce the "
        "radius"
    )


def _rounded(places: Array, at: Array, width: float, deviation: float) -> tuple[Path, Array]:
    """Return the path with segments of a length, and its distance from each waypoint (n,)."""
    segments = max(1, round(at[-1] / width))
    spacing = at[-1] / segments
    nodes = (np.arange(segments + DEGREE) - 2) * spacing
    corners = places
    for _ in range(_CORRECTIONS):
        spline = UniformSpline(_on_polygon(nodes, at, corners), spacing)
        error = places - spline.sample(at, 0)[0].T
        miss = np.linalg.norm(error, axis=1)
        if deviation or miss.max() <= _MISS or not np.isfinite(miss.max()) or miss.max() > 1e6:
            break
        corners = corners + error
    return Path(spline, at, at[-1]), miss


def _on_polygon(nodes: Array, at: Array, corners: Array) -> Array:
    """Return points (m, 2) of a polygon with corners at u ``at``, its ends continued straight."""
    reach = 3.0 * at[-1]
    before = corners[0] - (corners[1] - corners[0]) / (at[1] - at[0]) * reach
    after = corners[-1] + (corners[-1] - corners[-2]) / (at[-1] - at[-2]) * reach
    places = np.vstack([before, corners, after])
    u = np.concatenate([[-reach], at, [at[-1] + reach]])
    return np.column_stack([np.interp(nodes, u, places[:, k]) for k in (0, 1)])
