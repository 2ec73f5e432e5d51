# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Parameters of all cameras on the body, and of what they see.

``cameras`` names them; ``camera.*`` holds for all, ``NAME.camera.*`` for one; below both lies the
file that a camera's ``preset`` names, and below the scene's parameters the file of ``scene.type``.
"""

import dataclasses
from collections.abc import Iterator, Mapping
from contextlib import suppress
from dataclasses import dataclass
from typing import Any, Final

from imu_sim_ros.errors import ConfigurationError
from imu_sim_ros.names import unknown
from imu_sim_ros.parameters import files
from imu_sim_ros.parameters.kinds import choice, entries, texts
from imu_sim_ros.parameters.sections import build, section, section_names, variant
from imu_sim_ros.places.mesh_file import is_mesh
from imu_sim_ros.sensors.camera.parameters import CameraParameters
from imu_sim_ros.sensors.camera.scene_parameters import (
    TYPES,
    SceneParameters,
    find_scene,
    known_scenes,
)
from imu_sim_ros.sensors.environment import EnvironmentParameters
from imu_sim_ros.sensors.registry import sees, sensor_kinds
from imu_sim_ros.timebase import exact_rate

DEFAULT_CAMERA: Final = "vio_data_simulation"
DEFAULT_SCENE: Final = "room"
LAYOUTS: Final = ("mono", "fusion", "none")
_OF_ALL: Final = ("camera", "scene", "features")
_TAKEN: Final = {*_OF_ALL, "cameras", "imus", "imu", "trajectory", "publish", "inject"}


@dataclass(frozen=True)
class OneCameraParameters:
    """What a camera has of its own."""

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
class RigParameters:
    """All cameras of a body; each has a section of its own name."""

    cameras: tuple[str, ...] = texts(
        (),
        "names of the cameras on the body, each the namespace of its topics and the prefix of its "
        "own parameters (cam0.camera.rate, ...); none: no camera",
    )
    scene: SceneParameters = variant("type", DEFAULT_SCENE, find_scene, TYPES)

    features: FeatureParameters = section(FeatureParameters)

    def frame(self, name: str) -> str:
        """Return the frame of a camera's messages."""
        return self.camera(name).frame or f"{name}_optical_frame"

    def camera(self, name: str) -> CameraParameters:
        """Return the parameters of one camera."""
        own: OneCameraParameters = getattr(self, name)
        return own.camera

    def each(self) -> dict[str, CameraParameters]:
        """Return the parameters of all cameras by name, in order."""
        return {name: self.camera(name) for name in self.cameras}


def is_rig_key(key: str, names: list[str]) -> bool:
    """Return whether a parameter is about cameras or the scene, given the cameras' names."""
    first, dot, rest = key.partition(".")
    if key == "cameras" or (dot and first in _OF_ALL):
        return True
    return bool(dot) and first in names and rest.startswith("camera.")


def camera_names(given: Mapping[str, object]) -> list[str]:
    """Return the names in ``cameras``.

    :raises ConfigurationError: for names that cannot be used.
    """
    value = given.get("cameras", ())
    with suppress(ValueError):  # what is not a list is reported below
        value = entries(value)
    if not isinstance(value, list | tuple):
        raise ConfigurationError(f"cameras = {value!r}: must be a list of names")
    return section_names("cameras", value, _TAKEN)


def split_rig(
    given: Mapping[str, object],
) -> tuple[dict[str, object], dict[str, object]]:
    """Return what is about cameras and their scene, and all else.

    A scene that other sensors see, too, is in both.
    """
    names, others_see = camera_names(given), sees(sensor_kinds(given).values())
    rig, others = {}, {}
    for key, value in given.items():
        of_scene = key.startswith("scene.") and others_see
        if is_rig_key(key, names) and (names or not of_scene):
            rig[key] = value
        if not is_rig_key(key, names) or of_scene:
            others[key] = value
    return rig, others


def rig_section(names: list[str]) -> type[RigParameters]:
    """Return the section that holds the parameters of all cameras named."""
    fields: list[Any] = [
        (name, OneCameraParameters, section(OneCameraParameters)) for name in names
    ]
    return dataclasses.make_dataclass("RigParameters", fields, bases=(RigParameters,), frozen=True)


def layer_rig(given: Mapping[str, object], node: str = "simulator") -> dict[str, object]:
    """Return what was given above the presets and the scene's file that it names."""
    names = camera_names(given)
    common = {key: value for key, value in given.items() if key.startswith("camera.")}
    if not names:
        stray = [
            f"{key}: there is no camera; name them in cameras" for key in given if key != "cameras"
        ]
        if stray:
            raise ConfigurationError(stray)
        return {}
    result: dict[str, object] = {"cameras": tuple(names)}
    result.update(layered_scene(given, node))
    result.update({k: v for k, v in given.items() if k.startswith("features.")})
    for name in names:
        own = {k.removeprefix(f"{name}."): v for k, v in given.items() if k.startswith(f"{name}.")}
        merged: dict[str, object] = {"camera.preset": DEFAULT_CAMERA, **common, **own}
        preset = files.load(files.find("cameras", str(merged["camera.preset"])), node)
        result.update({f"{name}.{key}": value for key, value in {**preset, **merged}.items()})
    return result


def layered_scene(given: Mapping[str, object], node: str) -> dict[str, object]:
    """Return the parameters of the scene above the file that ``scene.type`` names."""
    scene = {key: value for key, value in given.items() if key.startswith("scene.")}
    kind = str(scene.get("scene.type", DEFAULT_SCENE))
    if kind in files.names("scenes"):
        scene.pop("scene.type", None)
        return {**files.load(files.find("scenes", kind), node), **scene}
    return scene


def load_rig(given: Mapping[str, object], node: str = "simulator") -> RigParameters:
    """Return the cameras and the scene that parameters describe.

    :param given: ``cameras``, ``camera.*``, ``scene.*`` and ``NAME.camera.*`` by dotted name.
    :raises ConfigurationError: with a line for each problem.
    """
    names = camera_names(given)
    return build(rig_section(names), layer_rig(given, node))


def rig_problems(rig: RigParameters, simulation: EnvironmentParameters) -> Iterator[str]:
    """Yield a line for each camera that does not fit the IMU, or is another one again."""
    of_values: dict[CameraParameters, str] = {}
    for name, camera in rig.each().items():
        # The file that a camera came from, and the frame of its messages, make no other camera.
        first = of_values.setdefault(dataclasses.replace(camera, preset="", frame=""), name)
        if first != name:
            yield (
                f"{name}.camera: is {first} again, with the same lens at the same place; give it "
                f"another {name}.camera.preset or {name}.camera.lever_arm"
            )
    for name, camera in rig.each().items():
        ratio = exact_rate(simulation.rate) / exact_rate(camera.rate)
        if camera.trigger == "synchronised" and ratio.denominator != 1:
            yield (
                f"{name}.camera.rate = {camera.rate:g}: must divide the IMU's rate, "
                f"{simulation.rate:g} Hz, where {name}.camera.trigger is synchronised"
            )


def scene_layer(name_or_file: str, node: str = "simulator") -> dict[str, object]:
    """Return what ``--scene`` stands for: a name in config/scenes, a kind, or a file.

    :raises ConfigurationError: for a name that is none of them.
    """
    if name_or_file in files.names("scenes"):
        return {"scene.type": name_or_file}
    if "/" not in name_or_file and "." not in name_or_file:
        if name_or_file not in TYPES:
            raise ConfigurationError(unknown("scene", name_or_file, known_scenes()))
        return {"scene.type": name_or_file}
    path = files.find("scenes", name_or_file)
    if path.suffix.lower() in (".yaml", ".yml"):
        return files.load(path, node)
    if is_mesh(path):
        return {"scene.type": "mesh", "scene.mesh": str(path)}
    return {"scene.type": "file", "scene.file": str(path)}
