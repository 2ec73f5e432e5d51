# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Parameters of what cameras see, one section for each ``scene.type``."""

from collections.abc import Iterator
from dataclasses import dataclass, replace

from imu_sim_ros.core.errors import ConfigurationError
from imu_sim_ros.core.names import suggestion
from imu_sim_ros.core.types import field_values
from imu_sim_ros.parameters.files import names
from imu_sim_ros.parameters.kinds import (
    IDENTITY_MATRIX,
    ZERO_VECTOR,
    Matrix,
    Vector,
    choice,
    integer,
    matrix,
    number,
    numbers,
    text,
    vector,
)
from imu_sim_ros.parameters.sections import section
from imu_sim_ros.places.catalogue import size_problems
from imu_sim_ros.places.mesh import ANCHORS, UPS
from imu_sim_ros.places.place import LIGHTS, TEXTURES
from imu_sim_ros.sensors.parameters import rotation_problems

MOST_BODIES = 100
"""Largest number of moving bodies."""
TYPE_TEXT = "kind of scene, or the name of a file in config/scenes"
LOOKS = ("auto", "unlit", "sun")


@dataclass(frozen=True)
class SceneParameters:
    """Parameters common to all scenes."""

    type: str = text("auto", TYPE_TEXT)
    seed: int = integer(0, "seed of places and textures", minimum=0, maximum=2**63 - 1)


@dataclass(frozen=True)
class PathSceneParameters(SceneParameters):
    """Parameters of scenes along the path, which do not depend on the simulation's duration."""

    horizon: float = number(
        60.0,
        "length of an endless trajectory for which the scene is made; other trajectories count "
        "in full",
        unit="s",
        minimum=0.1,
        maximum=1e4,
    )


@dataclass(frozen=True)
class RoomParameters(PathSceneParameters):
    """A box around the path, with boxes that stand in it; landmarks on all surfaces."""

    type: str = text("room", TYPE_TEXT)
    size: Vector = vector(
        ZERO_VECTOR,
        "length along x, y, z; 0: the path and a margin",
        unit="m",
        minimum=0.0,
        maximum=1e6,
    )
    center: Vector = vector(ZERO_VECTOR, "center of the room, if it has a size", unit="m")
    margin: float = number(
        2.0,
        "distance of the walls from the path, if the room has no size",
        unit="m",
        minimum=0.0,
        above_minimum=True,
        maximum=1e6,
    )
    boxes: int = integer(4, "boxes against the walls, as furniture", minimum=0, maximum=100)
    landmarks: int = integer(1000, "points on the surfaces", minimum=1, maximum=1_000_000)

    def problems(self, prefix: str) -> Iterator[str]:
        """Yield a line if only some sides are given."""
        if any(self.size) and not all(self.size):
            yield f"{prefix}size = {list(self.size)}: must be 0 or above 0 m on all axes"


@dataclass(frozen=True)
class HouseParameters(SceneParameters):
    """A frame house of lines and their end points, seen from outside."""

    type: str = text("house", TYPE_TEXT)
    lines: tuple[float, ...] = numbers((), "x, y, z of both ends of each line", unit="m", group=6)
    second_points: Vector = vector(
        (0.5, 0.5, -0.5), "each end point is repeated with this offset; 0: not repeated", unit="m"
    )

    def problems(self, prefix: str) -> Iterator[str]:
        """Yield a line if there are no lines."""
        if not self.lines:
            yield f"{prefix}lines = []: must hold at least one line; the scene house has some"


@dataclass(frozen=True)
class CloudParameters(PathSceneParameters):
    """Random points along the path, so many that every frame sees enough of them."""

    type: str = text("cloud", TYPE_TEXT)
    visible: int = integer(
        100,
        "minimum number of points seen in each frame",
        minimum=1,
        maximum=10_000,
    )
    spacing: float = number(
        0.2, "time between two viewpoints", unit="s", minimum=0.001, maximum=1e6
    )
    near: float = number(
        3.0,
        "smallest distance of a point from the camera",
        unit="m",
        minimum=0.0,
        above_minimum=True,
        maximum=1e6,
    )
    far: float = number(
        10.0, "largest distance of a point from the camera", unit="m", minimum=0.0, maximum=1e6
    )

    def problems(self, prefix: str) -> Iterator[str]:
        """Yield a line if the distances are in disorder."""
        if self.far <= self.near:
            yield f"{prefix}far = {self.far:g}: must be above {prefix}near, {self.near:g} m"


@dataclass(frozen=True)
class PlanesParameters(SceneParameters):
    """Rectangles anywhere, seen from both sides, with landmarks on them."""

    type: str = text("planes", TYPE_TEXT)
    corners: tuple[float, ...] = numbers(
        (),
        "three corners of each rectangle: a first one and its two neighbours",
        unit="m",
        group=9,
    )
    landmarks: int = integer(300, "points on the rectangles", minimum=1, maximum=1_000_000)

    def problems(self, prefix: str) -> Iterator[str]:
        """Yield which rectangles are none."""
        if not self.corners:
            yield f"{prefix}corners = []: must hold at least one rectangle"
        for k in range(0, len(self.corners), 9):
            o, a, b = (self.corners[k + j : k + j + 3] for j in (0, 3, 6))
            first = [x - y for x, y in zip(a, o, strict=True)]
            second = [x - y for x, y in zip(b, o, strict=True)]
            lengths = [sum(x * x for x in side) ** 0.5 for side in (first, second)]
            dot = sum(x * y for x, y in zip(first, second, strict=True))
            if min(lengths) <= 0.0 or abs(dot) > 1e-6 * lengths[0] * lengths[1]:
                name = f"{prefix}corners: rectangle {k // 9 + 1}"
                yield f"{name} has no right angle at its first corner"


@dataclass(frozen=True)
class TargetParameters(SceneParameters):
    """Pose of a calibration target: x to the right and y up, seen from its +z."""

    position: Vector = vector(ZERO_VECTOR, "position of the target's origin in the world", unit="m")
    orientation: Matrix = matrix(
        IDENTITY_MATRIX, "rotation R_wt of the target in the world; it is seen from its +z side"
    )

    def problems(self, prefix: str) -> Iterator[str]:
        """Yield a line if the orientation is not a rotation."""
        yield from rotation_problems(self.orientation, f"{prefix}orientation")


@dataclass(frozen=True)
class AprilgridParameters(TargetParameters):
    """kalibr's AprilGrid of 36h11 tags; the origin is the lower left corner of tag 0."""

    type: str = text("aprilgrid", TYPE_TEXT)
    columns: int = integer(6, "tags in x, kalibr's tagCols", minimum=1, maximum=24)
    rows: int = integer(6, "tags in y, kalibr's tagRows", minimum=1, maximum=24)
    tag_size: float = number(
        0.088, "edge of a tag", unit="m", minimum=0.0, above_minimum=True, maximum=100.0
    )
    tag_spacing: float = number(
        0.3, "gap between two tags, in tag sizes", minimum=0.0, above_minimum=True, maximum=2.0
    )

    def problems(self, prefix: str) -> Iterator[str]:
        """Yield a line if there are more tags than the family has."""
        yield from super().problems(prefix)
        if self.rows * self.columns > 587:
            yield (
                f"{prefix}rows = {self.rows}: with {self.columns} columns exceeds the 587 tags "
                "of the family 36h11"
            )


@dataclass(frozen=True)
class CheckerboardParameters(TargetParameters):
    """A checkerboard; the origin is its lower left inner corner."""

    type: str = text("checkerboard", TYPE_TEXT)
    columns: int = integer(7, "inner corners in x, kalibr's targetCols", minimum=2, maximum=100)
    rows: int = integer(6, "inner corners in y, kalibr's targetRows", minimum=2, maximum=100)
    square: float = number(
        0.06, "edge of a square", unit="m", minimum=0.0, above_minimum=True, maximum=100.0
    )


@dataclass(frozen=True)
class PointFileParameters(SceneParameters):
    """Points of a file: CSV with x, y, z (or id, x, y, z), or PLY."""

    type: str = text("file", TYPE_TEXT)
    file: str = text("", "CSV or PLY")

    def problems(self, prefix: str) -> Iterator[str]:
        """Yield a line if the file is missing."""
        if not self.file:
            yield f"{prefix}file = '': must name a file of points"


@dataclass(frozen=True)
class MeshParameters(PathSceneParameters):
    """A file of triangles: a scan, CAD, a place of another simulator; landmarks on its surface.

    A place p of the file is at ``position + Rz(yaw) orientation up scale p`` in the world.
    """

    type: str = text("mesh", TYPE_TEXT)
    mesh: str = text("", "GLB, glTF, OBJ, PLY or STL")
    scale: float = number(
        1.0,
        "length of the file's unit; 0.001 for millimetres",
        unit="m",
        minimum=1e-9,
        maximum=1e9,
    )
    up: str = choice(
        "file", UPS, "axis of the file that points up; file: y of GLB and glTF, z of all others"
    )
    orientation: Matrix = matrix(
        IDENTITY_MATRIX, "rotation R_wm of the mesh in the world, its up axis already up"
    )
    yaw: float = number(0.0, "turn about the world's z after that", unit="rad")
    position: Vector = vector(ZERO_VECTOR, "position of the anchor in the world", unit="m")
    anchor: str = choice(
        "origin",
        ANCHORS,
        "origin: the file's origin is at position; path: the middle of the mesh is where the "
        "middle of the cameras' path is, moved by position",
    )
    light: str = choice(
        "auto",
        LOOKS,
        "unlit: textures and colours as they are; sun: shaded by the angle to a sun; auto: sun "
        "for a mesh without textures and colours of its vertices or faces",
    )
    landmarks: int = integer(
        2000, "points on what the path sees of the surface", minimum=1, maximum=1_000_000
    )

    def problems(self, prefix: str) -> Iterator[str]:
        """Yield a line if the file is missing, and if the orientation is not a rotation."""
        if not self.mesh:
            yield f"{prefix}mesh = '': must name a file of triangles"
        yield from rotation_problems(self.orientation, f"{prefix}orientation")


@dataclass(frozen=True)
class BodiesParameters:
    """Numbers and speed of moving bodies, whose courses keep off things and cameras."""

    people: int = integer(0, "people who walk, stop and turn", minimum=0, maximum=50)
    carts: int = integer(0, "carts that drive themselves", minimum=0, maximum=50)
    doors: int = integer(0, "doors that open and close: office, corridor", minimum=0, maximum=50)
    speed: float = number(
        1.2, "speed of people; carts move at 0.8 of it", unit="m/s", minimum=0.05, maximum=3.0
    )
    landmarks: int = integer(60, "points on each body", minimum=0, maximum=10_000)

    def names(self) -> list[str]:
        """Return the names of all bodies; the first has the id 1."""
        counts = (("door", self.doors), ("cart", self.carts), ("person", self.people))
        return [f"{kind}_{k + 1}" for kind, count in counts for k in range(count)]

    def problems(self, prefix: str) -> Iterator[str]:
        """Yield a line if there are more bodies than a mask has values."""
        count = len(self.names())
        if count > MOST_BODIES:
            yield f"{prefix}people = {self.people}: {count} bodies in all; at most {MOST_BODIES}"


@dataclass(frozen=True)
class PlaceParameters(PathSceneParameters):
    """Parameters common to all places: materials, light, and things that leave the path free."""

    size: Vector = vector(
        ZERO_VECTOR,
        "length along x, y, z; 0: the path and a margin",
        unit="m",
        minimum=0.0,
        maximum=500.0,
    )
    center: Vector = vector(ZERO_VECTOR, "center of the place, if it has a size", unit="m")
    texture: str = choice(
        "plain",
        TEXTURES,
        "how much there is to see on surfaces: rich; plain: as usual; blank: next to nothing",
    )
    light: str = choice(
        "day",
        LIGHTS,
        "day: through windows, or from the sun; lamps: at night; dim: few lamps, or clouds",
    )
    landmarks: int = integer(2000, "points on the surfaces", minimum=1, maximum=1_000_000)
    bodies: BodiesParameters = section(BodiesParameters)

    def problems(self, prefix: str) -> Iterator[str]:
        """Yield a line if only some sides are given, or too little for the place."""
        kind = "office" if isinstance(self, OfficeParameters) else self.type
        yield from size_problems(kind, self.size, f"{prefix}size")


@dataclass(frozen=True)
class OfficeParameters(PlaceParameters):
    """Desks in an open room with windows, closed rooms behind doors along one side."""

    type: str = text("office", TYPE_TEXT)


@dataclass(frozen=True)
class AutoParameters(OfficeParameters):
    """`office`; `room` around a path that is too large, unless what is set is an office's alone.

    For cameras on the trajectory `tour` it is the place that the tour goes through.
    """

    type: str = text("auto", TYPE_TEXT)

    @property
    def office(self) -> OfficeParameters:
        """These parameters, as those of an office."""
        return OfficeParameters(**{**field_values(self), "type": "office"})

    @property
    def room(self) -> RoomParameters | None:
        """These parameters, as those of a room; None: they describe more than a room has."""
        room = RoomParameters(seed=self.seed, horizon=self.horizon)
        plain = type(self)(seed=self.seed, horizon=self.horizon, landmarks=self.landmarks)
        if self.landmarks != type(self).landmarks:
            room = replace(room, landmarks=self.landmarks)
        return room if self == plain else None


@dataclass(frozen=True)
class CorridorParameters(PlaceParameters):
    """A corridor with the same doors at equal distances, and hardly anything else."""

    type: str = text("corridor", TYPE_TEXT)


@dataclass(frozen=True)
class WarehouseParameters(PlaceParameters):
    """Rows of racks with pallets, gates and roof lights."""

    type: str = text("warehouse", TYPE_TEXT)


@dataclass(frozen=True)
class MachineHallParameters(PlaceParameters):
    """Boilers, pipes, cabinets and a gallery between dark walls."""

    type: str = text("machine_hall", TYPE_TEXT)


@dataclass(frozen=True)
class StreetParameters(PlaceParameters):
    """Houses, pavements, trees, lamp posts and parked cars under the sky."""

    type: str = text("street", TYPE_TEXT)


TYPES: dict[str, type[SceneParameters]] = {
    "auto": AutoParameters,
    "room": RoomParameters,
    "house": HouseParameters,
    "cloud": CloudParameters,
    "planes": PlanesParameters,
    "aprilgrid": AprilgridParameters,
    "checkerboard": CheckerboardParameters,
    "file": PointFileParameters,
    "mesh": MeshParameters,
    "office": OfficeParameters,
    "corridor": CorridorParameters,
    "warehouse": WarehouseParameters,
    "machine_hall": MachineHallParameters,
    "street": StreetParameters,
}


def body_names(scene: SceneParameters) -> list[str]:
    """Return the names of the moving bodies of a scene; the first has the id 1."""
    return scene.bodies.names() if isinstance(scene, PlaceParameters) else []


def has_surfaces(scene: SceneParameters) -> bool:
    """Return whether a scene has anything but points and lines."""
    return not isinstance(scene, HouseParameters | CloudParameters | PointFileParameters)


def check_surfaces(scene: SceneParameters) -> None:
    """Refuse images of a scene without surfaces.

    :raises ConfigurationError: for such a scene.
    """
    if not has_surfaces(scene):
        raise ConfigurationError(
            f"scene.type = {scene.type!r}: has points and lines only, nothing to make images of; "
            "room, planes, places, aprilgrid and checkerboard have surfaces"
        )


def list_scenes() -> list[str]:
    """Return all kinds of scenes, and the names of the others in config/scenes."""
    return [*TYPES, *(name for name in names("scenes") if name not in TYPES)]


def find_scene(name: str) -> type[SceneParameters]:
    """Return the section of a scene type.

    :raises ConfigurationError: for a type that does not exist.
    """
    if name not in TYPES:
        raise ConfigurationError(f"scene.type = {name!r}: {suggestion(name, list_scenes())}")
    return TYPES[name]
