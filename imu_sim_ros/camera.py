# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Cameras on a simulated flight in one call: pixels, tracks, images."""

import dataclasses
import itertools
from collections.abc import Callable, Iterator, Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Final, Protocol, TypeVar

from numpy.typing import ArrayLike

from imu_sim_ros.core import arguments
from imu_sim_ros.core.errors import ConfigurationError
from imu_sim_ros.core.types import Bytes, Single
from imu_sim_ros.sensors.camera.declaration import cameras_in
from imu_sim_ros.sensors.camera.frames import Camera
from imu_sim_ros.sensors.camera.model import Projection
from imu_sim_ros.sensors.camera.model import reprojection_errors as reprojection_errors
from imu_sim_ros.sensors.camera.rig_parameters import (
    axes,
    load_rig,
    rig_parameters_of,
    rig_problems,
    scene_layer,
)
from imu_sim_ros.sensors.camera.tracker import Tracker, Tracks
from imu_sim_ros.sensors.declaration import Mounted
from imu_sim_ros.sensors.parameters import MountedParameters
from imu_sim_ros.sensors.world import World
from imu_sim_ros.simulation.cameras import scene_around
from imu_sim_ros.simulation.engine import Body
from imu_sim_ros.simulation.parameters import SimulationParameters, load_simulation
from imu_sim_ros.simulation.sensors import mount_sensors
from imu_sim_ros.trajectory.motion import Trajectory
from imu_sim_ros.trajectory.parameters import PosesParameters

if TYPE_CHECKING:
    from imu_sim_ros.sensors.camera.images.imager import Imager

_Pixels = TypeVar("_Pixels", Bytes, Single)

BLOCK: Final = 64
"""Frames generated at once."""
_NAME = "cam0"


class Rig:
    """The cameras of one simulation, as its body has them, and the scene that they see."""

    def __init__(self, sensors: Mapping[str, Mounted[MountedParameters]], world: World) -> None:
        """Set up cameras and scene.

        :param sensors: sensors of the body.
        :raises ConfigurationError: for a scene that does not fit the path.
        :raises InputError: for a file of points that cannot be used.
        """
        self.cameras, self.world = cameras_in(sensors), world
        self.parameters = rig_parameters_of(next(iter(self.cameras.values())).environment)
        self.trajectory, self.scene = world.trajectory, world.scene
        self._models = {
            name: Camera(mounted_camera, world.t0_ns, {}).within(world)
            for name, mounted_camera in self.cameras.items()
        }
        self.views = {name: model.view for name, model in self._models.items()}

    def tracker(self, name: str) -> Tracker:
        """Return the tracker of one camera."""
        return self._models[name].tracker

    def tracks(self, name: str, block: int = BLOCK) -> Iterator[Tracks]:
        """Yield the tracks of all frames of a camera, in blocks of frames.

        :raises ConfigurationError: for a size that is none, before the first block.
        """
        return self._tracks(name, arguments.block_size("block", block))

    def _tracks(self, name: str, block: int) -> Iterator[Tracks]:
        """Yield the tracks of a camera in blocks of frames."""
        tracker = self.tracker(name)
        total = self.views[name].total
        begin = 0
        while total is None or begin < total:
            size = block if total is None else min(block, total - begin)
            yield tracker.tracks(begin, size)
            begin += size

    def images(self, name: str) -> Iterator[tuple[int, Bytes]]:
        """Yield the stamp [ns] and the image (h, w), or (h, w, 3), of all frames of a camera.

        Frames that are lost are left out.

        :raises ConfigurationError: for a scene without surfaces.
        :raises MissingDependencyError: if OpenCV or numba is not installed.
        """
        return self._frames(name, lambda imager: imager.image)

    def depths(self, name: str) -> Iterator[tuple[int, Single]]:
        """Yield the stamp [ns] and the true depth (h, w) [m] of all frames of a camera.

        0 if nothing is seen; frames that are lost are left out.

        :raises ConfigurationError: for a scene without surfaces.
        :raises MissingDependencyError: if OpenCV or numba is not installed.
        """
        return self._frames(name, lambda imager: imager.depth)

    def flows(self, name: str) -> Iterator[tuple[int, Single]]:
        """Yield the stamp [ns] and the optical flow (h, w, 2) [px] of all frames of a camera.

        The steps in u and v to the next frame; NaN if there is none, and for what is outside of
        the next image or hidden there. Frames that are lost are left out.

        :raises ConfigurationError: for a scene without surfaces.
        :raises MissingDependencyError: if OpenCV or numba is not installed.
        """
        return self._frames(name, lambda imager: imager.flow)

    def _frames(
        self, name: str, renderer: "Callable[[Imager], Callable[[int], _Pixels]]"
    ) -> Iterator[tuple[int, _Pixels]]:
        """Yield the stamp [ns] and the pixels of the delivered frames of a camera.

        :param renderer: returns the function that renders the pixels of a frame by its number.
        """
        view, render = self.views[name], renderer(self._models[name].imager)
        numbers = itertools.count() if view.total is None else range(view.total)
        for number in numbers:
            frames = view.frames(number, 1)
            if frames.delivered[0]:
                yield int(frames.t_ns[0]), render(number)


def build_rig(parameters: Mapping[str, object]) -> Rig:
    """Return the cameras that parameters by dotted name describe, on their trajectory.

    The frames are those of ``generate`` with the same parameters.

    :param parameters: for instance ``{"cameras": ["cam0"], "camera.preset": "euroc_cam0",
        "trajectory.type": "figure_eight", "duration": 10.0, "seed": 1}``.
    :raises ConfigurationError: with a line for each problem.
    :raises InputError: for a file that cannot be used.
    """
    body = Body(load_simulation(parameters))
    return rig_of(body.parameters, body.trajectory, body.t0_ns)


class Simulated(Protocol):
    """Simulation of a body, as its cameras need it."""

    @property
    def parameters(self) -> SimulationParameters:
        """All parameters."""

    @property
    def trajectory(self) -> Trajectory:
        """The body's motion."""

    @property
    def t0_ns(self) -> int:
        """True time of sample 0 [ns]."""


def build_simulation_rig(layers: Mapping[str, object], simulation: Simulated) -> Rig:
    """Return the cameras that parameters by dotted name describe, on a simulation's body.

    :raises ConfigurationError: with a line for each problem.
    :raises InputError: for a file that cannot be used.
    """
    recorded = isinstance(simulation.parameters.trajectory, PosesParameters)
    rig = load_rig({**layers, **axes(layers, recorded)})
    problems = list(rig_problems(rig, simulation.parameters))
    if problems:
        raise ConfigurationError(problems)
    parameters = dataclasses.replace(simulation.parameters, cameras=rig.cameras, rig=rig)
    return rig_of(parameters, simulation.trajectory, simulation.t0_ns)


def rig_of(parameters: SimulationParameters, trajectory: Trajectory, t0_ns: int) -> Rig:
    """Return the cameras of a simulation, with their scene.

    :raises ConfigurationError: for a scene that does not fit the path.
    :raises InputError: for a file that cannot be used.
    """
    return Rig(mount_sensors(parameters), World(trajectory, parameters, t0_ns, scene_around))


def project(
    points: ArrayLike, camera: str | Path | Mapping[str, object] = "euroc_cam0"
) -> Projection:
    """Return the pixels of points, without noise: ``uv`` (n, 2) [px] and ``valid`` (n,).

    :param points: (n, 3) in the camera's frame, z along the view [m].
    :param camera: a name in config/cameras, a camera file, or the ``camera.*`` parameters.
    :returns: the pixels, and which of the points the camera sees.
    :raises ConfigurationError: with a line for each problem.

    >>> import imu_sim_ros as ims
    >>> ims.camera.project([[0.0, 0.0, 1.0]], camera={"preset": "euroc_cam0"}).uv.round(3)
    array([[367.215, 248.375]])
    """
    checked_points = arguments.array("points", points, (None, 3))
    rig = build_rig({**_camera(camera), "trajectory.type": "static", "duration": 1.0})
    return rig.views[_NAME].model.project(checked_points)


def tracks(
    flight: Simulated,
    camera: str | Path | Mapping[str, object] = "euroc_cam0",
    scene: str | Path = "auto",
    block: int = BLOCK,
) -> Iterator[Tracks]:
    """Yield the tracks of a camera on the flight's body, in blocks of frames.

    A block has arrays over its features: ``id``, ``uv`` and ``uv_true`` (n, 2) [px], ``depth`` [m],
    ``frame``, the row of each in ``frames``, which holds numbers and times. The tracks are those of
    ``generate`` with the same parameters and seed, whatever the size of the blocks.

    :param flight: what :func:`imu_sim_ros.simulate` returns.
    :param camera: a name in config/cameras, a camera file, or the ``camera.*`` parameters:
        ``{"preset": "euroc_cam0", "pixel_noise": 0.5}``.
    :param scene: a name in config/scenes, a parameter file, or a file of points or a mesh.
    :param block: frames in a block.
    :returns: an iterator over blocks of features.
    :raises ConfigurationError: with a line for each problem.
    :raises InputError: for a file that cannot be used.

    >>> import imu_sim_ros as ims
    >>> flight = ims.simulate(imu="adis16448", trajectory="figure_eight", duration=2, seed=1)
    >>> blocks = list(ims.camera.tracks(flight, camera="euroc_cam0", scene="room"))
    >>> blocks[0].uv.shape == (len(blocks[0].id), 2), sum(len(b.frames.t_ns) for b in blocks)
    (True, 40)
    """
    return _rig(flight, camera, scene).tracks(_NAME, block)


def frames(
    flight: Simulated,
    camera: str | Path | Mapping[str, object] = "euroc_cam0",
    scene: str | Path = "auto",
) -> Iterator[tuple[int, Bytes]]:
    """Yield the stamp [ns] and the image of each frame of a camera on the flight.

    Images are grey values (h, w), or red, green and blue (h, w, 3) with ``camera.encoding`` rgb8.
    They are those of ``generate`` with the same parameters and seed, without lost frames. Needs
    OpenCV and numba.

    :param flight: what :func:`imu_sim_ros.simulate` returns.
    :param camera: as in :func:`tracks`.
    :param scene: as in :func:`tracks`, with surfaces.
    :returns: an iterator over stamps [ns] and images.
    :raises ConfigurationError: with a line for each problem.
    :raises InputError: for a file that cannot be used.
    :raises MissingDependencyError: if OpenCV or numba is not installed.

    >>> import imu_sim_ros as ims
    >>> flight = ims.simulate(imu="perfect", trajectory="figure_eight", duration=0.1, seed=1)
    >>> t_ns, image = next(ims.camera.frames(flight, camera="euroc_cam0", scene="room"))
    >>> int(t_ns - flight.t_ns[0]), image.shape, image.dtype
    (0, (480, 752), dtype('uint8'))
    """
    return _rig(flight, camera, scene).images(_NAME)


def depths(
    flight: Simulated,
    camera: str | Path | Mapping[str, object] = "euroc_cam0",
    scene: str | Path = "auto",
) -> Iterator[tuple[int, Single]]:
    """Yield the stamp [ns] and the depth along the view (h, w) [m] of each frame of a camera.

    Depths have no errors and are those in the middle of the exposure; 0 means that the pixel sees
    nothing. Needs OpenCV and numba.

    :param flight: what :func:`imu_sim_ros.simulate` returns.
    :param camera: as in :func:`tracks`.
    :param scene: as in :func:`tracks`, with surfaces.
    :returns: an iterator over stamps [ns] and depths (h, w) [m].
    :raises ConfigurationError: with a line for each problem.
    :raises InputError: for a file that cannot be used.
    :raises MissingDependencyError: if OpenCV or numba is not installed.

    >>> import imu_sim_ros as ims
    >>> flight = ims.simulate(imu="perfect", trajectory="figure_eight", duration=0.1, seed=1)
    >>> t_ns, depth = next(ims.camera.depths(flight, camera="euroc_cam0", scene="room"))
    >>> depth.shape, bool(depth.max() > 1.0)
    ((480, 752), True)
    """
    return _rig(flight, camera, scene).depths(_NAME)


def flows(
    flight: Simulated,
    camera: str | Path | Mapping[str, object] = "euroc_cam0",
    scene: str | Path = "auto",
) -> Iterator[tuple[int, Single]]:
    """Yield the stamp [ns] and the optical flow (h, w, 2) [px] of each frame of a camera.

    The steps in u and v from each pixel's centre, in the middle of the exposure, to where what it
    sees is in the next frame, without errors; NaN for what is outside of that frame or hidden in
    it, and in the last frame. Needs OpenCV and numba.

    :param flight: what :func:`imu_sim_ros.simulate` returns.
    :param camera: as in :func:`tracks`.
    :param scene: as in :func:`tracks`, with surfaces.
    :returns: an iterator over stamps [ns] and flow (h, w, 2) [px].
    :raises ConfigurationError: with a line for each problem.
    :raises InputError: for a file that cannot be used.
    :raises MissingDependencyError: if OpenCV or numba is not installed.
    """
    return _rig(flight, camera, scene).flows(_NAME)


def _rig(flight: Simulated, camera: str | Path | Mapping[str, object], scene: str | Path) -> Rig:
    """Return the cameras of a flight with another camera and scene."""
    if not isinstance(getattr(flight, "parameters", None), SimulationParameters):
        arguments.refuse("flight", flight, "what simulate() returns", wrong_type=True)
    file = arguments.path("scene", scene, "a name or the path of a file")
    return build_simulation_rig({**_camera(camera), **scene_layer(str(file))}, flight)


def _camera(camera: str | Path | Mapping[str, object]) -> dict[str, object]:
    """Return the parameters of a camera given by name, file or parameters."""
    allowed = "a name, the path of a file, or parameters by name"
    if isinstance(camera, Mapping):
        camera_parameters = dict(camera)
    else:
        camera_parameters = {"preset": str(arguments.path("camera", camera, allowed))}
    if not all(isinstance(name, str) for name in camera_parameters):
        arguments.refuse("camera", camera, allowed, wrong_type=True)
    values = {
        name: v.tolist() if hasattr(v, "tolist") else v for name, v in camera_parameters.items()
    }
    return {"cameras": [_NAME], **{f"{_NAME}.camera.{name}": v for name, v in values.items()}}
