# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Parameters of all cameras on the body, and of what they see.

``cameras`` names them; ``camera.*`` holds for all, ``NAME.camera.*`` for one; below both lies the
file that a camera's ``preset`` names, and below the scene's parameters the file of ``scene.type``.
"""

import dataclasses
import math
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from typing import Final, Protocol, runtime_checkable

from imu_sim_ros.core.errors import ConfigurationError, Problems
from imu_sim_ros.core.names import unknown_name_line
from imu_sim_ros.core.timebase import exact_rate
from imu_sim_ros.parameters import files
from imu_sim_ros.parameters.kinds import choice, texts
from imu_sim_ros.parameters.sections import names_in_parameter, section, sections_by_name, variant
from imu_sim_ros.places.mesh_file import is_mesh
from imu_sim_ros.sensors import CAMERAS
from imu_sim_ros.sensors.camera import calibration_files
from imu_sim_ros.sensors.camera.parameters import CameraParameters
from imu_sim_ros.sensors.camera.scene_parameters import (
    TYPES,
    SceneParameters,
    find_scene,
    list_scenes,
)
from imu_sim_ros.sensors.environment import EnvironmentParameters
from imu_sim_ros.sensors.parameters import MountedParameters

DEFAULT_CAMERA: Final = "vio_data_simulation"
DEFAULT_SCENE: Final = "auto"
LAYOUTS: Final = ("mono", "fusion", "none")
_AXES: Final = ("body_axes", "mounting")
_TAKEN: Final = ("camera", "imus", "imu", "trajectory", "publish", "inject")


@dataclass(frozen=True)
class OneCameraParameters:
    """Parameters of a single camera of the rig."""

    camera: CameraParameters = section(CameraParameters)


@dataclass(frozen=True)
class FeatureParameters:
    """The topic of tracked features, feature_tracker/feature."""

    layout: str = choice(
        "mono",
        LAYOUTS,
        "channels of feature_tracker/feature: mono: the five of VINS-Mono; fusion: the nine of "
        "VINS-Fusion; none: do not publish it",
    )


@dataclass(frozen=True)
class RigParameters(MountedParameters):
    """All cameras of a body; each has a section of its own name."""

    cameras: tuple[str, ...] = texts((), CAMERAS)
    scene: SceneParameters = variant("type", DEFAULT_SCENE, find_scene, TYPES)
    features: FeatureParameters = section(FeatureParameters)
    each_camera: Mapping[str, OneCameraParameters] = sections_by_name(
        "cameras", lambda *_: OneCameraParameters, _TAKEN
    )

    @staticmethod
    def elsewhere(name: str) -> str | None:
        """Return where a parameter belongs whose section does not exist."""
        no_camera = "there is no camera; name them in cameras"
        return no_camera if name.startswith("camera.") else None

    @property
    def longest_window(self) -> float:
        """Longest time that is read at once [s]."""
        return min(
            (camera.longest_window for camera in self.camera_parameters().values()),
            default=math.inf,
        )

    def frame(self, name: str) -> str:
        """Return the frame of a camera's messages."""
        return self.camera(name).frame or f"{name}_optical_frame"

    def camera(self, name: str) -> CameraParameters:
        """Return the parameters of one camera."""
        return self.each_camera[name].camera

    def camera_parameters(self) -> dict[str, CameraParameters]:
        """Return the parameters of all cameras by name, in order."""
        return {name: self.camera(name) for name in self.cameras}


@runtime_checkable
class _WithRig(Protocol):
    """Parameters of a simulation in which something sees."""

    rig: RigParameters


def rig_parameters_of(environment: EnvironmentParameters) -> RigParameters:
    """Return the cameras and the scene of a simulation in which something sees."""
    assert isinstance(environment, _WithRig)
    return environment.rig


def axes(parameters: Mapping[str, object], recorded: bool) -> dict[str, object]:
    """Return ``NAME.camera.body_axes`` of the cameras for which the trajectory decides them.

    :param parameters: explicit parameters, without any preset, with ``cameras`` and ``camera.*``.
    :param recorded: the trajectory is recorded poses: the body has the axes of their recording.
    """
    result: dict[str, object] = {}
    for name in names_in_parameter("cameras", parameters):
        settings = {
            key: parameters.get(f"{name}.camera.{key}", parameters.get(f"camera.{key}"))
            for key in _AXES
        }
        if settings["body_axes"] in (None, "trajectory"):
            has_mount = recorded or settings["mounting"] is not None
            result[f"{name}.camera.body_axes"] = "preset" if has_mount else "flu"
    return result


def layer_rig(parameters: Mapping[str, object], problems: Problems) -> dict[str, object]:
    """Return parameters layered on the presets of cameras and the scene's file.

    A camera takes ``camera.*`` from those of all, if it has none of its own.

    :param problems: receives a line for each preset that cannot be read.
    """
    names = names_in_parameter("cameras", parameters)
    of_all = {key: value for key, value in parameters.items() if key.startswith("camera.")}
    result = {key: value for key, value in parameters.items() if not (names and key in of_all)}
    for name in names:
        camera_settings = {
            k.removeprefix(f"{name}."): v for k, v in parameters.items() if k.startswith(f"{name}.")
        }
        merged: dict[str, object] = {"camera.preset": DEFAULT_CAMERA, **of_all, **camera_settings}
        with problems.collect():
            preset = calibration_files.load(str(merged["camera.preset"]))
            merged = {**preset, **merged}
        result.update({f"{name}.{key}": value for key, value in merged.items()})
    kind = str(result.get("scene.type", DEFAULT_SCENE))
    if kind in files.names("scenes"):
        result.pop("scene.type", None)
        return {**files.load(files.find("scenes", kind)), **result}
    return result


def select_rig_parameters(parameters: Mapping[str, object]) -> dict[str, object]:
    """Return the parameters that are about cameras and scene."""
    camera_prefixes = (f"{name}.camera." for name in names_in_parameter("cameras", parameters))
    prefixes = ("camera.", "scene.", "features.", *camera_prefixes)
    return {k: v for k, v in parameters.items() if k == "cameras" or k.startswith(prefixes)}


def load_rig(parameters: Mapping[str, object]) -> RigParameters:
    """Return the cameras and the scene that parameters describe.

    :param parameters: ``cameras``, ``camera.*``, ``scene.*`` and ``NAME.camera.*`` by dotted name.
    :raises ConfigurationError: with a line for each problem.
    """
    return files.build_from_layers(RigParameters, layer_rig, parameters)


def rig_problems(rig: RigParameters, simulation: EnvironmentParameters) -> Iterator[str]:
    """Yield a line for each camera that does not fit the IMU, or is the same as another one."""
    of_values: dict[CameraParameters, str] = {}
    for name, camera in rig.camera_parameters().items():
        # The file that a camera came from, and the frame of its messages, make no other camera.
        twin = of_values.setdefault(dataclasses.replace(camera, preset="", frame=""), name)
        if twin != name:
            yield (
                f"{name}.camera: is {twin} again, with the same lens and mount; give it "
                f"another {name}.camera.preset or {name}.camera.lever_arm"
            )
    for name, camera in rig.camera_parameters().items():
        ratio = exact_rate(simulation.rate) / exact_rate(camera.rate)
        if camera.trigger == "synchronised" and ratio.denominator != 1:
            yield (
                f"{name}.camera.rate = {camera.rate:g}: must divide the IMU's rate, "
                f"{simulation.rate:g} Hz, where {name}.camera.trigger is synchronised"
            )


def scene_layer(name_or_file: str) -> dict[str, object]:
    """Return the parameters of ``--scene``: a name in config/scenes, a kind, or a file.

    :raises ConfigurationError: for a name that is none of them.
    """
    if name_or_file in files.names("scenes"):
        return {"scene.type": name_or_file}
    if "/" not in name_or_file and "." not in name_or_file:
        if name_or_file not in TYPES:
            raise ConfigurationError(unknown_name_line("scene", name_or_file, list_scenes()))
        return {"scene.type": name_or_file}
    path = files.find("scenes", name_or_file)
    if path.suffix.lower() in (".yaml", ".yml"):
        return files.load(path)
    if is_mesh(path):
        return {"scene.type": "mesh", "scene.mesh": str(path)}
    return {"scene.type": "file", "scene.file": str(path)}
