# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""A flight through a place that touches nothing: waypoints from stop to stop."""

import math
from collections.abc import Callable
from typing import Any, Final, NamedTuple

import numpy as np

from imu_sim_ros.core.errors import ConfigurationError
from imu_sim_ros.core.types import Array
from imu_sim_ros.places.geometry import Surfaces
from imu_sim_ros.places.place import CLEARANCE, Place

_CELL: Final = 0.1
"""Edge of the cells of the search for a way, in large places twice as much [m]."""
_LARGE: Final = 200.0
"""Area of a large place [m^2]."""
_REACH: Final = 1.0
"""Distance beyond which surfaces have no influence [m]."""
_FEWEST: Final = 10
"""Cells of the shortest tour."""
_FEAR: Final = 0.6
"""Distance from surfaces below which a way costs more [m]."""
_STEPS: Final = ((1.4, 5), (1.0, 3), (0.8, 3), (0.6, 1), (0.4, 1))
"""Distances of waypoints that are tried [m], and cells over which the way is smoothed."""
_WAVE: Final = 0.15
"""Amplitude of the flight's rise and fall [m]."""
_LENGTH: Final = 7.0
"""Approximate length of a rise and fall [m]."""
_LOOKS: Final = 4000
"""Number of points of a flight whose distance from surfaces is checked."""


class WaypointList(NamedTuple):
    """Waypoints of a flight, with headings."""

    positions: Array
    """(n, 3) positions p_w [m]."""
    headings: Array
    """(n,) yaw along the way, not wrapped [rad]."""


def clearance(surfaces: Surfaces, points: Array, reach: float = math.inf) -> Array:
    """Return the distance (n,) of points (n, 3) from the nearest of all rectangles [m].

    :param reach: distance beyond which the result may be inf [m].
    """
    order = np.argsort(points[:, 0], kind="stable")
    ordered, result = points[order], np.full(len(points), np.inf)
    corners = surfaces.corners
    low, high = corners.min(axis=1) - reach, corners.max(axis=1) + reach
    begin = np.searchsorted(ordered[:, 0], low[:, 0])
    end = np.searchsorted(ordered[:, 0], high[:, 0], side="right")
    for k, (o, a, b) in enumerate(zip(*surfaces[:3], strict=True)):
        y = ordered[begin[k] : end[k], 1]
        rows = begin[k] + np.flatnonzero((y >= low[k, 1]) & (y <= high[k, 1]))
        offset = ordered[rows] - o
        s, r = ((offset @ side / (side @ side)).clip(0.0, 1.0)[:, None] for side in (a, b))
        rest = offset - s * a - r * b
        result[rows] = np.minimum(result[rows], np.sqrt((rest * rest).sum(axis=1)))
    back = np.empty_like(result)
    back[order] = result
    return back


def tour(place: Place, fly: Callable[[WaypointList], Callable[[int], Array]]) -> WaypointList:
    """Return waypoints through a place, from stop to stop and back to the first.

    :param fly: returns a flight through waypoints: a function of n that returns n positions (n, 3).
    :raises ConfigurationError: for a place without a way through it.
    """
    surfaces = place.surfaces()
    way = _way(place, surfaces)
    for step, smooth in _STEPS:
        for wave in (_WAVE, 0.0):
            waypoints = _thin(way, step, smooth, wave)
            if clearance(surfaces, fly(waypoints)(_LOOKS), _REACH).min() > CLEARANCE:
                return waypoints
    raise ConfigurationError(
        f"trajectory.type = 'tour': no flight stays {CLEARANCE:g} m from everything here; another "
        "trajectory.place_seed or a larger trajectory.place_size may have one"
    )


def _way(place: Place, surfaces: Surfaces) -> Array:
    """Return positions (n, 3), a cell apart, along the cheapest ways between stops."""
    from scipy.sparse.csgraph import dijkstra

    height = float(np.median(place.route[:, 2]))
    width, depth = (place.high - place.low)[:2].tolist()
    cell = _CELL if width * depth < _LARGE else 2.0 * _CELL
    shape = math.ceil(width / cell), math.ceil(depth / cell)
    x, y = ((np.arange(n) + 0.5) * cell + low for n, low in zip(shape, place.low[:2], strict=True))
    grid = np.stack(np.meshgrid(x, y, indexing="ij"), axis=-1).reshape(-1, 2)
    points = np.column_stack([grid, np.full(len(grid), height)])
    free = clearance(_surfaces_at_height(surfaces, height), points, _REACH)
    for dz in (-0.35, 0.35):  # what is just above or below counts as well
        level = points + np.array([0.0, 0.0, dz])
        free = np.minimum(
            free, clearance(_surfaces_at_height(surfaces, height + dz), level, _REACH) + 0.1
        )
    stops = [_nearest_free_point(points, free, stop) for stop in place.route]
    _, predecessors = dijkstra(
        graph(free, shape, CLEARANCE + 0.1), indices=stops, return_predecessors=True
    )
    way, stop_index = [stops[0]], 0
    for k in (*range(1, len(stops)), 0):
        part = [stops[k]]
        while part[-1] >= 0 and part[-1] != stops[stop_index]:
            part.append(int(predecessors[stop_index][part[-1]]))
        if part[-1] >= 0 and len(part) > 1:  # others are out of reach
            way += part[-2::-1]
            stop_index = k
    if len(way) < _FEWEST:
        raise ConfigurationError("trajectory.type = 'tour': this place has nowhere to fly")
    return points[way]


def _surfaces_at_height(surfaces: Surfaces, height: float) -> Surfaces:
    """Return the surfaces that are not far above or below a height."""
    heights = surfaces.corners[..., 2]
    low, high = heights.min(axis=1), heights.max(axis=1)
    return surfaces.some((low < height + _REACH) & (high > height - _REACH))


def graph(free: Array, shape: tuple[int, int], clearance: float) -> Any:
    """Return the sparse matrix (n, n) of the costs of steps between neighbouring free cells.

    :param free: (n,) distance of each cell from the nearest surface [m].
    :param shape: rows and columns of the cells.
    :param clearance: distance from surfaces above which a cell is free [m].
    """
    from scipy.sparse import coo_matrix

    number = np.arange(shape[0] * shape[1]).reshape(shape)
    open_cells = (free > clearance).reshape(shape)
    cost = (1.0 + 3.0 * np.maximum(0.0, 1.0 - free / _FEAR)).reshape(shape)
    rows, columns, values = [], [], []
    for di, dj in ((0, 1), (1, 0), (1, 1), (1, -1)):
        a = np.s_[: shape[0] - di, max(0, -dj) : shape[1] - max(0, dj)]
        b = np.s_[di:, max(0, dj) : shape[1] - max(0, -dj)]
        both = open_cells[a] & open_cells[b]
        rows.append(number[a][both])
        columns.append(number[b][both])
        values.append((math.hypot(di, dj) * 0.5 * (cost[a] + cost[b]))[both])
    ends = np.concatenate(rows), np.concatenate(columns)
    one_way = coo_matrix((np.concatenate(values), ends), shape=(number.size, number.size))
    return (one_way + one_way.T).tocsr()


def _nearest_free_point(points: Array, free: Array, stop: Array) -> int:
    """Return the number of the point nearest to a stop that keeps clear of all faces."""
    away = ((points - stop) ** 2).sum(axis=1)
    return int(np.argmin(np.where(free > CLEARANCE + 0.1, away, np.inf)))


def _thin(way: Array, step: float, smooth: int, wave: float) -> WaypointList:
    """Return waypoints at equal distances along a smoothed way, each heading along it."""
    kernel = np.ones(smooth) / smooth
    wide = np.concatenate([way[:1].repeat(smooth, 0), way, way[-1:].repeat(smooth, 0)])
    line = np.stack([np.convolve(wide[:, k], kernel, "same") for k in range(3)], axis=1)
    line = line[smooth:-smooth]
    line[0], line[-1] = way[0], way[-1]
    lengths = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(line, axis=0), axis=1))])
    count = max(3, round(float(lengths[-1]) / step))
    arc_lengths = np.linspace(0.0, lengths[-1], count)
    positions = np.stack([np.interp(arc_lengths, lengths, line[:, k]) for k in range(3)], axis=1)
    waves = max(1, round(float(lengths[-1]) / _LENGTH))
    positions[:, 2] += wave * np.sin(2.0 * np.pi * waves * arc_lengths / lengths[-1])
    ahead = np.stack([np.interp(arc_lengths + 0.4, lengths, line[:, k]) for k in range(2)], axis=1)
    behind = np.stack([np.interp(arc_lengths - 0.4, lengths, line[:, k]) for k in range(2)], axis=1)
    along = ahead - behind
    headings = np.unwrap(np.arctan2(along[:, 1], along[:, 0]))
    return WaypointList(np.round(positions, 6), np.round(headings, 6))
