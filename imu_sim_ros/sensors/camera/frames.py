# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""A camera as a sensor: its frames in a window of time, and what each shows.

A frame depends on nothing but the seed and its number, and is made when somebody asks for it.
"""

from collections.abc import Callable, Mapping
from functools import cached_property
from typing import TYPE_CHECKING, Final, TypeVar

import numpy as np

from imu_sim_ros.core import rotation
from imu_sim_ros.core.blocks import ceil_divide
from imu_sim_ros.core.types import Array, Mask
from imu_sim_ros.parameters.kinds import IDENTITY_MATRIX
from imu_sim_ros.sensors.camera.images.libraries import opencv
from imu_sim_ros.sensors.camera.parameters import CameraParameters
from imu_sim_ros.sensors.camera.rig_parameters import rig_parameters_of
from imu_sim_ros.sensors.camera.scene_parameters import (
    AprilgridParameters,
    body_names,
    has_surfaces,
)
from imu_sim_ros.sensors.camera.target import target_warning
from imu_sim_ros.sensors.camera.tracker import Tracker
from imu_sim_ros.sensors.camera.view import Frames, View, view_of
from imu_sim_ros.sensors.declaration import Model, Mounted
from imu_sim_ros.sensors.deferred import Deferred, DeferredValues
from imu_sim_ros.sensors.model import FixedModel
from imu_sim_ros.sensors.samples import Samples
from imu_sim_ros.sensors.timing import SampleTimes
from imu_sim_ros.sensors.world import Window, World

if TYPE_CHECKING:
    from imu_sim_ros.sensors.camera.images.imager import Imager

_T = TypeVar("_T")
_LANDMARKS: Final = (200, 20_000)
"""Numbers of landmarks that are looked for in the field of view, the second ones if none is."""
_GRID: Final = 17
"""Pixels on each side of the image whose rays look for surfaces."""


class Camera(FixedModel):
    """The frames of a camera; any window may be read at any time."""

    def __init__(
        self, mounted: Mounted[CameraParameters], t0_ns: int, _: Mapping[str, Model]
    ) -> None:
        self.mounted = mounted
        self.times = SampleTimes(mounted.parameters.rate, t0_ns, mounted.parameters.phase)
        self._world: World | None = None

    def read(self, window: Window, world: World) -> Samples:
        """Return the frames in a window."""
        return self.samples(self.frames(window, world))

    def frames(self, window: Window, world: World) -> Frames:
        """Return times and numbers of the frames in a window."""
        begin, end = self.times.index(window.begin), self.times.index(window.end)
        return self.within(world).view.frames(begin, end - begin)

    def within(self, world: World) -> "Camera":
        """Set the world that the sensor is in."""
        self._world = world
        return self

    def samples(self, frames: Frames) -> Samples:
        """Return frames as samples, with tracks and images that are computed when they are used."""
        first_number, count = int(frames.number[0]) if len(frames.number) else 0, len(frames.number)
        p, scene = self.view.parameters, rig_parameters_of(self.mounted.environment).scene

        def per_frame(make: Callable[[int], _T], keep: bool = False) -> DeferredValues[_T]:
            return DeferredValues(make, frames.number.tolist(), self.world.threads, keep)

        values = Deferred(
            tracks=lambda: self.tracker.tracks(first_number, count),
            lines=lambda: self.tracker.lines(first_number, count),
            image=lambda: per_frame(self.imager.image, keep=p.images == "both"),
            depth_and_mask=lambda: per_frame(
                self.imager.depth_and_mask, keep=bool(body_names(scene))
            ),
            flow=lambda: per_frame(self.imager.flow),
            exposure=lambda: per_frame(self.imager.exposure),
        )
        times = frames.true_t_ns, frames.t_ns, frames.release_t_ns
        return Samples(*times, np.flatnonzero(frames.delivered), values, first_number)

    @property
    def world(self) -> World:
        """The world that it is in."""
        assert self._world is not None, "it is put in one first"
        return self._world

    @cached_property
    def view(self) -> View:
        """Frame times of the camera and its poses at them."""
        return view_of(self.mounted, self.world)

    @cached_property
    def tracker(self) -> Tracker:
        """Tracker of the landmarks in the camera's frames."""
        return Tracker(self.view, self.world.scene, self.world.trajectory)

    @cached_property
    def imager(self) -> "Imager":
        """Renderer of the camera's images.

        :raises ConfigurationError: for a scene without surfaces.
        :raises MissingDependencyError: if OpenCV or numba is not installed.
        """
        from imu_sim_ros.sensors.camera.images.imager import Imager, textures  # needs numba

        world, colour = self.world, self.view.parameters.encoding == "rgb8"
        if world.threads is not None:
            opencv().setNumThreads(1)  # the threads are ours
        scene, described = world.scene, rig_parameters_of(self.mounted.environment).scene
        look = world.share(f"textures {colour}", lambda: textures(scene, described, colour))
        return Imager(self.view, scene, look, world.trajectory)


def warnings(mounted: Mounted[CameraParameters], world: World, _: float) -> list[str]:
    """Return a line if a camera sees too little of the board that it was put before."""
    view, scene = view_of(mounted, world), rig_parameters_of(mounted.environment).scene
    lines = target_warning(scene, view, world.trajectory)
    return [f"{mounted.name}: {line}" for line in lines]


def visibility_mask(mounted: Mounted[CameraParameters], world: World, t: Array) -> Mask:
    """Return at which times (n,) [s] a camera has a landmark or a surface in its image."""
    view, scene = view_of(mounted, world), world.scene
    described = rig_parameters_of(mounted.environment).scene
    visible: Mask = np.zeros(len(t), np.bool_)
    for count in _LANDMARKS:
        rows = np.flatnonzero(~visible)
        step = ceil_divide(len(scene.landmarks), count) or 1
        sparse = scene._replace(landmarks=scene.landmarks[::step], normals=scene.normals[::step])
        t_ns = view.t0_ns + np.rint(t[rows] * 1e9).astype(np.int64)
        frames = Frames(
            number=np.arange(len(rows)),
            true_t_ns=t_ns,
            t_ns=t_ns,
            release_t_ns=t_ns,
            delivered=np.ones(len(rows), np.bool_),
        )
        counts = Tracker(view, sparse, world.trajectory).visible_counts(frames)
        visible[rows] = counts > 0
    rows = np.flatnonzero(~visible)
    if has_surfaces(described) and len(rows):
        visible[rows] = _meets_surfaces(view, world, t[rows])
    if isinstance(described, AprilgridParameters) and not visible.any():
        return ~visible  # the warning about its tags says what to do
    return visible


def _meets_surfaces(view: View, world: World, t: Array) -> Mask:
    """Return at which times (n,) [s] one of a grid of pixels has a surface."""
    u = np.linspace(0.0, view.model.width - 1.0, _GRID)
    v = np.linspace(0.0, view.model.height - 1.0, _GRID)
    ray = view.model.unproject(np.stack(np.meshgrid(u, v), axis=-1).reshape(-1, 2))
    direction, poses = ray.direction[ray.valid], view.poses(world.trajectory, t)
    count = len(direction)
    traced = world.scene.tracer().trace(
        t.repeat(count),
        poses.position.repeat(count, axis=0),
        rotation.rotate(poses.q_wc[:, None], direction).reshape(-1, 3),
    )
    hits: Mask = traced.surface.reshape(len(t), count) >= 0
    rows: Mask = np.any(hits, axis=1)
    return rows


def notes(mounted: Mounted[CameraParameters]) -> list[str]:
    """Return which axes the body has, for a camera whose device has others."""
    p = mounted.parameters
    if p.rig_mounting == IDENTITY_MATRIX:
        return []
    if p.body_axes == "flu":
        return [f"{mounted.name}: the body is forward, left, up (camera.body_axes flu)"]
    return [f"{mounted.name}: the body has the axes of {p.preset} (camera.body_axes preset)"]
