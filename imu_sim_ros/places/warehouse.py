# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""A warehouse: rows of racks with pallets, aisles between them, gates and roof lights."""

from typing import Final

import numpy as np

from imu_sim_ros.places.furniture import DAYLIGHT, LAMP, signs
from imu_sim_ros.places.light import Lamp, Lighting
from imu_sim_ros.places.place import Place, PlaceBuilder, Site
from imu_sim_ros.places.sheet import Print

_DEPTH: Final = 1.1
"""Depth of a rack [m]."""
_AISLE: Final = 2.9
"""Width of an aisle [m]."""
_BAY: Final = 2.8
"""Distance of two uprights [m]."""
_LEVEL: Final = 1.6
"""Height of a level of a rack [m]."""
_FRONT: Final = 3.0
"""Free length before the racks on both ends [m]."""


def warehouse(site: Site) -> Place:
    """Return a warehouse whose aisles run along x."""
    b = PlaceBuilder(site)
    stream = site.stream("warehouse")
    x0, y0, z0 = site.low.tolist()
    x1, y1, z1 = site.high.tolist()
    materials = {"floor": "concrete:8e8e8c", "ceiling": "ribbed:b4b8ba", "walls": "ribbed:c4ccd0"}
    sides = b.room((x0, y0, z0), (x1, y1, z1), materials)
    rows = max(1, int((y1 - y0 - _AISLE) / (_DEPTH + _AISLE)))
    pitch = (y1 - y0 - rows * _DEPTH) / (rows + 1)
    lines, stops = [], []
    height = z0 + min(2.2, 0.4 * (z1 - z0))
    for k in range(rows + 1):
        y = y0 + k * (pitch + _DEPTH)
        ends = [[x0 + 1.4, y + 0.5 * pitch, height], [x1 - 1.4, y + 0.5 * pitch, height]]
        stops += ends if k % 2 == 0 else ends[::-1]
        if k < rows:
            _row(b, y + pitch, stream)
            for edge in (y + pitch - 0.25, y + pitch + _DEPTH + 0.15):
                lines.append(Print("line", _FRONT, edge - y0, x1 - x0 - 2 * _FRONT, 0.1))
    b.add_prints(sides["floor"], lines)
    for side in ("-x", "+x"):
        _gates(b, sides[side], y1 - y0)
    for side in ("-y", "+y"):
        band = [Print("strip", 0, 0, x1 - x0, 0.3)]
        b.add_prints(sides[side], [*band, Print("exit", 0.5 * (x1 - x0), 2.3, 0.6, 0.3)])
        signs(b, sides[side], 0.9, cables=2.75)
    _roof(b)
    return Place(
        faces=tuple(b.faces),
        lighting=Lighting(tuple(b.lamps)),
        low=site.low,
        high=site.high,
        route=np.array(stops),
    )


def _row(b: PlaceBuilder, y: float, stream: np.random.Generator) -> None:
    """Add a row of racks at y with their pallets."""
    x0, _, z0 = b.site.low.tolist()
    x1, _, z1 = b.site.high.tolist()
    bays = max(1, int((x1 - x0 - 2 * _FRONT) / _BAY))
    start = 0.5 * (x0 + x1 - bays * _BAY)
    levels = max(1, int((z1 - z0 - 1.0) / _LEVEL))
    top = z0 + (levels - 1) * _LEVEL + 1.0
    detailed = b.site.texture != "blank"
    for k in range(bays):
        x = start + k * _BAY
        for level in range(levels):
            low = z0 + level * _LEVEL
            free = b.free((x, y, low), (x + _BAY, y + _DEPTH, low + _LEVEL))
            kind = stream.random()
            sizes = stream.uniform(0.7, 1.25, 2)
            shade = int(stream.integers(4))
            if not free or kind < 0.12:
                continue
            parts = ((0.15, 1.25), (1.5, 1.2)) if kind < 0.6 else ((0.2, 2.4),)
            for j, (offset, width) in enumerate(parts):
                _load(b, (x + offset, y, low + 0.14), width, float(sizes[j]), shade)
    for k in range(bays + 1):
        x = start + k * _BAY
        low, high = (x - 0.05, y, z0), (x + 0.05, y + _DEPTH, top)
        if b.free(low, high):
            holes = [Print("holes", 0.0, 0.0, 0.1, top - z0)] if detailed else []
            b.box(low, high, "paint:2c4c8c", {"-y": holes, "+y": holes}, leave="bottom")
    for level in range(1, levels):
        for front in (y - 0.03, y + _DEPTH - 0.02):
            low = (start, front, z0 + level * _LEVEL)
            high = (start + bays * _BAY, front + 0.05, z0 + level * _LEVEL + 0.12)
            if b.free(low, high):
                names = [Print("places", 0.0, 0.0, bays * _BAY, 0.12, b.number())]
                front_side = {"-y": names, "+y": names} if detailed else None
                b.box(low, high, "paint:d8702c", front_side, leave="-x,+x")


def _load(
    b: PlaceBuilder, corner: tuple[float, float, float], width: float, height: float, shade: int
) -> None:
    """Add a pallet with cartons to a level."""
    x, y, z = corner
    material = ("cardboard", "cardboard:a88454", "cardboard:bc9a6c", "paint:dfe4e8")[shade]
    prints = {}
    for side in ("-y", "+y"):
        lines = [Print("cartons", 0, 0, width, height, b.number() % 7)]
        if b.decor.random() < b.rich(0.5):
            lines.append(Print("label", 0.15 * width, 0.55 * height, 0.3, 0.2, b.number()))
        prints[side] = lines if b.site.texture != "blank" and shade < 3 else lines[1:]
    b.box((x, y + 0.08, z), (x + width, y + _DEPTH - 0.08, z + height), material, prints)


def _gates(b: PlaceBuilder, wall: int, width: float) -> None:
    """Add gates along a wall."""
    count = max(1, int(width / 5.0))
    prints = [Print("strip", 0, 0, width, 0.3)]
    for k in range(count):
        x = (k + 0.5) * width / count - 1.6
        prints.append(Print("gate", x, 0, 3.2, 3.4, 0))
        prints.append(Print("number", x + 1.3, 3.6, 0.6, 0.6, k + 1))
    b.add_prints(wall, prints)


def _roof(b: PlaceBuilder) -> None:
    """Add beams, lamps between them, and by day roof lights."""
    x0, y0, _ = b.site.low.tolist()
    x1, y1, z1 = b.site.high.tolist()
    count = max(1, round((x1 - x0) / 6.0))
    strength = {"day": 5.0, "lamps": 14.0, "dim": 8.0}[b.site.light]
    for k in range(count):
        x = x0 + (k + 0.5) * (x1 - x0) / count
        if b.free((x - 0.15, y0, z1 - 0.5), (x + 0.15, y1, z1)):
            b.box((x - 0.12, y0, z1 - 0.45), (x + 0.12, y1, z1), "paint:7c868c", leave="top,-y,+y")
        across = max(1, round((y1 - y0) / 4.0))
        for j in range(across):
            y = y0 + (j + 0.5) * (y1 - y0) / across
            lit = b.site.light != "dim" or (k + j) % 4 == 0
            b.lamp((x + 1.4, y, z1 - 0.3), (0.4, 1.5), LAMP, strength if lit else 0.0)
            if b.site.light == "day" and j % 2 == 0:
                corner = np.array([x - 2.4, y + 1.2, z1 - 0.004])
                pane = corner, np.array([1.6, 0.0, 0.0]), np.array([0.0, -2.4, 0.0])
                b.face(*pane, "paint:eef4fa", glows=True)
                red, green, blue = (3.0 * c for c in DAYLIGHT)
                b.lamps.append(Lamp(pane, (red, green, blue)))
