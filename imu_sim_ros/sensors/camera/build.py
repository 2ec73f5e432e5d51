# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Construction of a scene from its parameters, with places and sizes drawn from its seed."""

import math
from collections.abc import Sequence
from pathlib import Path
from typing import Final

import numpy as np

from imu_sim_ros.core import rotation
from imu_sim_ros.core.blocks import ceil_divide
from imu_sim_ros.core.errors import ConfigurationError
from imu_sim_ros.core.random_streams import generator
from imu_sim_ros.core.types import Array
from imu_sim_ros.places.bodies import Crowd
from imu_sim_ros.places.catalogue import around, describe_stretch
from imu_sim_ros.places.catalogue import build as build_place
from imu_sim_ros.places.geometry import Surfaces, is_hidden, join_surfaces, surfaces
from imu_sim_ros.places.paint import Painter
from imu_sim_ros.places.place import Place, Site
from imu_sim_ros.places.shadows import sunlight
from imu_sim_ros.places.walks import Passage, moving_bodies
from imu_sim_ros.sensors.camera.mesh_scene import mesh_scene
from imu_sim_ros.sensors.camera.scene import Scene, read_points
from imu_sim_ros.sensors.camera.scene_parameters import (
    AprilgridParameters,
    AutoParameters,
    CheckerboardParameters,
    CloudParameters,
    HouseParameters,
    MeshParameters,
    PathSceneParameters,
    PlaceParameters,
    PlanesParameters,
    PointFileParameters,
    RoomParameters,
    SceneParameters,
    TargetParameters,
)
from imu_sim_ros.sensors.camera.tracker import Tracker
from imu_sim_ros.sensors.camera.view import View, transform_to_camera
from imu_sim_ros.trajectory.motion import Trajectory

_LOOKS: Final = 20_000
"""Positions along a path at which a scene is fitted to it."""
_SIGHTS: Final = 500
"""Positions from which it is looked how near everything is."""
_LONGEST: Final = 600.0
"""Length of an endless path that is checked against its room [s]."""
_FRAMES: Final = 64
"""Frames of a cloud that are counted at once."""
_TRIES: Final = 20
"""Largest number of times that points of a cloud are added for a frame."""
_SAMPLES: Final = 1000
"""Points of a cloud from which it is seen whether a camera sees any."""
_IN_FRONT: Final = 0.1
"""Cosine of the largest angle from the axis at which a cloud has points."""
_FURNITURE: Final = 0.8
"""Largest depth of a box into the room, in distances of the path from the wall."""


def build_scene(
    parameters: SceneParameters,
    arms: Array,
    views: Sequence[View],
    trajectory: Trajectory,
    span: float,
) -> Scene:
    """Return the scene that the parameters describe.

    :param arms: (k, 3) positions in the body of all sensors that see it; a room encloses their
        paths [m].
    :param views: the cameras among them, for which a cloud is generated.
    :param span: time span of the trajectory that the scene is made for, :func:`scene_span` [s].
    :raises InputError: for a file of points or triangles that cannot be used.
    :raises MissingDependencyError: for a mesh, if trimesh or embreex is not installed.
    """
    match parameters:
        case AutoParameters():
            return _office_or_room(parameters, _passage(arms, trajectory, span))
        case RoomParameters():
            return _room(parameters, _path(arms, trajectory, span))
        case PlaceParameters():
            return _place(parameters, _passage(arms, trajectory, span))
        case HouseParameters():
            return _house(parameters)
        case CloudParameters():
            return _cloud(parameters, views, trajectory, span)
        case PlanesParameters():
            return _planes(parameters)
        case AprilgridParameters():
            return _target(parameters, *_aprilgrid(parameters))
        case CheckerboardParameters():
            return _target(parameters, *_checkerboard(parameters))
        case PointFileParameters():
            return Scene.of_points(read_points(Path(parameters.file)))
        case MeshParameters():
            return mesh_scene(parameters, _path(arms, trajectory, span))
    raise ConfigurationError(f"scene.type = {parameters.type!r}: cannot be built as a scene")


def scene_span(parameters: SceneParameters, duration: float) -> float:
    """Return the length of trajectory that a scene is made for [s]: all of a finite one.

    :param duration: duration of the trajectory [s]; may be infinite.
    """
    if math.isfinite(duration) or not isinstance(parameters, PathSceneParameters):
        return duration
    return parameters.horizon


def check_path(
    parameters: SceneParameters,
    arms: Array,
    trajectory: Trajectory,
    duration: float,
    scene: Scene,
) -> None:
    """Check that a path stays inside its room or place, and free of what stands in it.

    :param arms: (k, 3) positions in the body of all sensors that see the scene [m].
    :param duration: duration of the simulation [s].
    :param scene: the scene that was built for this path.
    :raises ConfigurationError: if it does not; the line names the parameter to change.
    """
    if not isinstance(parameters, RoomParameters | PlaceParameters):
        return
    path = _path(arms, trajectory, min(duration, _LONGEST))
    low, high = path.min(axis=0), path.max(axis=0)
    kind = parameters.type
    if isinstance(parameters, AutoParameters):
        kind = "room" if scene.painter is None else "office"
    if scene.painter is not None:
        corner, end = scene.painter.place.low, scene.painter.place.high
    else:
        walls = scene.surfaces.origin[:6]
        ends = walls + scene.surfaces.across[:6] + scene.surfaces.up[:6]
        corner, end = np.minimum(walls, ends).min(axis=0), np.maximum(walls, ends).max(axis=0)
    if isinstance(parameters, PlaceParameters) and any(parameters.size):
        meets = is_hidden(scene.surfaces, path[:-1], path[1:])
        if meets.any():
            where = _format_position(path[int(np.argmax(meets))])
            raise ConfigurationError(
                f"scene.size = {list(parameters.size)}: the path meets something at {where} m; "
                f"without a size the {kind} leaves it free, and trajectory.type tour "
                "flies around everything"
            )
    if (low <= corner).any() or (high >= end).any():
        setting = f"size = {list(parameters.size)}"
        if not any(parameters.size):
            setting = f"horizon = {parameters.horizon:g}"
        raise ConfigurationError(
            f"scene.{setting}: the path, from {_format_position(low)} to "
            f"{_format_position(high)} m, leaves the {kind}, from {_format_position(corner)} "
            f"to {_format_position(end)} m"
        )


def _path(arms: Array, trajectory: Trajectory, duration: float) -> Array:
    """Return positions (n, 3) of all sensors that see along the path."""
    return np.concatenate(_passage(arms, trajectory, duration).places)


def _passage(arms: Array, trajectory: Trajectory, duration: float) -> Passage:
    """Return the paths of all cameras in the world.

    :param arms: (k, 3) positions of the cameras on the body [m].
    """
    t = np.linspace(0.0, duration, _LOOKS)
    motion = trajectory.sample(np.clip(t, 0.0, trajectory.duration))
    positions = motion.position + rotation.rotate(motion.q_wb, arms[:, None])
    foot = float(motion.position[:, 2].min())
    return Passage(t, positions, duration >= trajectory.duration, foot)


def _room(p: RoomParameters, path: Array) -> Scene:
    """Return the walls of a room around a path, with random landmarks on them."""
    low, high = path.min(axis=0), path.max(axis=0)
    if any(p.size):
        size, center = np.asarray(p.size), np.asarray(p.center)
        corner, end = center - 0.5 * size, center + 0.5 * size
    else:
        corner, end = low - p.margin, high + p.margin
    walls = surfaces(_inner_faces(corner, end), hides=False)
    stream = generator(p.seed, "scene.boxes")
    boxes: list[tuple[Array, Array, Array]] = []
    for _ in range(p.boxes):
        boxes += _outer_faces(*_box(stream, corner, end, low, high))
    everything = join_surfaces(walls, surfaces(boxes, hides=True))
    landmarks, normals = _scatter(everything, p.landmarks, p.seed)
    extent = float(np.linalg.norm(end - corner))
    return Scene(
        landmarks=landmarks,
        normals=normals,
        surfaces=everything,
        extent=extent,
    )


def _place(p: PlaceParameters, passage: Passage) -> Scene:
    """Return a furnished place around a path."""
    path, note = np.concatenate(passage.places), ""
    if any(p.size):
        size, center = np.asarray(p.size), np.asarray(p.center)
        low, high = center - 0.5 * size, center + 0.5 * size
    else:
        low, high = around(p.type, path, passage.foot)
        note = describe_stretch(p.type, low, high)
    keep = np.zeros((0, 3)) if any(p.size) else path  # a place of a given size is as it is
    site = Site(
        low=low,
        high=high,
        path=keep,
        seed=p.seed,
        texture=p.texture,
        light=p.light,
        doors=p.bodies.doors,
    )
    place = build_place(p.type, site)
    everything = place.surfaces()
    landmarks, normals = _scatter(everything.some(~place.sky), p.landmarks, p.seed)
    extent = float(np.linalg.norm(high - low))
    crowd = _crowd(p, place, site, passage)
    painter = Painter(place, site, path[:: ceil_divide(len(path), _SIGHTS)])
    return Scene(
        landmarks=landmarks,
        normals=normals,
        surfaces=everything,
        extent=extent,
        painter=painter,
        crowd=crowd,
        note=note,
    )


def _office_or_room(p: AutoParameters, passage: Passage) -> Scene:
    """Return an office, or a room around a path that is too large for one."""
    path, room = np.concatenate(passage.places), p.room
    if room is not None:
        try:
            around("office", path, passage.foot)
        except ConfigurationError:
            length, width, _ = np.ptp(path, axis=0)
            return _room(room, path)._replace(
                note=f"scene.type auto: a room, since an office is too small for a path of "
                f"{length:.1f} x {width:.1f} m"
            )
    return _place(p.office, passage)


def _crowd(p: PlaceParameters, place: Place, site: Site, passage: Passage) -> Crowd | None:
    """Return the moving bodies of a place."""
    crowd_parameters = p.bodies
    counts = {
        "person": crowd_parameters.people,
        "cart": crowd_parameters.carts,
        "door": crowd_parameters.doors,
    }
    if not any(counts.values()):
        return None
    bodies = moving_bodies(place, site, counts, crowd_parameters.speed, passage)
    points = [
        _scatter(body.surfaces(), crowd_parameters.landmarks, p.seed + k)
        for k, body in enumerate(bodies, start=1)
    ]
    return Crowd(bodies, site, points, sunlight(place.surfaces(), place.sky, place.lighting))


def _format_position(position: Array) -> str:
    """Return a position as text."""
    return "(" + ", ".join(f"{x:.2f}" for x in position) + ")"


def _box(
    stream: np.random.Generator, corner: Array, end: Array, low: Array, high: Array
) -> tuple[Array, Array]:
    """Return two opposite corners (3,) of a box that stands against a wall, off the path [m].

    :param corner, end: (3,) lower and upper corner of the room [m].
    :param low, high: (3,) lower and upper corner of the box around the path [m].
    """
    axis, side = int(stream.integers(0, 2)), int(stream.integers(0, 2))
    free = (low - corner)[axis] if side == 0 else (end - high)[axis]
    depth = _FURNITURE * free * stream.uniform(0.4, 1.0)
    size = (end - corner) * stream.uniform(0.08, 0.2, 3)
    size[axis] = depth
    size[2] = (end - corner)[2] * stream.uniform(0.2, 0.7)
    box_corner = corner + (end - corner - size) * stream.random(3)
    box_corner[axis] = corner[axis] if side == 0 else end[axis] - depth
    box_corner[2] = corner[2]
    return box_corner, box_corner + size


def _inner_faces(low: Array, high: Array) -> list[tuple[Array, Array, Array]]:
    """Return the six faces of a box, their normals inwards."""
    return [(o + b, a, -b) for o, a, b in _outer_faces(low, high)]


def _outer_faces(low: Array, high: Array) -> list[tuple[Array, Array, Array]]:
    """Return the six faces of a box, their normals outwards."""
    x, y, z = np.diag(high - low)
    return [
        (low, z, y),
        (low + x, y, z),
        (low, x, z),
        (low + y, z, x),
        (low, y, x),
        (low + z, x, y),
    ]


def _scatter(
    where: Surfaces, count: int, seed: int, both_sides: bool = False
) -> tuple[Array, Array]:
    """Return landmarks (n, 3) spread evenly over all surfaces, and their normals (n, 3)."""
    stream = generator(seed, "scene.landmarks")
    areas = np.linalg.norm(np.cross(where.across, where.up), axis=1)
    surface = np.searchsorted(np.cumsum(areas) / areas.sum(), stream.random(count))
    surface = np.minimum(surface, len(areas) - 1)
    s, t = stream.uniform(0.02, 0.98, (2, count, 1))
    points = where.origin[surface] + s * where.across[surface] + t * where.up[surface]
    normals = np.zeros_like(points) if both_sides else where.normal[surface]
    return points, normals


def _planes(p: PlanesParameters) -> Scene:
    """Return given planes with random landmarks on them."""
    corners = np.reshape(p.corners, (-1, 3, 3))
    where = surfaces([(o, a - o, b - o) for o, a, b in corners], hides=True, texture="plane")
    landmarks, normals = _scatter(where, p.landmarks, p.seed, both_sides=True)
    extent = float(np.linalg.norm(np.ptp(corners.reshape(-1, 3), axis=0)))
    return Scene(
        landmarks=landmarks,
        normals=normals,
        surfaces=where,
        extent=extent,
    )


def _house(p: HouseParameters) -> Scene:
    """Return the lines' end points, each once, in the order of their first mention."""
    ends = np.reshape(p.lines, (-1, 3))
    _, first_rows = np.unique(ends, axis=0, return_index=True)
    points = ends[np.sort(first_rows)]
    if any(p.second_points):
        points = np.concatenate([points, points + np.asarray(p.second_points)])
    return Scene.of_points(points)._replace(lines=ends.reshape(-1, 2, 3))


def _cloud(
    p: CloudParameters, views: Sequence[View], trajectory: Trajectory, duration: float
) -> Scene:
    """Return points such that every frame sees ``visible`` of them, as OpenVINS' simulator does.

    :raises ConfigurationError: without cameras, and for depths that they do not see.

    If a camera sees too few of the points so far, random pixels become points at random depths:
    first at viewpoints along the path, then in the frames between them.
    """
    if not views:
        raise ConfigurationError("scene.type = cloud: is made for cameras, and there is none")
    _check_depths(p, views)
    stream = generator(p.seed, "scene.landmarks")
    times = np.arange(0.0, duration, p.spacing)
    all_poses = [view.poses(trajectory, times) for view in views]
    points = np.zeros((0, 3))
    for k in range(len(times)):
        for view, poses in zip(views, all_poses, strict=True):
            pose = type(poses)(poses.position[k : k + 1], poses.q_wc[k : k + 1])
            missing = p.visible - _count_visible(view, transform_to_camera(pose, points))
            if missing > 0:
                local = _draw_points_in_view(view, missing, p, stream)
                points = np.concatenate([points, pose.position + rotation.rotate(pose.q_wc, local)])
    extra_stream = generator(p.seed, "scene.landmarks.frames")
    for view in views:
        points = _fill_views(points, p, view, trajectory, duration, extra_stream)
    return Scene.of_points(points)


def _check_depths(p: CloudParameters, views: Sequence[View]) -> None:
    """Refuse a cloud whose points are outside the camera's range of depths.

    :raises ConfigurationError: with both ranges.
    """
    for view in views:
        camera, stream = view.parameters, generator(p.seed, "scene.depths")
        depth = _draw_points_in_view(view, _SAMPLES, p, stream)[:, 2]
        if not ((depth > camera.min_depth) & (depth < camera.max_depth)).any():
            raise ConfigurationError(
                f"scene.near = {p.near:g}, scene.far = {p.far:g}: no point between them is in the "
                f"depths that {view.name} sees, {view.name}.camera.min_depth = "
                f"{camera.min_depth:g} to max_depth = {camera.max_depth:g} m"
            )


def _fill_views(
    points: Array,
    p: CloudParameters,
    view: View,
    trajectory: Trajectory,
    duration: float,
    stream: np.random.Generator,
) -> Array:
    """Return the points (n, 3), and more behind them, so that every single frame sees enough.

    Frames lie between the viewpoints, and a border or a rolling shutter takes some of the points.
    """
    total = view.total
    total = math.ceil(duration * view.parameters.rate) if total is None else total
    tracker, first_frame, tries = Tracker(view, Scene.of_points(points), trajectory), 0, 0
    while first_frame < total:
        counts = tracker.counts(first_frame, min(_FRAMES, total - first_frame))
        few = np.flatnonzero((counts >= 0) & (counts < p.visible))
        if not len(few):
            first_frame, tries = first_frame + len(counts), 0
            continue
        first_frame, tries = first_frame + int(few[0]), tries + 1 if few[0] == 0 else 0
        if tries > _TRIES:  # out of the depths that it sees, for instance
            first_frame, tries = first_frame + 1, 0
            continue
        pose = view.poses(trajectory, view.seconds(view.frames(first_frame, 1).true_t_ns))
        local = _draw_points_in_view(view, p.visible - int(counts[few[0]]), p, stream)
        points = np.concatenate([points, pose.position + rotation.rotate(pose.q_wc, local)])
        tracker = Tracker(view, Scene.of_points(points), trajectory)
    return points


def _draw_points_in_view(
    view: View, count: int, p: CloudParameters, stream: np.random.Generator
) -> Array:
    """Return points (count, 3) in the camera's frame, each in a random pixel."""
    visible_points = np.zeros((0, 3))
    while len(visible_points) < count:
        pixel = stream.random((count, 2)) * (view.model.width, view.model.height) - 0.5
        ray = view.model.unproject(pixel)
        local = ray.direction * stream.uniform(p.near, p.far, (count, 1))
        # A wide lens sees beyond 90 degrees, where a landmark has no depth.
        visible_points = np.concatenate(
            [visible_points, local[ray.valid & (local[:, 2] > p.near * _IN_FRONT)]]
        )
    return visible_points[:count]


def _count_visible(view: View, local: Array) -> int:
    """Return the number of points (n, 3) in the camera's frame that its image shows."""
    in_front = local[(local[:, 2] > view.parameters.min_depth)]
    uv, valid = view.model.project(in_front)
    return int(np.count_nonzero(valid & view.model.inside(uv)))


def _aprilgrid(p: AprilgridParameters) -> tuple[Array, Array, Array]:
    """Return the tags' corners (n, 3) in the target's frame, and the board's corner and size.

    kalibr's order: tags row by row from the lower left, of each tag lower left, lower right, upper
    right, upper left (GridCalibrationTargetAprilgrid.cpp).
    """
    pitch = p.tag_size * (1.0 + p.tag_spacing)
    tags = [(column * pitch, row * pitch) for row in range(p.rows) for column in range(p.columns)]
    corners = np.array([[0.0, 0.0], [1.0, 0.0], [1.0, 1.0], [0.0, 1.0]]) * p.tag_size
    plane = (np.array(tags)[:, None] + corners).reshape(-1, 2)
    # Black squares in the gaps close the pattern on all four sides.
    gap = p.tag_spacing * p.tag_size
    size = np.array([p.columns, p.rows]) * pitch + gap
    return np.pad(plane, ((0, 0), (0, 1))), np.array([-gap, -gap]), size


def aprilgrid_corners(p: AprilgridParameters) -> Array:
    """Return the corners of an AprilGrid's tags (4 n, 3) in the world [m], in kalibr's order."""
    corners, _, _ = _aprilgrid(p)
    return _board_corners(p, corners)


def _checkerboard(p: CheckerboardParameters) -> tuple[Array, Array, Array]:
    """Return the inner corners (n, 3), row by row from the lower left, board's corner and size."""
    row, column = np.divmod(np.arange(p.rows * p.columns), p.columns)
    plane = np.stack([column, row], axis=1) * p.square
    size = np.array([p.columns + 1, p.rows + 1]) * p.square
    return np.pad(plane, ((0, 0), (0, 1))), np.array([-p.square, -p.square]), size


def _board_corners(p: TargetParameters, corners: Array) -> Array:
    """Return corners (n, 3) of a board in the world."""
    moved: Array = np.asarray(p.position) + corners @ np.reshape(p.orientation, (3, 3)).T
    return moved


def _target(p: TargetParameters, corners: Array, board_corner: Array, size: Array) -> Scene:
    """Return a calibration board as a scene.

    :param corners: (n, 3) landmarks on the board, in its axes [m].
    :param board_corner: (2,) lower left corner of the board in its axes [m].
    :param size: (2,) width and height of the board [m].
    """
    r_wt, p_wt = np.reshape(p.orientation, (3, 3)), np.asarray(p.position)
    landmarks = _board_corners(p, corners)
    normals = np.broadcast_to(r_wt[:, 2], landmarks.shape)
    board = (p_wt + r_wt[:, :2] @ board_corner, size[0] * r_wt[:, 0], size[1] * r_wt[:, 1])
    where = surfaces([board], hides=True, texture=p.type)
    return Scene(
        landmarks=landmarks,
        normals=normals,
        surfaces=where,
        extent=float(np.linalg.norm(size)),
    )
