# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""The ground below a path: a plane, or a map of heights as geographic programs write them."""

from pathlib import Path
from typing import Final

import numpy as np

from imu_sim_ros.errors import InputError
from imu_sim_ros.inputs.rows import number_of, row_blocks, shortened
from imu_sim_ros.trajectory.path import UniformSpline
from imu_sim_ros.types import Array

_MOST_CELLS: Final = 25_000_000
_KEYS: Final = ("ncols", "nrows", "cellsize")
_OPTIONAL: Final = (
    *("xllcorner", "yllcorner", "xllcenter", "yllcenter"),
    "nodata_value",
)
_LEAST_SEGMENTS: Final = 4
_MOST_SEGMENTS: Final = 2_000_000


class HeightMap:
    """Heights at the centres of square cells, bilinear in between; ``spacing`` is a cell [m]."""

    def __init__(self, path: str, x: float, y: float, cell: float, heights: Array) -> None:
        """Take the centre of the south-western cell, and heights (rows north, columns east)."""
        self._path, self._heights = path, heights
        self._corner, self.spacing = np.array([x, y]), cell

    def height(self, places: Array) -> Array:
        """Return heights (n,) at places (n, 2) [m].

        :raises InputError: for a place outside the map, or in a cell without height.
        """
        rows, columns = self._heights.shape
        scaled = (places - self._corner) / self.spacing
        outside = ((scaled < 0.0) | (scaled > [columns - 1, rows - 1])).any(axis=1)
        if outside.any():
            x, y = places[np.argmax(outside)]
            east, north = self._corner + self.spacing * np.array([columns - 1, rows - 1])
            raise InputError(
                f"{self._path}: the drive leaves the map at x {x:.1f}, y {y:.1f} m; it reaches "
                f"from {self._corner[0]:g}, {self._corner[1]:g} to {east:g}, {north:g}"
            )
        cell = np.minimum(scaled.astype(np.int64), [max(columns - 2, 0), max(rows - 2, 0)])
        (east, north), (k, j) = (scaled - cell).T, cell.T
        h = self._heights
        found: Array = (1.0 - north) * ((1.0 - east) * h[j, k] + east * h[j, k + 1]) + north * (
            (1.0 - east) * h[j + 1, k] + east * h[j + 1, k + 1]
        )
        if np.isnan(found).any():
            x, y = places[np.argmax(np.isnan(found))]
            raise InputError(f"{self._path}: has no height at x {x:.1f}, y {y:.1f} m, on the drive")
        return found


def read_height_map(path: str) -> HeightMap:
    """Return the map of an ESRI ASCII grid, in metres of the world.

    :raises InputError: for a file that is none.
    """
    header: dict[str, float] = {}
    values: list[Array] = []
    count = 0
    for block in row_blocks(Path(path), "an ESRI ASCII grid"):
        for number, line in block:
            words = line.decode(errors="replace").split()
            if not values and words[0].lower() in (*_KEYS, *_OPTIONAL):
                header[words[0].lower()] = _value(path, number, words[1:])
                continue
            if not values:
                _check_header(path, header)
            try:
                row = np.array([number_of(word) for word in words])
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


def _value(path: str, number: int, words: list[str]) -> float:
    try:
        (word,) = words
        return number_of(word)
    except ValueError:
        given = shortened(" ".join(words))
        raise InputError(f"{path}: line {number}: {given}: must be one number") from None


def _check_header(path: str, header: dict[str, float]) -> None:
    missing = [key for key in _KEYS if key not in header]
    if missing:
        raise InputError(
            f"{path}: lacks {', '.join(missing)} in its head; it must be an ESRI ASCII grid"
        )
    columns, rows, cell = (header[key] for key in _KEYS)
    least = min(columns, rows)
    if not (least >= 2 and columns * rows <= _MOST_CELLS and columns % 1 == rows % 1 == 0):
        raise InputError(
            f"{path}: {columns:g} columns of {rows:g} rows: must be at least 2 each and at most "
            f"{_MOST_CELLS} cells"
        )
    if not 1e-3 <= cell <= 1e6:
        raise InputError(f"{path}: cellsize {cell:g}: must be from 0.001 to 1e6 m")


def plane_profile(slope: tuple[float, ...], path: UniformSpline) -> UniformSpline:
    """Return height and slopes of a plane through the world's origin, as :func:`map_profile`."""
    rises = np.array(slope)
    slopes = np.broadcast_to(rises, path.controls.shape)
    return UniformSpline(np.column_stack([path.controls @ rises, slopes]), path.spacing)


def map_profile(ground: HeightMap, path: UniformSpline, track: float) -> UniformSpline:
    """Return the height of the ground and its slopes along x and y, below a path and along it.

    It follows the ground in the steps of its cells, exactly where that is a cubic, and is C4.

    :param track: width over which slopes are taken [m].
    """
    segments = min(max(_LEAST_SEGMENTS, round(path.length / ground.spacing)), _MOST_SEGMENTS)
    spacing = path.length / segments
    u: Array = np.arange(segments + 1, dtype=np.float64) * spacing
    place = path.sample(np.minimum(u, path.length), 0)[0].T
    half = 0.5 * track
    slopes = [
        (ground.height(place + half * axis) - ground.height(place - half * axis)) / track
        for axis in np.eye(2)
    ]
    values = np.column_stack([ground.height(place), *slopes])
    # Point-symmetric beyond both ends, three nodes far; a spline of values v is too smooth by
    # spacing^2 / 4 times their second derivative.
    before, after = 2.0 * values[0] - values[3:0:-1], 2.0 * values[-1] - values[-2:-5:-1]
    values = np.vstack([before, values, after])
    controls = values[1:-1] - 0.25 * (values[2:] - 2.0 * values[1:-1] + values[:-2])
    return UniformSpline(controls, spacing)
