# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Checks of the path of a sensor that sees through its scene, and of its view."""

from collections.abc import Iterator
from typing import Final, NamedTuple

import numpy as np

from imu_sim_ros.core import rotation
from imu_sim_ros.core.types import Array, Mask
from imu_sim_ros.places.mesh import fibonacci_directions, size_remarks
from imu_sim_ros.places.rays import RayTracer
from imu_sim_ros.sensors.camera.rig_parameters import rig_parameters_of
from imu_sim_ros.sensors.camera.scene import Scene
from imu_sim_ros.sensors.camera.scene_parameters import has_surfaces
from imu_sim_ros.sensors.declaration import Mounted
from imu_sim_ros.sensors.parameters import MountedParameters
from imu_sim_ros.sensors.world import World

_CLEARANCE: Final = 0.1
"""Distance from a surface below which a path comes close to it [m]."""
_POSITIONS: Final = 1000
"""Number of positions on a path that are checked."""
_MOMENTS: Final = 100
"""Number of moments at which a sensor looks for anything in its field of view."""
_RAY_POSITIONS: Final = 250
"""Number of positions from which rays go in all directions."""
_LONGEST: Final = 600.0
"""Length of an endless path that is checked [s]."""
_DIRECTIONS: Final = 64
"""Number of directions around a position."""
_LEAST: Final = 0.02
"""Share of directions in which a mesh around a path has something."""
_BEHIND: Final = 0.5
"""Share of directions that meet a face from behind from which on a mesh seems inside out."""


class _Path(NamedTuple):
    """Positions of a sensor in its scene."""

    scene: Scene
    name: str
    """Name of the scene in messages."""
    t: Array
    """(n,) time since the start of the run [s]."""
    position: Array
    """(n, 3) p_ws [m]."""


def scene_warnings(mounted: Mounted[MountedParameters], world: World, duration: float) -> list[str]:
    """Return a line for each way in which a sensor's path or view does not suit the scene.

    The path goes through surfaces, leaves the scene or comes close to it, there is nothing around
    it, a mesh has defects, or the sensor has nothing in its field of view.

    :param duration: length of the run [s]; may be infinite.
    """
    scene, sensor = world.scene, mounted.sensor
    longest = min(duration, world.trajectory.duration, _LONGEST)
    t = np.linspace(0.0, longest, _POSITIONS)
    motion = world.trajectory.sample(t)
    arm = mounted.parameters.mount()[:3, 3]
    position = motion.position + rotation.rotate(motion.q_wb, arm[None])
    kind = rig_parameters_of(mounted.environment).scene.type
    path = _Path(scene, "mesh" if scene.mesh is not None else f"scene {kind}", t, position)
    lines = _path_lines(path)
    moments = np.linspace(0.0, longest, _MOMENTS, endpoint=False)
    if sensor.in_sight is not None:
        lines += _blind_lines(sensor.in_sight(mounted, world, moments), moments, mounted)
    elif not has_surfaces(rig_parameters_of(mounted.environment).scene):
        lines += _blind_lines(np.zeros(_MOMENTS, np.bool_), moments, mounted)
    remarks = size_remarks(scene.mesh) if scene.mesh is not None else ()
    return [*(f"scene: {line}" for line in remarks), *(f"{mounted.name}: {line}" for line in lines)]


def _blind_lines(in_sight: Mask, t: Array, mounted: Mounted[MountedParameters]) -> Iterator[str]:
    """Yield a line if a sensor has nothing in its field of view at some moments.

    :param in_sight: (n,) False where nothing is in view.
    :param t: (n,) times [s].
    """
    if in_sight.all():
        return
    scene, first_time = rig_parameters_of(mounted.environment).scene, t[int(np.argmin(in_sight))]
    if in_sight.any():
        share = 1.0 - float(in_sight.mean())
        yield f"nothing in sight for {share:.0%} of the time, first at {first_time:.2f} s"
    elif has_surfaces(scene):
        yield f"nothing in sight: nothing of scene.type = {scene.type!r} is in its field of view"
    else:
        yield f"nothing in sight of scene.type = {scene.type!r}, which has no surfaces"


def _path_lines(path: _Path) -> list[str]:
    """Return a line for each way in which a path does not suit the surfaces of its scene."""
    if not len(path.scene.surfaces.origin) and path.scene.caster is None:
        return []
    tracer = path.scene.tracer(moving=False)
    return [*_wall_problems(path, tracer), *_outside(path), *_around(path, tracer)]


def _wall_problems(path: _Path, tracer: RayTracer) -> Iterator[str]:
    """Yield a problem if the path passes through a surface."""
    step = np.diff(path.position, axis=0)
    length = np.sqrt((step * step).sum(axis=1))
    rows = np.flatnonzero(length > 0.0)
    traced = tracer.trace(path.t[rows], path.position[rows], step[rows] / length[rows, None])
    rows = rows[traced.distance < length[rows]]
    if len(rows):
        row, repeats = int(rows[0]), len(rows) - 1
        times = f", and {repeats} more times" if repeats else ""
        yield (
            f"the path goes through the {path.name} at {path.t[row]:.2f} s, "
            f"{_format_position(path.position[row])} m{times}"
        )


def _outside(path: _Path) -> Iterator[str]:
    """Yield a line for a path that is in the scene's box and leaves it."""
    low, high = path.scene.box()
    is_outside = ((path.position < low) | (path.position > high)).any(axis=1)
    if is_outside.any() and not is_outside.all():
        row = int(np.argmax(is_outside))
        yield (
            f"the path is outside of the {path.name} for {is_outside.mean():.0%} of the time, "
            f"first at {path.t[row]:.2f} s, {_format_position(path.position[row])} m; "
            f"{_boxes(path)}"
        )


def _around(path: _Path, tracer: RayTracer) -> Iterator[str]:
    """Yield lines for a path that comes close, or is far, and for faces seen from behind."""
    mesh = path.scene.mesh is not None
    rows = np.arange(0, _POSITIONS, 1 if mesh else _POSITIONS // _RAY_POSITIONS)
    origins = path.position[rows].repeat(_DIRECTIONS, axis=0)
    directions = np.tile(fibonacci_directions(_DIRECTIONS), (len(rows), 1))
    traced = tracer.trace(path.t[rows].repeat(_DIRECTIONS), origins, directions)
    distance = traced.distance.reshape(len(rows), _DIRECTIONS).min(axis=1)
    nearest = int(np.argmin(distance))
    if distance[nearest] < _CLEARANCE:
        row = rows[nearest]
        yield (
            f"the path comes as close as {distance[nearest]:.3f} m to the {path.name} at "
            f"{path.t[row]:.2f} s, {_format_position(path.position[row])} m"
        )
    meets = traced.surface >= 0
    if mesh and meets.mean() < _LEAST:
        yield (
            f"hardly anything of the {path.name} is around the path, in {meets.mean():.1%} of all "
            f"directions; {_boxes(path)}"
        )
    if not mesh or meets.mean() < _LEAST:
        return
    behind = float((traced.along[meets] > 0.0).mean())
    if behind > _BEHIND:
        yield (
            f"{behind:.0%} of what lies around the path shows its back: the mesh is inside out, or "
            "the path is inside of a body; faces are drawn from both sides"
        )


def _boxes(path: _Path) -> str:
    """Return path and scene as boxes in text, with a remedy."""
    low, high = path.scene.box()
    remedy = ""
    if path.scene.mesh is not None:
        remedy = (
            " (scene.position, scene.scale, scene.up; scene.anchor path puts its middle into the "
            "path's)"
        )
    return (
        f"the path is within {_format_position(path.position.min(axis=0))} to "
        f"{_format_position(path.position.max(axis=0))} m, the {path.name} within "
        f"{_format_position(low)} to {_format_position(high)} m{remedy}"
    )


def _format_position(position: Array) -> str:
    """Return a position as text."""
    digits = 2 if float(np.abs(position).max()) < 1e4 else 0
    return "(" + ", ".join(f"{x:.{digits}f}" for x in position) + ")"
