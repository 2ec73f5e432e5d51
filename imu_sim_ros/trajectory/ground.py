# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""The ground below a path: a plane, elevations of waypoints, or a map of heights."""

from pathlib import Path as FilePath
from typing import Final, Protocol

import numpy as np

from imu_sim_ros.core.errors import InputError
from imu_sim_ros.core.types import Array
from imu_sim_ros.inputs.rows import number_of, row_blocks, shorten_word
from imu_sim_ros.trajectory.bspline import DEGREE
from imu_sim_ros.trajectory.path import Path, UniformSpline, sample_spline_chain

_MOST_CELLS: Final = 25_000_000
"""Largest number of cells of a height map."""
_KEYS: Final = ("ncols", "nrows", "cellsize")
_OPTIONAL: Final = (
    *("xllcorner", "yllcorner", "xllcenter", "yllcenter"),
    "nodata_value",
)
_LEAST_SEGMENTS: Final = 4
"""Smallest number of segments of the spline of the heights."""
_MOST_SEGMENTS: Final = 2_000_000
"""Largest number of segments of the spline of the heights."""
_WAYS: Final = 4
"""Nodes of the table of ways in a segment of a path."""
_GAUSS: Final = 5
"""Number of nodes of the quadrature."""


class HeightMap:
    """Heights at the centres of square cells, bilinear in between; ``spacing`` is a cell [m]."""

    def __init__(self, path: str, x: float, y: float, cell: float, heights: Array) -> None:
        """Store the centre of the south-western cell, and heights (rows north, columns east)."""
        self._path, self._heights = path, heights
        self._corner, self.spacing = np.array([x, y]), cell

    def height(self, points: Array) -> Array:
        """Return heights (n,) at points (n, 2) [m].

        :raises InputError: for a point outside the map, or in a cell without height.
        """
        rows, columns = self._heights.shape
        scaled = (points - self._corner) / self.spacing
        is_outside = ((scaled < 0.0) | (scaled > [columns - 1, rows - 1])).any(axis=1)
        if is_outside.any():
            x, y = points[np.argmax(is_outside)]
            east, north = self._corner + self.spacing * np.array([columns - 1, rows - 1])
            raise InputError(
                f"{self._path}: the drive leaves the map at x {x:.1f}, y {y:.1f} m; it reaches "
                f"from {self._corner[0]:g}, {self._corner[1]:g} to {east:g}, {north:g}"
            )
        cell = np.minimum(scaled.astype(np.int64), [max(columns - 2, 0), max(rows - 2, 0)])
        (east, north), (k, j) = (scaled - cell).T, cell.T
        h = self._heights
        heights: Array = (1.0 - north) * ((1.0 - east) * h[j, k] + east * h[j, k + 1]) + north * (
            (1.0 - east) * h[j + 1, k] + east * h[j + 1, k + 1]
        )
        if np.isnan(heights).any():
            x, y = points[np.argmax(np.isnan(heights))]
            raise InputError(f"{self._path}: has no height at x {x:.1f}, y {y:.1f} m, on the drive")
        return heights


def read_height_map(path: str) -> HeightMap:
    """Return the map of an ESRI ASCII grid, in metres of the world.

    :raises InputError: for a file that is none.
    """
    header: dict[str, float] = {}
    values: list[Array] = []
    count = 0
    for block in row_blocks(FilePath(path), "an ESRI ASCII grid"):
        for number, line in block:
            tokens = line.decode(errors="replace").split()
            if not values and tokens[0].lower() in (*_KEYS, *_OPTIONAL):
                header[tokens[0].lower()] = _value(path, number, tokens[1:])
                continue
            if not values:
                _check_header(path, header)
            try:
                row = np.array([number_of(word) for word in tokens])
            except ValueError:
                raise InputError(f"{path}: line {number}: not numbers") from None
            values.append(row)
            count += len(row)
    if not values:
        raise InputError(f"{path}: has no heights; it must be an ESRI ASCII grid")
    columns, rows = int(header["ncols"]), int(header["nrows"])
    if count != rows * columns:
        raise InputError(f"{path}: has {count} heights; must be {rows} rows of {columns}")
    heights = np.concatenate(values).reshape(rows, columns)[::-1].copy()
    heights[~np.isfinite(heights) | (heights == header.get("nodata_value", -9999.0))] = np.nan
    cell = header["cellsize"]
    x, y = (
        header.get(f"{axis}llcenter", header.get(f"{axis}llcorner", 0.0) + 0.5 * cell)
        for axis in "xy"
    )
    return HeightMap(path, x, y, cell, heights)


def _value(path: str, number: int, tokens: list[str]) -> float:
    """Return the number in a line of the head."""
    try:
        (token,) = tokens
        return number_of(token)
    except ValueError:
        text = shorten_word(" ".join(tokens))
        raise InputError(f"{path}: line {number}: {text}: must be one number") from None


def _check_header(path: str, header: dict[str, float]) -> None:
    """Refuse a head without cell size, corner or counts."""
    missing = [key for key in _KEYS if key not in header]
    if missing:
        raise InputError(
            f"{path}: lacks {', '.join(missing)} in its head; it must be an ESRI ASCII grid"
        )
    columns, rows, cell = (header[key] for key in _KEYS)
    smallest = min(columns, rows)
    if not (smallest >= 2 and columns * rows <= _MOST_CELLS and columns % 1 == rows % 1 == 0):
        raise InputError(
            f"{path}: {columns:g} columns of {rows:g} rows: must be at least 2 each and at most "
            f"{_MOST_CELLS} cells"
        )
    if not 1e-3 <= cell <= 1e6:
        raise InputError(f"{path}: cellsize {cell:g}: must be from 0.001 to 1e6 m")


class Ground(Protocol):
    """The ground below a path."""

    def sample(self, u: Array, derivatives: int) -> list[Array]:
        """Return height and slopes along x and y at u (n,), and derivatives by u, each (3, n)."""


class PlaneProfile:
    """The ground of a plane through the world's origin."""

    def __init__(self, slope: tuple[float, ...], path: Path) -> None:
        """Initialise with splines of height and slopes along each part of a path.

        :param slope: rise of the plane along x and along y [m/m].
        """
        rises = np.array(slope)
        self._joints = path.waypoint_u[path.turns]
        self._splines = [
            UniformSpline(
                np.column_stack(
                    [spline.controls @ rises, np.broadcast_to(rises, spline.controls.shape)]
                ),
                spline.spacing,
            )
            for spline in path.splines
        ]

    def sample(self, u: Array, derivatives: int) -> list[Array]:
        """Return height and slopes; see :class:`Ground`."""
        return sample_spline_chain(self._splines, self._joints, u, derivatives)


class GradeProfile:
    """The ground of a path whose waypoints have elevations: level across, graded along.

    The height is a uniform B-spline of the way s in the plane. Its control points are means of the
    elevations, straight between waypoints, over one of its steps: an even grade stays exact, and a
    change of grade is spread smoothly, as where a road is built.
    """

    def __init__(self, path: Path, heights: Array, smoothing: float) -> None:
        """Initialise with heights (w,) of the waypoints and the length of a step [m]."""
        from scipy.interpolate import make_interp_spline

        self._path = path
        count = max(1, path.splines[0].segments * _WAYS)
        self._step = float(path.length / count)
        nodes: Array = np.arange(count + 1, dtype=np.float64) * self._step
        self._ways = np.concatenate([[0.0], np.cumsum(self._between(nodes[:-1], self._step))])
        s = self._way(path.waypoint_u)
        length = float(s[-1])
        segments = min(max(1, round(length / smoothing)), _MOST_SEGMENTS)
        spacing = length / segments
        ends = s[[0, -1]] + [-4.0 * spacing, 4.0 * spacing]
        grades = (np.diff(heights) / np.diff(s))[[0, -1]]
        beyond = heights[[0, -1]] + grades * (ends - s[[0, -1]])
        knots = np.concatenate([ends[:1], s, ends[1:]])
        polygon = make_interp_spline(
            knots, np.concatenate([beyond[:1], heights, beyond[1:]]), k=1
        ).antiderivative()
        knot_positions = (np.arange(segments + DEGREE) - 2.0) * spacing
        means = (
            polygon(knot_positions + 0.5 * spacing) - polygon(knot_positions - 0.5 * spacing)
        ) / spacing
        self._heights = UniformSpline(means[:, None], spacing)

    def sample(self, u: Array, derivatives: int) -> list[Array]:
        """Return height and slopes; see :class:`Ground`. The slopes are those across: 0."""
        _, d1, d2, d3 = self._path.sample(u, 3)
        r = np.hypot(*d1)
        r1 = (d1 * d2).sum(axis=0) / r
        r2 = ((d2 * d2 + d1 * d3).sum(axis=0) - r1 * r1) / r
        (z,), (z1,), (z2,), (z3,) = self._heights.sample(self._way(u), 3)
        values = (
            *(z, z1 * r, z2 * r * r + z1 * r1),
            z3 * r**3 + 3.0 * z2 * r * r1 + z1 * r2,
        )
        level = np.zeros_like(u)
        return [np.stack([value, level, level]) for value in values[: derivatives + 1]]

    def _way(self, u: Array) -> Array:
        """Return the way (n,) [m] up to u (n,)."""
        node = np.clip((u / self._step).astype(np.int64), 0, len(self._ways) - 2)
        start = self._step * node.astype(np.float64)
        return self._ways[node] + self._between(start, u - start)

    def _between(self, u: Array, length: Array | float) -> Array:
        """Return the way (n,) from u to u + length, by Gauss and Legendre's rule."""
        x, weights = np.polynomial.legendre.leggauss(_GAUSS)
        half = 0.5 * np.broadcast_to(length, u.shape)
        nodes = u + half * (1.0 + x[:, None])
        speed = np.hypot(*self._path.sample(nodes.ravel(), 1)[1]).reshape(nodes.shape)
        return half * (weights @ speed)


def map_profile(ground: HeightMap, path: UniformSpline, track: float) -> UniformSpline:
    """Return the height of the ground and its slopes along x and y, below a path and along it.

    It follows the ground in the steps of its cells, exactly where that is a cubic, and is C4.

    :param track: width over which slopes are taken [m].
    """
    segments = min(max(_LEAST_SEGMENTS, round(path.length / ground.spacing)), _MOST_SEGMENTS)
    spacing = path.length / segments
    u: Array = np.arange(segments + 1, dtype=np.float64) * spacing
    points = path.sample(np.minimum(u, path.length), 0)[0].T
    half = 0.5 * track
    slopes = [
        (ground.height(points + half * axis) - ground.height(points - half * axis)) / track
        for axis in np.eye(2)
    ]
    values = np.column_stack([ground.height(points), *slopes])
    # Point-symmetric beyond both ends, three nodes far; a spline of values v is too smooth by
    # spacing^2 / 4 times their second derivative.
    padding_before, padding_after = (
        2.0 * values[0] - values[3:0:-1],
        2.0 * values[-1] - values[-2:-5:-1],
    )
    values = np.vstack([padding_before, values, padding_after])
    controls = values[1:-1] - 0.25 * (values[2:] - 2.0 * values[1:-1] + values[:-2])
    return UniformSpline(controls, spacing)
