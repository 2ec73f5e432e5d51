# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Bodies that move in a place: people, carts and doors, each rigid, with its course in closed form.

A body's own axes: x ahead, y to the left, z up, from the floor below its middle; of a door from the
foot of its hinge, x along the leaf.
"""

import math
from collections.abc import Sequence
from typing import Final, NamedTuple

import numpy as np

from imu_sim_ros.core import rotation
from imu_sim_ros.core.random_streams import generator_at
from imu_sim_ros.core.records import States
from imu_sim_ros.core.types import Array, Mask, Single, Times
from imu_sim_ros.places.geometry import Surfaces, is_hidden, surfaces
from imu_sim_ros.places.light import Lighting, factors
from imu_sim_ros.places.paint import MIDDLE, Painter
from imu_sim_ros.places.place import Face, Hinge, Place, PlaceBuilder, Site
from imu_sim_ros.places.shadows import Shadow, Sunlight
from imu_sim_ros.places.sheet import Print

KINDS: Final = ("person", "cart", "door")
RADIUS: Final = {"person": 0.3, "cart": 0.56}
"""Radius of the circle around its middle that a body never leaves [m]."""
HEIGHT: Final = {"person": 1.75, "cart": 1.05, "door": 2.1}
"""Heights of moving bodies by kind [m]."""
STEP: Final = 0.25
"""Time between the knots of a course [s]."""
_LEAF: Final = 0.04
"""Thickness of a door [m]."""
_OVERHEAD: Final = {"up": 1.15, "sideways": 0.9, "down": 0.45}
"""Light on faces that look up, sideways and down, as a share of the place's light."""


class Course(NamedTuple):
    """Place and heading at any time: a periodic uniform cubic B-spline, with two derivatives."""

    controls: Array
    """(n, 3) x, y [m] and heading, not wrapped [rad]."""
    turns: int = 0
    """Whole turns in a period."""

    @property
    def period(self) -> float:
        """Time after which the course repeats [s]."""
        return len(self.controls) * STEP

    def at(self, t: Array) -> Array:
        """Return x, y and heading (n, 3) at times t (n,) [s]."""
        interval, f = self._place(t)
        g = 1.0 - f
        square = f * f
        cube = square * f
        weights = (
            g * g * g / 6.0,
            (3.0 * cube - 6.0 * square + 4.0) / 6.0,
            (3.0 * (f + square - cube) + 1.0) / 6.0,
            cube / 6.0,
        )
        return self._sum(interval, weights)

    def rates(self, t: Array) -> Array:
        """Return the rates of x, y [m/s] and heading [rad/s] (n, 3) at times t (n,) [s]."""
        interval, f = self._place(t)
        g = 1.0 - f
        weights = (
            -0.5 * g * g / STEP,
            (1.5 * f * f - 2.0 * f) / STEP,
            (0.5 + f - 1.5 * f * f) / STEP,
            0.5 * f * f / STEP,
        )
        return self._sum(interval, weights)

    @staticmethod
    def _place(t: Array) -> tuple[Array, Array]:
        """Return the spline's intervals (n,) of times (n,), and the shares of them before (n,)."""
        u = np.asarray(t, np.float64) / STEP
        whole = np.floor(u)
        return whole.astype(np.int64), u - whole

    def _sum(self, interval: Array, weights: Sequence[Array]) -> Array:
        """Return the weighted sums (n, 3) of the control points of intervals (n,)."""
        result: Array = np.zeros((len(interval), 3))
        for j, weight in enumerate(weights):
            rounds, index = np.divmod(interval + j, len(self.controls))
            control = self.controls[index]
            control[:, 2] += 2.0 * math.pi * self.turns * rounds
            result += weight[:, None] * control
        return result


Landmarks = tuple[Array, Array]
"""Points (n, 3) [m] on a body and their outward normals (n, 3), in the body's axes."""


class MovingBody(NamedTuple):
    """A person, a cart or a door that moves in a place as a rigid body."""

    name: str
    """Name of the body: its kind and a number."""
    kind: str
    """One of ``KINDS``."""
    faces: tuple[Face, ...]
    """Faces in the body's axes."""
    course: Course
    floor: float
    """Height of the origin [m]."""

    def surfaces(self) -> Surfaces:
        """Return the rectangles of its faces, in its own axes."""
        result = surfaces([face.rectangle for face in self.faces], hides=True)
        return result._replace(texture=tuple(face.material for face in self.faces))

    def pose(self, t: Array) -> tuple[Array, Array]:
        """Return positions (n, 3) [m] and attitudes (n, 4) in the world at times t (n,) [s]."""
        place = self.course.at(t)
        count = len(place)
        position = np.column_stack([place[:, :2], np.full(count, self.floor)])
        half = 0.5 * place[:, 2]
        zeros = np.zeros(count)
        return position, np.column_stack([np.cos(half), zeros, zeros, np.sin(half)])

    def states(self, t_ns: Times, t: Array) -> States:
        """Return the states at times after the start.

        :param t_ns: (n,) stamps [ns].
        :param t: (n,) times after the start [s].
        """
        (position, q_wb), rate = self.pose(t), self.course.rates(t)
        velocity, angular_velocity = rate.copy(), rate.copy()
        velocity[:, 2] = angular_velocity[:, :2] = 0.0
        return States.unchecked(
            t_ns=t_ns,
            position=position,
            q_wb=q_wb,
            velocity=velocity,
            angular_velocity=angular_velocity,
            source=self.name,
        )

    def sees(self, t: Array, position: Array, q_wc: Array) -> tuple[Array, Array]:
        """Return positions (n, 3) and attitudes (n, 4) in its own axes at times t (n,) [s]."""
        p_wb, q_wb = self.pose(t)
        position_b = rotation.rotate_inverse(q_wb, position - p_wb)
        return position_b, rotation.multiply(rotation.conjugate(q_wb), q_wc)

    def to_body(self, t: Array, points: Array) -> Array:
        """Return points (n, 3) of the world in its own axes at times t (n,) [s]."""
        p_wb, q_wb = self.pose(t)
        points_b: Array = rotation.rotate_inverse(q_wb, points - p_wb)
        return points_b

    def to_world(self, t: Array, points: Array) -> Array:
        """Return points (n, 3) of its own axes in the world at times t (n,) [s]."""
        p_wb, q_wb = self.pose(t)
        points_w: Array = p_wb + rotation.rotate(q_wb, points)
        return points_w


def ball(where: Surfaces) -> tuple[Array, float]:
    """Return middle (3,) and radius [m] of a ball around all rectangles."""
    corners = where.corners.reshape(-1, 3)
    middle = 0.5 * (corners.min(axis=0) + corners.max(axis=0))
    return middle, float(np.sqrt(((corners - middle) ** 2).sum(axis=1)).max())


def faces(kind: str, number: int, site: Site, hinge: Hinge | None = None) -> tuple[Face, ...]:
    """Return the faces of a body of some kind, in its own axes.

    :param number: number of the body, with which its looks are drawn.
    :param hinge: hinge of a door; None for other kinds.
    """
    body_site = Site(
        low=np.zeros(3),
        high=np.ones(3),
        path=np.zeros((0, 3)),
        seed=site.seed,
        texture=site.texture,
        light=site.light,
    )
    b = PlaceBuilder(body_site)
    stream = generator_at(site.seed, f"bodies.look.{kind}", number)
    if kind == "person":
        _person(b, number, stream)
    elif kind == "cart":
        _cart(b, number, stream)
    elif hinge is not None:
        half = 0.5 * _LEAF
        leaf = [Print("door", 0, 0, hinge.width, hinge.height, hinge.number)]
        low, high = (0.0, -half, 0.01), (hinge.width, half, hinge.height + 0.01)
        b.box(low, high, "board:a87c50", {"-y": leaf, "+y": leaf}, leave="")
    return tuple(b.faces)


_SHIRTS: Final = (
    *("carpet:8c3c34", "carpet:2c4c7c", "carpet:d8d4c8", "carpet:3c6c4c", "carpet:c8a040"),
    *("carpet:6c5c80", "carpet:30343c", "carpet:b8c4d0"),
)
_TROUSERS: Final = ("carpet:2c3440", "carpet:3c4c68", "carpet:6c6454", "carpet:242428")
_SKINS: Final = ("paint:e0b494", "paint:c08c68", "paint:8c5c40", "paint:f0c8a8")
_HAIR: Final = ("carpet:2c2018", "carpet:5c4028", "carpet:8c7450", "carpet:a09890")


def _person(b: PlaceBuilder, number: int, stream: np.random.Generator) -> None:
    """Build a person of 1.75 m in the middle of a step."""
    shirt, trousers, skin, hair = (
        options[int(stream.integers(len(options)))]
        for options in (_SHIRTS, _TROUSERS, _SKINS, _HAIR)
    )
    stride = 0.08
    for side in (-1, 1):
        y, ahead = 0.1 * side, stride * side
        low, high = (ahead - 0.09, y - 0.05, 0.0), (ahead + 0.16, y + 0.05, 0.09)
        b.box(low, high, "paint:282420", leave="bottom")
        low, high = (ahead - 0.08, y - 0.075, 0.09), (ahead + 0.08, y + 0.075, 0.88)
        b.box(low, high, trousers, leave="")
        arm, y = -0.4 * ahead, 0.235 * side
        low, high = (arm - 0.045, y - 0.045, 0.78), (arm + 0.045, y + 0.045, 1.43)
        b.box(low, high, shirt, leave="")
    chest = [Print("label", 0.1, 0.3, 0.16, 0.12, number)]
    back = [Print("poster", 0.07, 0.12, 0.24, 0.3, number)]
    b.box((-0.11, -0.19, 0.86), (0.11, 0.19, 1.46), shirt, {"+x": chest, "-x": back}, leave="")
    b.prism((0.0, 0.0, 1.46), (0.0, 0.0, 1.54), 0.055, skin, sides=4)
    b.box((-0.08, -0.08, 1.52), (0.1, 0.08, 1.72), skin, leave="")
    b.box((-0.1, -0.09, 1.62), (0.0, 0.09, 1.75), hair, leave="")
    b.box((0.0, -0.09, 1.69), (0.11, 0.09, 1.75), hair, leave="")


def _cart(b: PlaceBuilder, number: int, stream: np.random.Generator) -> None:
    """Build a cart that drives itself, with boxes on it."""
    colour = ("paint:2c5c8c", "paint:c8702c", "paint:d0d0cc")[int(stream.integers(3))]
    for x in (-0.32, 0.32):
        for y in (-0.2, 0.2):
            low, high = (x - 0.07, y - 0.03, 0.0), (x + 0.07, y + 0.03, 0.14)
            b.box(low, high, "paint:242424", leave="top,bottom")
    sign = [Print("label", 0.3, 0.02, 0.3, 0.1, number)]
    b.box((-0.45, -0.28, 0.12), (0.45, 0.28, 0.3), colour, {"-y": sign, "+y": sign}, leave="")
    b.box((-0.45, -0.28, 0.3), (-0.41, 0.28, 1.0), colour, leave="bottom")
    cartons = {
        side: [Print("label", 0.1, 0.1, 0.3, 0.2, number + 1)] for side in ("-y", "+y", "+x", "-x")
    }
    b.box((-0.36, -0.24, 0.3), (0.1, 0.2, 0.72), "cardboard", cartons)
    b.box((0.12, -0.2, 0.3), (0.42, 0.22, 0.6), "cardboard:a88454", cartons)
    b.box((-0.3, -0.2, 0.72), (0.02, 0.16, 0.98), "cardboard:bc9a6c", cartons)


class Crowd:
    """All bodies of a scene; their ids are 1, 2, ... in this order."""

    def __init__(
        self,
        bodies: Sequence[MovingBody],
        site: Site,
        landmarks: Sequence[Landmarks],
        sun: Sunlight | None = None,
    ) -> None:
        """Initialise with the bodies of a scene.

        :param landmarks: landmarks of each body.
        :param sun: sun in which they throw shadows; None: they are under a roof.
        """
        self.bodies = tuple(bodies)
        self.surfaces = [body.surfaces() for body in bodies]
        self.balls = [ball(where) for where in self.surfaces]
        self.landmarks = tuple(landmarks)
        self.shadows = [Shadow.of(where) for where in self.surfaces]
        self.sun = sun
        self.painter = BodyPainter(bodies, site)

    def is_hidden(self, t: Array, eye: Array, points: Array) -> Mask:
        """Return True for points (n, 3) that a body hides from eyes (n, 3) at times t (n,)."""
        result = np.zeros(len(points), np.bool_)
        for body, where, (middle, radius) in zip(
            self.bodies, self.surfaces, self.balls, strict=True
        ):
            center = body.to_world(t, np.broadcast_to(middle, points.shape))
            rows = np.flatnonzero(_distance(center, eye, points) < radius)
            if len(rows):
                in_body = (body.to_body(t[rows], positions[rows]) for positions in (eye, points))
                result[rows] |= is_hidden(where, *in_body)
        return result


def _distance(points: Array, start: Array, end: Array) -> Array:
    """Return the distances (n,) of points (n, 3) from line segments, start to end (n, 3) [m]."""
    side, offset = end - start, points - start
    square = np.maximum((side * side).sum(axis=1), 1e-12)
    share = np.clip((offset * side).sum(axis=1) / square, 0.0, 1.0)
    rest = offset - share[:, None] * side
    return np.asarray(np.sqrt((rest * rest).sum(axis=1)))


class BodyPainter(Painter):
    """Textures of moving bodies, with the same light from above at every place."""

    def __init__(self, bodies: Sequence[MovingBody], site: Site) -> None:
        everything = tuple(face for body in bodies for face in body.faces)
        nowhere = np.zeros(3)
        unlit = Place(
            faces=everything, lighting=Lighting(), low=nowhere, high=nowhere, route=np.zeros((0, 3))
        )
        super().__init__(unlit, site)
        upwards = self._surfaces.normal[:, 2]
        middle = MIDDLE[site.light]
        self._constant = [
            factors(np.full((1, 1, 3), middle * _share(float(up)), np.float32)) for up in upwards
        ]

    @property
    def _light(self) -> list[Single]:
        """Factors of the colours of each face (1, 1, 3), which do not depend on the body's pose."""
        return self._constant


def _share(up: float) -> float:
    """Return the light on a face, as a share of the place's, by the z of its unit normal."""
    if up > 0.5:
        return _OVERHEAD["up"]
    return _OVERHEAD["down"] if up < -0.5 else _OVERHEAD["sideways"]
