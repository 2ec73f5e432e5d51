# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""A mesh as a scene: put into the world, with landmarks on what a path sees of it."""

from pathlib import Path
from typing import Final

import numpy as np

from imu_sim_ros.core import rotation
from imu_sim_ros.core.random_streams import generator
from imu_sim_ros.core.types import Array
from imu_sim_ros.places.geometry import NO_SURFACES
from imu_sim_ros.places.mesh import (
    MeshCaster,
    box,
    place_mesh,
    scatter_points,
    up_axis_rotation,
)
from imu_sim_ros.places.mesh_file import Mesh, areas, read_mesh
from imu_sim_ros.sensors.camera.scene import Scene
from imu_sim_ros.sensors.camera.scene_parameters import MeshParameters

_EYES: Final = 24
"""Number of positions on the path; at least one of them sees each landmark."""
_ROUNDS: Final = 20
"""Largest number of times that points are drawn to find some that the path sees."""


def mesh_scene(p: MeshParameters, path: Array) -> Scene:
    """Return a mesh in the world, with landmarks on its parts that the path sees.

    :param path: (n, 3) places of all cameras [m].
    :raises InputError: for a file that cannot be used.
    :raises MissingDependencyError: if trimesh or embreex is not installed.
    """
    file = Path(p.mesh)
    mesh = read_mesh(file)
    turn = rotation.to_matrix(rotation.from_euler(np.array([0.0, 0.0, p.yaw])))
    matrix = (
        turn @ np.reshape(p.orientation, (3, 3)) @ up_axis_rotation(p.up, file.suffix) * p.scale
    )
    middle = 0.5 * (path.min(axis=0) + path.max(axis=0)) if p.anchor == "path" else None
    mesh = place_mesh(mesh, matrix, np.asarray(p.position), middle)
    caster = MeshCaster(mesh)
    landmarks = _draw_visible_landmarks(mesh, caster, path, p)
    low, high = box(mesh)
    extent = float(np.linalg.norm(high - low))
    return Scene(
        landmarks=landmarks,
        normals=np.zeros_like(landmarks),
        surfaces=NO_SURFACES,
        extent=extent,
        mesh=mesh,
        caster=caster,
    )


def _draw_visible_landmarks(
    mesh: Mesh, caster: MeshCaster, path: Array, p: MeshParameters
) -> Array:
    """Return landmarks spread evenly over the parts visible from the path; maybe none."""
    stream = generator(p.seed, "scene.landmarks")
    eyes = path[np.linspace(0, len(path) - 1, _EYES).astype(np.int64)]
    landmarks: list[Array] = []
    sums = np.cumsum(areas(mesh))
    for _ in range(_ROUNDS):
        points = scatter_points(mesh, sums, p.landmarks, stream)
        visible = np.zeros(len(points), np.bool_)
        for eye in eyes:
            rest = np.flatnonzero(~visible)
            origins = np.broadcast_to(eye, (len(rest), 3))
            visible[rest] = ~caster.is_hidden(origins, points[rest])
        landmarks.append(points[visible])
        if sum(map(len, landmarks)) >= p.landmarks:
            break
    return np.concatenate(landmarks)[: p.landmarks]
