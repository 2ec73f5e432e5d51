# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Pixels at the edges of rectangles: which parts of their areas see which rectangle.

Eight places in a pixel are looked at, but only where an edge, or the line in which two planes meet,
may cross it. ``1 / t``, ``s / t`` and ``r / t`` are linear in the ray, so a pixel's steps to its
neighbours give them at each place.
"""

from collections.abc import Sequence
from typing import Final, NamedTuple

import numpy as np

from imu_sim_ros.sensors.camera.images.rays import CELL
from imu_sim_ros.types import Integers, Single

PLACES: Final = (
    np.array([(1, -3), (-1, 3), (5, 1), (-3, -5), (-5, 5), (-7, -1), (3, 7), (7, -7)], np.float32)
    / 16
).T[:, :, None]
"""Columns and rows (2, 8, 1) [px]: one in each eighth of both, their mean in the middle."""
_HALF: Final = np.float32(0.5)
_ONE: Final = np.float32(1.0)
_LEAST: Final = np.float32(1e-12)
_NONE: Final = np.zeros(0, np.int64)


class Slopes(NamedTuple):
    """How fast what is linear in the ray changes over the pixels of p pairs."""

    steps: Single
    """(2, 3, p) of 1 / t, s / t and r / t from a pixel to that on its right, and below."""
    inside: Single
    """(2, p) 1 / what s / t or (1 - s) / t, r / t or (1 - r) / t change in half a pixel at most."""
    depth: Single
    """(p,) what 1 / t changes within half a pixel."""

    @classmethod
    def of(cls, linear: Single) -> "Slopes":
        """Take the values of a pixel, of that on its right and of that below (3, 3, p)."""
        steps = linear[1:] - linear[:1]
        n, s, r = steps.transpose(1, 0, 2)
        most = [_HALF * np.abs(each).sum(axis=0) for each in (s, n - s, r, n - r, n)]
        sides = np.stack([np.maximum(most[k], most[k + 1]) for k in (0, 2)])
        return cls(steps, _ONE / np.maximum(sides, _LEAST), np.asarray(most[4]))


class Parts(NamedTuple):
    """e pixels that see more than one surface, and k parts of theirs that their centres miss."""

    cell: Integers
    """(e,) number of the cell."""
    spot: Integers
    """(e,) number of the pixel in its cell."""
    own: Integers
    """(e,) places that see what the centre sees."""
    nothing: Integers
    """(e,) places that see nothing."""
    pixel: Integers
    """(k,) to which of the pixels a part belongs, ascending."""
    pair: Integers
    """(k,) what it sees."""
    weight: Integers
    """(k,) places that see it."""
    inverse: Single
    """(k,) 1 / t of its plane at the pixel's centre."""
    places: Single
    """(2, k) s and r there, on the rectangle."""


def together(parts: Sequence[Parts]) -> Parts:
    """Return some of them as one."""
    before = np.cumsum([0, *(len(each.cell) for each in parts)])
    moved = [
        each._replace(pixel=each.pixel + first) for each, first in zip(parts, before, strict=False)
    ]
    return Parts(*(np.concatenate(each, axis=-1) for each in zip(*moved, strict=True)))


def parts(
    pairs: Integers,
    local: Integers,
    inverse: Single,
    places: Single,
    seen: tuple[Single, Integers],
    slopes: Slopes,
) -> Parts | None:
    """Return what is seen of m pairs at the edges in c cells; None: there are no edges.

    :param pairs: (m,) all pairs of the cells.
    :param local: (m,) cell of each, from 0 to c - 1; those of :class:`Parts` are these.
    :param inverse: (m, CELL^2) 1 / t of the planes; 0: not in front.
    :param places: (2, m, CELL^2) s and r on them.
    :param seen: (c, CELL^2) of what the centres see 1 / t, and its pair; -1: nothing.
    """
    nearest, own = seen
    # Halves of a pixel from the nearest edge: below -1 the pixel is outside, above 1 inside.
    to_edge = np.subtract(_ONE, places)
    np.minimum(to_edge, places, out=to_edge)
    to_edge *= slopes.inside.take(pairs, axis=1)[..., None]
    far = np.minimum(to_edge[0], to_edge[1], out=to_edge[0])
    far *= inverse
    touched = far > -_ONE
    touched &= inverse > 0
    front = nearest - slopes.depth.take(own)
    visible = inverse + slopes.depth.take(pairs)[:, None] >= front.take(local, axis=0)
    visible &= touched
    visible &= (far < _ONE) | (own.take(local, axis=0) != pairs[:, None])
    row, spot = np.divmod(np.flatnonzero(visible), CELL**2)
    if not len(row):
        return None
    edge = np.zeros(own.shape, np.bool_)
    edge[local[row], spot] = True
    touched &= edge.take(local, axis=0)
    row, spot = np.divmod(np.flatnonzero(touched), CELL**2)
    key = local[row] * CELL**2 + spot
    order = np.argsort(key, kind="stable")
    row, spot, key = row[order], spot[order], key[order]
    at = row * CELL**2 + spot
    pair, away = pairs[row], inverse.reshape(-1).take(at)
    on_it = places.reshape(2, -1).take(at, axis=1)
    middle = np.concatenate([away[None], on_it * away])
    near = _seen_at_places(middle, slopes.steps.take(pair, axis=2))
    begins = np.ones(len(key), np.bool_)
    np.not_equal(key[1:], key[:-1], out=begins[1:])
    first, pixel = np.flatnonzero(begins), np.cumsum(begins) - 1
    best = np.maximum.reduceat(near, first, axis=1)
    weight = ((near == best.take(pixel, axis=1)) & (near > 0)).sum(axis=0)
    nothing = (best <= 0).sum(axis=0)
    centre = own.reshape(-1)[key] == pair
    of_centre = np.add.reduceat(weight * centre, first)
    more = np.add.reduceat(weight, first) + nothing > of_centre
    some = np.flatnonzero((weight > 0) & ~centre & more[pixel])
    number = np.cumsum(more) - 1
    cell, spots = np.divmod(key[first[more]], CELL**2)
    return Parts(
        cell,
        spots,
        of_centre[more],
        nothing[more],
        number[pixel[some]],
        pair[some],
        weight[some],
        away[some],
        np.clip(on_it[:, some], 0, _ONE),
    )


def _seen_at_places(middle: Single, steps: Single) -> Single:
    """Return 1 / t (8, k) at the places of pixels; 0: beside the rectangle.

    :param middle: (3, k) 1 / t, s / t and r / t at the centres.
    :param steps: (2, 3, k) of them.
    """
    n, s, r = (middle[j] + (PLACES[0] * steps[0, j] + PLACES[1] * steps[1, j]) for j in range(3))
    hit = s >= 0
    hit &= s <= n
    hit &= r >= 0
    hit &= r <= n
    return np.where(hit, n, np.float32(0.0))
