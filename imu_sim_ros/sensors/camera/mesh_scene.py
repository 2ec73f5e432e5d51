# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""A mesh as a scene: put into the world, with landmarks, and how a path lies in it."""

from pathlib import Path
from typing import Final

import numpy as np

from imu_sim_ros import rotation
from imu_sim_ros.places.geometry import NO_SURFACES
from imu_sim_ros.places.mesh import (
    MeshCaster,
    box,
    placed,
    scattered,
    size_remarks,
    spread,
    up_axis,
)
from imu_sim_ros.places.mesh_file import Mesh, areas, read_mesh
from imu_sim_ros.random_streams import generator
from imu_sim_ros.sensors.camera.scene import Scene
from imu_sim_ros.sensors.camera.scene_parameters import MeshParameters
from imu_sim_ros.sensors.camera.view import View
from imu_sim_ros.trajectory.motion import Trajectory
from imu_sim_ros.types import Array

_CLEARANCE: Final = 0.1
"""Distance from the mesh below which a path comes close to it [m]."""
_LOOKS: Final = 1000
"""Moments of a path that are looked at."""
_LONGEST: Final = 600.0
"""How much of an endless path is looked at [s]."""
_WAYS: Final = 64
"""Directions that are looked into from each."""
_EYES: Final = 24
"""Places of the path of which at least one sees each landmark."""
_ROUNDS: Final = 20
"""How often points are looked for that the path sees."""
_LEAST: Final = 0.02
"""Share of directions in which there should be something."""
_BEHIND: Final = 0.5
"""Share of directions that meet a face from behind from which on a mesh seems inside out."""


def mesh_scene(p: MeshParameters, path: Array) -> Scene:
    """Return a mesh in the world, with landmarks on what is seen from the path.

    :param path: (n, 3) places of all cameras [m].
    :raises InputError: for a file that cannot be used.
    :raises MissingDependencyError: if trimesh or embreex is not installed.
    """
    file = Path(p.mesh)
    mesh = read_mesh(file)
    turn = rotation.to_matrix(rotation.from_euler(np.array([0.0, 0.0, p.yaw])))
    matrix = turn @ np.reshape(p.orientation, (3, 3)) @ up_axis(p.up, file.suffix) * p.scale
    middle = 0.5 * (path.min(axis=0) + path.max(axis=0)) if p.anchor == "path" else None
    mesh = placed(mesh, matrix, np.asarray(p.position), middle)
    caster = MeshCaster(mesh)
    landmarks = _seen_from(mesh, caster, path, p)
    low, high = box(mesh)
    extent = float(np.linalg.norm(high - low))
    return Scene(
        landmarks,
        np.zeros_like(landmarks),
        np.zeros((0, 2, 3)),
        NO_SURFACES,
        extent,
        mesh=mesh,
        caster=caster,
    )


def _seen_from(mesh: Mesh, caster: MeshCaster, path: Array, p: MeshParameters) -> Array:
    """Return landmarks, evenly spread over what some places of the path see; none: nothing."""
    stream = generator(p.seed, "scene.landmarks")
    eyes = path[np.linspace(0, len(path) - 1, _EYES).astype(np.int64)]
    found: list[Array] = []
    sums = np.cumsum(areas(mesh))
    for _ in range(_ROUNDS):
        points = scattered(mesh, sums, p.landmarks, stream)
        seen = np.zeros(len(points), np.bool_)
        for eye in eyes:
            rest = np.flatnonzero(~seen)
            here = np.broadcast_to(eye, (len(rest), 3))
            seen[rest] = ~caster.hidden(here, points[rest])
        found.append(points[seen])
        if sum(map(len, found)) >= p.landmarks:
            break
    return np.concatenate(found)[: p.landmarks]


def mesh_warnings(
    scene: Scene, view: View, trajectory: Trajectory, first: bool = True
) -> list[str]:
    """Return a line for whatever is odd about a mesh, and about a camera's path in it.

    :param first: of all cameras; the others do not repeat what the mesh is.
    """
    if scene.mesh is None or scene.caster is None:
        return []
    t = np.linspace(0.0, min(view.duration, _LONGEST), _LOOKS)
    path = view.poses(trajectory, t).position
    return [
        *(size_remarks(scene.mesh) if first else ()),
        *_through(scene.caster, t, path),
        *_outside(scene.mesh, t, path),
        *_around(scene.mesh, scene.caster, t, path),
    ]


def _through(caster: MeshCaster, t: Array, path: Array) -> list[str]:
    meets = caster.blocked(path[:-1], path[1:] - path[:-1], 1.0)
    meets &= (path[1:] != path[:-1]).any(axis=1)
    if not meets.any():
        return []
    first = int(np.argmax(meets))
    times = "" if meets.sum() == 1 else f", and {int(meets.sum()) - 1} more times"
    return [f"the path goes through the mesh at {t[first]:.2f} s, {_shown(path[first])} m{times}"]


def _outside(mesh: Mesh, t: Array, path: Array) -> list[str]:
    """Return a line for a path that is in the mesh's box and leaves it."""
    low, high = box(mesh)
    out = ((path < low) | (path > high)).any(axis=1)
    if out.all() or not out.any():
        return []
    first = int(np.argmax(out))
    return [
        f"the path is outside of the mesh for {out.mean():.0%} of the time, first at "
        f"{t[first]:.2f} s, {_shown(path[first])} m; {_boxes(mesh, path)}"
    ]


def _around(mesh: Mesh, caster: MeshCaster, t: Array, path: Array) -> list[str]:
    """Return lines for a path that comes close, or is far, and for faces seen from behind."""
    ways = spread(_WAYS)
    count = len(path)
    meeting = caster.meet(path.repeat(_WAYS, axis=0), np.tile(ways, (count, 1)))
    distance = meeting.hits.distance.reshape(count, _WAYS).min(axis=1)
    lines = []
    nearest = int(np.argmin(distance))
    if distance[nearest] < _CLEARANCE:
        lines.append(
            f"the path comes as close as {distance[nearest]:.3f} m to the mesh at "
            f"{t[nearest]:.2f} s, {_shown(path[nearest])} m"
        )
    meets = meeting.hits.surface >= 0
    if meets.mean() < _LEAST:
        return [
            *lines,
            f"hardly anything of the mesh is around the path, in {meets.mean():.1%} of all "
            f"directions; {_boxes(mesh, path)}",
        ]
    behind = float((meeting.along[meets] > 0.0).mean())
    if behind > _BEHIND:
        lines.append(
            f"{behind:.0%} of what lies around the path shows its back: the mesh is inside out, or "
            "the path is inside of a body; faces are drawn from both sides"
        )
    return lines


def _boxes(mesh: Mesh, path: Array) -> str:
    low, high = box(mesh)
    return (
        f"the path is within {_shown(path.min(axis=0))} to {_shown(path.max(axis=0))} m, the mesh "
        f"within {_shown(low)} to {_shown(high)} m (scene.position, scene.scale, scene.up; "
        "scene.anchor path puts its middle into the path's)"
    )


def _shown(position: Array) -> str:
    digits = 2 if float(np.abs(position).max()) < 1e4 else 0
    return "(" + ", ".join(f"{x:.{digits}f}" for x in position) + ")"
