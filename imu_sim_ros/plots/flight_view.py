# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""A flight in rerun's viewer: paths, readings, biases, images, scans on one time line."""

import os
import shutil
import sys
import sysconfig
from collections.abc import Iterable
from pathlib import Path
from types import ModuleType
from typing import Any, Final

import numpy as np

from imu_sim_ros.core.blocks import ceil_divide
from imu_sim_ros.core.conventions import AXIS_COLOURS, SERIES_COLOURS, WORLD_FRAME
from imu_sim_ros.core.errors import MissingDependencyError
from imu_sim_ros.core.records import States
from imu_sim_ros.core.types import AnyArray, Array, Times


def _rgb(colour: str) -> tuple[int, int, int]:
    """Return red, green and blue, 0 to 255, of a colour such as ``#1A1A1A``."""
    red, green, blue = bytes.fromhex(colour[1:])
    return red, green, blue


_TIME: Final = "stamp"
_COLOURS: Final = ((120, 120, 120), *map(_rgb, SERIES_COLOURS))
"""Colours of the truth, grey on any background, then of each estimate."""
_AXES: Final = tuple(map(_rgb, AXIS_COLOURS.values()))
_RADIUS: Final = 0.01
"""Radius of the line of a path [m]."""
_BRIGHTER: Final = 0.5
"""Exponent of intensities, so that dark surfaces differ, too."""
_MAX_POINTS: Final = 20_000
"""Largest number of points in the line of a path; the moving body has all poses."""


_OTHERWISE: Final = "--save FILE writes what rerun opens elsewhere"


def rerun() -> ModuleType:
    """Return the library rerun.

    :raises MissingDependencyError: if it is not installed.
    """
    try:
        import rerun
    except ImportError as error:
        raise MissingDependencyError(f"view needs rerun ({error}): pip install rerun-sdk") from None
    return rerun


class FlightView:
    """A recording of rerun that is filled part by part."""

    def __init__(self, title: str) -> None:
        """Initialise without data.

        :param title: name of the recording.
        :raises MissingDependencyError: without rerun.
        """
        self._rr = rerun()
        self._recording = self._rr.RecordingStream("imu_sim_ros", recording_id=None)
        self._recording.send_recording_name(title)
        self._recording.log(WORLD_FRAME, self._rr.ViewCoordinates.RIGHT_HAND_Z_UP, static=True)
        self._paths = 0

    def save(self, path: Path) -> None:
        """Send everything from now on into a file; call it first."""
        self._recording.save(str(path))

    def spawn(self) -> None:
        """Start the viewer and send everything from now on to it; call it first.

        :raises MissingDependencyError: if there is no viewer, or no screen for it.
        """
        screens = ("DISPLAY", "WAYLAND_DISPLAY")
        if sys.platform == "linux" and not any(os.environ.get(name) for name in screens):
            raise MissingDependencyError(f"there is no screen for rerun's viewer; {_OTHERWISE}")
        # Next to this Python, which a program of a virtual environment need not have in PATH.
        folders = (sysconfig.get_path("scripts"), os.environ.get("PATH", os.defpath))
        viewer = shutil.which("rerun", path=os.pathsep.join(folders))
        try:
            self._rr.spawn(executable_path=viewer, recording=self._recording)
        except RuntimeError as error:
            raise MissingDependencyError(f"rerun: {error}; {_OTHERWISE}") from None

    def flush(self) -> None:
        """Wait until everything has arrived.

        :raises MissingDependencyError: if the viewer has gone.
        """
        try:
            self._recording.flush()
        except RuntimeError as error:
            raise MissingDependencyError(f"rerun: {error}; {_OTHERWISE}") from None
        self._recording.disconnect()

    def path(self, name: str, poses: States) -> None:
        """Add a path: its line, and a body that moves along it."""
        rr, colour = self._rr, _COLOURS[self._paths % len(_COLOURS)]
        self._paths += 1
        stride = max(1, ceil_divide(len(poses.t_ns), _MAX_POINTS))
        line = rr.LineStrips3D([poses.position[::stride]], colors=[colour], radii=[_RADIUS])
        self._recording.log(f"{WORLD_FRAME}/{name}/path", line, static=True)
        self._columns(
            f"{WORLD_FRAME}/{name}/body",
            poses.t_ns,
            rr.Transform3D.columns(
                translation=poses.position, quaternion=np.roll(poses.q_wb, -1, axis=1)
            ),
        )
        axes = rr.Arrows3D(vectors=np.eye(3) * 0.5, colors=_AXES)
        self._recording.log(f"{WORLD_FRAME}/{name}/body/axes", axes, static=True)

    def points(self, name: str, positions: Array) -> None:
        """Add landmarks (n, 3) [m]."""
        cloud = self._rr.Points3D(positions, radii=[2.0 * _RADIUS])
        self._recording.log(f"{WORLD_FRAME}/{name}", cloud, static=True)

    def series(self, name: str, t_ns: Times, values: Array) -> None:
        """Add values (n, 3) over time, a curve for each axis."""
        lines = self._rr.SeriesLines(names=list("xyz"), colors=_AXES)
        self._recording.log(name, lines, static=True)
        scalars = self._rr.Scalars.columns(scalars=values)
        self._columns(name, t_ns, scalars)

    def images(self, name: str, frames: Iterable[tuple[int, AnyArray]]) -> None:
        """Add the images (h, w) or (h, w, 3) of a camera."""
        for t_ns, image in frames:
            self._recording.set_time(_TIME, timestamp=np.datetime64(t_ns, "ns"))
            kind = self._rr.DepthImage if image.dtype == np.float32 else self._rr.Image
            self._recording.log(name, kind(image))

    def clouds(
        self,
        name: str,
        scans: Iterable[tuple[int, AnyArray]],
        frame: tuple[str, Array] | None = None,
    ) -> None:
        """Add the scans of a sensor; structured arrays with x, y, z [m], grey by their intensity.

        :param frame: below which part of the world they are, such as ``truth/body/NAME``, and the
            pose (4, 4) of their frame in it; None: they are in a space of their own.
        """
        rr = self._rr
        if frame is not None:
            parent, pose = frame
            frame_transform = rr.Transform3D(translation=pose[:3, 3], mat3x3=pose[:3, :3])
            self._recording.log(f"{WORLD_FRAME}/{parent}", frame_transform, static=True)
            name = f"{WORLD_FRAME}/{parent}/{name}"
        for t_ns, points in scans:
            self._recording.set_time(_TIME, timestamp=np.datetime64(t_ns, "ns"))
            positions = np.stack([points[axis] for axis in "xyz"], axis=1)
            colours = None
            if "intensity" in (points.dtype.names or ()):
                grey = np.clip(2.55 * np.nan_to_num(points["intensity"]), 0.0, 255.0) ** _BRIGHTER
                grey = (grey * 255.0 ** (1.0 - _BRIGHTER)).astype(np.uint8)
                colours = np.repeat(grey[:, None], 3, axis=1)
            self._recording.log(name, rr.Points3D(positions, colors=colours, radii=[_RADIUS]))

    def _columns(self, name: str, t_ns: Times, columns: Any) -> None:
        """Send values with stamps to the viewer."""
        stamps = self._rr.TimeColumn(_TIME, timestamp=t_ns.astype("datetime64[ns]"))
        self._recording.send_columns(name, indexes=[stamps], columns=columns)
