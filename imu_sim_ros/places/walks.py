# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""The courses of bodies in a place: from stop to stop along its free floor, and back.

All courses of a scene have one period, so that bodies which do not meet within it never do. They
keep off the cameras: of a path that ends, at the times at which it is there; of one without an end,
always.
"""

import math
from collections.abc import Sequence
from typing import Final, NamedTuple

import numpy as np

from imu_sim_ros.core.errors import ConfigurationError
from imu_sim_ros.core.random_streams import generator_at
from imu_sim_ros.core.types import Array, Integers, Mask
from imu_sim_ros.places.bodies import HEIGHT, RADIUS, STEP, Course, MovingBody, faces
from imu_sim_ros.places.geometry import Surfaces
from imu_sim_ros.places.place import CLEARANCE, Hinge, Place, Site
from imu_sim_ros.places.tour import graph

PERIOD: Final = 60.0
"""Period of all courses [s]."""
_KNOTS: Final = round(PERIOD / STEP)
_CELL: Final = 0.1
"""Edge of a cell of the floor, in large places twice as much [m]."""
_LARGE: Final = 200.0
"""Area of a large place [m^2]."""
_REACH: Final = 1.5
"""Distance beyond which things have no influence [m]."""
_ROOM: Final = 0.06
"""Margin of a planned way's distance from things [m]."""
_STOPS: Final = 24
"""Places at which a body may stop: half of them anywhere, half next to things."""
_BESIDE: Final = 0.15
"""Margin within which a place counts as next to things [m]."""
_SETS: Final = 4
"""Sets of stops that are tried, one after the other."""
_TRIES: Final = 3
"""Number of courses that are drawn from one stop."""
_SLACK: Final = 0.04
"""Margin of a planned course's distance from moving bodies [m]."""
_TURNING: Final = 4
"""Knots during which a body turns before it walks on."""
_PAUSE: Final = (4, 16)
"""Knots of a pause, at least and at most."""
_APART: Final = 0.1
"""Smallest distance between bodies [m]."""
_LOOKS: Final = 1200
"""Number of times in a period at which the distances of bodies are checked."""
_DOOR_TRIES: Final = 40
"""Largest number of courses of a door that are drawn until one is clear of the cameras."""
_ANGLES: Final = 12
"""Number of angles of a swinging door that are checked."""
_GAIT: Final = {"person": 1.0, "cart": 0.8}
"""Speed of each kind over that of people."""


class Passage(NamedTuple):
    """The cameras' path."""

    times: Array
    """(n,) times [s]."""
    places: Array
    """(k, n, 3) positions of each of k cameras [m]."""
    ends: bool
    """False if the path goes on after the last time."""
    foot: float
    """Lowest height of the body with the cameras [m]."""


class _Floor(NamedTuple):
    """Grid of square cells of the floor, with their distances from things."""

    places: Array
    """(n, 2) middles [m]."""
    free: Array
    """(n,) distance from the nearest thing [m]."""
    shape: tuple[int, int]
    """Number of cells along x and y; n is their product."""
    cell: float
    """Edge of a cell [m]."""

    def number(self, places: Array) -> Integers:
        """Return the cell of each of places (n, 2), which are on the floor."""
        i, j = np.floor((places - self.places[0]) / self.cell + 0.5).astype(np.int64).T
        i, j = (np.clip(k, 0, n - 1) for k, n in zip((i, j), self.shape, strict=True))
        return np.asarray(i * self.shape[1] + j)

    def at(self, places: Array) -> Array:
        """Return lower bounds (n,) of the distances of places (n, 2) from the nearest thing [m]."""
        return self.free[self.number(places)] - self.cell * math.sqrt(0.5)


def moving_bodies(
    place: Place, site: Site, counts: dict[str, int], speed: float, passage: Passage
) -> tuple[MovingBody, ...]:
    """Return the bodies of a place: doors, carts, then people.

    If no course is left among the stops of a set of walkers, other stops are drawn, a few times.

    :param counts: number of bodies of each kind.
    :param speed: speed of walking people [m/s].
    :param passage: path of the cameras, which bodies keep off.
    :raises ConfigurationError: if there is no room for so many.
    """
    bodies: list[MovingBody] = []
    for number, hinge in enumerate(place.hinges[: counts["door"]], start=1):
        course = _door(hinge, number, site, passage)
        look = faces("door", number, site, hinge)
        bodies.append(MovingBody(f"door_{number}", "door", look, course, hinge.foot[2]))
    if len(bodies) < counts["door"]:
        raise ConfigurationError(
            f"scene.bodies.doors = {counts['door']}: this place has {len(bodies)} doors that can "
            "move; an office and a corridor have some"
        )
    for kind in ("cart", "person"):
        walkers: list[_Walkers] = []
        for number in range(1, counts[kind] + 1):
            for k in range(_SETS):
                if k == len(walkers):
                    walkers.append(_Walkers(place, site, kind, speed, passage, k))
                way = walkers[k].course(number, bodies)
                if way is not None:
                    break
            if way is None:
                name = {"cart": "carts", "person": "people"}[kind]
                raise ConfigurationError(
                    f"scene.bodies.{name} = {counts[kind]}: only {number - 1} find a way that "
                    "keeps off things, each other and the cameras; fewer, another scene.seed, a "
                    "larger place or another scene.bodies.speed"
                )
            low = float(place.low[2])
            bodies.append(MovingBody(f"{kind}_{number}", kind, faces(kind, number, site), way, low))
    return tuple(bodies)


class _Walkers:
    """Planner of walking bodies of one kind on the floor of a place.

    Stops and times, a knot apart, are the nodes of a graph: from each a body may wait, or walk to
    another stop if nothing is in its way at those times. Back from the end of the period it is
    known which nodes lead home, so that a course is drawn that does.
    """

    def __init__(
        self,
        place: Place,
        site: Site,
        kind: str,
        speed: float,
        passage: Passage,
        number: int,
    ) -> None:
        """Initialise with a random set of stops.

        :param kind: ``cart`` or ``person``.
        :param speed: speed of walking people [m/s], of which a cart has a share.
        :param passage: path of the cameras.
        :param number: number of the set of stops, with which it is drawn.
        """
        from scipy.sparse.csgraph import dijkstra

        self._kind, self._site, self._passage = kind, site, passage
        self._radius, self._pace = RADIUS[kind], speed * _GAIT[kind]
        top = float(place.low[2]) + HEIGHT[kind]
        self._floor = _floor(place, top, passage if not passage.ends else None)
        self._near = passage.places[..., 2] < top + CLEARANCE
        stream = generator_at(site.seed, f"bodies.stops.{kind}", number)
        clearance = self._radius + _ROOM + self._floor.cell * math.sqrt(0.5)
        ways = graph(self._floor.free, self._floor.shape, clearance)
        self._stops = _stops(self._floor.free, clearance, ways, stream)
        if len(self._stops) < 2:
            return
        _, self._before = dijkstra(ways, indices=self._stops, return_predecessors=True)
        count = len(self._stops)
        self._legs = [[self._way(a, b) for b in range(count)] for a in range(count)]
        """Places (n, 2) a knot apart on the way from each stop to each other one [m]."""
        self._lengths = np.array([[len(leg) for leg in legs] for legs in self._legs])
        places = np.concatenate([leg for legs in self._legs for leg in legs])
        self._cells, index = np.unique(self._floor.number(places), return_inverse=True)
        ends = np.cumsum(self._lengths.ravel())[:-1]
        self._along = np.split(index.ravel(), ends)
        """Indices of the cells that each leg passes, knot by knot."""
        self._at = np.searchsorted(self._cells, self._stops)
        """Index of the cell of each stop."""
        self._clear = self._clear_of_cameras()
        """(knots, cells) True where a body is clear of the cameras and of the known bodies."""
        self._known = 0

    def _clear_of_cameras(self) -> Mask:
        """Return True for knots at which cells (knots, cells) are away from the cameras."""
        result = np.ones((_KNOTS, len(self._cells)), np.bool_)
        if not self._passage.ends:
            return result
        from scipy.spatial import cKDTree

        middles = self._floor.places[self._cells]
        reach = self._radius + CLEARANCE + _SLACK
        phase = np.tile(self._passage.times % PERIOD, len(self._near))[self._near.ravel()]
        positions_near = self._passage.places.reshape(-1, 3)[self._near.ravel()][:, :2]
        order = np.argsort(phase, kind="stable")
        phase, positions_near = phase[order], positions_near[order]
        for k in range(_KNOTS):
            # A knot moves a body for two steps before and after it.
            ends = ((k - 2) * STEP, (k + 2) * STEP)
            parts = [
                positions_near[slice(*np.searchsorted(phase, [end + shift for end in ends]))]
                for shift in (-PERIOD, 0.0, PERIOD)
            ]
            positions = np.unique(np.round(np.concatenate(parts), 2), axis=0)
            if len(positions):
                away, _ = cKDTree(positions).query(middles, distance_upper_bound=reach)
                result[k] = ~np.isfinite(away)
        return result

    def _keep_off(self, bodies: Sequence[MovingBody]) -> None:
        """Mark the knots at which cells are too close to other bodies."""
        middles = self._floor.places[self._cells]
        halves: Array = np.arange(2.0 * _KNOTS) * (0.5 * STEP)
        for body in bodies:
            if body.kind == "door":  # all that it sweeps is no floor
                continue
            reach = self._radius + RADIUS[body.kind] + _APART + _SLACK
            positions = body.course.at(halves)[:, :2]
            off = np.array([np.hypot(*(middles - place).T) > reach for place in positions])
            for shift in range(-4, 5):  # a knot moves a body for two steps before and after it
                self._clear &= np.roll(off, shift, axis=0)[::2]

    def course(self, number: int, bodies: Sequence[MovingBody]) -> Course | None:
        """Return a course that keeps its distance from other bodies; None: none was found.

        :param bodies: bodies of the last call, and behind them those that were added since.
        """
        if len(self._stops) < 2:
            return None
        stream = generator_at(self._site.seed, f"bodies.course.{self._kind}", number)
        self._keep_off(bodies[self._known :])
        self._known = len(bodies)
        go = self._possible_legs(self._clear)
        stay = self._clear[:, self._at]
        for home in stream.permutation(len(self._stops)).tolist():
            homewards = self._homewards(home, go, stay)
            for _ in range(_TRIES if homewards[0, home] else 0):
                course = self._draw_course(home, go, stay, homewards, stream)
                if course is not None and self._possible(course, bodies):
                    return course
        return None

    def _possible_legs(self, clear: Mask) -> Mask:
        """Return True for legs (stops, stops, knots) that may begin at a knot.

        :param clear: (knots, cells) True where a cell is far enough from other bodies.
        """
        count = len(self._stops)
        is_possible = np.zeros((count * count, _KNOTS), np.bool_)
        # (start, step): the knot at each step of a leg; a course repeats after the last knot.
        knots = (np.arange(_KNOTS)[:, None] + 1 + np.arange(_KNOTS // 2)) % _KNOTS
        for leg, cells in enumerate(self._along):
            if 0 < len(cells) <= _KNOTS // 2:
                is_possible[leg] = clear[knots[:, : len(cells)], cells].all(axis=1)
        return is_possible.reshape(count, count, _KNOTS)

    def _homewards(self, home: int, go: Mask, stay: Mask) -> Mask:
        """Return True for stops (knots + 2, stops) from which a body can be home in time.

        The last row is False: a leg that ends there arrives too late.

        :param home: number of the stop at which the body must be at the last knot.
        :param go: (stops, stops, knots) True for legs that may begin at a knot.
        :param stay: (knots, stops) True where a body may stand.
        """
        count = len(self._stops)
        can_return = np.zeros((_KNOTS + 2, count), np.bool_)
        can_return[_KNOTS, home] = stay[0, home]
        stops = np.arange(count)
        for k in range(_KNOTS - 1, -1, -1):
            arrival = np.minimum(k + self._lengths, _KNOTS + 1)
            by_leg = (go[:, :, k] & can_return[arrival, stops[None, :]]).any(axis=1)
            can_return[k] = by_leg | (stay[(k + 1) % _KNOTS] & can_return[k + 1])
        return can_return

    def _draw_course(
        self,
        home: int,
        go: Mask,
        stay: Mask,
        homewards: Mask,
        stream: np.random.Generator,
    ) -> Course | None:
        """Return a course from a stop to others and back; None: it would stand all the time.

        :param go: as returned by :meth:`_possible_legs`.
        :param stay: (knots, stops) True where the body may stand.
        :param homewards: as returned by :meth:`_homewards`.
        """
        stop, stops = home, np.arange(len(self._stops))
        line: list[Array] = []
        pause = int(stream.integers(*_PAUSE))
        while len(line) < _KNOTS:
            k = len(line)
            arrival = np.minimum(k + self._lengths[stop], _KNOTS + 1)
            options = np.flatnonzero(go[stop, :, k] & homewards[arrival, stops])
            waits = stay[(k + 1) % _KNOTS, stop] and homewards[k + 1, stop]
            if waits and (pause > 0 or not len(options)):
                line.append(self._floor.places[self._stops[stop]])
                pause -= 1
                continue
            following = int(options[stream.integers(len(options))])
            line += list(self._legs[stop][following])
            stop, pause = following, int(stream.integers(*_PAUSE))
        places = np.roll(np.array(line), 1, axis=0)  # the last knot is the first one's place
        if not np.ptp(places, axis=0).any():
            return None
        headings, turns = _headings(places)
        controls = np.asarray(np.round(np.column_stack([places, headings]), 6), np.float64)
        return Course(controls, turns)

    def _way(self, start: int, end: int) -> Array:
        """Return places (n, 2) a knot apart on the way between two stops, without the first."""
        cells = [int(self._stops[end])]  # of the floor, from the end back to the start
        while cells[-1] != self._stops[start]:
            cells.append(int(self._before[start][cells[-1]]))
        line = self._floor.places[cells[::-1]]
        if len(line) < 2:
            return np.zeros((0, 2))
        padded = np.concatenate([line[[0, 0]], line, line[[-1, -1]]])
        smooth = np.stack([np.convolve(padded[:, k], np.full(5, 0.2), "valid") for k in (0, 1)], 1)
        smooth[0], smooth[-1] = line[0], line[-1]
        lengths = np.concatenate([[0.0], np.cumsum(np.hypot(*np.diff(smooth, axis=0).T))])
        count = max(1, math.ceil(float(lengths[-1]) / (self._pace * STEP)))
        arc_lengths = np.linspace(0.0, lengths[-1], count + 1)[1:]
        return np.stack([np.interp(arc_lengths, lengths, smooth[:, k]) for k in (0, 1)], axis=1)

    def _possible(self, course: Course, bodies: Sequence[MovingBody]) -> bool:
        """Return True if a course keeps clear of walls and of other bodies."""
        t: Array = np.arange(_LOOKS, dtype=np.float64) * (PERIOD / _LOOKS)
        place = course.at(t)[:, :2]
        if (self._floor.at(place) < self._radius).any():
            return False
        for body in bodies:
            if (_body_distances(body, t, place) < self._radius + _APART).any():
                return False
        return not self._passage.ends or self._off_the_cameras(course)

    def _off_the_cameras(self, course: Course) -> bool:
        """Return True if a course keeps away from the cameras."""
        positions = course.at(self._passage.times)[:, :2]
        for close, places in zip(self._near, self._passage.places, strict=True):
            away = np.hypot(*(places[:, :2] - positions).T)
            moved = np.hypot(*np.diff(places[:, :2], axis=0, append=places[-1:, :2]).T)
            if (close & (away - moved < self._radius + CLEARANCE)).any():
                return False
        return True


def _body_distances(body: MovingBody, t: Array, places: Array) -> Array:
    """Return distances (n,) of places (n, 2) from a body at times t (n,), or less [m]."""
    pose = body.course.at(t)
    offset = places - pose[:, :2]
    if body.kind != "door":
        return np.asarray(np.hypot(*offset.T) - RADIUS[body.kind])
    return _leaf_distances(offset, pose[:, 2], float(body.surfaces().sides.max(axis=0)[0]))


def _leaf_distances(offset: Array, heading: Array, width: float) -> Array:
    """Return the distances (n,) of points from the leaf of a door [m].

    :param offset: (n, 2) points relative to the hinge [m].
    :param heading: (n,) directions of the leaf [rad].
    """
    ahead = np.column_stack([np.cos(heading), np.sin(heading)])
    along = np.clip((offset * ahead).sum(axis=1), 0.0, width)
    return np.asarray(np.hypot(*(offset - along[:, None] * ahead).T) - 0.03)


def _stops(free: Array, clearance: float, ways: object, stream: np.random.Generator) -> Integers:
    """Return random cells of the largest part of the floor whose cells are all connected."""
    from scipy.sparse.csgraph import connected_components

    _, part = connected_components(ways, directed=False)
    open_cells = free > clearance
    sizes = np.bincount(part[open_cells], minlength=1)
    cells = np.flatnonzero(open_cells & (part == int(np.argmax(sizes))))
    if not len(cells):
        return cells
    edge = cells[free[cells] < clearance + _BESIDE]
    some = [
        candidates[stream.integers(0, len(candidates), _STOPS // 2)]
        for candidates in (cells, edge)
        if len(candidates)
    ]
    return np.unique(np.concatenate(some))


def _headings(line: Array) -> tuple[Array, int]:
    """Return the heading (n,) of a body at each knot of a closed line, and its whole turns.

    The heading is that of the motion; in a pause it turns to the next one.
    """
    steps = np.roll(line, -1, axis=0) - np.roll(line, 1, axis=0)
    goes = np.hypot(*steps.T) > 1e-3
    start = int(np.argmax(goes))
    order = (np.arange(len(line)) + start) % len(line)
    heading, previous = np.zeros(len(line)), 0.0
    for k, number in enumerate(order.tolist()):
        if goes[number]:
            ahead = math.atan2(steps[number, 1], steps[number, 0])
            previous = ahead if k == 0 else previous + _wrap_angle(ahead - previous)
        heading[k] = previous
    back = heading[0] + 2.0 * math.pi * round((previous - heading[0]) / (2.0 * math.pi))
    turns = round((back - heading[0]) / (2.0 * math.pi))
    full = np.concatenate([heading, heading + 2.0 * math.pi * turns])
    # The mean over the next knots: a body begins to turn before it goes on.
    kernel = np.full(2 * _TURNING + 1, 1.0 / (2 * _TURNING + 1))
    periodic = np.concatenate([heading[-_TURNING:] - 2.0 * math.pi * turns, full])
    smooth = np.convolve(periodic, kernel, "valid")[: len(line)]
    result = np.empty(len(line))
    wraps = np.where(order < start, 2.0 * math.pi * turns, 0.0)
    result[order] = smooth - wraps
    return result, turns


def _wrap_angle(angle: float) -> float:
    """Return an angle in -pi to pi."""
    return (angle + math.pi) % (2.0 * math.pi) - math.pi


def _floor(place: Place, top: float, keep_off: Passage | None) -> _Floor:
    """Return the cells of the floor, with their distances from things on it up to a height.

    :param keep_off: a path that counts as a thing.
    """
    width, depth = (place.high - place.low)[:2].tolist()
    cell = _CELL if width * depth < _LARGE else 2.0 * _CELL
    shape = max(1, int(width / cell)), max(1, int(depth / cell))
    x, y = ((np.arange(n) + 0.5) * cell + low for n, low in zip(shape, place.low[:2], strict=True))
    grid = np.stack(np.meshgrid(x, y, indexing="ij"), axis=-1)
    edge = np.minimum(grid - place.low[:2], place.high[:2] - grid).min(axis=2)
    free = np.minimum(edge, _REACH)
    bottom = float(place.low[2]) + 0.03
    for corners in _shadows(place.surfaces(), bottom, top):
        _put(free, grid, corners)
    for hinge in place.hinges:
        for angle in np.linspace(0.0, hinge.swing, _ANGLES):
            heading = hinge.heading + float(angle)
            foot = np.array(hinge.foot[:2])
            end = foot + hinge.width * np.array([math.cos(heading), math.sin(heading)])
            _put(free, grid, np.array([foot, end, end, foot]))
    if keep_off is not None:
        from scipy.spatial import cKDTree

        obstacles = keep_off.places[keep_off.places[..., 2] < top + CLEARANCE][:, :2]
        if len(obstacles):
            reach = _REACH + 2.0 * CLEARANCE  # from there on the path is of no interest
            away, _ = cKDTree(obstacles).query(grid.reshape(-1, 2), distance_upper_bound=reach)
            free = np.minimum(free, away.reshape(shape) - CLEARANCE)
    return _Floor(grid.reshape(-1, 2), free.ravel(), shape, cell)


def _shadows(where: Surfaces, bottom: float, top: float) -> list[Array]:
    """Return the projections onto the floor of the rectangles that stand in the way of a body.

    :param where: all rectangles of a place.
    :param bottom, top: heights between which a rectangle is in the way [m].
    :returns: corners (4, 2) of each such rectangle, x and y in the world [m].
    """
    corners = where.corners
    high, low = corners[..., 2].max(axis=1), corners[..., 2].min(axis=1)
    return list(corners[(high > bottom) & (low < top)][..., :2])


def _put(free: Array, grid: Array, corners: Array) -> None:
    """Lower the distances of cells to what is in the way by those to a convex quadrilateral.

    :param free: (a, b) distances [m], changed in place; those above ``_REACH`` do not matter.
    :param grid: (a, b, 2) x and y of the cells' middles [m].
    :param corners: (4, 2) corners in order; a cell inside has the distance 0.
    """
    low, high = corners.min(axis=0) - _REACH, corners.max(axis=0) + _REACH
    rows = slice(*np.searchsorted(grid[:, 0, 0], (low[0], high[0])))
    columns = slice(*np.searchsorted(grid[0, :, 1], (low[1], high[1])))
    part = grid[rows, columns]
    if not part.size:
        return
    best = np.full(part.shape[:2], np.inf)
    in_sweep = np.ones((2, *part.shape[:2]), np.bool_)
    for k in range(4):
        start, side = corners[k], corners[(k + 1) % 4] - corners[k]
        offset = part - start
        square = float(side @ side)
        share = np.clip((offset @ side) / square, 0.0, 1.0) if square > 0.0 else 0.0
        rest = offset - np.multiply.outer(share, side) if square > 0.0 else offset
        np.minimum(best, np.hypot(rest[..., 0], rest[..., 1]), out=best)
        turn = side[0] * offset[..., 1] - side[1] * offset[..., 0]
        in_sweep[0] &= turn > 0.0
        in_sweep[1] &= turn < 0.0
    best[in_sweep[0] | in_sweep[1]] = 0.0
    np.minimum(free[rows, columns], best, out=free[rows, columns])


def _door(hinge: Hinge, number: int, site: Site, passage: Passage) -> Course:
    """Return the course of a door: now and then it opens and closes, unless a camera is near."""
    stream = generator_at(site.seed, "bodies.course.door", number)
    usual = 1.0 if hinge.usually_open else 0.0
    shares = [np.full(_KNOTS, usual)]
    for _ in range(_DOOR_TRIES):
        share = np.full(_KNOTS, usual)
        knot = int(stream.integers(4, 30))
        while knot < _KNOTS - 60:
            moves, stays = int(stream.integers(6, 12)), int(stream.integers(8, 24))
            ramp = np.linspace(usual, 1.0 - usual, moves)
            share[knot : knot + moves] = ramp
            share[knot + moves : knot + moves + stays] = 1.0 - usual
            share[knot + moves + stays : knot + 2 * moves + stays] = ramp[::-1]
            knot += 2 * moves + stays + int(stream.integers(20, 60))
        shares.insert(-1, np.roll(share, int(stream.integers(_KNOTS))))
    for share in shares:
        heading = hinge.heading + hinge.swing * share
        foot = np.broadcast_to(np.array(hinge.foot[:2]), (_KNOTS, 2))
        course = Course(np.round(np.column_stack([foot, heading]), 6))
        if _has_clear_swing(course, hinge, passage):
            return course
    return course  # it stays as it is


def _has_clear_swing(course: Course, hinge: Hinge, passage: Passage) -> bool:
    """Return True if a door swings clear of a course."""
    top = hinge.foot[2] + hinge.height + CLEARANCE
    headings = course.at(passage.times)[:, 2]
    if not passage.ends:
        headings = np.array([hinge.heading + hinge.swing * k / _ANGLES for k in range(_ANGLES + 1)])
    for places in passage.places:
        offset = places[:, :2] - np.array(hinge.foot[:2])
        close = (places[:, 2] < top) & (np.hypot(*offset.T) < hinge.width + CLEARANCE + _REACH)
        if not close.any():
            continue
        if passage.ends:
            away = _leaf_distances(offset[close], headings[close], hinge.width)
        else:
            distances = [
                _leaf_distances(offset[close], np.full(int(close.sum()), h), hinge.width)
                for h in headings
            ]
            away = np.min(distances, axis=0)
        if (away < CLEARANCE).any():
            return False
    return True
