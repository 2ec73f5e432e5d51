# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""What the preset of an IMU stands for: its file, and the files that this one names."""

from collections.abc import Mapping
from pathlib import Path
from typing import Final

from imu_sim_ros.errors import ConfigurationError, InputError
from imu_sim_ros.parameters.files import find, load

DEFAULT_IMU: Final = "lecture"
_BAROMETER: Final = "imu.barometer_preset"
_OF_MODELS: Final = (".sdf", ".world", ".urdf", ".xacro", ".xml", ".jinja")
"""Ends of the names of Gazebo's models; ``FILE#SENSOR`` is one, too."""


def sensor_layer(name_or_file: str, node: str = "simulator") -> dict[str, object]:
    """Return what ``imu.preset`` stands for, above the presets that its file names in turn.

    For a model of Gazebo it contains ``imu.preset`` with the name of the sensor that was taken.

    :param name_or_file: a name in config/imus, a parameter file, or a model of Gazebo,
        ``model.sdf`` or ``model.sdf#SENSOR``.
    :raises ConfigurationError: for a preset that cannot be read, or that leads back to itself.
    """
    if Path(name_or_file.partition("#")[0]).suffix.lower() in _OF_MODELS:
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
            return result
        name_or_file = str(below)


def layer_imu(given: Mapping[str, object], node: str) -> dict[str, object]:
    """Return what was given above the preset of an IMU, and above that of its barometer.

    :param given: parameters of all kinds, as a preset may have, by dotted name.
    :raises ConfigurationError: for a preset that cannot be read.
    """
    above = {"imu.preset": DEFAULT_IMU, **given}
    preset = sensor_layer(str(above["imu.preset"]), node)
    above["imu.preset"] = preset.pop("imu.preset", above["imu.preset"])
    barometer = {**preset, **given}.get(_BAROMETER)
    file = load(find("barometers", str(barometer)), node) if barometer else {}
    # A barometer that the IMU's preset names may be changed there; another one is what it is.
    own = {**preset, **file} if _BAROMETER in given else {**file, **preset}
    return {**own, **above}
