# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Furniture and fittings of houses, at real size."""

import math
from collections.abc import Callable, Mapping, Sequence
from typing import Final

import numpy as np

from imu_sim_ros.places.light import Lamp, Lighting
from imu_sim_ros.places.place import Hinge, PlaceBuilder, rotation_about_z
from imu_sim_ros.places.sheet import Print

Stream = np.random.Generator
Place3 = Sequence[float]

DAYLIGHT: Final = (0.93, 0.97, 1.0)
"""Colour of the light of the sky: red, green, blue."""
LAMP: Final = (1.0, 0.96, 0.88)
"""Colour of the light of lamps: red, green, blue."""
SUN: Final = (1.0, 0.93, 0.8)
"""Colour of the light of the sun: red, green, blue."""
_LAMP_PITCH: Final = 2.4
"""Distance of ceiling lamps, about [m]."""
_LAMP_SIZE: Final = (1.2, 0.6)
"""Size of a ceiling lamp along x and y [m]."""


def _place_point(
    origin: Place3, turn: float, x: float, y: float, z: float
) -> tuple[float, float, float]:
    """Return a point of a piece of furniture in the place.

    :param origin: foot of the piece [m].
    :param turn: its heading in steps of 90 degrees.
    :param x, y, z: point in the axes of the piece [m].
    """
    offset = rotation_about_z(turn) @ np.array([x, y, z])
    return origin[0] + float(offset[0]), origin[1] + float(offset[1]), origin[2] + float(offset[2])


def _part(
    b: PlaceBuilder,
    origin: Place3,
    turn: float,
    middle: Place3,
    size: Place3,
    material: str,
    prints: Mapping[str, Sequence[Print]] | None = None,
    leave: str = "bottom",
) -> None:
    """Add a box of a piece of furniture.

    :param origin: foot of the piece [m].
    :param middle: middle of the box in the axes of the piece [m].
    :param size: edges of the box [m].
    :param leave: sides without a face, ``top,bottom``; empty: none.
    """
    center = np.array(_place_point(origin, turn, *middle))
    half = 0.5 * np.asarray(size, np.float64)
    b.box((center - half).tolist(), (center + half).tolist(), material, prints, turn, leave)


def _clear(b: PlaceBuilder, origin: Place3, radius: float, height: float) -> bool:
    """Return True if no path runs through a box on a foot, of half a width and a height [m]."""
    x, y, z = origin
    return b.free((x - radius, y - radius, z), (x + radius, y + radius, z + height))


def desk(b: PlaceBuilder, origin: Place3, turn: float, stream: Stream) -> None:
    """Add a desk with a screen and a chair; its user looks along -y of its axes.

    :param origin: its place on the floor; ``turn`` about z [rad].
    :param stream: random stream of the place's geometry; its decoration has another one.
    """
    if not _clear(b, origin, 1.1, 1.2):
        return
    top = ("board:d2b48c", "paint:dcdcd8", "board:b08a5c")[int(stream.integers(3))]
    clutter = b.decor.random() < b.rich(0.8)
    papers = []
    if clutter:
        for _ in range(int(b.decor.integers(1, 4))):
            papers.append(
                Print(
                    "paper",
                    b.decor.uniform(0.05, 1.2),
                    b.decor.uniform(0.05, 0.4),
                    0.21,
                    0.297,
                    b.number(),
                )
            )
        for corner in ((1.28, 0.5), (0.08, 0.52)):
            if b.decor.random() < 0.7:
                papers.append(Print("book", *corner, 0.17, 0.24, b.number()))
    papers.append(Print("keyboard", 0.58, 0.42, 0.44, 0.14, 0))
    if b.site.texture != "blank":
        papers.append(Print("strip", 0.1, 0.05, 1.3, 0.012))
    _part(b, origin, turn, (0, 0, 0.725), (1.6, 0.8, 0.03), top, prints={"top": papers}, leave="")
    for x in (-0.77, 0.77):
        _part(b, origin, turn, (x, 0, 0.355), (0.03, 0.7, 0.71), "paint:8c9094", leave="top,bottom")
    drawers = [Print("drawers", 0, 0, 0.42, 0.58, 0)]
    _part(
        b,
        origin,
        turn,
        (0.5, 0.05, 0.3),
        (0.42, 0.55, 0.58),
        "paint:ced0d2",
        prints={"+y": drawers},
        leave="bottom",
    )
    screen = [Print("screen", 0, 0, 0.56, 0.34, b.number(), glows=bool(b.decor.random() < 0.7))]
    x = stream.uniform(-0.2, 0.1)
    _part(
        b,
        origin,
        turn,
        (x, -0.22, 1.06),
        (0.56, 0.03, 0.34),
        "paint:28282c",
        prints={"+y": screen},
        leave="",
    )
    _part(b, origin, turn, (x, -0.25, 0.82), (0.06, 0.04, 0.16), "paint:28282c", leave="top,bottom")
    chair(
        b,
        _place_point(origin, turn, stream.uniform(-0.25, 0.2), 0.62, 0),
        turn + stream.uniform(-0.6, 0.6),
        stream,
    )


def chair(b: PlaceBuilder, origin: Place3, turn: float, stream: Stream) -> None:
    """Add a swivel chair whose back is at +y of its axes."""
    if not _clear(b, origin, 0.35, 1.0):
        return
    cover = ("carpet:2c3440", "carpet:4a2c30", "carpet:30403a", "carpet:303030")[
        int(stream.integers(4))
    ]
    _part(b, origin, turn, (0, 0, 0.46), (0.46, 0.46, 0.08), cover, leave="")
    _part(b, origin, turn, (0, 0.22, 0.78), (0.42, 0.05, 0.46), cover, leave="")
    _part(b, origin, turn, (0, 0, 0.24), (0.06, 0.06, 0.36), "paint:1e1e20", leave="top,bottom")
    _part(b, origin, turn, (0, 0, 0.05), (0.5, 0.5, 0.04), "paint:1e1e20")


def table(
    b: PlaceBuilder, origin: Place3, size: tuple[float, float], stream: Stream, chairs: bool
) -> None:
    """Add a table, with chairs along both long sides."""
    w, d = size
    if not _clear(b, origin, 0.5 * max(w, d) + 0.4, 1.0):
        return
    _part(b, origin, 0.0, (0, 0, 0.73), (w, d, 0.04), "board:9c7248", leave="")
    for x in (-0.5 * w + 0.1, 0.5 * w - 0.1):
        _part(
            b, origin, 0.0, (x, 0, 0.355), (0.08, 0.6 * d, 0.71), "paint:4a4a4c", leave="top,bottom"
        )
    for x in np.arange(-0.5 * w + 0.5, 0.5 * w, 1.0) if chairs else ():
        for side in (-1, 1):
            place = (origin[0] + x, origin[1] + side * (0.5 * d + 0.15), origin[2])
            chair(b, place, 0.0 if side > 0 else math.pi, stream)


def bookcase(b: PlaceBuilder, low: Place3, high: Place3, front: str) -> None:
    """Add shelves of books that are seen from one side."""
    width = (high[1] - low[1]) if front.endswith("x") else (high[0] - low[0])
    books = [Print("books", 0, 0, width, high[2] - low[2], b.number())]
    plain = b.site.texture == "blank"
    if plain:
        books = [Print("drawers", 0, 0, width, high[2] - low[2], 0)]
    b.box(low, high, "board:96704a", {front: books})


def door_leaf(
    b: PlaceBuilder, hinge: Place3, width: float, height: float, angle: float, number: int
) -> None:
    """Add an open door, or, while the site has moving doors left, the hinge of one of these.

    :param hinge: foot of the hinge; the closed door lies along x [m].
    :param angle: angle by which the door is open [rad].
    :param number: number of its looks.
    """
    x, y, z = hinge
    if len(b.hinges) < b.site.doors:
        foot = (x + 0.03, y + 0.03, z)
        b.hinges.append(Hinge(foot, 0.0, angle, width, height, number, usually_open=True))
        return
    direction = rotation_about_z(angle) @ np.array([1.0, 0.0, 0.0])
    middle = np.array([x, y, z]) + 0.5 * width * direction + np.array([0, 0, 0.5 * height + 0.01])
    half = np.array([0.5 * width, 0.02, 0.5 * height])
    if b.free(middle - half.max(), middle + half.max()):
        leaf = [Print("door", 0, 0, width, height, number)]
        b.box(
            (middle - half).tolist(),
            (middle + half).tolist(),
            "board:a87c50",
            {"-y": leaf, "+y": leaf},
            turn=angle,
            leave="bottom",
        )


def fittings(b: PlaceBuilder, ceiling: int, pitch: float = 2.4) -> None:
    """Add outlets for air, smoke detectors and sprinklers to a ceiling, between its lamps."""
    if b.site.texture == "blank":
        return
    _, across, up = b.faces[ceiling].rectangle
    width, depth = (float(np.sqrt(side @ side)) for side in (across, up))
    for i, j in np.ndindex(max(1, int(width / pitch)), max(1, int(depth / pitch))):
        kind, size = (("vent", 0.58), ("detector", 0.16), ("detector", 0.12))[(i + 2 * j) % 3]
        x, bottom = pitch * (i + 0.08), pitch * (j + 0.08)
        b.hang(ceiling, Print(kind, x, bottom, size, size))


HALL_SIGNS: Final = (
    ("switch", 0.09, 0.17, 1.05),
    ("warning", 0.3, 0.3, 1.55),
    ("plan", 0.5, 0.4, 1.4),
    ("label", 0.32, 0.22, 1.5),
    ("bolts", 0.7, 0.9, 0.9),
    ("panel", 0.6, 0.8, 1.0),
    ("notices", 1.0, 0.8, 1.15),
)
"""Signs and fittings on walls of halls: kind, width, height and height of its lower edge [m]."""
OFFICE_SIGNS: Final = (
    ("switch", 0.09, 0.17, 1.05),
    ("outlet", 0.16, 0.08, 0.3),
    ("plan", 0.5, 0.4, 1.4),
    ("paper", 0.21, 0.297, 1.3),
    ("paper", 0.297, 0.42, 1.25),
    ("poster", 0.5, 0.7, 1.2),
    ("notices", 0.8, 0.6, 1.2),
)
"""Signs and fittings on walls of offices: kind and sizes as above [m]."""


def signs(
    b: PlaceBuilder,
    wall: int,
    pitch: float,
    kinds: Sequence[tuple[str, float, float, float]] = HALL_SIGNS,
    cables: float = 0.0,
) -> None:
    """Add switches, plates, signs and conduits to a wall.

    :param pitch: mean distance between two of them [m].
    :param kinds: kinds to choose from: print, width, height, and height of the lower edge [m].
    :param cables: height of the conduits [m]; 0: none.
    """
    if b.site.texture == "blank":
        return
    _, across, up = b.faces[wall].rectangle
    width, height = (float(np.sqrt(side @ side)) for side in (across, up))
    if 0.0 < cables < height - 0.3:
        b.add_prints(wall, [Print("cables", 0.0, cables, width, 0.16, b.number())])
    x = 0.3
    while x < width - 0.3:
        kind, w, h, bottom = kinds[int(b.decor.integers(len(kinds)))]
        b.hang(wall, Print(kind, x, bottom, w, h, b.number()))
        x += w + pitch * float(b.decor.uniform(0.4, 1.2))


def plant(b: PlaceBuilder, origin: Place3, stream: Stream) -> None:
    """Add a plant in a pot."""
    x, y, z = origin
    b.box((x - 0.17, y - 0.17, z), (x + 0.17, y + 0.17, z + 0.35), "paint:8a5a44")
    for k in range(3):
        size = 0.22 + 0.06 * k
        top = z + 0.35 + 0.28 * k
        b.box(
            (x - size, y - size, top),
            (x + size, y + size, top + 0.34),
            "leaves",
            turn=float(stream.uniform(0, 1.5)),
            leave="",
        )


def wall_decoration(b: PlaceBuilder, wall: int) -> None:
    """Add posters, a clock, outlets and a skirting to a wall, where it is free.

    What stands in front of the wall must have been added before.
    """
    _, across, up = b.faces[wall].rectangle
    width, height = (float(np.sqrt((side * side).sum())) for side in (across, up))
    b.add_prints(wall, [Print("strip", 0, 0, width, 0.07)])
    x = 0.4 + float(b.decor.uniform(0, 0.8))
    while x < width - 1.4:
        choice = b.decor.random()
        if choice < b.rich(0.5) and height > 2.2:
            kind, w, h = (
                ("poster", 0.6, 0.85),
                ("notices", 1.2, 0.9),
                ("poster", 1.0, 0.7),
                ("whiteboard", 1.8, 1.1),
            )[int(b.decor.integers(4))]
            if x + w < width - 0.2:
                bottom = 1.0 + float(b.decor.uniform(0, 0.3))
                b.hang(wall, Print(kind, x, bottom, w, h, b.number()))
            x += w
        elif choice > 0.85:
            b.hang(wall, Print("outlet", x, 0.3, 0.16, 0.08))
        x += 0.5 + float(b.decor.uniform(0, 1.4))
    if b.decor.random() < b.rich(0.4):
        for share in (0.5, 0.4, 0.6, 0.3, 0.7, 0.2, 0.8):
            if b.hang(wall, Print("clock", share * width, min(2.1, height - 0.5), 0.3, 0.3)):
                break


def windows(
    b: PlaceBuilder, wall: int, sill: float, height: float
) -> Callable[[PlaceBuilder], Lighting]:
    """Add windows to a wall; return the function that makes the lighting of the finished place.

    By day sky and sun shine through them; otherwise it is night outside.

    :param sill: height of their lower edge [m].
    """
    origin, across, up = b.faces[wall].rectangle
    width, top = (float(np.sqrt((side * side).sum())) for side in (across, up))
    height = min(height, top - sill - 0.2)
    day = b.site.light == "day"
    count = max(1, int(width / 2.6))
    pitch = width / count
    prints = [Print("strip", 0, 0, width, 0.07)]
    panes = []
    inwards = np.cross(across, up) / np.linalg.norm(np.cross(across, up))
    for k in range(count):
        start = (k + 0.5) * pitch - 0.9
        prints.append(
            Print("window" if day else "night", start, sill, 1.8, height, b.number(), glows=day)
        )
        corner = origin + start / width * across + sill / top * up + 0.01 * inwards
        panes.append((corner, 1.8 / width * across, height / top * up))
    b.add_prints(wall, prints)
    if day:
        red, green, blue = (2.4 * c for c in DAYLIGHT)
        b.lamps += [Lamp(pane, (red, green, blue)) for pane in panes]

    def lit(done: PlaceBuilder) -> Lighting:
        """Return the lamps, and by day the direction and colour of the sun, and the panes."""
        if not day:
            return Lighting(tuple(done.lamps))
        sideways = rotation_about_z(0.5) @ -inwards
        to_sun = np.array([sideways[0], sideways[1], 0.75])
        to_sun /= np.linalg.norm(to_sun)
        x, y, z = (round(float(value), 9) for value in to_sun)
        red, green, blue = (2.2 * c for c in SUN)
        return Lighting(tuple(done.lamps), (x, y, z), (red, green, blue), tuple(panes))

    return lit


def add_ceiling_lamps(b: PlaceBuilder) -> None:
    """Hang a grid of flat lamps under the ceiling; in dim light one in five shines."""
    x0, y0, _ = b.site.low.tolist()
    x1, y1, z1 = b.site.high.tolist()
    columns, rows = (max(1, round(length / _LAMP_PITCH)) for length in (x1 - x0, y1 - y0))
    strength = {"day": 2.6, "lamps": 5.0, "dim": 3.0}[b.site.light]
    for i in range(rows):
        for j in range(columns):
            lit = b.site.light != "dim" or (i * columns + j) % 5 == 1
            center = (
                x0 + (j + 0.5) * (x1 - x0) / columns,
                y0 + (i + 0.5) * (y1 - y0) / rows,
                z1 - 0.005,
            )
            b.lamp(center, _LAMP_SIZE, LAMP, strength if lit else 0.0)
