# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""All cameras of a body, and the scene that they see."""

import itertools
from collections.abc import Iterator, Mapping
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from imu_sim_ros import arguments
from imu_sim_ros.sensors.camera.declaration import cameras_in
from imu_sim_ros.sensors.camera.rig_parameters import RigParameters
from imu_sim_ros.sensors.camera.tracker import Tracker, Tracks
from imu_sim_ros.sensors.camera.view import view_of
from imu_sim_ros.sensors.declaration import Mounted
from imu_sim_ros.sensors.world import World
from imu_sim_ros.types import Bytes, Single

BLOCK: Final = 64
"""Frames generated at once."""


class Rig:
    """The cameras of one simulation."""

    def __init__(self, sensors: Mapping[str, Mounted], world: World) -> None:
        """Set up cameras and scene.

        :param sensors: of the body.
        :raises ConfigurationError: for a scene that does not fit the path.
        :raises InputError: for a file of points that cannot be used.
        """
        self.cameras, self.world = cameras_in(sensors), world
        self.parameters: RigParameters = next(iter(self.cameras.values())).environment.rig
        self.trajectory, self.scene = world.trajectory, world.scene
        self.views = {name: view_of(one, world) for name, one in self.cameras.items()}

    def tracker(self, name: str) -> Tracker:
        """Return the tracker of one camera."""
        return Tracker(self.views[name], self.scene, self.trajectory)

    def tracks(self, name: str, block: int = BLOCK) -> Iterator[Tracks]:
        """Yield the tracks of all frames of a camera, in blocks of frames.

        :raises ConfigurationError: for a size that is none, before the first block.
        """
        return self._tracks(name, arguments.block_size("block", block))

    def _tracks(self, name: str, block: int) -> Iterator[Tracks]:
        tracker = self.tracker(name)
        total = self.views[name].total
        first = 0
        while total is None or first < total:
            size = block if total is None else min(block, total - first)
            yield tracker.tracks(first, size)
            first += size

    def images(self, name: str) -> Iterator[tuple[int, Bytes]]:
        """Yield the stamp [ns] and the image (h, w), or (h, w, 3), of all frames of a camera.

        Frames that are lost are left out.

        :raises ConfigurationError: for a scene without surfaces.
        :raises MissingDependencyError: if OpenCV is not installed.
        """
        return self._frames(name, "image")

    def depths(self, name: str) -> Iterator[tuple[int, Single]]:
        """Yield the stamp [ns] and the true depth (h, w) [m] of all frames of a camera.

        0 if nothing is seen; frames that are lost are left out.

        :raises ConfigurationError: for a scene without surfaces.
        :raises MissingDependencyError: if OpenCV is not installed.
        """
        return self._frames(name, "depth")

    def flows(self, name: str) -> Iterator[tuple[int, Single]]:
        """Yield the stamp [ns] and the optical flow (h, w, 2) [px] of all frames of a camera.

        The steps in u and v to the next frame; NaN if there is none, and for what is outside of
        the next image or hidden there. Frames that are lost are left out.

        :raises ConfigurationError: for a scene without surfaces.
        :raises MissingDependencyError: if OpenCV is not installed.
        """
        return self._frames(name, "flow")

    def _frames(self, name: str, what: str) -> Iterator[tuple[int, NDArray[Any]]]:
        from imu_sim_ros.sensors.camera.images.imager import imagers  # they need OpenCV

        view = self.views[name]
        made = imagers({name: view}, self.scene, self.parameters.scene, self.trajectory)
        make = getattr(made[name], what)
        numbers = itertools.count() if view.total is None else range(view.total)
        for number in numbers:
            frames = view.frames(number, 1)
            if frames.delivered[0]:
                yield int(frames.t_ns[0]), make(number)


class Blindness:
    """Where a camera sees nothing: the time spans without any landmark."""

    def __init__(self, name: str) -> None:
        self.name = name
        self.spans: list[list[float]] = []
        self._open = False

    def look(self, tracks: Tracks, t0_ns: int) -> None:
        """Record a block of frames; blocks come in order."""
        counts = np.bincount(tracks.frame, minlength=len(tracks.frames.number))
        times = (tracks.frames.true_t_ns - t0_ns) * 1e-9
        for t, count, there in zip(times, counts, tracks.frames.delivered, strict=True):
            if count or not there:
                self._open = self._open and not count
            elif self._open:
                self.spans[-1][1] = float(t)
            else:
                self.spans.append([float(t), float(t)])
                self._open = True

    def warnings(self) -> list[str]:
        """Return a line for the spans without landmarks; nothing if there are none."""
        if not self.spans:
            return []
        shown = ", ".join(f"{a:.2f} to {b:.2f} s" for a, b in self.spans[:5])
        more = f" and {len(self.spans) - 5} more times" if len(self.spans) > 5 else ""
        return [f"{self.name}: no landmark in view from {shown}{more}"]
