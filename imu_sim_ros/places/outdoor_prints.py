# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Prints and flat fittings in halls and streets."""

from collections.abc import Callable
from typing import Final

import numpy as np

from imu_sim_ros.places.sheet import INK, Sheet


def _draw_line(s: Sheet) -> None:
    """Draw a line on the floor of a hall."""
    s.all((212, 176, 36))


def _draw_dash(s: Sheet) -> None:
    """Draw a dash of a road marking."""
    s.all((214, 214, 210))


def _draw_plinth(s: Sheet) -> None:
    """Draw the plinth of a house."""
    s.all((122, 118, 112))
    s.fill(0, 0.9 * s.height, s.width, s.height, (96, 92, 88))


def _draw_cartons(s: Sheet) -> None:
    """Draw cartons in rows, each with its tape."""
    rows, columns = max(1, round(s.height / 0.35)), max(1, round(s.width / 0.45))
    for i in range(rows):
        for j in range(columns):
            x0, x1 = (s.width / columns * k for k in (j, j + 1))
            y0, y1 = (s.height / rows * k for k in (i, i + 1))
            tone = int(s.stream.integers(-14, 15))
            s.fill(x0, y0, x1, y1, (88, 66, 42))
            s.fill(x0 + 0.008, y0 + 0.008, x1, y1, (178 + tone, 142 + tone, 96 + tone))
            middle = 0.5 * (x0 + x1)
            s.fill(middle - 0.02, y0 + 0.008, middle + 0.02, y1, (194, 166, 120))


def _draw_gate(s: Sheet) -> None:
    """Draw a sectional gate."""
    s.all((60, 62, 64))
    s.fill(0.1, 0, s.width - 0.1, s.height - 0.1, (206, 208, 208))
    for k in range(1, int(s.height / 0.5)):
        s.fill(0.1, 0.5 * k, s.width - 0.1, 0.5 * k + 0.02, (140, 142, 144))
    for k in range(3):
        x = s.width * (0.2 + 0.25 * k)
        s.fill(x, 1.55, x + 0.4, 1.85, (70, 84, 92))
    for x in (0.0, s.width - 0.1):
        for k in range(int(s.height / 0.4)):
            s.fill(x, 0.4 * k, x + 0.1, 0.4 * k + 0.2, (220, 180, 30))


_SEGMENTS: Final = {0: "abcdef", 1: "bc", 2: "abged", 3: "abgcd", 4: "fgbc", 5: "afgcd"}


def _draw_number(s: Sheet) -> None:
    """Draw a house number."""
    s.all((250, 250, 250))
    s.frame(0.03, (30, 60, 140))
    w, h, bar = s.width, s.height, 0.1 * s.width
    low, high, x_left, x_right = 0.2 * h, 0.8 * h, 0.32 * w, 0.68 * w
    middle = 0.5 * (low + high)
    strokes = {
        "a": (x_left, high - bar, x_right, high),
        "b": (x_right - bar, middle, x_right, high),
        "c": (x_right - bar, low, x_right, middle),
        "d": (x_left, low, x_right, low + bar),
        "e": (x_left, low, x_left + bar, middle),
        "f": (x_left, middle, x_left + bar, high),
        "g": (x_left, middle - 0.5 * bar, x_right, middle + 0.5 * bar),
    }
    for name in _SEGMENTS[int(s.stream.integers(6))]:
        x0, y0, x1, y1 = strokes[name]
        s.fill(x0, y0, x1, y1, (30, 60, 140))


def _draw_panel(s: Sheet) -> None:
    """Draw the front of a control cabinet: dials, lamps, switches."""
    s.all((176, 182, 180))
    s.frame(0.012, (96, 100, 100))
    pitch = 0.16
    for i in range(int((s.height - 0.08) / pitch)):
        for j in range(int((s.width - 0.08) / pitch)):
            x, y = 0.12 + pitch * j, 0.12 + pitch * i
            choice = s.stream.random()
            if choice < 0.35:
                s.disc(x, y, 0.055, (40, 42, 44))
                s.disc(x, y, 0.047, (240, 240, 234))
                angle = s.stream.uniform(-0.03, 0.03)
                s.fill(x - 0.004, y, x + 0.004, y + 0.04, (20, 20, 22))
                s.fill(x + angle - 0.01, y - 0.03, x + angle + 0.01, y - 0.022, (160, 30, 30))
            elif choice < 0.65:
                colour = ((200, 40, 36), (50, 150, 60), (220, 180, 40))[int(s.stream.integers(3))]
                s.disc(x, y, 0.028, (60, 62, 62))
                s.disc(x, y, 0.022, colour)
            elif choice < 0.9:
                s.fill(x - 0.05, y - 0.02, x + 0.05, y + 0.02, (238, 238, 230))
                s.text(x - 0.045, y - 0.012, x + 0.045, 0.022, INK)


def _draw_warning(s: Sheet) -> None:
    """Draw a yellow triangle on white."""
    s.all((244, 244, 240))
    steps = max(4, len(s.values))
    for k in range(steps):
        y = k / steps
        half = 0.46 * (1.0 - y)
        s.fill(
            (0.5 - half) * s.width, y * s.height, (0.5 + half) * s.width, y * s.height, (20, 20, 20)
        )
        half -= 0.09
        if half > 0.0 and y > 0.07:
            box = (0.5 - half) * s.width, y * s.height, (0.5 + half) * s.width, y * s.height
            s.fill(*box, (236, 190, 30))
    s.fill(0.46 * s.width, 0.16 * s.height, 0.54 * s.width, 0.52 * s.height, (20, 20, 20))


def _draw_glass(s: Sheet) -> None:
    """Draw a window from outside by day: a frame, panes that mirror the sky a little."""
    rows = len(s.values)
    share = (np.arange(rows) / rows).astype(np.float32)[:, None]
    tone = (
        np.array([38, 48, 58], np.float32) * (1 - share)
        + np.array([104, 124, 144], np.float32) * share
    )
    s.values[:] = tone[:, None].astype(np.uint8)
    s.fill(0.1, 0.2, 0.3 * s.width, 0.95 * s.height, (150, 146, 136))
    frame = ((232, 232, 228), (90, 70, 52), (210, 206, 196), (64, 68, 72))[
        int(s.stream.integers(4))
    ]
    s.frame(0.07, frame)
    s.fill(0.5 * s.width - 0.03, 0, 0.5 * s.width + 0.03, s.height, frame)
    s.fill(0, 0, s.width, 0.06, (190, 186, 178))


def _draw_lit_window(s: Sheet) -> None:
    """Draw a window from outside at night, with light behind it."""
    s.all((230, 190, 110))
    s.fill(0.08, 0.1, 0.35 * s.width, s.height, (190, 140, 76))
    s.frame(0.07, (40, 38, 36))
    s.fill(0.5 * s.width - 0.03, 0, 0.5 * s.width + 0.03, s.height, (40, 38, 36))


def _draw_shop(s: Sheet) -> None:
    """Draw a shop's front: a name above, goods behind panes, a door."""
    s.all((56, 52, 50))
    board = s.colour(30, 170)
    s.fill(0, s.height - 0.6, s.width, s.height, board)
    s.text(0.3, s.height - 0.47, s.width - 0.5, 0.34, (244, 240, 226))
    count = max(2, int(s.width / 1.8))
    for k in range(count):
        x0, x1 = (s.width * j / count for j in (k, k + 1))
        s.fill(x0 + 0.07, 0.35, x1 - 0.07, s.height - 0.68, (84, 92, 96))
        if k == count // 2:
            s.fill(x0 + 0.3, 0.0, x1 - 0.3, s.height - 0.75, (120, 132, 136))
            s.fill(x1 - 0.45, 0.9, x1 - 0.4, 1.3, (210, 210, 206))
            continue
        for _ in range(6):
            x, w = s.stream.uniform(x0 + 0.1, x1 - 0.4), s.stream.uniform(0.1, 0.3)
            s.fill(x, 0.37, x + w, 0.37 + s.stream.uniform(0.2, 1.0), s.colour(60, 230))


CAR_COLOURS: Final = ("8c1c20", "24405c", "d4d6d8", "2a2c2e", "8c9296")
WHEEL_HEIGHT: Final = 0.125
"""Height of a wheel's axis above the lower edge of the car's side [m]."""


def _draw_wheel(s: Sheet) -> None:
    """Draw a wheel in its arch, on a side in the colour of the number."""
    code = CAR_COLOURS[s.number % len(CAR_COLOURS)]
    s.all((int(code[:2], 16), int(code[2:4], 16), int(code[4:], 16)))
    for radius, colour in (
        (0.37, (16, 16, 18)), (0.3, (32, 32, 34)), (0.12, (150, 152, 154)), (0.04, (60, 60, 62)),
    ):  # fmt: skip
        s.disc(0.5 * s.width, WHEEL_HEIGHT, radius, colour)


def _draw_car_panes(s: Sheet) -> None:
    """Draw the windows of a car."""
    s.all((34, 42, 50))
    s.fill(0.5 * s.width - 0.03, 0, 0.5 * s.width + 0.03, s.height, (20, 22, 24))
    s.fill(0, 0.7 * s.height, s.width, s.height, (64, 78, 90))


def _draw_bumper(s: Sheet) -> None:
    """Draw the bumper of a car with its lamps and number plate."""
    s.all((44, 46, 48))
    s.fill(0.05, 0.35, 0.4, 0.52, (236, 232, 220))
    s.fill(s.width - 0.4, 0.35, s.width - 0.05, 0.52, (236, 232, 220))
    s.fill(0.5 * s.width - 0.26, 0.12, 0.5 * s.width + 0.26, 0.24, (240, 240, 236))
    s.text(0.5 * s.width - 0.22, 0.14, 0.5 * s.width + 0.22, 0.07, INK)


PRINTS: Final[dict[str, Callable[[Sheet], None]]] = {
    "line": _draw_line,
    "dash": _draw_dash,
    "plinth": _draw_plinth,
    "cartons": _draw_cartons,
    "gate": _draw_gate,
    "number": _draw_number,
    "panel": _draw_panel,
    "warning": _draw_warning,
    "glass": _draw_glass,
    "lit": _draw_lit_window,
    "shop": _draw_shop,
    "wheel": _draw_wheel,
    "panes": _draw_car_panes,
    "bumper": _draw_bumper,
}
