# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""What the preset of an IMU stands for: its file, and the files that this one names."""

from collections.abc import Mapping
from pathlib import Path
from typing import Final

from imu_sim_ros.errors import ConfigurationError, InputError
from imu_sim_ros.parameters.files import find, load

BAROMETER_PRESET: Final = "imu.barometer_preset"


_OF_MODELS: Final = (".sdf", ".world", ".urdf", ".xacro", ".xml", ".jinja")


def is_model(path: str) -> bool:
    """Return whether a file is a model of Gazebo, by its name; ``FILE#SENSOR`` is one, too."""
    return Path(path.partition("#")[0]).suffix.lower() in _OF_MODELS


def sensor_layer(name_or_file: str, node: str = "simulator") -> dict[str, object]:
    """Return what ``imu.preset`` stands for, above the presets that its file names in turn.

    For a model of Gazebo it contains ``imu.preset`` with the name of the sensor that was taken.

    :param name_or_file: a name in config/imus, a parameter file, or a model of Gazebo,
        ``model.sdf`` or ``model.sdf#SENSOR``.
    :raises ConfigurationError: for a preset that cannot be read, or that leads back to itself.
    """
    if is_model(name_or_file):
        from imu_sim_ros.sensors.imu import sdf  # few sensors come from a model

        try:
            return dict(sdf.read(name_or_file).parameters)
        except InputError as error:
            raise ConfigurationError(error.problems) from None
    result: dict[str, object] = {}
    passed: list[Path] = []
    while True:
        path = find("imus", name_or_file)
        if path.resolve() in passed:
            raise ConfigurationError(f"{path}: imu.preset = {name_or_file} leads back to this file")
        passed.append(path.resolve())
        values = load(path, node)
        below = values.pop("imu.preset", None)
        result = {**values, **result}
        if below is None:
            return {**barometer_layer(result, node), **result}
        name_or_file = str(below)


def barometer_layer(given: Mapping[str, object], node: str) -> dict[str, object]:
    """Return what ``imu.barometer_preset`` stands for; nothing if it names no file."""
    preset = given.get(BAROMETER_PRESET)
    return load(find("barometers", str(preset)), node) if preset else {}
