# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Drawing surface of prints: a sheet in metres."""

from typing import Final, NamedTuple

import numpy as np

from imu_sim_ros.core.random_streams import generator_at
from imu_sim_ros.core.types import Array, Bytes

Colour = tuple[int, int, int]

INK: Final = (38, 38, 42)
"""Colour of print and handwriting: red, green, blue, to 255."""


class Print(NamedTuple):
    """A picture on a surface."""

    kind: str
    """Name of the picture in the catalogue of prints."""
    left: float
    """Distance of its left edge from that of the surface [m]."""
    bottom: float
    """Distance of its lower edge from that of the surface [m]."""
    width: float
    """Width [m]."""
    height: float
    """Height [m]."""
    number: int = 0
    """Number of the picture; another number gives another picture of its kind."""
    glows: bool = False
    """True if its colours do not depend on the light."""


class Sheet:
    """A picture in metres: x to the right, y up."""

    def __init__(self, p: Print, texel: tuple[float, float], seed: int) -> None:
        """Initialise with black.

        :param texel: height and width of a texel [m].
        """
        self.width, self.height, self.number = p.width, p.height, p.number
        rows, columns = (
            max(2, round(side / edge))
            for side, edge in zip((p.height, p.width), texel, strict=True)
        )
        self.values: Bytes = np.zeros((rows, columns, 3), np.uint8)
        self.stream = generator_at(seed, f"print.{p.kind}", p.number)

    def fill(self, x0: float, y0: float, x1: float, y1: float, colour: Colour | Array) -> None:
        """Fill a rectangle from (x0, y0) to (x1, y1) [m], at least one texel."""
        rows, columns = self.values.shape[:2]
        column0, column1 = round(x0 / self.width * columns), round(x1 / self.width * columns)
        low, high = round(y0 / self.height * rows), round(y1 / self.height * rows)
        self.values[
            max(low, 0) : max(high, low + 1), max(column0, 0) : max(column1, column0 + 1)
        ] = colour

    def all(self, colour: Colour | Array) -> None:
        """Fill the whole sheet."""
        self.values[:] = colour

    def frame(self, edge: float, colour: Colour) -> None:
        """Draw a frame along the edges."""
        w, h = self.width, self.height
        for x0, y0, x1, y1 in (
            (0.0, 0.0, w, edge),
            (0.0, h - edge, w, h),
            (0.0, 0.0, edge, h),
            (w - edge, 0.0, w, h),
        ):
            self.fill(x0, y0, x1, y1, colour)

    def text(self, x0: float, y0: float, x1: float, size: float, colour: Colour) -> None:
        """Draw a line of unreadable letters of a size, from x0 to x1 on the base y0 [m]."""
        x = x0
        while x < x1:
            letters = int(self.stream.integers(2, 9))
            for _ in range(letters):
                if x + 0.5 * size > x1:
                    return
                self._letter(x, y0, size, colour)
                x += 0.62 * size
            x += 0.5 * size

    def _letter(self, x: float, y: float, size: float, colour: Colour) -> None:
        """Draw one letter of random strokes."""
        w, bar = 0.5 * size, 0.14 * size
        strokes = (
            (0, 0, bar, size), (w - bar, 0, w, size), (0, 0, w, bar), (0, size - bar, w, size),
            (0, 0.45 * size, w, 0.45 * size + bar), (0.5 * (w - bar), 0, 0.5 * (w + bar), size),
        )  # fmt: skip
        for k in self.stream.permutation(6)[:3]:
            a, b, c, d = strokes[k]
            self.fill(x + a, y + b, x + c, y + d, colour)

    def disc(self, x: float, y: float, radius: float, colour: Colour) -> None:
        """Fill a disc around (x, y) [m]."""
        rows, columns = self.values.shape[:2]
        v, u = np.ogrid[:rows, :columns]
        dx = (u + 0.5) * (self.width / columns) - x
        dy = (v + 0.5) * (self.height / rows) - y
        self.values[dx * dx + dy * dy <= radius * radius] = colour

    def colour(self, low: int = 30, high: int = 226) -> Colour:
        """Return a random colour with components from ``low`` to below ``high``."""
        r, g, b = self.stream.integers(low, high, 3).tolist()
        return r, g, b
