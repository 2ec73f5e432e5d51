# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Visibility of many points from one eye, or from a point of a lamp, between rectangles."""

import math
from collections.abc import Iterator
from typing import Final, NamedTuple

import numpy as np

from imu_sim_ros.core.types import Array, Integers, Mask, Single
from imu_sim_ros.places.geometry import Surfaces

_BUNDLE: Final = 16
"""Places in about the same direction that are compared with the same rectangles."""
_PAIRS: Final = 32_768
"""Pairs of a place and a rectangle that are compared at once."""
_APART: Final = np.float32(1e-4)
"""Smallest distance of a hiding surface from the place, as a share of the place's distance."""
_FRONT: Final = 1e-4
"""Smallest depth of visible surfaces [m]."""
_SLACK: Final = np.float32(1e-5)
"""Margin of the bounds of bundles."""


def is_hidden_place(where: Surfaces, eye: Array, axis: Array, places: Single) -> Mask:
    """Return True for places (n, 3) behind rectangles that face an eye.

    Of a closed body one side that is before a place faces the eye. Places in about the same
    direction are compared with what is in that direction.

    :param eye: (3,) [m].
    :param axis: (3,) unit vector; all places are on this side of the eye.
    """
    hidden = np.zeros(len(places), np.bool_)
    origin, normals = where.origin - eye, where.normal
    distance = (origin * normals).sum(axis=1)
    front = distance < 0.0
    if not (len(places) and front.any()):
        return hidden
    helper = np.eye(3)[np.argmin(np.abs(axis))]
    horizontal = np.cross(axis, helper)
    horizontal /= math.sqrt(float(horizontal @ horizontal))
    view = np.stack([horizontal, np.cross(axis, horizontal), axis])
    o, a, b = origin[front], where.across[front], where.up[front]
    corners = np.stack([o, o + a, o + a + b, o + b])
    low, high = _bounds((corners[:, :, None] * view).sum(axis=3))
    # 1 / t, s / t and r / t of the ray that is at a place at t = 1 are its products with these.
    inward = normals[front] / distance[front, None]
    shares = [side / (side * side).sum(axis=1, keepdims=True) for side in (a, b)]
    linear = [inward, *(u - (o * u).sum(axis=1, keepdims=True) * inward for u in shares)]
    vectors = np.stack(linear).transpose(0, 2, 1).astype(np.float32)
    way = (places - eye).T.astype(np.float32)
    bundles = _Bundles.of(
        _directions(np.stack([_product(axis, way) for axis in view.astype(np.float32)]))
    )
    for place, number in bundles.pairs(low, high):
        n = _product(vectors[0].take(number, axis=1), way.take(place, axis=1))
        some = np.flatnonzero(n > 1 + _APART)  # it is before the place
        n, place, number = n.take(some), place.take(some), number.take(some)
        ray, blocked = way.take(place, axis=1), np.ones(len(some), np.bool_)
        for vector in vectors[1:]:
            share = _product(vector.take(number, axis=1), ray)
            blocked &= share >= 0
            blocked &= share <= n
        hidden[place[blocked]] = True
    return hidden


def _product(a: Single, b: Single) -> Single:
    """Return the scalar products (k,) of vectors (3, k)."""
    result: Single = a[0] * b[0]
    for k in (1, 2):
        result += a[k] * b[k]
    return result


def _directions(local: Single) -> Single:
    """Return image coordinates from -1 to 1, and depth (3, n), of places (3, n) in the eye's frame.

    ``x / (z + |x|)`` grows with x / z, so that the bounds of a rectangle are those of its corners.
    """
    x, y, z = local
    return np.stack([x / (z + np.abs(x)), y / (z + np.abs(y)), z])


def _bounds(corners: Array) -> tuple[Single, Single]:
    """Return smallest and largest image coordinates and depth (3, m) of rectangles.

    :param corners: (4, m, 3) in the eye's frame, around each rectangle.
    """
    following = np.roll(corners, -1, axis=0)
    z, step = corners[..., 2:], (following - corners)[..., 2:]
    share = (_FRONT - z) / np.where(step == 0.0, 1.0, step)
    cut = corners + share * (following - corners)
    points = np.concatenate([corners, cut])
    valid = np.concatenate([z >= _FRONT, (share > 0.0) & (share < 1.0) & (step != 0.0)])
    x, y, depth = points.transpose(2, 0, 1)
    depth = np.maximum(depth, _FRONT)
    projected = _directions(np.stack([x, y, depth]))
    valid = valid.transpose(2, 0, 1)
    low = np.where(valid, projected, np.inf).min(axis=1)
    high = np.where(valid, projected, -np.inf).max(axis=1)
    return low.astype(np.float32), high.astype(np.float32)


class _Bundles(NamedTuple):
    """Places in b bundles."""

    order: Integers
    """(n,) numbers of the places, one bundle after the other."""
    first: Integers
    """(b,) index of a bundle's first place in ``order``."""
    sizes: Integers
    """(b,) number of places in each bundle."""
    low: Single
    """(3, b) smallest image coordinates and depth."""
    high: Single
    """(3, b) largest image coordinates and depth."""

    @classmethod
    def of(cls, projected: Single) -> "_Bundles":
        """Return the bundles of places with image coordinates and depth (3, n)."""
        side = max(1, round(math.sqrt(projected.shape[1] / _BUNDLE)))
        column, row = ((np.float32(0.5 * side) * (projected[:2] + 1)).astype(np.int64)).clip(
            0, side - 1
        )
        number = row * side + column
        order = np.argsort(number, kind="stable")
        starts = np.flatnonzero(np.diff(number[order], prepend=-1))
        in_order = projected.take(order, axis=1)
        low, high = (f.reduceat(in_order, starts, axis=1) for f in (np.minimum, np.maximum))
        return cls(
            order=order,
            first=starts,
            sizes=np.diff(starts, append=len(order)),
            low=low - _SLACK,
            high=high + _SLACK,
        )

    def pairs(self, low: Single, high: Single) -> Iterator[tuple[Integers, Integers]]:
        """Yield numbers of places and of rectangles (k,) in the same directions, not behind them.

        :param low, high: (3, m) bounds of the rectangles, see :func:`_bounds`.
        """
        overlap = self.high[2, :, None] >= low[2]
        for k in range(2):
            overlap &= self.high[k, :, None] >= low[k]
            overlap &= self.low[k, :, None] <= high[k]
        bundle, number = np.nonzero(overlap)
        count = self.sizes.take(bundle)
        ends = np.cumsum(count)
        start = 0
        while start < len(bundle):
            skipped = int(ends[start - 1]) if start else 0
            stop = max(start + 1, int(np.searchsorted(ends, skipped + _PAIRS, side="right")))
            counts = count[start:stop]
            begin = ends[start:stop] - counts - skipped
            within = np.arange(int(counts.sum())) - np.repeat(begin, counts)
            place = np.repeat(self.first.take(bundle[start:stop]), counts) + within
            yield self.order.take(place), np.repeat(number[start:stop], counts)
            start = stop
