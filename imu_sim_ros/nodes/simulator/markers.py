# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""A scene and its cameras for RViz and Foxglove: visualization_msgs/MarkerArray."""

from collections.abc import Mapping, Sequence
from typing import Final

import numpy as np
from geometry_msgs.msg import Point
from std_msgs.msg import ColorRGBA
from visualization_msgs.msg import Marker, MarkerArray

from imu_sim_ros.core.types import Array
from imu_sim_ros.places.geometry import Surfaces
from imu_sim_ros.sensors.camera.declaration import cameras_in
from imu_sim_ros.sensors.camera.model import CameraModel
from imu_sim_ros.sensors.declaration import Mounted
from imu_sim_ros.sensors.parameters import MountedParameters
from imu_sim_ros.sensors.world import World

_SIZE: Final = 0.03
"""Size of a landmark; lines are a third as wide [m]."""
_FRUSTUM: Final = 0.3
"""Length of a camera's drawn view [m]."""
_COLORS: Final = {
    "landmarks": (0.9, 0.7, 0.1),
    "lines": (0.2, 0.6, 0.9),
    "surfaces": (0.6, 0.6, 0.6),
    "cameras": (0.1, 0.8, 0.3),
}


def markers(sensors: Mapping[str, Mounted[MountedParameters]], world: World) -> MarkerArray:
    """Return landmarks, lines and the edges of surfaces in the world, and each camera's view."""
    scene, world_frame = world.scene, world.environment.world_frame
    shapes = [
        _marker(Marker.POINTS, "landmarks", world_frame, scene.landmarks),
        _marker(Marker.LINE_LIST, "lines", world_frame, scene.lines.reshape(-1, 3)),
        _marker(Marker.LINE_LIST, "surfaces", world_frame, _edges(scene.surfaces)),
    ]
    for k, camera in enumerate(cameras_in(sensors).values()):
        ends = _frustum(CameraModel(camera.parameters))
        shown = _marker(Marker.LINE_LIST, "cameras", camera.frame, ends)
        shown.id = k
        shapes.append(shown)
    return MarkerArray(markers=[marker for marker in shapes if marker.points])


def _marker(kind: int, name: str, frame: str, points: Array) -> Marker:
    """Return points, or pairs of them as lines; a marker moves with its frame."""
    marker = Marker(type=kind, ns=name, action=Marker.ADD, frame_locked=True)
    marker.header.frame_id = frame
    marker.pose.orientation.w = 1.0
    width = _SIZE if kind == Marker.POINTS else _SIZE / 3.0
    marker.scale.x = marker.scale.y = width
    red, green, blue = _COLORS[name]
    marker.color = ColorRGBA(r=red, g=green, b=blue, a=1.0)
    marker.points = [Point(x=x, y=y, z=z) for x, y, z in points.tolist()]
    return marker


def _pairs(corners: Sequence[Array]) -> list[Array]:
    """Return the ends of the lines from each corner to the next, and from the last to the first."""
    following = [*corners[1:], corners[0]]
    return [end for pair in zip(corners, following, strict=True) for end in pair]


def _edges(surfaces: Surfaces) -> Array:
    """Return the ends (2 m, 3) of the edges of rectangles, two points for each edge."""
    ends = [end for corners in surfaces.corners for end in _pairs(list(corners))]
    return np.array(ends).reshape(-1, 3)


def _frustum(model: CameraModel) -> Array:
    """Return the four rays through the corners of the image, and the edges that join them."""
    w, h = model.width - 1.0, model.height - 1.0
    corners = np.array([[0.0, 0.0], [w, 0.0], [w, h], [0.0, h]])
    directions = model.unproject(corners).direction * _FRUSTUM
    rays = list(directions[np.isfinite(directions).all(axis=1)])
    ends = [end for ray in rays for end in (np.zeros(3), ray)]
    return np.array([*ends, *(_pairs(rays) if rays else [])]).reshape(-1, 3)
