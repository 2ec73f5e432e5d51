# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Prints and flat fittings on surfaces: posters, books, screens, doors, windows, signs."""

from collections.abc import Callable
from typing import Final

import numpy as np

from imu_sim_ros.core.types import Bytes
from imu_sim_ros.places import outdoor_prints
from imu_sim_ros.places.sheet import INK, Print, Sheet


def _draw_poster(s: Sheet) -> None:
    """Draw a poster: a landscape, a pattern or a text."""
    paper, main = s.colour(170, 250), s.colour()
    s.all(paper)
    w, h = s.width, s.height
    if s.stream.random() < 0.5:  # a landscape
        horizon = h * s.stream.uniform(0.35, 0.6)
        s.fill(0, horizon, w, h, s.colour(150, 240))
        s.disc(w * s.stream.uniform(0.2, 0.8), h * 0.8, 0.12 * w, s.colour(200, 256))
        x = 0.0
        while x < w:
            step = w * s.stream.uniform(0.05, 0.2)
            s.fill(x, 0, x + step, horizon * s.stream.uniform(0.6, 1.3), s.colour(20, 140))
            x += step
    else:
        s.fill(0.08 * w, 0.42 * h, 0.92 * w, 0.9 * h, main)
        for _ in range(5):
            x, y = s.stream.uniform(0.1, 0.8) * w, s.stream.uniform(0.45, 0.8) * h
            s.fill(x, y, x + 0.12 * w, y + 0.08 * h, s.colour())
            s.disc(x, y, s.stream.uniform(0.03, 0.1) * w, s.colour())
        s.text(0.1 * w, 0.3 * h, 0.9 * w, 0.07 * h, INK)
        for k in range(5):
            s.text(0.1 * w, (0.24 - 0.045 * k) * h, 0.9 * w, 0.022 * h, INK)
    s.frame(0.012, s.colour(10, 60))


def _draw_notices(s: Sheet) -> None:
    """Draw a pin board."""
    s.all((176, 132, 84))
    for _ in range(int(14 * s.width * s.height) + 3):
        w, h = (0.21, 0.297) if s.stream.random() < 0.7 else (0.15, 0.1)
        x = s.stream.uniform(0.02, max(0.03, s.width - w - 0.02))
        y = s.stream.uniform(0.02, max(0.03, s.height - h - 0.02))
        s.fill(x, y, x + w, y + h, s.colour(205, 256))
        s.text(x + 0.02, y + h - 0.045, x + w - 0.02, 0.022, INK)
        for k in range(int((h - 0.07) / 0.018)):
            s.text(x + 0.02, y + h - 0.065 - 0.018 * k, x + w - 0.03, 0.009, (70, 70, 76))
        s.disc(x + w / 2, y + h - 0.01, 0.008, s.colour())
    s.frame(0.02, (120, 86, 52))


def _draw_whiteboard(s: Sheet) -> None:
    """Draw a whiteboard with writing."""
    s.all((244, 245, 246))
    for _ in range(int(3 * s.width * s.height) + 2):
        colour = ((30, 60, 160), (20, 20, 24), (170, 40, 40))[int(s.stream.integers(3))]
        x, y = s.stream.uniform(0.1, 0.7) * s.width, s.stream.uniform(0.25, 0.9) * s.height
        if s.stream.random() < 0.4:
            for dx, dy, w, h in (
                (0, 0, 0.3, 0.006),
                (0, 0.18, 0.3, 0.006),
                (0, 0, 0.006, 0.18),
                (0.3, 0, 0.006, 0.186),
            ):
                s.fill(x + dx, y + dy, x + dx + w, y + dy + h, colour)
            s.text(x + 0.03, y + 0.06, x + 0.27, 0.05, colour)
        else:
            s.text(x, y, min(x + 0.7, s.width - 0.1), 0.05, colour)
    s.frame(0.025, (150, 154, 158))


def _draw_books(s: Sheet) -> None:
    """Draw shelves with books and folders, a board each 0.35 m."""
    s.all((52, 42, 34))
    boards = max(1, round(s.height / 0.36))
    pitch = s.height / boards
    for k in range(boards):
        x, low = 0.03, k * pitch + 0.022
        while x < s.width - 0.07:
            if s.stream.random() < 0.12:
                x += s.stream.uniform(0.05, 0.25)  # nothing stands there
                continue
            w, h = s.stream.uniform(0.02, 0.06), pitch * s.stream.uniform(0.6, 0.86)
            colour = s.colour(30, 235)
            s.fill(x, low, x + w - 0.003, low + h, colour)
            label = s.colour(190, 256) if sum(colour) < 380 else s.colour(0, 70)
            s.fill(x + 0.2 * w, low + 0.55 * h, x + 0.75 * w, low + 0.85 * h, label)
            x += w
        s.fill(0, k * pitch, s.width, k * pitch + 0.022, (150, 116, 78))
    s.fill(0, s.height - 0.022, s.width, s.height, (150, 116, 78))
    for x in (0.0, s.width - 0.022):
        s.fill(x, 0, x + 0.022, s.height, (140, 106, 70))


def _draw_drawers(s: Sheet) -> None:
    """Draw a cabinet of drawers."""
    s.all((206, 208, 210))
    count = max(1, round(s.height / 0.3))
    columns = max(1, round(s.width / 0.5))
    for k in range(count):
        for j in range(columns):
            x0, x1 = (s.width / columns * i for i in (j, j + 1))
            y0, y1 = (s.height / count * i for i in (k, k + 1))
            s.fill(x0, y0, x1, y0 + 0.006, (88, 90, 94))
            s.fill(x0, y0, x0 + 0.005, y1, (88, 90, 94))
            middle, top = 0.5 * (x0 + x1), y1 - 0.07
            s.fill(middle - 0.06, top, middle + 0.06, top + 0.02, (70, 72, 76))
            s.fill(middle - 0.04, top + 0.025, middle + 0.04, top + 0.05, (246, 246, 240))


def _draw_screen(s: Sheet) -> None:
    """Draw a screen with windows or text."""
    s.all((24, 26, 32))
    w, h = s.width, s.height
    if s.stream.random() < 0.6:
        s.fill(0.03, 0.03, w - 0.03, h - 0.03, s.colour(225, 250))
        s.fill(0.03, h - 0.055, w - 0.03, h - 0.03, s.colour(40, 140))
        for k in range(int((h - 0.12) / 0.018)):
            start = 0.05 + 0.03 * int(s.stream.integers(0, 4))
            end = s.stream.uniform(0.5, 0.95) * w
            s.text(start, h - 0.085 - 0.018 * k, end, 0.009, (50, 60, 90))
    else:
        s.fill(0.02, 0.02, w - 0.02, h - 0.02, (18, 30, 44))
        for k in range(int((h - 0.08) / 0.016)):
            end = s.stream.uniform(0.2, 0.95) * w
            colour = ((120, 200, 140), (220, 180, 110), (140, 170, 230))[int(s.stream.integers(3))]
            s.text(
                0.04 + 0.02 * int(s.stream.integers(0, 5)), h - 0.05 - 0.016 * k, end, 0.009, colour
            )


def _draw_door(s: Sheet) -> None:
    """Draw a door with its handle."""
    colour = ((150, 108, 68), (168, 172, 176), (88, 108, 128), (178, 160, 132))[
        int(s.stream.integers(4))
    ]
    s.all((216, 214, 208))
    edge = 0.06
    s.fill(edge, 0, s.width - edge, s.height - edge, colour)
    dark = colour[0] // 2, colour[1] // 2, colour[2] // 2
    s.fill(edge, 0, edge + 0.006, s.height - edge, dark)
    s.fill(s.width - edge - 0.006, 0, s.width - edge, s.height - edge, dark)
    s.fill(s.width - edge - 0.16, 1.02, s.width - edge - 0.04, 1.05, (60, 60, 62))
    s.fill(s.width - edge - 0.075, 0.95, s.width - edge - 0.035, 1.13, (190, 190, 192))
    if s.stream.random() < 0.5 and s.height > 1.9:
        s.fill(edge + 0.15, 1.35, s.width - edge - 0.15, 1.85, (60, 72, 80))
    s.fill(0.5 * s.width - 0.1, 1.55, 0.5 * s.width + 0.1, 1.63, (240, 240, 236))
    s.text(0.5 * s.width - 0.085, 1.575, 0.5 * s.width + 0.085, 0.035, INK)


def _draw_doorway(s: Sheet) -> None:
    """Draw the frame of a doorway to a dark room."""
    s.all((38, 36, 34))
    s.fill(0, 0, s.width, 0.25 * s.height, (62, 58, 52))
    s.frame(0.06, (216, 214, 208))


_HAZE: Final = np.array([236, 242, 250], np.float32)
_BLUE: Final = np.array([178, 208, 245], np.float32)


def _draw_window(s: Sheet) -> None:
    """Draw a view of sky and roofs through panes in a white frame."""
    rows = len(s.values)
    share = (np.arange(rows) / rows).astype(np.float32)[:, None]
    sky = _HAZE * (1 - share) + _BLUE * share
    s.values[:] = sky[:, None].astype(np.uint8)
    x = -0.2
    while x < s.width:
        step = s.stream.uniform(0.25, 0.8)
        top = s.stream.uniform(0.15, 0.45) * s.height
        tone = int(s.stream.integers(140, 200))
        s.fill(x, 0, x + step, top, (tone, tone - 6, tone - 14))
        for k in range(int(step / 0.1)):
            for j in range(int(top / 0.14)):
                pane_x, low = x + 0.03 + 0.1 * k, top - 0.1 - 0.14 * j
                s.fill(pane_x, low, pane_x + 0.045, low + 0.07, (tone - 50, tone - 45, tone - 40))
        x += step
    _draw_panes(s)


def _draw_night(s: Sheet) -> None:
    """Draw a night sky over lit windows."""
    s.all((16, 20, 30))
    for _ in range(int(8 * s.width * s.height)):
        x, y = s.stream.uniform(0, s.width), s.stream.uniform(0, 0.6 * s.height)
        s.fill(x, y, x + 0.02, y + 0.03, s.colour(120, 240))
    _draw_panes(s)


def _draw_panes(s: Sheet) -> None:
    """Draw the frame of a window, divided into panes."""
    frame = (226, 226, 222)
    s.frame(0.055, frame)
    count = max(1, round(s.width / 0.9))
    for k in range(1, count):
        x = s.width * k / count
        s.fill(x - 0.04, 0, x + 0.04, s.height, frame)
    if s.height > 1.3:
        s.fill(0, 0.72 * s.height - 0.03, s.width, 0.72 * s.height + 0.03, frame)


def _draw_lamp(s: Sheet) -> None:
    """Draw the cover of a lamp."""
    s.all((255, 255, 250))
    s.frame(0.02, (210, 210, 206))


def _draw_strip(s: Sheet) -> None:
    """Draw a dark line, as skirting and edges of floors are."""
    s.all((98, 100, 102))


def _draw_outlet(s: Sheet) -> None:
    """Draw an electrical outlet."""
    s.all((246, 246, 244))
    s.frame(0.006, (190, 190, 188))
    s.disc(0.5 * s.width, 0.5 * s.height, 0.3 * min(s.width, s.height), (205, 205, 203))


def _draw_exit(s: Sheet) -> None:
    """Draw the sign of an exit."""
    s.all((20, 132, 70))
    w, h = s.width, s.height
    s.fill(0.1 * w, 0.2 * h, 0.32 * w, 0.8 * h, (246, 250, 246))
    s.text(0.42 * w, 0.3 * h, 0.95 * w, 0.4 * h, (246, 250, 246))


def _draw_clock(s: Sheet) -> None:
    """Draw the face of a clock."""
    s.all((225, 224, 220))
    r = 0.5 * s.width
    s.disc(r, r, r, (40, 40, 44))
    s.disc(r, r, 0.9 * r, (250, 250, 248))
    s.fill(r - 0.008, r, r + 0.008, 1.7 * r, INK)
    s.fill(r, r - 0.008, 1.5 * r, r + 0.008, INK)


def _draw_label(s: Sheet) -> None:
    """Draw a parcel's address, or the plate of a machine."""
    s.all((246, 246, 242))
    for k in range(3):
        s.text(0.06 * s.width, (0.72 - 0.2 * k) * s.height, 0.9 * s.width, 0.13 * s.height, INK)
    x = 0.1 * s.width
    while x < 0.85 * s.width:
        step = s.width * s.stream.uniform(0.008, 0.03)
        s.fill(x, 0.05 * s.height, x + step, 0.22 * s.height, INK)
        x += 2 * step


def _draw_paper(s: Sheet) -> None:
    """Draw a sheet of paper with lines of text."""
    s.all(s.colour(228, 256))
    for k in range(int((s.height - 0.04) / 0.013)):
        s.text(0.02, s.height - 0.03 - 0.013 * k, s.width - 0.02, 0.007, (80, 80, 86))


def _draw_keyboard(s: Sheet) -> None:
    """Draw a keyboard."""
    s.all((40, 40, 44))
    for i in range(5):
        for j in range(15):
            x, y = 0.01 + 0.028 * j, 0.01 + 0.024 * i
            s.fill(x, y, x + 0.02, y + 0.016, (86, 86, 92))


def _draw_grille(s: Sheet) -> None:
    """Draw a radiator."""
    s.all((238, 238, 234))
    for k in range(int(s.width / 0.05)):
        s.fill(0.05 * k + 0.02, 0, 0.05 * k + 0.032, s.height, (196, 196, 194))


def _draw_band(s: Sheet) -> None:
    """Draw a rail along a wall."""
    s.all((150, 120, 86))
    s.fill(0, 0, s.width, 0.1 * s.height, (96, 76, 54))


def _draw_doors(s: Sheet) -> None:
    """Draw two wings of glass in frames."""
    s.all((92, 100, 108))
    half = 0.5 * s.width
    for x in (0.0, half):
        s.fill(x + 0.1, 0.12, x + half - 0.1, s.height - 0.12, (70, 84, 92))
        s.fill(x + 0.14, 0.9 * s.height, x + half - 0.3, 0.93 * s.height, (120, 136, 146))
    s.fill(half - 0.004, 0, half + 0.004, s.height, (20, 20, 22))
    for x in (half - 0.09, half + 0.06):
        s.fill(x, 0.8, x + 0.03, 1.3, (200, 202, 204))


def _draw_grid(s: Sheet) -> None:
    """Draw squares of 0.1 m, black in the lower left."""
    s.all((240, 240, 240))
    for i in range(round(s.height / 0.1)):
        for j in range(i % 2, round(s.width / 0.1), 2):
            s.fill(0.1 * j, 0.1 * i, 0.1 * (j + 1), 0.1 * (i + 1), (20, 20, 20))


def _draw_switch(s: Sheet) -> None:
    """Draw two switches under each other, or a switch and a socket."""
    s.all((240, 240, 236))
    s.frame(0.004, (170, 170, 168))
    half = 0.5 * s.height
    s.fill(0.012, half + 0.012, s.width - 0.012, s.height - 0.012, (222, 222, 218))
    s.fill(0.012, half + 0.012, s.width - 0.012, half + 0.016, (120, 120, 118))
    s.disc(0.5 * s.width, 0.5 * half, 0.026, (206, 206, 202))
    for x in (0.5 * s.width - 0.01, 0.5 * s.width + 0.01):
        s.disc(x, 0.5 * half, 0.004, (20, 20, 22))


def _draw_vent(s: Sheet) -> None:
    """Draw an outlet for air in a ceiling."""
    s.all((214, 214, 210))
    s.frame(0.02, (240, 240, 238))
    for k in range(int((s.height - 0.08) / 0.04)):
        s.fill(0.04, 0.05 + 0.04 * k, s.width - 0.04, 0.064 + 0.04 * k, (70, 72, 74))


def _draw_detector(s: Sheet) -> None:
    """Draw a smoke detector, or a sprinkler, on a tile of a ceiling."""
    s.all((232, 231, 226))
    middle = 0.5 * s.width
    s.disc(middle, middle, 0.46 * s.width, (246, 246, 244))
    s.disc(middle, middle, 0.26 * s.width, (150, 150, 148))
    s.disc(middle, middle, 0.12 * s.width, (190, 40, 36))


def _draw_plan(s: Sheet) -> None:
    """Draw the plan of a floor in its frame, as at exits."""
    s.all((250, 250, 248))
    for _ in range(9):
        x, y = s.stream.uniform(0.05, 0.7) * s.width, s.stream.uniform(0.2, 0.75) * s.height
        w, h = s.stream.uniform(0.1, 0.25) * s.width, s.stream.uniform(0.08, 0.2) * s.height
        s.fill(x, y, x + w, y + h, (40, 44, 48))
        s.fill(x + 0.006, y + 0.006, x + w - 0.006, y + h - 0.006, s.colour(200, 256))
    s.fill(0.1 * s.width, 0.12 * s.height, 0.9 * s.width, 0.16 * s.height, (30, 140, 70))
    s.text(0.06 * s.width, 0.9 * s.height, 0.9 * s.width, 0.06 * s.height, (180, 30, 30))
    s.frame(0.014, (120, 124, 128))


def _draw_book(s: Sheet) -> None:
    """Draw a book or a folder that lies on a desk."""
    cover = s.colour(40, 220)
    s.all(cover)
    ink = (240, 238, 228) if sum(cover) < 400 else (30, 30, 34)
    s.text(0.1 * s.width, 0.7 * s.height, 0.9 * s.width, 0.12 * s.height, ink)
    s.fill(0.2 * s.width, 0.2 * s.height, 0.8 * s.width, 0.55 * s.height, s.colour(60, 240))
    s.fill(0, 0, 0.05 * s.width, s.height, ink)


def _draw_cables(s: Sheet) -> None:
    """Draw conduits along a wall, with their clips and boxes."""
    s.all((150, 152, 152))
    tones = ((58, 60, 62), (206, 206, 200), (120, 122, 124), (190, 140, 40))
    count = max(2, int(s.height / 0.035))
    for k in range(count):
        low = s.height * k / count
        s.fill(0, low, s.width, low + 0.6 * s.height / count, tones[k % 4])
    x = 0.3
    while x < s.width - 0.3:
        s.fill(x, 0, x + 0.03, s.height, (88, 90, 92))
        if s.stream.random() < 0.3:
            s.fill(x + 0.1, 0.05 * s.height, x + 0.24, 0.95 * s.height, (214, 214, 208))
            s.disc(x + 0.17, 0.5 * s.height, 0.02, (60, 62, 62))
        x += s.stream.uniform(0.5, 0.9)


def _draw_bolts(s: Sheet) -> None:
    """Draw a plate of steel with bolts along its edges and a stamped sign."""
    s.all((128, 132, 134))
    s.frame(0.01, (70, 72, 74))
    pitch = 0.12
    for i in range(int(s.width / pitch) + 1):
        for j in range(int(s.height / pitch) + 1):
            x, y = 0.035 + pitch * i, 0.035 + pitch * j
            interior = 0.1 < x < s.width - 0.1 and 0.1 < y < s.height - 0.1
            if not interior and x < s.width - 0.02 and y < s.height - 0.02:
                s.disc(x, y, 0.014, (44, 46, 48))
                s.disc(x - 0.002, y + 0.002, 0.009, (196, 198, 198))
    if s.width > 0.4 and s.height > 0.3:
        s.fill(0.15, 0.5 * s.height, s.width - 0.15, 0.5 * s.height + 0.09, (226, 226, 220))
        s.text(0.17, 0.5 * s.height + 0.02, s.width - 0.17, 0.05, INK)


def _draw_holes(s: Sheet) -> None:
    """Draw the holes of a rack's upright, each 0.05 m."""
    s.all((44, 76, 140))
    for k in range(int(s.height / 0.05)):
        for x in (0.28, 0.72):
            y = 0.05 * k + 0.014
            s.fill(x * s.width - 0.008, y, x * s.width + 0.008, y + 0.022, (14, 18, 26))


def _draw_places(s: Sheet) -> None:
    """Draw the labels of a beam's places: a bar code and a number each 0.7 m."""
    s.all((216, 112, 44))
    for k in range(int(s.width / 0.7)):
        x = 0.25 + 0.7 * k
        s.fill(x, 0.15 * s.height, x + 0.24, 0.85 * s.height, (246, 246, 240))
        stroke_x = x + 0.015
        while stroke_x < x + 0.1:
            step = s.stream.uniform(0.003, 0.009)
            s.fill(stroke_x, 0.25 * s.height, stroke_x + step, 0.75 * s.height, INK)
            stroke_x += 2.0 * step
        s.text(x + 0.115, 0.3 * s.height, x + 0.235, 0.4 * s.height, INK)


PRINTS: Final[dict[str, Callable[[Sheet], None]]] = {
    **outdoor_prints.PRINTS,
    "poster": _draw_poster,
    "notices": _draw_notices,
    "whiteboard": _draw_whiteboard,
    "books": _draw_books,
    "drawers": _draw_drawers,
    "screen": _draw_screen,
    "door": _draw_door,
    "window": _draw_window,
    "night": _draw_night,
    "lamp": _draw_lamp,
    "strip": _draw_strip,
    "outlet": _draw_outlet,
    "exit": _draw_exit,
    "clock": _draw_clock,
    "label": _draw_label,
    "paper": _draw_paper,
    "grid": _draw_grid,
    "band": _draw_band,
    "doors": _draw_doors,
    "opening": _draw_doorway,
    "keyboard": _draw_keyboard,
    "grille": _draw_grille,
    "switch": _draw_switch,
    "vent": _draw_vent,
    "detector": _draw_detector,
    "plan": _draw_plan,
    "book": _draw_book,
    "cables": _draw_cables,
    "bolts": _draw_bolts,
    "holes": _draw_holes,
    "places": _draw_places,
}


def picture(content: Print, texel: tuple[float, float], seed: int) -> Bytes:
    """Return the picture (rows, columns, 3) of a print; its first row is the lowest.

    :param texel: height and width of a texel [m].
    """
    sheet = Sheet(content, texel, seed)
    PRINTS[content.kind](sheet)
    return sheet.values
