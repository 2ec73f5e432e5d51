# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""An office: desks in an open room with windows, and closed rooms behind doors along one side."""

from typing import Final

import numpy as np

from imu_sim_ros.places.furniture import (
    OFFICE_SIGNS,
    add_ceiling_lamps,
    bookcase,
    desk,
    door_leaf,
    fittings,
    plant,
    signs,
    table,
    wall_decoration,
    windows,
)
from imu_sim_ros.places.place import Place, PlaceBuilder, Site
from imu_sim_ros.places.sheet import Print

_ROOMS: Final = 3.3
"""Depth of the closed rooms [m]."""
_LEAST: Final = 7.0
"""Smallest depth of an office with closed rooms [m]."""
_DOOR: Final = 1.0
"""Width of an opening [m]."""
_OPEN: Final = 1.45
"""Angle of an open door [rad]."""
_WALL: Final = 0.1
"""Thickness of a wall [m]."""
_LINTEL: Final = 2.1
"""Height of a doorway [m]."""
_HEIGHT: Final = 1.35
"""Height of a tour, below the lintels [m]."""


def office(site: Site) -> Place:
    """Return an office with windows at -y and closed rooms at +y."""
    b = PlaceBuilder(site)
    stream = site.stream("office")
    carpet = ("flecked:66707c", "flecked:7a7468", "flecked:5c6c66")[int(stream.integers(3))]
    sides = b.room(
        site.low.tolist(),
        site.high.tolist(),
        {"floor": carpet, "ceiling": "ceiling", "walls": "plaster"},
    )
    lit = windows(b, sides["-y"], 0.9, 1.35)
    x0, y0, z0 = site.low.tolist()
    x1, y1, z1 = site.high.tolist()
    partition = y1 - _ROOMS
    if y1 - y0 < _LEAST or not b.free((x0, partition, z0), (x1, partition + _WALL, z1)):
        partition = y1
    stops = []
    if partition < y1:
        stops = _closed_rooms(b, partition, stream)
    x_low, x_high = _desks(b, partition, stream)
    add_ceiling_lamps(b)
    fittings(b, sides["ceiling"])
    for x in (x0 + 0.45, x1 - 0.45):
        if stream.random() < 0.8 and b.free((x - 0.3, y0 + 0.2, z0), (x + 0.3, y0 + 0.8, z0 + 1.4)):
            plant(b, (x, y0 + 0.5, z0), stream)
    for k in range(int((x1 - x0) / 4.0)):
        x = x0 + 2.0 + 4.0 * k
        low, high = (x - 0.5, y0 + 0.01, z0), (x + 0.5, y0 + 0.13, z0 + 0.6)
        if b.free(low, high):
            b.box(low, high, "paint:f0f0ec", {"+y": [Print("grille", 0.02, 0.03, 0.96, 0.54, 0)]})
    for side in ("-x", "+x", "+y"):
        wall_decoration(b, sides[side])
        signs(b, sides[side], 0.5, OFFICE_SIGNS)
    return Place(
        faces=tuple(b.faces),
        lighting=lit(b),
        low=site.low,
        high=site.high,
        route=np.array([*x_low, *stops, *x_high]),
        hinges=tuple(b.hinges),
    )


def _closed_rooms(b: PlaceBuilder, y: float, stream: np.random.Generator) -> list[list[float]]:
    """Build rooms behind a wall at y; return a point (3,) behind each door, for a tour."""
    x0, _, z0 = b.site.low.tolist()
    x1, y1, z1 = b.site.high.tolist()
    count = max(1, round((x1 - x0) / 4.4))
    width = (x1 - x0) / count
    stops: list[list[float]] = []
    sides: list[int] = []
    fronts: list[int] = []
    for k in range(count):
        x_low, x_high = x0 + k * width, x0 + (k + 1) * width
        opening = x_low + (0.25 if k % 2 else 0.65) * (width - _DOOR)
        fronts += _front(b, (x_low, x_high), y, opening)
        if k and b.free((x_low - 0.05, y, z0), (x_low + 0.05, y1, z1)):
            strip = [Print("strip", 0, 0, y1 - y, 0.07)]
            low, high = (x_low - 0.05, y + _WALL, z0), (x_low + 0.05, y1, z1)
            faces = b.box(low, high, "plaster", dict.fromkeys(("-x", "+x"), strip),
                         leave="top,bottom,-y,+y")  # fmt: skip
            sides += faces.values()
        middle = 0.5 * (x_low + x_high)
        if k % 2 == 0:
            table(b, (middle, y1 - 1.35, z0), (2.0, 1.0), stream, chairs=True)
        else:
            desk(b, (middle, y1 - 0.55, z0), 0.0, stream)
        low, high = (x_high - 0.45, y1 - 1.5, z0), (x_high - 0.06, y1 - 0.4, z0 + 1.95)
        if b.free(low, high):
            bookcase(b, low, high, "-x")
        stops.append([opening + 0.5 * _DOOR, y + 0.75, z0 + _HEIGHT])
    for wall in sides:
        if b.decor.random() < b.rich(0.6):
            number, places = b.number(), (0.5, 0.8, 0.2, 1.1)
            any(b.hang(wall, Print("whiteboard", x, 1.0, 2.0, 1.1, number)) for x in places)
    for wall in (*sides, *fronts):
        signs(b, wall, 0.35, OFFICE_SIGNS)
    return stops


def _front(b: PlaceBuilder, ends: tuple[float, float], y: float, opening: float) -> list[int]:
    """Build one room's part of the wall between it and the open office, with its door.

    :returns: the places of its sides among the faces.
    """
    x_low, x_high = ends
    z0, z1 = float(b.site.low[2]), float(b.site.high[2])
    strip, walls = 0.07, []
    for a, c in ((x_low, opening), (opening + _DOOR, x_high)):
        decoration = [Print("strip", 0, 0, c - a, strip)]
        if c - a > 1.2 and b.decor.random() < b.rich(0.6):
            kind = ("poster", "notices")[int(b.decor.integers(2))]
            w, h = (0.7, 1.0) if kind == "poster" else (1.1, 0.9)
            decoration.append(Print(kind, 0.5 * (c - a - w), 1.05, w, h, b.number()))
        low, high = (a, y, z0), (c, y + _WALL, z1)
        leave = ["top", "bottom"]
        leave += ["-x"] if a == x_low else ["+x"]
        faces = b.box(
            low,
            high,
            "plaster",
            {"-y": decoration, "+y": [Print("strip", 0, 0, c - a, strip)]},
            leave=",".join(leave),
        )
        walls += [faces["-y"], faces["+y"]]
    low, high = (opening, y, z0 + _LINTEL), (opening + _DOOR, y + _WALL, z1)
    sign = [Print("label", 0.35, 0.06, 0.3, 0.16, b.number())] if z1 - z0 - _LINTEL > 0.3 else []
    b.box(low, high, "plaster", {"-y": sign}, leave="top,-x,+x")
    door_leaf(b, (opening, y + _WALL, z0), _DOOR - 0.06, _LINTEL - 0.03, _OPEN, b.number())
    return walls


def _desks(
    b: PlaceBuilder, depth: float, stream: np.random.Generator
) -> tuple[list[list[float]], list[list[float]]]:
    """Add pairs of desks to the open room; return points for a tour at its -x and its +x end."""
    x0, y0, z0 = b.site.low.tolist()
    x1 = float(b.site.high[0])
    rows = max(1, int((depth - y0 - 1.6) / 3.2))
    columns = max(1, int((x1 - x0 - 2.2) / 2.9))
    pitch = (x1 - x0 - 2.2) / columns
    for i in range(rows):
        for j in range(columns):
            x = x0 + 1.1 + (j + 0.5) * pitch
            y = y0 + 1.2 + (i + 0.5) * (depth - y0 - 1.6) / rows
            if stream.random() < 0.08:
                continue
            for way in (1, -1):
                desk(b, (x, y + way * 0.41, z0), 0.0 if way > 0 else np.pi, stream)
            if stream.random() < 0.6:
                low, high = (x - 0.8, y - 0.015, z0 + 0.76), (x + 0.8, y + 0.015, z0 + 1.16)
                if b.free(low, high):
                    b.box(low, high, "carpet:8c98a4")
    middle, edge, height = depth - 0.75, y0 + 0.65, z0 + _HEIGHT
    x_low = [[x0 + 0.7, edge + 0.6, height], [x0 + 0.7, middle, height]]
    x_high = [[x1 - 0.7, middle, height], [x1 - 0.7, edge + 0.6, height]]
    return x_low, [*x_high, [0.5 * (x0 + x1), edge, height]]
