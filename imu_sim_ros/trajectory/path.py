# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""A path in the plane: straight between waypoints, rounded at them, C4 up to where it turns back.

The path is a uniform B-spline of degree 5 whose control points lie on the polygon of the waypoints.
Such a spline follows its control points without overshoot: it is exactly straight where six of them
are in line, and its derivatives are bounded by their differences.
"""

import math
from collections.abc import Sequence
from typing import Final, NamedTuple

import numpy as np

from imu_sim_ros.core.errors import ConfigurationError
from imu_sim_ros.core.types import Array, Mask
from imu_sim_ros.trajectory.bspline import BASIS, DEGREE, ORDER

_SAMPLES: Final = 8
"""Per segment, to look at curvature and length."""
_MOST_SEGMENTS: Final = 250_000
"""Largest number of segments of a path: some seconds, and less than 1 GB."""
_WIDTHS: Final = 2.0 ** np.arange(-2.0, 5.1, 0.25)
"""Lengths of a segment that are tried, over the smallest radius."""
_OFF_LINE: Final = 1e-3
"""Largest distance of a waypoint after turning back from the line, over its distance."""
_ALIKE: Final = 1e-9
"""Largest angle between the headings before and after turning back [rad]."""
_CORRECTIONS: Final = 200
"""Largest number of corrections of the corners of the control polygon."""
_MISS: Final = 1e-9
"""Largest distance of a path from a waypoint that it goes through [m]."""


class UniformSpline:
    """k functions of one variable as a uniform B-spline of degree 5, constant steps apart."""

    def __init__(self, controls: Array, spacing: float) -> None:
        """Initialise with control points (c, k); point j acts most at ``(j - 2) spacing``."""
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


def _falling_factorials() -> Array:
    """Return the factor of ``x^(n - k)`` in the k-th derivative of ``x^n``, by k and n."""
    table = np.ones((DEGREE, ORDER))
    for k in range(1, DEGREE):
        table[k] = table[k - 1] * np.maximum(np.arange(ORDER) - (k - 1), 0)
    return table


_FALLING: Final = _falling_factorials()


class Bends(NamedTuple):
    """A path at places along it."""

    u: Array
    """(n,) parameters of the path [m]."""
    speed: Array
    """(n,) length of the way per u."""
    curvature: Array
    """(n,) curvatures, positive to the left [1/m]."""


class Path:
    """A path by its parameter u, the way along the polygon of its waypoints [m].

    ``waypoint_u`` (w,) are the u of the waypoints, ``turns`` the numbers of those at which a new
    spline begins, in the opposite direction.
    """

    def __init__(
        self,
        splines: Sequence[UniformSpline],
        waypoint_u: Array,
        turns: Sequence[int] = (),
        starts_backward: bool = False,
    ) -> None:
        """Initialise with the splines between turns.

        :param splines: x and y of each part of the path by u [m].
        :param waypoint_u: (w,) u of the waypoints [m].
        :param turns: numbers of the waypoints at which the vehicle reverses.
        :param starts_backward: True if the first part is driven backwards.
        """
        self.splines, self.waypoint_u, self.turns = splines, waypoint_u, list(turns)
        self.length, self._turns_at = float(waypoint_u[-1]), waypoint_u[self.turns]
        self._first_direction = -1.0 if starts_backward else 1.0

    def sample(self, u: Array, derivatives: int) -> list[Array]:
        """Return the place and its derivatives by u (n,), each (2, n)."""
        return sample_spline_chain(self.splines, self._turns_at, u, derivatives)

    def driving_direction(self, u: Array) -> Array | float:
        """Return 1 where the vehicle drives forward, -1 where it backs up, at u (n,)."""
        if not self.turns:
            return self._first_direction
        odd = np.searchsorted(self._turns_at, u, side="right") % 2
        return np.where(odd, -self._first_direction, self._first_direction)

    def bends(self) -> Bends:
        """Return speed and curvature everywhere, a few places in each segment."""
        ends = [*self._turns_at, self.length]
        parts, start = [], 0.0
        for spline, end in zip(self.splines, ends, strict=True):
            count = spline.segments * _SAMPLES
            steps: Array = np.arange(count + 1, dtype=np.float64)
            parts.append(start + steps[: count + (end == ends[-1])] * ((end - start) / count))
            start = float(end)
        u = np.concatenate(parts)
        _, d1, d2 = self.sample(u, 2)
        speed = np.hypot(*d1)
        turning = d1[0] * d2[1] - d1[1] * d2[0]
        with np.errstate(divide="ignore", invalid="ignore"):
            curvature = turning / speed**3
        turned_back = np.zeros(len(u), dtype=bool)
        turned_back[1:] = (d1[:, 1:] * d1[:, :-1]).sum(axis=0) <= 0.0
        turned_back[np.searchsorted(u, self._turns_at)] = False
        return Bends(u, speed, np.where(turned_back, np.inf, curvature))


def sample_spline_chain(
    splines: Sequence[UniformSpline], joints: Array, u: Array, derivatives: int
) -> list[Array]:
    """Return values and derivatives at u (n,) of splines that follow each other at ``joints``."""
    if len(splines) == 1:
        return splines[0].sample(u, derivatives)
    which = np.searchsorted(joints, u, side="right")
    starts = np.concatenate([[0.0], joints])
    values = np.empty((derivatives + 1, splines[0].controls.shape[1], len(u)))
    for k, spline in enumerate(splines):
        rows = which == k
        values[:, :, rows] = spline.sample(u[rows] - starts[k], derivatives)
    return list(values)


def find_path(
    waypoints: Array,
    radius: float,
    deviation: float,
    prefix: str,
    backward: Mask | None = None,
) -> Path:
    """Return a path that turns no tighter than a radius, with corners as short as that allows.

    :param waypoints: (n, 2) waypoints [m]; none twice in a row.
    :param deviation: deviation from a waypoint [m]; 0: the path goes through each.
    :param prefix: prefix of the parameters, for messages.
    :param backward: (n - 1,) whether the vehicle backs up on the way to the next waypoint; None:
        nowhere.
    :raises ConfigurationError: if there is none, with the waypoint that is in the way.
    """
    if backward is None:
        backward = np.zeros(len(waypoints) - 1, dtype=bool)
    _check_length(waypoints, radius, prefix)
    turns = (1 + np.flatnonzero(np.diff(backward))).tolist()
    waypoints = _straight_at_turns(waypoints, turns, prefix)
    ends = zip([0, *turns], [*turns, len(waypoints) - 1], strict=True)
    parts = [
        _find_part(
            *_add_guards(waypoints[a : b + 1], a in turns, b in turns), radius, deviation, prefix, a
        )
        for a, b in ends
    ]
    starts = np.cumsum([0.0, *(part.length for part in parts)])
    waypoint_u = np.concatenate(
        [[0.0], *(a + part.waypoint_u[1:] for a, part in zip(starts, parts, strict=False))]
    )
    path = Path([part.splines[0] for part in parts], waypoint_u, turns, bool(backward[0]))
    for k, path_before, path_after in zip(turns, parts, parts[1:], strict=False):
        end, start = (
            path_before.sample(path_before.waypoint_u[-1:], 1),
            path_after.sample(path_after.waypoint_u[:1], 1),
        )
        (x1,), (y1,), (x2,), (y2,) = *end[1], *start[1]
        bend = abs(x1 * y2 - y1 * x2)
        if not (bend < _ALIKE and np.abs(end[0] - start[0]).max() < _MISS):
            raise ConfigurationError(
                f"{prefix}speeds: the path is not straight at waypoint {k + 1}, where the vehicle "
                f"turns back; move the waypoints next to it away, or reduce {prefix}turning_radius"
            )
    return path


def _check_length(waypoints: Array, radius: float, prefix: str) -> None:
    """Refuse a path that would take minutes, with its longest leg."""
    legs = np.linalg.norm(np.diff(waypoints, axis=0), axis=1)
    smallest = float(legs.sum()) / (_WIDTHS[0] * _MOST_SEGMENTS)
    if radius < smallest:
        k = int(np.argmax(legs))
        raise ConfigurationError(
            f"{prefix}turning_radius = {radius:g}: must be at least {smallest:.3g} m for a route "
            "of "
            f"{legs.sum() * 1e-3:.3g} km; its longest leg, {legs[k] * 1e-3:.3g} km, is that from "
            f"waypoint {k + 1} to {k + 2}"
        )


def _straight_at_turns(waypoints: Array, turns: list[int], prefix: str) -> Array:
    """Return waypoints, those after a turn moved by the little that they are off the line there."""
    moved = waypoints.copy()
    for k in turns:
        come, go = moved[k] - moved[k - 1], moved[k + 1] - moved[k]
        along = come / np.linalg.norm(come)
        back = -float(go @ along)
        off = np.linalg.norm(go + back * along)
        if back <= 0.0 or off > _OFF_LINE * back:
            angle = math.degrees(math.atan2(off, back))
            x, y = waypoints[k] - 0.5 * np.linalg.norm(go) * along
            raise ConfigurationError(
                f"{prefix}speeds: at waypoint {k + 1} the vehicle turns back, and the next one is "
                f"{angle:.3g} deg off the line on which it came: it must first go straight, for "
                "example to "
                f"{x:.4f}, {y:.4f}"
            )
        moved[k + 1] = moved[k] - back * along
    return moved


def _add_guards(waypoints: Array, guard_start: bool, guard_end: bool) -> tuple[Array, Mask]:
    """Return waypoints with one more in the middle of the first or last leg, and which were there.

    From there to the end a path is straight, however its corners are moved.
    """
    if len(waypoints) == 2:
        guard_start = guard_end = False
    middle = 0.5 * (waypoints[1:] + waypoints[:-1])
    parts = [
        waypoints[:1],
        *[middle[:1]] * guard_start,
        waypoints[1:-1],
        *[middle[-1:]] * guard_end,
        waypoints[-1:],
    ]
    waypoint = np.ones(len(waypoints) + guard_start + guard_end, dtype=bool)
    waypoint[1] = not guard_start
    waypoint[-2] &= not guard_end
    return np.concatenate(parts), waypoint


def _find_part(
    waypoints: Array,
    waypoint: Mask,
    radius: float,
    deviation: float,
    prefix: str,
    waypoints_before: int,
) -> Path:
    """Return a path along waypoints between which the vehicle does not turn back.

    Segments of the spline are made longer, which rounds corners more, until no bend is sharper than
    the turning radius.

    :param waypoints: (n, 2) points along the way [m].
    :param waypoint: (n,) True for the points that are waypoints, not added ones.
    :param radius: smallest turning radius [m].
    :param deviation: largest distance of the path from a waypoint [m]; 0: it goes through all.
    :param waypoints_before: number of waypoints before this path, for messages.
    :raises ConfigurationError: if no such path was found, with the reason of the best one.
    """
    steps = np.linalg.norm(np.diff(waypoints, axis=0), axis=1)
    waypoint_u = np.concatenate([[0.0], np.cumsum(steps)])
    longest = 1.5 * np.diff(waypoint_u[waypoint]).min()
    best_radius, why = 0.0, ""  # smallest radius of the best path so far, and why it is unfit
    for width in _WIDTHS * radius:
        if not deviation and width > longest:
            break
        path, miss = _round_corners(waypoints, waypoint_u, waypoint, width, deviation)
        if miss.max() > max(deviation, _MISS):
            farthest = int(np.argmax(miss))
            why = why or (
                f"the path would pass {miss[farthest]:.2f} m from waypoint "
                f"{waypoints_before + farthest + 1}"
            )
            if deviation:
                break
            continue
        bends = path.bends()
        sharpest = int(np.argmax(np.abs(bends.curvature)))
        smallest_radius = 1.0 / max(abs(bends.curvature[sharpest]), 1e-12)
        if smallest_radius >= radius:
            return path
        nearest = int(np.argmin(np.abs(path.waypoint_u - bends.u[sharpest])))
        if smallest_radius >= best_radius:
            best_radius = smallest_radius
            why = (
                f"the path turns with {smallest_radius:.3g} m near waypoint "
                f"{waypoints_before + nearest + 1}"
            )
    raise ConfigurationError(
        f"{prefix}turning_radius = {radius:g}: {why or 'the waypoints are too close'}; move "
        f"waypoints apart, allow a larger {prefix}deviation than {deviation:g} m, or reduce the "
        "radius"
    )


def _round_corners(
    waypoints: Array, waypoint_u: Array, waypoint: Mask, width: float, deviation: float
) -> tuple[Path, Array]:
    """Return the path with segments of a length, and its distance from each waypoint (n,) [m].

    Without an allowed deviation the corners of the polygon are moved until the path meets them.

    :param waypoints: (w, 2) corners of the polygon [m].
    :param waypoint_u: (w,) ways to them along the polygon [m].
    :param waypoint: (w,) True for corners that are waypoints.
    :param width: length of a segment, about [m].
    :param deviation: allowed distance from the waypoints [m]; 0: none.
    """
    segments = max(1, round(waypoint_u[-1] / width))
    spacing = waypoint_u[-1] / segments
    nodes = (np.arange(segments + DEGREE) - 2) * spacing
    corners = waypoints
    for _ in range(_CORRECTIONS):
        spline = UniformSpline(_polygon_points(nodes, waypoint_u, corners), spacing)
        error = np.where(waypoint[:, None], waypoints - spline.sample(waypoint_u, 0)[0].T, 0.0)
        miss = np.linalg.norm(error, axis=1)
        if deviation or miss.max() <= _MISS or not np.isfinite(miss.max()) or miss.max() > 1e6:
            break
        corners = corners + error
    return Path([spline], waypoint_u[waypoint]), miss[waypoint]


def _polygon_points(nodes: Array, waypoint_u: Array, corners: Array) -> Array:
    """Return points (m, 2) of a polygon, its ends continued straight.

    :param nodes: (m,) u of the points.
    :param waypoint_u: (w,) u of the corners.
    :param corners: (w, 2) corners [m].
    """
    reach = 3.0 * waypoint_u[-1]
    start_extension = (
        corners[0] - (corners[1] - corners[0]) / (waypoint_u[1] - waypoint_u[0]) * reach
    )
    end_extension = (
        corners[-1] + (corners[-1] - corners[-2]) / (waypoint_u[-1] - waypoint_u[-2]) * reach
    )
    waypoints = np.vstack([start_extension, corners, end_extension])
    u = np.concatenate([[-reach], waypoint_u, [waypoint_u[-1] + reach]])
    return np.column_stack([np.interp(nodes, u, waypoints[:, k]) for k in (0, 1)])
