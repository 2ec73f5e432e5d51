# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Regions of an image with shadows of bodies, and with gloss."""

from collections.abc import Sequence
from typing import Final, NamedTuple

import numpy as np

from imu_sim_ros.core.types import Integers, Mask, Single
from imu_sim_ros.places.gloss import Polish, Sheen
from imu_sim_ros.places.shadows import ShadowLine
from imu_sim_ros.sensors.camera.images.planes import Pairs, Planes

_TURNING: Final = np.float32(12.0)
"""Number of pixels within which distances change by less than a factor of two."""
_ANYWHERE: Final = np.float32(1e9)
"""Step from pixel to pixel of a position that is unknown."""


class Glossy(NamedTuple):
    """Glossy regions that may be visible in the cells of p pairs of a cell and a rectangle."""

    first: Integers
    """(p + 1,) index in ``region`` of each pair's first region; the last is q."""
    region: Integers
    """(q,) numbers of the regions, ordered by pair."""
    lit: Mask
    """(q, sources) True if the source's highlight may be there."""
    sheen: Sheen

    @classmethod
    def of(
        cls,
        polish: Polish,
        planes: Planes,
        face: Integers,
        pairs: Pairs,
        probes: tuple[Single, Single, Integers],
        angle: float,
    ) -> "Glossy":
        """Return the glossy regions of pairs.

        :param face: (p,) number of each pair's face; -1: a face without gloss.
        :param probes: inverse distance (3, p) and s and r (3, 2, p) of the probes, row (p,) of the
            first.
        """
        number = np.flatnonzero(face >= 0)
        inverse, positions = (probe.take(number, axis=-1) for probe in probes[:2])
        rows = probes[2].take(number)[:, None]
        start, height = _eye(planes, pairs.which.take(number), rows)
        steps = np.abs(positions[1:] - positions[0]).sum(axis=0)
        turning = np.abs(inverse[1:] - inverse[0]).sum(axis=0)
        steps[:, inverse[0] <= _TURNING * turning] = _ANYWHERE
        glossy_faces = face[number]
        sights = polish.sights(glossy_faces, positions[0, ..., None], start, height)
        active = polish.active(glossy_faces, sights, steps, angle)
        starts = np.searchsorted(number[active.pair], np.arange(len(face) + 1))
        return cls(starts, active.region, active.lit, polish.sheen)

    @classmethod
    def none(cls, pairs: int) -> "Glossy":
        """Return no regions for some pairs."""
        starts, lit = np.zeros(pairs + 1, np.int64), np.zeros((0, 0), np.bool_)
        return cls(starts, starts[:0], lit, Sheen.empty(0, 0, 0, 0))


def _eye(planes: Planes, which: Integers, rows: Integers) -> tuple[Single, Single]:
    """Return s and r of the eye's foot on rectangles (2, p, k), and its height (p, k) [m]."""
    vectors, start = planes.select(which, rows)
    normal = vectors[0]
    square = normal[0] * normal[0] + normal[1] * normal[1] + normal[2] * normal[2]
    return start, 1 / np.sqrt(square)


class Shades(NamedTuple):
    """The shadows of bodies in an image."""

    first: Integers
    """(cells + 1,) first of each cell's shadows."""
    which: Integers
    """Numbers of the shadows, by cell."""
    planes: Planes
    """(k,) parts of the floor that may be in a shadow."""
    lines: Single
    """(k, 3) length and radius of the shadows [m], and the share of light that is missing."""

    @classmethod
    def of(
        cls, cells: int, nothing: Planes, shadows: Sequence[tuple[Planes, Pairs, ShadowLine]]
    ) -> "Shades":
        """Return the shadows that may be visible, by cell.

        :param cells: number of cells of the image.
        :param nothing: planes of no rectangles.
        :param shadows: plane, cells and line of each shadow.
        """
        cell = np.concatenate([np.zeros(0, np.int64), *(pairs.cell for _, pairs, _ in shadows)])
        which = np.repeat(np.arange(len(shadows)), [len(pairs.cell) for _, pairs, _ in shadows])
        order = np.argsort(cell, kind="stable")
        lines = [(line.length, line.radius, line.depth) for *_, line in shadows]
        return cls(
            np.searchsorted(cell[order], np.arange(cells + 1)),
            which[order],
            nothing.concatenate([planes for planes, *_ in shadows]),
            np.array(lines, np.float32).reshape(-1, 3),
        )
