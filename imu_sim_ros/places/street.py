# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""A street: houses on both sides, pavements, trees, lamp posts, parked cars, and the sky."""

import math
from typing import Final

import numpy as np

from imu_sim_ros.places.clouds import CLOUDED
from imu_sim_ros.places.furniture import LAMP, SUN
from imu_sim_ros.places.light import Lamp, Lighting
from imu_sim_ros.places.outdoor_prints import CAR_COLOURS, WHEEL_HEIGHT
from imu_sim_ros.places.place import Place, PlaceBuilder, Site, rotation_about_z
from imu_sim_ros.places.sheet import Print

_FACADES: Final = (
    *("brick", "brick:8a4c3c", "plaster:d8c8a4", "plaster:c8b0a0", "plaster:a8b4b8"),
    *("concrete:b0aca4", "plaster:e0d8c0", "brick:b08468"),
)
_SKY: Final = {"day": CLOUDED, "lamps": "paint:0c1018", "dim": "paint:b4b8be"}
_RADIANCE: Final = {
    "day": (0.42, 0.5, 0.62),
    "lamps": (0.01, 0.012, 0.018),
    "dim": (0.8, 0.82, 0.85),
}
_FAR: Final = 140.0
"""Distance of the sky from the street's ends and sides [m]."""
_STOREY: Final = 3.1
"""Height of a storey [m]."""
_AXLE: Final = 1.25
"""Distance of a car's axles from its middle [m]."""
_FLAT: Final = 0.3
"""Distance of a tyre's axis from the ground: a tyre is an octagon [m]."""
_TYRE: Final = "paint:202022"


def street(site: Site) -> Place:
    """Return a street along the longer of x and y; its space is that between the houses."""
    b = PlaceBuilder(site)
    stream = site.stream("street")
    low, high = site.low, site.high
    along = 0 if high[0] - low[0] >= high[1] - low[1] else 1
    ground = float(low[2])
    _sky_and_ground(b, ground)
    wide = float((high - low)[1 - along])
    walk = min(2.6, 0.25 * wide)
    for side in (0, 1):
        _houses(b, along, side, stream)
        inner = low[1 - along] + walk if side == 0 else high[1 - along] - walk
        outer = low[1 - along] if side == 0 else high[1 - along]
        corner, end = _span(
            b, along, (min(inner, outer), max(inner, outer)), (ground, ground + 0.14)
        )
        if b.free(corner, end):
            b.box(corner, end, "slabs:a4a09a", leave="bottom")
        _furniture(b, along, float(inner), 1 if side == 0 else -1, stream)
    # A tour along the street 2.4 m above the ground, a little to the left and right of its middle.
    middle = 0.5 * (low + high)
    stops = np.tile(middle, (5, 1))
    stops[:, along] = low[along] + np.array([0.06, 0.35, 0.65, 0.94, 0.5]) * (high - low)[along]
    stops[:, 1 - along] += np.array([-0.05, 0.05, -0.05, 0.0, 0.08]) * wide
    stops[:, 2] = ground + 2.4
    sun = site.light == "day"
    height = math.sqrt(0.5)  # of the sun: 45 degrees above the horizon
    to_sun = (round(0.5 * height * 2**0.5, 9), 0.5, round(height, 9))
    colour = (2.2 * SUN[0], 2.2 * SUN[1], 2.2 * SUN[2]) if sun else (0.0, 0.0, 0.0)
    lighting = Lighting(
        lamps=tuple(b.lamps), to_sun=to_sun, sun=colour, windows=(), sky=_RADIANCE[site.light]
    )
    return Place(faces=tuple(b.faces), lighting=lighting, low=low, high=high, route=stops)


def _span(
    b: PlaceBuilder, along: int, across: tuple[float, float], up: tuple[float, float]
) -> tuple[list[float], list[float]]:
    """Return the corners of a box over the whole length of the street."""
    corner, end = b.site.low.copy(), b.site.high.copy()
    corner[1 - along], end[1 - along] = across
    corner[2], end[2] = up
    return corner.tolist(), end.tolist()


def _sky_and_ground(b: PlaceBuilder, ground: float) -> None:
    """Add sky and ground, far beyond the street."""
    x0, y0 = (b.site.low[:2] - _FAR).tolist()
    x1, y1 = (b.site.high[:2] + _FAR).tolist()
    low, high = (x0, y0, ground - 1.0), (x1, y1, ground + 300.0)
    face_count = len(b.faces)
    sides = b.room(low, high, {"walls": _SKY[b.site.light], "ceiling": _SKY[b.site.light]})
    for face in (sides[side] for side in ("-x", "+x", "-y", "+y", "ceiling")):
        b.faces[face] = b.faces[face]._replace(sky=True, detail=0.02)
    del b.faces[sides["floor"]]
    assert len(b.faces) == face_count + 5
    b.face((x0, y0, ground - 0.02), (x1 - x0, 0, 0), (0, y1 - y0, 0), "grass", detail=0.04)
    start, size = b.site.low, b.site.high - b.site.low
    along = 0 if size[0] >= size[1] else 1
    dashes = []
    for k in range(int(size[along] / 4.0)):
        dash_start, middle = 4.0 * k + 0.5, 0.5 * float(size[1 - along])
        place = (
            (dash_start, middle - 0.07, 2.0, 0.14)
            if along == 0
            else (middle - 0.07, dash_start, 0.14, 2.0)
        )
        dashes.append(Print("dash", *place))
    b.face((start[0], start[1], ground), (size[0], 0, 0), (0, size[1], 0), "asphalt", dashes)


def _houses(b: PlaceBuilder, along: int, side: int, stream: np.random.Generator) -> None:
    """Build a row of houses behind one side of the street."""
    low, high, ground = b.site.low, b.site.high, float(b.site.low[2])
    position = float(low[along]) - 6.0
    while position < high[along] + 4.0:
        width = float(stream.uniform(7.0, 13.0))
        storeys = int(stream.integers(2, 6))
        height = 0.6 + storeys * _STOREY
        material = _FACADES[int(stream.integers(len(_FACADES)))]
        shop = bool(stream.random() < 0.4)
        corner, end = np.zeros(3), np.zeros(3)
        corner[along], end[along] = position, position + width
        face = low[1 - along] if side == 0 else high[1 - along]
        corner[1 - along], end[1 - along] = (face - 9.0, face) if side == 0 else (face, face + 9.0)
        corner[2], end[2] = ground, ground + height
        front = ("-+"[side == 0]) + "yx"[along]
        prints = _facade(b, width, storeys, shop, int(stream.integers(4)))
        roof = {"top": "paint:6c4a40" if stream.random() < 0.5 else "paint:585c60"}
        b.box(corner.tolist(), end.tolist(), material, {front: prints}, materials=roof)
        position += width


def _facade(b: PlaceBuilder, width: float, storeys: int, shop: bool, style: int) -> list[Print]:
    """Return the prints of a front: windows in rows, and a door or a shop."""
    count = max(2, int((width - 0.8) / 1.9))
    pitch = width / count
    prints = [Print("plinth", 0, 0, width, 0.5)]
    for storey in range(storeys):
        sill = 0.6 + storey * _STOREY + 0.85
        for k in range(count):
            x = (k + 0.5) * pitch - 0.55
            if storey == 0:
                if shop:
                    continue
                if k == count // 2:
                    prints.append(Print("door", x, 0.0, 1.1, 2.4, style))
                    continue
            lit = b.site.light == "lamps" and b.decor.random() < 0.3
            kind = "lit" if lit else "glass"
            prints.append(Print(kind, x, sill, 1.1, 1.6, style, glows=lit))
    if shop:
        name = b.number() if b.site.texture != "blank" else 0
        prints.append(
            Print("shop", 0.4, 0.25, width - 0.8, 3.0, name, glows=b.site.light == "lamps")
        )
    return prints


def _furniture(
    b: PlaceBuilder, along: int, edge: float, inwards: int, stream: np.random.Generator
) -> None:
    """Add trees and lamp posts along the kerb, and cars before it."""
    low, high, ground = b.site.low, b.site.high, float(b.site.low[2])
    position, k = float(low[along]) + 2.5, 0
    while position < high[along] - 2.0:
        place = np.array([0.0, 0.0, ground])
        place[along], place[1 - along] = position, edge - 0.5 * inwards
        x, y, z = place.tolist()
        if k % 2 == 0:
            _tree(b, (x, y, z), stream)
        else:
            _lamp_post(b, (x, y, z), along, inwards)
        if stream.random() < 0.6:
            car = place.copy()
            car[along] += 3.0
            car[1 - along] = edge + 1.05 * inwards
            _car(b, car.tolist(), along, stream)
        position, k = position + 5.5, k + 1


def _tree(b: PlaceBuilder, foot: tuple[float, float, float], stream: np.random.Generator) -> None:
    """Add a tree with a crown of four boxes, unless it would stand in the path."""
    x, y, z = foot
    height = float(stream.uniform(2.2, 2.8))
    parts = [
        (*stream.uniform(-0.5, 0.5, 2), 0.75 * k, stream.uniform(0.8, 1.25), stream.uniform(0, 1.5))
        for k in range(4)
    ]
    if not b.free((x - 1.6, y - 1.6, z), (x + 1.6, y + 1.6, z + height + 4.0)):
        return
    b.prism((x, y, z), (x, y, z + height + 0.6), 0.14, "wood:5c4a3a", 6)
    for dx, dy, up, size, turn in parts:
        bottom = z + height + up
        b.box((x + dx - size, y + dy - size, bottom), (x + dx + size, y + dy + size, bottom + 1.4),
              "leaves", turn=float(turn), leave="")  # fmt: skip


def _lamp_post(b: PlaceBuilder, foot: tuple[float, float, float], along: int, inwards: int) -> None:
    """Add a lamp post whose arm reaches over the street."""
    x, y, z = foot
    reach = [0.0, 0.0]
    reach[1 - along] = 1.0 * inwards
    ends = (min(x, x + reach[0]) - 0.2, min(y, y + reach[1]) - 0.2, z)
    if not b.free(ends, (max(x, x + reach[0]) + 0.2, max(y, y + reach[1]) + 0.2, z + 5.2)):
        return
    b.prism((x, y, z), (x, y, z + 5.0), 0.07, "paint:4c545a", 6)
    b.prism((x, y, z + 5.0), (x + reach[0], y + reach[1], z + 5.1), 0.05, "paint:4c545a", 4)
    head = (x + reach[0], y + reach[1], z + 5.06)
    hx, hy, hz = head
    b.box((hx - 0.25, hy - 0.15, hz), (hx + 0.25, hy + 0.15, hz + 0.1), "paint:3c4046", leave="")
    b.box(
        (x - 0.075, y - 0.075, z + 4.95), (x + 0.075, y + 0.075, z + 5.06), "paint:4c545a", leave=""
    )
    if b.site.light == "lamps":
        corner = np.array([hx - 0.2, hy + 0.1, hz - 0.03])
        pane = corner, np.array([0.4, 0.0, 0.0]), np.array([0.0, -0.2, 0.0])
        red, green, blue = (170.0 * c for c in LAMP)
        b.lamps.append(Lamp(pane, (red, green, blue)))
        b.face(*pane, "paint:fff8e0", glows=True)


def _car(b: PlaceBuilder, middle: list[float], along: int, stream: np.random.Generator) -> None:
    """Add a parked car."""
    x, y, z = middle
    paint = int(stream.integers(len(CAR_COLOURS)))
    colour = f"paint:{CAR_COLOURS[paint]}"
    turn = 0.0 if along == 0 else 0.5 * math.pi
    if not b.free((x - 2.2, y - 2.2, z), (x + 2.2, y + 2.2, z + 1.5)):
        return
    side = [Print("wheel", 2.1 + axle - 0.38, 0.0, 0.76, 0.5, paint) for axle in (-_AXLE, _AXLE)]
    ends = [Print("bumper", 0, 0, 1.7, 0.55)]
    prints = {"-y": side, "+y": side, "-x": ends, "+x": ends}
    bottom = z + _FLAT - WHEEL_HEIGHT
    low, high = (x - 2.1, y - 0.85, bottom), (x + 2.1, y + 0.85, z + 0.78)
    b.box(low, high, colour, prints, turn, leave="")
    panes = {face: [Print("panes", 0.1, 0.06, 2.0, 0.46)] for face in ("-y", "+y")}
    panes |= {face: [Print("panes", 0.1, 0.06, 1.3, 0.46)] for face in ("-x", "+x")}
    b.box((x - 1.2, y - 0.75, z + 0.78), (x + 1.0, y + 0.75, z + 1.38), colour, panes, turn)
    for along_x in (-_AXLE, _AXLE):
        for side_y in (-1.0, 1.0):
            _tyre(b, (x, y, z), turn, along_x, side_y, WHEEL_HEIGHT)


def _tyre(
    b: PlaceBuilder,
    foot: tuple[float, float, float],
    turn: float,
    along: float,
    side: float,
    hidden: float,
) -> None:
    """Add the part of a tyre that is below a car: the lower part of an octagon.

    :param foot: point on the ground below the middle of the car [m].
    :param turn: heading of the car [rad].
    :param along: place of the axle along the car [m].
    :param side: -1 or 1, side of the car.
    :param hidden: height of the axis above the lower edge of the car [m].
    """
    half = _FLAT * math.tan(math.pi / 8.0)  # of an edge
    rise = _FLAT - half  # of an oblique edge
    matrix = rotation_about_z(turn)

    def face(
        corner: tuple[float, float, float],
        first: tuple[float, float, float],
        second: tuple[float, float, float],
    ) -> None:
        """Add a rectangle in the axes of the car; the order of its sides turns with the side."""
        across, up = (first, second) if side < 0.0 else (second, first)
        place = np.array(foot) + matrix @ (np.array([along, 0.0, 0.0]) + np.array(corner))
        b.face(place, matrix @ np.array(across), matrix @ np.array(up), _TYRE)

    outer, inner = 0.83 * side, 0.63 * side
    height = _FLAT - hidden
    face((-half, outer, 0.0), (2.0 * half, 0.0, 0.0), (0.0, 0.0, height))
    deep = outer - 0.002 * side
    for way in (-1.0, 1.0):
        edge, depth = (way * rise, 0.0, rise), (-0.5 * way * rise, 0.0, 0.5 * rise)
        corner, width = (way * half, deep, 0.0), (0.0, inner - deep, 0.0)
        if way > 0.0:
            face(corner, edge, depth)
            face(corner, width, edge)
        else:
            face(corner, depth, edge)
            face(corner, edge, width)
    face((-rise, inner, 0.0), (0.0, 0.0, height), (2.0 * rise, 0.0, 0.0))
