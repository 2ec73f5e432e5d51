# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""A camera as a sensor: its frames in a window of time, and what each shows.

A frame depends on nothing but the seed and its number, and is made when somebody asks for it.
"""

from collections.abc import Callable, Mapping
from functools import cached_property
from typing import TYPE_CHECKING, Any

import numpy as np

from imu_sim_ros.parameters.kinds import IDENTITY_MATRIX
from imu_sim_ros.rotation import pose_matrix
from imu_sim_ros.sensors.camera.mesh_scene import mesh_warnings
from imu_sim_ros.sensors.camera.parameters import CameraParameters
from imu_sim_ros.sensors.camera.scene_parameters import body_names
from imu_sim_ros.sensors.camera.target import target_warning
from imu_sim_ros.sensors.camera.tracker import Tracker
from imu_sim_ros.sensors.camera.view import Frames, View, view_of
from imu_sim_ros.sensors.declaration import Model, Mounted
from imu_sim_ros.sensors.deferred import Deferred, Each
from imu_sim_ros.sensors.model import FixedModel
from imu_sim_ros.sensors.samples import Samples
from imu_sim_ros.sensors.timing import SampleTimes
from imu_sim_ros.sensors.world import Window, World
from imu_sim_ros.types import Array

if TYPE_CHECKING:
    from imu_sim_ros.sensors.camera.images.imager import Imager


class Camera(FixedModel):
    """The frames of a camera; any window may be read at any time."""

    def __init__(self, mounted: Mounted, t0_ns: int, _: Mapping[str, Model]) -> None:
        self.mounted = mounted
        self.times = SampleTimes(mounted.own.rate, t0_ns, mounted.own.phase)
        self._world: World | None = None

    def read(self, window: Window, world: World) -> Samples:
        """Return the frames in a window."""
        return self.samples(self.frames(window, world))

    def frames(self, window: Window, world: World) -> Frames:
        """Return times and numbers of the frames in a window."""
        first, end = self.times.index(window.begin), self.times.index(window.end)
        return self.within(world).view.frames(first, end - first)

    def within(self, world: World) -> "Camera":
        """Put it in a world."""
        self._world = world
        return self

    def samples(self, frames: Frames) -> Samples:
        """Return frames with all that they show."""
        first, count = int(frames.number[0]) if len(frames.number) else 0, len(frames.number)
        p, moving = self.view.parameters, bool(body_names(self.mounted.environment.rig.scene))

        def each(name: str, kept: bool = False) -> Callable[[], Each[Any]]:
            def made() -> Each[Any]:
                make, threads = getattr(self.imager, name), self.world.threads
                return Each(make, frames.number.tolist(), threads, kept)

            return made

        values = Deferred(
            tracks=lambda: self.tracker.tracks(first, count),
            lines=lambda: self.tracker.lines(first, count),
            image=each("image", kept=p.images == "both"),
            depth_and_mask=each("depth_and_mask", kept=moving),
            flow=each("flow"),
            exposure=each("exposure"),
        )
        times = frames.true_t_ns, frames.t_ns, frames.release_t_ns
        return Samples(*times, np.flatnonzero(frames.delivered), values, first)

    @property
    def world(self) -> World:
        """The world that it is in."""
        assert self._world is not None, "it is put in one first"
        return self._world

    @cached_property
    def view(self) -> View:
        """When it takes frames, and where it is then."""
        return view_of(self.mounted, self.world)

    @cached_property
    def tracker(self) -> Tracker:
        """Which landmarks it sees."""
        return Tracker(self.view, self.world.scene, self.world.trajectory)

    @cached_property
    def imager(self) -> "Imager":
        """Its images.

        :raises ConfigurationError: for a scene without surfaces.
        :raises MissingDependencyError: if OpenCV or numba is not installed.
        """
        from imu_sim_ros.sensors.camera.images.imager import Imager, textures  # needs numba
        from imu_sim_ros.sensors.camera.images.libraries import opencv

        world, colour = self.world, self.view.parameters.encoding == "rgb8"
        if world.threads is not None:
            opencv().setNumThreads(1)  # the threads are ours
        scene, described = world.scene, self.mounted.environment.rig.scene
        look = world.shared(f"textures {colour}", lambda: textures(scene, described, colour))
        return Imager(self.view, scene, look, world.trajectory)


def mount(p: CameraParameters) -> Array:
    """Return the pose T_bc (4, 4) of a camera."""
    return pose_matrix(*p.pose())


def warnings(mounted: Mounted, world: World, _: float) -> list[str]:
    """Return a line for whatever keeps a camera from seeing what it was put before."""
    view, rig = view_of(mounted, world), mounted.environment.rig
    lines = [
        *target_warning(rig.scene, view, world.trajectory),
        *mesh_warnings(world.scene, view, world.trajectory, mounted.name == rig.cameras[0]),
    ]
    return [f"{mounted.name}: {line}" for line in lines]


def notes(mounted: Mounted) -> list[str]:
    """Return which axes the body has, for a camera whose device has others."""
    p: CameraParameters = mounted.own
    if p.rig_mounting == IDENTITY_MATRIX:
        return []
    if p.body_axes == "flu":
        return [f"{mounted.name}: the body is forward, left, up (camera.body_axes flu)"]
    return [f"{mounted.name}: the body has the axes of {p.preset} (camera.body_axes preset)"]
