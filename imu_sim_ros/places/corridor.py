# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""A corridor: doors at equal distances on both sides, lamps in a row, and hardly anything else."""

import math
from typing import Final

import numpy as np

from imu_sim_ros.places.furniture import LAMP, fittings, plant
from imu_sim_ros.places.light import Lighting
from imu_sim_ros.places.place import Hinge, Place, PlaceBuilder, Site
from imu_sim_ros.places.sheet import Print

_PITCH: Final = 3.6
"""Distance of two doors [m]."""
_DOOR: Final = 1.0
"""Width of a door [m]."""


def corridor(site: Site) -> Place:
    """Return a corridor along the longer of x and y."""
    b = PlaceBuilder(site)
    stream = site.stream("corridor")
    low, high = site.low, site.high
    along = 0 if high[0] - low[0] >= high[1] - low[1] else 1
    floor = ("tiles:b4b0a6", "flecked:5a6470", "tiles:8c9296")[int(stream.integers(3))]
    sides = b.room(
        low.tolist(), high.tolist(), {"floor": floor, "ceiling": "ceiling", "walls": "plaster"}
    )
    length, height = float(high[along] - low[along]), float(high[2] - low[2])
    door = int(stream.integers(4))
    _things(b, along, stream)
    walls = ("-y", "+y") if along == 0 else ("-x", "+x")
    for k, side in enumerate(walls):
        moving = (site.doors + 1 - k) // 2
        doors, wall_prints = _doors(b, length, height, door, moving)
        b.add_prints(sides[side], doors)
        for fitting in wall_prints:
            b.hang(sides[side], fitting)
        _hang(b, sides[side], moving, min(2.1, height - 0.2), door)
    for side in ("-x", "+x") if along == 0 else ("-y", "+y"):
        width = float(high[1 - along] - low[1 - along])
        fits = min(1.8, width - 0.2), min(2.15, height - 0.35)
        b.add_prints(
            sides[side],
            [
                Print("strip", 0, 0, width, 0.07),
                Print("doors", 0.5 * (width - fits[0]), 0, *fits, number=door),
                Print("exit", 0.5 * width - 0.2, fits[1] + 0.1, 0.4, 0.18),
            ],
        )
    _lamps(b, along)
    fittings(b, sides["ceiling"], 1.2 if length * (high[1 - along] - low[1 - along]) < 120 else 2.4)
    middle = 0.5 * (low + high)
    stops = np.tile(middle, (4, 1))
    stops[:, along] = low[along] + np.array([0.03, 0.35, 0.7, 0.97]) * length
    stops[:, 2] = low[2] + min(1.5, 0.55 * height)
    return Place(
        faces=tuple(b.faces),
        lighting=Lighting(tuple(b.lamps)),
        low=low,
        high=high,
        route=stops,
        hinges=tuple(b.hinges),
    )


def _doors(
    b: PlaceBuilder, length: float, height: float, door: int, moving: int
) -> tuple[list[Print], list[Print]]:
    """Return the equal doors of a wall with their plates, and prints between them.

    :param moving: number of doors that move; they are every second one.
    """
    prints = [Print("strip", 0, 0, length, 0.09)]
    wall_prints: list[Print] = []
    prints.append(Print("band", 0, 0.95, length, 0.12))
    for k in range(int((length - 1.0) / _PITCH)):
        x = 1.2 + k * _PITCH
        kind = "opening" if k % 2 and k // 2 < moving else "door"
        prints.append(Print(kind, x, 0, _DOOR, min(2.1, height - 0.2), door))
        prints.append(Print("label", x + _DOOR + 0.12, 1.5, 0.2, 0.12, b.number()))
        if b.site.texture != "blank":
            wall_prints.append(Print("switch", x + _DOOR + 0.14, 1.12, 0.09, 0.17))
            wall_prints.append(Print("outlet", x + _DOOR + 0.5, 0.25, 0.16, 0.08))
            if k % 3 == 1:
                wall_prints.append(Print("plan", x - 0.75, 1.35, 0.5, 0.36, b.number()))
            if kind == "door" and b.decor.random() < 0.6:
                prints.append(Print("paper", x + 0.38, 1.15, 0.21, 0.297, b.number()))
        if b.decor.random() < b.rich(0.7):
            kind, w, h = (("poster", 0.6, 0.85), ("notices", 1.0, 0.8))[int(b.decor.integers(2))]
            wall_prints.append(Print(kind, x + _DOOR + 0.7, 1.15, w, h, b.number()))
        elif b.decor.random() < 0.25:
            wall_prints.append(Print("outlet", x + _DOOR + 1.1, 0.3, 0.16, 0.08))
    return prints, wall_prints


def _hang(b: PlaceBuilder, wall: int, moving: int, height: float, door: int) -> None:
    """Hang the doors of a wall that move."""
    origin, across, up = b.faces[wall].rectangle
    length = float(np.sqrt((across * across).sum()))
    ahead = across / length
    inwards = np.cross(ahead, up) / float(np.sqrt((up * up).sum()))
    for k in range(1, int((length - 1.0) / _PITCH), 2):
        if k // 2 < moving:
            x, y, z = (origin + (1.2 + k * _PITCH + 0.03) * ahead + 0.03 * inwards).tolist()
            heading = math.atan2(float(ahead[1]), float(ahead[0]))
            width = _DOOR - 0.06
            b.hinges.append(
                Hinge((x, y, z), heading, -1.2, width, height - 0.03, door, usually_open=False)
            )


def _lamps(b: PlaceBuilder, along: int) -> None:
    """Hang lamps across the middle."""
    low, high = b.site.low, b.site.high
    count = max(1, round(float(high[along] - low[along]) / 2.4))
    strength = {"day": 4.0, "lamps": 4.0, "dim": 3.0}[b.site.light]
    for k in range(count):
        center = 0.5 * (low + high)
        center[along] = low[along] + (k + 0.5) / count * (high - low)[along]
        center[2] = high[2] - 0.005
        size = (1.2, 0.3) if along == 0 else (0.3, 1.2)
        lit = b.site.light != "dim" or k % 4 == 1
        b.lamp(center.tolist(), size, LAMP, strength if lit else 0.0)


def _things(b: PlaceBuilder, along: int, stream: np.random.Generator) -> None:
    """Add extinguishers, bins and a few plants along the walls."""
    low, high = b.site.low, b.site.high
    for k in range(int((high - low)[along] / (2 * _PITCH))):
        side = int(stream.integers(2))
        place = low.copy()
        place[along] = low[along] + 1.2 + (2 * k + 1) * _PITCH - 0.5
        across = 1 - along
        edge = 0.12 if side == 0 else float((high - low)[across]) - 0.12
        place[across] = low[across] + edge
        x, y, z = place.tolist()
        if not b.free((x - 0.15, y - 0.15, z), (x + 0.15, y + 0.15, z + 1.0)):
            continue
        choice = stream.random()
        if choice < 0.45:
            b.prism((x, y, z + 0.35), (x, y, z + 0.85), 0.08, "paint:b01c1c")
            b.box(
                (x - 0.035, y - 0.035, z + 0.85), (x + 0.035, y + 0.035, z + 0.95), "paint:202020"
            )
        elif choice < 0.75:
            b.box((x - 0.12, y - 0.12, z), (x + 0.12, y + 0.12, z + 0.4), "paint:50565c")
        elif choice < 0.9:
            plant(b, (x, y, z), stream)
