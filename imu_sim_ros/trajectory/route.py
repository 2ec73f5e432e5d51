# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Routes in files: CSV, GPX and KML, in metres or in latitude and longitude."""

import math
from collections.abc import Iterator, Sequence
from datetime import datetime, timezone
from pathlib import Path
from typing import Final, NamedTuple

import numpy as np

from imu_sim_ros.core.bad_rows import COLUMNS, NUMBERS, STAMPS, VALUES, BadRows
from imu_sim_ros.core.conventions import ECCENTRICITY_SQUARED, SEMI_MAJOR_AXIS
from imu_sim_ros.core.errors import InputError
from imu_sim_ros.core.types import Array
from imu_sim_ros.inputs.rows import LARGEST_TEXT, number_of, row_blocks, shorten_word
from imu_sim_ros.inputs.xml_text import Element, parse_xml

_LATITUDES: Final = ("latitude", "lat", "latitude_deg")
_LONGITUDES: Final = ("longitude", "lon", "lng", "long", "longitude_deg")
_HEIGHTS: Final = ("z", "z_m", "up", "altitude", "alt", "elevation", "ele", "height")
_TIMES: Final = ("t", "time", "time_s", "timestamp")
MOST_POINTS: Final = 1_000_000
"""Largest number of points of a file."""
_FARTHEST: Final = 1e6
"""Largest distance from the origin at which a plane resembles the Earth [m]."""
_HIGHEST: Final = 1e5
"""Largest height [m]."""
_STEPS: Final = 4
"""Each puts a place closer to the plane by its distance over the Earth's radius."""


class Route(NamedTuple):
    """The n points of a file."""

    waypoints: Array
    """(n, 2) x, y in the world [m]."""
    times: Array | None
    """(n,) times since the first point [s]; None: the file has none."""
    origin: tuple[float, float] | None
    """Latitude and longitude of the world's origin [deg]; None for a file in metres."""
    heights: Array
    """(n,) heights as the file has them [m]; NaN where it has none."""


class _Row(NamedTuple):
    """A point of a file, its coordinates as the text that the file has."""

    number: int
    """Number of its line, or of the point in a GPX or KML file."""
    first: str
    """Latitude [deg], or x [m]."""
    second: str
    """Longitude [deg], or y [m]."""
    height: str
    """Height [m]; empty: none."""
    time: float
    """Time [s]; nan: none."""


class _Points(NamedTuple):
    """Contents of a file: latitude, longitude or x, y; times and heights, nan if there is none."""

    rows: list[tuple[float, float, float, float]]
    is_geographic: bool


def read_route(path: str | Path, origin: Sequence[float] = ()) -> Route:
    """Return the route of a CSV, GPX or KML file.

    :param origin: latitude and longitude of the world's origin [deg]; empty: the first point.
    :raises InputError: for a file that cannot be used, a line for each problem.
    """
    kind = Path(path).suffix.lower()
    bad = BadRows(path, "line" if kind not in (".gpx", ".kml") else "point")
    if kind == ".gpx":
        points = _check(_gpx(path, bad), bad, True)
    elif kind == ".kml":
        points = _check(_kml(path, bad), bad, True)
    elif kind in (".csv", ".txt"):
        points = _csv(Path(path), bad)
    else:
        raise InputError(f"{path}: must be a route: .csv, .gpx or .kml")
    bad.complain()
    if len(points.rows) < 2:
        raise InputError(f"{path}: has {len(points.rows)} points; a route needs at least two")
    values = np.array(points.rows)
    times = None if np.isnan(values[:, 2]).any() else values[:, 2] - values[0, 2]
    if not points.is_geographic:
        return Route(values[:, :2], times, None, values[:, 3])
    where = (float(origin[0]), float(origin[1])) if origin else (values[0, 0], values[0, 1])
    waypoints = east_north(values[:, 0], values[:, 1], *where)
    distance = np.linalg.norm(waypoints, axis=1)
    if not distance.max() <= _FARTHEST:
        raise InputError(
            f"{path}: point {np.argmax(distance) + 1} is {distance.max() * 1e-3:.0f} km from the "
            "origin "
            f"({where[0]:g}, {where[1]:g}); a flat world reaches {_FARTHEST * 1e-3:.0f} km"
        )
    return Route(waypoints, times, where, values[:, 3])


def east_north(latitude: Array, longitude: Array, origin: float, meridian: float) -> Array:
    """Return x, y (n, 2) [m] in the plane that touches WGS84 at an origin, east and north of it.

    The points are those of the plane with these latitudes and longitudes, so that a receiver on the
    plane, z = 0, reports them.

    :param latitude: (n,) geodetic [deg].
    :param longitude: (n,) longitude [deg].
    :param origin: latitude of the origin [deg].
    :param meridian: longitude of the origin [deg].

    >>> import numpy as np
    >>> east_north(np.array([48.0]), np.array([11.001]), 48.0, 11.0).round(2).tolist()
    [[74.63, 0.0]]
    """
    phi, lam = np.radians(latitude), np.radians(longitude - meridian)
    sine, cosine = np.sin(phi), np.cos(phi)
    s, c = math.sin(math.radians(origin)), math.cos(math.radians(origin))
    normal = SEMI_MAJOR_AXIS / np.sqrt(1.0 - ECCENTRICITY_SQUARED * sine * sine)
    curvature_radius = SEMI_MAJOR_AXIS / math.sqrt(1.0 - ECCENTRICITY_SQUARED * s * s)
    height = np.zeros_like(phi)
    for _ in range(_STEPS):
        across = (normal + height) * cosine
        out, east = across * np.cos(lam) - curvature_radius * c, across * np.sin(lam)
        z = (normal * (1.0 - ECCENTRICITY_SQUARED) + height) * sine
        z = z - curvature_radius * (1.0 - ECCENTRICITY_SQUARED) * s
        up = c * out + s * z
        north = c * z - s * out
        # The vertical there leans away from ours by the angle between both.
        height = height - up / (s * sine + c * cosine * np.cos(lam))
    return np.column_stack([east, north])


def _check(rows: Iterator[_Row], bad: BadRows, is_geographic: bool) -> _Points:
    """Return the points of rows."""
    points: list[tuple[float, float, float, float]] = []
    for number, x_text, y_text, height, t in rows:
        if len(points) >= MOST_POINTS:
            raise InputError(f"{bad.source}: more than {MOST_POINTS} points")
        try:
            pair = number_of(x_text.strip()), number_of(y_text.strip())
        except ValueError:
            bad.note(
                NUMBERS, number, f"{shorten_word(x_text)}, {shorten_word(y_text)}: not two numbers"
            )
            continue
        if not all(math.isfinite(value) for value in pair):
            bad.note(VALUES, number, f"{x_text}, {y_text}: must be finite")
        elif is_geographic and not (abs(pair[0]) <= 90.0 and abs(pair[1]) <= 360.0):
            bad.note(
                *(VALUES, number),
                f"latitude {pair[0]:g}, longitude {pair[1]:g}: must be within 90 and 360 deg",
            )
        elif not is_geographic and max(map(abs, pair)) > _FARTHEST:
            bad.note(VALUES, number, f"{pair[0]:g}, {pair[1]:g}: must be within {_FARTHEST:g} m")
        else:
            points.append((*pair, t, _height(height)))
    return _Points(points, is_geographic)


def _csv(path: Path, bad: BadRows) -> _Points:
    """Return the points of a route in a CSV file."""
    header: list[str] = []
    rows: list[_Row] = []
    columns: tuple[int, int, int, int] | None = None
    geographic = False
    for block in row_blocks(path, "a route of comma-separated values"):
        for number, line in block:
            cells = [w.strip() for w in line.decode(errors="replace").replace(";", ",").split(",")]
            if columns is None:
                header = [word.lower() for word in cells]
                columns, geographic = _columns(path, header)
                continue
            if len(cells) != len(header):
                bad.note(COLUMNS, number, f"{len(cells)} columns; must be {len(header)}")
                continue
            x_column, y_column, height_column, time_column = columns
            t = math.nan
            if time_column >= 0:
                try:
                    t = number_of(cells[time_column])
                except ValueError:
                    bad.note(
                        STAMPS, number, f"time {shorten_word(cells[time_column])}: not a number [s]"
                    )
            height = cells[height_column] if height_column >= 0 else ""
            rows.append(_Row(number, cells[x_column], cells[y_column], height, t))
        bad.rows, bad.good = bad.count, len(rows)
        bad.give_up()
    if columns is None:
        raise InputError(f"{path}: is empty")
    return _check(iter(rows), bad, geographic)


def _columns(path: Path, header: list[str]) -> tuple[tuple[int, int, int, int], bool]:
    """Return the columns of coordinates, height and time, -1 for none; whether on the Earth."""

    def column(names: Sequence[str]) -> int:
        return next((k for k, word in enumerate(header) if word in names), -1)

    up, time = column(_HEIGHTS), column(_TIMES)
    latitude, longitude = column(_LATITUDES), column(_LONGITUDES)
    if latitude >= 0 and longitude >= 0:
        return (latitude, longitude, up, time), True
    x, y = column(("x", "x_m", "east")), column(("y", "y_m", "north"))
    if x >= 0 and y >= 0:
        return (x, y, up, time), False
    raise InputError(
        f"{path}: the first line must name the columns, x and y or latitude and longitude; it is "
        f"{shorten_word(','.join(header))}"
    )


def _height(word: str) -> float:
    """Return a height [m]; NaN for none, and for a text that is no number."""
    try:
        value = number_of(word.strip())
    except ValueError:
        return math.nan
    return value if abs(value) <= _HIGHEST else math.nan


def _gpx(path: str | Path, bad: BadRows) -> Iterator[_Row]:
    """Yield the points of all tracks; without tracks of all routes, without these all waypoints."""
    elements = list(parse_xml(path).every())
    for tag in ("trkpt", "rtept", "wpt"):
        points = [element for element in elements if _local(element) == tag]
        if points:
            break
    for number, point in enumerate(points, start=1):
        stamp, height = (
            next((child.text for child in point.children if _local(child) == tag), "")
            for tag in ("time", "ele")
        )
        latitude, longitude = (point.attributes.get(name, "") for name in ("lat", "lon"))
        yield _Row(number, latitude, longitude, height, _seconds(stamp, number, bad))


def _kml(path: str | Path, bad: BadRows) -> Iterator[_Row]:
    """Yield the points of the first line or track; without any all placemarks' points."""
    elements = list(parse_xml(path, LARGEST_TEXT).every())
    track = next((element for element in elements if _local(element) == "Track"), None)
    if track is not None:
        coordinates = [child.text for child in track.children if _local(child) == "coord"]
        stamps = [child.text for child in track.children if _local(child) == "when"]
        for number, text in enumerate(coordinates, start=1):
            longitude, latitude, height, *_ = (*text.split(), "", "", "")
            stamp = stamps[number - 1] if len(stamps) == len(coordinates) else ""
            yield _Row(number, latitude, longitude, height, _seconds(stamp, number, bad))
        return
    texts = _coordinates(elements, "LineString")[:1] or _coordinates(elements, "Point")
    tuples = [tuple_text for text in texts for tuple_text in text.split()]
    for number, tuple_text in enumerate(tuples, start=1):
        longitude, latitude, height, *_ = (*tuple_text.split(","), "", "", "")
        yield _Row(number, latitude, longitude, height, math.nan)


def _coordinates(elements: list[Element], tag: str) -> list[str]:
    """Return the texts of the coordinates of all elements of a name."""
    return [
        child.text
        for element in elements
        if _local(element) == tag
        for child in element.children
        if _local(child) == "coordinates"
    ]


def _local(element: Element) -> str:
    """Return an element's name without the prefix of its namespace."""
    return element.tag.rpartition(":")[2]


def _seconds(stamp: str, number: int, bad: BadRows) -> float:
    """Return the Unix time of an ISO 8601 stamp; nan if there is none."""
    text = stamp.strip()
    if not text:
        return math.nan
    try:
        when = datetime.fromisoformat(text.replace("Z", "+00:00"))
    except ValueError:
        bad.note(STAMPS, number, f"time {shorten_word(text)}: must be like 2026-05-01T08:30:00Z")
        return math.nan
    return when.replace(tzinfo=when.tzinfo or timezone.utc).timestamp()
