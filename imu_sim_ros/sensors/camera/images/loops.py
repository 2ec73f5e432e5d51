# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Compiled loops over the pixels of an image.

For each pixel, of the rectangles that may be in its cell the nearest one; its texture along the
pixel's footprint, in the shadows of bodies, with its gloss. Where an edge, or the line in which two
planes meet, may cross a pixel, what is seen at eight points of it. ``1 / t``, ``s / t`` and
``r / t`` are linear in the ray, so a pixel's steps to its neighbours give them at each point.

Names in all functions: ``m`` number of a rectangle; ``k`` number of its pose, the image's row if
the camera moves during the exposure, else 0; ``p`` number of a pair of a cell and a rectangle;
``t`` distance along a ray, in lengths of its direction; ``s`` and ``r`` coordinates of a point in a
rectangle, from 0 to 1 along its two sides.

Real numbers have 32 bits, and no product and sum become one step: the bits of a picture are the
same on every processor. All functions that call each other are in this file
(:func:`numba_function`). Rays that meet the triangles of a mesh look in the same way, each at a
level of its own.
"""

import math
from typing import Any, Final, TypeAlias

import numpy as np
from numpy.typing import NDArray

from imu_sim_ros.core.types import Bytes, Integers, Mask, Single
from imu_sim_ros.places.gloss import Sheen, limit_highlight, reflectance
from imu_sim_ros.sensors.camera.images.finish import Glossy, Shades
from imu_sim_ros.sensors.camera.images.libraries import numba_function, part
from imu_sim_ros.sensors.camera.images.planes import Pairs, Planes
from imu_sim_ros.sensors.camera.images.visible import MeshHits, Triangles, Visible

Ray: TypeAlias = tuple[np.float32, np.float32, np.float32]

FORMULAS_DIGEST: Final = "c76c7eea580f"
"""Digest of the formulas that are compiled here and stand in other files.

numba reuses compiled code until the file of the calling function changes; a new digest is such a
change. test/camera/test_images.py computes it."""
LEVELS: Final = 8
"""Mip levels of a texture."""
CELL: Final = 8
"""Pixels along which the mip level is constant, in both directions."""
TILE: Final = 4
"""Cells along the edge of a tile, the first step of the search for rectangles."""
BACKGROUND: Final = 110
"""Grey value of the background."""
SHARES: Final = 256
"""Steps of the share of the coarser of two levels."""
IN_FRONT: Final = np.float32(1e-6)
"""Least 1 / t of what is in front of the camera."""
POINTS: Final = np.array(
    [(1, -3), (-1, 3), (5, 1), (-3, -5), (-5, 5), (-7, -1), (3, 7), (7, -7)], np.float32
) / np.float32(16)
"""Columns and rows (8, 2) [px]: one in each eighth of both, their mean in the middle."""
LOOKS: Final = np.array([1.5, 3.0, 6.0], np.float32)
"""Lengths [texels] above which a footprint is looked at 2, 4, 8 times: steps of 0.75 to 1.5."""
_OF_PARTS: Final = 2
"""Doublings of the points that a part of a pixel looks at, whatever its footprint."""
_MOST_SQUARED: Final = np.float32(4.0 ** len(LOOKS))
_GRAZING: Final = 1e-6
"""Least cosine between a ray and a normal that counts in a pixel's footprint."""
_ON_FLOOR: Final = np.float32(0.03)
"""Height up to which something is floor [m]."""
_SLANT: Final = np.float32(2.0)
"""Largest factor by which a lobe that meets a lamp at a slant is wider."""
_NARROWEST: Final = np.float32(1e-6)
_STEPS: Final = np.float32(32.0)
"""Steps of a texel in which positions are told."""
_WHITE: Final = np.float32(255.0)
_ONE_OF_WHITE: Final = np.float32(1.0 / 255.0)
_ZERO: Final = np.float32(0.0)
_QUARTER: Final = np.float32(0.25)
_HALF: Final = np.float32(0.5)
_THREE_QUARTERS: Final = np.float32(0.75)
_ONE: Final = np.float32(1.0)
_TWO: Final = np.float32(2.0)


def space() -> tuple[Integers, Single]:
    """Return arrays for one call of a function that works on pixels."""
    return np.empty((4, 8), np.int64), np.empty((2, 8), np.float32)


@numba_function
def candidates(
    slots: NDArray[np.void],
    planes: Planes,
    rays: Single,
    rows: Integers,
    edges: Single,
    bent: np.float32,
    slack: np.float32,
) -> int:
    """Write the cells in which rectangles may be, by rectangle; return their number.

    A rectangle is looked for in tiles of cells, and in the cells of those in which it may be.

    :param slots: candidates, which are written; the returned number may exceed their length, and
        the last slot is then overwritten.
    :param planes: m rectangles in the camera's frame, for each row of the image or for all.
    :param rays: (3, a + 1, b + 1) through the corners of all cells; ``rows`` (a + 1,) theirs.
    :param edges: (5, tiles + 1, tiles + 1) memory, which is overwritten.
    :param bent: share of a cell that the image of a straight line bends within it at most.
    :param slack: share by which a ray is longer within a cell than at its corners.
    """
    vectors, start = planes
    height, width = rays.shape[1] - 1, rays.shape[2] - 1
    in_tile, count = np.float32(TILE) * bent, 0
    for m in range(len(start)):
        for i in range(edges.shape[1]):
            row = min(i * TILE, height)
            k = rows[row] if start.shape[1] > 1 else 0
            for j in range(edges.shape[2]):
                values = _edges(vectors, start, m, k, rays, row, min(j * TILE, width))
                for e in range(len(values)):
                    edges[e, i, j] = values[e]
        for i in range(edges.shape[1] - 1):
            for j in range(edges.shape[2] - 1):
                possible = True
                for e in range(len(edges)):
                    low, high = _range(edges[e, i, j], edges[e, i, j + 1],
                                         edges[e, i + 1, j], edges[e, i + 1, j + 1])  # fmt: skip
                    possible &= high + in_tile * (high - low) >= _ZERO
                if possible:
                    for row in range(i * TILE, min((i + 1) * TILE, height)):
                        for column in range(j * TILE, min((j + 1) * TILE, width)):
                            slot = slots[min(count, len(slots) - 1)]
                            if _candidate(
                                slot, vectors, start, m, rays, rows, row, column, bent, slack
                            ):
                                count += 1
    return count


@part
def _edges(
    vectors: Single, start: Single, m: int, k: int, rays: Single, row: int, column: int
) -> tuple[np.float32, np.float32, np.float32, np.float32, np.float32]:
    """Return 1 / t of a ray, and its distance inside each edge; all are above 0 for a hit."""
    ray = (rays[0, row, column], rays[1, row, column], rays[2, row, column])
    n = _dot(vectors, m, k, 0, ray)
    s = _dot(vectors, m, k, 1, ray) + start[m, k, 0] * n
    r = _dot(vectors, m, k, 2, ray) + start[m, k, 1] * n
    return n, s, n - s, r, n - r


@part
def _range(
    a: np.float32, b: np.float32, c: np.float32, d: np.float32
) -> tuple[np.float32, np.float32]:
    """Return the smallest and the largest of four numbers."""
    return min(min(a, b), min(c, d)), max(max(a, b), max(c, d))


@part
def _candidate(
    slot: Any,
    vectors: Single,
    start: Single,
    m: int,
    rays: Single,
    rows: Integers,
    row: int,
    column: int,
    bent: np.float32,
    slack: np.float32,
) -> bool:
    """Return whether a rectangle may be in a cell; write its nearness there.

    It may unless all four corners of the cell are outside the same edge, or it is behind them.

    :param slot: record of a candidate, which is written.
    :param rays: (3, a + 1, b + 1) through the corners of all cells; ``rows`` (a + 1,) theirs.
    :param row: row and ``column`` of the cell.
    :param bent: share of a cell that the image of a straight line bends within it at most.
    :param slack: share by which a ray is longer within a cell than at its corners.
    """
    pose_above = rows[row] if start.shape[1] > 1 else 0
    pose_below = rows[row + 1] if start.shape[1] > 1 else 0
    a = _edges(vectors, start, m, pose_above, rays, row, column)
    b = _edges(vectors, start, m, pose_above, rays, row, column + 1)
    c = _edges(vectors, start, m, pose_below, rays, row + 1, column)
    d = _edges(vectors, start, m, pose_below, rays, row + 1, column + 1)
    hides, nearest, hiding = True, _ZERO, -_ONE
    for e in range(len(a)):
        low, high = _range(a[e], b[e], c[e], d[e])
        bend = (high - low) * bent
        if e == 0:
            bend += slack * high
        high += bend
        low -= bend
        if not high >= _ZERO:
            return False
        if e == 0:
            nearest, hiding = high, low
            hides = low > _TWO * IN_FRONT
        else:
            hides = hides and low > _ZERO
    slot.cell, slot.which = row * (rays.shape[2] - 1) + column, m
    slot.nearest, slot.hiding = nearest, hiding if hides else -_ONE
    corners = slot.corners
    corners[0], corners[1], corners[2], corners[3] = a[0], b[0], c[0], d[0]
    return True


@numba_function
def arrange(
    pairs: Pairs,
    slots: NDArray[np.void],
    hiding: Single,
    front: Integers,
    bent: np.float32,
    apart: np.float32,
) -> int:
    """Write the candidates that no other one hides, by cell; return their number.

    Of the rectangles that fill a cell the nearest one, the front, hides all that are behind it at
    all four corners. Between the corners 1 / t of two planes differs linearly, but for the bend.

    :param pairs: pairs of a cell and a rectangle, which are written.
    :param slots: candidates, by rectangle.
    :param hiding: (cells,) memory, which is overwritten, as is ``front`` (cells,).
    :param bent: share of a cell that the image of a straight line bends within it at most.
    :param apart: share of 1 / t by which a surface is at least nearer than what it hides.
    """
    hiding[:] = -_ONE
    front[:] = -1
    pairs.first[:] = 0
    for j in range(len(slots)):
        cell = slots[j].cell
        hiding[cell] = max(hiding[cell], slots[j].hiding)
    for j in range(len(slots)):
        cell = slots[j].cell
        if slots[j].hiding > _ZERO and slots[j].hiding == hiding[cell]:
            front[cell] = j
    for j in range(len(slots)):
        cell = slots[j].cell
        visible = slots[j].nearest > hiding[cell]
        if visible and front[cell] >= 0:
            front_corners, corners = slots[front[cell]].corners, slots[j].corners
            low, high = _range(
                front_corners[0] - corners[0],
                front_corners[1] - corners[1],
                front_corners[2] - corners[2],
                front_corners[3] - corners[3],
            )
            _, nearest = _range(
                front_corners[0], front_corners[1], front_corners[2], front_corners[3]
            )
            visible = not low - bent * (high - low) > apart * nearest
        if visible:
            pairs.first[cell + 1] += 1
        else:
            slots[j].cell = -1
    for cell in range(len(front)):
        pairs.first[cell + 1] += pairs.first[cell]
        front[cell] = pairs.first[cell + 1]
    # A counting sort; from the last one on, so that those of a cell keep their order.
    for j in range(len(slots) - 1, -1, -1):
        cell = slots[j].cell
        if cell >= 0:
            front[cell] -= 1
            slot = front[cell]
            pairs.cell[slot], pairs.which[slot] = cell, slots[j].which
            pairs.fills[slot] = slots[j].hiding > _ZERO
    return pairs.first[-1]


@numba_function
def paint(
    picture: Bytes,
    rays: Single,
    origin: tuple[int, int],
    visible: Visible,
    atlas: Bytes,
    areas: bool,
    space: tuple[Integers, Single],
) -> None:
    """Draw the view of the rays (3, h, w) of a band into a picture (h, w, colours).

    :param origin: row of its first rays in the whole image, and the whole image's last row.
    :param visible: rectangles, and those of them that may be seen in each cell, with their
        textures, shadows and gloss.
    :param atlas: (height, width, colours) textures.
    :param areas: True: pixels see what is in their areas; False: what is at their centres.
    :param space: memory for this call alone, of :func:`space`.
    """
    height, width, colours = picture.shape
    vectors, start = visible.planes
    _, starts, which, fills = visible.pairs
    patches, shades, gloss = visible.patches, visible.shades, visible.gloss
    value, sample, total = space[0][0, :colours], space[0][1, :colours], space[0][2, :colours]
    pair_at, front, added = space[0][3], space[1][0], space[1][1, :colours]
    for row in range(height):
        k = min(origin[0] + row, origin[1]) if start.shape[1] > 1 else 0
        for column in range(width):
            cell = _cell(origin[0] + row, column, width)
            begin, end = starts[cell], starts[cell + 1]
            ray = (rays[0, row, column], rays[1, row, column], rays[2, row, column])
            inverse, hit, s, r = nearest_hit(vectors, start, which, fills, begin, end, k, ray)
            if hit < 0:
                value[:] = BACKGROUND
            else:
                look_up(value, atlas, patches[hit], s, r, patches[hit].doublings)
                _shade(value, shades, cell, k, ray, inverse)
                _polish(value, added, gloss, vectors, start, which[hit], hit, k, s, r)
            if (
                not areas
                or (end - begin == 1 and fills[begin])
                or not _is_at_edge(vectors, start, which, patches, begin, end, k, ray, inverse, hit)
            ):
                for c in range(colours):
                    picture[row, column, c] = value[c]
                continue
            # The mean of eight points of the pixel; each pair that is seen is looked up once.
            pair_at[:] = -1
            front[:] = _ZERO
            for p in range(begin, end):
                _see_at_points(pair_at, front, vectors, start, which[p], patches[p], p, k, ray)
            total[:] = len(POINTS) // 2
            for point in range(len(POINTS)):
                p = pair_at[point]
                count = _count(pair_at, point, p)
                if p == hit:
                    _add(total, value, 1)
                elif p < 0:
                    sample[:] = BACKGROUND
                    _add(total, sample, 1)
                elif count > 0:
                    inverse, s, r = _meet(vectors, start, which[p], k, ray)
                    s, r = min(max(s, _ZERO), _ONE), min(max(r, _ZERO), _ONE)
                    look_up(sample, atlas, patches[p], s, r, _OF_PARTS)
                    _shade(sample, shades, cell, k, ray, inverse)
                    _polish(sample, added, gloss, vectors, start, which[p], p, k, s, r)
                    _add(total, sample, count)
            for c in range(colours):
                picture[row, column, c] = total[c] // len(POINTS)


@part
def _count(pair_at: Integers, point: int, p: int) -> int:
    """Return how many points see a pair; 0: one before this has counted them."""
    count = 0
    for j in range(len(pair_at)):
        if pair_at[j] == p:
            if j < point:
                return 0
            count += 1
    return count


@part
def _add(total: Integers, value: Integers, count: int) -> None:
    """Add ``count`` times a colour to a sum of colours."""
    for c in range(len(total)):
        total[c] += value[c] * count


@numba_function
def measure(
    depth: Single,
    body: Bytes,
    rays: Single,
    origin: tuple[int, int],
    planes: Planes,
    pairs: Pairs,
    bodies: Bytes,
) -> None:
    """Write depth (h, w) [m] and number of the body (h, w) that rays hit; 0: nothing.

    :param rays: (3, h, w) directions in the camera's frame.
    :param origin: as of :func:`paint`.
    :param planes: m rectangles in the camera's frame, for each row of the image or for all.
    :param pairs: the rectangles in each cell of the image.
    :param bodies: (m,) number of the body of each rectangle; 0: it does not move.
    """
    height, width = depth.shape
    vectors, start = planes
    _, starts, which, fills = pairs
    for row in range(height):
        k = min(origin[0] + row, origin[1]) if start.shape[1] > 1 else 0
        for column in range(width):
            cell = _cell(origin[0] + row, column, width)
            begin, end = starts[cell], starts[cell + 1]
            ray = (rays[0, row, column], rays[1, row, column], rays[2, row, column])
            inverse, hit, _, _ = nearest_hit(vectors, start, which, fills, begin, end, k, ray)
            depth[row, column] = ray[2] / inverse if hit >= 0 else _ZERO
            body[row, column] = bodies[which[hit]] if hit >= 0 else 0


@part
def _cell(row: int, column: int, width: int) -> int:
    """Return the number of the cell that a pixel lies in."""
    return row // CELL * ((width + CELL - 1) // CELL) + column // CELL


@part
def nearest_hit(
    vectors: Single,
    start: Single,
    which: Integers,
    fills: Mask,
    begin: int,
    end: int,
    k: int,
    ray: Ray,
) -> tuple[np.float32, int, np.float32, np.float32]:
    """Return 1 / t of the nearest rectangle that a ray meets, its pair (-1: none), s and r.

    The first one of rectangles at the same distance.

    :param which: (p,) rectangles of the pairs; ``fills``: True if they fill their cells.
    :param begin: first pair of the ray's cell; ``end``: that after its last.
    :param k: number of the planes' pose.
    """
    inverse, hit, s, r = _ZERO, -1, _ZERO, _ZERO
    filled = end - begin == 1 and fills[begin]
    for p in range(begin, end):
        m = which[p]
        if _dot(vectors, m, k, 0, ray) > inverse:
            n, across, up = _meet(vectors, start, m, k, ray)
            in_rectangle = across >= _ZERO and across <= _ONE and up >= _ZERO and up <= _ONE
            if n > _ZERO and (in_rectangle or filled):
                inverse, hit, s, r = n, p, across, up
    return inverse, hit, s, r


@part
def _dot(vectors: Single, m: int, k: int, j: int, ray: Ray) -> np.float32:
    """Return the scalar product of a ray with vector j (0: normal, 1 and 2: sides) of a table.

    :param m: number of the rectangle.
    :param k: number of the pose.
    """
    x, y, z = ray
    return vectors[m, k, j, 0] * x + vectors[m, k, j, 1] * y + vectors[m, k, j, 2] * z


@part
def _meet(
    vectors: Single, start: Single, m: int, k: int, ray: Ray
) -> tuple[np.float32, np.float32, np.float32]:
    """Return 1 / t, s and r where a ray meets a plane; 0, 0, 0: the plane is not in front.

    The ray meets it at ``t`` times its direction, at the share s of the rectangle's first side and
    r of its second one, from its corner.

    :param vectors, start: tables of :class:`~imu_sim_ros.sensors.camera.images.planes.Planes`.
    :param m: number of the rectangle.
    :param k: number of the pose, of a row with a rolling shutter.
    """
    n = _dot(vectors, m, k, 0, ray)
    if n <= IN_FRONT:
        return _ZERO, _ZERO, _ZERO
    t = _ONE / n
    s = _dot(vectors, m, k, 1, ray) * t + start[m, k, 0]
    r = _dot(vectors, m, k, 2, ray) * t + start[m, k, 1]
    return n, s, r


@part
def _inside(patch: Any, n: np.float32, s: np.float32, r: np.float32) -> np.float32:
    """Return how far inside a rectangle a point on its plane is, in halves of a pixel about."""
    across, up = min(_ONE - s, s) * patch.inside[0], min(_ONE - r, r) * patch.inside[1]
    return min(across, up) * n


@part
def _is_at_edge(
    vectors: Single,
    start: Single,
    which: Integers,
    patches: NDArray[np.void],
    begin: int,
    end: int,
    k: int,
    ray: Ray,
    inverse: np.float32,
    hit: int,
) -> bool:
    """Return whether a pixel may show more than its centre does.

    :param which: numbers of the rectangles of all pairs.
    :param patches: texture mappings of all pairs.
    :param begin, end: the pairs of the pixel's cell.
    :param k: number of the pose.
    :param ray: direction through the centre.
    :param inverse: 1 / t at which the centre meets a rectangle.
    :param hit: the pair that the centre meets; below 0: none.
    """
    threshold = inverse - patches[hit].depth if hit >= 0 else _ZERO
    for p in range(begin, end):
        patch = patches[p]
        if _dot(vectors, which[p], k, 0, ray) + patch.depth >= threshold:
            n, s, r = _meet(vectors, start, which[p], k, ray)
            overlap = _inside(patch, n, s, r)
            if n > _ZERO and overlap > -_ONE and (overlap < _ONE or p != hit):
                return True
    return False


@part
def _see_at_points(
    pair_at: Integers,
    front: Single,
    vectors: Single,
    start: Single,
    m: int,
    patch: Any,
    p: int,
    k: int,
    ray: Ray,
) -> None:
    """Write the number of a pair at those points (8,) of a pixel at which it is nearest so far.

    :param pair_at: (8,) numbers of the nearest pairs, which are changed.
    :param front: (8,) 1 / t of the nearest pairs, which are changed.
    :param patch: the pair's steps of 1 / t, s / t and r / t to the neighbouring pixels.
    """
    n, s, r = _meet(vectors, start, m, k, ray)
    if n > _ZERO and _inside(patch, n, s, r) > -_ONE:
        s *= n
        r *= n
        steps = patch.steps
        for point in range(len(POINTS)):
            x, y = POINTS[point, 0], POINTS[point, 1]
            away = n + (x * steps[0, 0] + y * steps[1, 0])
            across = s + (x * steps[0, 1] + y * steps[1, 1])
            up = r + (x * steps[0, 2] + y * steps[1, 2])
            in_rectangle = across >= _ZERO and across <= away and up >= _ZERO and up <= away
            if in_rectangle and away > front[point]:
                front[point], pair_at[point] = away, p


@part
def look_up(
    value: Integers, atlas: Bytes, patch: Any, s: np.float32, r: np.float32, doublings: int
) -> None:
    """Write the mean (colours,) of 1, 2, 4, ... points along a pixel's footprint on a texture."""
    count = 1 << doublings
    value[:] = count >> 1
    for j in range(count):
        step = _step_along(j, count)
        x, y = _texel(patch, 0, s, r, step)
        for c in range(len(value)):
            texel = bilinear(atlas, x, y, c)
            if patch.share > 0:
                coarse_x, coarse_y = _texel(patch, 1, s, r, step)
                texel = mix_levels(texel, bilinear(atlas, coarse_x, coarse_y, c), patch.share)
            value[c] += texel
    for c in range(len(value)):
        value[c] >>= doublings


@part
def _step_along(j: int, count: int) -> np.float32:
    """Return where on a footprint the j-th of some points is, from its middle, in its length."""
    return (np.float32(j) + _HALF) / np.float32(count) - _HALF


@part
def _texel(
    patch: Any, level: int, s: np.float32, r: np.float32, step: np.float32
) -> tuple[int, int]:
    """Return column and row in the atlas [1/32 texel] of a point along a footprint.

    :param step: from its middle, in its length. No look leaves the rectangle.
    """
    width, margin = patch.scale[level, 0], patch.offset[level, 0]
    x = step * (patch.along[0] * width) + (s * width + margin)
    height, top = patch.scale[level, 1], patch.offset[level, 1]
    y = step * (patch.along[1] * height) + (r * height + top)
    return round_to_steps(min(max(x, margin), margin + width)), round_to_steps(
        min(max(y, top), top + height)
    )


@part
def round_to_steps(position: np.float32) -> int:
    """Return the nearest steps of 1/32 texel, of two the even one."""
    return np.int64(np.rint(position * _STEPS))


@part
def bilinear(atlas: Bytes, x: int, y: int, colour: int) -> int:
    """Return a value between four texels, in integers, at a point in 1/32 texel."""
    column, row, weight, down = x >> 5, y >> 5, x & 31, y & 31
    column = min(max(column, 0), atlas.shape[1] - 1)
    row = min(max(row, 0), atlas.shape[0] - 1)
    next_column = min(column + 1, atlas.shape[1] - 1)
    next_row = min(row + 1, atlas.shape[0] - 1)
    upper = (32 - weight) * np.int64(atlas[row, column, colour])
    upper += weight * np.int64(atlas[row, next_column, colour])
    lower = (32 - weight) * np.int64(atlas[next_row, column, colour])
    lower += weight * np.int64(atlas[next_row, next_column, colour])
    return ((32 - down) * upper + down * lower + 512) >> 10


@part
def mix_levels(fine: int, coarse: int, share: int) -> int:
    """Return a value of two levels."""
    return (fine * (SHARES - share) + coarse * share + SHARES // 2) // SHARES


@part
def _shade(
    value: Integers, shades: Shades, cell: int, k: int, ray: Ray, inverse: np.float32
) -> None:
    """Darken a value (colours,) that a ray sees at 1 / t by the shadows of its cell."""
    vectors, start = shades.planes
    for j in range(shades.first[cell], shades.first[cell + 1]):
        m = shades.which[j]
        away, s, r = _meet(vectors, start, m, k, ray)
        offset = _height(vectors, m, k) * (_ONE - away / inverse)
        in_rectangle = s >= _ZERO and s <= _ONE and r >= _ZERO and r <= _ONE
        if away > _ZERO and in_rectangle and abs(offset) < _ON_FLOOR:
            light = light_share(s, r, shades.lines[m, 0], shades.lines[m, 1], shades.lines[m, 2])
            if light < _ONE:
                for c in range(len(value)):
                    value[c] = _adjust_contrast(value[c], light, _ZERO)


@part
def light_share(
    s: np.float32, r: np.float32, length: np.float32, radius: np.float32, depth: np.float32
) -> np.float32:
    """Return the share of the light that is left at a point of the floor in a shadow.

    ``1 - depth (1 - (d / radius)^2)^2`` at a distance d from a line, which lies in the middle of a
    rectangle of the floor, a radius from its sides.

    :param s: the point's coordinate in the rectangle along the line, from 0 to 1; ``r`` across it.
    :param length: length of the line [m]; ``radius`` reach of the shadow around it [m].
    :param depth: share of the light that is missing on the line.
    """
    along = s * (length + _TWO * radius) - radius
    along -= min(max(along, _ZERO), length)
    across = (_TWO * r - _ONE) * radius
    rest = _ONE - min((along * along + across * across) / (radius * radius), _ONE)
    return _ONE - depth * rest * rest


@part
def _adjust_contrast(value: int, keep: np.float32, add: np.float32) -> int:
    """Return the root of ``keep value^2 + add``.

    A square instead of the power 2.2 of a screen, since a root is exact everywhere.
    """
    square = np.float32(value)
    square = square * square * keep + add
    return np.int64(min(np.sqrt(square) + _HALF, _WHITE))


@part
def _height(vectors: Single, m: int, k: int) -> np.float32:
    """Return the height of the eye above a plane [m]."""
    x, y, z = vectors[m, k, 0, 0], vectors[m, k, 0, 1], vectors[m, k, 0, 2]
    return _ONE / np.sqrt(x * x + y * y + z * z)


@part
def _polish(
    value: Integers,
    added: Single,
    gloss: Glossy,
    vectors: Single,
    start: Single,
    m: int,
    p: int,
    k: int,
    s: np.float32,
    r: np.float32,
) -> None:
    """Change a value (colours,) by the gloss of the region in which a point of a pair lies.

    Of several regions the last one counts: what lies on another comes after it.

    :param added: (colours,) memory, which is overwritten.
    """
    for j in range(gloss.first[p + 1] - 1, gloss.first[p] - 1, -1):
        region = gloss.sheen.regions[gloss.region[j]]
        low, high = region.bounds[:2], region.bounds[2:]
        if s >= low[0] and r >= low[1] and s <= high[0] and r <= high[1]:
            foot, height = (start[m, k, 0], start[m, k, 1]), _height(vectors, m, k)
            keep = shine(added, gloss.sheen, gloss.region[j], gloss.lit[j], (s, r), foot, height)
            for c in range(len(value)):
                value[c] = _adjust_contrast(value[c], keep, added[c])
            break


_reflectance: Final = part(reflectance)
_limit_highlight: Final = part(limit_highlight)


@part
def shine(
    added: Single,
    sheen: Sheen,
    m: int,
    lit: Mask,
    point: tuple[np.float32, np.float32],
    foot: tuple[np.float32, np.float32],
    height: np.float32,
) -> np.float32:
    """Write the light that a glossy point mirrors; return the share of its own light that stays.

    Squares of grey values are proportional to light. The formulas are those of
    :mod:`~imu_sim_ros.places.gloss`: first the surroundings, between floor, horizon and zenith,
    then the highlights of lamps and sun.

    :param added: (colours,) mirrored light, which is written.
    :param m: number of the glossy region.
    :param lit: (sources,) True if the source's highlight may be there.
    :param point: s and r of the point on its rectangle.
    :param foot: s and r of the eye's foot on the plane; ``height`` of the eye above it [m].
    """
    region = sheen.regions[m]
    face = sheen.faces[region.face]
    across, up = (point[0] - foot[0]) * face.sides[0], (point[1] - foot[1]) * face.sides[1]
    away = np.sqrt(across * across + up * up + height * height)
    specular = _reflectance(height / away, region.normal)
    share = max(specular - region.base, _ZERO) * region.smooth
    z = across * face.upwards[0] + up * face.upwards[1] + height * face.upwards[2]
    z /= away
    rise, fall = max(z, _ZERO), max(-z, _ZERO)
    for c in range(len(added)):
        down, level, zenith = sheen.mirrored[0, c], sheen.mirrored[1, c], sheen.mirrored[2, c]
        added[c] = (level + rise * (zenith - level) + fall * (down - level)) * share
    for j in range(len(lit)):
        if lit[j]:
            source, sight = sheen.sources[j], sheen.sights[region.face, j]
            is_lamp = source.near
            x = sight.place[0] - is_lamp * face.sides[0] * point[0]
            y = sight.place[1] - is_lamp * face.sides[1] * point[1]
            to = (x, y, sight.place[2])
            distance = np.sqrt(to[0] * to[0] + to[1] * to[1] + to[2] * to[2])
            ray = (across, up, height)
            if is_lamp > _ZERO:
                light = _lamp_share(source, sight, ray, away, to, region.blur)
            else:
                floor = sheen.floor[m, j]
                light = _sun_share(ray, away, to, distance, region.doublings, floor)
            if light > _ZERO:
                power = light_at(sheen.light, face, j, point[0], point[1]) * region.gain
                power /= max(height / away, to[2] / max(distance, _NARROWEST))
                bright = _limit_highlight(power, is_lamp) * light * specular
                for c in range(len(added)):
                    added[c] += source.colour[c] * bright
    return _ONE - share


@part
def _lamp_share(
    source: Any,
    sight: Any,
    ray: Ray,
    away: np.float32,
    to: Ray,
    blur: np.float32,
) -> np.float32:
    """Return the brightness of a lamp's highlight at a point, over that at its middle, 0 to 1.

    The mirrored ray meets the plane of the lamp; along each of its two sides the highlight is the
    lamp's extent, blurred by the lobe of the surface.

    :param source: the lamp, with the ``halves`` of its sides [m].
    :param sight: position and axes of the lamp as the face sees it: along its sides, and normal.
    :param ray: vector from the eye to the point [m], mirrored: across, up and normal to the face.
    :param away: length of the ray [m].
    :param to: vector from the point to the middle of the lamp, in the same axes [m].
    :param blur: half-width of the lobe's smooth step [rad].
    """
    steepness, height = _project(sight.axes[2], ray), _project(sight.axes[2], to)
    if not height * steepness > _ZERO:
        return _ZERO  # it never meets the lamp's plane
    scale = height / steepness
    wide = scale * away * blur
    share = _ONE
    for k in range(2):
        half = source.halves[k]
        side = _project(sight.axes[k], ray)
        offset = scale * side - _project(sight.axes[k], to)
        slant = side / steepness
        slant = min(np.sqrt(slant * slant + _ONE), _SLANT)
        width = _ONE / max(wide * slant, _NARROWEST)
        share *= _step((half - offset) * width) + _step((half + offset) * width)
        share /= _TWO * _step(half * width)
    return share


@part
def _project(axis: Single, vector: Ray) -> np.float32:
    """Return the component of a vector along an axis."""
    return axis[0] * vector[0] + axis[1] * vector[1] + axis[2] * vector[2]


@part
def _step(x: np.float32) -> np.float32:
    """Return a smooth step from -1/2 to 1/2 between -1 and 1, whose slope has the variance 1/5."""
    x = min(max(x, -_ONE), _ONE)
    return x * (_THREE_QUARTERS - _QUARTER * x * x)


@part
def _sun_share(
    ray: Ray,
    away: np.float32,
    to: Ray,
    distance: np.float32,
    doublings: int,
    floor: np.float32,
) -> np.float32:
    """Return the share of a highlight's middle that the sun has.

    :param ray: ray on the mirrored side, of the length ``away``; ``to`` direction of the sun, of
        the length ``distance``, in the same axes.
    :param doublings: logarithm to base 2 of the exponent of the lobe.
    :param floor: share of the lobe's peak that is subtracted, below which nothing is visible.
    """
    cosine = ray[0] * to[0] + ray[1] * to[1] + ray[2] * to[2]
    power = max(cosine / (away * distance), _ZERO)
    for _ in range(doublings):
        power *= power
    return max(power - floor, _ZERO)


@part
def light_at(light: Single, face: Any, source: int, s: np.float32, r: np.float32) -> np.float32:
    """Return the light of a source at a point of a face, interpolated between its points."""
    rows, columns = face.shape[0], face.shape[1]
    low, down = _grid_position(r, rows)
    column, across = _grid_position(s, columns)
    high, next_column = min(low + 1, rows - 1), min(column + 1, columns - 1)
    offset = face.first + source * rows * columns
    value = _ZERO
    for row, share in ((low, _ONE - down), (high, down)):
        line = light[offset + row * columns + column] * (_ONE - across)
        line += light[offset + row * columns + next_column] * across
        value += share * line
    return value


@part
def _grid_position(share: np.float32, count: int) -> tuple[int, np.float32]:
    """Return the part before a share from 0 to 1 among even parts, and how far the next one is."""
    position = min(max(share * np.float32(count) - _HALF, _ZERO), np.float32(count - 1))
    whole = np.int64(position)
    return whole, position - np.float32(whole)


@numba_function
def paint_mesh(
    values: Bytes,
    hits: MeshHits,
    pitch: Single,
    triangles: Triangles,
    textures: tuple[Bytes, Single, Single],
    modes: tuple[bool, bool],
    space: tuple[Integers, Single],
) -> None:
    """Draw the view of n rays on a mesh into values (n, colours).

    :param hits: triangle, point and distance that each ray meets.
    :param pitch: (n,) angles between neighbouring rays [rad].
    :param triangles: colours and textures of the triangles.
    :param textures: image, sizes and corners of the textures, as those of
        :class:`~.texture.Atlas`.
    :param modes: True to look at two mip levels; True to see what is in the pixels' areas.
    :param space: memory for this call alone, of :func:`space`.
    """
    image, size, corner = textures
    texel = space[0][0, : image.shape[2]]
    uv, along = space[1][0, :2], space[1][1, :2]
    textured, tinted = len(triangles.uv) > 0, len(triangles.tints) > 0
    shaded = len(triangles.shades) > 0
    for n in range(len(values)):
        if hits.nothing[n]:
            values[n, :] = BACKGROUND
            continue
        m = hits.number[n]
        if textured:
            texture = triangles.texture[m]
            for k in range(2):
                uv[k] = _interpolate_triangle(triangles.uv, k, m, hits.point, n)
            square, length = _footprint(along, hits, n, pitch[n], triangles, size[texture], modes)
            level, share = _level(square, modes)
            doublings = 0
            for threshold in LOOKS:
                doublings += length * _level_scale(level) > threshold
            _repeat(texel, image, size[texture], corner[texture], uv, along, doublings,
                    level, share)  # fmt: skip
        for c in range(len(texel)):
            if not tinted and not shaded:
                values[n, c] = texel[c]
                continue
            value = (
                _interpolate_triangle(triangles.tints, c, m, hits.point, n) if tinted else _WHITE
            )
            if textured:
                value *= np.float32(texel[c])
                value *= _ONE_OF_WHITE
            if shaded:
                value *= triangles.shades[1 if hits.along[n] > 0.0 else 0, m]
            values[n, c] = np.uint8(min(max(value + _HALF, _ZERO), _WHITE))


@part
def _interpolate_triangle(
    coefficients: Single, k: int, m: int, point: Single, n: int
) -> np.float32:
    """Return the value of linear function number k on triangle m at the point that ray n meets.

    :param coefficients: (4 functions, triangles) slopes along x, y and z of each, then a constant.
    """
    value = coefficients[4 * k + 3, m]
    for j in range(3):
        value += coefficients[4 * k + j, m] * point[j, n]
    return value


@part
def _footprint(
    along: Single,
    hits: MeshHits,
    n: int,
    pitch: np.float32,
    triangles: Triangles,
    size: Single,
    modes: tuple[bool, bool],
) -> tuple[np.float32, np.float32]:
    """Return the size that determines the level of a texture, and the footprint's length [texels].

    The size is the square of the texels along which the pixel extends at most, ``(density pitch t /
    cos)^2`` with the cosine between the ray and the triangle's normal; for areas that of its width,
    ``(density pitch t)^2``, or of an eighth of its length. The axis in u and v, put into ``along``,
    is the ray's projection onto the triangle.
    """
    m, width = hits.number[n], hits.distance[n] * pitch
    cosine = max(abs(hits.along[n]), _GRAZING)
    density = triangles.density[m]
    if not modes[1]:
        along[:] = _ZERO
        width /= cosine
        return np.float32(width * width * density), _ZERO
    sine = math.sqrt(max(1.0 - cosine * cosine, _GRAZING))
    factor = np.float32(width / (cosine * sine))
    square = _ZERO
    for k in range(2):
        slope = _ZERO
        for j in range(3):
            slope += triangles.uv[4 * k + j, m] * hits.way[n, j]
        along[k] = slope * factor
        texels = along[k] * size[k]
        square += texels * texels
    return max(np.float32(width * width * density), square / _MOST_SQUARED), np.sqrt(square)


@part
def _level(square: np.float32, modes: tuple[bool, bool]) -> tuple[int, int]:
    """Return the nearest level of a footprint, or of two the finer, and the share of the coarser.

    As with rectangles: steps between levels are sqrt(2) times 1, 2, 4, ..., of two, and for areas,
    1, 2, 4, ...
    """
    trilinear, areas = modes
    exponent = math.frexp(max(square, _NARROWEST))[1] - 1
    if not trilinear:
        return min(max((exponent + (0 if areas else 1)) >> 1, 0), LEVELS - 1), 0
    level = min(max(exponent >> 1, 0), LEVELS - 2)
    excess = np.sqrt(square) * _level_scale(level) - _ONE
    return level, np.int64(np.rint(min(max(excess, _ZERO), _ONE) * np.float32(SHARES)))


@part
def _level_scale(level: int) -> np.float32:
    """Return 1 / 2^level, the size of an image of a pyramid over the full one."""
    return _ONE / np.float32(1 << level)


@part
def _repeat(
    value: Integers,
    image: Bytes,
    size: Single,
    corner: Single,
    uv: Single,
    along: Single,
    doublings: int,
    level: int,
    share: int,
) -> None:
    """Write the mean (colours,) of 1, 2, 4, ... points along a footprint on a repeating texture.

    :param value: (colours,) mean, which is written.
    :param image: atlas of textures.
    :param size: (2,) columns and rows of the texture.
    :param corner: (LEVELS, 2) column and row of each level of the texture in the atlas.
    :param uv: (2,) middle of the footprint; ``along`` (2,) its long axis, in the same coordinates.
    :param doublings: logarithm to base 2 of the number of points.
    :param level: mip level; ``share`` of the next coarser one, in steps.
    """
    count = 1 << doublings
    value[:] = count >> 1
    for j in range(count):
        step = _step_along(j, count)
        s, r = uv[0] + step * along[0], uv[1] + step * along[1]
        s, r = s - np.floor(s), r - np.floor(r)
        x, y = _wrap_texel(s, size, corner, 0, level), _wrap_texel(r, size, corner, 1, level)
        for c in range(len(value)):
            texel = bilinear(image, x, y, c)
            if share > 0:
                coarse_x = _wrap_texel(s, size, corner, 0, level + 1)
                coarse_y = _wrap_texel(r, size, corner, 1, level + 1)
                texel = mix_levels(texel, bilinear(image, coarse_x, coarse_y, c), share)
            value[c] += texel
    for c in range(len(value)):
        value[c] >>= doublings


@part
def _wrap_texel(share: np.float32, size: Single, corner: Single, axis: int, level: int) -> int:
    """Return the texel at a place of a texture that repeats."""
    return round_to_steps(size[axis] * share * _level_scale(level) + (corner[level, axis] - _HALF))
