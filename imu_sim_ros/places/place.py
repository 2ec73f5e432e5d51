# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""A place: its faces with their materials, prints and light; and the builder of places."""

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Final, NamedTuple

import numpy as np

from imu_sim_ros.core.random_streams import generator
from imu_sim_ros.core.types import Array, Mask
from imu_sim_ros.places.geometry import Rectangle, Surfaces, surfaces
from imu_sim_ros.places.light import Lamp, Lighting
from imu_sim_ros.places.sheet import Print

TEXTURES: Final = ("rich", "plain", "blank")
LIGHTS: Final = ("day", "lamps", "dim")
_LINES: Final = ("strip", "band", "plinth", "cables")
"""Kinds of prints along whole walls, which other prints may cover."""
_GAP: Final = 0.05
"""Smallest distance of a print on a wall from other prints and from things before it [m]."""
_BEFORE: Final = 0.8
"""Distance from a wall within which faces cover parts of it [m]."""
CLEARANCE: Final = 0.3
"""Smallest distance of things from the path [m]."""

Vector = tuple[float, float, float]


class Face(NamedTuple):
    """One rectangle with its material and prints."""

    rectangle: Rectangle
    """Origin, across and up, each (3,) [m]."""
    material: str
    """Material: ``KIND`` or ``KIND:RRGGBB``."""
    prints: tuple[Print, ...] = ()
    """Prints on it, later ones above earlier ones."""
    detail: float = 1.0
    """Number of texels along a length, relative to other faces."""
    sky: bool = False
    """True for the sky, which gives light and reflects none."""
    glows: bool = False
    """True if its colour does not depend on the light."""


class Hinge(NamedTuple):
    """Hinge of a moving door."""

    foot: Vector
    """(3,) position p_w of its foot [m]."""
    heading: float
    """Direction of the closed leaf [rad]."""
    swing: float
    """Angle of the open leaf from there [rad]."""
    width: float
    """Width of the leaf [m]."""
    height: float
    """Height of the leaf [m]."""
    number: int
    """Number of the picture on the leaf."""
    usually_open: bool
    """True if the door is open most of the time."""


class Place(NamedTuple):
    """A place with its light, the space for bodies, the stops of a tour, and its moving doors."""

    faces: tuple[Face, ...]
    lighting: Lighting
    low: Array
    """(3,) corner of the space in which bodies move [m]."""
    high: Array
    """(3,) opposite corner [m]."""
    route: Array
    """(n, 3) stops of a tour, in the middle of free space [m]."""
    hinges: tuple[Hinge, ...] = ()
    """Hinges of the moving doors."""

    def surfaces(self) -> Surfaces:
        """Return the rectangles of all faces, with their materials as names of textures."""
        result = surfaces([face.rectangle for face in self.faces], hides=True)
        return result._replace(texture=tuple(face.material for face in self.faces))

    @property
    def detail(self) -> Array:
        """(m,) number of texels along a length on each face, relative to other faces."""
        return np.array([face.detail for face in self.faces])

    @property
    def sky(self) -> Mask:
        """(m,) True for faces of the sky."""
        return np.array([face.sky for face in self.faces], np.bool_)


@dataclass(frozen=True)
class Site:
    """Extent, path and seed for which a place is built."""

    low: Array
    """(3,) lower corner of the space for the place [m]."""
    high: Array
    """(3,) upper corner [m]."""
    path: Array
    """(n, 3) positions of cameras that must stay free [m]; none: there is no path."""
    seed: int = 0
    texture: str = "plain"
    """One of ``TEXTURES``."""
    light: str = "day"
    """One of ``LIGHTS``."""
    doors: int = 0
    """Largest number of moving doors, whose leaves are not part of the place."""

    def stream(self, what: str) -> np.random.Generator:
        """Return the random stream of a purpose, such as the furniture of an office."""
        return generator(self.seed, f"place.{what}")


class PlaceBuilder:
    """Faces, lamps and hinges of a place while it is built; its path can be kept free."""

    def __init__(self, site: Site) -> None:
        """Initialise without faces."""
        self.site = site
        self.faces: list[Face] = []
        self.lamps: list[Lamp] = []
        self.windows: list[Rectangle] = []
        self.hinges: list[Hinge] = []
        self.decor = site.stream("decor")
        """Random stream of decoration: another ``texture`` moves no furniture."""
        self._count = 0
        self._standing: dict[tuple[int, int], tuple[Array, Array]] = {}
        """Covered parts of a wall, by its index and the number of faces at that time."""

    def number(self) -> int:
        """Return a new number for a print."""
        self._count += 1
        return self._count

    def free(self, low: Sequence[float], high: Sequence[float]) -> bool:
        """Return whether the path keeps its distance from a box between two corners [m]."""
        path = self.site.path
        if not len(path):
            return True
        occupied = (path > np.asarray(low) - CLEARANCE) & (path < np.asarray(high) + CLEARANCE)
        return not bool(occupied.all(axis=1).any())

    def rich(self, plain: float) -> float:
        """Return the probability of a decoration from its probability in a plain place."""
        return {"blank": 0.0, "plain": plain, "rich": min(1.0, 1.8 * plain)}[self.site.texture]

    def face(
        self,
        origin: Sequence[float] | Array,
        across: Sequence[float] | Array,
        up: Sequence[float] | Array,
        material: str,
        prints: Sequence[Print] = (),
        detail: float = 1.0,
        sky: bool = False,
        glows: bool = False,
    ) -> int:
        """Add a rectangle that is visible from the side of ``across x up``; return its index.

        The other arguments are those of :class:`Face`.

        :param origin: corner (3,); ``across`` and ``up``: sides (3,) from it [m].
        """
        corner, across_side, up_side = (
            np.array(vector, dtype=np.float64).round(9) for vector in (origin, across, up)
        )
        sides = (corner, across_side, up_side)
        self.faces.append(Face(sides, material, tuple(prints), detail, sky, glows))
        return len(self.faces) - 1

    def room(
        self, low: Sequence[float], high: Sequence[float], materials: Mapping[str, str]
    ) -> dict[str, int]:
        """Add the inner faces of a box.

        :param materials: materials of ``floor``, ``ceiling`` and ``walls``, or of single walls.
        :returns: index of each face by its side; walls are -x, +x, -y and +y.
        """
        (x0, y0, z0), (x1, y1, z1) = low, high
        dx, dy, dz = x1 - x0, y1 - y0, z1 - z0
        sides = {
            "-x": ((x0, y0, z0), (0, dy, 0), (0, 0, dz)),
            "+x": ((x1, y1, z0), (0, -dy, 0), (0, 0, dz)),
            "-y": ((x1, y0, z0), (-dx, 0, 0), (0, 0, dz)),
            "+y": ((x0, y1, z0), (dx, 0, 0), (0, 0, dz)),
            "floor": ((x0, y0, z0), (dx, 0, 0), (0, dy, 0)),
            "ceiling": ((x0, y1, z1), (dx, 0, 0), (0, -dy, 0)),
        }
        faces = {}
        for side, (origin, across, up) in sides.items():
            material = materials.get(side, materials.get("walls", "plaster"))
            faces[side] = self.face(origin, across, up, material)
        return faces

    def add_prints(self, face: int, prints: Sequence[Print]) -> None:
        """Add prints to the face of an index, above those that it has."""
        previous = self.faces[face]
        self.faces[face] = previous._replace(prints=(*previous.prints, *prints))

    def hang(self, wall: int, what: Print) -> bool:
        """Add a print to a wall, unless other prints or things cover its place.

        :returns: True if it was added.
        """
        width, height = (float(np.sqrt(side @ side)) for side in self.faces[wall].rectangle[1:])
        hung = [print_ for print_ in self.faces[wall].prints if print_.kind not in _LINES]
        low = np.array([[print_.left, print_.bottom] for print_ in hung]).reshape(-1, 2)
        high = low + np.array([[print_.width, print_.height] for print_ in hung]).reshape(-1, 2)
        state = wall, len(self.faces)
        if state not in self._standing:
            self._standing[state] = self._standing_before(wall)
        standing = self._standing[state]
        low, high = np.concatenate([low, standing[0]]), np.concatenate([high, standing[1]])
        corner = np.array([what.left, what.bottom])
        end = corner + np.array([what.width, what.height])
        if (corner < 0.0).any() or (end > (width, height)).any():
            return False
        if ((low < end + _GAP) & (high > corner - _GAP)).all(axis=1).any():
            return False
        self.add_prints(wall, [what])
        return True

    def _standing_before(self, wall: int) -> tuple[Array, Array]:
        """Return lower and upper corners (n, 2) of the parts of a wall that faces cover [m]."""
        sides = np.array([face.rectangle for face in self.faces])  # (faces, origin and sides, 3)
        origin, across, up = sides[wall]
        axes = [axis / np.sqrt(axis @ axis) for axis in (across, up, np.cross(across, up))]
        origins, widths, heights = sides[:, 0], sides[:, 1], sides[:, 2]
        diagonals = widths + heights
        offsets = np.stack([np.zeros_like(origins), widths, heights, diagonals], axis=1)
        local = (origins[:, None] + offsets - origin) @ np.array(axes).T  # (faces, corners, 3)
        low, high = local.min(axis=1), local.max(axis=1)
        close = (low[:, 2] < _BEFORE) & (high[:, 2] > 1e-6)
        return low[close, :2], high[close, :2]

    def box(
        self,
        low: Sequence[float],
        high: Sequence[float],
        material: str,
        prints: Mapping[str, Sequence[Print]] | None = None,
        turn: float = 0.0,
        leave: str = "bottom",
        materials: Mapping[str, str] | None = None,
    ) -> dict[str, int]:
        """Add the outer faces of a box.

        :param low, high: corners before the turn [m].
        :param prints: prints by side: -x, +x, -y, +y, top, bottom.
        :param turn: angle about the vertical axis through the middle [rad].
        :param leave: sides without a face, separated by commas.
        :param materials: materials of sides that differ from ``material``.
        :returns: index of each face by its side.
        """
        middle = 0.5 * (np.asarray(low, np.float64) + np.asarray(high, np.float64))
        (x0, y0, z0), (x1, y1, z1) = low - middle, high - middle
        dx, dy, dz = x1 - x0, y1 - y0, z1 - z0
        sides = {
            "-x": ((x0, y1, z0), (0, -dy, 0), (0, 0, dz)),
            "+x": ((x1, y0, z0), (0, dy, 0), (0, 0, dz)),
            "-y": ((x0, y0, z0), (dx, 0, 0), (0, 0, dz)),
            "+y": ((x1, y1, z0), (-dx, 0, 0), (0, 0, dz)),
            "top": ((x0, y0, z1), (dx, 0, 0), (0, dy, 0)),
            "bottom": ((x0, y1, z0), (dx, 0, 0), (0, -dy, 0)),
        }
        matrix = rotation_about_z(turn)
        left_out, faces = leave.split(","), {}
        for side, vectors in sides.items():
            if side in left_out:
                continue
            origin, across, up = (matrix @ np.array(v, np.float64) for v in vectors)
            of_side = (prints or {}).get(side, ())
            side_material = (materials or {}).get(side, material)
            faces[side] = self.face(middle + origin, across, up, side_material, of_side)
        return faces

    def prism(
        self,
        start: Sequence[float],
        end: Sequence[float],
        radius: float,
        material: str,
        sides: int = 8,
    ) -> None:
        """Add a round column or pipe as rectangles around its axis, without its ends.

        :param start, end: ends of the axis [m].
        :param sides: number of rectangles.
        """
        a, b = np.asarray(start, np.float64), np.asarray(end, np.float64)
        axis = b - a
        unit = axis / np.linalg.norm(axis)
        helper = np.array([0.0, 0.0, 1.0]) if abs(unit[2]) < 0.9 else np.array([1.0, 0.0, 0.0])
        u_axis = np.cross(helper, unit)
        u_axis /= np.linalg.norm(u_axis)
        v_axis = np.cross(unit, u_axis)
        corners = []
        for k in range(sides):
            angle = 2.0 * math.pi * k / sides
            corners.append(
                radius * (round(math.cos(angle), 9) * u_axis + round(math.sin(angle), 9) * v_axis)
            )
        for k in range(sides):
            self.face(a + corners[k], corners[(k + 1) % sides] - corners[k], axis, material)

    def lamp(
        self, center: Sequence[float], size: tuple[float, float], colour: Vector, strength: float
    ) -> None:
        """Add a flat lamp that shines down, with a glowing face, unless it is in the path.

        :param center: middle of the lamp in the world [m].
        :param size: lengths along x and y [m].
        :param colour: red, green and blue, relative to white.
        :param strength: factor of the colour; 0: the lamp is off, and its face grey.
        """
        x, y, z = center
        w, d = size
        if not self.free((x - w / 2, y - d / 2, z), (x + w / 2, y + d / 2, z)):
            return
        rectangle = (
            np.array([x - w / 2, y + d / 2, z]),
            np.array([w, 0.0, 0.0]),
            np.array([0.0, -d, 0.0]),
        )
        red, green, blue = (strength * c for c in colour)
        if strength > 0.0:
            self.lamps.append(Lamp(rectangle, (red, green, blue)))
            self.face(*rectangle, "paint:fffef8", glows=True)
        else:
            self.face(*rectangle, "paint:c8c8c4")


def rotation_about_z(angle: float) -> Array:
    """Return the rotation (3, 3) about z by an angle [rad]."""
    c, s = round(math.cos(angle), 9), round(math.sin(angle), 9)
    return np.array([[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]])


Build = Callable[[Site], Place]
"""Function that builds a place on a site."""
