# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""A machine hall: boilers, pipes, cabinets and a gallery between dark concrete walls."""

import math
from typing import Final

import numpy as np

from imu_sim_ros.places.furniture import LAMP, signs, wall_decoration, windows
from imu_sim_ros.places.place import Place, PlaceBuilder, Site
from imu_sim_ros.places.sheet import Print

_WIDE: Final = 16.0
"""Width of a hall above which tanks stand between its walls and its middle [m]."""
_ROW: Final = 4.6
"""Distance of their rows from the walls [m]."""
_GOODS: Final = (
    ("board:b08a5c", 1.2, 0.8, 0.14),
    ("cardboard:b08c60", 0.8, 0.6, 0.6),
    ("board:9c7448", 0.9, 0.9, 0.9),
    ("paint:28506c", 1.1, 0.7, 0.5),
)
"""Materials and sizes [m] of the goods on the floor."""
_PIPES: Final = ("metal:a4a8a8", "paint:c8a030", "paint:3c6c4c", "paint:8c3428", "metal:6c7074")


def machine_hall(site: Site) -> Place:
    """Return a hall with machines along its walls and in its middle; windows high in -y."""
    b = PlaceBuilder(site)
    stream = site.stream("machine_hall")
    x0, y0, z0 = site.low.tolist()
    x1, y1, z1 = site.high.tolist()
    materials = {
        "floor": "concrete:787672",
        "ceiling": "concrete:6c6a68",
        "walls": "concrete:8c8882",
    }
    sides = b.room((x0, y0, z0), (x1, y1, z1), {**materials, "+y": "brick:8a5040"})
    lit = windows(b, sides["-y"], 0.55 * (z1 - z0), 0.3 * (z1 - z0))
    for side in ("-x", "+x"):
        b.add_prints(sides[side], [Print("gate", 0.5 * (y1 - y0) - 1.6, 0, 3.2, 3.2, 0)])
    for x in np.arange(x0 + 2.5, x1 - 1.5, 5.0):
        for y in (y0 + 0.2, y1 - 0.2):
            _add_standing_box(b, (x - 0.2, y - 0.2, z0), (x + 0.2, y + 0.2, z1), "concrete:98948e")
    _boilers(b, stream)
    _machines(b, stream)
    _pipes(b, stream)
    _gallery(b)
    if y1 - y0 > _WIDE:
        _tanks(b, stream)
        _clutter(b, stream)
        lanes = [
            Print("line", 1.0, y - y0, x1 - x0 - 2.0, 0.1)
            for y in (y0 + _ROW + 1.6, y1 - _ROW - 1.7)
        ]
        b.add_prints(sides["floor"], lanes)
    wall_decoration(b, sides["+y"])
    for side in ("-x", "+x", "-y", "+y"):
        signs(b, sides[side], 0.8, cables=0.4 * (z1 - z0))
    _lamps(b)
    height = z0 + min(1.8, 0.4 * (z1 - z0))
    u, v = x1 - x0, y1 - y0
    stops = [
        (0.08, 0.25),
        (0.3, 0.27),
        (0.5, 0.27),
        (0.92, 0.25),
        (0.92, 0.68),
        (0.5, 0.68),
        (0.08, 0.68),
    ]
    route = np.array([(x0 + a * u, y0 + c * v, height) for a, c in stops])
    return Place(faces=tuple(b.faces), lighting=lit(b), low=site.low, high=site.high, route=route)


def _add_standing_box(
    b: PlaceBuilder,
    low: tuple[float, ...],
    high: tuple[float, ...],
    material: str,
    **prints: list[Print],
) -> bool:
    """Add a box unless it stands in the path; return whether it was added.

    :param prints: prints on its front, back, left and right.
    """
    if not b.free(low, high):
        return False
    sides = {"front": "-y", "back": "+y", "left": "-x", "right": "+x"}
    b.box(low, high, material, {sides[k]: v for k, v in prints.items()})
    return True


def _boilers(b: PlaceBuilder, stream: np.random.Generator) -> None:
    """Add round tanks on feet along +y, each with its pipe to the ceiling."""
    x0, _, z0 = b.site.low.tolist()
    x1, y1, z1 = b.site.high.tolist()
    count = max(1, int((x1 - x0 - 2.0) / 5.0))
    for k in range(count):
        x = x0 + 2.5 + (k + 0.5) * (x1 - x0 - 5.0) / count
        radius, height = stream.uniform(0.7, 1.1), stream.uniform(2.0, 3.2)
        colour = ("metal:9ca4a8", "paint:5c7c84", "paint:8c8c7c")[int(stream.integers(3))]
        y = y1 - 1.6
        low, high = (x - radius, y - radius, z0), (x + radius, y + radius, z0 + height + 0.4)
        if not b.free(low, high):
            continue
        b.prism((x, y, z0 + 0.4), (x, y, z0 + 0.4 + height), radius, colour, sides=12)
        edge = 0.93 * radius / 1.4142
        b.box(
            (x - edge, y - edge, z0 + 0.4 + height - 0.01),
            (x + edge, y + edge, z0 + height + 0.55),
            colour,
        )
        b.box((x - edge, y - edge, z0), (x + edge, y + edge, z0 + 0.42), "paint:4c4c4c")
        if b.free((x - 0.15, y - 0.15, z0 + height), (x + 0.15, y + 0.15, z1)):
            b.prism((x, y, z0 + height + 0.5), (x, y, z1), 0.13, _PIPES[int(stream.integers(5))], 6)
        front = [Print("panel", 0, 0, 0.6, 0.8, b.number())]
        front.append(Print("label", 0.1, 0.25, 0.4, 0.25, b.number()))
        low, high = (x - 0.3, y - radius - 0.12, z0 + 1.1), (x + 0.3, y - radius + 0.06, z0 + 1.9)
        b.box(low, high, "paint:c4c8c4", {"-y": front}, leave="+y")


def _tanks(b: PlaceBuilder, stream: np.random.Generator) -> None:
    """Add a row of steel tanks on each side of the middle, with a duct, and ladders on some.

    The tanks of a row are the same, as in a real hall: they are hard to tell apart.
    """
    x0, y0, z0 = b.site.low.tolist()
    x1, y1, z1 = b.site.high.tolist()
    for y, front in ((y0 + _ROW, "+y"), (y1 - _ROW, "-y")):
        radius, height = stream.uniform(0.5, 0.75), stream.uniform(0.55, 0.8) * (z1 - z0)
        for k, x in enumerate(np.arange(x0 + 3.2, x1 - 2.0, 2.8)):
            if not b.free((x - 1.1, y - 1.1, z0), (x + 1.1, y + 1.1, z1)):
                continue
            _tank(b, (x, y, z0), radius, height, front)
            if k % 3 == 0:
                _ladder(b, (x + 0.3, y + _away(front, radius), z0), height, front)
        z, size = z0 + height + 0.7, 0.35
        if b.free((x0, y - size, z - size), (x1, y + size, z + size)) and z + size < z1:
            b.prism((x0, y, z), (x1, y, z), size, "metal:b0b4b6", 10)


def _away(front: str, distance: float) -> float:
    """Return a distance with the sign of the axis to which a front looks, +y or -y."""
    return distance if front == "+y" else -distance


def _tank(
    b: PlaceBuilder, foot: tuple[float, float, float], radius: float, height: float, front: str
) -> None:
    """Add a tank on its base, with a ring halfway up, a lid, a pipe to its duct and a panel."""
    x, y, z = foot
    base, lid = 0.7 * radius, 0.66 * radius
    b.box((x - base, y - base, z), (x + base, y + base, z + 0.3), "paint:4c4c4c")
    b.prism((x, y, z + 0.3), (x, y, z + height), radius, "metal:a8acae", 10)
    ring = z + 0.5 * height
    b.prism((x, y, ring), (x, y, ring + 0.08), radius + 0.03, "metal:707476", 10)
    top = z + height
    b.box((x - lid, y - lid, top - 0.01), (x + lid, y + lid, top + 0.1), "metal:8c9092")
    b.prism((x, y, top), (x, y, top + 0.4), 0.12, "metal:b0b4b6", 5)
    panel = {front: [Print("panel", 0.0, 0.0, 0.5, 0.6, b.number())]}
    middle = y + _away(front, radius)
    low, high = (x - 0.25, middle - 0.06, z + 1.2), (x + 0.25, middle + 0.06, z + 1.8)
    b.box(low, high, "paint:c4c8c4", panel, leave="+y" if front == "-y" else "-y")


def _ladder(b: PlaceBuilder, foot: tuple[float, float, float], height: float, front: str) -> None:
    """Add a ladder of which the front is seen."""
    x, y, z = foot
    hidden_sides = ",".join({"-x", "+x", "-y", "+y", "top", "bottom"} - {front})
    for k in np.arange(0.4, height, 0.4):
        low, high = (x + 0.04, y - 0.02, z + k), (x + 0.36, y + 0.02, z + k + 0.03)
        b.box(low, high, "paint:d8b020", leave=hidden_sides)
    for rail in (x, x + 0.36):
        low, high = (rail, y - 0.03, z + 0.1), (rail + 0.04, y + 0.03, z + height + 0.5)
        b.box(low, high, "paint:d8b020", leave="top,bottom")


def _clutter(b: PlaceBuilder, stream: np.random.Generator) -> None:
    """Add pallets, crates and cartons between tanks and machines, about one in 9 m^2."""
    x0, y0, z0 = b.site.low.tolist()
    x1, y1, _ = b.site.high.tolist()
    width = 0.5 * (y1 - y0) - _ROW - 4.4
    for side in (y0 + _ROW + 2.2, y1 - _ROW - 2.2 - width):
        for _ in range(int((x1 - x0) * max(0.0, width) / 9.0)):
            x, y = stream.uniform(x0 + 2.0, x1 - 2.0), side + stream.uniform(0.0, width)
            material, w, d, h = _GOODS[int(stream.integers(len(_GOODS)))]
            turn, reach = float(stream.uniform(0.0, 3.0)), 0.5 * math.hypot(w, d)
            if not b.free((x - reach, y - reach, z0), (x + reach, y + reach, z0 + h)):
                continue
            label = [Print("label", 0.1, 0.02, 0.3, min(0.3, h - 0.02), b.number())]
            low, high = (x - 0.5 * w, y - 0.5 * d, z0), (x + 0.5 * w, y + 0.5 * d, z0 + h)
            b.box(low, high, material, {"-y": label, "+x": label}, turn)


def _machines(b: PlaceBuilder, stream: np.random.Generator) -> None:
    """Add machines in the middle and cabinets along -y."""
    x0, y0, z0 = b.site.low.tolist()
    x1, y1, _ = b.site.high.tolist()
    middle = 0.5 * (y0 + y1) - 0.3
    for x in np.arange(x0 + 3.0, x1 - 3.0, 4.2):
        w, d, h = stream.uniform(1.4, 2.4), stream.uniform(1.0, 1.5), stream.uniform(0.9, 1.5)
        colour = ("paint:3c6450", "paint:46607c", "paint:a8a498")[int(stream.integers(3))]
        sign = [
            Print("warning", 0.1, h - 0.45, 0.3, 0.3, 0),
            Print("panel", 0.6, 0.3, 0.6, h - 0.45, b.number()),
        ]
        if not b.free((x, middle - 0.5 * d, z0), (x + w, middle + 0.5 * d, z0 + h + 0.6)):
            continue
        low, high = (x, middle - 0.5 * d, z0), (x + w, middle + 0.5 * d, z0 + h)
        back = [Print("grille", 0.2, 0.15, w - 0.4, 0.6 * h)]
        plate = [Print("bolts", 0.08, 0.08, d - 0.16, h - 0.16, b.number())]
        plates = plate if b.site.texture != "blank" else []
        if not _add_standing_box(
            b, low, high, colour, front=sign, back=back, left=plates, right=plates
        ):
            continue
        b.prism(
            (x + 0.3 * w, middle, z0 + h),
            (x + 0.3 * w, middle, z0 + h + 0.5),
            0.3,
            "metal:84888a",
            8,
        )
        b.prism((x + 0.55 * w, middle, z0 + h + 0.22), (x + 0.95 * w, middle, z0 + h + 0.22), 0.2,
                "paint:2c5c8c", 8)  # fmt: skip
    for x in np.arange(x0 + 1.0, x1 - 2.0, 2.6):
        h = stream.uniform(1.7, 2.1)
        front = [
            Print("panel", 0.05, 0.9, 0.7, 0.8, b.number()),
            Print("warning", 0.3, 0.4, 0.25, 0.25, 0),
        ]
        if stream.random() < 0.7:
            _add_standing_box(
                b, (x, y0 + 0.02, z0), (x + 0.8, y0 + 0.55, z0 + h), "paint:a4aca8", back=front
            )


def _pipes(b: PlaceBuilder, stream: np.random.Generator) -> None:
    """Run pipes along both long walls and across under the ceiling."""
    x0, y0, z0 = b.site.low.tolist()
    x1, y1, z1 = b.site.high.tolist()
    for k in range(4):
        y = y1 - 0.3 - 0.08 * k if k % 2 else y0 + 0.45
        z = z0 + (0.48 + 0.12 * k) * (z1 - z0)
        radius = stream.uniform(0.07, 0.16)
        if b.free((x0, y - radius, z - radius), (x1, y + radius, z + radius)):
            b.prism((x0, y, z), (x1, y, z), radius, _PIPES[k], 6)
    for x in np.arange(x0 + 4.0, x1 - 1.0, 6.0):
        z, radius = z1 - 0.9, stream.uniform(0.08, 0.2)
        if b.free((x - radius, y0, z - radius), (x + radius, y1, z + radius)):
            b.prism((x, y0, z), (x, y1, z), radius, _PIPES[int(stream.integers(5))], 6)


def _gallery(b: PlaceBuilder) -> None:
    """Hang a walkway with rails along -x, on posts."""
    x0, y0, z0 = b.site.low.tolist()
    y1, z1 = float(b.site.high[1]), float(b.site.high[2])
    z = z0 + 0.5 * (z1 - z0)
    if not b.free((x0, y0, z), (x0 + 1.3, y1, z + 1.2)):
        return
    b.box((x0, y0 + 0.1, z), (x0 + 1.2, y1 - 0.1, z + 0.08), "metal:70767a", leave="-x,-y,+y")
    for rail in (0.5, 1.0):
        low, high = (x0 + 1.15, y0 + 0.1, z + rail), (x0 + 1.2, y1 - 0.1, z + rail + 0.05)
        b.box(low, high, "paint:d8b020", leave="-y,+y")
    for y in np.arange(y0 + 0.3, y1, 2.4):
        low, high = (x0 + 1.14, y, z0), (x0 + 1.22, y + 0.08, z + 1.0)
        if b.free(low, high):
            b.box(low, high, "paint:d8b020", leave="top,bottom")


def _lamps(b: PlaceBuilder) -> None:
    """Add rows of lamps under the roof."""
    x0, y0, _ = b.site.low.tolist()
    x1, y1, z1 = b.site.high.tolist()
    strength = {"day": 6.0, "lamps": 20.0, "dim": 14.0}[b.site.light]
    columns, rows = max(1, round((x1 - x0) / 5.0)), max(1, round((y1 - y0) / 5.0))
    for i in range(rows):
        for j in range(columns):
            lit = (i + j) % (5 if b.site.light == "dim" else 2) == 0
            x, y = x0 + (j + 0.5) * (x1 - x0) / columns, y0 + (i + 0.5) * (y1 - y0) / rows
            b.lamp((x, y, z1 - 0.5), (0.8, 0.5), LAMP, strength if lit else 0.0)
